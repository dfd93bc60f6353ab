"""The error of the largest contact pressure.

The pressure ends like a square root, so that its square is smooth from one end of a contact zone to the other, and that
of Hertz is a parabola.  A parabola (in space a paraboloid) through the squares around the largest nodal pressure has a
smooth *top*, and separates what adds up in the error of the largest nodal pressure:

- how far it is above or below the top: the nodes miss the top, and pressures of neighbours scatter.  It is known, with
  its sign;
- the error of the top itself, by how it and the largest nodal pressure change from mesh to mesh, their geometric mean,
  extrapolated with its rate; the last change counts at least, with the rate that is seen where both go on changing the
  same way and that is smaller.  Its sign is that of the last change of the top;
- on meshes that are divided here and there, what an error elsewhere in the body adds, and a share of what was seen on
  the mesh before; in space and of degree 1 the stress on the mesh tells all of it: ``seen_by_recovery``.

No function of the pressures on these meshes that was tried tells more (docs/trust.md).  A finer mesh does, once it is
solved: ``seen_from_finer``; and so does one that is finer around the contact only: ``seen_from_zone``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.results.accuracy.contact_surface import ContactSurface
from signorini_fx.results.accuracy.pressure_error import peak_of
from signorini_fx.tuned import (
    CHANGES_USED,
    FINER_FACTOR,
    LEAST_SHARE_OF_PARTS,
    NODES_AROUND_PEAK,
    PEAK_RATES,
    RATE_SEEN_BEFORE,
    SAME_LENGTH,
    SCATTER_SHARE,
    SHARE_BESIDE_ZONE,
    SHARE_ELSEWHERE,
    SHARE_OF_LAST_ERROR,
    SHARE_SEEN_BEFORE,
    SLOWEST_PEAK,
    ZONE_RATE,
)

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Peak:
    """The largest pressure on one mesh.

    Attributes:
        largest: nodal pressure, stress; 0 without contact.
        top: of the paraboloid around it, stress.
        scatter: standard deviation of the pressures around it from the paraboloid, relative.
        spacing: mean distance of the nodes around it, length; 0 where there is a single one.
    """

    largest: float
    top: float
    scatter: float
    spacing: float

    @classmethod
    def of(cls, table: ContactTable) -> Peak:
        """That of a contact table."""
        pressure = table.columns["pressure"]
        row = int(np.argmax(pressure)) if pressure.size else 0
        if not pressure.size or not pressure[row] > 0:
            return cls(0.0, 0.0, 0.0, 0.0)
        largest = float(pressure[row])
        if table.facets is None:
            position, rows = _around_on_curve(table, row)
            # Beside a single pressed node the spacing is that to nodes that are not.
            spacing = float(np.ptp(position)) / (len(rows) - 1) if len(rows) > 1 else peak_of(table)[1]
            position = position[:, None]
        else:
            position, rows = _around_on_surface(table, row)
            spacing = float(np.sqrt(table.columns["weight"][rows].mean()))
        top, scatter = _paraboloid(position, (pressure[rows] / largest) ** 2)
        return cls(largest, largest * top, scatter, spacing)


@dataclass(frozen=True)
class _Refinement:
    """From one mesh to the next.

    Attributes:
        changes: of the top and of the largest nodal pressure, relative, shape (2,).
        finer: the second mesh, by this factor.
        to_last: by which the last mesh is finer than the second one.
    """

    changes: Floats
    finer: float
    to_last: float

    def beyond(self, rate: float) -> float:
        """The error of the top on the last mesh, relative, if it decreases with a rate.

        On coarse meshes the parabola is too wide, on unstructured ones the largest pressure is too rough.
        """
        size = float(np.sqrt(np.abs(self.changes).prod()))
        return size / (self.finer**rate - 1) / self.to_last**rate


def _rate_seen(first: _Refinement, last: _Refinement, expected: float) -> float:
    """The rate with which both changes decrease, from ``SLOWEST_PEAK`` to the expected one; this where one turns."""
    if not (first.changes * last.changes > 0).all():
        return expected
    seen = np.log(first.changes / last.changes) / np.log(last.finer)
    return float(np.clip(seen.max(), SLOWEST_PEAK, expected))


def _refinements(peaks: Sequence[Peak], fineness: Sequence[float] | None) -> list[_Refinement]:
    """From each mesh to the next, where that is finer at the peak, see ``peak_error``."""
    last, steps = peaks[-1], []
    for k in range(1, len(peaks)):
        coarse, fine = peaks[k - 1], peaks[k]
        # Between two bodies a node may carry a point and have no neighbour that does: then there is no spacing.
        if min(coarse.largest, fine.largest, coarse.spacing, fine.spacing, last.spacing) <= 0:
            continue
        finer, to_last = coarse.spacing / fine.spacing, fine.spacing / last.spacing
        if finer < FINER_FACTOR and fineness is not None:
            finer, to_last = fineness[k] / fineness[k - 1], fineness[-1] / fineness[k]
        if finer >= FINER_FACTOR:
            changes = np.array([fine.top - coarse.top, fine.largest - coarse.largest]) / last.largest
            steps.append(_Refinement(changes, finer, max(to_last, 1.0)))
    return steps


def seen_from_finer(
    peaks: Sequence[Peak], index: int, degree: int, error: float, fineness: Sequence[float]
) -> float | None:
    """The relative error of the largest pressure on a mesh, from a finer one that has been solved since.

    The top of the pressure on the last mesh, extrapolated with its rate, takes the place of the solution.  How far that
    may be wrong is a share of the error that is estimated on the last mesh.

    Args:
        peaks: on the meshes, coarsest first.
        index: of the mesh, which is not the last one.
        degree: of the displacement.
        error: of the last mesh, relative.
        fineness: 1 / h of the meshes, each finer than the one before everywhere.

    Returns:
        None where the last mesh is no finer at the peak, or without contact on the mesh.
    """
    mesh, last = peaks[index], peaks[-1]
    steps = _refinements(peaks, fineness)
    comparable = min(mesh.largest, last.largest, last.spacing) > 0
    if not (comparable and steps and mesh.spacing >= FINER_FACTOR * last.spacing):
        return None
    step = steps[-1]
    beyond = step.changes[0] / (step.finer ** PEAK_RATES[degree] - 1) / step.to_last ** PEAK_RATES[degree]
    better = last.top + beyond * last.largest
    return float(np.hypot(mesh.largest / better - 1, SHARE_OF_LAST_ERROR * error)) if better > 0 else None


@dataclass(frozen=True)
class FinerZone:
    """The largest pressure on a mesh with halved cells in contact.

    Attributes:
        peak: on it.
        energy: its estimated error in the energy norm, relative.
    """

    peak: Peak
    energy: float


def seen_from_zone(last: Peak, zone: FinerZone, error: float) -> float | None:
    """The relative error of the largest pressure on the last mesh, from the same mesh with halved cells in contact.

    What the top changes by, extrapolated, is the error.  As this may be zero by chance, the scatter around the top and
    a share of the error that is estimated without this mesh count as well.  What is wrong elsewhere in the body, which
    this mesh does not show, is about the square of its error in the energy norm (Aubin and Nitsche), or less.

    Args:
        last: on the last mesh.
        zone: on the one with halved cells.
        error: estimated by ``peak_error``, relative.

    Returns:
        None where the cells around the peak are no smaller.
    """
    peak = zone.peak
    if min(last.largest, peak.largest, peak.spacing) <= 0 or last.spacing < FINER_FACTOR * peak.spacing:
        return None
    better = peak.top + (peak.top - last.top) / ((last.spacing / peak.spacing) ** ZONE_RATE - 1)
    if not better > 0:
        return None
    elsewhere = SHARE_ELSEWHERE * zone.energy**2
    parts = [last.largest / better - 1, SCATTER_SHARE * peak.scatter, SHARE_BESIDE_ZONE * error, elsewhere]
    return float(np.linalg.norm(parts))


def seen_by_recovery(peak: Peak, of_mean: float) -> float | None:
    """The relative error of the largest pressure on a mesh whose stress tells that of the pressure around it.

    Args:
        peak: on the mesh.
        of_mean: the relative error of a mean of the pressure there, with its sign, see ``recovered_force``.

    Returns:
        None without contact.
    """
    if not peak.largest > 0:
        return None
    return _of_parts(peak, of_mean)


def peak_error(
    peaks: Sequence[Peak], degree: int, fineness: Sequence[float] | None = None, pollution: float = 0.0
) -> float | None:
    """The relative error of the largest pressure on the last mesh.

    Args:
        peaks: on the meshes, coarsest first.
        degree: of the displacement.
        fineness: 1 / h of the meshes, where each is finer than the one before everywhere; None: of meshes that are
            divided here and there the spacing of the nodes around the peak counts alone.
        pollution: what an error elsewhere in the body adds, relative.

    Returns:
        None where no mesh was coarser at the peak, without contact, or where a single node may be in contact.
    """
    seen = _seen(peaks, degree, fineness)
    if seen is None:
        return None
    # Meshes are divided until little is seen, which may be so by chance: then what was seen before counts.
    seen_before = _seen_before(peaks, degree) if fineness is None else 0.0
    # What the changes do not show at all on meshes that were divided for the peak is no more than what they show.
    return float(np.hypot(max(seen, SHARE_SEEN_BEFORE * seen_before), min(pollution, max(seen, seen_before))))


def _seen(peaks: Sequence[Peak], degree: int, fineness: Sequence[float] | None) -> float | None:
    """What the pressures around the peak show of the error, see ``peak_error``."""
    last, rate = peaks[-1], PEAK_RATES[degree]
    if not last.largest > 0:
        return None
    steps = _refinements(peaks, fineness)
    if not steps:
        return None
    of_top = np.sqrt(np.mean([step.beyond(rate) ** 2 for step in steps[-CHANGES_USED:]]))
    seen_rate = _rate_seen(steps[-2], steps[-1], rate) if len(steps) > 1 else rate
    of_top = -np.copysign(max(of_top, steps[-1].beyond(seen_rate)), steps[-1].changes[0])
    return _of_parts(last, of_top)


def _of_parts(last: Peak, of_top: float) -> float:
    """The error of the largest pressure from that of its top and how far it is off this, relative; the parts may cancel
    by chance.
    """
    above_top = last.largest / last.top - 1
    parts = np.linalg.norm([above_top, of_top, SCATTER_SHARE * last.scatter])
    return max(float(abs(above_top + of_top)), float(LEAST_SHARE_OF_PARTS * parts))


def _seen_before(peaks: Sequence[Peak], degree: int) -> float:
    """What was seen on the mesh before the last one, as it is expected to have decreased since, or more; 0: nothing."""
    coarse, last = peaks[-2:]
    seen = _seen(peaks[:-1], degree, None)
    if seen is None or min(coarse.spacing, last.spacing) <= 0:
        return 0.0
    return float(seen / max(coarse.spacing / last.spacing, 1.0) ** RATE_SEEN_BEFORE[degree])


def _around_on_curve(table: ContactTable, row: int) -> tuple[Floats, Ints]:
    """Arc length from a node, and rows, of the pressed nodes that are nearest to it along the boundary."""
    pressure = table.columns["pressure"]
    for path in table.paths:
        if row not in path:
            continue
        rows, s, _ = table.unrolled(path)
        places = np.flatnonzero(rows == row)
        first = last = int(places[len(places) // 2])
        away = np.abs(s - s[first])
        pressed = np.append(pressure[rows] > 0, False)
        while last - first + 1 < min(NODES_AROUND_PEAK, len(path)):
            left = away[first - 1] if first > 0 and pressed[first - 1] else np.inf
            right = away[last + 1] if pressed[last + 1] else np.inf
            nearest = min(left, right)
            if not np.isfinite(nearest):
                break
            # Nodes that are equally far are taken together: the parabola leans to neither side.
            first -= left <= nearest * (1 + SAME_LENGTH)
            last += right <= nearest * (1 + SAME_LENGTH)
        around = slice(first, last + 1)
        return s[around] - s[int(places[len(places) // 2])], rows[around]
    return np.zeros(1), np.array([row])


def _around_on_surface(table: ContactTable, row: int) -> tuple[Floats, Ints]:
    """Position from a node in the plane that is nearest to the surface there, shape (n, 2), and rows, of the pressed
    nodes of the pieces around it and around these.
    """
    surface, pressed = ContactSurface.of(table), table.columns["pressure"] > 0
    rows = np.array([row])
    for _ in range(2):
        beside = surface.corners[np.isin(surface.corners, rows).any(axis=1)]
        rows = np.unique(np.append(rows, beside[pressed[beside]]))
    x = surface.x[rows] - surface.x[row]
    axes = np.linalg.svd(x, full_matrices=False)[2][:2]
    return x @ axes.T, rows


def _paraboloid(place: Floats, square: Floats) -> tuple[float, float]:
    """The root of the top of the paraboloid that is nearest to values, and half of their deviation from it.

    Args:
        place: of the values, shape (n, 1) or (n, 2); the first mesh may have too few for a paraboloid: then its top
            is the largest of them, and the deviation that of the others from it.
        square: the values, the largest 1, shape (n,).
    """
    size = float(np.abs(place).max())
    x = place / size if size > 0 else place
    first, second = np.triu_indices(x.shape[1])
    powers = np.column_stack((np.ones(len(x)), x, x[:, first] * x[:, second]))
    count = powers.shape[1]
    if len(x) <= count:
        return 1.0, float(1 - np.sqrt(square).mean())
    weights, _, rank, _ = np.linalg.lstsq(powers, square, rcond=None)
    if rank < count:
        return 1.0, float(1 - np.sqrt(square).mean())
    values = powers @ weights
    top = float(values.max())
    bend = np.zeros((x.shape[1], x.shape[1]))
    bend[first, second] = weights[1 + x.shape[1] :]
    bend += bend.T
    if np.linalg.eigvalsh(bend).max() < 0:  # it has a top, which counts where the nodes are around it
        at = -np.linalg.solve(bend, weights[1 : 1 + x.shape[1]])
        if (np.abs(at) <= np.abs(x).max(axis=0)).all() and (x.min(axis=0) <= at).all() and (at <= x.max(axis=0)).all():
            top = float(weights[0] + weights[1 : 1 + x.shape[1]] @ at / 2)
    scatter = np.linalg.norm(square - values) / np.sqrt(len(x) - count) / 2
    return float(np.sqrt(max(top, 0.0))), float(scatter)
