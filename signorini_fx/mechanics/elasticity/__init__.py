"""The materials of a problem on its mesh: moduli in cells, and the elastic law as forms and stresses.

``materials`` has each material at a point.  Which law a problem has, such as one with a pressure of its own, is decided
in ``loads.load_vectors``.
"""

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
