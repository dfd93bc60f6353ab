# %% [markdown]
# # The friction coefficient from measured slip
#
# How far the points of a contact slip depends on the friction coefficient $F$ in $|\mu| \le F
# \lambda$. Here $F$ is found from noisy measurements $m_i$ of the slip $u_i$ at a few points, by
# least squares:
#
# $$\min_F \; \sum_i \frac{(u_i(F) - m_i)^2}{2 \sigma^2}, \qquad
# \mathrm{sd}(F) = \frac{\sigma}{\sqrt{\sum_i (du_i / dF)^2}}.$$
#
# One adjoint solve for each point gives its derivative, with the factor of the solve.

# %%
import os

import numpy as np
from mpi4py import MPI
from scipy.optimize import least_squares

from signorini_fx import MeshGenerator, Scene, sensitivity
from signorini_fx.mechanics.effects.contact import Contact
from signorini_fx.mechanics.effects.displacement import Displacement
from signorini_fx.mechanics.effects.loads import Traction
from signorini_fx.mechanics.laws.coulomb import Coulomb
from signorini_fx.mechanics.materials.isotropic import LinearElastic

CELLS = int(os.environ.get("CELLS", "48"))
POINTS = [f"displacement {x},0 x" for x in (0.4, 0.8, 1.3, 1.8, 2.3, 2.7)]
COEFFICIENT = "contact[0].friction.coefficient"
TRUE, NOISE = 0.3, 2e-6


def scene(coefficient):
    """A block that is pressed on a plane and pushed along it."""
    return Scene(
        mesh=MeshGenerator(
            generator="rectangle", parameters={"length": 3.0, "nx": CELLS, "ny": CELLS // 3}
        ),
        material=LinearElastic(young=5000.0, poisson=0.3),
        displacement=Displacement(boundary="left", x=0.0),
        traction=Traction(boundary="top", x=4.0, y=-20.0),
        contact=Contact(boundary="bottom", friction=Coulomb(coefficient=coefficient)),
    )


def slips(coefficient):
    """The slip at each point, and its derivative by the coefficient."""
    found = sensitivity(scene(float(coefficient)), POINTS, [COEFFICIENT])
    return np.array([one.value for one in found]), np.array([one[COEFFICIENT] for one in found])


# %% [markdown]
# ## Measurements
#
# They are computed with $F = 0.3$, and noise is added: a tenth of the largest slip.

# %%
exact, _ = slips(TRUE)
measured = exact + NOISE * np.random.default_rng(7).standard_normal(exact.size)

# %% [markdown]
# ## Fit
#
# A solve serves both the residual and its derivative.

# %%
known = {}


def at(coefficient):
    """Of the last coefficient, or computed."""
    (value,) = coefficient
    if value not in known:
        known[value] = slips(value)
    return known[value]


def fit(data):
    """The coefficient that fits the data, its standard deviation, and the solves that it took."""
    known.clear()
    found = least_squares(
        lambda f: (at(f)[0] - data) / NOISE,
        0.15,
        jac=lambda f: at(f)[1][:, None] / NOISE,
        bounds=(0.01, 1.0),
    )
    return float(found.x[0]), 1 / float(np.linalg.norm(found.jac)), len(known)


without_noise, _, solves = fit(exact)
coefficient, deviation, _ = fit(measured)
if MPI.COMM_WORLD.rank == 0:
    print(f"without noise F = {without_noise:.6f} after {solves} solves")
    print(
        f"F = {coefficient:.5f}, between {coefficient - 2 * deviation:.5f} and "
        f"{coefficient + 2 * deviation:.5f}"
    )
