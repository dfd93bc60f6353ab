"""Equilibrium in the certificate: the forces on a body, evaluated anew, and their residual on each
piece.

"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from signorini_fx.arrays import Array, Flags, Ints, extents, inner, matvec, rmatvec
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.assembly.pieces import find_pieces
from signorini_fx.mechanics.rigid.rigid_motions import rigid_modes
from signorini_fx.mechanics.scales import Scales
from signorini_fx.mechanics.step_effect import AddedForces
from signorini_fx.results.certificate.contact_nodes import ContactNodes
from signorini_fx.tuned import (
    CERTIFICATE_TOLERANCE,
    LEFT_BY_SOLVES,
    LOST_UNITS,
    NEGLIGIBLE,
    NO_FORCE,
    ROOT_OF_EPS,
    SAME_NUMBER,
    UNITS_OF_PLACES,
)

if TYPE_CHECKING:
    from signorini_fx.mechanics.contact_points.turned_supports import TurnedNodes


@dataclass(frozen=True)
class Balance:
    """The forces on a body without contact, evaluated anew, shape (owned nodes, d), and their
    scales.
    """

    pieces: RigidPart  # connected pieces of the body
    internal: Array  # a(y, .) of the strains
    external: Array  # the load vector L
    supports: PrescribedNodes  # prescribed displacements
    scales: Scales[float]  # of lengths and stresses
    stiffest: Scales[float]  # the same with the largest modulus
    resisted: Array  # forces of springs on the boundary, the rest of a(y, .)
    initial: Array | float = 0.0  # forces of prevented initial strains
    prevented: float = 0.0  # energy of the stress of prevented initial strains
    dilation: tuple[Array, Array] | None = (
        None  # see ``NodalForces.dilation``; None: the pressure is no unknown
    )
    # round-off of ``internal`` that does not decrease with y, such as that of a finite deformation
    # I + grad u; None: there is none
    lost: Array | None = None
    with_loads: bool = False  # whether ``internal`` is a whole residual, which contains the loads
    displaced: bool = False  # whether contact is evaluated at displaced points
    added: AddedForces | None = None  # of effects in time; ``external`` includes its loads

    def with_added(self, added: AddedForces) -> Balance:
        """Return the balance with the forces of an effect in time."""
        return replace(
            self,
            external=self.external + added.loads,
            supports=replace(self.supports, value=added.prescribed),
            lost=added.lost if self.lost is None else self.lost + added.lost,
            added=added,
        )

    def residual(self, pressed: Array | float = 0.0) -> Array:
        """Return the forces that are not in balance, reactions of supports included, shape (owned
        nodes, d).

        Args:
            pressed: minus the contact forces on the body, of the same shape.
        """
        residual = self.internal + self.resisted - (self.external + self.initial) + pressed
        return residual if self.added is None else residual + self.added.resisting

    @cached_property
    def energies(self) -> Array:
        """Energies that effects in time add, shape (pieces,)."""
        if self.added is None:
            return np.zeros(self.pieces.count)
        return self.pieces.sums(self.added.energy[:, None])[:, 0]

    def works(self, y: Array) -> Array:
        """Return the work of internal and of initial forces on displacements of the owned nodes,
        energies, shape (pieces, 2).
        """
        return self.pieces.sums(np.stack((self.internal * y, self.initial * y), axis=1).sum(axis=2))

    def strain_energy(self, works: Array) -> float:
        """Return the strain energy of the stress, initial strains included, and 0 where it is
        round-off.

        Args:
            works: the result of ``works``.
        """
        internal, expanding = map(float, works.sum(axis=0))
        prevented = self.prevented - expanding
        energy = internal / 2 + prevented
        return max(
            0.0, energy if energy > SAME_NUMBER * abs(internal / 2) or prevented == 0.0 else 0.0
        )

    def of_pieces(self) -> tuple[Scales[Array], Scales[Array]]:
        """Return ``scales`` and ``stiffest`` of each piece."""
        size = self.pieces.size if self.pieces.count > 1 else np.array([self.scales.size])
        return self.scales.of_pieces(size), self.stiffest.of_pieces(size)

    @cached_property
    def imposed(self) -> Flags:
        """Which pieces have a support with a displacement that is not zero, shape (pieces,)."""
        missed = self.supports.missed(np.zeros_like(self.external))
        moved = self.pieces.largest(missed, self.supports.among(self.pieces.piece))
        return moved > 0

    @cached_property
    def unloaded(self) -> Flags:
        """Which pieces have neither loads, initial strains nor moving supports, shape (pieces,).

        If no other piece transmits a force to them, their forces are round-off of the joint system,
        in proportion to the motions of the others.
        """
        loads = np.abs(self.external) + np.abs(self.initial)
        return (self.pieces.norms(loads) == 0) & ~self.imposed & (self.energies == 0)


class PieceScales(NamedTuple):
    """The scales that figures are divided by, for each piece or each point.

    Attributes:
        length: of the deformation.
        far: of the displacement.
        stress: of the tractions, at least ``penalty``.
        penalty: the stress whose round-off tractions have where two bodies meet by the regularised
            law.
    """

    length: Array
    far: Array
    stress: Array
    penalty: Array

    def between(self, piece: Ints, other: Ints) -> PieceScales:
        """Return the scales of points from those of pieces.

        The smaller stress of both pieces counts: forces that press the other piece elsewhere are
        not forces of this contact.

        Args:
            piece: the piece at each point.
            other: the piece on the other side, -1 for a rigid foundation.
        """
        rigid = other < 0
        length, far, _, penalty = (
            np.maximum(values[piece], np.where(rigid, 0.0, values[other])) for values in self
        )
        smaller = np.minimum(self.stress[piece], np.where(rigid, np.inf, self.stress[other]))
        return PieceScales(length, far, np.maximum(smaller, penalty), penalty)


def equilibrium(
    balance: Balance, y: Array, nodes: ContactNodes | None, units: PieceScales, reach: float
) -> tuple[float, tuple[int, ...], float]:
    """Return the relative residual of equilibrium, pieces that cannot be checked, and the residual
    that round-off may hide.  Collective.

    The residual is that of (3.3a) in the free unknowns, of each piece and of the worst contact node
    as a stress.  A piece cannot be checked if all forces on it are round-off of the joint system.
    What round-off of the evaluation may hide is relative to the forces on a piece, or, where
    displacements alone act, to the internal forces.

    Forces are relative to those of loads, contact and springs on the piece where it is free.  On
    slender bodies the reactions of supports, and so a(y, .), may be far larger: a share of them is
    a lower bound, because of round-off.

    Four floors keep round-off from counting as a residual where hardly any force acts: ``least``,
    from the displacement and the stiffness of an element; ``slight``, from all forces, what
    supports take included; ``joint``, from the largest force on any piece, as all are solved in one
    system; and ``missing``, from the digits that the sums themselves lose, and from the round-off
    of coordinates over the distances of nodes.

    Args:
        balance: forces on the body without contact.
        y: displacements of the owned nodes, shape (owned nodes, d).
        nodes: the contact points with the tractions at them; None without contact.
        units: scales of each piece.
        reach: the largest displacement of anything, also of a rigid body, length.
    """
    supports = balance.supports
    pieces = balance.pieces
    comm = pieces.space.mesh.comm
    _, stiffest = balance.of_pieces()
    nodes_of_pieces = pieces.sums(np.ones((len(y), 1)))[:, 0]
    spacing = stiffest.spacing(nodes_of_pieces)
    count = np.sqrt(nodes_of_pieces)
    # A motion without stress, or without change of volume, has forces too: round-off of the largest
    # modulus.
    firmness = stiffest.stiffness(spacing)
    least = firmness * pieces.norms(y)
    least = NO_FORCE * np.where(
        balance.unloaded, np.maximum(least, firmness.max() * reach * count), least
    )
    loads = balance.external + balance.initial
    acting = [supports.left(loads), supports.left(balance.resisted)]
    if balance.added is not None:
        acting.append(supports.left(balance.added.resisting))
    pressed: Array | float = 0.0
    reacting = np.maximum(pieces.norms(balance.internal), pieces.norms(loads))
    slight = NEGLIGIBLE * reacting
    if nodes is not None:
        reached, contact_forces, area = nodes.forces(len(y))
        pressed = np.zeros_like(y)
        np.add.at(pressed, reached, contact_forces)
        acting.append(supports.left(pressed))
        slight = np.maximum(slight, units.penalty * pieces.norms(area, pieces.piece[reached]))
        slight = np.maximum(
            slight, NO_FORCE * pieces.norms(pressed)
        )  # including what supports take
    on_pieces = np.max([pieces.norms(part) for part in acting], axis=0)
    force = np.max([least, slight, on_pieces], axis=0)
    joint = NO_FORCE * float(force.max())  # round-off of the joint system
    unknown = (pieces.norms(loads) > 0) & (force < CERTIFICATE_TOLERANCE * joint)
    unjudged = tuple(map(int, np.flatnonzero(unknown)))
    force = np.maximum(force, joint)
    residual = supports.left(balance.residual(pressed))
    digits = LOST_UNITS * np.finfo(float).eps
    coordinates = parallel.largest(comm, np.abs(pieces.x), 0.0)
    last_digit = UNITS_OF_PLACES * np.finfo(float).eps * coordinates
    missing = pieces.norms(residual) - digits * least / NO_FORCE - last_digit / spacing * reacting
    # A piece without loads is at rest if its forces are no more than the residuals of solves.
    rests = pieces.norms(loads) + float(balance.with_loads) == 0
    rests &= np.maximum(on_pieces, reacting) <= LEFT_BY_SOLVES / NO_FORCE * least
    missing = np.where(rests, 0.0, missing)
    hidden = 0.0
    if balance.lost is not None:
        lost = LOST_UNITS * pieces.norms(balance.lost)
        within = pieces.norms(balance.internal)
        # A body without forces that supports move as a whole has no equilibrium to lose.  Its
        # difference from the best-fitting small rotation is zero, or, where internal forces are
        # round-off, below the digits of displacements, or that of a finite rotation.
        beside = pieces.largest_beside(y)
        turned = (beside <= ROOT_OF_EPS * reach) | (beside > digits * pieces.size)
        whole = (beside <= digits * reach) | (turned & (within <= lost))
        # A contact of such a body without a force transmits round-off.
        known = ((on_pieces == 0) | (balance.imposed & (on_pieces <= lost))) & whole
        hidden = share(comm, np.where(known, 0.0, lost), np.where(on_pieces > 0, force, within))
        missing = missing - lost
    residual_share = share(comm, missing, force)
    if nodes is None:
        return residual_share, unjudged, hidden
    # The stress at a node has the round-off of loads, and of the displacement over the length of
    # its side; this length, and so all forces, have the round-off of coordinates.
    reached_piece = pieces.piece[reached]
    load = pieces.largest(np.linalg.norm(loads, axis=1))
    side = stiffest.side(area)
    least_stress = digits * (
        stiffest.modulus * units.far[reached_piece] / side + load[reached_piece] / area
    )
    acts = np.maximum(load, pieces.largest(np.linalg.norm(balance.internal, axis=1)))[reached_piece]
    least_stress += last_digit / side * acts / area
    if balance.lost is not None:
        least_stress = (
            least_stress + LOST_UNITS * np.linalg.norm(balance.lost[reached], axis=1) / area
        )
    unbalanced = np.linalg.norm(residual[reached], axis=1) / area - least_stress
    unbalanced = np.where(rests[reached_piece], 0.0, unbalanced)
    return (
        max(residual_share, share(comm, unbalanced, units.stress[reached_piece])),
        unjudged,
        hidden,
    )


def change_of_volume(balance: Balance, far: float, strain_energy: float) -> float:
    """Return the relative error of the change of volume where the pressure is an unknown, and 0
    otherwise.  Collective.

    It is relative to the mean strain, or to the strain that loads may cause (in an enclosed body
    they cause a pressure and no strain).

    Args:
        balance: the forces on the body; its ``dilation`` is the residual.
        far: largest displacement, length.
        strain_energy: the strain energy.
    """
    if balance.dilation is None:
        return 0.0
    residual, volume = balance.dilation
    comm = balance.pieces.space.mesh.comm
    scales = balance.scales
    loads = parallel.total(comm, np.linalg.norm(balance.external, axis=1)) / scales.surface
    strain = max(scales.stress(strain_energy), NEGLIGIBLE * loads) / scales.modulus
    lost = (
        LOST_UNITS
        * np.finfo(float).eps
        * far
        / scales.spacing(balance.pieces.space.dofmap.index_map.size_global)
    )
    left, size = (
        float(np.sqrt(parallel.global_sum(comm, np.sum(values**2))))
        for values in (residual, volume)
    )
    return share(comm, np.array(left - lost * size), np.array(strain * size))


def share(comm: MPI.Comm, parts: Array, wholes: Array) -> float:
    """Return the largest ratio of parts to wholes on all ranks.  Collective.

    It is 0 for a part <= 0, also of nothing, and otherwise inf for a whole <= 0: a residual where
    no force acts is never small.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.where(parts <= 0, 0.0, parts / wholes)
    largest = float(np.max(shares, initial=0.0))
    return parallel.global_max(comm, np.inf if np.isnan(largest) else largest)


