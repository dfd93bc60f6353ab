"""The error of the largest contact pressure, from its changes from mesh to mesh.

The largest nodal pressure converges with the rate of ``EXPECTED_RATES``, or with that of its last two changes if it is
smaller.  As a change may be small by chance, earlier ones count as well.

At a corner of the body the stress may be singular.  Then the pressure there grows with every refinement, and on some
mesh it exceeds every other one.  So the corners in contact are followed, too.  In 3D the largest pressure on the rim
of the contact boundary stands for all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.contact_points.contact_table import ContactTable, is_closed
from signorini_fx.results.accuracy.contact_surface import ContactSurface, places
from signorini_fx.results.accuracy.pressure_error import turning
from signorini_fx.tuned import (
    CHANGES_USED,
    CORNER_ANGLE,
    EXPECTED_RATES,
    FEW_NODES,
    FINER_FACTOR,
    GROWING_MESHES,
    GROWTH_POWER,
    LASTING_SHARE,
    SLOWEST_PEAK,
)

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class _Place:
    """A place of the contact boundary on the last mesh, and on those before it that are coarser there; ``pressure`` and
    ``spacing`` of the nodes: coarsest first; ``row``: in the table of the last mesh.
    """

    row: int
    corner: bool
    pressure: Floats
    spacing: Floats

    @classmethod
    def on(cls, tables: Sequence[ContactTable], rows: Sequence[int], *, corner: bool) -> _Place:
        """The place that is a row of each table."""
        pressure = np.array([table.columns["pressure"][row] for table, row in zip(tables, rows, strict=True)])
        spacing = np.array([_spacing(table)[row] for table, row in zip(tables, rows, strict=True)])
        meshes = [len(tables) - 1]
        for mesh in reversed(range(meshes[0])):
            if spacing[mesh] >= FINER_FACTOR * spacing[meshes[0]]:
                meshes.insert(0, mesh)
        return cls(rows[-1], corner, pressure[meshes], spacing[meshes])

    @property
    def growth(self) -> Floats:
        """The powers of 1 / h with which the pressure grows from mesh to mesh; infinite where it begins."""
        with np.errstate(divide="ignore", invalid="ignore"):
            steps = np.diff(np.log(self.pressure))
        return np.asarray(steps / -np.diff(np.log(self.spacing)))

    @property
    def grows(self) -> bool:
        """Whether the pressure grows with every refinement, on the last meshes by about the same power.

        Elsewhere than at a corner a pressure may grow until the mesh resolves it: then it must do so twice as often.
        """
        meshes = GROWING_MESHES if self.corner else 2 * GROWING_MESHES
        powers = self.growth[-meshes:]
        lasting = np.isfinite(powers).all() and len(powers) == meshes and powers[-1] > LASTING_SHARE * powers[0]
        least = self.pressure[0] * (self.spacing[0] / self.spacing[-1]) ** GROWTH_POWER
        return bool(lasting and powers.min() > GROWTH_POWER and self.pressure[-1] > least)

    @property
    def settled(self) -> bool:
        """Whether the pressure has not grown over the last meshes, or grows ever less."""
        powers = self.growth[-GROWING_MESHES:]
        if len(powers) < GROWING_MESHES:
            return False
        at_rest = max(powers[-1], np.mean(powers)) <= GROWTH_POWER
        return bool(at_rest or 0 < powers[-1] <= LASTING_SHARE * powers[0])

    @property
    def error(self) -> float:
        """The error of the pressure by the expected rate; infinite where no mesh was coarser."""
        changes = self.pressure[-1] - self.pressure[-1 - CHANGES_USED : -1]
        finer = self.spacing[-1 - CHANGES_USED : -1] / self.spacing[-1]
        return float((np.abs(changes) / (finer ** EXPECTED_RATES["peak"] - 1)).max()) if changes.size else np.inf

    @property
    def error_by_last_changes(self) -> float:
        """The same by the rate of the last two changes; 0 where that cannot be told."""
        changes, steps = np.diff(self.pressure)[-2:], -np.diff(np.log(self.spacing))[-2:]
        if len(changes) < 2 or not changes.prod() > 0:
            return 0.0
        rate = np.log(changes[0] / changes[1] * steps[1] / steps[0]) / steps.mean()
        return float(abs(changes[1]) / (np.exp(steps[1] * np.clip(rate, SLOWEST_PEAK, EXPECTED_RATES["peak"])) - 1))


def peak_error(tables: Sequence[ContactTable]) -> float | None:
    """The relative error of the largest pressure on the last mesh; ``tables``: coarsest first.

    Returns:
        None without contact, with few nodes in contact, where no mesh was coarser at the peak, and where the pressure
        grows at some place, or may do so at a corner.
    """
    if tables[-1].touching < FEW_NODES or (len(tables) > 1 and 2 * tables[-2].touching < FEW_NODES):
        return None
    peak, *corners = _followed(tables)
    if diverging_row(tables) is not None or not all(corner.settled for corner in corners):
        return None
    largest = peak.pressure[-1]
    higher = [corner.pressure[-1] + corner.error - largest for corner in corners]
    error = max(peak.error, peak.error_by_last_changes, *higher) / largest
    return float(error) if np.isfinite(error) else None


def diverging_row(tables: Sequence[ContactTable]) -> int | None:
    """The row of the last table where the pressure grows with every refinement; None: there is none.

    Where the nodes in contact were few and became more, it may only not have been resolved so far.
    """
    touching = [table.touching for table in tables[-1 - GROWING_MESHES :]]
    if touching[-1] == 0 or (touching[0] < touching[-1] and min(touching[-2:]) < FEW_NODES):
        return None
    return next((place.row for place in _followed(tables) if place.grows), None)


def _followed(tables: Sequence[ContactTable]) -> list[_Place]:
    """The place of the largest pressure, then the corners in contact, on all meshes."""
    last = tables[-1]
    tops = [int(np.argmax(table.columns["pressure"])) for table in tables]
    if last.facets is not None:
        rims = [np.flatnonzero(ContactSurface.of(table).rim_nodes) for table in tables]
        on_rims = [int(rim[np.argmax(table.columns["pressure"][rim])]) for rim, table in zip(rims, tables, strict=True)]
        pressed = last.columns["pressure"][on_rims[-1]] > 0
        corners = [on_rims] if pressed else []
    else:
        turns = [_turns(table) for table in tables]
        corners = []
        for row in corner_rows(last):
            rows = [int(np.linalg.norm(places(table) - places(last)[row], axis=1).argmin()) for table in tables]
            # The facets of a rounding turn ever less.
            if turns[-1][row] > LASTING_SHARE * min(turns[0][rows[0]], np.pi):
                corners.append(rows)
    is_corner = any(rows[-1] == tops[-1] for rows in corners)
    found = [_Place.on(tables, tops, corner=is_corner)]
    return found + [_Place.on(tables, rows, corner=True) for rows in corners]


def corner_rows(table: ContactTable) -> Ints:
    """The rows in contact at corners of the body in 2D, and at the ends of the contact boundary."""
    return np.flatnonzero((_turns(table) > CORNER_ANGLE) & (table.columns["pressure"] > 0))


def _turns(table: ContactTable) -> Floats:
    """How far the boundary turns at each node in 2D, radians; infinite at its ends."""
    x, turns = places(table), np.full(len(table.columns["x"]), np.inf)
    for path in table.paths:
        around = np.append(path, path[1]) if is_closed(path) else path
        turns[around[1:-1]] = turning(*x[around].T)
    return turns


def _spacing(table: ContactTable) -> Floats:
    """The length of the smaller interval beside each node; in 3D the side of the area that belongs to it."""
    if table.facets is not None:
        return np.asarray(np.sqrt(table.columns["weight"]))
    spacing = np.full(len(table.columns["x"]), np.inf)
    for path in table.paths:
        lengths = np.diff(table.arc(path))
        for rows in (path[:-1], path[1:]):
            np.minimum.at(spacing, rows, lengths)
    return spacing
