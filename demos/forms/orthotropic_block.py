# %% [markdown]
# # An orthotropic block between two plates
#
# The plates come closer by $d$ than the block is high. Its sides are free, so that
#
# $$\lambda = \Bigl(c_{22} - \frac{c_{12}^2}{c_{11}}\Bigr) \frac{d}{h}$$
#
# everywhere on both plates.

# %%
import numpy as np
import ufl
from mpi4py import MPI
from dolfinx.fem import Constant, dirichletbc, functionspace, locate_dofs_topological
from dolfinx.mesh import create_rectangle, locate_entities_boundary

from signorini_fx import ContactProblem, Foundation

C11, C22, C12, C66, CLOSER = 40.0, 10.0, 6.0, 4.0, 0.02
mesh = create_rectangle(MPI.COMM_WORLD, [[0.0, 0.0], [2.0, 1.0]], [12, 6])
V = functionspace(mesh, ("Lagrange", 1, (2,)))
u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
e, z = ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v))
stress = ufl.as_matrix(
    [
        [C11 * e[0, 0] + C12 * e[1, 1], 2 * C66 * e[0, 1]],
        [2 * C66 * e[0, 1], C12 * e[0, 0] + C22 * e[1, 1]],
    ]
)
left, bottom, top = (
    locate_entities_boundary(mesh, 1, lambda x, k=k, at=at: np.isclose(x[k], at))
    for k, at in ((0, 0.0), (1, 0.0), (1, 1.0))
)
symmetric = dirichletbc(0.0, locate_dofs_topological(V.sub(0), 1, left), V.sub(0))
plates = [Foundation(bottom), Foundation(top, gap=-CLOSER)]
nothing = ufl.inner(Constant(mesh, (0.0, 0.0)), v) * ufl.dx
a = ufl.inner(stress, z) * ufl.dx
problem = ContactProblem(a, nothing, [symmetric], plates, algorithm="alm", stress=stress)
problem.solve()
pressure, formula = problem.state.pressure, (C22 - C12**2 / C11) * CLOSER
