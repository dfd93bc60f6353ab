"""The errors of the contact pressure: in L2(Gamma_c) from its kinks at the nodes, and of its
largest value from changes from mesh to mesh.

At a corner of the body the stress may be singular, the pressure like r^(a - 1) with 1/2 < a < 1:
then nearly all of the error is in the one interval at the corner.  There the pressure is convex; at
a plane of symmetry or an axis, which is no corner, it is concave.  A singular pressure grows with
every refinement, and on some mesh exceeds every other one: so the corners in contact are followed
beside the largest pressure, in 3D the largest one on the rim of the contact boundary.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from signorini_fx.arrays import Array, Ints
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_table import ContactTable, is_closed
from signorini_fx.mechanics.kinematics import PLANE_STRAIN, Kinematics
from signorini_fx.results.accuracy.contact_surface import ContactSurface, places
from signorini_fx.tuned import (
    CHANGES_USED,
    CORNER_ANGLE,
    CORNER_SHARE,
    EXPECTED_RATES,
    FEW_NODES,
    GROWING_MESHES,
    GROWTH_POWER,
    KINK_SHARE,
    LASTING_SHARE,
    NOTABLE,
    ROOT_OF_EPS,
    SMALLEST_JUMP,
)


def interval_squares(table: ContactTable, kinematics: Kinematics = PLANE_STRAIN) -> list[Array]:
    """Return the estimated squared error of the pressure between neighbouring nodes, stress^2 times
    length, or times area of a ring.

    There is one array for each path of the table, shape (rows - 1,).
    """
    squares = []
    for path in table.paths:
        rows, s, own = table.unrolled(path)
        h = np.diff(s)
        kinks = np.diff(np.diff(table.columns["pressure"][rows]) / h) ** 2
        found = np.zeros(h.size)
        found[:-1] += KINK_SHARE / 2 * h[:-1] ** 3 * kinks
        found[1:] += KINK_SHARE / 2 * h[1:] ** 3 * kinks
        for interval, inside in _corners(table, rows, s) if h.size > 1 else ():
            found[interval] = max(
                found[interval], CORNER_SHARE * h[interval] ** 3 * kinks[inside - 1]
            )
        squares.append(found[own])
        if not kinematics.uniform:  # the circumference at the middle of each interval
            x = places(table)
            squares[-1] = squares[-1] * kinematics.measure_at((x[path[:-1]] + x[path[1:]]).T / 2)
    return squares


def bends(table: ContactTable, path: Ints, values: Array) -> Array:
    """Return the magnitude of the change of slope of nodal values at each row of a path, shape
    (rows of it,); at ends that of their neighbours.
    """
    rows, s, own = table.unrolled(path)
    changes = np.abs(np.diff(np.diff(values[rows]) / np.diff(s)))
    changes = np.pad(changes, 1, mode="edge") if changes.size else np.zeros(rows.size)
    return changes[own.start : own.stop + 1]


def _corners(table: ContactTable, rows: Ints, s: Array) -> list[tuple[int, int]]:
    """Return the intervals in contact at corners and ends towards which the pressure is convex,
    each with the node at its other end.
    """
    pressure = np.abs(table.columns["pressure"][rows])
    last = len(rows) - 1
    pairs = [(0, 0), (last, last - 1)]
    if "x" in table.columns:
        x = table.columns["x"][rows]
        y = table.columns["y"][rows]
        for node in np.flatnonzero(turning(x, y) > CORNER_ANGLE) + 1:
            pairs += [(node, k) for k in (node - 1, node) if 0 < k < last - 1]
    bends = np.diff(np.diff(pressure) / np.diff(s))
    corners = []
    for node, interval in pairs:
        inside = interval if interval == node - 1 else interval + 1
        pressed = (
            pressure[[node, inside, 2 * inside - node]] > 0
        ).all()  # the end of a contact zone is another matter
        if pressed and bends[inside - 1] > 0:
            corners.append((interval, inside))
    return corners


def growing_rows(table: ContactTable) -> Ints:
    """Return the rows in contact at corners, at ends and in 3D on the rim, towards which the
    pressure is convex, the largest pressure first.

    Small pressures are left out.
    """
    pressure = table.columns["pressure"]
    found = set[int]()
    if table.facets is not None:
        found.update(np.flatnonzero(ContactSurface.of(table).growing(pressure)))
    else:
        for path in table.paths:
            rows, s, _ = table.unrolled(path)
            for interval, inside in _corners(table, rows, s) if len(s) > 2 else ():
                found.add(int(rows[interval + (inside == interval)]))
    large = [row for row in found if pressure[row] > NOTABLE * pressure.max()]
    return np.array(sorted(large, key=lambda row: -pressure[row]), dtype=np.int64)


def turning(x: Array, y: Array) -> Array:
    """Return the angle from each interval to the next, radians, shape (nodes - 2,)."""
    angle = np.diff(np.arctan2(np.diff(y), np.diff(x)))
    return np.abs((angle + np.pi) % (2 * np.pi) - np.pi)


def polygon_error(table: ContactTable, modulus: float) -> float:
    """Return the effect of straight facets on a curved contact boundary, relative to the contact
    pressure.

    The slope of a polygon differs from that of the curve by up to half the angle between its
    facets, and slope times modulus is a pressure.

    Args:
        table: the contact table.
        modulus: stress per strain of the plane.
    """
    c = table.columns
    turns, _ = chords(table)
    square = pressure_square(table)
    length = float(np.sum(c["weight"][c["pressure"] != 0]))
    return (
        float(modulus * np.sqrt(np.mean(np.square(turns)) * length / square))
        if turns.size and square > 0
        else 0.0
    )


def chords(table: ContactTable, degree: int = 1) -> tuple[Array, Array]:
    """Return the angles between pressed facets and their neighbours, radians, without corners, and
    the lengths of these facets.

    A parabola through three nodes on a circle differs from it by far less than its two chords: its
    slope by a^3 / 4 and its points by l a^3 / 32, for chords of length l at an angle a.  So with
    degree 2 the angles are a^3 / 4: points differ by an eighth of angle times length, as those of a
    polygon do.

    Args:
        table: the contact table.
        degree: degree of the geometry.
    """
    c = table.columns
    angles = [np.zeros(0)]
    lengths = [np.zeros(0)]
    pressed = c["pressure"] != 0
    if table.facets is not None:
        surface = ContactSurface.of(table)
        near = pressed[surface.corners].any(axis=1)
        angles.append(surface.turns()[near].ravel())
        lengths.append(np.repeat(surface.sides.max(axis=1)[near], surface.corners.shape[1]))
    else:
        for path in table.paths:
            rows = np.append(path, path[1]) if is_closed(path) else path
            near = pressed[rows][1:-1] | pressed[rows][:-2] | pressed[rows][2:]
            x = c["x"][rows]
            y = c["y"][rows]
            size = np.hypot(np.diff(x), np.diff(y))
            angles.append(turning(x, y)[near])
            lengths.append(np.maximum(size[:-1], size[1:])[near])
    angle = np.concatenate(angles)
    length = np.concatenate(lengths)
    curved = (angle > ROOT_OF_EPS) & (angle <= CORNER_ANGLE)
    return (angle[curved] if degree == 1 else angle[curved] ** 3 / 4), length[curved]


def beside(table: ContactTable, rows: Ints) -> list[Array]:
    """Return equal weights with sum 1 for the intervals at these rows, one array for each path,
    shape (intervals,).
    """
    touching = [np.isin(path[:-1], rows) | np.isin(path[1:], rows) for path in table.paths]
    count = sum(int(np.count_nonzero(part)) for part in touching)
    return [part / max(count, 1) for part in touching]


def pressure_square(table: ContactTable) -> float:
    """Return the squared norm of the pressure in L2(Gamma_c)."""
    return float(np.dot(table.columns["weight"], table.columns["pressure"] ** 2))


def on_facets(boundary: ContactBoundary, table: ContactTable, intervals: list[Array]) -> Array:
    """Return sums over the intervals between nodes, for each facet of this rank in the order of
    ``boundary.segments``.

    Args:
        boundary: the contact points of this rank.
        table: the contact table.
        intervals: one array for each path of the table, shape (rows - 1,).
    """
    assert table.nodes is not None
    rows, following = (
        np.concatenate([path[end] for path in table.paths]) for end in (slice(-1), slice(1, None))
    )
    base = int(table.nodes.max(initial=0)) + 1

    def keys(part: Ints, first: Ints, second: Ints) -> Ints:
        """Return a number for each pair of nodes on a boundary, in either order."""
        return (part * base + np.minimum(first, second)) * base + np.maximum(first, second)

    interval_keys = keys(table.nodes[rows, 0], table.nodes[rows, 1], table.nodes[following, 1])
    order = np.argsort(interval_keys)
    interval_keys = interval_keys[order]
    values = np.concatenate(intervals)[order]
    part = boundary.segments[:, 0]
    nodes = boundary.segments[:, 1:]
    total = np.zeros(len(part))
    if not interval_keys.size:  # between two bodies a single node may carry a point
        return total
    for k in range(nodes.shape[1] - 1):
        wanted = keys(part, nodes[:, k], nodes[:, k + 1])
        position = np.minimum(np.searchsorted(interval_keys, wanted), interval_keys.size - 1)
        total += np.where(
            interval_keys[position] == wanted, values[position], 0.0
        )  # between two bodies a node may carry no point
    return total


@dataclass(frozen=True)
class _Place:
    """A place of the boundary on the last mesh and on coarser meshes; pressure and spacing are
    listed coarsest first.
    """

    row: int
    corner: bool
    pressure: Array
    spacing: Array

    @classmethod
    def on(cls, tables: Sequence[ContactTable], rows: Sequence[int], *, corner: bool) -> _Place:
        """Return the place that is a row of each table."""
        pressure = np.array(
            [table.columns["pressure"][row] for table, row in zip(tables, rows, strict=True)]
        )
        spacing = np.array([_spacing(table)[row] for table, row in zip(tables, rows, strict=True)])
        meshes = [len(tables) - 1]
        for mesh in reversed(range(meshes[0])):
            if spacing[mesh] >= SMALLEST_JUMP * spacing[meshes[0]]:
                meshes.insert(0, mesh)
        return cls(rows[-1], corner, pressure[meshes], spacing[meshes])

    @property
    def growth(self) -> Array:
        """The power of 1 / h with which the pressure grows from mesh to mesh; infinite where
        contact begins.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            steps = np.diff(np.log(self.pressure))
        return steps / -np.diff(np.log(self.spacing))

    @property
    def grows(self) -> bool:
        """Whether the pressure grows with every refinement, on the last meshes with about the same
        power.
        """
        # Elsewhere than at a corner a pressure may grow until the mesh resolves it.
        meshes = GROWING_MESHES if self.corner else 2 * GROWING_MESHES
        powers = self.growth[-meshes:]
        lasting = (
            np.isfinite(powers).all()
            and len(powers) == meshes
            and powers[-1] > LASTING_SHARE * powers[0]
        )
        least = self.pressure[0] * (self.spacing[0] / self.spacing[-1]) ** GROWTH_POWER
        return bool(lasting and powers.min() > GROWTH_POWER and self.pressure[-1] > least)

    @property
    def settled(self) -> bool:
        """Whether the pressure has not grown over the last meshes, or grows less and less."""
        powers = self.growth[-GROWING_MESHES:]
        if len(powers) < GROWING_MESHES:
            return False
        with np.errstate(invalid="ignore"):  # where contact has begun and ended it is not known
            at_rest = max(powers[-1], np.mean(powers)) <= GROWTH_POWER
        return bool(at_rest or 0 < powers[-1] <= LASTING_SHARE * powers[0])

    @property
    def error(self) -> float:
        """The error of the pressure by the expected rate; infinite without a coarser mesh."""
        changes = self.pressure[-1] - self.pressure[-1 - CHANGES_USED : -1]
        finer = self.spacing[-1 - CHANGES_USED : -1] / self.spacing[-1]
        return (
            float((np.abs(changes) / (finer ** EXPECTED_RATES["peak"] - 1)).max())
            if changes.size
            else np.inf
        )

    @property
    def error_by_last_changes(self) -> float:
        """The error by the rate of the last two changes; 0 where there is no rate."""
        changes = np.diff(self.pressure)[-2:]
        steps = -np.diff(np.log(self.spacing))[-2:]
        if len(changes) < 2 or not changes.prod() > 0:
            return 0.0
        rate = np.log(changes[0] / changes[1] * steps[1] / steps[0]) / steps.mean()
        expected = EXPECTED_RATES["peak"]
        return float(
            abs(changes[1]) / (np.exp(steps[1] * np.clip(rate, expected / 2, expected)) - 1)
        )


