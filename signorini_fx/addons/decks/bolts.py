"""*PRE-TENSION SECTION of an Abaqus or CalculiX input file, as the preload of a scene.

Its reference node has one component: *CLOAD gives the tension through the section, *BOUNDARY the
shortening; with FIXED it keeps the shortening that has been reached.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from signorini_fx.addons.decks.content import Deck, DeckLoad
from signorini_fx.addons.decks.text import DeckBlock, components, factors_of, real
from signorini_fx.arrays import Array
from signorini_fx.mechanics.mesh.files.cells import dimension
from signorini_fx.tuned import DIGITS_OF_FILES

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


def hold(deck: Deck, block: DeckBlock) -> None:
    """Read *BOUNDARY, FIXED: sections keep the shortening that has been reached."""
    for name, *words in block.rows:
        node = deck.reference_node(name)
        if node in deck.bolts:
            drive(deck, block, "fixed", node, min(components(words)), 1.0)
        else:
            deck.lose(block, f"{name!r} keeps the displacement that has been reached")


def drive(deck: Deck, block: DeckBlock, kind: str, node: int, component: int, value: float) -> None:
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
