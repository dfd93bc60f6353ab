"""Friction that depends on the direction of slip, in space: an ellipse in place of the disc.

Along an axis e_1 in the tangent plane the bound is g, along e_2 across it r g:

    (mu . e_1)^2 + (mu . e_2 / r)^2 <= g^2,

and the slip is normal to the ellipse (the associated rule; Z. Mroz and S. Stupkiewicz, Int. J. Solids Structures 31
(1994) 2027-2040).  With the tangents (e_1, r e_2) in place of orthonormal ones the components of the shear, in mu =
mu_1 e_1 + mu_2 r e_2, fill the disc |(mu_1, mu_2)| <= g, those of the slip are s . e_1 and r s . e_2, and the normal of
the ellipse is that of the disc.  So everything that works in the frame of a point, the laws, Newton's method and
statics, is what it is for the disc.  Vectors in space are made with these tangents for forces, and for displacements
with ``ContactBoundary.cotangents``, (e_1, e_2 / r).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx import parallel
from signorini_fx.errors import FormError

Array = npt.NDArray[np.float64]

# The part of a vector in the tangent plane below this share of the longest vector is round-off.
_NO_DIRECTION = 1e-6
# Ratios beyond this, or below its inverse, leave no digits.
LARGEST_RATIO = 1e3
# What supports leave free is told along the axes if its other components are below this.
_ALONG = 1e-8


@dataclass(frozen=True)
class Ellipse:
    """The friction ellipse of each of n points.

    Attributes:
        along: a vector whose part in the tangent plane is along e_1, shape (n, 3); zero: friction has no direction.
        ratio: r, shape (n,).
    """

    along: Array
    ratio: Array

    @classmethod
    def disc(cls, count: int) -> Ellipse:
        """That of points without direction."""
        return cls(np.zeros((count, 3)), np.ones(count))

    def axes(self, normal: Array, otherwise: Array) -> Array:
        """(e_1, e_2), one per column, shape (n, 3, 2); ``otherwise`` where friction has no direction."""
        directed = np.asarray(self.along.any(axis=1))
        first = self.along - np.einsum("ni,ni->n", self.along, normal)[:, None] * normal
        first /= np.where(directed, np.linalg.norm(first, axis=1), 1.0)[:, None]
        return np.where(directed[:, None, None], np.stack((first, np.cross(normal, first)), axis=2), otherwise)

    @property
    def scale(self) -> Array:
        """What the axes are multiplied by, (1, r), shape (n, 1, 2)."""
        return np.stack((np.ones_like(self.ratio), self.ratio), axis=1)[:, None]


def ellipse_of(friction: Any, at: Any, path: str, space: fem.FunctionSpace) -> Ellipse | None:
    """The ellipses of one foundation at all nodes of this rank; None: its friction has no direction; collective.

    Args:
        friction: ``Coulomb`` or ``Tresca``; None: there is none.
        at: evaluates data at nodes, see ``NodalValues``.
        path: of the friction law, for errors.
        space: the displacements.

    Raises:
        FormError: it is plane, or a value is wrong somewhere.
    """
    if friction is None or friction.ratio is None:
        return None
    if space.mesh.geometry.dim < 3:
        raise FormError([(f"{path}.ratio", "the mesh is plane: friction has one direction there, leave it out")])
    ratio = at(friction.ratio, f"{path}.ratio", minimum=0.0)
    if parallel.any_rank(space.mesh.comm, bool(((ratio < 1 / LARGEST_RATIO) | (ratio > LARGEST_RATIO)).any())):
        raise FormError([(f"{path}.ratio", f"must be between {1 / LARGEST_RATIO:g} and {LARGEST_RATIO:g}")])
    along = np.tile([1.0, 0.0, 0.0], (ratio.size, 1))
    if friction.along is not None:
        along = at(friction.along, f"{path}.along", 3)
    return Ellipse(along, ratio)


def check_axes(normal: Array, ellipse: Ellipse, path: str, comm: Any) -> None:
    """Whether the axes have a direction at the points of one foundation, n of them; collective.

    Raises:
        FormError: they have none somewhere.
    """
    across = np.linalg.norm(np.cross(normal, ellipse.along), axis=1)
    longest = parallel.largest(comm, np.linalg.norm(ellipse.along, axis=1))
    if parallel.any_rank(comm, not (across > _NO_DIRECTION * longest).all()):
        reason = "is zero or along the normal somewhere: it must have a part along the foundation"
        raise FormError([(f"{path}.along", reason)])


def check_supports(movable: Array, path: str, comm: Any) -> None:
    """Whether supports are along the axes; collective.

    Args:
        movable: see ``ContactPoints``.
        path: of the friction law, for errors.
        comm: the ranks.

    Raises:
        FormError: they are not.
    """
    if parallel.any_rank(comm, bool((np.abs(movable * (1 - np.eye(3))) > _ALONG).any())):
        why = "a support prescribes the displacement there neither along nor across it, nor along the normal"
        raise FormError([(f"{path}.along", f"{why}, which is not possible yet with a ratio")])
