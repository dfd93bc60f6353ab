"""Where a body that supports do not hold comes to rest on its foundation: the origin of its displacements.

If a body first drops by a millimetre and is then deformed by a nanometre, its contact forces would be computed as
differences of numbers that agree in six digits.  Measured from the place where the rigid body touches its foundation,
displacements and gaps are as small as the deformation, and so is their round-off.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.algebra.contact.motions import FreeMotions
from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.machine import parallel
from signorini_fx.tuned import CERTIFICATE_TOLERANCE, NOTHING_LEFT, SAME_NUMBER


@dataclass(frozen=True)
class ReferenceMotion:
    """A rigid motion, coefficients of the free motions, lengths, shape (k,), and its components tau_N y and tau_T y at
    the contact points.
    """

    motion: npt.NDArray[np.float64]
    u_n: Nodal
    u_t: Nodal

    def data_from(self, data: RegularisedData) -> RegularisedData:
        """The problem for displacements that are counted from this place."""
        return replace(data, gap=data.gap - self.u_n, slip_origin=data.slip_origin - self.u_t)


def reference_motion(
    gap: Nodal,
    bilateral: npt.NDArray[np.bool_],
    motions: FreeMotions,
    resultant: npt.NDArray[np.float64],
) -> ReferenceMotion | None:
    """Where the load moves the rigid body; None if nothing stops it without friction, or if supports hold it;
    collective.

    The work of the load is largest over the rigid motions that do not enter the foundation: a linear programme with
    as many unknowns as motions that the contact resists.  Pieces that are not joined come to rest separately.
    """
    if not motions.count:
        return None
    comm = motions.points.comm
    # A ring that moves along its axis does not move along its normals: their round-off would stop it 1e13 gaps away.
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
    u_n, u_t = motions.normal @ motion, motions.tangential @ motion
    # A motion along the normals has no tangential part except for round-off.
    still = parallel.largest(comm, np.abs(u_t)) <= SAME_NUMBER * float(np.abs(motion).max())
    return ReferenceMotion(motion, u_n, np.zeros_like(u_t) if still else u_t)


def _rest_of(
    normal_modes: npt.NDArray[np.float64], gap: npt.NDArray[np.float64], load: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64] | None:
    """How far the free motions of one assembly go, lengths, shape (k,); None where nothing stops it, or it rests."""
    values, vectors = np.linalg.eigh(normal_modes.T @ normal_modes)
    resisted: npt.NDArray[np.float64] = vectors[:, values > CERTIFICATE_TOLERANCE * values[-1]]
    work = resisted.T @ load
    size, largest = float(np.abs(gap).max()), float(np.abs(work).max(initial=0.0))
    if size == 0 or largest == 0:
        return None
    coefficients = _furthest(normal_modes @ resisted, gap / np.float64(size), work / np.float64(largest))
    return None if coefficients is None else size * (resisted @ coefficients)


def _furthest(
    rows: npt.NDArray[np.float64], gap: npt.NDArray[np.float64], work: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64] | None:
    """The coefficients q with rows q <= gap for which work . q is largest; None where it has no bound."""
    if work.size == 1:
        along = rows[:, 0] * np.sign(work[0])
        # Along a wall that it slides on there is only round-off.
        stops = along > CERTIFICATE_TOLERANCE * along.max(initial=0.0)
        return np.sign(work) * (gap[stops] / along[stops]).min() if stops.any() else None
    from scipy.optimize import linprog  # imported by what needs it alone: it takes 0.07 s

    result = linprog(-work, A_ub=rows, b_ub=gap, bounds=[(None, None)] * work.size)
    if result.status != 0:
        return None
    # The programme is solved to its own tolerance; the gaps that it closes are closed exactly.
    closed = rows @ result.x >= gap - CERTIFICATE_TOLERANCE
    coefficients: npt.NDArray[np.float64] = np.linalg.lstsq(rows[closed], gap[closed], rcond=None)[0]
    return coefficients
