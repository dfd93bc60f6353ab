"""A mesh in 2D or 3D as plain arrays on one rank: the content of a file, and the body in it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from signorini_fx.arrays import Array, Column, Flags, Ints
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.mechanics.mesh.files.cells import (
    CELLS,
    Cell,
    check_shape,
    completed,
    dimension,
    family,
    order_in,
)
from signorini_fx.mechanics.statement.expressions import Expression, in_space, sample
from signorini_fx.tuned import LARGEST_NUMBER

# A boundary or region is selected by numbers in the cell data of the file, or by a rule, a function
# of the position.
Selection = int | tuple[int, ...] | Callable[[Array], Array]


def plain(values: Column) -> Any:
    """Return an array as lists of Python numbers."""
    return values.tolist()


def bounds(points: Array) -> list[list[float]]:
    """Return the smallest and the largest coordinates of points."""
    found = [plain(points.min(axis=0)), plain(points.max(axis=0))]
    return found


def extent(ends: list[list[float]]) -> str:
    """Return the bounds of a box as text."""
    return ", ".join(
        f"x[{k}] {low:g} to {high:g}" for k, (low, high) in enumerate(zip(*ends, strict=True))
    )


@dataclass
class RawMesh:
    """The content of a file in meshio's layout: blocks of elements of one kind, with sets and data
    for each block.
    """

    points: Array  # positions, shape (n, 2) or (n, 3)
    blocks: list[
        tuple[str, Ints]
    ]  # (kind in meshio's words, nodes of shape (elements, nodes of each))
    # name -> for each block the numbers of its elements that belong
    sets: dict[str, list[Ints]] = field(default_factory=dict)
    node_sets: dict[str, Ints] = field(default_factory=dict)  # name -> numbers of points
    # name -> for each block the whole number of each element, shape (elements,), or where an
    # element may have several its numbers, shape (elements, k); below 0 is none
    data: dict[str, list[Ints]] = field(default_factory=dict)


class Numbering:
    """A map from numbers of nodes or elements to their rows.

    Attributes:
        again: the rows whose number has occurred before.
    """

    def __init__(self, numbers: Ints) -> None:
        self.numbers = numbers
        self._order = np.argsort(numbers, kind="stable")
        self._sorted = numbers[self._order]
        self.again = self._order[1:][self._sorted[1:] == self._sorted[:-1]]

    def rows(self, wanted: Ints) -> Ints:
        """Return the row of each number; -1 for unknown numbers."""
        if not self.numbers.size:
            return np.full(len(wanted), -1)
        places = np.minimum(np.searchsorted(self._sorted, wanted), len(self.numbers) - 1)
        return np.where(self._sorted[places] == wanted, self._order[places], -1)


def row_keys(rows: Ints) -> Ints:
    """Return one key for each row, equal for rows with the same numbers in any order; numbers are
    at least -1.
    """
    ordered = 1 + np.sort(rows, axis=1)
    largest = int(ordered.max(initial=0)) + 1
    keys: Ints = ordered[:, 0]
    for column in ordered.T[
        1:
    ]:  # renumbered each time, so that the product of two counts does not overflow
        keys = np.unique(keys * largest + column, return_inverse=True)[1].reshape(-1)
    return keys


def rows_of(wanted: Ints, table: Ints) -> Ints:
    """Return the position of each row of nodes in a table of distinct rows, regardless of the order
    of the nodes; -1 if absent.
    """
    keys = row_keys(np.concatenate((table, wanted)))
    row_numbers = np.full(int(keys.max(initial=0)) + 1, -1)
    row_numbers[keys[: len(table)]] = np.arange(len(table))
    return row_numbers[keys[len(table) :]]


@dataclass(frozen=True)
class MeshArrays:
    """A mesh of one kind of cell in 2D or in 3D, with the names of its boundaries and regions."""

    points: Array  # positions of the nodes, each of which belongs to a cell, shape (n, d)
    kind: str  # a kind of cell of ``CELLS``, of d dimensions
    cells: Ints  # nodes of each cell, shape (m, k)
    # nodes of each exterior facet, and of named ones inside the body, shape (f, l)
    facets: Ints
    boundaries: Mapping[str, Ints]  # name -> rows of ``facets``, sorted; boundaries may overlap
    regions: Mapping[str, Ints]  # name -> rows of ``cells``, sorted; regions may overlap
    # name of a boundary -> how many of the elements that it has in the file are no sides of cells
    astray: Mapping[str, int] = field(default_factory=dict)
    inner: int = 0  # how many facets, the last ones, are inside the body

    @property
    def cell(self) -> Cell:
        """The kind of the cells."""
        return CELLS[self.kind]

    @property
    def facet(self) -> Cell:
        """The kind of the facets."""
        return CELLS[self.cell.facet]

    @property
    def dim(self) -> int:
        """The dimension of the mesh, 2 or 3."""
        return self.cell.dim

    @property
    def corners(self) -> Ints:
        """Corners of each cell, shape (m, c)."""
        return self.cells[:, : len(self.cell.corners)]

    @property
    def facet_corners(self) -> Ints:
        """Corners of each facet, shape (f, c)."""
        return self.facets[:, : len(self.facet.corners)]

    @property
    def degree(self) -> int:
        """Polynomial degree of the geometry."""
        return self.cell.degree

    @property
    def diagonal(self) -> float:
        """The diagonal of the bounding box, length."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))


