"""Checks of a scene before it is solved: what will be computed, what it will cost and what may go wrong.

This package assembles no stiffness, and solves nothing but the few equations on which it tries PETSc options.  Some of
its findings are about results.
"""

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
