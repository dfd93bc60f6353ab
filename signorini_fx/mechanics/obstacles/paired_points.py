"""The contact points of a pair of bodies: both sides as surfaces for ``pairs``, and their map as a
boundary, made once or renewed at the present displacement.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import basix
import numpy as np
import scipy.sparse as sp
from dolfinx import fem
from scipy.spatial import cKDTree

from signorini_fx.arrays import Array, Flags, Indices, Ints, extents, inner, matvec, rmatvec
from signorini_fx.errors import FormError
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.averages import Averages, from_owners
from signorini_fx.mechanics.assembly.mesh_entities import (
    facet_cells,
    facet_nodes,
    lumped_degree,
    node_positions,
)
from signorini_fx.mechanics.assembly.nodal_stiffness import JointStiffness
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary, contact_part
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.contact_points.turned_supports import TurnedNodes
from signorini_fx.mechanics.interfaces import Pair
from signorini_fx.mechanics.pairs.mortar_coupling import Coupling, PairingError, Tested, couple
from signorini_fx.mechanics.pairs.pair_side import (
    ALONE,
    Lagrange,
    Overlap,
    PairSurface,
    Sharing,
    along_vectors,
    components,
    in_blocks,
    in_rows,
    turned_normals,
)
from signorini_fx.mechanics.pairs.search import default_reach
from signorini_fx.mechanics.pairs.sliding import SlidingCoupling, slide
from signorini_fx.mechanics.state import Field, State
from signorini_fx.tuned import ASKEW_NORMAL, DIGITS_OF_FILES, ROOT_OF_EPS, SAME_LENGTH, SAME_NUMBER


@dataclass(frozen=True)
class PairedSide:
    """Facets of the body as a surface that is the same on every rank, except for ``facets``.

    ``nodes``: global number of each node of the ``surface`` in the space, ascending, shape (N,);
    ``facets``: the facets of this rank, local numbers.
    """

    surface: PairSurface
    nodes: Ints
    facets: Indices

    @classmethod
    def of(cls, space: fem.FunctionSpace, facets: Indices, factor: Array | None) -> PairedSide:
        """Return the side that consists of these facets of all ranks; collective.

        Positions are interpolated at the nodes of the displacement.

        ``factor``: factor of the measure at all nodes of this rank, shape (nodes,); None: 1.
        """
        mesh = space.mesh
        dim = space.mesh.topology.dim
        element = space.element.basix_element
        kind = basix.cell.subentity_types(element.cell_type)[dim - 1][0]
        places = basix.create_element(
            element.family, kind, element.degree, element.lagrange_variant
        ).points
        x = node_positions(space)[:, :dim]
        node_table = facet_nodes(space, facets)
        names = space.dofmap.index_map.local_to_global(node_table.ravel()).reshape(node_table.shape)
        middles = x[space.dofmap.list[facet_cells(mesh, facets)]].mean(axis=1)
        names, positions, middles = (
            parallel.gather_rows(mesh.comm, rows) for rows in (names, x[node_table], middles)
        )
        nodes, first, numbers = np.unique(names, return_index=True, return_inverse=True)
        x = np.array(positions.reshape(-1, dim)[first], dtype=np.float64)
        measure = None
        if factor is not None:
            owned = np.nan_to_num(factor[: space.dofmap.index_map.size_local, None])
            measure = from_owners(owned, nodes, mesh.comm)[:, 0]
        numbers = numbers.reshape(names.shape).astype(np.int64)
        surface = PairSurface.of(numbers, x, Lagrange(places), np.ones(len(names)), measure)
        normals = surface.normals(np.arange(len(names)), places.mean(axis=0)[None, None])[:, 0]
        sign = np.sign(inner(normals, surface.corners.mean(axis=1) - middles))
        return cls(replace(surface, sign=sign), nodes.astype(np.int64), facets)

    def owned(self, space: fem.FunctionSpace) -> Flags:
        """Return the flags of the side's nodes that this rank owns, shape (N,)."""
        first, last = space.dofmap.index_map.local_range
        return (self.nodes >= first) & (self.nodes < last)

    def sharing(self, space: fem.FunctionSpace) -> Sharing:
        """Return the division between the ranks of a pair whose slave is this side; collective."""
        comm = space.mesh.comm
        if comm.size == 1:
            return ALONE
        ends = comm.allgather(space.dofmap.index_map.local_range[1])
        return Sharing(comm, np.searchsorted(ends, self.nodes, side="right"))


