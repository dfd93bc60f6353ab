"""Derivatives of scalar results by the data of a problem, by one adjoint solve.

It linearises a solution that is there, with the system that has solved it, and must not decide how
one is found.
"""

# First: PETSc and dolfinx from PyPI find the library of MPI where it is loaded.
import mpi4py.MPI  # noqa: F401
