"""An interface of one's own: suction between body and foundation, which acts on contact points and not by a form."""

from pathlib import Path

import mpi4py.MPI  # noqa: F401  # before dolfinx
from dolfinx import fem

from signorini_fx import read_scene, solve
from signorini_fx.extensions import register
from signorini_fx.mechanics.loads.load_vectors import AppliedLoad
from signorini_fx.mechanics.statement.effect import Force
from signorini_fx.solving.iterated_interfaces.protocol import Interface


class Suction(Force):
    boundary: str
    tension: float
    interface, grouped = property(lambda self: "suction"), property(lambda self: False)  # no form has it
    given = property(lambda self: {"tension": self.tension})

    def density(self, on):  # integrated by the certificate, where the interface takes the weights of contact points
        return self.tension * on.normal


class AtContactPoints(Interface):
    def loads(self, tagged, space, boundary):
        (effect,), forces = self.entries.values(), fem.Function(space)
        pull = effect.tension * boundary.weight[:, None] * boundary.normal
        forces.x.array.reshape(-1, space.dofmap.bs)[boundary.nodes] = pull
        owned = forces.x.array[: space.dofmap.index_map.size_local * space.dofmap.index_map_bs]
        now = lambda step: self.statement.now(effect, step)[0]  # noqa: E731
        return [AppliedLoad(now, forms=(), forces=owned, prescribed=fem.Function(space))]


register("signorini_fx.effects", "suction", Suction)
register("signorini_fx.interfaces", "suction", AtContactPoints)
if __name__ == "__main__":
    scene = read_scene(Path(__file__).parents[1] / "scenes" / "example1_tresca.toml")
    print(solve(scene.model_copy(update={"suction": Suction(boundary="bottom", tension=1.0)})))
