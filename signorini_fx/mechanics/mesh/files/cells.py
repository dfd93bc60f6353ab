"""The kinds of mesh elements, their measures and validity; corners, nodes and facets are in the
order of dolfinx.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import basix
import numpy as np

from signorini_fx.arrays import Array, Flags, Ints
from signorini_fx.errors import MeshError
from signorini_fx.tuned import SAME_NUMBER

if TYPE_CHECKING:
    from dolfinx.mesh import Mesh

Corners = tuple[int, ...]

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
    basix_type: basix.CellType
    degree: int  # of the geometry
    facet: str  # kind of the facets, "" for an element that is a line
    gmsh: int  # number of gmsh

    @property
    def dim(self) -> int:
        """Topological dimension."""
        return self.corners.shape[1]

    @cached_property
    def corners(self) -> Array:
        """The corners of the reference cell, shape (corners, dim)."""
        return basix.geometry(self.basix_type)

    @cached_property
    def edges(self) -> list[list[int]]:
        """The ends of each edge, by the numbers of its corners."""
        return list(basix.topology(self.basix_type)[1])

    @cached_property
    def nodes(self) -> list[Corners]:
        """Return for each node the corners whose mean it is; a corner is its own mean."""
        entities = enumerate(basix.topology(self.basix_type))
        middles = [
            tuple(corners)
            for dim, of_dim in entities
            for corners in of_dim
            if len(corners) == 2**dim
        ]
        return middles[: len(self.places)]

    @property
    def facet_nodes(self) -> Ints:
        """Nodes of each facet in the order of the kind of the facets, shape (facets, nodes of
        each).
        """
        return np.array(self._element.entity_closure_dofs[self.dim - 1])

    @property
    def places(self) -> Array:
        """The positions of the nodes in the reference cell, shape (nodes, dim)."""
        return self._element.points

    @cached_property
    def _element(self) -> basix.finite_element.FiniteElement:
        even = basix.LagrangeVariant.equispaced
        return basix.create_element(basix.ElementFamily.P, self.basix_type, self.degree, even)

    def shape(self, x: Array) -> Array:
        """Return the shape functions, shape (points, nodes), at points of the reference cell, shape
        (points, dim).
        """
        # At nodes they are 0 and 1 but for round-off, with which a node would leave an axis of
        # symmetry.
        return self._element.tabulate(0, x)[0, :, :, 0].round(_DIGITS)

    def gradient(self, x: Array) -> Array:
        """Return the derivatives of the shape functions, shape (dim, points, nodes), at points of
        the reference cell, shape (points, dim).
        """
        return self._element.tabulate(1, x)[1:, :, :, 0]


_KINDS = (
    Cell("line", "lines", basix.CellType.interval, 1, "", 1),
    Cell("line3", "lines", basix.CellType.interval, 2, "", 8),
    Cell("triangle", "triangles", basix.CellType.triangle, 1, "line", 2),
    Cell("triangle6", "triangles", basix.CellType.triangle, 2, "line3", 9),
    Cell("quad", "quadrilaterals", basix.CellType.quadrilateral, 1, "line", 3),
    Cell("quad9", "quadrilaterals", basix.CellType.quadrilateral, 2, "line3", 10),
    Cell("tetra", "tetrahedra", basix.CellType.tetrahedron, 1, "triangle", 4),
    Cell("tetra10", "tetrahedra", basix.CellType.tetrahedron, 2, "triangle6", 11),
    Cell("hexahedron", "hexahedra", basix.CellType.hexahedron, 1, "quad", 5),
    Cell("hexahedron27", "hexahedra", basix.CellType.hexahedron, 2, "quad9", 12),
)
CELLS = {cell.kind: cell for cell in _KINDS}


def kind_of_mesh(mesh: Mesh) -> Cell | None:
    """Return the kind of the cells of a dolfinx mesh; None if the degree of the geometry is above
    2.
    """
    from signorini_fx.machine import compat

    word = mesh.topology.cell_name()
    degree = compat.geometry_degree(mesh)
    return next(
        (cell for cell in CELLS.values() if (cell.basix_type.name, cell.degree) == (word, degree)),
        None,
    )


def order_in(program: str, kind: Cell) -> Ints:
    """Return the number in ``gmsh``, or in ``vtk`` (the order of meshio), of each node of an
    element.
    """
    import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
    from dolfinx.io import utils
    from dolfinx.mesh import to_type

    order = utils.cell_perm_gmsh if program == "gmsh" else utils.cell_perm_vtk
    return np.asarray(order(to_type(kind.basix_type.name), len(kind.nodes)), dtype=np.int64)


def straight(cell: Cell) -> Cell:
    """Return the kind with the same corners and no nodes between them."""
    return CELLS[family(cell.kind)]


# Elements of the serendipity family, which have no nodes in the middle of faces, and their complete
# kind.
_COMPLETE = {"quad8": "quad9", "hexahedron20": "hexahedron27"}
_DIMENSIONS = {"vertex": 0, "line": 1, "triangle": 2, "quad": 2, "polygon": 2}


def completed(kind: str) -> tuple[Cell, Array] | None:
    """Return the complete kind for an element without nodes in the middle of its faces, and the
    weights of the existing nodes in each of its nodes, shape (nodes, existing nodes); None for any
    other kind.
    """
    if kind not in _COMPLETE:
        return None
    full_cell = CELLS[_COMPLETE[kind]]
    existing = [set(corners) for corners in full_cell.nodes if len(corners) <= 2]
    weights = np.eye(len(full_cell.nodes), len(existing))
    for node, corners in enumerate(full_cell.nodes[len(existing) :], start=len(existing)):
        around = {
            1: -1 / 4,
            2: 2 / len(corners),
        }  # a corner; the middle of an edge, of a face or of the cell
        weights[node] = [around[len(ends)] if ends <= set(corners) else 0.0 for ends in existing]
    return full_cell, weights


def family(kind: str) -> str:
    """Return the kind of the elements with the same corners and no nodes between them."""
    return kind.rstrip("0123456789")


def dimension(kind: str) -> int:
    """Return the topological dimension of an element of a file, also of kinds that are not
    supported as cells; unknown kinds count as solids.
    """
    return _DIMENSIONS.get(family(kind), 3)


# --- elements of a mesh ---------------------------------------------------------------------------


def measures(points: Array, nodes: Ints, cell: Cell) -> Array:
    """Return the length, area or volume of each element, including curved sides, shape (m,).

    ``points``: shape (n, d); ``nodes``: the nodes of each element, shape (m, k); ``cell``: their
    kind, of dimension d or d - 1.
    """
    return nodal_measures(points, nodes, cell).sum(axis=1)


def nodal_measures(points: Array, nodes: Ints, cell: Cell) -> Array:
    """Return the integral of each shape function over each element, shape (m, k)."""
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


def _jacobian(points: Array, nodes: Ints, cell: Cell, x: Array) -> Array:
    """Return the derivatives of the position at points of the reference cell, shape (m, points, d,
    dim).
    """
    return np.einsum("jqk,mkd->mqdj", cell.gradient(x), points[nodes], optimize=True)


def curvature(points: Array, cells: Ints, cell: Cell) -> float:
    """Return the largest distance of a node between corners from its place in a straight cell,
    length.
    """
    away = [
        points[cells[:, k]] - points[cells[:, list(ends)]].mean(axis=1)
        for k, ends in enumerate(cell.nodes)
    ]
    return float(np.linalg.norm(away, axis=2).max(initial=0.0))


def check_shape(points: Array, cells: Ints, cell: Cell, name: str) -> None:
    """Check that no cell is flat or folded.

    Raises:
        MeshError: some cells are; the message states how many and where the first one is.
    """
    parts = [_spoilt(points, cells[k : k + _CHUNK], cell) for k in range(0, len(cells), _CHUNK)]
    flat, folded = (np.concatenate(flags) for flags in zip(*parts, strict=True))
    spoilt = np.flatnonzero(flat | folded)
    repeated = np.zeros(len(cells), dtype=bool)
    corners = np.sort(cells[spoilt, : len(cell.corners)], axis=1)
    repeated[spoilt] = (np.diff(corners, axis=1) == 0).any(axis=1)
    for bad, defect in (
        (repeated, "have a node twice, as wedges in place of hexahedra: make tetrahedra of them"),
        (flat, "have a corner without an angle (nodes that coincide or are in line)"),
        (folded, "are folded"),
    ):
        if bad.any():
            middle = points[cells[int(np.argmax(bad)), : len(cell.corners)]].mean(axis=0)
            point = ", ".join(f"{value:g}" for value in middle)
            raise MeshError(
                f"{name}: {np.count_nonzero(bad)} cells {defect}, the first at ({point})"
            )


def _spoilt(points: Array, cells: Ints, cell: Cell) -> tuple[Flags, Flags]:
    """Return the flags of cells that are flat at a corner, and of those whose Jacobian determinant
    changes its sign.
    """
    jacobian = _jacobian(points, cells, cell, cell.places)
    size = np.linalg.det(jacobian)
    spanned = np.sqrt(np.einsum("mqdj,mqdj->mqj", jacobian, jacobian).prod(axis=2))
    flat = np.any((np.abs(size) <= SAME_NUMBER * spanned)[:, : len(cell.corners)], axis=1)
    return flat, np.logical_and(size.min(axis=1) < 0, size.max(axis=1) > 0)
