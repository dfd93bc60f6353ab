"""Contact and ties of an Abaqus input file, as the contacts of a scene."""

from __future__ import annotations

import itertools
import re
from collections import Counter
from dataclasses import replace

import numpy as np

from signorini_fx.addons.decks.content import Deck, Interaction, SurfacePair, plain_name
from signorini_fx.addons.decks.keywords import (
    ADJUSTED_SET,
    CONSTRAINT,
    NO_BOUNDARY,
    NO_PLANE,
    NO_SEPARATION,
    OTHER_BEHAVIOUR,
    PARTNERS,
    ROUGH,
)
from signorini_fx.addons.decks.text import DeckBlock, parameter, quoted, real, real_or_none
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.tuned import DIGITS_OF_FILES, HARD_CONTACT, SAME_NUMBER

# How a contact pair is discretised, which a scene chooses itself.
_KINDS_OF_PAIRS = ("NODETOSURFACE", "SURFACETOSURFACE", "MORTAR", "LINMORTAR", "PGLINMORTAR", "MASSLESS")
# Elements that may have friction of their own, of no *SURFACE INTERACTION.
_WITH_FRICTION = ("GAP", "CONNECTORFRICTION")


def read_interaction(deck: Deck, block: DeckBlock) -> None:
    """*SURFACE INTERACTION."""
    if block.rows and deck.mesh.dim == 3:  # in 2D it is a thickness
        raise ValueError(f"data line 1, {', '.join(block.rows[0])!r}, is one too many: of which keyword is it?")
    deck.interaction = block.parameters["NAME"].upper()
    deck.interactions.setdefault(deck.interaction, Interaction())
    if "USER" in block.parameters:
        deck.lose(block, "behaviour of a subroutine is not read: contact is hard")


def _interaction(deck: Deck) -> Interaction:
    if not deck.interaction:
        raise ValueError("no *SURFACE INTERACTION is before it")
    return deck.interactions[deck.interaction]


def read_friction(deck: Deck, block: DeckBlock) -> None:
    """*FRICTION: a coefficient and, of CalculiX, the stiffness of sticking after it."""
    if deck.model.blocks[block.number - 1].keyword in _WITH_FRICTION:
        return
    interaction, rows = _interaction(deck), block.rows
    if "ROUGH" in block.parameters:
        interaction.rough = block
        return
    if rows and rows[0]:
        interaction.coefficient = real(rows[0][0])
    if "TAUMAX" in block.parameters:
        interaction.cap = parameter(block, "TAUMAX")
    if len(rows) == 1 and len(rows[0]) == 2:
        interaction.sticking = _stiffness_of(rows[0][1])
    if len(rows) > 1 or any(len(row) > 2 for row in rows):
        deck.lose(block, "friction that depends on speed, pressure or temperature: the first coefficient is taken")


def read_behaviour(deck: Deck, block: DeckBlock) -> None:
    """*SURFACE BEHAVIOR: hard contact, soft contact with a constant stiffness, or a bond."""
    interaction, rows = _interaction(deck), block.rows
    kind = block.parameters.get("PRESSURE-OVERCLOSURE", "HARD").upper()
    if interaction.behaviour is not None:
        deck.lose(block, f"a second behaviour of the interaction {deck.interaction!r}: the last one is taken")
    for word in itertools.chain(*rows):
        real(word)  # also those that only some programs read
    interaction.behaviour, interaction.tied, interaction.stiffness = block, kind == "TIED", None
    if kind in ("LINEAR", "TIED") and rows and rows[0]:
        interaction.stiffness = _stiffness_of(rows[0][0])
    elif kind == "HARD" and any(rows):
        deck.lose(block, "its numbers are not read: contact is hard")
    elif kind not in ("HARD", "LINEAR", "TIED"):
        deck.lose(block, f"{kind}: {OTHER_BEHAVIOUR}")


def _stiffness_of(word: str) -> float:
    if not (stiffness := real(word)) > 0:
        raise ValueError(f"a contact has the stiffness {stiffness:g}, which is not positive")
    return stiffness


