"""Random scenes in 2D with effects beyond tractions: scenes of ``scenes``, and what acts on them besides."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from benchmarks.stability.oracle.effects import listed
from benchmarks.stability.oracle.elements import Array
from benchmarks.stability.oracle.scenes import SIDES, Dice, Trial, drawn_units, trial
from benchmarks.stability.oracle.units import Units

# The scenes begin with this seed of those without further effects.
FIRST = 100_000
_CHANCE = 0.3


def more(seed: int, units: Units | None = None) -> Trial:
    """The scene of a seed with further effects, in its own units or in given ones."""
    kinds = (_graded, _gravity, _rotation, _temperature, _force, _fluid, _springs, _cohesion, _shape)
    return with_more(seed, units, 2, f"effects {seed}", trial(FIRST + seed), SIDES, kinds)


def with_more(
    seed: int,
    units: Units | None,
    dim: int,
    title: str,
    drawn: Trial,
    every: Sequence[str],
    kinds: Sequence[Callable[..., int]],
) -> Trial:
    """A scene with further effects, at least one of ``kinds``; ``every``: the sides of a mesh without its own names."""
    dice, scene = Dice(seed, dim, 2), drawn.scene | {"title": title}
    contacts = [effect["boundary"] for effect in scene["contact"]]
    named = [effect["boundary"] for key in ("traction", "displacement") for effect in listed(scene, key)]
    sides = [side for side in (every if drawn.mesh is not None else dict.fromkeys(named)) if side not in contacts]
    steps = max((len(e["factors"]) for key in scene for e in _tables(scene, key) if "factors" in e), default=1)
    scale, added = dice.power(-4, -2), 0

    def stepped(load: dict[str, Any]) -> dict[str, Any]:
        if steps > 1 and dice.chance(0.4):
            return load | {"factors": [round(dice.between(-0.5, 1.0), 3) for _ in range(steps)]}
        return load

    while not added:
        for draw in kinds:
            if dice.chance(_CHANCE):
                added += draw(dice, scene, sides, scale, stepped, drawn)
    return Trial(seed, scene, drawn.mesh, units or drawn_units(FIRST + seed, dim))


def _tables(scene: dict[str, Any], key: str) -> list[dict[str, Any]]:
    found = scene[key]
    return [one for one in (found if isinstance(found, list) else [found]) if isinstance(one, dict)]


def _wave(dice: Dice) -> str:
    """An expression between 0.25 and 1."""
    return f"0.625 + 0.375*sin({dice.between(1, 6)!r}*x[{dice.whole(0, 1)}] + {dice.between(0, 6)!r})"


def all_have(dice: Dice, scene: dict[str, Any], key: str, low: float, high: float) -> None:
    """Give all materials a number, unless they have it."""
    scene["material"] = [one | {key: one.get(key, dice.between(low, high))} for one in scene["material"]]


def _graded(dice: Dice, scene: dict[str, Any], *_: Any) -> int:
    place = dice.whole(0, len(scene["material"]) - 1)
    scene["material"] = list(scene["material"])
    scene["material"][place] = scene["material"][place] | {"grading": _wave(dice)}
    return 1


def _gravity(dice: Dice, scene: dict[str, Any], sides: list[str], scale: float, stepped: Any, _: Any) -> int:
    all_have(dice, scene, "density", 0.5, 2.0)
    scene["gravity"] = [stepped({"x": scale * dice.between(-0.5, 0.5), "y": -scale * dice.between(0, 1)})]
    return 1


def _rotation(dice: Dice, scene: dict[str, Any], sides: list[str], scale: float, stepped: Any, _: Any) -> int:
    all_have(dice, scene, "density", 0.5, 2.0)
    found: dict[str, Any] = {"speed": float(np.sqrt(scale * dice.between(0.1, 1.0)))}
    if dice.chance(0.6):
        found["about"] = [dice.between(-2, 2), dice.between(-2, 2)]
    scene["rotation"] = [stepped(found)]
    return 1


def _temperature(dice: Dice, scene: dict[str, Any], sides: list[str], scale: float, stepped: Any, drawn: Trial) -> int:
    all_have(dice, scene, "expansion", 0.3, 1.5)
    change = scale * dice.between(-1, 1)
    value = dice.one_of(change, f"{change!r}*(1 + {dice.between(-1, 1)!r}*x[{dice.whole(0, 1)}])")
    found = {"change": value}
    if drawn.mesh is not None and drawn.mesh.regions and dice.chance(0.5):
        found["region"] = dice.one_of(*drawn.mesh.regions)
    scene["temperature"] = [stepped(found)]
    return 1


def _force(dice: Dice, scene: dict[str, Any], sides: list[str], scale: float, stepped: Any, _: Any) -> int:
    if not sides:
        return 0
    found = {"boundary": dice.one_of(*sides), "x": scale * dice.between(-1, 1), "y": -scale * dice.between(-0.3, 1)}
    if dice.chance(0.5):
        found["spread"] = _wave(dice)
    scene["force"] = [stepped(found)]
    return 1


def _fluid(dice: Dice, scene: dict[str, Any], sides: list[str], scale: float, stepped: Any, _: Any) -> int:
    if not sides:
        return 0
    found = {"boundary": dice.one_of(*sides), "level": dice.between(-0.5, 2), "weight": scale * dice.between(0.2, 1)}
    if dice.chance(0.4):
        found["up"] = dice.one_of("x", "y")
    scene["fluid"] = [stepped(found)]
    return 1


def _springs(dice: Dice, scene: dict[str, Any], sides: list[str], *_: Any) -> int:
    if not sides:
        return 0
    keys = dice.one_of(("normal", "tangential"), ("x", "y"), ("normal",), ("y",))
    scene["springs"] = [{"boundary": dice.one_of(*sides)} | {key: dice.power(-3, 1) for key in keys}]
    return 1


def _cohesion(dice: Dice, scene: dict[str, Any], sides: list[str], scale: float, *_: Any) -> int:
    found = 0
    for number, effect in enumerate(scene["contact"]):
        if effect["friction"]["law"] == "coulomb" and "kind" not in effect:
            value = dice.one_of(scale * dice.power(-1, 0.5), f"{scale!r}*({_wave(dice)})")
            scene["contact"][number] = effect | {"friction": effect["friction"] | {"cohesion": value}}
            found = 1
    return found


def _shape(dice: Dice, scene: dict[str, Any], sides: list[str], scale: float, stepped: Any, drawn: Trial) -> int:
    """A plane or a circle under the lowest node of the contact boundary, seen along its mean normal."""

    def along(down: Array) -> Array:
        turn = dice.between(-0.2, 0.2)
        turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ down
        return np.asarray(turned / np.linalg.norm(down))

    return stands(dice, scene, scale, drawn, along, ("circle", -0.3))


def stands(
    dice: Dice,
    scene: dict[str, Any],
    scale: float,
    drawn: Trial,
    along: Callable[[Array], Array],
    round_one: tuple[str, float],
) -> int:
    """Whether the first contact boundary stands on a shape that is not inside the body.

    Args:
        dice: draws.
        scene: is changed.
        scale: of gaps, length.
        drawn: has the mesh.
        along: from the way from the middle of the body to the middle of the boundary to the unit vector downwards.
        round_one: name of a round shape, and the logarithm of its smallest radius.
    """
    effect, mesh = scene["contact"][0], drawn.mesh
    if mesh is None or "kind" in effect:
        return 0
    x = mesh.points[mesh.boundaries[effect["boundary"]]].reshape(-1, mesh.points.shape[1])
    down = along(x.mean(axis=0) - mesh.points.mean(axis=0))
    lowest = x[np.argmax(x @ down)]
    if dice.chance(0.5):
        shape = {"shape": "plane", "point": lowest.tolist(), "normal": (-down).tolist()}
    else:
        name, least = round_one
        radius = dice.power(least, 1)
        shape = {"shape": name, "centre": (lowest + radius * down).tolist(), "radius": radius}
        if (np.linalg.norm(mesh.points - np.array(shape["centre"]), axis=1) < radius - 0.05).any():
            return 0
    kept = {key: value for key, value in effect.items() if key != "direction"}
    scene["contact"][0] = kept | {"foundation": shape, "gap": dice.one_of(0.0, scale * dice.between(-0.5, 0.5))}
    return 1
