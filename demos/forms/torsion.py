# %% [markdown]
# # Torsion with friction
#
# A body is pressed onto a rigid sphere and turned about its axis. Nothing depends on the angle
# around the axis, but displacements have a component around it, and friction acts in two directions
# along the surface. The mesh is a section of the body in 3D: its points are $(r, z, 0)$, and the
# third component of a displacement is that around the axis. Along it the gradient is that of a
# vector which turns with the section. At the end everything slips, and
#
# $$T = \frac{3 \pi}{16} F N a$$
#
# for the pressure of Hertz's contact of radius $a$, as far as the body does not slip outwards, too.

# %%
import numpy as np
import ufl
from mpi4py import MPI
from dolfinx.fem import (
    Constant,
    Function,
    assemble_scalar,
    dirichletbc,
    form,
    functionspace,
    locate_dofs_topological,
)
from dolfinx.mesh import CellType, create_rectangle, locate_entities_boundary

from signorini_fx import ContactProblem, Coulomb, Foundation, embed_in_3d

E, NU, DOWN, ANGLE, F, BALL = (
    1000.0,
    0.49,
    0.0125,
    0.05,
    0.3,
    {"shape": "sphere", "centre": (0, -4, 0), "radius": 4},
)
mesh = embed_in_3d(
    create_rectangle(MPI.COMM_WORLD, [[0.0, 0.0], [1.0, 1.0]], [24, 24], CellType.quadrilateral)
)
mesh.geometry.x[:] = 4.0 * mesh.geometry.x**2.5  # fine near the contact, which reaches r = 0.2
V = functionspace(mesh, ("Lagrange", 2, (3,)))
u, v, r = ufl.TrialFunction(V), ufl.TestFunction(V), ufl.SpatialCoordinate(mesh)[0]
around = 2 * np.pi * r


def strain(y):
    return ufl.sym(
        ufl.grad(y) + ufl.outer(ufl.as_vector([-y[2], 0, y[0]]) / r, ufl.unit_vector(2, 3))
    )


stress = E / (1 + NU) * (strain(u) + NU / (1 - 2 * NU) * ufl.tr(strain(u)) * ufl.Identity(3))
places = ((1, 0.0), (1, 4.0), (0, 0.0))
bottom, top, axis = (
    locate_entities_boundary(mesh, 1, lambda x, k=k, at=at: np.isclose(x[k], at))
    for k, at in places
)
moved, nothing = Function(V), ufl.inner(Constant(mesh, (0.0, 0.0, 0.0)), v) * ufl.dx
moved.interpolate(lambda x: np.stack((0 * x[0], 0 * x[0] - DOWN, -ANGLE * x[0])))
still = [dirichletbc(0.0, locate_dofs_topological(V.sub(k), 1, axis), V.sub(k)) for k in (0, 2)]
ball = Foundation(bottom, friction=Coulomb(F), measure=around, shape=BALL)
conditions = [*still, dirichletbc(moved, locate_dofs_topological(V, 1, top))]
problem = ContactProblem(ufl.inner(stress, strain(v)) * around * ufl.dx, nothing, conditions, ball)
problem.solve()
torque = mesh.comm.allreduce(assemble_scalar(form(-r * problem.shear[2] * around * ufl.ds)))
