# %% [markdown]
# # The dovetail foot of a blade in its groove
#
# A fan blade hangs in the rim of its disk by a dovetail: the centrifugal force $P$ pulls the foot
# outwards, and two inclined flanks hold it. The disk is taken as rigid. On each flank, at the angle
# $\varphi$ to the tangent of the rim, act the normal force $N$ and the friction $T$ along the
# flank. Equilibrium of the foot says
#
# $$\tfrac{1}{2} P = N \cos\varphi + T \sin\varphi, \qquad |T| \le F N .$$
#
# While the speed increases, the foot is drawn up along the flanks and friction helps to hold it, $T
# = F N$ where all of the flank slides; while it decreases, the foot cannot slip back freely and
# friction reverses. So
#
# $$\frac{P}{2(\cos\varphi + F \sin\varphi)} \;\le\; N \;\le\; \frac{P}{2(\cos\varphi - F
# \sin\varphi)} :$$
#
# at the same speed the contact force on the flanks is larger while the speed decreases. This
# hysteresis, and the slip back and forth near the ends of the flanks, are what makes dovetails
# crack (fretting).

# %%
import os
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from mpi4py import MPI

from signorini_fx import (
    Contact,
    Coulomb,
    Displacement,
    LinearElastic,
    MeshFile,
    Scene,
    Traction,
    solve,
    write_results,
)
from signorini_fx.addons.pictures.style import STYLE

plt.rcParams.update(STYLE)
CELLS = int(os.environ.get("CELLS", "60"))  # facets along each flank
RESULTS = Path("results/demos/dovetail")
ANGLE, FRICTION = np.radians(50.0), 0.2
FLANK = 8.0 / np.cos(ANGLE)

# %% [markdown]
# ## Scene, in mm, N and MPa
#
# Titanium, plane strain. The pull of the blade above is a traction on the cut through the stem, the
# centrifugal force of the foot itself would be a `body_force`. The blade is guided sideways at the
# cut. The flanks of the groove are flat in the middle and fall back by a few hundredths of a
# millimetre towards their ends (crowning): the sharp end of a flat rigid flank would press with an
# infinite pressure, and no mesh would converge to it.

# %%
crowning = "0.03 * (2 * max(0, abs(abs(x[0]) - 11) / 3.4 - 0.5))**2"
speed = np.concatenate(
    (np.linspace(0.2, 1.0, 5), np.linspace(0.8, 0.2, 4))
)  # of the square of the speed
pull = 150.0  # MPa in the stem, at full speed
scene = Scene(
    title="Dovetail foot of a blade",
    mesh=MeshFile(file=Path(__file__).parent / "blade_foot.geo"),
    material=LinearElastic(young=114000.0, poisson=0.33),
    displacement=Displacement(boundary="top", x=0.0),
    traction=Traction(boundary="top", pressure=-pull, factors=tuple(speed)),
    contact=[
        Contact(
            boundary=flank,
            gap=crowning,
            friction=Coulomb(coefficient=FRICTION),
            contact_size=FLANK / CELLS,
        )
        for flank in ("left", "right")
    ],
)

# %% [markdown]
# ## Increasing and decreasing speed

# %%
solution = solve(scene)
write_results(solution, RESULTS)


def flank_forces(step):
    """N and T of both flanks together, T > 0 where friction holds the foot; collective."""
    contact, comm = step.contact, solution.comm
    weight = contact.boundary.weight
    # Along the tangent the right flank rises to the left, the left one to the right.
    upwards = np.where(contact.boundary.tangents[:, 1, 0] > 0, 1.0, -1.0)
    normal, shear = np.dot(weight, contact.pressure), np.dot(weight * upwards, contact.shear[:, 0])
    return comm.allreduce(normal), comm.allreduce(shear)


load = 14.0 * pull * speed
normal, shear = np.array([flank_forces(step) for step in solution.steps]).T
balance = normal * np.cos(ANGLE) + shear * np.sin(ANGLE)
low, high = (load / (np.cos(ANGLE) + sign * FRICTION * np.sin(ANGLE)) for sign in (1, -1))

# %% [markdown]
# ## Hysteresis
#
# Equilibrium holds to round-off in every step. While the speed increases nearly all of each flank
# slides, so $N$ is at its lower bound; while it decreases, $N$ is above it.

# %%
if MPI.COMM_WORLD.rank == 0:
    for row in zip(speed, load, normal, low, high, strict=True):
        print(
            "share of the load {:.1f}: P = {:6.1f}, N = {:6.1f} N/mm, between {:6.1f} and "
            "{:6.1f}".format(*row)
        )
    figure, axes = plt.subplots(figsize=(6, 3.6), layout="constrained")
    axes.fill_between(load[:5], low[:5], high[:5], color="0.9", label="where equilibrium allows it")
    axes.plot(load[:5], normal[:5], "k.-", label="running up")
    axes.plot(load[4:], normal[4:], "k.--", label="running down")
    axes.set(xlabel="pull $P$, N/mm", ylabel="normal force on both flanks, N/mm")
    axes.legend(frameon=False)
    figure.savefig(RESULTS / "hysteresis.png", dpi=150)
    plt.close(figure)

# %% [markdown]
# ## The flank at full speed
#
# The pressure is largest near the upper end, under the stem; all of the flank that touches slides.

# %%
full = solve(scene.model_copy(update={"traction": (Traction(boundary="top", pressure=-pull),)}))
columns = full.table.columns
right = columns["boundary"] == "right"
mean = np.dot(columns["weight"][right], columns["pressure"][right]) / FLANK
largest = columns["pressure"].max()
write_results(full, RESULTS / "full_speed")
if MPI.COMM_WORLD.rank == 0:
    print(f"pressure on the flank: mean {mean:.0f} MPa, largest {largest:.0f} MPa")
    print(f"results: {RESULTS}/")