def from_raw(
    raw: RawMesh,
    name: str,
    boundaries: Mapping[str, Selection] | None = None,
    regions: Mapping[str, Selection] | None = None,
    data: str | None = None,
) -> MeshArrays:
    """Return the cells of a raw mesh with their exterior facets, named interior facets, and all
    names.

    The mesh is 3D if it has 3D cells; otherwise it must lie in a plane x[2] = constant.

    Args:
        raw: the mesh as read from its file.
        name: name of the mesh in messages.
        boundaries: names given by the scene, as in ``read_mesh``; they replace those of the file.
        regions: the same for cells.
        data: the cell data that numbers refer to; None: the only one that has any.

    Raises:
        MeshError: there are no cells, or cells of several kinds; they are a surface in 3D, folded
            or flat; or a node is missing.
        SceneError: a selection is empty.
    """
    kind, body = _body(raw, name)
    if any(
        nodes.size and not 0 <= nodes.min() <= nodes.max() < len(raw.points)
        for _, nodes in raw.blocks
    ):
        raise MeshError(f"{name}: an element has a node that does not exist")
    table = np.concatenate([raw.blocks[n][1] for n in body]).astype(np.int64)
    positions = raw.points
    full_cell = completed(kind)
    cell = CELLS[kind] if full_cell is None else full_cell[0]
    table = table[:, order_in("vtk", cell)[: table.shape[1]]]
    if full_cell is not None:
        positions, table = _complete(positions, table, *full_cell)
    points, cells, renumber = _points_of(positions, table, cell.dim, name)
    corners = cells[:, : len(cell.corners)]
    check_shape(points, cells, cell, name)
    if cell.degree > 1:
        _check_crossing(points, cells, cell, name)
    width = len(CELLS[cell.facet].corners)
    all_sides = sides_of(cells, cell)
    exterior = _exterior(all_sides, width, name)
    named = [n for n, (k, _) in enumerate(raw.blocks) if family(k) == family(cell.facet)]
    facet_tables = [renumber[raw.blocks[n][1][:, :width]] for n in named]
    named_facets = np.concatenate([np.empty((0, width), dtype=np.int64), *facet_tables])
    facets = np.concatenate((exterior, _inside(named_facets, all_sides, exterior)))
    of_facets = rows_of(named_facets, facets[:, :width])
    corners_of_sides = exterior[:, :width]
    sides = _entities(raw, "boundaries", "exterior facet", corners_of_sides, named, of_facets)
    parts = _entities(raw, "regions", "cell", corners, body, np.arange(len(cells)))
    # If a name is that of facets and of nodes, as in Abaqus, the facets are meant.
    names = {}
    names_of_parts = dict[str, Ints]()
    for label, nodes in raw.node_sets.items():  # the exterior facets with all corners in a set
        if (within := np.flatnonzero(np.isin(sides.nodes, renumber[nodes]).all(axis=1))).size:
            names[label] = within
    astray: dict[str, int] = {}
    problems = []
    for entities, chosen, result in ((sides, boundaries, names), (parts, regions, names_of_parts)):
        numbers = _numbers(entities, data, name)
        word = "boundary" if entities is sides else "region"
        elements = dict(entities.sets) or {
            f"{word}_{value}": members for value, members in (numbers or {}).items()
        }
        result |= {label: entities.take(members) for label, members in elements.items()}
        for label, selection in (chosen or {}).items():
            elements.pop(label, None)
            if isinstance(selection, int | tuple):
                values = selection if isinstance(selection, tuple) else (selection,)
                found = {value: (numbers or {}).get(value, corners[:0, 0]) for value in values}
                absent = [value for value in values if not entities.take(found[value]).size]
                elements[label] = np.unique(np.concatenate(list(found.values())))
                selected = corners[:0, 0] if absent else entities.take(elements[label])
                message = _no_number(entities, numbers, absent[0], name) if absent else ""
            elif isinstance(selection, Expression) and selection.coordinates > cell.dim:
                selected = corners[:0, 0]
                message = f"{name}: the mesh is plane: there is no x[2]"
            else:
                selected = np.flatnonzero(
                    (sample(selection, in_space(points)) > 0)[entities.nodes].all(axis=1)
                )
                message = (
                    f"{name}: selects no {entities.word}; the body is {extent(bounds(points))}"
                )
            result[label] = selected
            if not selected.size:
                problems.append((f"mesh.{entities.key}.{label}", message))
        missed = {
            label: np.count_nonzero(entities.number[members] < 0)
            for label, members in elements.items()
        }
        astray |= {label: count for label, count in missed.items() if count}
    if problems:
        raise SceneError(problems)
    return MeshArrays(
        points, cell.kind, cells, facets, names, names_of_parts, astray, len(facets) - len(exterior)
    )


