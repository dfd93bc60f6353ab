# %% [markdown]
# # An effect of your own, in a few lines
#
# An effect that the package does not have can often be expressed by those that it has. Here are two examples, which do
# not change its code.
#
# ## 1. A load made of UFL
#
# Heat is an effect of the package, `[[temperature]]`, which makes it a good example: the results can be compared. A
# body heated by $T$ wants to grow by the strain $\alpha T$ in all directions. In plane strain the stress is $\sigma
# = C \varepsilon(y) - \beta T\, I$ with $\beta = E \alpha / (1 - 2\nu)$, and the work of the new term is a load,
#
# $$L_T(z) = \int_\Omega \beta T \operatorname{div} z
#   = \int_{\partial\Omega} \beta T\, n \cdot z - \int_\Omega \nabla(\beta T) \cdot z :$$
#
# a suction $\beta T$ on the whole boundary and a body force. Tractions and body forces may be UFL expressions, so this
# function adds heat to any scene:

# %%
import os
from pathlib import Path

import numpy as np
import ufl
from mpi4py import MPI

from signorini_fx import (
    BodyForce,
    CoulombFriction,
    LinearElastic,
    PrescribedDisplacement,
    Scene,
    SurfaceTraction,
    TrescaFriction,
    UnilateralContact,
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
    suction = tuple(SurfaceTraction(boundary=name, pressure=-stress) for name in scene.mesh.boundaries)
    force = {}
    if not isinstance(stress, float):
        force = {"body_force": BodyForce(x=-stress.dx(0), y=-stress.dx(1))}
    return scene.model_copy(update={"traction": scene.traction + suction, **force})


# %% [markdown]
# A block of height $h$ stands $d$ above the floor, its head held, its sides free. Heated by $T$ it touches down; with
# $\sigma_{xx} = 0$ and $\varepsilon_{yy} = d/h$ the pressure is
#
# $$\lambda = \frac{E}{1 - \nu^2}\Bigl( (1 + \nu)\, \alpha T - \frac{d}{h} \Bigr).$$

# %%
YOUNG, POISSON, ALPHA, GAP = 210000.0, 0.3, 1.2e-5, 5e-4
tagged = generate_mesh("rectangle", {"length": 3.0, "height": 1.0, "nx": CELLS, "ny": CELLS // 3}, MPI.COMM_WORLD)
cold = Scene(
    title="A block between head and floor",
    mesh=tagged,
    material=LinearElastic(young=YOUNG, poisson=POISSON),
    displacement=PrescribedDisplacement(boundary="top", y=0.0),
    contact=UnilateralContact(boundary="bottom", gap=GAP),
    solver={"algorithm": "exact"},
)
held = cold.model_copy(update={"displacement": (*cold.displacement, PrescribedDisplacement(boundary="left", x=0.0))})
uniform = solve(heated(held, 100.0, ALPHA))
pressure = uniform.table.columns["pressure"]
formula = YOUNG / (1 - POISSON**2) * ((1 + POISSON) * ALPHA * 100.0 - GAP)
deviation = np.abs(pressure / formula - 1).max()
if MPI.COMM_WORLD.rank == 0:
    print(f"uniformly heated: pressure {pressure.mean():.3f}, by the formula {formula:.3f}")

# %% [markdown]
# A hot spot touches down in its middle only. (The stress in the results is $C\varepsilon(y)$; the part $-\beta T\, I$
# is known to this script only.)

# %%
x = ufl.SpatialCoordinate(tagged.mesh)
spot = 150.0 * ufl.exp(-4 * (x[0] - 1.5) ** 2)
warm = solve(heated(held, spot, ALPHA))
(touching,) = warm.table.zones(warm.table.columns["pressure"] > 0)
write_results(warm, RESULTS)
if MPI.COMM_WORLD.rank == 0:
    print(f"hot spot: contact from {touching[0][0]:.3f} to {touching[1][0]:.3f}")

# %% [markdown]
# ## 2. A friction law: a fixed point of Tresca problems
#
# The shear cannot grow without limit with the pressure: metals yield at some $k$. A smooth law between Coulomb's and a
# constant shear is
#
# $$|\mu| \le g(\lambda) = k \bigl(1 - e^{-F \lambda / k}\bigr) .$$
#
# The package has Tresca friction, for which the bound $g$ is given. Section 6.3 of the paper obtains Coulomb friction
# from it by the fixed-point iteration $g \leftarrow F\lambda(g)$. Any other law is the same loop with another
# right-hand side:


# %%
def with_law(scene, law, tolerance=1e-8, most=50):
    """Solve with the friction bound ``law(pressure)`` on the only contact boundary; (solution, iterations)."""
    (contact,) = scene.contact
    at, bound = np.array([0.0]), np.array([0.0])
    for iteration in range(1, most + 1):
        given = TrescaFriction(bound=lambda x, at=at, bound=bound: np.interp(x[0], at, bound))
        problem = scene.model_copy(update={"contact": (contact.model_copy(update={"friction": given}),)})
        solution = solve(problem)
        columns = solution.table.columns
        at, before = columns["x"], np.interp(columns["x"], at, bound)
        bound = law(columns["pressure"])
        if np.abs(bound - before).max() <= tolerance * bound.max():
            return solution, iteration
    raise RuntimeError("the fixed point did not converge")


pressed = Scene(
    title="A friction law of one's own",
    mesh=tagged,
    material=LinearElastic(young=5000.0, poisson=0.4),
    displacement=[PrescribedDisplacement(boundary=side, x=0.0) for side in ("left", "right")],
    traction=SurfaceTraction(boundary="top", y="-20 if 1 <= x[0] <= 2 else 0"),
    contact=UnilateralContact(boundary="bottom", gap="0.003*(x[0] - 1.5)**2 + 0.001"),
)
own, iterations = with_law(pressed, lambda pressure: 3.0 * (1 - np.exp(-0.3 * pressure / 3.0)))

# %% [markdown]
# Every law of your own should pass this check: with $g(\lambda) = F\lambda$ the loop must give the same result as the
# package's Coulomb friction.

# %%
again, _ = with_law(pressed, lambda pressure: 0.3 * pressure)
friction = CoulombFriction(coefficient=0.3)
coulomb = solve(pressed.model_copy(update={"contact": (pressed.contact[0].model_copy(update={"friction": friction}),)}))
shear, same, builtin = (s.table.columns["shear"] for s in (own, again, coulomb))
difference = np.abs(same - builtin).max() / np.abs(builtin).max()
if MPI.COMM_WORLD.rank == 0:
    print(f"largest shear {np.abs(shear).max():.3f} with the law, {np.abs(builtin).max():.3f} with Coulomb friction")
    print(f"{iterations} iterations; the loop with Coulomb's law differs from the package's own by {difference:.1e}")
    print(f"results: {RESULTS}/")
