"""The rigid motions that supports leave free, at the contact points; statics needs nothing else of
a body.

They are the columns of B times the motions.  Several bodies, or pieces of one that can move apart,
form assemblies: a motion moves one of them only, and a contact point belongs to one of them.

Displacements are counted from the position at which the rigid body comes to rest on its foundation.
If a body first drops by a millimetre and is then deformed by a nanometre, its contact forces would
be differences of numbers that agree in six digits.  From that position displacements and gaps are
as small as the deformation, and so is their round-off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.algebra.contact.points import ContactPoints, PointGroups
from signorini_fx.arrays import Array, Flags, Ints
from signorini_fx.machine import parallel
from signorini_fx.tuned import (
    CERTIFICATE_TOLERANCE,
    NO_FORCE,
    NOTHING_LEFT,
    ROOT_OF_EPS,
    SAME_NUMBER,
)


@dataclass(frozen=True)
class RigidLoad:
    """A load on the free rigid motions, k of them.

    Attributes:
        work: work of the load on each motion, forces, shape (k,).
        size: sum of the magnitudes of the nodal forces on the assembly of each motion, shape (k,).
        assembly: number of the assembly that each motion moves, shape (k,).
    """

    work: Array
    size: Array
    assembly: Ints


def total_work(loads: Sequence[tuple[float, RigidLoad]], count: int) -> Array:
    """Return the work of loads times their factors on the free motions, shape (k,).

    It is zero for an assembly whose loads balance each other to round-off; this is the only place
    that decides whether a load acts on a rigid body.
    """
    work = np.zeros(count)
    size = np.zeros(count)
    for factor, load in loads:
        work += factor * load.work
        size += abs(factor) * load.size
    if not loads or not count:
        return work
    assembly = loads[0][1].assembly
    length = np.sqrt(np.bincount(assembly, work**2))[assembly]
    return np.where(length > NO_FORCE * size, work, 0.0)


@dataclass(frozen=True)
class FreeMotions:
    """The free rigid motions at the contact points of this rank, k of them.

    Attributes:
        points: the contact points, n of them.
        relative: relative displacement of each motion in the frame (n, T) of each point, shape (n,
            d, k).
        assembly: number of the assembly that each motion moves, from 0, shape (k,).
        of_point: number of the assembly of each point, shape (n,).
        groups: groups of points that are judged together.
    """

    points: ContactPoints
    relative: Array
    assembly: Ints
    of_point: Ints
    groups: PointGroups

    @cached_property
    def count(self) -> int:
        """Number of motions, k."""
        return int(self.assembly.size)

    @property
    def normal(self) -> Array:
        """The motions along the normal of each point, shape (n, k)."""
        return self.relative[:, 0]

    @property
    def tangential(self) -> Array:
        """The motions along the tangents of each point, shape (n, d - 1, k)."""
        return self.relative[:, 1:]

    @cached_property
    def assemblies(self) -> list[tuple[int, Flags]]:
        """The assemblies that can move: number, and a mask of their motions, shape (k,)."""
        return [(int(number), self.assembly == number) for number in np.unique(self.assembly)]

    def unheld(
        self,
        normal: Flags,
        stick: Flags,
        directions: Array | None = None,
    ) -> Flags:
        """Return which assemblies have a motion that contact does not resist, shape (assemblies,);
        collective.

        Args:
            normal: points in contact, which resist motion along their normal, shape (n,).
            stick: points that stick, which resist tangential motion, shape (n,).
            directions: directions of slip, shape (n, d - 1), zero at points without slip; slipping
                points resist motion perpendicular to them.  None: they do not.
        """
        # The assemblies that occur on this rank, also those that cannot move.
        last = max(self.assembly.max(initial=-1), self.of_point.max(initial=-1))
        unresisted = np.zeros(int(last) + 1, dtype=bool)
        if not self.count:
            return unresisted
        resisted = [self.normal[normal], *self.tangential[stick].swapaxes(0, 1)]
        if directions is not None and directions.shape[1] > 1:
            slip = directions.any(axis=1)
            along = np.einsum("it,itk->ik", directions[slip], self.tangential[slip])
            resisted += [
                *(self.tangential[slip] - directions[slip][:, :, None] * along[:, None]).swapaxes(
                    0, 1
                )
            ]
        rows = np.concatenate(resisted)
        gram = parallel.global_sum(self.points.comm, np.concatenate((rows.T @ rows, self._moved)))
        for number, columns in self.assemblies:
            values = np.linalg.eigvalsh(gram[:-1][np.ix_(columns, columns)])
            # A resistance that is smaller than this, relative to the motion of the points, is
            # round-off of their positions.
            real = values[-1] > NOTHING_LEFT**2 * gram[-1][columns].max()
            unresisted[number] = not (real and values[0] > ROOT_OF_EPS * values[-1] > 0)
        return unresisted

    def untouched(self, numbers: Sequence[int], pressed: Flags) -> list[int]:
        """Return which of these assemblies have no contact point with tractions; collective.

        Args:
            numbers: of the assemblies.
            pressed: points with tractions, shape (n,).
        """
        comm = self.points.comm
        of = self.of_point
        return [number for number in numbers if not parallel.any_rank(comm, pressed[of == number])]

    @cached_property
    def _moved(self) -> Array:
        """Squared size of each motion at the points of this rank, shape (1, k)."""
        return np.square(self.relative).sum(axis=(0, 1))[None]

    @property
    def none(self) -> FreeMotions:
        """Return the same points without any free motion, for bodies that are held."""
        return replace(self, relative=self.relative[:, :, :0], assembly=self.assembly[:0])

    def held_by(
        self,
        normal: Flags,
        stick: Flags,
        directions: Array | None = None,
    ) -> bool:
        """Return whether contact resists every motion; arguments as in ``unheld``.  Collective."""
        return not self.unheld(normal, stick, directions).any()


@dataclass(frozen=True)
class ReferenceMotion:
    """A rigid motion, or another displacement, from which displacements are counted.

    Attributes:
        motion: coefficients of the free motions, lengths, shape (k,).
        u_n: its component tau_N y at the contact points, length, shape (n,).
        u_t: its component tau_T y, length, shape (n, d - 1).
        displacement: the displacement if it is no rigid motion, length, ghosts included, shape
            (dofs,); None: it is rigid.
    """

    motion: Array
    u_n: Array
    u_t: Array
    displacement: Array | None = None

    def data_from(self, data: RegularisedData) -> RegularisedData:
        """Return the problem for displacements counted from this reference."""
        return replace(data, gap=data.gap - self.u_n, slip_origin=data.slip_origin - self.u_t)


def reference_motion(
    gap: Array,
    bilateral: Flags,
    motions: FreeMotions,
    resultant: Array,
) -> ReferenceMotion | None:
    """Return the rigid motion by which the load moves the body to its rest position; collective.

    Returns None if nothing stops the body without friction, or if supports hold it.

    Among the rigid motions that do not penetrate the foundation it is the one with the largest work
    of the load: a linear programme with as many unknowns as motions that the contact resists.
    Pieces that are not joined come to rest separately.
    """
    if not motions.count:
        return None
    comm = motions.points.comm
    # A ring that moves along its axis does not move along its normals, but round-off of the normals
    # would stop it after 1e13 gaps.
    sizes = parallel.largest_of_each(comm, np.abs(motions.relative).max(axis=(0, 1), initial=0.0))
    normal = np.where(np.abs(motions.normal) <= NOTHING_LEFT * sizes, 0.0, motions.normal)
    table = parallel.gather_rows(comm, np.column_stack((normal, gap, bilateral, motions.of_point)))
    motion = np.zeros(motions.count)
    for number, columns in motions.assemblies:
        rows = table[table[:, -1] == number]
        if len(rows) and not rows[:, -2].any():
            moved = _rest_of(rows[:, :-3][:, columns], rows[:, -3], resultant[columns])
            motion[columns] = 0.0 if moved is None else moved
    if not motion.any():
        return None
    u_n = motions.normal @ motion
    u_t = motions.tangential @ motion
    # A motion along the normals has no tangential part except round-off, which is dropped.
    still = parallel.largest(comm, np.abs(u_t)) <= SAME_NUMBER * float(np.abs(motion).max())
    return ReferenceMotion(motion, u_n, np.zeros_like(u_t) if still else u_t)


def _rest_of(
    normal_modes: Array,
    gap: Array,
    load: Array,
) -> Array | None:
    """Return the coefficients of the free motions of one assembly at its rest position, lengths,
    shape (k,); None if nothing stops it, or if it does not move.
    """
    values, vectors = np.linalg.eigh(normal_modes.T @ normal_modes)
    resisted = vectors[:, values > CERTIFICATE_TOLERANCE * values[-1]]
    work = resisted.T @ load
    size = float(np.abs(gap).max())
    largest = float(np.abs(work).max(initial=0.0))
    if size == 0 or largest == 0:
        return None
    coefficients = _furthest(
        normal_modes @ resisted, gap / np.float64(size), work / np.float64(largest)
    )
    return None if coefficients is None else size * (resisted @ coefficients)


def _furthest(rows: Array, gap: Array, work: Array) -> Array | None:
    """Return the coefficients q with rows q <= gap for which work . q is largest; None if it is
    unbounded.
    """
    if work.size == 1:
        along = rows[:, 0] * np.sign(work[0])
        # At points on walls along which the body slides there is only round-off.
        stops = along > CERTIFICATE_TOLERANCE * along.max(initial=0.0)
        return np.sign(work) * (gap[stops] / along[stops]).min() if stops.any() else None
    from scipy.optimize import linprog  # imported here because it takes 0.07 s

    result = linprog(-work, A_ub=rows, b_ub=gap, bounds=[(None, None)] * work.size)
    if result.status != 0:
        return None
    # The linear programme is solved to its own tolerance; now the gaps that it closes are closed
    # exactly.
    closed = rows @ result.x >= gap - CERTIFICATE_TOLERANCE
    coefficients = np.linalg.lstsq(rows[closed], gap[closed], rcond=None)[0]
    return coefficients
