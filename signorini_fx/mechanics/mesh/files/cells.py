"""The kinds of elements in mesh files, their corners, nodes and facets, and the order of each; measure and validity.

The order is that of meshio and VTK: corners, then the nodes in the middle of edges, of faces, of the cell.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import basix
import numpy as np
import numpy.typing as npt

from signorini_fx.errors import MeshError
from signorini_fx.tuned import SAME_LENGTH, SAME_NUMBER

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]
Corners = tuple[int, ...]
_Truths = npt.NDArray[np.bool_]

_DIGITS = np.finfo(float).precision
# Volumes of curved cells are integrated exactly.
_DEGREE = 5
# Number of cells that are processed at once.
_CHUNK = 20_000


@dataclass(frozen=True)
class Cell:
    """A kind of element."""

    kind: str  # in meshio's words
    word: str  # the plural for messages
    corners: tuple[Corners, ...]  # their places on the reference cell, whole numbers, shape (corners, dim)
    # for each node the corners that it is in the middle of; a corner is in the middle of itself
    nodes: tuple[Corners, ...]
    facets: tuple[Corners, ...]  # corners of each facet, along its perimeter
    facet: str  # kind of the facets, "" for an element that is a line
    gmsh: int  # number of gmsh

    @property
    def dim(self) -> int:
        """Topological dimension."""
        return len(self.corners[0])

    @property
    def degree(self) -> int:
        """Polynomial degree of the geometry."""
        return 1 if len(self.nodes) == len(self.corners) else 2

    @property
    def simplex(self) -> bool:
        """Whether the cell has one corner more than dimensions."""
        return len(self.corners) == self.dim + 1

    @cached_property
    def facet_nodes(self) -> tuple[Corners, ...]:
        """Nodes of each facet, in the order of the kind of the facets."""
        node_of = {frozenset(corners): node for node, corners in enumerate(self.nodes)}
        pattern = CELLS[self.facet].nodes
        return tuple(
            tuple(node_of[frozenset(facet[c] for c in corners)] for corners in pattern) for facet in self.facets
        )

    @property
    def basix_type(self) -> basix.CellType:
        """The shape in basix's words."""
        four = "quadrilateral" if self.dim == 2 else "tetrahedron"
        return basix.CellType[{2: "interval", 3: "triangle", 4: four, 8: "hexahedron"}[len(self.corners)]]

    @cached_property
    def places(self) -> Floats:
        """Its nodes on the reference cell, shape (nodes, dim)."""
        return np.array([np.mean([self.corners[c] for c in corners], axis=0) for corners in self.nodes])

    @cached_property
    def _element(self) -> Any:
        even = basix.LagrangeVariant.equispaced
        return basix.create_element(basix.ElementFamily.P, self.basix_type, self.degree, even)

    @cached_property
    def from_dolfinx(self) -> Ints:
        """Each node is the one with this number in basix and dolfinx."""
        return np.asarray(np.abs(self._element.points - self.places[:, None]).sum(axis=2).argmin(axis=1))

    @property
    def to_dolfinx(self) -> Ints:
        """Node k of dolfinx is the node with this number here."""
        return np.asarray(np.argsort(self.from_dolfinx), dtype=np.int64)

    def shape(self, x: Floats) -> Floats:
        """Shape functions at places of the reference cell, shape (places, dim) -> (places, nodes)."""
        # At nodes they are 0 and 1 but for round-off, with which a node would leave an axis of symmetry.
        return np.asarray(self._element.tabulate(0, x)[0, :, self.from_dolfinx, 0].T.round(_DIGITS))

    def gradient(self, x: Floats) -> Floats:
        """Their derivatives, shape (places, dim) -> (dim, places, nodes)."""
        return np.asarray(self._element.tabulate(1, x)[1:, :, self.from_dolfinx, 0])


