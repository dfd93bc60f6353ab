"""Contact points that average the displacement around them: those of elements without a positive rule at their nodes.

The basis functions of the vertices of a quadratic triangle integrate to zero, so that ``quadrature.nodal_rule``
gives them no weight.  There the contact points are the vertices alone, and

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

import basix
import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
import ufl
from dolfinx import default_scalar_type, fem
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.machine import compat
from signorini_fx.mechanics.assembly.mesh_entities import (
    assemble,
    compile_form,
    facet_entities,
    measure,
    node_positions,
)
from signorini_fx.mechanics.assembly.quadrature import nodal_rule
from signorini_fx.tuned import NOTHING_LEFT

_Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Averages:
    """How n contact points of this rank average over m nodes, which other ranks may own.

    Attributes:
        shares: share of each node in each point, rows with the sum one, scipy sparse, shape (n, m).
        nodes: global numbers of the nodes, shape (m,); a node of two contact boundaries is there twice.
        x: their positions, length, shape (m, d).
        fixed: which displacement components are prescribed at them, shape (m, d).
        centre: where the force of each point acts on the body of its node, length, shape (n, d); None: at the average
            of the nodes.
        lift: displacements of some nodes, all along one direction, that move the points by one each, scipy sparse,
            shape (m, n); None: not known.
        between: ``operator`` between two bodies, scipy sparse, shape (n d, m d); None: it is that of ``shares``.
    """

    shares: Any
    nodes: npt.NDArray[np.int64]
    x: _Floats
    fixed: npt.NDArray[np.bool_]
    centre: _Floats | None = None
    lift: Any = None
    between: Any = None

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
        from signorini_fx.mechanics.pairs.sparse_maps import of_components

        return of_components(self.shares, self.x.shape[1])

    def any_of(self, flags: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Whether any node of a point has a flag, from shape (m, k) to shape (n, k)."""
        return np.asarray(abs(self.shares) @ flags.astype(np.float64) > 0)


@dataclass(frozen=True)
class AveragingForms:
    """The compiled forms of one contact boundary.

    Attributes:
        hats: the space of the hat functions.
        corners: the same functions, discontinuous between cells.
        parts: the facets by their numbers in the cells that they are of: cells, shape (f,).
        products: of each of them, the integrals of the hat functions of each cell times the basis functions.
        moments: (phi_i, n).
    """

    hats: fem.FunctionSpace
    corners: fem.FunctionSpace
    parts: list[npt.NDArray[np.int32]]
    products: list[fem.Form]
    moments: fem.Form


def averaging(space: fem.FunctionSpace) -> bool:
    """Whether the contact points of displacements in a space average: on quadratic tetrahedra."""
    return space.element.basix_element.degree == 2 and space.mesh.topology.cell_name() == "tetrahedron"


def averaging_forms(space: fem.FunctionSpace, facets: npt.NDArray[np.int32], factor: Any = None) -> AveragingForms:
    """Compile what the points of one boundary need; ``factor``: of the surface measure."""
    mesh = space.mesh
    dim, degree = mesh.geometry.dim, space.element.basix_element.degree
    rule = nodal_rule(degree, compat.geometry_degree(mesh), dim)
    hats, corners = (fem.functionspace(mesh, (family, 1)) for family in ("Lagrange", "DG"))
    scalar = fem.functionspace(mesh, ("Lagrange", degree))
    phi, y = ufl.TestFunction(corners), ufl.TrialFunction(scalar)
    z = ufl.TestFunction(fem.functionspace(mesh, ("Lagrange", 1, (dim,))))
    pressure = fem.Constant(mesh, default_scalar_type(1.0)) if factor is None else factor
    weighted = y if factor is None else factor * y
    entities = facet_entities(mesh, facets)
    # Two facets of a cell have functions of their own: one form for each number, the same code for all.
    numbers = [np.flatnonzero(entities[:, 1] == number) for number in range(dim + 1)]
    measures = [measure(mesh, [facets[rows]], rule)(1) for rows in numbers]
    products = [compile_form(ufl.inner(weighted, phi) * ds) for ds in measures]
    ds = measure(mesh, [facets], rule)(1)
    moments = compile_form(pressure * ufl.inner(z, ufl.FacetNormal(mesh)) * ds)
    return AveragingForms(hats, corners, [entities[rows, 0] for rows in numbers], products, moments)


