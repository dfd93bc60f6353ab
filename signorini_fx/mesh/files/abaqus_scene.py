"""The draft of a scene from an Abaqus input file.  No dolfinx here."""

from __future__ import annotations

import json
import math
import os
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.errors import MeshError
from signorini_fx.mesh.files.abaqus_blocks import real
from signorini_fx.mesh.files.abaqus_bolts import preload_tables
from signorini_fx.mesh.files.abaqus_content import Deck, Load, plain_name
from signorini_fx.mesh.files.abaqus_deck import read_deck
from signorini_fx.mesh.files.abaqus_temperatures import temperature_changes
from signorini_fx.mesh.files.abaqus_tools import tool_keys
from signorini_fx.mesh.files.arrays import MeshArrays
from signorini_fx.mesh.files.shape import Floats, Ints

_FLAT = 1e-6  # of its size: a rigid surface that deviates by less from a plane is one

_PIECES = 64  # straight ones that an arc of a rigid surface becomes


def draft(file: Path, mesh: MeshArrays, target: Path) -> tuple[str, list[str], dict[Path, str]]:
    """A scene file, what it leaves out of the deck, and the files beside it that it refers to with their text.

    Args:
        file: the input file.
        mesh: what was read from it.
        target: where the scene will be, from which it refers to the file.

    Raises:
        MeshError: a number is none, or a line has too few of them.
    """
    deck = read_deck(file, mesh)
    files: dict[Path, str] = {}
    try:
        return _written(deck, file, target, files), deck.left_out, files
    except (ValueError, IndexError) as error:
        raise MeshError(f"{file}: a rigid surface: {error}") from None


def _written(deck: Deck, file: Path, target: Path, files: dict[Path, str]) -> str:
    steps = max(1, len(deck.steps))
    tables = [("[element]", ["degree = 2"])] if deck.mesh.degree == 2 else []
    heat = _heat(deck, steps, target, files)
    tables += [*_materials(deck, bool(heat)), *_tables(deck, steps), *heat]
    tables += [("[[preload]]", lines) for lines in preload_tables(deck, steps)]
    tables += [("[[contact]]", lines) for lines in _contacts(deck, steps)]
    every = [line for _, lines in tables for line in lines]
    timed = any(line.startswith("foundation") and " if t < " in line for line in every)
    if timed or any(line.startswith("factors") for line in every):  # else all steps are the same
        times = [f"times = {[float(step) for step in range(1, steps + 1)]}"] if timed else []
        tables.append(("[load_steps]", [f"names = [{', '.join(map(_quoted, deck.steps))}]", *times]))
    lines = [f"# A draft from {file.name}: read it, and complete what it leaves out."]
    lines += [f"# Left out: {one}" for one in deck.left_out]
    lines += [f"title = {_quoted(deck.title or file.stem)}", "", "[mesh]"]
    lines += [f"file = {_quoted(os.path.relpath(file, target.parent))}"]
    for heading, own in tables:
        lines += ["", heading, *own]
    return "\n".join(lines) + "\n"


def _heat(deck: Deck, steps: int, target: Path, files: dict[Path, str]) -> list[tuple[str, list[str]]]:
    """Changes of the temperature; one that is not the same everywhere becomes a file beside the scene."""
    found = []
    for value, field, factors in temperature_changes(deck, steps):
        lines = [f"change = {value!r}"]
        if value is None:
            beside = target.with_name(f"{target.stem}_temperature_{len(files) + 1}.csv")
            rows = np.column_stack((deck.mesh.points[: len(field)], field))
            written = (",".join(repr(float(one)) for one in row) for row in rows)
            files[beside] = "\n".join([f"{','.join(deck.axes)},change", *written])
            lines = [f"file = {_quoted(beside.name)}"]
        found.append(("[[temperature]]", lines + ([f"factors = {factors}"] if set(factors) != {1.0} else [])))
    return found


