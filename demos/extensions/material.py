"""A material of one's own: fibres along axis 1, alike in all directions across them, with five moduli (R. Hill)."""

from pathlib import Path
from typing import Literal

import numpy as np
import ufl

from signorini_fx import DirectedMaterial, read_scene, solve
from signorini_fx.extensions import register


class Fibres(DirectedMaterial):
    law: Literal["fibres"] = "fibres"
    n: float  # stress along the fibres per strain there
    c: float  # the same per strain across them
    k: float  # mean stress across the fibres per sum of both strains there
    m: float  # shear modulus across the fibres
    p: float  # shear modulus along the fibres

    def stress(self, e):
        across, fibre, around = ufl.as_matrix(np.diag([0, 1, 1]).tolist()), e[0, 0], e[1, 1] + e[2, 2]
        s = 2 * self.p * e + ((self.n - 2 * self.p) * fibre + self.c * around) * (ufl.Identity(3) - across)
        return s + (self.c * fibre + (self.k - self.m) * around) * across + 2 * (self.m - self.p) * across * e * across


register("signorini_fx.materials", "fibres", Fibres)
if __name__ == "__main__":
    scene = read_scene(Path(__file__).parents[1] / "scenes" / "example1_tresca.toml")
    print(solve(scene.model_copy(update={"material": Fibres(n=9000.0, c=1500.0, k=2000.0, m=600.0, p=900.0)})))
