"""A mesh in the plane as plain arrays, whole on one rank: what mesh files are read into.  No dolfinx here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.errors import MeshError, SceneError
from signorini_fx.scene.magnitudes import LARGEST

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]
# What names a boundary or region: a number in the cell data of the file, or a rule, a function of the position.
Selection = int | Callable[[Floats], Floats]

# The cells that dolfinx has in the plane: number of corners, and what people call them.
CORNERS = {"triangle": 3, "triangle6": 3, "quad": 4, "quad9": 4}
_WORDS = {"triangle": "triangles", "triangle6": "triangles", "quad": "quadrilaterals", "quad9": "quadrilaterals"}
LINES = ("line", "line3")
_SURFACES = (*CORNERS, "quad8", "triangle7", "polygon")
# A corner whose sine is below this has no angle.
_FLAT = 1e-12


def plain(values: npt.NDArray[Any]) -> Any:
    """Numbers of Python, in lists."""
    return values.tolist()


@dataclass
class RawMesh:
    """What a file holds, in meshio's layout: blocks of elements of one kind, sets and data block by block.

    Attributes:
        points: positions, shape (n, 2) or (n, 3).
        blocks: (kind in meshio's words, nodes of shape (elements, nodes of each)).
        sets: name -> for each block the numbers of its elements that belong.
        node_sets: name -> numbers of points.
        data: name -> for each block the whole number of each element, shape (elements,), or where an element may have
            several its numbers, shape (elements, k); below 0 is none.
    """

    points: Floats
    blocks: list[tuple[str, Ints]]
    sets: dict[str, list[Ints]] = field(default_factory=dict)
    node_sets: dict[str, Ints] = field(default_factory=dict)
    data: dict[str, list[Ints]] = field(default_factory=dict)


@dataclass(frozen=True)
class MeshArrays:
    """A mesh of one kind of cell in the plane, with the names of its boundaries and regions.

    Attributes:
        points: positions of the nodes, every one of some cell, shape (n, 2).
        kind: ``triangle``, ``triangle6``, ``quad`` or ``quad9``.
        cells: nodes of each cell: corners along its perimeter, then midside nodes, then the centre, shape (m, k).
        facets: nodes of each exterior facet: its ends, then the one between if there is one, shape (f, 2 or 3).
        boundaries: name -> rows of ``facets``, sorted; boundaries may overlap.
        regions: name -> rows of ``cells``, sorted; regions may overlap.
    """

    points: Floats
    kind: str
    cells: Ints
    facets: Ints
    boundaries: Mapping[str, Ints]
    regions: Mapping[str, Ints]

    @property
    def corners(self) -> Ints:
        """Corners of each cell along its perimeter, shape (m, 3 or 4)."""
        return self.cells[:, : CORNERS[self.kind]]

    @property
    def degree(self) -> int:
        """Polynomial degree of the geometry."""
        return 2 if self.kind in ("triangle6", "quad9") else 1

    @property
    def cell_word(self) -> str:
        """What the cells are called."""
        return _WORDS[self.kind]


def in_the_plane(
    raw: RawMesh,
    name: str,
    boundaries: Mapping[str, Selection] | None = None,
    regions: Mapping[str, Selection] | None = None,
    data: str | None = None,
) -> MeshArrays:
    """The cells of a raw mesh with their exterior facets and all names.

    Args:
        raw: the mesh as its file has it.
        name: what to call it in messages.
        boundaries: names that the scene gives; they stand above those of the file.  A rule takes the exterior facets
            whose ends both satisfy it (true or positive).
        regions: the same for cells and all their corners.
        data: the cell data that numbers refer to; None: the only one that has any.

    Raises:
        MeshError: there are no cells, or of several kinds; they are not in a plane, folded or flat; or a node is not
            there.
        SceneError: a selection takes nothing.
    """
    kind, body = _body(raw, name)
    points, cells, renumber = _plane_points(raw, body, name)
    corners = cells[:, : CORNERS[kind]]
    _check_shape(points, corners, name)
    _check_twice(corners, name)
    facets = _exterior(cells, CORNERS[kind], name)
    find = _Finder(facets[:, :2], len(points))
    lines = [n for n, (k, _) in enumerate(raw.blocks) if k in LINES]
    sides = _Entities(
        "boundaries", "exterior facet", {n: find(renumber[raw.blocks[n][1][:, :2]]) for n in lines}, facets[:, :2]
    )
    first = np.cumsum([0, *(len(raw.blocks[n][1]) for n in body)])
    whole = {n: k + np.arange(len(raw.blocks[n][1])) for n, k in zip(body, first, strict=False)}
    parts = _Entities("regions", "cell", whole, corners)
    # Where a name is that of facets and of nodes, as in Abaqus, the facets are what is meant.
    named = _from_nodes(raw, renumber, len(points), facets[:, :2]) | _names(raw, sides, data, name)
    named_parts = _names(raw, parts, data, name)
    problems: list[tuple[str, str]] = []
    for entities, chosen, result in ((sides, boundaries, named), (parts, regions, named_parts)):
        for label, selection in (chosen or {}).items():
            if isinstance(selection, int):
                found, message = _numbered(raw, entities, selection, data, name)
            else:
                found = np.flatnonzero(_holds(selection, points)[entities.nodes].all(axis=1))
                (left, lower), (right, upper) = points.min(axis=0), points.max(axis=0)
                message = (
                    f"{name}: takes no {entities.word}; the body is x[0] {left:.6g} to {right:.6g}, "
                    f"x[1] {lower:.6g} to {upper:.6g}"
                )
            result[label] = found
            if not found.size:
                problems.append((f"mesh.{entities.key}.{label}", message))
    if problems:
        raise SceneError(problems)
    return MeshArrays(points, kind, cells, facets, named, named_parts)


@dataclass(frozen=True)
class _Entities:
    """What can have names: the exterior facets, or the cells.

    Attributes:
        key: where the scene names them.
        word: one of them.
        rows: block of the raw mesh -> which of them each element is, -1: none.
        nodes: corners of each.
    """

    key: str
    word: str
    rows: Mapping[int, Ints]
    nodes: Ints

    def take(self, members: Callable[[int], Ints]) -> Ints:
        """Those that are elements ``members(block)``."""
        found = [rows[members(block)] for block, rows in self.rows.items()]
        every = np.concatenate([np.empty(0, dtype=np.int64), *found])
        return np.unique(every[every >= 0])

    def values(self, numbers: list[Ints]) -> list[int]:
        """The numbers that elements have; below 0 is none."""
        return sorted({int(v) for block in self.rows for v in np.unique(numbers[block]) if v >= 0})

    def with_number(self, numbers: list[Ints], value: int) -> Ints:
        """Those whose elements have this number."""
        return self.take(lambda block: np.unique(np.nonzero(numbers[block] == value)[0]))


def _names(raw: RawMesh, entities: _Entities, data: str | None, name: str) -> dict[str, Ints]:
    """The names that sets give, or without any those that numbers make."""
    named = {
        label: entities.take(members.__getitem__)
        for label, members in raw.sets.items()
        if any(members[block].size for block in entities.rows)
    }
    numbers = _numbers(raw, entities, data, name)
    if named or numbers is None:
        return named
    word = "boundary" if entities.key == "boundaries" else "region"
    return {f"{word}_{value}": entities.with_number(numbers, value) for value in entities.values(numbers)}


def _from_nodes(raw: RawMesh, renumber: Ints, count: int, ends: Ints) -> dict[str, Ints]:
    """Boundaries that are sets of nodes: the exterior facets with both ends in it."""
    named: dict[str, Ints] = {}
    for label, nodes in raw.node_sets.items():
        marked = np.zeros(count + 1, dtype=bool)  # the last one stands for points that no cell uses
        marked[renumber[nodes]] = True
        marked[-1] = False
        found = np.flatnonzero(marked[ends].all(axis=1))
        if found.size:
            named[label] = found
    return named


def _numbered(raw: RawMesh, entities: _Entities, value: int, data: str | None, name: str) -> tuple[Ints, str]:
    """Those with a number, and what to say if there are none."""
    numbers = _numbers(raw, entities, data, name)
    if numbers is None:
        known = ", ".join(map(repr, raw.data)) or "none"
        return np.empty(0, dtype=np.int64), f"{name}: set mesh.data to the cell data that is meant; there are: {known}"
    known = ", ".join(map(str, entities.values(numbers))) or "none"
    found = entities.with_number(numbers, value)
    return found, f"{name}: takes no {entities.word}; the numbers there are: {known}"


def _body(raw: RawMesh, name: str) -> tuple[str, list[int]]:
    """The kind of the cells and the blocks that hold them.

    Raises:
        MeshError: no cells, cells of several kinds, or of one that there is no element for.
    """
    sizes: dict[str, int] = {}
    for kind, nodes in raw.blocks:
        if len(nodes) and kind not in (*LINES, "vertex", "line4"):
            sizes[kind] = sizes.get(kind, 0) + len(nodes)
    solid = [kind for kind in sizes if kind not in _SURFACES and not kind.startswith("polygon")]
    if solid:
        words = ", ".join(solid)
        raise MeshError(f"{name}: has cells of three dimensions, or unknown ones ({words}): a plane mesh is wanted")
    if not sizes:
        raise MeshError(f"{name}: the mesh has no cells: in gmsh, put the surface into a physical group of dimension 2")
    if len(sizes) > 1:
        counts = ", ".join(f"{count} {kind}" for kind, count in sorted(sizes.items()))
        raise MeshError(f"{name}: the mesh mixes cell types or orders ({counts}); use one")
    (kind,) = sizes
    if kind not in CORNERS:
        raise MeshError(f"{name}: no element for cells of kind {kind}; use one of: {', '.join(CORNERS)}")
    return kind, [n for n, (k, _) in enumerate(raw.blocks) if k == kind]


def _plane_points(raw: RawMesh, body: list[int], name: str) -> tuple[Floats, Ints, Ints]:
    """Points that cells use, the cells in their numbers, and the new number of every point (-1: dropped)."""
    cells = np.concatenate([raw.blocks[n][1] for n in body]).astype(np.int64)
    count = len(raw.points)
    if any(nodes.size and not 0 <= nodes.min() <= nodes.max() < count for _, nodes in raw.blocks):
        raise MeshError(f"{name}: an element has a node that is not there")
    used = np.zeros(count, dtype=bool)
    used[cells] = True
    renumber = np.where(used, np.cumsum(used) - 1, -1)
    points = np.asarray(raw.points, dtype=np.float64)[used]
    if not (np.abs(points) <= LARGEST).all():
        raise MeshError(f"{name}: a node has coordinates that are not finite, or larger than {LARGEST:g}")
    spread = np.ptp(points, axis=0)
    if points.shape[1] > 2 and spread[2] > 1e-9 * max(spread[:2]):
        raise MeshError(f"{name}: the mesh is not in a plane x[2] = constant: x[2] varies by {spread[2]:g}")
    return np.ascontiguousarray(points[:, :2]), renumber[cells], renumber


def _corner_sides(points: Floats, corners: Ints) -> tuple[Floats, Floats]:
    """Cross product and product of the lengths of the sides at each corner of each cell, shape (m, 3 or 4) each."""
    x = points[corners]
    forth, back = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    cross = forth[..., 0] * back[..., 1] - forth[..., 1] * back[..., 0]
    return cross, np.hypot(*np.moveaxis(forth, -1, 0)) * np.hypot(*np.moveaxis(back, -1, 0))


def _check_shape(points: Floats, corners: Ints, name: str) -> None:
    cross, product = _corner_sides(points, corners)
    flat = (np.abs(cross) <= _FLAT * product).any(axis=1)
    folded = (cross.min(axis=1) < 0) & (cross.max(axis=1) > 0)
    for bad, what in (
        (flat, "have a corner without an angle (nodes that coincide or are in line)"),
        (folded, "are folded"),
    ):
        if bad.any():
            x, y = points[corners[np.argmax(bad)]].mean(axis=0)
            raise MeshError(f"{name}: {np.count_nonzero(bad)} cells {what}, the first at ({x:g}, {y:g})")


def _check_twice(corners: Ints, name: str) -> None:
    twice = len(corners) - len(np.unique(np.sort(corners, axis=1), axis=0))
    if twice:
        hint = "gmsh's format 2.2 has them so where physical groups overlap: write 4.1"
        raise MeshError(f"{name}: {twice} cells are there twice ({hint})")


def _sides(cells: Ints, corners: int) -> Ints:
    """Nodes of all sides of all cells: ends, then the midside node if there is one, shape (corners * m, 2 or 3)."""
    ends = np.stack([cells[:, [k, (k + 1) % corners]] for k in range(corners)], axis=1)
    if cells.shape[1] == corners:
        return ends.reshape(-1, 2)
    return np.concatenate((ends, cells[:, corners : 2 * corners, None]), axis=2).reshape(-1, 3)


def _exterior(cells: Ints, corners: int, name: str) -> Ints:
    """The sides that one cell has alone, in the order of the cells."""
    sides = _sides(cells, corners)
    keys = _keys(sides[:, :2], int(cells.max()) + 1)
    _, first, counts = np.unique(keys, return_index=True, return_counts=True)
    if counts.max() > 2:
        raise MeshError(f"{name}: a facet belongs to {counts.max()} cells")
    if counts.min() > 1:
        raise MeshError(f"{name}: the body has no boundary: every facet belongs to two cells")
    return sides[np.sort(first[counts == 1])]


def _keys(ends: Ints, points: int) -> Ints:
    """One number for each pair of nodes, in either order."""
    return ends.min(axis=1) * points + ends.max(axis=1)


class _Finder:
    """Rows of exterior facets by their ends, in either order."""

    def __init__(self, ends: Ints, points: int) -> None:
        self._points = points
        keys = _keys(ends, points)
        self._order = np.argsort(keys)
        self._sorted = keys[self._order]

    def __call__(self, ends: Ints) -> Ints:
        """Row of each facet; -1 for one that is not there."""
        if not len(ends):
            return np.empty(0, dtype=np.int64)
        keys = np.where((ends >= 0).all(axis=1), _keys(ends, self._points), -1)
        place = np.minimum(np.searchsorted(self._sorted, keys), len(self._sorted) - 1)
        return np.where(self._sorted[place] == keys, self._order[place], -1)


def _numbers(raw: RawMesh, entities: _Entities, data: str | None, name: str) -> list[Ints] | None:
    """The cell data that numbers refer to; None where there is none or a choice."""
    if data is not None:
        if data not in raw.data:
            known = ", ".join(map(repr, raw.data)) or "none"
            raise SceneError([("mesh.data", f"{name}: no cell data {data!r} of whole numbers; there are: {known}")])
        return raw.data[data]
    possible = [numbers for numbers in raw.data.values() if entities.values(numbers)]
    return possible[0] if len(possible) == 1 else None


def _holds(rule: Callable[[Floats], Floats], points: Floats) -> npt.NDArray[np.bool_]:
    values = np.asarray(rule(np.column_stack((points, np.zeros(len(points)))).T))
    with np.errstate(invalid="ignore"):
        return np.broadcast_to(values > 0, (len(points),))


# --- what a mesh is like ---------------------------------------------------------------------------------------------


def areas(mesh: MeshArrays) -> Floats:
    """Area of each cell with straight sides, shape (m,)."""
    x = mesh.points[mesh.corners]
    after = np.roll(x, -1, axis=1)
    return 0.5 * np.abs((x[..., 0] * after[..., 1] - x[..., 1] * after[..., 0]).sum(axis=1))


def quality(points: Floats, corners: Ints) -> Floats:
    """Shape of each cell: 1 for equilateral triangles and squares, 0 for flat cells, shape (m,).

    It is the mean ratio: of triangles 4 sqrt(3) area / sum of squared sides, of quadrilaterals the smallest over the
    corners of 2 |a x b| / (|a|^2 + |b|^2) for the sides a, b that meet there.

    Args:
        points: positions, shape (n, 2).
        corners: corners of each cell along its perimeter, shape (m, 3 or 4).
    """
    x = points[corners]
    cross = np.abs(_corner_sides(points, corners)[0])
    squares = ((np.roll(x, -1, axis=1) - x) ** 2).sum(axis=-1)
    if corners.shape[1] == 3:
        return 2 * np.sqrt(3.0) * cross[:, 0] / squares.sum(axis=1)
    return (2 * cross / (squares + np.roll(squares, 1, axis=1))).min(axis=1)


def combinations(groups: Mapping[str, Ints], count: int) -> tuple[Ints, dict[str, tuple[int, ...]]]:
    """One tag for each combination of groups that overlap.

    Args:
        groups: name -> members, numbers below ``count``.
        count: how many may be members.

    Returns:
        Tag of each, from 1 on, 0 where it is in no group, shape (count,); and name -> its tags.
    """
    tags = np.zeros(count, dtype=np.int64)
    for members in groups.values():
        member = np.zeros(count, dtype=np.int64)
        member[members] = 1
        kinds, tags = np.unique(2 * tags + member, return_inverse=True)
        # What is in no group stays 0; without it the numbers begin at 1.
        tags = tags.reshape(-1) + int(kinds.size > 0 and kinds[0] != 0)
    return tags, {name: tuple(plain(np.unique(tags[members]))) for name, members in groups.items()}
