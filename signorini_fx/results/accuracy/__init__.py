"""The error of a solution and the cost of reducing it; which mesh comes next is decided by
``solving``.
"""

# First: PETSc and dolfinx from PyPI find the library of MPI where it is loaded.
import mpi4py.MPI  # noqa: F401