def _check_crossing(points: Array, cells: Ints, cell: Cell, name: str) -> None:
    """Check that cells do not cross: each node between corners belongs to one set of corners, and
    each set of corners has one such node.

    Raises:
        MeshError: cells cross.
    """
    keys = [np.empty(0, dtype=np.int64)]
    nodes = [np.empty(0, dtype=np.int64)]
    for size in sorted({len(ends) for ends in cell.nodes}):  # corners, edges, faces, cells
        columns = [k for k, ends in enumerate(cell.nodes) if len(ends) == size]
        ends = cells[:, [cell.nodes[k] for k in columns]].reshape(-1, size)
        keys.append(1 + keys[-1].max(initial=-1) + row_keys(ends))
        nodes.append(cells[:, columns].ravel())
    key = np.concatenate(keys)
    node = np.concatenate(nodes)
    crossed = node[_with_several(key, node) | _with_several(node, key)]
    if crossed.size:
        place = ", ".join(f"{value:g}" for value in points[crossed[0]])
        raise MeshError(
            f"{name}: cells cross at the node at ({place}): it is in the middle of two edges or "
            "faces, or one of these has two such nodes; mend the list of the cells, or make the "
            "mesh again"
        )


def _with_several(keys: Ints, values: Ints) -> Flags:
    """Return the flags of rows whose key occurs with several values, shape (rows,)."""
    one = np.zeros(int(keys.max(initial=0)) + 1, dtype=np.int64)
    one[keys] = values
    several = np.zeros(len(one), dtype=bool)
    several[keys[one[keys] != values]] = True
    return several[keys]


@dataclass(frozen=True)
class _Entities:
    """The entities that can have names, exterior facets or cells, and the elements of the file that
    correspond to them.
    """

    key: str  # the key of the scene for their names
    word: str  # the word for them in messages
    nodes: Ints  # corners of each cell or exterior facet
    number: Ints  # which of them each element is, -1: none
    sets: Mapping[str, Ints]  # name -> elements
    data: Mapping[str, Mapping[int, Ints]]  # name -> number -> elements

    def take(self, elements: Ints) -> Ints:
        """Return the entities that correspond to some elements, sorted."""
        numbers = self.number[elements]
        return np.unique(numbers[numbers >= 0])


