"""Prescribed displacements: Dirichlet conditions along the axes, supports along other directions,
and forces at nodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from dolfinx import default_scalar_type, fem
from dolfinx import mesh as dmesh

from signorini_fx.arrays import Array, Flags, Indices, Ints, Value
from signorini_fx.errors import SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import (
    facet_cells,
    facet_vertices,
    marked_nodes,
    node_positions,
    prescribed,
)
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.effects.displacement import Displacement
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.expressions import in_space, sample
from signorini_fx.tuned import ROOT_OF_EPS, ZERO_COMPONENT

if TYPE_CHECKING:
    from signorini_fx.mechanics.contact_points.turned_supports import SkewSupport, TurnedNodes
    from signorini_fx.mechanics.effects.loads import PointForce
    from signorini_fx.mechanics.statement.statement import Statement

Conditions = list[tuple[Displacement, fem.DirichletBC]]


@dataclass(frozen=True)
class Supports:
    """The prescribed displacements on a mesh."""

    # The Dirichlet conditions with the values of the first load step, one component each.
    conditions: Conditions
    # Supports along normals of flat boundaries that are not perpendicular to an axis.
    skew: list[SkewSupport]
    turned: TurnedNodes | None  # the nodes of these; None: there are none
    fixed: Flags  # the prescribed owned dofs, in the frames of turned nodes, shape (owned dofs,)
    _place: tuple[Statement, fem.FunctionSpace, dict[str, Indices], TaggedMesh, float]

    @classmethod
    def of(
        cls,
        statement: Statement,
        space: fem.FunctionSpace,
        facets: dict[str, Indices],
        tagged: TaggedMesh,
        step: float,
    ) -> Supports:
        """Return the supports of a statement that act at a place in the lists of factors;
        collective.

        Args:
            statement: the entries of the scene.
            space: of the displacement.
            facets: exterior facets of each boundary, by name.
            tagged: the mesh.
            step: the place.
        """
        from signorini_fx.mechanics.contact_points.turned_supports import TurnedNodes

        place = (statement, space, facets, tagged, step)
        dim = space.mesh.geometry.dim
        turned = None
        conditions, skew = conditions_on(*place)
        owned = space.dofmap.index_map.size_local
        fixed = prescribed(space, [condition for _, condition in conditions])[0][: owned * dim]
        if skew:
            axes = np.full((len(node_positions(space)), dim), -1)
            position = {
                id(effect): index
                for index, effect in enumerate((*statement.displacement, _ON_AXIS))
            }
            for effect, condition in conditions:
                axes.reshape(-1)[condition.dof_indices()[0]] = position[id(effect)]
            turned = TurnedNodes.of(skew, axes)
            on_rank = turned.nodes < owned
            fixed.reshape(-1, dim)[turned.nodes[on_rank]] = turned.fixed[on_rank]
        return cls(conditions, skew, turned, fixed, place)

    def at(self, step: float) -> tuple[Conditions, TurnedNodes | None]:
        """Return the conditions and the turned nodes with their values at a place in the lists of
        factors; collective.
        """
        statement = self._place[0]
        if not any(effect.timed for effect in statement.displacement):
            return self.conditions, self.turned
        moved = tuple(effect.at_time(statement.time_at(step)) for effect in statement.displacement)
        axes, skew = conditions_on(statement.changed(displacement=moved), *self._place[1:])
        updated = [
            replace(initial, values=current.values)
            for initial, current in zip(self.skew, skew, strict=True)
        ]
        pairs = [
            (effect, support)
            for (effect, _), (_, support) in zip(self.conditions, axes, strict=True)
        ]
        return pairs, None if self.turned is None else replace(self.turned, supports=updated)


def conditions_on(
    statement: Statement,
    space: fem.FunctionSpace,
    facets: dict[str, Indices],
    tagged: TaggedMesh,
    step: float,
) -> tuple[Conditions, list[SkewSupport]]:
    """Return the supports that act at a place in the lists of factors; collective.

    Returns:
        Dirichlet conditions, one per component, of which the later one wins where two meet; and the
        supports along normals of flat boundaries that are not perpendicular to an axis.
    """
    from signorini_fx.mechanics.contact_points.turned_supports import SkewSupport

    dim = space.mesh.topology.dim - 1
    supports = Conditions()
    skew = []
    for index, effect in enumerate(statement.displacement):
        if not effect.holds_at(step):
            continue
        components = effect.components
        if effect.normal is not None:
            normal = flat_normal(effect, index, tagged)
            if np.abs(normal).max() < 1.0:
                nodes = fem.locate_dofs_topological(space, dim, facets[str(effect.boundary)])
                values = sample(effect.normal, node_positions(space)[nodes].T)
                skew.append(SkewSupport(effect, index, nodes, normal, values))
                continue
            components = [_times(float(sign), effect.normal) if sign else None for sign in normal]
        for component, value in enumerate(components):
            if value is None:
                continue
            subspace = space.sub(component)
            if effect.at is not None:
                node = node_at(space, effect, f"displacement[{index}]", tagged)
                dofs = (space.mesh.geometry.dim * node + component).astype(np.int32)
                at = in_space(np.array([effect.at]))
                support = fem.dirichletbc(default_scalar_type(sample(value, at)[0]), dofs, subspace)
            elif isinstance(value, float):
                dofs = fem.locate_dofs_topological(subspace, dim, facets[str(effect.boundary)])
                support = fem.dirichletbc(default_scalar_type(value), dofs, subspace)
            else:
                collapsed, _ = subspace.collapse()
                pair = fem.locate_dofs_topological(
                    (subspace, collapsed), dim, facets[str(effect.boundary)]
                )
                function = fem.Function(collapsed)
                function.interpolate(lambda x, value=value: sample(value, x))
                support = fem.dirichletbc(function, pair, subspace)
            supports.append((effect, support))
    on_rank = np.flatnonzero(on_axis(node_positions(space), tagged))
    for component in statement.kinematics_in(tagged.dimension).zero_on_axis:
        dofs = (space.mesh.geometry.dim * on_rank + component).astype(np.int32)
        supports.append(
            (_ON_AXIS, fem.dirichletbc(default_scalar_type(0.0), dofs, space.sub(component)))
        )
    return supports, skew


def _times(sign: float, value: Value) -> Value:
    """Return a component of a displacement that is prescribed along a normal parallel to an
    axis.
    """
    return sign * value if isinstance(value, float) else lambda x: sign * sample(value, x)


# The entry to which conditions on the axis of revolution belong, for all components.
_ON_AXIS = Displacement(boundary="on the axis", x=0.0)


def on_axis(x: Array, tagged: TaggedMesh) -> Flags:
    """Return which points of shape (n, 3) or (n, 2) are on the axis of revolution, shape (n,)."""
    return np.abs(x[:, 0]) <= ROOT_OF_EPS * tagged.size


def flat_normal(effect: Displacement, index: int, tagged: TaggedMesh) -> Array:
    """Return the outward unit normal of a flat boundary, exact if it is along an axis, shape (d,);
    collective.

    Raises:
        SceneError: the boundary is not flat.
    """
    mesh = tagged.mesh
    facets = tagged.facets(str(effect.boundary))
    dim = mesh.topology.dim
    inside = dmesh.compute_midpoints(mesh, dim, facet_cells(mesh, facets))
    outward = parallel.global_sum(
        mesh.comm, (dmesh.compute_midpoints(mesh, dim - 1, facets) - inside).sum(axis=0)
    )
    # From the edges of single facets: a fit through all points would be less accurate.
    corners = facet_vertices(mesh, facets)[:, :, :dim]
    along = corners[:, 1:dim] - corners[:, :1]
    across = (
        np.column_stack((along[:, 0, 1], -along[:, 0, 0]))
        if dim == 2
        else np.cross(along[:, 0], along[:, 1])
    )
    across = across * np.sign(across @ outward[:dim])[:, None]
    normal = parallel.global_sum(mesh.comm, across.sum(axis=0))
    normal = normal / max(float(np.linalg.norm(normal)), 1e-300)
    if np.abs(normal).max() > 1 - ZERO_COMPONENT:
        normal = np.rint(normal)
    low, high = parallel.global_bounds(mesh.comm, (corners @ normal).reshape(-1, 1))
    if float(high[0] - low[0]) > 1e-9 * tagged.size:
        message = (
            f"boundary {effect.boundary!r} is not flat: use bilateral contact without friction"
        )
        raise SceneError.at(f"displacement[{index}].normal", message)
    return np.pad(normal, (0, mesh.geometry.dim - dim))


def at_rest(
    space: fem.FunctionSpace,
    supports: Sequence[tuple[Displacement, fem.DirichletBC]],
    turned: TurnedNodes | None,
    fixed: Flags,
) -> Flags:
    """Return which prescribed dofs are zero at all times, shape (owned dofs,); at turned nodes in
    their frames.

    Args:
        space: of the displacement.
        supports: the Dirichlet conditions.
        turned: nodes with supports along no axis; None: there are none.
        fixed: the prescribed owned dofs.
    """
    values = prescribed(space, [support for _, support in supports])[1]
    for effect, support in supports:
        if effect.timed:
            values[support.dof_indices()[0]] = np.nan
    dim = space.mesh.geometry.dim
    displacements = values.reshape(-1, dim)
    if turned is not None:
        still = (displacements[turned.nodes] == 0).all(axis=1)
        for skew_support in turned.supports:
            moves = skew_support.nodes[(skew_support.values != 0) | skew_support.effect.timed]
            still &= ~np.isin(turned.nodes, moves)
        displacements[turned.nodes] = np.where(still, 0.0, np.nan)[:, None]
    return fixed & (displacements.ravel()[: fixed.size] == 0)


def check_overlap(
    statement: Statement,
    boundary: ContactBoundary,
    facets: dict[str, Indices],
    tagged: TaggedMesh,
) -> None:
    """Raise a ``SceneError`` if the normal displacement is prescribed on contact facets, as that
    contradicts the contact condition.
    """
    problems = []
    for index, support in enumerate(statement.displacement):
        if support.at is not None:  # as where a supported side ends at the contact
            continue
        axes = [
            component for component, value in enumerate(support.components) if value is not None
        ]
        prescribed = (
            np.eye(tagged.mesh.geometry.dim)[axes]
            if axes
            else flat_normal(support, index, tagged)[None]
        )
        for part, effect in enumerate(statement.contact):
            shared = np.intersect1d(facets[support.boundary], facets[effect.boundary]).size
            total = int(parallel.total(boundary.comm, shared))
            slope = np.abs(boundary.normal[boundary.part == part] @ prescribed.T).max(initial=0.0)
            if total and parallel.global_max(boundary.comm, slope) > 1e-8:
                message = (
                    f"boundary {support.boundary!r} prescribes the normal displacement on "
                    f"{total} facets of the "
                )
                message += f"contact boundary {effect.boundary!r}: remove them from one of the two"
                problems.append((f"displacement[{index}]", message))
    if problems:
        raise SceneError(problems)


# --- what acts at single nodes --------------------------------------------------------------------


def node_at(
    space: fem.FunctionSpace, effect: Displacement | PointForce, path: str, tagged: TaggedMesh
) -> Ints:
    """Return the node of this rank at the point of an effect, ghosts included, shape (1,) or (0,);
    collective.

    Args:
        space: of the displacement.
        effect: has the point ``at``, and perhaps a region that the node must belong to.
        path: of the effect, for errors.
        tagged: the mesh.

    Raises:
        SceneError: no node is at the point, or several are.
    """
    point = np.array(effect.at)
    x = node_positions(space)[:, : tagged.dimension]
    away = np.linalg.norm(x - point, axis=1)
    near = away <= ROOT_OF_EPS * tagged.size
    if effect.region is not None:
        near &= marked_nodes(space, space.dofmap.list[tagged.cells(effect.region)].ravel())
    candidates = np.flatnonzero(near)
    if not parallel.any_rank(tagged.mesh.comm, candidates.size > 0):
        nearest = parallel.gather_rows(
            tagged.mesh.comm, np.column_stack((away, x))[np.argsort(away)[:1]]
        )
        nearest_point = (
            np.round(nearest[np.argmin(nearest[:, 0]), 1:] / tagged.size, 9) * tagged.size
        )
        at = ", ".join(f"{value:.6g}" for value in nearest_point)
        raise SceneError.at(
            f"{path}.at", f"no node of the mesh is at {effect.place}; near is ({at})"
        )
    owned = candidates[candidates < space.dofmap.index_map.size_local]
    count = int(parallel.total(tagged.mesh.comm, owned.size))
    if count > 1:
        message = (
            f"{count} nodes of the mesh are at {effect.place}, of parts that do not share them: "
            "name the region of one "
            "of them, or choose a point at which there is one node"
        )
        raise SceneError.at(f"{path}.at", message)
    return candidates


def forces_at_nodes(load: Any, path: str, space: fem.FunctionSpace, tagged: TaggedMesh) -> Array:
    """Return the load vector of a ``PointForce``, shape (owned dofs,); collective.

    Raises:
        SceneError: see ``node_at``.
    """
    node = node_at(space, load, path, tagged)
    owned = space.dofmap.index_map.size_local
    at = in_space(np.array([load.at]))
    forces = np.zeros((owned, space.dofmap.index_map_bs))
    forces[node[node < owned], : tagged.dimension] = [
        sample(c, at)[0] for c in load.components[: tagged.dimension]
    ]
    return forces.ravel()
