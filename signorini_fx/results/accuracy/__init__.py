"""The error of a solution and the cost of reducing it: error estimators and the convergence table.

This package evaluates solutions on one mesh or on several.  It must not start a solve: ``solving`` decides which mesh
comes next.
"""

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
