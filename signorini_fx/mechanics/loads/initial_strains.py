"""Initial strains, and sections across bolts with the jumps of the displacement there.

Cells beyond a section move relative to the nodes that they share with the cells before it, as if
these nodes were doubled: their displacement is that of the nodes minus s n at the nodes of the
section, where n is the unit vector across it and s the shortening.  No node is added, and the
section may consist of any facets, here of those closest to a plane.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import ufl
from dolfinx import default_scalar_type, fem

from signorini_fx.arrays import Array, Expr, Flags, Indices
from signorini_fx.errors import SceneError
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.averages import from_owners
from signorini_fx.mechanics.assembly.mesh_entities import (
    compile_form,
    facet_nodes,
    marked_nodes,
    node_positions,
)
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.elasticity.elastic_law import SceneLaw
from signorini_fx.mechanics.loads.load_vectors import AppliedLoad, FormCoefficients
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, outer_facets
from signorini_fx.mechanics.statement.effect import InitialStrain
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.tuned import DIGITS_OF_FILES, ROOT_OF_EPS, SAME_LENGTH

if TYPE_CHECKING:
    from signorini_fx.mechanics.contact_points.turned_supports import TurnedNodes
    from signorini_fx.mechanics.effects.loads import Preload


@dataclass(frozen=True)
class Jump:
    """The jump of the displacement at one section, on this rank."""

    path: str  # of its entry in the scene, for messages
    entry: Preload
    amount: Callable[[float], float]  # s, length, at a place in the lists of factors
    axis: Array  # n, shape (d,)
    nodes: Flags  # which nodes lie on its section, ghosts included, shape (nodes,)
    cells: Indices  # the cells beyond it with such nodes, ghosts included, shape (c,)

    @property
    def at_nodes(self) -> Array:
        """The displacement J per unit of shortening that is added to the nodes of cells beyond the
        section, shape (nodes, d).
        """
        return np.where(self.nodes[:, None], -self.axis, 0.0)

    def on(self, space: fem.FunctionSpace) -> fem.Function:
        """Return J as a discontinuous function.

        Args:
            space: of the displacement.
        """
        dim = self.axis.size
        jump = fem.Function(
            fem.functionspace(space.mesh, ("DG", space.element.basix_element.degree, (dim,)))
        )
        of_cells = jump.function_space.dofmap.list[self.cells]
        jump.x.array.reshape(-1, dim)[of_cells] = self.at_nodes[space.dofmap.list[self.cells]]
        return jump


def jump_at(
    path: str, effect: Preload, statement: Statement, tagged: TaggedMesh, space: fem.FunctionSpace
) -> Jump:
    """Return the jump at the section of an entry; collective.

    Args:
        path: of the entry, for errors.
        effect: the entry.
        statement: gives its shortening.
        tagged: the mesh.
        space: of the displacement.

    Raises:
        SceneError: the section does not cut the body through.
    """
    mesh = tagged.mesh
    dim = tagged.dimension
    of_cells = space.dofmap.list
    corners = compat.geometry_cells(mesh)
    middle = mesh.geometry.x[corners, :dim].mean(axis=1)
    inside: Flags = np.ones(len(middle), dtype=bool)
    nodes: Flags = np.zeros(len(node_positions(space)), dtype=bool)
    key = "section"
    if effect.section is not None:
        facets = _inner_facets(effect.section, path, tagged)
        nodes = marked_nodes(space, facet_nodes(space, facets).ravel())
        point, axis = _plane(space, nodes, tagged, path)
    else:
        key = "point"
        point = np.array(effect.point)
        axis = np.array(effect.axis)
        axis = axis / np.linalg.norm(axis)
        if effect.region is not None:
            inside[:] = False
            inside[tagged.cells(effect.region)] = True
    beyond = (middle - point) @ axis > -SAME_LENGTH * tagged.size
    if effect.section is None:
        sides = (marked_nodes(space, of_cells[inside & side].ravel()) for side in (beyond, ~beyond))
        nodes = np.logical_and(*sides)
    touching = nodes[of_cells].any(axis=1)
    far_nodes, near_nodes = (
        marked_nodes(space, of_cells[touching & side].ravel()) for side in (beyond, ~beyond)
    )
    where = "the mesh" if effect.region is None else f"region {effect.region!r}"
    for wrong, reason in (
        (not parallel.any_rank(mesh.comm, nodes), f"the plane does not cut {where}"),
        (
            bool((touching & ~inside).any()),
            f"cells outside {where} share nodes with the section: move it",
        ),
        (
            bool((far_nodes & near_nodes & ~nodes).any()),
            "the section ends inside the body: it must cut it through",
        ),
    ):
        if parallel.any_rank(mesh.comm, wrong):
            raise SceneError.at(f"{path}.{key}", reason)
    cells = np.flatnonzero(touching & beyond).astype(np.int32)
    axis = np.append(
        axis, np.zeros(space.dofmap.index_map_bs - dim)
    )  # no jump around the axis of a body with torsion
    return Jump(path, effect, partial(effect.shortening_at, statement), axis, nodes, cells)


def _inner_facets(name: str, path: str, tagged: TaggedMesh) -> Indices:
    """Return the facets inside the mesh that have a name, those of this rank.

    Raises:
        SceneError: there are none.
    """
    mesh = tagged.mesh
    if name not in tagged.boundaries:
        boundary_names = ", ".join(sorted(tagged.boundaries)) or "none"
        raise SceneError.at(
            f"{path}.section", f"the mesh has no facets {name!r}; it has: {boundary_names}"
        )
    tags = tagged.boundaries[name]
    tagged_facets = tagged.facet_tags.indices[np.isin(tagged.facet_tags.values, tags)]
    inner_facets = np.setdiff1d(tagged_facets, outer_facets(mesh)).astype(np.int32)
    if not parallel.any_rank(mesh.comm, inner_facets.size > 0):
        raise SceneError.at(
            f"{path}.section", f"{name!r} has no facets inside the mesh: it is on its boundary"
        )
    return inner_facets


def _plane(
    space: fem.FunctionSpace, nodes: Flags, tagged: TaggedMesh, path: str
) -> tuple[Array, Array]:
    """Return a point and the unit normal of the plane through some nodes; collective.

    Raises:
        SceneError: the nodes are not in one plane.
    """
    comm = space.mesh.comm
    owned = space.dofmap.index_map.size_local
    x = node_positions(space)[:owned, : tagged.dimension][nodes[:owned]]
    sums = parallel.global_sum(comm, np.append(x.sum(axis=0), len(x)))
    point = sums[:-1] / sums[-1]
    spread, directions = np.linalg.eigh(parallel.global_sum(comm, (x - point).T @ (x - point)))
    if np.sqrt(max(spread[0], 0.0) / sums[-1]) > DIGITS_OF_FILES * tagged.size:
        raise SceneError.at(
            f"{path}.section", "its facets are not in one plane: give point and axis instead"
        )
    return point, directions[:, 0]


def jumps_in(statement: Statement, tagged: TaggedMesh, space: fem.FunctionSpace) -> list[Jump]:
    """Return the jumps of all preloads of a scene; collective."""
    if not statement.preloads:
        return []
    acting = [(path, entry) for path, entry in statement.listed() if entry in statement.preloads]
    return [jump_at(path, entry, statement, tagged, space) for path, entry in acting]


def jump_loads(
    jumps: Sequence[Jump], space: fem.FunctionSpace, elastic: SceneLaw, held: Callable[[Jump], bool]
) -> list[AppliedLoad]:
    """Return for each jump J the load -a(J, .), and -(div J, .) if the pressure is an unknown; its
    factor is the shortening; collective.

    Args:
        jumps: the jumps.
        space: of the displacement.
        elastic: the elastic law.
        held: returns whether contact or supports hold nodes of a jump on this rank along its axis.

    Raises:
        SceneError: nodes of a jump are held.
    """
    z = ufl.TestFunction(space)
    loads = []
    for jump in jumps:
        if parallel.any_rank(space.mesh.comm, held(jump)):
            raise SceneError.at(
                jump.path,
                "contact or a support holds nodes of the section along its axis: move it, or leave "
                "out the contact of a shank that stays open in its hole: its entry, or "
                "general_contact.within below the clearance",
            )
        terms = elastic.jump_terms(jump.on(space), z)
        forms = tuple(map(compile_form, terms))
        owned = space.dofmap.index_map.size_local * space.dofmap.index_map_bs
        forces, pressure_load = elastic.assembled(forms, owned)
        of_jump = jump.entry.shortening_at, forms, -forces, fem.Function(space)
        loads.append(
            AppliedLoad(*of_jump, balanced=True, entry=jump.entry, pressure_load=pressure_load)
        )
    return loads


def holds(
    jump: Jump,
    fixed: Flags,
    turned: TurnedNodes | None,
    boundary: ContactBoundary | None,
    bonded: Sequence[int] = (),
) -> bool:
    """Return whether contact or supports hold nodes of a jump on this rank along its axis;
    collective.

    They would act on the displacement of one side of the section alone.

    Args:
        jump: the jump.
        fixed: see ``Model``.
        turned: see ``Model``.
        boundary: the contact points; None: there are none.
        bonded: numbers of the contacts that hold in all directions.
    """
    dim = jump.axis.size
    nodes = np.flatnonzero(jump.nodes[: fixed.size // dim])
    frames = np.eye(dim)[None] if turned is None else turned.frames_at(nodes)
    along = np.abs(np.einsum("nij,i->nj", frames, jump.axis)) > ROOT_OF_EPS
    held = bool((fixed.reshape(-1, dim)[nodes] & along).any())
    if boundary is None:
        return held
    owned_flags = jump.nodes[: fixed.size // dim, None].astype(np.float64)
    averages = boundary.averages
    of_points = (
        abs(averages.shares) @ from_owners(owned_flags, averages.nodes, boundary.comm)[:, 0] > 0
    )
    holding = (np.abs(boundary.normal @ jump.axis) > ROOT_OF_EPS) | np.isin(boundary.part, bonded)
    return held or bool((of_points & holding).any())


def given_strains(
    statement: Statement, tagged: TaggedMesh, space: fem.FunctionSpace
) -> tuple[Expr | None, Expr | None, Callable[[float], None]]:
    """Return the sum of initial strains, the sum of jumps, and a function that sets both to a place
    in the lists of factors; collective.

    The sums are UFL, None if there are none, with the values of the first load step.
    """
    on = FormCoefficients(
        statement, tagged, space
    )  # own coefficients: other stresses may be at another step
    effects = [effect for effect in statement.of(InitialStrain) if effect.acts]
    jumps = jumps_in(statement, tagged, space)
    factors, amounts = (
        [fem.Constant(tagged.mesh, default_scalar_type(0.0)) for _ in of] for of in (effects, jumps)
    )

    def move_to(step: float) -> None:
        on.move_to(step)
        for constant, effect in zip(factors, effects, strict=True):
            constant.value, _ = statement.now(effect, step)
        for constant, jump in zip(amounts, jumps, strict=True):
            constant.value = jump.amount(step)

    move_to(0)
    strains = [factor * effect.strain(on) for factor, effect in zip(factors, effects, strict=True)]
    moved = [amount * jump.on(space) for amount, jump in zip(amounts, jumps, strict=True)]
    strain, jump = (sum(terms[1:], terms[0]) if terms else None for terms in (strains, moved))
    return strain, jump, move_to
