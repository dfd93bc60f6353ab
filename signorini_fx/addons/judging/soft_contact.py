"""Laws of soft contact, from the numbers of an input file or a scene, by code of the judge's own.

Programs differ in where a law ends: of an exponential one CalculiX has none beyond c_0, and between faces none where
the sides are apart; a scene has its tangent there.  Beyond the last row of a table CalculiX keeps its pressure, and a
scene continues its line.  A law is an interval of pressures there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from signorini_fx.addons.decks.content import Deck
from signorini_fx.mechanics.mesh.files.abaqus_blocks import real
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.tuned import TENSION_OF_CALCULIX

# The share of p_0 that an exponential law has left at the clearance c_0.
_LEFT = 100.0


@dataclass(frozen=True)
class SoftLaw:
    """How pressure and overclosure belong together.

    Attributes:
        kind: linear, exponential or tabular.
        rows: its numbers: [stiffness, tension at large clearances], stress per length and stress; [c_0, p_0], length
            and stress; or [pressure, overclosure], both increasing, stress and length.
        apart: whether it presses where the sides are apart, too: in a scene, and in CalculiX nodes against a surface.
    """

    kind: str
    rows: tuple[tuple[float, ...], ...]
    apart: bool

    @property
    def words(self) -> str:
        """As it is called."""
        return f"the {self.kind} law"

    @property
    def reach(self) -> float:
        """The clearance up to which it may press, length."""
        if self.kind == "exponential":
            return float(self.rows[0][0] * (1 + 1 / np.log(_LEFT)))
        return max(-self.rows[0][1], 0.0) if self.kind == "tabular" else 0.0

    def pressures(self, overclosure: Floats) -> tuple[Floats, Floats]:
        """The least and the largest pressure at an overclosure, stress, both of its shape.

        Args:
            overclosure: at the points of facets, length, negative where the sides are apart, shape (f, q); or at nodes,
                shape (n, 1).
        """
        h = overclosure
        if self.kind == "linear":
            stiffness, tension = self.rows[0]
            plain = stiffness * np.maximum(h, 0.0)
            if not (self.apart and tension > 0):
                return plain, plain
            smooth = stiffness * h * (0.5 + np.arctan(stiffness * h / (np.pi * tension)) / np.pi)
            return np.minimum(smooth, plain), plain
        if self.kind == "exponential":
            clearance, pressure = self.rows[0]
            rate = np.log(_LEFT) / clearance
            law = pressure * np.exp(rate * np.maximum(h, -clearance))
            high = law * np.maximum(1 + rate * np.minimum(h + clearance, 0.0), 0.0)
            if self.apart:
                return np.where(h >= -clearance, high, 0.0), high
            # It begins with p_0 at once, which quadrature of facets that are partly apart does not resolve.
            closed = (h >= 0).all(axis=1, keepdims=True)
            return np.where(closed, high, 0.0), np.where(closed, high, high.max(axis=1, keepdims=True))
        p, depth = np.array(self.rows).T
        low: Floats = np.interp(h, depth, p)
        beyond = np.maximum(h - depth[-1], 0.0) * (p[-1] - p[-2]) / (depth[-1] - depth[-2])
        return np.where((h > 0) | self.apart, low, 0.0), low + beyond

    def overclosure(self, pressure: Floats) -> Floats:
        """That at a pressure > 0, length, shape (n,)."""
        if self.kind == "linear":
            return np.asarray(pressure / self.rows[0][0])
        if self.kind == "exponential":
            clearance, full = self.rows[0]
            return np.asarray(clearance * np.log(np.maximum(pressure / full, 1 / _LEFT)) / np.log(_LEFT))
        p, h = np.array(self.rows).T
        beyond = np.maximum(pressure - p[-1], 0.0) * (h[-1] - h[-2]) / (p[-1] - p[-2])
        return np.asarray(np.interp(pressure, p, h) + beyond)

    def give(self, pressure: Floats) -> Floats:
        """The pressure over its derivative by the overclosure, length, shape (n,): how soft contact is there."""
        if self.kind == "linear":
            return np.asarray(pressure / self.rows[0][0])
        if self.kind == "exponential":
            return np.full_like(pressure, self.rows[0][0] / np.log(_LEFT))
        p, h = np.array(self.rows).T
        row = np.clip(np.searchsorted(p, pressure, side="right") - 1, 0, len(p) - 2)
        return np.asarray(pressure * (np.diff(h) / np.diff(p))[row])


def law_of_scene(entry: Any) -> SoftLaw | None:
    """That of a contact of a scene; None: it has none."""
    stated = getattr(entry, "overclosure", None)
    if stated is None:
        return None
    if stated.law == "linear":
        return SoftLaw(stated.law, ((stated.stiffness, 0.0),), apart=True)
    if stated.law == "exponential":
        return SoftLaw(stated.law, ((stated.clearance, stated.pressure),), apart=True)
    return SoftLaw(stated.law, tuple(tuple(row) for row in stated.rows), apart=True)


def law_of_deck(deck: Deck, interaction: str, *, nodal: bool) -> SoftLaw | None:
    """That of an interaction of an input file, from its *SURFACE BEHAVIOR; None: contact is hard.

    Args:
        deck: what was read.
        interaction: its name.
        nodal: whether nodes touch a surface.
    """
    block = deck.behaviours.get(interaction)
    if block is None:
        return None
    kind = block.parameters.get("PRESSURE-OVERCLOSURE", "HARD").lower()
    rows = [[*map(real, row)] for row in block.rows]
    return _law(kind, rows, _first_modulus(deck) if nodal else 0.0, nodal=nodal)


def _law(kind: str, rows: Sequence[Sequence[float]], young: float, *, nodal: bool) -> SoftLaw | None:
    if kind == "linear" and rows and rows[0] and rows[0][0] > 0:
        tension = rows[0][1] if len(rows[0]) > 1 and rows[0][1] > 0 else young * TENSION_OF_CALCULIX
        return SoftLaw(kind, ((rows[0][0], tension),), nodal)
    if kind == "exponential":
        return SoftLaw(kind, ((rows[0][0], rows[0][1]),), nodal)
    if kind != "tabular":
        return None
    pairs = [(row[0], row[1]) for row in rows]
    (first, at), (second, further) = pairs[:2]
    # A law that begins with a pressure comes from none on its first line.
    start = [(0.0, at - first * (further - at) / (second - first))] if first > 0 else []
    return SoftLaw(kind, (*start, *pairs), nodal)


def _first_modulus(deck: Deck) -> float:
    """Young's modulus of the first material, by which CalculiX completes a linear law; 0: it is not known."""
    for block in deck.model.blocks:
        if block.keyword == "ELASTIC" and block.rows and block.rows[0]:
            return real(block.rows[0][0])
    return 0.0
