# %% [markdown]
# # A time loop of your own
#
# The block of the demo [press and slide](../press_and_slide.py): pressed down, then pushed to and
# fro. `advance` ends a step, after which friction acts on what the next step adds to the slip. It
# takes the stiffness that is there: only the prescribed displacement changes.

# %%
import numpy as np
import ufl
from mpi4py import MPI
from dolfinx.fem import Constant, dirichletbc, functionspace, locate_dofs_topological
from dolfinx.mesh import CellType, create_rectangle, locate_entities_boundary

from signorini_fx import ContactProblem, Coulomb, Foundation

E, NU = 5000.0, 0.3
mesh = create_rectangle(MPI.COMM_WORLD, [[0.0, 0.0], [3.0, 1.0]], [60, 20], CellType.quadrilateral)
V = functionspace(mesh, ("Lagrange", 1, (2,)))
u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
e = ufl.sym(ufl.grad(u))
stress = E / (1 + NU) * (e + NU / (1 - 2 * NU) * ufl.tr(e) * ufl.Identity(2))
bottom, top = (
    locate_entities_boundary(mesh, 1, lambda x, at=at: np.isclose(x[1], at)) for at in (0.0, 1.0)
)
aside, nothing = Constant(mesh, 0.0), ufl.inner(Constant(mesh, (0.0, 0.0)), v) * ufl.dx
bcs = [
    dirichletbc(-0.003, locate_dofs_topological(V.sub(1), 1, top), V.sub(1)),
    dirichletbc(aside, locate_dofs_topological(V.sub(0), 1, top), V.sub(0)),
]
a, floor = ufl.inner(stress, ufl.grad(v)) * ufl.dx, Foundation(bottom, friction=Coulomb(0.3))
problem = ContactProblem(a, nothing, bcs, floor)
force = []
for aside.value in 0.005 * np.interp(np.arange(21), [0, 4, 12, 20], [0, 1, -1, 1]):
    problem.solve()
    problem.advance()
    force.append(-problem.state.forces[1][0])
