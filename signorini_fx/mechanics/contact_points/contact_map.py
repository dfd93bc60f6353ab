"""The contact map B of a contact boundary: what points reach are nodes, which it selects, or averages, and rotates."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from petsc4py import PETSc

from signorini_fx.algebra.contact.contact_map import ContactMap
from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary, MovingFoundation
from signorini_fx.tuned import ZERO_COMPONENT


def contact_map(
    boundary: ContactBoundary | None,
    fixed: npt.NDArray[np.bool_],
    matrix: PETSc.Mat,
    rotation: PETSc.Mat | None,
    dimension: int,
    behind: int = 0,
) -> ContactMap:
    """B from the unknowns of the stiffness; collective.

    Args:
        boundary: the contact points; None: there are none.
        fixed: the prescribed unknowns of this rank.
        matrix: the stiffness, for the layout of x.
        rotation: Q, where displacements are y = Q x; None: they are x.
        dimension: of space.
        behind: how many unknowns stand behind those of foundations that move, which no point reaches.
    """
    (columns, _), _ = (matrix if rotation is None else rotation).getSizes()
    if boundary is None:
        return ContactMap.without_contact(matrix, fixed, dimension)
    count, dim = boundary.size, dimension
    nodes = boundary.reached.astype(np.int64)
    point, values = np.arange(count), boundary.frames.transpose(0, 2, 1)
    room: Any = (dim, 0)
    if boundary.averages is not None:
        blocks = sp.bsr_array(boundary.averages.operator, blocksize=(dim, dim))
        point, nodes = np.repeat(point, np.diff(blocks.indptr)), nodes[blocks.indices]
        values = values[point] @ blocks.data
        row_entries = dim * int(np.bincount(point, minlength=count).max(initial=1))
        room = (min(row_entries, columns), row_entries)
    operator = PETSc.Mat().createAIJ(((count * dim, None), (columns, None)), nnz=room, comm=matrix.comm)
    if point.size:
        rows = operator.getOwnershipRange()[0] + dim * point[:, None] + np.arange(dim)
        unknowns = dim * nodes[:, None] + np.arange(dim)
        values = np.ascontiguousarray(values)
        operator.setValuesRCV(rows.astype(PETSc.IntType), unknowns.astype(PETSc.IntType), values, addv=True)
    operator.assemble()
    mapping = ContactMap(operator, boundary.points, fixed, _lift(boundary, operator), boundary.paired)
    if rotation is None:
        return mapping
    # What a tangent or a normal has of a component across it is round-off, and gamma makes a shear of it: it is zero.
    mapping = mapping.after(rotation, fixed)
    mapping.operator.chop(ZERO_COMPONENT)
    return mapping if boundary.moving is None else _relative_to_foundations(mapping, boundary, boundary.moving, behind)


def _relative_to_foundations(
    contact: ContactMap, boundary: ContactBoundary, moving: MovingFoundation, behind: int
) -> ContactMap:
    """[I, -R]: the map with the motion of foundations; after their k unknowns come ``behind`` others; collective."""
    (rows, _), (columns, total_columns) = contact.operator.getSizes()
    (_, last), entries = moving.modes.shape[1:], -np.einsum("nij,nik->njk", boundary.frames, moving.modes)
    csr = sp.csr_array(entries.reshape(rows, last))
    indices = (total_columns - behind - last + csr.indices).astype(PETSc.IntType)
    relative = PETSc.Mat().createAIJ(
        ((rows, None), (columns, None)), csr=(csr.indptr.astype(PETSc.IntType), indices, csr.data), comm=boundary.comm
    )
    relative.axpy(1.0, contact.operator, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    return replace(contact, operator=relative, paired=True)


def with_rotations(contact: ContactMap, boundary: ContactBoundary) -> PETSc.Mat:
    """B with rows more after those of each point: the rotations of the rigid body that it touches, times L; collective.

    Args:
        contact: B, with the unknowns of rigid bodies as its last columns.
        boundary: the contact points, with rigid bodies that move.
    """
    moving, dim, count = boundary.moving, boundary.x.shape[1], boundary.size
    assert moving is not None
    (_, (columns, total)) = contact.operator.getSizes()
    each = moving.number.size // len(moving.bodies)
    reached = (moving.modes != 0.0).any(axis=1)
    touches = np.where(reached.any(axis=1), moving.number[reached.argmax(axis=1)], -1)
    points = np.flatnonzero(touches >= 0)
    starts, names, values = contact.operator.getValuesCSR()
    shape = (dim * count, total)
    along = sp.csr_array((values, names.astype(np.int64), starts.astype(np.int64)), shape=shape)
    turns = each - dim
    rows = (turns * points[:, None] + np.arange(turns)).ravel()
    at = (total - moving.number.size + each * touches[points][:, None] + dim + np.arange(turns)).ravel()
    about = sp.csr_array((np.ones(rows.size), (rows, at)), shape=(turns * count, total))
    order = np.column_stack(
        (
            np.arange(dim * count).reshape(count, dim),
            dim * count + np.arange(turns * count).reshape(count, turns),
        )
    ).ravel()
    matrix = sp.csr_array(sp.vstack((along, about), format="csr")[order])
    csr = (matrix.indptr.astype(PETSc.IntType), matrix.indices.astype(PETSc.IntType), matrix.data)
    return PETSc.Mat().createAIJ(((each * count, None), (columns, None)), csr=csr, comm=contact.operator.comm)


def block_diagonal(operator: PETSc.Mat, blocks: Nodal) -> PETSc.Mat:
    """The matrix with these blocks, shape (n, m, m), on the diagonal, for the rows of an operator; collective."""
    rows, first = operator.getSizes()[0], operator.getOwnershipRange()[0]
    count, size, _ = blocks.shape
    matrix = PETSc.Mat().createAIJ((rows, rows), nnz=(size, 0), comm=operator.comm)
    numbers = (first + np.arange(count * size).reshape(count, size)).astype(PETSc.IntType)
    if count:
        matrix.setValuesRCV(numbers, numbers, np.ascontiguousarray(blocks))
    matrix.assemble()
    return matrix


def _lift(boundary: ContactBoundary, operator: PETSc.Mat) -> PETSc.Mat | None:
    """S of ``ContactMap`` where two bodies are in contact; None: else, or where points share a node; collective."""
    averages = boundary.averages
    if averages is None or not averages.paired or averages.lift is None:
        return None
    alone = boundary.nodes[np.diff(averages.shares.indptr) == 1]
    if parallel.any_rank(boundary.comm, np.unique(alone).size < alone.size):
        return None
    dim = boundary.x.shape[1]
    blocks, size = (boundary.coframes, np.arange(boundary.size), np.arange(boundary.size + 1)), dim * boundary.size
    frames = sp.bsr_array(blocks, shape=(size, size))
    lift = sp.csr_array((sp.kron(averages.lift, sp.eye_array(dim)) @ frames).T)
    columns = (dim * averages.nodes[:, None] + np.arange(dim)).ravel()[lift.indices]
    csr = (lift.indptr.astype(PETSc.IntType), columns.astype(PETSc.IntType), lift.data)
    inverse = PETSc.Mat().createAIJ(operator.getSizes(), csr=csr, comm=operator.comm).transpose(PETSc.Mat())
    # Points see half the rotation of their own nodes, too, which is along other directions than the displacements that
    # cause it: one step of Newton's method for the inverse of B S, S (2 - B S), leaves the square of a small angle.
    turned = operator.matMult(inverse)
    turned.scale(-1.0)
    turned.shift(2.0)
    return inverse.matMult(turned)
