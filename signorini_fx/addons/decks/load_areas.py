"""Shells that are there to carry a pressure to a part of a flat side, to which they are tied.  No dolfinx here.

CalculiX's way to load an area that is not bounded by sides of elements: shells as thin as nothing.  In a scene their
pressure is a traction on that side, which is zero outside them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from signorini_fx.addons.decks.content import Deck, DeckLoad
from signorini_fx.mechanics.mesh.files.abaqus_blocks import DeckBlock, DeckError, real
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.tuned import SAME_LENGTH

# Shells of three or four corners with straight sides; of eight and six nodes the corners come first.
_SHELL = re.compile(r"S(?:TRI)?(?P<nodes>[3468])")
_CORNERS = {3: 3, 4: 4, 6: 3, 8: 4}


@dataclass(frozen=True)
class LoadArea:
    """A shell.

    Attributes:
        surface: the boundary of the body on which it lies.
        corners: shape (3 or 4, 3).
        normal: unit vector around which the corners go, along which a pressure acts, shape (3,).
    """

    surface: str
    corners: Floats
    normal: Floats

    @property
    def within(self) -> str:
        """Where it is, as a condition of a scene."""
        conditions = []
        for start, end in zip(self.corners, np.roll(self.corners, -1, axis=0), strict=True):
            inward = np.cross(self.normal, end - start)
            terms = [f"{share!r}*x[{k}]" for k, share in enumerate(plain(inward)) if share]
            conditions.append(f"{' + '.join(terms)} >= {float(inward @ start)!r}")
        return " and ".join(conditions)


def find_load_areas(deck: Deck) -> None:
    """Find shells without stiffness of their own, all of which are tied to flat sides of the body.

    Raises:
        DeckError: a thickness is no number.
    """
    if deck.mesh.dim != 3:
        return
    thin = _thin_shells(deck)
    for slave, master, tied in _pairs(deck):
        faces = {name.upper(): listed for name, listed in deck.model.surfaces.items()}.get(slave.upper(), [])
        where = deck.boundary(master)
        if not faces or where is None or not tied or not {element for element, _ in faces} <= thin.keys():
            continue
        areas = {element: _on_side(deck, thin[element], where) for element, _ in faces}
        if all(area is not None for area in areas.values()):
            deck.areas |= {element: area for element, area in areas.items() if area is not None}
            deck.vanished.add(frozenset((slave.upper(), master.upper())))


def read_area_loads(deck: Deck, block: DeckBlock, factor: float) -> set[int]:
    """The pressures of a *DLOAD on shells that are areas of load.

    Returns:
        The rows of the keyword that are such.
    """
    done: set[int] = set()
    for number, row in enumerate(block.rows):
        if len(row) < 2:
            continue
        name, kind, *words = row
        elements = [int(name)] if name.isdigit() else deck.shells.get(name.upper(), [])
        if kind.upper() != "P" or not elements or not set(elements) <= deck.areas.keys():
            continue
        done.add(number)
        for element in elements:
            area = deck.areas[element]
            load = DeckLoad(
                "traction", area.surface, tuple(deck.axes), block, tuple(plain(area.normal)), within=area.within
            )
            key = (load.table, load.target, load.within)
            values = deck.loads.setdefault(key, load).values
            values[deck.step] = (values.get(deck.step) or 0.0) + factor * real(words[0])
    return done


def _thin_shells(deck: Deck) -> dict[int, Floats]:
    """The corners of the shells of sections that are as thin as nothing; their sets are kept."""
    raw = deck.model.raw
    corners: dict[int, Floats] = {}
    for block in deck.model.blocks:
        if block.keyword != "ELEMENT" or (match := _SHELL.match(block.parameters.get("TYPE", "").upper())) is None:
            continue
        count = int(match["nodes"])
        numbers = [int(word) for row in block.rows for word in row if word]
        for number, *nodes in (numbers[k : k + count + 1] for k in range(0, len(numbers), count + 1)):
            corners[number] = raw.points[[deck.model.places[node] for node in nodes[: _CORNERS[count]]]]
            deck.shells.setdefault(block.parameters.get("ELSET", "").upper(), []).append(number)
    thin: dict[int, Floats] = {}
    size = deck.size
    for block in deck.model.blocks:
        if block.keyword == "SHELLSECTION" and 0 < _thickness(block) <= SAME_LENGTH * size:
            members = deck.shells.get(block.parameters.get("ELSET", "").upper(), [])
            thin |= {number: corners[number] for number in members}
    return thin


def _thickness(block: DeckBlock) -> float:
    """Of the shells of a section, length; 0: it has none.

    Raises:
        DeckError: it is no number.
    """
    words = block.rows[0] if block.rows else []
    try:
        return real(words[0]) if words else 0.0
    except ValueError as error:
        raise DeckError(block, f"thickness: {error}") from None


def _pairs(deck: Deck) -> list[tuple[str, str, bool]]:
    """Slaves and masters of all contacts and ties, and whether they are bonded."""
    tied, interaction = set[str](), ""
    for block in deck.model.blocks:
        if block.keyword == "SURFACEINTERACTION":
            interaction = block.parameters.get("NAME", "").upper()
        if block.keyword == "SURFACEBEHAVIOR" and block.parameters.get("PRESSURE-OVERCLOSURE", "").upper() == "TIED":
            tied.add(interaction)
    return [
        (row[0], row[1], block.keyword == "TIE" or block.parameters.get("INTERACTION", "").upper() in tied)
        for block in deck.model.blocks
        if block.keyword in ("CONTACTPAIR", "TIE")
        for row in block.rows
        if len(row) > 1
    ]


def _on_side(deck: Deck, corners: Floats, where: str) -> LoadArea | None:
    """A flat and convex shell on a flat boundary; None: it is none."""
    sides = np.roll(corners, -1, axis=0) - corners
    turns = np.cross(sides, np.roll(sides, -1, axis=0))
    normal = turns.sum(axis=0) / max(float(np.linalg.norm(turns.sum(axis=0))), 1e-300)
    x = deck.mesh.points[np.unique(deck.mesh.facets[deck.mesh.boundaries[where]])]
    near = SAME_LENGTH * deck.size
    flat = np.abs((np.concatenate((x, corners)) - corners[0]) @ normal).max() <= near
    inside = (corners >= x.min(axis=0) - near).all() and (corners <= x.max(axis=0) + near).all()
    if not flat or not inside or (turns @ normal <= 0).any():
        return None
    return LoadArea(where, corners, normal)
