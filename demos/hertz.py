# %% [markdown]
# # Hertz's line contact, with and without friction
#
# A cylinder of radius $R$ is pressed onto a rigid plane with the force $P$ per unit thickness.
# While the contact is narrow, $a \ll R$, and there is no friction, it has the half-width $a$ and
# the pressure
#
# $$a^2 = \frac{4 P R}{\pi E^*}, \qquad \lambda(x) = p_0 \sqrt{1 - x^2/a^2}, \qquad p_0 = \frac{2
# P}{\pi a},
#   \qquad E^* = \frac{E}{1 - \nu^2}.$$
#
# By symmetry half of the lower half disk is enough. With friction there is no formula: the plane is
# rigid, so the surface of the cylinder, which would move inwards, is held back. This makes the
# contact narrower and its peak pressure higher.

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
    MeshGenerator,
    Scene,
    Traction,
    solve,
    write_results,
)
from signorini_fx.addons.pictures.style import STYLE

plt.rcParams.update(STYLE)
CELLS = int(os.environ.get("CELLS", "40"))  # facets along the half-width
RESULTS = Path("results/demos/hertz")
YOUNG, POISSON, RADIUS, HALF_WIDTH = 200.0, 0.3, 8.0, 0.4

# %% [markdown]
# ## The load for a half-width of 0.4

# %%
modulus = YOUNG / (1 - POISSON**2)
force = np.pi * modulus * HALF_WIDTH**2 / (4 * RADIUS)
peak = 2 * force / (np.pi * HALF_WIDTH)

# %% [markdown]
# ## Scene
#
# The gap is the height of the circle over the plane, measured downwards. The mesh follows the
# circle (`order = 2`), and so does the displacement (degree 2).


# %%
def pressed(friction):
    """A quarter of a disk on a plane; ``friction`` is the coefficient F."""
    size = HALF_WIDTH / CELLS
    return Scene(
        title=f"Hertz, F = {friction:g}",
        mesh=MeshGenerator(
            generator="half_disk",
            parameters={
                "radius": RADIUS,
                "contact_size": 2 * size,  # of quadratic elements, which have a node between
                "contact_zone": 1.5 * HALF_WIDTH,
                "symmetric": True,
                "order": 2,
            },
        ),
        element={"degree": 2},
        material=LinearElastic(young=YOUNG, poisson=POISSON),
        displacement=Displacement(boundary="symmetry", normal=0.0),
        traction=Traction(boundary="top", pressure=force / (2 * RADIUS)),
        contact=Contact(
            boundary="arc",
            gap="x[1]",
            direction=(0.0, -1.0),
            friction=Coulomb(coefficient=friction),
        ),
    )


def half_width(columns):
    """Of the ellipse with the same mean of x^2, which is a^2 / 4."""
    share = columns["weight"] * columns["pressure"]
    return 2 * np.sqrt(np.dot(share, columns["x"] ** 2) / share.sum())


# %% [markdown]
# ## Solve

# %%
profiles, widths, peaks = {}, {}, {}
for friction in (0.0, 0.1, 0.3):
    solution = solve(pressed(friction))
    columns = profiles[friction] = solution.table.columns
    widths[friction] = half_width(columns) / HALF_WIDTH
    peaks[friction] = columns["pressure"].max() / peak
    if MPI.COMM_WORLD.rank == 0:
        print(
            f"F = {friction:g}: half-width {widths[friction]:.4f} a, peak {peaks[friction]:.4f} p0"
        )

write_results(solution, RESULTS)  # of the last one

# %% [markdown]
# Without friction half-width and peak are Hertz's to a few tenths of a percent, which is what the
# formula itself is good for here, $a/R = 0.05$.

# %%
if MPI.COMM_WORLD.rank == 0:
    figure, axes = plt.subplots(figsize=(6, 3.6), layout="constrained")
    at = np.linspace(0, 1, 400)
    axes.plot(at, np.sqrt(1 - at**2), color="0.7", linewidth=4, label="Hertz, no friction")
    for (friction, columns), style in zip(profiles.items(), ("k-", "k--", "k:"), strict=True):
        near = columns["x"] < 1.15 * HALF_WIDTH
        x, y = columns["x"][near] / HALF_WIDTH, columns["pressure"][near] / peak
        axes.plot(x, y, style, linewidth=1.2, label=f"computed, F = {friction:g}")
    axes.set(xlabel="$x / a$", ylabel=r"$\lambda / p_0$", xlim=(0, 1.15), ylim=(0, 1.15))
    axes.legend(frameon=False, loc="lower left")
    figure.savefig(RESULTS / "pressure.png", dpi=150)
    plt.close(figure)
    print(f"results: {RESULTS}/")
