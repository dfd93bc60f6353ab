"""The contact points of a pair of bodies: both sides as surfaces for ``pairs``, and its coupling as a boundary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import basix
import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from dolfinx import fem
from mpi4py import MPI

from signorini_fx.errors import FormError
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.averages import Averages, from_owners
from signorini_fx.mechanics.assembly.mesh_entities import facet_entities, facet_nodes, node_positions
from signorini_fx.mechanics.assembly.nodal_stiffness import JointStiffness
from signorini_fx.mechanics.assembly.quadrature import lumped_degree
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary, segments_of
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.contact_points.turned_supports import TurnedNodes
from signorini_fx.mechanics.interfaces import Pair
from signorini_fx.mechanics.obstacles.mirrored_points import mirrored
from signorini_fx.mechanics.pairs.dual_functions import HeldSides
from signorini_fx.mechanics.pairs.mortar_coupling import (
    Coupling,
    PairingError,
    Tested,
    couple,
    normals_of_points,
)
from signorini_fx.mechanics.pairs.pair_side import Lagrange, Overlap, PairSurface
from signorini_fx.mechanics.pairs.sliding import along_vectors
from signorini_fx.mechanics.pairs.sparse_maps import beside, of_blocks, of_components, turned_normals
from signorini_fx.tuned import ROOT_OF_EPS, SAME_NUMBER

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int32]


@dataclass(frozen=True)
class PairedSide:
    """Facets of the body as a surface, the same on every rank but for ``facets``.

    Attributes:
        surface: with nodes numbered from 0.
        nodes: global number of each of them in the space, ascending, shape (N,).
        facets: those of this rank, local numbers.
    """

    surface: PairSurface
    nodes: npt.NDArray[np.int64]
    facets: Indices

    @classmethod
    def of(cls, space: fem.FunctionSpace, facets: Indices) -> PairedSide:
        """Those facets of all ranks; collective.  Positions interpolate those of the nodes of the displacement."""
        mesh, dim, element = space.mesh, space.mesh.topology.dim, space.element.basix_element
        kind = basix.cell.subentity_types(element.cell_type)[dim - 1][0]
        places = basix.create_element(element.family, kind, element.degree, element.lagrange_variant).points
        x, node_table = node_positions(space)[:, :dim], facet_nodes(space, facets)
        names = space.dofmap.index_map.local_to_global(node_table.ravel()).reshape(node_table.shape)
        middles = x[space.dofmap.list[facet_entities(mesh, facets)[:, 0]]].mean(axis=1)
        names, positions, middles = (parallel.gather_rows(mesh.comm, rows) for rows in (names, x[node_table], middles))
        nodes, first, numbers = np.unique(names, return_index=True, return_inverse=True)
        x = np.array(positions.reshape(-1, dim)[first], dtype=np.float64)
        numbers, none, ones = (
            numbers.reshape(names.shape).astype(np.int64),
            np.zeros((len(x), dim, dim)),
            np.ones(len(names)),
        )
        surface = PairSurface(numbers, x, Lagrange(places), ones, none)
        at = np.broadcast_to(places.mean(axis=0), (len(names), 1, dim - 1))
        away = surface.corners.mean(axis=1) - middles
        sign = np.sign(np.einsum("fd,fd->f", surface.normals(np.arange(len(names)), at)[:, 0], away))
        surface = replace(surface, sign=sign)
        return cls(surface, nodes.astype(np.int64), facets)

    def measured(self, space: fem.FunctionSpace, factor: Array | None) -> PairSurface:
        """The surface with a factor of the measure at all nodes of this rank, shape (nodes,), None: 1; collective."""
        if factor is None:
            return self.surface
        owned = np.nan_to_num(factor[: space.dofmap.index_map.size_local, None])
        return replace(self.surface, measure=from_owners(owned, self.nodes, space.mesh.comm)[:, 0])


def averaged_points(
    space: fem.FunctionSpace, facets: Indices, factor: Array | None, fixed: npt.NDArray[np.bool_]
) -> tuple[tuple[Indices, Array, Array], Averages]:
    """The points of a rigid foundation on a side whose dual functions average, see ``averages``: local numbers of their
    nodes, weights and normals, and how they average; collective.

    Args:
        space: the displacements.
        facets: owned, local numbers.
        factor: of the measure, at all nodes of this rank, shape (nodes,); None: 1.
        fixed: which dofs of this rank are prescribed, shape (owned dofs,).
    """
    comm, dim, side = space.mesh.comm, space.mesh.topology.dim, PairedSide.of(space, facets)
    surface = side.measured(space, factor)
    numbers = np.arange(len(surface.nodes))
    points, weights = surface.functions.rule(
        lumped_degree(surface.functions.degree, compat.geometry_degree(space.mesh))
    )
    at = np.broadcast_to(points, (numbers.size, *points.shape))
    itself = Overlap(numbers, numbers, at, at, surface.sizes(numbers, at) * weights).measured(surface)
    tested = Tested.of(surface, itself, MPI.COMM_SELF, bonded=False)
    area, (first, last) = tested.areas(surface, MPI.COMM_SELF), space.dofmap.index_map.local_range
    mine = np.flatnonzero((area > 0) & (side.nodes >= first) & (side.nodes < last))
    shares = sp.csr_array(sp.diags_array(1.0 / area[mine]) @ tested.products(surface, surface)[0][mine])
    reached = np.unique(shares.indices)
    held = from_owners(fixed.reshape(-1, dim).astype(np.float64), side.nodes[reached], comm) > 0
    averages = Averages(shares[:, reached], side.nodes[reached], surface.x[reached], held)
    return ((side.nodes[mine] - first).astype(np.int32), area[mine], surface.nodal_normals[mine]), averages


def held_along(normal: Array, frames: Array, fixed: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Which nodes supports hold along a direction: no component that is free has any of it, shape (n,).

    Args:
        normal: shape (n, d).
        frames: that the components are told in, one direction per column, shape (n, d, d).
        fixed: which of them are prescribed, shape (n, d).
    """
    sizes = np.abs(np.einsum("nij,ni->nj", frames, normal))
    return np.asarray(np.where(fixed, 0.0, sizes).max(axis=1, initial=0.0) <= ROOT_OF_EPS)