def _entities(
    raw: RawMesh, key: str, word: str, nodes: Ints, blocks: list[int], number: Ints
) -> _Entities:
    """Return the entities for the elements of some blocks, which are numbered block after block."""
    firsts = np.cumsum([0, *(len(raw.blocks[n][1]) for n in blocks)])[:-1]
    placed = list(zip(blocks, firsts, strict=True))
    none = np.empty(0, dtype=np.int64)
    sets = {
        label: np.concatenate([none, *(at + rows[n] for n, at in placed)])
        for label, rows in raw.sets.items()
    }
    data = {}
    for label, columns in raw.data.items():
        elements = [(at + np.indices(columns[n].shape)[0]).ravel() for n, at in placed]
        data[label] = _by_number(elements, [columns[n].ravel() for n in blocks]) if blocks else {}
    return _Entities(
        key, word, nodes, number, {label: rows for label, rows in sets.items() if rows.size}, data
    )


def _by_number(elements: list[Ints], numbers: list[Ints]) -> dict[int, Ints]:
    """Return the elements that have each number, by ascending numbers; negative numbers
    mean none.
    """
    order = np.argsort(values := np.concatenate(numbers), kind="stable")
    found, first = np.unique(values[order], return_index=True)
    parts = np.split(np.concatenate(elements)[order], first[1:])
    return {value: part for value, part in zip(plain(found), parts, strict=False) if value >= 0}


def _no_number(
    entities: _Entities, numbers: Mapping[int, Ints] | None, value: int, name: str
) -> str:
    """Return the message for a number that no entity has."""
    if numbers is not None:
        known_numbers = ", ".join(map(str, numbers)) or "none"
        return (
            f"{name}: number {value} selects no {entities.word}; the numbers there are: "
            f"{known_numbers}"
        )
    possible = ", ".join(repr(label) for label, known in entities.data.items() if known) or "none"
    return (
        f"{name}: the cell data of the number is ambiguous: set mesh.data to one of {possible}, "
        "give a condition, such as 'x[1] < 1e-9', or name the facets or cells in the file (in "
        "gmsh: physical groups)"
    )


def _body(raw: RawMesh, name: str) -> tuple[str, list[int]]:
    """Return the kind of the cells and the blocks that hold them."""
    sizes: dict[str, int] = {}
    for kind, nodes in raw.blocks:
        if len(nodes) and dimension(kind) > 1:
            sizes[kind] = sizes.get(kind, 0) + len(nodes)
    solid = {kind: n for kind, n in sizes.items() if dimension(kind) == 3}
    sizes = solid or sizes  # the surfaces of a body in 3D are facets
    if not sizes:
        raise MeshError(
            f"{name}: the mesh has no cells: in gmsh, put the body into a physical group of "
            "dimension 2, or 3 in 3D"
        )
    kind = next(iter(sizes))
    if len(sizes) > 1 or (kind not in CELLS and completed(kind) is None):
        counts = ", ".join(f"{count} {kind}" for kind, count in sorted(sizes.items()))
        simplices = "tetrahedra" if solid else "triangles"
        raise MeshError(
            f"{name}: a mesh has one kind of cell of degree 1 or 2, no wedges and no pyramids, "
            "and this one has "
            f"{counts}: {simplices} are made of all by gmsh without Recombine, or from a file by "
            "ParaView's filter "
            "Tetrahedralize"
        )
    return kind, [n for n, (k, _) in enumerate(raw.blocks) if k == kind]


def _points_of(positions: Array, cells: Ints, dim: int, name: str) -> tuple[Array, Ints, Ints]:
    """Return the points that cells use, the cells in the new numbers, and the new number of every
    point (-1: dropped).
    """
    used = np.zeros(len(positions), dtype=bool)
    used[cells] = True
    renumber = np.where(used, np.cumsum(used) - 1, -1)
    points = np.asarray(positions, dtype=np.float64)[used]
    if not (np.abs(points) <= LARGEST_NUMBER).all():
        raise MeshError(
            f"{name}: a node has coordinates that are not finite, or larger than {LARGEST_NUMBER:g}"
        )
    if points.shape[1] < dim:
        raise MeshError(
            f"{name}: the cells are those of a body in 3D, but the nodes have no third coordinate"
        )
    if dim == 2 and points.shape[1] > 2:
        _check_plane(points, name)
    return np.ascontiguousarray(points[:, :dim]), renumber[cells], renumber


