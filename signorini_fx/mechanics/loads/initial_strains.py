"""Initial strains, and jumps of the displacement, with the forces that keep it continuous else."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import default_scalar_type, fem

from signorini_fx.errors import SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import from_owners
from signorini_fx.mechanics.assembly.mesh_entities import compile_form
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.elasticity.elastic_law import SceneLaw
from signorini_fx.mechanics.loads.load_vectors import AppliedLoad, FormCoefficients
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.effect import InitialStrain
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.tuned import ROOT_OF_EPS

if TYPE_CHECKING:
    from signorini_fx.mechanics.contact_points.turned_supports import TurnedNodes
    from signorini_fx.mechanics.loads.bolt_sections import Jump


def jumps_in(statement: Statement, tagged: TaggedMesh, space: fem.FunctionSpace) -> list[Jump]:
    """Those of a scene; collective."""
    if not statement.preloads:
        return []
    from signorini_fx.mechanics.loads.bolt_sections import jump_at

    acting = [(path, entry) for path, entry in statement.listed() if entry in statement.preloads]
    return [jump_at(path, entry, statement, tagged, space) for path, entry in acting]


def jump_loads(
    jumps: Sequence[Jump], space: fem.FunctionSpace, elastic: SceneLaw, held: Callable[[Jump], bool]
) -> list[AppliedLoad]:
    """-a(J, .) of each jump J, times its amount, and -(div J, .) where the pressure is an unknown; ``held``: whether
    something on this rank holds nodes of a jump along its axis, see ``holds``; collective.

    Raises:
        SceneError: contact or supports hold its nodes.
    """
    z, loads = ufl.TestFunction(space), []
    for jump in jumps:
        if parallel.any_rank(space.mesh.comm, held(jump)):
            raise SceneError([(jump.path, "contact or a support holds nodes of the section along its axis: move it")])
        terms = elastic.jump_terms(jump.on(space), z)
        forms = tuple(map(compile_form, terms))
        owned = space.dofmap.index_map.size_local * space.dofmap.index_map_bs
        forces, pressure_load = elastic.assembled(forms, owned)
        of_jump = jump.amount, forms, -forces, fem.Function(space)
        loads.append(AppliedLoad(*of_jump, balanced=True, entry=jump.entry, pressure_load=pressure_load))
    return loads


def holds(
    jump: Jump,
    fixed: npt.NDArray[np.bool_],
    turned: TurnedNodes | None,
    boundary: ContactBoundary | None,
    bonded: Sequence[int] = (),
) -> bool:
    """Whether contact or prescribed displacements hold nodes of a jump on this rank along its axis, which would see the
    displacement on one of its sides alone; ``fixed`` and ``turned``: see ``ElasticBody``; ``bonded``: numbers of the
    contacts that hold in all directions; collective.
    """
    dim = jump.axis.size
    nodes = np.flatnonzero(jump.nodes[: fixed.size // dim])
    frames = np.eye(dim)[None] if turned is None else turned.frames_at(nodes)
    along = np.abs(np.einsum("nij,i->nj", frames, jump.axis)) > ROOT_OF_EPS
    held = bool((fixed.reshape(-1, dim)[nodes] & along).any())
    if boundary is None:
        return held
    owned_flags, averages = jump.nodes[: fixed.size // dim, None].astype(np.float64), boundary.averages
    of_points = abs(averages.shares) @ from_owners(owned_flags, averages.nodes, boundary.comm)[:, 0] > 0
    holding = (np.abs(boundary.normal @ jump.axis) > ROOT_OF_EPS) | np.isin(boundary.part, bonded)
    return held or bool((of_points & holding).any())


def initial_strain(
    statement: Statement, tagged: TaggedMesh, space: fem.FunctionSpace, step: float
) -> tuple[Any, Callable[[float], None]]:
    """All initial strains together in each direction, UFL, None without any, and what moves them to a place."""
    effects = [effect for effect in statement.of(InitialStrain) if effect.acts]
    if not effects:
        return None, lambda step: None
    on = FormCoefficients(statement, tagged, space)  # of its own: other stresses are at other places
    factors = [fem.Constant(tagged.mesh, default_scalar_type(0.0)) for _ in effects]

    def move_to(step: float) -> None:
        on.move_to(step)
        for constant, effect in zip(factors, effects, strict=True):
            constant.value, _ = statement.now(effect, step)

    move_to(step)
    return sum(factor * effect.strain(on) for factor, effect in zip(factors, effects, strict=True)), move_to


def total_jump(
    statement: Statement, tagged: TaggedMesh, space: fem.FunctionSpace
) -> tuple[Any, Callable[[float], None]]:
    """All jumps together, zero so far, UFL, None without any, and what moves them to a place."""
    jumps = jumps_in(statement, tagged, space)
    amounts = [fem.Constant(tagged.mesh, default_scalar_type(0.0)) for _ in jumps]

    def move_to(step: float) -> None:
        for constant, jump in zip(amounts, jumps, strict=True):
            constant.value = jump.amount(step)

    terms = [amount * jump.on(space) for amount, jump in zip(amounts, jumps, strict=True)]
    return sum(terms[1:], terms[0]) if terms else None, move_to
