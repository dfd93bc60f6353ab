"""How contact points average the displacement around them.

Most points take the displacement of their node.  On the faces of quadratic tetrahedra the functions
of the vertices integrate to zero; there the contact points are the vertices alone.  With functions
psi_i on the facets around it, a point has the weight w_i = (psi_i, 1), the displacement y_i =
(psi_i, y) / w_i, and the gap (psi_i, d) / w_i.

The psi_i are the dual functions of the linear hat functions, see ``pairs.dual_functions``.  They
decouple neighbouring points almost fully, so that pressures do not oscillate and active sets
converge fast.  But the average of a round gap of radius R is h^2 / (8 R) below its value at the
vertex: the body would be pressed before it touches.  For such gaps the psi_i are the hat functions
themselves.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.arrays import Array, Flags, Integers, Ints
from signorini_fx.tuned import NEGLIGIBLE


@dataclass(frozen=True)
class Averages:
    """The averages over m nodes, which may belong to other ranks, at n contact points of
    this rank.
    """

    shares: sp.csr_array  # weight of each node in each point, rows have the sum 1, shape (n, m)
    nodes: Ints  # global numbers, shape (m,); a node of two contact boundaries occurs twice
    x: Array  # positions of the nodes, length, shape (m, d)
    fixed: Flags  # which displacement components are prescribed at the nodes, shape (m, d)
    # Position where the force of each point acts on the body of its node, length, shape (n, d);
    # None: the average of the positions of the nodes.
    centre: Array | None = None
    # Nodal displacements along one direction that give each point of two bodies a unit relative
    # displacement, shape (m, n); None: unknown.
    lift: sp.csr_array | None = None
    # ``operator`` for pairs of bodies, shape (n d, m d); None: it follows from ``shares``.
    between: sp.csr_array | None = None

    @classmethod
    def at_nodes(cls, nodes: Ints, x: Array, fixed: Flags) -> Averages:
        """Return the averages of points that each take the displacement of one node."""
        itself = sp.eye_array(nodes.size, format="csr")
        return cls(itself, nodes, x, fixed, lift=itself)

    @classmethod
    def joined(cls, parts: list[Averages]) -> Averages:
        """Return the averages of several contact boundaries as one."""
        if len(parts) == 1:
            return parts[0]
        shares = sp.block_diag([part.shares for part in parts], format="csr")
        nodes, x, fixed = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("nodes", "x", "fixed")
        )
        if not any(part.paired for part in parts):
            return cls(shares, nodes, x, fixed)
        lifts = [part.lift for part in parts]
        between = sp.block_diag([part.operator for part in parts], format="csr")
        lift = (
            None if any(matrix is None for matrix in lifts) else sp.block_diag(lifts, format="csr")
        )
        return cls(
            shares, nodes, x, fixed, np.concatenate([part.arm for part in parts]), lift, between
        )

    @property
    def paired(self) -> bool:
        """Whether points belong to two bodies, which rotate relative to each other."""
        return self.between is not None

    @property
    def arm(self) -> Array:
        """The point where the force of each contact point acts on its body, length, shape
        (n, d).
        """
        return (self.shares @ self.x) if self.centre is None else self.centre

    @cached_property
    def point(self) -> Ints:
        """The row, and so the contact point, of each stored entry of ``shares``."""
        return np.repeat(np.arange(self.shares.shape[0]), np.diff(self.shares.indptr))

    @cached_property
    def operator(self) -> sp.csr_array:
        """The matrix from displacements of the nodes to those of the points, both along the
        coordinate axes, shape (n d, m d).
        """
        if self.between is not None:
            return self.between
        return sp.csr_array(sp.kron(self.shares, sp.eye_array(self.x.shape[1]), format="csr"))

    def of_gap(self, vertices: Array, values: Array) -> Array:
        """Return the gap of the points, length, shape (n,).

        It is the average of ``values``, except where the gap jumps or has kinks between nodes, as
        an average may lie outside all values there.  A gap counts as kinked if the best quadratic
        function of two coordinates leaves a notable part of its variation.  If the average then
        differs from the value at the vertex by no more than this remainder can explain, the value
        at the vertex is taken.

        Args:
            vertices: gap at the points, length, shape (n,).
            values: gap at the nodes, length, shape (m,).
        """
        gap = self.shares @ values
        for point in range(gap.size):
            entries = slice(*self.shares.indptr[point : point + 2])
            nodes = self.shares.indices[entries]
            shares = self.shares.data[entries]
            x = self.x[nodes] - self.x[nodes].mean(axis=0)
            a, b = (x @ np.linalg.eigh(x.T @ x)[1][:, 1:]).T / np.abs(x).max()
            powers = np.column_stack((np.ones_like(a), a, b, a * a, a * b, b * b))
            fitted = powers @ np.linalg.lstsq(powers, values[nodes])[0]
            rest = np.abs(values[nodes] - fitted).max()
            changed = (1.0 + np.abs(shares).sum()) * rest
            bent = rest > NEGLIGIBLE * np.ptp(values[nodes])
            if bent and np.abs(gap[point] - vertices[point]) < changed:
                gap[point] = vertices[point]
        return gap

    def any_of(self, flags: Flags) -> Flags:
        """Return whether any node of a point has a flag, shape (n, k), from flags of shape
        (m, k).
        """
        return abs(self.shares) @ flags.astype(np.float64) > 0


def averaging(space: fem.FunctionSpace) -> bool:
    """Return whether contact points of displacements in this space average: only on quadratic
    tetrahedra.
    """
    return (
        space.element.basix_element.degree == 2 and space.mesh.topology.cell_name() == "tetrahedron"
    )


def from_owners(owned_rows: Array, nodes: Integers, comm: MPI.Comm) -> Array:
    """Return the rows of ``owned_rows`` for global node numbers; collective.

    Args:
        owned_rows: one row per owned node of each rank.
        nodes: global numbers.
        comm: the ranks.
    """
    if comm.size == 1:
        return np.array(owned_rows[nodes], dtype=np.float64)
    width = owned_rows.shape[1]
    sent = PETSc.Vec().createWithArray(np.array(owned_rows, dtype=np.float64).ravel(), comm=comm)
    received = PETSc.Vec().createSeq(nodes.size * width, comm=PETSc.COMM_SELF)
    places = PETSc.IS().createBlock(width, nodes.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
    PETSc.Scatter().create(sent, places, received, None).scatter(sent, received)
    return np.array(received.getArray(readonly=True)).reshape(-1, width)


def to_owners(values: Array, nodes: Integers, comm: MPI.Comm, owned: int) -> Array:
    """Return rows summed over all ranks by global node number, at the owned nodes, shape (owned,
    k); collective.

    Args:
        values: rows to add, shape (m, k).
        nodes: their global node numbers, shape (m,).
        comm: the ranks.
        owned: number of nodes that this rank owns.
    """
    width = values.shape[1]
    sums = PETSc.Vec().createMPI((owned * width, None), bsize=width, comm=comm)
    sums.setValuesBlocked(
        nodes.astype(PETSc.IntType), np.ascontiguousarray(values), addv=PETSc.InsertMode.ADD_VALUES
    )
    sums.assemble()
    return np.array(sums.getArray(readonly=True)).reshape(-1, width)
