# %% [markdown]
# # Three lines for a program that you have
#
# A body as in the elasticity demo of dolfinx: a box that rotates, held on two sides, with compiled
# forms `a` and `L`, a condition `bc` and a Function `uh`. The last three lines of code are what
# contact adds; they do the same after the last line of dolfinx's own `demo_elasticity.py`, which
# has these names too.

# %%
import numpy as np
import ufl
from mpi4py import MPI
from dolfinx.fem import Function, dirichletbc, form, functionspace, locate_dofs_topological
from dolfinx.mesh import create_box, locate_entities_boundary

from signorini_fx import ContactProblem, Coulomb, Foundation

msh = create_box(MPI.COMM_WORLD, [[0.0, 0.0, 0.0], [2.0, 1.0, 1.0]], [8, 4, 4])
V = functionspace(msh, ("Lagrange", 1, (3,)))
u, v, x = ufl.TrialFunction(V), ufl.TestFunction(V), ufl.SpatialCoordinate(msh)
strain = ufl.sym(ufl.grad(u))
stress = 2 * 3.85e8 * strain + 5.77e8 * ufl.tr(strain) * ufl.Identity(3)
a = form(ufl.inner(stress, ufl.grad(v)) * ufl.dx)
L = form(9e5 * (x[0] * v[0] + x[1] * v[1]) * ufl.dx)
held = locate_entities_boundary(msh, 2, lambda x: np.isclose(x[0], 0.0) | np.isclose(x[1], 1.0))
bc = dirichletbc(np.zeros(3), locate_dofs_topological(V, 2, held), V)
uh = Function(V)

# %% [markdown]
# A rough wall stands 0.1 mm beside the end of the box.

# %%
end = locate_entities_boundary(msh, 2, lambda x: np.isclose(x[0], 2.0))
problem = ContactProblem(a, L, [bc], contact=Foundation(end, gap=1e-4, friction=Coulomb(0.3)), u=uh)
problem.solve()
