"""Rigid bodies of an Abaqus input file, as rigid foundations of a scene: planes at rest."""

from __future__ import annotations

import re

import numpy as np

from signorini_fx.addons.decks.content import Deck, plain_name
from signorini_fx.addons.decks.keywords import NO_PLANE
from signorini_fx.addons.decks.text import DeckBlock, real
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.tuned import DIGITS_OF_FILES, SAME_NUMBER


def read_rigid_body(deck: Deck, block: DeckBlock) -> None:
    """*RIGID BODY: a rigid surface and the nodes that move it."""
    parameters = block.parameters
    names = [parameters[key] for key in ("ANALYTICALSURFACE", "ELSET") if key in parameters]
    if not names or any(deck.region(name) is not None for name in names):
        deck.lose(block, "a rigid part of the body is not read: it deforms here")
        return
    deck.rigid |= {plain_name(name) for name in names}
    nodes = (deck.single(parameters.get(key, "")) for key in ("REFNODE", "ROTNODE"))
    deck.movers |= {node for node in nodes if node is not None}


def find_surfaces(deck: Deck) -> None:
    """Rigid surfaces, wherever in the file they are named."""
    for block in deck.model.blocks:
        if block.keyword == "ELEMENT" and re.match(r"R[23]D", block.parameters.get("TYPE", "").upper()):
            deck.rigid.add(plain_name(block.parameters.get("ELSET", "")))
    for block in (block for block in deck.model.blocks if block.keyword == "SURFACE" and "NAME" in block.parameters):
        name = plain_name(block.parameters["NAME"])
        if block.parameters.get("TYPE", "").upper() in ("SEGMENTS", "CYLINDER", "REVOLUTION"):
            deck.drawn[name] = block.rows
            deck.rigid.add(name)
        elif block.rows and all(plain_name(row[0]) in deck.rigid for row in block.rows):
            deck.rigid.add(name)
            deck.parts[name] = [plain_name(row[0]) for row in block.rows]
    deck.rigid.discard("")


def foundation(deck: Deck, block: DeckBlock, where: str, surface: str) -> list[str]:
    """A rigid surface as lines of a contact: the distance to a plane as a formula.

    Args:
        deck: what has been read.
        block: the contact pair.
        where: the boundary of the body.
        surface: the name of the rigid surface.
    """
    points = _points_of(deck, plain_name(surface))
    body = deck.mesh.points[np.unique(deck.mesh.facet_corners[deck.mesh.boundaries[where]])]
    plane = None if points is None else _plane(points[:, : deck.mesh.dim])
    if plane is None:
        deck.lose(block, f"rigid surface {surface!r}: {NO_PLANE}")
        return ["gap = 0.0  # the distance to the foundation, which is not known here"]
    middle, normal = plane
    side = float(np.mean(body, axis=0) @ normal - middle @ normal)
    if abs(side) <= DIGITS_OF_FILES * float(np.ptp(deck.mesh.points, axis=0).max()):
        side = -float((body.mean(axis=0) - deck.mesh.points.mean(axis=0)) @ normal)
    toward = -normal if side > 0 else normal
    at, toward = float(middle @ toward), toward + 0.0  # without negative zeros
    terms = "".join(
        f" {'-' if share > 0 else '+'} {'' if abs(share) == 1 else f'{abs(share)!r}*'}x[{k}]"
        for k, share in enumerate(map(float, toward))
        if share
    )
    distance = f"{at!r}{terms}" if at else terms.removeprefix(" + ").lstrip()
    return [f'gap = "{distance}"', f"direction = {plain(toward)}"]


def _points_of(deck: Deck, name: str) -> Floats | None:
    """Points of a rigid surface that consists of elements, or in 2D of lines."""
    if (rows := deck.drawn.get(name)) is not None:
        if deck.mesh.dim == 3 or any(row[0].upper() not in ("START", "LINE") for row in rows):
            return None
        try:
            return np.array([[real(word) for word in row[1:3]] for row in rows])
        except ValueError as error:
            raise ValueError(f"the rigid surface {name!r}: {error}") from None
    labels = {name, *deck.parts.get(name, ())}
    nodes = [
        block[rows].ravel()
        for label, members in deck.model.raw.sets.items()
        if label.upper() in labels
        for (_, block), rows in zip(deck.model.raw.blocks, members, strict=True)
    ]
    return np.asarray(deck.model.raw.points, dtype=np.float64)[np.unique(np.concatenate(nodes))] if nodes else None


def _plane(points: Floats) -> tuple[Floats, Floats] | None:
    """A point and the unit normal of the plane (in 2D: of the line) through points; None: there is none."""
    middle = points.mean(axis=0)
    _, sizes, axes = np.linalg.svd(points - middle)
    small = DIGITS_OF_FILES * sizes[0]
    if len(points) < points.shape[1] or sizes[-2] <= small or sizes[-1] > small:
        return None
    normal = np.where(np.abs(axes[-1]) < SAME_NUMBER, 0.0, axes[-1])
    return middle, np.asarray(normal / np.linalg.norm(normal))
