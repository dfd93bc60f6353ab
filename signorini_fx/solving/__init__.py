"""From a model to its solution: load steps, restarts and sequences of meshes; the algorithms for
one load step are in ``algebra``.
"""

# First: PETSc and dolfinx from PyPI find the library of MPI where it is loaded.
import mpi4py.MPI  # noqa: F401
