"""Contact points that average the displacement around them: those of elements without a positive rule at their nodes.

The basis functions of the vertices of a quadratic triangle integrate to zero, so that the nodal rule of ``forms.py``
gives them no weight.  There the contact points are the vertices alone, lambda and mu are linear on each facet, and

    w_i = (phi_i, 1),    y_i = (phi_i, y) / w_i    with phi_i the linear hat function of vertex i

are the weight of a point and the displacement that contact sees there: (lambda, z) = sum_i w_i lambda_i z_i.  All w_i
are positive, tractions that are linear on each facet load the body as they should, and a gap is averaged in the same
way as the displacement that it is compared with (Puso, Laursen, Solberg, Comput. Methods Appl. Mech. Engrg. 197 (2008)
555-566, for two bodies).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
import ufl
from dolfinx import default_scalar_type, fem
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx import compat
from signorini_fx.body import forms
from signorini_fx.body.assembly import assemble, measure
from signorini_fx.records import Inventory

_Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Averages:
    """How n contact points of this rank average over m nodes, which other ranks may own.

    Attributes:
        shares: share of each node in each point, rows with the sum one, scipy sparse, shape (n, m).
        nodes: global numbers of the nodes, shape (m,); a node of two contact boundaries is there twice.
        x: their positions, length, shape (m, d).
        fixed: which displacement components are prescribed at them, shape (m, d).
    """

    shares: Any
    nodes: npt.NDArray[np.int64]
    x: _Floats
    fixed: npt.NDArray[np.bool_]

    @classmethod
    def joined(cls, parts: list[Averages]) -> Averages:
        """Those of several contact boundaries."""
        shares = sp.block_diag([part.shares for part in parts], format="csr")
        rest = (np.concatenate([getattr(part, name) for part in parts]) for name in ("nodes", "x", "fixed"))
        return cls(shares, *rest)

    def any_of(self, flags: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Whether any node of a point has a flag, from shape (m, k) to shape (n, k)."""
        return np.asarray(abs(self.shares) @ flags.astype(np.float64) > 0)


@dataclass(frozen=True)
class AveragingForms:
    """The compiled forms of one contact boundary.

    Attributes:
        hats: the space of the hat functions.
        products: (phi_i, psi_j) of hat and basis functions.
        moments: (phi_i, n).
    """

    hats: fem.FunctionSpace
    products: fem.Form
    moments: fem.Form


def averaging(space: fem.FunctionSpace) -> bool:
    """Whether the contact points of displacements in a space average: on quadratic tetrahedra."""
    return space.element.basix_element.degree == 2 and space.mesh.topology.cell_name() == "tetrahedron"


def averaging_forms(
    space: fem.FunctionSpace, facets: npt.NDArray[np.int32], inventory: Inventory, name: str, factor: Any = None
) -> AveragingForms:
    """Compile what the points of one boundary need; ``factor``: of the surface measure."""
    mesh = space.mesh
    dim, degree = mesh.geometry.dim, space.element.basix_element.degree
    ds = measure(mesh, [facets], forms.nodal_rule(degree, compat.geometry_degree(mesh), dim))(1)
    hats = fem.functionspace(mesh, ("Lagrange", 1))
    scalar = fem.functionspace(mesh, ("Lagrange", degree))
    phi, psi = ufl.TestFunction(hats), ufl.TrialFunction(scalar)
    z = ufl.TestFunction(fem.functionspace(mesh, ("Lagrange", 1, (dim,))))
    one = fem.Constant(mesh, default_scalar_type(1.0)) if factor is None else factor
    weighted = psi if factor is None else factor * psi
    products = inventory.compile(f"{name}, averages", partial(fem.form, forms.average_form(weighted, phi, ds)))
    moments = inventory.compile(name, partial(fem.form, forms.contact_form(one, z, ufl.FacetNormal(mesh), ds)))
    return AveragingForms(hats, products, moments)


def averaged_points(
    space: fem.FunctionSpace, compiled: AveragingForms, fixed: npt.NDArray[np.bool_]
) -> tuple[npt.NDArray[np.int32], _Floats, _Floats, Averages]:
    """The points of one boundary; collective.

    Args:
        space: the displacements.
        compiled: see ``averaging_forms``.
        fixed: which dofs of this rank are prescribed, shape (owned dofs,).

    Returns:
        Local numbers of the vertices among the nodes of ``space``, shape (n,), weights, shape (n,), the integrals of
        hat function times normal, shape (n, d), and how the points average.
    """
    dim = space.mesh.geometry.dim
    products = fem_petsc.assemble_matrix(compiled.products)
    products.assemble()
    starts, columns, values = products.getValuesCSR()
    moments = assemble(compiled.moments).reshape(-1, dim)
    rows = sp.csr_array((values, columns, starts), shape=(len(starts) - 1, products.getSize()[1]))
    rows.eliminate_zeros()  # the nodes of the cells that are not on the boundary
    weight = np.asarray(rows.sum(axis=1)).ravel()
    node = _vertex_nodes(space, compiled.hats)[: weight.size]
    points = np.flatnonzero(weight > 0)
    own = rows[points]
    nodes = np.unique(own.indices)
    values = own.data / np.repeat(weight[points], np.diff(own.indptr))
    places = np.searchsorted(nodes, own.indices)
    shares = sp.csr_array((values, places, own.indptr), shape=(points.size, nodes.size))
    x = space.tabulate_dof_coordinates()[: fixed.size // dim, :dim]
    known = np.column_stack((x, fixed.reshape(-1, dim))).astype(np.float64)
    there = from_owners(known, nodes, space.mesh.comm)
    averages = Averages(shares, nodes.astype(np.int64), there[:, :dim], there[:, dim:] > 0)
    return node[points], weight[points], moments[points], averages


def _vertex_nodes(space: fem.FunctionSpace, hats: fem.FunctionSpace) -> npt.NDArray[np.int32]:
    """The local node of ``space`` at each local hat function: vertices come first in every cell."""
    corners = hats.dofmap.list
    found = np.zeros(hats.dofmap.index_map.size_local + hats.dofmap.index_map.num_ghosts, dtype=np.int32)
    found[corners] = space.dofmap.list[:, : corners.shape[1]]
    return found


def from_owners(known: _Floats, nodes: npt.NDArray[Any], comm: MPI.Comm) -> _Floats:
    """Rows of ``known``, which has one per owned node, for global numbers of nodes; collective."""
    column = PETSc.Vec().createMPI((len(known), None), comm=comm)
    found = np.empty((nodes.size, known.shape[1]))
    places = PETSc.IS().createGeneral(nodes.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
    received = PETSc.Vec().createSeq(nodes.size, comm=PETSc.COMM_SELF)
    scatter = PETSc.Scatter().create(column, places, received, None)
    for k in range(known.shape[1]):
        column.getArray()[:] = known[:, k]
        scatter.scatter(column, received)
        found[:, k] = received.getArray(readonly=True)
    return found