def read_pairs(deck: Deck, block: DeckBlock) -> None:
    """*CONTACT PAIR: surfaces, and what it refers to must be there."""
    parameters = block.parameters
    kind = parameters.get("TYPE", "NODE TO SURFACE")
    if kind.upper().replace(" ", "") not in _KINDS_OF_PAIRS:
        raise ValueError(f"TYPE={kind}: NODE TO SURFACE, SURFACE TO SURFACE or MORTAR is expected")
    interaction, adjust = parameters.get("INTERACTION", "").upper(), parameters.get("ADJUST")
    named = {b.parameters.get("NAME", "").upper() for b in deck.model.blocks if b.keyword == "SURFACEINTERACTION"}
    if interaction and interaction not in named:
        raise ValueError(f"there is no *SURFACE INTERACTION, NAME={interaction}")
    if adjust is not None and (not adjust or real_or_none(adjust) is None) and not deck.has_nodes(adjust):
        raise ValueError(f"ADJUST={adjust}: a length or the name of a set of nodes is expected")
    deck.pairs += [SurfacePair(row[0], (*row, row[0])[1], interaction, block, adjust) for row in block.rows]


def read_ties(deck: Deck, block: DeckBlock) -> None:
    """*TIE: a bond, but for that of sectors."""
    if "CYCLICSYMMETRY" in block.parameters:
        deck.lose(block, CONSTRAINT)
    else:
        deck.pairs += [SurfacePair(row[0], (*row, row[0])[1], None, block) for row in block.rows]


def contact_tables(deck: Deck) -> tuple[list[list[str]], list[str]]:
    """The lines of each [[contact]], and those of [solver] with their stiffness."""
    tables: list[list[str]] = []
    interactions: list[Interaction | None] = []
    taken: dict[str, Ints] = {}  # facets with contact points: they are in one contact only
    touched: dict[str, Ints] = {}  # by others, which may be several
    for pair in sorted(_oriented(deck), key=lambda pair: pair.interaction is not None):  # ties come first
        interaction = None if pair.interaction is None else deck.interactions.get(pair.interaction, Interaction())
        label = f"{'tie' if interaction is None else 'contact'} of {pair.slave!r} with {pair.master!r}"
        surfaces = [name for name in (pair.slave, pair.master) if plain_name(name) in deck.rigid]
        sides = {name: deck.boundary(name) for name in (pair.slave, pair.master) if name not in surfaces}
        missing = [name for name, side in sides.items() if side is None]
        first, *opposite = [side for side in sides.values() if side is not None] or [""]
        if len(surfaces) == 2 or pair.slave == pair.master or first in opposite:
            deck.lose(pair.block, f"{label}: {'both are rigid' if surfaces else 'contact of a surface with itself'}")
            continue
        if missing:
            deck.lose(pair.block, f"{label}: {missing[0]!r} {NO_BOUNDARY}")
            continue
        facets = {side: deck.mesh.boundaries[side] for side in (first, *opposite)}
        shared = _shared(facets[first], taken | touched) or any(_shared(facets[side], taken) for side in opposite)
        if shared:
            deck.lose(pair.block, f"{label}: facets of {first!r} are in another contact, and have one only")
            continue
        kind = _kind(deck, interaction)
        if kind == "bonded" and surfaces:
            deck.lose(pair.block, f"{label}: {surfaces[0]!r} is rigid: give displacements instead")
            continue
        taken[first] = facets[first]
        touched |= {side: facets[side] for side in opposite}
        lines = [f"# {pair.block.origin}", f"boundary = {quoted(first)}"]
        lines += [f"against = {quoted(side)}" for side in opposite]
        lines += _foundation(deck, pair.block, first, surfaces[0]) if surfaces else []
        lines += ['kind = "bonded"'] * (kind == "bonded")
        if kind != "bonded" and interaction is not None:
            lines += _adjust(deck, pair, label, opposite) + _friction(interaction)
        tables.append(lines)
        interactions.append(interaction)
    return tables, _stiffness(deck, interactions, tables)


def _shared(facets: Ints, opposite: dict[str, Ints]) -> bool:
    return any(np.intersect1d(facets, listed).size for listed in opposite.values())


def _oriented(deck: Deck) -> list[SurfacePair]:
    """The pairs; where one dependent surface is in several, the other surfaces get the contact points."""
    counts = Counter(deck.boundary(pair.slave) for pair in deck.pairs)

    def turned(pair: SurfacePair) -> SurfacePair:
        several = deck.boundary(pair.slave) is not None and counts[deck.boundary(pair.slave)] > 1
        if not several or plain_name(pair.master) in deck.rigid or pair.adjust is not None:
            return pair
        return replace(pair, slave=pair.master, master=pair.slave)

    return [turned(pair) for pair in deck.pairs]


