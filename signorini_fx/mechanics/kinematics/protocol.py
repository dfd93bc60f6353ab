"""What every kind of kinematics answers; what stands here are small displacements in Cartesian coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt

_Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Kinematics:
    """Which displacements a body has, and the strains, measures and rigid motions that belong to them.

    Attributes:
        words: what it is called.
        dimension: d, components of the displacement.
        rotations: the two axes of each rotation, which turns the first towards the second; in 3D the rotation about
            x[0] is first.
        normal_out: whether the components of the strain include that along x[2], which is across the mesh.
        out_of_section: components of the displacement along x[2], which is across the mesh.
        prevented: whether a strain across the mesh is prevented, so that there is a stress.
        whole: whether forces are those of the whole body; else they are per unit of length across the mesh.
        uniform: whether areas and lengths of the mesh are those of the body, up to ``depth``, everywhere alike.
        further_degrees: by how much the quadrature degree of products of strains is higher, as strains or the measure
            are no polynomials of the degree that the displacement has.
        motions_without_strain: which translations and rotations about the origin have no strain; None: all.
        zero_on_axis: components of the displacement that vanish where x[0] = 0.
        least_x: the smallest x[0] that a mesh may have.
        refuses: what does not go together with it, by its name, and why.
    """

    words: str
    dimension: int
    rotations: tuple[tuple[int, int], ...]
    normal_out: bool = False
    out_of_section: int = 0
    prevented: bool = False
    whole: bool = False
    uniform: bool = True
    further_degrees: int = 0
    motions_without_strain: tuple[bool, ...] | None = None
    zero_on_axis: tuple[int, ...] = ()
    least_x: float = -np.inf
    refuses: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def motions(self) -> int:
        """Number of rigid motions: d translations and the rotations."""
        return self.dimension + len(self.rotations)

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """The components of a symmetric tensor: the normal ones, the shears, and zz with ``normal_out``."""
        axes = range(self.dimension)
        return [*((k, k) for k in axes), *combinations(axes, 2), *([(2, 2)] if self.normal_out else [])]

    @property
    def stressed(self) -> list[tuple[int, int]]:
        """The components of the stress: with ``prevented`` also zz."""
        return [*self.pairs, *([(2, 2)] if self.prevented else [])]

    @property
    def directions(self) -> int:
        """In how many directions a uniform strain meets a stiffness; in plane stress it is free out of the plane."""
        return sum(i == j for i, j in self.stressed)

    def tensors(self, components: _Floats) -> _Floats:
        """Symmetric tensors, shape (..., 3, 3), from their components, with zeros out of the plane."""
        tensors = np.zeros((*components.shape[:-1], 3, 3))
        for column, (i, j) in enumerate(self.pairs):
            tensors[..., i, j] = tensors[..., j, i] = components[..., column]
        return tensors

    def turned(self, arms: _Floats, vectors: _Floats) -> _Floats:
        """Arms times vectors, shape (..., d): moments of forces, one per rotation, shape (..., rotations)."""
        pairs = ((arms[..., i] * vectors[..., j], arms[..., j] * vectors[..., i]) for i, j in self.rotations)
        return np.stack([positive - negative for positive, negative in pairs], axis=-1)

    @cached_property
    def unbalanced(self) -> npt.NDArray[np.bool_]:
        """Along which rigid motions forces on the whole body do not cancel by symmetry, shape (motions,)."""
        return np.array(self.motions_without_strain or (True,) * self.motions)

    def refused_axis(self, axis: tuple[float, ...] | None, about: tuple[float, ...] | None = None) -> str:
        """Why nothing acts along or about an axis, x[2] unless given, through a point; empty: it may."""
        return ""

    def depth(self, size: float) -> float:
        """What areas of the mesh are multiplied by in a body of this size, about."""
        return 1.0

    # --- forms -------------------------------------------------------------------------------------------------------

    def strain(self, y: Any, *, on_axis: bool = False) -> Any:
        """Linearised strain, epsilon(y) of section 2.1, UFL, shape (d, d), or (3, 3) with ``normal_out``.

        Args:
            y: the displacement.
            on_axis: whether it is wanted where x[0] = 0 too, as a limit.
        """
        import ufl

        return ufl.sym(ufl.grad(y))

    def gradient(self, y: Any) -> Any:
        """Gradient of the displacement at finite strains, with what is across the mesh, UFL, shape (3, 3)."""
        import ufl

        slope, axes = ufl.grad(y), range(self.dimension)
        return ufl.as_tensor([[slope[i, j] if i in axes and j in axes else 0 for j in range(3)] for i in range(3)])

    def measure(self, x: Any) -> Any:
        """By what areas and lengths of the mesh are multiplied at x, UFL of shape (d,) or numbers of shape (d, n)."""
        return 1

    def measure_at(self, x: _Floats) -> _Floats | None:
        """``measure`` at points of shape (..., d), not below zero by round-off, shape (...); None: 1."""
        return None if self.uniform else np.maximum(self.measure(np.moveaxis(x, -1, 0)), 0.0)


# Plane stress, of a thin body without stress across its plane, is the affair of the material.
SPACE = Kinematics("in 3D", 3, ((1, 2), (2, 0), (0, 1)), whole=True)
PLANE_STRAIN = Kinematics("plane strain", 2, ((0, 1),), prevented=True)
PLANE_STRESS = Kinematics(
    "plane stress",
    2,
    ((0, 1),),
    refuses={"mixed element": "'mixed' is of no use in plane stress: nothing locks"},
)


def position(y: Any) -> Any:
    """The place that an expression is taken at, UFL."""
    import ufl

    return ufl.SpatialCoordinate(ufl.domain.extract_unique_domain(y))
