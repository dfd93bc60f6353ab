"""The nodes of a body, its connected pieces, and the prescribed displacements, evaluated anew for
the certificate.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from dolfinx import fem

from signorini_fx.arrays import Array, Flags, Ints, extents, inner, matvec, rmatvec
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.assembly.pieces import find_pieces
from signorini_fx.mechanics.rigid.rigid_motions import rigid_modes

if TYPE_CHECKING:
    from signorini_fx.mechanics.contact_points.turned_supports import TurnedNodes


class RigidPart:
    """The connected pieces of a mesh and the rigid motions that fit displacements of their nodes
    best.

    Pieces that can touch move independently of each other.  The constructor is collective.

    Args:
        space: the space of the displacement.

    Attributes:
        space: the space of the displacement.
        x: positions of the owned nodes, length, shape (owned nodes, d).
        count: number of pieces.
        piece: number of the piece that each owned node is in.
        size: diameters of the pieces, length, shape (pieces,).
    """

    def __init__(self, space: fem.FunctionSpace) -> None:
        pieces = find_pieces(space.mesh)
        self._comm = space.mesh.comm
        dim = space.mesh.geometry.dim
        self.count = pieces.count
        nodes = space.dofmap.index_map
        self.space = space
        self.x = node_positions(space)[: nodes.size_local, :dim]
        of_node = np.zeros(nodes.size_local + nodes.num_ghosts, dtype=np.int64)
        of_node[space.dofmap.list] = pieces.of_cell[:, None]
        self.piece = of_node[: len(self.x)]
        self.size = extents(pieces.bounds)
        self._turned = rigid_modes(self._without_mean(self.x), np.zeros(dim), np.array(1.0))[
            :, :, dim:
        ]
        turns = self._turned.shape[2]
        gram = self.sums(
            np.einsum("nik,nil->nkl", self._turned, self._turned).reshape(-1, turns**2)
        )
        self._inverse = np.linalg.pinv(gram.reshape(-1, turns, turns), hermitian=True)

    def largest_beside(self, y: Array) -> Array:
        """Return the largest nodal displacement of each piece after its best-fitting small rigid
        motion is subtracted, length, shape (pieces,).  Collective.

        Args:
            y: displacements of the owned nodes, length, shape (owned nodes, d).
        """
        motion = self._without_mean(y)
        moment = self.sums(rmatvec(self._turned, motion))
        angles = matvec(self._inverse, moment)
        return self.largest(
            np.linalg.norm(motion - matvec(self._turned, angles[self.piece]), axis=1)
        )

    def largest(self, values: Array, piece: Ints | None = None) -> Array:
        """Return the largest value of each piece, at least 0, and inf where a value is nan, shape
        (pieces,).  Collective.

        Args:
            values: one value for each entry of ``piece``, on this rank.
            piece: the piece that each value belongs to, -1 for none; None for values of the owned
                nodes.
        """
        piece = self.piece if piece is None else piece
        local_largest = np.zeros(self.count)
        inside = piece >= 0
        np.maximum.at(local_largest, piece[inside], values[inside])
        return parallel.largest_of_each(
            self._comm, np.where(np.isnan(local_largest), np.inf, local_largest)
        )

    def norms(self, vectors: Array, piece: Ints | None = None) -> Array:
        """Return the Euclidean norm of all vectors of each piece together, shape (pieces,).
        Collective.

        Args:
            vectors: numbers or vectors, shape (n,) or (n, d).
            piece: the piece that each one belongs to; None for those of the owned nodes.
        """
        rows = vectors[:, None] if vectors.ndim == 1 else vectors
        squares = inner(rows, rows)[:, None]
        pieces = self.piece if piece is None else piece
        return np.sqrt(parallel.sums_by(self._comm, pieces, squares, self.count)[:, 0])

    def _without_mean(self, values: Array) -> Array:
        sums = self.sums(np.column_stack((np.ones(len(values)), values)))
        return values - (sums[:, 1:] / np.maximum(sums[:, :1], 1.0))[self.piece]

    def sums(self, values: Array) -> Array:
        """Return the sums over the owned nodes of each piece, from shape (owned nodes, m) to
        (pieces, m).  Collective.
        """
        return parallel.sums_by(self._comm, self.piece, values, self.count)


@dataclass(frozen=True)
class PrescribedNodes:
    """The prescribed displacements of the owned nodes."""

    fixed: Flags  # which components are prescribed, in ``_frames``, shape (owned nodes, d)
    value: Array  # prescribed displacements along the axes, length, shape (owned nodes, d)
    # position in ``scene.displacement`` of the entry that prescribes a component along the axes, -1
    # for none
    by: Ints
    turned: TurnedNodes | None = None

    def missed(self, y: Array) -> Array:
        """Return the differences between displacements of the owned nodes and the prescribed ones,
        one for each prescribed component, length, as a flat array.
        """
        return np.abs(self._in_frames(y - self.value)[self.fixed])

    def among(self, of_node: Ints) -> Ints:
        """Return the number of the node of each entry of ``missed``, from a number for each owned
        node, such as that of its piece.
        """
        return np.broadcast_to(of_node[:, None], self.fixed.shape)[self.fixed]

    def left(self, vectors: Array) -> Array:
        """Return vectors at the owned nodes without their prescribed components, shape (owned
        nodes, d).
        """
        free = np.where(self.fixed, 0.0, self._in_frames(vectors))
        return free if self._frames is None else matvec(self._frames, free)

    def taken(self, forces: Array, position: int) -> Array:
        """Return the part of nodal forces that one entry of ``scene.displacement`` takes, shape
        (owned nodes, d).

        This part does the same work as all forces on any displacement that this entry alone
        prescribes.
        """
        taken = np.where(self.by == position, forces, 0.0)
        if self.turned is None:
            return taken
        here = self.turned.nodes < len(forces)
        nodes = self.turned.nodes[here]
        dim = forces.shape[1]
        along = rmatvec(self.turned.from_given[here], forces[nodes])
        taken[nodes] = np.where(self.by[nodes] == position, along[:, :dim], 0.0)
        for number, support in enumerate(self.turned.supports):
            if support.position == position:
                taken[nodes] += along[:, dim + number, None] * support.normal
        return taken

    @cached_property
    def _frames(self) -> Array | None:
        """The frames of the owned nodes in which ``fixed`` is stated, shape (owned nodes, d, d);
        None if they are the axes.
        """
        return None if self.turned is None else self.turned.frames_at(np.arange(len(self.fixed)))

    def _in_frames(self, vectors: Array) -> Array:
        """Return the components of vectors at the owned nodes in ``_frames``."""
        return vectors if self._frames is None else rmatvec(self._frames, vectors)
