"""The contact boundary: its nodes with weights and directions, and the traces tau_N y and tau_T y.

With the nodal rule of ``forms.py`` the products on Gamma_c are sums over nodes,
(lambda, tau_N z) = sum_i w_i lambda_i n_i . z_i.  A node belongs to the rank that owns its degrees of freedom; that
rank may own none of the facets around it.  A node of two contact boundaries is two entries here, one for each normal.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from signorini_fx import parallel

Nodal = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ContactBoundary:
    """The contact nodes of this rank, n of them.

    Attributes:
        comm: the ranks that share the boundary.
        nodes: local number of the node (block of the function space), shape (n,).
        x: position, length, shape (n, 2).
        weight: w_i, the length (per unit thickness: area) that the node stands for, shape (n,).
        normal: outward unit normal n_i, shape (n, 2).
        part: position of the effect in ``scene.contact`` that the node belongs to, shape (n,).
        free: which displacement components are not prescribed, shape (n, 2).
        segments: facets of this rank: the part, then global node numbers in order along the facet, shape
            (facets, degree + 2).
        global_nodes: global number of the node, shape (n,).
    """

    comm: MPI.Comm
    nodes: npt.NDArray[np.int32]
    x: Nodal
    weight: Nodal
    normal: Nodal
    part: npt.NDArray[np.int32]
    free: npt.NDArray[np.bool_]
    segments: npt.NDArray[np.int64]
    global_nodes: npt.NDArray[np.int64]

    @property
    def size(self) -> int:
        """Number of contact nodes on this rank."""
        return int(self.nodes.size)

    @property
    def tangent(self) -> Nodal:
        """Unit tangent t_i = (-n_2, n_1), shape (n, 2): for a body above its foundation it points along x[0]."""
        return np.column_stack((-self.normal[:, 1], self.normal[:, 0]))

    def traces(self, y: Nodal) -> tuple[Nodal, Nodal]:
        """(tau_N y, tau_T y) from nodal displacements of shape (n, 2)."""
        return np.einsum("ij,ij->i", y, self.normal), np.einsum("ij,ij->i", y, self.tangent)

    def nodal_forces(self, pressure: Nodal, shear: Nodal) -> Nodal:
        """Nodal w (lambda n + mu t), shape (n, 2): (lambda, tau_N .) + (mu, tau_T .), minus of which loads the body."""
        return (self.weight * pressure)[:, None] * self.normal + (self.weight * shear)[:, None] * self.tangent

    def norm(self, values: Nodal) -> float:
        """The norm of L2(Gamma_c) by the nodal rule, collective."""
        return float(np.sqrt(parallel.global_sum(self.comm, np.dot(self.weight, values**2))))


def join(parts: list[ContactBoundary]) -> ContactBoundary:
    """Several contact boundaries as one list of nodes."""
    fields: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("nodes", "x", "weight", "normal", "part", "free", "segments", "global_nodes")
    }
    return ContactBoundary(parts[0].comm, **fields)
