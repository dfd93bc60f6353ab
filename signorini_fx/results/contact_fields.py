"""Contact pressure, shear, gap and slip as Functions for use in UFL: on the mesh of the body, and
on a mesh of the contact boundary.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import fem, la
from dolfinx import mesh as dmesh

from signorini_fx.arrays import Flags, Indices, matvec
from signorini_fx.machine import compat
from signorini_fx.mechanics.assembly.averages import averaging
from signorini_fx.mechanics.assembly.mesh_entities import facet_nodes, node_positions
from signorini_fx.mechanics.contact_points.contact_state import ContactState


@dataclass(frozen=True)
class ContactFields:
    """Functions on the mesh of the body, zero at nodes that are no contact points; updated by every
    solve.

    On quadratic tetrahedra, whose contact points are the vertices, they are linear.

    Attributes:
        pressure: lambda, stress, scalar.
        shear: mu, stress, a vector: the foundation acts on the body with - lambda n - mu.
        gap: the current gap d - tau_N y, length, scalar; zero in contact except for the
            regularisation.
        slip: tau_T y since the last ``advance``, length, a vector.
    """

    pressure: fem.Function
    shear: fem.Function
    gap: fem.Function
    slip: fem.Function

    @classmethod
    def on(cls, space: fem.FunctionSpace) -> ContactFields:
        """Return zero fields for displacements in a function space."""
        mesh = space.mesh
        degree = 1 if averaging(space) else int(space.element.basix_element.degree)
        scalar = fem.functionspace(mesh, ("Lagrange", degree))
        same_degree = degree == space.element.basix_element.degree
        vector = (
            space
            if same_degree
            else fem.functionspace(mesh, ("Lagrange", degree, (mesh.geometry.dim,)))
        )
        makes = {"pressure": scalar, "shear": vector, "gap": scalar, "slip": vector}
        return cls(**{name: fem.Function(where, name=name) for name, where in makes.items()})

    def take(
        self,
        space: fem.FunctionSpace,
        state: ContactState | None,
        selected: Flags | None = None,
    ) -> None:
        """Copy the nodal values of a contact state into the fields, or zero without a state.
        Collective.

        Args:
            space: the function space of the displacement.
            state: the contact state of this rank.
            selected: which points to copy, shape (n,); None for all.  At a node of two contacts the
                later one counts.
        """
        if state is None:
            for field in (self.pressure, self.shear, self.gap, self.slip):
                field.x.array[:] = 0.0
            return
        where = state.boundary.at_nodes & (True if selected is None else selected)
        tangents = state.boundary.tangents
        cotangents = state.boundary.cotangents
        values = {
            "pressure": state.pressure[:, None],
            "shear": matvec(tangents, state.shear),
            "gap": (state.gap - state.u_n)[:, None],
            "slip": matvec(cotangents, state.slip_length),
        }
        for name, point_values in values.items():
            function = getattr(self, name)
            nodes = function.function_space.dofmap.list
            numbering = np.zeros(node_positions(space).shape[0], dtype=np.int64)
            numbering[space.dofmap.list[:, : nodes.shape[1]]] = (
                nodes  # vertices come first in every cell
            )
            array = function.x.array
            array[:] = 0.0
            array.reshape(-1, point_values.shape[1])[numbering[state.boundary.nodes[where]]] = (
                point_values[where]
            )
            function.x.scatter_reverse(
                la.InsertMode.add
            )  # the owner of a vertex need not be that of the point
            function.x.scatter_forward()


@dataclass(frozen=True, kw_only=True)
class BoundaryFields(ContactFields):
    """The Functions of ``ContactFields`` on a mesh of the contact boundary.

    Attributes:
        mesh: mesh of the facets, of one dimension less than the body, in the same space; it is
            shared by the same ranks, of which some may have no cell.
        facets: local number of the facet of the body for each cell on this rank, ghosts included.
    """

    mesh: dmesh.Mesh
    facets: Indices


def boundary_fields(
    space: fem.FunctionSpace,
    state: ContactState,
    facets: Sequence[Indices],
    number: int | None,
) -> BoundaryFields:
    """Return the fields of a state on a mesh of its contact boundaries, see
    ``Solution.boundary_fields``.  Collective.

    Args:
        space: the function space of the displacement.
        state: the contact state of this rank.
        facets: local numbers of the facets of each contact whose cell this rank owns; of pairs
            those on the side with the points.
        number: the contact to take, from 0; None for all.
    """
    if number is not None and not 0 <= number < len(facets):
        raise ValueError(
            f"number: must be from 0 to {len(facets) - 1}, the contacts in their order, got "
            f"{number}"
        )
    fields = ContactFields.on(space)
    fields.take(space, state, None if number is None else state.boundary.part == number)
    wanted = np.unique(np.concatenate(list(facets) if number is None else [facets[number]]))
    mesh, cells = compat.facet_mesh(space.mesh, wanted)
    made: dict[str, fem.Function] = {}
    for name in ("pressure", "shear", "gap", "slip"):
        function = getattr(fields, name)
        parent = function.function_space
        size = function.function_space.dofmap.index_map_bs
        shape = (size,) if function.ufl_shape else ()
        part = fem.functionspace(mesh, ("Lagrange", parent.element.basix_element.degree, shape))
        made[name] = fem.Function(part, name=name)
        nodes = _nodes_of_parent(part, parent, cells)
        values = made[name].x.array
        values.reshape(-1, size)[part.dofmap.list] = function.x.array.reshape(-1, size)[nodes]
        made[name].x.scatter_forward()  # ghost cells
    return BoundaryFields(mesh=mesh, facets=cells, **made)


def _nodes_of_parent(
    part: fem.FunctionSpace, parent: fem.FunctionSpace, facets: Indices
) -> Indices:
    """Return the node of the parent space at each node of each cell of ``part``, shape (cells,
    nodes of a cell).

    Nodes are matched by position, because their order in facets differs between cells.
    """
    parent_nodes = facet_nodes(parent, facets)
    part_nodes = part.dofmap.list
    if facets.size == 0:
        return np.zeros_like(part_nodes)
    sought = np.asarray(part.tabulate_dof_coordinates())[part_nodes]
    distances = np.linalg.norm(
        sought[:, :, None] - node_positions(parent)[parent_nodes][:, None], axis=3
    )
    return np.take_along_axis(parent_nodes, np.argmin(distances, axis=2), axis=1)
