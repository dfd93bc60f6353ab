# %% [markdown]
# # Hertz's point contact, axisymmetric
#
# All forms are multiplied by $2 \pi r$; `measure` says so of the contact. A flat elastic body is
# pressed onto a rigid sphere of radius $R$, which is a circle of the plane of $r$ and $z$. With the
# force $F$ and $E^* = E / (1 - \nu^2)$,
#
# $$a = \Bigl(\frac{3 F R}{4 E^*}\Bigr)^{1/3}, \qquad \lambda(r) = \frac{3 F}{2 \pi a^2} \sqrt{1 -
# r^2 / a^2} .$$

# %%
import numpy as np
import ufl
from mpi4py import MPI
from dolfinx.fem import (
    Constant,
    assemble_scalar,
    dirichletbc,
    form,
    functionspace,
    locate_dofs_topological,
)
from dolfinx.mesh import CellType, create_rectangle, locate_entities_boundary

from signorini_fx import ContactProblem, Foundation

E, NU, RADIUS, DOWN = 1000.0, 0.3, 4.0, 0.0125
mesh = create_rectangle(MPI.COMM_WORLD, [[0.0, 0.0], [1.0, 1.0]], [64, 64], CellType.quadrilateral)
mesh.geometry.x[:, :2] = (
    4.0 * mesh.geometry.x[:, :2] ** 2.5
)  # fine near the contact, which reaches r = 0.2
V = functionspace(mesh, ("Lagrange", 1, (2,)))
u, v, r = ufl.TrialFunction(V), ufl.TestFunction(V), ufl.SpatialCoordinate(mesh)[0]
around = 2 * np.pi * r


def strain(y):
    """Along r and z and around the axis."""
    return ufl.as_matrix(
        [[y[0].dx(0), 0, y[0].dx(1)], [0, y[0] / r, 0], [y[1].dx(0), 0, y[1].dx(1)]]
    )


stress = (
    E / (1 + NU) * (ufl.sym(strain(u)) + NU / (1 - 2 * NU) * ufl.tr(strain(u)) * ufl.Identity(3))
)
bottom, top = (
    locate_entities_boundary(mesh, 1, lambda x, at=at: np.isclose(x[1], at)) for at in (0.0, 4.0)
)
axis = locate_entities_boundary(mesh, 1, lambda x: np.isclose(x[0], 0.0))
down = dirichletbc(-DOWN, locate_dofs_topological(V.sub(1), 1, top), V.sub(1))
symmetric = dirichletbc(0.0, locate_dofs_topological(V.sub(0), 1, axis), V.sub(0))
nothing = ufl.inner(Constant(mesh, (0.0, 0.0)), v) * ufl.dx
ball = Foundation(
    bottom, shape={"shape": "circle", "centre": (0, -RADIUS), "radius": RADIUS}, measure=around
)
problem = ContactProblem(
    ufl.inner(stress, strain(v)) * around * ufl.dx, nothing, [down, symmetric], ball
)
problem.solve()
force = mesh.comm.allreduce(assemble_scalar(form(problem.pressure * around * ufl.ds)))
