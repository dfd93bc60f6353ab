"""The forces on the nodes of bodies of nonlinear materials, and their Cauchy stress, from their states and their UFL.

Of materials with a state that of the load step before is given, and updated here.  The stress is evaluated at the
points of quadrature, where the material is; extremes are those of these points.  The fields are polynomials of degree
k - 1 in each cell of degree k, the nearest ones to the values at its points: those of a higher degree would leave the
yield surface at the nodes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import basix
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.assembly.mesh_entities import assemble
from signorini_fx.mechanics.assembly.quadrature import strain_degree
from signorini_fx.mechanics.body.nonlinear_law import (
    BodyResidual,
    at_rest,
    body_residual,
    cells_of,
    stress_parts,
    volume_degree,
)
from signorini_fx.mechanics.elasticity.elastic_law import ElementStress, within
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.results.certificate.nodal_forces import NodalForces
from signorini_fx.results.resultants import NamedForces
from signorini_fx.results.stresses import (
    COMPONENTS,
    Extreme,
    RawStresses,
    check_has_extremes,
    extreme_at,
    principal_of,
    von_mises_of,
)

Array = npt.NDArray[np.float64]
States = Mapping[int, Array]


@dataclass(frozen=True)
class PointStress:
    """The Cauchy stress at the points of quadrature of the cells that this rank owns; at small strains the stress;
    ``points`` and ``weights``: of the reference cell, shapes (q, t) and (q,); ``x``: undeformed, shape (c, q, t);
    ``stress``: tension positive, shape (c, q, 3, 3).
    """

    points: Array
    weights: Array
    x: Array
    stress: Array


class NonlinearForces(NodalForces):
    """Forces on the nodes of a body of nonlinear materials, see ``NodalForces``."""

    def __init__(self, statement: Statement, tagged: TaggedMesh, space: fem.FunctionSpace) -> None:
        super().__init__(at_rest(statement), tagged, space)
        self.materials, self._nonlinear = statement.material, statement

    @cached_property
    def _u(self) -> fem.Function:
        return fem.Function(self.space)

    @cached_property
    def _body(self) -> BodyResidual:
        """The work of the stress at the displacement of its own."""
        return body_residual(self._nonlinear, self.tagged, self._u)

    @cached_property
    def _points(self) -> dict[int, Any]:
        """Those of the materials with a state, by their numbers."""
        return {self.materials.index(points.material): points for points in self._body.points}

    @cached_property
    def _residual(self) -> fem.Form:
        with compiling():
            return fem.form(self._body.form)

    def _move_to(self, displacement: fem.Function, states: States, step: float) -> None:
        """Take a displacement in the load step that begins with ``states`` and ends at a place."""
        self._u.x.array[:] = displacement.x.array
        self._body.move_to(step)
        for number, points in self._points.items():
            points.begun = states[number]
        self._body.update()

    def residual(self, displacement: fem.Function, states: States, step: float) -> Array:
        """Forces of materials, springs and loads, forces of shape (owned dofs,); ``states``: of the materials with a
        state, by their numbers, at the end of the last load step, shape (c, q, numbers), in the order of their cells;
        collective.
        """
        self._move_to(displacement, states, step)
        return np.asarray(assemble(self._residual) - self.external(step).ravel())

    def of_followers(self, displacement: fem.Function, step: float) -> list[NamedForces]:
        """Those of loads that follow the body, with their names; collective."""
        self._u.x.array[:] = displacement.x.array
        self._body.move_to(step)
        followers, loads = self._body.followers, list[NamedForces]()
        for effect, work in zip(followers.effects, followers.works, strict=True):
            forms = self._compiled(("follower", id(effect)), partial(list, (work,)))
            loads.append((effect.where, effect.label if effect.carried else "pressure", -self._sum(forms)))
        return loads

    def unstrained(self) -> dict[int, Array]:
        """The states of the materials that have one before the first load step, by their numbers."""
        return {number: np.zeros_like(points.begun) for number, points in self._points.items()}

    def advanced(self, displacement: fem.Function, states: States, step: float) -> dict[int, Array]:
        """The states at the end of a load step from those at its begin; for the arguments see ``residual``."""
        if states:
            self._move_to(displacement, states, step)
        return {number: self._points[number].current for number in states}

    def plastic_strain(self, states: States) -> Array | None:
        """The accumulated plastic strain at the points of quadrature of the cells that this rank owns, shape (c, q),
        zero in materials that have none; None: there is no other; for ``states`` see ``residual``.
        """
        total: Array | None = None
        for number, state in states.items():
            points = self._points[number]
            reached = points.material.plastic_strain(state.reshape(-1, points.material.state_size))
            if reached is not None:
                total = np.zeros((self._owned_cells, state.shape[1])) if total is None else total
                total[points.cells] = reached.reshape(state.shape[:2])
        return total

    @property
    def _owned_cells(self) -> int:
        return int(self.space.mesh.topology.index_map(self.space.mesh.topology.dim).size_local)

    def cauchy(self, displacement: fem.Function, states: States, step: float) -> PointStress:
        """The Cauchy stress at the points of quadrature; for the arguments see ``residual``.

        A mean stress that is integrated with fewer points is the polynomial through them.
        """
        self._move_to(displacement, states, step)
        degree = max(1, strain_degree(self.space, self.kinematics))
        cell_type = getattr(basix.CellType, self.space.mesh.topology.cell_name())
        points, weights = basix.make_quadrature(cell_type, degree)
        mesh, cells = self.space.mesh, np.arange(self._owned_cells, dtype=np.int32)
        with compiling():
            places = fem.Expression(ufl.SpatialCoordinate(mesh), points)
        at = np.asarray(places.eval(mesh, cells)).reshape(cells.size, len(points), mesh.geometry.dim)
        x = at[:, :, : points.shape[1]]
        reduced = volume_degree(self._nonlinear, self.tagged)
        parts = [stress_parts(material, self._u, self.kinematics, self._body.free) for material in self.materials]
        shape, volume = ([part[k] for part in parts] for k in range(2))
        stress = self._evaluated(shape, points, (3, 3))
        for state in self._points.values():
            stress[state.cells] = state.response()[0].reshape(*state.begun.shape[:2], 3, 3)
        if reduced is None:
            return PointStress(points, weights, x, stress + self._evaluated(volume, points, (3, 3)))
        fewer, their_weights = basix.make_quadrature(cell_type, reduced)
        mean = self._evaluated(volume, fewer, (3, 3))
        between = _between(cell_type, self.space.element.basix_element.degree - 1, fewer, their_weights, points)
        return PointStress(points, weights, x, stress + np.einsum("pq,cqij->cpij", between, mean))

    def _evaluated(self, expressions: Sequence[Any], points: Array, shape: tuple[int, ...]) -> Array:
        """UFL expressions of the materials, None: zero, at points of the owned cells, shape (c, q, *shape)."""
        mesh, values = self.space.mesh, np.zeros((self._owned_cells, len(points), *shape))
        for material, expression in zip(self.materials, expressions, strict=True):
            if expression is None:
                continue
            with compiling():
                compiled = fem.Expression(expression, points)
            cells = cells_of(material, self.tagged)
            values[cells] = np.asarray(compiled.eval(mesh, cells)).reshape(len(cells), len(points), *shape)
        return values


@dataclass
class StatesOnPath:
    """The states of materials at the ends of load steps, which follow from the displacements of these.

    Kept are those of the load step that was asked for last: the states of all of them would take many times the memory
    of the displacements.
    """

    forces: NonlinearForces
    _path: tuple[tuple[fem.Function, float], ...] = ()
    _states: Mapping[int, Array] | None = None

    def after(self, path: Sequence[tuple[fem.Function, float]]) -> Mapping[int, Array]:
        """Those at the end of load steps; ``path``: their displacements, the first one first, with their places in the
        lists of factors; none: before the first one.
        """
        count = len(self._path)
        pairs = zip(self._path, path, strict=False)
        if self._states is None or count > len(path) or any(a is not b for (a, _), (b, _) in pairs):
            count, self._states = 0, self.forces.unstrained()
        for displacement, step in path[count:]:
            self._states = self.forces.advanced(displacement, self._states, step)
        self._path = tuple(path)
        return self._states


@dataclass(frozen=True, repr=False)
class NonlinearStresses(RawStresses):
    """The Cauchy stress of a displacement, at small strains the stress; nothing is recovered, and no error estimated;
    ``filled``: a function on cells; ``plastic``: the accumulated plastic strain at the points of quadrature, shape (c,
    q), None: there is none.
    """

    filled: fem.Function = field(kw_only=True)
    at_points: PointStress = field(kw_only=True)
    plastic: Array | None = field(kw_only=True)

    @classmethod
    def of(cls, model: Model, states: StatesOnPath, path: Sequence[tuple[fem.Function, float]]) -> NonlinearStresses:
        """That at the end of the last load step of a path, see ``StatesOnPath``; collective."""
        forces, kinematics, (y, step) = states.forces, model.statement.kinematics_in(model.tagged.dimension), path[-1]
        at_points = forces.cauchy(y, states.after(path[:-1]), step)
        plastic = forces.plastic_strain(states.after(path))
        mesh, degree, dim = y.function_space.mesh, y.function_space.element.basix_element.degree, kinematics.dimension
        tensor = fem.Function(fem.functionspace(mesh, ("DG", degree - 1, (3, 3))), name="stress")
        _fill(tensor, at_points, at_points.stress)
        outward = tensor[2, 2] if dim == 2 else None
        stress = ElementStress(y, kinematics, within(tensor, dim), outward, lambda _: None, None, None)
        return cls(stress, None, filled=tensor, at_points=at_points, model=model, plastic=plastic)

    @cached_property
    def tensor(self) -> fem.Function:
        """The Cauchy stress with all components in 3D, shape (3, 3), discontinuous and of degree k - 1."""
        return self.filled

    @cached_property
    def plastic_strain(self) -> fem.Function | None:
        """In each cell within the values at its points."""
        if self.plastic is None:
            return None
        space = self.tensor.function_space
        function = fem.Function(
            fem.functionspace(space.mesh, ("DG", space.element.basix_element.degree)), name="plastic_strain"
        )
        _fill(function, self.at_points, self.plastic)
        return function

    def plastic_extreme(self) -> dict[str, Any] | None:
        return None if self.plastic is None else self._told(self._extreme_of_points(self.plastic, 1.0))

    def _extreme(self, field: str, component: int, *, sign: float) -> Extreme:
        """At the points of quadrature."""
        check_has_extremes(field)
        stress = self.at_points.stress
        if field in COMPONENTS:
            return self._extreme_of_points(stress[..., *COMPONENTS[field]], sign)
        tensors = stress.reshape(-1, 3, 3)
        values = von_mises_of(tensors) if field == "von_mises" else principal_of(tensors)[:, component]
        return self._extreme_of_points(values, sign)

    def _extreme_of_points(self, values: Array, sign: float) -> Extreme:
        """The largest or smallest of values at the points; collective."""
        x, mesh = self.at_points.x, self.tensor.function_space.mesh
        return extreme_at(mesh, values.ravel(), x.reshape(-1, x.shape[2]), lambda at: at // x.shape[1], sign)


def _fill(function: fem.Function, at_points: PointStress, values: Array) -> None:
    """Give a function on cells the values of the nearest polynomials to those at points, of numbers, shape (c, q), no
    less or more than these; collective.
    """
    space = function.function_space
    coefficients = through_points(space.element.basix_element, at_points.points, at_points.weights)
    assert coefficients is not None
    rows = values.reshape(*values.shape[:2], math.prod(values.shape[2:]))  # also where a rank has no cells
    fitted = np.einsum("nq,cqm->cnm", coefficients, rows)
    if values.ndim == 2:
        fitted = np.clip(fitted, rows.min(axis=1, keepdims=True), rows.max(axis=1, keepdims=True))
    function.x.array.reshape(-1, rows.shape[2])[space.dofmap.list[: len(rows)]] = fitted
    function.x.scatter_forward()


def through_points(element: Any, points: Array, weights: Array) -> Array | None:
    """What takes values at points of a reference cell to the coefficients of the nearest function of a Lagrange
    element, shape (n, q); None: the points do not determine it; ``element``: of basix, with n functions; ``points``:
    shape (q, t); ``weights``: shape (q,).
    """
    root = np.sqrt(weights)[:, None]
    basis = root * element.tabulate(0, points)[0, :, :, 0]
    return np.asarray(np.linalg.pinv(basis) * root.T) if np.linalg.matrix_rank(basis) == basis.shape[1] else None


def _between(cell_type: basix.CellType, degree: int, points: Array, weights: Array, wanted: Array) -> Array:
    """What takes values at points, shape (q, t), to those at others, shape (p, t), of the nearest polynomial of a
    degree, or of the largest below it that the points determine, shape (p, q).
    """
    family, variant = basix.ElementFamily.P, basix.LagrangeVariant.gll_warped
    element = basix.create_element(family, cell_type, degree, variant, discontinuous=degree == 0)
    if (coefficients := through_points(element, points, weights)) is None:
        return _between(cell_type, degree - 1, points, weights, wanted)
    return np.asarray(element.tabulate(0, wanted)[0, :, :, 0] @ coefficients)
