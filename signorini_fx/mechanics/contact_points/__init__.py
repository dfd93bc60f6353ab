"""The contact boundary and its points: normals and frames, the map B, and states and tables of
points.

What the points may touch is in ``obstacles``; this package does not depend on it.
"""

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
