"""Supports, loads and temperatures of an Abaqus input file as those of a scene.

*PRE-TENSION SECTION of an Abaqus or CalculiX input file, as the preload of a scene.

Its reference node has one component: *CLOAD gives the tension through the section, *BOUNDARY the
shortening; with FIXED it keeps the shortening that has been reached.
"""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

from signorini_fx.addons.decks.content import Deck, DeckLoad, Place
from signorini_fx.addons.decks.mesh import Group
from signorini_fx.addons.decks.text import (
    NO_BODY_PART,
    ROTATIONS,
    UNKNOWN,
    WITHOUT_EFFECT,
    DeckBlock,
    DeckError,
    components,
    factors_of,
    number_of,
    origins_of,
    parameter,
    real,
)
from signorini_fx.arrays import Array, Ints
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.cells import completed, dimension, nodal_measures
from signorini_fx.tuned import DIGITS_OF_FILES, NEGLIGIBLE, ZERO_IN_SOLUTION

_AXES = {1: "x", 2: "y", 3: "z"}
_NODES_DIFFER = "temperatures that differ within a body are not read"
_LOADS = ("CLOAD", "DLOAD", "DSLOAD")
_NOWHERE = np.empty(0, dtype=np.int64)
_BODY_FORCE = re.compile(r"GRAV|CENTRIF|B[XYZ]|P\d", re.IGNORECASE)


def read_boundary(deck: Deck, block: DeckBlock) -> None:
    """Read *BOUNDARY: displacements of sets and of single nodes, as supports of whole facets, and
    of single nodes that fill no facet.
    """
    _end_earlier(deck, block)
    if "FIXED" in block.parameters:
        hold_bolt(deck, block)
        return
    kind = block.word("TYPE", "DISPLACEMENT")
    if kind != "DISPLACEMENT" or block.parameters.keys() & {"SUBMODEL", "USER"}:
        deck.lose(block, "the file gives no value for the prescribed displacement")
        return
    factor = amplitude_share(deck, block)
    prescribed: dict[str, dict[int, float]] = {}
    for name, *words in block.rows:
        deck.check_nodes(name)
        if (reference_node := deck.reference_node(name)) is not None:
            for component, value in components(words).items():
                drive_bolt(deck, block, "prescribed", reference_node, component, value * factor)
        elif number_of(name) is None:
            prescribed.setdefault(name, {}).update(components(words))
    nodes: dict[str, tuple[int, ...]] = {}
    for group in deck.model.groups.get(block.number, []):
        if body_nodes := tuple(node for node in group.nodes if node not in deck.bolts):
            nodes[group.name] = body_nodes
            prescribed.setdefault(group.name, {}).update(components(group.words))
    for name, displacements in prescribed.items():
        if any(
            component not in _AXES and component not in ROTATIONS for component in displacements
        ):
            deck.note(block, f"what {name!r} has besides displacements and rotations")
        named = {
            _AXES.get(component, ""): value * factor for component, value in displacements.items()
        }
        along = {axis: named[axis] for axis in deck.axes if axis in named}
        held = deck.rows(nodes[name]) if name in nodes else deck.nodes(name)
        if along and not held.size:
            many = (
                "single nodes"
                if len(nodes.get(name, ())) > 1
                else f"node {nodes.get(name, ('',))[0]}"
            )
            deck.note(block, f"support of {many if name in nodes else repr(name)}: {NO_BODY_PART}")
        where = deck.boundary(name)
        if where is not None and np.setdiff1d(deck.boundary_nodes(where), held).size:
            where = None  # facets have nodes in the middle of their sides that stay free
        places: list[tuple[str, Place]] = [] if where is None else [(where, ())]
        alone = held if where is None else np.setdiff1d(held, deck.boundary_nodes(where))
        places += [("", deck.at_point(row)) for row in plain(alone)]
        for axis, value in along.items():
            for target, place in places:
                _set_load(
                    deck, DeckLoad("displacement", target, (axis,), block, place=place), value
                )


