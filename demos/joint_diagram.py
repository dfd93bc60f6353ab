# %% [markdown]
# # The joint diagram of preloaded bolts
#
# A row of bolts clamps two plates, each with the preload $F_V$; then a working load $F_A$ pulls the
# plates apart. Bolt and plates are springs with the compliances $\delta_S$ and $\delta_P$. As long
# as the joint is closed, the bolt takes the share $\Phi$ of the working load, and the joint is
# relieved of the rest:
#
# $$F_S = F_V + \Phi F_A, \qquad F_K = F_V - (1 - \Phi) F_A, \qquad \Phi = n \,
# \frac{\delta_P}{\delta_P + \delta_S}.$$
#
# The factor $n$ says where in the plates the load acts (VDI 2230). Once the joint is open, the bolt
# takes all of it: $F_S = F_A$.
#
# In plane strain and with its planes of symmetry, a quarter is enough: half of a bolt's upper half,
# and the upper plate as far as halfway to the next bolt. Forces are those of the quarter, per
# length.

# %%
import os
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from mpi4py import MPI

from signorini_fx import solve, write_results
from signorini_fx.addons.pictures.style import STYLE
from signorini_fx.scenes.reading import parse_scene

plt.rcParams.update(STYLE)
CELLS = int(os.environ.get("CELLS", "2"))  # along a millimetre
RESULTS = Path("results/demos/joint_diagram")
SHANK, HEAD, HOLE, PITCH, THICK, HIGH = 5.0, 10.0, 6.0, 14.0, 20.0, 8.0
PRELOAD, LOADS = 1000.0, np.array([0.0, 250.0, 500.0, 1000.0, 1250.0, 1500.0])
STEEL, ALUMINIUM = {"young": 210e3, "poisson": 0.3}, {"young": 70e3, "poisson": 0.33}


def block(name, width, height, shift):
    """A rectangle with its lower left corner at ``shift``."""
    size = {
        "length": width,
        "height": height,
        "nx": round(CELLS * width),
        "ny": round(CELLS * height),
    }
    return {"name": name, "mesh": {"generator": "rectangle", "parameters": size}, "shift": shift}


PLATE = block("plate", PITCH - HOLE, THICK, [HOLE, 0.0])
BOLT = [block("shank", SHANK, THICK, [0.0, 0.0]), block("head", HEAD, HIGH, [0.0, THICK])]
WELD = {"boundary": "shank.top", "against": "head.bottom", "kind": "bonded"}
HELD = {"plate": {"boundary": "plate.right", "x": 0.0}}  # halfway to the next bolt
HELD |= {name: {"boundary": f"{name}.left", "x": 0.0} for name in ("shank", "head")}
MIDDLE = {"boundary": "shank.bottom", "y": 0.0}
WORKING = {"boundary": "plate.right", "y": LOADS[-1]}


def scene(bodies, displacement=(), **given):
    """The scene with some of the bodies."""
    names = [one["name"] for one in bodies]
    material = [{"region": name, **(ALUMINIUM if name == "plate" else STEEL)} for name in names]
    held = [*(HELD[name] for name in names), *displacement]
    return parse_scene(
        {
            "body": bodies,
            "element": {"degree": 2},
            "material": material,
            "displacement": held,
            **given,
        }
    )


# %% [markdown]
# ## The bolt is tightened, then the load is applied
#
# `[[preload]]` tightens a section across the shank by the force $F_V$ in the first load step, and
# keeps the length that it has led to. Head and shank are bonded.

# %%
solution = solve(
    scene(
        [PLATE, *BOLT],
        [MIDDLE],
        preload={
            "region": "shank",
            "point": [0.0, THICK / 2],
            "axis": [0.0, 1.0],
            "force": PRELOAD,
        },
        force=WORKING | {"factors": (LOADS / LOADS[-1]).tolist()},
        contact=[
            {"boundary": "plate.bottom"},
            {"boundary": "plate.top", "against": "head.bottom"},
            WELD,
        ],
    )
)
write_results(solution, RESULTS)
at = [solution.at(step) for step in solution.steps]
bolt = np.array([one.preloads[0].force for one in at])
clamp = np.array([one.resultants.of("plate.bottom").force[1] for one in at])

# %% [markdown]
# ## The springs
#
# Bolt and plate are solved alone, with a uniform pressure under the head, of the force $F$: $\delta
# = 2 U / F^2$ with the strain energy $U$. The energy of both loads of the plate together, without
# that of each, is the work of the pressure on what the working load moves: over $F F_A$ this is $n
# \, \delta_P$.

# %%
AREA = HEAD - HOLE
PRESSED = {"boundary": "plate.top", "pressure": f"1 if x[0] < {HEAD} else 0"}
LIFTED = {"boundary": "head.bottom", "pressure": f"1 if x[0] > {HOLE} else 0"}
CLOSED = {"boundary": "plate.bottom", "y": 0.0}


def energy(*given, **more):
    """The strain energy of a scene."""
    return solve(scene(*given, **more)).last_step.strain_energy


of_bolt = energy(BOLT, [MIDDLE], traction=LIFTED, contact=WELD)
of_plate = energy([PLATE], [CLOSED], traction=PRESSED)
of_load = energy([PLATE], [CLOSED], force=WORKING)
of_both = energy([PLATE], [CLOSED], force=WORKING, traction=PRESSED)
delta_bolt, delta_plate = 2 * of_bolt / AREA**2, 2 * of_plate / AREA**2
moved = -(of_both - of_plate - of_load) / (AREA * LOADS[-1])
share = moved / (delta_plate + delta_bolt)
found = (bolt[1] - bolt[0]) / LOADS[1]
if MPI.COMM_WORLD.rank == 0:
    print(
        f"share of the bolt: {found:.3f}; by the springs {share:.3f}, with n = "
        f"{moved / delta_plate:.2f}"
    )

# %% [markdown]
# ## The diagram
#
# The joint begins to open at its edge before all of it is without pressure, which the springs do
# not know.

# %%
if MPI.COMM_WORLD.rank == 0:
    opens = PRELOAD / (1 - share)
    load = np.array([0.0, opens, LOADS[-1]])
    figure, axes = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
    axes.plot(load, np.array([PRELOAD, opens, LOADS[-1]]), "C0-", label="bolt, springs")
    axes.plot(load, np.array([PRELOAD, 0.0, 0.0]), "C1-", label="joint, springs")
    axes.plot(LOADS, bolt, "C0o", label="bolt, computed")
    axes.plot(LOADS, clamp, "C1o", label="joint, computed")
    axes.set(xlabel="working load (N/mm)", ylabel="force (N/mm)", ylim=(-50.0, None))
    axes.legend()
    figure.savefig(RESULTS / "joint_diagram.png")
    plt.close(figure)
