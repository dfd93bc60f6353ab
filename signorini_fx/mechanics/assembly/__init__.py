"""From forms to arrays: facets, quadrature, nodal blocks, averages, and the pieces of a mesh.

It knows meshes and finite element spaces.  It must not know where there is contact or what loads there are.
"""

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