def read_surface_loads(deck: Deck, block: DeckBlock) -> None:
    """Read *DSLOAD: tractions and pressures on surfaces."""
    _end_earlier(deck, block)
    factor = amplitude_share(deck, block)
    for name, kind, *words in block.rows:
        where = deck.boundary(name)
        if where is None:
            deck.lose(block, f"load on {name!r}, which is no boundary of the body")
        elif kind.upper() == "P":
            _press(deck, block, where, factor * real(words[0]))
        elif kind.upper() in ("TRVEC", "TRSHR"):
            if kind.upper() == "TRSHR":
                deck.note(
                    block,
                    f"TRSHR on {name!r}: taken along its vector, which must lie in the surface",
                )
            direction = _unit([real(word) for word in words[1:]])[: deck.mesh.dim]
            load = DeckLoad("traction", where, tuple(deck.axes), block, direction)
            _set_load(deck, load, factor * real(words[0]))
            if _turns_with_the_body(deck, block):
                deck.lose(
                    block, f"{kind} on {name!r} with NLGEOM: its direction and area are fixed"
                )
        else:
            deck.lose(block, f"load of type {kind}")


def _turns_with_the_body(deck: Deck, block: DeckBlock) -> bool:
    """Return whether finite strains change the direction or the area of a traction."""
    fixed = {"FOLLOWER": "NO", "CONSTANTRESULTANT": "YES"}
    given = {key: block.word(key) for key in fixed}
    return given != fixed and any(is_finite(other) for other in deck.model.blocks)


def is_finite(block: DeckBlock) -> bool:
    """Return whether a keyword is a step with finite strains."""
    return block.keyword == "STEP" and block.word("NLGEOM", "NO") in ("", "YES")


def _press(deck: Deck, block: DeckBlock, where: str, value: float) -> None:
    _set_load(deck, DeckLoad("traction", where, ("pressure",), block), value)
    if inside := deck.inside[where]:
        deck.lose(block, f"pressure on faces inside the body: {inside}")


def read_body_forces(deck: Deck, block: DeckBlock) -> None:
    """Read *DLOAD: pressures on faces of elements, and forces in the whole body."""
    _end_earlier(deck, block)
    factor = amplitude_share(deck, block)
    for group in deck.model.groups.get(block.number, []):
        if (where := deck.boundary(group.name)) is None:
            deck.lose(
                block, f"pressure on faces that are no boundary of the body: {len(group.values)}"
            )
        else:
            _press(deck, block, where, factor * group.values[0])
    parts: dict[
        tuple[str, ...], dict[str, Ints]
    ] = {}  # load without its set -> set -> cells that it acts on
    for row in block.rows:
        at = next((k for k, word in enumerate(row) if _BODY_FORCE.fullmatch(word)), None)
        if at is None:
            deck.lose(block, f"load {', '.join(row)}")
        else:
            region = deck.label("region", row[0])
            cells = _NOWHERE if region is None else deck.mesh.regions[region]
            whole = at == 0 or not any(row[:at])
            loaded = parts.setdefault(tuple(row[at:]), {})
            loaded["" if whole else row[0]] = np.arange(len(deck.mesh.cells)) if whole else cells
    for (kind_name, *numbers), loaded in parts.items():
        kind = kind_name.upper()
        words = [real(word) for word in numbers]
        if kind.startswith("P"):
            continue
        if len(np.unique(np.concatenate([*loaded.values()]))) < len(deck.mesh.cells):
            deck.lose(block, f"{kind} on {', '.join(map(repr, loaded))}, a part of the body")
        elif kind.startswith("B"):
            _set_load(
                deck, DeckLoad("body_force", "", (kind[1].lower(),), block), factor * words[0]
            )
        elif not deck.materials or any(
            "density" not in properties for properties in deck.materials.values()
        ):
            deck.lose(block, f"{kind}: a material has no *DENSITY")
        elif kind == "GRAV":
            direction = _unit(words[1:])[: deck.mesh.dim]
            _set_load(
                deck, DeckLoad("gravity", "", tuple(deck.axes), block, direction), factor * words[0]
            )
        else:
            about = words[1:4]
            axis = words[4:7]
            turns = deck.mesh.dim == 3 or any(axis[:2])
            place = (
                ("about", tuple(about[: deck.mesh.dim])),
                ("axis", tuple(axis[: deck.mesh.dim]) if turns else ()),
            )
            _set_load(
                deck, DeckLoad("rotation", "", ("speed",), block, place=place), factor * words[0]
            )


