"""Temperatures of an Abaqus input file as the thermal strain of a scene.  No dolfinx here.

With a coefficient of expansion that is constant, the strain is this coefficient times the temperature less the one that
*INITIAL CONDITIONS gives: where the coefficient counts from, ZERO, makes no difference.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from signorini_fx.addons.decks.content import Deck
from signorini_fx.addons.decks.loads import kept_share
from signorini_fx.mechanics.mesh.files.abaqus_blocks import DeckBlock, real
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
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
    share = kept_share(deck, block)
    if "LINTEMP" in parameters:
        _along_a_line(deck, block, temperatures, share)
    else:
        for name, value, *_ in block.rows:
            deck.check_nodes(name)
            rows = deck.rows([int(name)]) if name.isdigit() else deck.nodes(name)
            if not rows.size:
                deck.note(block, f"temperature of {name!r}: no part of the body")
            temperatures[np.searchsorted(deck.numbers, rows)] = share * real(value)
    deck.temperatures[deck.step] = temperatures
    deck.heating.append(block)


def _along_a_line(deck: Deck, block: DeckBlock, temperatures: Floats, share: float) -> None:
    """Temperatures that are linear along a direction, LINTEMP: its vector, and place and temperature at both ends.

    Raises:
        ValueError: a row has other than seven numbers, or both of its places are the same.
    """
    for row in block.rows:
        words = [real(word) for word in row]
        if len(words) != 7:
            raise ValueError(
                f"a direction, and two places with their temperatures are expected, not {len(words)} words"
            )
        if words[3] == words[5]:
            raise ValueError(f"both temperatures are at {words[3]:g}, and one place along the direction has only one")
        (start, first, end, last), points = words[3:], deck.mesh.points[: len(deck.numbers)]
        along = points @ np.array(words[: deck.mesh.dim])
        inside = (along >= min(start, end)) & (along <= max(start, end))
        temperatures[inside] = share * (first + (along[inside] - start) * (last - first) / (end - start))


def _at(deck: Deck, step: int) -> Floats:
    """Of the nodes of the file at the end of a step, shape (n,)."""
    steps = [earlier for earlier in deck.temperatures if earlier <= step]
    return deck.temperatures[max(steps)] if steps else np.zeros(len(deck.numbers))


@dataclass(frozen=True)
class TemperatureField:
    """A field whose multiples are the changes in a body since the beginning.

    Attributes:
        body: its name; empty: the whole of the file.
        nodes: where its nodes are among those of the file, shape (n,).
        values: at them, temperature, shape (n,).
        factors: in each step.
    """

    body: str
    nodes: Ints
    values: Floats
    factors: list[float]

    @property
    def uniform(self) -> float | None:
        """Its value, if it is the same everywhere."""
        alike = np.ptp(self.values) <= ZERO_IN_SOLUTION * np.abs(self.values).max()
        return float(self.values[0]) if alike else None


def temperature_fields(deck: Deck, steps: int) -> list[TemperatureField]:
    """The fields of each body, as nodes of several may be at one place; one field, if all are heated evenly alike.

    Args:
        deck: what has been read.
        steps: how many there are.
    """
    fields = [field for name, nodes in deck.bodies.items() for field in _fields(deck, name, nodes, steps)]
    alike = {(field.uniform, *field.factors) for field in fields}
    if len(alike) == 1 and fields[0].uniform is not None and len(fields) == len(deck.bodies):
        return [replace(fields[0], body="")]
    return fields


def _fields(deck: Deck, name: str, nodes: Ints, steps: int) -> Iterator[TemperatureField]:
    """Those of a body."""
    fields: list[tuple[Floats, list[float]]] = []
    at_rest = _at(deck, -1)[nodes]
    for step in range(steps):
        change = _at(deck, step)[nodes] - at_rest
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
        yield TemperatureField(name, nodes, largest_factor * field, [factor / largest_factor for factor in factors])
