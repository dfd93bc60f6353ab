"""A displacement of two bodies that do not enter each other, from one that does: both sides are moved apart.

On facets that match, the jump less the gap has coefficients of Bernstein at common vertices and in the middle.  At a
vertex both sides move by hat functions, by shares with the least energy of springs in series; in the middle the softer
side moves by a parabola.  Where contact is closed they may as well be moved to each other: what is left open between
nodes times the pressure is of the order of the error, while a change costs its square.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum

import numpy as np

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.bounded_error import out
from signorini_fx.addons.bounds.common_refinement import CommonRefinement
from signorini_fx.addons.bounds.plain_scene import FacetsInContact
from signorini_fx.addons.bounds.simplices import EDGES_OF_FACET, Simplices
from signorini_fx.quantities.proved_statements import Refused
from signorini_fx.tuned import SAME_LENGTH


class Shut(IntEnum):
    """What is closed besides what would overlap: nothing, the gap under pressure, and slip that friction prevents."""

    NOTHING = 0
    GAPS = 1
    SLIP = 2


# Of a contact, from a displacement at vertices and middles: coefficients of the jump along its normals, less the gap.
Relative = Callable[[FacetsInContact, Array, Array], Array]


def separate(
    t: Simplices,
    pairs: list[FacetsInContact],
    relative: Relative,
    y: Array,
    middle: Array,
    free: tuple[Array, Array],
    tiny: float,
    shut: Shut,
) -> None:
    """Move a displacement in place.

    Args:
        t: the cells.
        pairs: the contacts.
        relative: coefficients of Bernstein of the displacement relative to the other side, shape (m, 3 or 6, d).
        y: at vertices, length, shape (v, d).
        middle: at middles of edges, length, shape (e, d).
        free: projectors onto the directions in which supports let vertices and edges move, shapes (v, d, d), (e, d, d).
        tiny: a length of the size of round-off.
        shut: what is closed.

    Raises:
        Refused: supports leave no way out.
    """
    d = t.dimension
    for surface in pairs:
        assert surface.opposite is not None
        unmoved, opposite = y.copy(), surface.opposite
        for (slave, master), rows in _over_each_other(t.facets[surface.facets], opposite.vertices(t)).items():
            row, column = np.array(rows).T
            normals, share = surface.normal[row], float(opposite.share[row].mean())
            jump = y[slave] - y[master]
            excess = normals @ jump - surface.below[row, column]
            ways = free[0][slave], free[0][master]
            slip = jump - surface.before[row[0], column[0]]
            closed = surface.bilateral or (shut >= Shut.GAPS and bool((surface.pressure[row, column] > 0).any()))
            sizes = np.linalg.norm(surface.shear[row, column], axis=1)
            stuck = (sizes < (1 - SAME_LENGTH) * surface.least[row, column]).all()
            sticks = surface.bonded or (shut >= Shut.SLIP and closed and bool(stuck))
            step = _step(normals, excess, slip if sticks else None, ways, share, tiny, surface, closed=closed)
            y[slave] -= share * ways[0] @ step
            y[master] += (1 - share) * ways[1] @ step
        middle += (y - unmoved)[t.edges].mean(axis=1)
        coefficient = relative(surface, y, middle)
        edges = _over_each_other(t.edges_of_facets[surface.facets], opposite.edges(t))
        for (edge, across), rows in edges.items():
            row, column = np.array(rows).T
            ends = EDGES_OF_FACET[d][column]
            normals, jump = surface.normal[row], coefficient[row[0], d + column[0]]
            excess = normals @ jump - surface.below[row, d + column]
            pressed = (surface.pressure[row[:, None], ends] > 0).all(axis=1)
            closed = surface.bilateral or (shut >= Shut.GAPS and bool(pressed.any()))
            sizes = np.linalg.norm(surface.shear[row[:, None], ends], axis=2)
            stuck = (sizes < (1 - SAME_LENGTH) * surface.least[row[:, None], ends]).all()
            sticks = surface.bonded or (shut >= Shut.SLIP and closed and bool(stuck))
            if not (closed or sticks) and excess.max() <= -tiny:
                continue
            ways = free[1][edge], free[1][across]
            along = [float(np.linalg.norm(way @ normals[0])) for way in ways]
            share = float(opposite.share[row].mean() >= 0.5)
            if min(along) < 0.5 < max(along):
                share = float(along[0] > along[1])
            slip = jump - surface.before[row[0], d + column[0]] if sticks else None
            step = _step(normals, excess, slip, ways, share, tiny, surface, closed=closed)
            # Twice the middle of an edge is what its coefficient of Bernstein has of it.
            middle[edge] -= share * ways[0] @ step / 2
            middle[across] += (1 - share) * ways[1] @ step / 2


def separate_unmatched(
    t: Simplices,
    pairs: list[tuple[FacetsInContact, CommonRefinement]],
    relative: Relative,
    y: Array,
    middle: Array,
    free: Array,
    tiny: float,
) -> None:
    """Move both sides of contacts apart, in place, where facets do not match: each vertex by its share of the largest
    excess on the facets around, so that the change is as large everywhere on these.  What supports keep of this the
    other side does.

    Args:
        t: the cells.
        pairs: the contacts, and the triangles that facets share.
        relative: see ``separate``.
        y: at vertices, length, shape (v, 3).
        middle: at middles of edges, length, shape (e, 3).
        free: projectors onto the directions in which supports let vertices move, shape (v, 3, 3).
        tiny: a length of the size of round-off.
    """
    for surface, refined in pairs:
        assert surface.opposite is not None
        normal, first = surface.normal[0], float(surface.opposite.share.mean())
        along = np.einsum("vij,j->vi", free, normal)
        part = along @ normal
        movable = part > 0.25  # half of a unit vector along the normal is left
        steps = np.where(movable[:, None], along / np.where(movable, part, 1.0)[:, None], 0.0)
        for share in (first, 0.0, 1.0):
            excess, unmoved = surface.excess(relative(surface, y, middle)), y.copy()
            if excess.max(initial=-np.inf) <= -tiny:
                break
            for side, of_side in enumerate((-share, 1 - share)):
                depths, faces = np.zeros(len(y)), refined.facets[side]
                depth = (refined.largest(excess, side) + tiny).clip(min=0.0)
                np.maximum.at(depths, t.facets[faces], depth[:, None])
                y += of_side * depths[:, None] * steps
            middle += (y - unmoved)[t.edges].mean(axis=1)


def _over_each_other(slave: Ints, master: Ints) -> dict[tuple[int, int], list[tuple[int, int]]]:
    """The vertices or edges of both sides that lie over each other, shapes (m, k), with the facets and the places."""
    rows = dict[tuple[int, int], list[tuple[int, int]]]()
    for k, column in np.ndindex(slave.shape):
        rows.setdefault((int(slave[k, column]), int(master[k, column])), []).append((k, column))
    return rows


def _step(
    normals: Array,
    excess: Array,
    slip: Array | None,
    ways: tuple[Array, Array],
    share: float,
    tiny: float,
    surface: FacetsInContact,
    *,
    closed: bool,
) -> Array:
    """What changes the jump by a step that both sides share, shape (d,): the first one moves by minus its share of it.

    Args:
        normals: along which the jump is bounded, shape (r, d).
        excess: of it, length, shape (r,).
        slip: to be taken away, length, shape (d,); None: none is.
        ways: projectors onto the directions in which both sides may move.
        share: of the first side.
        tiny: length.
        surface: the contact.
        closed: whether negative excess is taken away, too.
    """
    step: Array = np.zeros(normals.shape[1])
    free = share * ways[0] + (1 - share) * ways[1]
    if closed or slip is not None:
        mean = normals.mean(axis=0)
        rows, lengths = ([mean], [excess.max()]) if not surface.bilateral else (list(normals), list(excess))
        if slip is not None:
            tangents = np.linalg.svd(mean[None])[2][1:]  # perpendicular to it
            rows, lengths = [*rows, *tangents], [*lengths, *(tangents @ slip)]
        step = np.linalg.lstsq(np.array(rows) @ free, np.array(lengths), rcond=SAME_LENGTH)[0]
        if surface.bilateral:
            if np.abs(np.array(rows) @ free @ step - lengths).max() > SAME_LENGTH * np.abs(lengths).max() + tiny:
                raise Refused("supports and contact that cannot open prescribe different displacements")
            return np.asarray(step)
    remaining = excess - normals @ free @ step
    if (remaining > -tiny).any():
        step = step + out(normals, remaining + tiny, free, tiny)
    return np.asarray(step)
