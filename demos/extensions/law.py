"""A friction law of one's own: k tanh(F p / k), from Coulomb's law to a constant shear."""

from pathlib import Path
from typing import Literal

import numpy as np

from signorini_fx import Contact, FrictionLaw, Parameter, read_scene, solve
from signorini_fx.extensions import register


class Smooth(FrictionLaw):
    law: Literal["smooth"] = "smooth"
    coefficient: Parameter
    largest: Parameter  # the shear k at large pressures
    concave = True

    def evaluate(self, pressure, slip, dt):
        share = self.coefficient * pressure / self.largest
        by_pressure = self.coefficient / np.cosh(np.minimum(share, 300.0)) ** 2
        return self.largest * np.tanh(share), by_pressure, 0.0


register("signorini_fx.laws", "smooth", Smooth)
if __name__ == "__main__":
    scene = read_scene(Path(__file__).parents[1] / "scenes" / "example1_coulomb.toml")
    gap = scene.contact[0].gap
    contact = Contact(boundary="bottom", gap=gap, friction=Smooth(coefficient=0.3, largest=3.0))
    print(solve(scene.model_copy(update={"contact": contact})))
