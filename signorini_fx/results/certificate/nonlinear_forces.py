"""Nodal forces of nonlinear materials by quadrature in NumPy, from what their files say a second time.

As of ``nodal_forces`` no form and no matrix of the solver enters.  Both sides share the rules of quadrature, and of
materials with a state that of the last load step.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.mechanics.body.nonlinear_law import at_rest, cells_of, volume_degree
from signorini_fx.mechanics.materials.nonlinear import Hyperelastic, PathDependent, deviator, inverse_transposed
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.results.certificate.nodal_forces import NodalForces

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int32]


class NonlinearForces(NodalForces):
    """Forces on the nodes of a body of nonlinear materials, see ``NodalForces``.

    Args:
        statement: what is stated of the problem.
        tagged: its mesh.
        space: of the displacement.
    """

    def __init__(self, statement: Statement, tagged: TaggedMesh, space: fem.FunctionSpace) -> None:
        super().__init__(at_rest(statement), tagged, space)
        self._materials, self._reduced = statement.material, volume_degree(statement, tagged)
        owned = len(self._owned_cells)
        self._made_of, self._place = np.zeros(owned, dtype=np.int64), np.zeros(owned, dtype=np.int64)
        for number, material in enumerate(self._materials):
            cells = cells_of(material, statement, tagged)
            self._made_of[cells], self._place[cells] = number, np.arange(cells.size)
        self._states: Mapping[int, Array] = {}

    def of_body(self, displacement: fem.Function, states: Mapping[int, Array]) -> Array:
        """The work of the stress with unit displacements, forces, shape (owned nodes, d); collective.

        Args:
            displacement: y, length.
            states: of the materials with a state, by their numbers, at the end of the last load step, shape (c, q,
                numbers), in the order of their cells.
        """
        y, self._states = displacement.x.array.reshape(-1, self.dimension), states
        degree = max(1, self.degree)
        total = self._part_of_work(y, degree, self._of_shape, None)[0]
        total += self._part_of_work(y, self._reduced or degree, self._of_volume, None)[0]
        return self.over_ranks(total)

    def _of_shape(self, cells: Indices, gradient: Array, initial: Array | None) -> tuple[Array, float]:
        return self._by_material(cells, gradient, shape=True), 0.0

    def _of_volume(self, cells: Indices, gradient: Array, initial: Array | None) -> tuple[Array, float]:
        return self._by_material(cells, gradient, shape=False), 0.0

    def _by_material(self, cells: Indices, gradient: Array, *, shape: bool) -> Array:
        """The stress of the shape, or of the volume, shape (k, k, c, q); of finite strains the first Piola-Kirchhoff
        one.
        """
        dim = len(gradient)
        change = np.zeros((*gradient.shape[2:], 3, 3))
        change[..., :dim, :dim] = np.moveaxis(gradient, (0, 1), (2, 3))
        stress = np.zeros_like(change)
        for number, material in enumerate(self._materials):
            inside = self._made_of[cells] == number
            if not inside.any():
                continue
            part, points = change[inside], change.shape[1]
            if isinstance(material, Hyperelastic):
                stress[inside] = _finite(material, np.eye(3) + part, shape=shape)
                continue
            strain = (part + part.swapaxes(-1, -2)) / 2
            linear = getattr(material, "at_rest", material)
            if not shape:
                mean = np.trace(strain, axis1=-2, axis2=-1)[..., None, None]
                stress[inside] = linear.young / (3 - 6 * linear.poisson) * mean * np.eye(3)
            elif isinstance(material, PathDependent):
                state = self._states[number][self._place[cells[inside]]].reshape(-1, material.state_size)
                responded = material.respond_at(strain.reshape(-1, 3, 3), state)
                stress[inside] = responded.reshape(-1, points, 3, 3)
            else:
                stress[inside] = deviator(material.stress_at(strain))
        return np.moveaxis(stress[..., :dim, :dim], (2, 3), (0, 1))


def _finite(material: Hyperelastic, gradient: Array, *, shape: bool) -> Array:
    """The first Piola-Kirchhoff stress of the shape, or of the volume, shape (..., 3, 3)."""
    if shape:
        return material.shape_stress_at(gradient)
    volume = np.linalg.det(gradient)
    return np.asarray((material.volume_stress_at(volume) * volume)[..., None, None] * inverse_transposed(gradient))
