# %% [markdown]
# # Quadratic elements and a displacement that varies
#
# A space of degree 2, and a DirichletBC with a Function on one of its components: the top is
# pressed down by a curved stamp that it sticks to vertically. Friction has a coefficient that
# varies, as UFL. The same problem as a scene gives the same displacement.

# %%
import numpy as np
import ufl
from mpi4py import MPI
from dolfinx.fem import Constant, Function, dirichletbc, functionspace, locate_dofs_topological
from dolfinx.mesh import create_rectangle, locate_entities_boundary

from signorini_fx import ContactProblem, Coulomb, Foundation

E, NU = 5000.0, 0.3
mesh = create_rectangle(MPI.COMM_WORLD, [[0.0, 0.0], [3.0, 1.0]], [18, 6])
V = functionspace(mesh, ("Lagrange", 2, (2,)))
u, v, x = ufl.TrialFunction(V), ufl.TestFunction(V), ufl.SpatialCoordinate(mesh)
e = ufl.sym(ufl.grad(u))
stress = E / (1 + NU) * (e + NU / (1 - 2 * NU) * ufl.tr(e) * ufl.Identity(2))
bottom, top = (
    locate_entities_boundary(mesh, 1, lambda x, at=at: np.isclose(x[1], at)) for at in (0.0, 1.0)
)
vertical, _ = V.sub(1).collapse()
stamp = Function(vertical)
stamp.interpolate(lambda x: -0.004 - 0.002 * np.sin(x[0]))
down = dirichletbc(stamp, locate_dofs_topological((V.sub(1), vertical), 1, top), V.sub(1))
aside = dirichletbc(0.001, locate_dofs_topological(V.sub(0), 1, top), V.sub(0))
nothing = ufl.inner(Constant(mesh, (0.0, 0.0)), v) * ufl.dx
floor = Foundation(bottom, gap=0.001 * (x[0] - 1.5) ** 2, friction=Coulomb(0.2 + 0.1 * x[0]))
problem = ContactProblem(
    ufl.inner(stress, ufl.grad(v)) * ufl.dx, nothing, [down, aside], floor, gamma_n=1e8, gamma_t=1e8
)
y = problem.solve()
