"""The materials of a problem on its mesh: moduli in cells, and the elastic law as forms and
stresses.

``materials`` has each material at a point; ``loads.load_vectors`` decides which law a problem has.
"""

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
