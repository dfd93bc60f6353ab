"""The certificate: forces, gaps, slips and conditions of a result, evaluated anew by code that the solver does not use.

This package takes a displacement and contact tractions, and what is stated of the problem.  It must not import what has
solved it: neither algorithms, nor regularised problems, nor linear algebra.
"""

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
