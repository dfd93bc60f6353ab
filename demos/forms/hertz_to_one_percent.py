# %% [markdown]
# # Hertz's line contact, to 1 % of the peak pressure
#
# Half a disk is pressed on a rigid plane. What needs finer meshes takes a function that makes the
# problem on any mesh; each mesh begins with the contact state of the one before, and has an
# estimate of its error. With the load $P$ and $E^* = E / (1 - \nu^2)$ the peak is
#
# $$p_0 = \sqrt{\frac{P E^*}{\pi R}} .$$

# %%
import numpy as np
import ufl
from mpi4py import MPI
from dolfinx.fem import dirichletbc, functionspace, locate_dofs_topological
from dolfinx.mesh import meshtags

from signorini_fx import Accuracy, ContactProblem, Foundation, generate_mesh, solve_to_accuracy

E, NU, RADIUS, LOAD = 200.0, 0.3, 8.0, 3.4523


def disk(n):
    """Half of the half disk, with cells n times as small as those of the coarsest one."""
    sizes = {"size": 1.0 / n, "contact_size": 0.3 / n, "contact_zone": 0.6}
    return generate_mesh(
        "half_disk", {"radius": RADIUS, "symmetric": True, **sizes}, MPI.COMM_WORLD
    )


def stress(y):
    """Hooke's law, plane strain."""
    return E / (1 + NU) * (ufl.sym(ufl.grad(y)) + NU / (1 - 2 * NU) * ufl.div(y) * ufl.Identity(2))


def make(disk):
    """The problem on a mesh: the weight LOAD of both halves, at the top."""
    V, top = functionspace(disk.mesh, ("Lagrange", 1, (2,))), disk.facets("top")
    u, v, x = ufl.TrialFunction(V), ufl.TestFunction(V), ufl.SpatialCoordinate(disk.mesh)
    ds = ufl.ds(
        domain=disk.mesh, subdomain_data=meshtags(disk.mesh, 1, top, np.full(top.size, 1, np.int32))
    )
    held = dirichletbc(0.0, locate_dofs_topological(V.sub(0), 1, disk.facets("symmetry")), V.sub(0))
    a, L = ufl.inner(stress(u), ufl.grad(v)) * ufl.dx, -LOAD / (2 * RADIUS) * v[1] * ds(1)
    return ContactProblem(
        a, L, [held], Foundation(disk.facets("arc"), gap=x[1], direction=(0, -1)), stress=stress
    )


solution = solve_to_accuracy(make, disk, Accuracy(target="1%", of="peak"))
largest, peak = (
    solution.table.columns["pressure"].max(),
    np.sqrt(LOAD * E / (1 - NU**2) / (np.pi * RADIUS)),
)
print(f"{largest:.4g} of {peak:.4g}, estimated error {solution.convergence_table[-2].peak:.1%}")
