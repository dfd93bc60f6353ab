# %% [markdown]
# # A modulus that varies
#
# Young's modulus is a `Function`, one value per layer, and the layers become softer from solve to
# solve. Without lateral contraction each column is a chain of springs,
#
# $$\lambda = d \Bigl( \int_0^h \frac{\mathrm{d}y}{E(y)} \Bigr)^{-1} .$$

# %%
import numpy as np
import ufl
from mpi4py import MPI
from dolfinx.fem import Constant, Function, dirichletbc, functionspace, locate_dofs_topological
from dolfinx.mesh import CellType, create_rectangle, locate_entities_boundary

from signorini_fx import ContactProblem, Foundation

LAYERS, DOWN = 6, 0.01
mesh = create_rectangle(
    MPI.COMM_WORLD, [[0.0, 0.0], [2.0, 1.0]], [8, LAYERS], CellType.quadrilateral
)
V = functionspace(mesh, ("Lagrange", 1, (2,)))
u, v, modulus = ufl.TrialFunction(V), ufl.TestFunction(V), Function(functionspace(mesh, ("DG", 0)))
left, bottom, top = (
    locate_entities_boundary(mesh, 1, lambda x, k=k, at=at: np.isclose(x[k], at))
    for k, at in ((0, 0.0), (1, 0.0), (1, 1.0))
)
a = modulus * ufl.inner(ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v))) * ufl.dx
nothing = ufl.inner(Constant(mesh, (0.0, 0.0)), v) * ufl.dx
down = dirichletbc(-DOWN, locate_dofs_topological(V.sub(1), 1, top), V.sub(1))
symmetric = dirichletbc(0.0, locate_dofs_topological(V.sub(0), 1, left), V.sub(0))
problem = ContactProblem(a, nothing, [down, symmetric], Foundation(bottom), algorithm="alm")
middles, found, formula = (np.arange(LAYERS) + 0.5) / LAYERS, [], []
for soft in (0.0, 0.4, 0.8):
    modulus.interpolate(lambda x, soft=soft: 5000.0 * (1 - soft * x[1]))
    problem.solve()
    found.append(problem.state.pressure)
    formula.append(DOWN / np.mean(1 / (5000.0 * (1 - soft * middles))))
