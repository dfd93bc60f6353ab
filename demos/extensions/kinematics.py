"""Kinematics of one's own: a slice of a body of revolution between two smooth planes through its
axis.
"""

from dataclasses import dataclass, fields
from math import pi

from signorini_fx import Scene, solve
from signorini_fx.extensions import register
from signorini_fx.mechanics.kinematics import AXISYMMETRIC, BodyOfRevolution


@dataclass(frozen=True)
class Slice(BodyOfRevolution):
    angle: float = pi / 6

    def depth(self, size):
        return self.angle * size / 2

    def measure(self, x):
        return self.angle * x[0]


SLICE = Slice(
    **{field.name: getattr(AXISYMMETRIC, field.name) for field in fields(AXISYMMETRIC)}
    | {"words": "slice"}
)
register("signorini_fx.kinematics", "slice", SLICE)
cake = {
    "mesh": {
        "generator": "rectangle",
        "parameters": {"length": 1.0, "height": 0.5, "nx": 16, "ny": 8},
    },
    "material": {"young": 1000.0, "poisson": 0.3, "hypothesis": "slice"},
    "traction": {"boundary": "top", "pressure": 2.0},
    "contact": {"boundary": "bottom", "friction": {"law": "coulomb", "coefficient": 0.2}},
}
if __name__ == "__main__":
    print(solve(Scene(**cake)))
