"""Rigid motions: those that supports leave free, foundations that forces move, and the space of
coarse levels.

Meshes of nested iterations are levels of multigrid here, because its coarse spaces must contain the
rigid motions.
"""

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
