"""Rubber and metal that yields of an Abaqus input file, as nonlinear materials of a scene.  No dolfinx here."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

from signorini_fx.addons.decks.content import Deck, DeckSection
from signorini_fx.addons.decks.keywords import (
    BESIDE_RUBBER,
    FIRST_LINE,
    NOT_YET_NONLINEAR,
    OTHER_HARDENING,
    OTHER_RUBBER,
    YIELDING_RUBBER,
)
from signorini_fx.mechanics.mesh.files.abaqus_blocks import DeckBlock, DeckError, parameter, real

# By the parameters of *HYPERELASTIC that name an energy: its law; a polynomial is what it is without any.
_ENERGIES = {
    "NEOHOOKE": "neo-hooke",
    "MOONEY-RIVLIN": "mooney-rivlin",
    "OGDEN": "ogden",
    "POLYNOMIAL": "mooney-rivlin",
    "REDUCEDPOLYNOMIAL": "neo-hooke",
}
_OTHER_ENERGIES = ("ARRUDA-BOYCE", "YEOH", "MARLOW", "VANDERWAALS", "USER", "TESTDATAINPUT")
_FIRST_TERM = ("POLYNOMIAL", "REDUCEDPOLYNOMIAL")


def read_rubber(deck: Deck, block: DeckBlock, material: str) -> None:
    """*HYPERELASTIC: its energy, with kappa = 2 / D1 and, of Ogden, 2 mu / alpha for its mu.

    Raises:
        DeckError: scenes do not know the energy.
    """
    parameters = block.parameters
    named = [key for key in _ENERGIES if key in parameters] or ["POLYNOMIAL"]
    terms = round(parameter(block, "N")) if "N" in parameters else 1
    law = _ENERGIES[named[0]]
    if any(key in parameters for key in _OTHER_ENERGIES) or (named[0] in _FIRST_TERM and terms != 1):
        raise DeckError(block, OTHER_RUBBER)
    count = {"neo-hooke": 2, "mooney-rivlin": 3, "ogden": 3 * terms}[law]
    words = [real(word) for row in block.rows for word in row]
    if len(words) < count:
        raise ValueError(f"{count} constants are expected")
    volumes = words[count - (terms if law == "ogden" else 1) : count]
    if not volumes[0] > 0 or any(volumes[1:]):
        raise DeckError(block, OTHER_RUBBER)
    if len(block.rows) > -(-count // 8):
        deck.lose(block, FIRST_LINE)
    lines: dict[str, Any] = {"law": "ogden" if law == "ogden" else "mooney-rivlin"}
    if law == "ogden":
        if not all(words[1 : 2 * terms : 2]) or not min(words[: 2 * terms : 2]) > 0:
            raise ValueError("mu must be above 0 here, and no exponent alpha zero")
        lines["mu"] = [
            2 * mu / alpha for mu, alpha in zip(words[: 2 * terms : 2], words[1 : 2 * terms : 2], strict=True)
        ]
        lines["alpha"] = words[1 : 2 * terms : 2]
    else:
        if min(words[: count - 1]) < 0 or not sum(words[: count - 1]) > 0:
            raise ValueError("C10 and C01 must not be negative here, and their sum be above 0")
        lines |= dict(zip(("c10", "c01"), words[: count - 1], strict=False))
    lines["bulk"] = 2 / volumes[0]
    deck.materials[material]["rubber"] = lines, block


def read_hardening(deck: Deck, block: DeckBlock, material: str) -> None:
    """*PLASTIC: rows of yield stresses and plastic strains, which begin at 0, of one temperature."""
    if block.parameters.get("HARDENING", "ISOTROPIC").upper() != "ISOTROPIC":
        deck.lose(block, OTHER_HARDENING)
        return
    rows = [[*map(real, row), 0.0, 0.0][:3] for row in block.rows]
    if any(row[2] != rows[0][2] for row in rows):
        deck.lose(block, FIRST_LINE)
    curve = [(strain, stress) for stress, strain, temperature in rows if temperature == rows[0][2]]
    if curve[0][0] != 0.0:
        raise ValueError("the first plastic strain must be 0")
    if any(b[0] <= a[0] or b[1] < a[1] for a, b in itertools.pairwise(curve)):
        raise ValueError("plastic strains must increase from row to row, and yield stresses not decrease")
    deck.materials[material]["plastic"] = curve, block


def nonlinear_law(deck: Deck, section: DeckSection, obstacle: str) -> list[str] | None:
    """The lines of a material that is not linear; None: it is linear here.

    Beside rubber one with two constants is that of Saint Venant and Kirchhoff, which knows finite strains.

    Args:
        deck: the input file.
        section: of the material.
        obstacle: what of the scene does not go together with one; "": nothing.

    Raises:
        DeckError: it is rubber, and there is an obstacle.
    """
    properties = deck.materials[section.material]
    _, yielding = properties.get("plastic", (None, None))
    if "rubber" in properties:
        if yielding is not None:
            deck.lose(yielding, YIELDING_RUBBER)
        lines, block = properties["rubber"]
        if lines["law"] == "ogden" and deck.mesh.dim == 3:
            obstacle = "in space with OGDEN: take MOONEY-RIVLIN"
        if obstacle:
            raise DeckError(block, f"{NOT_YET_NONLINEAR} {obstacle}")
        return _written(lines)
    beside_rubber = has_rubber(deck)
    if yielding is not None:
        if not obstacle and "young" not in properties:
            obstacle = "with directions"
        obstacle = obstacle or ("beside rubber" if beside_rubber else "")
        if obstacle:
            deck.lose(yielding, f"{NOT_YET_NONLINEAR} {obstacle}: elastic here")
    if "young" not in properties or (yielding is None and not beside_rubber and not deck.finite):
        return None
    constants = {"law": "j2", "young": properties["young"], "poisson": properties["poisson"]}
    if beside_rubber:
        deck.note(section.block, BESIDE_RUBBER)
        return _written(constants | {"law": "saint-venant-kirchhoff"})
    if obstacle:
        return None
    if yielding is None:
        return _written(constants | {"law": "saint-venant-kirchhoff"})
    curve, _ = properties["plastic"]
    hardening = {"hardening": [list(row) for row in curve[1:]]} if len(curve) > 1 else {}
    return _written(constants | {"yield_stress": curve[0][1]} | hardening)


def has_rubber(deck: Deck) -> bool:
    """Whether a part of the body is rubber."""
    return any("rubber" in deck.materials.get(section.material, {}) for section in deck.sections)


def obstacle_of(deck: Deck, contacts: Sequence[Sequence[str]], *, heated: bool) -> str:
    """What of a scene does not go together with nonlinear materials, in words after "not possible yet"; "": nothing."""
    lines = [line for contact in contacts for line in contact]
    for wrong, words in (
        (any(_bonded(contact) and not _between(contact) for contact in contacts), "with a rigid body that is tied"),
        (any(line.startswith("overclosure") for line in lines), "with soft contact"),
        (deck.hypothesis == "plane stress", "in plane stress"),
        # CalculiX takes alpha T from grad u there: another material than one that expands and is deformed then.
        (heated and (deck.finite or has_rubber(deck)), "with temperature at finite strains"),
        (bool(deck.links), "with links between nodes"),
        (bool(deck.bolts), "with a preload"),
    ):
        if wrong:
            return words
    return ""


def sliding_lines(deck: Deck, contacts: Sequence[list[str]], obstacle: str) -> list[list[str]]:
    """The lines of contacts with what they say of sliding where bodies are nonlinear: what is tied, nominal or adjusted
    keeps its partners, and so do sides of degree 2 in space.

    Args:
        deck: the input file.
        contacts: the lines of each.
        obstacle: what of the scene does not go together with nonlinear materials; "": nothing.
    """
    if obstacle or not (deck.finite or any({"rubber", "plastic"} & made.keys() for made in deck.materials.values())):
        return list(contacts)
    in_space = deck.mesh.dim == 3 and deck.mesh.degree == 2
    return [
        [*lines, 'sliding = "small"'] if _between(lines) and (in_space or _keeps_partners(lines)) else lines
        for lines in contacts
    ]


def _between(lines: Sequence[str]) -> bool:
    """Whether a contact is one of two bodies."""
    return any(line.startswith("against") for line in lines)


def _bonded(lines: Sequence[str]) -> bool:
    return any(line.startswith("kind") and "bonded" in line for line in lines)


def _keeps_partners(lines: Sequence[str]) -> bool:
    """Whether a contact of two bodies is one that sides which slide cannot have."""
    return _bonded(lines) or any(line.startswith(("distance", "adjust")) for line in lines)


def _written(constants: dict[str, Any]) -> list[str]:
    """As lines of a table."""
    return [
        f'{key} = "{value}"' if isinstance(value, str) else f"{key} = {value!r}" for key, value in constants.items()
    ]
