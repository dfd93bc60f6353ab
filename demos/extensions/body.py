"""A body of one's own: rubber by its stored energy, with stresses and tangent as they follow from
it.
"""

import numpy as np
import ufl
from mpi4py import MPI
from dolfinx import fem, mesh

from signorini_fx import Coulomb, Foundation, NonlinearContactProblem

domain = mesh.create_rectangle(
    MPI.COMM_WORLD, [[0.0, 0.0], [2.0, 1.0]], [16, 8], mesh.CellType.quadrilateral
)
V = fem.functionspace(domain, ("Lagrange", 1, (2,)))
u, v, w = fem.Function(V, name="u"), ufl.TestFunction(V), ufl.TrialFunction(V)
dx = ufl.dx(metadata={"quadrature_degree": 2})
gradient = ufl.variable(ufl.Identity(2) + ufl.grad(u))
J, mu, lame = ufl.det(gradient), 40.0, 60.0
energy = mu / 2 * (ufl.inner(gradient, gradient) - 2) - mu * ufl.ln(J) + lame / 2 * ufl.ln(J) ** 2
stress = ufl.diff(energy, gradient)
residual = ufl.inner(stress, ufl.grad(v)) * dx
tangent = ufl.derivative(residual, u, w)

bottom, top = (
    mesh.locate_entities_boundary(domain, 1, lambda x, y=y: np.isclose(x[1], y)) for y in (0.0, 1.0)
)
fixed = fem.dirichletbc(np.zeros(2), fem.locate_dofs_topological(V, 1, bottom), V)
circle = Foundation(
    top, shape={"shape": "circle", "centre": (1.0, 1.5), "radius": 0.5}, friction=Coulomb(0.3)
)
problem = NonlinearContactProblem(residual, u, J=tangent, bcs=[fixed], contact=circle)
problem.run([0.5, 1.0], lambda t: problem.place(0, shift=(0.0, -0.2 * t)))
force, _ = problem.state.forces  # of all ranks
if MPI.COMM_WORLD.rank == 0:
    print(f"force {force[1]:.2f}, {problem.certificate}")
