"""A rigid shape of one's own: a box with round corners in 2D.  Scenes have it as shape = "rounded box"."""

from pathlib import Path
from typing import Literal

import numpy as np

from signorini_fx import UnilateralContact, read_scene, solve
from signorini_fx.extensions import register
from signorini_fx.mechanics.statement.rigid_shape import Shape
from signorini_fx.mechanics.statement.values import Positive, Vector


class RoundedBox(Shape):
    exists_in = (2,)
    shape: Literal["rounded box"] = "rounded box"
    centre: Vector
    half: Vector  # half of its width and of its height, without the corners
    radius: Positive  # of its corners

    @property
    def inradius(self):
        return min(self.half) + self.radius

    def initial(self, x):
        away = x - np.array(self.centre)
        sign, beyond = np.where(away < 0, -1, 1), np.abs(away) - np.array(self.half)
        outside = np.maximum(beyond, 0.0)
        far, nearest = np.linalg.norm(outside, axis=1), beyond.max(axis=1)
        side = np.eye(2)[beyond.argmax(axis=1)]  # of points inside
        normal = np.where(far[:, None] > 0, outside / np.maximum(far, 1e-300)[:, None], side)
        return far + np.minimum(nearest, 0.0) - self.radius, sign * normal


register("signorini_fx.shapes", "rounded box", RoundedBox)
if __name__ == "__main__":
    scene = read_scene(Path(__file__).parents[1] / "scenes" / "example1_tresca.toml")
    box = {"shape": "rounded box", "centre": [1.5, -0.502], "half": [0.6, 0.3], "radius": 0.2}
    contact = UnilateralContact(boundary="bottom", foundation=box, friction={"law": "coulomb", "coefficient": 0.3})
    print(solve(scene.model_copy(update={"contact": contact})))
