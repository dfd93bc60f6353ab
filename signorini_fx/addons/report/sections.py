"""The sections of the report page: outcome, pictures, figures, load steps, certificate, and how the
results were computed.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from signorini_fx.addons.pictures.fields import FIELDS
from signorini_fx.addons.report.markup import (
    Markup,
    folded,
    in_text,
    is_number,
    joined,
    part,
    picture,
    rendered,
    shown,
    table,
)
from signorini_fx.errors import PYVISTA
from signorini_fx.machine.display import effort_in_words, results_of, status_in_words
from signorini_fx.mechanics.statement.units import names_of, unit
from signorini_fx.quantities.shown import (
    Summary,
    Validity,
    all_shown,
    brief_lines,
    has_friction,
    kinematics_of,
    shown_lines,
    validity_of,
    was_solved,
)
from signorini_fx.quantities.summary import CertificateFigures
from signorini_fx.records import JUDGED
from signorini_fx.tuned import CERTIFICATE_TOLERANCE

if TYPE_CHECKING:
    from signorini_fx.arrays import Columns, Plain

_TONES = {Validity.SOLUTION: "good", Validity.LESS_ACCURATE: "short"}
_TONES |= dict.fromkeys((Validity.EARLIER_STEP, Validity.NO_SOLUTION), "bad")


def outcome(summary: Summary, folder: Path) -> Markup:
    """Return the first section: status, verdict of the certificate, the lines that ``solve`` prints
    beside the picture of the body, errors and costs, and warnings.
    """
    validity = validity_of(summary)
    verdict = (
        "The certificate holds."
        if summary["certificate"]["holds"]
        else "The certificate does NOT hold."
    )
    if not validity.solved:
        of = (
            "this state, which means nothing"
            if summary["certificate"]["holds"]
            else "the last iterate"
        )
        verdict = f"{verdict} All figures are of {of}: do not use them."
        if not was_solved(summary):
            verdict = "Nothing was solved, so there are no figures."
    elif "results_of" in summary:
        verdict = f"{verdict} All figures are of {results_of(summary)}."
    elif validity is Validity.LESS_ACCURATE:
        verdict = f"{verdict} All figures are of the last mesh."
    lacking = summary.get("incomplete", ())
    return rendered(
        "outcome",
        tone="bad" if lacking else _TONES[validity],
        status=status_in_words(summary),
        verdict=verdict,
        lacking=lacking,
        advice="" if validity is Validity.SOLUTION else summary["advice"],
        figures=[
            (line.begin.strip(), in_text(line.text), line.kind) for line in brief_lines(summary)
        ],
        overview=_overview(summary, folder),
        warnings=_warnings(summary),
    )


def done(summary: Summary) -> str:
    """Return "solved" or "tried"."""
    return "solved" if was_solved(summary) else "tried"


def no_result(summary: Summary) -> str:
    """Return what state figures and pictures show if it is no solution, and "" if it is one."""
    if validity_of(summary).solved:
        return ""
    holds = summary["certificate"]["holds"]
    return (
        "Of the state that was found, which is no result."
        if holds
        else "Of the last iterate, which is no solution."
    )


def figures(summary: Summary) -> Markup:
    """Return the results that ``--verbose`` prints in addition to those of the outcome."""
    lines = [
        line for shown in all_shown() if not shown.brief for line in shown_lines(shown, summary)
    ]
    rows = [(line.begin.strip(), in_text(line.text)) for line in lines]
    return joined([table(["result", ""], rows), part("note", _note(summary))])


def _note(summary: Summary) -> str:
    """Return a note on the sign of forces and moments, and on the units."""
    who, body = _sides(summary)
    forms = "forms" in summary["scene"]  # forces are integrated by the measure of the forms
    measure = "what" if forms or kinematics_of(summary).whole else "per unit thickness, and what"
    integrated = ", integrated by the measure of the forms" if forms else ""
    names = names_of(summary["scene"], summary["dimension"])
    units = (
        f"Units: {', '.join(map(' '.join, names.items()))}"
        if names
        else "Units are those of the scene"
    )
    moments = "Moments are about the origin, in 2D counterclockwise"
    return f"Forces are {measure} {who} exerts on {body}{integrated}. {moments}. {units}."


def _sides(summary: Summary) -> tuple[str, str]:
    """Return which body exerts contact forces, and on which, in words."""
    kinds = {bool(entry.get("against")) for entry in summary["scene"].get("contact", ())}
    who = {(True,): "the other body", (False, True): "the foundation or the other body"}
    return who.get(
        tuple(sorted(kinds)), "the foundation"
    ), "the body of the boundary" if True in kinds else "the body"


def _warnings(summary: Summary) -> list[dict[str, Plain]]:
    """Return the warnings about the scene and the result that the advice does not contain."""
    warned = [finding for finding in summary.get("findings", []) if finding["level"] == "warning"]
    warnings = [finding for finding in warned if finding["message"] not in summary["advice"]]
    return [{**finding, "message": in_text(finding["message"])} for finding in warnings]


_COLOURS = "Colour: von Mises stress, recovered, which smooths peaks narrower than a cell"
_CIRCLE = "; circle: the largest one that is drawn. "
_DISPLACEMENT = "Colour: size of the displacement; there is no stress. "
_MAGNIFIED = "The title gives the magnification."
_SETUP = (
    "Supports, loads and contact before the solve. Squares and circles: supports; arrows: "
    "loads and motions."
)
_SOLID_BODY = "Gray lines: undeformed body; arrows: its lengths; beside it the contact pressure. "
_FOUNDATION = {False: "Hatched: the foundation. ", True: "Gray surface: the foundation. "}  # in 3D?


def _drawn(folder: Path, file: str, alternative: str, caption: str) -> Markup:
    """Return a picture that ``solve`` drew, or nothing if it drew none."""
    drawn = folder / file
    return picture(drawn.read_bytes(), alternative, caption) if drawn.is_file() else Markup("")


def _overview(summary: Summary, folder: Path) -> Markup:
    """Return the picture of the deformed body, or why there is none."""
    scene = summary["scene"]
    solid = summary["dimension"] == 3
    iterate = no_result(summary)
    marked = ". " if iterate else _CIRCLE
    colours = f"{_COLOURS}{marked}" if "stress" in scene.get("forms", ["stress"]) else _DISPLACEMENT
    grounded = any(not entry.get("against") for entry in scene.get("contact", ()))
    parts = f"{_SOLID_BODY * solid}{_FOUNDATION[solid] * grounded}"
    caption = f"{iterate} {colours}{parts}{_MAGNIFIED}".lstrip()
    reason = "this was solved with --no-pictures"
    if solid:
        reason += f", or has too many facets to be drawn, or without {PYVISTA}"
    return (
        _drawn(folder, "setup.png", "body, supports, loads and contact", _SETUP)
        or _drawn(folder, "deformed.png", "deformed body on its foundation", caption)
        or part("note", f"No picture: {reason}.")
    )


def further_pictures(folder: Path) -> Markup:
    """Return the pictures of other fields that were requested."""
    further = list[Markup]()
    for name, field in FIELDS.items():
        caption = f"{field.in_words[0].upper()}{field.in_words[1:]}{field.remark}."
        further.append(_drawn(folder, f"field_{name}.png", field.in_words, caption))
    return part("beside", further) if any(further) else Markup("")


def contact(summary: Summary, folder: Path) -> Markup:
    """Return the picture of the contact boundary, curves in 2D and the surface in 3D, with its sign
    conventions.
    """
    if summary["dimension"] == 3:
        caption = (
            "Contact pressure, shear and slip as arrows, seen along the outward normal, through "
            "the body. Arrows of "
            "shear point where the body slips or would slip; the traction on the body is opposite."
        )
        return _drawn(folder, "contact_surface.png", "contact surface", caption)
    contacts = summary["scene"].get("contact", ())
    rubs = has_friction(summary)
    opposite, _ = _sides(summary)
    caption = (
        f"Normal displacement above {opposite} is "
        f"penetration{'; shear has the sign of the slip' * rubs}."
    )
    if kinematics_of(summary).out_of_section:
        caption += (
            " Friction acts along the section and around the axis: both parts together are bounded."
        )
    if any((entry.get("friction") or {}).get("law") == "tresca" for entry in contacts):
        caption += (
            " Tresca friction also acts where nothing is in contact: its bound does not "
            "depend on the pressure."
        )
    return _drawn(folder, "profiles.png", "curves along the contact boundary", caption)


def steps(steps: Columns, summary: Summary, folder: Path) -> Markup:
    """Return the pictures of the load steps, and their table, the columns of ``steps.csv``."""
    who, whom = _sides(summary)
    caption = (
        f"Forces of {who} on {whom}, and of friction; where they balance each other, "
        "pressure and moment."
    )
    drawn = _drawn(folder, "load_steps.png", "forces of the load steps", caption)
    more = _drawn(folder, "effects.png", "effects from step to step", "The later, the darker.")
    rows = list(zip(*steps.values(), strict=True))
    return joined([drawn, more, folded(f"Every load step ({len(rows)})", table(list(steps), rows))])


def certificate(summary: Summary) -> Markup:
    """Return the verdict of the certificate, every figure with its limit, and the
    guaranteed error.
    """
    rows = []
    classes = []
    for name, value in summary["certificate"].items():
        if name in ("holds", "law"):
            continue
        meaning = (CertificateFigures.model_fields[name].description or "").rstrip(".")
        missed = name in JUDGED and not (is_number(value) and value <= CERTIFICATE_TOLERANCE)
        verdict = "reported" if name not in JUDGED else "violated" if missed else "holds"
        judged = f"<= {CERTIFICATE_TOLERANCE:g}" if name in JUDGED else ""
        digits = _two_digits(value) if math.isfinite(value) else "not finite"
        rows.append((part("named", name.replace("_", " "), meaning), digits, verdict, judged))
        classes.append("missed" if missed else "")
    law = f" The law is {summary['certificate']['law']}." if "law" in summary["certificate"] else ""
    note = (
        "The conditions of the problem, checked after the iteration from the displacement and the "
        "contact tractions "
        f"alone; every figure is relative: to the largest stress, deformation or force.{law}"
    )
    missed = "missed" in classes
    verdict = "The certificate does NOT hold."
    if not missed:
        value, worst = max(
            (value, name) for name, value in summary["certificate"].items() if name in JUDGED
        )
        largest = f"{value:.1e} ({worst.replace('_', ' ')})" if value else "round-off"
        verdict = (
            f"The certificate holds: no figure is above {largest}, the limit is "
            f"{CERTIFICATE_TOLERANCE:g}."
        )
    full_table = table(["figure", "value", "", "limit"], rows, classes)
    parts = [part("paragraph", in_text(verdict)), part("note", in_text(note))]
    parts.append(full_table if missed else folded("Every figure of the certificate", full_table))
    error = summary.get("error_bound") or {}
    bound = "Guaranteed error" if error.get("guaranteed") else "Bound of the error"
    if error:
        statement = f"{bound}: {error['statement']}."
        if "energy between" in statement and unit("energy"):
            statement += f" Energies are in {unit('energy')}."
        parts.append(part("paragraph", in_text(statement)))
    return joined(parts)


# Entries that are shown elsewhere on the page.
_ELSEWHERE = {"title", "incomplete", "units", "solver", "accuracy"}


def scene(summary: Summary) -> Markup:
    """Return the entries of the scene as a table, the method, and the scene as JSON."""
    scene = summary["scene"]
    rows = list[tuple[str, str]]()
    for key, section in scene.items():
        entries = (
            section
            if section and isinstance(section, list) and isinstance(section[0], dict)
            else [section]
        )
        texts = [] if key in _ELSEWHERE else [shown(entry) for entry in entries]
        if key == "mesh" and isinstance(section, str):  # the name of a type
            texts = ["made in Python"]
        rows += [(key.replace("_", " "), text) for text in texts if text and text != "()"]
    method = {
        "algorithm": summary["algorithm"],
        **summary["parameters"],
        "linear algebra": summary["linear_algebra"],
    }
    return joined(
        [
            table(["effect", "data"], rows),
            part("paragraph", in_text(f"Method: {shown(method)}.")),
            folded(
                "The whole scene with all defaults", part("source", json.dumps(scene, indent=1))
            ),
        ]
    )


def convergence_table(rows: list[dict[str, Any]]) -> Markup:
    """Return estimated errors and costs of each mesh as a table."""
    names = [
        "h",
        "dofs",
        "linear_solves",
        "seconds",
        "memory",
        "energy",
        "pressure",
        "force",
        "zone",
        "peak",
    ]
    names += ["regularisation", "iteration"]
    shorter = [
        [_two_digits(row[name]) for name in names] + ["predicted" if row["predicted"] else ""]
        for row in rows
    ]
    note = (
        "One row per mesh. Energy: displacement in the energy norm; pressure; force; zone: ends "
        "of the contact zones, "
        "in 3D the contact area; peak: largest pressure, without an estimate where it has no limit "
        "or the meshes are no finer where it is; the parts of the energy error due to "
        "regularisation and "
        "iteration. Memory in MB."
    )
    classes = ["predicted" if row["predicted"] else "" for row in rows]
    return joined(
        [
            table([*(name.replace("_", " ") for name in names), ""], shorter, classes),
            part("note", note),
        ]
    )


def _two_digits(value: float | None) -> float | str | None:
    """Return an estimate rounded to two digits."""
    return float(f"{value:.2g}") if isinstance(value, float) else value


def history(summary: Summary) -> Markup:
    """Return the number of linear solves, and the events, which are shown on demand."""
    effort = (
        f"{summary['algorithm']}: {effort_in_words(summary)}; history.csv has a row for each solve."
    )
    parts = [part("paragraph", effort)]
    if events := list(dict.fromkeys(summary.get("events", ()))):
        parts.append(folded("What happened", part("items", list(map(in_text, events)))))
    return joined(parts)


def made_with(summary: Summary) -> Markup:
    """Return date, versions, ranks and times of the solve."""
    versions = summary["versions"]
    when = done(summary).capitalize()
    if "finished" in summary:
        when += f" on {summary['finished'].replace('T', ' ').replace('+00:00', ' UTC')}"
    ranks = f"{summary['ranks']} rank{'s' * (summary['ranks'] > 1)}"
    programs = " and ".join(
        f"{name} {versions[name]}" for name in ("signorini_fx", "dolfinx") if versions.get(name)
    )
    timings = table(
        ["phase", "seconds"],
        [(name, _two_digits(value)) for name, value in summary["timings"].items()],
    )
    tables = part("beside", [timings, table(["program", "version"], list(versions.items()))])
    took = f"{when} by {programs} on {ranks}: {summary['dofs']} unknowns."
    return joined([part("paragraph", took), folded("Times and versions", tables)])
