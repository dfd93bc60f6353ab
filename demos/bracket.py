# %% [markdown]
# # Will the bracket slip?
#
# An angle bracket is bolted down through its foot; a load on its upright leg pulls it forwards and
# sideways. There is clearance around the bolt: friction alone must hold the foot. The pull $T$ uses
# the share
#
# $$s_1 = \frac{T}{F N}$$
#
# of the friction of the bolt's force $N$. But it is beside the bolt and also turns the foot, and
# friction that resists turning is missing elsewhere. Let the foot move as a rigid body with the
# velocity
# $v(x) = (v_1 - \omega x_2,\, v_2 + \omega x_1)$. As soon as the power of the load exceeds what
# friction can dissipate, the foot slips: of the friction under a given pressure $\lambda$ the load
# uses the share
#
# $$s = \max_{v_1, v_2, \omega} \frac{T_1 v_1 + T_2 v_2 + M \omega}{\int F \lambda\, |v|},$$
#
# with the moment $M$ of the load about the vertical axis through the origin. This is
# `solution.friction_used`. Only the contact problem tells where the pressure is: the foot is a
# plate that is pressed near its bolt and lifts off elsewhere, and the load changes the pressure.

# %%
import os
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from mpi4py import MPI
from matplotlib.tri import Triangulation

from signorini_fx import MeshGenerator, read_scene, solve, write_results
from signorini_fx.addons.pictures.style import INK, ORANGE, STYLE, VALUES
from signorini_fx.mechanics.contact_points.contact_table import contact_table

plt.rcParams.update(STYLE)
CELLS = int(os.environ.get("CELLS", "10"))  # along the diameter of the seat
RESULTS = Path("results/demos/bracket")
BOLT, RADIUS, SEAT_RADIUS = (
    37.0,
    5.5,
    10.0,
)  # of the generator: x[0] of the bolt, hole and seat around it

# %% [markdown]
# ## Scene
#
# The file has three load steps: the bolt is tightened, then half of the load is applied, then all
# of it.

# %%
scene = read_scene(Path(__file__).parent / "scenes" / "bracket.toml")
mesh = MeshGenerator(
    generator="bracket", parameters={"contact_size": 2 * SEAT_RADIUS / CELLS, "size": 50 / CELLS}
)
scene = scene.model_copy(update={"mesh": mesh})
(friction,) = (contact.friction.coefficient for contact in scene.contact)


def loaded(*factors):
    """The scene with other load steps."""
    bolt, pull = scene.traction
    return scene.model_copy(
        update={"traction": (bolt, pull.model_copy(update={"factors": factors}))}
    )


# %% [markdown]
# ## Tightening and loading
#
# The resultant of the pressure must act where statics says: forwards of the bolt by the tilting
# moment of the load, 50 mm above the foot, over $N$. Its magnitude is the bolt's force, up to the
# facets that approximate the round seat.

# %%
solution = solve(scene)
write_results(solution, RESULTS)
steps = [contact_table(step.contact, ["foot"]).columns for step in solution.steps]
force = np.array([step.contact.forces[0][2] for step in solution.steps])
moments = np.array([step.contact.moments[0] for step in solution.steps])
pull = -np.array([step.contact.forces[1][:2] for step in solution.steps])
areas = [step.contact.areas for step in solution.steps]
through = np.column_stack((-moments[:, 1], moments[:, 0])) / force[:, None]
statics = np.array([BOLT, 0.0]) + 50.0 * pull / force[:, None]

# %%
simple = np.hypot(*pull[-1]) / (friction * force[-1])
used = solution.friction_used

# %% [markdown]
# ## Checking it
#
# The solver knows nothing of rigid bodies. It finds an equilibrium just below the load where the
# foot should slip, and none just above. There the fixed-point iteration finds that the foot slides
# under the friction of its last pressure. The status is not *slides*, which statics alone would
# prove: another pressure with the same resultant could hold the foot.

# %%
held = 0.97 / used
below = solve(loaded(0.0, 1.0, held))
at_limit = held / below.friction_used
above = solve(loaded(0.0, 1.0, 1.03 * at_limit), check=False)

# %% [markdown]
# ## The foot from below
#
# Only the middle of the foot is pressed. Nearly all of it slips as soon as the bolt is tightened:
# pressed between bolt and foundation the plate expands sideways, friction resists this, and reaches
# its limit where the pressure is small. The foot as a whole does not slide.

# %%
if MPI.COMM_WORLD.rank == 0:
    print(
        "share of the load:  N        pull     resultant at       by statics         contact  "
        "stick, mm2"
    )
    for row in zip(
        (0.0, 0.5, 1.0), force, np.hypot(*pull.T), *through.T, *statics.T, areas, strict=True
    ):
        line = (
            "{:9.1f}      {:9.1f}  {:7.1f}   ({:.3f}, {:.3f})    ({:.3f}, {:.3f})      {:5.0f} "
            "   {:5.0f}"
        )
        print(line.format(*row[:-1], row[-1]["contact"], row[-1]["stick"]))
    print(
        f"friction used: T / (F N) = {100 * simple:.1f} %; with the turning of the foot "
        f"{100 * used:.1f} %"
    )
    print(
        f"{held:.3f} times the load: {below.status.value}; the pressure there bears "
        f"{at_limit:.3f} times the load"
    )
    print(f"{1.03 * at_limit:.3f} times the load: {above.status.value}")
    print(*above.history.events, sep="\n")
    figure, axes = plt.subplots(1, 2, figsize=(8.5, 3.6), layout="constrained", sharey=True)
    largest = max(columns["pressure"].max() for columns in steps)
    for k, title, axis in zip((0, 2), ("tightened", "loaded"), axes, strict=True):
        columns = steps[k]
        x, y, pressure = columns["x"], columns["y"], columns["pressure"]
        foot = Triangulation(x, y)
        centre = [values[foot.triangles].mean(axis=1) for values in (x, y)]
        touching = columns["state"] != "open"
        foot.set_mask(
            (np.hypot(centre[0] - BOLT, centre[1]) < RADIUS) | ~touching[foot.triangles].any(axis=1)
        )
        shown = axis.tripcolor(
            foot, pressure, shading="gouraud", cmap=VALUES, vmin=0.0, vmax=largest
        )
        shear = [columns[name][touching] for name in ("shear_x", "shear_y")]
        axis.quiver(
            x[touching],
            y[touching],
            *shear,
            color="white",
            edgecolor=INK,
            linewidth=0.4,
            width=0.004,
        )
        stuck = columns["state"] == "stick"
        axis.plot(
            x[stuck],
            y[stuck],
            "o",
            color=ORANGE,
            markeredgecolor=INK,
            markersize=4.5,
            label="stick",
        )
        axis.add_patch(plt.Circle((BOLT, 0), SEAT_RADIUS, fill=False, linestyle=":"))
        axis.set(xlabel="x, mm", xlim=(15, 60), title=title, aspect="equal")
    axes[0].set(ylabel="y, mm")
    axes[0].legend(frameon=False, loc="upper left")
    figure.colorbar(shown, ax=axes, label="pressure, MPa", shrink=0.9)
    figure.savefig(RESULTS / "foot.png", dpi=150)
    plt.close(figure)
    print(f"results: {RESULTS}/")
