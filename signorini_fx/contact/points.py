"""The contact points of this rank: their weights, and the directions in which supports let them move.

Everything is told in the frame (n, T) of each point, normal first, so that no coordinates are needed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from signorini_fx import parallel
from signorini_fx.contact.laws import Nodal

# A direction has a component along another one if it is larger than this.
_ALONG = 1e-8


@dataclass(frozen=True)
class ContactPoints:
    """The contact points of this rank, n of them.

    Attributes:
        comm: the ranks that share the points.
        weight: w, the area (in the plane: length) that belongs to a point, shape (n,).
        movable: orthogonal projector onto the directions in which something at the point can move, in its frame,
            shape (n, d, d); the identity where nothing is prescribed.
        x: position, length, shape (n, m): says which of several equal points comes first, alike on any number of ranks.
    """

    comm: MPI.Comm
    weight: Nodal
    movable: Nodal
    x: Nodal

    @property
    def size(self) -> int:
        """Number of contact points on this rank."""
        return int(self.weight.size)

    @property
    def dimension(self) -> int:
        """The dimension d of space."""
        return int(self.movable.shape[1])

    @property
    def everywhere(self) -> npt.NDArray[np.bool_]:
        """True at all points, shape (n,)."""
        return np.ones(self.size, dtype=bool)

    @property
    def immovable(self) -> npt.NDArray[np.bool_]:
        """Points that cannot move along their normal because they are free only perpendicular to it, shape (n,).

        The support takes the normal contact force at these points.
        """
        return np.asarray(np.linalg.norm(self.movable[:, 0], axis=1) <= _ALONG)

    @cached_property
    def still(self) -> Nodal:
        """Projections onto the tangential directions in which supports let a point not move, shape (n, d - 1, d - 1).

        A shear along them does nothing to the body, so only the friction law says what it is.
        """
        values, vectors = np.linalg.eigh(self.movable[:, 1:, 1:])
        return np.einsum("nik,nk,njk->nij", vectors, np.where(values <= _ALONG, 1.0, 0.0), vectors)

    def norm(self, values: Nodal) -> float:
        """The norm of L2(Gamma_c) by the nodal rule, of scalars (n,) or vectors (n, k); collective."""
        squares = np.tensordot(self.weight, values**2, axes=1).sum()
        return float(np.sqrt(parallel.global_sum(self.comm, squares)))

    def felt(self, values: Nodal, beside: Nodal | None = None) -> Nodal:
        """Size of the part of a pressure (n,) or a shear (n, d - 1) that no support takes, stress, shape (n,).

        A support may press a node into the foundation.  The pressure there is that of the penalty, however large, and
        does nothing to the body: it is no scale for other nodes.  Neither is what the other one of the two undoes.

        Args:
            values: the pressure or the shear.
            beside: the other one; None: it is not looked at.
        """
        alone = self._felt(values)
        size = np.asarray(np.linalg.norm(alone, axis=1))
        return size if beside is None else np.minimum(size, np.linalg.norm(alone + self._felt(beside), axis=1))

    def scale(self, values: Nodal, beside: Nodal | None = None) -> float:
        """The norm of what the body feels of a pressure or a shear; zero if supports take all of it; collective."""
        return self.norm(self.felt(values, beside))

    def _felt(self, values: Nodal) -> Nodal:
        """A pressure (n,) or a shear (n, d - 1) as vectors without what supports take, shape (n, d)."""
        if values.ndim == 1:
            return self.movable[:, :, 0] * values[:, None]
        return np.asarray(np.einsum("nij,nj->ni", self.movable[:, :, 1:], values))
