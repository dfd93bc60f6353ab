# %% [markdown]
# # A dent that stays
#
# A rigid circle is pressed into a metal and taken away. The metal yields by von Mises with linear
# hardening:
#
# $$\sqrt{3/2}\, |s - 2 \mu\, \varepsilon^p| \le \sigma_Y + H \alpha ,$$
#
# with $s$ the deviator of the elastic stress. `NonlinearContactProblem` takes any residual. A
# material with a state has two functions: `update` computes stress and tangent at a new
# displacement from the state of the last step, here by radial return (J. C. Simo and T. J. R.
# Hughes, Computational Inelasticity, Springer, 1998, box 3.2); `commit` keeps the state where a
# step ends.

# %%
import os

import numpy as np
import ufl
from mpi4py import MPI
from dolfinx import fem, mesh

from signorini_fx import Foundation, NonlinearContactProblem

BULK, MU, YIELD, HARDENING = 167e3, 77e3, 300.0, 2e3
CELLS = int(os.environ.get("CELLS", "24"))


def strain(y):
    """Plane strain, shape (3, 3)."""
    e = ufl.sym(ufl.grad(y))
    return ufl.as_matrix([[e[0, 0], e[0, 1], 0], [e[1, 0], e[1, 1], 0], [0, 0, 0]])


class VonMises:
    """Stress, tangent and state in each cell of a mesh of triangles, for a displacement of degree
    1.
    """

    def __init__(self, u):
        domain = u.function_space.mesh
        tensors, scalars = (
            fem.functionspace(domain, element) for element in (("DG", 0, (3, 3)), ("DG", 0))
        )
        self.order, cells = (
            scalars.dofmap.list[:, 0],
            np.arange(len(scalars.dofmap.list), dtype=np.int32),
        )
        middle = fem.Expression(strain(u), np.array([[1 / 3, 1 / 3]]))
        self.strain_now = lambda: middle.eval(domain, cells).reshape(-1, 3, 3)
        self.stress, self.normal = fem.Function(tensors), fem.Function(tensors)
        self.beta, self.gamma, self.hardened = (fem.Function(scalars) for _ in range(3))
        self.latest = self.state = np.zeros((len(cells), 3, 3)), np.zeros(len(cells))

    def update(self):
        """Radial return from the state of the last step."""
        e, (plastic, hardened) = self.strain_now(), self.state
        volume = np.trace(e, axis1=1, axis2=2)[:, None, None] * np.eye(3)
        trial = 2 * MU * (e - volume / 3 - plastic)
        size = np.maximum(np.linalg.norm(trial, axis=(1, 2)), 1e-12 * YIELD)
        flow = np.maximum(np.sqrt(1.5) * size - YIELD - HARDENING * hardened, 0) / (
            3 * MU + HARDENING
        )
        share, n = 1 - np.sqrt(6) * MU * flow / size, trial / size[:, None, None]
        self.latest = plastic + np.sqrt(1.5) * flow[:, None, None] * n, hardened + flow
        self.stress.x.array.reshape(-1, 9)[self.order] = (
            BULK * volume + share[:, None, None] * trial
        ).reshape(-1, 9)
        self.normal.x.array.reshape(-1, 9)[self.order] = n.reshape(-1, 9)
        self.beta.x.array[self.order] = share
        self.gamma.x.array[self.order] = (flow > 0) * (3 * MU / (3 * MU + HARDENING) - (1 - share))

    def commit(self):
        """The next step starts here."""
        self.state = self.latest
        self.hardened.x.array[self.order] = self.state[1]

    def tangent(self, e):
        """Change of the stress."""
        deviator = e - ufl.tr(e) / 3 * ufl.Identity(3)
        turned = self.gamma * ufl.inner(self.normal, e) * self.normal
        return BULK * ufl.tr(e) * ufl.Identity(3) + 2 * MU * (self.beta * deviator - turned)


# %% [markdown]
# The residual is the stress against the strain of the test function, and the tangent is its
# derivative.

# %%
crossed = {"cell_type": mesh.CellType.triangle, "diagonal": mesh.DiagonalType.crossed}
domain = mesh.create_rectangle(
    MPI.COMM_WORLD, [[0.0, 0.0], [2.0, 1.0]], [2 * CELLS, CELLS], **crossed
)
V = fem.functionspace(domain, ("Lagrange", 1, (2,)))
u, v, du = fem.Function(V), ufl.TestFunction(V), ufl.TrialFunction(V)
metal = VonMises(u)
F = ufl.inner(metal.stress, strain(v)) * ufl.dx
J = ufl.inner(metal.tangent(strain(du)), strain(v)) * ufl.dx
bottom, top = (
    mesh.locate_entities_boundary(domain, 1, lambda x, y=y: np.isclose(x[1], y)) for y in (0.0, 1.0)
)
fixed = fem.dirichletbc(np.zeros(2), fem.locate_dofs_topological(V, 1, bottom), V)
circle = {"shape": "circle", "centre": (1.0, 2.0), "radius": 1.0}
problem = NonlinearContactProblem(
    F,
    u,
    J=J,
    bcs=[fixed],
    contact=Foundation(top, shape=circle),
    update=metal.update,
    commit=metal.commit,
)
DEPTH, path = 0.02, [(0.0, 0.0)]
for depth in (*np.linspace(0, DEPTH, 9)[1:], *(DEPTH * np.array([0.95, 0.9, 0.85, 0.8, 0.7]))):
    problem.place(0, shift=(0.0, -depth))
    problem.solve()
    problem.advance()
    path.append((depth, -problem.state.forces[0][1]))
path = np.array(path)
dent = -MPI.COMM_WORLD.allreduce(u.x.array.reshape(-1, 2)[:, 1].min(), MPI.MIN)

# %% [markdown]
# The metal under the circle has hardened, and the force does not go back the way it came.

# %%
print(f"force {path[:, 1].max():.0f} N/mm, a dent of {dent:.4f} mm is left; {problem.certificate}")
if MPI.COMM_WORLD.size == 1:
    from pathlib import Path

    import matplotlib.pyplot as plt

    figure, (body, curve) = plt.subplots(
        1, 2, figsize=(9, 3.2), width_ratios=(2, 1), layout="constrained"
    )
    corners = V.tabulate_dof_coordinates()[:, :2] + 5 * u.x.array.reshape(-1, 2)
    shown = body.tripcolor(
        *corners.T,
        V.dofmap.list,
        facecolors=100 * metal.hardened.x.array[metal.order],
        cmap="cividis",
    )
    figure.colorbar(
        shown, ax=body, label="hardening strain in %", orientation="horizontal", shrink=0.6
    )
    body.set(aspect="equal", title="left behind, displacement 5 times")
    body.set_axis_off()
    curve.plot(*path.T, "o-", color="#1f4e79", markersize=3)
    curve.set(xlabel="depth of the circle in mm", ylabel="force in N/mm", xticks=(0, 0.01, 0.02))
    Path("results/demos").mkdir(parents=True, exist_ok=True)
    figure.savefig("results/demos/dent.png", dpi=110)
