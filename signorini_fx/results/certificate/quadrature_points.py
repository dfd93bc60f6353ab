"""Values of a scene at points of quadrature, for what is integrated without any compiled form."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.statement.effect import Effect
from signorini_fx.results.certificate.surface_quadrature import QuadratureFacets

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class QuadraturePoints:
    """Points of quadrature in cells or on facets with equal places in the reference cell, ``statement.effect.Points``.

    Attributes:
        forces: ``NodalForces`` of the body.
        part: the cells.
        size: length, area or volume that each point stands for, shape (f, q).
        y: nodal displacements with ghosts, shape (nodes, d).
        whole: the integral of ``Effect.weighting`` of the effect that is integrated.
    """

    forces: Any
    part: QuadratureFacets
    size: Array
    y: Array
    whole: float = np.nan

    @property
    def position(self) -> Array:
        """X, shape (f, q, d)."""
        return self._padded(self.forces.positions(self.part))

    @property
    def density(self) -> Array:
        """Mass per volume, shape (f, 1)."""
        return self._of_material("density")

    @property
    def expansion(self) -> Array:
        """Coefficient of thermal expansion, shape (f, 1)."""
        return self._of_material("expansion")

    def _of_material(self, key: str) -> Array:
        (constants,) = self.forces.of_materials(lambda material: (getattr(material, key) or 0.0,))
        return constants[:, None] if constants.size == 1 else constants[self.part.cells, None]

    def value_in(self, region: str | None, value: Any) -> Array:
        """A value at points in a region, 0 at others, shape (f, q); see ``BodyCoefficients``."""
        if region is None:
            return self.value(value)
        rows = np.flatnonzero(np.isin(self.part.cells, self.forces.tagged.cells(region)))
        values = np.zeros((len(self.part.cells), len(self.part.table.shape)))
        if rows.size:
            values[rows] = self.forces.values(value, replace(self.part, cells=self.part.cells[rows]))
        return values

    def total(self, effect: Effect) -> float:
        """See ``Coefficients``."""
        return self.whole

    @property
    def normal(self) -> Array:
        """Outward unit normal, shape (f, q, d)."""
        return self._padded(self.part.moment / self.size[:, :, None])

    def _padded(self, vectors: Array) -> Array:
        """Vectors in a section, with the component out of it."""
        missing = self.forces.dimension - vectors.shape[2]
        return np.pad(vectors, ((0, 0), (0, 0), (0, missing))) if missing else vectors

    @property
    def displacement(self) -> Array:
        """y, shape (f, q, d)."""
        return np.asarray(self.part.table.shape @ self.y[self.forces.space.dofmap.list[self.part.cells]])

    def value(self, value: Any) -> Array:
        """A number, an expression, or a callable, which the discretisation interpolates at nodes, shape (f, q)."""
        return self.forces.values(value, self.part)

    def vector(self, values: tuple[Any, ...]) -> Array:
        """Values along the axes, shape (f, q, d)."""
        return np.stack([self.value(value) for value in values[: self.forces.dimension]], axis=2)
