"""From a model to its solution: load steps, restarts, meshes; how a load step is solved only ``algebra`` knows."""

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
