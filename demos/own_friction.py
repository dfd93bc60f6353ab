# %% [markdown]
# # A friction law of your own
#
# The shear cannot grow without limit with the pressure: metals yield at some $k$. A smooth law
# between Coulomb's and a constant shear is
#
# $$|\mu| \le g(\lambda) = k \bigl(1 - e^{-F \lambda / k}\bigr) .$$
#
# A law is a class: its parameters, and one method, which returns the bound and its derivatives by
# pressure and slip. This one does not follow the slip. `concave` says that $g$ is below its tangent
# at zero and below its limit, which is what statics uses. All that a law says is tried at pressures
# up to the modulus of the body before anything is solved.

# %%
import os
from typing import Literal

import numpy as np

from signorini_fx import FrictionLaw, Parameter, Scene, sensitivity, solve, write_results


class Saturating(FrictionLaw):
    """At most k (1 - exp(-F lambda / k)), with F the coefficient and k the largest shear."""

    law: Literal["saturating"] = "saturating"
    coefficient: Parameter
    largest: Parameter
    concave = True

    def evaluate(self, pressure, slip, dt):
        left = np.exp(-self.coefficient * pressure / self.largest)
        return self.largest * (1 - left), self.coefficient * left, 0.0


# %% [markdown]
# It stands where `Coulomb` may stand: in the `contact` of a scene, as here, in `Foundation(...,
# friction=...)` and in `Pair(..., friction=...)`. Its parameters have derivatives. Scene files know
# it by its name, with an entry point of your package.

# %%
cells = int(os.environ.get("CELLS", "60"))
scene = Scene(
    mesh={
        "generator": "rectangle",
        "parameters": {"length": 3.0, "height": 1.0, "nx": cells, "ny": cells // 3},
    },
    material={"young": 5000.0, "poisson": 0.4},
    displacement=[{"boundary": side, "x": 0.0} for side in ("left", "right")],
    traction={
        "boundary": "top",
        "x": "10 if 1 <= x[0] <= 2 else 0",
        "y": "-20 if 1 <= x[0] <= 2 else 0",
    },
    contact={
        "boundary": "bottom",
        "gap": "0.003*(x[0] - 1.5)**2 + 0.001",
        "friction": Saturating(0.3, 3.0),
    },
)
solution = solve(scene)
found = sensitivity(
    scene, "force bottom x", ["contact.friction.coefficient", "contact.friction.largest"]
)
write_results(solution, "results/demos/own_friction")
print(f"{solution.certificate}; d(force)/dF, dk: {found}")
