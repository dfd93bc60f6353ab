"""The model of a scene: which effects act, and their data.

This package knows keys, units, defaults, expressions and the messages for mistakes in them.  It must not know meshes,
forms or solvers, and it imports none of dolfinx, PETSc and MPI: a scene can be read and refused on any machine.
"""
