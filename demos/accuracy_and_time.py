# %% [markdown]
# # What accuracy costs
#
# How large is the error of a result, and what would the next accuracy cost? A nested iteration
# solves on coarser meshes anyway, and their solutions give an estimate. For the contact pressure it
# is derived from the difference between successive meshes,
#
# $$\frac{\|\lambda - \lambda_h\|}{\|\lambda\|} \approx \eta_h ,$$
#
# see [theory](../docs/theory.md#error-estimates). Here it is compared with the true error, that is,
# with a
# solution on a much finer mesh, for Example 1 of the paper with Coulomb friction. Then an accuracy
# is requested, and the result is checked in the same way.

# %%
import os
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from mpi4py import MPI
from matplotlib.ticker import LogLocator

from signorini_fx import Accuracy, MeshGenerator, read_scene, solve, write_results
from signorini_fx.addons.pictures.style import STYLE

plt.rcParams.update(STYLE)
CELLS = int(os.environ.get("CELLS", "192"))
RESULTS = Path("results/demos/accuracy_and_time")
SCENE = read_scene(Path(__file__).parent / "scenes" / "example1_coulomb.toml")


def on_mesh(cells, levels):
    """Example 1 with ``cells`` along the block, and ``levels`` meshes."""
    parameters = {**SCENE.mesh.parameters, "nx": cells, "ny": cells // 3}
    return SCENE.model_copy(
        update={
            "mesh": MeshGenerator(generator=SCENE.mesh.generator, parameters=parameters),
            "solver": SCENE.solver.model_copy(update={"levels": levels}),
        }
    )


# %% [markdown]
# ## The reference, twice as fine as the finest mesh

# %%
reference = solve(on_mesh(2 * CELLS, 4)).table.columns


def true_error(columns):
    """Of the pressure in L2 along the contact boundary, relative."""
    exact, weight = reference["pressure"], reference["weight"]
    here = np.interp(reference["x"], columns["x"], columns["pressure"])
    return np.sqrt(np.dot(weight, (here - exact) ** 2) / np.dot(weight, exact**2))


# %% [markdown]
# ## Estimated and true
#
# The row `predicted` is the next mesh, which has not been solved.

# %%
cells = [CELLS // 4, CELLS // 2, CELLS]
estimated, true, seconds = [], [], []
for count in cells:
    solution = solve(on_mesh(count, 3))
    *_, price, following = solution.convergence_table
    estimated.append(price.pressure)
    true.append(true_error(solution.table.columns))
    seconds.append(sum(row.seconds for row in solution.convergence_table if not row.predicted))
    if MPI.COMM_WORLD.rank == 0:
        print(
            f"{count:4d} cells: {price.dofs:6d} unknowns, error of the pressure "
            f"{estimated[-1]:.4f} estimated, "
            f"{true[-1]:.4f} true; the next mesh: {following.dofs} unknowns, "
            f"{following.seconds:.2g} s predicted"
        )
write_results(solution, RESULTS)

# %% [markdown]
# ## Requesting an accuracy
#
# Now the meshes are chosen by the package, which stops as soon as twice the estimate meets the
# target.

# %%
TARGET = 0.05
asked = solve(
    on_mesh(CELLS, 1).model_copy(update={"accuracy": Accuracy(target=TARGET, of="pressure")})
)
reached = true_error(asked.table.columns)
if MPI.COMM_WORLD.rank == 0:
    print(
        f"asked for {TARGET}: reached {reached:.4f} with {asked.convergence_table[-2].dofs} "
        "unknowns"
    )
    figure, axes = plt.subplots(figsize=(6, 3.6), layout="constrained")
    axes.loglog(seconds, true, "ko-", label="true")
    axes.loglog(seconds, estimated, "k^--", label="estimated")
    axes.axhline(TARGET, color="0.7", label="asked for")
    axes.set(xlabel="seconds, all meshes together", ylabel="relative error of the pressure")
    axes.set_xticks(seconds, [f"{value:.2g}" for value in seconds])
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.minorticks_off()
    axes.legend(frameon=False)
    figure.savefig(RESULTS / "error_against_time.png", dpi=150)
    plt.close(figure)
    print(f"results: {RESULTS}/")
