"""The extremes of the stress in the body."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.mechanics.statement.units import with_unit
from signorini_fx.quantities.digits import between, figure, percent
from signorini_fx.quantities.kinds import ExtremeOfStress, Number, Row, described, perhaps
from signorini_fx.quantities.quantity import Card, Quantity, Summary
from signorini_fx.quantities.text import digits, point_in_words, row
from signorini_fx.quantities.validity import validity_of
from signorini_fx.tuned import FAR_ABOVE_YIELD


class RecoveredExtremes(Row):
    """Extremes of the recovered stress."""

    von_mises: ExtremeOfStress
    largest_principal: ExtremeOfStress
    smallest_principal: ExtremeOfStress
    largest_zz: ExtremeOfStress = perhaps()
    smallest_zz: ExtremeOfStress = perhaps()


class StressExtremes(RecoveredExtremes):
    """Extremes of the raw stress, and of the recovered one."""

    recovered: RecoveredExtremes | None = described(
        "Those of the recovered stress; null of nonlinear materials, and if the displacement is not a number."
    )
    error: Number = described(
        "Estimated error of the raw stress in the energy norm, relative; null of nonlinear materials, and without "
        "stress."
    )


class ExtremeOfPlasticStrain(Row):
    """A strain and where it is."""

    value: Number
    place: Annotated[list[Number], Field(max_length=3)]
    region: str | None = described("Name of the region of its material, if there are several.", default=None)


class Stress(Quantity):
    """Raw and recovered."""

    key, unit, kind, stage = "stress", "stress", StressExtremes, "fields"
    title = (
        "Extremes of the raw stress at the nodes, and of the recovered one; of nonlinear materials those of the Cauchy "
        "stress at the points of quadrature; absent if no fields were written."
    )
    terminal, report = "von Mises stress", "largest von Mises stress"

    def value(self, solution: Any) -> Any:
        stress = solution.known_stress
        return None if stress is None else stress.as_dict()

    def lines(self, summary: Summary) -> list[TerminalLine]:
        """See ``Quantity``: the largest value with the digits that raw and recovered stress both have; or why it has no
        limit.
        """
        if self.key not in summary:
            return []
        stress = summary[self.key]
        raw, recovered, apart = stress["von_mises"], stress["recovered"], between(stress)
        region = f" in {raw['region']}" if raw.get("region") else ""
        text = f"{digits(raw['value'], apart)} at most, at {point_in_words(raw['place'])}{region}"
        if recovered is not None and apart is not None:
            text += f"; recovered {digits(recovered['von_mises']['value'], apart)}"
        if (why := raw.get("no_limit")) is not None:
            text += f"; it has no limit as the mesh is refined: {why}"
        error = "" if stress["error"] is None else f"; estimated error in the mean {percent(stress['error'])}"
        return [row(self.terminal, text + error)]

    def cards(self, summary: Summary) -> list[Card]:
        """See ``Quantity``: the larger one of the raw and the recovered one, and what it is worth."""
        if self.key not in summary:
            return []
        largest = largest_von_mises(summary)
        if largest is None:
            return []
        value = with_unit(figure(largest["value"], between(summary[self.key])), self.unit)
        remark = f"{largest['of']}, at {with_unit(point_in_words(largest['place']), 'length')}"
        if region := largest.get("region"):
            remark += f" in {region}"
        if why := largest.get("no_limit"):
            remark += f"; no limit as the mesh is refined: {why}"
        return [Card(self.report, value, remark=remark)]


class PlasticStrain(Quantity):
    """Of materials that yield."""

    key, kind, stage = "plastic_strain", ExtremeOfPlasticStrain, "fields"
    title = (
        "Largest accumulated (equivalent) plastic strain at the points of quadrature, and where; absent if no material "
        "is one that yields, or no fields were written."
    )
    terminal, report = "plastic strain", "largest plastic strain"

    def value(self, solution: Any) -> Any:
        stress = solution.known_stress
        return None if stress is None else stress.plastic_extreme()

    def lines(self, summary: Summary) -> list[TerminalLine]:
        return [row(self.terminal, f"{card.text} {card.remark}".rstrip()) for card in self.cards(summary)]

    def cards(self, summary: Summary) -> list[Card]:
        """See ``Quantity``: the value and its place; or that nothing has yielded."""
        if self.key not in summary:
            return []
        text, remark = yielding_in_words(summary)
        return [Card(self.report, text, remark=remark)]


class Utilisation(Quantity):
    """Of the raw and the recovered stress that which uses more."""

    key, kind, stage = "utilisation", ExtremeOfStress, "fields"
    title = "Largest von Mises stress over the yield stress, and where; absent if no material has a yield stress."
    terminal, report = "yield stress used", "yield stress used"

    def value(self, solution: Any) -> Any:
        stress = solution.known_stress
        return None if stress is None else stress.utilisation()

    def lines(self, summary: Summary) -> list[TerminalLine]:
        return [row(self.terminal, f"{card.text} {card.remark}") for card in self.cards(summary)]

    def cards(self, summary: Summary) -> list[Card]:
        """See ``Quantity``: the share, where it is reached, and what follows if it is above 1."""
        if self.key not in summary:
            return []
        largest = summary[self.key]
        region = f" in {largest['region']}" if largest.get("region") else ""
        text = f"at {with_unit(point_in_words(largest['place']), 'length')}{region}"
        if largest["value"] is not None and largest["value"] > 1:
            text += "; it would yield, which linear elasticity does not know"
        if why := largest.get("no_limit"):
            text += f"; no limit as the mesh is refined: {why}"
        return [Card(self.report, share_in_words(summary), remark=text)]


def largest_von_mises(summary: Summary) -> dict[str, Any] | None:
    """The larger one of the raw and the recovered von Mises stress, and which it is ``of``; None: there is none."""
    stress = summary.get("stress") or {}
    extremes = {"raw": stress.get("von_mises"), "recovered": (stress.get("recovered") or {}).get("von_mises")}
    known = [entry | {"of": name} for name, entry in extremes.items() if entry and entry["value"] is not None]
    return max(known, key=lambda entry: float(entry["value"])) if known else None


def marked_stress(summary: Summary) -> tuple[list[float], str] | None:
    """The place of the largest von Mises stress and its value, as the answers have them; None: it may not be used."""
    largest = largest_von_mises(summary) if validity_of(summary).solved else None
    if largest is None or not largest["value"] > 0:
        return None
    return largest["place"], figure(largest["value"], between(summary["stress"]))


def share_in_words(summary: Summary, of: str = "") -> str:
    """How much of the yield stress is used, with the digits that the stress has: a share of it, such as 41 %, far above
    it how many times, and above it at a place where the stress has no limit no figure, which each mesh would change.

    Args:
        summary: with the share.
        of: the yield stress by its name; "": who reads it knows what is meant.
    """
    largest, apart = summary["utilisation"], between(summary["stress"])
    share = largest["value"]
    if share is not None and share > 1 and largest.get("no_limit"):
        return f"{'far ' * (share > FAR_ABOVE_YIELD)}above {of or '100 %'}"
    if share is not None and share > FAR_ABOVE_YIELD:
        return f"{figure(share, apart)} times{' ' * bool(of)}{of}"
    return f"{figure(None if share is None else 100 * share, apart)} %{' of ' * bool(of)}{of}"


def yielding_in_words(summary: Summary) -> tuple[str, str]:
    """The largest plastic strain, and where it is; zero and that nothing yields.

    Args:
        summary: with a ``plastic_strain``.
    """
    largest = summary["plastic_strain"]
    if largest["value"] == 0:
        return "0", "nothing has yielded"
    region = f" in {largest['region']}" if largest.get("region") else ""
    return figure(largest["value"]), f"at {with_unit(point_in_words(largest['place']), 'length')}{region}"


QUANTITIES = (Stress(), PlasticStrain(), Utilisation())
