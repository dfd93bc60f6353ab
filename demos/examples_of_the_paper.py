# %% [markdown]
# # Examples 1 and 2 of Kunisch and Stadler (2005)
#
# An elastic body $\Omega$ is pressed onto a rigid foundation. With $\sigma(y)$ the stress of the
# displacement $y$, $n$ the outward normal, $\tau_N y = y \cdot n$ and $\tau_T y$ its part along the
# boundary, and the distance $d$ to the foundation, the conditions on the contact boundary
# $\Gamma_c$ are Signorini's
#
# $$\tau_N y \le d, \qquad \lambda \ge 0, \qquad \lambda\,(\tau_N y - d) = 0 \qquad (\lambda =
# -\sigma_N),$$
#
# and a friction law, with the shear $\mu = -\sigma_T$ and a friction bound $g$,
#
# $$|\mu| \le g, \qquad |\mu| < g \Rightarrow \tau_T y = 0, \qquad
#   |\mu| = g \Rightarrow \mu \text{ has the direction of } \tau_T y .$$
#
# Tresca: $g$ is given. Coulomb: $g = F \lambda$. Elsewhere $-\operatorname{div} \sigma(y) = f$,
# with prescribed displacements and tractions.
#
# Run it as it is, on two ranks with `mpirun -n 2`, or coarser with `CELLS=60` in the environment.

# %%
import os
from pathlib import Path

from mpi4py import MPI

from signorini_fx import MeshGenerator, read_scene, solve, write_results

CELLS = int(os.environ.get("CELLS", "120"))  # along the block, three times as many as up its height
SCENES = Path(__file__).parent / "scenes"
RESULTS = Path("results/demos")

# %% [markdown]
# ## The scenes
#
# A scene lists what acts on the body, and nothing else is computed. Both examples are files beside
# this script; only their mesh is replaced, so that it can be coarser.


# %%
def scene_of(name):
    """A scene file with CELLS cells along its body."""
    scene = read_scene(SCENES / f"{name}.toml")
    parameters = {**scene.mesh.parameters, "nx": CELLS, "ny": CELLS // 3}
    mesh = MeshGenerator(generator=scene.mesh.generator, parameters=parameters)
    return scene.model_copy(update={"mesh": mesh})


# %% [markdown]
# ## Solve them
#
# `solve` raises `ConvergenceError` unless the conditions above hold, which is checked anew after
# the iteration. The pictures in the result folders show the deformed body and the curves along
# $\Gamma_c$.

# %%
energy, peak, solves, sliding = {}, {}, {}, {}
for name in ("example1_tresca", "example1_coulomb", "example2_tresca"):
    solution = solve(scene_of(name))
    columns = solution.table.columns
    energy[name] = solution.steps[-1].strain_energy
    peak[name] = columns["pressure"].max()
    solves[name] = solution.history.linear_solves
    sliding[name] = solution.table.zones(
        (columns["pressure"] > 0) & (columns["friction"] != "stick")
    )
    write_results(solution, RESULTS / name)
    if MPI.COMM_WORLD.rank == 0:
        print(
            f"{name:17s} energy {energy[name]:.6f}, largest pressure {peak[name]:.3f}, "
            f"{solves[name]} linear solves"
        )
        print(f"                  results: {RESULTS / name}/")

# %% [markdown]
# On the paper's mesh, 120 x 40, Example 1 has the energy 0.0231870 with Tresca and 0.0234108 with
# Coulomb friction, and the largest pressures 20.112 and 20.181. In the middle of the contact zone
# the block sticks, at both ends it slides; the picture `profiles.png` shows where, as a strip below
# the curves.
