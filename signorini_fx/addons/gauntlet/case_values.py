"""Values of another program at nodes and instants beside ours."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
import numpy as np

from signorini_fx.addons.decks.content import Deck
from signorini_fx.addons.decks.node_results import NodeResults
from signorini_fx.addons.gauntlet.finer import FinerValues, finer_values
from signorini_fx.addons.gauntlet.outcomes import ComparedQuantity, GauntletCase
from signorini_fx.addons.gauntlet.solved_drafts import SolvedDraft
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.tuned import DIGITS_OF_FILES, EXPLAINED_FROM

DISPLACEMENT, PRESSURE, REACTION = "displacement", "contact pressure", "nodal force"


@dataclass(frozen=True)
class WantedValue:
    """A value of another program.

    Attributes:
        quantity: one of the three above.
        component: 0 to 2 of a vector.
        node: its number in the deck.
        label: of the node in the other program.
        instant: which one of the solution.
        theirs: the value.
    """

    quantity: str
    component: int
    node: int
    label: str
    instant: int
    theirs: float


def with_values(
    case: GauntletCase,
    wanted: Sequence[WantedValue],
    moments: Sequence[NodeResults],
    solved: SolvedDraft,
    deck: Deck,
    formulations: Sequence[str],
) -> GauntletCase:
    """The case with what both programs have, and, where they differ, with what explains that.

    Args:
        case: without quantities.
        wanted: their values.
        moments: ours at each instant.
        solved: the scene and our solution.
        deck: that it was drafted from.
        formulations: how the other program solves its contact, in words.
    """
    case = replace(case, quantities=tuple(_quantities(wanted, moments, deck, None)))
    if (case.difference or 0.0) <= EXPLAINED_FROM:
        return case
    theirs = [f"theirs is {words}" for words in formulations]
    case = replace(case, reasons=(*theirs, *([f"here {deck.mesh.note}"] if deck.mesh.note else [])))
    finer = finer_values(solved, deck)
    if finer is None:
        return case
    return replace(case, quantities=tuple(_quantities(wanted, moments, deck, finer))).told_by_finer()


def _quantities(
    wanted: Sequence[WantedValue], moments: Sequence[NodeResults], deck: Deck, finer: FinerValues | None
) -> Iterator[ComparedQuantity]:
    """Each quantity where theirs is largest, with the largest difference of all."""
    places = {number: row for row, number in enumerate(plain(deck.names))}
    for quantity in (DISPLACEMENT, PRESSURE, REACTION):
        rows: list[tuple[WantedValue, float]] = []
        size = 0.0
        for value in wanted:
            if value.quantity != quantity or value.node not in places:
                continue
            table = _field(moments[value.instant], quantity, deck)
            ours = table[places[value.node], value.component]
            if np.isfinite(ours):  # a node that is no contact point has no pressure
                rows.append((value, float(ours)))
                size = max(size, float(np.abs(table[np.isfinite(table)]).max(initial=0.0)))
        if not rows:
            continue
        largest, ours_there = max(rows, key=lambda row: abs(row[0].theirs))
        theirs = largest.theirs
        scale = abs(theirs) if abs(theirs) > DIGITS_OF_FILES * size else size or 1.0
        difference = max(abs(ours - value.theirs) for value, ours in rows) / scale
        axis = "" if quantity == PRESSURE else f"{'xyz'[largest.component]} "
        label = f"{quantity}, {axis}at node {largest.label}"
        of_finer = None if finer is None else _shares(rows, finer, len(moments) - 1, scale)
        yield ComparedQuantity(label, theirs, ours_there, difference, finer=of_finer)


def _field(moment: NodeResults, quantity: str, deck: Deck) -> Floats:
    """Ours at all nodes, infinite where there is none."""
    if quantity == DISPLACEMENT:
        return moment.displacement
    if quantity == REACTION:
        return np.asarray(moment.reactions / deck.printed_share)
    return np.where(moment.points, np.nan_to_num(moment.contact[:, 3]), np.inf)[:, None]


def _shares(
    rows: Sequence[tuple[WantedValue, float]], finer: FinerValues, last: int, scale: float
) -> tuple[float, float] | None:
    """How far theirs and ours are from our solution on a finer mesh at the last instant; None: it lacks the nodes."""
    distances = []
    for value, ours in rows:
        table = {DISPLACEMENT: finer.displacement, PRESSURE: finer.pressure}.get(value.quantity, {})
        if value.instant != last or value.node not in table:
            continue
        exact = float(np.nan_to_num(table[value.node][value.component], posinf=np.inf))
        if np.isfinite(exact):
            distances.append((abs(value.theirs - exact) / scale, abs(ours - exact) / scale))
    return (max(pair[0] for pair in distances), max(pair[1] for pair in distances)) if distances else None
