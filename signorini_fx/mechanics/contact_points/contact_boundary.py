"""The contact boundary: its nodes with weights and normals, the traces tau_N y and tau_T y, and the
map B to them.

With the nodal quadrature rule of ``mesh_entities`` the products on Gamma_c are sums over nodes,
(lambda, tau_N z) = sum_i w_i lambda_i n_i . z_i.  A contact point belongs to the rank that owns the
degrees of freedom of its node.  A node of two contact boundaries has two entries, one for each
normal.  On quadratic tetrahedra, where this rule has no weight at vertices, the contact points are
the vertices, and z_i is an average (``averages.py``).
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
from signorini_fx.mechanics.kinematics import Kinematics, of_components
from signorini_fx.mechanics.laws.directed import FrictionAxes
from signorini_fx.mechanics.statement.rigid_body import RigidBody
from signorini_fx.tuned import ROOT_OF_EPS, ZERO_COMPONENT

if TYPE_CHECKING:
    from signorini_fx.mechanics.contact_points.turned_supports import TurnedNodes


@dataclass(frozen=True)
class MovingFoundation:
    """The motion of rigid foundations with unknown motion at n contact points, see
    ``rigid_bodies``.

    Attributes:
        modes: displacement of the foundation at each point per unit of each of the k unknowns,
            shape (n, d, k).
        fixed: which unknowns are prescribed, shape (k,).
        stiffness: of springs to the ground, force / length, shape (k,).
        number: position in ``bodies`` of the body of each unknown, shape (k,).
        bodies: the rigid bodies.
    """

    modes: Array
    fixed: Flags
    stiffness: Array
    number: Ints
    bodies: Sequence[RigidBody]

    @property
    def loose(self) -> Flags:
        """Which unknowns only contact restrains, shape (k,)."""
        return ~self.fixed & (self.stiffness == 0.0)


@dataclass(frozen=True)
class CornerPoints:
    """Which of n contact points lie below corners of foundations, see ``obstacles.corner_points``.

    Values at points that are nodes are nan, if not said otherwise.

    Attributes:
        number: of the point among those of the corners of its foundation, two for each corner; -1
            at nodes, shape (n,).
        opening: the gap from the geometry alone, which replaces that at nodes; nan: the gap at the
            node is kept, length, shape (n,).
        alone: which points have no foundation opposite, with a gap beyond any reach, shape (n,).
        place: position of the corner, length, shape (n, d).
        facet: length of the facet under it, shape (n,).
        slope: tangent of the angle between the facet and the nearer side of the corner, shape (n,).
    """

    number: Ints
    opening: Array
    alone: Flags
    place: Array
    facet: Array
    slope: Array

    @classmethod
    def at_nodes(cls, alone: Flags, reach: float, dimension: int) -> CornerPoints:
        """Return the record of points that are all nodes.

        Args:
            alone: which of them have no foundation opposite, shape (n,).
            reach: the gap of these, length.
            dimension: d.
        """
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
        """Return the records of several lists of points as one."""
        return cls(
            *(np.concatenate([getattr(part, one.name) for part in parts]) for one in fields(cls))
        )


@dataclass(frozen=True)
class ContactBoundary:
    """The n contact points of this rank.

    Attributes:
        comm: the ranks that share the boundary.
        nodes: local number of the node (block of the function space), shape (n,).
        x: position, length, shape (n, d).
        weight: w_i, the area (in 2D: length) that belongs to the node, shape (n,).
        normal: outward unit normal n_i, shape (n, d).
        part: position in ``statement.contact`` of the contact of each point, shape (n,).
        free: which displacement components along ``axes`` are not prescribed, shape (n, d); where
            points average, at some node of them.
        surface: the space, the facets of this rank and the number of each part.
        global_nodes: global number of the node, shape (n,).
        averages: how each point averages the displacement around it.
        axes: the frame of each point to which ``free`` refers, one direction per column, shape (n,
            d, d).
        kinematics: of the displacement components: Cartesian or with torsion, whatever the
            hypothesis of the scene is.
        moving: foundations with unknown motion; None: there are none.
        friction_axes: axes of friction that depends on the direction; None: there is none.
        pushing: minus the force of a unit pressure on the body of its node, per area, shape (n, d),
            where it is not along ``normal`` but along derivatives of the gap; None: ``normal``.
        corners: which points lie below corners of foundations; None: all are nodes.
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
        """Which points are nodes, shape (n,); tractions exist at these only, as corners transmit
        point forces.
        """
        return self.number < 0

    @property
    def number(self) -> Ints:
        """The number of each point among those of corners, -1 at nodes, shape (n,)."""
        return np.full(self.size, -1) if self.corners is None else self.corners.number

    def interpolated(self, values: Array) -> Array:
        """Return nodal values at the points, shape (n,); collective if there are corners.

        Args:
            values: at the nodes of this rank, shape (nodes,).
        """
        if self.corners is None:
            return values[self.nodes]
        owned = np.nan_to_num(values[: self.surface[0][0].dofmap.index_map.size_local, None])
        at_nodes = from_owners(owned, self.averages.nodes, self.comm)
        return np.where(self.at_nodes, values[self.nodes], (self.averages.shares @ at_nodes)[:, 0])

    def moved(self, displacement: Array | None) -> Array:
        """Return the displacements of the points, length, shape (n, d); collective.

        Args:
            displacement: of the nodes of this rank, shape (nodes, d); None: zero.
        """
        if displacement is None:
            return np.zeros_like(self.x)
        owned = displacement[: self.surface[0][0].dofmap.index_map.size_local]
        at_nodes = from_owners(owned, self.averages.nodes, self.comm)
        return (self.averages.operator @ at_nodes.ravel()).reshape(self.x.shape)

    @property
    def size(self) -> int:
        """The number of contact points on this rank."""
        return int(self.nodes.size)

    @cached_property
    def segments(self) -> Ints:
        """The facets of this rank: the number of the part, then global node numbers, shape (facets,
        1 + nodes of a facet).

        In 2D nodes are in order along the facet, in 3D in the order of basix.
        """
        return np.concatenate([segments_of(*part) for part in self.surface])

    @cached_property
    def centre(self) -> Array:
        """The points where the contact forces act on a rigid body, length, shape (n, d)."""
        return self.averages.arm

    @property
    def paired(self) -> bool:
        """Whether points belong to two bodies."""
        return self.averages.paired

    @cached_property
    def tangents(self) -> Array:
        """The tangents T_i, one per column, shape (n, d, d - 1): orthonormal, unless friction
        depends on the direction.
        """
        return self._axes if self.friction_axes is None else self._axes * self.friction_axes.scale

    @cached_property
    def cotangents(self) -> Array:
        """The dual basis of the tangents, shape (n, d, d - 1).

        It turns components of displacements into vectors, as the tangents do for forces.
        """
        return self._axes if self.friction_axes is None else self._axes / self.friction_axes.scale

    @cached_property
    def _axes(self) -> Array:
        """Orthonormal tangents, shape (n, d, d - 1).

        One of them is along a prescribed component if there is one in the tangent plane; with axes
        of friction they follow these.
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
        """The frame (n, T) of each point, one direction per column, shape (n, d, d)."""
        return np.concatenate((self.normal[:, :, None], self.tangents), axis=2)

    @property
    def coframes(self) -> Array:
        """The dual basis (n, T^-T) of the frames, shape (n, d, d)."""
        return np.concatenate((self.normal[:, :, None], self.cotangents), axis=2)

    @cached_property
    def points(self) -> ContactPoints:
        """The contact points in the form that algorithms need, without the mesh."""
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
        """The points that share their node with another one; points that average are left out."""
        alone = np.flatnonzero(np.diff(self.averages.shares.indptr) == 1)
        _, node, times = np.unique(self.nodes[alone], return_inverse=True, return_counts=True)
        alone = alone[times[node] > 1]
        order = alone[np.argsort(self.nodes[alone], kind="stable")]
        nodes = np.split(order, np.flatnonzero(np.diff(self.nodes[order])) + 1)
        pairs = [pair for group in nodes for pair in permutations(map(int, group), 2)]
        points, beside = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
        return SharedNodes(points, beside, rmatvec(self.coframes[points], self.normal[beside]))

    def nodal_forces(self, pressure: Array, shear: Array) -> Array:
        """Return w (lambda n + T mu), which is minus the contact forces on the body, shape (n, d).

        ``pushing`` replaces n where it is given.

        Args:
            pressure: lambda, stress, shape (n,).
            shear: mu, stress, along the tangents, shape (n, d - 1).
        """
        along = self.normal if self.pushing is None else self.pushing
        traction = pressure[:, None] * along + np.einsum("ik,ijk->ij", shear, self.tangents)
        return self.weight[:, None] * traction


def tangents_of(normal: Array) -> Array:
    """Return orthonormal tangents of unit normals, one per column, shape (n, d, d - 1).

    In 2D t = (-n_2, n_1), along x[0] for a body above its foundation.  In 3D they make right-handed
    frames (n, t_1, t_2) (Duff et al., J. Comput. Graph. Tech. 6 (2017) 1-8), which may jump from
    node to node.
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
    """Return several contact boundaries as one."""
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
    """Return the form (lambda, tau_N z) for lambda = 1: its vector has the nodal weights times the
    normals.

    Args:
        space: of the displacement.
        facets: exterior facets of the contact boundary.
        factor: of the surface measure, UFL; None: 1.
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
    """Return local numbers, weights and normals of the contact nodes; collective.

    Nodes whose weight is at most ``least`` times the largest one are left out.

    Args:
        space: of the displacement.
        form: see ``unit_contact_form``.
        least: relative weight.
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
    """Return the contact boundary of one foundation or pair.

    Args:
        space: of the displacement.
        points: local numbers, weights and normals, see ``nodal_points``.
        averages: how the points average.
        facets: exterior facets.
        index: position of the contact in the scene.
        turned: nodes with supports along no axis; None: there are none.
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
    """Return a contact boundary without points, for a body without contact."""
    dim = space.mesh.geometry.dim
    nowhere = np.zeros(0, dtype=np.int32)
    x = np.zeros((0, dim))
    averages = Averages.at_nodes(nowhere.astype(np.int64), x, x.astype(bool))
    return contact_part(space, (nowhere, np.zeros(0), x), averages, nowhere, 0)


def segments_of(space: fem.FunctionSpace, facets: Indices, part: int) -> Ints:
    """Return ``ContactBoundary.segments`` of one part."""
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
    """Return the map B from the unknowns of the stiffness to traces at the contact points;
    collective.

    Args:
        boundary: the contact points.
        fixed: which unknowns of this rank are prescribed.
        matrix: the stiffness.
        rotation: Q with displacements y = Q x; None: the unknowns x are displacements.
        behind: how many unknowns, such as pressures, follow those of rigid bodies; no contact point
            depends on them.
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
    # Entries at components perpendicular to a normal or tangent are round-off.  They are dropped,
    # because gamma would turn them into tractions.
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
    """Return a block diagonal matrix with the row layout of an operator; collective.

    Args:
        operator: gives the layout.
        blocks: the blocks of this rank, shape (n, m, m).
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
    """Return S of ``ContactMap``, if there are two bodies and no points share a node, else None;
    collective.
    """
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
    # B also contains half the rotation of the points' own nodes, in other directions than the
    # displacements that cause it, so B S is only nearly the identity.  One step of Newton's method
    # for its inverse, S (2 - B S), leaves the square of a small angle.
    turned = operator.matMult(inverse)
    turned.scale(-1.0)
    turned.shift(2.0)
    return inverse.matMult(turned)
