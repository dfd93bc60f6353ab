"""The algorithms of the paper and their extensions, one in each module.

The inner method (``ssn``) solves one regularised problem; an outer algorithm solves a sequence of
such problems with changing data.  ``strategy.solve_task`` is the entry point: it chooses the
algorithms and their order, and solves a problem given by matrices.  This package works with arrays
at the contact points only, without forms, meshes, scenes or particular kinds of linear systems.
"""

# First: PETSc and dolfinx from PyPI find the library of MPI where it is loaded.
import mpi4py.MPI  # noqa: F401
