"""Random scenes with loads of other kinds than tractions and body forces, or with springs, and their true errors.

    ./env python3 tests/support/loaded_scenes.py KIND STUDY [SEEDS] [FIRST]

KIND is gravity, force, rotation, fluid, springs, 'varying springs', preload, 'pressed springs', or 'facing springs',
STUDY one of ``heated_scenes``.  Prints guaranteed bounds over true errors, and what finer solutions say against other
bounds.
"""

import sys
from functools import partial

import heated_scenes
import numpy as np

from signorini_fx.mechanics.laws.none import NoFriction
from signorini_fx.scenes.reading import parse_scene


def _boundaries(scene):
    """The boundary that is loaded from above or from aside, and the size of the body."""
    if scene.body:
        upper = scene.body[0].mesh.parameters
        high = scene.body[0].shift[-1] + upper["height"]
        return "upper.top", "upper.right", float(upper["length"]), float(high)
    if hasattr(scene.mesh, "mesh"):
        x = scene.mesh.mesh.geometry.x
        return "top", "right", float(np.ptp(x[:, 0])), float(x[:, 2].max())
    return "top", "right", float(scene.mesh.parameters["length"]), float(scene.mesh.parameters["height"])


def loaded(scene, seed, kind):
    """The scene with one or two such loads, of the size of its own ones."""
    chance = np.random.default_rng([seed, 51])
    plane = not (hasattr(scene.mesh, "mesh") and scene.mesh.mesh.geometry.dim == 3)
    plane &= not (scene.body and len(scene.body[0].shift) == 3)
    top, right, length, high = _boundaries(scene)
    up, young = "xyz"[1 if plane else 2], float(min(material.young for material in scene.material))
    size = 1e-3 * young * float(10 ** chance.uniform(-0.3, 0.7))
    fields = {key: getattr(scene, key) for key in scene.model_fields_set}
    fields["material"] = [
        material.model_copy(update={"density": float(chance.uniform(0.3, 2))}) for material in scene.material
    ]
    if kind == "gravity":
        values = [
            f"{-size / high}",
            f"{-size / high}*(x[0] + 0.2)",
            f"where(x[0] < {0.37 * length}, {-size / high}, 0)",
        ]
        gravity = {up: str(chance.choice(values))}
        fields["gravity"] = [gravity | {"x": float(size / high * chance.normal())}]
    elif kind == "force":
        spreads = ["1", "x[0] + 0.1", f"max(0, {0.37 * length} - x[0])", f"where(x[0] < {0.41 * length}, 1, 0.2)"]
        spreads += ["1 + sin(3*x[0])"] * 2
        spread = str(chance.choice(spreads))
        fields["force"] = [
            {"boundary": top, up: float(-size * length), "x": float(size * chance.normal()), "spread": spread}
        ]
        fields["traction"] = fields["traction"][1:]
    elif kind == "rotation":
        about = [float(length * chance.uniform(-1, 1)), *map(float, high * chance.uniform(-1, 1, 1 if plane else 2))]
        speed = float(np.sqrt(size) / length)
        speeds = [speed, speed, f"{speed}*(1 + x[0]/{length})", f"where(x[0] < {0.37 * length}, {speed}, {speed / 2})"]
        fields["rotation"] = [{"speed": speeds[int(chance.integers(len(speeds)))], "about": about}]
        if chance.random() < 0.4:
            fields["rotation"][0]["axis"] = [1.0, float(chance.normal()), 0.0][: 2 if plane else 3]
    elif kind == "fluid":
        low = high - (high if not scene.body else scene.body[0].mesh.parameters["height"])
        levels = [low + (high - low) * float(chance.uniform(0.2, 1.5)), f"{high} - 0.3*x[0]"]
        fields["fluid"] = [{"boundary": right, "level": levels[int(chance.integers(2))], "weight": 3 * size / high}]
        if chance.random() < 0.5:
            fields["fluid"].append({"boundary": top, "level": f"{high - 0.2} + 0.6*x[0]", "weight": size / high})
    elif kind == "springs":
        fields |= _on_springs(scene, chance, (top, right), up, young / high)
    elif kind == "varying springs":
        fields |= _on_springs(scene, chance, (top, right), up, young / high)
        fields["springs"] = _varying(fields["springs"], chance, up, (length, high))
    elif kind == "preload":  # a section across the body, or the upper one of two, which is shortened or lengthened
        long = float(scene.body[0].mesh.parameters["length"]) if scene.body else length
        axis, point = [1.0, 0.0, 0.0], [float(long * chance.uniform(0.2, 0.8)), 0.0, 0.0]
        # The support that presses a block holds all of its top, so that a section across it would have one side held.
        if plane and not scene.body and any(str(one.boundary) == top for one in scene.displacement):
            axis, point = [0.0, 1.0, 0.0], [0.0, float(high * chance.uniform(0.2, 0.8)), 0.0]
        shortening = size / young * high * float(chance.choice([1, 2, -1]))
        section = {"point": point[: 2 if plane else 3], "axis": axis[: 2 if plane else 3], "shortening": shortening}
        # Friction would see one side of the section.
        fields["contact"] = [one.model_copy(update={"friction": NoFriction()}) for one in scene.contact]
        fields["preload"] = [section | ({"region": "upper"} if scene.body else {})]
    elif kind == "pressed springs":  # where contact is
        stiff = young / high * 10 ** chance.uniform(-2, 1, 2)
        springs = [{"normal": float(stiff[0]), "tangential": float(stiff[1])}, {"x": float(stiff[0])}]
        fields["springs"] = [{"boundary": scene.contact[0].boundary, **springs[int(chance.integers(2))]}]
    elif kind == "facing springs":  # on both sides of the contact of two bodies
        stiff = young / high * 10 ** chance.uniform(-1, 1, 4)
        fields["springs"] = [
            {"boundary": boundary, "normal": float(normal), "tangential": float(tangential)}
            for boundary, normal, tangential in (
                (scene.contact[0].boundary, *stiff[:2]),
                (scene.contact[0].against, *stiff[2:]),
            )
        ]
    return parse_scene(fields)


