# %% [markdown]
# # A stiff punch irons a block of rubber
#
# A punch with a rounded lower side, ten times as stiff as a block, is pressed into it and drawn
# over it, with friction. Both bodies are parts of one mesh, and their facets slide past each other.
# The contact points of the `Pair` are on its first side, that of the softer body. Which facets
# meet, and in which directions, is found anew in each iteration.

# %%
import os

import numpy as np
import ufl
from mpi4py import MPI
from dolfinx.fem import Constant, Function, dirichletbc, functionspace, locate_dofs_topological
from dolfinx.mesh import (
    CellType,
    compute_midpoints,
    create_rectangle,
    create_submesh,
    locate_entities_boundary,
)

from signorini_fx import Coulomb, NonlinearContactProblem, Pair

MU, LAME, CELLS = 17.8, 71.4, int(os.environ.get("CELLS", "16"))
whole = create_rectangle(
    MPI.COMM_WORLD, [[0, 0], [4, 1.75]], [4 * CELLS, 7 * CELLS // 4], CellType.quadrilateral
)
x, y, _ = compute_midpoints(
    whole, 2, np.arange(whole.topology.index_map(2).size_local, dtype=np.int32)
).T
mesh = create_submesh(
    whole, 2, np.flatnonzero((y < 1) | ((y > 1.25) & (abs(x - 1.25) < 0.5))).astype(np.int32)
)[0]
x, y, _ = mesh.geometry.x.T
y += (y > 1.2) * (
    0.6 * (1.75 - y) * (2 * x - 2.5) ** 2 - 0.24
)  # so close to the block, and rounded

# %% [markdown]
# A neo-Hookean energy, the two sides, and what is held and driven.

# %%
V = functionspace(mesh, ("Lagrange", 1, (2,)))
u, way, stiffness = (
    Function(V),
    Constant(mesh, np.zeros(2)),
    11 + 9 * ufl.sign(ufl.SpatialCoordinate(mesh)[1] - 1),
)
G = ufl.Identity(2) + ufl.grad(u)
energy = (
    MU / 2 * (ufl.inner(G, G) - 2) - MU * ufl.ln(ufl.det(G)) + LAME / 2 * ufl.ln(ufl.det(G)) ** 2
)
F = ufl.derivative(
    stiffness * energy * ufl.dx(metadata={"quadrature_degree": 2}), u, ufl.TestFunction(V)
)
on = lambda f: locate_entities_boundary(mesh, 1, lambda x: np.isclose(f(x), 0))  # noqa: E731
ends = (
    locate_dofs_topological(V, 1, on(lambda x: x[1])),
    locate_dofs_topological(V, 1, on(lambda x: x[1] - 1.51)),
)
bcs = [dirichletbc(np.zeros(2), ends[0], V), dirichletbc(way, ends[1], V)]
pair = Pair(
    on(lambda x: x[1] - 1),
    on(lambda x: 1.01 + 0.3 * (2 * x[0] - 2.5) ** 2 - x[1]),
    friction=Coulomb(0.3),
)
problem = NonlinearContactProblem(F, u, bcs=bcs, contact=pair)

# %% [markdown]
# Down by a fifth of the height, then across in steps of about a facet.

# %%
problem.run([0.5, 1.0], lambda t: np.copyto(way.value, (0.0, -0.2 * t)))
problem.run(np.linspace(0.075, 1.5, 20), lambda x: np.copyto(way.value, (x, -0.2)))
print(problem.solution.last_step, sum(problem.state.forces))
