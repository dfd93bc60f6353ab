"""Scipy matrices on one rank as an elastic body with contact."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.algebra import Settings
from signorini_fx.algebra.algorithms.task import Task
from signorini_fx.algebra.contact.contact_map import ContactMap
from signorini_fx.algebra.contact.motions import FreeMotions, RigidLoad
from signorini_fx.algebra.contact.points import ContactPoints, PointGroups
from signorini_fx.algebra.linalg import Elasticity, LoadCase
from signorini_fx.records import History
from signorini_fx.tuned import SAME_NUMBER

_Floats = npt.NDArray[np.float64]


def from_scipy(
    stiffness: Any,
    load: _Floats,
    operator: Any,
    weight: _Floats,
    *,
    prescribed: tuple[npt.NDArray[np.int64], _Floats] | None = None,
    modes: _Floats | None = None,
) -> tuple[Elasticity, FreeMotions]:
    """An elastic body of one piece with one load case, and its free rigid motions at the contact
    points.

    Args:
        stiffness: K without supports, symmetric, sparse, shape (N, N).
        load: f, forces, shape (N,).
        operator: B, sparse, shape (n d, N): d rows for each contact point, the relative
        displacement along the normal,
            positive towards the foundation, then along the tangents.
        weight: area of each contact point (in 2D, per unit thickness, length), shape (n,).
        prescribed: numbers and values of the prescribed unknowns; None: there are none.
        modes: the rigid motions that they leave free, zero at the prescribed unknowns, shape (N,
        k); None: there are
            none.
    """
    matrix, count, points = sp.csr_array(stiffness, dtype=np.float64), load.size, weight.size
    fixed, start = np.zeros(count, dtype=bool), np.zeros(count)
    if prescribed is not None:
        fixed[prescribed[0]], start[prescribed[0]] = True, prescribed[1]
    free, diagonal = sp.diags_array((~fixed).astype(np.float64)), float(matrix.diagonal().max())
    lifted = np.where(fixed, diagonal * start, load - matrix @ start)
    supported = sp.csr_array(free @ matrix @ free + sp.diags_array(diagonal * fixed))
    rows = sp.csr_array(operator, dtype=np.float64)
    d, moving = rows.shape[0] // points, sp.csr_array(rows @ free)
    gram = np.array(
        [[moving[i::d].multiply(moving[j::d]).sum(axis=1) for j in range(d)] for i in range(d)]
    )
    values, vectors = np.linalg.eigh(gram.transpose(2, 0, 1))
    movable = np.einsum(
        "nik,nk,njk->nij", vectors, values > SAME_NUMBER * values.max(initial=0.0), vectors
    )
    at = ContactPoints(
        MPI.COMM_SELF, weight, movable, np.arange(points)[:, None].astype(np.float64)
    )
    contact = ContactMap(_matrix(rows), at, fixed)
    motions = [_vector(mode) for mode in (np.zeros((0, count)) if modes is None else modes.T)]
    forces, assembly = _vector(np.where(fixed, 0.0, load)), np.zeros(len(motions), dtype=np.int64)
    size = np.full(len(motions), forces.norm(PETSc.NormType.NORM_1))
    resultant = RigidLoad(np.array([mode.dot(forces) for mode in motions]), size, assembly)
    petsc = _matrix(supported)
    petsc.setOption(PETSc.Mat.Option.SPD, True)
    case = LoadCase(_vector(lifted), _vector(start), resultant)
    relative = np.zeros((points, d, len(motions)))
    for number, mode in enumerate(motions):
        relative[:, 0, number], relative[:, 1:, number] = contact.traces(mode)
    groups = PointGroups.of(at, at.everywhere[:, None])
    free_motions = FreeMotions(at, relative, assembly, np.zeros(points, dtype=np.int64), groups)
    return Elasticity(petsc, [case], contact, len(motions)), free_motions


def task_of(system, motions, gap, law=None, settings=None):
    """The contact problem with the natural unit of gamma that its stiffness shows."""
    natural = system.contact.natural_stiffness(system.matrix.getDiagonal())
    coulomb = law is not None and law.follows_pressure
    common = {"has_coulomb": coulomb, "history": History()}
    return Task.of(
        system, motions, gap, law, settings=settings or Settings(), natural_gamma=natural, **common
    )


def _matrix(matrix: Any) -> PETSc.Mat:
    csr = (matrix.indptr.astype(PETSc.IntType), matrix.indices.astype(PETSc.IntType), matrix.data)
    return PETSc.Mat().createAIJ(matrix.shape, csr=csr, comm=MPI.COMM_SELF)


def _vector(values: _Floats) -> PETSc.Vec:
    return PETSc.Vec().createWithArray(np.ascontiguousarray(values).copy(), comm=MPI.COMM_SELF)