def _on_springs(scene, chance, boundaries, up, stiffness):
    """Springs beside supports, or in place of those of the body that is not fixed."""
    top, right = boundaries
    stiff = stiffness * 10 ** chance.uniform(-2, 1, 3)
    frames = [
        {"normal": float(stiff[0]), "tangential": float(stiff[1])},
        {"normal": float(stiff[0])},
        {"x": float(stiff[0]), up: float(stiff[1])},
        {"tangential": float(stiff[0])},
    ]
    springs = [{"boundary": right, **frames[int(chance.integers(4))]}]
    supports = list(scene.displacement)
    free = str(supports[-1].boundary)
    if chance.random() < 0.5:  # springs alone hold the body, or one of both
        supports = supports[:-1]
        springs.append({"boundary": free, **frames[0]})
    held = {str(support.boundary) for support in supports}
    if chance.random() < 0.5 and top not in held:
        springs.append({"boundary": top, up: float(stiff[2])})
    springs = [spring for spring in springs if spring["boundary"] not in held]
    return {"springs": springs or [{"boundary": right, **frames[0]}], "displacement": supports}


def _varying(springs, chance, up, sizes):
    """The same with stiffnesses that vary: polynomials, some of which vanish at a place, jumps, and waves."""
    length, high = sizes
    along = (f"(x[0]/{length})", f"(x[{'xyz'.index(up)}]/{high})")
    changed = []
    for spring in springs:
        values = dict(spring)
        for key in [name for name in values if name != "boundary"]:  # in an order that all ranks have
            a, b = along if chance.random() < 0.5 else along[::-1]
            shapes = [
                f"0.1 + {a} + 2*{b}**2",
                f"2*({b} - 0.3)**2",
                f"where({b} < 0.37, 0.02, 1.5)",
                f"where({a} < 0.41, 0, 1 + {b})",
                f"3*max(0, {b} - 0.45)",
                f"1.2 + sin(3*{b} + {a})",
            ]
            values[key] = f"{values[key]}*({shapes[int(chance.integers(len(shapes)))]})"
        changed.append(values)
    return changed


def drawn(kind, study, seed):
    """A scene of a study of ``heated_scenes`` with such loads."""
    return heated_scenes.drawn(study, seed, partial(loaded, kind=kind))


def effectivity(kind, study, seed):
    """See ``heated_scenes``."""
    return heated_scenes.effectivity(study, seed, partial(loaded, kind=kind))


if __name__ == "__main__":
    kind = sys.argv.pop(1)
    heated_scenes.main(partial(loaded, kind=kind))