_SQUARE = ((0, 0), (1, 0), (1, 1), (0, 1))
_TRIANGLE = ((0, 0), (1, 0), (0, 1))
_TETRAHEDRON = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
_CUBE = (*((*c, 0) for c in _SQUARE), *((*c, 1) for c in _SQUARE))
_AROUND_3: tuple[Corners, ...] = ((0, 1), (1, 2), (2, 0))
_AROUND_4: tuple[Corners, ...] = ((0, 1), (1, 2), (2, 3), (3, 0))
_EDGES_4: tuple[Corners, ...] = (*_AROUND_3, (0, 3), (1, 3), (2, 3))
_EDGES_8: tuple[Corners, ...] = (*_AROUND_4, (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
_FACES_4: tuple[Corners, ...] = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))
# The order of VTK's hexahedra of 27 nodes.
_FACES_8: tuple[Corners, ...] = ((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7))


def _made(kind: str, corners: tuple[Corners, ...], between: tuple[Corners, ...], gmsh: int) -> Cell:
    word, facets, straight = {
        2: ("lines", ((0,), (1,)), ""),
        3: ("triangles", _AROUND_3, "line"),
        4: ("quadrilaterals", _AROUND_4, "line") if len(corners[0]) == 2 else ("tetrahedra", _FACES_4, "triangle"),
        8: ("hexahedra", _FACES_8, "quad"),
    }[len(corners)]
    curved = {"line": "line3", "triangle": "triangle6", "quad": "quad9", "": ""}[straight] if between else straight
    nodes = (*((c,) for c in range(len(corners))), *between)
    return Cell(kind, word, corners, nodes, facets, curved, gmsh)


_KINDS = (
    _made("line", ((0,), (1,)), (), 1),
    _made("line3", ((0,), (1,)), ((0, 1),), 8),
    _made("triangle", _TRIANGLE, (), 2),
    _made("triangle6", _TRIANGLE, _AROUND_3, 9),
    _made("quad", _SQUARE, (), 3),
    _made("quad9", _SQUARE, (*_AROUND_4, (0, 1, 2, 3)), 10),
    _made("tetra", _TETRAHEDRON, (), 4),
    _made("tetra10", _TETRAHEDRON, _EDGES_4, 11),
    _made("hexahedron", _CUBE, (), 5),
    _made("hexahedron27", _CUBE, (*_EDGES_8, *_FACES_8, tuple(range(8))), 12),
)
CELLS = {cell.kind: cell for cell in _KINDS}


def kind_of_mesh(mesh: Any) -> Cell | None:
    """The kind of the cells of a mesh of dolfinx; None for a geometry of a degree above 2."""
    from signorini_fx.machine import compat

    word, degree = mesh.topology.cell_name(), compat.geometry_degree(mesh)
    return next((cell for cell in CELLS.values() if (cell.basix_type.name, cell.degree) == (word, degree)), None)


def order_in_gmsh(kind: Cell) -> Ints:
    """Node k here is the node with this number in gmsh."""
    import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
    from dolfinx.io import utils
    from dolfinx.mesh import to_type

    order = utils.cell_perm_gmsh(to_type(kind.basix_type.name), len(kind.nodes))
    return np.asarray(order)[kind.from_dolfinx]


def straight(cell: Cell) -> Cell:
    """The kind with the same corners and no nodes between them."""
    return CELLS[family(cell.kind)]


# Elements of the serendipity family, which have no nodes in the middle of faces, and their complete kind.
_COMPLETE = {"quad8": "quad9", "hexahedron20": "hexahedron27"}
_DIMENSIONS = {"vertex": 0, "line": 1, "triangle": 2, "quad": 2, "polygon": 2}


def completed(kind: str) -> tuple[Cell, Floats] | None:
    """How to complete an element without nodes in the middle of its faces, with exactly the same shape.

    Returns:
        The complete kind, and the weights of the existing nodes in each of its nodes, shape (nodes, existing nodes);
        None for any other kind.
    """
    if kind not in _COMPLETE:
        return None
    full_cell = CELLS[_COMPLETE[kind]]
    existing = [set(corners) for corners in full_cell.nodes if len(corners) <= 2]
    weights = np.eye(len(full_cell.nodes), len(existing))
    for node, corners in enumerate(full_cell.nodes[len(existing) :], start=len(existing)):
        around = {1: -1 / 4, 2: 2 / len(corners)}  # a corner; the middle of an edge, of a face or of the cell
        weights[node] = [around[len(ends)] if ends <= set(corners) else 0.0 for ends in existing]
    return full_cell, weights


