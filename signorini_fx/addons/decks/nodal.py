"""What an Abaqus input file says of single nodes, as forces at nodes and links between them.  No dolfinx here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.addons.decks.content import Deck
from signorini_fx.addons.decks.keywords import CONSTRAINT
from signorini_fx.mechanics.mesh.files.abaqus_blocks import DeckBlock, DeckError, quoted, real
from signorini_fx.mechanics.mesh.files.abaqus_groups import single
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.tuned import ALIKE_IN_DECK, NODES_OF_TABLES, STIFF_LINK

# A term of a link: its node of the mesh, and the vector by which the displacement there is multiplied.
Term = tuple[int, Floats]


@dataclass(frozen=True)
class DeckLink:
    """A linear relation of the displacements of nodes, whose sum of terms is zero, or what a load says.

    Attributes:
        terms: node by node.
        block: the keyword that says it.
    """

    terms: tuple[Term, ...]
    block: DeckBlock


def link_nodes(deck: Deck, block: DeckBlock, terms: Sequence[Term]) -> None:
    """Add a link; terms of one node are added up, and the largest entry becomes one."""
    sums: dict[int, Floats] = {}
    for node, vector in terms:
        sums[node] = sums.get(node, np.zeros(3)) + vector
    largest = max((float(np.abs(vector).max()) for vector in sums.values()), default=0.0)
    together = [node for node in sums if deck.together(node)[1] in deck.together(node)[0]]
    if together:
        deck.lose(block, f"{deck.called(together[0])}: its body has another node at the same place")
    elif largest > 0:
        scaled = tuple((node, np.asarray(vector / largest)) for node, vector in sums.items() if vector.any())
        deck.links.append(DeckLink(scaled, block))


def direction(deck: Deck, row: int, component: int) -> Floats:
    """The unit vector of a component, from 1 to 3, of the displacement of a node, which a *TRANSFORM may have turned.

    Args:
        deck: what has been read.
        row: of the node in the file.
        component: its number.
    """
    frame = deck.frame_of(row)
    return np.array(np.eye(3)[component - 1] if frame is None else frame[component - 1], dtype=np.float64)


def read_equations(deck: Deck, block: DeckBlock) -> None:
    """*EQUATION: a number of terms, then node, component and coefficient of each.

    Raises:
        DeckError: there are too few words.
    """
    if "REMOVE" in block.parameters or deck.steps:
        deck.lose(block, "equations that change within a step")
        return
    words = [word for row in block.rows for word in row]
    while words:
        if not words[0].isdigit() or int(words[0]) < 1:
            raise DeckError(block, f"the number of terms of an equation is expected, not {words[0]!r}")
        count = int(words[0])
        entries, words = words[1 : 3 * count + 1], words[3 * count + 1 :]
        if len(entries) < 3 * count:
            raise DeckError(block, f"an equation of {count} terms ends after {len(entries)} of {3 * count} entries")
        triples = [entries[k : k + 3] for k in range(0, len(entries), 3)]
        _read_equation(deck, block, [(name, int(component), real(value)) for name, component, value in triples])


def _read_equation(deck: Deck, block: DeckBlock, terms: Sequence[tuple[str, int, float]]) -> None:
    members = [_members(deck, name) for name, _, _ in terms]
    for (name, component, _), rows in zip(terms, members, strict=True):
        if rows is None:
            deck.lose(block, f"an equation with {name!r}: no part of the body")
            return
        if not 1 <= component <= 3:
            deck.lose(block, f"an equation with component {component} of {name!r}: a rotation")
            return
    sizes = {len(rows) for rows in members if rows is not None} - {1}
    if len(sizes) > 1:
        deck.lose(block, "an equation of sets with different numbers of nodes")
        return
    for k in range(max(sizes, default=1)):
        added = []
        for (_, component, value), rows in zip(terms, members, strict=True):
            row = (rows or [])[min(k, len(rows or []) - 1)]
            added.append((deck.node(row), value * direction(deck, row, component)))
        link_nodes(deck, block, added)


def _members(deck: Deck, name: str) -> list[int] | None:
    """Rows of the file of a node or of a set; None: some are no part of the body, or there is none."""
    if (number := single(name)) is not None:
        rows = plain(deck.rows([number]))
        return rows or None
    rows = plain(deck.nodes(name))
    return rows if rows and len(rows) == deck.members_of(name) else None


def read_constraints(deck: Deck, block: DeckBlock) -> None:
    """*MPC: PIN and TIE, which join the first node of each pair to the second, and PLANE and STRAIGHT, whose nodes stay
    in a plane, or on a line, for small displacements.

    Raises:
        DeckError: there are too few nodes, or they span no plane or line.
    """
    if deck.steps:
        deck.lose(block, "constraints that change within a step")
        return
    entries: list[list[str]] = []
    for row in block.rows:
        if single(row[0]) is None or not entries:
            entries.append(list(row))
        else:
            entries[-1] += row[1:] if row[0] == "0" else row
    for kind, *names in entries:
        members = [_members(deck, name) for name in names]
        if kind.upper() not in ("PIN", "TIE", "PLANE", "STRAIGHT") or None in members:
            missing = [name for name, rows in zip(names, members, strict=True) if rows is None]
            reason = f"{missing[0]!r} is no part of the body" if missing else CONSTRAINT
            deck.lose(block, f"{kind.upper()}: {reason}")
            continue
        nodes = [[deck.node(row) for row in rows or ()] for rows in members]
        if kind.upper() in ("PIN", "TIE"):
            if len(nodes) != 2 or len(nodes[0]) != len(nodes[1]):
                raise DeckError(block, f"{kind.upper()}: two nodes, or two sets of as many, are expected")
            for pair in zip(*nodes, strict=True):
                for unit in np.eye(3)[: deck.mesh.dim]:
                    link_nodes(deck, block, [(pair[0], unit), (pair[1], -unit)])
        else:
            every = list(dict.fromkeys(node for part in nodes for node in part))
            _keep_flat(deck, block, every, 3 if kind.upper() == "PLANE" else 2)


def _keep_flat(deck: Deck, block: DeckBlock, nodes: Sequence[int], count: int) -> None:
    """Keep nodes on the line of the first two, or in the plane of the first three, for small displacements.

    Raises:
        DeckError: there are too few nodes, or they span no line or plane.
    """
    dim = deck.mesh.dim
    x: Floats = np.zeros((len(nodes), 3))
    x[:, :dim] = deck.mesh.points[nodes]
    tolerance = ALIKE_IN_DECK**2 * deck.size
    first: list[int] = []  # that span the line or the plane
    for k in range(len(nodes)):
        if len(first) < count and np.linalg.matrix_rank(x[[*first, k]] - x[0], tol=tolerance) == len(first):
            first.append(k)
    if len(first) < count or len(nodes) == count:
        raise DeckError(block, f"more than {count} nodes are expected, {count} of them not in line")
    order = [*first, *(k for k in range(len(nodes)) if k not in first)]
    nodes, x = [nodes[k] for k in order], x[order]
    arms = x[1:count] - x[0]
    across = np.linalg.svd(arms)[2][count - 1 :]
    shares = np.linalg.lstsq(arms.T, (x[count:] - x[0]).T, rcond=None)[0]
    for node, share in zip(nodes[count:], shares.T, strict=True):
        for unit in across:
            if np.abs(unit[dim:]).max(initial=0.0) > ALIKE_IN_DECK:
                continue
            weights = [1.0 - float(share.sum()), *plain(share)]
            terms = [(other, -weight * unit) for other, weight in zip(nodes[:count], weights, strict=True)]
            link_nodes(deck, block, [(node, unit), *terms])


def follow(deck: Deck, nodes: set[int], along: Floats) -> set[int]:
    """The nodes of the mesh that links of two terms move along a direction as these, one after the other."""
    followers, grown = set(nodes), True
    while grown:
        grown = False
        for link in deck.links:
            if len(link.terms) != 2:
                continue
            (first, vector), (second, other) = link.terms
            parallel = np.linalg.norm(np.cross(np.pad(along, (0, 3 - len(along))), vector)) < ALIKE_IN_DECK
            if (first in followers) != (second in followers) and parallel and np.allclose(vector, -other):
                followers |= {first, second}
                grown = True
    return followers


def ground(deck: Deck, block: DeckBlock, row: int, component: int) -> Floats:
    """Hold one component of a node, in the directions of *TRANSFORM, by a link to the ground.

    Returns:
        The vector along which it is held, as far as the mesh has its components.
    """
    vector = direction(deck, row, component)
    vector[deck.mesh.dim :] = 0.0
    key = f"{row} {component}"
    if key not in deck.grounded and vector.any():
        deck.grounded[key] = len(deck.links)
        deck.links.append(DeckLink(((deck.node(row), vector),), block))
    return vector


def stiffness_of_links(deck: Deck) -> float:
    """That of each link, force per length: by a factor more than cells of the stiffest material resist."""
    moduli = (properties.get("orthotropic", properties).get("young", 0.0) for properties in deck.materials.values())
    young = max(float(np.max(stiffness)) for stiffness in moduli)
    size = deck.size
    if deck.mesh.dim == 2:
        radius = np.abs(deck.mesh.points[:, 0]).max()
        return float(f"{STIFF_LINK * young * (1.0 if deck.kinematics.uniform else 2 * np.pi * radius):.3g}")
    return float(f"{STIFF_LINK * young * size / len(deck.mesh.cells) ** (1 / 3):.3g}")


def nodal_tables(deck: Deck, steps: int, target: Path, files: dict[Path, str]) -> list[tuple[str, list[str]]]:
    """Each [[point_force]] and [[links]] with its lines; what they refer to is added to the files beside the scene."""
    tables = []
    stiffness = stiffness_of_links(deck) if deck.links else 0.0
    by_course: dict[tuple[float, ...], dict[int, Floats]] = {}
    blocks: dict[tuple[float, ...], list[DeckBlock]] = {}
    for load in deck.loads.values():
        if load.table not in ("point_force", "grounded"):
            continue
        values = deck.course(load, steps)
        largest = max(values, key=abs)
        if not largest:
            continue
        course = tuple(float(f"{value / largest:.12g}") for value in values)
        held, vector = load.table == "grounded", np.array([0.0, 0.0, 0.0])
        vector[: len(load.direction)] = load.direction
        node = deck.node(int(load.target)) if held else int(load.target)
        forces = by_course.setdefault(course, {})
        forces[node] = forces.get(node, np.zeros(3)) + largest * (stiffness if held else 1.0) * vector
        blocks.setdefault(course, []).append(load.block)
    for course, forces in by_course.items():
        factors = [f"factors = {list(course)}"] if set(course) != {1.0} else []
        origin = f"# {' and '.join(dict.fromkeys(block.origin for block in blocks[course]))}"
        rows = [(node, vector) for node, vector in forces.items() if vector[: deck.mesh.dim].any()]
        if len(rows) > NODES_OF_TABLES:
            listed = [[*_place(deck, node), *_numbers(deck, vector)] for node, vector in rows]
            beside = _file(target, files, "forces", ["f"], deck, listed)
            tables.append(("[[point_force]]", [origin, f"file = {quoted(beside.name)}", *factors]))
            continue
        for node, vector in rows:
            *point, region = _place(deck, node)
            lines = [origin, f"at = [{', '.join(point)}]", *([f"region = {quoted(region)}"] if region else [])]
            lines += [f"{axis} = {value!r}" for axis, value in zip(deck.axes, plain(vector), strict=False) if value]
            tables.append(("[[point_force]]", [*lines, *factors]))
    if deck.links:
        listed = [
            [*_place(deck, node), *_numbers(deck, vector), str(number)]
            for number, link in enumerate(deck.links, 1)
            for node, vector in link.terms
        ]
        beside = _file(target, files, "links", ["c", "link"], deck, listed)
        origin = f"# {' and '.join(dict.fromkeys(link.block.origin for link in deck.links))}"
        tables.append(("[[links]]", [origin, f"file = {quoted(beside.name)}", f"stiffness = {stiffness!r}"]))
    return tables


def _place(deck: Deck, node: int) -> list[str]:
    """The coordinates of a node of the mesh, and its body where another one has a node there; empty: there is none."""
    others, body = deck.together(node)
    return [*map(repr, plain(deck.mesh.points[node])), body if others else ""]


def _numbers(deck: Deck, vector: Any) -> list[str]:
    return [repr(value) for value in plain(vector)[: deck.mesh.dim]]


def _file(
    target: Path, files: dict[Path, str], word: str, columns: Sequence[str], deck: Deck, listed: Sequence[list[str]]
) -> Path:
    """A .csv beside the scene."""
    prefix, *more = columns
    beside = target.with_name(f"{target.stem}_{word}_{len(files) + 1}.csv")
    head = [*deck.axes, "region", *(f"{prefix}{axis}" for axis in deck.axes), *more]
    files[beside] = "\n".join([",".join(head), *map(",".join, listed)]) + "\n"
    return beside
