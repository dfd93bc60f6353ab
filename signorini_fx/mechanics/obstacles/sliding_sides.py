"""The contact points of two sides that slide on each other: at the displacement of now, see ``pairs.sliding``."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from dolfinx import fem

from signorini_fx.errors import FormError
from signorini_fx.mechanics.assembly.averages import Averages, from_owners
from signorini_fx.mechanics.assembly.nodal_stiffness import JointStiffness
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.obstacles.paired_points import FacingSides
from signorini_fx.mechanics.pairs.search import default_reach
from signorini_fx.mechanics.pairs.sliding import Frames, SlidingCoupling, along_vectors, slide
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


@dataclass
class MovingPair:
    """The two sides of a pair, and where they are.

    Attributes:
        sides: both, undeformed.
        displacement: of the nodes of both, length, shape (m, d).
        coupling: the map there.
        settled: the displacement at the end of the last step.
        begun: which nodes the points met there.
        allowance: what is added to the gap, at the owned nodes of the space, length, shape (owned nodes,).
    """

    sides: SlidingSides
    displacement: Array = field(init=False)
    coupling: SlidingCoupling = field(init=False)
    settled: Array = field(init=False)
    begun: Frames = field(init=False)
    allowance: Array = field(init=False)

    def __post_init__(self) -> None:
        self.displacement = np.zeros((self.sides.nodes.size, self.sides.slave.surface.dimension))
        self.coupling = self.sides.at(self.displacement)
        self.allowance = np.zeros(self.sides.space.dofmap.index_map.size_local)
        self.settle()

    def move(self, u: fem.Function) -> None:
        """Renew the map at a displacement; a PairingError: a facet sees two sheets of the other side; collective."""
        owned = u.function_space.dofmap.index_map.size_local
        displacement = self.sides.gathered(u.x.array.reshape(-1, self.displacement.shape[1])[:owned])
        if not np.array_equal(displacement, self.displacement):
            self.coupling, self.displacement = self.sides.at(displacement), displacement

    def settle(self) -> None:
        """A step begins here."""
        self.settled, self.begun = self.displacement, self.coupling.frames

    def boundary(self) -> ContactBoundary:
        """The contact points of this rank."""
        return self.sides.boundary(self.coupling)

    def gap(self, coupling: SlidingCoupling) -> Array:
        """The distance of all points, where they see no other side the reach, length, shape (n,)."""
        return np.where(coupling.frames.partnered, coupling.gap, self.sides.reach)

    def slip(self, coupling: SlidingCoupling) -> Array:
        """The slip of all points since the step has begun, length, shape (n, d - 1)."""
        count, slave, master = self.sides.slave.nodes.size, self.sides.slave.surface.x, self.sides.master.surface.x
        places = slave + self.settled[:count], master + self.settled[count:]
        return coupling.slip(coupling.started(self.begun, *places))

    @property
    def alone(self) -> npt.NDArray[np.bool_]:
        """Which of the points of this rank do not see the other side, shape (n,)."""
        return np.asarray(~self.coupling.frames.partnered[self.sides.mine])

    @property
    def opening(self) -> Array:
        """The linearised gap of the points at the displacement, length, shape (n,)."""
        relative = self.coupling.normal_rows @ self.displacement.ravel()
        return np.asarray(self.gap(self.coupling) + relative)[self.sides.mine]

    @property
    def slip_origin(self) -> Array:
        """Where the slip of the points counts from, length, shape (n, d)."""
        slip = self.slip(self.coupling)
        along = (self.coupling.tangent_rows @ self.displacement.ravel()).reshape(slip.shape)
        return self.sides.sliding_along(self.coupling, along - slip)

    def stiffness(self, state: ContactState) -> JointStiffness:
        """What the tractions of a state add to the tangent, see ``SlidingCoupling``; collective."""
        rows, sides = np.flatnonzero(state.boundary.part == self.sides.index), self.sides
        shear = np.einsum("nik,nk->ni", state.boundary.tangents[rows], state.shear[rows])
        along = np.einsum("ndk,nd->nk", self.coupling.frames.tangents, sides.at_points(shear))
        return JointStiffness(sides.nodes, self.coupling.stiffness(sides.at_points(state.pressure[rows]), along))

    @property
    def parted(self) -> str:
        """The place of a point that saw the other side as the step began, if none sees it any more; else ""."""
        left = np.flatnonzero(self.begun.partnered)
        if self.coupling.frames.partnered.any() or not left.size:
            return ""
        place = self.coupling.slave.x[self.sides.points[left[0]]]
        return f"contact[{self.sides.index}], at ({', '.join(f'{component:.4g}' for component in place)})"

    @property
    def rotation(self) -> Array:
        """That of the frames of the points of this rank since the step has begun, shape (n, d, d), in 2D of no account:
        in a plane of symmetry, where neither half turns about the normal alone, about the direction across it.
        """
        if self.displacement.shape[1] == 2:
            return np.eye(2)
        frames, start = (
            np.concatenate((_normals_of(frames.tangents)[:, :, None], self._tangents(frames)), axis=2)
            for frames in (self.coupling.frames, self.begun)
        )
        return np.asarray(np.einsum("nik,njk->nij", frames, start))[self.sides.mine]

    def _tangents(self, frames: Frames) -> Array:
        """Those of frames in 3D, in a plane of symmetry along it and across it, shape (n, 3, 2)."""
        tangents, planes = frames.tangents.copy(), self.sides.across
        held = np.flatnonzero(planes.any(axis=(1, 2)))
        normal, across = _normals_of(tangents[held]), np.linalg.eigh(planes[held])[1][:, :, -1]
        across -= np.sum(across * normal, axis=1, keepdims=True) * normal
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        tangents[held] = np.stack((across, np.cross(normal, across)), axis=2)
        return tangents


def _normals_of(tangents: Array) -> Array:
    """The normals that make frames of tangents in 3D, shape (n, 3)."""
    return np.asarray(np.cross(tangents[:, :, 0], tangents[:, :, 1]))