class RigidPart:
    """The connected pieces of a mesh and the rigid motions that fit displacements of their nodes
    best.

    Pieces that can touch move independently of each other.  The constructor is collective.

    Args:
        space: the space of the displacement.

    Attributes:
        space: the space of the displacement.
        x: positions of the owned nodes, length, shape (owned nodes, d).
        count: number of pieces.
        piece: number of the piece that each owned node is in.
        size: diameters of the pieces, length, shape (pieces,).
    """

    def __init__(self, space: fem.FunctionSpace) -> None:
        pieces = find_pieces(space.mesh)
        self._comm = space.mesh.comm
        dim = space.mesh.geometry.dim
        self.count = pieces.count
        nodes = space.dofmap.index_map
        self.space = space
        self.x = node_positions(space)[: nodes.size_local, :dim]
        of_node = np.zeros(nodes.size_local + nodes.num_ghosts, dtype=np.int64)
        of_node[space.dofmap.list] = pieces.of_cell[:, None]
        self.piece = of_node[: len(self.x)]
        self.size = extents(pieces.bounds)
        self._turned = rigid_modes(self._without_mean(self.x), np.zeros(dim), np.array(1.0))[
            :, :, dim:
        ]
        turns = self._turned.shape[2]
        gram = self.sums(
            np.einsum("nik,nil->nkl", self._turned, self._turned).reshape(-1, turns**2)
        )
        self._inverse = np.linalg.pinv(gram.reshape(-1, turns, turns), hermitian=True)

    def largest_beside(self, y: Array) -> Array:
        """Return the largest nodal displacement of each piece after its best-fitting small rigid
        motion is subtracted, length, shape (pieces,).  Collective.

        Args:
            y: displacements of the owned nodes, length, shape (owned nodes, d).
        """
        motion = self._without_mean(y)
        moment = self.sums(rmatvec(self._turned, motion))
        angles = matvec(self._inverse, moment)
        return self.largest(
            np.linalg.norm(motion - matvec(self._turned, angles[self.piece]), axis=1)
        )

    def largest(self, values: Array, piece: Ints | None = None) -> Array:
        """Return the largest value of each piece, at least 0, and inf where a value is nan, shape
        (pieces,).  Collective.

        Args:
            values: one value for each entry of ``piece``, on this rank.
            piece: the piece that each value belongs to, -1 for none; None for values of the owned
                nodes.
        """
        piece = self.piece if piece is None else piece
        local_largest = np.zeros(self.count)
        inside = piece >= 0
        np.maximum.at(local_largest, piece[inside], values[inside])
        return parallel.largest_of_each(
            self._comm, np.where(np.isnan(local_largest), np.inf, local_largest)
        )

    def norms(self, vectors: Array, piece: Ints | None = None) -> Array:
        """Return the Euclidean norm of all vectors of each piece together, shape (pieces,).
        Collective.

        Args:
            vectors: numbers or vectors, shape (n,) or (n, d).
            piece: the piece that each one belongs to; None for those of the owned nodes.
        """
        rows = vectors[:, None] if vectors.ndim == 1 else vectors
        squares = inner(rows, rows)[:, None]
        pieces = self.piece if piece is None else piece
        return np.sqrt(parallel.sums_by(self._comm, pieces, squares, self.count)[:, 0])

    def _without_mean(self, values: Array) -> Array:
        sums = self.sums(np.column_stack((np.ones(len(values)), values)))
        return values - (sums[:, 1:] / np.maximum(sums[:, :1], 1.0))[self.piece]

    def sums(self, values: Array) -> Array:
        """Return the sums over the owned nodes of each piece, from shape (owned nodes, m) to
        (pieces, m).  Collective.
        """
        return parallel.sums_by(self._comm, self.piece, values, self.count)


