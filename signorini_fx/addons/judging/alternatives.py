"""Other problems that a result may solve: those in which one load, modulus, friction or gap is
different.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from signorini_fx.addons.judging.judged_problem import NotJudgedError, SolutionOnMesh
from signorini_fx.arrays import Array
from signorini_fx.errors import SceneError
from signorini_fx.mechanics.laws.coulomb import NoFriction
from signorini_fx.mechanics.statement.effect import Effect, Load
from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.scenes.scene import Scene
from signorini_fx.tuned import JUDGED_INCREMENTS, NOTABLE

if TYPE_CHECKING:
    from signorini_fx.mechanics.effects.contact import Contact


# Entries of a scene by their keys.
Entries = Mapping[str, Effect | Sequence[Effect]]


@dataclass(frozen=True)
class Alternative:
    """A number of the problem that may have another value."""

    text: Callable[[float, float], str]  # what to say of a value and its inverse
    start: float  # its value in the problem
    trial: float  # another value, from which its effect is seen
    entries: Callable[[float], Entries]  # of the scene with a value
    least: float = -np.inf  # the smallest value


@dataclass(frozen=True)
class OtherProblem:
    """An alternative with a certain value, and its solution."""

    text: str  # what it is
    displacement: Array  # length, shape (n, d)
    distance: float  # from the result, in the energy norm
    large: bool  # whether its value is at least as far from the problem's as the trial


def nearest_alternative(on_mesh: SolutionOnMesh, v: Array, enough: float) -> OtherProblem | None:
    """Return the alternative whose solution is nearest to a displacement in the energy norm, or
    None without one.

    Args:
        on_mesh: our solution.
        v: the displacement of the result, length, shape (n, d).
        enough: distance at which the search for a nearer value stops.
    """
    size = float(np.abs(on_mesh.displacement).max())
    tried = (_values(on_mesh, v, one, enough) for one in _alternatives(on_mesh.problem.scene, size))
    found = list(chain.from_iterable(tried))
    return min(found, key=lambda other: other.distance) if found else None


def _values(
    on_mesh: SolutionOnMesh, v: Array, tried: Alternative, enough: float
) -> Iterator[OtherProblem]:
    """Yield the solutions for values that the secant method finds, until a value has no effect or
    no solution.
    """
    value = tried.trial
    before = tried.start
    u_before = on_mesh.displacement
    for _ in range(JUDGED_INCREMENTS):
        try:
            u = on_mesh.with_entries(tried.entries(value))
        except (NotJudgedError, SceneError):  # there is none, or the scene contradicts itself
            return
        off = v - u
        distance = on_mesh.norm(off)
        large = abs(value - tried.start) >= abs(tried.trial - tried.start)
        yield OtherProblem(tried.text(value, 1 / value if value else np.inf), u, distance, large)
        slope = np.asarray((u - u_before) / (value - before))
        square = on_mesh.product(slope, slope)
        if distance <= enough or not square > 0:
            return
        following = max(value + on_mesh.product(off, slope) / square, tried.least)
        if following == value:
            return
        value, before, u_before = following, value, u


def _alternatives(scene: Scene, size: float) -> Iterator[Alternative]:
    """Yield all alternatives of a scene.

    Args:
        scene: the scene.
        size: the largest displacement, length.
    """
    loads = [
        (key, number)
        for key, entries in scene.statement.effects.items()
        for number, entry in enumerate(entries)
        if isinstance(entry, Load) and key != "displacement"
    ]
    trial = 1.0 + NOTABLE
    text = "its loads are {:.4g} times the problem's, or its moduli {:.4g} times".format
    if loads:
        yield Alternative(text, 1.0, trial, partial(_loaded, scene, loads))
    for load in loads if len(loads) > 1 else ():
        text = partial(
            "its {where} is {:.4g} times the problem's".format, where=_named(*load, scene)
        )
        yield Alternative(text, 1.0, trial, partial(_loaded, scene, [load]))
    for number, material in enumerate(scene.material if len(scene.material) > 1 else ()):
        if getattr(material, "young", None) is not None:
            text = partial(
                "its modulus of {region} is {1:.4g} times the problem's".format,
                region=material.region,
            )
            yield Alternative(text, 1.0, trial, partial(_softer, scene, number), NOTABLE)
    for number, contact in enumerate(scene.contact):
        if contact.bonded:
            continue
        yield from _of_friction(scene, number, contact)
        text = partial("its gap of {where} is larger by {:.4g}".format, where=contact.boundary)
        yield Alternative(text, 0.0, NOTABLE * size, partial(_opened, scene, number))


def _of_friction(scene: Scene, number: int, contact: Contact) -> Iterator[Alternative]:
    """Yield another coefficient or bound of friction; for a contact without friction a
    coefficient.
    """
    friction = contact.friction
    law = friction.model_dump()
    if isinstance(friction, NoFriction):
        law = {"law": "coulomb", "coefficient": 0.0}
    key = next((key for key in ("coefficient", "bound") if isinstance(law.get(key), float)), None)
    if key is None:
        return
    start = float(law[key])

    def entries(value: float) -> Entries:
        return _changed(
            scene, "contact", number, friction={**law, key: value} if value > 0 else NoFriction()
        )

    said = "its {key} of friction on {where} is {:.4g}, not {start:.4g}"
    text = partial(said.format, key=key, where=contact.boundary, start=start)
    yield Alternative(text, start, start / 2 if start > 0 else NOTABLE, entries, 0.0)


def _named(key: str, number: int, scene: Scene) -> str:
    entry = scene.statement.effects[key][number]
    where = next(
        (str(at) for name in ("boundary", "region", "at") if (at := getattr(entry, name, None))), ""
    )
    return f"{entry.label.replace('_', ' ')} {number + 1}" + (f" on {where}" if where else "")


def _loaded(scene: Scene, loads: Sequence[tuple[str, int]], value: float) -> Entries:
    """Return the entries of a scene in which some loads are ``value`` times as large."""
    entries: dict[str, Sequence[Effect]] = {}
    for key, number in loads:
        several = list(entries.get(key, scene.statement.effects[key]))
        factors = several[number].factors or (1.0,) * scene.statement.steps
        several[number] = several[number].model_copy(
            update={"factors": tuple(value * share for share in factors)}
        )
        entries[key] = several
    return {
        key: several[0] if key in scene.statement.single else several
        for key, several in entries.items()
    }


def _changed(scene: Scene, key: str, number: int, **values: Any) -> Entries:
    """Return one list of a scene with other values in one of its entries, by its key."""
    entries = list(getattr(scene, key))
    entries[number] = entries[number].remade(**values)
    return {key: entries}


def _softer(scene: Scene, number: int, compliance: float) -> Entries:
    """Return the materials with one compliance multiplied by a factor; the displacement is nearly
    linear in it.
    """
    material = scene.material[number]
    return _changed(scene, "material", number, young=material.young / compliance)


def _opened(scene: Scene, number: int, by: float) -> Entries:
    gap = scene.contact[number].gap
    if isinstance(gap, float):
        gap += by
    elif isinstance(gap, Expression):
        gap = replace(gap, text=f"({gap.text}) + {by!r}")
    return _changed(scene, "contact", number, gap=gap)
