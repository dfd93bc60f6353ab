"""The linear law of soft contact, from the numbers of an input file or a scene, by code of the judge's own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from signorini_fx.addons.decks.content import Deck
from signorini_fx.addons.decks.text import real
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.tuned import TENSION_OF_CALCULIX


@dataclass(frozen=True)
class SoftLaw:
    """Pressure = stiffness times overclosure; nodes of CalculiX also pull a little where sides are apart.

    Attributes:
        stiffness: stress per length.
        tension: at large clearances, stress.
        apart: whether it presses where the sides are apart, too: in a scene, and in CalculiX nodes against a surface.
    """

    stiffness: float
    tension: float
    apart: bool

    @property
    def words(self) -> str:
        """As it is called."""
        return "the linear law"

    @property
    def reach(self) -> float:
        """The clearance up to which it may press, length."""
        return 0.0

    def pressures(self, overclosure: Floats) -> tuple[Floats, Floats]:
        """The least and the largest pressure at an overclosure, stress, both of its shape.

        Args:
            overclosure: at the points of facets, length, negative where the sides are apart, shape (f, q); or at nodes,
                shape (n, 1).
        """
        h = overclosure
        plain = self.stiffness * np.maximum(h, 0.0)
        if not (self.apart and self.tension > 0):
            return plain, plain
        smooth = self.stiffness * h * (0.5 + np.arctan(self.stiffness * h / (np.pi * self.tension)) / np.pi)
        return np.minimum(smooth, plain), plain

    def overclosure(self, pressure: Floats) -> Floats:
        """That at a pressure > 0, length, shape (n,)."""
        return np.asarray(pressure / self.stiffness)

    def give(self, pressure: Floats) -> Floats:
        """The pressure over its derivative by the overclosure, length, shape (n,): how soft contact is there."""
        return np.asarray(pressure / self.stiffness)


def law_of_scene(entry: Any) -> SoftLaw | None:
    """That of a contact of a scene; None: it has none."""
    stated = getattr(entry, "overclosure", None)
    return None if stated is None else SoftLaw(stated.stiffness, 0.0, apart=True)


def law_of_deck(deck: Deck, interaction: str, *, nodal: bool) -> SoftLaw | None:
    """That of an interaction of an input file, from its *SURFACE BEHAVIOR; None: contact is hard.

    Args:
        deck: what was read.
        interaction: its name.
        nodal: whether nodes touch a surface.
    """
    known = deck.interactions.get(interaction)
    if known is None or known.behaviour is None or known.stiffness is None or known.tied:
        return None
    words = known.behaviour.rows[0]
    given = real(words[1]) if len(words) > 1 else 0.0
    completed = _first_modulus(deck) * TENSION_OF_CALCULIX if nodal else 0.0
    return SoftLaw(known.stiffness, given if given > 0 else completed, nodal)


def _first_modulus(deck: Deck) -> float:
    """Young's modulus of the first material, by which CalculiX completes a linear law; 0: it is not known."""
    for block in deck.model.blocks:
        if block.keyword == "ELASTIC" and block.rows and block.rows[0]:
            return real(block.rows[0][0])
    return 0.0
