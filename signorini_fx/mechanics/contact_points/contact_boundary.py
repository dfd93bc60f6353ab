"""The contact boundary: its nodes with weights and directions, the traces tau_N y and tau_T y, and
the map B to them.

With the nodal rule of ``mesh_entities`` the products on Gamma_c are sums over nodes,
(lambda, tau_N z) = sum_i w_i lambda_i n_i . z_i.  A node belongs to the rank that owns its degrees
of freedom.  A node of two contact boundaries has two entries, one for each normal.  Where nodes
have no such rule the contact points are the vertices, at which z_i is an average (``averages.py``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
import ufl
from dolfinx import default_scalar_type, fem
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.algebra.contact.contact_map import ContactMap
from signorini_fx.algebra.contact.points import ContactPoints, SharedNodes, onto_range
from signorini_fx.arrays import Array, Expr, Flags, Indices, Ints, rmatvec
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.averages import Averages, averaging, from_owners
from signorini_fx.mechanics.assembly.mesh_entities import (
    assemble,
    compile_form,
    facet_nodes,
    lumped_degree,
    measure,
    node_positions,
)
from signorini_fx.mechanics.kinematics import of_components
from signorini_fx.mechanics.kinematics.protocol import Kinematics
from signorini_fx.mechanics.laws.directed import FrictionAxes
from signorini_fx.mechanics.statement.rigid_body import RigidBody
from signorini_fx.tuned import ROOT_OF_EPS, ZERO_COMPONENT

if TYPE_CHECKING:
    from signorini_fx.mechanics.contact_points.turned_supports import TurnedNodes


@dataclass(frozen=True)
class MovingFoundation:
    """The motion of rigid foundations at n contact points, where it is an unknown, see
    ``rigid_bodies``.

    Attributes:
        modes: displacement of the foundation of each point for each of the k unknowns, shape (n, d,
            k).
        fixed: which unknowns are prescribed, shape (k,).
        stiffness: of springs to the ground, force / length, shape (k,).
        number: of the foundation of each unknown among the ``bodies``, shape (k,).
    """

    modes: Array
    fixed: Flags
    stiffness: Array
    number: Ints
    bodies: Sequence[RigidBody]

    @property
    def loose(self) -> Flags:
        """Which unknowns contact alone holds, shape (k,)."""
        return ~self.fixed & (self.stiffness == 0.0)


@dataclass(frozen=True)
class CornerPoints:
    """Which of n contact points are those of corners of foundations, see
    ``obstacles.corner_points``.

    Attributes:
        number: of the point among those of the corners of its foundation, two of each, -1 at
            nodes, shape (n,).
        opening: the gap without what is given, of a node that of its place: nan, length, shape
            (n,).
        alone: which points see no foundation, with a gap beyond any reach, shape (n,).
        place: of the corner, nan at nodes, length, shape (n, d).
        facet: length of the facet under it, nan at nodes, shape (n,).
        slope: tangent of the angle between the facet and the nearer side, nan at nodes, shape (n,).
    """

    number: Ints
    opening: Array
    alone: Flags
    place: Array
    facet: Array
    slope: Array

    @classmethod
    def at_nodes(cls, alone: Flags, reach: float, dimension: int) -> CornerPoints:
        """Return those of points that are all at nodes, some of them alone."""
        unknown = np.full(alone.size, np.nan)
        return cls(
            np.full(alone.size, -1, dtype=np.int64),
            np.where(alone, reach, np.nan),
            alone,
            np.full((alone.size, dimension), np.nan),
            unknown,
            unknown,
        )

    @classmethod
    def joined(cls, parts: Sequence[CornerPoints]) -> CornerPoints:
        """Return those of several lists of points."""
        return cls(
            *(np.concatenate([getattr(part, one.name) for part in parts]) for one in fields(cls))
        )


@dataclass(frozen=True)
class ContactBoundary:
    """The contact nodes of this rank, n of them.

    Attributes:
        comm: the ranks that share the boundary.
        nodes: local number of the node (block of the function space), shape (n,).
        x: position, length, shape (n, d).
        weight: w_i, the area (in 2D: length) that belongs to the node, shape (n,).
        normal: outward unit normal n_i, shape (n, d).
        part: position of the effect in ``statement.contact`` that the node belongs to, shape (n,).
        free: which displacement components are not prescribed, shape (n, d); where points average,
            at some node.
        surface: of each part the space, the facets of this rank, and its number.
        global_nodes: global number of the node, shape (n,).
        averages: how each point averages the displacement around it.
        axes: the frame of each point that ``free`` is told in, one direction per column, shape (n,
            d, d).
        moving: foundations whose motion is an unknown; None: there are none.
        friction_axes: of friction that depends on the direction; None: none does.
        kinematics: of displacements with these components on these cells, whatever the scene is.
        pushing: the force of a unit pressure on the body of its node, per area and negative, shape
            (n, d), where that acts along derivatives of the gap; None: ``normal``.
        corners: which points are those of corners of foundations; None: all are those of nodes.
    """

    comm: MPI.Comm
    nodes: Indices
    x: Array
    weight: Array
    normal: Array
    part: Indices
    free: Flags
    surface: tuple[tuple[fem.FunctionSpace, Indices, int], ...]
    global_nodes: Ints
    averages: Averages
    axes: Array
    kinematics: Kinematics
    moving: MovingFoundation | None = None
    friction_axes: FrictionAxes | None = None
    pushing: Array | None = None
    corners: CornerPoints | None = None

    @cached_property
    def at_nodes(self) -> Flags:
        """Which points are those of nodes, shape (n,): a force at a corner is no pressure."""
        return self.number < 0

    @property
    def number(self) -> Ints:
        """The number of each point among those of corners, -1 at nodes, shape (n,)."""
        return np.full(self.size, -1) if self.corners is None else self.corners.number

    def interpolated(self, values: Array) -> Array:
        """Return values at the nodes of this rank, shape (nodes,), at the points, shape (n,);
        collective where there are corners.
        """
        if self.corners is None:
            return values[self.nodes]
        owned = np.nan_to_num(values[: self.surface[0][0].dofmap.index_map.size_local, None])
        at_nodes = from_owners(owned, self.averages.nodes, self.comm)
        return np.where(self.at_nodes, values[self.nodes], (self.averages.shares @ at_nodes)[:, 0])

    def moved(self, displacement: Array | None) -> Array:
        """Return the displacements of the points, length, shape (n, d), from those of the nodes of
        this rank, shape (nodes, d), None: none; collective.
        """
        if displacement is None:
            return np.zeros_like(self.x)
        owned = displacement[: self.surface[0][0].dofmap.index_map.size_local]
        at_nodes = from_owners(owned, self.averages.nodes, self.comm)
        return (self.averages.operator @ at_nodes.ravel()).reshape(self.x.shape)

    @property
    def size(self) -> int:
        """Number of contact nodes on this rank."""
        return int(self.nodes.size)

    @cached_property
    def segments(self) -> Ints:
        """Facets of this rank: the part, then global node numbers, shape (facets, 1 + points of a
        facet); in the plane in order along the facet, in 3D as basix has them.
        """
        return np.concatenate([segments_of(*part) for part in self.surface])

    @cached_property
    def centre(self) -> Array:
        """Return the points where the forces act on a rigid body, length, shape (n, d)."""
        return self.averages.arm

    @property
    def paired(self) -> bool:
        """Whether points are those of two bodies."""
        return self.averages.paired

    @cached_property
    def tangents(self) -> Array:
        """Tangents T_i, one per column, shape (n, d, d - 1): orthonormal, unless friction has a
        direction.
        """
        return self._axes if self.friction_axes is None else self._axes * self.friction_axes.scale

    @cached_property
    def cotangents(self) -> Array:
        """Return the dual basis of the tangents, shape (n, d, d - 1), which makes vectors of
        components of displacements; the tangents make those of forces.
        """
        return self._axes if self.friction_axes is None else self._axes / self.friction_axes.scale

    @cached_property
    def _axes(self) -> Array:
        """Orthonormal tangents; one is along a component that is prescribed, those of friction
        along its axes.
        """
        tangents = tangents_of(self.normal)
        if self.normal.shape[1] == 2:
            return tangents
        # Normals of a curved surface are off a support's plane by round-off of its cells.
        components = np.abs(np.einsum("ij,ijk->ik", self.normal, self.axes))
        for axis in range(3):
            held_across = (
                ~self.free[:, axis] & self.free.any(axis=1) & (components[:, axis] <= ROOT_OF_EPS)
            )
            along = self.axes[held_across, :, axis]
            tangents[held_across] = np.stack(
                (along, np.cross(self.normal[held_across], along)), axis=2
            )
        return (
            tangents
            if self.friction_axes is None
            else self.friction_axes.directions(self.normal, tangents)
        )

    @property
    def frames(self) -> Array:
        """(n, T) of each node, one direction per column, shape (n, d, d)."""
        return np.concatenate((self.normal[:, :, None], self.tangents), axis=2)

    @property
    def coframes(self) -> Array:
        """Return the dual basis of the frames, (n, T^-T), shape (n, d, d)."""
        return np.concatenate((self.normal[:, :, None], self.cotangents), axis=2)

    @cached_property
    def points(self) -> ContactPoints:
        """Return the contact points without coordinates, for the core."""
        orthonormal = np.concatenate((self.normal[:, :, None], self._axes), axis=2)
        frames = np.einsum("nji,njk->nik", self.axes, orthonormal)
        movable = np.einsum("nki,nk,nkj->nij", frames, self.free.astype(np.float64), frames)
        if self.moving is not None:
            moves = np.einsum(
                "nij,nik->njk", orthonormal, self.moving.modes[:, :, ~self.moving.fixed]
            )
            on_moving = moves.any(axis=(1, 2))
            movable[on_moving] = onto_range(
                movable[on_moving] + np.einsum("nik,njk->nij", moves[on_moving], moves[on_moving])
            )
        return ContactPoints(self.comm, self.weight, movable, self.x, self._shared)

    @property
    def _shared(self) -> SharedNodes:
        """The points that share a node with another one; none of those that average."""
        alone = np.flatnonzero(np.diff(self.averages.shares.indptr) == 1)
        _, node, times = np.unique(self.nodes[alone], return_inverse=True, return_counts=True)
        alone = alone[times[node] > 1]
        order = alone[np.argsort(self.nodes[alone], kind="stable")]
        nodes = np.split(order, np.flatnonzero(np.diff(self.nodes[order])) + 1)
        pairs = [pair for group in nodes for pair in permutations(map(int, group), 2)]
        points, beside = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
        return SharedNodes(points, beside, rmatvec(self.coframes[points], self.normal[beside]))

    def nodal_forces(self, pressure: Array, shear: Array) -> Array:
        """Nodal w (lambda n + T mu), shape (n, d), minus the forces on the body; with ``pushing``
        for n.
        """
        along = self.normal if self.pushing is None else self.pushing
        traction = pressure[:, None] * along + np.einsum("ik,ijk->ij", shear, self.tangents)
        return self.weight[:, None] * traction


def tangents_of(normal: Array) -> Array:
    """Orthonormal tangents of unit normals, one per column, shape (n, d, d - 1).

    In 2D t = (-n_2, n_1), along x[0] for a body above its foundation; in 3D any two of a
    right-handed frame (n, t_1, t_2) (Duff et al., J. Comput. Graph. Tech. 6 (2017) 1-8), which must
    not be compared from node to node.
    """
    if normal.shape[1] == 2:
        return np.stack((-normal[:, 1], normal[:, 0]), axis=1)[:, :, None]
    x, y, z = normal.T
    sign = np.where(z < 0, -1.0, 1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    first = np.stack((1.0 + sign * x * x * a, sign * b, -sign * x), axis=1)
    second = np.stack((b, sign + y * y * a, -y), axis=1)
    return np.stack((first, second), axis=2)


def join(parts: list[ContactBoundary]) -> ContactBoundary:
    """Several contact boundaries as one list of nodes."""
    names = ("nodes", "x", "weight", "normal", "part", "free", "global_nodes", "axes")
    joined_fields = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in names
    }
    pushing = None
    if any(part.pushing is not None for part in parts):
        pushing = np.concatenate(
            [part.normal if part.pushing is None else part.pushing for part in parts]
        )
    return ContactBoundary(
        parts[0].comm,
        **joined_fields,
        surface=tuple(surface for part in parts for surface in part.surface),
        averages=Averages.joined([part.averages for part in parts]),
        friction_axes=FrictionAxes.joined(
            [part.friction_axes for part in parts], [part.size for part in parts]
        ),
        kinematics=parts[0].kinematics,
        pushing=pushing,
        corners=None
        if all(part.corners is None for part in parts)
        else CornerPoints.joined(
            [
                part.corners
                or CornerPoints.at_nodes(np.zeros(part.size, dtype=bool), 0.0, part.x.shape[1])
                for part in parts
            ]
        ),
    )


def unit_contact_form(
    space: fem.FunctionSpace, facets: Indices, factor: Expr | None = None
) -> fem.Form:
    """(lambda, tau_N z) for lambda = 1: the nodal weights times the normals.

    ``factor``: of the surface measure.
    """
    mesh = space.mesh
    degree = space.element.basix_element.degree
    geometry = compat.geometry_degree(mesh)
    rule: dict[str, str | int] = {"quadrature_degree": lumped_degree(degree, geometry)}
    if mesh.topology.dim == 2 and (degree > 1 or factor is None):
        # The points are the nodes, with positive weights; on the axis of a body of revolution a
        # vertex would have none, and on surfaces these rules are not exact.
        rule = {
            "quadrature_rule": "GLL" if degree > 1 else "vertex",
            "quadrature_degree": 2 * degree - 1,
        }
    factor = fem.Constant(mesh, default_scalar_type(1.0)) if factor is None else factor
    ds = measure(mesh, [facets], rule)(1)
    return compile_form(factor * ufl.inner(ufl.TestFunction(space), ufl.FacetNormal(mesh)) * ds)


def nodal_points(
    space: fem.FunctionSpace, form: fem.Form, least: float
) -> tuple[Indices, Array, Array]:
    """Local numbers of contact nodes, their weights and normals, from the unit contact form; nodes
    whose weight is no larger than ``least`` times the largest one are no points; collective.
    """
    weighted_normals = assemble(form).reshape(-1, space.mesh.geometry.dim)
    size = np.linalg.norm(weighted_normals, axis=1)
    nodes = np.flatnonzero(size > least * parallel.largest(space.mesh.comm, size)).astype(np.int32)
    return nodes, size[nodes], weighted_normals[nodes] / size[nodes, None]


def contact_part(
    space: fem.FunctionSpace,
    points: tuple[Indices, Array, Array],
    averages: Averages,
    facets: Indices,
    index: int,
    turned: TurnedNodes | None = None,
) -> ContactBoundary:
    """Return the contact boundary of one foundation or pair from its ``points``, see
    ``nodal_points``.
    """
    dim = space.mesh.geometry.dim
    nodes, weight, normal = points
    return ContactBoundary(
        comm=space.mesh.comm,
        nodes=nodes,
        x=node_positions(space)[nodes, :dim],
        weight=weight,
        normal=normal,
        part=np.full(nodes.size, index, dtype=np.int32),
        free=averages.any_of(~averages.fixed),
        surface=((space, facets, index),),
        global_nodes=space.dofmap.index_map.local_to_global(nodes),
        averages=averages,
        axes=np.tile(np.eye(dim), (nodes.size, 1, 1))
        if turned is None
        else turned.frames_at(nodes),
        kinematics=of_components(space.mesh.topology.dim, dim),
    )


def no_points(space: fem.FunctionSpace) -> ContactBoundary:
    """Return the contact boundary of a body without contact."""
    dim = space.mesh.geometry.dim
    nowhere = np.zeros(0, dtype=np.int32)
    x = np.zeros((0, dim))
    averages = Averages.at_nodes(nowhere.astype(np.int64), x, x.astype(bool))
    return contact_part(space, (nowhere, np.zeros(0), x), averages, nowhere, 0)


def segments_of(space: fem.FunctionSpace, facets: Indices, part: int) -> Ints:
    """Return the segments of one part of a contact boundary."""
    side = space.mesh.topology.dim - 1
    local_nodes = facet_nodes(space, facets)
    # Vertices come first, then inner nodes: along a facet in 2D the second vertex is the last node.
    if averaging(space):
        local_nodes = local_nodes[:, : side + 1]  # of triangles: no other facets average
    if side == 1:
        local_nodes = local_nodes[:, [0, *range(2, local_nodes.shape[1]), 1]]
    nodes = space.dofmap.index_map.local_to_global(local_nodes.ravel()).reshape(local_nodes.shape)
    return np.column_stack((np.full(len(local_nodes), part, dtype=np.int64), nodes))


def contact_map(
    boundary: ContactBoundary,
    fixed: Flags,
    matrix: PETSc.Mat,
    rotation: PETSc.Mat | None,
    behind: int = 0,
) -> ContactMap:
    """B from the unknowns of the stiffness, of which some are ``fixed``; collective.

    ``rotation``: Q, where displacements are y = Q x, None: they are x.
    ``behind``: how many unknowns, which no point reaches, stand behind those of foundations that
        move.
    """
    columns, total = (matrix if rotation is None else rotation).getSizes()[0]
    count, dim = boundary.x.shape
    blocks = sp.bsr_array(boundary.averages.operator, blocksize=(dim, dim))
    values = (
        boundary.frames.transpose(0, 2, 1)[np.repeat(np.arange(count), np.diff(blocks.indptr))]
        @ blocks.data
    )
    at_nodes = values, boundary.averages.nodes[blocks.indices], blocks.indptr
    csr = sp.csr_array(sp.bsr_array(at_nodes, shape=(dim * count, dim * (total // dim))))
    csr.sum_duplicates()
    entries = csr.indptr.astype(PETSc.IntType), csr.indices.astype(PETSc.IntType), csr.data
    operator = PETSc.Mat().createAIJ(
        ((dim * count, None), (columns, None)), csr=entries, comm=matrix.comm
    )
    mapping = ContactMap(
        operator, boundary.points, fixed, _lift(boundary, operator), boundary.paired
    )
    if rotation is None:
        return mapping
    # What a tangent or a normal has of a component across it is round-off, and gamma makes a shear
    # of it: it is zero.
    mapping = mapping.after(rotation, fixed)
    mapping.operator.chop(ZERO_COMPONENT)
    if (moving := boundary.moving) is None:
        return mapping
    # [I, -R]: the map with the motion of foundations.
    (rows, _), (columns, total_columns) = mapping.operator.getSizes()
    csr = sp.csr_array(
        -np.einsum("nij,nik->njk", boundary.frames, moving.modes).reshape(rows, moving.number.size)
    )
    indices = (total_columns - behind - moving.number.size + csr.indices).astype(PETSc.IntType)
    entries = csr.indptr.astype(PETSc.IntType), indices, csr.data
    relative = PETSc.Mat().createAIJ(
        ((rows, None), (columns, None)), csr=entries, comm=boundary.comm
    )
    relative.axpy(1.0, mapping.operator, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    return replace(mapping, operator=relative, paired=True)


def block_diagonal(operator: PETSc.Mat, blocks: Array) -> PETSc.Mat:
    """Return the matrix with these blocks, shape (n, m, m), on the diagonal, for the rows of an
    operator; collective.
    """
    rows = operator.getSizes()[0]
    first = operator.getOwnershipRange()[0]
    numbers = np.arange(len(blocks) + 1)
    csr = sp.csr_array(sp.bsr_array((blocks, numbers[:-1], numbers), shape=(rows[0], rows[0])))
    csr.eliminate_zeros()
    entries = (
        csr.indptr.astype(PETSc.IntType),
        (first + csr.indices).astype(PETSc.IntType),
        csr.data,
    )
    return PETSc.Mat().createAIJ((rows, rows), csr=entries, comm=operator.comm)


def _lift(boundary: ContactBoundary, operator: PETSc.Mat) -> PETSc.Mat | None:
    """S of ``ContactMap`` between two bodies whose points share no node; else None; collective."""
    averages = boundary.averages
    if not averages.paired or averages.lift is None:
        return None
    alone = boundary.nodes[np.diff(averages.shares.indptr) == 1]
    if parallel.any_rank(boundary.comm, np.unique(alone).size < alone.size):
        return None
    dim = boundary.x.shape[1]
    blocks = (boundary.coframes, np.arange(boundary.size), np.arange(boundary.size + 1))
    size = dim * boundary.size
    frames = sp.bsr_array(blocks, shape=(size, size))
    lift = sp.csr_array((sp.kron(averages.lift, sp.eye_array(dim)) @ frames).T)
    columns = (dim * averages.nodes[:, None] + np.arange(dim)).ravel()[lift.indices]
    csr = (lift.indptr.astype(PETSc.IntType), columns.astype(PETSc.IntType), lift.data)
    inverse = (
        PETSc.Mat()
        .createAIJ(operator.getSizes(), csr=csr, comm=operator.comm)
        .transpose(PETSc.Mat())
    )
    # Points see half the rotation of their own nodes, too, along other directions than the
    # displacements that cause it: one step of Newton's method for the inverse of B S, S (2 - B S),
    # leaves the square of a small angle.
    turned = operator.matMult(inverse)
    turned.scale(-1.0)
    turned.shift(2.0)
    return inverse.matMult(turned)
