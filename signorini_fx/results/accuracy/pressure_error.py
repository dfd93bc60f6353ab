"""The error of the contact pressure along a curve in L2(Gamma_c), where it is, estimated from its kinks at the nodes.

Between the nodes the pressure is linear.  The change of its slope at the nodes indicates its error, in smooth parts as
well as at the ends of the contact zones.  At a corner of the body the stress may be singular, the pressure like
r^(a - 1) with 1/2 < a < 1: then nearly all of the error is in the one interval at the corner.  There the pressure is
convex; at a plane of symmetry or an axis, which is no corner, it is concave.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_table import ContactTable, is_closed
from signorini_fx.mechanics.kinematics.protocol import PLANE_STRAIN, Kinematics
from signorini_fx.results.accuracy.contact_surface import ContactSurface
from signorini_fx.tuned import CORNER_ANGLE, CORNER_ERROR_SHARE, CORNER_SHARE, JUMP_RATIO, KINK_SHARE, ROOT_OF_EPS

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


def interval_squares(table: ContactTable, kinematics: Kinematics = PLANE_STRAIN) -> list[Floats]:
    """Estimated squared error of the pressure between neighbouring nodes, stress^2 times length, or area of a ring.

    Returns:
        One array for each path of the table, shape (rows - 1,).
    """
    squares = []
    for path, measure in zip(table.paths, around(table, kinematics), strict=True):
        rows, s, path_slice = table.unrolled(path)
        squares.append(_squares(table, rows, s)[path_slice] * measure)
    return squares


def _squares(table: ContactTable, rows: Ints, s: Floats) -> Floats:
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
    for corner, interval in _corners(table, rows, s):
        inside = interval if interval == corner - 1 else interval + 1  # the other node of the interval
        squares[interval] = max(squares[interval], CORNER_SHARE * h[interval] ** 3 * kinks[inside - 1])
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


def _corners(table: ContactTable, rows: Ints, s: Floats) -> list[tuple[int, int]]:
    """Nodes in contact at corners and ends, each with an interval beside it towards which the pressure is convex."""
    pressure, last = np.abs(table.columns["pressure"][rows]), len(rows) - 1
    pairs = [(0, 0), (last, last - 1)]
    if "x" in table.columns:
        x, y = table.columns["x"][rows], table.columns["y"][rows]
        for node in np.flatnonzero(turning(x, y) > CORNER_ANGLE) + 1:
            pairs += [(node, k) for k in (node - 1, node) if 0 < k < last - 1]
    bends = np.diff(np.diff(pressure) / np.diff(s))
    corners = []
    for node, interval in pairs:
        inside = interval if interval == node - 1 else interval + 1
        pressed = (pressure[[node, inside, 2 * inside - node]] > 0).all()  # the end of a contact zone is another matter
        if pressed and bends[inside - 1] > 0:
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
    curved = (angle > ROOT_OF_EPS) & (angle <= CORNER_ANGLE)
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
