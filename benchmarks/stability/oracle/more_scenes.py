"""Random scenes with effects beyond tractions: scenes of ``scenes``, in 2D or in 3D, and what acts
on them besides.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.stability.oracle import scenes, scenes_in_space
from benchmarks.stability.oracle.effects import listed
from benchmarks.stability.oracle.scenes import Dice, Trial, drawn_units
from benchmarks.stability.oracle.units import Units

Table = dict[str, Any]
# The scenes begin with this seed of those without further effects.
_FIRST = 100_000
_CHANCE = 0.3


def more(seed: int, dim: int, units: Units | None = None) -> Trial:
    """The scene of a seed with at least one further effect, in its own units or in given ones."""
    room, own = (
        (scenes, (_graded, _rotation, _fluid))
        if dim == 2
        else (scenes_in_space, (_orthotropic, _ellipse))
    )
    kinds = (*own, _gravity, _temperature, _force, _springs, _cohesion, _shape)
    drawn = room.trial(_FIRST + seed)
    dice, scene = Dice(seed, dim, 2), drawn.scene | {"title": f"effects in {dim}D {seed}"}
    contacts = [effect["boundary"] for effect in scene["contact"]]
    named = [
        effect["boundary"] for key in ("traction", "displacement") for effect in listed(scene, key)
    ]
    every = room.SIDES if drawn.mesh is not None else dict.fromkeys(named)
    sides = [side for side in every if side not in contacts]
    steps = max(
        (len(e["factors"]) for key in scene for e in _tables(scene, key) if "factors" in e),
        default=1,
    )
    scale, added = dice.power(-4, -2), 0

    def stepped(load: Table) -> Table:
        if steps > 1 and dice.chance(0.4):
            return load | {"factors": [round(dice.between(-0.5, 1.0), 3) for _ in range(steps)]}
        return load

    while not added:
        for draw in kinds:
            if dice.chance(_CHANCE):
                added += draw(dice, scene, sides, scale, stepped, drawn)
    return Trial(seed, scene, drawn.mesh, units or drawn_units(_FIRST + seed, dim))


def _tables(scene: Table, key: str) -> list[Table]:
    found = scene[key]
    return [one for one in (found if isinstance(found, list) else [found]) if isinstance(one, dict)]


def _vector(dice: Dice, dim: int) -> list[float]:
    """Any direction."""
    return [dice.between(-1, 1) for _ in range(dim)]


def _components(dice: Dice, scale: float, dim: int) -> dict[str, float]:
    """Of a load in any direction."""
    return dict(zip("xyz"[:dim], (scale * value for value in _vector(dice, dim)), strict=True))


def _wave(dice: Dice, dim: int) -> str:
    """An expression between 0.25 and 1."""
    return f"0.625 + 0.375*sin({dice.between(1, 3)!r}*x[{dice.whole(0, dim - 1)}])"


def _all_have(dice: Dice, scene: Table, key: str, low: float, high: float) -> None:
    """Give all materials a number, unless they have it."""
    scene["material"] = [
        one | {key: one.get(key, dice.between(low, high))} for one in scene["material"]
    ]


def _graded(dice: Dice, scene: Table, *_: Any) -> int:
    place = dice.whole(0, len(scene["material"]) - 1)
    scene["material"] = list(scene["material"])
    scene["material"][place] = scene["material"][place] | {"grading": _wave(dice, 2)}
    return 1


def _rotation(
    dice: Dice, scene: Table, sides: list[str], scale: float, stepped: Any, *_: Any
) -> int:
    _all_have(dice, scene, "density", 0.5, 2.0)
    found: Table = {"speed": float(np.sqrt(scale * dice.between(0.1, 1.0)))}
    if dice.chance(0.6):
        found["about"] = [dice.between(-2, 2), dice.between(-2, 2)]
    scene["rotation"] = [stepped(found)]
    return 1


def _fluid(dice: Dice, scene: Table, sides: list[str], scale: float, stepped: Any, *_: Any) -> int:
    if not sides:
        return 0
    found = {
        "boundary": dice.one_of(*sides),
        "level": dice.between(-0.5, 2),
        "weight": scale * dice.between(0.2, 1),
    }
    if dice.chance(0.4):
        found["up"] = dice.one_of("x", "y")
    scene["fluid"] = [stepped(found)]
    return 1


def _field(dice: Dice) -> list[Any]:
    """A direction, sometimes one that turns from place to place."""
    found: list[Any] = _vector(dice, 3)
    if dice.chance(0.4):
        found[dice.whole(0, 2)] = (
            f"{dice.between(0.5, 2)!r}*sin({dice.between(0, 3)!r}*x[{dice.whole(0, 2)}] + 0.7)"
        )
    return found


def _orthotropic(dice: Dice, scene: Table, sides: list[str], scale: float, *_: Any) -> int:
    if "temperature" in scene or "volumetric" in scene["element"]:
        return 0
    place = dice.whole(0, len(scene["material"]) - 1)
    old, young = scene["material"][place], [dice.power(-1.3, 0) for _ in range(3)]
    flexible = np.diag(1 / np.array(young))
    ratios = []
    for i, j in ((0, 1), (0, 2), (1, 2)):
        ratios.append(dice.between(-0.4, 0.6) * float(np.sqrt(young[i] / young[j])))
        flexible[i, j] = flexible[j, i] = -ratios[-1] / young[i]
    scaled = flexible * np.sqrt(np.outer(young, young))
    if np.linalg.eigvalsh(scaled).min() < 0.05:
        ratios = [0.3 * ratio for ratio in ratios]
    constants = {
        "young": young,
        "poisson": ratios,
        "shear": [dice.power(-1.5, -0.3) for _ in range(3)],
    }
    scene["material"] = list(scene["material"])
    scene["material"][place] = {key: old[key] for key in old if key in ("region", "density")} | {
        "orthotropic": constants | {"direction": _field(dice), "second": _vector(dice, 3)}
    }
    return 1


def _ellipse(dice: Dice, scene: Table, sides: list[str], scale: float, *_: Any) -> int:
    held = [effect["boundary"] for effect in listed(scene, "displacement")]
    found = 0
    for number, effect in enumerate(scene["contact"]):
        # Supports on the edge of the contact would have to be along the axes.
        if (
            effect["friction"]["law"] == "none"
            or held not in ([], ["top"])
            or effect["boundary"] != "bottom"
        ):
            continue
        directed = {"ratio": dice.power(-0.8, 0.5), "along": _field(dice)}
        scene["contact"][number] = effect | {"friction": effect["friction"] | directed}
        found = 1
    return found


def _gravity(
    dice: Dice, scene: Table, sides: list[str], scale: float, stepped: Any, drawn: Trial
) -> int:
    dim = drawn.units.dimension
    _all_have(dice, scene, "density", 0.5, 2.0)
    scene["gravity"] = [stepped(_components(dice, scale, dim))]
    return 1


def _temperature(
    dice: Dice, scene: Table, sides: list[str], scale: float, stepped: Any, drawn: Trial
) -> int:
    dim = drawn.units.dimension
    if any("orthotropic" in material for material in scene["material"]):
        return 0
    _all_have(dice, scene, "expansion", 0.3, 1.5)
    change = scale * dice.between(-1, 1)
    value = dice.one_of(
        change, f"{change!r}*(1 + {dice.between(-1, 1)!r}*x[{dice.whole(0, dim - 1)}])"
    )
    found = {"change": value}
    if drawn.mesh is not None and drawn.mesh.regions and dice.chance(0.5):
        found["region"] = dice.one_of(*drawn.mesh.regions)
    scene["temperature"] = [stepped(found)]
    return 1


def _force(
    dice: Dice, scene: Table, sides: list[str], scale: float, stepped: Any, drawn: Trial
) -> int:
    dim = drawn.units.dimension
    if not sides:
        return 0
    found = {"boundary": dice.one_of(*sides)} | _components(dice, scale, dim)
    if dice.chance(0.5):
        found["spread"] = _wave(dice, dim)
    scene["force"] = [stepped(found)]
    return 1


def _springs(
    dice: Dice, scene: Table, sides: list[str], scale: float, stepped: Any, drawn: Trial
) -> int:
    dim = drawn.units.dimension
    if not sides:
        return 0
    axes = "xyz"[:dim]
    keys = dice.one_of(("normal", "tangential"), tuple(axes), ("normal",), (axes[-1],))
    scene["springs"] = [
        {"boundary": dice.one_of(*sides)} | {key: dice.power(-3, 1) for key in keys}
    ]
    return 1


def _cohesion(
    dice: Dice, scene: Table, sides: list[str], scale: float, stepped: Any, drawn: Trial
) -> int:
    dim = drawn.units.dimension
    found = 0
    for number, effect in enumerate(scene["contact"]):
        friction = effect["friction"]
        if (
            friction["law"] == "coulomb"
            and "kind" not in effect
            and (dim == 2 or "cap" not in friction)
        ):
            value: Any = scale * dice.power(-1, 0.5)
            if dim == 2 and dice.chance(0.5):
                value = f"{value!r}*({_wave(dice, dim)})"
            scene["contact"][number] = effect | {"friction": friction | {"cohesion": value}}
            found = 1
    return found


def _shape(
    dice: Dice, scene: Table, sides: list[str], scale: float, stepped: Any, drawn: Trial
) -> int:
    """A plane, circle or sphere under the lowest node of the contact boundary, seen nearly along
    its mean normal.
    """
    dim = drawn.units.dimension
    effect, mesh = scene["contact"][0], drawn.mesh
    if mesh is None or "kind" in effect:
        return 0
    x = mesh.points[mesh.boundaries[effect["boundary"]]].reshape(-1, dim)
    down = x.mean(axis=0) - mesh.points.mean(axis=0)
    down = down / np.linalg.norm(down) + 0.1 * np.array(_vector(dice, dim))
    down /= np.linalg.norm(down)
    lowest = x[np.argmax(x @ down)]
    if dice.chance(0.5):
        shape = {"shape": "plane", "point": lowest.tolist(), "normal": (-down).tolist()}
    else:
        radius = dice.power(-0.3 if dim == 2 else 0.0, 1)
        name = "circle" if dim == 2 else "sphere"
        shape = {"shape": name, "centre": (lowest + radius * down).tolist(), "radius": radius}
        if (np.linalg.norm(mesh.points - np.array(shape["centre"]), axis=1) < radius - 0.05).any():
            return 0
    kept = {key: value for key, value in effect.items() if key != "direction"}
    scene["contact"][0] = kept | {
        "foundation": shape,
        "gap": dice.one_of(0.0, scale * dice.between(-0.5, 0.5)),
    }
    return 1
