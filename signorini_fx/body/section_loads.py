"""Shortened sections as loads: the forces that keep the displacement continuous, and the jump that the stress sees."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import default_scalar_type, fem

from signorini_fx import parallel
from signorini_fx.body.assembly import assemble
from signorini_fx.body.averages import from_owners
from signorini_fx.body.contact_boundary import ContactBoundary
from signorini_fx.body.loads import AppliedLoad
from signorini_fx.body.mixed import MixedPressure
from signorini_fx.body.section import Section, section_of, unit_jump
from signorini_fx.body.turned_supports import TurnedNodes
from signorini_fx.errors import SceneError
from signorini_fx.mesh.tagged import TaggedMesh
from signorini_fx.records import Inventory
from signorini_fx.scene.effect import SectionJump
from signorini_fx.scene.model import Scene

# A direction has a component along the axis if it is larger than this.
_ALONG = 1e-8


def section_loads(
    scene: Scene,
    tagged: TaggedMesh,
    space: fem.FunctionSpace,
    elastic: Callable[[Any, Any], tuple[Any, ...]],
    mixed: MixedPressure | None,
    inventory: Inventory,
    held: Callable[[Section], bool],
) -> list[AppliedLoad]:
    """-a(J, .) of the jump J of each section, whose factor is its shortening, and -(div J, .) where the pressure is an
    unknown; collective.

    Args:
        scene: the scene.
        tagged: its mesh.
        space: of the displacement.
        elastic: the terms of a(., .).
        mixed: the pressure of a mixed element, of which these are not.
        inventory: where forms are compiled.
        held: whether something on this rank holds nodes of a section along its axis, see ``holds``.

    Raises:
        SceneError: see ``section_of``; or contact or supports hold its nodes.
    """
    z, loads = ufl.TestFunction(space), []
    for path, effect in scene.listed():
        if not isinstance(effect, SectionJump) or not effect.acts:
            continue
        section = section_of(effect, path, tagged, space)
        if parallel.any_rank(space.mesh.comm, held(section)):
            raise SceneError([(path, "contact or a support holds nodes of the section along its axis: move it")])
        jump, swelling = unit_jump(section, space), None
        terms = elastic(jump, z) if mixed is None else mixed.terms(jump, fem.Function(mixed.own))[:2]
        second = "reduced volumetric" if mixed is None else "divergence of"
        names = (effect.name, f"{second} {effect.name}")[: len(terms)]
        forms = tuple(inventory.compile(name, partial(fem.form, term)) for name, term in zip(names, terms, strict=True))
        owned = space.dofmap.index_map.size_local * space.dofmap.index_map_bs
        if mixed is not None:  # the second one is of the change of volume
            forms, swelling = forms[:1], np.asarray(assemble(forms[1]) / mixed.unit, dtype=np.float64)
        forces = -sum((assemble(form) for form in forms), np.zeros(owned))
        amount = partial(effect.shortening_at, scene)
        ones, zero_displacement = (1.0,) * scene.steps, fem.Function(space)
        loads.append(
            AppliedLoad(
                ones,
                names,
                forms,
                forces,
                zero_displacement,
                balanced=True,
                swelling=swelling,
                section=effect,
                amount=amount,
            )
        )
    return loads


def holds(
    section: Section,
    fixed: npt.NDArray[np.bool_],
    turned: TurnedNodes | None,
    boundary: ContactBoundary | None,
    bonded: Sequence[int] = (),
) -> bool:
    """Whether contact or prescribed displacements hold nodes of a section on this rank along its axis; collective.

    They would see the displacement on one of its sides alone.

    Args:
        section: across the body.
        fixed: which displacement components are prescribed at the owned nodes, shape (owned dofs,).
        turned: nodes for which ``fixed`` is told in their own frames; None: there are none.
        boundary: the contact points; None: there are none.
        bonded: numbers of the contacts that hold in all directions.
    """
    dim = section.axis.size
    nodes = np.flatnonzero(section.nodes[: fixed.size // dim])
    frames = np.eye(dim)[None] if turned is None else turned.frames_at(nodes)
    along = np.abs(np.einsum("nij,i->nj", frames, section.axis)) > _ALONG
    held = bool((fixed.reshape(-1, dim)[nodes] & along).any())
    if boundary is None:
        return held
    of_points = section.nodes[boundary.nodes]
    if (averages := boundary.averages) is not None:  # points see other nodes than their own, and the other body's
        owned_flags = section.nodes[: fixed.size // dim, None].astype(np.float64)
        of_points = abs(averages.shares) @ from_owners(owned_flags, averages.nodes, boundary.comm)[:, 0] > 0
    holding = (np.abs(boundary.normal @ section.axis) > _ALONG) | np.isin(boundary.part, bonded)
    return held or bool((of_points & holding).any())


def jump_of(
    scene: Scene, tagged: TaggedMesh, space: fem.FunctionSpace, step: float
) -> tuple[Any, Callable[[float], None]]:
    """The jumps of all sections together, UFL, and what moves them to a place in the lists of factors.

    Returns:
        None in place of the jump where there is none.
    """
    effects = [
        (path, candidate) for path, candidate in scene.listed() if isinstance(candidate, SectionJump) and candidate.acts
    ]
    amounts = [fem.Constant(tagged.mesh, default_scalar_type(0.0)) for _ in effects]

    def move_to(step: float) -> None:
        for constant, (_, effect) in zip(amounts, effects, strict=True):
            constant.value = effect.shortening_at(scene, step)

    move_to(step)
    jumps = [unit_jump(section_of(effect, path, tagged, space), space) for path, effect in effects]
    terms = [amount * jump for amount, jump in zip(amounts, jumps, strict=True)]
    return sum(terms[1:], terms[0]) if terms else None, move_to
