"""The next mesh: bisected triangles and tetrahedra, or cell lengths for a mesh that gmsh makes
anew.

The names of boundaries and regions are kept.  Lengths follow O. C. Zienkiewicz, J. Z. Zhu, Int. J.
Numer. Meth. Engng 24 (1987): the error of a cell falls with its length to the power of the degree,
and the next mesh shall have the same error in all cells.  At the ends of a contact zone the error
falls more slowly, so that another mesh follows: starting with too few cells costs less than having
too many.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import basix
import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
from dolfinx import mesh as dmesh
from dolfinx.common import IndexMap
from mpi4py import MPI

from signorini_fx.arrays import Array, Indices, Ints
from signorini_fx.errors import MeshError
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.mesh.files.size_field import SizeField
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, arrays_of, from_arrays
from signorini_fx.tuned import SHORTEST_CHILD, SIZE_GROWTH


def mark(comm: MPI.Comm, squares: Array, share: float = 0.5) -> Indices:
    """Return the smallest set of cells that holds a ``share`` of the squared error (Doerfler
    marking), over all ranks: the numbers of those on this rank; collective.

    ``squares``: squared errors of the owned cells, shape (cells,).
    """
    total = parallel.total(comm, squares)
    low = 0.0
    high = parallel.largest(comm, squares)
    for _ in range(60):  # bisection for the threshold: no rank needs the cells of another
        middle = (low + high) / 2
        held = parallel.total(comm, squares[squares >= middle])
        low, high = (middle, high) if held >= share * total else (low, middle)
    return np.flatnonzero(squares >= low).astype(np.int32)


def check_divisible(tagged: TaggedMesh) -> None:
    """Check that the cells are straight triangles or tetrahedra.

    Raises:
        MeshError: they are not.
    """
    simplex = {2: "triangle", 3: "tetrahedron"}[tagged.mesh.topology.dim]
    if tagged.mesh.topology.cell_name() != simplex:
        plural = {"triangle": "triangles", "tetrahedron": "tetrahedra"}[simplex]
        raise MeshError(
            f"only {plural} can be refined: use cell = '{simplex}', or a generator and uniform "
            "refinement"
        )
    if compat.geometry_degree(tagged.mesh) > 1:
        raise MeshError(
            "only cells with straight sides can be refined: use a mesh whose geometry has degree 1"
        )


def refine(tagged: TaggedMesh, cells: Indices | None = None) -> TaggedMesh:
    """Bisect triangles or tetrahedra, at least the given cells of this rank (None: all); the mesh
    stays conforming.

    If only some are given, the cells are redistributed between the ranks.

    Raises:
        MeshError: the cells are neither triangles nor tetrahedra, or not straight.
    """
    check_divisible(tagged)
    mesh = tagged.mesh
    dim = mesh.topology.dim
    pairs = ((1, 0), (1, dim), (dim, 1), (dim - 1, dim), (dim, dim - 1))
    for pair in pairs:
        mesh.topology.create_connectivity(*pair)
    edges = None if cells is None else dmesh.compute_incident_entities(mesh.topology, cells, dim, 1)
    fine, parent_cell, parent_facet = dmesh.refine(
        mesh, edges, partitioner=None, option=dmesh.RefinementOption.parent_cell_and_facet
    )
    for pair in pairs:
        fine.topology.create_connectivity(*pair)
    # dolfinx's own transfer refuses meshes with ghost cells.  A child knows its parent by its place
    # before reordering.
    original = fine.topology.original_cell_index
    first = parallel.rows_before(mesh.comm, len(parent_cell))
    children = np.arange(len(parent_cell), dtype=np.int32)
    parents = parent_cell[original[children] - first]
    sides = parent_facet.reshape(-1, dim + 1)[original[children] - first]
    cell_tags = None
    if tagged.cell_tags is not None:
        kinds = _table(tagged.cell_tags, mesh.topology.index_map(dim))[parents]
        has_tag = kinds != _NO_TAG
        cell_tags = dmesh.meshtags(fine, dim, children[has_tag], kinds[has_tag])
    old, new = (
        m.topology.connectivity(dim, dim - 1).array.reshape(-1, dim + 1) for m in (mesh, fine)
    )
    on_side = sides >= 0
    facets = new[: len(children)][on_side]
    origin = old[np.repeat(parents, dim + 1).reshape(-1, dim + 1)[on_side], sides[on_side]]
    kinds = _table(tagged.facet_tags, mesh.topology.index_map(dim - 1))[origin]
    facets, index = np.unique(facets[kinds != _NO_TAG], return_index=True)
    facet_tags = dmesh.meshtags(
        fine, dim - 1, facets.astype(np.int32), kinds[kinds != _NO_TAG][index]
    )
    refined = TaggedMesh(
        fine, facet_tags, tagged.boundaries, cell_tags, tagged.regions, tagged.origin
    )
    if cells is None or mesh.comm.size == 1:
        return refined
    arrays = arrays_of(refined)
    return replace(from_arrays(mesh.comm, lambda: arrays), origin=tagged.origin)


_NO_TAG = np.iinfo(np.int32).min


def _table(tags: dmesh.MeshTags, index_map: IndexMap) -> Indices:
    """Return the tag of every entity of this rank, ghosts included; ``_NO_TAG`` where it
    has none.
    """
    table = np.full(index_map.size_local + index_map.num_ghosts, _NO_TAG, dtype=np.int32)
    table[tags.indices] = tags.values
    return table


# --- lengths of the next cells --------------------------------------------------------------------


def shorter_lengths(
    comm: MPI.Comm,
    squares: Array,
    lengths: Array,
    factor: float,
    degree: int,
    dimension: int,
    finer: float,
) -> Array:
    """Return the lengths of cells that reduce the error by ``factor`` with the fewest cells;
    collective.

    If this needs more cells than allowed, the error is reduced as far as the allowed number
    permits.

    Args:
        comm: the ranks that share the mesh.
        squares: squared error of each owned cell, shape (cells,).
        lengths: present lengths of these cells.
        factor: factor by which the error shall be reduced.
        degree: power of its length with which the error of a cell falls.
        dimension: dimension of the mesh.
        finer: how many times finer, on average over the body, the mesh may become: with 2 it may
            have as many cells as after halving all cells.
    """
    errors = np.sqrt(squares)
    total = parallel.total(comm, squares)
    largest = parallel.largest(comm, errors)
    if not largest > 0:
        return lengths

    def shares(level: float) -> Array:
        with np.errstate(divide="ignore"):
            wanted = (level / errors) ** (1 / (degree + dimension / 2))
        return np.clip(wanted, SHORTEST_CHILD, 1.0)

    allowed = finer**dimension * parallel.total(comm, len(lengths))
    low = np.log(largest) - 60.0
    high = np.log(largest)
    for _ in range(60):
        middle = (low + high) / 2
        share = shares(np.exp(middle))
        left_over = parallel.total(comm, squares * share ** (2 * degree))
        cells = parallel.total(comm, share**-dimension)
        low, high = (
            (low, middle) if left_over > total / factor**2 and cells < allowed else (middle, high)
        )
    return lengths * shares(np.exp(low))


def lengths_of_cells(tagged: TaggedMesh) -> Array:
    """Return the mean length of the edges of each owned cell, shape (cells,)."""
    owned = tagged.mesh.topology.index_map(tagged.dimension).size_local
    x = tagged.mesh.geometry.x[compat.geometry_cells(tagged.mesh)[:owned]]
    edges = basix.topology(getattr(basix.CellType, tagged.mesh.topology.cell_name()))[1]
    return np.mean([np.linalg.norm(x[:, a] - x[:, b], axis=1) for a, b in edges], axis=0)


def size_fields(
    tagged: TaggedMesh,
    lengths: Array,
    parts: Sequence[Indices],
    finer: float = np.inf,
) -> list[SizeField]:
    """Return size fields that grow slowly from the shortest lengths, also from body to body;
    collective.

    If this would need too many cells, all lengths that differ from those of the mesh are increased
    by one factor.

    Args:
        tagged: the mesh.
        lengths: the requested lengths in place of each owned cell, shape (cells,).
        parts: cells of this rank; each part gets a field, which is complete on the first rank and
            empty on the others.
        finer: see ``shorter_lengths``; cells between short and long ones count as well.
    """
    comm = tagged.mesh.comm
    dim = tagged.dimension
    of_part = np.full(len(lengths), -1)
    for number, members in enumerate(parts):
        of_part[members[members < len(of_part)]] = number
    arrays = arrays_of(tagged)
    of_row = parallel.rows_on_root(comm, of_part)
    of_cell = parallel.rows_on_root(comm, np.column_stack((lengths_of_cells(tagged), lengths)))
    x = arrays.points
    corners = arrays.corners
    if not parallel.is_root(comm):
        return [SizeField(x, corners, np.empty(0)) for _ in parts]
    longest: Array = np.zeros(len(x))
    around: Array = np.zeros(len(x))
    np.add.at(longest, corners, of_cell[:, :1])
    np.add.at(around, corners, 1.0)
    longest /= np.maximum(around, 1.0)
    share = np.ones(len(x))
    np.minimum.at(share, corners, of_cell[:, 1:] / of_cell[:, :1])
    used = np.flatnonzero(around)
    sizes: Array = longest.copy()
    sizes[used] = _graded(x[used], longest[used] * share[used])
    sizes = _affordable(sizes, longest, corners, of_cell[:, 0], dim, finer)
    fields = []
    for number in range(len(parts)):
        nodes, cells = np.unique(corners[of_row == number], return_inverse=True)
        fields.append(SizeField(x[nodes], cells.reshape(-1, corners.shape[1]), sizes[nodes]))
    return fields


def _affordable(
    sizes: Array,
    longest: Array,
    corners: Ints,
    old: Array,
    dimension: int,
    finer: float,
) -> Array:
    """Return lengths at all nodes: ``sizes``, increased by one factor if they need too many cells,
    but not beyond those of the mesh.
    """

    def longer(factor: float) -> Array:
        return np.minimum(factor * sizes, longest)

    def finer_by(factor: float) -> float:
        count = ((old / longer(factor)[corners].mean(axis=1)) ** dimension).sum()
        return float((count / len(old)) ** (1 / dimension))

    if not finer_by(1.0) > finer:
        return sizes
    low = 1.0
    high = float((longest / np.where(sizes > 0, sizes, np.inf)).max())
    for _ in range(40):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if finer_by(middle) > finer else (low, middle)
    return longer(high)


def _graded(x: Array, sizes: Array) -> Array:
    """Return lengths at points, reduced such that they differ by about ``SIZE_GROWTH`` times their
    distance at most.
    """
    from scipy.spatial import cKDTree

    graded = sizes.copy()
    least = graded.min()
    for octave in range(int(np.log2(graded.max() / least)) + 1):
        at = np.floor(np.log2(graded / least))
        short = at == octave
        longer = at > octave
        if short.any() and longer.any():
            distance, nearest = cKDTree(x[short]).query(x[longer])
            graded[longer] = np.minimum(
                graded[longer], graded[short][nearest] + SIZE_GROWTH * distance
            )
    return graded
