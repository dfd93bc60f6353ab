"""The sections that come first on the page: outcome, pictures, figures, forces, load steps, advice."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.addons.pictures.fields import FIELDS
from signorini_fx.addons.report.markup import Markup, in_text, joined, long_table, part, picture, rendered, table
from signorini_fx.errors import PYVISTA
from signorini_fx.machine.display import clean, results_of, status_in_words
from signorini_fx.machine.result_files import seconds_of
from signorini_fx.mechanics.statement.units import bracketed
from signorini_fx.quantities.digits import components, figure, percent
from signorini_fx.quantities.shown import Card, brief_lines, shown_cards
from signorini_fx.quantities.shown import table as table_of_results
from signorini_fx.quantities.text import (
    boundaries_touched_by,
    has_friction,
    kinematics_of,
    marked_stress,
    named_components,
)
from signorini_fx.quantities.validity import Validity, validity_of, was_solved
from signorini_fx.tuned import FEW_NODES

_TONES = {Validity.SOLUTION: "good", Validity.LESS_ACCURATE: "short"}
_TONES |= dict.fromkeys((Validity.EARLIER_STEP, Validity.NO_SOLUTION), "bad")
# Counts that are of interest to those who solve.
_COUNTS = {"dofs": "unknowns", "contact_nodes": "contact nodes"}


def outcome(summary: dict[str, Any], folder: Path) -> Markup:
    """Status, verdict of the certificate, what ``solve`` prints beside the picture of the body, with what accuracy
    costs below that, and warnings.
    """
    validity = validity_of(summary)
    verdict = "The certificate holds." if summary["certificate"]["holds"] else "The certificate does NOT hold."
    if not validity.solved:
        of = "this state, which means nothing" if summary["certificate"]["holds"] else "the last iterate"
        verdict = f"{verdict} All figures are of {of}: do not use them."
        if not was_solved(summary):
            verdict = "Nothing was solved, so there are no figures."
    elif "results_of" in summary:
        verdict = f"{verdict} All figures are of {results_of(summary)}."
    elif validity is Validity.LESS_ACCURATE:
        verdict = f"{verdict} All figures are of the last mesh."
    lacking = summary.get("incomplete", ())
    cost = "Estimated relative errors against unknowns and time; open: the next mesh, predicted."
    return rendered(
        "outcome",
        tone="bad" if lacking else _TONES[validity],
        status=status_in_words(summary),
        verdict=verdict,
        lacking=lacking,
        advice="" if validity is Validity.SOLUTION else summary["advice"],
        figures=[(line.begin.strip(), in_text(line.text), line.kind) for line in brief_lines(summary)],
        overview=_overview(summary, folder),
        cost=_drawn(folder, "convergence_table.png", "errors and costs of the meshes", cost),
        warnings=_warnings(summary),
    )


def done(summary: dict[str, Any]) -> str:
    """What was done with the scene, in a word."""
    return "solved" if was_solved(summary) else "tried"


def no_result(summary: dict[str, Any]) -> str:
    """Of what figures and pictures are that are none of a solution; "": they are of one."""
    if validity_of(summary).solved:
        return ""
    holds = summary["certificate"]["holds"]
    return "Of the state that was found, which is no result." if holds else "Of the last iterate, which is no solution."


def figures(summary: dict[str, Any]) -> Markup:
    """The figures of all quantities by their names, with units, and what is to be known of each."""
    cards = [card for shown in table_of_results() for card in shown_cards(shown, summary)]
    rows = [(card.label, card.text, card.remark or _estimate(card)) for card in cards]
    return joined([table(["figure", "value", ""], rows), part("note", _note(summary))])


def size(summary: dict[str, Any]) -> str:
    """What the solve took, for those who make such solves."""
    counts = [f"{summary[key]} {label}" for key, label in _COUNTS.items() if key in summary]
    return ", ".join([*counts, f"{seconds_of(summary):.3g} seconds"])


def _note(summary: dict[str, Any]) -> str:
    """What the forces are, and how many digits are shown."""
    who, body = _sides(entry.get("against") for entry in summary["scene"].get("contact", []))
    forms = "forms" in summary["scene"]  # their measure says what is integrated
    measure = "what" if forms or kinematics_of(summary).whole else "per unit thickness, and what"
    integrated = ", integrated by the measure of the forms" if forms else ""
    named = "" if summary["scene"].get("units", {}).get("length") else "; units are those of the scene"
    digits = "Figures with an estimated error are rounded to it, others to four digits; all digits are in summary.json."
    return f"Forces are {measure} {who} exerts on {body}{integrated}{named}. {digits}"


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
    warnings = [finding for finding in warned if finding["message"] not in summary["advice"]]
    return [{**finding, "message": in_text(finding["message"])} for finding in warnings]


_COLOURS = "Colour: von Mises stress, recovered, which smooths peaks narrower than a cell"
_CIRCLE = "; circle: the largest one, recovered or raw. "
_DISPLACEMENT = "Colour: size of the displacement; the stress is not known. "
_MAGNIFIED = "The title says what is magnified."
_SETUP = "What the scene prescribes, before it is solved. Squares and circles: supports; arrows: loads and motions."
_SECTION = "Von Mises stress within the body, which is cut through the centre of the contact pressure."
_SOLID_BODY = "Gray lines: undeformed body; arrows: how long the body is. "
_FOUNDATION = {False: "Hatched: the foundation. ", True: "Gray surface: the foundation. "}  # in 3D?


def _drawn(folder: Path, file: str, alternative: str, caption: str, class_: str = "still") -> Markup:
    """A picture that solve drew; nothing if it drew none."""
    drawn = folder / file
    return picture(drawn.read_bytes(), alternative, caption, class_) if drawn.is_file() else Markup("")


def _overview(summary: dict[str, Any], folder: Path) -> Markup:
    """The picture of the deformed body, or why there is none."""
    scene, solid, iterate = summary["scene"], summary["dimension"] == 3, no_result(summary)
    marked = _CIRCLE if marked_stress(summary) is not None else ". "
    colours = f"{_COLOURS}{marked}" if "stress" in scene.get("forms", ["stress"]) else _DISPLACEMENT
    grounded = any(not entry.get("against") for entry in scene.get("contact", ()))
    caption = f"{iterate} {colours}{_SOLID_BODY * solid}{_FOUNDATION[solid] * grounded}{_MAGNIFIED}".lstrip()
    reason = "this was solved with --no-pictures"
    if solid:
        reason += f", or has too many facets to be drawn, or without {PYVISTA}"
    return (
        _drawn(folder, "setup.png", "body, supports, loads and contact", _SETUP, "still overview")
        or _drawn(folder, "deformed.png", "deformed body on its foundation", caption, "still overview")
        or part("note", f"No picture: {reason}.")
    )


def further_pictures(folder: Path) -> Markup:
    """A section, and the pictures of other fields that were asked for."""
    further = [_drawn(folder, "section.png", "section through the body", _SECTION)]
    for name, field in FIELDS.items():
        caption = f"{field.in_words[0].upper()}{field.in_words[1:]}{field.remark}."
        further.append(_drawn(folder, f"field_{name}.png", field.in_words, caption))
    return part("beside", further) if any(further) else Markup("")


def contact(summary: dict[str, Any], folder: Path) -> Markup:
    """The picture of the contact boundary: curves in 2D, the surface in 3D, and its signs."""
    if summary["dimension"] == 3:
        caption = (
            "Contact pressure, shear and slip as arrows, seen along the outward normal, through the body. Arrows of "
            "shear point where the body slips or would slip; the traction on the body is opposite."
        )
        return _drawn(folder, "contact_surface.png", "contact surface", caption)
    contacts, rubs = summary["scene"].get("contact", ()), has_friction(summary)
    opposite, _ = _sides(entry.get("against") for entry in contacts)
    caption = f"Normal displacement above {opposite} is penetration{'; shear has the sign of the slip' * rubs}."
    if kinematics_of(summary).out_of_section:
        caption += " Friction acts along the section and around the axis: both parts together are bounded."
    if any((entry.get("friction") or {}).get("law") == "tresca" for entry in contacts):
        caption += " Tresca friction also acts where nothing is in contact: its bound does not depend on the pressure."
    return _drawn(folder, "profiles.png", "curves along the contact boundary", caption)


def forces(summary: dict[str, Any]) -> Markup:
    """Resultants of all boundaries, figures of each contact boundary, zones and areas, as far as there are any."""
    return joined([_resultants(summary), _contact_boundaries(summary), _zones(summary), _areas(summary)])


def _resultants(summary: dict[str, Any]) -> Markup:
    """Force, moment and point of action through each boundary, component by component."""
    entries = summary.get("resultants", [])
    if not entries:
        return Markup("")
    kinematics = kinematics_of(summary)
    axes = named_components(kinematics, len(entries[0]["force"]))
    moments = [list(entry["moment"]) if isinstance(entry["moment"], list) else [entry["moment"]] for entry in entries]
    turns = [k for k in range(len(moments[0])) if kinematics.uniform or any(moment[k] for moment in moments)]
    places = [_place_of_action(summary, entry.get("acts_at")) for entry in entries]
    names = [f"force {name}{bracketed('force')}" for name in axes.values()]
    names += [f"moment{f' {chr(120 + k)}' * (len(moments[0]) > 1)}{bracketed('moment')}" for k in turns]
    names += [f"acts at {axis}{bracketed('length')}" for axis in "xyz"[: len(axes)]] if any(places) else []
    rows = []
    for entry, moment, point in zip(entries, moments, places, strict=True):
        row = [entry.get("boundary") or "whole body", " and ".join(entry.get("acts", []))]
        row += [*components([entry["force"][k] for k in axes]), *components([moment[k] for k in turns])]
        row += (components(point) if point else [""] * len(axes)) if any(places) else []
        rows.append(tuple(row))
    note = "Forces on the body."
    if turns:
        note += " Moments are about the origin" + (", counterclockwise." if len(moments[0]) == 1 else ".")
    if any(places):
        note += " The point is one of the line on which the force acts."
    if any(places) and not all(places):
        note += " Where no point is named the force acts far outside the body or nowhere: the moment counts."
    return joined([table(["boundary", "by", *names], rows), part("note", note)])


def _place_of_action(summary: dict[str, Any], point: list[float] | None) -> list[float] | None:
    """A point of the line of action that is not farther from the body than the body is large."""
    bounds = [piece["bounds"] for piece in summary.get("pieces", ())]
    if point is None or not bounds:
        return point
    low, high = np.min([bound[0] for bound in bounds], axis=0), np.max([bound[1] for bound in bounds], axis=0)
    away = np.maximum(0.0, np.maximum(low - point, point - high))
    return point if np.linalg.norm(away) <= np.linalg.norm(high - low) else None


def _contact_boundaries(summary: dict[str, Any]) -> Markup:
    """Area, mean pressure and forces of each contact boundary."""
    entries = summary.get("contact_boundaries", [])
    if not entries:
        return Markup("")
    area = f"area{bracketed('area')}" if kinematics_of(summary).whole else f"length{bracketed('length')}"
    names = {
        "boundary": "contact boundary",
        "area": area,
        "contact_area": f"in contact, {area}",
        "mean_pressure": f"mean pressure{bracketed('stress')}",
        "pressure_integral": f"integral of pressure{bracketed('force')}",
        "contact_force": f"contact force{bracketed('force')}",
        "friction_force": f"friction force{bracketed('force')}",
        "friction_limit": f"friction limit{bracketed('force')}",
        "friction_moment": f"moment of friction about its middle{bracketed('moment')}",
        "moment_limit": f"moment limit{bracketed('moment')}",
    }
    used = [key for key in names if any(entry.get(key) is not None for entry in entries)]
    if not has_friction(summary):
        used = [key for key in used if not key.startswith("friction")]
    rows = [tuple(figure(entry.get(key)) if key != "boundary" else entry[key] for key in used) for entry in entries]
    return table([names[key] for key in used], rows)


def _zones(summary: dict[str, Any]) -> Markup:
    """The zones of contact, stick and slip in 2D."""
    if "zones" not in summary:
        return Markup("")
    size = max((abs(c) for runs in summary["zones"].values() for run in runs for end in run for c in end), default=0.0)
    rows = []
    for name, runs in summary["zones"].items():
        for first, last in runs:
            ends = (c for end in (first, last) for c in components(clean(end, size)))
            rows.append((name, *ends, figure(math.dist(first, last))))
    if not rows:
        return part("paragraph", "Nothing is in contact.")
    note = "From node to node: the true ends lie up to one element further out. Stick and slip within the contact."
    names = [
        f"{side} {axis}{bracketed('length')}" for side in ("from", "to") for axis in "xyz"[: (len(rows[0]) - 2) // 2]
    ]
    return joined([table(["zone", *names, f"chord{bracketed('length')}"], rows), part("note", note)])


def _areas(summary: dict[str, Any]) -> Markup:
    """The areas of contact, stick and slip in 3D."""
    if "areas" not in summary:
        return Markup("")
    rows = [(name, figure(area)) for name, area in summary["areas"].items()]
    note = "Sums of weights of nodes, stick and slip where friction can act."
    return joined([table(["all boundaries", f"area{bracketed('area')}"], rows), part("note", note)])


def steps(steps: dict[str, Any], summary: dict[str, Any], folder: Path) -> Markup:
    """Forces step by step, and the table of the steps, the columns of ``steps.csv``."""
    who, whom = _sides(entry.get("against") for entry in summary["scene"].get("contact", ()))
    caption = f"Forces of {who} on {whom}, and of friction; where they balance each other, pressure and moment."
    drawn = _drawn(folder, "load_steps.png", "forces of the load steps", caption)
    return joined([drawn, long_table("Every load step", steps, "steps.csv")])


def next_steps(summary: dict[str, Any]) -> list[str]:
    """What to do with this result, most urgent first."""
    if not validity_of(summary).solved:
        return [
            "The first thing to do is stated at the top. Before the next solve, signorini-fx check SCENE reports what "
            "may go wrong, and why."
        ]
    advice = []
    if coarse := boundaries_touched_by(range(1, FEW_NODES), summary):
        advice.append(
            f"Too few nodes are in contact on {', '.join(coarse)}: refine there before the ends of the zone or the "
            "largest pressure are used."
        )
    if summary.get("fields"):
        advice.append(f"Look at the fields in ParaView: {', '.join(summary['fields'])}.")
    return advice
