"""Loads and supports on a mesh: load vectors, prescribed displacements, jumps and initial strains.

``effects`` has the density of each; here densities are integrated and updated from load step to
load step.
"""

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
