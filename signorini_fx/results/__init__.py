"""The results of a solve: the solution with its certificate, the summary, and the files of a result folder.

This package evaluates and writes.  It must not change a solution, nor know which algorithm found it.
"""

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
