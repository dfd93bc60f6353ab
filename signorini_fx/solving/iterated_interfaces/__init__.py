"""Bolts that are tightened, overclosures that are removed, and fluids that enter open contact: one file per kind.

They act across bodies or within the contact, and are neither forms nor properties of contact points.

A file says what its kind contributes to the displacement, the loads, the load steps and their checkpoints;
``Statement.interfaces`` finds it by the name that entries of a scene give, and ``protocol`` has the default answers.
All others ask these objects and know no kind.
"""

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
