"""Frees the objects of PETSc that are no longer used on several ranks.

To destroy them is collective, and Python forgets objects at another time on each rank.  Therefore petsc4py only sets
them aside there, with their matrices and factors, until all ranks ask for a clean-up of their communicator.  dolfinx
has a communicator for each mesh, which is gone with the mesh; an object that stays keeps PETSc's copy of it for us.
"""

from __future__ import annotations

import weakref
from dataclasses import dataclass

import mpi4py.MPI as MPI  # first, see signorini_fx.body
from dolfinx import mesh as dmesh
from petsc4py import PETSc

_SAME = (MPI.IDENT, MPI.CONGRUENT)


@dataclass(frozen=True, eq=False)
class _Kept:
    """A mesh, and an object of PETSc on its communicator."""

    mesh: weakref.ReferenceType[dmesh.Mesh]
    holder: PETSc.Vec

    @property
    def comm(self) -> MPI.Comm:
        """PETSc's copy of the communicator of the mesh."""
        return self.holder.comm.tompi4py()


_kept: list[_Kept] = []


def free_unused(mesh: dmesh.Mesh) -> None:
    """Free what is no longer used on the communicators of all meshes on the ranks of this one, which is noted for later
    calls; collective.
    """
    if mesh.comm.size == 1:  # destroyed at once
        return
    here = [kept for kept in _kept if MPI.Comm.Compare(kept.comm, mesh.comm) in _SAME]
    for kept in here:
        PETSc.garbage_cleanup(kept.comm)
    # A rank may have forgotten a mesh that another one still has.
    gone = mesh.comm.allreduce(sum(1 << k for k, kept in enumerate(here) if kept.mesh() is None), MPI.BAND)
    for k, kept in enumerate(here):
        if gone >> k & 1:
            kept.holder.destroy()
            _kept.remove(kept)
    if not any(kept.mesh() is mesh for kept in here):
        _kept.append(_Kept(weakref.ref(mesh), PETSc.Vec().createMPI((0, 0), comm=mesh.comm)))
