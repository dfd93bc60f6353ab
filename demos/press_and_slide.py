# %% [markdown]
# # Press and slide: a friction loop
#
# A block is pressed onto a rough foundation, then its top is pushed to the right and pulled back,
# twice. With load steps the friction law acts on what a step adds to the tangential displacement,
#
# $$|\mu| \le F \lambda, \qquad |\mu| < F\lambda \Rightarrow \Delta\tau_T y = 0, \qquad
#   |\mu| = F\lambda \Rightarrow \mu \text{ has the direction of } \Delta\tau_T y,$$
#
# so the result depends on the load path. Over a closed loop the work of the push equals the work
# that friction dissipates,
#
# $$\oint T \,\mathrm{d}u_{\mathrm{top}} = \sum_{\text{steps}} \int_{\Gamma_c} \mu\, \Delta\tau_T y
# .$$

# %%
import os
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from mpi4py import MPI

from signorini_fx import MeshGenerator, read_scene, solve, write_results
from signorini_fx.addons.pictures.style import STYLE

plt.rcParams.update(STYLE)
CELLS = int(os.environ.get("CELLS", "60"))
RESULTS = Path("results/demos/press_and_slide")

# %% [markdown]
# ## Scene
#
# The file has 37 load steps: the pressure acts in all of them, the push is multiplied by `factors`.

# %%
scene = read_scene(Path(__file__).parent / "scenes" / "press_and_slide.toml")
mesh = MeshGenerator(
    generator="rectangle", parameters={**scene.mesh.parameters, "nx": CELLS, "ny": CELLS // 3}
)
scene = scene.model_copy(update={"mesh": mesh})
(push,) = (load for load in scene.displacement if load.factors)
top = push.x * np.array(push.factors)

# %% [markdown]
# ## Solve, and take the loop from the steps

# %%
solution = solve(scene)
write_results(solution, RESULTS)
force = np.array(
    [-step.contact.forces[1][0] for step in solution.steps]
)  # what must be pushed with
work = np.array([step.contact.friction_work for step in solution.steps])

# %% [markdown]
# ## The loop
#
# The second loop, from step 20 to step 36, repeats the first. Its area, computed by the trapezoidal
# rule, is the work of friction in these steps; the rule is exact only where the force is linear
# within a step, so they agree to a few percent.

# %%
LOOP = slice(20, 37)
area = np.trapezoid(force[LOOP], top[LOOP])
lost = work[21:37].sum()
closing = abs(force[36] - force[20]) / force.max()
if MPI.COMM_WORLD.rank == 0:
    print(
        f"largest force {force.max():.4f}, area of the loop {area:.6f}, work of friction {lost:.6f}"
    )
    figure, axes = plt.subplots(figsize=(6, 3.6), layout="constrained")
    axes.plot(top[:5], force[:5], "k:", label="first push")
    axes.plot(top[4:21], force[4:21], color="0.75", linewidth=4, label="first loop")
    axes.plot(top[LOOP], force[LOOP], "k.-", linewidth=1, label="second loop")
    axes.set(xlabel="displacement of the top", ylabel="horizontal force")
    axes.legend(frameon=False)
    figure.savefig(RESULTS / "loop.png", dpi=150)
    plt.close(figure)
    print(f"results: {RESULTS}/")
