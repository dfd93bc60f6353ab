"""Contact: the map to the contact points, the pointwise laws, the data of a scene on them, and statics.

The laws act on arrays of values at the contact points.  This package must not know matrices, factorisations or the
order in which problems are solved.
"""

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
