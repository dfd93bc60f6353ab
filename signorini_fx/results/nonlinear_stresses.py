"""The Cauchy stress of bodies of nonlinear materials, from their states and their UFL.

It is evaluated at the points of quadrature, where the material is; extremes are those of these points.  The fields are
polynomials of degree k - 1 in each cell of degree k, the nearest ones to the values at its points: those of a higher
degree would leave the yield surface at the nodes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.mechanics.elasticity.elastic_law import ElementStress, within
from signorini_fx.mechanics.model import Model
from signorini_fx.results.certificate.nonlinear_forces import NonlinearForces, PointStress, through_points
from signorini_fx.results.stresses import (
    COMPONENTS,
    Extreme,
    RawStresses,
    check_has_extremes,
    extreme_at,
    not_recovered,
    principal_of,
    von_mises_of,
)

Array = npt.NDArray[np.float64]


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
        stress = ElementStress(y, kinematics, within(tensor, dim), outward, not_recovered, None, None)
        recovers = not_recovered, not_recovered
        return cls(stress, *recovers, filled=tensor, at_points=at_points, model=model, plastic=plastic)

    @property
    def recovers(self) -> bool:
        return False

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

    def largest_plastic_strain(self) -> Extreme | None:
        return None if self.plastic is None else self._extreme_of_points(self.plastic, 1.0)

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

        def cell_of(at: int) -> int:
            cell = np.array([at // x.shape[1]], dtype=np.int32)
            return int(mesh.topology.index_map(mesh.topology.dim).local_to_global(cell)[0])

        return extreme_at(self.comm, values.ravel(), x.reshape(-1, x.shape[2]), cell_of, sign)


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