def peak_error(tables: Sequence[ContactTable]) -> float | None:
    """Return the relative error of the largest pressure on the last mesh, or None.

    It is None without contact, with few nodes in contact, if no mesh was coarser at the peak, and
    if the pressure grows without limit at some place, or may do so at a corner.

    Args:
        tables: contact tables, coarsest mesh first.
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
    """Return the row of the last table where the pressure grows with every refinement, or None if
    there is none.

    Where the nodes in contact were few and became more, the pressure may simply not have been
    resolved so far: then None is returned.
    """
    touching = [table.touching for table in tables[-1 - GROWING_MESHES :]]
    if touching[-1] == 0 or (touching[0] < touching[-1] and min(touching[-2:]) < FEW_NODES):
        return None
    grows = next((place.row for place in _followed(tables) if place.grows), None)
    return _kinked_row(tables) if grows is None else grows


def _kinked_row(tables: Sequence[ContactTable]) -> int | None:
    """Return the row of the largest pressure of the last table if the gap has a kink there in 2D,
    or None.

    Towards a kink the pressure grows like a logarithm: the change of slope stays as cells become
    smaller, and so does what each mesh adds.
    """
    if len(tables) <= GROWING_MESHES or tables[-1].facets is not None:
        return None
    kinks = list[float]()
    spacing = list[float]()
    largest = list[float]()
    row = 0
    for table in tables[-1 - GROWING_MESHES :]:
        row = int(np.argmax(table.columns["pressure"]))
        largest.append(float(table.columns["pressure"][row]))
        spacing.append(float(_spacing(table)[row]))
        kinks.append(0.0)
        for path in table.paths:
            inside = np.flatnonzero(path == row)
            if 0 < inside[:1].sum() < len(path) - 1:
                beside = path[inside[0] - 1 : inside[0] + 2]
                slopes = (
                    np.diff(table.columns["gap"][beside])
                    / np.diff(table.arc(path))[inside[0] - 1 : inside[0] + 1]
                )
                kinks[-1] = float(slopes[1] - slopes[0])
    finer = -np.diff(np.log(spacing))
    if not (finer >= np.log(SMALLEST_JUMP)).all():
        return None
    added = np.diff(largest) / finer
    lasting = kinks[-1] > LASTING_SHARE * kinks[0] > 0 and added[-1] > LASTING_SHARE * added[0] > 0
    return row if lasting else None


def _followed(tables: Sequence[ContactTable]) -> list[_Place]:
    """Return the place of the largest pressure, then the corners in contact, on all meshes."""
    last = tables[-1]
    tops = [int(np.argmax(table.columns["pressure"])) for table in tables]
    if last.facets is not None:
        rims = [np.flatnonzero(ContactSurface.of(table).rim_nodes) for table in tables]
        on_rims = [
            int(rim[np.argmax(table.columns["pressure"][rim])])
            for rim, table in zip(rims, tables, strict=True)
        ]
        pressed = last.columns["pressure"][on_rims[-1]] > 0
        corners = [on_rims] if pressed else []
    else:
        turns = [_turns(table) for table in tables]
        corners = []
        for row in corner_rows(last):
            rows = [
                int(np.linalg.norm(places(table) - places(last)[row], axis=1).argmin())
                for table in tables
            ]
            # The facets of a rounding turn ever less.
            if turns[-1][row] > LASTING_SHARE * min(turns[0][rows[0]], np.pi):
                corners.append(rows)
    is_corner = any(rows[-1] == tops[-1] for rows in corners)
    found = [_Place.on(tables, tops, corner=is_corner)]
    return found + [_Place.on(tables, rows, corner=True) for rows in corners]


def corner_rows(table: ContactTable) -> Ints:
    """Return the rows in contact at corners of the body in 2D, and at the ends of the contact
    boundary.
    """
    return np.flatnonzero((_turns(table) > CORNER_ANGLE) & (table.columns["pressure"] > 0))


def _turns(table: ContactTable) -> Array:
    """Return the angle between the two intervals at each node in 2D, radians; infinite at ends of
    the boundary.
    """
    x = places(table)
    turns = np.full(len(table.columns["x"]), np.inf)
    for path in table.paths:
        around = np.append(path, path[1]) if is_closed(path) else path
        turns[around[1:-1]] = turning(*x[around].T)
    return turns


def _spacing(table: ContactTable) -> Array:
    """Return the length of the smaller interval at each node; in 3D the side of a square of the
    area of the node.
    """
    if table.facets is not None:
        return np.sqrt(table.columns["weight"])
    spacing = np.full(len(table.columns["x"]), np.inf)
    for path in table.paths:
        lengths = np.diff(table.arc(path))
        for rows in (path[:-1], path[1:]):
            np.minimum.at(spacing, rows, lengths)
    return spacing