def read_forces(deck: Deck, block: DeckBlock) -> None:
    """Read *CLOAD: a traction on whole facets if it has the same nodal forces, otherwise single
    forces.
    """
    _end_earlier(deck, block)
    factor = amplitude_share(deck, block)
    drives: dict[tuple[int, int], float] = {}
    for name, *words in block.rows:
        if (
            reference_node := deck.reference_node(name)
        ) is not None:  # several forces at a node in one block add up
            key = (reference_node, int(words[0]))
            drives[key] = drives.get(key, 0.0) + factor * real((*words, "0")[1])
    for (node, component), value in drives.items():
        drive_bolt(deck, block, "force", node, component, value)
    for group in deck.model.groups.get(block.number, []):
        nodes = [node for node in group.nodes if node not in deck.bolts]
        component = int(group.words[0])
        axis = _AXES.get(int(group.words[0]), "")
        if not nodes:
            continue
        if not axis:
            deck.lose(block, "moments at nodes are not read")
            continue
        rows = deck.rows(nodes)
        if len(rows) < len(nodes):
            missing = [node for node in nodes if not deck.rows([node]).size]
            many = f"node {missing[0]}" if len(missing) == 1 else f"{len(missing)} nodes"
            deck.note(block, f"force at {many}: {NO_BODY_PART}")
        if not rows.size or axis not in deck.axes:
            continue
        where = deck.boundary(group.name) if len(rows) == len(group.nodes) else None
        singly = component in deck.given_singly or not deck.kinematics.uniform
        uniform = (
            None if where is None or singly else _uniform(deck, where, rows, np.array(group.values))
        )
        if where is None or uniform is None:
            _push_singly(deck, block, group, axis, factor)
        else:
            _set_load(
                deck, DeckLoad("traction", where, (axis,), block), factor * uniform / deck.thickness
            )


def _push_singly(deck: Deck, block: DeckBlock, group: Group, axis: str, factor: float) -> None:
    """Add the forces of a group at its nodes, one by one."""
    share = deck.thickness if deck.mesh.dim == 2 and deck.kinematics.uniform else 1.0
    for node, value in zip(group.nodes, group.values, strict=True):
        for row in plain(deck.rows([node])) if node not in deck.bolts else []:
            load = DeckLoad("point_force", "", (axis,), block, place=deck.at_point(row))
            _set_load(deck, load, factor * value / share)


def _uniform(deck: Deck, where: str, rows: Ints, values: Array) -> float | None:
    """Return the uniform traction times thickness that is equivalent to nodal forces, stress times
    length, or None if there is none.
    """
    if not np.isin(rows, deck.boundary_nodes(where)).all():
        return None
    areas = _areas(deck, where)
    forces = np.zeros(len(areas))
    forces[np.searchsorted(deck.numbers, rows)] = values
    value = float(forces.sum() / areas.sum())
    return (
        None if np.abs(forces - value * areas).max() > NEGLIGIBLE * np.abs(forces).max() else value
    )


