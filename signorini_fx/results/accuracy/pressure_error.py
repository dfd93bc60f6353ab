"""The error of the contact pressure along a curve in L2(Gamma_c), where it is, estimated from its kinks at the nodes.

Between the nodes the pressure is linear.  The change of its slope at the nodes indicates its error, in smooth parts as
well as at the ends of the contact zones.  At a corner of the body the stress may be singular,
the pressure like r^(a - 1) with 1/2 < a < 1: then nearly all of the error is in the one interval at the corner.  A
singular pressure is steepest there; one that is as steep farther away is bending, and one that is steeper there belongs
to a plane of symmetry or to an axis, which is no corner.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_table import ContactTable, is_closed
from signorini_fx.mechanics.kinematics.protocol import PLANE_STRAIN, Kinematics
from signorini_fx.results.accuracy.contact_surface import ContactSurface
from signorini_fx.tuned import (
    BENDING,
    CORNER_ANGLE,
    CORNER_ERROR_SHARE,
    CORNER_SHARE,
    FIT_STRETCH,
    JUMP_RATIO,
    KINK_SHARE,
    LARGEST_EXPONENT,
    SAME_LENGTH,
    STEEP_EXPONENT,
    STRAIGHT_ANGLE,
)

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


def interval_squares(
    table: ContactTable, kinematics: Kinematics = PLANE_STRAIN, *, corners: bool = True, blur: float = 0.0
) -> list[Floats]:
    """Estimated squared error of the pressure between neighbouring nodes, stress^2 times length, or area of a ring;
    ``corners``: whether to include the singular intervals at corners; ``blur``: length over which the regularisation
    smears the pressure there, 0 without.

    Returns:
        One array for each path of the table, shape (rows - 1,).
    """
    squares = []
    for path, measure in zip(table.paths, around(table, kinematics), strict=True):
        rows, s, path_slice = table.unrolled(path)
        squares.append(_squares(table, rows, s, blur, corners=corners)[path_slice] * measure)
    return squares


def _squares(table: ContactTable, rows: Ints, s: Floats, blur: float, *, corners: bool) -> Floats:
    pressure = table.columns["pressure"][rows]
    h = np.diff(s)
    squares = np.zeros(h.size)
    if h.size < 2:
        return squares
    kinks = np.diff(np.diff(pressure) / h) ** 2
    squares[:-1] += KINK_SHARE / 2 * h[:-1] ** 3 * kinks
    squares[1:] += KINK_SHARE / 2 * h[1:] ** 3 * kinks
    jumps = _jumps(s, pressure)
    squares[:-1] += h[:-1] * jumps**2 / 12
    squares[1:] += h[1:] * jumps**2 / 12
    for corner, interval in _corners(table, rows, s, blur):
        inside = interval if interval == corner - 1 else interval + 1  # the other node of the interval
        beside = inside if interval == corner else inside - 1  # the next interval
        if corners:
            r, values = _away(s, pressure, corner, interval)
            near, far = _slopes(r, values, blur)
            # A regularised pressure is less steep at the corner itself.
            steeper = 1.0 if blur > r[1] else BENDING
            squares[interval] = max(
                squares[interval],
                CORNER_SHARE * h[interval] ** 3 * kinks[inside - 1],
                0.0 if near >= steeper * far else singular_square(r, values, blur),
            )
        else:
            squares[[interval, beside]] = 0.0
    return squares


def _jumps(s: Floats, pressure: Floats) -> Floats:
    """Where the pressure jumps, as it does between two materials: by how much at each inner node, shape (nodes - 2,).

    It is extrapolated to the node from both sides; the difference is a jump if it is larger than all changes nearby.
    A line through a jump is wrong by half of it at one end of an interval: h jump^2 / 12.
    """
    jumps = np.zeros(s.size - 2)
    if s.size < 5:
        return jumps
    steps = np.diff(pressure)
    slopes = steps / np.diff(s)
    from_left = pressure[1:-3] + slopes[:-3] * (s[2:-2] - s[1:-3])
    right = pressure[3:-1] + slopes[3:] * (s[2:-2] - s[3:-1])
    size = np.abs(from_left - right)
    pressed = np.lib.stride_tricks.sliding_window_view(pressure != 0, 5).all(axis=1)
    beyond = size > JUMP_RATIO * np.maximum(np.abs(steps[:-3]), np.abs(steps[3:]))
    jumps[1:-1] = np.where(pressed & beyond, size, 0.0)
    return jumps


def singular_square(r: Floats, pressure: Floats, blur: float) -> float:
    """Squared error beside a corner if the pressure is K r^-a there, fitted to the nodes farther away; ``r``: distance
    of the nodes from the corner, which is the first; ``blur``: up to this distance the regularisation smears the
    pressure.
    """
    # Neighbouring nodes of quadratic elements behave differently, every second one alike.
    even = np.arange(2, r.size, 2)
    near = even[r[even] >= 2 * max(r[1], blur) * (1 - SAME_LENGTH)]
    if near.size < 2 or not 0 < pressure[near[1]] < pressure[near[0]]:
        return 0.0
    first = near[0]
    if bends(r[near], pressure[near]):
        return 0.0
    falling = near[: 1 + int(np.argmin(np.append(np.diff(pressure[near]) < 0, False)))]
    stretch = falling[(r[falling] <= FIT_STRETCH * r[first] * (1 + SAME_LENGTH)) & (pressure[falling] > 0)]

    def growth(node: int) -> float:
        return float(np.log(pressure[first] / pressure[node]) / np.log(r[node] / r[first]))

    a = growth(near[1])
    if a > STEEP_EXPONENT and stretch[-1] > first:
        # Two neighbours mostly reflect their element; a singularity shows over the whole range where it dominates.
        a = max(a, growth(stretch[-1]))
    a = min(a, LARGEST_EXPONENT)
    h, start, slope = r[1], pressure[0], pressure[1] - pressure[0]
    k = pressure[first] * (r[first] / h) ** a  # at the end of the interval
    square = k**2 / (1 - 2 * a) - 2 * k * (start / (1 - a) + slope / (2 - a))
    total = h * (square + start**2 + start * slope + slope**2 / 3)
    if blur > h:
        inner = slice(1, int(np.searchsorted(r, blur)) + 1)
        missing = k * (r[inner] / h) ** -a - pressure[inner]
        total += float(np.dot(missing[:-1] ** 2 + missing[1:] ** 2, np.diff(r[inner])) / 2)
    return float(max(0.0, total))


def bends(r: Floats, pressure: Floats) -> bool:
    """Whether a pressure falls like a line, as that of bending does, or faster, and not like a power; ``r``: distance
    of nodes from the corner, ascending, at least two.

    In the logarithm of the distance a power falls ever more slowly, a line twice as fast at twice the distance.
    """
    third = 1 + int(np.searchsorted(r[1:], r[1] ** 2 / r[0] * (1 - SAME_LENGTH)))  # as many times farther as the second
    if third >= r.size:
        return False
    p, x = pressure[[0, 1, third]], np.log(r[[0, 1, third]])
    slopes = np.diff(p) / np.diff(x)
    return bool(p[2] > 0 and slopes[1] < BENDING * slopes[0])


def _away(s: Floats, pressure: Floats, corner: int, interval: int) -> tuple[Floats, Floats]:
    """Distance of the nodes from the corner, which is the first, and their pressure, on the side of the interval."""
    away = slice(corner, None) if interval == corner else slice(corner, None, -1)
    return np.abs(s[away] - s[corner]), pressure[away]


def _slopes(r: Floats, pressure: Floats, blur: float) -> tuple[float, float]:
    """Slopes of the pressure from the corner to the first node that ``singular_square`` looks at, and from there to one
    twice as far away; nan where there are no such nodes; arguments as of that.
    """
    even = np.arange(0, r.size, 2)
    first = 1 + int(np.searchsorted(r[even[1:]], 2 * max(r[1], blur) * (1 - SAME_LENGTH)))
    if first >= even.size:
        return np.nan, np.nan
    second = first + int(np.searchsorted(r[even[first:]], 2 * r[even[first]] * (1 - SAME_LENGTH)))
    if second >= even.size:
        return np.nan, np.nan
    nodes = even[[0, first, second]]
    near, far = np.diff(pressure[nodes]) / np.diff(r[nodes])
    return float(near), float(far)


def _corners(table: ContactTable, rows: Ints, s: Floats, blur: float = 0.0) -> list[tuple[int, int]]:
    """Nodes in contact at a corner of the body or at the ends of these rows, each with an interval beside it.

    A pressure that falls from a corner is steepest there if it is singular.  Where it is less steep there is no corner
    but a plane of symmetry or an axis.
    """
    pressure, last = table.columns["pressure"][rows], len(rows) - 1
    pairs = [(0, 0), (last, last - 1)]
    if "x" in table.columns:
        x, y = table.columns["x"][rows], table.columns["y"][rows]
        for node in np.flatnonzero(turning(x, y) > CORNER_ANGLE) + 1:
            pairs += [(node, k) for k in (node - 1, node) if 0 < k < last - 1]
    corners = []
    for node, interval in pairs:
        near, far = _slopes(*_away(s, pressure, node, interval), blur)
        flatter = near * pressure[node] < 0 and abs(far) > BENDING * abs(near) and near * far > 0
        if pressure[node] != 0 and not flatter:
            corners.append((node, interval))
    return corners


def corners_of_error(table: ContactTable, kinematics: Kinematics = PLANE_STRAIN) -> Floats:
    """Positions of the corners with a large share of the error of the pressure beside them, shape (n, 2)."""
    squares = interval_squares(table, kinematics)
    much = CORNER_ERROR_SHARE * sum(float(part.sum()) for part in squares)
    nodes: list[int] = []
    for path, of_path in zip(table.paths, squares, strict=True):
        rows, s, part = table.unrolled(path)
        for node, interval in _corners(table, rows, s) if of_path.size > 1 else []:
            if part.start <= interval < part.stop and of_path[interval - part.start] > much:
                nodes.append(int(rows[node]))
    return np.column_stack((table.columns["x"][nodes], table.columns["y"][nodes]))


def turning(x: Floats, y: Floats) -> Floats:
    """Angle from each interval to the next, radians, shape (nodes - 2,)."""
    angle = np.diff(np.arctan2(np.diff(y), np.diff(x)))
    return np.abs((angle + np.pi) % (2 * np.pi) - np.pi)


def polygon_error(table: ContactTable, modulus: float) -> float:
    """The effect of straight facets in place of a curved contact boundary, relative to the contact pressure;
    ``modulus``: stress per strain of the plane.

    The slope of a polygon differs from that of the curve by up to half the angle between its facets, and slope times
    modulus is a pressure.
    """
    c, (turns, _) = table.columns, chords(table)
    square, length = pressure_square(table), float(np.sum(c["weight"][c["pressure"] != 0]))
    return float(modulus * np.sqrt(np.mean(np.square(turns)) * length / square)) if turns.size and square > 0 else 0.0


def chords(table: ContactTable) -> tuple[Floats, Floats]:
    """Angles between the facets that are pressed and their neighbours, radians, corners left out, and lengths of these
    facets.
    """
    c, angles, lengths = table.columns, [np.zeros(0)], [np.zeros(0)]
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
            x, y = c["x"][rows], c["y"][rows]
            size = np.hypot(np.diff(x), np.diff(y))
            angles.append(turning(x, y)[near])
            lengths.append(np.maximum(size[:-1], size[1:])[near])
    angle, length = np.concatenate(angles), np.concatenate(lengths)
    curved = (angle > STRAIGHT_ANGLE) & (angle <= CORNER_ANGLE)
    return angle[curved], length[curved]


def beside(table: ContactTable, rows: Ints) -> list[Floats]:
    """Equal shares of 1 for the intervals beside these rows, one array for each path, shape (intervals,)."""
    touching = [np.isin(path[:-1], rows) | np.isin(path[1:], rows) for path in table.paths]
    count = sum(int(np.count_nonzero(part)) for part in touching)
    return [part / max(count, 1) for part in touching]


def pressure_square(table: ContactTable) -> float:
    """The squared norm of the pressure in L2(Gamma_c)."""
    return float(np.dot(table.columns["weight"], table.columns["pressure"] ** 2))


def around(table: ContactTable, kinematics: Kinematics) -> list[Floats]:
    """By what the length of each interval of ``interval_squares`` is multiplied: in a body of revolution the length of
    the circumference at its middle, elsewhere 1.
    """
    if kinematics.uniform:
        return [np.ones(len(path) - 1) for path in table.paths]
    x = np.column_stack((table.columns["x"], table.columns["y"]))
    measures = (kinematics.measure_at((x[path[:-1]] + x[path[1:]]) / 2) for path in table.paths)
    return [measure for measure in measures if measure is not None]


def on_facets(boundary: ContactBoundary, table: ContactTable, intervals: list[Floats]) -> Floats:
    """Sums over the intervals between nodes, for each facet of this rank, as in ``boundary.segments``; ``intervals``:
    one array for each path of the table, shape (rows - 1,).
    """
    assert table.nodes is not None
    rows, following = (np.concatenate([path[end] for path in table.paths]) for end in (slice(-1), slice(1, None)))
    base = int(table.nodes.max(initial=0)) + 1

    def keys(part: Ints, first: Ints, second: Ints) -> Ints:
        """One number for each pair of nodes on a boundary, in either order."""
        return (part * base + np.minimum(first, second)) * base + np.maximum(first, second)

    interval_keys = keys(table.nodes[rows, 0], table.nodes[rows, 1], table.nodes[following, 1])
    order = np.argsort(interval_keys)
    interval_keys, values = interval_keys[order], np.concatenate(intervals)[order]
    part, nodes = boundary.segments[:, 0], boundary.segments[:, 1:]
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
