"""Friction that depends on the direction of slip, in 3D: an ellipse in place of the disc, a
modifier of other laws.

The bound along an axis e_1 in the tangent plane is g, along e_2 across it r g, and the slip is
normal to the ellipse (Z. Mroz and S. Stupkiewicz, Int. J. Solids Structures 31 (1994) 2027-2040).
With the tangents (e_1, r e_2) in place of orthonormal ones the shear mu = mu_1 e_1 + mu_2 r e_2
fills the disc |(mu_1, mu_2)| <= g, the slip has the components s . e_1 and r s . e_2, and the
normal of the ellipse is that of the disc: everything in the frame of a point is what it is for the
disc.  Displacements in 3D are made with ``ContactBoundary.cotangents``, (e_1, e_2 / r).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import BeforeValidator, Field, WithJsonSchema, WrapValidator, model_validator

from signorini_fx.arrays import Array, Flags, Integers, inner
from signorini_fx.errors import FormError
from signorini_fx.mechanics.laws.protocol import FrictionLaw
from signorini_fx.mechanics.statement.base import refused
from signorini_fx.mechanics.statement.expressions import sample
from signorini_fx.mechanics.statement.values import Entries, SampledValue, value
from signorini_fx.tuned import CERTIFICATE_TOLERANCE, ROOT_OF_EPS

if TYPE_CHECKING:
    from mpi4py import MPI

Ratio = Annotated[Any, BeforeValidator(value), WithJsonSchema({"type": ["number", "string"]})]
VectorField = Annotated[
    Entries[SampledValue],
    Field(min_length=3, max_length=3),
    WrapValidator(
        lambda given, handler: (
            given if callable(given) or hasattr(given, "ufl_shape") else handler(given)
        )
    ),
]


@dataclass(frozen=True)
class FrictionAxes:
    """The axes of friction at each of n points."""

    # Vectors whose part in the tangent plane is along e_1, shape (n, 3); zero: friction does not
    # depend on the direction.
    along: Array
    ratio: Array  # r, shape (n,)

    @classmethod
    def joined(
        cls, parts: Sequence[FrictionAxes | None], sizes: Sequence[int]
    ) -> FrictionAxes | None:
        """Return the axes of several boundaries as one; None if no friction depends on the
        direction.

        Args:
            parts: axes of each boundary; None: its friction is the same in all directions.
            sizes: number of points of each.
        """
        if not any(parts):
            return None
        # Zero vectors: friction that does not depend on the direction.
        axes = [
            part or cls(np.zeros((size, 3)), np.ones(size))
            for part, size in zip(parts, sizes, strict=True)
        ]
        return cls(
            np.concatenate([part.along for part in axes]),
            np.concatenate([part.ratio for part in axes]),
        )

    def at(self, points: Flags | Integers | slice) -> FrictionAxes:
        """Return the axes of some of the points."""
        return FrictionAxes(self.along[points], self.ratio[points])

    def directions(self, normal: Array, otherwise: Array) -> Array:
        """Return (e_1, e_2), one per column, shape (n, 3, 2).

        Args:
            normal: unit normals, shape (n, 3).
            otherwise: tangents for points where friction does not depend on the direction.
        """
        directed = np.asarray(self.along.any(axis=1))
        first = self.along - inner(self.along, normal)[:, None] * normal
        first /= np.where(directed, np.linalg.norm(first, axis=1), 1.0)[:, None]
        return np.where(
            directed[:, None, None], np.stack((first, np.cross(normal, first)), axis=2), otherwise
        )

    @property
    def scale(self) -> Array:
        """The factors (1, r) of the axes, shape (n, 1, 2)."""
        return np.stack((np.ones_like(self.ratio), self.ratio), axis=1)[:, None]

    def check(self, normal: Array, movable: Callable[[], Array], path: str, comm: MPI.Comm) -> None:
        """Raise an error if axes have no direction at points of a foundation, or supports are not
        along them; collective.

        Args:
            normal: unit normals of the points, shape (n, 3).
            movable: returns ``ContactPoints.movable`` along these axes.
            path: of the law, for errors.
            comm: the ranks.
        """
        from signorini_fx.machine import parallel

        across = np.linalg.norm(np.cross(normal, self.along), axis=1)
        longest = parallel.largest(comm, np.linalg.norm(self.along, axis=1))
        reason = "is zero or along the normal somewhere: it must have a part along the foundation"
        _refuse_where(~(across > CERTIFICATE_TOLERANCE * longest), f"{path}.along", reason, comm)
        self.check_supports(movable(), path, comm)

    def check_supports(self, movable: Array, path: str, comm: MPI.Comm) -> None:
        """Raise an error if supports prescribe displacements that are not along the axes, see
        ``check``; collective.
        """
        askew = np.abs(movable[self.along.any(axis=1)] * (1 - np.eye(3))) > ROOT_OF_EPS
        why = (
            "a support prescribes the displacement there neither along nor across it, nor along "
            "the normal"
        )
        _refuse_where(
            askew, f"{path}.along", f"{why}, which is not possible yet with a ratio", comm
        )


def _refuse_where(wrong: Flags, key: str, reason: str, comm: MPI.Comm) -> None:
    """Raise an error on all ranks if any point of any rank is wrong; collective."""
    from signorini_fx.machine import parallel

    if parallel.any_rank(comm, wrong):
        raise FormError.at(key, reason)


class DirectedLaw(FrictionLaw):
    """A friction law that may depend on the direction of slip, in 3D.

    Attributes:
        law: its name.
        ratio: friction across ``along`` divided by friction along it; None: friction is the same in
            all directions.
        along: a vector, of which the part in the tangent plane counts; None: along x[0].
    """

    apart: ClassVar[tuple[str, ...]] = ("law", "ratio", "along")

    ratio: Ratio | None = None
    along: VectorField | None = None

    @model_validator(mode="after")
    def _both(self) -> Self:
        if self.along is not None and self.ratio is None:
            raise refused(
                type(self).__name__, [(("along",), "needs a ratio, of the friction across it")]
            )
        return self

    @property
    def directed(self) -> bool:
        """Whether the friction depends on the direction of slip."""
        return self.ratio is not None

    def vectors(self, x: Array) -> Array:
        """Return ``along`` at points, both of shape (3, n)."""
        along = self.along or (1.0, 0.0, 0.0)
        return np.asarray(
            along(x) if callable(along) else [sample(component, x) for component in along]
        )

    def axes(
        self, at: Callable[..., Array], path: str, dimension: int, comm: MPI.Comm
    ) -> FrictionAxes | None:
        """Return the axes of friction at nodes; None if it is the same in all directions;
        collective.

        Args:
            at: evaluates data at nodes, see ``assembly.nodal_values.NodalValues``.
            path: of the law, for errors.
            dimension: of the mesh.
            comm: the ranks.
        """
        if self.ratio is None:
            return None
        if dimension < 3:
            raise FormError.at(
                f"{path}.ratio", "the mesh is plane: friction has one direction there, leave it out"
            )
        ratio = at(self.ratio, f"{path}.ratio", minimum=0.0)
        _refuse_where(np.isfinite(ratio) & ~(ratio > 0), f"{path}.ratio", "must be above 0", comm)
        form = hasattr(self.along, "ufl_shape")
        return FrictionAxes(at(self.along if form else self.vectors, f"{path}.along", 3), ratio)
