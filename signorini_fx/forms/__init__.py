"""Contact for anybody's forms: ``ContactProblem`` in the idiom of dolfinx, and what it needs of
forms and conditions.

It knows UFL forms, function spaces and Dirichlet conditions.  It must not know materials or scenes.
"""

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
