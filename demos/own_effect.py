# %% [markdown]
# # An effect of your own, in a few lines
#
# An effect that the package does not have can often be expressed by those that it has, without a
# change of its code: here a load made of UFL. ([Friction laws](own_friction.py) are classes.)
#
# Heat is an effect of the package, `[[temperature]]`, which makes it a good example: the results
# can be compared. A body heated by $T$ wants to grow by the strain $\alpha T$ in all directions. In
# plane strain the stress is $\sigma = C \varepsilon(y) - \beta T\, I$ with $\beta = E \alpha / (1 -
# 2\nu)$, and the work of the new term is a load,
#
# $$L_T(z) = \int_\Omega \beta T \operatorname{div} z
#   = \int_{\partial\Omega} \beta T\, n \cdot z - \int_\Omega \nabla(\beta T) \cdot z :$$
#
# a suction $\beta T$ on the whole boundary and a body force. Tractions and body forces may be UFL
# expressions, so this function adds heat to any scene:

# %%
import os
from pathlib import Path

import numpy as np
import ufl
from mpi4py import MPI

from signorini_fx import (
    BodyForce,
    Contact,
    Displacement,
    LinearElastic,
    Scene,
    Traction,
    generate_mesh,
    solve,
    write_results,
)

CELLS = int(os.environ.get("CELLS", "60"))
RESULTS = Path("results/demos/own_effect")


def heated(scene, temperature, expansion):
    """The scene with a temperature, a UFL expression or a number; ``expansion`` is alpha."""
    (material,) = scene.material
    stress = material.young * expansion / (1 - 2 * material.poisson) * temperature
    suction = tuple(Traction(boundary=name, pressure=-stress) for name in scene.mesh.boundaries)
    force = {}
    if not isinstance(stress, float):
        force = {"body_force": BodyForce(x=-stress.dx(0), y=-stress.dx(1))}
    return scene.model_copy(update={"traction": scene.traction + suction, **force})


# %% [markdown]
# A block of height $h$ stands $d$ above the floor, its head held, its sides free. Heated by $T$ it
# touches down; with $\sigma_{xx} = 0$ and $\varepsilon_{yy} = d/h$ the pressure is
#
# $$\lambda = \frac{E}{1 - \nu^2}\Bigl( (1 + \nu)\, \alpha T - \frac{d}{h} \Bigr).$$

# %%
YOUNG, POISSON, ALPHA, GAP = 210000.0, 0.3, 1.2e-5, 5e-4
tagged = generate_mesh(
    "rectangle", {"length": 3.0, "height": 1.0, "nx": CELLS, "ny": CELLS // 3}, MPI.COMM_WORLD
)
cold = Scene(
    title="A block between head and floor",
    mesh=tagged,
    material=LinearElastic(young=YOUNG, poisson=POISSON),
    displacement=Displacement(boundary="top", y=0.0),
    contact=Contact(boundary="bottom", gap=GAP),
    solver={"algorithm": "alm"},
)
held = cold.model_copy(
    update={"displacement": (*cold.displacement, Displacement(boundary="left", x=0.0))}
)
uniform = solve(heated(held, 100.0, ALPHA))
pressure = uniform.table.columns["pressure"]
formula = YOUNG / (1 - POISSON**2) * ((1 + POISSON) * ALPHA * 100.0 - GAP)
deviation = np.abs(pressure / formula - 1).max()
if MPI.COMM_WORLD.rank == 0:
    print(f"uniformly heated: pressure {pressure.mean():.3f}, by the formula {formula:.3f}")

# %% [markdown]
# A hot spot touches down in its middle only. (The stress in the results is $C\varepsilon(y)$; the
# part $-\beta T\, I$ is known to this script only.)

# %%
x = ufl.SpatialCoordinate(tagged.mesh)
spot = 150.0 * ufl.exp(-4 * (x[0] - 1.5) ** 2)
warm = solve(heated(held, spot, ALPHA))
(touching,) = warm.table.zones(warm.table.columns["pressure"] > 0)
write_results(warm, RESULTS)
if MPI.COMM_WORLD.rank == 0:
    print(f"hot spot: contact from {touching[0][0]:.3f} to {touching[1][0]:.3f}")
    print(f"results: {RESULTS}/")
