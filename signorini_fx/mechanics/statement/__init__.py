"""The data of a problem before it has a mesh: effects, load steps, rigid shapes and motions,
settings.

This package defines units, values, expressions and their error messages.  It must not use forms or
solvers, and imports dolfinx, PETSc and MPI only within functions that need them.
"""
