"""Studies on top of the package: which method is cheapest for which accuracy, measured against a reference solution.

No other package imports it: an add-on.
"""

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
