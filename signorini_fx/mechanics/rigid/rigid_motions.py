"""Motions of the body without strain that the supports leave free, and their names in messages.

A connected piece has m of them: in 2D two translations and a rotation, in 3D three translations and
three rotations.  A body of several pieces has m for each of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.algebra.contact.motions import FreeMotions, RigidLoad
from signorini_fx.algebra.contact.points import PointGroups
from signorini_fx.arrays import Array, Flags, Integers, Ints, matvec
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import from_owners
from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.assembly.pieces import BodyPieces
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary, MovingFoundation
from signorini_fx.mechanics.kinematics import CARTESIAN, Kinematics
from signorini_fx.tuned import CERTIFICATE_TOLERANCE, LEFT_BY_SOLVES, ROOT_OF_EPS

if TYPE_CHECKING:
    from signorini_fx.mechanics.contact_points.turned_supports import TurnedNodes

# Number of pieces that a message lists.
MOST_LISTED = 4


@dataclass(frozen=True)
class RigidMotions:
    """The k motions without strain that the prescribed displacements leave free.

    Attributes:
        pieces: the connected pieces of the body, p of them.
        x: positions of the nodes of this rank, ghosts included, length, shape (nodes, d).
        piece: number of the piece of each of these nodes, shape (nodes,).
        owned: how many of these nodes this rank owns.
        centre: the point of each piece about which its rotations are taken, shape (p, d).
        length: size of each piece, which makes its rotations comparable with translations, shape
            (p,).
        supported: pseudo-inverse of the products of the motions of each piece with each other at
            the supports, shape (p, m, m).
        free: the free motions as combinations of the motions of each piece (see ``rigid_modes``),
            one per column, shape (m p, k); a column moves the pieces of one assembly only.
        assembly: number of the assembly that each column moves, shape (k,).
        foundations: the unknowns of moving foundations in each motion, lengths, shape (unknowns,
            k); None: there are none.
        moving: these foundations; None: there are none.
    """

    pieces: BodyPieces
    x: Array
    piece: Ints
    owned: int
    centre: Array
    length: Array
    supported: Array
    free: Array
    assembly: Ints
    foundations: Array | None = None
    moving: MovingFoundation | None = None

    @property
    def of_all(self) -> Array:
        """The matrix ``free`` with ``foundations`` below it."""
        return self.free if self.foundations is None else np.vstack((self.free, self.foundations))

    @property
    def each(self) -> int:
        """The number m of motions of a piece: 3 in 2D, 6 in 3D."""
        return CARTESIAN[self.x.shape[1]].motions

    def at(self, boundary: ContactBoundary) -> FreeMotions:
        """Return the relative displacements B r of the free motions r at the contact points of this
        rank; collective.
        """
        piece = self.piece[boundary.nodes]
        averages = boundary.averages
        of = self._pieces_at(boundary)
        free_modes = self.free.reshape(self.pieces.count, self.each, -1)
        at_nodes = rigid_modes(averages.x, self.centre[of], self.length[of]) @ free_modes[of]
        flat = at_nodes.reshape(averages.x.size, self.free.shape[1])
        moved = (averages.operator @ flat).reshape(*boundary.x.shape, self.free.shape[1])
        if boundary.moving is not None and self.foundations is not None:
            moved = moved - boundary.moving.modes @ self.foundations
        relative = boundary.points.movable @ np.einsum("nij,nik->njk", boundary.frames, moved)
        reached = piece[:, None] == np.arange(self.pieces.count)
        reached[averages.point, of[averages.shares.indices]] = True
        groups = PointGroups.of(boundary.points, reached)
        return FreeMotions(
            boundary.points, relative, self.assembly, self.pieces.assembly[piece], groups
        )

    def joined(self, boundary: ContactBoundary) -> RigidMotions:
        """Return the motions including the free motions of foundations, with everything that may
        touch as one assembly; collective.
        """
        moving = boundary.moving
        of = self.pieces.assembly
        averages = boundary.averages
        if moving is None and not boundary.paired:
            return self
        count = int(of.max()) + 1
        bodies = 0
        at_points = of[self.piece[boundary.nodes]]
        links = [
            np.column_stack(
                (at_points[averages.point], of[self._pieces_at(boundary)[averages.shares.indices]])
            )
        ]
        if moving is not None:
            point, unknown = np.nonzero(moving.modes.any(axis=1))
            links.append(np.column_stack((at_points[point], count + moving.number[unknown])))
            bodies = int(moving.number.max()) + 1
        number = _joined(np.concatenate(links), count + bodies, boundary.comm)
        assembled = replace(
            self, pieces=replace(self.pieces, assembly=number[of]), assembly=number[self.assembly]
        )
        if moving is None:
            return assembled
        tool_modes = np.eye(moving.loose.size)[:, moving.loose]
        return replace(
            assembled,
            free=np.hstack((self.free, np.zeros((len(self.free), tool_modes.shape[1])))),
            assembly=np.concatenate(
                (assembled.assembly, number[count + moving.number[moving.loose]])
            ),
            foundations=np.hstack((np.zeros((len(tool_modes), self.free.shape[1])), tool_modes)),
            moving=moving,
        )

    def _pieces_at(self, boundary: ContactBoundary) -> Ints:
        """Return the pieces of the nodes that the averages of a boundary use, shape (m,);
        collective.
        """
        owned_pieces = self.piece[: self.owned, None].astype(np.float64)
        return from_owners(owned_pieces, boundary.averages.nodes, boundary.comm)[:, 0].astype(
            np.int64
        )

    def displacement(self, motion: Array) -> Array:
        """Return the sum of the free motions with coefficients of shape (k,) at all nodes of this
        rank, shape (nodes, d).
        """
        return self.of_pieces(self.free @ motion)

    def of_pieces(self, motion: Array, nodes: Integers | slice = slice(None)) -> Array:
        """Return the sum of the motions of all pieces with coefficients of shape (m p,) at nodes of
        this rank, shape (n, d).
        """
        coefficients = motion.reshape(-1, self.each)[self.piece[nodes]]
        moved = matvec(self.modes(nodes), coefficients)
        return moved

    def load_of(self, forces: Array, comm: MPI.Comm, driving: Array | None = None) -> RigidLoad:
        """Return the work of forces on the free motions; collective.

        ``forces``: at the owned dofs, shape (owned dofs,); ``driving``: forces on the unknowns of
        moving foundations.
        """
        if self.free.shape[1] == 0:
            return RigidLoad(np.zeros(0), np.zeros(0), self.assembly)
        forces = forces.reshape(-1, self.x.shape[1])
        acting = np.flatnonzero(forces.any(axis=1))  # few where loads are on the boundary
        work = np.einsum("ij,ijk->ik", forces[acting], self.modes(acting))
        sizes = np.linalg.norm(forces[acting], axis=1, keepdims=True)
        total = parallel.sums_by(
            comm, self.piece[acting], np.hstack((work, sizes)), self.pieces.count
        )
        of_assembly = np.bincount(self.pieces.assembly, total[:, -1]).astype(np.float64)
        work = self.free.T @ total[:, :-1].ravel()
        size = of_assembly[self.assembly]
        if driving is not None and self.foundations is not None:
            driven = self.foundations * driving[:, None]
            work = work + driven.sum(axis=0)
            size = size + np.bincount(self.assembly, np.abs(driven).sum(axis=0))[self.assembly]
        return RigidLoad(work, size, self.assembly)

    def modes(self, nodes: Integers | slice) -> Array:
        """Return the motions of the pieces of some nodes of this rank at these nodes, shape (n, d,
        m).
        """
        piece = self.piece[nodes]
        return rigid_modes(self.x[nodes], self.centre[piece], self.length[piece])


def _joined(links: Ints, count: int, comm: MPI.Comm) -> Ints:
    """Return the number of the connected component of each of ``count`` items, which the pairs
    ``links`` of all ranks join; collective.
    """
    keys = parallel.gather_rows(comm, np.unique(links[:, 0] * count + links[:, 1]))
    number = np.arange(count)
    for pair in np.column_stack(np.divmod(np.unique(keys), count)):
        low, high = np.sort(number[pair])
        number[number == high] = low
    return np.unique(number, return_inverse=True)[1].astype(np.int64)


def rigid_modes(x: Array, centre: Array, length: Array) -> Array:
    """Return the translations along the axes and the rotations about them at points, shape (n, d,
    m).

    ``x``: the points, length, shape (n, d). ``centre``: centre of rotation, shape (n, d) or (d,).
    ``length``: distance from the centre at which a rotation displaces by one, shape (n,) or ().
    """
    dim = x.shape[1]
    turns = CARTESIAN[dim].rotations
    modes = np.zeros((x.shape[0], dim, dim + len(turns)))
    modes[:, np.arange(dim), np.arange(dim)] = 1.0
    arm = (x - centre) / np.asarray(length)[..., None]
    for k, (first, second) in enumerate(turns, start=dim):
        modes[:, first, k] = -arm[:, second]
        modes[:, second, k] = arm[:, first]
    return modes


def rigid_motions(
    space: fem.FunctionSpace,
    fixed: Flags,
    pieces: BodyPieces,
    turned: TurnedNodes | None,
    kinematics: Kinematics,
) -> RigidMotions:
    """Return the motions without strain that supports leave free; collective.

    ``fixed``: which displacement components are prescribed at the owned nodes, shape (owned nodes,
    d);
        at ``turned`` nodes in their own frames.
    """
    comm = space.mesh.comm
    owned = slice(fixed.shape[0])
    x = np.ascontiguousarray(node_positions(space)[:, : fixed.shape[1]], dtype=np.float64)
    cells = space.dofmap.list
    piece = np.zeros(x.shape[0], dtype=np.int64)
    if pieces.count > 1:
        piece[cells.ravel()] = np.repeat(pieces.of_cell, cells.shape[1])
    sums = np.column_stack((np.ones(x[owned].shape[0]), x[owned]))
    total = parallel.sums_by(comm, piece[owned], sums, pieces.count)
    centre = total[:, 1:] / np.maximum(total[:, :1], 1.0)
    length = np.hypot.reduce(pieces.bounds[:, 1] - pieces.bounds[:, 0], axis=1)
    none = np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(0, dtype=np.int64)
    motions = RigidMotions(pieces, x, piece, len(fixed), centre, length, *none)
    products, _ = _at_supports(motions, fixed, np.zeros(fixed.shape), turned, comm)
    free, assembly = _null_space(products, motions, kinematics)
    supported = np.linalg.pinv(products, rcond=ROOT_OF_EPS, hermitian=True).astype(np.float64)
    motions = replace(motions, supported=supported, free=free, assembly=assembly)
    # Products have half of the digits of where the supports lie: what the motions still do there is
    # taken out.
    held = np.flatnonzero(fixed.any(axis=1))
    moved = np.zeros(fixed.shape)
    for column in free.T:
        moved[held] = motions.of_pieces(column, held)
        column -= nearest_motion(motions, fixed, moved, turned, comm)
    return motions


def without_energy(
    motions: RigidMotions, matrix: PETSc.Mat, vector: Callable[[Array], PETSc.Vec]
) -> RigidMotions:
    """Return those combinations of the motions for which a(r, r) = 0: springs, and whatever else
    resists rigid motions, count as supports; collective.

    ``matrix``: the matrix of a(., .), or of the part of it that may resist. ``vector``: returns a
    new vector of unknowns of the matrix from displacements of the nodes of this
        rank.
    """
    if motions.free.shape[1] == 0:
        return motions
    moved = []
    forces = []
    for motion in np.eye(motions.free.shape[1]):
        x = vector(motions.displacement(np.asarray(motion)))
        moved.append(x.getArray(readonly=True))
        forces.append((matrix * x).getArray(readonly=True))
    rows = np.array(moved)
    size = np.abs(matrix.getDiagonal().getArray(readonly=True))
    products = np.stack((rows @ np.array(forces).T, (rows * size) @ rows.T))
    energy, scale = parallel.global_sum(matrix.comm.tompi4py(), products)
    columns = []
    numbers = []
    for number in np.unique(motions.assembly):
        of = motions.assembly == number
        values, vectors = np.linalg.eigh(energy[np.ix_(of, of)])
        # Springs may have nothing to say of a motion: its energy is round-off of that of the
        # others.
        # One that is negative is that of a tangent under stress: such a motion is not free.
        combinations = vectors[
            :, np.abs(values) <= LEFT_BY_SOLVES * np.trace(scale[np.ix_(of, of)])
        ]
        columns.append(motions.free[:, of] @ combinations)
        numbers.append(np.full(combinations.shape[1], number))
    return replace(motions, free=np.concatenate(columns, axis=1), assembly=np.concatenate(numbers))


def nearest_motion(
    motions: RigidMotions,
    fixed: Flags,
    prescribed: Array,
    turned: TurnedNodes | None,
    comm: MPI.Comm,
) -> Array:
    """Return the motions of the pieces that are nearest to prescribed displacements, shape (m p,);
    collective.

    ``fixed``, ``prescribed``: which components are prescribed at the owned nodes, and their values,
    shapes (owned nodes, d); at ``turned`` nodes in their own frames.
    """
    _, moved = _at_supports(motions, fixed, prescribed, turned, comm)
    return matvec(motions.supported, moved).ravel()


def _at_supports(
    motions: RigidMotions,
    fixed: Flags,
    prescribed: Array,
    turned: TurnedNodes | None,
    comm: MPI.Comm,
) -> tuple[Array, Array]:
    """Return the products of the motions with each other at prescribed components, shape (p, m, m),
    and with the prescribed values, shape (p, m).
    """
    node, component = np.nonzero(fixed)
    columns = np.concatenate((motions.modes(node), prescribed[node][:, :, None]), axis=2)
    piece = motions.piece[node]
    if turned is not None:
        columns = np.einsum("nij,nik->njk", turned.frames_at(node), columns)
    rows = columns[np.arange(node.size), component]
    products: Array = np.zeros((motions.pieces.count, motions.each, motions.each + 1))
    for number in range(motions.pieces.count):
        mine = rows[piece == number]
        products[number] = mine[:, :-1].T @ mine
    products = parallel.global_sum(comm, products)
    return products[:, :, :-1], products[:, :, -1]


def _null_space(
    supported: Array, motions: RigidMotions, kinematics: Kinematics
) -> tuple[Array, Ints]:
    """Return the motions of each piece that kinematics and supports allow, one per column, and the
    piece of each.
    """
    count = motions.pieces.count
    each = motions.each
    dim = motions.x.shape[1]
    ways = np.tile(np.eye(each), (count, 1, 1))
    if (
        not kinematics.unbalanced.all()
    ):  # these are about the origin, those of pieces about their middles
        ways[:, :dim] = rigid_modes(motions.centre, np.zeros(dim), motions.length)
        ways = ways[:, :, kinematics.unbalanced]
        ways = ways / np.linalg.norm(ways, axis=1, keepdims=True)
    columns = []
    numbers = list[int]()
    for piece, products in enumerate(supported):
        admitted = ways[piece]
        scaled = products / max(float(np.linalg.eigvalsh(products)[-1]), 1e-300)
        values, vectors = np.linalg.eigh(admitted.T @ scaled @ admitted)
        null_vectors = admitted @ vectors[:, values <= ROOT_OF_EPS]
        modes = np.zeros((count, each, null_vectors.shape[1]))
        modes[piece] = null_vectors
        columns.append(modes.reshape(each * count, -1))
        numbers += [piece] * null_vectors.shape[1]
    return np.concatenate(columns, axis=1), np.array(numbers, dtype=np.int64)


def names_of(moved: Array, motions: RigidMotions, members: Ints, *, one_way: bool = False) -> str:
    """Return names for the motions of an assembly in a message.

    ``moved``: combinations as in ``RigidMotions.of_all``, one per column. ``members``: the pieces
    of the assembly. ``one_way``: whether the motions count in their own direction only, not in the
    opposite one.
    """
    descriptions = []
    moved = moved / np.abs(moved).max()  # the size of a motion means nothing
    rows = moved.reshape(-1, motions.each, moved.shape[1])
    rigid = motions.moving
    pieces = motions.pieces
    things = [(pieces.called(int(member)), rows[member]) for member in members]
    if rigid is not None:
        things += [
            (body.called, row) for body, row in zip(rigid.bodies, rows[pieces.count :], strict=True)
        ]
    for name, modes in things:
        vectors, values, _ = np.linalg.svd(modes, full_matrices=False)
        independent = modes if len(things) == 1 else vectors[:, values > CERTIFICATE_TOLERANCE]
        if one_way and independent.shape[1]:
            independent = modes / np.linalg.norm(modes)  # the sign of ``vectors`` means nothing
        if independent.shape[1]:
            names = _names_of_piece(independent, motions.x.shape[1], one_way=one_way)
            descriptions.append(names if len(things) == 1 else f"{name} in {names}")
    suffix = (
        f", and {len(descriptions) - MOST_LISTED} more pieces"
        if len(descriptions) > MOST_LISTED
        else ""
    )
    return ", ".join(descriptions[:MOST_LISTED]) + suffix


def _names_of_piece(motions: Array, dim: int, *, one_way: bool) -> str:
    """Return names for motions of one piece (translations, then rotations, see ``rigid_modes``),
    one per column.
    """
    _, values, rows = np.linalg.svd(motions[dim:], full_matrices=True)
    turning = int(np.count_nonzero(values > CERTIFICATE_TOLERANCE))
    shifts = (motions @ (rows[turning:].T if turning else np.eye(motions.shape[1])))[:dim]
    names = []
    if shifts.shape[1] == dim:
        names.append("translations")
    elif shifts.shape[1] == 1:
        along = _direction(shifts[:, 0], upwards=not one_way or motions.shape[1] > 1)
        names.append(f"the translation along ({along})")
    elif shifts.shape[1] == 2:
        names.append(f"the translations across ({_direction(np.linalg.svd(shifts.T)[2][-1])})")
    if turning == 1 and dim == 3:
        names.append(f"rotations about axes along ({_direction(rows[0] @ motions[dim:].T)})")
    elif turning:
        names.append("rotations")
    return " and ".join(names)


def _direction(vector: Array, *, upwards: bool = True) -> str:
    """Return the unit direction of a vector as text; with ``upwards`` its largest component is made
    positive.
    """
    sign = np.sign(vector[np.argmax(np.abs(vector))]) if upwards else 1.0
    return ", ".join(rounded(value) for value in sign * vector / np.linalg.norm(vector))


def rounded(value: float, size: float = 1.0) -> str:
    """Return a number as text with four digits; 0 where it is round-off compared with ``size``."""
    return f"{round(float(value) / size, 6) * size + 0.0:.4g}"
