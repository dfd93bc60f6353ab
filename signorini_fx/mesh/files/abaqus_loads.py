"""Supports and loads of an Abaqus input file as those of a scene, on named boundaries.  No dolfinx here."""

from __future__ import annotations

import math
import re

import numpy as np

from signorini_fx.mesh.files.abaqus import Group
from signorini_fx.mesh.files.abaqus_blocks import ROTATIONS, Block, components, real
from signorini_fx.mesh.files.abaqus_content import Deck, Load, plain_name
from signorini_fx.mesh.files.cells import completed
from signorini_fx.mesh.files.shape import nodal_measures

_AXES = {1: "x", 2: "y", 3: "z"}
# Forces at nodes that differ by less than this share of the largest from those of a uniform traction are those.
_ALIKE = 1e-3


def read_boundary(deck: Deck, block: Block) -> None:
    """Prescribed displacements, *BOUNDARY: of sets, and of single nodes that fill whole facets."""
    _forget(deck, block)
    kind = block.parameters.get("TYPE", "DISPLACEMENT").upper()
    if kind != "DISPLACEMENT" or block.parameters.keys() & {"SUBMODEL", "USER", "FIXED"}:
        deck.leave_out(block, "what is prescribed is no displacement that the file gives")
        return
    factor, lost = _factor(deck, block), set[int]()
    groups = deck.model.groups.get(block.line, [])
    every: dict[str, dict[int, float]] = {}
    for name, *words in block.rows:
        if not plain_name(name).isdigit():
            every.setdefault(name, {}).update(components(words))
    for group in groups:
        every.setdefault(group.name, {}).update(components(group.words))
    nodes = {group.name: group.nodes for group in groups}
    for name, given in every.items():
        if _moves_rigid_body(deck, block, name, nodes.get(name, ()), given):
            continue
        if any(component not in _AXES and component not in ROTATIONS for component in given):
            deck.leave_out(block, f"what {name!r} has besides displacements and rotations")
        where = deck.boundary(name)
        along = {_AXES[component]: value * factor for component, value in given.items() if component in _AXES}
        if not along:
            continue
        clamped = all(along.get(axis) == 0 for axis in deck.axes)
        if where is None and name in nodes:
            lost.update(nodes[name])
        elif where is None:
            deck.leave_out(block, f"support of {name!r}, which holds no whole facet: a scene supports boundaries")
        elif not clamped and not deck.turned.isdisjoint(map(int, deck.nodes(name))):
            deck.leave_out(block, f"support of {name!r} in the directions of *TRANSFORM")
        else:
            for axis in deck.axes:
                if axis in along:
                    _given(deck, Load("displacement", where, (axis,), keyword=block.keyword), along[axis])
            _say_what_differs(deck, block, name, where)
    if lost:
        said = f"{len(lost)} single nodes, which hold" if len(lost) > 1 else f"node {lost.pop()}, which holds"
        deck.leave_out(block, f"support of {said} no whole facet: a scene supports boundaries")


def _moves_rigid_body(deck: Deck, block: Block, name: str, nodes: tuple[int, ...], given: dict[int, float]) -> bool:
    """Whether what is prescribed is that of a rigid body; its motion is left out."""
    own = {str(node) for node in nodes} or {plain_name(name)}
    if not own <= deck.movers:
        return False
    if any(given.values()):
        deck.leave_out(block, f"motion of the rigid body of node {', '.join(sorted(own))}: move the body instead")
    return True


def _say_what_differs(deck: Deck, block: Block, name: str, where: str) -> None:
    """Nodes that a support has on no whole facet, and those on its facets that it has not."""
    own, held = deck.nodes(name), deck.held(where)
    for count, said in (
        (np.setdiff1d(own, held).size, "of {} nodes of {!r}, which are on none of its whole facets"),
        (np.setdiff1d(held, own).size if own.size else 0, "of {1!r} only at its corners: {0} more nodes are held here"),
    ):
        if count:
            deck.leave_out(block, f"support {said.format(count, name)}")


def read_surface_loads(deck: Deck, block: Block) -> None:
    """Tractions and pressures on surfaces, *DSLOAD."""
    _forget(deck, block)
    factor, inside = _factor(deck, block), 0
    for name, kind, *words in block.rows:
        where = deck.boundary(name)
        if where is None:
            deck.leave_out(block, f"load on {name!r}, which is no boundary of the body")
        elif kind.upper() == "P":
            _given(deck, Load("traction", where, ("pressure",), keyword=block.keyword), factor * real(words[0]))
            inside += deck.inside(where)
        elif kind.upper() in ("TRVEC", "TRSHR"):
            if kind.upper() == "TRSHR":
                deck.leave_out(block, f"TRSHR on {name!r}: taken along its vector, which must lie in the surface")
            direction = _unit([real(word) for word in words[1:]])[: deck.mesh.dim]
            load = Load("traction", where, tuple(deck.axes), direction, block.keyword)
            _given(deck, load, factor * real(words[0]))
        else:
            deck.leave_out(block, f"load of type {kind}")
    _say_inside(deck, block, inside)


def _say_inside(deck: Deck, block: Block, faces: int) -> None:
    if faces:
        deck.leave_out(block, f"pressure on faces inside the body: {faces}")


