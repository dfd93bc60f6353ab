"""The contact problem as residual and active-set Jacobian: regularised (3.3), and its limit without regularisation.

A problem combines an elastic system, the contact points and the laws.  It must not know which kind of elastic system it
is given, or which algorithm evaluates its residual.
"""

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