def averaged_points(
    space: fem.FunctionSpace,
    facets: Indices,
    factor: Array | None,
    fixed: Flags,
    gap: Array,
) -> tuple[tuple[Indices, Array, Array], Averages]:
    """Return the points of a rigid foundation on a side whose displacements are averaged;
    collective.

    Returns the local numbers of their nodes, weights and normals, and the averages, see
    ``averages``.

    Args:
        space: the space of displacements.
        facets: the facets of the side on this rank.
        factor: factor of the measure, see ``PairedSide.of``.
        fixed: flags of the owned dofs that are prescribed.
        gap: at all nodes of this rank, length, shape (nodes,).
    """
    comm = space.mesh.comm
    dim = space.mesh.topology.dim
    side = PairedSide.of(space, facets, factor)
    surface = side.surface
    numbers = np.arange(len(surface.nodes))
    points, weights = surface.functions.rule(
        lumped_degree(surface.functions.degree, compat.geometry_degree(space.mesh))
    )
    at = np.broadcast_to(points, (numbers.size, *points.shape))
    itself = Overlap(numbers, numbers, at, at, surface.sizes(numbers, at) * weights)
    owned_gap = np.nan_to_num(gap[: space.dofmap.index_map.size_local, None])
    gap_on_side = from_owners(owned_gap, side.nodes, comm)[:, 0]
    least = gap_on_side.min(initial=np.inf) - SAME_LENGTH * float(np.ptp(surface.x))

    def averaged(*, by_hats: bool) -> tuple[Ints, Array, Averages, Array]:
        """Return the numbers of the points on the side, their areas, averages and gaps."""
        tested = Tested(surface, surface, itself, by_hats)
        mine = np.flatnonzero((tested.areas > 0) & side.owned(space))
        own = sp.eye_array(len(surface.x), format="csr")[mine]
        shares = (tested.mean(own) @ tested.products())[:, : len(surface.x)]
        reached = np.unique(shares.indices)
        held = from_owners(fixed.reshape(-1, dim).astype(np.float64), side.nodes[reached], comm) > 0
        averages = Averages(shares[:, reached], side.nodes[reached], surface.x[reached], held)
        gaps = averages.of_gap(gap_on_side[mine], gap_on_side[reached])
        return mine, tested.areas[mine], averages, gaps

    mine, area, averages, gaps = averaged(by_hats=False)
    if parallel.any_rank(comm, gaps < least):
        mine, area, averages, gaps = averaged(by_hats=True)
    local = (side.nodes[mine] - space.dofmap.index_map.local_range[0]).astype(np.int32)
    return (local, area, surface.nodal_normals[mine]), averages


def held_along(normal: Array, frames: Array, fixed: Flags) -> Flags:
    """Return the flags of nodes that supports hold along their normals, shape (n,): the normal has
    no component along a free direction.

    Args:
        normal: unit normals, shape (n, d); zero where a node has none, which counts as not held.
        frames: directions of the supports at each node, one per column, shape (n, d, d).
        fixed: which of these directions are prescribed, shape (n, d).
    """
    sizes = np.abs(rmatvec(frames, normal))
    return (np.where(fixed, 0.0, sizes).max(axis=1) <= ROOT_OF_EPS) & normal.any(axis=1)


