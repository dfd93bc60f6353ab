# %% [markdown]
# # A wheel rolls over an elastic block
#
# The wheel is a rigid foundation that is a shape. Each step `place`s it anew, turned by the way
# over its radius. Gap and normals are those of the new place, and friction acts on the slip
# relative to the wheel. A rolling wheel is hardly held back; a locked one meets the whole friction
# $F \lambda$.

# %%
import numpy as np
import ufl
from mpi4py import MPI
from dolfinx.fem import Constant, dirichletbc, functionspace, locate_dofs_topological
from dolfinx.mesh import CellType, create_rectangle, locate_entities_boundary

from signorini_fx import ContactProblem, Coulomb, Foundation

E, NU, RADIUS, DOWN, WAY, STEPS = 1000.0, 0.3, 2.0, 0.01, 0.6, 20
mesh = create_rectangle(
    MPI.COMM_WORLD, [[-1.5, -1.0], [1.5, 0.0]], [90, 24], CellType.quadrilateral
)
V = functionspace(mesh, ("Lagrange", 1, (2,)))
u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
strain = ufl.sym(ufl.grad(u))
stress = E / (1 + NU) * (strain + NU / (1 - 2 * NU) * ufl.tr(strain) * ufl.Identity(2))
top, bottom = (
    locate_entities_boundary(mesh, 1, lambda x, at=at: np.isclose(x[1], at)) for at in (0.0, -1.0)
)
fixed = dirichletbc(np.zeros(2), locate_dofs_topological(V, 1, bottom), V)
nothing = ufl.inner(Constant(mesh, (0.0, 0.0)), v) * ufl.dx
circle = {
    "shape": "circle",
    "centre": (-WAY / 2, RADIUS),
    "radius": RADIUS,
    "pivot": (-WAY / 2, RADIUS),
}
wheel = Foundation(top, shape=circle, friction=Coulomb(0.3))


# Friction over the normal force after each step, and whether that is certified.
def drive(rolls):
    problem = ContactProblem(ufl.inner(stress, ufl.grad(v)) * ufl.dx, nothing, [fixed], wheel)
    for way in np.linspace(0.0, WAY, STEPS + 1):
        problem.place(0, shift=(way, -DOWN), rotation=-np.degrees(way / RADIUS) * rolls)
        problem.solve()
        yield problem.state.forces[1][0] / -problem.state.forces[0][1], problem.certificate.holds
        problem.advance()


# %%
rolling, locked = (list(drive(rolls)) for rolls in (True, False))
