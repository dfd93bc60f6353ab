"""Loads and supports on a mesh: vectors of the densities of effects, prescribed displacements,
jumps and strains.

``effects`` has the density of each; here these are integrated, and followed through load steps.
"""

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
