"""Contact: the contact points and the map to them, the pointwise laws, statics, and results at the
points.

Everything works on arrays of values at the contact points, in the frame of each point, without
positions of points, meshes, scenes, factorisations or the order in which problems are solved.
"""

# First: PETSc and dolfinx from PyPI find the library of MPI where it is loaded.
import mpi4py.MPI  # noqa: F401
