# %% [markdown]
# # A round punch is pressed into rubber and drawn along an arc
#
# A punch with a paraboloid at its tip, ten times as stiff as a block of rubber, is pressed into it and drawn along an
# arc, with friction. Both are bodies in space in one mesh, and their facets, which do not match, slide past each other.
# The force along the block turns with the way.

# %%
import os

import numpy as np
import ufl
from mpi4py import MPI
from dolfinx.fem import Constant, Function, dirichletbc, functionspace, locate_dofs_topological
from dolfinx.mesh import CellType, compute_midpoints, create_box, create_submesh, locate_entities_boundary

from signorini_fx import Coulomb, NonlinearContactProblem, Pair

N = 2 * int(os.environ.get("CELLS", "4"))
whole = create_box(MPI.COMM_WORLD, [[0, 0, -1], [2.5, 2, 1]], [5 * N // 2, 2 * N, 2 * N], CellType.hexahedron)
x, y, z = compute_midpoints(whole, 3, np.arange(whole.topology.index_map(3).size_local, dtype=np.int32)).T
above = (z > 0.5) & (np.maximum(abs(x - 0.75), abs(y - 0.75)) < 0.5)
mesh = create_submesh(whole, 3, np.flatnonzero((z < 0) | above).astype(np.int32))[0]
x, y, z = mesh.geometry.x.T
punch, tip = z > 0.4, lambda x: (x[0] - 0.75) ** 2 + (x[1] - 0.75) ** 2
x[punch], y[punch] = (0.9 * values[punch] + 0.075 for values in (x, y))  # facets that do not match
z[punch] += 2 * (1 - z[punch]) * tip((x, y))[punch] - 0.5

# %% [markdown]
# A neo-Hookean energy, the two sides, and what is held and driven.

# %%
V = functionspace(mesh, ("Lagrange", 1, (3,)))
u, way, stiffness = Function(V), Constant(mesh, np.zeros(3)), 11 + 9 * ufl.sign(ufl.SpatialCoordinate(mesh)[2])
G = ufl.Identity(3) + ufl.grad(u)
energy = stiffness * ((ufl.inner(G, G) - 3) / 2 - ufl.ln(ufl.det(G)) + ufl.ln(ufl.det(G)) ** 2)
F = ufl.derivative(energy * ufl.dx(metadata={"quadrature_degree": 2}), u, ufl.TestFunction(V))
on = lambda f: locate_entities_boundary(mesh, 2, lambda x: np.isclose(f(x), 0))  # noqa: E731
ends = (np.zeros(3), on(lambda x: x[2] + 1)), (way, on(lambda x: x[2] - 0.5))
bcs = [dirichletbc(value, locate_dofs_topological(V, 2, facets), V) for value, facets in ends]
block = on(lambda x: x[2])
pair = Pair(block, np.setdiff1d(on(lambda x: x[2] - tip(x)), block), friction=Coulomb(0.3))
problem = NonlinearContactProblem(F, u, bcs=bcs, contact=pair)

# %% [markdown]
# Down by a seventh of the height, then along a sixth of a circle in steps of about a facet.

# %%
problem.ramp(lambda t: np.copyto(way.value, (0.0, 0.0, -0.15 * t)), first=0.5)
arc = lambda a: np.copyto(way.value, (0.8 * np.sin(a), 0.8 * (1 - np.cos(a)), -0.15))  # noqa: E731
print(problem.ramp(arc, to=np.pi / 3, largest=1 / N)[-1], sum(problem.state.forces))
