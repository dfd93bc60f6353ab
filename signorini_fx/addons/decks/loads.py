"""Supports and loads of an Abaqus input file as those of a scene, on named boundaries.  No dolfinx here."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from signorini_fx.addons.decks.bolts import drive, hold
from signorini_fx.addons.decks.content import Deck, DeckLoad, plain_name
from signorini_fx.addons.decks.couplings import spread
from signorini_fx.addons.decks.keywords import GOES_ON
from signorini_fx.addons.decks.load_areas import read_area_loads
from signorini_fx.addons.decks.nodal import direction, ground
from signorini_fx.mechanics.mesh.files.abaqus_blocks import (
    ROTATIONS,
    DeckBlock,
    DeckError,
    components,
    parameter,
    quoted,
    real,
)
from signorini_fx.mechanics.mesh.files.abaqus_groups import Group
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.cells import completed
from signorini_fx.mechanics.mesh.files.raw import rows_of
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints, nodal_measures
from signorini_fx.tuned import ALIKE_IN_DECK

_AXES = {1: "x", 2: "y", 3: "z"}
_LOADS = ("CLOAD", "DLOAD", "DSLOAD")
_COMPONENTS = {"x": 0, "y": 1, "z": 2}
# More nodes than these that fill no facet are not held one by one.
_POINTS = 12


def read_boundary(deck: Deck, block: DeckBlock) -> None:
    """Prescribed displacements, *BOUNDARY: of sets, and of single nodes that fill whole facets."""
    _forget(deck, block)
    if "FIXED" in block.parameters:
        hold(deck, block)
        return
    kind = block.parameters.get("TYPE", "DISPLACEMENT").upper()
    if kind != "DISPLACEMENT" or block.parameters.keys() & {"SUBMODEL", "USER"}:
        deck.lose(block, "what is prescribed is no displacement that the file gives")
        return
    factor = _share_now(deck, block)
    groups = deck.model.groups.get(block.number, [])
    prescribed: dict[str, dict[int, float]] = {}
    for name, *words in block.rows:
        deck.check_nodes(name)
        if (mover := deck.mover(name)) in deck.distributed:
            deck.lose(block, "what is prescribed at the node of *DISTRIBUTING: give a force there")
        elif mover is not None:
            displacements = components(words)
            for component, value in displacements.items():
                _drive(deck, block, "prescribed", mover, component, value * factor)
            if any(component not in _AXES and component not in ROTATIONS for component in displacements):
                deck.note(block, f"what {name!r} has besides displacements and rotations")
        elif not plain_name(name).isdigit():
            prescribed.setdefault(name, {}).update(components(words))
    nodes: dict[str, tuple[int, ...]] = {}
    for group in groups:
        if body_nodes := tuple(node for node in group.nodes if node not in deck.driven):
            nodes[group.name] = body_nodes
            prescribed.setdefault(group.name, {}).update(components(group.words))
    for name, displacements in prescribed.items():
        if any(component not in _AXES and component not in ROTATIONS for component in displacements):
            deck.note(block, f"what {name!r} has besides displacements and rotations")
        where = deck.boundary(name)
        named = {_AXES.get(component, ""): value * factor for component, value in displacements.items()}
        along = {axis: named[axis] for axis in deck.axes if axis in named}
        if not along:
            continue
        clamped = all(along.get(axis) == 0 for axis in deck.axes)
        held = deck.rows(nodes[name]) if name in nodes else deck.nodes(name)
        if where is not None and len(held) <= _POINTS and np.setdiff1d(deck.held(where), held).size:
            where = None  # facets have nodes in the middle of their sides that stay free
        if not held.size:
            deck.outside(block, f"support of {_shown(name, nodes)}")
        elif not clamped and not deck.turned.keys().isdisjoint(map(int, held)):
            if where is not None and not np.setdiff1d(held, deck.held(where)).size:
                values = {_COMPONENTS[axis]: value for axis, value in along.items()}
                if (turned := _along_the_normal(deck, where, held, values)) is not None:
                    _set_load(deck, DeckLoad("displacement", where, ("normal",), block), turned)
                    _say_what_differs(deck, block, name, held, where)
                    continue
            _hold_singly(deck, block, held, along)
        else:
            alone = held if where is None else np.setdiff1d(held, deck.held(where))
            if len(alone) > _POINTS:
                _hold_singly(deck, block, alone, along)
            for axis, value in along.items():
                lines = _at_points(deck, block, alone)
                for line in [()] * (where is not None) + lines:
                    load = DeckLoad("displacement", "" if line else where or "", (axis,), block, lines=line)
                    _set_load(deck, load, value)
            _say_what_differs(deck, block, name, held, where)


def _hold_singly(deck: Deck, block: DeckBlock, rows: Ints, along: Mapping[str, float]) -> None:
    """Hold components of nodes one by one, in the directions of *TRANSFORM, by stiff links to the ground."""
    for axis, value in along.items():
        for row in plain(rows):
            if not _alone_in_its_body(deck, block, row):
                continue
            vector = ground(deck, block, row, _COMPONENTS[axis] + 1)
            load = DeckLoad("grounded", str(row), (axis,), block, direction=tuple(plain(vector)))
            _set_load(deck, load, value)


def _alone_in_its_body(deck: Deck, block: DeckBlock, row: int) -> bool:
    """Whether a node has its place to itself in its body, so that a scene can name it; it is lost else."""
    others, body = deck.beside(row)
    if body in others:
        deck.lose(block, f"node {deck.number(row)}: its body has another node at the same place")
    return body not in others


def _along_the_normal(deck: Deck, where: str, held: Ints, values: Mapping[int, float]) -> float | None:
    """What turned axes prescribe along the outward normal of a flat boundary; None: something else.

    Args:
        deck: what has been read.
        where: the boundary.
        held: rows of the file of the nodes.
        values: number of an axis, from 0 -> displacement along it.
    """
    if len(values) != 1:
        return None
    ((component, value),) = values.items()
    axes = np.array([direction(deck, int(row), component + 1) for row in held])
    axis, dim = axes[0], deck.mesh.dim
    if np.abs(axes - axis).max() > ALIKE_IN_DECK**2 or np.abs(axis[dim:]).any():
        return None
    nodes = deck.mesh.facets[deck.mesh.boundaries[where]]
    x = deck.mesh.points[np.unique(nodes)]
    size = float(np.linalg.norm(np.ptp(x, axis=0)))
    if (np.abs((x - x[0]) @ axis[:dim]) > ALIKE_IN_DECK**2 * size).any():
        return None
    sides = _outward_sides(deck, where, axis[:dim])
    return float(sides[0]) * value if (sides == sides[0]).all() else None


def _outward_sides(deck: Deck, where: str, axis: Floats) -> Floats:
    """For each facet of a flat boundary whether an axis along its normal leads out of the body, 1, or into it, -1."""
    facets = np.sort(deck.mesh.facet_corners[deck.mesh.boundaries[where]], axis=1)
    sides = deck.mesh.cell.facets
    cell_facets = np.concatenate([deck.mesh.cells[:, list(corners)] for corners in sides])
    middles = deck.mesh.points[deck.mesh.corners].mean(axis=1)
    at = rows_of(cell_facets, facets)
    heights = np.zeros(len(facets))
    for k in range(len(sides)):
        rows = at[k * len(middles) : (k + 1) * len(middles)]
        matching = np.flatnonzero(rows >= 0)
        heights[rows[matching]] = (deck.mesh.points[facets[rows[matching], 0]] - middles[matching]) @ axis
    return np.sign(heights)


def _drive(deck: Deck, block: DeckBlock, kind: str, node: int, component: int, value: float) -> None:
    """What moves a rigid body, at its reference node, or at the node that turns it."""
    if node in deck.bolts:
        share = kept_share(deck, block) if _goes_on(deck, block) else 1.0
        drive(deck, block, kind, node, component, share * value)
        return
    if node in deck.turners:
        node, component = deck.turners[node], component + 3
    name = _AXES.get(component, "")
    if component in ROTATIONS:
        name = f"rotation_{_AXES[component - 3]}" if deck.mesh.dim == 3 else "rotation" if component == 6 else ""
        kind = "moment" if kind == "force" else kind
    if name and (deck.mesh.dim == 3 or name != "z"):
        _set_load(deck, DeckLoad("tool", str(node), (kind, name), block), value)


def _shown(name: str, nodes: Mapping[str, tuple[int, ...]]) -> str:
    """A set, or single nodes, in words."""
    if name not in nodes:
        return repr(name)
    return f"{len(nodes[name])} single nodes" if len(nodes[name]) > 1 else f"node {nodes[name][0]}"


def _at_points(deck: Deck, block: DeckBlock, rows: Ints) -> list[tuple[str, ...]]:
    """Where nodes are, as tables of supports say it, each with its body where another one has a node there; nothing,
    if there are too many.
    """
    points: list[tuple[str, ...]] = []
    for row in rows if len(rows) <= _POINTS else ():
        others, body = deck.beside(int(row))
        if any(other == body for other in others):
            deck.lose(block, f"support of node {deck.number(int(row))}: its body has another node at the same place")
            continue
        points.append((f"at = {deck.position(int(row))}", *([f"region = {quoted(body)}"] if others else [])))
    return points


def _say_what_differs(deck: Deck, block: DeckBlock, name: str, set_nodes: Ints, where: str | None) -> None:
    """Nodes that only the scene holds."""
    held = np.empty(0, np.int64) if where is None else deck.held(where)
    extra = np.setdiff1d(held, set_nodes).size
    if extra:
        deck.lose(block, f"support of {name!r} only at its corners: {extra} more nodes are held here")


def read_surface_loads(deck: Deck, block: DeckBlock) -> None:
    """Tractions and pressures on surfaces, *DSLOAD."""
    _forget(deck, block)
    factor, inside = _share_now(deck, block), 0
    for name, kind, *words in block.rows:
        where = deck.boundary(name)
        if where is None:
            deck.lose(block, f"load on {name!r}, which is no boundary of the body")
        elif kind.upper() == "P":
            _set_load(deck, DeckLoad("traction", where, ("pressure",), block), factor * real(words[0]))
            inside += deck.inside(where)
        elif kind.upper() in ("TRVEC", "TRSHR"):
            if kind.upper() == "TRSHR":
                deck.note(block, f"TRSHR on {name!r}: taken along its vector, which must lie in the surface")
            direction = _unit([real(word) for word in words[1:]])[: deck.mesh.dim]
            load = DeckLoad("traction", where, tuple(deck.axes), block, direction)
            _set_load(deck, load, factor * real(words[0]))
        else:
            deck.lose(block, f"load of type {kind}")
    _say_inside(deck, block, inside)


def _say_inside(deck: Deck, block: DeckBlock, faces: int) -> None:
    if faces:
        deck.lose(block, f"pressure on faces inside the body: {faces}")


def read_body_forces(deck: Deck, block: DeckBlock) -> None:
    """Pressures on faces of elements, and forces in the whole body, *DLOAD."""
    _forget(deck, block)
    factor, inside = _share_now(deck, block), 0
    for group in deck.model.groups.get(block.number, []):
        if (where := deck.boundary(group.name)) is None:
            inside += len(group.values)
        else:
            load = DeckLoad("traction", where, ("pressure",), block)
            _set_load(deck, load, factor * group.values[0])
            inside += deck.inside(where)
    _say_inside(deck, block, inside)
    on_areas = read_area_loads(deck, block, kept_share(deck, block))
    whole, done = _on_the_whole_body(deck, block), set[tuple[str, ...]]()
    for row in (row for number, row in enumerate(block.rows) if number not in on_areas):
        if (at := _kind_of_body_force(row)) is None:
            deck.lose(block, f"load {', '.join(row)}")
            continue
        kind, words = row[at].upper(), [real(word) for word in row[at + 1 :]]
        everywhere = at == 0 or not any(row[:at]) or tuple(row[at:]) in whole
        if kind.startswith("P") or (at and everywhere and tuple(row[at:]) in done):
            continue
        done.add(tuple(row[at:]))
        if not everywhere:
            deck.lose(block, f"{kind} on {row[0]!r}, a part of the body")
        elif kind.startswith("B"):
            _set_load(deck, DeckLoad("body_force", "", (kind[1].lower(),), block), factor * words[0])
        elif not deck.materials or any("density" not in properties for properties in deck.materials.values()):
            deck.lose(block, f"{kind}: a material has no *DENSITY")
        elif kind == "GRAV":
            direction = _unit(words[1:])[: deck.mesh.dim]
            load = DeckLoad("gravity", "", tuple(deck.axes), block, direction)
            _set_load(deck, load, factor * words[0])
        else:
            about, axis = words[1:4], words[4:7]
            lines = [f"about = {about[: deck.mesh.dim]}"]
            if deck.mesh.dim == 3 or any(axis[:2]):
                lines.append(f"axis = {axis[: deck.mesh.dim]}")
            _set_load(deck, DeckLoad("rotation", "", ("speed",), block, lines=tuple(lines)), factor * words[0])


def _kind_of_body_force(row: list[str]) -> int | None:
    """Where in a row of *DLOAD the kind of the load stands; None: it is not known."""
    return next((k for k, word in enumerate(row) if re.fullmatch(r"GRAV|CENTRIF|B[XYZ]|P\d", word.upper())), None)


def _on_the_whole_body(deck: Deck, block: DeckBlock) -> set[tuple[str, ...]]:
    """Loads, without their sets, whose sets are the whole body together."""
    parts: dict[tuple[str, ...], list[Ints]] = {}
    for row in block.rows:
        if (at := _kind_of_body_force(row)) and (region := deck.region(row[0])) is not None:
            parts.setdefault(tuple(row[at:]), []).append(deck.mesh.regions[region])
    return {load for load, cells in parts.items() if len(np.unique(np.concatenate(cells))) == len(deck.mesh.cells)}


def read_forces(deck: Deck, block: DeckBlock) -> None:
    """Forces at nodes: on whole facets a traction, if they are those of a uniform one, or evenly, if all are the same
    and have the moment of their sum; else one by one.
    """
    _forget(deck, block)
    factor = _share_now(deck, block)
    drives: dict[tuple[int, int], float] = {}
    for name, *words in block.rows:
        if (mover := deck.mover(name)) is not None:  # several forces at a node in one block add up
            key = (mover, int(words[0]))
            drives[key] = drives.get(key, 0.0) + factor * real((*words, "0")[1])
    spread_over: dict[int, Floats] = {}
    for (mover, component), value in drives.items():
        if mover in deck.distributed and 1 <= component <= 6:
            spread_over.setdefault(mover, np.zeros(6))[component - 1] += value
        else:
            _drive(deck, block, "force", mover, component, value)
    thickness = deck.thickness if deck.mesh.dim == 2 and deck.kinematics.uniform else 1.0
    for node, both in spread_over.items():
        for load in spread(deck, block, node, both[:3], both[3:]):
            (share,) = load.values.values()
            _set_load(deck, replace(load, values={}), (share or 0.0) / thickness)
    for group in map(deck.without_rigid, deck.model.groups.get(block.number, [])):
        if not group.nodes:
            continue
        component = int(group.words[0])
        axis, total = _AXES.get(component, ""), factor * sum(group.values)
        if not axis:
            deck.lose(block, "moments at nodes")
            continue
        rows = deck.rows(group.nodes)
        if len(rows) < len(group.nodes):
            missing = [node for node in group.nodes if not deck.rows([node]).size]
            deck.outside(block, f"force at {f'node {missing[0]}' if len(missing) == 1 else f'{len(missing)} nodes'}")
        if not rows.size or (axis not in deck.axes and deck.turned.keys().isdisjoint(map(int, rows))):
            continue
        single_forces = component in deck.given_singly or not deck.kinematics.uniform
        if not single_forces and (uniform := _uniform(deck, group)) is not None:
            load = DeckLoad("traction", uniform[0], (axis,), block)
            _set_load(deck, load, factor * uniform[1])
            continue
        total = 0.0 if abs(total) < ALIKE_IN_DECK**2 * abs(factor) * sum(map(abs, group.values)) else total
        where = deck.boundary(group.name)
        turned = not deck.turned.keys().isdisjoint(map(int, rows))
        evenly = (
            not single_forces
            and not deck.at_nodes
            and where is not None
            and not turned
            and total
            and len(rows) == len(group.nodes)
        )
        if evenly and where is not None and _like_an_even_one(deck, group, where, axis):
            _set_load(deck, DeckLoad("force", where, (axis,), block), total / deck.thickness)
            deck.note(block, f"forces at nodes, {total:g} along {axis} in all ({len(rows)} nodes): on {where!r} evenly")
            continue
        _push_singly(deck, block, group, factor)


def _push_singly(deck: Deck, block: DeckBlock, group: Group, factor: float) -> None:
    """Forces at the nodes of a group, one by one, in the directions of *TRANSFORM."""
    component = int(group.words[0])
    share = deck.thickness if deck.mesh.dim == 2 and deck.kinematics.uniform else 1.0
    for node, value in zip(group.nodes, group.values, strict=True):
        for row in plain(deck.rows([node])):
            if not _alone_in_its_body(deck, block, row):
                continue
            vector = tuple(plain(direction(deck, row, component)))
            load = DeckLoad("point_force", str(deck.node(row)), (_AXES[component],), block, direction=vector)
            _set_load(deck, load, factor * value / share)


def _uniform(deck: Deck, group: Group) -> tuple[str, float] | None:
    """The boundary and the traction, stress, that forces at nodes are equivalent to; None: they are not."""
    where, rows = deck.boundary(group.name), deck.rows(group.nodes)
    if where is None or not deck.kinematics.uniform or not deck.turned.keys().isdisjoint(map(int, rows)):
        return None
    if len(rows) < len(group.nodes) or not np.isin(rows, deck.held(where)).all():
        return None
    areas = _areas(deck, where)
    forces = np.zeros(len(areas))
    forces[np.searchsorted(deck.numbers, rows)] = group.values
    value = float(forces.sum() / areas.sum())
    if np.abs(forces - value * areas).max() > ALIKE_IN_DECK * np.abs(forces).max():
        return None
    return where, value / deck.thickness


def _areas(deck: Deck, where: str) -> Floats:
    """The share of each node of the mesh in the area (in the plane: length) of a boundary."""
    facets = deck.mesh.facets[deck.mesh.boundaries[where]]
    shares = nodal_measures(deck.mesh.points, facets, deck.mesh.facet)
    if deck.mesh.completed and deck.mesh.dim == 3 and (full_cell := completed("quad8")) is not None:
        facets, shares = facets[:, :-1], shares @ full_cell[1]
    return np.bincount(facets.ravel(), shares.ravel(), minlength=len(deck.mesh.points)).astype(np.float64)


def _like_an_even_one(deck: Deck, group: Group, where: str, axis: str) -> bool:
    """Whether forces at nodes along an axis are all the same, and have the moment of an even traction on a boundary."""
    areas, values = _areas(deck, where), np.array(group.values)
    if np.ptp(values) > ALIKE_IN_DECK * np.abs(values).max():
        return False
    at = [deck.position(deck.model.places[node]) for node in group.nodes]
    apart = values @ np.array(at) / values.sum() - areas @ deck.mesh.points / areas.sum()
    apart[deck.axes.index(axis)] = 0.0
    size = np.linalg.norm(np.ptp(deck.mesh.points[areas != 0], axis=0))
    return bool(np.linalg.norm(apart) <= ALIKE_IN_DECK * size)


def _unit(vector: list[float]) -> tuple[float, ...]:
    size = math.hypot(*vector)
    if not size > 0:
        raise ValueError("a direction is expected")
    return tuple(value / size for value in vector)


def share_of(deck: Deck, block: DeckBlock) -> float:
    """The share of the values of a load that acts at the end of the step, by its amplitude."""
    return _share_between(deck, block, deck.time, deck.time + deck.period)


def kept_share(deck: Deck, block: DeckBlock) -> float:
    """The same of what does not follow its amplitude in later steps; where that matters, the draft says so."""
    deck.kept.append((deck.step, block))
    return share_of(deck, block)


def _goes_on(deck: Deck, block: DeckBlock) -> bool:
    """Whether a load follows its amplitude in later steps too, in which it need not be given again.

    That is so where the times of the amplitude are total times.  With times of the step, a load keeps what it has
    reached: CalculiX 2.20 does so, and Abaqus.
    """
    amplitude = deck.amplitudes.get(block.parameters.get("AMPLITUDE", "").upper())
    return amplitude is not None and "TIME" in amplitude.parameters


def _share_now(deck: Deck, block: DeckBlock) -> float:
    """The share that acts at the end of the step; 1 where ``_set_load`` applies the amplitude, as it goes on."""
    return 1.0 if _goes_on(deck, block) else share_of(deck, block)


def follow_amplitudes(deck: Deck) -> None:
    """Give loads whose amplitude goes on their values in the steps that give them no others."""
    for load in deck.loads.values():
        for step, parts in load.parts.items():
            if not any(_goes_on(deck, block) for block, _ in parts):
                continue
            end = deck.ends.get(step, step + 1.0)
            following = min((later for later in load.values if later > step), default=len(deck.steps))
            for later in range(step + 1, following):
                begin, end = end, deck.ends.get(later, end + 1.0)
                load.values[later] = sum(
                    value * (_share_between(deck, block, begin, end) if _goes_on(deck, block) else 1.0)
                    for block, value in parts
                )
    for step, block in deck.kept:
        following = min((later for later, _ in deck.kept if later > step), default=len(deck.steps))
        ends = [deck.ends.get(at, at + 1.0) for at in range(step, following)]
        shares = {_share_between(deck, block, end, end) for end in ends if _goes_on(deck, block)}
        if len(shares) > 1:
            deck.lose(block, GOES_ON)


def _share_between(deck: Deck, block: DeckBlock, begin: float, end: float) -> float:
    """The share of the values of a load that acts at the end of a step, by its amplitude.

    Args:
        deck: the deck.
        block: the load.
        begin: the total time at which the step begins.
        end: likewise, at which it ends.
    """
    if (name := block.parameters.get("AMPLITUDE")) is None:
        return 1.0
    amplitude = deck.amplitudes.get(name.upper())
    if (
        amplitude is None
        or not amplitude.rows
        or amplitude.parameters.get("DEFINITION", "TABULAR").upper() not in ("TABULAR", "SMOOTHSTEP")
    ):
        deck.lose(block, f"the amplitude {name!r}: the whole load is taken")
        return 1.0
    given_times, values = _course_of(amplitude)
    if not _goes_on(deck, block):
        begin, end = 0.0, end - begin
    times = given_times + (parameter(block, "TIMEDELAY") if "TIMEDELAY" in block.parameters else 0.0)
    if np.count_nonzero(times == end) > 1:
        deck.lose(block, f"the amplitude {name!r} jumps at the end of the step: its value after it is taken")
    within = values[(times > begin) & (times < end)]
    share = float(np.interp(end, times, values))
    course = np.diff([float(np.interp(begin, times, values)), *within, share])
    if (course > 0).any() and (course < 0).any():
        deck.lose(block, f"the amplitude {name!r} within the step: its value at the end is taken")
    return share


def _course_of(amplitude: DeckBlock) -> tuple[Floats, Floats]:
    """The times and values of an amplitude.

    Raises:
        DeckError: they are no pairs of numbers, or a time is before the one in front of it.
    """
    try:
        words = np.array([real(word) for row in amplitude.rows for word in row])
    except ValueError as error:
        raise DeckError(amplitude, str(error)) from None
    if words.size % 2:
        raise DeckError(amplitude, "pairs of a time and a value are expected")
    times, values = words[0::2], words[1::2]
    back = np.flatnonzero(np.diff(times) < 0)
    if back.size:
        raise DeckError(amplitude, f"its times go back, from {times[back[0]]:g} to {times[back[0] + 1]:g}")
    return times, values


def _set_load(deck: Deck, load: DeckLoad, value: float) -> None:
    """Loads that a step gives several times add up; what earlier steps gave is replaced, as are displacements."""
    key = (load.table, load.target, load.keys, load.direction, load.keyword, load.lines)
    load_of_key, block = deck.loads.setdefault(key, load), load.block
    adds_up = load.keyword in _LOADS
    parts = load_of_key.parts.get(deck.step, []) if adds_up else []
    load_of_key.parts[deck.step] = [*parts, (block, value)]
    share = share_of(deck, block) if _goes_on(deck, block) else 1.0
    earlier = load_of_key.values.get(deck.step) if adds_up else None
    load_of_key.values[deck.step] = share * value + (earlier or 0.0)


def _forget(deck: Deck, block: DeckBlock) -> None:
    """With OP=NEW, what steps have given so far by a keyword ends with this one."""
    if block.parameters.get("OP", "MOD").upper() != "NEW" or (deck.step, block.keyword) in deck.ended:
        return
    deck.ended.add((deck.step, block.keyword))
    for load in deck.loads.values():
        if load.keyword == block.keyword:
            load.values[deck.step] = None
            load.parts.pop(deck.step, None)
