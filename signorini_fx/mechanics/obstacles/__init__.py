"""What contact points meet: rigid shapes, the sides of other bodies, and the images across planes
of symmetry.

``pairs`` couples two surfaces by their geometry alone; here couplings and shapes get their points,
gaps and laws.
"""

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
