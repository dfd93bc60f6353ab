# %% [markdown]
# # A seal is pushed over the tapered end of a shaft
#
# Both are bodies of revolution: the forms are multiplied by $2 \pi r$, and `measure` says so of the
# pair. The rubber ring widens by a quarter while it slides over eight facets of the shaft. On the
# taper the slope holds it back as well as friction, $F_z / F_r = \tan(\alpha + \arctan F)$; on the
# cylinder it is friction alone.

# %%
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

whole = create_rectangle(MPI.COMM_WORLD, [[0, 0], [1.5, 3]], [12, 24], CellType.quadrilateral)
r, z, _ = compute_midpoints(
    whole, 2, np.arange(whole.topology.index_map(2).size_local, dtype=np.int32)
).T
mesh = create_submesh(
    whole, 2, np.flatnonzero(np.where(z < 2, r < 1, (z > 2.25) & (z < 2.75) & (r > 1)))
)[0]
shaft, r, z = lambda z: 1 - 0.3 * np.maximum(z - 1, 0), *mesh.geometry.x.T[:2]
r[:] = np.where(
    z < 2.1, r * shaft(z), r - 0.2 + 2 * (1.5 - r) * (z - 2.5) ** 2
)  # the ring is rounded inside

# %%
V, R = functionspace(mesh, ("Lagrange", 1, (2,))), ufl.SpatialCoordinate(mesh)
u, way, around = Function(V), Constant(mesh, 0.0), 2 * np.pi * R[0]
G, hoop = ufl.Identity(2) + ufl.grad(u), 1 + u[0] / R[0]
J, stiffness = hoop * ufl.det(G), ufl.conditional(R[1] < 2.1, 100.0, 1.0)
energy = (
    stiffness * around * (0.5 * (ufl.inner(G, G) + hoop**2 - 3) - ufl.ln(J) + 2 * ufl.ln(J) ** 2)
)
F = ufl.derivative(energy * ufl.dx(metadata={"quadrature_degree": 2}), u, ufl.TestFunction(V))
on = lambda f: locate_entities_boundary(mesh, 1, lambda x: np.isclose(f(x[0], x[1]), 0))  # noqa: E731
held = (0.0, 0, lambda r, z: r), (0.0, 1, lambda r, z: z), (way, 1, lambda r, z: z - 2.75)
bcs = [
    dirichletbc(value, locate_dofs_topological(V.sub(k), 1, on(f)), V.sub(k))
    for value, k, f in held
]
inside, outside = on(lambda r, z: r - 0.8 - (z - 2.5) ** 2), on(lambda r, z: r - shaft(z))
pair = Pair(inside, outside, friction=Coulomb(0.3), measure=around)
problem = NonlinearContactProblem(F, u, bcs=bcs, contact=pair)

# %%
forces, end = [], lambda step: forces.append([step.time, *sum(problem.state.forces)])
problem.run(np.linspace(0.075, 1.8, 24), lambda t: np.copyto(way.value, -t), on_step=end)
