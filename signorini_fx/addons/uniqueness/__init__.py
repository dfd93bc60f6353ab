"""Whether a solution is the only one on its mesh, and how far it is from the fixed point of Coulomb friction.

It looks at a solved problem, and must not decide how one is found.  No other package imports it: an add-on.
"""

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
