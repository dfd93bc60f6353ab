"""The foundation of a body as it is drawn, and the magnification of displacements."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from signorini_fx.addons.pictures.body import DrawnBody, normals_of
from signorini_fx.addons.pictures.boundary_profiles import (
    ContactColumns,
    boundaries_of,
    by_boundary,
)
from signorini_fx.addons.pictures.style import TIMES, number, readable
from signorini_fx.arrays import Array, Flags, Ints, inner
from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.results.fields import facets_of
from signorini_fx.tuned import SEEN_AS_IT_IS, SHARP_EDGE, SMALL_PART

if TYPE_CHECKING:
    from typing import Any

_BENT = math.cos(math.radians(SHARP_EDGE))

# In 2D lines, in 3D points and triangles.
DrawnSurface = list[Array] | tuple[Array, Ints]


@dataclass(frozen=True)
class Foundation:
    """A contact boundary and the foundation or body that it may touch; in 2D a connected part of
    it, with the body on its left.
    """

    nodes: Array  # positions of the contact nodes, length, in 2D in order, shape (k, d)
    normals: Array  # towards the foundation or other body, shape (k, d)
    gap: Array  # distance d of the foundation or other body along them, length, shape (k,)
    touching: Flags  # nodes in contact, shape (k,)
    facets: Ints | None = (
        None  # in 3D nodes of each facet, in order along its perimeter, shape (m, 3) or (m, 4)
    )
    rigid: bool = True  # False: another body, which is drawn itself
    # the whole surface of a rigid shape near the body, see ``drawn_shapes``, in 2D for one part of
    # a boundary and [] for the others; None: only the points opposite the nodes are known
    surface: Any = None

    def drawn(self, factor: float) -> Array:
        """Return the points opposite the nodes, with the gap times a factor, shape (k, d)."""
        return self.nodes + factor * self.gap[:, None] * self.normals

    def keeps_shape(self, factor: float, size: float) -> bool:
        """Return whether the foundation keeps its shape when the gap is multiplied by a factor.

        Args:
            factor: the factor.
            size: size of the body, length.
        """
        places = self.drawn(1.0), self.drawn(factor)
        if self.facets is None:  # along the sides
            real, drawn = (np.diff(points, axis=0) for points in places)
        else:
            real, drawn = (normals_of(points[self.facets]) for points in places)
        lengths = np.linalg.norm(real, axis=1) * np.linalg.norm(drawn, axis=1)
        farther = (factor - 1) * float(np.abs(self.gap).max(initial=0.0))
        return farther <= SMALL_PART * size and bool((inner(real, drawn) >= _BENT * lengths).all())


def foundations_of(
    table: ContactTable,
    motions: Mapping[str, Callable[[Array], Array]],
    shapes: Mapping[str, DrawnSurface],
) -> list[Foundation]:
    """Return the foundation or other body of each contact boundary, in 2D for each connected part
    of it.

    Args:
        table: the contact boundary.
        motions: for a boundary with a rigid body, a function from points of shape (n, d) to the
            displacement of the rigid body there.
        shapes: the whole foundation of a boundary, see ``drawn_shapes``.
    """
    foundations = list[Foundation]()
    left = dict(shapes)
    for boundary, facets in _parts(table):
        nodes = boundary.vectors("")
        normals = boundary.vectors("n_")
        name = str(boundary.columns["boundary"][0])
        gap = boundary.floats("gap")
        if name in motions:  # of its motion that along the normals is seen
            gap = gap + np.sum(normals * motions[name](nodes), axis=1)
        known = nodes, normals, gap, boundary.touching, facets
        foundations.append(Foundation(*known, not boundary.against, left.get(name)))
        if name in left and facets is None:
            left[name] = []
    return foundations


def _parts(table: ContactTable) -> Iterator[tuple[ContactColumns, Ints | None]]:
    """Yield the boundaries in 3D with their facets, or in 2D the connected parts that have
    a gap.
    """
    if table.facets is not None:
        yield from by_boundary(
            table.columns, facets_of(table)[:, :4]
        )  # those of VTK begin with their corners
        return
    for boundary in boundaries_of(table):
        known = boundary.at(np.flatnonzero(np.isfinite(boundary.floats("gap"))))
        for first, end in pairwise([*known.starts, len(known.coordinate)]):
            part = known.at(np.arange(first, end))
            x, y = np.diff(part.vectors(""), axis=0).T
            right, up = part.vectors("n_")[1:].T
            if x @ up > y @ right:  # normals to the left of the way: it is to be the other one
                part = part.at(np.arange(end - first)[::-1])
            if end - first > 1:
                yield part, None


def magnification(body: DrawnBody, foundations: Sequence[Foundation]) -> float:
    """Return a factor that makes the displacement visible: the largest becomes about 8 % of the
    diagonal.

    It is 1, 2 or 5 times a power of ten.  Between two bodies that touch it shows a gap or an
    overlap of at most 0.3 % of the diagonal.

    It is 1 if the displacement is round-off, if it is visible without magnification, above 3 % of
    the diagonal, and if it would bend a rigid foundation visibly, as under a disk on a plane: the
    gap is magnified too, because otherwise the body would seem to enter the foundation.
    """
    largest = float(np.linalg.norm(body.displacement, axis=1).max(initial=0.0))
    if not (math.isfinite(largest) and largest > np.finfo(np.float64).eps * body.size):
        return 1.0
    ideal = 0.08 * body.size / largest
    pairs = [part for part in foundations if not part.rigid]
    closed = [
        np.abs(part.gap).max(initial=0.0, where=part.touching & np.isfinite(part.gap))
        for part in pairs
    ]
    if parted := float(max(closed, default=0.0)):
        ideal = min(ideal, 0.003 * body.size / parted)
    factor = readable(ideal) if ideal > SEEN_AS_IT_IS else 1.0
    rigid = [part for part in foundations if part.rigid]
    return factor if all(part.keeps_shape(factor, body.size) for part in rigid) else 1.0


def magnified(foundations: Sequence[Foundation], factor: float) -> str:
    """Return what is magnified and the factor, in words."""
    gap = " and gap" if factor != 1 and any(part.rigid for part in foundations) else ""
    return f"displacement{gap} {TIMES} {number(factor)}"
