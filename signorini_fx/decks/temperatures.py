"""Temperatures of an Abaqus input file as the thermal strain of a scene.  No dolfinx here.

With a coefficient of expansion that is constant, the strain is this coefficient times the temperature less the one that
*INITIAL CONDITIONS gives: where the coefficient counts from, ZERO, makes no difference.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from signorini_fx.decks.content import Deck
from signorini_fx.decks.loads import share_of
from signorini_fx.mesh.files.abaqus_blocks import DeckBlock, real
from signorini_fx.mesh.files.shape import Floats
from signorini_fx.tuned import ZERO_IN_SOLUTION


def read_temperatures(deck: Deck, block: DeckBlock) -> None:
    """Temperatures at nodes: *TEMPERATURE of a step, or *INITIAL CONDITIONS, TYPE=TEMPERATURE."""
    parameters = block.parameters
    if block.keyword == "INITIALCONDITIONS" and parameters.get("TYPE", "").upper() != "TEMPERATURE":
        if parameters.get("TYPE", "").upper() == "VELOCITY":
            deck.note(block, "without effect in static steps")
        else:
            deck.lose(block, "not known to scenes")
        return
    if parameters.keys() & {"FILE", "BSTEP", "USER"}:
        deck.lose(block, "temperatures that are not in the file")
        return
    anew = parameters.get("OP", "MOD").upper() == "NEW" and deck.step not in deck.temperatures
    temperatures = _at(deck, -1 if anew else deck.step).copy()
    share = share_of(deck, block)
    for name, value, *_ in block.rows:
        rows = deck.rows([int(name)]) if name.isdigit() else deck.nodes(name)
        if not rows.size:
            deck.note(block, f"temperature of {name!r}: no part of the body")
        temperatures[np.searchsorted(deck.numbers, rows)] = share * real(value)
    deck.temperatures[deck.step] = temperatures


def _at(deck: Deck, step: int) -> Floats:
    """Of the nodes of the file at the end of a step, shape (n,)."""
    steps = [earlier for earlier in deck.temperatures if earlier <= step]
    return deck.temperatures[max(steps)] if steps else np.zeros(len(deck.numbers))


def temperature_changes(deck: Deck, steps: int) -> Iterator[tuple[float | None, Floats, list[float]]]:
    """The fields whose multiples are the changes since the beginning.

    Args:
        deck: what has been read.
        steps: how many there are.

    Yields:
        The value of a field that is the same everywhere, or None; the field at the nodes of the file, shape (n,); its
        factor in each step.
    """
    fields: list[tuple[Floats, list[float]]] = []
    for step in range(steps):
        change = _at(deck, step) - _at(deck, -1)
        largest = float(np.abs(change).max(initial=0.0))
        if not largest:
            continue
        for field, factors in fields:
            factor = float(change @ field / (field @ field))
            if np.abs(change - factor * field).max() <= ZERO_IN_SOLUTION * largest:
                factors[step] = factor
                break
        else:
            fields.append((change, [float(number == step) for number in range(steps)]))
    for field, factors in fields:
        largest_factor = max(factors, key=abs)
        full_change: Floats = largest_factor * field
        uniform = np.ptp(field) <= ZERO_IN_SOLUTION * np.abs(field).max()
        yield float(full_change[0]) if uniform else None, full_change, [factor / largest_factor for factor in factors]
