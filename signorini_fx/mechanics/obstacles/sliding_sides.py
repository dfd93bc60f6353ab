"""The contact points of two sides that slide on each other: at the displacement of now, see ``pairs.sliding``."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from dolfinx import fem
from mpi4py import MPI

from signorini_fx.errors import FormError
from signorini_fx.mechanics.assembly.averages import Averages, from_owners
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary, segments_of
from signorini_fx.mechanics.obstacles.paired_points import FacingSides, PairedSide
from signorini_fx.mechanics.pairs.dual_functions import HeldSides
from signorini_fx.mechanics.pairs.pair_side import PairSurface
from signorini_fx.mechanics.pairs.search import default_reach
from signorini_fx.mechanics.pairs.sliding import SlidingCoupling, along_vectors, slide
from signorini_fx.mechanics.pairs.sparse_scaling import beside

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int32]


@dataclass(frozen=True)
class SlidingSides:
    """Both sides of a pair, undeformed, the same on every rank.

    Attributes:
        space: of the displacement.
        slave: the side with the points.
        master: the other one.
        points: its nodes that have a point, numbers of the side, shape (n,).
        unable: its nodes that cannot carry one, as another contact owns them, shape (N,).
        held: nodes that supports hold along the undeformed normals.
        reach: distance beyond which facets are no partners, length.
        fixed: which components are prescribed at the nodes of both sides, shape (m, d).
        facets: of the slave, owned, local numbers.
        index: of the pair among the contacts.
    """

    space: fem.FunctionSpace
    slave: PairedSide
    master: PairedSide
    points: npt.NDArray[np.int64]
    unable: npt.NDArray[np.bool_]
    held: HeldSides
    reach: float
    fixed: npt.NDArray[np.bool_]
    facets: Indices
    index: int

    @classmethod
    def of(cls, space: fem.FunctionSpace, reach: float | None, facing: FacingSides, index: int) -> SlidingSides:
        """Two parts of the boundary; collective.

        Args:
            space: of the displacement.
            reach: distance beyond which facets are no partners, length; None: a default.
            facing: both sides.
            index: of the pair among the contacts.

        Raises:
            FormError: the sides share nodes, or no node can carry a point.
        """
        name = f"contact[{index}]"
        slave, master = facing.slave, facing.master
        if np.intersect1d(slave.nodes, master.nodes).size:
            raise FormError([(name, "its sides share nodes, and slide on each other: give parts that do not meet")])
        points = np.flatnonzero(~facing.unable & (slave.surface.area > 0.0) & ~slave.surface.without_area)
        if not points.size:
            raise FormError([(name, "other contacts own all nodes of its side: exchange facets and against")])
        if reach is None:
            reach = default_reach(slave.surface.x, master.surface.x)
        return cls(space, slave, master, points, facing.unable, facing.held, reach, facing.fixed, slave.facets, index)

    @cached_property
    def nodes(self) -> npt.NDArray[np.int64]:
        """Global numbers of the nodes of both sides, those of the slave first, shape (m,)."""
        return np.concatenate((self.slave.nodes, self.master.nodes))

    @property
    def comm(self) -> MPI.Comm:
        """The ranks that share the body."""
        comm: MPI.Comm = self.space.mesh.comm
        return comm

    @cached_property
    def mine(self) -> npt.NDArray[np.int64]:
        """Which of the points this rank owns."""
        first, last = self.space.dofmap.index_map.local_range
        names = self.slave.nodes[self.points]
        return np.flatnonzero((names >= first) & (names < last))

    def gathered(self, owned: Array) -> Array:
        """Rows of the owned nodes at the nodes of both sides, shape (m, k); collective."""
        return from_owners(owned, self.nodes, self.comm)

    def at(self, displacement: Array) -> SlidingCoupling:
        """The map at a displacement of the nodes of both sides, shape (m, d).

        Raises:
            PairingError: a facet sees two sheets of the other side.
        """
        return slide(*self._displaced(displacement), self.points, self.unable, self.reach, self.held)

    def _displaced(self, displacement: Array) -> tuple[PairSurface, PairSurface]:
        """Both sides at a displacement."""
        count = self.slave.nodes.size
        return self.slave.surface.displaced(displacement[:count]), self.master.surface.displaced(displacement[count:])

    def local_points(self) -> npt.NDArray[np.int32]:
        """Local numbers of the nodes of the points of this rank."""
        names = self.slave.nodes[self.points[self.mine]]
        return (names - self.space.dofmap.index_map.local_range[0]).astype(np.int32)

    @cached_property
    def _segments(self) -> npt.NDArray[np.int64]:
        return segments_of(self.space, self.facets, self.index, vertices=False)

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
        mine, count, dim = self.mine, self.mine.size, self.slave.surface.dimension
        across, normal = self.across[mine], coupling.normal[mine]
        moved = beside(coupling.frames.slave, -coupling.frames.master)
        normal_rows, tangent_rows = coupling.normal_rows, coupling.tangent_rows
        if count < self.points.size:
            rows_of_tangents = ((dim - 1) * mine[:, None] + np.arange(dim - 1)).ravel()
            moved, normal_rows, tangent_rows = moved[mine], normal_rows[mine], tangent_rows[rows_of_tangents]
        inward = along_vectors(normal[:, :, None]), along_vectors(self._sliding(coupling)[mine])
        along = inward[0].T @ normal_rows + inward[1].T @ tangent_rows
        x = np.concatenate((self.slave.surface.x, self.master.surface.x))
        averages = Averages(moved, self.nodes, x, self.fixed, centre=coupling.centre[mine], between=sp.csr_array(along))
        partnered = coupling.frames.partnered
        counted = partnered | ~partnered.any()
        free = averages.any_of(~self.fixed) & counted[mine, None]
        free &= np.einsum("nii->ni", across) < 0.5
        translation = np.tile(np.eye(dim), (len(self.slave.nodes), 1))  # of the slave alone
        pushing = np.asarray(normal_rows[:, : len(translation)] @ translation)
        return ContactBoundary(
            comm=self.comm,
            nodes=self.local_points(),
            x=self.slave.surface.x[self.points[mine]],
            weight=coupling.weight[mine],
            normal=normal,
            part=np.full(count, self.index, dtype=np.int32),
            free=free,
            segments=self._segments,
            global_nodes=self.slave.nodes[self.points[mine]],
            averages=averages,
            pushing=pushing,
        )

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
        gathered = from_owners(owned, self.slave.nodes[self.points], self.comm)
        return gathered.reshape(len(gathered), *values.shape[1:])

    def at_owned_nodes(self, values: Array) -> Array:
        """Values at the nodes of both sides, shape (m, d), at the owned nodes of the space, shape (owned nodes, d)."""
        first, last = self.space.dofmap.index_map.local_range
        at_owned, is_owned = np.zeros((last - first, values.shape[1])), (self.nodes >= first) & (self.nodes < last)
        at_owned[self.nodes[is_owned] - first] = values[is_owned]
        return at_owned
