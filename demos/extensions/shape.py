"""A rigid shape of one's own: a box with round corners in 2D, ``shape = "rounded box"``."""

from pathlib import Path
from typing import Literal

import numpy as np

from signorini_fx import Contact, read_scene, solve
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
        beyond = np.abs(away) - np.array(self.half)
        far = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        normal = np.maximum(beyond, 0.0) / np.maximum(far, 1e-300)[:, None]
        normal[far == 0] = np.eye(2)[beyond.argmax(axis=1)][far == 0]  # of points inside
        return far + np.minimum(beyond.max(axis=1), 0.0) - self.radius, np.copysign(normal, away)


register("signorini_fx.shapes", "rounded box", RoundedBox)
if __name__ == "__main__":
    scene = read_scene(Path(__file__).parents[1] / "scenes" / "example1_tresca.toml")
    box = {"shape": "rounded box", "centre": [1.5, -0.502], "half": [0.6, 0.3], "radius": 0.2}
    friction = {"law": "coulomb", "coefficient": 0.3}
    contact = Contact(boundary="bottom", foundation=box, friction=friction)
    print(solve(scene.model_copy(update={"contact": contact})))
