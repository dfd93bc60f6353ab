# %% [markdown]
# # A limit load
#
# A block that only friction holds is pushed harder and harder. Load steps without a solution are
# tried again with half the increment, until the force is enclosed at which the block slides:
# friction times the weight on it.

# %%
import numpy as np
import ufl
from mpi4py import MPI
from dolfinx.fem import Constant, functionspace
from dolfinx.mesh import CellType, create_rectangle, locate_entities_boundary

from signorini_fx import ContactProblem, ConvergenceError, Coulomb, Foundation, LoadPath

mesh = create_rectangle(MPI.COMM_WORLD, [[0.0, 0.0], [3.0, 1.0]], [12, 4], CellType.quadrilateral)
V = functionspace(mesh, ("Lagrange", 1, (2,)))
u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
e, push = ufl.sym(ufl.grad(u)), Constant(mesh, 0.0)
a = 4000.0 * (ufl.inner(e, ufl.sym(ufl.grad(v))) + 0.7 * ufl.tr(e) * ufl.div(v)) * ufl.dx
bottom = locate_entities_boundary(mesh, 1, lambda x: np.isclose(x[1], 0.0))
L = (push * v[0] - 20.0 * v[1]) * ufl.dx  # forces per volume: 60 of weight, 3 times push
problem = ContactProblem(a, L, contact=Foundation(bottom, friction=Coulomb(0.3)))
try:
    problem.run(LoadPath((0.0, 9.0), steps=5), at=push)
except ConvergenceError as error:
    limit = 3.0 * error.solution.last_step.time
    print(f"{error}\nit holds up to {limit:.4g} of {0.3 * 60.0:.4g}")
