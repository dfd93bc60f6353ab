"""The elastic body: from a scene and its mesh to the assembled stiffness and loads, supports and rigid motions.

This is the only package that writes UFL forms.  It knows materials, loads, prescribed displacements, and the contact
boundary.  It must not know friction, active sets or how linear systems are solved.
"""

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
