"""The results of a solve: this package evaluates and writes them.

It must not depend on the algorithm that found them.
"""

# First: PETSc and dolfinx from PyPI find the library of MPI where it is loaded.
import mpi4py.MPI  # noqa: F401
