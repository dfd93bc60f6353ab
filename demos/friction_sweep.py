# %% [markdown]
# # From no friction to stick: a sweep over the coefficient
#
# How does the coefficient $F$ in $|\mu| \le F \lambda$ change the contact of Example 1 of the
# paper? Only the data on the contact boundary change with it. The elastic body is assembled and
# factorised once, and each value starts from the active sets of the one before, so that twenty
# values cost little more than one.

# %%
import os
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from mpi4py import MPI

from signorini_fx import MeshGenerator, read_scene, sweep
from signorini_fx.addons.pictures.style import STYLE

plt.rcParams.update(STYLE)
CELLS = int(os.environ.get("CELLS", "120"))
RESULTS = Path("results/demos/friction_sweep")

scene = read_scene(Path(__file__).parent / "scenes" / "example1_coulomb.toml")
parameters = {**scene.mesh.parameters, "nx": CELLS, "ny": CELLS // 3}
scene = scene.model_copy(
    update={"mesh": MeshGenerator(generator=scene.mesh.generator, parameters=parameters)}
)

# %% [markdown]
# ## Twenty coefficients
#
# The share of the contact that sticks, the friction force of the right half, and the largest
# pressure:

# %%
coefficients = np.linspace(0.05, 1.0, 20)
stick, drag, peak, solves = [], [], [], []
for solution in sweep(scene, {"contact.friction.coefficient": coefficients}):
    assert solution.converged, solution.status
    columns = solution.table.columns
    touching = columns["pressure"] > 0
    sticking = touching & (columns["state"] == "stick")
    weight = columns["weight"]
    stick.append(weight[sticking].sum() / weight[touching].sum())
    right = columns["x"] > 1.5
    drag.append(abs(np.dot(weight[right], columns["shear"][right])))
    peak.append(columns["pressure"].max())
    solves.append(solution.history.linear_solves)

# %% [markdown]
# The stick zone grows with $F$, and with it the friction force. Beyond some $F$ nothing changes any
# more except at the very ends of the contact zone, where the pressure tends to zero.

# %%
if MPI.COMM_WORLD.rank == 0:
    print(" F     sticks  friction  peak    linear solves")
    for row in zip(coefficients, stick, drag, peak, solves, strict=True):
        print("{:5.2f}  {:5.3f}   {:6.4f}   {:6.3f}  {:3d}".format(*row))
    RESULTS.mkdir(parents=True, exist_ok=True)
    figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.4), layout="constrained")
    left.plot(coefficients, stick, "k.-")
    left.set(xlabel="F", ylabel="share of the contact that sticks", ylim=(0, 1))
    right.plot(coefficients, drag, "k.-")
    right.set(xlabel="F", ylabel="friction force on the right half", ylim=(0, None))
    figure.savefig(RESULTS / "sweep.png", dpi=150)
    plt.close(figure)
    print(f"results: {RESULTS}/")
