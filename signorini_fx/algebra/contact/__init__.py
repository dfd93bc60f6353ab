"""Contact: the contact points and the map to them, the pointwise laws, statics, and results at the
points.

Everything acts on arrays of values at the contact points, in the frame of each point.  This package
must not know where the points are, meshes, scenes, factorisations or the order in which problems
are solved.
"""

# First: PETSc and dolfinx from PyPI find the library of MPI where it is loaded.
import mpi4py.MPI  # noqa: F401
