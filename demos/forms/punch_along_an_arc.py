# %% [markdown]
# # A round punch is pressed into rubber and drawn along an arc
#
# A punch with a paraboloid at its tip, ten times as stiff as a block of rubber, is pressed into it
# and drawn along an arc, with friction. Both are bodies in 3D in one mesh, and their facets slide
# past each other. The force along the block turns with the way.

# %%
import os

import numpy as np
import ufl
from mpi4py import MPI
from dolfinx import fem
from dolfinx.mesh import (
    CellType,
    create_box,
    create_submesh,
    locate_entities,
    locate_entities_boundary,
)

from signorini_fx import Coulomb, NonlinearContactProblem, Pair

N = 2 * int(os.environ.get("CELLS", "4"))
whole = create_box(
    MPI.COMM_WORLD, [[0, 0, -1], [2.5, 2, 1]], [5 * N // 2, 2 * N, 2 * N], CellType.hexahedron
)


def bodies(x):
    beside = np.maximum(abs(x[0] - 0.75), abs(x[1] - 0.75))
    return (x[2] < 1e-9) | ((x[2] > 0.49) & (beside < 0.51))


mesh = create_submesh(whole, 3, locate_entities(whole, 3, bodies))[0]
x, y, z = mesh.geometry.x.T
tip = lambda x: (x[0] - 0.75) ** 2 + (x[1] - 0.75) ** 2  # noqa: E731
z += (z > 0.4) * (2 * (1 - z) * tip((x, y)) - 0.5)

# %% [markdown]
# A neo-Hookean energy, the two sides, and what is held and driven.

# %%
V = fem.functionspace(mesh, ("Lagrange", 1, (3,)))
u, way, stiffness = (
    fem.Function(V),
    fem.Constant(mesh, np.zeros(3)),
    11 + 9 * ufl.sign(ufl.SpatialCoordinate(mesh)[2]),
)
G = ufl.Identity(3) + ufl.grad(u)
energy = stiffness * ((ufl.inner(G, G) - 3) / 2 - ufl.ln(ufl.det(G)) + ufl.ln(ufl.det(G)) ** 2)
F = ufl.derivative(energy * ufl.dx(metadata={"quadrature_degree": 2}), u, ufl.TestFunction(V))
on = lambda f: locate_entities_boundary(mesh, 2, lambda x: np.isclose(f(x), 0))  # noqa: E731


def held(way, z):
    return fem.dirichletbc(way, fem.locate_dofs_topological(V, 2, on(lambda x: x[2] - z)), V)


pair = Pair(on(lambda x: x[2]), on(lambda x: x[2] - tip(x)), friction=Coulomb(0.3))
problem = NonlinearContactProblem(F, u, bcs=[held(np.zeros(3), -1), held(way, 0.5)], contact=pair)

# %% [markdown]
# Down by a seventh of the height, then along a sixth of a circle in steps of about a facet.

# %%


def arc(t):
    angle = max(t - 1, 0)
    way.value[:] = np.sin(angle), 1 - np.cos(angle), -0.15 * min(t, 1)


problem.run(np.linspace(0, 1 + np.pi / 3, 5 * N // 2 + 1)[1:], arc)
print(problem.solution.last_step, sum(problem.state.forces))
