"""From a model to its solution: nested iteration, load steps, restarts, solution to a given accuracy.

This package must not know how a load step is solved, which is the core's.  It is not called ``solve``, because that is
the name of the public function.
"""

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
