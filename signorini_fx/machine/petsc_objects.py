"""Frees PETSc objects that are no longer used, on several ranks.

Destroying them is collective, but Python collects objects at different times on each rank.
Therefore petsc4py only sets them aside, with their matrices and factors, until all ranks request a
clean-up of their communicator.  dolfinx has a communicator for each mesh, which is freed with the
mesh; a PETSc object that is kept here keeps PETSc's copy of it alive.
"""

from __future__ import annotations

import weakref

import mpi4py.MPI as MPI  # first, see signorini_fx.mechanics.body
from dolfinx import mesh as dmesh
from petsc4py import PETSc

_SAME_COMMUNICATOR = (MPI.IDENT, MPI.CONGRUENT)


# Meshes, each with an object of PETSc on its communicator.
_mesh_objects: list[tuple[weakref.ReferenceType[dmesh.Mesh], PETSc.Vec]] = []


def free_unused(mesh: dmesh.Mesh) -> None:
    """Free the unused PETSc objects of all meshes on the same ranks as this one, and register this
    mesh; collective.
    """
    if mesh.comm.size == 1:  # destroyed at once
        return
    entries = []
    for entry in _mesh_objects:
        comm = entry[1].comm.tompi4py()  # PETSc's copy of the communicator of the mesh
        if MPI.Comm.Compare(comm, mesh.comm) in _SAME_COMMUNICATOR:
            entries.append(entry)
            PETSc.garbage_cleanup(comm)
    # A rank may have forgotten a mesh that another one still has.
    gone = mesh.comm.allreduce(
        sum(1 << k for k, (known, _) in enumerate(entries) if known() is None), MPI.BAND
    )
    for k, entry in enumerate(entries):
        if gone >> k & 1:
            entry[1].destroy()
            _mesh_objects.remove(entry)
    if not any(known() is mesh for known, _ in entries):
        _mesh_objects.append((weakref.ref(mesh), PETSc.Vec().createMPI((0, 0), comm=mesh.comm)))
