"""The model of a scene: which effects act, and their data.

This package knows keys, units, defaults, expressions and the error messages about them.  It must not know meshes, forms
or solvers, and it does not import dolfinx, PETSc or MPI: a scene can be read and checked on any machine.
"""