def _areas(deck: Deck, where: str) -> Array:
    """Return the area of a boundary that belongs to each node of the mesh, in 2D a length, shape
    (n,).
    """
    facets = deck.mesh.facets[deck.mesh.boundaries[where]]
    shares = nodal_measures(deck.mesh.points, facets, deck.mesh.facet)
    kinds = {kind for kind, _ in deck.model.raw.blocks}
    if "hexahedron20" in kinds and (full_cell := completed("quad8")) is not None:
        facets = facets[:, :-1]
        shares = shares @ full_cell[1]
    return np.bincount(facets.ravel(), shares.ravel(), minlength=len(deck.mesh.points)).astype(
        np.float64
    )


def _unit(vector: list[float]) -> tuple[float, ...]:
    size = math.hypot(*vector)
    if not size > 0:
        raise ValueError("a direction is expected")
    return tuple(value / size for value in vector)


# --- amplitudes and steps -------------------------------------------------------------------------


def amplitude_share(deck: Deck, block: DeckBlock) -> float:
    """Return the share of a load that acts at the end of the step, by its amplitude.

    In later steps a load keeps the value that it has reached, as in CalculiX 2.20 and Abaqus.
    """
    if (name := block.parameters.get("AMPLITUDE")) is None:
        return 1.0
    amplitude = deck.amplitudes.get(name.upper())
    if (
        amplitude is None
        or not amplitude.rows
        or amplitude.word("DEFINITION", "TABULAR") != "TABULAR"
        or amplitude.unread
    ):
        deck.lose(
            block,
            f"the amplitude {name!r}: only tabular amplitudes are read: the whole load is taken",
        )
        return 1.0
    if (
        "TIME" in amplitude.parameters
        and sum(other.keyword == "STEP" for other in deck.model.blocks) > 1
    ):
        deck.lose(
            block,
            f"the amplitude {name!r}: TIME=TOTAL TIME is read in decks of one step: the whole "
            "load is taken",
        )
        return 1.0
    given_times, values = _course_of(amplitude)
    times = given_times + (
        parameter(block, "TIMEDELAY") if "TIMEDELAY" in block.parameters else 0.0
    )
    if np.count_nonzero(times == deck.period) > 1:
        deck.lose(
            block,
            f"the amplitude {name!r} jumps at the end of the step: its value after it is taken",
        )
    within = values[(times > 0) & (times < deck.period)]
    share = float(np.interp(deck.period, times, values))
    course = np.diff([float(np.interp(0.0, times, values)), *within, share])
    if (course > 0).any() and (course < 0).any():
        deck.lose(block, f"the amplitude {name!r} within the step: its value at the end is taken")
    return share


def _course_of(amplitude: DeckBlock) -> tuple[Array, Array]:
    """Return the times and values of an amplitude."""
    try:
        words = np.array([real(word) for row in amplitude.rows for word in row])
    except ValueError as error:
        raise DeckError(amplitude, str(error)) from None
    if words.size % 2:
        raise DeckError(amplitude, "pairs of a time and a value are expected")
    times = words[0::2]
    values = words[1::2]
    back = np.flatnonzero(np.diff(times) < 0)
    if back.size:
        raise DeckError(
            amplitude, f"its times go back, from {times[back[0]]:g} to {times[back[0] + 1]:g}"
        )
    return times, values


def _set_load(deck: Deck, load: DeckLoad, value: float) -> None:
    """Record a load.

    Loads that one step gives several times add up; a value replaces that of earlier steps, and a
    prescribed displacement any earlier one.
    """
    block = load.block
    key = (load.table, load.target, load.keys, load.direction, block.keyword, load.place)
    load_of_key = deck.loads.setdefault(key, load)
    earlier = load_of_key.values.get(deck.step) if block.keyword in _LOADS else None
    load_of_key.values[deck.step] = value + (earlier or 0.0)


def _end_earlier(deck: Deck, block: DeckBlock) -> None:
    """End all loads or supports that a keyword has given in earlier steps, if it has OP=NEW."""
    if block.word("OP", "MOD") != "NEW" or (deck.step, block.keyword) in deck.ended:
        return
    deck.ended.add((deck.step, block.keyword))
    for load in deck.loads.values():
        if load.block.keyword == block.keyword:
            load.values[deck.step] = None


