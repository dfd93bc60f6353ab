"""The algorithms of the paper and beyond, one update rule in each module.

The inner method (``ssn``) solves one regularised problem; an outer algorithm only changes the data
of that problem. ``strategy.solve_task`` is the entry: it knows all of them and their order, and
solves a problem given by matrices. This package sees arrays at the contact points only.  It must
not know forms, meshes, scenes or kinds of linear systems.
"""

# First: PETSc and dolfinx from PyPI find the library of MPI where it is loaded.
import mpi4py.MPI  # noqa: F401