@dataclass(frozen=True)
class FacingSides:
    """Both sides of a pair, undeformed and the same on every rank, and what supports prescribe there.

    Attributes:
        space: the displacements.
        index: of the pair among the contacts.
        slave: the side with the contact points.
        master: the other one.
        unable: nodes of the slave that cannot carry a point, as another contact or the other side owns them, shape
            (N,).
        fixed: which components are prescribed at the nodes of both sides, those of the slave first, shape (m, d).
        held: nodes that are held along their normals.
        axes: the frames of the nodes of the slave that supports hold them in, shape (N, d, d); None: the axes of space.
    """

    space: fem.FunctionSpace
    index: int
    slave: PairedSide
    master: PairedSide
    unable: npt.NDArray[np.bool_]
    fixed: npt.NDArray[np.bool_]
    held: HeldSides
    axes: Array | None

    @classmethod
    def of(
        cls,
        space: fem.FunctionSpace,
        facets: tuple[Indices, Indices],
        index: int,
        fixed: npt.NDArray[np.bool_],
        taken: Sequence[Indices],
        turned: TurnedNodes | None = None,
        at_rest: npt.NDArray[np.bool_] | None = None,
        factor: Array | None = None,
    ) -> FacingSides:
        """Two parts of the boundary; collective.

        Args:
            space: the displacements.
            facets: of the slave and of the master, owned, local numbers.
            index: of the pair among the contacts.
            fixed: which displacement components are prescribed at the owned nodes, shape (owned nodes, d).
            taken: facets of other contacts, whose nodes carry no points of this one.
            turned: nodes for which ``fixed`` is told in their own frames; None: there are none.
            at_rest: which of the components ``fixed`` are zero at all times, shape (owned nodes, d); None: none.
            factor: of the measure, at all nodes of this rank, shape (nodes,); None: 1.

        Raises:
            FormError: the sides are curved and the displacement is linear.
        """
        if compat.geometry_degree(space.mesh) > space.element.basix_element.degree:
            raise FormError([(f"contact[{index}]", "two bodies with curved cells need a space of degree 2")])
        comm, dim, owned = space.mesh.comm, space.mesh.topology.dim, len(fixed)
        slave, master = (PairedSide.of(space, entries) for entries in facets)
        taken_nodes = np.zeros(owned, dtype=bool)
        for taken_facets in (*taken, facets[1]):
            reached = fem.locate_dofs_topological(space, dim - 1, taken_facets)
            taken_nodes[reached[reached < owned]] = True
        at_rest = np.zeros_like(fixed) if at_rest is None else at_rest
        owned_rows = np.column_stack((fixed, at_rest, taken_nodes)).astype(np.float64)

        def told(side: PairedSide) -> tuple[Array, npt.NDArray[np.bool_]]:
            """Frames of the nodes of a side, shape (N, d, d), and what is known there, shape (N, 2 d + 1)."""
            frames: Array = np.tile(np.eye(dim), (side.nodes.size, 1, 1))
            if turned is not None:
                owned_frames = turned.frames_at(np.arange(owned)).reshape(owned, dim**2)
                frames = from_owners(owned_frames, side.nodes, comm).reshape(frames.shape)
            return frames, from_owners(owned_rows, side.nodes, comm) > 0

        (frames, entries), (axes, reached) = told(slave), told(master)
        rests = (frames, entries[:, dim:-1]), (axes, reached[:, dim:-1])
        measures = [side.measured(space, factor).measure for side in (slave, master)]
        slave = replace(slave, surface=replace(slave.surface, measure=measures[0]))
        on_axis = [None if measure is None else measure <= SAME_NUMBER * measure.max() for measure in measures]
        across = (
            mirrored(slave.surface, master.surface, rests, on_axis[0]),
            mirrored(master.surface, slave.surface, (rests[1], rests[0]), on_axis[1]),
        )
        slave, master = (
            replace(side, surface=replace(side.surface, across=planes))
            for side, planes in zip((slave, master), across, strict=True)
        )
        normals = slave.surface.directions
        supported = held_along(normals, frames, entries[:, :dim]) & normals.any(axis=1)
        held = HeldSides(supported, held_along(master.surface.directions, axes, reached[:, :dim]))
        unable, fixed = entries[:, -1], np.concatenate((entries[:, :dim], reached[:, :dim]))
        return cls(space, index, slave, master, unable, fixed, held, None if turned is None else frames)

    @property
    def of_facing(self) -> dict[str, Any]:
        """What is known before both sides are paired, by name."""
        return {field.name: getattr(self, field.name) for field in fields(FacingSides)}

    @cached_property
    def nodes(self) -> npt.NDArray[np.int64]:
        """Global numbers of the nodes of both sides, those of the slave first, shape (m,)."""
        return np.concatenate((self.slave.nodes, self.master.nodes))

    def local(self, nodes: npt.NDArray[np.int64]) -> Indices:
        """Local numbers of nodes of the slave that this rank owns."""
        return np.asarray(self.slave.nodes[nodes] - self.space.dofmap.index_map.local_range[0], dtype=np.int32)

    @cached_property
    def _segments(self) -> npt.NDArray[np.int64]:
        functions, tests = self.slave.surface.functions, self.slave.surface.tests
        vertices = len(tests.places) < len(functions.places)
        return segments_of(self.space, self.slave.facets, self.index, vertices=vertices)

    def points_at(self, nodes: npt.NDArray[np.int64], averages: Averages, **of_points: Any) -> ContactBoundary:
        """The contact points at nodes of the slave that this rank owns, which do not move across a plane of symmetry;
        ``of_points``: what else is known of them.
        """
        x, axes = self.slave.surface.x[nodes], None if self.axes is None else self.axes[nodes]
        across, free = self.slave.surface.across[nodes], np.ones(x.shape, dtype=bool)
        if axes is None:
            free = averages.any_of(~averages.fixed)
        else:
            across = np.einsum("nji,njk,nkl->nil", axes, across, axes)
        return ContactBoundary(
            comm=self.space.mesh.comm,
            nodes=self.local(nodes),
            x=x,
            part=np.full(nodes.size, self.index, dtype=np.int32),
            free=free & (np.einsum("nii->ni", across) < 0.5),
            segments=self._segments,
            global_nodes=self.slave.nodes[nodes],
            averages=averages,
            axes=axes,
            **of_points,
        )


