"""Random scenes in 3D with effects beyond tractions: scenes of ``scenes``, and what acts on them besides."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.stability.oracle.effects import listed
from benchmarks.stability.oracle.elements import Array
from benchmarks.stability.oracle.more_scenes import FIRST, all_have, stands, with_more
from benchmarks.stability.oracle.scenes import Dice, Trial
from benchmarks.stability.oracle.scenes_in_space import SIDES, trial
from benchmarks.stability.oracle.units import Units


def more(seed: int, units: Units | None = None) -> Trial:
    """The scene of a seed with further effects, in its own units or in given ones."""
    kinds = (_orthotropic, _ellipse, _gravity, _temperature, _force, _springs, _cohesion, _shape)
    return with_more(seed, units, 3, f"effects in 3D {seed}", trial(FIRST + seed), SIDES, kinds)


def _vector(dice: Dice) -> list[float]:
    """Any direction."""
    return [dice.between(-1, 1) for _ in range(3)]


def _field(dice: Dice) -> list[Any]:
    """A direction, sometimes one that turns from place to place."""
    found: list[Any] = _vector(dice)
    if dice.chance(0.4):
        found[dice.whole(0, 2)] = f"{dice.between(0.5, 2)!r}*sin({dice.between(0, 3)!r}*x[{dice.whole(0, 2)}] + 0.7)"
    return found


def _orthotropic(dice: Dice, scene: dict[str, Any], sides: list[str], scale: float, *_: Any) -> int:
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
    constants = {"young": young, "poisson": ratios, "shear": [dice.power(-1.5, -0.3) for _ in range(3)]}
    scene["material"] = list(scene["material"])
    scene["material"][place] = {key: old[key] for key in old if key in ("region", "density")} | {
        "orthotropic": constants | {"direction": _field(dice), "second": _vector(dice)}
    }
    return 1


def _ellipse(dice: Dice, scene: dict[str, Any], sides: list[str], scale: float, *_: Any) -> int:
    held = [effect["boundary"] for effect in listed(scene, "displacement")]
    found = 0
    for number, effect in enumerate(scene["contact"]):
        # Supports on the edge of the contact would have to be along the axes.
        if effect["friction"]["law"] == "none" or held not in ([], ["top"]) or effect["boundary"] != "bottom":
            continue
        directed = {"ratio": dice.power(-0.8, 0.5), "along": _field(dice)}
        scene["contact"][number] = effect | {"friction": effect["friction"] | directed}
        found = 1
    return found


def _gravity(dice: Dice, scene: dict[str, Any], sides: list[str], scale: float, stepped: Any, _: Any) -> int:
    all_have(dice, scene, "density", 0.5, 2.0)
    scene["gravity"] = [stepped(dict(zip("xyz", (scale * value for value in _vector(dice)), strict=True)))]
    return 1


def _temperature(dice: Dice, scene: dict[str, Any], sides: list[str], scale: float, stepped: Any, _: Any) -> int:
    if any("orthotropic" in material for material in scene["material"]):
        return 0
    all_have(dice, scene, "expansion", 0.3, 1.5)
    change = scale * dice.between(-1, 1)
    value = dice.one_of(change, f"{change!r}*(1 + {dice.between(-1, 1)!r}*x[{dice.whole(0, 2)}])")
    scene["temperature"] = [stepped({"change": value})]
    return 1


def _force(dice: Dice, scene: dict[str, Any], sides: list[str], scale: float, stepped: Any, _: Any) -> int:
    if not sides:
        return 0
    found = {"boundary": dice.one_of(*sides)} | dict(
        zip("xyz", (scale * value for value in _vector(dice)), strict=True)
    )
    if dice.chance(0.5):
        found["spread"] = f"0.625 + 0.375*sin({dice.between(1, 3)!r}*x[{dice.whole(0, 2)}])"
    scene["force"] = [stepped(found)]
    return 1


def _springs(dice: Dice, scene: dict[str, Any], sides: list[str], *_: Any) -> int:
    if not sides:
        return 0
    keys = dice.one_of(("normal", "tangential"), ("x", "y", "z"), ("normal",), ("z",))
    scene["springs"] = [{"boundary": dice.one_of(*sides)} | {key: dice.power(-3, 1) for key in keys}]
    return 1


def _cohesion(dice: Dice, scene: dict[str, Any], sides: list[str], scale: float, *_: Any) -> int:
    found = 0
    for number, effect in enumerate(scene["contact"]):
        if effect["friction"]["law"] == "coulomb" and "kind" not in effect and "cap" not in effect["friction"]:
            cohesion = {"cohesion": scale * dice.power(-1, 0.5)}
            scene["contact"][number] = effect | {"friction": effect["friction"] | cohesion}
            found = 1
    return found


def _shape(dice: Dice, scene: dict[str, Any], sides: list[str], scale: float, stepped: Any, drawn: Trial) -> int:
    """A plane or a sphere under the lowest node of the contact boundary, seen nearly along its mean normal."""

    def along(down: Array) -> Array:
        aside = down / np.linalg.norm(down) + 0.1 * np.array(_vector(dice))
        return np.asarray(aside / np.linalg.norm(aside))

    return stands(dice, scene, scale, drawn, along, ("sphere", 0.0))
