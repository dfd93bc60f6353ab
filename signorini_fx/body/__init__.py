"""The elastic body: from a scene and its mesh to the assembled stiffness and loads, supports and rigid motions.

This is the only package that writes UFL forms.  It knows materials, loads, prescribed displacements, and the contact
boundary with its data.  It must not know active sets of an iterate, or how contact problems are solved.
"""

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
