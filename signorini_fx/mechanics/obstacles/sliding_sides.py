"""The contact points of two sides that slide on each other: at the displacement of now, see ``pairs.sliding``."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from signorini_fx.errors import FormError
from signorini_fx.mechanics.assembly.averages import Averages, from_owners
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.obstacles.paired_points import FacingSides
from signorini_fx.mechanics.pairs.search import default_reach
from signorini_fx.mechanics.pairs.sliding import SlidingCoupling, along_vectors, slide
from signorini_fx.mechanics.pairs.sparse_maps import beside

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int32]


@dataclass(frozen=True)
class SlidingSides(FacingSides):
    """Both sides of a pair that slide on each other, undeformed.

    Attributes:
        points: nodes of the slave that have a point, shape (n,).
        reach: distance beyond which facets are no partners, length.
    """

    points: npt.NDArray[np.int64]
    reach: float

    @classmethod
    def from_facing(cls, facing: FacingSides, reach: float | None) -> SlidingSides:
        """Two sides; ``reach``: distance beyond which facets are no partners, length; None: a default.

        Raises:
            FormError: the sides share nodes, or no node can carry a point.
        """
        name = f"contact[{facing.index}]"
        slave, master = facing.slave, facing.master
        if np.intersect1d(slave.nodes, master.nodes).size:
            raise FormError([(name, "its sides share nodes, and slide on each other: give parts that do not meet")])
        points = np.flatnonzero(~facing.unable & (slave.surface.area > 0.0) & ~slave.surface.without_area)
        if not points.size:
            raise FormError([(name, "other contacts own all nodes of its side: exchange facets and against")])
        if reach is None:
            reach = default_reach(slave.surface.x, master.surface.x)
        return cls(**facing.of_facing, points=points, reach=reach)

    @cached_property
    def mine(self) -> npt.NDArray[np.int64]:
        """Which of the points this rank owns."""
        first, last = self.space.dofmap.index_map.local_range
        names = self.slave.nodes[self.points]
        return np.flatnonzero((names >= first) & (names < last))

    def gathered(self, owned: Array) -> Array:
        """Rows of the owned nodes at the nodes of both sides, shape (m, k); collective."""
        return from_owners(owned, self.nodes, self.space.mesh.comm)

    def at(self, displacement: Array) -> SlidingCoupling:
        """The map at a displacement of the nodes of both sides, shape (m, d).

        Raises:
            PairingError: a facet sees two sheets of the other side.
        """
        on_slave, on_master = np.split(displacement, [self.slave.nodes.size])
        slave, master = self.slave.surface.displaced(on_slave), self.master.surface.displaced(on_master)
        return slide(slave, master, self.points, self.unable, self.reach, self.held)

    def local_points(self) -> Indices:
        """Local numbers of the nodes of the points of this rank."""
        return self.local(self.points[self.mine])

    @cached_property
    def across(self) -> Array:
        """Projectors onto the directions across planes of symmetry at the points, shape (n, d, d)."""
        return np.asarray(self.slave.surface.across[self.points])

    def _sliding(self, coupling: SlidingCoupling) -> Array:
        """Tangents without what they have across planes of symmetry, as nothing slides there, shape (n, d, d - 1)."""
        tangents = coupling.frames.tangents
        return np.asarray(tangents - np.einsum("nij,njk->nik", self.across, tangents))

    def boundary(self, coupling: SlidingCoupling) -> ContactBoundary:
        """The contact points of this rank; those without a partner do not move, and those in a plane of symmetry not
        across it.
        """
        mine, dim, normal = self.mine, self.slave.surface.dimension, coupling.normal[self.mine]
        rows_of_tangents = ((dim - 1) * mine[:, None] + np.arange(dim - 1)).ravel()
        normal_rows, tangent_rows = coupling.normal_rows[mine], coupling.tangent_rows[rows_of_tangents]
        moved = beside(coupling.frames.slave, -coupling.frames.master)[mine]
        inward = along_vectors(normal[:, :, None]), along_vectors(self._sliding(coupling)[mine])
        along = inward[0].T @ normal_rows + inward[1].T @ tangent_rows
        x = np.concatenate((self.slave.surface.x, self.master.surface.x))
        averages = Averages(moved, self.nodes, x, self.fixed, centre=coupling.centre[mine], between=sp.csr_array(along))
        translation = np.tile(np.eye(dim), (len(self.slave.nodes), 1))  # of the slave alone
        pushing = np.asarray(normal_rows[:, : len(translation)] @ translation)
        points = self.points_at(
            self.points[mine], averages, weight=coupling.weight[mine], normal=normal, pushing=pushing
        )
        partnered = coupling.frames.partnered
        counted = partnered | ~partnered.any()
        return replace(points, free=points.free & counted[mine, None])

    def sliding_along(self, coupling: SlidingCoupling, slip: Array) -> Array:
        """Slips along T_i of the points of all ranks, shape (n, d - 1), as vectors without what nothing slides along,
        at those of this rank, shape (n, d).
        """
        return np.asarray(np.einsum("ndk,nk->nd", self._sliding(coupling), slip))[self.mine]

    def at_points(self, values: Array) -> Array:
        """Values at the points of this rank, shape (n, ...), at those of all ranks; collective."""
        columns = values.reshape(len(values), int(np.prod(values.shape[1:])))
        owned = np.zeros((self.space.dofmap.index_map.size_local, columns.shape[1]))
        owned[self.local_points()] = columns
        gathered = from_owners(owned, self.slave.nodes[self.points], self.space.mesh.comm)
        return gathered.reshape(len(gathered), *values.shape[1:])

    def at_owned_nodes(self, values: Array) -> Array:
        """Values at the nodes of both sides, shape (m, d), at the owned nodes of the space, shape (owned nodes, d)."""
        first, last = self.space.dofmap.index_map.local_range
        at_owned, is_owned = np.zeros((last - first, values.shape[1])), (self.nodes >= first) & (self.nodes < last)
        at_owned[self.nodes[is_owned] - first] = values[is_owned]
        return at_owned
