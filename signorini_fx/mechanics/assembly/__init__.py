"""From forms to arrays: facets, quadrature, nodal blocks, averages, and the pieces of a mesh.

Facets and coefficients are arguments: this package does not know what boundaries and materials a
problem has.
"""

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
