"""An effect of one's own: a magnet pulls a boundary down, the more the closer it is. Scenes have
[[magnet]].
"""

from pathlib import Path

from signorini_fx import read_scene, solve
from signorini_fx.extensions import register
from signorini_fx.mechanics.statement.effect import ForceDensity
from signorini_fx.mechanics.statement.values import Positive, TimedValue, Vector


class Magnet(ForceDensity):
    boundary: str
    centre: Vector  # where it is
    radius: Positive  # how far it is felt, length
    strength: TimedValue  # force per area at its centre

    value_keys = ("strength",)

    def degree(self, element):
        return 10

    def density(self, on):
        way = [c - x for c, x in zip(self.centre, on.position, strict=True)]
        return (
            on.value(self.strength)
            / (1 + sum(w * w for w in way) / self.radius**2)
            * on.vector((0.0, -1.0, 0.0))
        )


register("signorini_fx.effects", "magnet", Magnet)
if __name__ == "__main__":
    scene = read_scene(Path(__file__).parents[1] / "scenes" / "example1_tresca.toml")
    magnet = Magnet(boundary="top", centre=[1.5, -0.5], radius=0.5, strength=20.0)
    print(solve(scene.model_copy(update={"magnet": magnet})))
