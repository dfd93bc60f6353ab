"""What is asked of a result first, in words: does it hold, how much is left, where is the largest stress, how sure.

The four answers are of what the figures are of, see ``validity``: of a solution, of the last load step that has one, or
of none; then there is no figure among them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from signorini_fx.machine.display import load_step
from signorini_fx.mechanics.statement.units import with_unit
from signorini_fx.quantities.digits import between, figure, percent, solved_prices
from signorini_fx.quantities.shown import error_of
from signorini_fx.quantities.text import (
    cost_in_words,
    largest_von_mises,
    point_in_words,
    share_in_words,
    yielding_in_words,
)
from signorini_fx.quantities.validity import Validity, validity_of, was_solved
from signorini_fx.records import Status
from signorini_fx.tuned import CERTIFICATE_TOLERANCE

# Of a share of the yield stress at a place where the stress has no limit, which the first answer tells.
_NOT_SHOWN = "strength is not shown"
# The errors of a convergence table that say something to somebody who has asked for none of them, as they are called
# there.
_ESTIMATED = ("pressure", "force", "energy")
# What statics proves of a body without a solution, or finds before one is looked for.
_MOVES_AWAY = {Status.NOT_HELD, Status.OPEN, Status.TIPS, Status.SLIDES}


@dataclass(frozen=True)
class Answer:
    """To a question about a result."""

    question: str  # in words
    text: str  # the answer, in few words
    details: tuple[str, ...] = ()  # sentences without full stops
    tone: str = ""  # ``good``, ``short`` or ``bad`` where it is a verdict; "": it is none


def answers(summary: dict[str, Any]) -> list[Answer]:
    """Those that the report begins with; ``summary``: the content of summary.json."""
    questions = {
        "Does it hold?": _holds,
        "How much is left?": _what_is_left,
        "Where is the largest stress?": _stress,
        "How sure is it?": _sure,
    }
    all_answers = [replace(answer(summary), question=question) for question, answer in questions.items()]
    if not (summary.get("incomplete") and validity_of(summary).solved):
        return all_answers
    holds, *further_answers = all_answers
    return [
        holds,
        *(
            replace(answer, details=(*answer.details, "of the scene without what was left out"), tone="")
            for answer in further_answers
        ),
    ]


def _holds(summary: dict[str, Any]) -> Answer:
    """Whether an equilibrium was found that keeps the laws of contact, and whether the material stays elastic."""
    validity = validity_of(summary)
    if summary.get("incomplete"):
        return Answer("", "not known", ("what was left out changes the answer",), "bad")
    if validity is Validity.NO_SOLUTION:
        return Answer("", "no" if _status(summary) in _MOVES_AWAY else "not known", (_failure(summary),), "bad")
    if not summary["certificate"]["holds"]:
        return Answer("", "not shown", ("the certificate does NOT hold",), "bad")
    strength = Strength.of(summary)
    details = [_balance(summary), strength.statement]
    if strength.exceeded:
        return Answer("", "no, it would yield", tuple(details), "bad")
    if validity is Validity.EARLIER_STEP:
        step = load_step(summary["results_of"])
        return Answer("", f"up to {step}", tuple(details), "bad")
    if law := _other_law(summary):
        details.append("not with the contact law that was asked for")
    if strength.singular:
        shown = details if "results_of" in summary else details[1:]  # the answer says the first one
        return Answer("", "in balance; strength not shown", tuple(shown), "short")
    if validity is Validity.LESS_ACCURATE:
        return Answer("", "yes", (*details, f"less accurate than required: {summary['status']}"), "short")
    return Answer("", "yes", tuple(details), "short" if law else "good")


def _balance(summary: dict[str, Any]) -> str:
    """Under which loads there is an equilibrium, and under which none was found."""
    of, steps = summary.get("results_of"), summary.get("steps", [])
    if of is None:
        return "in balance under these loads"
    if validity_of(summary) is Validity.EARLIER_STEP:
        return f"{load_step(steps[-1])}: {_failure(summary)}"
    return f"in balance in all {len(steps)} load steps" if len(steps) > 1 else "in balance in its load step"


def _status(summary: dict[str, Any]) -> Status:
    return Status(summary["status"])


def _failure(summary: dict[str, Any]) -> str:
    """Why there is no solution."""
    status = _status(summary)
    found = validity_of(summary) is Validity.NO_SOLUTION and summary["certificate"]["holds"]  # what means nothing
    if status in _MOVES_AWAY or found:
        return status.value
    return f"no solution was found ({status.value}); there may be one"


@dataclass(frozen=True)
class Strength:
    """How much of the yield stress is used."""

    statement: str  # the share with what limits it, or why it is not judged
    share: str = ""  # the share; "": it is not known
    exceeded: bool = False  # whether it is above 1
    singular: bool = False  # whether it is below 1 at a place where the stress has no limit

    @property
    def is_known(self) -> bool:
        """Whether there is a share."""
        return bool(self.share)

    @classmethod
    def of(cls, summary: dict[str, Any]) -> Strength:
        """That of the load step that the figures are of."""
        largest = summary.get("utilisation") or {}
        value, no_limit = largest.get("value"), bool(largest.get("no_limit"))
        materials = (summary.get("scene") or {}).get("material") or []
        if value is None:
            if _of_a_nonlinear_scene(summary):
                return cls(_yielding(summary))
            if any(material.get("yield_stress") for material in materials):
                return cls("strength is not judged: no fields were written, leave --no-fields out")
            if materials and not any("yield_stress" in material for material in materials):
                return cls("strength is not judged: no yield stress is known of such a material")
            if _arguments(summary):
                return cls("strength is not judged: forms do not say at which stress a material yields")
            return cls("strength is not judged: give yield_stress in [[material]]")
        share = share_in_words(summary, "the yield stress")
        statement = share = f"{share} used" if "%" in share else share
        if "results_of" in summary:
            statement = f"{statement} at {load_step(summary['results_of'])}"
        if no_limit:
            where = largest["no_limit"].removeprefix("it is ")
            statement += (
                f" on this mesh, {where}; the stress has no limit there as it is refined: judge it at a distance"
            )
        if len(summary.get("steps", ())) > 1:
            statement += "; other load steps are not judged"
        unjudged = [material.get("region") or "the body" for material in materials if not material.get("yield_stress")]
        if unjudged:
            statement += f"; without a yield stress: {', '.join(unjudged)}"
        return cls(statement, share, value > 1, no_limit and value <= 1)


def _what_is_left(summary: dict[str, Any]) -> Answer:
    """How much of the strength and of the friction, or beyond which load step nothing."""
    validity, moves_away = validity_of(summary), _status(summary) in _MOVES_AWAY
    if not validity.solved:
        nothing_left = moves_away and not summary.get("incomplete")
        return Answer("", "nothing" if nothing_left else "not known", (_failure(summary),), "bad")
    strength, used = Strength.of(summary), summary.get("friction_used")
    if validity is Validity.EARLIER_STEP:
        last, failed = (load_step(step) for step in (summary["results_of"], summary["steps"][-1]))
        if strength.exceeded:
            return Answer("", f"nothing: {strength.share}", (f"at {last}",), "bad")
        text = f"nothing at {failed}" if moves_away else f"no solution was found beyond {last}"
        first = _NOT_SHOWN if strength.singular else strength.share if strength.is_known else strength.statement
        return Answer("", text, (f"at {last}: {first}",), "bad")
    if used is not None:
        friction = f"friction used: {percent(used)}" if used else "the loads need no friction"
    elif summary.get("held_by_supports"):
        friction = "supports hold it, so that no load moves it away"
    else:
        friction = "no multiple of the loads is known at which it moves away"
    if strength.exceeded:
        return Answer("", f"nothing: {strength.share}", (friction,), "bad")
    texts = [strength.share] if strength.is_known and not strength.singular else []
    details = list[str]()
    (details if used is None else texts).append(friction)
    if strength.singular:
        details.append(_NOT_SHOWN)
    elif not texts:
        details.append(strength.statement)
    return Answer("", "; ".join(texts) or "not known", tuple(details))


def _stress(summary: dict[str, Any]) -> Answer:
    validity, details = validity_of(summary), list[str]()
    if not validity.solved:
        reason = "no solution was found, and so no stress"
        if _status(summary) in _MOVES_AWAY:
            reason = "there is no solution, and so no stress"
        elif summary["certificate"]["holds"]:
            reason = _failure(summary)
        return Answer("", "not known", (reason,))
    if pressed := summary.get("max_pressure"):
        pressure = with_unit(figure(pressed, error_of(summary, "max_pressure")), "stress")
        details.append(f"largest contact pressure {pressure}")
    if "results_of" in summary:
        details.append(f"of {load_step(summary['results_of'])} alone")
    stress = largest_von_mises(summary)
    if stress is None:
        arguments = _arguments(summary)
        if arguments and "stress" not in arguments:
            alone = "the residual alone knows" if "F" in arguments else "forms alone do not say: give stress="
            return Answer("", "not known", (f"it is what {alone}", *details))
        return Answer("", "not computed", ("no stress was written: leave --no-fields out", *details))
    if why := stress.get("no_limit"):
        details.insert(0, f"no limit as the mesh is refined: {why}")
    value = with_unit(figure(stress["value"], between(summary["stress"])), "stress")
    position = with_unit(point_in_words(stress["place"]), "length")
    region = f" in {stress['region']}" if stress.get("region") else ""
    return Answer("", f"at {position}", (f"von Mises stress {value}{region}, {stress['of']}", *details))


def _arguments(summary: dict[str, Any]) -> list[str]:
    """Of a problem of forms what it was stated by; of a scene nothing."""
    return list((summary.get("scene") or {}).get("forms") or [])


def _of_a_nonlinear_scene(summary: dict[str, Any]) -> bool:
    """Whether Newton's method of nonlinear bodies has solved a scene."""
    return not _arguments(summary) and str(summary.get("algorithm", "")).startswith("newton, ")


