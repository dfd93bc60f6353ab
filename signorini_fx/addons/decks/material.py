"""Materials and sections of an Abaqus input file, as the materials of a scene."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from signorini_fx.addons.decks.content import Deck, DeckSection
from signorini_fx.addons.decks.text import NO_BODY_PART, DeckBlock, DeckError, parameter, real
from signorini_fx.arrays import Plain

_NOT_YET_NONLINEAR = "a nonlinear material is not possible yet"
_FIRST_LINE = "constants that depend on temperature: the first line is taken"
_OTHER_RUBBER = "only NEO HOOKE, MOONEY-RIVLIN and OGDEN with D1 above 0 are read"
# By the parameters of *HYPERELASTIC that name an energy: its law; a polynomial is the default.
_ENERGIES = {
    "NEOHOOKE": "neo-hooke",
    "MOONEY-RIVLIN": "mooney-rivlin",
    "OGDEN": "ogden",
    "POLYNOMIAL": "mooney-rivlin",
    "REDUCEDPOLYNOMIAL": "neo-hooke",
}
_OTHER_ENERGIES = {"ARRUDA-BOYCE", "YEOH", "MARLOW", "VANDERWAALS", "USER", "TESTDATAINPUT"}
_FIRST_TERM = ("POLYNOMIAL", "REDUCEDPOLYNOMIAL")


def read_section(deck: Deck, block: DeckBlock) -> None:
    """Read *SOLID SECTION and other sections: the material of a region, and in 2D the thickness."""
    region = deck.label("region", block.parameters["ELSET"])
    if block.keyword != "SOLIDSECTION":
        if deck.mesh.dim == 3 or region is None:
            deck.lose(block, NO_BODY_PART)
            return
        deck.note(block, "as a plane body under plane stress, without bending")
    if "MATERIAL" not in block.parameters:
        raise ValueError("MATERIAL is missing; sections of several layers are not known")
    if region is not None:
        deck.sections.append(DeckSection(region, block.parameters["MATERIAL"].upper(), block))
    if (
        deck.mesh.dim == 2
        and deck.kinematics.uniform
        and block.rows
        and block.rows[0]
        and block.rows[0][0]
    ):
        deck.thickness = real(block.rows[0][0])
        if deck.thickness != 1:
            deck.note(block, f"the thickness {deck.thickness:g}: forces are per unit of it")


def read_material(deck: Deck, block: DeckBlock) -> None:
    """Read *MATERIAL: its name."""
    deck.material = block.parameters["NAME"].upper()
    deck.materials.setdefault(deck.material, {})


def _properties(deck: Deck) -> dict[str, Any]:
    if not deck.material:
        raise ValueError("no *MATERIAL is before it")
    return deck.materials[deck.material]


def read_density(deck: Deck, block: DeckBlock) -> None:
    """Read *DENSITY: mass per volume."""
    _properties(deck)["density"] = real(block.rows[0][0])
    if len(block.rows) > 1:
        deck.lose(block, _FIRST_LINE)


def read_expansion(deck: Deck, block: DeckBlock) -> None:
    """Read *EXPANSION: a constant coefficient, for which the reference temperature ZERO has no
    effect.
    """
    properties = _properties(deck)
    if block.word("TYPE", "ISO") not in ("ISO", "ISOTROPIC"):
        deck.lose(block, "expansion that depends on the direction is not read")
        return
    properties["expansion"] = real(block.rows[0][0])
    if len(block.rows) > 1:
        deck.lose(block, _FIRST_LINE)


def read_elastic(deck: Deck, block: DeckBlock) -> None:
    """Read *ELASTIC: Young's modulus and Poisson's ratio of an isotropic material."""
    properties = _properties(deck)
    if block.word("TYPE", "ISOTROPIC") not in ("ISOTROPIC", "ISO"):
        raise DeckError(
            block,
            "only isotropic elasticity is read: state others in a scene, with material.orthotropic",
        )
    words = (*block.rows[0], "0")
    properties["young"] = real(words[0])
    properties["poisson"] = real(words[1])
    if len(block.rows) > 1:
        deck.lose(block, _FIRST_LINE)


def read_rubber(deck: Deck, block: DeckBlock) -> None:
    """Read *HYPERELASTIC: an energy, with kappa = 2 / D1; Ogden's mu becomes 2 mu / alpha."""
    properties = _properties(deck)
    parameters = block.parameters
    named = [key for key in _ENERGIES if key in parameters] or ["POLYNOMIAL"]
    terms = round(parameter(block, "N")) if "N" in parameters else 1
    law = _ENERGIES[named[0]]
    if parameters.keys() & _OTHER_ENERGIES or (named[0] in _FIRST_TERM and terms != 1):
        raise DeckError(block, _OTHER_RUBBER)
    count = {"neo-hooke": 2, "mooney-rivlin": 3, "ogden": 3 * terms}[law]
    words = [real(word) for row in block.rows for word in row]
    if len(words) < count:
        raise ValueError(f"{count} constants are expected")
    volumes = words[count - (terms if law == "ogden" else 1) : count]
    if not volumes[0] > 0 or any(volumes[1:]):
        raise DeckError(block, _OTHER_RUBBER)
    if len(block.rows) > -(-count // 8):
        deck.lose(block, _FIRST_LINE)
    table: dict[str, Any] = {"law": "ogden" if law == "ogden" else "mooney-rivlin"}
    if law == "ogden":
        mu = words[: 2 * terms : 2]
        alpha = words[1 : 2 * terms : 2]
        if not all(alpha) or not min(mu) > 0:
            raise ValueError("mu must be above 0 here, and no exponent alpha zero")
        table |= {"mu": [2 * m / a for m, a in zip(mu, alpha, strict=True)], "alpha": alpha}
    else:
        if min(words[: count - 1]) < 0 or not sum(words[: count - 1]) > 0:
            raise ValueError("C10 and C01 must not be negative here, and their sum be above 0")
        table |= dict(zip(("c10", "c01"), words[: count - 1], strict=False))
    properties["rubber"] = table | {"bulk": 2 / volumes[0]}, block


def read_hardening(deck: Deck, block: DeckBlock) -> None:
    """Read *PLASTIC: rows of yield stress and plastic strain, from 0 on, at one temperature."""
    properties = _properties(deck)
    if block.word("HARDENING", "ISOTROPIC") != "ISOTROPIC":
        deck.lose(block, "hardening that is not isotropic is not read: elastic here")
        return
    if "RATE" in block.parameters:  # the static curve, which has no rate, holds
        return
    rows = [[*map(real, row), 0.0, 0.0][:3] for row in block.rows]
    if any(row[2] != rows[0][2] for row in rows):
        deck.lose(block, _FIRST_LINE)
    curve = [(strain, stress) for stress, strain, temperature in rows if temperature == rows[0][2]]
    if curve[0][0] != 0.0:
        raise ValueError("the first plastic strain must be 0")
    if any(b[0] <= a[0] or b[1] < a[1] for a, b in itertools.pairwise(curve)):
        raise ValueError(
            "plastic strains must increase from row to row, and yield stresses not decrease"
        )
    properties["plastic"] = curve, block


# --- tables of the scene --------------------------------------------------------------------------


def material_tables(
    deck: Deck, obstacle: str, *, heated: bool
) -> list[tuple[str, dict[str, Plain]]]:
    """Return the tables of materials; each region of the body has one material.

    Args:
        deck: the content of the input file.
        obstacle: see ``obstacle_of``.
        heated: whether there are temperatures.
    """
    weighs = any(load.table in ("gravity", "rotation") for load in deck.loads.values())
    keys = ("density",) * weighs + ("expansion",) * heated
    covered = np.zeros(len(deck.mesh.cells), dtype=bool)
    for section in deck.sections:
        cells = deck.mesh.regions[section.region]
        if covered[cells].any():
            raise DeckError(
                section.block,
                "some of its elements are in another section, too: give each of them one",
            )
        covered[cells] = True
    if not covered.all():
        middle = deck.mesh.points[deck.mesh.corners[int(np.argmin(covered))]].mean(axis=0)
        place = ", ".join(f"{value:g}" for value in middle)
        count = np.count_nonzero(~covered)
        raise ValueError(
            f"no material: {count} of {len(covered)} cells are in no section, the first at "
            f"({place})"
        )
    shown = list[tuple[str, dict[str, Any]]]()
    for section in deck.sections:
        name = f"the material {section.material!r} of {section.region!r}"
        if (properties := deck.materials.get(section.material)) is None:
            raise DeckError(section.block, f"{name} is not defined")
        law = _nonlinear_law(deck, section, obstacle)
        if law is None and "young" not in properties:
            raise DeckError(section.block, f"{name} has no *ELASTIC")
        law = law or {key: properties[key] for key in ("young", "poisson")}
        # without *EXPANSION a material does not expand
        properties = {"expansion": 0.0, **properties} if heated else properties
        law |= {key: properties.get(key) for key in keys} | {"hypothesis": deck.hypothesis}
        shown.append((section.region, law))
    if all(law == shown[0][1] for _, law in shown):
        return [("[material]", shown[0][1])]
    return [("[[material]]", {"region": region, **law}) for region, law in shown]


def has_rubber(deck: Deck) -> bool:
    """Return whether a part of the body is rubber."""
    return any("rubber" in deck.materials.get(section.material, {}) for section in deck.sections)


def obstacle_of(deck: Deck, contacts: Sequence[Mapping[str, Plain]], *, heated: bool) -> str:
    """Return the feature of a scene that excludes nonlinear materials, in words, or ""."""
    finite = deck.nonlinear is not None or has_rubber(deck)
    obstacles = {
        "with soft contact": any("overclosure" in contact for contact in contacts),
        "in plane stress": deck.hypothesis == "plane stress",
        # CalculiX takes alpha T from grad u there: another material than one that expands and is
        # deformed then.
        "with temperature at finite strains": heated and finite,
        "with a preload": bool(deck.bolts),
    }
    return next((words for words, there in obstacles.items() if there), "")


def is_nonlinear(deck: Deck, obstacle: str) -> bool:
    """Return whether the scene has nonlinear materials."""
    if obstacle:
        return False
    made = [deck.materials.get(section.material, {}) for section in deck.sections]
    return deck.nonlinear is not None or any(
        {"rubber", "plastic"} & properties.keys() for properties in made
    )


def _nonlinear_law(deck: Deck, section: DeckSection, obstacle: str) -> dict[str, Any] | None:
    """Return the keys of a nonlinear material, or None if it is linear in the scene.

    Beside rubber a material with two elastic constants is nonlinear too.
    """
    properties = deck.materials[section.material]
    curve, yielding = properties.get("plastic", (None, None))
    if "rubber" in properties:
        if yielding is not None:
            deck.lose(yielding, "a material with *HYPERELASTIC does not yield here")
        law, block = properties["rubber"]
        if law["law"] == "ogden" and deck.mesh.dim == 3:
            obstacle = "in 3D with OGDEN: take MOONEY-RIVLIN"
        if obstacle:
            raise DeckError(block, f"{_NOT_YET_NONLINEAR} {obstacle}")
        return dict(law)
    beside_rubber = has_rubber(deck)
    why = obstacle or ("beside rubber" if beside_rubber else "")
    if yielding is not None and why:
        deck.lose(yielding, f"{_NOT_YET_NONLINEAR} {why}: elastic here")
    if "young" not in properties:
        return None
    constants = {"young": properties["young"], "poisson": properties["poisson"]}
    if beside_rubber:
        deck.note(
            section.block,
            "beside rubber: law = 'saint-venant-kirchhoff', linear in the strain of Green",
        )
    elif obstacle or (yielding is None and deck.nonlinear is None):
        if deck.nonlinear is not None:
            why = f"finite strains are not possible yet {obstacle}"
            deck.lose(
                deck.nonlinear, f"NLGEOM: displacements and rotations are taken as small: {why}"
            )
        return None
    if yielding is None or beside_rubber:
        return {"law": "saint-venant-kirchhoff"} | constants
    return {"law": "j2"} | constants | {"yield_stress": curve[0][1], "hardening": tuple(curve[1:])}
