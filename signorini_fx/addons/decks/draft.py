"""The draft of a scene from an Abaqus input file."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

from signorini_fx.addons.decks import loads, material
from signorini_fx.addons.decks.bolts import bolt_tables
from signorini_fx.addons.decks.contact import contact_tables, set_sliding
from signorini_fx.addons.decks.content import Deck
from signorini_fx.addons.decks.reading import read_deck
from signorini_fx.addons.decks.text import (
    DeckBlock,
    factors_of,
    lines_of,
    mesh_errors,
    origins_of,
    written,
)


@dataclass(frozen=True)
class Draft:
    """A scene that was drafted from an input file."""

    text: str  # of the scene file
    lost: list[str]  # what the scene lacks, so that its solution differs; also listed in the scene
    noted: list[str]  # what is stated in another way, or does not change the solution
    deck: Deck  # what was read


def draft(file: Path, target: Path) -> Draft:
    """Return the scene that an input file describes.

    Args:
        file: the input file.
        target: the path of the scene file, relative to which it refers to the input file.
    """
    deck = read_deck(file)
    with mesh_errors(file):
        tables = _tables(deck)
    present = {block.keyword for block in deck.model.blocks}
    touching = any(heading == "[[contact]]" for heading, _ in tables)
    lost = deck.remarks(lost=True)
    noted = deck.remarks(lost=False)
    if not touching and (deck.pairs or present & {"CONTACT", "GAP"}):
        lost.append("all of its contact: bodies do not touch in the scene")
    lines = [f"# From {file.name}: read it, and complete what it lacks."]
    lines += [f"# Left out: {remark}" for remark in noted]
    lines += [f"title = {written(deck.title or file.stem)}"]
    if lost:
        lines += [
            "# Remove what you have completed, or do not need: results are incomplete as long as "
            "this is here."
        ]
        lines += ["incomplete = [", *(f"    {written(remark)}," for remark in lost), "]"]
    lines += ["", "[mesh]", f"file = {written(os.path.relpath(file, target.parent))}"]
    for heading, table in tables:
        lines += ["", heading, *lines_of(table)]
    return Draft("\n".join(lines) + "\n", lost, noted, deck)


def _tables(deck: Deck) -> list[tuple[str, dict[str, Any]]]:
    """Return all tables of the scene except its mesh."""
    steps = max(1, len(deck.steps))
    element: dict[str, Any] = {"degree": 2} if deck.mesh.degree == 2 else {}
    element |= {"volumetric": "auto"} if material.has_rubber(deck) else {}
    heat = loads.temperature_tables(deck, steps)
    contacts, stiffness = contact_tables(deck)
    obstacle = material.obstacle_of(deck, contacts, heated=bool(heat))
    if material.is_nonlinear(deck, obstacle):
        set_sliding(deck, contacts)
    tables = [
        *([("[element]", element)] if element else []),
        *material.material_tables(deck, obstacle, heated=bool(heat)),
        *_load_tables(deck, steps, releases=bool(contacts)),
        *heat,
        *bolt_tables(deck, steps),
        *(("[[contact]]", table) for table in contacts),
    ]
    if any(
        table.get(key) for _, table in tables for key in ("factors", "holds")
    ):  # else all steps are the same
        tables.append(("[load_steps]", {"names": deck.steps}))
    return tables + ([("[solver]", stiffness)] if stiffness else [])


def _load_tables(deck: Deck, steps: int, *, releases: bool) -> list[tuple[str, dict[str, Any]]]:
    """Return the tables of supports and loads; those with the same history on a boundary share a
    table.

    Args:
        deck: the content of the input file.
        steps: number of load steps.
        releases: whether supports may end.
    """
    merged: dict[tuple[Any, ...], dict[str, float]] = {}
    origins: dict[tuple[Any, ...], list[DeckBlock]] = {}
    for load in deck.loads.values():
        if load.table == "bolt":
            continue
        values = load.by_step(steps)
        largest, factors = factors_of([value or 0.0 for value in values])
        supports = load.table == "displacement"
        if largest == 0 and not supports:
            continue
        held = tuple(value is not None for value in values) if supports and None in values else ()
        if held and not releases and any(held):
            free = ", ".join(
                name for name, value in zip(deck.steps, values, strict=False) if value is None
            )
            what = f"at = {written(load.place[0][1])}" if load.place else repr(load.target)
            deck.lose(
                load.block, f"{what} is free along {load.keys[-1]} in {free}: here it is held there"
            )
            held = ()
        elif held and not any(held):
            continue
        components = {
            key: share * largest
            for key, share in zip(load.keys, load.direction, strict=False)
            if share
        }
        if load.table == "rotation":  # its factors multiply the force
            components = {"speed": math.sqrt(largest)}
        where = (load.table, load.target, load.place, factors, held)
        # Two loads with the same component are two entries, which add up.
        entry = next(
            n for n in count() if not components.keys() & merged.get((*where, n), {}).keys()
        )
        merged.setdefault((*where, entry), {}).update(components)
        origins.setdefault((*where, entry), []).append(load.block)
    tables = []
    weighing = False
    for key, components in merged.items():
        table, target, place, factors, held, _ = key
        if table == "body_force" and weighing:
            deck.lose(origins[key][0], "several body forces: a scene has one, the first is taken")
            continue
        weighing |= table == "body_force"
        entries = {"#": origins_of(origins[key]), "boundary": target, **dict(place), **components}
        entries |= {"factors": factors, "holds": held}
        tables.append((f"[{table}]" if table == "body_force" else f"[[{table}]]", entries))
    return tables
