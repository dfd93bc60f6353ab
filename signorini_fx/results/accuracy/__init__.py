"""The error of a solution and the cost of reducing it; ``solving`` decides which mesh comes
next.
"""

# First: PETSc and dolfinx from PyPI find the library of MPI where it is loaded.
import mpi4py.MPI  # noqa: F401
