"""Nodal forces of nonlinear materials by quadrature in NumPy, from what their files say a second time.

As of ``nodal_forces`` no form and no matrix of the solver enters.  Both sides share the rules of quadrature, and of
materials with a state that of the last load step.

Where the temperature would stretch all lengths of a body by b, forces per undeformed area are b^2 times those of the
deformation F / b, as the areas on which this has them are b^2 times as large.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.mechanics.body.nonlinear_law import at_rest, cells_of, volume_degree
from signorini_fx.mechanics.loads.follower_pressure import carried_loads, degree_of, following
from signorini_fx.mechanics.materials.nonlinear import (
    Hyperelastic,
    PathDependent,
    deviator,
    growth_at,
    inverse_transposed,
)
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.effect import Force
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.results.certificate.nodal_forces import NodalForces
from signorini_fx.results.certificate.quadrature_points import QuadraturePoints

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int32]


@dataclass(frozen=True)
class PointStress:
    """The Cauchy stress at the points of quadrature of the cells that this rank owns; at small strains the stress.

    Attributes:
        points: of the reference cell, shape (q, t), with t the dimension of the cells.
        weights: of the points, shape (q,).
        x: the places in the undeformed body, length, shape (c, q, t).
        stress: force per deformed area, tension positive, shape (c, q, 3, 3).
    """

    points: Array
    weights: Array
    x: Array
    stress: Array


class NonlinearForces(NodalForces):
    """Forces on the nodes of a body of nonlinear materials, see ``NodalForces``.

    Args:
        statement: what is stated of the problem.
        tagged: its mesh.
        space: of the displacement.

    Attributes:
        materials: of the statement.
    """

    def __init__(self, statement: Statement, tagged: TaggedMesh, space: fem.FunctionSpace) -> None:
        super().__init__(at_rest(statement), tagged, space)
        self.materials, self._reduced = statement.material, volume_degree(statement, tagged)
        self._following = statement
        owned = len(self._owned_cells)
        self._made_of, self._place = np.zeros(owned, dtype=np.int64), np.zeros(owned, dtype=np.int64)
        for number, material in enumerate(self.materials):
            cells = cells_of(material, statement, tagged)
            self._made_of[cells], self._place[cells] = number, np.arange(cells.size)
        self._states: Mapping[int, Array] = {}
        self._time = 1.0

    def of_body(self, displacement: fem.Function, states: Mapping[int, Array], step: float) -> Array:
        """The work of the stress with unit displacements, forces, shape (owned nodes, d); collective.

        Args:
            displacement: y, length.
            states: of the materials with a state, by their numbers, at the end of the last load step, shape (c, q,
                numbers), in the order of their cells.
            step: a place in the lists of factors.
        """
        y, self._states = displacement.x.array.reshape(-1, self.dimension), states
        self._time = self._following.path.time_at(step)
        degree, (free, _) = max(1, self.degree), self.strain(step, 1.0)
        total = self._part_of_work(y, degree, self._of_shape, free)[0]
        total += self._part_of_work(y, self._reduced or degree, self._of_volume, free)[0]
        return self.over_ranks(total)

    def residual(self, displacement: fem.Function, states: Mapping[int, Array], step: float) -> Array:
        """Forces of materials, springs and loads, forces of shape (owned dofs,); collective.

        Args:
            displacement: y, length.
            states: see ``of_body``.
            step: a place in the lists of factors.
        """
        resisted = self.resisted(displacement.x.array.reshape(-1, self.dimension))
        loads = self.external(step) + self.of_followers(displacement, step)
        return np.asarray(self.of_body(displacement, states, step) + resisted - loads).ravel()

    def of_followers(self, displacement: fem.Function, step: float, effects: Sequence[Any] | None = None) -> Array:
        """The forces of pressures that follow the body, by the tangents of its deformed facets, and centrifugal ones at
        displaced places, shape (owned nodes, d); collective.

        Args:
            displacement: y, length.
            step: a place in the lists of factors.
            effects: some of these loads; None: all.
        """
        y, total = displacement.x.array.reshape(-1, self.dimension), self.zero()
        carried = [*following(self._following), *carried_loads(self._following)]
        for effect in carried if effects is None else effects:
            factor, current = self._following.now(effect, step)
            if effect.carried:
                total += factor * self._integral(current, partial(_at_displaced_points, current), y)
                continue
            points, weights = basix.make_quadrature(self._facet, degree_of(effect, self.statement.element.degree))
            for part in self._facets(self.facets(effect.where), points, weights, moved=y):
                at = self.positions(part) + part.table.shape @ y[self.cell_nodes[part.cells], : self.across]
                around, pressure = self.kinematics.measure_at(at), self.values(current.pressure, part)
                pressed = -factor * (pressure if around is None else pressure * around)[:, :, None] * part.moment
                np.add.at(total[:, : self.across], self.cell_nodes[part.cells], part.table.shape.T @ pressed)
        return self.over_ranks(total)

    def cauchy(self, displacement: fem.Function, states: Mapping[int, Array], step: float) -> PointStress:
        """The Cauchy stress at the points of quadrature; for the arguments see ``of_body``.

        A mean stress that is integrated with fewer points is the polynomial through them.
        """
        y, self._states = displacement.x.array.reshape(-1, self.dimension), states
        self._time = self._following.path.time_at(step)
        points, weights = basix.make_quadrature(self.cell_type, max(1, self.degree))
        x, shape = self._cauchy_of_part(y, points, step, shape=True)
        if self._reduced is None:
            return PointStress(points, weights, x, shape + self._cauchy_of_part(y, points, step, shape=False)[1])
        fewer, their_weights = basix.make_quadrature(self.cell_type, self._reduced)
        mean = self._cauchy_of_part(y, fewer, step, shape=False)[1]
        between = _between(self.cell_type, self._shapes.degree - 1, fewer, their_weights, points)
        return PointStress(points, weights, x, shape + np.einsum("pq,cqij->cpij", between, mean))

    def advanced(self, displacement: fem.Function, states: Mapping[int, Array], step: float) -> dict[int, Array]:
        """The states at the end of a load step from those at its begin; for the arguments see ``of_body``."""
        y, new = displacement.x.array.reshape(-1, self.dimension), {key: np.empty_like(s) for key, s in states.items()}
        if not states:
            return new
        self._time = self._following.path.time_at(step)
        points, _ = basix.make_quadrature(self.cell_type, max(1, self.degree))
        free, _ = self.strain(step, 1.0)
        for part, gradient, _, _ in self.gradients(y, points):
            strains = _strain_of(_in_space(gradient), None if free is None else free(part))
            for number, begun in states.items():
                inside, material = self._made_of[part.cells] == number, self.materials[number]
                rows, strain = self._place[part.cells[inside]], strains[inside]
                state = begun[rows].reshape(-1, material.state_size)
                assert isinstance(material, PathDependent)
                new[number][rows] = (
                    material.at_time(self._time).respond(strain.reshape(-1, 3, 3), state)[2].reshape(begun[rows].shape)
                )
        return new

    def unstrained(self) -> dict[int, Array]:
        """The states of the materials that have one before the first load step, by their numbers."""
        count = len(basix.make_quadrature(self.cell_type, max(1, self.degree))[1])
        return {
            number: np.zeros((np.count_nonzero(self._made_of == number), count, material.state_size))
            for number, material in enumerate(self.materials)
            if isinstance(material, PathDependent)
        }

    def plastic_strain(self, states: Mapping[int, Array]) -> Array | None:
        """The accumulated plastic strain at the points of quadrature of the cells that this rank owns, shape (c, q),
        zero in materials that have none; None: there is no other; for ``states`` see ``of_body``.
        """
        total: Array | None = None
        for number, state in states.items():
            material = self.materials[number]
            assert isinstance(material, PathDependent)
            reached = material.plastic_strain(state.reshape(-1, material.state_size))
            if reached is not None:
                total = np.zeros((len(self._made_of), state.shape[1])) if total is None else total
                inside = np.flatnonzero(self._made_of == number)
                total[inside] = reached.reshape(state.shape[:2])[self._place[inside]]
        return total

    def _cauchy_of_part(self, y: Array, points: Array, step: float, *, shape: bool) -> tuple[Array, Array]:
        """The places, and the Cauchy stress of the shape, or of the volume, shape (c, q, 3, 3)."""
        places: list[Array] = [np.zeros((0, len(points), self.across))]
        stresses: list[Array] = [np.zeros((0, len(points), 3, 3))]
        finite = any(isinstance(material, Hyperelastic) for material in self.materials)
        free, _ = self.strain(step, 1.0)
        for part, gradient, _, _ in self.gradients(y, points):
            change = _in_space(gradient)
            stress = self._by_material(part.cells, change, None if free is None else free(part), shape=shape)
            if finite:
                deformed = np.eye(3) + change
                stress = stress @ deformed.swapaxes(-1, -2) / np.linalg.det(deformed)[..., None, None]
            places.append(self.positions(part))
            stresses.append(stress)
        return np.concatenate(places), np.concatenate(stresses)

    def _of_shape(self, cells: Indices, gradient: Array, initial: Array | None) -> tuple[Array, float]:
        return _in_mesh(self._by_material(cells, _in_space(gradient), initial, shape=True), len(gradient)), 0.0

    def _of_volume(self, cells: Indices, gradient: Array, initial: Array | None) -> tuple[Array, float]:
        return _in_mesh(self._by_material(cells, _in_space(gradient), initial, shape=False), len(gradient)), 0.0

    def _by_material(self, cells: Indices, change: Array, free: Array | None, *, shape: bool) -> Array:
        """The stress of the shape, or of the volume, from the gradient of the displacement, shapes (c, q, 3, 3), and
        from free expansions, shape (c, q); of finite strains the first Piola-Kirchhoff one.
        """
        stress = np.zeros_like(change)
        for number, material in enumerate(self.materials):
            inside = self._made_of[cells] == number
            if not inside.any():
                continue
            part, points, expansion = change[inside], change.shape[1], None if free is None else free[inside]
            if isinstance(material, Hyperelastic):
                stress[inside] = _finite(material, part, expansion, shape=shape)
                continue
            strain = _strain_of(part, expansion)
            linear = material.at_rest
            if not shape:
                mean = np.trace(strain, axis1=-2, axis2=-1)[..., None, None]
                stress[inside] = linear.young / (3 - 6 * linear.poisson) * mean * np.eye(3)
            elif isinstance(material, PathDependent):
                state = self._states[number][self._place[cells[inside]]].reshape(-1, material.state_size)
                responded = material.at_time(self._time).respond_at(strain.reshape(-1, 3, 3), state)
                stress[inside] = responded.reshape(-1, points, 3, 3)
            else:
                stress[inside] = deviator(material.stress_at(strain))
        return stress


class _DisplacedPoints(QuadraturePoints):
    """Points of quadrature, ``position`` where they have moved to."""

    @property
    def position(self) -> Array:
        """X + u, shape (f, q, d)."""
        return super().position + self.displacement


def _at_displaced_points(load: Force, at: QuadraturePoints) -> Array:
    """The density of a load where points have moved to."""
    return load.density_at(_DisplacedPoints(**vars(at)))


def _in_space(gradient: Array) -> Array:
    """From shape (k, k, c, q) to (c, q, 3, 3), with zeros across a plane mesh."""
    dim = len(gradient)
    change = np.zeros((*gradient.shape[2:], 3, 3))
    change[..., :dim, :dim] = np.moveaxis(gradient, (0, 1), (2, 3))
    return change


def _in_mesh(stress: Array, dim: int) -> Array:
    """From shape (c, q, 3, 3) to (dim, dim, c, q)."""
    return np.moveaxis(stress[..., :dim, :dim], (2, 3), (0, 1))


def through_points(element: Any, points: Array, weights: Array) -> Array | None:
    """What takes values at points of a reference cell to the coefficients of the nearest function of a Lagrange
    element, shape (n, q); None: the points do not determine it.

    Args:
        element: of basix, with n functions.
        points: of the cell, shape (q, t).
        weights: of the points, shape (q,).
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


def _strain_of(change: Array, free: Array | None) -> Array:
    """The linearised strain, shape (..., 3, 3), without a free expansion, shape (...)."""
    strain = (change + change.swapaxes(-1, -2)) / 2
    return strain if free is None else strain - free[..., None, None] * np.eye(3)


def _finite(material: Hyperelastic, change: Array, free: Array | None, *, shape: bool) -> Array:
    """The first Piola-Kirchhoff stress of the shape, or of the volume, from grad u, shape (..., 3, 3), and from a free
    expansion, shape (...).
    """
    if free is not None:
        stretch = 1 + free[..., None, None]
        elastic = (change - free[..., None, None] * np.eye(3)) / stretch
        return np.asarray(stretch**2 * _finite(material, elastic, None, shape=shape))
    if shape:
        return material.shape_stress_by_change(change)
    growth, inverse = growth_at(change), inverse_transposed(np.eye(3) + change)
    return np.asarray((material.volume_stress_by_change(growth) * (1 + growth))[..., None, None] * inverse)