def mirrored(
    slave: PairSurface,
    master: PairSurface,
    at_rest: tuple[Array, Flags],
    opposite: tuple[Array, Flags],
) -> Array:
    """Return projectors onto the normals of planes of symmetry at the nodes of the slave, shape (N,
    d, d).

    A plane of symmetry, or an axis of revolution, is recognised where supports hold both bodies
    across it and neither side extends beyond.  The function of a point on it is even across it, the
    relative displacement across it is odd: their product integrates to zero over both halves, but
    not over one. So the point has no relative displacement and no traction across the plane, and
    its normal, the mean of those on both halves, is in the plane.  (Multipliers where Dirichlet
    conditions meet a mortar interface: Wohlmuth, SIAM J. Numer. Anal. 38 (2000) 989-1012; Puso and
    Laursen, Comput. Methods Appl. Mech. Engrg. 193 (2004) 601-629.)

    Args:
        slave: the side with the contact points.
        master: the opposite side.
        at_rest: a frame at each slave node, one direction per column, shape (N, d, d), and along
            which of these directions supports hold the node at zero, shape (N, d).
        opposite: the same for the nodes of the master.
    """
    frames, held = at_rest
    axes, master_held = opposite
    projectors = np.zeros_like(at_rest[0])
    nodes, columns = np.nonzero(held & slave.nodal_normals.any(axis=1, keepdims=True))
    across = frames[nodes, :, columns]
    along_side = np.abs(inner(slave.nodal_normals[nodes], across)) <= ASKEW_NORMAL
    if slave.measure is not None:  # the normal is along the axis also at the tip of a cone
        on_axis = slave.measure[nodes] <= SAME_NUMBER * slave.measure.max()
        along_side |= on_axis & (np.abs(across[:, 1:]).max(axis=1) <= ROOT_OF_EPS)
    nodes = nodes[along_side]
    across = across[along_side]
    if not nodes.size or not master_held.any():
        return projectors
    size = max(float(extents(side.corners).max()) for side in (slave, master))
    within = DIGITS_OF_FILES * size
    reach = size + cKDTree(master.x).query(slave.x[nodes])[0]
    _, first, direction = np.unique(
        np.round(across, 9), axis=0, return_index=True, return_inverse=True
    )
    for number, outward in enumerate(across[first]):
        along = np.einsum("nik,i->nk", axes, outward)
        held_across = np.linalg.norm(np.where(master_held, 0.0, along), axis=1) < DIGITS_OF_FILES
        for normal in (outward, -outward):  # both sides ahead, and both behind
            plane = (slave.x @ normal).min() + within
            partners = np.flatnonzero(held_across & (master.x @ normal <= plane))
            if partners.size and (master.x @ normal).min() >= plane - 2 * within:
                near = cKDTree(master.x[partners]).query(slave.x[nodes])[0] <= reach
                found = nodes[
                    near & (slave.x[nodes] @ normal <= plane) & (direction.ravel() == number)
                ]
                projectors[found] += np.outer(normal, normal)
    return projectors