def _materials(deck: Deck, heated: bool) -> list[tuple[str, list[str]]]:
    hypothesis = [f"hypothesis = {_quoted(deck.hypothesis)}"] if deck.hypothesis else []
    weighs = any(load.table in ("gravity", "rotation") for load in deck.loads.values())
    used = [(deck.region(region), deck.materials.get(name, {}), name) for region, name in deck.sections]
    known: list[tuple[str | None, dict[str, float]]] = [(region, own) for region, own, _ in used if "young" in own]
    for region, own, name in used:
        if "young" not in own:
            deck.leave_out(None, f"material {name!r}" + (f" of {region!r}" if region else "") + ": it has no *ELASTIC")
    if not known:
        known += [(None, own) for own in deck.materials.values() if "young" in own][:1]
    if not known:
        deck.leave_out(None, "the material: there is none with *ELASTIC, and steel in mm and MPa stands in its place")
        known += [(None, {"young": 210000.0, "poisson": 0.3})]
    keys = ("young", "poisson") + ("density",) * weighs + ("expansion",) * heated
    if heated:  # without *EXPANSION a material does not expand
        known = [(region, {"expansion": 0.0, **own}) for region, own in known]
    alike = len({tuple(own.get(key) for key in keys) for _, own in known}) == 1
    shown = known[:1] if alike else known
    several = len(shown) > 1
    return [
        (
            "[[material]]" if several else "[material]",
            [
                *([f"region = {_quoted(region or '')}"] if several else []),
                *(f"{key} = {own[key]!r}" for key in keys if key in own),
                *hypothesis,
            ],
        )
        for region, own in shown
    ]


def _tables(deck: Deck, steps: int) -> list[tuple[str, list[str]]]:
    """Supports and loads; those of a boundary that have the same course over the steps share a table."""
    merged: dict[tuple[Any, ...], dict[str, float]] = {}
    for load in deck.loads.values():
        if load.table in ("tool", "preload"):
            continue
        values = _courses(deck, load, steps)
        largest = max(values, key=abs)
        if largest == 0 and load.table != "displacement":
            continue
        factors = tuple(value / largest for value in values) if largest else ()
        own = {key: share * largest for key, share in zip(load.keys, load.direction, strict=False) if share}
        if load.table == "rotation":  # its factors multiply the force
            own = {"speed": math.sqrt(largest)}
        where = (load.table, load.target, load.lines, () if set(factors) <= {1.0} else factors)
        # Two loads with the same component are two entries, which add up.
        entry = next(n for n in count() if not own.keys() & merged.get((*where, n), {}).keys())
        merged.setdefault((*where, entry), {}).update(own)
    found, weights = [], 0
    for (table, target, more, course, _), own in merged.items():
        weights += table == "body_force"
        if table == "body_force" and weights > 1:
            deck.leave_out(None, "several body forces: a scene has one, the first is taken")
            continue
        lines = [f"boundary = {_quoted(target)}"] if target else []
        lines += more
        lines += [f"{key} = {value!r}" for key, value in own.items()]
        lines += [f"factors = {list(course)}"] if course else []
        found.append((f"[{table}]" if table == "body_force" else f"[[{table}]]", lines))
    return found