def _kind(deck: Deck, interaction: Interaction | None) -> str:
    """The kind of a contact; what it loses is said."""
    if interaction is None or interaction.tied:
        return "bonded"
    if interaction.behaviour is not None and "NOSEPARATION" in interaction.behaviour.parameters:
        deck.lose(interaction.behaviour, NO_SEPARATION)
    if interaction.rough is not None:
        deck.lose(interaction.rough, ROUGH)
    return "unilateral"


def _adjust(deck: Deck, pair: SurfacePair, label: str, opposite: list[str]) -> list[str]:
    """How far points are moved onto the other side: ADJUST of *CONTACT PAIR, a length or a set of nodes."""
    if pair.adjust is None:
        return []
    if not opposite:
        deck.lose(pair.block, f"{label}: ADJUST, which scenes know between two bodies")
        return []
    if (length := real_or_none(pair.adjust)) is not None:
        return [f"adjust = {length!r}"]
    if np.isin(deck.held(str(deck.boundary(pair.slave))), deck.nodes(pair.adjust)).all():
        return [f"adjust = {deck.size!r}"]
    deck.lose(pair.block, f"{label}: {ADJUSTED_SET}")
    return []


def _friction(interaction: Interaction) -> list[str]:
    if not interaction.coefficient or interaction.rough is not None:
        return []
    cap = "" if interaction.cap is None else f", cap = {interaction.cap!r}"
    return [f'friction = {{ law = "coulomb", coefficient = {interaction.coefficient!r}{cap} }}']


def _stiffness(deck: Deck, interactions: list[Interaction | None], tables: list[list[str]]) -> list[str]:
    """The stiffness of contact and of sticking as keys of [solver], which hold for the whole scene; where contacts
    differ in the first one, or bonds are beside soft contact, each contact has an overclosure of its own.
    """
    contacts = [used_interaction for used_interaction in interactions if used_interaction is not None]
    slopes = {used_interaction.stiffness for used_interaction in contacts}
    slope = next(iter(slopes)) if len(slopes) == 1 else None
    bonded = None in interactions or any(used_interaction.tied for used_interaction in contacts)
    lines = []
    if slope is not None and (
        slope >= _hard(deck) or not bonded or all(used_interaction.tied for used_interaction in contacts)
    ):
        lines.append(f"gamma_n = {slope!r}")
    else:
        for interaction, table in zip(interactions, tables, strict=True):
            if interaction is None or interaction.stiffness is None or interaction.behaviour is None:
                continue
            if interaction.tied:
                deck.lose(interaction.behaviour, "the stiffness of a bond beside other contact is not read")
            else:
                table.append(f'overclosure = {{ law = "linear", stiffness = {interaction.stiffness!r} }}')
    rubbing = [used_interaction.sticking for used_interaction in contacts if used_interaction.coefficient]
    soft = [sticking for sticking in rubbing if sticking is not None]
    if soft:
        lines.append(f"gamma_t = {max(soft)!r}")
        if len({*rubbing}) > 1 and min(soft) < _hard(deck):
            block = next(pair.block for pair in deck.pairs if pair.interaction is not None)
            deck.lose(block, "contacts of several stiffnesses of sticking: a scene has one gamma_t, the largest")
    return lines


def _hard(deck: Deck) -> float:
    """The stiffness, stress per length, from which contact is hard."""
    moduli = (properties.get("young", 0.0) for properties in deck.materials.values())
    return HARD_CONTACT * max(moduli, default=0.0) / deck.size


def say_partners(deck: Deck, contacts: list[list[str]]) -> list[list[str]]:
    """The lines of contacts of nonlinear bodies with what they say of sliding: what is tied or adjusted keeps its
    partners, and so do sides of degree 2 in 3D.
    """
    result = []
    for lines in contacts:
        between = any(line.startswith("against") for line in lines)
        bonded = any('kind = "bonded"' in line for line in lines)
        keeps = (
            bonded or any(line.startswith("adjust") for line in lines) or (deck.mesh.dim, deck.mesh.degree) == (3, 2)
        )
        result.append([*lines, 'sliding = "small"'] if between and keeps else lines)
        if between and keeps and not bonded and deck.nonlinear is not None:
            deck.lose(deck.nonlinear, PARTNERS)
    return result


# --- rigid surfaces: planes at rest ----------------------------------------------------------------------------------


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


def _foundation(deck: Deck, block: DeckBlock, where: str, surface: str) -> list[str]:
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
