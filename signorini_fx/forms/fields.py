"""What contact does to the body as Functions, which UFL can go on with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from dolfinx import fem, la

from signorini_fx.mechanics.body.contact_state import ContactState
from signorini_fx.mechanics.body.node_positions import node_positions


@dataclass(frozen=True)
class ContactFields:
    """Functions on the mesh of the body, zero at nodes that are no contact points; updated by every solve.

    On quadratic tetrahedra, whose contact points are the vertices, they are linear.

    Attributes:
        pressure: lambda, stress, scalar.
        shear: mu, stress, a vector: the foundation acts on the body with - lambda n - mu.
        gap: what is left of the gap, d - tau_N y, length, scalar; zero in contact but for the regularisation.
        slip: tau_T y since the last ``advance``, length, a vector.
    """

    pressure: fem.Function
    shear: fem.Function
    gap: fem.Function
    slip: fem.Function

    @classmethod
    def on(cls, space: fem.FunctionSpace, degree: int) -> ContactFields:
        """Zero, for displacements in a space."""
        mesh = space.mesh
        scalar = fem.functionspace(mesh, ("Lagrange", degree))
        same_degree = degree == space.element.basix_element.degree
        vector = space if same_degree else fem.functionspace(mesh, ("Lagrange", degree, (mesh.geometry.dim,)))
        makes = {"pressure": scalar, "shear": vector, "gap": scalar, "slip": vector}
        return cls(**{name: fem.Function(where, name=name) for name, where in makes.items()})

    def take(
        self, space: fem.FunctionSpace, state: ContactState, selected: npt.NDArray[np.bool_] | None = None
    ) -> None:
        """The values of a state; collective.

        Args:
            space: the displacements, whose nodes the points are numbered by.
            state: of the contact points of this rank.
            selected: the points to take, shape (n,); None: all.  Of a node of two contacts the later one is taken.
        """
        where = slice(None) if selected is None else selected
        tangents, cotangents = state.boundary.tangents, state.boundary.cotangents
        values = {
            "pressure": state.pressure[:, None],
            "shear": np.einsum("ijk,ik->ij", tangents, state.shear),
            "gap": (state.gap - state.u_n)[:, None],
            "slip": np.einsum("ijk,ik->ij", cotangents, state.slip_length),
        }
        for name, point_values in values.items():
            function: fem.Function = getattr(self, name)
            nodes = function.function_space.dofmap.list
            numbering = np.zeros(node_positions(space).shape[0], dtype=np.int64)
            numbering[space.dofmap.list[:, : nodes.shape[1]]] = nodes  # vertices come first in every cell
            array = function.x.array
            array[:] = 0.0
            array.reshape(-1, point_values.shape[1])[numbering[state.boundary.nodes[where]]] = point_values[where]
            function.x.scatter_reverse(la.InsertMode.add)  # the owner of a vertex need not be that of the point
            function.x.scatter_forward()
