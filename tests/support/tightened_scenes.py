"""Random scenes with sections that forces tighten, and their true errors against solutions on finer meshes.

    ./env python3 tests/support/tightened_scenes.py walls | hammer | two | space [SEEDS] [FIRST]

prints guaranteed bounds over true errors, and what finer solutions say against other bounds.  Between walls the
section is tightened against supports, and its stiffness decides on the shortening; the head of a hammer is drawn onto a
foundation, so that contact and loads determine the tension; ``two`` has one more section, of a given shortening.  Loads
along the axis act where no section may be, as the facets of a section are others on a finer mesh.
"""

import tempfile
from pathlib import Path

import heated_scenes
import numpy as np
from mpi4py import MPI

from signorini_fx.mechanics.laws.none import NoFriction
from signorini_fx.mechanics.mesh.tagged import load_file
from signorini_fx.mechanics.statement.mesh_sources import MeshFile
from signorini_fx.scenes.reading import parse_scene

# A stem of unit width on a wall, and a head whose lower sides touch foundations.
HAMMER = """
Point(1) = {{-0.5, 0, 0}}; Point(2) = {{0.5, 0, 0}}; Point(3) = {{0.5, {high}, 0}}; Point(4) = {{{right}, {high}, 0}};
Point(5) = {{{right}, {top}, 0}}; Point(6) = {{{left}, {top}, 0}}; Point(7) = {{{left}, {high}, 0}};
Point(8) = {{-0.5, {high}, 0}};
For k In {{1 : 8}}
  Line(k) = {{k, k == 8 ? 1 : k + 1}};
EndFor
Curve Loop(1) = {{1 : 8}}; Plane Surface(1) = {{1}}; MeshSize {{ : }} = {size};
Physical Curve("wall") = {{1}}; Physical Curve("under") = {{3, 7}}; Physical Curve("top") = {{5}};
Physical Curve("stem") = {{2}}; Physical Surface("body") = {{1}};
"""


def walls(scene, seed):
    """A body that is tightened between supports on the left and on the right, on its foundation."""
    chance = np.random.default_rng([seed, 61])
    space = hasattr(scene.mesh, "mesh")
    high = float(np.ptp(scene.mesh.mesh.geometry.x[:, 2])) if space else float(scene.mesh.parameters["height"])
    length = float(np.ptp(scene.mesh.mesh.geometry.x[:, 0])) if space else float(scene.mesh.parameters["length"])
    size = 1e-3 * float(min(material.young for material in scene.material))
    up = "z" if space else "y"
    fields = {key: getattr(scene, key) for key in scene.model_fields_set if key != "body_force"}
    fields["displacement"] = [
        {"boundary": "left", **dict.fromkeys("xyz"[: 2 + space], 0.0)},
        {"boundary": "right", "x": float(size / scene.material[0].young * chance.choice([0.0, 0.3, -0.3]))},
    ]
    fields["traction"] = [{"boundary": "top", up: f"{-size * chance.uniform(0.1, 2)}*(1 + x[0])"}]
    if chance.random() < 0.4:
        fields["body_force"] = {up: float(-size / high)}
    fields["contact"] = [one.model_copy(update={"friction": NoFriction()}) for one in scene.contact]
    point = [length * float(chance.uniform(0.2, 0.8)), 0.0, 0.0][: 2 + space]
    area = high * (float(np.ptp(scene.mesh.mesh.geometry.x[:, 1])) if space else 1.0)
    section = {"point": point, "axis": [float(chance.choice([1, -1])), 0.0, 0.0][: 2 + space]}
    fields["preload"] = [section | {"force": size * area * float(chance.uniform(0.2, 3))}]
    return parse_scene(fields)


def hammer(scene, seed, sections=1):
    """A stem that is held below, whose head is drawn down onto a foundation."""
    chance = np.random.default_rng([seed, 62])
    young, high = float(10 ** chance.uniform(1, 4)), float(chance.uniform(1, 2.5))
    size = 1e-3 * young
    with tempfile.TemporaryDirectory() as folder:
        name = Path(folder) / "hammer.geo"
        text = HAMMER.format(
            high=high,
            top=high + chance.uniform(0.4, 1),
            right=0.5 + chance.uniform(0.3, 1),
            left=-0.5 - chance.uniform(0.3, 1),
            size=chance.uniform(0.25, 0.5),
        )
        name.write_text(text, encoding="utf-8")
        tagged = load_file(MeshFile(file=str(name)), MPI.COMM_SELF, 0)
    deep = 1e-3 * float(chance.uniform(0, 1))
    gaps = ["0.0", f"{deep}*x[0]**2", f"{deep}*abs(x[0] - 0.2)", f"{deep}*(1 + x[0])"]
    fields = {
        "mesh": tagged,
        "element": {"degree": int(chance.choice([1, 1, 2]))},
        "material": {"young": young, "poisson": float(chance.choice([0.0, 0.3, 0.45]))},
        "displacement": [{"boundary": "wall", "x": 0.0, "y": 0.0}],
        "traction": [
            {"boundary": "top", "y": size * float(chance.uniform(-1, 0.3)), "x": size * float(chance.normal()) / 10},
            {"boundary": "stem", "x": size * float(chance.normal()) / 5},
        ],
        "contact": {"boundary": "under", "gap": str(chance.choice(gaps)), "direction": [0.0, -1.0]},
        "preload": [
            {
                "point": [0.0, high * (number + float(chance.uniform(0.3, 0.7))) / sections],
                "axis": [0.0, float(chance.choice([1, -1]))],
                "force": size * float(chance.uniform(0.5, 3)),
            }
            for number in range(sections)
        ],
    }
    if sections == 2:  # the other one is closed by a length
        fields["preload"][0].pop("force")
        fields["preload"][0]["shortening"] = size / young * float(chance.normal())
    return parse_scene(fields)


def two(scene, seed):
    """The same with two sections, of one of which the shortening is given."""
    return hammer(scene, seed, 2)


FAMILIES = {"walls": ("plane", walls), "hammer": ("plane", hammer), "two": ("plane", two), "space": ("space", walls)}


def drawn(family, seed):
    """A scene of a family."""
    study, change = FAMILIES[family]
    return change(heated_scenes.STUDIES[study].drawn(seed), seed)


def effectivity(family, seed):
    """See ``heated_scenes``."""
    study, change = FAMILIES[family]
    return heated_scenes.effectivity(study, seed, change)


if __name__ == "__main__":
    import sys

    study, change = FAMILIES[sys.argv[1]]
    sys.argv[1] = study
    heated_scenes.main(change)
