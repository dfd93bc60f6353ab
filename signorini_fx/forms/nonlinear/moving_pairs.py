"""Two bodies that slide on each other: a pair at the displacement of now, and where its step has begun."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from dolfinx import fem
from dolfinx import mesh as dmesh

from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.nodal_stiffness import JointStiffness
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.obstacles.paired_points import PairedSides
from signorini_fx.mechanics.obstacles.sliding_sides import SlidingSides
from signorini_fx.mechanics.pairs.sliding import Frames, SlidingCoupling, along_vectors
from signorini_fx.records import Finding
from signorini_fx.tuned import FACETS_OF_KEPT_PARTNERS

Array = npt.NDArray[np.float64]


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

    @property
    def alone(self) -> npt.NDArray[np.bool_]:
        """Which of the points of this rank do not see the other side, shape (n,)."""
        return np.asarray(~self.coupling.frames.partnered[self.sides.mine])

    @property
    def opening(self) -> Array:
        """The linearised gap of the points at the displacement, length, shape (n,)."""
        coupling = self.coupling
        gap = np.where(coupling.frames.partnered, coupling.gap, self.sides.reach)
        return np.asarray(gap + coupling.normal_rows @ self.displacement.ravel())[self.sides.mine]

    @property
    def slip_origin(self) -> Array:
        """Where the slip of the points counts from, length, shape (n, d)."""
        coupling, count = self.coupling, self.sides.slave.nodes.size
        slave, master = self.sides.slave.surface.x, self.sides.master.surface.x
        slip = coupling.slip(coupling.started(self.begun, slave + self.settled[:count], master + self.settled[count:]))
        along = (coupling.tangent_rows @ self.displacement.ravel()).reshape(slip.shape)
        return self.sides.sliding_along(coupling, along - slip)

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


def turned_forces(state: ContactState, paired: PairedSides, displacement: Array) -> JointStiffness:
    """What displacements of the owned nodes change of the contact forces of a pair as normals turn, which is not
    symmetric, and its transpose; ``paired``: both sides where they are undeformed; collective.
    """
    boundary, averages, dim = state.boundary, state.boundary.averages, displacement.shape[1]
    assert averages is not None
    points = np.flatnonzero(boundary.part == paired.index)
    normal, weight = boundary.normal[points], boundary.weight[points, None, None]
    shear = np.einsum("nik,nk->ni", boundary.tangents[points], state.shear[points])
    # Tangents turn against normals.
    tractions = state.pressure[points, None, None] * np.eye(dim) - normal[:, :, None] * shear[:, None]
    components = np.arange(dim)
    operator = sp.csr_array(averages.operator)[(dim * points[:, None] + components).ravel()]
    forces = along_vectors((weight * tractions).swapaxes(1, 2)) @ paired.turning(displacement)
    entries = sp.coo_array(operator.T @ forces)
    rows, columns = ((dim * nodes[:, None] + components).ravel() for nodes in (averages.nodes, paired.master.nodes))
    of_rank = rows[entries.row], columns[entries.col], entries.data
    row, column, value = (np.concatenate(part) for part in zip(*boundary.comm.allgather(of_rank), strict=True))
    unknowns = np.stack((row, column))
    reached = np.unique(unknowns // dim)
    places = np.searchsorted(reached, unknowns // dim) * dim + unknowns % dim
    matrix = sp.coo_array((value, (places[0], places[1])), shape=(dim * reached.size, dim * reached.size))
    return JointStiffness(reached, sp.csr_array(matrix + matrix.T))


def slid_past_partners(state: ContactState, sides: Mapping[int, float]) -> list[Finding]:
    """A warning for each pair whose touching points have moved farther along the other side than partners may be kept;
    ``sides``: the mean size of facets of the first side of each, length, by the number of the contact; collective.
    """
    findings, boundary = list[Finding](), state.boundary
    for number, facet in sides.items():
        touching = (boundary.part == number) & state.in_contact
        farthest = parallel.largest(boundary.comm, np.linalg.norm(state.u_t[touching], axis=1), 0.0)
        if farthest > FACETS_OF_KEPT_PARTNERS * facet:
            message = (
                f"points that keep their partners have moved by up to {farthest:.3g} along the other side, "
                f"{farthest / facet:.2g} facets: forces there may be wrong, and those on both sides act apart: let the "
                "sides slide"
            )
            findings.append(Finding("warning", f"contact[{number}].sliding", message))
    return findings


def facet_size(mesh: dmesh.Mesh, facets: npt.NDArray[np.int32]) -> float:
    """The mean size of facets of all ranks, length; collective.  ``facets``: local numbers."""
    dim = mesh.topology.dim - 1
    mesh.topology.create_connectivity(dim, mesh.topology.dim)
    owned = facets[facets < mesh.topology.index_map(dim).size_local]
    sums = np.array([mesh.h(dim, owned).sum(), owned.size], dtype=np.float64)
    total, count = parallel.global_sum(mesh.comm, sums)
    return float(total / max(count, 1.0))
