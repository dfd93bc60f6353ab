"""What contact points touch: rigid shapes, the sides of other bodies, and images across planes of
symmetry.

``pairs`` couples two surfaces by their geometry alone; this package adds contact points, gaps and
contact laws to couplings and shapes.
"""

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
