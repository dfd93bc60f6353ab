"""The boundary of a body of elements: its facets, which of them are meant by nodes or facets of a file, and where the
body is.  No dolfinx here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from signorini_fx.mechanics.mesh.files.abaqus import faces_of
from signorini_fx.mechanics.mesh.files.cells import CELLS
from signorini_fx.mechanics.mesh.files.raw import RawMesh, row_keys, rows_of
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.tuned import DIGITS_OF_FILES, SAME_LENGTH

_CORNERS = {"l": 2, "t": 3, "q": 4}
# Along each side of a facet, from which lines go to the other side: a smaller part of a facet there may be missed.
_PLACES = 12


def _facets_of(kind: str) -> list[tuple[str, tuple[int, ...]]]:
    """The facets of a kind of element, each with its kind and its nodes; of a wedge, which has two kinds of them."""
    if kind in CELLS:
        return [(CELLS[kind].facet, places) for places in CELLS[kind].facet_nodes]
    return [({3: "triangle", 4: "quad"}[len(places)], places) for places in faces_of(kind)]


class BodyFacets:
    """Elements of a body and the facets of its boundary, each facet as an element of its own.

    Attributes:
        mesh: blocks of elements, then blocks of facets.
        cells: of the blocks how many are of elements.
    """

    def __init__(self, points: Floats, blocks: Sequence[tuple[str, Ints]]) -> None:
        self.cells = len(blocks)
        facets: dict[str, list[tuple[int, Ints]]] = {}
        for block, (kind, nodes) in enumerate(blocks):
            for facet, places in _facets_of(kind):
                facets.setdefault(facet, []).append((block, nodes[:, list(places)]))
        outer: list[tuple[str, Ints]] = []
        inwards: list[Floats] = []
        for kind, parts in facets.items():
            rows = np.concatenate([nodes for _, nodes in parts])
            middles = np.concatenate([points[blocks[block][1]].mean(axis=1) for block, _ in parts])
            keys = row_keys(rows[:, : _CORNERS[kind[0]]])
            alone = np.bincount(keys)[keys] == 1
            outer.append((kind, rows[alone]))
            inwards.append(middles[alone])
        self.mesh = RawMesh(points, [*blocks, *outer])
        self._middles = inwards
        self._parts = self._connected(blocks, len(points))

    @staticmethod
    def _connected(blocks: Sequence[tuple[str, Ints]], count: int) -> Ints:
        pairs = [(nodes[:, [0]].repeat(nodes.shape[1], axis=1).ravel(), nodes.ravel()) for _, nodes in blocks]
        i, j = (np.concatenate([pair[k] for pair in pairs]) for k in (0, 1))
        graph = coo_array((np.ones(len(i)), (i, j)), shape=(count, count))
        return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)

    def nothing(self) -> list[Any]:
        """Of each block no element."""
        return [np.zeros(len(nodes), dtype=bool) for _, nodes in self.mesh.blocks]

    def within(self, nodes: Ints) -> list[Any]:
        """The facets all of whose corners are among some nodes."""
        marks = self.nothing()
        for k, (kind, rows) in self._outer():
            marks[k] = np.isin(rows[:, : _CORNERS[kind[0]]], nodes).all(axis=1)
        return marks

    def matching(self, wanted: Ints) -> tuple[list[Any], int]:
        """The facets that have the same corners as some others, and how many of these are none."""
        marks, missing = self.nothing(), len(wanted)
        for k, (kind, rows) in self._outer():
            if wanted.shape[1] != _CORNERS[kind[0]] or not len(wanted):
                continue
            at = rows_of(wanted, rows[:, : wanted.shape[1]])
            marks[k][at[at >= 0]] = True
            missing -= int((at >= 0).sum())
        return marks, missing

    def outward(self, wanted: Ints) -> Floats:
        """Whether the normals of facets, by the order of their corners, point out of the body: 1.0, or -1.0; 0.0 of
        what is no facet of the boundary.  The normal of a side from a to b is that to its right.
        """
        signs = np.zeros(len(wanted))
        points = self.mesh.points
        for (_, (kind, rows)), middles in zip(self._outer(), self._middles, strict=True):
            if wanted.shape[1] != _CORNERS[kind[0]] or not len(wanted):
                continue
            at = rows_of(wanted, rows[:, : wanted.shape[1]])
            located = np.flatnonzero(at >= 0)
            x = points[wanted[located]]
            away = x.mean(axis=1) - middles[at[located]]
            signs[located] = np.sign(np.einsum("ij,ij->i", _normals(x, kind), away))
        return signs

    def leans(self, marks: list[Any], component: int) -> bool:
        """Whether a facet of a choice has a normal with a component."""
        for k, (kind, rows) in self._outer():
            normals = _normals(self.mesh.points[rows[marks[k]]], kind)
            sizes = np.linalg.norm(normals, axis=1)
            if (np.abs(normals[:, component]) > DIGITS_OF_FILES * sizes).any():
                return True
        return False

    def filled(self, marks: list[Any], nodes: Ints) -> Ints:
        """Of some nodes those of facets of a choice that have no others."""
        collected = [np.empty(0, np.int64)]
        for k, (_, rows) in self._outer():
            chosen = rows[marks[k]]
            collected.append(chosen[np.isin(chosen, nodes).all(axis=1)].ravel())
        return np.unique(np.concatenate(collected))

    def halves(self, marks: list[Any]) -> tuple[list[Any], list[Any]]:
        """Facets on the connected part of the body that has the first one of them, and those on all others."""
        parts = [self._parts[rows[:, 0]] for _, rows in self.mesh.blocks]
        first = next((part[mark][0] for part, mark in zip(parts, marks, strict=True) if mark.any()), -1)
        pairs = list(zip(parts, marks, strict=True))
        return [mark & (part == first) for part, mark in pairs], [mark & (part != first) for part, mark in pairs]

    def facing(self, marks: list[Any], others: list[Any]) -> list[Any]:
        """Of other facets those that are met first by a line along the normal of a facet of a choice, from one of many
        places of it; corners count, and not nodes between them.
        """
        found, points = self.nothing(), self.mesh.points
        targets = [
            (k, np.flatnonzero(others[k]), points[rows[others[k]][:, : _CORNERS[kind[0]]]])
            for k, (kind, rows) in self._outer()
        ]
        rows_of_targets = [(k, row) for k, chosen, _ in targets for row in chosen]
        pieces = [_triangles(x) for _, _, x in targets]
        corners = np.concatenate([piece.reshape(-1, *piece.shape[2:]) for piece in pieces if piece.size])
        first = np.cumsum([0, *(len(chosen) for _, chosen, _ in targets)])
        owner = np.concatenate(
            [
                start + np.tile(np.arange(piece.shape[1]), piece.shape[0])
                for start, piece in zip(first, pieces, strict=False)
                if piece.size
            ]
        )
        near = _Nearness.of(corners)
        for k, (kind, rows) in self._outer():
            x = points[rows[marks[k]][:, : _CORNERS[kind[0]]]]
            for facet, normal in zip(x, _normals(x, kind), strict=True):
                hit = near.met(_places(facet), np.asarray(normal / np.linalg.norm(normal)))
                for number in np.unique(owner[hit[hit >= 0]]):
                    block, row = rows_of_targets[int(number)]
                    found[block][row] = True
        return found

    def _outer(self) -> list[tuple[int, tuple[str, Ints]]]:
        return list(enumerate(self.mesh.blocks))[self.cells :]


def _triangles(x: Floats) -> Floats:
    """Facets by their corners as lines or triangles, one for each, or two, shape (1 or 2, facets, 2 or 3, 3)."""
    if x.shape[1] < 4:
        return x[None]
    return np.stack((x[:, :3], x[:, [0, 2, 3]]))


def _places(corners: Floats) -> Floats:
    """Many places inside of a facet, shape (n, 3)."""
    at = (np.arange(_PLACES) + 0.5) / _PLACES
    if len(corners) == 2:
        return np.asarray(corners[0] + at[:, None] * (corners[1] - corners[0]))
    s, t = (along.ravel() for along in np.meshgrid(at, at))
    if len(corners) == 3:
        s, t = s[s + t < 1], t[s + t < 1]
        weights = np.column_stack((1 - s - t, s, t))
    else:
        weights = np.column_stack(((1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t))
    return np.asarray(weights @ corners)


@dataclass(frozen=True)
class _Nearness:
    """Lines or triangles, and a tree by which those near a line are found.

    Attributes:
        corners: shape (m, 2 or 3, 3).
        middles: of balls around them, shape (m, 3).
        radii: of these, length, shape (m,).
        tree: of the middles.
    """

    corners: Floats
    middles: Floats
    radii: Floats
    tree: Any

    @classmethod
    def of(cls, corners: Floats) -> _Nearness:
        """Of some lines or triangles."""
        from scipy.spatial import cKDTree

        middles = corners.mean(axis=1)
        radii = np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1)
        return cls(corners, middles, radii, cKDTree(middles))

    def met(self, places: Floats, normal: Floats) -> Ints:
        """Which is the nearest one on a line along a unit normal through each of some places, see ``_met``."""
        centre = places.mean(axis=0)
        radius = float(np.linalg.norm(places - centre, axis=1).max())
        numbers = self._along(centre, normal, radius)
        nearest = _met(places, normal, self.corners[numbers])
        return np.where(nearest >= 0, numbers[nearest], -1) if numbers.size else nearest

    def _along(self, centre: Floats, normal: Floats, radius: float) -> Ints:
        """Those whose balls the cylinder along a normal around a centre meets, ascending."""
        width = (radius + float(self.radii.max())) * (1 + 4 * DIGITS_OF_FILES)  # ``_met`` is as generous at edges
        low, high = self.tree.mins - width - centre, self.tree.maxes + width - centre
        across = np.abs(normal) > SAME_LENGTH
        ends = np.sort(np.stack((low[across], high[across])) / normal[across], axis=0)
        first, last = ends[0].max(), ends[1].min()
        if first > last or (low[~across] > 0).any() or (high[~across] < 0).any():
            return np.empty(0, np.int64)
        # Balls around places in the middle of pieces of the cylinder that are as long as it is wide contain these.
        pieces = max(1, int(np.ceil((last - first) / (2 * width))))
        middles = centre + (first + (np.arange(pieces)[:, None] + 0.5) * (last - first) / pieces) * normal
        found = self.tree.query_ball_point(middles, (1 + SAME_LENGTH) * np.sqrt(2) * width)
        numbers = np.unique(np.concatenate([np.asarray(near, dtype=np.int64) for near in found]))
        apart = self.middles[numbers] - centre
        away = np.linalg.norm(apart - (apart @ normal)[:, None] * normal, axis=1)
        return np.asarray(numbers[away <= (radius + self.radii[numbers]) * (1 + 4 * DIGITS_OF_FILES)])


def _met(places: Floats, normal: Floats, corners: Floats) -> Ints:
    """Which line or triangle of some is the nearest one on a line along a unit normal through each place, in either
    direction, -1: none; corners of shape (m, 2 or 3, 3).
    """
    if not len(corners):
        return np.full(len(places), -1)
    sides = corners[:, 1:] - corners[:, :1]
    if corners.shape[1] == 2:  # in the plane: any triangle with this side across it
        sides = np.concatenate((sides, np.broadcast_to([0.0, 0.0, 1.0], (len(sides), 1, 3))), axis=1)
    systems = np.concatenate((sides, np.broadcast_to(-normal, (len(sides), 1, 3))), axis=1).swapaxes(1, 2)
    parallel = np.abs(np.linalg.det(systems)) <= DIGITS_OF_FILES * np.linalg.norm(sides, axis=2).prod(axis=1)
    systems[parallel] = np.eye(3)
    a, b, away = np.moveaxis(np.linalg.solve(systems[:, None], (places - corners[:, :1])[..., None])[..., 0], -1, 0)
    inside = (a >= 0) & (b >= -DIGITS_OF_FILES) & (a + b <= 1 + DIGITS_OF_FILES) & ~parallel[:, None]
    distance = np.where(inside, np.abs(away), np.inf)
    nearest = distance.argmin(axis=0)
    return np.where(np.isfinite(distance.min(axis=0)), nearest, -1)


def _normals(x: Floats, kind: str) -> Floats:
    """Normals of facets of a kind, of any length, by the positions of their nodes, corners first, shape (facets, nodes,
    3).
    """
    along = x[:, 1] - x[:, 0]
    if kind[0] == "l":
        return np.column_stack((along[:, 1], -along[:, 0], 0.0 * along[:, 0]))
    return np.asarray(np.cross(along, x[:, 2] - x[:, 0]))


def either(*several: list[Any]) -> list[Any]:
    """The elements of several choices, block by block."""
    return [np.logical_or.reduce(marks) for marks in zip(*several, strict=True)]


def without(marks: list[Any], others: list[Any]) -> list[Any]:
    """The elements of one choice that are not in another one, block by block."""
    return [mark & ~other for mark, other in zip(marks, others, strict=True)]


def some(marks: list[Any]) -> bool:
    """Whether there is any element in a choice."""
    return any(bool(mark.any()) for mark in marks)
