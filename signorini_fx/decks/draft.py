"""The draft of a scene from an Abaqus input file.  No dolfinx here."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.decks.bolts import bolt_tables
from signorini_fx.decks.contact import contact_tables
from signorini_fx.decks.content import Deck
from signorini_fx.decks.deck import read_deck
from signorini_fx.decks.material import material_tables
from signorini_fx.decks.temperatures import temperature_changes
from signorini_fx.errors import MeshError
from signorini_fx.mesh.files.abaqus_blocks import DeckError, quoted
from signorini_fx.mesh.files.arrays import MeshArrays


@dataclass(frozen=True)
class Draft:
    """A scene that was drafted from an input file.

    Attributes:
        text: of the scene file.
        lost: what the scene lacks, so that its solution is another one; the scene says it itself.
        noted: what is told in another way, or is nothing that a scene is about.
        deck: what was read.
        files: the scene and those beside it that it refers to, with their text.
    """

    text: str
    lost: list[str]
    noted: list[str]
    deck: Deck
    files: dict[Path, str]


def draft(file: Path, mesh: MeshArrays, target: Path) -> Draft:
    """The scene that an input file describes.

    Args:
        file: the input file.
        mesh: what was read from it.
        target: where the scene will be, from which it refers to the file.

    Raises:
        MeshError: a number is none, or a line has too few of them; there is no material.
    """
    deck = read_deck(file, mesh)
    files: dict[Path, str] = {}
    try:
        tables = _tables(deck, target, files)
    except (ValueError, IndexError) as error:
        raise MeshError(f"{file}: {error.text if isinstance(error, DeckError) else error}") from None
    lost, noted = (deck.remarks(lost=lost) for lost in (True, False))
    lines = [f"# A draft from {file.name}: read it, and complete what it lacks."]
    lines += [f"# Left out: {remark}" for remark in noted]
    lines += [f"title = {quoted(deck.title or file.stem)}"]
    if lost:
        lines += ["# Remove what you have completed, or do not need: results are incomplete as long as this is here."]
        lines += ["incomplete = [", *(f"    {quoted(remark)}," for remark in lost), "]"]
    lines += ["", "[mesh]", f"file = {quoted(os.path.relpath(file, target.parent))}"]
    for heading, table_lines in tables:
        lines += ["", heading, *table_lines]
    files[target] = "\n".join(lines) + "\n"
    return Draft(files[target], lost, noted, deck, files)


def _tables(deck: Deck, target: Path, files: dict[Path, str]) -> list[tuple[str, list[str]]]:
    """All tables of the scene but its mesh, each with its lines."""
    steps = max(1, len(deck.steps))
    tables = [("[element]", ["degree = 2"])] if deck.mesh.degree == 2 else []
    heat = _heat(deck, steps, target, files)
    tables += [*material_tables(deck, heated=bool(heat)), *_loads(deck, steps), *heat]
    tables += bolt_tables(deck, steps)
    contacts, stiffness = contact_tables(deck, steps)
    tables += [("[[contact]]", lines) for lines in contacts]
    all_lines = [line for _, lines in tables for line in lines]
    timed = any(line.startswith("foundation") and " if t < " in line for line in all_lines)
    if timed or any(line.startswith("factors") for line in all_lines):  # else all steps are the same
        times = [f"times = {[float(step) for step in range(1, steps + 1)]}"] if timed else []
        tables.append(("[load_steps]", [f"names = [{', '.join(map(quoted, deck.steps))}]", *times]))
    return tables + ([("[solver]", stiffness)] if stiffness else [])


def _heat(deck: Deck, steps: int, target: Path, files: dict[Path, str]) -> list[tuple[str, list[str]]]:
    """Changes of the temperature; one that is not the same everywhere becomes a file beside the scene."""
    tables = []
    for value, field, factors in temperature_changes(deck, steps):
        lines = [f"change = {value!r}"]
        if value is None:
            beside = target.with_name(f"{target.stem}_temperature_{len(files) + 1}.csv")
            rows = np.column_stack((deck.mesh.points[: len(field)], field))
            written = (",".join(repr(float(number)) for number in row) for row in rows)
            files[beside] = "\n".join([f"{','.join(deck.axes)},change", *written])
            lines = [f"file = {quoted(beside.name)}"]
        tables.append(("[[temperature]]", lines + ([f"factors = {factors}"] if set(factors) != {1.0} else [])))
    return tables


def _loads(deck: Deck, steps: int) -> list[tuple[str, list[str]]]:
    """Supports and loads; those of a boundary that have the same course over the steps share a table."""
    merged: dict[tuple[Any, ...], dict[str, float]] = {}
    for load in deck.loads.values():
        if load.table in ("tool", "bolt"):
            continue
        values = deck.course(load, steps)
        largest = max(values, key=abs)
        if largest == 0 and load.table != "displacement":
            continue
        factors = tuple(value / largest for value in values) if largest else ()
        components = {key: share * largest for key, share in zip(load.keys, load.direction, strict=False) if share}
        if load.table == "rotation":  # its factors multiply the force
            components = {"speed": math.sqrt(largest)}
        where = (load.table, load.target, load.lines, () if set(factors) <= {1.0} else factors)
        # Two loads with the same component are two entries, which add up.
        entry = next(n for n in count() if not components.keys() & merged.get((*where, n), {}).keys())
        merged.setdefault((*where, entry), {}).update(components)
    tables, weights = [], 0
    for (table, target, extra_lines, course, _), components in merged.items():
        weights += table == "body_force"
        if table == "body_force" and weights > 1:
            deck.lose(None, "several body forces: a scene has one, the first is taken")
            continue
        lines = [f"boundary = {quoted(target)}"] if target else []
        lines += extra_lines
        lines += [f"{key} = {value!r}" for key, value in components.items()]
        lines += [f"factors = {list(course)}"] if course else []
        tables.append((f"[{table}]" if table == "body_force" else f"[[{table}]]", lines))
    return tables
