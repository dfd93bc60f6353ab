"""Interfaces as users of forms state them: a rigid foundation, a pair of two sides.

``body.foundations_on_points`` has them on their contact points.  Bolts, overclosures and fluids that enter, for which a
load step finds shortenings or pressures, are in ``solving.interfaces``.
"""

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
