"""The safety factor of a body that supports do not hold."""

from __future__ import annotations

from typing import Any

from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.quantities.digits import percent
from signorini_fx.quantities.kinds import Number, Row, described
from signorini_fx.quantities.quantity import Card, Quantity, Summary
from signorini_fx.quantities.text import row
from signorini_fx.records import PROVED_FOR_BODY

# Of live loads that pressures balance by themselves, whatever their size: no share of the friction is used up.
NO_FRICTION_NEEDED = "the live loads need no friction"


class SafetyFigures(Row):
    """Of the live loads."""

    factor: Number = described("Contact tractions that the law allows for were found that balance this multiple.")
    bound: Number = described("It is proved that none balance a larger one.")
    exact: bool = described(
        "Whether the body stays up to `factor`; with Coulomb friction `bound` is an upper bound only."
    )
    friction_used: Number = described(
        "Share of the friction of this solution that the live loads use; null without Coulomb friction."
    )
    motion: str = described("The motion beyond the factor.")
    sliding: Number = described("The multiple at which the body slides, however it would tip; null: no limit.")
    overturning: Number = described(
        "The multiple at which it tips or lifts off, however it would slide; null: no limit."
    )
    body: list[Number] = described(
        "Between which the factor is proved to be for the body with all points of its surface; 0, null: not."
    )
    reason: str = described("Why nothing is proved of the body; empty: something is.")
    assumed: str = described("What the factors rest on.")
    of_body: bool = described("Whether the factor is proved for the body, and not only for its mesh.")


class SafetyOfSolution(Quantity):
    """Of the live loads."""

    key, kind, first = "safety", SafetyFigures, True
    title = "The largest multiple of the live loads at which a body that supports do not hold stays; null: no limit."
    terminal, report = "safety factor", "safety factor"

    def asked(self, solution: Any) -> bool:
        """See ``Quantity``."""
        return solution.contact is not None

    def value(self, solution: Any) -> Any:
        """See ``Quantity``."""
        safety = solution.safety
        return None if safety is None else safety.as_dict()

    def lines(self, summary: Summary) -> list[TerminalLine]:
        """See ``Quantity``: the factor, the motion beyond it, and what it does not say."""
        if self.key not in summary:
            return []
        safety = summary[self.key]
        beyond = "" if safety["factor"] is None else f"; beyond, {safety['motion']}"
        parts = [safety_factor(safety) + beyond, *friction_in_use(safety), safety_proved(safety)]
        return [row(self.terminal, "; ".join([*parts, *safety_assumed(safety)]))]

    def cards(self, summary: Summary) -> list[Card]:
        """See ``Quantity``."""
        if self.key not in summary:
            return []
        safety = summary[self.key]
        beyond = [f"beyond, {safety['motion']}"] if safety["motion"] else []
        remark = "; ".join([*beyond, *friction_in_use(safety), *safety_assumed(safety)])
        return [Card(self.report, safety_factor(safety), remark=remark, wide=True)]


class HeldBySupports(Quantity):
    """So that there is no safety factor to be asked for."""

    key, kind, scope, stage = "held_by_supports", bool, "all", "results"
    title = "Whether supports leave the body no rigid motion, so that no load can move it away."

    def value(self, solution: Any) -> Any:
        """See ``Quantity``."""
        return solution.model.motions.free.shape[1] == 0


def safety_assumed(safety: dict[str, Any]) -> list[str]:
    """What a safety factor rests on."""
    return [f"assumed: {safety['assumed']}"] if safety.get("assumed") else []


def safety_proved(safety: dict[str, Any]) -> str:
    """Of what a safety factor is proved: of the body, or only of its mesh."""
    if safety["of_body"]:
        return PROVED_FOR_BODY
    if safety["reason"]:
        return f"proved for its mesh ({safety['reason']})"
    low, high = safety["body"]
    limits = [f"at least {low:.4g}"] * bool(low) + ([] if high is None else [f"at most {high:.4g}"])
    return "proved for its mesh" + (f", for the body {' and '.join(limits)}" if limits else "")


def safety_factor(safety: dict[str, Any]) -> str:
    """The safety factor of a summary, an upper bound if it is not exact, and those of sliding and overturning."""
    if safety["factor"] is None:
        return "no limit by statics"
    each = {name: safety[name] for name in ("sliding", "overturning") if name in safety}
    told = [f"{name} {'no limit' if value is None else f'{value:.4g}'}" for name, value in each.items()]
    whole = f"{safety['factor']:.4g}" if safety["exact"] else f"at most {safety['bound']:.4g}"
    return f"{whole} ({', '.join(told)})" if told else whole


def friction_in_use(safety: dict[str, Any]) -> list[str]:
    """What Coulomb friction makes of a safety factor; nothing without it."""
    if safety["exact"]:
        return []
    used = safety["friction_used"]
    if used == 0:
        return [NO_FRICTION_NEEDED]
    share = "" if used is None else f": the live loads use {100 * used:.3g} % of it, with its bounds as they are"
    return [f"friction may give way before{share}"]


def used_friction(safety: dict[str, Any]) -> str:
    """How much of its friction a result uses, in few words; "": that is not known."""
    used = safety["friction_used"]
    if used is None:
        return ""
    return f"friction used: {percent(used)}" if used else NO_FRICTION_NEEDED


QUANTITIES = (SafetyOfSolution(), HeldBySupports())
