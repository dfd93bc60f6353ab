"""What a scene has across bodies and in open contact beside forms and points, one file per kind.

A file says what its kind contributes to the displacement, the loads, the load steps and their checkpoints;
``Statement.interfaces`` finds it by the name that entries of a scene give, and ``protocol`` has the default answers.
All others ask these objects and know no kind.
"""

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