# --- temperatures ---------------------------------------------------------------------------------

# With a constant coefficient the strain is that of the change since *INITIAL CONDITIONS, whatever
# ZERO is.


def read_temperatures(deck: Deck, block: DeckBlock) -> None:
    """Read the temperatures of sets of nodes: *TEMPERATURE of a step, or *INITIAL CONDITIONS,
    TYPE=TEMPERATURE.
    """
    parameters = block.parameters
    if (
        block.keyword == "INITIALCONDITIONS"
        and (kind := parameters.get("TYPE", "").upper()) != "TEMPERATURE"
    ):
        if kind == "VELOCITY":
            deck.note(block, WITHOUT_EFFECT)
        else:
            deck.lose(block, UNKNOWN)
        return
    if parameters.keys() & {"FILE", "BSTEP", "USER", "LINTEMP"}:
        deck.lose(block, _NODES_DIFFER)
        return
    anew = parameters.get("OP", "MOD").upper() == "NEW" and deck.step not in deck.temperatures
    temperatures = _temperatures_at(deck, -1 if anew else deck.step).copy()
    share = amplitude_share(deck, block)
    for name, value, *_ in block.rows:
        deck.check_nodes(name)
        rows = deck.rows([int(name)]) if number_of(name) is not None else deck.nodes(name)
        if not rows.size:
            deck.note(block, f"temperature of {name!r}: {NO_BODY_PART}")
        temperatures[np.searchsorted(deck.numbers, rows)] = share * real(value)
    deck.temperatures[deck.step] = temperatures
    deck.heating.append(block)


def _temperatures_at(deck: Deck, step: int) -> Array:
    """Return the temperatures of the nodes of the body at the end of a step, shape (n,)."""
    steps = [earlier for earlier in deck.temperatures if earlier <= step]
    return deck.temperatures[max(steps)] if steps else np.zeros(len(deck.numbers))


def temperature_tables(deck: Deck, steps: int) -> list[tuple[str, dict[str, Any]]]:
    """Return the [[temperature]] tables: the change in each body since the beginning, with its
    history over the steps.
    """
    if not any(properties.get("expansion") for properties in deck.materials.values()):
        return []  # nothing expands
    courses: dict[str, tuple[float, ...]] = {}
    for name, nodes in deck.bodies.items():
        changes = [
            (_temperatures_at(deck, step) - _temperatures_at(deck, -1))[nodes]
            for step in range(steps)
        ]
        if any(
            np.ptp(change) > ZERO_IN_SOLUTION * np.abs(change).max(initial=0.0)
            for change in changes
        ):
            deck.lose(deck.heating[-1], _NODES_DIFFER)
        elif any(change[0] for change in changes):
            courses[name] = tuple(float(change[0]) for change in changes)
    if len(courses) == len(deck.bodies) and len({*courses.values()}) == 1:
        courses = {"": next(iter(courses.values()))}
    tables = []
    for name, course in courses.items():
        largest, factors = factors_of(course)
        table = {
            "#": origins_of(deck.heating),
            "change": largest,
            "region": name,
            "factors": factors,
        }
        tables.append(("[[temperature]]", table))
    return tables


# The cosine to its surface beyond which a given normal is along that of the surface.
_ALONG = 1 - DIGITS_OF_FILES


def read_bolt(deck: Deck, block: DeckBlock) -> None:
    """Read *PRE-TENSION SECTION: the surface of a reference node."""
    node = deck.single_node(block.parameters["NODE"])
    name = block.parameters.get("SURFACE", "")
    surface = deck.label("surface", name)
    if node is None or surface is None:
        deck.lose(
            block, f"the preload: {name!r} is no surface of faces, or NODE is not a single node"
        )
    elif (normal := _normal(deck, surface)) is None:
        deck.lose(block, f"the preload: the surface {name!r} is not in one plane")
    else:
        direction = [real(word) for row in block.rows[:1] for word in row]
        if any(direction) and abs(normal @ direction) < _ALONG * np.linalg.norm(direction):
            deck.lose(block, "the direction of the preload: it is taken across the section")
        deck.bolts[node] = surface