def family(kind: str) -> str:
    """The kind of the elements with the same corners and no nodes between them."""
    return kind.rstrip("0123456789")


def dimension(kind: str) -> int:
    """Of an element of a file, also one that is no kind of cell here; what is not known is a solid."""
    return _DIMENSIONS.get(family(kind), 3)


# --- elements of a mesh -----------------------------------------------------------------------------------------------


def measures(points: Floats, nodes: Ints, cell: Cell) -> Floats:
    """Length, area or volume of each element, on its curved shape if it is one, shape (m,).

    Args:
        points: positions, shape (n, d).
        nodes: of each element in the order of its kind, shape (m, k).
        cell: the kind, of d dimensions or of one less.
    """
    return np.asarray(nodal_measures(points, nodes, cell).sum(axis=1))


def nodal_measures(points: Floats, nodes: Ints, cell: Cell) -> Floats:
    """The integral of each shape function over each element, which is the share of its node, shape (m, k)."""
    x, weights = basix.make_quadrature(cell.basix_type, _DEGREE)
    shares = [np.empty((0, len(cell.nodes)))]
    for start in range(0, len(nodes), _CHUNK):
        jacobian = _jacobian(points, nodes[start : start + _CHUNK], cell, x)
        if cell.dim == points.shape[1]:
            size = np.abs(np.linalg.det(jacobian))
        else:
            gram = np.einsum("mqdi,mqdj->mqij", jacobian, jacobian)
            size = np.sqrt(np.maximum(np.linalg.det(gram), 0.0))
        shares.append(size @ (weights[:, None] * cell.shape(x)))
    return np.concatenate(shares)


def _jacobian(points: Floats, nodes: Ints, cell: Cell, x: Floats) -> Floats:
    """Derivatives of the position at places of the reference cell, shape (m, places, d, dim)."""
    return np.asarray(np.einsum("jqk,mkd->mqdj", cell.gradient(x), points[nodes], optimize=True))


def is_straight(points: Floats, cells: Ints, cell: Cell) -> bool:
    """Whether all nodes between corners are where those of straight cells would be."""
    limit = SAME_LENGTH * float(np.linalg.norm(np.ptp(points, axis=0)))
    return all(
        bool((np.abs(points[cells[:, k]] - points[cells[:, list(corners)]].mean(axis=1)) <= limit).all())
        for k, corners in enumerate(cell.nodes)
    )


def check_shape(points: Floats, cells: Ints, cell: Cell, name: str) -> None:
    """Refuse cells that are flat or folded.

    Raises:
        MeshError: with how many there are and where the first one is.
    """
    parts = [_spoilt(points, cells[k : k + _CHUNK], cell) for k in range(0, len(cells), _CHUNK)]
    flat, folded = (np.concatenate(flags) for flags in zip(*parts, strict=True))
    for bad, defect in (
        (flat, "have a corner without an angle (nodes that coincide or are in line)"),
        (folded, "are folded"),
    ):
        if bad.any():
            middle = points[cells[int(np.argmax(bad)), : len(cell.corners)]].mean(axis=0)
            point = ", ".join(f"{value:g}" for value in middle)
            raise MeshError(f"{name}: {np.count_nonzero(bad)} cells {defect}, the first at ({point})")


def _spoilt(points: Floats, cells: Ints, cell: Cell) -> tuple[_Truths, _Truths]:
    """Which cells are flat at a corner, and which are inverted between two of their nodes."""
    jacobian = _jacobian(points, cells, cell, cell.places)
    size = np.linalg.det(jacobian)
    spanned = np.sqrt(np.einsum("mqdj,mqdj->mqj", jacobian, jacobian).prod(axis=2))
    flat = np.any((np.abs(size) <= SAME_NUMBER * spanned)[:, : len(cell.corners)], axis=1)
    return flat, np.logical_and(size.min(axis=1) < 0, size.max(axis=1) > 0)
