"""Which features of scenes do not go together, and why, as each of them declares it."""

from __future__ import annotations

import pkgutil
from collections.abc import Iterator, Mapping
from importlib import import_module
from itertools import chain

from signorini_fx.addons.derivatives import of_scene
from signorini_fx.mechanics import effects, materials
from signorini_fx.mechanics.kinematics import KINDS
from signorini_fx.mechanics.statement.effect import Effect
from signorini_fx.mechanics.statement.features import REFUSED_BY_SETTINGS

# What is computed of a scene, and the features that it does not know.
COMPUTED = {"derivatives": of_scene.REFUSES}
YET = (" yet", " so far", "not tried")


def of_effects() -> Iterator[tuple[str, type[Effect]]]:
    """Each effect and material of the package by the name of its key."""
    rooms = (
        pkgutil.iter_modules(room.__path__, f"{room.__name__}.") for room in (effects, materials)
    )
    names = [module.name for module in chain.from_iterable(rooms)]
    for module in names:
        for item in vars(import_module(module)).values():
            if isinstance(item, type) and issubclass(item, Effect) and item.__module__ == module:
                yield module.rpartition(".")[2].replace("_", " "), item


def declared() -> Iterator[tuple[str, Mapping[str, str]]]:
    """Each feature that refuses others, and these with the reasons."""
    yield from REFUSED_BY_SETTINGS.items()
    yield from ((kind.words, kind.refuses) for kind in KINDS)
    yield from (
        refused for _, item in of_effects() for refused in vars(item).get("refuses", {}).items()
    )


def pairs() -> dict[tuple[str, str], str]:
    """The reason of each pair; what a body with torsion shares with one without is listed once."""
    found = {
        (feature, other): why for feature, refused in declared() for other, why in refused.items()
    }
    found |= {
        (feature, other): why
        for feature, refused in COMPUTED.items()
        for other, why in refused.items()
    }
    shared = [
        (twisted, other) for twisted, other in found if (twisted.partition(",")[0], other) in found
    ]
    return {pair: why for pair, why in found.items() if "," not in pair[0] or pair not in shared}


def derived(why: str) -> bool:
    """Whether a reason is one of mathematics, and not that nobody has done it yet."""
    return not any(word in why for word in YET)
