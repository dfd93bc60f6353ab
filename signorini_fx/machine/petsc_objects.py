"""Frees the objects of PETSc that are no longer used on several ranks.

To destroy them is collective, and Python forgets objects at another time on each rank.  Therefore petsc4py only sets
them aside there, with their matrices and factors, until all ranks ask for a clean-up of their communicator.  dolfinx
has a communicator for each mesh, which is gone with the mesh; an object that stays keeps PETSc's copy of it for us.
"""

from __future__ import annotations

import weakref
from dataclasses import dataclass

import mpi4py.MPI as MPI  # first, see signorini_fx.mechanics.body
from dolfinx import mesh as dmesh
from petsc4py import PETSc

_SAME_COMMUNICATOR = (MPI.IDENT, MPI.CONGRUENT)


@dataclass(frozen=True, eq=False)
class _MeshObject:
    """A mesh, and an object of PETSc on its communicator."""

    mesh: weakref.ReferenceType[dmesh.Mesh]
    holder: PETSc.Vec

    @property
    def comm(self) -> MPI.Comm:
        """PETSc's copy of the communicator of the mesh."""
        return self.holder.comm.tompi4py()


_mesh_objects: list[_MeshObject] = []


def free_unused(mesh: dmesh.Mesh) -> None:
    """Free what is no longer used on the communicators of all meshes on the ranks of this one, which is noted for later
    calls; collective.
    """
    if mesh.comm.size == 1:  # destroyed at once
        return
    entries = [entry for entry in _mesh_objects if MPI.Comm.Compare(entry.comm, mesh.comm) in _SAME_COMMUNICATOR]
    for entry in entries:
        PETSc.garbage_cleanup(entry.comm)
    # A rank may have forgotten a mesh that another one still has.
    gone = mesh.comm.allreduce(sum(1 << k for k, entry in enumerate(entries) if entry.mesh() is None), MPI.BAND)
    for k, entry in enumerate(entries):
        if gone >> k & 1:
            entry.holder.destroy()
            _mesh_objects.remove(entry)
    if not any(entry.mesh() is mesh for entry in entries):
        _mesh_objects.append(_MeshObject(weakref.ref(mesh), PETSc.Vec().createMPI((0, 0), comm=mesh.comm)))
