"""The contact points of this rank: their weights, and the directions in which supports let them
move.

All components are those of the frame (n, T) of each point, normal first, so that no coordinates are
needed.  Points of the same body are judged together, those of different bodies separately: the
forces on one body do not tell whether the iteration has converged on another one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from mpi4py import MPI

from signorini_fx.arrays import Array, Flags, Ints, length, matvec
from signorini_fx.machine import parallel
from signorini_fx.tuned import NO_FORCE, ROOT_OF_EPS, SAME_LENGTH, ZERO_IN_SOLUTION


def pushed(depth: Array, size: float) -> Flags:
    """Return where supports push the body into its foundation by more than round-off, shape (n,).

    Args:
        depth: see ``PointState.held_inside``, length, shape (n,).
        size: of the body, length.
    """
    return depth > SAME_LENGTH * size


@dataclass(frozen=True)
class SharedNodes:
    """Pairs of contact points at the same node, m of them, each pair in both orders.

    Attributes:
        here: the first point, shape (m,).
        beside: the second point, shape (m,).
        normal: normal of the second point in the frame of the first one, shape (m, d).
    """

    here: Ints
    beside: Ints
    normal: Array


@dataclass(frozen=True)
class ContactPoints:
    """The contact points of this rank, n of them.

    Attributes:
        comm: the ranks that share the points.
        weight: w, the area (in 2D: length) that belongs to a point, shape (n,).
        movable: orthogonal projector onto the directions in which the point can move, in its frame,
            shape (n, d, d); the identity where nothing is prescribed.
        x: position, length, shape (n, m); it only breaks ties between equal points, independently
            of the number of ranks.
        shared: points that share a node; None: there are none.
    """

    comm: MPI.Comm
    weight: Array
    movable: Array
    x: Array
    shared: SharedNodes | None = None

    @cached_property
    def size(self) -> int:
        """Number of contact points on this rank."""
        return int(self.weight.size)

    @cached_property
    def dimension(self) -> int:
        """The dimension d of space."""
        return int(self.movable.shape[1])

    @cached_property
    def everywhere(self) -> Flags:
        """True at all points, shape (n,)."""
        return np.ones(self.size, dtype=bool)

    @cached_property
    def immovable(self) -> Flags:
        """Points that cannot move along their normal because they are free only perpendicular to
        it, shape (n,).

        Supports alone determine their gap and would take any pressure: they transmit none.
        """
        return np.linalg.norm(self.movable[:, 0], axis=1) <= ROOT_OF_EPS

    @cached_property
    def still(self) -> Array:
        """Projections onto the tangential directions in which supports hold a point, shape (n, d -
        1, d - 1).

        A shear along them has no effect on the body, so only the friction law determines it.
        """
        return np.eye(self.dimension - 1) - onto_range(self.movable[:, 1:, 1:])

    def dragged(self, slip: Array, motion: Array) -> Flags:
        """Return points that supports move along their tangents, whatever the friction there, shape
        (n,).

        Args:
            slip: the slip that friction opposes, length, shape (n, d - 1).
            motion: (tau_N y, tau_T y), length, shape (n, d).
        """
        return length(matvec(self.still, slip)) > ZERO_IN_SOLUTION * length(motion)

    def closed(self, contact: Flags, entered: Array) -> tuple[Array, Array]:
        """Return the tangential directions in which supports or another contact at the same node
        hold a point.

        Another contact blocks one direction, if one is then left to slip in.  A shear along it and
        the pressures of both contacts only have a common effect.  The displacement along it is due
        to the penetrations of the two contacts, tau_N y - d, which vanish in the limit.

        Args:
            contact: points in contact, shape (n,).
            entered: penetration tau_N y - d, length, shape (n,).

        Returns:
            Projections onto the blocked directions, shape (n, d - 1, d - 1), and the part of the
            displacement along them that is due to ``entered``, length, shape (n, d - 1).
        """
        projections = self.still.copy()
        moved = np.zeros((self.size, self.dimension - 1))
        if self.shared is None:
            return projections, moved
        across = self.shared.normal[:, 1:]
        size = np.linalg.norm(across, axis=1)
        use = contact[self.shared.here] & contact[self.shared.beside] & (size > ROOT_OF_EPS)
        point = self.shared.here[use]
        beside = self.shared.beside[use]
        size = size[use]
        aligned = self.shared.normal[use, 0]
        across = across[use] / size[:, None]
        np.add.at(projections, point, across[:, :, None] * across[:, None, :])
        projections = onto_range(projections)
        moved[point] = across * ((entered[beside] - aligned * entered[point]) / size)[:, None]
        slips = np.trace(projections, axis1=1, axis2=2) < self.dimension - 1.5
        return np.where(slips[:, None, None], projections, self.still), np.where(
            slips[:, None], moved, 0.0
        )

    def norm(self, values: Array) -> float:
        """Return the norm in L2(Gamma_c) by the nodal rule, of scalars (n,) or vectors (n, k);
        collective.
        """
        squares = np.tensordot(self.weight, values**2, axes=1).sum()
        return float(np.sqrt(parallel.global_sum(self.comm, squares)))

    def felt(self, values: Array, beside: Array | None = None) -> Array:
        """Return the size of the part of a pressure (n,) or a shear (n, d - 1) that supports do not
        take, stress, shape (n,).

        The part that supports take has no effect on the body, so it is no scale for other nodes.
        The same holds for the part that is cancelled by ``beside``, the shear at the same points
        for a pressure and vice versa.
        """
        alone = self._felt(values)
        size = np.linalg.norm(alone, axis=1)
        return (
            size
            if beside is None
            else np.minimum(size, np.linalg.norm(alone + self._felt(beside), axis=1))
        )

    def _felt(self, values: Array) -> Array:
        """Return a pressure (n,) or a shear (n, d - 1) as vectors without the part that supports
        take, shape (n, d).
        """
        if values.ndim == 1:
            return self.movable[:, :, 0] * values[:, None]
        return matvec(self.movable[:, :, 1:], values)


def onto_range(matrices: Array) -> Array:
    """Return orthogonal projectors onto the ranges of symmetric matrices of order one, shape (n, k,
    k).
    """
    values, vectors = np.linalg.eigh(matrices)
    return np.einsum("nik,nk,njk->nij", vectors, np.where(values > ROOT_OF_EPS, 1.0, 0.0), vectors)


@dataclass(frozen=True)
class PointGroups:
    """The contact points of this rank in groups that reach the same pieces of bodies; methods are
    collective.

    Attributes:
        points: the contact points, n of them.
        number: the number of the group of each point, shape (n,).
        pieces: which of p pieces each of g groups reaches, shape (g, p), the same on every rank.
    """

    points: ContactPoints
    number: Ints
    pieces: Flags

    @classmethod
    def of(cls, points: ContactPoints, reached: Flags) -> PointGroups:
        """Return the groups of points that reach the same pieces; ``reached`` has shape (n,
        pieces).
        """
        every = np.array(
            sorted(set(map(tuple, parallel.gather_rows(points.comm, reached).tolist())))
        )
        if len(every) < 2:
            return cls(points, np.zeros(points.size, dtype=np.int64), np.ones((1, 1), dtype=bool))
        number = (reached[:, None] == every).all(axis=2).argmax(axis=1)
        return cls(points, number, every)

    @cached_property
    def count(self) -> int:
        """Number of groups, g."""
        return len(self.pieces)

    def norms(self, values: Array) -> Array:
        """Return the norms of ``ContactPoints.norm`` over each group, shape (g,)."""
        columns = values[:, None] if values.ndim == 1 else values  # a rank may have no point
        squares = (self.points.weight[:, None] * columns**2).sum(axis=1)
        sums = parallel.sums_by(self.points.comm, self.number, squares[:, None], self.count)
        return np.sqrt(sums[:, 0])

    def largest(self, values: Array) -> Array:
        """Return the largest value in each group, shape (g,), of non-negative values of
        shape (n,).
        """
        found = np.zeros(self.count)
        np.maximum.at(found, self.number, values)
        return parallel.largest_of_each(self.points.comm, found)

    def scales(self, sizes: Array, *, lengths: bool = False) -> Array:
        """Return the scale of each group for relative errors, shape (g,), at least round-off of the
        largest of all sizes.

        The size of a piece is the largest one of the groups that reach it.  The scale of a group is
        the smaller size of its two pieces, as the other piece may be pressed elsewhere by forces
        that have nothing to do with this contact.  For ``lengths``, which are relative
        displacements of both, it is the larger one.
        """
        of_pieces = np.where(self.pieces, sizes[:, None], 0.0).max(axis=0)
        counting = np.where(self.pieces, of_pieces, 0.0 if lengths else np.inf)
        scales = counting.max(axis=1) if lengths else counting.min(axis=1)
        return np.maximum(scales, NO_FORCE * sizes.max())
