"""The sections that come first on the page: outcome, pictures, curves, forces, load steps."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from signorini_fx.display import clean, results_of, status_in_words
from signorini_fx.errors import PYVISTA
from signorini_fx.kinematics import of_data
from signorini_fx.kinematics.cartesian import Kinematics
from signorini_fx.pictures.fields import FIELDS
from signorini_fx.quantities.answers import answers
from signorini_fx.quantities.digits import figure, percent
from signorini_fx.quantities.quantity import Card
from signorini_fx.quantities.registry import quantities, shown_cards
from signorini_fx.records import Status
from signorini_fx.report.interactive import plots, turning
from signorini_fx.report.markup import drawn_by, joined, long_table, picture, table, tag
from signorini_fx.report.templating import Markup, rendered
from signorini_fx.result_files import SHORT_OF_ACCURACY, ResultFiles, in_space, seconds_of
from signorini_fx.units import bracketed, unit, with_unit

# Counts that are shown large behind the quantities.
_COUNTS = {"dofs": "unknowns", "contact_nodes": "contact nodes"}


def outcome(summary: dict[str, Any]) -> Markup:
    """Status, verdict of the certificate, warnings and the most important figures."""
    good = summary["status"] == Status.CONVERGED.value
    short = summary["status"] in SHORT_OF_ACCURACY
    verdict = "The certificate holds." if summary["certificate"]["holds"] else "The certificate does NOT hold."
    if not good:
        last = "the last mesh" if short else "the last iterate: do not use them"
        if summary.get("results_of", {}).get("status") == Status.CONVERGED.value:
            last = results_of(summary)
        verdict = f"{verdict} All figures are of {last}."
    elif "results_of" in summary:
        verdict = f"{verdict} All figures are of {results_of(summary)}."
    if not good and summary["linear_solves"] == 0:
        verdict += " No linear system was solved: the figures are those of the body without displacement."
    lacking = summary.get("incomplete", ())
    cards = [card for quantity in quantities() for card in shown_cards(quantity, summary)]
    cards += [Card(label, str(summary[key])) for key, label in _COUNTS.items() if key in summary]
    cards.append(Card("seconds", f"{seconds_of(summary):.3g}"))
    who, body = _sides(entry.get("against") for entry in summary["scene"].get("contact", []))
    return rendered(
        "outcome",
        tone="bad" if lacking else "short" if short else "good" if good else "bad",
        status=status_in_words(summary),
        verdict=verdict,
        lacking=lacking,
        advice="" if good else summary["advice"],
        answers=answers(summary),
        warnings=_warnings(summary),
        cards=[(card, _estimate(card)) for card in cards],
        note=_note(summary, who, body),
    )


def _note(summary: dict[str, Any], who: str, body: str) -> str:
    """What the forces are, and how many digits are shown."""
    forms = "forms" in summary["scene"]  # their measure says what is integrated
    measure = "what" if forms or _kinematics(summary).whole else "per unit thickness, and what"
    integrated = ", integrated by the measure of the forms" if forms else ""
    named = "" if summary["scene"].get("units", {}).get("length") else "; units are those of the scene"
    digits = "Figures with an estimated error are rounded to it, others to four digits; all digits are in summary.json."
    return f"Forces are {measure} {who} exerts on {body}{integrated}{named}. {digits}"


def _kinematics(summary: dict[str, Any]) -> Kinematics:
    return of_data(summary["scene"], 3 if in_space(summary) else 2)


def _sides(against: Iterable[str | None]) -> tuple[str, str]:
    """What exerts the forces of contacts, and on what, from the other boundary of each; none or "": it is rigid."""
    kinds = {bool(name) for name in against}
    who = {(True,): "the other body", (False, True): "the foundation or the other body"}
    return who.get(tuple(sorted(kinds)), "the foundation"), "the body of the boundary" if True in kinds else "the body"


def _estimate(card: Card) -> str:
    """What is said below a figure that says nothing itself."""
    share = percent(card.error) if card.error and card.error < 1 else ""
    return share and f"error {'' if share.startswith('below') else 'about '}{share}"


def _warnings(summary: dict[str, Any]) -> list[dict[str, Any]]:
    """About the scene and the result."""
    warned = [finding for finding in summary.get("findings", []) if finding["level"] == "warning"]
    return [finding for finding in warned if finding["message"] != summary["advice"]]


_COLOURS = (
    "Colour: von Mises stress; recovered, it is continuous in each material and smooths peaks that are narrower than a "
    "cell. "
)
_DISPLACEMENT = "Colour: size of the displacement; the stress is not known. "
_PLANE_BODY = (
    "Hatched lines: the foundation. The title says what is magnified; where a magnified gap would bend the "
    "foundation it is drawn beside, with the body as it is."
)
_SECTION = "Von Mises stress within the body, which is cut through the centre of the contact pressure."
_SOLID_BODY = (
    "Gray lines: undeformed body; arrows: how long it is along each axis; gray surface: the foundation. The "
    "title says what is magnified; where a magnified gap would bend the foundation it is drawn beside, with the body "
    "as it is."
)


_APART = (
    "The bodies moved apart along the mean normal of their contact, or out of a fit, so that both faces can be seen."
)


def deformed(folder: ResultFiles, *, solid: bool = False, stressed: bool = True) -> Markup:
    """The picture of the deformed body, and those of the other fields that were asked for.

    Args:
        folder: of the result.
        solid: whether the body is in space.
        stressed: whether its stress is known.
    """
    data = folder.picture("deformed.png")
    turned = turning(folder) if solid else []
    if data is None:
        reason = "this was solved with --no-pictures"
        if solid:
            reason += f", or has too many facets to be drawn, or without {PYVISTA}"
        return joined([*turned, tag("p", f"No picture: {reason}.", class_="note")])
    caption = (_COLOURS if stressed else _DISPLACEMENT) + (_SOLID_BODY if solid else _PLANE_BODY)
    overview = picture(data, "png", "deformed body on its foundation", caption, "still overview")
    cut, apart = folder.picture("section.png"), folder.picture("exploded.png")
    inside = [] if cut is None else [picture(cut, "png", "section through the body", _SECTION)]
    inside += [] if apart is None else [picture(apart, "png", "bodies moved apart", _APART)]
    further = inside + [
        picture(data, "png", field.label, f"{field.label[0].upper()}{field.label[1:]}{field.remark}.")
        for name, field in FIELDS.items()
        if (data := folder.picture(f"field_{name}.png")) is not None
    ]
    return joined([overview, *turned, *([tag("div", *further, class_="pictures")] if further else [])])


def profiles(contact: dict[str, Any]) -> Markup:
    """Curves along the contact boundary, to be zoomed where the page can; contact and friction beside each other."""
    from signorini_fx.pictures.boundary_profiles import boundaries_of, boundary_profiles

    frictional = bool(np.any(contact["bound"] != 0) or np.any(contact["friction"] != "none"))
    opposite, _ = _sides(contact.get("against", ()))
    beside = opposite.replace("the ", "")
    sides = {"contact": f"Contact pressure; normal displacement and {beside}; below, what is in contact."}
    if frictional:
        sides["friction"] = "Shear and its bounds; tangential displacement; below, where the contact sticks and slips."
    drawn = [
        drawn_by(boundary_profiles, contact, sides=[side], caption=caption, class_="still curves")
        for side, caption in sides.items()
    ]
    signs = f"Normal displacement above {opposite} is penetration; shear has the sign of the slip."
    if "shear_z" in contact:
        signs += " Friction acts along the section and around the axis: both parts together are bounded."
    apart = contact["state"] == "open"
    if np.any(np.abs(contact["shear"][apart]) > 1e-9 * np.abs(contact["shear"]).max(initial=0.0)):
        signs += " Tresca friction acts where nothing is in contact too, as its bound does not depend on the pressure."
    return joined(
        [tag("div", *drawn, class_="pictures"), *plots(boundaries_of(contact)), tag("p", signs, class_="note")]
    )


def forces(summary: dict[str, Any]) -> Markup:
    """Resultants of all boundaries, figures of each contact boundary and zones, as far as the summary has them."""
    parts = [_resultants(summary), _contact_boundaries(summary), _zones(summary)]
    return joined([part for part in parts if part is not None])


def _resultants(summary: dict[str, Any]) -> Markup | None:
    """Force, moment and point of action through each boundary."""
    nowhere = "nowhere: a couple or none" if _kinematics(summary).uniform else ""
    rows = [
        (
            entry.get("boundary") or "whole body",
            " and ".join(entry.get("acts", [])),
            with_unit(figure(entry.get("force")), "force"),
            with_unit(figure(entry.get("moment")), "moment"),
            with_unit(figure(entry.get("acts_at")), "length") or nowhere,
        )
        for entry in summary.get("resultants", [])
    ]
    if not rows:
        return None
    return table(["resultant of", "by", "force on the body", "moment about the origin", "acts at"], rows)


def _contact_boundaries(summary: dict[str, Any]) -> Markup | None:
    """Area, mean pressure and friction of each contact boundary."""
    entries = summary.get("contact_boundaries", [])
    if not entries:
        return None
    length = unit("length")
    solid = _kinematics(summary).whole
    area = f"area{f' ({length}²)' if length else ''}" if solid else f"length{bracketed('length')}"
    names = {
        "boundary": "contact boundary",
        "area": area,
        "contact_area": f"in contact, {area}",
        "pressure_integral": f"integral of pressure{bracketed('force')}",
        "mean_pressure": f"mean pressure{bracketed('stress')}",
        "tangential_force": f"tangential force{bracketed('force')}",
        "friction_limit": f"friction limit{bracketed('force')}",
        "friction_moment": f"moment of friction about its middle{bracketed('moment')}",
        "moment_limit": f"moment limit{bracketed('moment')}",
    }
    used = [key for key in names if any(entry.get(key) is not None for entry in entries)]
    rows = [tuple(figure(entry.get(key)) if key != "boundary" else entry[key] for key in used) for entry in entries]
    return table([names[key] for key in used], rows)


def _zones(summary: dict[str, Any]) -> Markup | None:
    """The zones of contact, stick and slip."""
    if "zones" not in summary:
        return None
    size = max((abs(c) for runs in summary["zones"].values() for run in runs for end in run for c in end), default=0.0)
    rows = []
    for name, runs in summary["zones"].items():
        for first, last in runs:
            ends = (figure(clean(end, size)) for end in (first, last))
            rows.append((name, *ends, with_unit(figure(math.dist(first, last)), "length")))
    if not rows:
        return tag("p", "Nothing is in contact.")
    note = "From node to node: the true ends lie up to one element further out. Stick and slip within the contact."
    return joined([table(["zone", "from", "to", "chord"], rows), tag("p", note, class_="note")])


def steps(folder: ResultFiles, steps: dict[str, Any], contact: dict[str, Any]) -> Markup:
    """Forces step by step, the animation, and the table of the steps; ``contact``: columns of ``contact.csv``."""
    from signorini_fx.pictures.load_steps import load_steps
    from signorini_fx.pictures.step_animation import step_animation

    parts = []
    body = folder.picture("deformed.gif")
    if body is not None:
        caption = "The deformed body, load step by load step; magnification and colours stay the same."
        parts.append(picture(body, "gif", caption, caption, "moving"))
    if any(name.startswith("contact_force_x") for name in steps):
        resisting = "torque of friction" if "torque" in steps else "friction force"
        who, whom = _sides(contact.get("against", ()))
        caption = f"Above: forces of {who} on {whom}. Below: {resisting} over displacement."
        if any(name.startswith("friction_moment") for name in steps):
            caption = f"Forces of {who} on {whom}, and of friction; where they balance each other, pressure and moment."
        pictures = [drawn_by(load_steps, steps, caption=caption)]
        solid = any(name.startswith("contact_force_z") for name in steps)
        if (not solid or "torque" in steps) and (folder.path / "contact_steps.csv").is_file():
            caption = "Pressure, shear and states along the contact boundary, step by step."
            contact = folder.columns("contact_steps.csv")
            pictures.append(drawn_by(step_animation, contact, caption=caption, suffix=".gif", class_="moving"))
        parts.append(tag("div", *pictures, class_="pictures"))
    return joined([*parts, long_table("Every load step", steps, "steps.csv")])
