"""A quantity of one's own, with its derivative: the mean pressure over the half of a boundary."""

from pathlib import Path

import numpy as np

from signorini_fx import Quantity, read_scene, sensitivity, solve, write_results
from signorini_fx.extensions import register


class OverHalf:
    """The mean over the contact points right of the one at x = 1.5, and its derivative by the tractions."""

    def value(self, y, boundary, pressure, shear):
        return boundary.comm.allreduce(self.by_traction(boundary, pressure, shear)[:, 0] @ (boundary.weight * pressure))

    def by_displacement(self, y):
        return None

    def by_traction(self, boundary, pressure, shear):
        right = boundary.centre[:, 0] > 1.5 + 1e-6  # round-off, which depends on the ranks, does not decide
        return np.column_stack((right / boundary.comm.allreduce(boundary.weight @ right), np.zeros_like(shear)))


class MeanPressureRight(Quantity):
    key, title, unit = "mean_pressure_right", "Mean pressure right of the middle.", "stress"
    terminal, report, steps = "pressure right", "mean pressure right of the middle", "number"

    def value(self, solution):
        return (c := solution.contact) and OverHalf().value(None, c.boundary, c.pressure, c.shear)

    def functional(self, d):
        return OverHalf()


register("signorini_fx.quantities", MeanPressureRight.key, MeanPressureRight)
if __name__ == "__main__":
    scene = read_scene(Path(__file__).parents[1] / "scenes" / "example1_coulomb.toml")
    write_results(solve(scene), "results/demos/quantity")
    print(sensitivity(scene, "mean_pressure_right", ["contact[0].friction.coefficient"]))
