"""Guaranteed bounds of the error of a displacement, of means and of forces, in 2D and in 3D.

They are computed from a solved problem alone, whose scene is integrated on plain triangles or
tetrahedra.  It is an add-on: no other package imports it.
"""

# First: PETSc and dolfinx from PyPI find the library of MPI where it is loaded.
import mpi4py.MPI  # noqa: F401
