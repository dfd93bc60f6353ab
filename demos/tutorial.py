# %% [markdown]
# # Tutorial: a block on a curved foundation
#
# A block of 3 x 1 is pressed with 20 onto a foundation that curves away from it; its ends are
# guided. The unknown is the displacement $y$, together with where the block touches the foundation
# and where it slips on it. On the bottom $\Gamma_c$ the contact pressure $\lambda$ and the gap $d$
# satisfy Signorini's conditions, the shear $\mu$ Coulomb's law:
#
# $$ y_n \le d, \quad \lambda \ge 0, \quad \lambda\,(y_n - d) = 0; \qquad
#    |\mu| \le F \lambda, \quad \mu = F \lambda\, \operatorname{sign} y_t \ \text{ where } y_t \ne
#    0. $$
#
# This is Example 1 of Kunisch and Stadler (2005). The tutorial takes seconds; it is also a
# notebook, `demos/tutorial.ipynb`.

# %%
import os
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import signorini_fx as sfx
from signorini_fx.addons.pictures.style import STYLE

plt.rcParams.update(STYLE)
CELLS = int(os.environ.get("CELLS", "60"))  # along the block
RESULTS = Path("results/demos/tutorial")

# %% [markdown]
# ## A scene
#
# A scene lists what acts on the body, and nothing else is computed. A value is a number, an
# expression of the position `x`, or a function. There are no units: use any consistent ones, such
# as N and mm.


# %%
def block(friction, top="-20 if 1 <= x[0] <= 2 else 0", **guides):
    """The block with this friction law and this vertical traction on its top; ``guides``: what
    holds its ends.
    """
    return sfx.Scene(
        title="A block on a curved foundation",
        mesh=sfx.MeshGenerator(
            generator="block",
            parameters={"length": 3.0, "height": 1.0, "nx": CELLS, "ny": CELLS // 3},
        ),
        material=sfx.LinearElastic(young=5000.0, poisson=0.4),
        displacement=[
            sfx.Displacement(boundary=side, **(guides or {"x": 0.0})) for side in ("left", "right")
        ],
        traction=sfx.Traction(boundary="top", y=top),
        contact=sfx.Contact(
            boundary="bottom", gap=lambda x: 0.003 * (x[0] - 1.5) ** 2 + 0.001, friction=friction
        ),
    )


scene = block(sfx.Coulomb(coefficient=0.3))

# %% [markdown]
# ## Solve it
#
# `print_progress` prints one line for each linear solve: how many nodes are in contact and slip,
# how many have changed their state (0 at the end), and the residual.

# %%
solution = sfx.solve(scene, observers=[sfx.print_progress])
solution

# %% [markdown]
# `plot` draws the deformed body with its von Mises stress, the curves along the contact boundary
# and the iteration, as they are written to a result folder below:

# %%
sfx.plot(solution)

# %% [markdown]
# *converged* says more than that an iteration ended: the conditions above, the equilibrium and the
# supports were checked with the displacement, independently of the solver. This is the certificate:

# %%
solution.certificate

# %% [markdown]
# ## What the foundation carries
#
# The contact force balances the load, which is 20 on a length of 1. By symmetry there is no
# resultant friction.

# %%
contact_force, friction_force = solution.contact.forces
print(f"contact force {contact_force[1]:.6f} upwards, friction force {friction_force[0]:.6f}")
np.testing.assert_allclose(contact_force, [0.0, 20.0], atol=1e-6)

# %% [markdown]
# ## Along the contact boundary
#
# `solution.table` has one row per contact node: position, gap, displacement, pressure, shear,
# state.

# %%
solution.table

# %%
RESULTS.mkdir(parents=True, exist_ok=True)
columns = solution.table.columns
figure, axes = plt.subplots(figsize=(6, 3.4), layout="constrained")
axes.plot(columns["x"], columns["pressure"], "k-", label=r"pressure $\lambda$")
axes.plot(columns["x"], columns["shear"], "k--", label=r"shear $\mu$")
axes.fill_between(
    columns["x"], -columns["bound"], columns["bound"], color="0.9", label=r"$|\mu| \leq F \lambda$"
)
axes.set(xlabel="$x$", ylabel="stress", xlim=(0, 3))
axes.legend(frameon=False)
figure.savefig(RESULTS / "stresses.png", dpi=150)
plt.close(figure)
figure

# %% [markdown]
# The block sticks where the shear is below its bound, and slips outwards where it is at the bound:

# %%
for state in ("stick", "slip+", "slip-"):
    runs = solution.table.zones(columns["state"] == state)
    print(f"{state:6s}", [f"{run[0][0]:.2f} to {run[-1][0]:.2f}" for run in runs])

# %% [markdown]
# ## Change something
#
# Many values of one parameter cost little more than one, because the body is assembled and
# factorised once:

# %%
values = [0.05, 0.1, 0.2, 0.4, 0.8]
for value, point in zip(
    values, sfx.sweep(scene, {"contact.friction.coefficient": values}), strict=True
):
    largest = point.contact.pressure.max()
    print(f"F = {value:4.2f}: {point.history.linear_solves} linear solves, pressure {largest:.4f}")

# %% [markdown]
# ## When there is no solution
#
# Without its guides, without friction and with an oblique load nothing could balance the block.
# That is proved from statics and ends in an outcome with a name; nothing is hidden behind a number
# of iterations.

# %%
pushed = block(sfx.NoFriction(), y=0.0).model_copy(
    update={"displacement": (), "traction": (sfx.Traction(boundary="top", x=1.0, y=-20.0),)}
)
try:
    sfx.solve(pushed)
    outcome = None
except sfx.ConvergenceError as error:
    outcome = error.solution.status
    print(error)

# %% [markdown]
# ## Keep it
#
# The result folder has tables, pictures, fields for ParaView and `summary.json`; `signorini-fx
# report` makes one HTML page of it.

# %%
summary = sfx.write_results(solution, RESULTS)
print(summary["status"], sorted(file.name for file in RESULTS.glob("*.csv")))

# %% [markdown]
# Where to go on: [load steps](../docs/load-steps.md), [a body of your own](../docs/own-body.md),
# [the scene file](../docs/scene.md), [the gallery](../docs/gallery.md).
