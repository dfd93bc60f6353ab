"""Materials, sections and orientations of an Abaqus input file, as the materials of a scene.  No dolfinx here."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from signorini_fx.addons.decks.content import Deck, DeckSection, frame
from signorini_fx.addons.decks.keywords import FIRST_LINE, LOAD_AREA
from signorini_fx.addons.decks.nonlinear_material import nonlinear_law, obstacle_of
from signorini_fx.mechanics.mesh.files.abaqus_blocks import DeckBlock, DeckError, quoted, real
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.tuned import ZERO_SUM

_SECTIONS = {"SHELLSECTION": "shells", "MEMBRANESECTION": "membranes", "BEAMSECTION": "beams"}
# Where the first six constants of stiffness of *ELASTIC, TYPE=ORTHO belong; the others are shear moduli.
_NORMAL = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))
_CONSTANTS = 9


def read_section(deck: Deck, block: DeckBlock) -> None:
    """The material of a part, and the thickness of a plane one."""
    word = _SECTIONS.get(block.keyword)
    name = deck.model.sections.get(block.number, block.parameters["ELSET"])
    region = None if name is None else deck.region(name)
    if word == "shells" and (members := deck.shells.get((name or "").upper())) and set(members) <= deck.areas.keys():
        deck.note(block, LOAD_AREA)
        return
    if word is not None and (deck.mesh.dim == 3 or region is None or word == "beams"):
        deck.lose(block, f"{word}, which are no part of the body")
        return
    if word is not None:
        deck.note(block, f"{word}: as a plane body under plane stress, without bending")
    if "MATERIAL" not in block.parameters:
        raise ValueError("MATERIAL is missing; sections of several layers are not known")
    if name != block.parameters["ELSET"]:
        deck.note(
            block,
            f"its elements that a later section has too are of that one: the rest is {name!r}"
            if name
            else "all of its elements are of later sections",
        )
    if region is not None:
        material, turned = (block.parameters.get(key, "").upper() for key in ("MATERIAL", "ORIENTATION"))
        deck.sections.append(DeckSection(region, material, turned, block))
    if deck.mesh.dim == 2 and deck.kinematics.uniform and block.rows and block.rows[0] and block.rows[0][0]:
        deck.thickness = real(block.rows[0][0])
        if deck.thickness != 1:
            deck.note(block, f"the thickness {deck.thickness:g}: forces are per unit of it")


def read_constants(deck: Deck, block: DeckBlock, material: str) -> None:
    """*ELASTIC, *DENSITY or *EXPANSION of a material."""
    properties = deck.materials[material]
    if block.keyword == "DENSITY":
        properties["density"] = real(block.rows[0][0])
        return
    kind, rows = block.parameters.get("TYPE", "ISOTROPIC").upper().replace(" ", ""), len(block.rows)
    if block.keyword == "ELASTIC" and kind in ("ORTHO", "ORTHOTROPIC", "ENGINEERINGCONSTANTS"):
        words = [real(word) for row in block.rows[:2] for word in row][:_CONSTANTS]
        if len(words) < _CONSTANTS:
            raise ValueError(f"{_CONSTANTS} constants are expected")
        properties["orthotropic"] = _by_axes(words) if kind == "ENGINEERINGCONSTANTS" else _by_axes(_engineering(words))
        rows -= 1
    elif kind not in ("ISOTROPIC", "ISO"):
        deck.lose(block, f"{block.name.lower()} of the material {material!r}: it is neither isotropic nor orthotropic")
        return
    elif block.keyword == "EXPANSION":  # ZERO, a temperature of reference, matters for a coefficient that varies only
        properties["expansion"] = real(block.rows[0][0])
    else:
        properties["young"], properties["poisson"] = (real(word) for word in (*block.rows[0], "0")[:2])
    if rows > 1:
        deck.lose(block, FIRST_LINE)


def _engineering(words: list[float]) -> list[float]:
    """E_1, E_2, E_3, nu_12, nu_13, nu_23 and shear moduli from constants of stiffness, D_1111, D_1122 and so on."""
    stiffness = np.zeros((3, 3))
    for (i, j), value in zip(_NORMAL, words, strict=False):
        stiffness[i, j] = stiffness[j, i] = value
    if not np.linalg.matrix_rank(stiffness) == 3:
        raise ValueError("the constants have no inverse")
    strains = np.linalg.inv(stiffness)
    young = [float(1 / strains[k, k]) for k in range(3)]
    return [*young, *(-float(strains[i, j]) * young[i] for i, j in ((0, 1), (0, 2), (1, 2))), *words[6:]]


def _by_axes(words: list[float]) -> dict[str, list[float]]:
    return {"young": words[:3], "poisson": words[3:6], "shear": words[6:]}


def _axes_of(deck: Deck, name: str) -> list[str]:
    """The keys for the directions of an *ORIENTATION."""
    block = deck.orientations.get(name)
    if block is None:
        raise ValueError(f"there is no *ORIENTATION {name!r}")
    system, dim = block.parameters.get("SYSTEM", "RECTANGULAR").upper(), deck.mesh.dim
    words = [real(word) for word in block.rows[0]]
    if len(words) not in (6, 9) or block.parameters.get("DEFINITION", "COORDINATES").upper() != "COORDINATES":
        raise ValueError(f"*ORIENTATION {name!r}: two points are expected, or three")
    first, second = np.array(words[:3]), np.array(words[3:6])
    turn, angle = ([real(word) for word in block.rows[1]] + [0.0])[:2] if len(block.rows) > 1 else (1.0, 0.0)
    if system in ("CYLINDRICAL", "C"):
        along = (second - first) / np.linalg.norm(second - first)
        if angle or (dim == 2 and abs(along[2]) < 1 - ZERO_SUM):
            deck.lose(block, "a cylindrical orientation that is turned about one of its axes")
        keep = np.eye(3) - np.outer(along, along)
        cross = np.array([np.cross(along, axis) for axis in np.eye(3)]).T @ keep
        rows = [_linear(matrix, -matrix @ first, dim) for matrix in (keep, cross)]
    elif system in ("RECTANGULAR", "R"):
        centre = np.array(words[6:9]) if len(words) == 9 else np.zeros(3)
        axes = _turned(frame(first - centre, second - centre), round(turn) - 1, np.radians(angle))
        if dim == 2 and abs(axes[2, 2]) < 1 - ZERO_SUM:
            deck.lose(block, "an orientation whose axis 3 is not across the plane")
        rows = [str((np.where(np.abs(axis) < ZERO_SUM, 0.0, axis) + 0.0)[:dim].tolist()) for axis in axes[:2]]
    else:
        raise ValueError(f"*ORIENTATION {name!r}: its system is neither rectangular nor cylindrical")
    return [f"direction = {rows[0]}"] + ([f"second = {rows[1]}"] if dim == 3 else [])


def _turned(axes: Floats, about: int, angle: float) -> Floats:
    """A frame turned about one of its axes."""
    if not 0 <= about < 3:
        raise ValueError("an *ORIENTATION is turned about axis 1, 2 or 3")
    turned, (first_axis, second_axis) = axes.copy(), ((about + 1) % 3, (about + 2) % 3)
    turned[first_axis] = np.cos(angle) * axes[first_axis] + np.sin(angle) * axes[second_axis]
    turned[second_axis] = np.cos(angle) * axes[second_axis] - np.sin(angle) * axes[first_axis]
    return turned


def _linear(matrix: Floats, constant: Floats, dim: int) -> str:
    """A vector that is linear in the position, as values of a scene."""
    values = []
    for row, offset in zip(plain(matrix[:dim, :dim]), plain(constant[:dim]), strict=True):
        terms = [f"{share!r}*x[{k}]" for k, share in enumerate(row) if abs(share) > ZERO_SUM]
        text = " + ".join([*terms, repr(offset)]).replace("+ -", "- ")
        values.append(quoted(text) if terms else text)
    return f"[{', '.join(values)}]"


def material_tables(deck: Deck, contacts: Sequence[Sequence[str]], *, heated: bool) -> list[tuple[str, list[str]]]:
    """The lines of each material.

    Args:
        deck: the input file.
        contacts: the lines of each contact of the scene.
        heated: whether there are temperatures.

    Raises:
        ValueError: a part of the body has none.
    """
    weighs = any(load.table in ("gravity", "rotation") for load in deck.loads.values())
    keys = ("density",) * weighs + ("expansion",) * heated
    covered = np.zeros(len(deck.mesh.cells), dtype=bool)
    for section in deck.sections:
        covered[deck.mesh.regions[section.region]] = True
    if not covered.all():
        why = f"no material: {np.count_nonzero(~covered)} of {len(covered)} cells are in no section"
        if deck.model.bare is None:
            raise ValueError(why)
        element, block = deck.model.bare
        raise DeckError(block, f"{why}, such as element {element}")
    shown, obstacle = list[tuple[str, list[str]]](), obstacle_of(deck, contacts, heated=heated)
    for section in deck.sections:
        name = f"the material {section.material!r} of {section.region!r}"
        if (properties := deck.materials.get(section.material)) is None:
            raise DeckError(section.block, f"{name} is not defined")
        law = nonlinear_law(deck, section, obstacle) or _law(deck, properties, section.orientation)
        if law is None:
            raise DeckError(section.block, f"{name} has no *ELASTIC that is isotropic or orthotropic")
        # without *EXPANSION a material does not expand
        properties = {"expansion": 0.0, **properties} if heated else properties
        shown.append((section.region, [*law, *(f"{key} = {properties[key]!r}" for key in keys if key in properties)]))
    hypothesis = [f"hypothesis = {quoted(deck.hypothesis)}"] if deck.hypothesis else []
    if all(lines == shown[0][1] for _, lines in shown):
        return [("[material]", [*shown[0][1], *hypothesis])]
    return [("[[material]]", [f"region = {quoted(region)}", *lines, *hypothesis]) for region, lines in shown]


def _law(deck: Deck, properties: dict[str, Any], orientation: str) -> list[str] | None:
    """Its constants of elasticity as lines; None: it has none."""
    if "young" in properties:
        return [f"{key} = {properties[key]!r}" for key in ("young", "poisson")]
    if "orthotropic" not in properties:
        return None
    axes = _axes_of(deck, orientation) if orientation else []
    constants = [f"{key} = {value}" for key, value in properties["orthotropic"].items()]
    return [f"orthotropic = {{ {', '.join([*constants, *axes])} }}"]
