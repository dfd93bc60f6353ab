"""Interfaces as users of forms state them: a rigid foundation; a pair of two sides, or with ``bonded`` a bond of both.

``effects.contact`` has those of scenes, ``obstacles.foundations_on_points`` all of them on their contact points.
Bolts, overclosures and fluids that enter, for which a load step finds shortenings or pressures, are in
``solving.iterated_interfaces``.
"""

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