def read_body_forces(deck: Deck, block: Block) -> None:
    """Pressures on faces of elements, and forces in the whole body, *DLOAD."""
    _forget(deck, block)
    factor, inside = _factor(deck, block), 0
    for group in deck.model.groups.get(block.line, []):
        if (where := deck.boundary(group.name)) is None:
            inside += len(group.values)
        else:
            load = Load("traction", where, ("pressure",), keyword=block.keyword)
            _given(deck, load, factor * group.values[0])
            inside += deck.inside(where)
    _say_inside(deck, block, inside)
    for row in block.rows:
        at = next((k for k, word in enumerate(row) if re.fullmatch(r"GRAV|B[XYZ]|P\d", word.upper())), None)
        if at is None:
            deck.leave_out(block, f"load {', '.join(row)}")
            continue
        kind, words = row[at].upper(), [real(word) for word in row[at + 1 :]]
        whole = at == 0 or ((where := deck.region(row[0])) is not None and _whole(deck, where))
        if kind.startswith("P"):
            continue
        if not whole:
            deck.leave_out(block, f"body force on {row[0]!r}, a part of the body: give an expression of the position")
        elif kind == "GRAV":
            densities = {own.get("density") for own in deck.materials.values()}
            if len(densities) != 1 or None in densities:
                deck.leave_out(block, "weight: the body has no density, or several")
                continue
            (density,) = densities
            direction = _unit(words[1:])[: deck.mesh.dim]
            load = Load("body_force", "", tuple(deck.axes), direction, block.keyword)
            _given(deck, load, factor * (density or 0.0) * words[0])
        else:
            _given(deck, Load("body_force", "", (kind[1].lower(),), keyword=block.keyword), factor * words[0])


def _whole(deck: Deck, region: str) -> bool:
    return len(deck.mesh.regions[region]) == len(deck.mesh.cells)


def read_forces(deck: Deck, block: Block) -> None:
    """Forces at nodes: those that a uniform traction has at the nodes of whole facets are one."""
    _forget(deck, block)
    factor = _factor(deck, block)
    for group in deck.model.groups.get(block.line, []):
        axis, total = _AXES.get(int(group.words[0]), ""), factor * sum(group.values)
        if axis and axis not in deck.axes:
            continue
        if axis and (uniform := _uniform(deck, group)) is not None:
            where, value = uniform
            _given(deck, Load("traction", where, (axis,), keyword=block.keyword), factor * value)
            continue
        if not axis:
            deck.leave_out(block, "moments at nodes")
            continue
        total = 0.0 if abs(total) < _ALIKE**2 * abs(factor) * sum(map(abs, group.values)) else total
        said = f"forces at nodes, {total:g} along {axis} in all ({len(group.nodes)} nodes)"
        deck.leave_out(block, f"{said}: give a traction, force over area, on their boundary")


def _uniform(deck: Deck, group: Group) -> tuple[str, float] | None:
    """The boundary and the traction, stress, that forces at nodes are equivalent to; None: they are not."""
    where = deck.boundary(group.name)
    rows = np.array([deck.model.places.get(node, -1) for node in group.nodes])
    if where is None or not np.isin(rows, deck.held(where)).all() or not deck.turned.isdisjoint(map(int, rows)):
        return None
    facets = deck.mesh.facets[deck.mesh.boundaries[where]]
    shares = nodal_measures(deck.mesh.points, facets, deck.mesh.facet)
    if (whole := completed("quad8")) is not None and "get nodes" in deck.mesh.note and deck.mesh.dim == 3:
        facets, shares = facets[:, :-1], shares @ whole[1]
    areas = np.bincount(facets.ravel(), shares.ravel(), minlength=len(deck.mesh.points))
    forces = np.zeros(len(areas))
    forces[np.searchsorted(deck.numbers, rows)] = group.values
    value = float(forces.sum() / areas.sum())
    if np.abs(forces - value * areas).max() > _ALIKE * np.abs(forces).max():
        return None
    return where, value / deck.thickness


def _unit(vector: list[float]) -> tuple[float, ...]:
    size = math.hypot(*vector)
    if not size > 0:
        raise ValueError("a direction is expected")
    return tuple(value / size for value in vector)


def _factor(deck: Deck, block: Block) -> float:
    """The share of the values of a load that acts at the end of the step, by its amplitude."""
    if (name := block.parameters.get("AMPLITUDE")) is None:
        return 1.0
    own = deck.amplitudes.get(name.upper())
    if (
        own is None
        or not own.rows
        or own.parameters.get("DEFINITION", "TABULAR").upper() not in ("TABULAR", "SMOOTHSTEP")
    ):
        deck.leave_out(block, f"the amplitude {name!r}: the whole load is taken")
        return 1.0
    words = [real(word) for row in own.rows for word in row]
    start = deck.time if "TIME" in own.parameters else 0.0
    times, values = np.array(words[0::2]), np.array(words[1::2])
    within = values[(times > start) & (times < start + deck.period)]
    share = float(np.interp(start + deck.period, times, values))
    course = np.diff([float(np.interp(start, times, values)), *within, share])
    if (course > 0).any() and (course < 0).any():
        deck.leave_out(block, f"the amplitude {name!r} within the step: its value at the end is taken")
    return share


def _given(deck: Deck, load: Load, value: float) -> None:
    key = (load.table, load.target, load.keys, load.direction, load.keyword)
    deck.loads.setdefault(key, load).values[deck.step] = value


def _forget(deck: Deck, block: Block) -> None:
    """With OP=NEW, what steps have given so far by a keyword ends with this one."""
    if block.parameters.get("OP", "MOD").upper() != "NEW" or (deck.step, block.keyword) in deck.ended:
        return
    deck.ended.add((deck.step, block.keyword))
    for load in deck.loads.values():
        if load.keyword == block.keyword:
            load.values[deck.step] = None
