"""How contact points average the displacement around them.

Most take that of their node.  Elements without a positive rule at their nodes need averages: the basis functions of the
vertices of a quadratic triangle integrate to zero, so that ``nodal_rule`` gives them no weight.  There the
contact points are the vertices alone, and

    w_i = (psi_i, 1),    y_i = (psi_i, y) / w_i

are the weight of a point and the displacement that contact sees there: (lambda, z) = sum_i w_i lambda_i z_i.  The
psi_i are dual to the linear hat functions phi_i of the vertices on each facet f, (psi_i, phi_k)_f = (phi_i, 1)_f
delta_ik: psi_i = 4 phi_i - 1 on a flat one.  They sum to one, so that a constant traction loads the body as it should,
all w_i = (phi_i, 1) are positive, and y_i of a linear displacement is its value at the vertex: a point hardly feels
the tractions of those beside it, and pressures do not alternate (Wohlmuth, SIAM J. Numer. Anal. 38 (2000) 989-1012).
The gap that it is compared with is that of the vertex: what is averaged of a round one is negative where it touches.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

_Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Averages:
    """How n contact points of this rank average over m nodes, which other ranks may own."""

    shares: Any  # share of each node in each point, rows with the sum one, scipy sparse, shape (n, m)
    nodes: npt.NDArray[np.int64]  # global numbers, shape (m,); a node of two contact boundaries is there twice
    x: _Floats  # positions of the nodes, length, shape (m, d)
    fixed: npt.NDArray[np.bool_]  # which displacement components are prescribed at the nodes, shape (m, d)
    # Where the force of each point acts on the body of its node, length, shape (n, d); None: at the average.
    centre: _Floats | None = None
    # Displacements of some nodes along one direction that move the points of two bodies by one, (m, n); None: unknown.
    lift: Any = None
    between: Any = None  # ``operator`` between two bodies, shape (n d, m d); None: it is that of ``shares``

    @classmethod
    def at_nodes(cls, nodes: npt.NDArray[np.int64], x: _Floats, fixed: npt.NDArray[np.bool_]) -> Averages:
        """Of points that take the displacement of their nodes."""
        itself = sp.eye_array(nodes.size, format="csr")
        return cls(itself, nodes, x, fixed, lift=itself)

    @classmethod
    def joined(cls, parts: list[Averages]) -> Averages:
        """Those of several contact boundaries."""
        if len(parts) == 1:
            return parts[0]
        shares = sp.block_diag([part.shares for part in parts], format="csr")
        nodes, x, fixed = (np.concatenate([getattr(part, name) for part in parts]) for name in ("nodes", "x", "fixed"))
        if not any(part.paired for part in parts):
            return cls(shares, nodes, x, fixed)
        operators = [part.operator for part in parts]
        centre, lifts = np.concatenate([part.arm for part in parts]), [part.lift for part in parts]
        lift = None if any(matrix is None for matrix in lifts) else sp.block_diag(lifts, format="csr")
        between = sp.block_diag(operators, format="csr")
        return cls(shares, nodes, x, fixed, centre, lift, between)

    @property
    def paired(self) -> bool:
        """Whether points are those of two bodies, which turn relative to each other."""
        return self.between is not None

    @property
    def arm(self) -> _Floats:
        """Where the force of each point acts on the body of its node, length, shape (n, d)."""
        return np.asarray(self.shares @ self.x) if self.centre is None else self.centre

    @cached_property
    def operator(self) -> Any:
        """From displacements of nodes to those at the points, in the axes of space, scipy sparse, shape (n d, m d)."""
        if self.between is not None:
            return self.between
        return sp.csr_array(sp.kron(self.shares, sp.eye_array(self.x.shape[1]), format="csr"))

    def any_of(self, flags: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Whether any node of a point has a flag, from shape (m, k) to shape (n, k)."""
        return np.asarray(abs(self.shares) @ flags.astype(np.float64) > 0)


def averaging(space: fem.FunctionSpace) -> bool:
    """Whether the contact points of displacements in a space average: on quadratic tetrahedra."""
    return space.element.basix_element.degree == 2 and space.mesh.topology.cell_name() == "tetrahedron"


def from_owners(owned_rows: _Floats, nodes: npt.NDArray[Any], comm: MPI.Comm) -> _Floats:
    """Rows of ``owned_rows``, which has one per owned node, for global numbers of nodes; collective."""
    if comm.size == 1:
        return np.array(owned_rows[nodes], dtype=np.float64)
    column = PETSc.Vec().createMPI((len(owned_rows), None), comm=comm)
    rows = np.empty((nodes.size, owned_rows.shape[1]))
    places = PETSc.IS().createGeneral(nodes.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
    received = PETSc.Vec().createSeq(nodes.size, comm=PETSc.COMM_SELF)
    scatter = PETSc.Scatter().create(column, places, received, None)
    for k in range(owned_rows.shape[1]):
        column.getArray()[:] = owned_rows[:, k]
        scatter.scatter(column, received)
        rows[:, k] = received.getArray(readonly=True)
    return rows


def to_owners(values: _Floats, nodes: npt.NDArray[Any], comm: MPI.Comm, owned: int) -> _Floats:
    """Sums of rows for global numbers of nodes over all ranks, at the owned nodes, shape (owned, k); collective."""
    column = PETSc.Vec().createMPI((owned, None), comm=comm)
    sums = np.empty((owned, values.shape[1]))
    for k in range(values.shape[1]):
        column.set(0.0)
        column.setValues(nodes.astype(PETSc.IntType), values[:, k], addv=PETSc.InsertMode.ADD_VALUES)
        column.assemble()
        sums[:, k] = column.getArray(readonly=True)
    return sums
