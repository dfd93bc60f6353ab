"""The contact boundary and its points: normals and frames, the map B, and states and tables of
points.

It knows nothing of what the points may touch, which is in ``obstacles``.
"""

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
