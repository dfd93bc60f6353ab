"""The draft of a scene from an Abaqus input file."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

from signorini_fx.addons.decks.bolts import bolt_tables
from signorini_fx.addons.decks.contact import contact_tables, say_partners
from signorini_fx.addons.decks.content import Deck
from signorini_fx.addons.decks.deck import read_deck
from signorini_fx.addons.decks.loads import temperature_tables
from signorini_fx.addons.decks.material import has_rubber, is_nonlinear, material_tables, obstacle_of
from signorini_fx.addons.decks.text import DeckBlock, placed, quoted


@dataclass(frozen=True)
class Draft:
    """A scene that was drafted from an input file.

    Attributes:
        text: of the scene file.
        lost: what the scene lacks, so that its solution is another one; the scene says it itself.
        noted: what is put in another way, or does not change the solution.
        deck: what was read.
    """

    text: str
    lost: list[str]
    noted: list[str]
    deck: Deck


def draft(file: Path, target: Path) -> Draft:
    """The scene that an input file describes.

    Args:
        file: the input file.
        target: where the scene will be, from which it refers to the file.

    Raises:
        MeshError: see ``read_deck``; there is no material.
    """
    deck = read_deck(file)
    with placed(file):
        tables = _tables(deck)
    keywords = {block.keyword for block in deck.model.blocks}
    touching = any(heading == "[[contact]]" for heading, _ in tables)
    lost, noted = (deck.remarks(lost=lost) for lost in (True, False))
    if not touching and (deck.pairs or keywords & {"CONTACT", "GAP"}):
        lost.append("all of its contact: bodies do not touch in the scene")
    lines = [f"# From {file.name}: read it, and complete what it lacks."]
    lines += [f"# Left out: {remark}" for remark in noted]
    lines += [f"title = {quoted(deck.title or file.stem)}"]
    if lost:
        lines += ["# Remove what you have completed, or do not need: results are incomplete as long as this is here."]
        lines += ["incomplete = [", *(f"    {quoted(remark)}," for remark in lost), "]"]
    lines += ["", "[mesh]", f"file = {quoted(os.path.relpath(file, target.parent))}"]
    for heading, table_lines in tables:
        lines += ["", heading, *table_lines]
    return Draft("\n".join(lines) + "\n", lost, noted, deck)


def _tables(deck: Deck) -> list[tuple[str, list[str]]]:
    """All tables of the scene but its mesh, each with its lines."""
    steps = max(1, len(deck.steps))
    element = ["degree = 2"] if deck.mesh.degree == 2 else []
    element += ['volumetric = "auto"'] if has_rubber(deck) else []
    heat = temperature_tables(deck, steps)
    contacts, stiffness = contact_tables(deck)
    obstacle = obstacle_of(deck, contacts, heated=bool(heat))
    if is_nonlinear(deck, obstacle):
        contacts = say_partners(deck, contacts)
    tables = [
        *([("[element]", element)] if element else []),
        *material_tables(deck, obstacle, heated=bool(heat)),
        *_loads(deck, steps, releases=bool(contacts)),
        *heat,
        *bolt_tables(deck, steps),
        *(("[[contact]]", lines) for lines in contacts),
    ]
    all_lines = [line for _, lines in tables for line in lines]
    if any(line.startswith(("factors", "holds")) for line in all_lines):  # else all steps are the same
        tables.append(("[load_steps]", [f"names = [{', '.join(map(quoted, deck.steps))}]"]))
    return tables + ([("[solver]", stiffness)] if stiffness else [])


def _loads(deck: Deck, steps: int, *, releases: bool) -> list[tuple[str, list[str]]]:
    """Supports and loads; those of a boundary that have the same course over the steps share a table."""
    merged: dict[tuple[Any, ...], dict[str, float]] = {}
    origins: dict[tuple[Any, ...], list[DeckBlock]] = {}
    for load in deck.loads.values():
        if load.table == "bolt":
            continue
        values = deck.course(load, steps, releases=releases)
        largest = max(values, key=abs)
        if largest == 0 and load.table != "displacement":
            continue
        holding = tuple(value is not None for value in load.by_step(steps))
        held = holding if releases and load.table == "displacement" and not all(holding) else ()
        if held and not any(held):
            continue
        factors = tuple(value / largest for value in values) if largest else ()
        components = {key: share * largest for key, share in zip(load.keys, load.direction, strict=False) if share}
        if load.table == "rotation":  # its factors multiply the force
            components = {"speed": math.sqrt(largest)}
        where = (load.table, load.target, load.lines, () if set(factors) <= {1.0} else factors, held)
        # Two loads with the same component are two entries, which add up.
        entry = next(n for n in count() if not components.keys() & merged.get((*where, n), {}).keys())
        merged.setdefault((*where, entry), {}).update(components)
        origins.setdefault((*where, entry), []).append(load.block)
    tables, weighing = [], False
    for key, components in merged.items():
        table, target, extra, factors, held, _ = key
        if table == "body_force" and weighing:
            deck.lose(origins[key][0], "several body forces: a scene has one, the first is taken")
            continue
        weighing |= table == "body_force"
        lines = [f"# {' and '.join(dict.fromkeys(block.origin for block in origins[key]))}"]
        lines += [f"boundary = {quoted(target)}"] if target else []
        lines += [*extra, *(f"{axis} = {value!r}" for axis, value in components.items())]
        lines += [f"factors = {list(factors)}"] if factors else []
        lines += [f"holds = [{', '.join('true' if value else 'false' for value in held)}]"] if held else []
        tables.append((f"[{table}]" if table == "body_force" else f"[[{table}]]", lines))
    return tables
