"""The nodes of a body as certificates see them."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from mpi4py import MPI

from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.assembly.shared_cache import shared_in
from signorini_fx.results.certificate.rigid_part import RigidPart

Array = npt.NDArray[np.float64]


class BodyNodes:
    """The nodes of a vector Lagrange space.

    Args:
        space: of the displacement.

    Attributes:
        space: of the displacement.
        owned: number of nodes that this rank owns.
        dimension: d, of displacements.
    """

    def __init__(self, space: fem.FunctionSpace) -> None:
        self.space = space
        self.owned = int(space.dofmap.index_map.size_local)
        self.dimension = int(space.mesh.geometry.dim)
        self._of_mesh: dict[Any, Any] = {}

    @property
    def comm(self) -> MPI.Comm:
        """The ranks."""
        comm: MPI.Comm = self.space.mesh.comm
        return comm

    @shared_in("_of_mesh")
    def at_nodes(self) -> Array:
        """Positions of the nodes of this rank, length, shape (nodes, 3)."""
        return node_positions(self.space)

    @shared_in("_of_mesh")
    def pieces(self) -> RigidPart:
        """The pieces of the mesh; collective."""
        return RigidPart(self.space, self.at_nodes[: self.owned, : self.dimension])

    def zero(self) -> Array:
        """Zeros at the nodes of this rank, ghosts included, shape (n, d)."""
        return np.zeros((len(self.at_nodes), self.dimension))
