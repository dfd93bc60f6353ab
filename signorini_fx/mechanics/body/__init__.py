"""The elastic body: from a scene and its mesh to the assembled stiffness and loads, supports and
rigid motions.

The result is a task with a linear system.  This package does not depend on the algorithm that
solves it.
"""

# First: PETSc and dolfinx from PyPI find the library of MPI where it is loaded.
import mpi4py.MPI  # noqa: F401
