"""The results of a solve, which this package evaluates and writes: it must not know which algorithm
found them.
"""

# First: PETSc and dolfinx from PyPI find the library of MPI where it is loaded.
import mpi4py.MPI  # noqa: F401
