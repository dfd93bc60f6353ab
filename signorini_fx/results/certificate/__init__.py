"""The certificate: forces, gaps, slips and conditions of a result, evaluated anew from what is
stated of the problem.

It finds wrong states; wrong forms are for the oracle and the tests.  It must not import what has
solved the problem: neither algorithms, nor regularised problems, nor linear algebra.
"""

# First: PETSc and dolfinx from PyPI find the library of MPI where it is loaded.
import mpi4py.MPI  # noqa: F401