def _normal(deck: Deck, name: str) -> Array | None:
    """Return the normal of a plane surface, shape (3,); None if the surface is not plane."""
    raw = deck.model.raw
    dim = deck.mesh.dim
    nodes = [
        np.unique(block[rows])
        for (kind, block), rows in zip(raw.blocks, raw.sets[name], strict=False)
        if dimension(kind) == dim - 1
    ]
    x = raw.points[np.concatenate(nodes)][:, :dim]
    _, sizes, axes = np.linalg.svd(x - x.mean(axis=0))
    if len(x) < dim or sizes[dim - 1] > (1 - _ALONG) * sizes[0]:
        return None
    return np.pad(axes[dim - 1], (0, 3 - dim))


def hold_bolt(deck: Deck, block: DeckBlock) -> None:
    """Read *BOUNDARY, FIXED: sections keep the shortening that has been reached."""
    for name, *words in block.rows:
        node = deck.reference_node(name)
        if node in deck.bolts:
            drive_bolt(deck, block, "fixed", node, min(components(words)), 1.0)
        else:
            deck.lose(block, f"{name!r} keeps the displacement that has been reached")


def drive_bolt(
    deck: Deck, block: DeckBlock, kind: str, node: int, component: int, value: float
) -> None:
    """Record the load of a reference node: a force, a shortening (``prescribed``) or ``fixed``."""
    if component != 1:
        deck.lose(
            block, f"component {component} of node {node}: that of a preload has the first one only"
        )
        return
    key = ("bolt", str(node), kind)
    deck.loads.setdefault(key, DeckLoad("bolt", str(node), (kind,), block)).values[deck.step] = (
        value
    )


def bolt_tables(deck: Deck, steps: int) -> list[tuple[str, dict[str, Any]]]:
    """Return the [[preload]] tables."""
    courses: dict[int, dict[str, DeckLoad]] = {}
    for load in deck.loads.values():
        if load.table == "bolt":
            courses.setdefault(int(load.target), {})[load.keys[0]] = load
    tables = []
    for node, course in courses.items():
        given = {key: load.by_step(steps) for key, load in course.items()}
        force = given.get("force", [None] * steps)
        fixed = given.get("fixed", [None] * steps)
        moved = given.get("prescribed", [None] * steps)
        block = next(iter(course.values())).block
        key = "shortening"
        values = moved
        until = 0
        if any(force):
            label = f"preload of {deck.bolts[node]!r}"
            until = next((k for k in range(steps) if fixed[k] or moved[k] is not None), steps)
            if until == 0 or not all(value is not None and value > 0 for value in force[:until]):
                deck.lose(
                    block,
                    f"{label}: give a positive force in each step until it is fixed, or a "
                    "shortening",
                )
                continue
            if any(value is not None for value in moved):
                deck.lose(
                    block,
                    f"{label}: prescribed after a force: the length that the force leads to is "
                    "kept",
                )
            share = deck.thickness if deck.mesh.dim == 2 else 1.0
            # The force after the section is fixed does not matter.
            key = "force"
            values = [
                (value or 0.0) / share
                for value in force[:until] + force[until - 1 : until] * (steps - until)
            ]
        elif not any(moved):
            continue
        largest, factors = factors_of([value or 0.0 for value in values])
        table = {"#": block.origin, "section": deck.bolts[node], key: largest}
        tables.append(
            (
                "[[preload]]",
                table | {"locked_after": until if until > 1 else None, "factors": factors},
            )
        )
    return tables