def _check_plane(points: Array, name: str) -> None:
    """Raise a MeshError if 2D cells are not in a plane x[2] = constant."""
    spread = np.ptp(points, axis=0)
    if spread[2] <= 1e-9 * max(spread[:2]):
        return
    off = points[np.argmax(np.abs(points[:, 2] - np.median(points[:, 2])))]
    place = ", ".join(f"{value:g}" for value in off)
    raise MeshError(
        f"{name}: the mesh is not in a plane x[2] = constant, off by {spread[2]:g}, the most at "
        f"({place}): turn it "
        "there; a body in 3D has tetrahedra or hexahedra: in gmsh, put the volume into a physical "
        "group of dimension 3"
    )


def _complete(points: Array, cells: Ints, cell: Cell, weights: Array) -> tuple[Array, Ints]:
    """Return points and cells with the missing nodes in the middle of faces and cells; cells that
    meet share them.
    """
    new = cell.nodes[cells.shape[1] :]
    # A face is identified by its corners, a cell by its number.
    faces = np.concatenate(
        [np.empty((0, 4), np.int64), *(cells[:, list(corners)] for corners in new[:-1])]
    )
    first, number = np.unique(row_keys(faces), return_index=True, return_inverse=True)[1:]
    inside = len(first) + np.arange(len(cells))
    added = np.column_stack((number.reshape(len(new) - 1, len(cells)).T, inside)) + len(points)
    x = np.einsum(
        "nt,ctd->cnd", weights[cells.shape[1] :], np.asarray(points, dtype=np.float64)[cells]
    )
    points = np.concatenate(
        (points, x[:, :-1].transpose(1, 0, 2).reshape(-1, x.shape[2])[first], x[:, -1])
    )
    return points, np.column_stack((cells, added))


def sides_of(cells: Ints, cell: Cell) -> Ints:
    """Return the nodes of all facets of all cells, cell by cell, shape (facets of a cell * m, nodes
    of a facet).
    """
    return cells[:, cell.facet_nodes].reshape(-1, cell.facet_nodes.shape[1])


def pieces_of(mesh: MeshArrays) -> Ints:
    """Return the number of the piece that each cell is in, shape (m,).

    Pieces share no facet, so that they transmit no forces to each other.
    """
    sides = row_keys(sides_of(mesh.cells, mesh.cell)[:, : len(mesh.facet.corners)])
    cells = np.repeat(np.arange(len(mesh.cells)), len(mesh.cell.facet_nodes))
    count = len(mesh.cells) + int(sides.max()) + 1
    links = coo_array(
        (np.ones(cells.size, dtype=bool), (cells, sides + len(mesh.cells))), shape=(count, count)
    )
    # All facets are sides of cells, so that each piece has the number of some cell.
    return connected_components(links, directed=False)[1][: len(mesh.cells)]


def _exterior(sides: Ints, width: int, name: str) -> Ints:
    """Return the sides that belong to one cell only, in the order of the cells.

    ``width``: number of corners of a side.
    """
    keys = row_keys(sides[:, :width])
    counts = np.bincount(keys)
    alone = sides[counts[keys] == 1]
    hint = "gmsh's format 2.2 has cells twice where physical groups overlap: write 4.1"
    if counts.max() > 2:
        raise MeshError(f"{name}: a facet belongs to {counts.max()} cells ({hint})")
    if not alone.size:
        raise MeshError(
            f"{name}: the body has no boundary: every facet belongs to two cells ({hint})"
        )
    return alone


def _inside(named: Ints, sides: Ints, exterior: Ints) -> Ints:
    """Return the interior sides of cells that have the corners of a named facet, each once."""
    width = named.shape[1]
    wanted = named[rows_of(named, exterior[:, :width]) < 0]
    if not wanted.size:
        return exterior[:0]
    rows = rows_of(wanted, sides[:, :width])
    return sides[np.unique(rows[rows >= 0])]


def _numbers(entities: _Entities, data: str | None, name: str) -> Mapping[int, Ints] | None:
    """Return the cell data that numbers refer to; None if there are none, or if the choice is
    ambiguous.
    """
    if data is None:
        possible = [numbers for numbers in entities.data.values() if numbers]
        return possible[0] if len(possible) == 1 else None
    if data not in entities.data:
        labels = ", ".join(map(repr, entities.data)) or "none"
        raise SceneError.at(
            "mesh.data", f"{name}: no cell data {data!r} of whole numbers; there are: {labels}"
        )
    return entities.data[data]
