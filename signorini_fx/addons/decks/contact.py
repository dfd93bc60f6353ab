"""Contact and ties of an Abaqus input file, as the contacts of a scene."""

from __future__ import annotations

import itertools
from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from signorini_fx.addons.decks.content import Deck, Interaction, SurfacePair
from signorini_fx.addons.decks.text import CONSTRAINT, DeckBlock, parameter, real, real_or_none
from signorini_fx.arrays import Ints, Plain, inner
from signorini_fx.tuned import DIGITS_OF_FILES, HARD_CONTACT

# How a contact pair is discretised, which a scene chooses itself.
_KINDS_OF_PAIRS = (
    "NODETOSURFACE",
    "SURFACETOSURFACE",
    "MORTAR",
    "LINMORTAR",
    "PGLINMORTAR",
    "MASSLESS",
)
# Elements that may have friction of their own, of no *SURFACE INTERACTION.
_WITH_FRICTION = ("GAP", "CONNECTORFRICTION")


def read_interaction(deck: Deck, block: DeckBlock) -> None:
    """Read *SURFACE INTERACTION: its name."""
    if block.rows and deck.mesh.dim == 3:  # in 2D it is a thickness
        raise ValueError(
            f"data line 1, {', '.join(block.rows[0])!r}, is one too many: of which keyword is it?"
        )
    deck.interaction = block.parameters["NAME"].upper()
    deck.interactions.setdefault(deck.interaction, Interaction())
    if "USER" in block.parameters:
        deck.lose(block, "behaviour of a subroutine is not read: contact is hard")


def _interaction(deck: Deck) -> Interaction:
    if not deck.interaction:
        raise ValueError("no *SURFACE INTERACTION is before it")
    return deck.interactions[deck.interaction]


def read_friction(deck: Deck, block: DeckBlock) -> None:
    """Read *FRICTION: a coefficient, in CalculiX followed by the stiffness of stick."""
    if deck.model.blocks[block.number - 1].keyword in _WITH_FRICTION:
        return
    interaction = _interaction(deck)
    rows = block.rows
    if "ROUGH" in block.parameters:
        deck.lose(block, "ROUGH is not read: this contact has no friction")
        return
    if rows and rows[0]:
        interaction.coefficient = real(rows[0][0])
    if "TAUMAX" in block.parameters:
        interaction.cap = parameter(block, "TAUMAX")
    # Only CalculiX, which has no parameters here, has a stiffness; of Abaqus it is a speed.
    if len(rows) == 1 and len(rows[0]) == 2 and not block.parameters.keys() - {"INPUT"}:
        interaction.sticking = _stiffness_of(rows[0][1])
    if len(rows) > 1 or any(len(row) > 2 for row in rows):
        deck.lose(
            block,
            "friction that depends on speed, pressure or temperature: the first coefficient is "
            "taken",
        )


def read_behaviour(deck: Deck, block: DeckBlock) -> None:
    """Read *SURFACE BEHAVIOR: hard contact, soft contact of constant stiffness, or a bond."""
    interaction = _interaction(deck)
    rows = block.rows
    kind = block.word("PRESSURE-OVERCLOSURE", "HARD")
    if interaction.behaviour is not None:
        deck.lose(
            block,
            f"a second behaviour of the interaction {deck.interaction!r}: the last one is taken",
        )
    for word in itertools.chain(*rows):
        real(word)  # also those that only some programs read
    interaction.behaviour = block
    interaction.tied = kind == "TIED"
    interaction.stiffness = None
    interaction.separates = "NOSEPARATION" not in block.parameters
    if kind in ("LINEAR", "TIED") and rows and rows[0]:
        interaction.stiffness = _stiffness_of(rows[0][0])
    elif kind == "HARD" and any(rows):
        deck.lose(block, "its numbers are not read: contact is hard")
    elif kind not in ("HARD", "LINEAR", "TIED"):
        deck.lose(
            block, f"{kind}: soft contact is read as LINEAR or TIED only: this contact is hard"
        )


def _stiffness_of(word: str) -> float:
    if not (stiffness := real(word)) > 0:
        raise ValueError(f"a contact has the stiffness {stiffness:g}, which is not positive")
    return stiffness


