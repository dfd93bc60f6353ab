"""Guaranteed bounds of the error of a displacement, of means and of forces, in 2D and in 3D.

They look at a solved problem alone, whose scene they integrate on plain triangles or tetrahedra.
No other package imports it: an add-on.
"""

# First: PETSc and dolfinx from PyPI find the library of MPI where it is loaded.
import mpi4py.MPI  # noqa: F401
