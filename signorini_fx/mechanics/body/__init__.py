"""The elastic body: from a scene and its mesh to the assembled stiffness and loads, supports and
rigid motions.

It hands them to the core as a task with its linear system, and must not know by which algorithm
that is solved.
"""

# First: PETSc and dolfinx from PyPI find the library of MPI where it is loaded.
import mpi4py.MPI  # noqa: F401