def _yielding(summary: dict[str, Any]) -> str:
    """What is known of the strength of a nonlinear material."""
    if "stress" not in summary:
        return "strength is not judged: no fields were written, leave --no-fields out"
    if "plastic_strain" not in summary:
        return "strength is not judged: no yield stress is known of such a material"
    if not summary["plastic_strain"]["value"]:
        return "nothing has yielded"
    largest, where = yielding_in_words(summary)
    return f"it has yielded, to a plastic strain of {largest} {where}; how much more it bears is not judged"


def _sure(summary: dict[str, Any]) -> Answer:
    """How far the mesh and the solution can be trusted."""
    validity, holds = validity_of(summary), summary["certificate"]["holds"]
    checked = "the certificate holds" if holds else "the certificate does NOT hold"
    if not validity.solved:
        if _status(summary) in _MOVES_AWAY:
            return Answer("", "proved by statics")
        if not was_solved(summary):
            return Answer("", "there is no figure", ("nothing was solved",), "bad")
        return Answer("", "no figure may be used", () if holds else (checked,), "bad")
    if holds:
        checked += f": each condition to {CERTIFICATE_TOLERANCE:.0e}"
    error, is_known = error_in_words(summary)
    details = [checked, *([] if is_known else [_way_to_an_estimate(summary)])]
    goal, law = (summary.get("scene") or {}).get("accuracy"), _other_law(summary)
    if validity is Validity.LESS_ACCURATE and goal is not None:
        details.insert(0, f"{100 * goal['target']:.4g} % of the {goal['of']} was asked for")
    if law:
        details.append(law)
    if took := cost_in_words(summary):
        details.append(took)
    tone = "bad" if not holds else "short" if law or validity is Validity.LESS_ACCURATE else ""
    several = error.startswith(_ESTIMATED)
    text = f"{'errors:' if several else 'error'} {error}" if is_known else "error of the mesh not estimated"
    return Answer("", text, tuple(details), tone)