@dataclass(frozen=True)
class PrescribedNodes:
    """The prescribed displacements of the owned nodes."""

    fixed: Flags  # which components are prescribed, in ``_frames``, shape (owned nodes, d)
    value: Array  # prescribed displacements along the axes, length, shape (owned nodes, d)
    # position in ``scene.displacement`` of the entry that prescribes a component along the axes, -1
    # for none
    by: Ints
    turned: TurnedNodes | None = None

    def missed(self, y: Array) -> Array:
        """Return the differences between displacements of the owned nodes and the prescribed ones,
        one for each prescribed component, length, as a flat array.
        """
        return np.abs(self._in_frames(y - self.value)[self.fixed])

    def among(self, of_node: Ints) -> Ints:
        """Return the number of the node of each entry of ``missed``, from a number for each owned
        node, such as that of its piece.
        """
        return np.broadcast_to(of_node[:, None], self.fixed.shape)[self.fixed]

    def left(self, vectors: Array) -> Array:
        """Return vectors at the owned nodes without their prescribed components, shape (owned
        nodes, d).
        """
        free = np.where(self.fixed, 0.0, self._in_frames(vectors))
        return free if self._frames is None else matvec(self._frames, free)

    def taken(self, forces: Array, position: int) -> Array:
        """Return the part of nodal forces that one entry of ``scene.displacement`` takes, shape
        (owned nodes, d).

        This part does the same work as all forces on any displacement that this entry alone
        prescribes.
        """
        taken = np.where(self.by == position, forces, 0.0)
        if self.turned is None:
            return taken
        here = self.turned.nodes < len(forces)
        nodes = self.turned.nodes[here]
        dim = forces.shape[1]
        along = rmatvec(self.turned.from_given[here], forces[nodes])
        taken[nodes] = np.where(self.by[nodes] == position, along[:, :dim], 0.0)
        for number, support in enumerate(self.turned.supports):
            if support.position == position:
                taken[nodes] += along[:, dim + number, None] * support.normal
        return taken

    @cached_property
    def _frames(self) -> Array | None:
        """The frames of the owned nodes in which ``fixed`` is stated, shape (owned nodes, d, d);
        None if they are the axes.
        """
        return None if self.turned is None else self.turned.frames_at(np.arange(len(self.fixed)))

    def _in_frames(self, vectors: Array) -> Array:
        """Return the components of vectors at the owned nodes in ``_frames``."""
        return vectors if self._frames is None else rmatvec(self._frames, vectors)
