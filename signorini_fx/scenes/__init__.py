"""Scenes: what a user states in a file or in Python, read, validated and solved.

This package knows keys, defaults and the error messages about them.  Reading imports dolfinx, PETSc
and MPI nowhere before a function needs them: a scene can be read on any machine.
"""
