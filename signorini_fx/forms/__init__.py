"""Contact for user-defined forms: ``ContactProblem`` with the interface of dolfinx, and the checks
of its forms and conditions.

It handles UFL forms, function spaces and Dirichlet conditions, but no materials or scenes.
"""

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
