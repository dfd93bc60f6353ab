"""From forms to arrays: facets, quadrature, nodal blocks, averages, and the pieces of a mesh.

Facets and densities come to it as arguments: it must not know what stands where in a problem.
"""

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