@dataclass(frozen=True)
class FacingSides:
    """The two sides of a pair, undeformed and the same on every rank, and the displacement
    components that supports prescribe there.

    Attributes:
        space: the space of displacements.
        index: number of the pair among the contacts.
        slave: the side with the contact points.
        master: the opposite side.
        fixed: which components are prescribed at the nodes of both sides, those of the slave first,
            shape (m, d).
        turned: nodes whose supports are given in rotated frames; None: there are none.
    """

    space: fem.FunctionSpace
    index: int
    slave: PairedSide
    master: PairedSide
    fixed: Flags
    turned: TurnedNodes | None

    @classmethod
    def of(
        cls,
        space: fem.FunctionSpace,
        facets: tuple[Indices, Indices],
        index: int,
        fixed: Flags,
        taken: Sequence[Indices],
        turned: TurnedNodes | None,
        at_rest: Flags,
        factor: Array | None,
    ) -> FacingSides:
        """Return the two sides of a pair; collective.

        Args:
            space: the space of displacements.
            facets: facets of the slave and of the master, owned, local numbers.
            index: number of the pair among the contacts.
            fixed: which displacement components are prescribed at the owned nodes, shape (owned
                nodes, d).
            taken: facets of other contacts, whose nodes carry no points of this one.
            turned: nodes whose supports are given in rotated frames; None: there are none.
            at_rest: which components are held at zero at all times, shape (owned nodes, d).
            factor: factor of the measure at all nodes of this rank, shape (nodes,); None: 1.

        Raises:
            FormError: the geometry is of higher degree than the displacement.
        """
        if compat.geometry_degree(space.mesh) > space.element.basix_element.degree:
            raise FormError.at(
                f"contact[{index}]", "two bodies with curved cells need a space of degree 2"
            )
        comm = space.mesh.comm
        dim = space.mesh.topology.dim
        owned = len(fixed)
        sides = [PairedSide.of(space, entries, factor) for entries in facets]
        taken_nodes = np.zeros(owned, dtype=bool)
        # A rank may have facets of neither side.
        two = parallel.any_rank(comm, not np.array_equal(*facets))
        opposite = [facets[1]] if two else []
        for taken_facets in (*taken, *opposite):
            reached = fem.locate_dofs_topological(space, dim - 1, taken_facets)
            taken_nodes[reached[reached < owned]] = True
        axes = (
            np.tile(np.eye(dim), (owned, 1, 1))
            if turned is None
            else turned.frames_at(np.arange(owned))
        )
        owned_rows = np.column_stack(
            (axes.reshape(owned, dim**2), fixed, at_rest, taken_nodes)
        ).astype(np.float64)
        known = [from_owners(owned_rows, side.nodes, comm) for side in sides]
        frames = [rows[:, : dim**2].reshape(-1, dim, dim) for rows in known]
        flags = [rows[:, dim**2 :] > 0 for rows in known]
        rests = [(axes, entries[:, dim:-1]) for axes, entries in zip(frames, flags, strict=True)]
        surfaces = [side.surface for side in sides]
        across = [mirrored(surfaces[k], surfaces[1 - k], rests[k], rests[1 - k]) for k in range(2)]
        surfaces = [
            replace(surface, across=planes)
            for surface, planes in zip(surfaces, across, strict=True)
        ]
        held = [
            held_along(surface.directions, frames[k], flags[k][:, :dim])
            for k, surface in enumerate(surfaces)
        ]
        slave, master = (
            replace(side, surface=replace(surfaces[k], held=held[k], unable=flags[k][:, -1]))
            for k, side in enumerate(sides)
        )
        fixed = np.concatenate([entries[:, :dim] for entries in flags])
        return cls(space, index, slave, master, fixed, turned)

    @cached_property
    def nodes(self) -> Ints:
        """Global numbers of the nodes of both sides, those of the slave first, shape (m,)."""
        return np.concatenate((self.slave.nodes, self.master.nodes))

    @property
    def one(self) -> bool:
        """Whether both sides are one surface that may touch itself."""
        return np.array_equal(self.slave.nodes, self.master.nodes)

    @cached_property
    def x(self) -> Array:
        """The undeformed positions of the nodes of both sides, length, shape (m, d)."""
        return np.concatenate((self.slave.surface.x, self.master.surface.x))

    def gathered(self, owned: Array) -> Array:
        """Return the rows at the nodes of both sides, shape (m, k), from those of the owned nodes;
        collective.
        """
        return from_owners(owned, self.nodes, self.space.mesh.comm)

    def displaced_master(self, owned: Array) -> PairSurface:
        """Return the master displaced by a displacement of the owned nodes, length, shape (owned
        nodes, d); collective.
        """
        return self.master.surface.displaced(
            from_owners(owned, self.master.nodes, self.space.mesh.comm)
        )

    def local(self, nodes: Ints) -> Indices:
        """Return the local numbers of slave nodes that this rank owns."""
        return np.asarray(
            self.slave.nodes[nodes] - self.space.dofmap.index_map.local_range[0], dtype=np.int32
        )

    def points_at(
        self, nodes: Ints, weight: Array, normal: Array, averages: Averages
    ) -> ContactBoundary:
        """Return the contact points at slave nodes that this rank owns; they are not free across
        planes of symmetry.
        """
        points = (self.local(nodes), weight, normal)
        facets = self.slave.facets
        part = contact_part(self.space, points, averages, facets, self.index, self.turned)
        across = np.einsum(
            "nji,njk,nki->ni", part.axes, self.slave.surface.across[nodes], part.axes
        )
        return replace(part, free=(part.free | (self.turned is not None)) & (across < 0.5))


