"""Derivatives of scalar results by the data of a problem, by one adjoint solve.

This package linearises an existing solution with the system that solved it, and must not decide how
a solution is found.
"""

# First: PETSc and dolfinx from PyPI find the library of MPI where it is loaded.
import mpi4py.MPI  # noqa: F401