def _courses(deck: Deck, load: Load, steps: int) -> list[float]:
    """The values of a load in the steps, and a word on supports that are not there in all of them."""
    values = load.by_step(steps)
    if (
        (load.table == "displacement" or load.keys[0] == "prescribed")
        and None in values
        and any(value is not None for value in values)
    ):
        free = ", ".join(name for name, value in zip(deck.steps, values, strict=False) if value is None)
        where = repr(load.target) if load.target else load.lines[0]
        where = f"rigid body of node {load.target}" if load.table == "tool" else where
        deck.leave_out(None, f"{where} is free along {load.keys[-1]} in {free}: here it is held there")
    return [value or 0.0 for value in values]


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _contacts(deck: Deck, steps: int) -> list[list[str]]:
    """The lines of each [[contact]]."""
    found: list[list[str]] = []
    taken: dict[str, Ints] = {}
    drives = _drives(deck, steps)
    used = set()
    for name, node in deck.coupled:
        where = str(deck.boundary(name))
        if np.setdiff1d(deck.nodes(name), deck.held(where)).size:
            deck.leave_out(None, f"rigid coupling of {name!r}: not all of its nodes are on whole facets of the body")
        used.add(node)
        taken[where] = deck.mesh.boundaries[where]
        keys = tool_keys(deck, node, drives.get(node, {}), always=True)
        pivot = deck.model.raw.points[deck.model.places[node]][: deck.mesh.dim].tolist()
        normal = [0.0] * (deck.mesh.dim - 1) + [1.0]  # a bond holds in all directions, whichever this is
        shape = f'shape = "plane", point = {pivot}, normal = {normal}'
        found.append([f"boundary = {_quoted(where)}", 'kind = "bonded"', f"foundation = {{ {shape}, {keys} }}"])
    every = [(*names, None) for names in deck.ties] + deck.pairs
    for one, other, interaction in every:
        tie = interaction is None or interaction in deck.tied
        said = f"{'tie' if tie else 'contact'} of {one!r} with {other!r}"
        names = [name for name in (one, other) if plain_name(name) in deck.rigid]
        sides = {name: deck.boundary(name) for name in (one, other) if name not in names}
        missing = [name for name, where in sides.items() if where is None]
        own = [where for where in sides.values() if where is not None]
        rows = {where: deck.mesh.boundaries[where] for where in own}
        shared = [where for where in own if any(np.intersect1d(rows[where], there).size for there in taken.values())]
        if len(names) == 2 or one == other:
            deck.leave_out(None, f"{said}: " + ("both are rigid" if names else "a surface with itself"))
        elif missing:
            deck.leave_out(None, f"{said}: {missing[0]!r} is no boundary of the body")
        elif shared:
            deck.leave_out(None, f"{said}: facets of {shared[0]!r} are in another contact, and have one only")
        else:
            mover = deck.movers.get(plain_name(names[0])) if names else None
            keys = "" if mover is None else tool_keys(deck, mover, drives.get(mover, {}))
            if tie and names and not keys:
                deck.leave_out(None, f"{said}: {names[0]!r} is rigid; give displacements instead")
                continue
            used |= set() if mover is None else {mover}
            taken |= rows
            lines = [f"boundary = {_quoted(own[0])}"]
            lines += _gap(deck, own[0], names[0], keys) if names else [f"against = {_quoted(own[1])}"]
            found.append([*lines, 'kind = "bonded"'] if tie else [*lines, *_friction(deck, said, interaction or "")])
    for node in sorted(drives.keys() - used):
        if tool_keys(deck, node, drives[node]):
            deck.leave_out(None, f"what moves the rigid body of node {node}: no contact with it is in the scene")
    return found


def _drives(deck: Deck, steps: int) -> dict[int, dict[tuple[str, ...], list[float]]]:
    """What moves rigid bodies in the steps, by the number of their reference nodes; see ``tool_keys``."""
    found: dict[int, dict[tuple[str, ...], list[float]]] = {}
    for load in deck.loads.values():
        if load.table == "tool":
            found.setdefault(int(load.target), {})[load.keys] = _courses(deck, load, steps)
    return found


def _friction(deck: Deck, said: str, interaction: str) -> list[str]:
    own = deck.frictions.get(interaction, {})
    if interaction in deck.rough:
        deck.leave_out(None, f"{said}: rough friction, which never slides: give a coefficient")
    elif own.get("coefficient"):
        cap = f", cap = {own['cap']!r}" if "cap" in own else ""
        return [f'friction = {{ law = "coulomb", coefficient = {own["coefficient"]!r}{cap} }}']
    return []


def _gap(deck: Deck, where: str, rigid: str, tool: str) -> list[str]:
    """A rigid surface: the distance to a plane one as a formula, and one of lines and arcs as a polyline.

    Args:
        deck: what has been read.
        where: the boundary of the body.
        rigid: the surface.
        tool: keys of what drives it, see ``tool_keys``; empty: it stays where it is.
    """
    driven = f", {tool}" if tool else ""
    points = _points_of_surface(deck, plain_name(rigid))
    body = deck.mesh.points[np.unique(deck.mesh.facet_corners[deck.mesh.boundaries[where]])]
    plane = None if points is None else _plane(points[:, : deck.mesh.dim])
    if plane is None and points is not None and plain_name(rigid) in deck.drawn:
        if len(points) > len(deck.drawn[plain_name(rigid)]):
            deck.leave_out(None, f"arcs of the rigid surface {rigid!r}: polygons of {_PIECES} sides each")
        shape = f'shape = "polyline", points = {_with_left(points, body.mean(axis=0)).tolist()}'
        return [f"foundation = {{ {shape}{driven} }}"]
    if plane is None:
        deck.leave_out(None, f"shape of the rigid surface {rigid!r}: write the gap to it as an expression")
        if tool:
            deck.leave_out(None, f"what moves the rigid surface {rigid!r}: {tool}")
        return ["gap = 0.0  # the distance to the foundation, which is not known here"]
    middle, normal = plane
    side = float(np.mean(body, axis=0) @ normal - middle @ normal)
    toward = -normal if side > 0 else normal
    if abs(side) <= _FLAT * float(np.ptp(deck.mesh.points, axis=0).max()):
        toward = _outwards(deck, where, normal)
    if tool:
        shape = f'shape = "plane", point = {middle.tolist()}, normal = {(-toward + 0.0).tolist()}'
        return [f"foundation = {{ {shape}{driven} }}"]
    at, toward = float(middle @ toward), toward + 0.0  # without negative zeros
    terms = "".join(
        f" {'-' if share > 0 else '+'} {'' if abs(share) == 1 else f'{abs(share)!r}*'}x[{k}]"
        for k, share in enumerate(map(float, toward))
        if share
    )
    distance = f"{at!r}{terms}" if at else terms.removeprefix(" + ").lstrip()
    return [f'gap = "{distance}"', f"direction = {toward.tolist()}"]


