"""What is asked of a result first, in words: does it hold, how much is left, where is the largest stress, how sure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from signorini_fx.display import results_of, status_in_words
from signorini_fx.quantities.digits import between, figure, percent, solved_prices
from signorini_fx.quantities.families.stress import share_in_words
from signorini_fx.quantities.registry import error_of
from signorini_fx.quantities.text import point_in_words
from signorini_fx.records import CERTIFICATE_TOLERANCE, Status
from signorini_fx.units import with_unit

# The errors of a price list that say something to somebody who has asked for none of them, as they are called there.
_ESTIMATED = ("pressure", "force", "energy")


@dataclass(frozen=True)
class Answer:
    """To a question about a result.

    Attributes:
        question: in words.
        text: the answer, in few words.
        details: sentences without full stops.
        tone: ``good``, ``short`` or ``bad`` where it is a verdict; "": it is none.
    """

    question: str
    text: str
    details: tuple[str, ...] = ()
    tone: str = ""


def answers(summary: dict[str, Any]) -> list[Answer]:
    """Those that the report begins with; ``summary``: the content of summary.json."""
    return [_holds(summary), _left(summary), _stress(summary), _sure(summary)]


def _holds(summary: dict[str, Any]) -> Answer:
    """Whether an equilibrium was found that keeps the laws of contact, and whether the material stays elastic."""
    question = "Does it hold?"
    if not summary["converged"]:
        return _level_of_failure(question, summary)
    if summary.get("incomplete"):
        return Answer(question, "not known", ("what was left out changes the answer",), "bad")
    if not summary["certificate"]["holds"]:
        return Answer(question, "not shown", ("the certificate does NOT hold",), "bad")
    share = (summary.get("utilisation") or {}).get("value")
    balance = "in balance under these loads" + (f": {results_of(summary)}" if "results_of" in summary else "")
    if share is None:
        return Answer(question, "yes", (balance, "strength is not judged: yield_stress in [[material]]"), "good")
    used = f"{share_in_words(summary)} of the yield stress used"
    if share > 1:
        return Answer(question, "no, it would yield", (balance, used), "bad")
    return Answer(question, "yes", (balance, used), "good")


def _level_of_failure(question: str, summary: dict[str, Any]) -> Answer:
    """Of a solve that has failed: up to which level of the loads there is a solution."""
    of, ended = summary.get("results_of", {}), status_in_words(summary)
    if of.get("status") != Status.CONVERGED.value:
        return Answer(question, "not known", (f"no solution: {ended}",), "bad")
    failed = summary["steps"][-1]
    names = [f"{row['name']}, time" if row["name"] else "time" for row in (of, failed)]
    until = f"up to {names[0]} {of['time']:.4g}"
    return Answer(question, until, (f"none found at {names[1]} {failed['time']:.4g}: {ended}",), "bad")


def _left(summary: dict[str, Any]) -> Answer:
    """How many times the loads until it moves, and how much of the strength."""
    question, details, texts = "How much is left?", list[str](), list[str]()
    safety, largest = summary.get("safety"), summary.get("utilisation")
    if safety is not None and summary["converged"]:
        factor = safety["factor"] if safety["exact"] else safety["bound"]
        limit = "no limit by statics" if factor is None else f"{factor:.3g} times these loads"
        texts.append(limit if safety["exact"] or factor is None else f"at most {limit}")
        each = {name: safety[name] for name in ("sliding", "overturning") if name in safety}
        details += [f"{name}: {'no limit' if at is None else f'{at:.3g}'}" for name, at in each.items()]
        if safety["friction_used"] is not None:
            details.append(f"friction used: {100 * safety['friction_used']:.2g} %")
    if largest is not None:
        singular = ", where the stress has no limit as the mesh is refined" if largest.get("no_limit") else ""
        used = f"yield stress used: {share_in_words(summary)}{singular}"
        (details if texts else texts).append(used)
    if not texts:
        return Answer(question, "not known", ("supports hold the body; strength: yield_stress in [[material]]",))
    return Answer(question, "; ".join(texts), tuple(details))


def _stress(summary: dict[str, Any]) -> Answer:
    question, details = "Where is the largest stress?", []
    if pressed := summary.get("max_pressure"):
        pressure = with_unit(figure(pressed, error_of(summary, "max_pressure")), "stress")
        details.append(f"largest contact pressure {pressure}")
    stress = largest_von_mises(summary)
    if stress is None:
        return Answer(question, "not computed", tuple(details))
    if region := stress.get("region"):
        details.insert(0, f"in {region}")
    if why := stress.get("no_limit"):
        details.append(f"no limit as the mesh is refined: {why}")
    value = with_unit(figure(stress["value"], between(summary["stress"])), "stress")
    place = with_unit(point_in_words(stress["place"]), "length")
    return Answer(question, f"at {place}", (f"von Mises stress {value}", *details))


def largest_von_mises(summary: dict[str, Any]) -> dict[str, Any] | None:
    """The larger one of the raw and the recovered von Mises stress; None: there is none."""
    stress = summary.get("stress") or {}
    entries = [(extremes or {}).get("von_mises") for extremes in (stress, stress.get("recovered"))]
    known = [entry for entry in entries if entry and entry["value"] is not None]
    return max(known, key=lambda entry: float(entry["value"])) if known else None


def _sure(summary: dict[str, Any]) -> Answer:
    """How far the mesh and the solution can be trusted."""
    question = "How sure is it?"
    error, known = error_in_words(summary)
    holds = summary["certificate"]["holds"]
    checked = "the certificate holds" if holds else "the certificate does NOT hold"
    if holds:
        checked += f": each condition to {CERTIFICATE_TOLERANCE:.0e}"
    text = f"error {error}" if known else "error of the mesh not estimated"
    return Answer(question, text, (checked, *([] if known else [error])), "" if holds else "bad")


def error_in_words(summary: dict[str, Any]) -> tuple[str, bool]:
    """How wrong the results are: proved, estimated, or how to know it; and whether it is known."""
    bound = summary.get("error_bound") or {}
    if bound.get("relative_error") is not None and bound.get("guaranteed"):
        return f"at most {percent(bound['relative_error'])} of the energy norm, guaranteed", True
    prices = solved_prices(summary)
    known = [f"{name} {percent(prices[name])}" for name in _ESTIMATED if prices.get(name) is not None]
    if known:
        return f"{', '.join(known)}, estimated", True
    of_stress = (summary.get("stress") or {}).get("error")
    if of_stress is not None:
        return f"of the stress {percent(of_stress)} in the mean, estimated", True
    return "not estimated; --accuracy 5% asks for one and reaches it", False
