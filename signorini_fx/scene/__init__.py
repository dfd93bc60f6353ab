"""The model of a scene: which effects act, and their data.

This package knows keys, units, defaults, expressions and the error messages about them.  It must not know meshes, forms
or solvers, and imports dolfinx, PETSc and MPI nowhere before a function needs them: a scene can be read on any machine.
"""