@dataclass(frozen=True)
class PairedSides:
    """The two sides of a pair whose points keep their partners, and their coupling.

    ``followed``: whether the normals are those of the deformed sides, and distances rotate with
    them; else the coupling describes how distances rotate.
    """

    sides: FacingSides
    coupling: Coupling
    followed: bool = False

    @classmethod
    def from_facing(cls, facing: FacingSides, pair: Pair) -> PairedSides:
        """Pair two sides; collective.

        Raises:
            FormError: the sides do not fit together.
        """
        if facing.one:
            reason = (
                "is the side itself: a surface touches itself where it is that of a nonlinear body "
                "and sliding is 'finite', else name two parts of it that may touch"
            )
            raise FormError.at(f"contact[{facing.index}].against", reason)
        try:
            coupling = couple(
                facing.slave.surface,
                facing.master.surface,
                bonded=pair.bonded,
                nominal=not pair.by_geometry,
                reach=pair.reach,
                sharing=facing.slave.sharing(facing.space),
            )
        except PairingError as error:
            raise FormError.at(f"contact[{facing.index}]", str(error)) from None
        return cls(facing, coupling)

    def deformed(self, displacement: Array) -> PairedSides:
        """Return the same points and partners, with normals rotated as the master rotates at the
        partners; collective.

        ``displacement``: displacement of the owned nodes, length, shape (owned nodes, d).
        """
        normal = self.coupling.normal
        moved = self.sides.displaced_master(displacement)
        initial, present = (self._at_partners(side) for side in (self.sides.master.surface, moved))
        initial, present = (
            vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
            for vectors in (initial, present)
        )
        # The least rotation that takes the initial normal of the master to the present one: a
        # reflection at the bisector of both after one at the initial normal.
        bisector = initial + present
        share = 1.0 + np.sum(initial * present, axis=1, keepdims=True)
        along, initial_part = (
            np.sum(vectors * normal, axis=1, keepdims=True) for vectors in (bisector, initial)
        )
        normal = normal - along / share * bisector + 2.0 * initial_part * present
        return replace(self, coupling=replace(self.coupling, normal=normal), followed=True)

    def stiffness(self, state: ContactState, displacement: Array) -> JointStiffness:
        """Return the change of the contact forces of a state as the normals rotate from those of
        ``deformed``, made symmetric by adding its transpose; collective.

        The normals are taken as opposite to those of the master.  At the midside nodes of quadratic
        triangles normals are means, whose rotation is neglected.

        ``displacement``: displacement of the owned nodes, length, shape (owned nodes, d).
        """
        boundary = state.boundary
        sides = self.sides
        dim = displacement.shape[1]
        master = sides.displaced_master(displacement)
        identity = np.eye(dim)
        points = boundary.part == sides.index
        sums = self._at_partners(master)
        size = np.linalg.norm(sums, axis=1)[:, None, None]
        present = sums / size[:, 0]
        turned = (
            (present[:, :, None] * present[:, None] - identity) @ (identity - self.across) / size
        )
        shear = matvec(boundary.tangents[points], state.shear[points])
        # Tangents turn against normals.
        tractions = (
            state.pressure[points, None, None] * identity
            - boundary.normal[points, :, None] * shear[:, None]
        )
        turning = (boundary.weight[points, None, None] * tractions @ turned).swapaxes(1, 2)
        forces = along_vectors(turning, in_blocks(self.coupling.master, dim)) @ turned_normals(
            master
        )
        entries = sp.coo_array(replace(self, followed=True).relative.T @ forces)
        places = np.column_stack((entries.row, entries.col + dim * sides.slave.nodes.size))
        matrix = sp.coo_array((entries.data, tuple(places.T)), shape=(sides.x.size, sides.x.size))
        return JointStiffness(sides.nodes, sp.csr_array(matrix + matrix.T))

    def _at_partners(self, master: PairSurface) -> Array:
        """Return sums of the master's normals at the partners of the points, without components
        across planes of symmetry.
        """
        sums = self.coupling.master @ master.directions
        return sums - matvec(self.across, sums)

    @property
    def across(self) -> Array:
        """Projectors onto the normals of planes of symmetry at the points, shape (n, d, d)."""
        return self.sides.slave.surface.across[self.coupling.nodes]

    @cached_property
    def relative(self) -> sp.csr_array:
        """The map from the displacements of the nodes of both sides to the relative displacement at
        the points, without components across planes of symmetry, shape (n d, m d).
        """
        dim = self.sides.slave.surface.dimension
        relative = in_blocks(self.coupling.both, dim)
        if not self.followed:
            relative = relative + self.coupling.turning
        return along_vectors(np.eye(dim) - self.across, relative)

    def boundary(self) -> ContactBoundary:
        """Return the contact points of this rank; collective."""
        sides = self.sides
        coupling = self.coupling
        dim = self.sides.slave.surface.dimension
        relative = self.relative
        lift = coupling.lift(sides.slave.surface).tocoo()
        reached = np.unique(np.concatenate((relative.indices // dim, lift.row)))
        lifting = sp.csr_array(
            (lift.data, (lift.row, lift.col)), shape=(sides.nodes.size, coupling.nodes.size)
        )
        averages = Averages(
            coupling.both[:, reached],
            sides.nodes[reached],
            sides.x[reached],
            sides.fixed[reached],
            coupling.centre,
            lifting[reached],
            relative[:, components(reached, dim)],
        )
        return sides.points_at(coupling.nodes, coupling.weight, coupling.normal, averages)


class MovingPair:
    """The two sides of a pair that slide on each other, and their present position.

    Attributes:
        sides: both sides, undeformed.
        reach: distance beyond which facets are not paired, length.
        points: slave nodes that have a point, on any rank, shape (n,).
        sharing: division of the pair between the ranks.
        displacement: present displacement of the nodes of both sides, length, shape (m, d).
        coupling: the map at this displacement.
        settled: the displacement at the beginning of the step.
        begun: the map at the beginning of the step.
    """

    settled: Array
    begun: SlidingCoupling
    _known: tuple[SlidingCoupling, ContactBoundary] | None = None  # the last map and its points

    def __init__(self, sides: FacingSides, reach: float | None) -> None:
        """Set up the pair at the undeformed sides.

        ``reach``: distance beyond which facets are not paired, length; None: ``default_reach``.
        """
        surface = sides.slave.surface
        name = f"contact[{sides.index}]"
        if not sides.one and np.intersect1d(sides.slave.nodes, sides.master.nodes).size:
            reason = (
                "sides that slide must not share nodes: give parts that do not meet, or the same "
                "boundary on both sides, which may touch itself"
            )
            raise FormError.at(name, reason)
        points = np.flatnonzero(~surface.unable & (surface.area > 0.0) & ~surface.without_area)
        if not points.size:
            raise FormError.at(
                name, "other contacts own all nodes of its side: exchange facets and against"
            )
        self.sides = sides
        self.points = points
        self.sharing = sides.slave.sharing(sides.space)
        self.reach = default_reach(surface.x, sides.master.surface.x) if reach is None else reach
        self.displacement = np.zeros_like(sides.x)
        self.coupling = self._at(self.displacement)
        self.settled = self.displacement
        self.begun = self.coupling

    def move(self, owned: Array) -> None:
        """Update the map for a displacement of the owned nodes, length, shape (owned nodes, d);
        collective.

        Raises:
            PairingError: a facet faces two sheets of the other side.
        """
        displacement = self.sides.gathered(owned)
        if np.array_equal(displacement, self.settled):
            self.coupling = self.begun
        elif not np.array_equal(displacement, self.displacement):
            self.coupling = self._at(displacement)
        self.displacement = displacement

    def settle(self, state: State) -> None:
        """Take a state as the beginning of a step, see ``move``; collective."""
        dim = self.displacement.shape[1]
        owned = self.sides.space.dofmap.index_map.size_local
        self.move(state.displacement.reshape(-1, dim)[:owned])
        self.settled = self.displacement
        self.begun = self.coupling

    def remembered(self) -> dict[str, Field]:
        """Return the fields, besides the displacement, that the next step needs; none here."""
        return {}

    def in_words(self, state: ContactState) -> str:
        """Return a text for the user about both sides in a state, "" for none; collective."""
        return ""

    def _at(self, displacement: Array) -> SlidingCoupling:
        """Return the map at a displacement of the nodes of both sides, shape (m, d)."""
        sides = self.sides
        on_slave, on_master = np.split(displacement, [sides.slave.nodes.size])
        slave = sides.slave.surface.displaced(on_slave)
        master = sides.master.surface.displaced(on_master)
        return slide(slave, master, self.points, self.reach, sharing=self.sharing)

    @property
    def local_points(self) -> Indices:
        """Local numbers of the nodes of the points of this rank."""
        return self.sides.local(self.coupling.nodes)

    @property
    def across(self) -> Array:
        """Projectors onto the normals of planes of symmetry at the points, shape (n, d, d)."""
        return self.sides.slave.surface.across[self.coupling.nodes]

    @property
    def _sliding(self) -> Array:
        """The tangents without components across planes of symmetry, where nothing slides, shape
        (n, d, d - 1).
        """
        tangents = self.coupling.frames.tangents
        return tangents - np.einsum("nij,njk->nik", self.across, tangents)

    def boundary(self) -> ContactBoundary:
        """Return the contact points of this rank; points without a partner are not free, and points
        in a plane of symmetry are not free across it.
        """
        if self._known is not None and self._known[0] is self.coupling:
            return self._known[1]
        sides = self.sides
        coupling = self.coupling
        count, dim = coupling.normal.shape
        on_slave = sides.slave.surface.x.size
        own = np.arange(count)
        own = np.column_stack((own, count + (dim - 1) * own[:, None] + np.arange(dim - 1)))
        rows = sp.vstack((coupling.normal_rows, coupling.tangent_rows), format="csr")
        frames = np.concatenate((coupling.normal[:, :, None], self._sliding), axis=2)
        along = in_rows(frames, own, rows.shape[0]) @ rows
        both = coupling.frames.both
        averages = Averages(both, sides.nodes, sides.x, sides.fixed, coupling.centre, between=along)
        translations = np.tile(np.eye(dim), (len(sides.x), 1))  # of the slave alone
        translations[on_slave:] = 0.0
        pushing = coupling.normal_rows @ translations
        points = sides.points_at(coupling.nodes, coupling.weight, coupling.normal, averages)
        free = points.free & coupling.frames.partnered[:, None]
        self._known = (coupling, replace(points, free=free, pushing=pushing))
        return self._known[1]

    def sliding_along(self, slip: Array) -> Array:
        """Return slips along T_i, shape (n, d - 1), as vectors without components across planes of
        symmetry, shape (n, d).
        """
        return matvec(self._sliding, slip)

    @property
    def slip(self) -> Array:
        """The slip of the points since the beginning of the step, length, shape (n, d - 1)."""
        return self.coupling.slip(self.begun)

    @property
    def alone(self) -> Flags:
        """The flags of the points without a partner, shape (n,)."""
        return ~self.coupling.frames.partnered

    @property
    def opening(self) -> Array:
        """The linearised gap of the points at the displacement, length, shape (n,)."""
        relative = self.coupling.normal_rows @ self.displacement.ravel()
        return self.coupling.gap + relative

    @property
    def slip_origin(self) -> Array:
        """The relative tangential displacement from which the slip of the step is measured, length,
        shape (n, d).
        """
        slip = self.slip
        return self.sliding_along(
            (self.coupling.tangent_rows @ self.displacement.ravel()).reshape(slip.shape) - slip
        )

    def stiffness(self, state: ContactState, *, symmetric: bool = True) -> JointStiffness:
        """Return the stiffness that the tractions of a state add to the tangent, see
        ``SlidingCoupling``; collective.
        """
        rows = np.flatnonzero(state.boundary.part == self.sides.index)
        shear = matvec(state.boundary.tangents[rows], state.shear[rows])
        along = rmatvec(self.coupling.frames.tangents, shear)
        return JointStiffness(
            self.sides.nodes,
            self.coupling.stiffness(state.pressure[rows], along, symmetric=symmetric),
        )

    @property
    def parted(self) -> str:
        """The name of the contact and the place of a point that had a partner when the step began,
        if no point has one any more; else ""; collective.
        """
        if self.coupling.seen or not self.begun.seen:
            return ""
        places = self.coupling.slave.x[self.begun.nodes[self.begun.frames.partnered]]
        place = parallel.gather_rows(self.sharing.comm, places[:1])[0]
        return (
            f"contact[{self.sides.index}], at "
            f"({', '.join(f'{component:.4g}' for component in place)})"
        )

    @property
    def rotation(self) -> Array:
        """The rotation of the frames of the points of this rank since the beginning of the step,
        shape (n, d, d); in 2D the identity.
        """
        if self.displacement.shape[1] == 2:
            return np.eye(2)
        frames, start = (
            np.concatenate(
                (np.cross(tangents[:, :, :1], tangents[:, :, 1:], axis=1), tangents), axis=2
            )
            for tangents in (self.coupling.frames.tangents, self.begun.frames.tangents)
        )
        return np.einsum("nik,njk->nij", frames, start)