@dataclass(frozen=True)
class PairedSides(FacingSides):
    """Both sides of a pair, and what joins them.

    Attributes:
        coupling: of both.
        by_geometry: whether the gap is the distance of both sides.
        adjust: up to which distance the sides count as closed, length; None: nowhere.
        followed: whether the normals are those of the deformed sides, with which distances turn; else it is the
            coupling that tells how distances turn.
    """

    coupling: Coupling
    by_geometry: bool
    adjust: float | None = None
    followed: bool = False

    @classmethod
    def from_facing(cls, facing: FacingSides, pair: Pair) -> PairedSides:
        """Pair two sides; collective.

        Raises:
            FormError: the sides do not fit together.
        """
        slave, master, comm = facing.slave, facing.master, facing.space.mesh.comm
        first, last = facing.space.dofmap.index_map.local_range
        mine = (slave.nodes >= first) & (slave.nodes < last)
        try:
            coupling = couple(
                slave.surface,
                master.surface,
                facing.unable,
                facing.held,
                bonded=pair.bonded,
                nominal=not pair.by_geometry,
                reach=pair.reach,
                comm=comm,
                mine=mine,
            )
        except PairingError as error:
            raise FormError([(f"contact[{facing.index}]", str(error))]) from None
        return cls(**facing.of_facing, coupling=coupling, by_geometry=pair.by_geometry, adjust=pair.adjust)

    @property
    def undeformed_normals(self) -> Array:
        """Normals of the points where both sides are undeformed, shape (n, d)."""
        coupling, surfaces = self.coupling, (self.slave.surface, self.master.surface)
        shares = coupling.slave, coupling.master
        return normals_of_points(surfaces, coupling.nodes, shares, nominal=not self.by_geometry)

    def deformed(self, displacement: Array) -> PairedSides:
        """The same points and partners, with normals that turn as those of the master do at the partners; collective.
        ``displacement``: of the owned nodes, length, shape (owned nodes, d).
        """
        normal, start = self.undeformed_normals, self.master.surface
        master = start.displaced(from_owners(displacement, self.master.nodes, self.space.mesh.comm))
        initial, present = (self._at_partners(side) for side in (start, master))
        initial, present = (vectors / np.linalg.norm(vectors, axis=1, keepdims=True) for vectors in (initial, present))
        bisector, share = initial + present, 1.0 + np.sum(initial * present, axis=1, keepdims=True)
        along, initial_part = (np.sum(vectors * normal, axis=1, keepdims=True) for vectors in (bisector, initial))
        normal = normal - along / share * bisector + 2.0 * initial_part * present
        return replace(self, coupling=replace(self.coupling, normal=normal), followed=True)

    def turning(self, displacement: Array) -> sp.csr_array:
        """How further displacements of the nodes of the master turn the normals of ``deformed``, as if these were
        opposite to its own, sparse, shape (n d, d M); collective.

        Between the vertices of quadratic triangles normals are means, whose turning is left out.
        """
        coupling = self.coupling
        master = self.master.surface.displaced(from_owners(displacement, self.master.nodes, self.space.mesh.comm))
        sums, identity = self._at_partners(master), np.eye(coupling.normal.shape[1])
        size = np.linalg.norm(sums, axis=1)[:, None, None]
        present = sums / size[:, 0]
        turned = (present[:, :, None] * present[:, None] - identity) @ (identity - self.across) / size
        nodal = of_components(coupling.master, len(identity)) @ turned_normals(master)
        return sp.csr_array(along_vectors(turned.transpose(0, 2, 1)) @ nodal)

    def _at_partners(self, master: PairSurface) -> Array:
        """Sums of the normals of the master at the partners of the points, shape (n, d): those of both halves beside a
        plane of symmetry have nothing across it.
        """
        sums = self.coupling.master @ master.directions
        return np.asarray(sums - np.einsum("nij,nj->ni", self.across, sums))

    @property
    def across(self) -> Array:
        """Projectors onto the directions across planes of symmetry at the points, shape (n, d, d)."""
        return np.asarray(self.slave.surface.across[self.coupling.nodes])

    @cached_property
    def relative(self) -> sp.csr_array:
        """The relative displacement from that of the nodes of both sides, shape (n d, m d), without what ``mirrored``
        leaves out.
        """
        coupling = self.coupling
        relative = of_components(beside(coupling.slave, -coupling.master), self.slave.surface.dimension)
        if not self.followed:
            relative = relative + coupling.turning
        if self.across.any():
            relative = relative - of_blocks(self.across) @ relative
        return sp.csr_array(relative)

    def boundary(self) -> ContactBoundary:
        """The contact points of this rank; collective."""
        coupling, dim, relative = self.coupling, self.slave.surface.dimension, self.relative
        lift = coupling.lift(self.slave.surface).tocoo()
        reached = np.unique(np.concatenate((relative.indices // dim, lift.row)))
        components = (dim * reached[:, None] + np.arange(dim)).ravel()
        lifting = sp.csr_array((lift.data, (lift.row, lift.col)), shape=(self.nodes.size, coupling.nodes.size))
        averages = Averages(
            beside(coupling.slave, -coupling.master)[:, reached],
            self.nodes[reached],
            np.concatenate((self.slave.surface.x, self.master.surface.x))[reached],
            self.fixed[reached],
            coupling.centre,
            lifting[reached],
            relative[:, components],
        )
        return self.points_at(coupling.nodes, averages, weight=coupling.weight, normal=coupling.normal)


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
