"""Operations on a mesh in plain arrays: straighten its sides, or halve the sides of all cells;
names are kept.

A triangle or quadrilateral is divided into four, a tetrahedron or hexahedron into eight.  Cells
with curved sides are divided on their own geometry: their children lie on the same curves.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.distance import cdist

from signorini_fx.arrays import Array, Ints
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays, rows_of, sides_of
from signorini_fx.mechanics.mesh.files.cells import CELLS, Cell, straight

# The ends of the sides whose middles are the corners of children that have no corner of their
# parent.  The order of Bey (Computing 55, 1995): however often they are divided, tetrahedra have
# three shapes at most.
_WITHIN = {
    "triangle": [[(1, 2), (0, 2), (0, 1)]],
    "tetra": [
        [(0, 1), (0, 2), (0, 3), (1, 3)],
        [(0, 1), (0, 2), (1, 2), (1, 3)],
        [(0, 2), (0, 3), (1, 3), (2, 3)],
        [(0, 2), (1, 2), (1, 3), (2, 3)],
    ],
}


def straightened(mesh: MeshArrays) -> MeshArrays:
    """Return the mesh with straight sides, without the nodes between corners."""
    if mesh.degree == 1:
        return mesh
    used, corners = np.unique(mesh.corners, return_inverse=True)
    number = np.full(len(mesh.points), -1)
    number[used] = np.arange(used.size)
    return replace(
        mesh,
        points=mesh.points[used],
        kind=straight(mesh.cell).kind,
        cells=corners.reshape(mesh.corners.shape),
        facets=number[mesh.facet_corners],
    )


def quadratic(mesh: MeshArrays) -> MeshArrays:
    """Return a mesh of straight cells with additional nodes in the middle of their edges and faces;
    the shape is the same.
    """
    cell = next(
        kind
        for kind in CELLS.values()
        if kind.basix_type == mesh.cell.basix_type and kind.degree == 2
    )
    number, points, lattice = _numbered(mesh, 2)
    cells = number[:, _places(cell, cell.corners, lattice)]
    rows = rows_of(
        mesh.facet_corners, sides_of(mesh.cells, mesh.cell)[:, : len(mesh.facet.corners)]
    )
    return replace(
        mesh, points=points, kind=cell.kind, cells=cells, facets=sides_of(cells, cell)[rows]
    )


def halved(mesh: MeshArrays) -> MeshArrays:
    """Return the mesh with every side of every cell halved."""
    cell = mesh.cell
    corners = mesh.cell.corners
    number, points, lattice = _numbered(mesh, 2 * mesh.degree)
    children = _places(cell, _children(cell, corners), lattice)
    ends = cell.facet_nodes[:, : len(mesh.facet.corners)]
    sides = np.array(
        [_places(mesh.facet, _children(mesh.facet, corners[facet]), lattice) for facet in ends]
    )
    owner, side = np.divmod(
        rows_of(mesh.facet_corners, mesh.cells[:, ends].reshape(-1, ends.shape[1])), len(ends)
    )
    halves = number[owner[:, None, None], sides[side]]
    return MeshArrays(
        points=points,
        kind=mesh.kind,
        cells=number[:, children].reshape(-1, len(cell.nodes)),
        facets=halves.reshape(-1, halves.shape[2]),
        boundaries={
            name: _repeated(rows, halves.shape[1]) for name, rows in mesh.boundaries.items()
        },
        regions={name: _repeated(rows, len(children)) for name, rows in mesh.regions.items()},
    )


def _numbered(mesh: MeshArrays, degree: int) -> tuple[Ints, Array, Array]:
    """Return the nodes of an equispaced lattice of this degree on all cells.

    Returns their numbers, the same in cells that share a node, shape (m, k), their positions, and
    the lattice in the reference cell.
    """
    import basix.ufl
    import mpi4py.MPI  # first, see signorini_fx.mechanics.body
    import ufl
    from dolfinx import fem
    from dolfinx import mesh as dmesh

    coarse = straightened(mesh)
    even = basix.LagrangeVariant.equispaced
    cell = coarse.cell
    shape = coarse.cell.basix_type.name
    domain = ufl.Mesh(basix.ufl.element("Lagrange", shape, 1, even, shape=(cell.dim,)))
    made = dmesh.create_mesh(mpi4py.MPI.COMM_SELF, cells=coarse.cells, x=coarse.points, e=domain)
    element = basix.ufl.element("Lagrange", shape, degree, even)
    dofs = fem.functionspace(made, element).dofmap.list
    lattice = element.basix_element.points
    number = np.empty(dofs.shape, dtype=np.int64)
    number[made.topology.original_cell_index] = dofs
    points = np.empty((int(number.max()) + 1, mesh.dim))
    points[number] = np.einsum("ln,cnd->cld", mesh.cell.shape(lattice), mesh.points[mesh.cells])
    return number, points, lattice


def _places(kind: Cell, corners: Array, lattice: Array) -> Ints:
    """Return the lattice numbers of the nodes of cells or facets with these corners, shape (...,
    k).
    """
    nodes = straight(kind).shape(kind.places) @ corners
    places = cdist(nodes.reshape(-1, nodes.shape[-1]), lattice).argmin(axis=1)
    return places.reshape(nodes.shape[:-1])


def _children(kind: Cell, corners: Array) -> Array:
    """Return the corners of the children of a cell or facet, shape (children, corners, d)."""
    count = len(corners)
    ends = [[(own, other) for other in range(count)] for own in range(count)]
    return corners[np.array(ends + _WITHIN.get(straight(kind).kind, []))].mean(axis=2)


def _repeated(rows: Ints, times: int) -> Ints:
    """Return the rows of the children of some rows."""
    return (times * rows[:, None] + np.arange(times)).ravel()
