"""A material of one's own: fibres along axis 1, isotropic across them, five moduli (R. Hill)."""

from pathlib import Path
from typing import Literal

import numpy as np
import ufl

from signorini_fx import OrientedMaterial, read_scene, solve
from signorini_fx.extensions import register


class Fibres(OrientedMaterial):
    law: Literal["fibres"] = "fibres"
    n: float  # stress along the fibres per strain there
    c: float  # the same per strain across them
    k: float  # mean stress across the fibres per sum of both strains there
    m: float  # shear modulus across the fibres
    p: float  # shear modulus along the fibres

    def stress(self, e):
        across = ufl.as_matrix(np.diag([0, 1, 1]).tolist())
        along = ufl.Identity(3) - across
        around = e[1, 1] + e[2, 2]
        s = 2 * self.p * e + 2 * (self.m - self.p) * across * e * across
        s += ((self.n - 2 * self.p) * e[0, 0] + self.c * around) * along
        return s + (self.c * e[0, 0] + (self.k - self.m) * around) * across


register("signorini_fx.materials", "fibres", Fibres)
if __name__ == "__main__":
    scene = read_scene(Path(__file__).parents[1] / "scenes" / "example1_tresca.toml")
    fibres = Fibres(n=9000.0, c=1500.0, k=2000.0, m=600.0, p=900.0)
    print(solve(scene.model_copy(update={"material": fibres})))
