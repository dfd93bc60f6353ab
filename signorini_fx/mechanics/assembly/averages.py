"""How contact points average the displacement around them.

Most take that of their node.  On quadratic triangles, whose functions of the vertices integrate to
zero, the contact points are the vertices alone.  With functions psi_i on the facets around them
w_i = (psi_i, 1) is the weight of a point, y_i = (psi_i, y) / w_i the displacement that contact sees
there, and (psi_i, d) / w_i the gap.

The psi_i are the dual functions of the linear hat functions, see ``pairs.dual_functions``.  A point
hardly feels the tractions of those beside it, so that pressures do not alternate and active sets
settle fast.  But of a round gap with the radius R an average is h^2 / (8 R) below the value at the
vertex: the body would be pressed before it touches.  There they are the hat functions themselves.
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
    """How n contact points of this rank average over m nodes, which other ranks may own."""

    shares: sp.csr_array  # share of each node in each point, rows with the sum one, shape (n, m)
    nodes: Ints  # global numbers, shape (m,); a node of two contact boundaries is there twice
    x: Array  # positions of the nodes, length, shape (m, d)
    fixed: Flags  # which displacement components are prescribed at the nodes, shape (m, d)
    # Where the force of each point acts on the body of its node, length, shape (n, d); None: at the
    # average.
    centre: Array | None = None
    # Displacements of some nodes along one direction that move the points of two bodies by one, (m,
    # n); None: unknown.
    lift: sp.csr_array | None = None
    # ``operator`` between two bodies, shape (n d, m d); None: it is that of ``shares``.
    between: sp.csr_array | None = None

    @classmethod
    def at_nodes(cls, nodes: Ints, x: Array, fixed: Flags) -> Averages:
        """Return the averages of points that have the displacement of their nodes."""
        itself = sp.eye_array(nodes.size, format="csr")
        return cls(itself, nodes, x, fixed, lift=itself)

    @classmethod
    def joined(cls, parts: list[Averages]) -> Averages:
        """Return the averages of several contact boundaries."""
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
        """Whether points are those of two bodies, which turn relative to each other."""
        return self.between is not None

    @property
    def arm(self) -> Array:
        """Return the vector from each node to the point where the force acts on its body, length,
        shape (n, d).
        """
        return (self.shares @ self.x) if self.centre is None else self.centre

    @cached_property
    def point(self) -> Ints:
        """The point of each entry of ``shares``."""
        return np.repeat(np.arange(self.shares.shape[0]), np.diff(self.shares.indptr))

    @cached_property
    def operator(self) -> sp.csr_array:
        """Return the matrix from displacements of nodes to those of the points, in the axes of
        space, shape (n d, m d).
        """
        if self.between is not None:
            return self.between
        return sp.csr_array(sp.kron(self.shares, sp.eye_array(self.x.shape[1]), format="csr"))

    def of_gap(self, vertices: Array, values: Array) -> Array:
        """Return the gap of the points, length, shape (n,): averages of ``values`` at the nodes.

        Where the gap jumps or bends between nodes an average means nothing, and may lie below all
        values, or above.  There it is that of ``vertices``, shape (n,): where the average differs
        from it by no more than what the values differ, notably, from the quadratic function of two
        coordinates that fits best may change it.
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
        """Return whether any node of a point has a flag, from shape (m, k) to shape (n, k)."""
        return abs(self.shares) @ flags.astype(np.float64) > 0


def averaging(space: fem.FunctionSpace) -> bool:
    """Return whether the contact points of displacements in a space average: on quadratic
    tetrahedra.
    """
    return (
        space.element.basix_element.degree == 2 and space.mesh.topology.cell_name() == "tetrahedron"
    )


def from_owners(owned_rows: Array, nodes: Integers, comm: MPI.Comm) -> Array:
    """Return rows of ``owned_rows``, which has one per owned node, for global numbers of nodes;
    collective.
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
    """Return sums of rows for global numbers of nodes over all ranks, at the owned nodes, shape
    (owned, k); collective.
    """
    width = values.shape[1]
    sums = PETSc.Vec().createMPI((owned * width, None), bsize=width, comm=comm)
    sums.setValuesBlocked(
        nodes.astype(PETSc.IntType), np.ascontiguousarray(values), addv=PETSc.InsertMode.ADD_VALUES
    )
    sums.assemble()
    return np.array(sums.getArray(readonly=True)).reshape(-1, width)
