"""The draft of a scene from an Abaqus input file.  No dolfinx here."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.addons.decks.bolts import bolt_tables
from signorini_fx.addons.decks.contact import contact_tables
from signorini_fx.addons.decks.content import Deck
from signorini_fx.addons.decks.deck import read_deck
from signorini_fx.addons.decks.material import material_tables
from signorini_fx.addons.decks.nodal import nodal_tables
from signorini_fx.addons.decks.nonlinear_material import obstacle_of, sliding_lines
from signorini_fx.addons.decks.temperatures import TemperatureField, temperature_fields
from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.abaqus_blocks import DeckBlock, DeckError, quoted
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.mechanics.statement.point_values import same_places
from signorini_fx.tuned import ZERO_IN_SOLUTION


@dataclass(frozen=True)
class Draft:
    """A scene that was drafted from an input file.

    Attributes:
        text: of the scene file.
        lost: what the scene lacks, so that its solution is another one; the scene says it itself.
        noted: what is told in another way, or is nothing that a scene is about.
        deck: what was read.
        files: the scene and those beside it that it refers to, with their text.
        origins: tables of the scene, such as ``displacement[0]``, and the keywords of the input file that say the same.
    """

    text: str
    lost: list[str]
    noted: list[str]
    deck: Deck
    files: dict[Path, str]
    origins: dict[str, str]


def draft(file: Path, target: Path) -> Draft:
    """The scene that an input file describes.

    Args:
        file: the input file.
        target: where the scene will be, from which it refers to the file.

    Raises:
        MeshError: see ``read_deck``; there is no material.
    """
    return draft_of(read_deck(file), file, target, file.name)


def finite_draft(file: Path, target: Path) -> Draft | None:
    """The same with finite strains where the input file asks for NLGEOM; None: it does not, or they are not possible
    with what else it has.

    Args:
        file: the input file.
        target: where the scene will be, from which it refers to the file.

    Raises:
        MeshError: see ``draft``.
    """
    deck = read_deck(file, finite=True)
    if deck.nonlinear is None:
        return None
    drafted = draft_of(deck, file, target, file.name)
    laws = [line for line in drafted.text.splitlines() if line.startswith("law = ")]
    return drafted if any("saint-venant-kirchhoff" in line for line in laws) else None


def draft_of(deck: Deck, file: Path, target: Path, source: str) -> Draft:
    """The scene of an input file that has been read.

    Args:
        deck: what was read.
        file: the input file.
        target: where the scene will be, from which it refers to the file.
        source: the name of what the draft is from.

    Raises:
        MeshError: a number is none, or there is no material.
    """
    files: dict[Path, str] = {}
    try:
        tables = _tables(deck, target, files)
    except (ValueError, IndexError) as error:
        raise MeshError(f"{file}: {error.text if isinstance(error, DeckError) else error}") from None
    lost, noted = (deck.remarks(lost=lost) for lost in (True, False))
    lines = [f"# A draft from {source}: read it, and complete what it lacks."]
    lines += [f"# Left out: {remark}" for remark in noted]
    lines += [f"title = {quoted(deck.title or file.stem)}"]
    if lost:
        lines += ["# Remove what you have completed, or do not need: results are incomplete as long as this is here."]
        lines += ["incomplete = [", *(f"    {quoted(remark)}," for remark in lost), "]"]
    lines += ["", "[mesh]", f"file = {quoted(os.path.relpath(file, target.parent))}"]
    for heading, table_lines in tables:
        lines += ["", heading, *table_lines]
    files[target] = "\n".join(lines) + "\n"
    origins: dict[str, str] = {}
    counts: Counter[str] = Counter()
    for heading, table_lines in tables:
        name = heading.strip("[]")
        if table_lines[0].startswith("# "):
            origins[f"{name}[{counts[name]}]" if heading.startswith("[[") else name] = table_lines[0].removeprefix("# ")
        counts[name] += 1
    return Draft(files[target], lost, noted, deck, files, origins)


def _tables(deck: Deck, target: Path, files: dict[Path, str]) -> list[tuple[str, list[str]]]:
    """All tables of the scene but its mesh, each with its lines."""
    steps = max(1, len(deck.steps))
    element = ["degree = 2"] if deck.mesh.degree == 2 else []
    if any("rubber" in properties for properties in deck.materials.values()):
        element.append('volumetric = "auto"')
    tables = [("[element]", element)] if element else []
    heat = _heat(deck, steps, target, files)
    contacts, stiffness = contact_tables(deck, steps)
    contacts = sliding_lines(deck, contacts, obstacle_of(deck, contacts, heated=bool(heat)))
    tables += [
        *material_tables(deck, contacts, heated=bool(heat)),
        *_loads(deck, steps, releases=bool(contacts)),
        *heat,
    ]
    tables += bolt_tables(deck, steps)
    tables += nodal_tables(deck, steps, target, files)
    if not contacts and not deck.links and deck.touches:
        deck.lose(None, "all of its contact: bodies do not touch in the scene")
        deck.apart = True
    tables += [("[[contact]]", lines) for lines in contacts]
    all_lines = [line for _, lines in tables for line in lines]
    timed = any(line.startswith(("foundation", "friction", "gap")) and " if t < " in line for line in all_lines)
    if timed or any(line.startswith(("factors", "holds")) for line in all_lines):  # else all steps are the same
        times = [f"times = {[float(step) for step in range(1, steps + 1)]}"] if timed else []
        tables.append(("[load_steps]", [f"names = [{', '.join(map(quoted, deck.steps))}]", *times]))
    return tables + ([("[solver]", stiffness)] if stiffness else [])


def _heat(deck: Deck, steps: int, target: Path, files: dict[Path, str]) -> list[tuple[str, list[str]]]:
    """Changes of the temperature; one that is not the same everywhere becomes a file beside the scene."""
    tables = list[tuple[str, list[str]]]()
    if not any(properties.get("expansion") for properties in deck.materials.values()):
        return tables  # nothing expands
    for field in temperature_fields(deck, steps):
        lines = [f"change = {field.uniform!r}"]
        if field.uniform is None:
            beside = target.with_name(f"{target.stem}_temperature_{len(files) + 1}.csv")
            points, values = _distinct(deck, field)
            written = (",".join(map(repr, plain(row))) for row in np.column_stack((points, values)))
            files[beside] = "\n".join([f"{','.join(deck.axes)},change", *written])
            lines = [f"file = {quoted(beside.name)}"]
        lines += [f"region = {quoted(field.body)}"] if field.body else []
        lines += [f"factors = {field.factors}"] if set(field.factors) != {1.0} else []
        tables.append(("[[temperature]]", [_origins(deck.heating), *lines]))
    return tables


def _origins(blocks: Sequence[DeckBlock]) -> str:
    """A comment that says which keywords a table is from."""
    return f"# {' and '.join(dict.fromkeys(block.origin for block in blocks))}"


def _distinct(deck: Deck, field: TemperatureField) -> tuple[Floats, Floats]:
    """The points of a field and its values there, of which a table has one for each place."""
    points = deck.mesh.points[field.nodes]
    places = same_places(points)
    first = np.unique(places, return_index=True)[1]
    means = np.bincount(places, field.values) / np.bincount(places)
    away = np.abs(means[places] - field.values)
    if away.max() > ZERO_IN_SOLUTION * np.abs(field.values).max():
        node = deck.names[field.nodes[np.argmax(away)]]
        deck.lose(None, f"several temperatures at one place of a body, as of node {node}: their mean is taken")
    return points[first], means


def _loads(deck: Deck, steps: int, *, releases: bool) -> list[tuple[str, list[str]]]:
    """Supports and loads; those of a boundary that have the same course over the steps share a table."""
    merged: dict[tuple[Any, ...], dict[str, float]] = {}
    origins: dict[tuple[Any, ...], list[DeckBlock]] = {}
    for load in deck.loads.values():
        if load.table in ("tool", "bolt", "point_force", "grounded"):
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
        where = (load.table, load.target, load.lines, load.within, () if set(factors) <= {1.0} else factors, held)
        # Two loads with the same component are two entries, which add up.
        entry = next(n for n in count() if not components.keys() & merged.get((*where, n), {}).keys())
        merged.setdefault((*where, entry), {}).update(components)
        origins.setdefault((*where, entry), []).append(load.block)
    tables, weights = [], 0
    for key, components in merged.items():
        table, target, extra_lines, within, course, holds, _ = key
        weights += table == "body_force"
        if table == "body_force" and weights > 1:
            deck.lose(None, "several body forces: a scene has one, the first is taken")
            continue
        lines = [_origins(origins[key]), *([f"boundary = {quoted(target)}"] if target else []), *extra_lines]
        for axis, value in components.items():
            lines.append(f"{axis} = {quoted(f'{value!r} if {within} else 0.0') if within else repr(value)}")
        lines += [f"factors = {list(course)}"] if course else []
        lines += [f"holds = [{', '.join('true' if value else 'false' for value in holds)}]"] if holds else []
        tables.append((f"[{table}]" if table == "body_force" else f"[[{table}]]", lines))
    return tables
