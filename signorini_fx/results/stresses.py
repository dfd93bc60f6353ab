"""The stress of a solution: its tensor, the von Mises stress, principal stresses, and where they are largest."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from mpi4py import MPI

from signorini_fx.body.discretisation import Discretisation
from signorini_fx.body.material import out_of_plane_stress, stress
from signorini_fx.results.interpolation import interpolated

Nodal = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Extreme:
    """The smallest or largest value of a field, and where.

    Attributes:
        value: a stress.
        place: a point, length, shape (d,).
    """

    value: float
    place: tuple[float, ...]


@dataclass(frozen=True, repr=False)
class Stresses:
    """The stress of a displacement in each cell, as the derivatives of the displacement give it.

    It is discontinuous from cell to cell and a power of h less accurate than the displacement; values at corners of
    the body, at ends of supports and at a contact edge may have no limit as the mesh is refined.  Every field is made
    when it is first asked for; making it is collective.

    Attributes:
        discretisation: the body.
        displacement: y, a finite element function.
        hypothesis: plane strain or plane stress; of no meaning in space.
    """

    discretisation: Discretisation
    displacement: fem.Function
    hypothesis: str

    def __repr__(self) -> str:
        return f"<Stresses of {self.discretisation.dofs} unknowns: tensor, von_mises, principal, largest(), smallest()>"

    @cached_property
    def tensor(self) -> fem.Function:
        """Sigma with all components in space, also in the plane, where (2, 2) is that of the hypothesis; a stress,
        shape (3, 3), discontinuous and of the degree of the element.
        """
        d, y = self.discretisation, self.displacement
        degree = max(d.scene.element.degree, 1)
        sigma = stress(y, *d.lame)
        if d.tagged.dimension == 2:
            out = out_of_plane_stress(y, d.lame[0], self.hypothesis)
            sigma = ufl.as_tensor(
                [[sigma[0, 0], sigma[0, 1], 0 * out], [sigma[1, 0], sigma[1, 1], 0 * out], [0 * out, 0 * out, out]]
            )
        return interpolated(sigma, fem.functionspace(d.tagged.mesh, ("DG", degree, (3, 3))), "stress")

    @cached_property
    def von_mises(self) -> fem.Function:
        """The von Mises stress, sqrt(3/2) |dev sigma|."""
        sigma = self._nodal()
        deviator = sigma - np.trace(sigma, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
        return self._function("von_mises", np.sqrt(1.5 * np.einsum("ijk,ijk->i", deviator, deviator)))

    @cached_property
    def principal(self) -> fem.Function:
        """The principal stresses, the largest (most tensile) first, shape (3,); in the plane one of them acts out of
        it.
        """
        sigma = self._nodal()
        known = np.isfinite(sigma).all(axis=(1, 2))  # a solve that failed may leave anything behind
        values = np.full((len(sigma), 3), np.nan)
        values[known] = np.linalg.eigvalsh(sigma[known])[:, ::-1]
        return self._function("principal_stresses", values)

    def largest(self, field: str = "von_mises", component: int = 0) -> Extreme:
        """Where a field is largest; collective.

        Args:
            field: ``von_mises`` or ``principal``.
            component: of the principal stresses; of no meaning for the von Mises stress.

        Raises:
            ValueError: there is no such field.
        """
        return self._extreme(field, component, sign=1.0)

    def smallest(self, field: str = "principal", component: int = 2) -> Extreme:
        """Where a field is smallest, see ``largest``: by default the largest compression."""
        return self._extreme(field, component, sign=-1.0)

    def as_dict(self) -> dict[str, dict[str, object]]:
        """Extremes of the von Mises stress and of the principal stresses, JSON-safe; collective."""
        found = {
            "von_mises": self.largest(),
            "largest_principal": self.largest("principal", 0),
            "smallest_principal": self.smallest(),
        }
        return {name: {"value": one.value, "place": list(one.place)} for name, one in found.items()}

    def _extreme(self, field: str, component: int, *, sign: float) -> Extreme:
        if field not in ("von_mises", "principal"):
            raise ValueError(f"{field!r} is no field with extremes: take 'von_mises' or 'principal'")
        function: fem.Function = getattr(self, field)
        d, space = self.discretisation, function.function_space
        component = min(component, space.dofmap.bs - 1)
        values = sign * function.x.array.reshape(-1, space.dofmap.bs)[: space.dofmap.index_map.size_local, component]
        x = space.tabulate_dof_coordinates()[:, : d.tagged.dimension]
        values = np.where(np.isfinite(values), values, -np.inf)
        at = int(values.argmax()) if values.size else 0
        own = float(values[at]) if values.size else -np.inf
        best, rank = d.comm.allreduce((own, -d.comm.rank), op=MPI.MAX)
        place = d.comm.bcast(tuple(map(float, x[at])) if -rank == d.comm.rank and values.size else (), root=-rank)
        return Extreme(sign * best, place)

    def _nodal(self) -> Nodal:
        """The tensor at the points of its function space on this rank, shape (n, 3, 3)."""
        return np.asarray(self.tensor.x.array.reshape(-1, 3, 3), dtype=np.float64)

    def _function(self, name: str, values: Nodal) -> fem.Function:
        """A field on the points of the tensor, which all spaces of one degree number alike."""
        space = self.tensor.function_space
        degree, shape = space.element.basix_element.degree, values.shape[1:]
        element = ("DG", degree, shape) if shape else ("DG", degree)
        function = fem.Function(fem.functionspace(space.mesh, element), name=name)
        assert np.array_equal(function.function_space.dofmap.list, space.dofmap.list)
        function.x.array[:] = values.ravel()
        return function