def read_pairs(deck: Deck, block: DeckBlock) -> None:
    """Read *CONTACT PAIR: its surfaces, its interaction, and ADJUST."""
    parameters = block.parameters
    kind = parameters.get("TYPE", "NODE TO SURFACE")
    if kind.upper().replace(" ", "") not in _KINDS_OF_PAIRS:
        raise ValueError(f"TYPE={kind}: NODE TO SURFACE, SURFACE TO SURFACE or MORTAR is expected")
    interaction = parameters.get("INTERACTION", "").upper()
    adjust = parameters.get("ADJUST")
    named = {b.word("NAME") for b in deck.model.blocks if b.keyword == "SURFACEINTERACTION"}
    if interaction and interaction not in named:
        raise ValueError(f"there is no *SURFACE INTERACTION, NAME={interaction}")
    if (
        adjust is not None
        and (not adjust or real_or_none(adjust) is None)
        and deck.label("nodes", adjust) is None
    ):
        raise ValueError(f"ADJUST={adjust}: a length or the name of a set of nodes is expected")
    tied = "TIED" in parameters
    small = "SMALLSLIDING" in parameters
    deck.pairs += [
        SurfacePair(row[0], (*row, row[0])[1], None if tied else interaction, block, adjust, small)
        for row in block.rows
    ]


def read_ties(deck: Deck, block: DeckBlock) -> None:
    """Read *TIE: bonds; ties of cyclic symmetry are lost."""
    if "CYCLICSYMMETRY" in block.parameters:
        deck.lose(block, CONSTRAINT)
        return
    tolerance = block.parameters.get("POSITIONTOLERANCE")
    deck.pairs += [
        SurfacePair(row[0], (*row, row[0])[1], None, block, tolerance) for row in block.rows
    ]


