# %% [markdown]
# # Springs under a block
#
# A block of height $h$ stands on springs of stiffness $k$ per area and is pressed by a plate that
# comes down by $d$: the springs are one more term of the form. They hold the block without any
# Dirichlet condition on its displacement along them. With free sides,
#
# $$\lambda = d \Bigl( \frac{1}{k} + \frac{h (1 - \nu^2)}{E} \Bigr)^{-1} .$$

# %%
import numpy as np
import ufl
from mpi4py import MPI
from dolfinx.fem import Constant, dirichletbc, functionspace, locate_dofs_topological
from dolfinx.mesh import create_rectangle, locate_entities_boundary, meshtags

from signorini_fx import ContactProblem, Foundation

E, NU, SPRINGS, DOWN = 5000.0, 0.3, 2000.0, 0.01
mesh = create_rectangle(MPI.COMM_WORLD, [[0.0, 0.0], [2.0, 1.0]], [12, 6])
V = functionspace(mesh, ("Lagrange", 1, (2,)))
u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
e = ufl.sym(ufl.grad(u))
stress = E / (1 + NU) * (e + NU / (1 - 2 * NU) * ufl.tr(e) * ufl.Identity(2))
left, bottom, top = (
    locate_entities_boundary(mesh, 1, lambda x, k=k, at=at: np.isclose(x[k], at))
    for k, at in ((0, 0.0), (1, 0.0), (1, 1.0))
)
ds = ufl.ds(
    domain=mesh,
    subdomain_data=meshtags(mesh, 1, np.sort(bottom), np.full(bottom.size, 1, dtype=np.int32)),
)
a = ufl.inner(stress, ufl.grad(v)) * ufl.dx + SPRINGS * u[1] * v[1] * ds(1)
symmetric = dirichletbc(0.0, locate_dofs_topological(V.sub(0), 1, left), V.sub(0))
nothing = ufl.inner(Constant(mesh, (0.0, 0.0)), v) * ufl.dx
problem = ContactProblem(a, nothing, [symmetric], Foundation(top, gap=-DOWN), algorithm="alm")
problem.solve()
pressure, formula = problem.state.pressure, DOWN / (1 / SPRINGS + (1 - NU**2) / E)
