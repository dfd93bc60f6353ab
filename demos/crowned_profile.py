# %% [markdown]
# # A crowned profile that evens the pressure
#
# The edges of a flat punch press hard. A crown that recedes by $g(s)$ at the place $-1 \le s \le 1$
# of the punch evens the pressure: here $g(s) = c_1 s^2 + c_2 s^4 + c_3 s^{16}$. The force is
# prescribed, so that the largest pressure cannot be below the mean one, $P / 2a$, where the mesh
# adds half a cell to each end. Its smooth form is minimised:
#
# $$\min_c \; \Bigl( \frac{1}{|\Gamma|} \int_\Gamma \lambda^{20} \Bigr)^{1/20}.$$
#
# One adjoint solve gives its derivatives by all parameters, which are Constants of the gap.

# %%
import os
from pathlib import Path

import numpy as np
import ufl
from mpi4py import MPI

# isort: split
from dolfinx import fem
from dolfinx import mesh as dmesh
from scipy.optimize import minimize

from signorini_fx import ContactProblem, Foundation

CELLS = int(os.environ.get("CELLS", "96"))
HALF, LOAD, YOUNG, POISSON = 0.75, 10.0, 5000.0, 0.3
MEAN = 3.0 * LOAD / (2 * HALF)
UNIT = LOAD / YOUNG  # of the parameters

# %% [markdown]
# ## The block
#
# It is 3 wide and 1 high, guided at its sides, and pressed from above onto the punch below its
# middle.

# %%
corners, cells = [np.array([0.0, 0.0]), np.array([3.0, 1.0])], [CELLS, CELLS // 3]
mesh = dmesh.create_rectangle(MPI.COMM_WORLD, corners, cells, dmesh.CellType.quadrilateral)
space = fem.functionspace(mesh, ("Lagrange", 1, (2,)))


def side(axis, at):
    """The facets of one side."""
    return dmesh.locate_entities_boundary(mesh, 1, lambda x: np.isclose(x[axis], at))


y, z, x = ufl.TrialFunction(space), ufl.TestFunction(space), ufl.SpatialCoordinate(mesh)
mu, lam = YOUNG / (2 * (1 + POISSON)), YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))


def strain(v):
    """Symmetric gradient."""
    return ufl.sym(ufl.grad(v))


a = ufl.inner(2 * mu * strain(y) + lam * ufl.tr(strain(y)) * ufl.Identity(2), strain(z)) * ufl.dx
top = np.sort(side(1, 1.0))
ds = ufl.Measure(
    "ds", mesh, subdomain_data=dmesh.meshtags(mesh, 1, top, np.ones(top.size, dtype=np.int32))
)
guided = space.sub(0)
bcs = [
    fem.dirichletbc(0.0, fem.locate_dofs_topological(guided, 1, side(0, at)), guided)
    for at in (0.0, 3.0)
]

parameters = [fem.Constant(mesh, 0.0) for _ in range(3)]
s = (x[0] - 1.5) / HALF
crown = sum(c * s**power for c, power in zip(parameters, (2, 4, 16), strict=True))
gap = ufl.conditional(ufl.le(abs(s), 1 + 1e-9), crown, 1.0)
problem = ContactProblem(a, -LOAD * z[1] * ds(1), bcs, contact=[Foundation(side(1, 0.0), gap=gap)])

# %% [markdown]
# ## Minimise
#
# The logarithm of the smoothed largest pressure has derivatives of order one.


# %%
def pressed(values):
    """Log of the smoothed largest pressure over the mean one, and its derivatives."""
    for constant, value in zip(parameters, values, strict=True):
        constant.value = value * UNIT
    problem.solve()
    found = problem.gradient("pressure 0 20", parameters)
    return float(np.log(found.value / MEAN)), found.derivatives * UNIT / found.value


def profile():
    """Place, pressure over the mean one, and crown over its unit at the contact points, in
    order.
    """
    state = problem.state
    depth = sum(
        c.value * np.abs((state.boundary.x[:, 0] - 1.5) / HALF) ** q
        for c, q in zip(parameters, (2, 4, 16), strict=True)
    )
    columns = np.column_stack((state.boundary.x[:, 0], state.pressure / MEAN, depth / UNIT))
    found = np.concatenate(mesh.comm.allgather(columns))
    return found[np.argsort(found[:, 0])]


pressed(np.zeros(3))
flat = profile()
found = minimize(pressed, np.zeros(3), jac=True, method="BFGS", options={"gtol": 1e-4})
value, _ = pressed(found.x)
crowned = profile()
before, after = float(flat[:, 1].max()), float(crowned[:, 1].max())
if mesh.comm.rank == 0:
    print(f"largest over mean pressure: {before:.3f} before, {after:.3f} after {found.nfev} solves")
    print("c E / load:", ", ".join(f"{one:.4f}" for one in found.x))

# %% [markdown]
# ## Before and after

# %%
if mesh.comm.rank == 0:
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, (above, below) = plt.subplots(2, 1, figsize=(7, 5), sharex=True, layout="constrained")
    above.plot(flat[:, 0], flat[:, 1], ".-", color="0.6", label="flat")
    above.plot(crowned[:, 0], crowned[:, 1], ".-", color="tab:blue", label="crowned")
    above.axhline(1.0, color="0.8", zorder=0)
    above.set_ylabel("pressure / mean pressure")
    above.legend(frameon=False)
    under = np.abs(crowned[:, 0] - 1.5) <= HALF + 1e-9
    below.plot(flat[under, 0], 0 * flat[under, 0], color="0.6")
    below.plot(crowned[under, 0], -crowned[under, 2], color="tab:blue")
    below.set_xlabel("x")
    below.set_ylabel("punch, height in load / E")
    folder = Path("results/demos")
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / "crowned_profile.png", dpi=150)