def contact_tables(deck: Deck) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Return the [[contact]] tables, and the entries of [solver] for their stiffness."""
    tables: list[dict[str, Any]] = []
    interactions: list[Interaction | None] = []
    taken: dict[str, Ints] = {}  # facets with contact points: they are in one contact only
    touched: dict[str, Ints] = {}  # by others, which may be several
    for pair in sorted(
        _oriented(deck), key=lambda pair: pair.interaction is not None
    ):  # ties come first
        interaction = (
            None
            if pair.interaction is None
            else deck.interactions.get(pair.interaction, Interaction())
        )
        label = (
            f"{'tie' if interaction is None else 'contact'} of {pair.slave!r} with {pair.master!r}"
        )
        first = deck.boundary(pair.slave)
        opposite = deck.boundary(pair.master)
        if first is None or opposite is None:
            absent = pair.slave if first is None else pair.master
            deck.lose(pair.block, f"{label}: {absent!r} is no boundary of the body")
            continue
        if first == opposite:
            deck.lose(pair.block, f"{label}: contact of a surface with itself")
            continue
        facets = {side: deck.mesh.boundaries[side] for side in (first, opposite)}
        if _shared(facets[first], taken | touched) or _shared(facets[opposite], taken):
            deck.lose(
                pair.block,
                f"{label}: facets of {first!r} are in another contact, and have one only",
            )
            continue
        taken[first] = facets[first]
        touched[opposite] = facets[opposite]
        table: dict[str, Any] = {"#": pair.block.origin, "boundary": first, "against": opposite}
        if interaction is None or interaction.tied:
            table["kind"] = "bonded"
            reach = None if pair.adjust is None else real_or_none(pair.adjust)
            if reach is not None and _distance(deck, first, opposite) > reach:
                why = f"{label}: nodes farther apart than {reach:g} are tied, too"
                deck.lose(pair.block, why)
        else:
            law = {"law": "coulomb", "coefficient": interaction.coefficient, "cap": interaction.cap}
            table |= {
                "adjust": _adjust(deck, pair, label),
                "friction": law if interaction.coefficient else None,
            }
            table |= {"sliding": "small"} if pair.keeps_partners else {}
            if not interaction.separates:
                table["kind"] = "bilateral"
                closed = table["adjust"] or DIGITS_OF_FILES * deck.mesh.diagonal
                if (distance := _distance(deck, first, opposite)) > closed:
                    why = f"{label}: NO SEPARATION of sides {distance:.3g} apart: closed here"
                    deck.lose(pair.block, why)
        tables.append(table)
        interactions.append(interaction)
    return tables, _stiffness(deck, interactions, tables)


def _shared(facets: Ints, opposite: dict[str, Ints]) -> bool:
    return any(np.intersect1d(facets, listed).size for listed in opposite.values())


def _distance(deck: Deck, boundary: str, opposite: str) -> float:
    """Return the largest distance of the nodes of a boundary from the nearest facets of another
    one, length.
    """
    mesh = deck.mesh
    corners = mesh.points[mesh.facet_corners[mesh.boundaries[opposite]]]
    edges = corners[:, 1] - corners[:, 0]
    normals = (
        edges[:, ::-1] * [1, -1]
        if mesh.dim == 2
        else np.cross(edges, corners[:, 2] - corners[:, 0])
    )
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    x = mesh.points[np.unique(mesh.facets[mesh.boundaries[boundary]])]
    nearest = cKDTree(corners.mean(axis=1)).query(x)[1]
    return float(np.abs(inner(x - corners[nearest, 0], normals[nearest])).max())


def _oriented(deck: Deck) -> list[SurfacePair]:
    """Return the pairs, with both surfaces exchanged where one dependent surface belongs to several
    pairs, so that the other surfaces get the contact points.
    """
    counts = Counter(filter(None, (deck.boundary(pair.slave) for pair in deck.pairs)))
    return [
        replace(pair, slave=pair.master, master=pair.slave)
        if (pair.adjust is None or pair.interaction is None)
        and counts[deck.boundary(pair.slave) or ""] > 1
        else pair
        for pair in deck.pairs
    ]


def _adjust(deck: Deck, pair: SurfacePair, label: str) -> float | None:
    """Return the length by which contact points are moved onto the other side, ADJUST of *CONTACT
    PAIR: a length, or a set of nodes.
    """
    length = None if pair.adjust is None else real_or_none(pair.adjust)
    if pair.adjust is None or length is not None:
        return length
    if np.isin(deck.boundary_nodes(str(deck.boundary(pair.slave))), deck.nodes(pair.adjust)).all():
        return deck.mesh.diagonal
    deck.lose(
        pair.block,
        f"{label}: ADJUST: a set with only some nodes of the dependent surface is not read",
    )
    return None


def _stiffness(
    deck: Deck, interactions: list[Interaction | None], tables: list[dict[str, Any]]
) -> dict[str, Any]:
    """Return the stiffness of contact and of stick as entries of [solver]; if contacts differ, each
    gets an ``overclosure``.
    """
    contacts = [used for used in interactions if used is not None]
    slopes = {used.stiffness for used in contacts}
    tied = [used.tied for used in contacts]
    slope = next(iter(slopes)) if len(slopes) == 1 else None
    bonded = None in interactions or any(tied)
    solver = {}
    if slope is not None and (slope >= _hard(deck) or not bonded or all(tied)):
        solver["gamma_n"] = slope
    else:
        for interaction, table in zip(interactions, tables, strict=True):
            if (
                interaction is None
                or interaction.stiffness is None
                or interaction.behaviour is None
            ):
                continue
            if interaction.tied or not interaction.separates:
                kept = "a bond beside other contact" if interaction.tied else "NO SEPARATION"
                deck.lose(interaction.behaviour, f"the stiffness of {kept} is not read")
            else:
                table["overclosure"] = {"law": "linear", "stiffness": interaction.stiffness}
    rubbing = [used.sticking for used in contacts if used.coefficient]
    soft = [sticking for sticking in rubbing if sticking is not None]
    if soft:
        solver["gamma_t"] = max(soft)
        if len({*rubbing}) > 1 and min(soft) < _hard(deck):
            block = next(pair.block for pair in deck.pairs if pair.interaction is not None)
            deck.lose(
                block,
                "contacts of several stiffnesses of sticking: a scene has one gamma_t, the largest",
            )
    return solver


def _hard(deck: Deck) -> float:
    """Return the stiffness above which contact is considered hard, stress per length."""
    moduli = (properties.get("young", 0.0) for properties in deck.materials.values())
    return HARD_CONTACT * max(moduli, default=0.0) / deck.mesh.diagonal


def set_sliding(deck: Deck, contacts: list[dict[str, Plain]]) -> None:
    """Set small sliding for contacts of nonlinear bodies that are tied or adjusted, and for sides
    of degree 2 in 3D.
    """
    for table in contacts:
        bonded = table.get("kind") == "bonded"
        adjusted = table.get("adjust") is not None
        if "sliding" in table:
            continue
        if bonded or adjusted or (deck.mesh.dim, deck.mesh.degree) == (3, 2):
            table["sliding"] = "small"
            if not bonded and deck.nonlinear is not None:
                deck.lose(deck.nonlinear, "NLGEOM: points in contact keep their partners")
