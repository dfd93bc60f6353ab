"""Temperatures of an Abaqus input file as the thermal strain of a scene.

With a coefficient of expansion that is constant, the strain is this coefficient times the temperature less the one that
*INITIAL CONDITIONS gives: where the coefficient counts from, ZERO, makes no difference.
"""

from __future__ import annotations

import numpy as np

from signorini_fx.addons.decks.content import Deck
from signorini_fx.addons.decks.keywords import UNKNOWN, WITHOUT_EFFECT
from signorini_fx.addons.decks.loads import share_now
from signorini_fx.addons.decks.text import DeckBlock, number_of, quoted, real
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.tuned import ZERO_IN_SOLUTION

_NODES_DIFFER = "temperatures that differ within a body are not read"


def read_temperatures(deck: Deck, block: DeckBlock) -> None:
    """Temperatures of sets of nodes: *TEMPERATURE of a step, or *INITIAL CONDITIONS, TYPE=TEMPERATURE."""
    parameters = block.parameters
    if block.keyword == "INITIALCONDITIONS" and (kind := parameters.get("TYPE", "").upper()) != "TEMPERATURE":
        if kind == "VELOCITY":
            deck.note(block, WITHOUT_EFFECT)
        else:
            deck.lose(block, UNKNOWN)
        return
    if parameters.keys() & {"FILE", "BSTEP", "USER", "LINTEMP"}:
        deck.lose(block, _NODES_DIFFER)
        return
    anew = parameters.get("OP", "MOD").upper() == "NEW" and deck.step not in deck.temperatures
    temperatures = _at(deck, -1 if anew else deck.step).copy()
    share = share_now(deck, block)
    for name, value, *_ in block.rows:
        deck.check_nodes(name)
        rows = deck.rows([int(name)]) if number_of(name) is not None else deck.nodes(name)
        if not rows.size:
            deck.note(block, f"temperature of {name!r}: no part of the body")
        temperatures[np.searchsorted(deck.numbers, rows)] = share * real(value)
    deck.temperatures[deck.step] = temperatures
    deck.heating.append(block)


def _at(deck: Deck, step: int) -> Floats:
    """Of the nodes of the file at the end of a step, shape (n,)."""
    steps = [earlier for earlier in deck.temperatures if earlier <= step]
    return deck.temperatures[max(steps)] if steps else np.zeros(len(deck.numbers))


def temperature_tables(deck: Deck, steps: int) -> list[tuple[str, list[str]]]:
    """The change of the temperature of each body since the beginning, with its course over the steps."""
    if not any(properties.get("expansion") for properties in deck.materials.values()):
        return []  # nothing expands
    courses: dict[str, tuple[float, ...]] = {}
    for name, nodes in deck.bodies.items():
        changes = [(_at(deck, step) - _at(deck, -1))[nodes] for step in range(steps)]
        if any(np.ptp(change) > ZERO_IN_SOLUTION * np.abs(change).max(initial=0.0) for change in changes):
            deck.lose(deck.heating[-1], _NODES_DIFFER)
        elif any(change[0] for change in changes):
            courses[name] = tuple(float(change[0]) for change in changes)
    if len(courses) == len(deck.bodies) and len({*courses.values()}) == 1:
        courses = {"": next(iter(courses.values()))}
    tables = []
    for name, course in courses.items():
        largest = max(course, key=abs)
        factors = [value / largest for value in course]
        origins = f"# {' and '.join(dict.fromkeys(block.origin for block in deck.heating))}"
        lines = [origins, f"change = {largest!r}", *([f"region = {quoted(name)}"] if name else [])]
        tables.append(("[[temperature]]", lines + ([f"factors = {factors}"] if set(factors) != {1.0} else [])))
    return tables
