"""From a model to its solution: load steps, restarts, meshes; how a load step is solved only
``algebra`` knows.
"""

# First: PETSc and dolfinx from PyPI find the library of MPI where it is loaded.
import mpi4py.MPI  # noqa: F401
