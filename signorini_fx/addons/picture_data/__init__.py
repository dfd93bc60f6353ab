"""What pictures are drawn from: arrays of a solution, or of a scene on its mesh, from all ranks on the first one.

It looks at a solved problem, and hands plain arrays to ``pictures``.  No other package imports it: an add-on.
"""

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
