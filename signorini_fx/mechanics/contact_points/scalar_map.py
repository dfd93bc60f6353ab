"""The map from nodal scalars, such as temperatures, to contact points, and its transpose."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from dolfinx import fem
from petsc4py import PETSc

from signorini_fx.arrays import Array, Flags, Ints
from signorini_fx.errors import FormError
from signorini_fx.mechanics.assembly.averages import from_owners, to_owners
from signorini_fx.mechanics.assembly.mesh_entities import facet_nodes, marked_nodes
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary


@dataclass(frozen=True)
class ScalarMap:
    """The matrix B from values at nodes to the n contact points of this rank.

    Between two bodies, B gives the value on the side with the points minus that on the other side,
    so that its rows have the sum zero; on a foundation it gives the value of the body.  A flux of h
    per area and difference has the matrix B^T w h B.

    Attributes:
        boundary: the contact points.
        space: scalar space of the values, with the nodes of the displacement.

    Raises:
        FormError: the space has other nodes.
    """

    boundary: ContactBoundary
    space: fem.FunctionSpace

    def __post_init__(self) -> None:
        for displaced, *_ in self.boundary.surface:
            nodes = displaced.dofmap.list
            if self.space.dofmap.bs > 1 or not np.array_equal(self.space.dofmap.list, nodes):
                degree = displaced.element.basix_element.degree
                wrong = f"must be ('Lagrange', {degree}) on the mesh of the displacement"
                raise FormError.at("space", wrong)

    @property
    def rows(self) -> sp.csr_array:
        """The matrix B, shape (n, m)."""
        return sp.csr_array(self.boundary.averages.shares)

    @property
    def dofs(self) -> Ints:
        """The global number of each column of ``rows``, shape (m,)."""
        return self.boundary.averages.nodes

    @property
    def weight(self) -> Array:
        """The area (in 2D: length) of each point, shape (n,)."""
        return self.boundary.weight

    @cached_property
    def side(self) -> sp.csr_array:
        """The part of ``rows`` on the side of the contact points; collective."""
        on_side = sp.csr_array(self.rows.shape)
        for space, facets, number in self.boundary.surface:
            nodes = marked_nodes(space, facet_nodes(space, facets).ravel())
            of_part = sp.diags_array((self.boundary.part == number).astype(np.float64))
            on_side = on_side + of_part @ self.rows @ sp.diags_array(self.received(nodes))
        return sp.csr_array(on_side)

    def of(self, values: Array, rows: sp.csr_array | None = None) -> Array:
        """Return B times nodal values, shape (n,); collective.

        Args:
            values: at the nodes of this rank.
            rows: a matrix that replaces B, such as ``side``; None: B.
        """
        return np.asarray((self.rows if rows is None else rows) @ self.received(values))

    def received(self, values: Array | Flags) -> Array:
        """Return nodal values at the columns of ``rows``, also those that other ranks own, shape
        (m,); collective.

        Args:
            values: at the nodes of this rank.
        """
        owned = np.asarray(values, dtype=np.float64)[: self._owned, None]
        return from_owners(owned, self.dofs, self.boundary.comm)[:, 0]

    @property
    def _owned(self) -> int:
        return int(self.space.dofmap.index_map.size_local)

    def vector(self, density: Array, rows: sp.csr_array | None = None) -> Array:
        """Return B^T w q at the owned nodes, shape (owned nodes,); collective.

        Args:
            density: q at the points, per area, shape (n,).
            rows: a matrix that replaces B, such as ``side``; None: B.
        """
        rows = self.rows if rows is None else rows
        at_nodes = np.asarray(rows.T @ (self.weight * density))[:, None]
        return to_owners(at_nodes, self.dofs, self.boundary.comm, self._owned)[:, 0]

    def matrix(self, conductance: Array) -> PETSc.Mat:
        """Return the matrix B^T w h B; collective.

        Args:
            conductance: h at the points, shape (n,).
        """
        rows = self.rows
        product = sp.csr_array(rows.T @ sp.diags_array(self.weight * conductance) @ rows)
        dofs = self.dofs.astype(PETSc.IntType)
        matrix = PETSc.Mat().createAIJ(2 * ((self._owned, None),), comm=self.boundary.comm)
        matrix.setUp()
        matrix.setValuesIJV(
            product.indptr.astype(PETSc.IntType),
            dofs[product.indices],
            product.data,
            addv=PETSc.InsertMode.ADD_VALUES,
            rowmap=dofs,
        )
        matrix.assemble()
        return matrix
