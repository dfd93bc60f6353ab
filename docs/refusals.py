"""Write docs/refusals.md: which features of scenes do not go together, and why, from what each of them declares.

    ./env python3 docs/refusals.py

See ``signorini_fx/mechanics/statement/features.py``.  A test checks that the page is up to date.
"""

from __future__ import annotations

import pkgutil
import sys
from collections.abc import Iterator, Mapping
from importlib import import_module
from itertools import chain
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "refusals.md"
sys.path.insert(0, str(ROOT))

from signorini_fx.addons.derivatives import of_scene  # noqa: E402
from signorini_fx.mechanics import effects, materials  # noqa: E402
from signorini_fx.mechanics.body import statics_of_surface  # noqa: E402
from signorini_fx.mechanics.kinematics import KINDS  # noqa: E402
from signorini_fx.mechanics.statement.effect import Effect  # noqa: E402
from signorini_fx.mechanics.statement.features import REFUSED_BY_SETTINGS  # noqa: E402

# What is computed of a scene, and the features that it does not know.
COMPUTED = {
    "proof by statics": statics_of_surface.REFUSES,
    "derivatives": of_scene.REFUSES,
}
YET = (" yet", " so far", "not tried")
HEAD = """# What does not go together

`./env python3 docs/refusals.py` writes this page from what each feature declares. All pairs that are not listed can be
combined, and what is refused is refused before anything is solved, by `check` too. A bound, a proof or a derivative
that does not know a feature says so in the result or is refused when it is asked for.
"""


def of_effects() -> Iterator[tuple[str, type[Effect]]]:
    """Each effect and material of the package by the name of its key."""
    rooms = (pkgutil.iter_modules(room.__path__, f"{room.__name__}.") for room in (effects, materials))
    for module in chain.from_iterable(rooms):
        for item in vars(import_module(module.name)).values():
            if isinstance(item, type) and issubclass(item, Effect) and item.__module__ == module.name:
                yield module.name.rpartition(".")[2].replace("_", " "), item


def declared() -> Iterator[tuple[str, Mapping[str, str]]]:
    """Each feature that refuses others, and these with the reasons."""
    yield from REFUSED_BY_SETTINGS.items()
    yield from ((kind.words, kind.refuses) for kind in KINDS)
    yield from (refused for _, item in of_effects() for refused in vars(item).get("refuses", {}).items())


def pairs() -> dict[tuple[str, str], str]:
    """The reason of each pair; what a body with torsion shares with one without is listed once."""
    found = {(feature, other): why for feature, refused in declared() for other, why in refused.items()}
    found |= {(feature, other): why for feature, refused in COMPUTED.items() for other, why in refused.items()}
    shared = [(twisted, other) for twisted, other in found if (twisted.partition(",")[0], other) in found]
    return {pair: why for pair, why in found.items() if "," not in pair[0] or pair not in shared}


def derived(why: str) -> bool:
    """Whether a reason is one of mathematics, and not that nobody has done it yet."""
    return not any(word in why for word in YET)


def written() -> str:
    """The page."""
    parts, every = [HEAD], pairs()
    for heading, mathematical in (("By mathematics", True), ("Not derived yet", False)):
        rows = [f"| {one} | {other} | {why} |" for (one, other), why in every.items() if derived(why) == mathematical]
        parts += [f"\n## {heading}\n", "| feature | with | message |", "|---|---|---|", *rows]
    return "\n".join(parts) + "\n"


if __name__ == "__main__":
    PAGE.write_text(written(), encoding="utf-8")
