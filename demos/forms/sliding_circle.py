# %% [markdown]
# # A circle ploughs over rubber
#
# A rigid circle is pressed into a neo-Hookean block by 30 % of its height, and slides twice its
# radius over it with friction. The body is a residual in UFL. `place` moves the circle, `run` goes
# through the steps and halves those that have no solution; distances and normals are those at the
# displaced points.

# %%
import os

import numpy as np
import ufl
from mpi4py import MPI
from dolfinx.fem import Function, dirichletbc, functionspace, locate_dofs_topological
from dolfinx.mesh import CellType, create_rectangle, locate_entities_boundary

from signorini_fx import Coulomb, Foundation, NonlinearContactProblem

E, NU, FRICTION, CELLS = 100.0, 0.4, 0.3, int(os.environ.get("CELLS", "16"))
mu, lame = E / 2 / (1 + NU), E * NU / (1 + NU) / (1 - 2 * NU)
mesh = create_rectangle(
    MPI.COMM_WORLD, [[0.0, 0.0], [4.0, 1.0]], [4 * CELLS, CELLS], CellType.quadrilateral
)
u = Function(functionspace(mesh, ("Lagrange", 1, (2,))))
gradient = ufl.Identity(2) + ufl.grad(u)
J = ufl.det(gradient)
energy = mu / 2 * (ufl.inner(gradient, gradient) - 2) - mu * ufl.ln(J) + lame / 2 * ufl.ln(J) ** 2
F = ufl.derivative(
    energy * ufl.dx(metadata={"quadrature_degree": 2}), u, ufl.TestFunction(u.function_space)
)
top, bottom = (
    locate_entities_boundary(mesh, 1, lambda x, at=at: np.isclose(x[1], at)) for at in (1.0, 0.0)
)
fixed = dirichletbc(
    np.zeros(2), locate_dofs_topological(u.function_space, 1, bottom), u.function_space
)
circle = {"shape": "circle", "centre": (1.5, 1.5), "radius": 0.5}
problem = NonlinearContactProblem(
    F, u, bcs=[fixed], contact=Foundation(top, shape=circle, friction=Coulomb(FRICTION))
)
problem.run([0.25, 0.625, 1.0], lambda t: problem.place(0, shift=(0.0, -0.3 * t)))
forces = []
keep = lambda step: forces.append((step.time, *sum(problem.state.forces)))  # noqa: E731
problem.run(np.linspace(0.1, 1.0, 10), lambda t: problem.place(0, shift=(t, -0.3)), on_step=keep)

# %% [markdown]
# The way of the circle, and the force on the body.

# %%
if MPI.COMM_WORLD.rank == 0:
    print(np.array(forces), problem.certificate)