def _outwards(deck: Deck, where: str, normal: Floats) -> Floats:
    """The direction of a plane's normal that leads out of the body at a boundary that lies in it."""
    inside = deck.mesh.points.mean(axis=0)
    there = deck.mesh.points[np.unique(deck.mesh.facet_corners[deck.mesh.boundaries[where]])].mean(axis=0)
    return normal if (there - inside) @ normal > 0 else -normal


def _points_of_surface(deck: Deck, name: str) -> Floats | None:
    """Points of a rigid surface that consists of elements, or in the plane of lines and arcs, which are in order."""
    if (rows := deck.drawn.get(name)) is not None:
        return None if deck.mesh.dim == 3 else _walked(rows)
    own = {name, *deck.parts.get(name, ())}
    nodes = [
        block[rows].ravel()
        for label, members in deck.model.raw.sets.items()
        if label.upper() in own
        for (_, block), rows in zip(deck.model.raw.blocks, members, strict=True)
    ]
    return np.asarray(deck.model.raw.points, dtype=np.float64)[np.unique(np.concatenate(nodes))] if nodes else None


def _walked(rows: list[list[str]]) -> Floats | None:
    """Points along START, LINE and CIRCL of a rigid surface; None: it has other pieces."""
    found: list[Floats] = []
    for kind, *words in rows:
        end = np.array([real(word) for word in words[:2]])
        if kind.upper() == "CIRCL":
            centre = np.array([real(word) for word in words[2:4]])
            (x, y), radius = found[-1] - centre, float(np.hypot(*(end - centre)))
            first, last = np.arctan2(y, x), np.arctan2(*(end - centre)[::-1])
            turn = (last - first + np.pi) % (2 * np.pi) - np.pi  # an arc is less than half a circle
            angles = first + turn * np.arange(1, _PIECES) / _PIECES
            found += list(centre + radius * np.column_stack((np.cos(angles), np.sin(angles))))
        elif kind.upper() not in ("START", "LINE"):
            return None
        found.append(end)
    return np.array(found)


def _with_left(points: Floats, place: Floats) -> Floats:
    """The points in the order in which a place is on the left of the nearest piece."""
    ahead = np.diff(points, axis=0)
    share = np.clip(((place - points[:-1]) * ahead).sum(axis=1) / (ahead**2).sum(axis=1), 0.0, 1.0)
    near = int(np.argmin(np.linalg.norm(points[:-1] + share[:, None] * ahead - place, axis=1)))
    (along, across), (x, y) = ahead[near], place - points[near]
    return points if along * y - across * x > 0 else points[::-1]


def _plane(points: Floats) -> tuple[Floats, Floats] | None:
    """A point and the unit normal of the plane (in the plane: of the line) through points; None: there is none."""
    middle = points.mean(axis=0)
    _, sizes, axes = np.linalg.svd(points - middle)
    if len(points) < points.shape[1] or sizes[-2] <= _FLAT * sizes[0] or sizes[-1] > _FLAT * sizes[0]:
        return None
    normal = np.where(np.abs(axes[-1]) < 1e-12, 0.0, axes[-1])
    return middle, np.asarray(normal / np.linalg.norm(normal))
