"""Reading an Abaqus input file: each keyword has a function here, or an entry among
the keywords of ``text``.  ``draft`` makes the scene.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.addons.decks import loads, material
from signorini_fx.addons.decks.assembly import LEVELS
from signorini_fx.addons.decks.contact import (
    contact_tables,
    read_behaviour,
    read_friction,
    read_interaction,
    read_pairs,
    read_ties,
    set_sliding,
)
from signorini_fx.addons.decks.content import Deck
from signorini_fx.addons.decks.loads import bolt_tables, read_bolt
from signorini_fx.addons.decks.mesh import NO_BODY, POINTS, read_model
from signorini_fx.addons.decks.text import (
    CHANGED_WITHIN,
    LOST,
    NO_BODY_PART,
    NOTED,
    OTHER_PROCEDURE,
    OUTPUT,
    UNKNOWN,
    DeckBlock,
    factors_of,
    lines_of,
    mesh_errors,
    origins_of,
    real,
    written,
)
from signorini_fx.arrays import Plain
from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.arrays import from_raw

Reader = Callable[[Deck, DeckBlock], None]
_STRESS = r"CPS|STRI|M3D|S\d"  # plane stress, if they are a plane body
_ASSUMED = {"axisymmetric": "CAX", "plane stress": _STRESS, "plane strain": "CPE"}
# Keywords of steps, which have no meaning outside of them.
_OF_STEPS = {"STATIC", "BOUNDARY", "CLOAD", "DLOAD", "DSLOAD", "TEMPERATURE", "MODELCHANGE"}
_WEIGHT = re.compile("GRAV|CENTRIF", re.IGNORECASE)
_OTHER_PROCEDURE = OTHER_PROCEDURE
_PROCEDURES = {
    "STATIC",
    *(name for name, effect in LOST.items() if effect == _OTHER_PROCEDURE),
}


def read_deck(file: Path) -> Deck:
    """Return the content of an input file: its mesh, materials, supports, loads and contact."""
    model = read_model(file)
    mesh = from_raw(model.raw, str(file))
    outside = {
        name: rows[rows < len(mesh.facets) - mesh.inner] for name, rows in mesh.boundaries.items()
    }
    inside = {name: len(rows) - len(outside[name]) for name, rows in mesh.boundaries.items()}
    deck = Deck(replace(mesh, boundaries=outside), model, inside)
    for block in model.blocks:
        if block.keyword in _DEFINITIONS:
            with mesh_errors(file, block):
                _DEFINITIONS[block.keyword](deck, block)
    for block in _used_keywords(file, deck):
        with mesh_errors(file, block):
            for written in block.unread:
                deck.lose(block, f"{written} is not read")
            if deck.steps and block.keyword in _BEFORE_STEPS:
                deck.lose(block, CHANGED_WITHIN)
            elif block.keyword in _READERS:
                _READERS[block.keyword](deck, block)
            elif block.keyword in NOTED:
                deck.note(block, NOTED[block.keyword])
            elif block.keyword not in _READ_ELSEWHERE:
                deck.lose(block, LOST.get(block.keyword, UNKNOWN))
    return deck


def _used_keywords(file: Path, deck: Deck) -> Iterator[DeckBlock]:
    """Yield the keywords, except those of steps that are not static."""
    step: list[DeckBlock] | None = None
    seen = False
    static = False
    kind = ""
    for block in deck.model.blocks:
        if block.keyword == "STEP":
            if step is not None:
                raise MeshError(
                    f"{file}: {block.origin}: the step of {step[0].place} has no *END STEP before "
                    "this one"
                )
            step = []
            seen = True
        if step is None:
            if block.keyword in _OF_STEPS and (seen or block.keyword != "BOUNDARY"):
                raise MeshError(f"{file}: {block.origin}: is expected within a step")
            yield block
            continue
        if block.keyword == "INITIALCONDITIONS":
            raise MeshError(f"{file}: {block.origin}: is expected before the first step")
        step.append(block)
        if block.keyword != "ENDSTEP" and block is not deck.model.blocks[-1]:
            continue
        procedure = next((entry.name for entry in step if entry.keyword in _PROCEDURES), "")
        if not procedure and not kind:
            why = "has no procedure: write *STATIC into it; CalculiX solves nothing in such a step"
            raise MeshError(f"{file}: {step[0].origin}: the step {why}")
        if not procedure:
            deck.note(step[0], f"*{kind}, as in the step before: this one names no procedure")
        kind = procedure or kind
        if kind != "STATIC":
            deck.lose(step[0], f"the step, *{kind}: {_OTHER_PROCEDURE}")
        elif static and "PERTURBATION" in step[0].parameters:
            deck.lose(step[0], f"the step, a perturbation of the one before it: {_OTHER_PROCEDURE}")
        else:
            static = True
            yield from step
        step = None


def _read_surface(deck: Deck, block: DeckBlock) -> None:
    """Read *SURFACE: report faces that are no part of the body; the others have already
    been read.
    """
    name = block.parameters["NAME"]
    if missing := deck.model.undefined.pop(name, 0):
        deck.lose(
            block, f"faces of {name!r} that are not defined, or no part of the body: {missing}"
        )


def _read_heading(deck: Deck, block: DeckBlock) -> None:
    deck.title = ", ".join(block.rows[0]) if block.rows else ""


def _read_element(deck: Deck, block: DeckBlock) -> None:
    """Read *ELEMENT: the hypothesis of plane elements; report elements that are no part of the
    body.
    """
    kind = block.parameters["TYPE"].upper()
    if NO_BODY.match(kind):
        if not POINTS.match(kind):
            deck.lose(block, f"{kind}: {NO_BODY_PART}")
        return
    assumed = next((name for name, pattern in _ASSUMED.items() if re.match(pattern, kind)), "")
    if (
        deck.mesh.dim == 3 or not assumed or kind == "CAX4P"
    ):  # meshio writes any quadrilateral as CAX4P
        return
    if deck.assumed not in ("", assumed):
        deck.lose(
            block,
            f"{kind} beside elements of another kind ({deck.assumed}): all are {assumed} here",
        )
    deck.assumed = assumed
    deck.hypothesis = "" if assumed == "plane strain" else assumed


def _read_step(deck: Deck, block: DeckBlock) -> None:
    deck.steps.append(block.parameters.get("NAME", f"step {len(deck.steps) + 1}"))
    deck.time += deck.period if deck.step else 0.0
    deck.period = 1.0
    if loads.is_finite(block):
        deck.nonlinear = block
    if "PERTURBATION" in block.parameters:
        deck.lose(
            block, "PERTURBATION: contact may open and close here, and does not in such a step"
        )


def _read_static(deck: Deck, block: DeckBlock) -> None:
    rows = block.rows
    deck.period = (
        real(rows[0][1]) if rows and len(rows[0]) > 1 else 0.0
    ) or 1.0  # as both programs take it


def _read_level(deck: Deck, block: DeckBlock) -> None:
    """Read *PART, *ASSEMBLY and similar keywords, which are reported as lost in a file without
    instances.
    """
    if not any(other.keyword == "INSTANCE" for other in deck.model.blocks):
        deck.lose(block, UNKNOWN)


def _read_mass(deck: Deck, block: DeckBlock) -> None:
    """Read *MASS: masses at nodes, which are reported as lost where weight or rotation acts on
    them.
    """
    masses = deck.elements(block.parameters["ELSET"])
    for other in deck.model.blocks:
        for row in other.rows if other.keyword == "DLOAD" else ():
            if not any(_WEIGHT.fullmatch(word) for word in row[:2]):
                continue
            whole = not row[0] or _WEIGHT.fullmatch(row[0])
            if whole or np.isin(masses, deck.elements(row[0])).any():
                deck.lose(block, "masses at nodes, on which weight or rotation acts, are not read")


def _read_amplitude(deck: Deck, block: DeckBlock) -> None:
    deck.amplitudes[block.parameters["NAME"].upper()] = block


# Keywords that may be anywhere in the file, that have been read by then or a scene does not need,
# and that a scene cannot change from step to step.
_DEFINITIONS: dict[str, Reader] = {"AMPLITUDE": _read_amplitude, "PRE-TENSIONSECTION": read_bolt}
_READ_ELSEWHERE = {
    "NODE",
    "NSET",
    "ELSET",
    *_DEFINITIONS,
    "ENDSTEP",
    "SYSTEM",
    "INCLUDE",
    "RESTART",
    *OUTPUT,
}
_BEFORE_STEPS = {
    "DENSITY",
    "ELASTIC",
    "EXPANSION",
    "HYPERELASTIC",
    "PLASTIC",
    "FRICTION",
    "SURFACEBEHAVIOR",
}
_READERS: dict[str, Reader] = {
    "HEADING": _read_heading,
    **dict.fromkeys(LEVELS, _read_level),
    "MASS": _read_mass,
    "ELEMENT": _read_element,
    "SURFACE": _read_surface,
    **dict.fromkeys(("SOLIDSECTION", "SHELLSECTION", "MEMBRANESECTION"), material.read_section),
    "MATERIAL": material.read_material,
    "DENSITY": material.read_density,
    "ELASTIC": material.read_elastic,
    "EXPANSION": material.read_expansion,
    "HYPERELASTIC": material.read_rubber,
    "PLASTIC": material.read_hardening,
    "SURFACEINTERACTION": read_interaction,
    "FRICTION": read_friction,
    "SURFACEBEHAVIOR": read_behaviour,
    "CONTACTPAIR": read_pairs,
    "TIE": read_ties,
    "STEP": _read_step,
    "STATIC": _read_static,
    "BOUNDARY": loads.read_boundary,
    "CLOAD": loads.read_forces,
    "DLOAD": loads.read_body_forces,
    "DSLOAD": loads.read_surface_loads,
    "TEMPERATURE": loads.read_temperatures,
    "INITIALCONDITIONS": loads.read_temperatures,
}


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


def _tables(deck: Deck) -> list[tuple[str, dict[str, Plain]]]:
    """Return all tables of the scene except its mesh."""
    steps = max(1, len(deck.steps))
    element: dict[str, Plain] = {"degree": 2} if deck.mesh.degree == 2 else {}
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


def _load_tables(deck: Deck, steps: int, *, releases: bool) -> list[tuple[str, dict[str, Plain]]]:
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
