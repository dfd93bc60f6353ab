"""Checks of a scene before it is solved: what will be computed, what it will cost and what may go wrong.

This package assembles no stiffness but for the uniqueness of solutions.  Some of its findings are about results.
"""

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
