"""The connected pieces of a body: cells that are connected through common sides (edges in 2D, faces
in 3D).

Cells transmit forces through the sides that they share, so a mesh of several pieces is several
bodies.  Pieces that share a vertex but no side would be joined by a hinge, and are refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt
from dolfinx import la
from dolfinx import mesh as dmesh
from dolfinx.common import IndexMap
from mpi4py import MPI
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from signorini_fx.arrays import Array, Indices, Ints, Plain
from signorini_fx.errors import MeshError
from signorini_fx.machine import compat, parallel

# A mesh with more pieces is refused: its cells do not share their nodes, and rigid motions are
# dense objects of this size.
MOST_PIECES = 200
# The pieces of each mesh that still exists.
_known: WeakKeyDictionary[dmesh.Mesh, BodyPieces] = WeakKeyDictionary()


@dataclass(frozen=True)
class BodyPieces:
    """The connected pieces of a body; all but ``of_cell`` are the same on every rank."""

    # number of the piece that each cell of this rank is in, ghosts included, shape (cells,)
    of_cell: Ints
    cells: Ints  # number of cells of each piece, shape (pieces,)
    bounds: Array  # smallest and largest coordinates of each piece, lengths, shape (pieces, 2, d)
    # number of the assembly (bodies that may touch each other) of each piece, shape (pieces,)
    assembly: Ints
    bodies: tuple[str, ...] = ()  # name of the body of each piece; empty where bodies have no names

    @cached_property
    def count(self) -> int:
        """Number of pieces."""
        return int(self.cells.size)

    def called(self, piece: int) -> str:
        """Return the name of a piece for messages: that of its body, or its number, size and
        extent.
        """
        bodies = self.bodies
        cells = int(self.cells[piece])
        if bodies and bodies.count(bodies[piece]) == 1:
            return f"body {bodies[piece]!r}"
        number = f"piece {piece + 1} of {self.count}" + (
            f", in body {bodies[piece]!r}" if bodies else ""
        )
        return f"{number} ({cells} cell{'s' * (cells > 1)}, {extent(self.bounds[piece])})"

    def names(self, pieces: Ints) -> list[str]:
        """Return the names of the bodies of some pieces, or the numbers of the pieces; empty if the
        body is one piece without a name.
        """
        if self.bodies:
            return list(dict.fromkeys(self.bodies[piece] for piece in pieces))
        return [f"piece {piece + 1}" for piece in pieces] if self.count > 1 else []

    def of_bodies(self, comm: MPI.Comm, cells: Mapping[str, Indices]) -> BodyPieces:
        """Return the pieces with the names of their bodies; collective.

        Args:
            comm: the ranks.
            cells: the cells of each body on this rank, by name; a piece belongs to the body that
                has most of its cells.
        """
        counts = [
            np.bincount(self.of_cell[body_cells], minlength=self.count)
            for body_cells in cells.values()
        ]
        majority = parallel.global_sum(comm, np.array(counts)).argmax(axis=0)
        return replace(self, bodies=tuple(np.array(list(cells), dtype=object)[majority]))

    def of_regions(self, comm: MPI.Comm, cells: Mapping[str, Indices]) -> BodyPieces:
        """Return the pieces with the names of regions, if each piece is exactly one region, else
        unchanged; collective.

        Args:
            comm: the ranks.
            cells: the cells of each region that this rank owns, by name.
        """
        counts = parallel.global_sum(
            comm,
            np.array(
                [np.bincount(self.of_cell[own], minlength=self.count) for own in cells.values()]
            ),
        )
        whole = (counts == self.cells) & (counts.sum(axis=1)[:, None] == self.cells)
        if not whole.any(axis=0).all():
            return self
        return replace(
            self, bodies=tuple(np.array(list(cells), dtype=object)[whole.argmax(axis=0)])
        )

    def as_rows(self) -> list[dict[str, Plain]]:
        """Return one row for each piece, ready for JSON."""
        return [
            {
                "piece": piece + 1,
                "body": self.bodies[piece] if self.bodies else None,
                "cells": int(self.cells[piece]),
                "bounds": self.bounds[piece].tolist(),
            }
            for piece in range(self.count)
        ]


def extent(bounds: npt.ArrayLike) -> str:
    """Return smallest and largest coordinates, shape (2, d), as text."""
    return ", ".join(
        f"x[{axis}] {low:g} to {high:g}" for axis, (low, high) in enumerate(np.transpose(bounds))
    )


def find_pieces(mesh: dmesh.Mesh) -> BodyPieces:
    """Return the connected pieces of a mesh, ordered by their smallest coordinates; collective.

    Raises:
        MeshError: there are more than ``MOST_PIECES``, or two share a vertex.
    """
    if mesh not in _known:
        _known[mesh] = _pieces_of(mesh)
    return _known[mesh]


def forget_pieces(mesh: dmesh.Mesh) -> None:
    """Drop the cached pieces of a mesh, after its coordinates have changed."""
    _known.pop(mesh, None)


def _pieces_of(mesh: dmesh.Mesh) -> BodyPieces:
    """Compute the pieces of a whole mesh; collective.

    Each rank labels the components of its own cells; sides between two ranks then join the labels.
    """
    comm = mesh.comm
    topology = mesh.topology
    dim = topology.dim
    topology.create_connectivity(dim, dim - 1)
    cells = topology.index_map(dim)
    owned = cells.size_local
    sides, local = _local_components(topology)
    # Labels of all ranks, one after the other.
    numbered = int(local.max(initial=-1)) + 1
    local += comm.exscan(numbered) or 0
    total = int(parallel.total(comm, numbered))
    of_side = _labels_of(sides, local, topology.index_map(dim - 1))
    shared = _disagreements(of_side, topology.index_map(dim - 1))
    links = np.unique(parallel.gather_rows(comm, np.unique(shared[:, 1:], axis=0)), axis=0)
    graph = coo_array(
        (np.ones(len(links), dtype=np.int8), (links[:, 0], links[:, 1])), shape=(total, total)
    )
    count, names = connected_components(graph, directed=False)
    if count > MOST_PIECES:
        raise MeshError(
            f"the mesh falls into {count} pieces that share no side (more than {MOST_PIECES}): "
            "its cells do not share "
            "their nodes; merge coincident points (signorini-fx mesh-info counts them)"
        )
    of_cell = names[local].astype(np.int64)
    dim = mesh.geometry.dim
    x = mesh.geometry.x[:, :dim].astype(np.float64)
    corners = compat.geometry_cells(mesh)
    numbers = np.empty(count, dtype=np.int64)
    bounds = np.empty((count, 2, dim))
    for piece in range(count):
        in_piece = of_cell == piece
        bounds[piece] = parallel.global_bounds(
            comm, x if count == 1 else x.take(corners[in_piece].ravel(), axis=0)
        )
        numbers[piece] = parallel.global_sum(comm, np.array(np.count_nonzero(in_piece[:owned])))
    if count > 1:
        _refuse_hinges(mesh, of_cell)
    # Rounded, because otherwise round-off would order pieces that are meant to begin at the same
    # place.
    size = float(np.ptp(bounds.reshape(-1, dim), axis=0).max())
    order = np.lexsort(np.round(bounds.reshape(count, 2 * dim) / size, 9).T[::-1])
    position = np.argsort(order)
    return BodyPieces(position[of_cell], numbers[order], bounds[order], np.arange(count))


def _local_components(topology: dmesh.Topology) -> tuple[Indices, Ints]:
    """Return the sides of the cells of this rank, and a label for each cell; cells that share a
    side have the same label.
    """
    sides = topology.connectivity(topology.dim, topology.dim - 1)
    side_map = topology.index_map(topology.dim - 1)
    cells = sides.num_nodes
    count = side_map.size_local + side_map.num_ghosts
    starts = np.concatenate((sides.offsets, np.full(count, sides.array.size))).astype(np.int32)
    graph = csr_array(
        (np.ones(sides.array.size, dtype=np.int8), sides.array + cells, starts),
        shape=(cells + count, cells + count),
    )
    _, labels = connected_components(graph, directed=True, connection="weak")
    # Every side has a cell, so every label has one.
    return sides.array, labels[:cells].astype(np.int64)


def _labels_of(entities: Indices, labels: Ints, index_map: IndexMap) -> Ints:
    """Return a label for each vertex or side: that of any of its cells, -1 if it has none."""
    entity_labels = np.full(index_map.size_local + index_map.num_ghosts, -1, dtype=np.int64)
    entity_labels[entities] = np.repeat(labels, entities.size // max(labels.size, 1))
    return entity_labels


def _disagreements(labels: Ints, index_map: IndexMap) -> Ints:
    """Return the ghosts that this rank and their owner label differently: rows of entity, own label
    and owner's label; collective.
    """
    vector = la.vector(index_map, 1, dtype=np.int64)
    vector.array[:] = labels
    vector.scatter_forward()
    different = np.flatnonzero((vector.array != labels) & (vector.array >= 0) & (labels >= 0))
    return np.column_stack((different, labels[different], vector.array[different])).astype(np.int64)


def _refuse_hinges(mesh: dmesh.Mesh, of_cell: Ints) -> None:
    """Raise a ``MeshError`` if two pieces share a vertex; collective."""
    topology = mesh.topology
    dim = mesh.geometry.dim
    vertices = topology.connectivity(topology.dim, 0).array
    of_vertex = _labels_of(vertices, of_cell, topology.index_map(0))
    of_corner = np.repeat(of_cell, vertices.size // max(of_cell.size, 1))
    between = _disagreements(of_vertex, topology.index_map(0))[:, 0]
    shared = np.concatenate((vertices[of_vertex[vertices] != of_corner], between)).astype(np.int32)
    nodes = np.empty(0, dtype=np.int32)
    if shared.size:  # dolfinx divides by their number
        topology.create_connectivity(0, topology.dim)
        nodes = dmesh.entities_to_geometry(mesh, 0, shared).ravel()
    places = parallel.gather_rows(mesh.comm, mesh.geometry.x[nodes, :dim].astype(np.float64))
    if len(places):
        place = ", ".join(f"{x:g}" for x in min(places.tolist()))
        raise MeshError(
            f"parts of the mesh share only the node at ({place}), as a hinge: let them share a "
            "side, or separate their nodes there"
        )