def _way_to_an_estimate(summary: dict[str, Any]) -> str:
    """How to learn how wrong a result is."""
    scene = summary.get("scene") or {}
    if scene.get("contact") and "forms" not in scene and "strain_energy" in summary:
        return "--accuracy 5% asks for an estimate"
    return "solve on a finer mesh as well, and compare"


def _other_law(summary: dict[str, Any]) -> str:
    """In what the law of the result is not the one that was asked for; "": it is, or none was."""
    return str((summary.get("law") or {}).get("differs", ""))


def error_in_words(summary: dict[str, Any]) -> tuple[str, bool]:
    """How wrong the results are: proved, estimated, or how to know it; and whether it is known."""
    relative = (summary.get("error_bound") or {}).get("relative_error")
    if relative is not None:
        return f"at most {percent(relative)} of the energy norm, guaranteed", True
    prices = solved_prices(summary)
    errors = [f"{name} {percent(prices[name])}" for name in _ESTIMATED if prices.get(name) is not None]
    if errors:
        return f"{', '.join(errors)}, estimated", True
    of_stress, cost = (summary.get("stress") or {}).get("error"), summary.get("cost") or {}
    if of_stress is None and cost.get("of") == "energy":  # without fields the stress itself is not told
        of_stress = cost.get("error")
    if of_stress is not None:
        return f"of the stress {percent(of_stress)} in the mean, estimated", True
    return f"not estimated: {_way_to_an_estimate(summary)}", False
