# %% [markdown]
# # Torsion of a pressed cylinder: the stick radius shrinks
#
# A cylinder of radius $a$ and height $H$ is pressed onto a rough plane with the pressure $p$, then
# its top is turned by the angle $\varphi$. Torsion moves every point around the axis, so friction
# has a different direction at every node. As long as the base sticks, the shear grows with the
# radius,
#
# $$\mu = G\varphi\, \frac{r}{H}, \qquad M = \frac{\pi}{2}\, \frac{G \varphi a^4}{H}
#   \qquad\text{up to}\qquad \varphi_1 = \frac{F p H}{G a},$$
#
# where the rim begins to slip; that is three quarters of the limit below. Beyond it the stick
# radius $c$ shrinks; when all of the base slips, the torque of friction has reached
#
# $$M_{\max} = \int_0^a F p\, r\; 2 \pi r\, \mathrm{d}r = \frac{2}{3}\, F N a, \qquad N = \pi a^2 p
# .$$
#
# In between there is no formula, but a scalar problem in $(r, z)$ for the displacement around the
# axis, which [torsion_oracle.py](studies/torsion_oracle.py) solves without this package. Pressing
# must not cause any shear for this to be the same problem: $\nu = 0$.

# %%
import os
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from mpi4py import MPI

from signorini_fx import (
    Contact,
    Coulomb,
    Displacement,
    LinearElastic,
    MeshGenerator,
    Scene,
    solve,
    write_results,
)
from signorini_fx.addons.pictures.style import STYLE
from signorini_fx.mechanics.contact_points.contact_table import contact_table

sys.path.insert(0, str(Path(__file__).parent / "studies"))
from torsion_oracle import torsion

plt.rcParams.update(STYLE)
CELLS = int(os.environ.get("CELLS", "10"))  # along the radius
RESULTS = Path("results/demos/torsion_of_a_pressed_cylinder")
YOUNG, RADIUS, HEIGHT, FRICTION, PRESSURE = 1000.0, 1.0, 1.0, 0.3, 10.0

# %% [markdown]
# ## Scene
#
# The cylinder is pressed first and turned later: friction acts on the increment of each step. The
# whole cylinder is needed, since torsion has no plane of symmetry. Its side is curved (`order =
# 2`): a polygon in place of the circle would give too small a torque.

# %%
modulus, bound = YOUNG / 2, FRICTION * PRESSURE
first = bound * HEIGHT / (modulus * RADIUS)  # the angle at which slip begins
turns = np.array([0.0, 0.5, 0.9, 1.2, 1.6, 2.4, 4.0])  # of it
core = round(0.45 * CELLS)
scene = Scene(
    title="Torsion of a pressed cylinder",
    mesh=MeshGenerator(
        generator="cylinder",
        parameters={
            "radius": RADIUS,
            "height": HEIGHT,
            "nr": core,
            "nt": CELLS - core,
            "nz": max(CELLS // 2, 3),
            "order": 2,
        },
    ),
    element={"degree": 2},
    material=LinearElastic(young=YOUNG, poisson=0.0),
    displacement=[
        Displacement(boundary="top", z=-PRESSURE * HEIGHT / YOUNG),
        Displacement(
            boundary="top", x=f"{-first} * x[1]", y=f"{first} * x[0]", factors=tuple(turns)
        ),
    ],
    contact=Contact(boundary="bottom", friction=Coulomb(coefficient=FRICTION)),
)

# %% [markdown]
# ## Turn, and take torque and stick radius from the steps
#
# The stick radius is that of a disc with the area of the nodes that stick, which is sharp to half a
# cell.

# %%
solution = solve(scene)
write_results(solution, RESULTS, pictures=["displacement"])
force = np.array([step.contact.forces[0][2] for step in solution.steps])
torque = np.array([-step.contact.moments[1][2] for step in solution.steps])
stick = np.array([np.sqrt(step.contact.areas["stick"] / np.pi) for step in solution.steps])
shears = [contact_table(step.contact, ["bottom"]).columns for step in solution.steps]

most = 2 / 3 * FRICTION * force * RADIUS
elastic = np.pi / 2 * modulus * turns * first * RADIUS**4 / HEIGHT
expected = [torsion(modulus, HEIGHT, bound, turn * first) for turn in turns]
oracle = np.array([found.torque for found in expected])
off = np.abs(torque[1:] / oracle[1:] - 1)

# %% [markdown]
# ## Against the scalar problem
#
# Up to $\varphi_1$ both follow the formula. Beyond it the torque is close to its limit long before
# all of the base slips: the part that still sticks is close to the axis and has a small lever.

# %%
if MPI.COMM_WORLD.rank == 0:
    print(
        "phi/phi1  M/Mmax: computed  scalar problem  all stick  difference   c/a: computed  "
        "scalar problem"
    )
    row = (
        "{:6.2f}         {:8.4f}     {:8.4f}      {:8.4f}    {:7.3f} %       {:6.3f}        {:6.3f}"
    )
    for k in range(1, len(turns)):
        shares = torque[k] / most[k], oracle[k] / most[k], elastic[k] / most[k]
        print(row.format(turns[k], *shares, 100 * off[k - 1], stick[k] / RADIUS, expected[k].stick))
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    fine = np.append(np.linspace(0.9, 2.4, 16), turns[-1])
    curve = np.array(
        [torsion(modulus, HEIGHT, bound, turn * first, nr=30, nz=20).torque for turn in fine]
    )
    left.axhline(1.0, color="0.7", linestyle=":")
    left.text(turns[-1], 0.985, r"$\frac{2}{3} F N a$", ha="right", va="top")
    left.plot(
        np.append(0, fine),
        np.append(0, curve) / most[-1],
        color="0.75",
        linewidth=4,
        label="scalar problem",
    )
    left.plot(turns, torque / most, "k.", label="computed in 3D")
    left.plot(turns[:4], elastic[:4] / most[0], "k--", linewidth=0.8, label="if all of it stuck")
    left.set(
        xlabel=r"$\varphi / \varphi_1$", ylabel=r"$M / M_{\max}$", xlim=(0, None), ylim=(0, 1.08)
    )
    left.legend(frameon=False, loc="lower right")
    for k, style in zip((2, 3, 4, 6), ("k.", "kx", "k+", "k1"), strict=True):
        columns = shears[k]
        radius = np.hypot(columns["x"], columns["y"]) / RADIUS
        right.plot(
            np.append(0, expected[k].r),
            np.append(0, expected[k].shear / bound),
            color="0.75",
            linewidth=3,
        )
        right.plot(
            radius,
            columns["shear"] / bound,
            style,
            markersize=4,
            label=rf"{turns[k]:g} $\varphi_1$",
        )
    right.set(xlabel="$r / a$", ylabel=r"$|\mu| / (F p)$", xlim=(0, 1), ylim=(0, 1.08))
    right.legend(frameon=False, loc="lower right")
    figure.savefig(RESULTS / "torque.png", dpi=150)
    plt.close(figure)
    print(f"results: {RESULTS}/")
