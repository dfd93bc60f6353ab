# %% [markdown]
# # A heated strip between two walls
#
# A strip of length $l$ rests against one wall, the other one is $d$ away. Heat is a load,
# $L(z) = \int \beta T \operatorname{div} z$ with $\beta = E \alpha / (1 - 2 \nu)$. In plane strain,
# with free sides,
#
# $$\lambda = \frac{E}{1 - \nu^2} \Bigl( (1 + \nu)\, \alpha T - \frac{d}{l} \Bigr)$$
#
# once the strip reaches the wall. The temperature is a `Constant`: the matrix is assembled and
# factorised once.

# %%
import numpy as np
import ufl
from mpi4py import MPI
from dolfinx.fem import Constant, dirichletbc, functionspace, locate_dofs_topological
from dolfinx.mesh import CellType, create_rectangle, locate_entities_boundary

from signorini_fx import ContactProblem, Foundation

E, NU, ALPHA, GAP, LENGTH = 210000.0, 0.3, 1.2e-5, 2e-3, 3.0
mesh = create_rectangle(
    MPI.COMM_WORLD, [[0.0, 0.0], [LENGTH, 0.5]], [24, 4], CellType.quadrilateral
)
V = functionspace(mesh, ("Lagrange", 1, (2,)))
u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
e, temperature = ufl.sym(ufl.grad(u)), Constant(mesh, 0.0)
stress = E / (1 + NU) * (e + NU / (1 - 2 * NU) * ufl.tr(e) * ufl.Identity(2))
load = E * ALPHA / (1 - 2 * NU) * temperature * ufl.div(v) * ufl.dx
left, right, bottom = (
    locate_entities_boundary(mesh, 1, lambda x, k=k, at=at: np.isclose(x[k], at))
    for k, at in ((0, 0.0), (0, LENGTH), (1, 0.0))
)
symmetric = dirichletbc(0.0, locate_dofs_topological(V.sub(1), 1, bottom), V.sub(1))
a, settings = (
    ufl.inner(stress, ufl.grad(v)) * ufl.dx,
    {"algorithm": "alm", "gamma_n": 1e6, "tolerance": 1e-12},
)
problem = ContactProblem(
    a, load, [symmetric], [Foundation(left), Foundation(right, gap=GAP)], **settings
)
found, formula = [], []
for temperature.value in (60.0, 80.0, 100.0):
    problem.solve()
    found.append(problem.state.pressure)
    formula.append(E / (1 - NU**2) * ((1 + NU) * ALPHA * float(temperature.value) - GAP / LENGTH))