def averaged_points(
    space: fem.FunctionSpace, compiled: AveragingForms, fixed: npt.NDArray[np.bool_]
) -> tuple[npt.NDArray[np.int32], _Floats, _Floats, Averages]:
    """The points of one boundary: local numbers of the vertices among the nodes of ``space``, shape (n,), weights,
    shape (n,), the integrals of hat function times normal, shape (n, d), and how the points average; ``fixed``: which
    dofs of this rank are prescribed, shape (owned dofs,); collective.
    """
    dim = space.mesh.geometry.dim
    products = _dual_products(space, compiled)
    starts, columns, values = products.getValuesCSR()
    moments = assemble(compiled.moments).reshape(-1, dim)
    rows = sp.csr_array((values, columns, starts), shape=(len(starts) - 1, products.getSize()[1]))
    rows.eliminate_zeros()  # the nodes of the cells that are not on the boundary
    weight = np.asarray(rows.sum(axis=1)).ravel()
    corners, hats = compiled.hats.dofmap.list, compiled.hats.dofmap.index_map
    node = np.zeros(hats.size_local + hats.num_ghosts, dtype=np.int32)
    node[corners] = space.dofmap.list[:, : corners.shape[1]]  # vertices come first in every cell
    points = np.flatnonzero(weight > 0)
    point_rows = rows[points]
    nodes = np.unique(point_rows.indices)
    values = point_rows.data / np.repeat(weight[points], np.diff(point_rows.indptr))
    places = np.searchsorted(nodes, point_rows.indices)
    shares = sp.csr_array((values, places, point_rows.indptr), shape=(points.size, nodes.size))
    x = node_positions(space)[: fixed.size // dim, :dim]
    owned_rows = np.column_stack((x, fixed.reshape(-1, dim))).astype(np.float64)
    reached_rows = from_owners(owned_rows, nodes, space.mesh.comm)
    averages = Averages(shares, nodes.astype(np.int64), reached_rows[:, :dim], reached_rows[:, dim:] > 0)
    return node[points], weight[points], moments[points], averages


def _dual_products(space: fem.FunctionSpace, compiled: AveragingForms) -> PETSc.Mat:
    """(psi_i, N_j) of dual and basis functions, a row for each hat function, a column for each node; collective."""
    element, hats = space.element.basix_element, compiled.hats.element.basix_element
    maps = [part.dofmap.index_map for part in (compiled.hats, space)]
    matrix = PETSc.Mat().create(comm=space.mesh.comm)
    matrix.setSizes([(index_map.size_local, None) for index_map in maps])
    matrix.setType(PETSc.Mat.Type.AIJ)
    numbers = [part.local_to_global(np.arange(part.size_local + part.num_ghosts)) for part in maps]
    matrix.setLGMap(*(PETSc.LGMap().create(part.astype(PETSc.IntType), comm=space.mesh.comm) for part in numbers))
    matrix.setUp()  # collective, which the ranks with facets must not begin on their own
    for number, (cells, form) in enumerate(zip(compiled.parts, compiled.products, strict=True)):
        assembled = fem.assemble_matrix(form).to_scipy(ghosted=True)  # on all ranks
        if cells.size == 0:
            continue
        vertices = np.array(basix.topology(element.cell_type)[-2][number])
        closure = np.array(space.dofmap.dof_layout.entity_closure_dofs(space.mesh.topology.dim - 1, number))
        corner_dofs, facet_dofs = compiled.corners.dofmap.list[cells][:, vertices], space.dofmap.list[cells][:, closure]
        shape = (len(cells), vertices.size, closure.size)
        at = [np.broadcast_to(index, shape) for index in (corner_dofs[:, :, None], facet_dofs[:, None])]
        product = np.asarray(assembled[at[0].ravel(), at[1].ravel()]).reshape(shape)
        # The hat functions from their values at the nodes of the facet.
        values_there = hats.tabulate(0, element.points[closure])[0, :, vertices, 0]
        mass = product @ values_there.T
        dual = product.sum(axis=2)[:, :, None] * (np.linalg.pinv(mass, rcond=NOTHING_LEFT, hermitian=True) @ product)
        places = compiled.hats.dofmap.list[cells][:, vertices], facet_dofs
        indices = (np.ascontiguousarray(dofs, dtype=PETSc.IntType) for dofs in places)
        matrix.setValuesLocalRCV(*indices, np.ascontiguousarray(dual), PETSc.InsertMode.ADD_VALUES)
    matrix.assemble()
    return matrix


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
