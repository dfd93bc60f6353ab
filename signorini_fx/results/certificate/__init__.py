"""The certificate: an independent check of a result.

Forces, gaps, slips and all conditions are evaluated anew from the statement of the problem.  It
finds wrong states; wrong forms are found by the oracle and the tests.  It must not import what has
solved the problem: neither algorithms, nor regularised problems, nor linear algebra.
"""

# First: PETSc and dolfinx from PyPI find the library of MPI where it is loaded.
import mpi4py.MPI  # noqa: F401
