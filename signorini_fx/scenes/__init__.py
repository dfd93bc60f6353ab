"""Scenes: what a user states in a file or in Python is read, validated and solved here.

This package defines keys, defaults and the error messages about them.  dolfinx, PETSc and MPI are
imported only inside functions that need them, so that a scene can be read on any machine.
"""
