"""What is stated before there is a mesh: effects with their data, load steps, rigid shapes and
motions, settings.

This package knows units, values, expressions and the error messages about them.  It must not know
forms or solvers, and imports dolfinx, PETSc and MPI nowhere before a function needs them.
"""
