"""The algorithms of the paper and beyond, one update rule in each module.

The inner method (``ssn``) solves one regularised problem; an outer algorithm only changes the data of that problem.
This package sees nodal arrays only.  It must not know forms, meshes or kinds of linear systems.
"""

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
