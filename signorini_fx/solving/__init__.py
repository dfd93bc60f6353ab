"""From a scene to its solution: strategy, nested iteration, load steps, sweeps, solution to a given accuracy.

This is the only package that knows all algorithms and their order.  It is not called ``solve``, because that is the
name of the public function.
"""

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
