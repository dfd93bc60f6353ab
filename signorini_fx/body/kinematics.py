"""What depends on the dimension of space: strains, components of tensors, rotations and moments."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl

_Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Kinematics:
    """Small displacements of a body in the plane or in space.

    Attributes:
        dimension: d.
        rotations: the two axes of each rotation, which turns the first towards the second; in space the rotation about
            x[0] is first.
        hoop: whether there are strain and stress along the circumference, of an axisymmetric body.
    """

    dimension: int
    rotations: tuple[tuple[int, int], ...]
    hoop: bool = False

    @property
    def motions(self) -> int:
        """Number of rigid motions: d translations and the rotations."""
        return self.dimension + len(self.rotations)

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """The components of a symmetric tensor: xx, yy, xy in the plane, of an axisymmetric body also zz, and in space
        xx, yy, zz, xy, xz, yz.
        """
        axes = range(self.dimension)
        return [*((k, k) for k in axes), *combinations(axes, 2), *([(2, 2)] if self.hoop else [])]

    def components(self, tensor: Any) -> Any:
        """The components ``pairs`` of a symmetric tensor as a UFL vector."""
        return ufl.as_vector([tensor[i, j] for i, j in self.pairs])

    def tensors(self, components: _Floats) -> _Floats:
        """Symmetric tensors from their components, shape (..., components), with zeros out of the plane, shape
        (..., 3, 3).
        """
        tensors = np.zeros((*components.shape[:-1], 3, 3))
        for column, (i, j) in enumerate(self.pairs):
            tensors[..., i, j] = tensors[..., j, i] = components[..., column]
        return tensors

    def turned(self, arms: _Floats, vectors: _Floats) -> _Floats:
        """Arms times vectors, shape (..., d): moments of forces, one per rotation, shape (..., rotations)."""
        pairs = ((arms[..., i] * vectors[..., j], arms[..., j] * vectors[..., i]) for i, j in self.rotations)
        return np.stack([positive - negative for positive, negative in pairs], axis=-1)


AXISYMMETRIC = Kinematics(2, ((0, 1),), hoop=True)
KINEMATICS = {2: Kinematics(2, ((0, 1),)), 3: Kinematics(3, ((1, 2), (2, 0), (0, 1)))}
