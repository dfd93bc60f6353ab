"""A quantity of one's own: the mean pressure over the half of a boundary."""

from pathlib import Path

from signorini_fx import Quantity, read_scene, solve, write_results
from signorini_fx.extensions import register


class MeanPressureRight(Quantity):
    key, title, unit = "mean_pressure_right", "Mean pressure right of the middle.", "stress"

    def value(self, solution):
        if (contact := solution.contact) is None:
            return None
        boundary = contact.boundary
        right = (
            boundary.centre[:, 0] > 1.5 + 1e-6
        )  # round-off, which depends on the ranks, does not decide
        force, area = (
            boundary.comm.allreduce(boundary.weight[right] @ of[right])
            for of in (contact.pressure, right)
        )
        return float(force / area)


register("signorini_fx.quantities", MeanPressureRight.key, MeanPressureRight)
if __name__ == "__main__":
    scene = read_scene(Path(__file__).parents[1] / "scenes" / "example1_coulomb.toml")
    summary = write_results(solve(scene), "results/demos/quantity")
    print(f"{summary['status']}, mean pressure {summary['mean_pressure_right']:.4g}")
