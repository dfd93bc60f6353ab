"""The table of results that the terminal and the report print: what solution they belong to, and
numbers with the digits that their error estimates justify.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.arrays import Plain
from signorini_fx.extensions import STEP_EFFECTS, names_of
from signorini_fx.machine.display import (
    clean,
    effort_in_words,
    on_several_bodies,
    point_in_words,
    results_of,
    status_in_words,
    touch_each_other,
    with_error,
)
from signorini_fx.machine.terminal import COLUMNS, TerminalLine, printable
from signorini_fx.mechanics.kinematics import Kinematics, of_data
from signorini_fx.mechanics.statement.units import unit, with_unit
from signorini_fx.quantities.summary import NO_FINITE_VALUE, PrintedNumber, own_quantities
from signorini_fx.records import JUDGED, NO_ACCURACY, SHORT_OF_ACCURACY, STEPS_UNESTIMATED, Status
from signorini_fx.tuned import CERTIFICATE_TOLERANCE, FAR_GAP, FEW_NODES, NEGLIGIBLE

# The content of summary.json.
Summary = dict[str, Any]
Lines = list[str | TerminalLine]


class Validity(Enum):
    """The kind of state that the results of a summary belong to."""

    SOLUTION = "the solution of the scene"
    LESS_ACCURATE = "a certified solution that is less accurate than required"
    EARLIER_STEP = "the last load step with a solution, before the one that failed"
    NO_SOLUTION = "the last iterate, which is no result"

    @property
    def solved(self) -> bool:
        """Whether the results are those of a solution, possibly of an earlier load step."""
        return self is not Validity.NO_SOLUTION


def validity_of(summary: Summary) -> Validity:
    """Return the kind of state that the results of a summary belong to."""
    status = Status(summary["status"])
    if status is Status.CONVERGED:
        return Validity.SOLUTION
    if status in SHORT_OF_ACCURACY:
        return Validity.LESS_ACCURATE
    if summary.get("results_of", {}).get("status") == Status.CONVERGED.value:
        return Validity.EARLIER_STEP
    return Validity.NO_SOLUTION


def was_solved(summary: Summary) -> bool:
    """Return whether there are results, possibly of an iterate; there are none if statics excludes
    a solution.
    """
    return validity_of(summary).solved or summary["linear_solves"] > 0


def solved_prices(summary: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the last solved row of the convergence table, which has the error estimates on the
    finest mesh; empty if there is none.
    """
    solved = [row for row in summary.get("convergence_table", []) if not row["predicted"]]
    return solved[-1] if solved else {}


def figure(value: Plain) -> str:
    """Return a number, or the components of a vector, with four digits; "" for None."""
    if isinstance(value, list | tuple):
        size = math.hypot(*value)
        return f"({', '.join(_rounded(component, size) for component in value)})"
    if isinstance(value, bool) or not isinstance(value, int | float):
        return "" if value is None else str(value)
    return str(value) if isinstance(value, int) else _rounded(value, abs(value))


def _rounded(value: float, size: float) -> str:
    if not (math.isfinite(value) and math.isfinite(size)):
        return f"{value}"
    if value == 0:
        return "0"
    # A small component of a large vector gets up to two digits more than the large one.
    last = max(math.floor(math.log10(abs(value))) - 3, math.floor(math.log10(size)) - 5)
    rounded = round(value, -last)
    return f"{rounded:.6g}" if rounded else "0"


def told(summary: Summary, name: str, value: Plain, quantity: str, area: str = "") -> str:
    """Return a value with the error of the number of this name, scaled to the value; without a
    known error it has four digits.

    Args:
        summary: the summary.
        name: the name in ``numbers``.
        value: the value to print.
        quantity: what it is measured in, for its unit.
        area: words behind the unit.
    """
    row = summary.get("numbers", {}).get(name)
    if row is None:
        return with_unit(figure(value), quantity) + area
    number = PrintedNumber(**row)
    if number.error and isinstance(value, float) and isinstance(number.value, float):
        number = number.model_copy(update={"error": number.error * abs(value / number.value)})
    return number.model_copy(update={"value": value}).told(f"{unit(quantity)}{area}".lstrip())


def percent(error: float) -> str:
    """Return a relative error, or another fraction, in per cent with two digits."""
    return (
        f"{float(f'{100 * error:.2g}'):g} %"
        if error > 1e-5
        else "below 0.001 %"
        if error
        else "0 %"
    )


# Largest number of rows of a list that the terminal shows.
MOST_ROWS = 8
# The errors of a convergence table that are shown without a request, and their names.
_ESTIMATED = {"pressure": "pressure", "force": "force", "energy": "stress"}


def row(label: str, text: str, kind: str = "") -> TerminalLine:
    """Return a line with a label."""
    return TerminalLine(f"  {label:16s} ", text, kind)


def labelled(label: str, texts: list[str]) -> list[TerminalLine]:
    """Return lines of which only the first has the label."""
    return [row(label if k == 0 else "", text) for k, text in enumerate(texts)]


def digits(value: Plain) -> str:
    """Return a number, or the components of a vector, with six digits."""
    if not isinstance(value, float):
        return in_brackets(value) if isinstance(value, list) else str(value)
    return f"{value:.6g}"


def in_brackets(components: Sequence[float]) -> str:
    """Return a vector as text, with six digits."""
    return "(" + ", ".join(f"{component:.6g}" for component in components) + ")"


def kinematics_of(summary: Summary) -> Kinematics:
    """Return the kinematics of the body of a summary."""
    return of_data(summary.get("scene") or {}, 3 if summary.get("dimension") == 3 else 2)


def has_friction(summary: Summary) -> bool:
    """Return whether a contact of the scene has a friction law."""
    laws = [
        (entry.get("friction") or {}).get("law")
        for entry in (summary.get("scene") or {}).get("contact", ())
    ]
    return any(law not in (None, "none") for law in laws)


def largest_von_mises(summary: Summary) -> dict[str, Any] | None:
    """Return the larger one of the raw and the recovered von Mises stress, with the key ``of`` that
    tells which it is; None if there is none.
    """
    stress = summary.get("stress") or {}
    extremes = {
        "raw": stress.get("von_mises"),
        "recovered": (stress.get("recovered") or {}).get("von_mises"),
    }
    known = [
        entry | {"of": name}
        for name, entry in extremes.items()
        if entry and entry["value"] is not None
    ]
    return max(known, key=lambda entry: float(entry["value"])) if known else None


def share_in_words(summary: Summary, of: str = "") -> str:
    """Return which fraction of the yield stress is used, such as "41 % of yield".

    Far above the yield stress it is a multiple; if the stress is singular, only that it is above,
    as each mesh would give another number.

    Args:
        summary: the summary.
        of: the name of the yield stress in the text; "": none.
    """
    largest = summary["utilisation"]
    share = largest["value"]
    if share is not None and share > 1 and largest.get("no_limit"):
        return f"{'far ' * (share > FAR_GAP)}above {of or '100 %'}"
    if share is not None and share > FAR_GAP:
        return f"{share:.3g} times{' ' * bool(of)}{of}"
    return f"{figure(None if share is None else 100 * share)} %{' of ' * bool(of)}{of}"


@dataclass(frozen=True)
class Shown:
    """How the terminal and the report show a key of the summary."""

    key: str  # key of the summary
    label: str  # label of its lines
    # returns its lines, each as text or with its own label; None: the number is shown
    format: Callable[[Summary], Lines] | None = None
    brief: bool = (
        False  # whether the terminal shows it without --verbose, and the report at the top
    )
    unit: str = ""  # the quantity of the number, for its unit


def all_shown() -> list[Shown]:
    """Return all entries of the table in their order, those of other packages last."""
    own = (
        Shown(one.key, one.key.replace("_", " "), brief=True, unit=one.unit)
        for one in own_quantities()
    )
    return [*_TABLE, *own]


def shown_lines(shown: Shown, summary: Summary) -> list[TerminalLine]:
    """Return the lines of an entry for a summary."""
    value = summary.get(shown.key)
    if value is None:
        return []
    if shown.format is None:
        return [row(shown.label, with_unit(digits(value), shown.unit))]
    texts = enumerate(shown.format(summary))
    return [
        text if isinstance(text, TerminalLine) else row(shown.label if k == 0 else "", text)
        for k, text in texts
    ]


def brief_lines(summary: Summary) -> list[TerminalLine]:
    """Return the lines of the short answer: none without a solution; if a load step failed, those
    of the last solved one.
    """
    if not validity_of(summary).solved:
        return []
    return [line for shown in all_shown() if shown.brief for line in shown_lines(shown, summary)]


def _limit(summary: Summary) -> Lines:
    """Return the loads that a ramp has reached, and why it ended."""
    limit = summary["limit"]
    held = limit["loads"] or f"time {limit['time']:.6g}"
    if full := limit.get("full_force"):
        force, whole = (with_unit(figure(value), "force") for value in (limit["force"], full))
        held = f"{force} ({limit['force'] / full:.4g} of {whole})"
    return [f"{held}: {limit['reason']}"]


def _corners(summary: Summary) -> Lines:
    """Return the forces at corners, and whether the mesh resolves their contact."""
    lines = Lines()
    for entry in summary["corners"][:MOST_ROWS]:
        sums = [a + b for a, b in zip(entry["contact_force"], entry["friction_force"], strict=True)]
        force = with_unit(in_brackets(clean(sums, math.hypot(*sums))), "force")
        facet = entry["facet"]
        width = entry["contact_width"]
        resolved = facet <= width
        left = (
            ""
            if resolved
            else f", not resolved by facets of {facet:.3g}: it falls as they are refined, until "
            f"they are about {width:.2g}"
        )
        lines.append(f"at {point_in_words(entry['place'])}: force {force}{left}")
    return lines


def _friction(summary: Summary) -> Lines:
    """Return the fraction of its friction that the body uses; nothing if a later load step
    failed.
    """
    if validity_of(summary) is Validity.EARLIER_STEP:
        return []
    used = summary["friction_used"]
    if used:
        return [f"{percent(used)} used"]
    boundaries = summary.get("contact_boundaries") or ()
    rubbing = [row for row in boundaries if not _is_bonded(row)]
    if boundaries and not rubbing:
        return ["bonded"]
    limit = sum(row.get("friction_limit", 0.0) for row in rubbing)
    carried = sum(row.get("tangential_force") or 0.0 for row in rubbing)
    notable = 0.0 < NEGLIGIBLE * limit < carried
    return [f"{percent(carried / limit)} of its limit" if notable else "not needed for equilibrium"]


def _is_bonded(boundary: Mapping[str, Any]) -> bool:
    """Return whether a boundary transmits any tangential force; files have null for infinity."""
    limit = boundary.get("friction_limit", 0.0)
    return limit is None or bool(np.isinf(limit))


def _contact(summary: Summary) -> Lines:
    touching = summary["touching_nodes"]
    present = summary.get("present_pressure")
    largest = summary["max_pressure"] if present is None else present
    per_area = "" if present is None else " per present area"
    peak = told(summary, "largest pressure", largest, "stress", per_area)
    if "numbers" not in summary:
        peak += _no_limit({"no_limit": summary.get("no_limit_of_pressure")})
    pressed = f", largest pressure {peak}" if touching else ""
    boundaries = summary.get("contact_boundaries") or ()
    few = [
        f"; only {row['touching_nodes']} on {row['boundary']}: refine there"
        for row in boundaries
        if row.get("touching_nodes") in range(1, FEW_NODES)
    ]
    sliding = [
        f"{row['boundary']} slides at the speed {figure(row['slip_speed'][0])} to "
        f"{figure(row['slip_speed'][1])}, coefficient "
        f"{figure(row['tangential_force'] / row['pressure_integral'])}"
        for row in boundaries
        if row.get("slip_speed") and row["pressure_integral"]
    ]
    where = f"at {touching} of {summary['contact_nodes']} nodes"
    area = summary.get("numbers", {}).get("contact area") or {}
    plane = summary.get("dimension") == 2 and kinematics_of(summary).uniform
    size = "length" if plane else "area"
    over = (
        f", {size} {told(summary, 'contact area', area['value'], size)}"
        if area.get("error")
        else ""
    )
    return [f"{where}{over}{pressed}{''.join(few)}", *sliding]


def _forces(summary: Summary) -> Lines:
    """Return the normal and the tangential force on the body; between bodies, those of each
    boundary.
    """
    entries = [
        {**entry, "name": f" on {entry['boundary']}"}
        for entry in summary.get("contact_boundaries", ())
    ]
    if not (touch_each_other(summary) and entries):
        entries = [{**summary, "name": ""}]
    size = max(
        abs(part)
        for entry in entries
        for key in ("contact_force", "friction_force")
        for part in entry[key]
    )
    kinematics = kinematics_of(summary)

    def of(entry: dict[str, Any], key: str) -> str:
        force = clean(entry[key], size)
        # Over a revolution radial forces cancel.
        shown = force if kinematics.uniform else force[1]
        kind = key.partition("_")[0].replace("contact", "force")
        name = entry["name"] if len(entries) > 1 else ""
        return told(summary, f"{kind}{name}", shown, "force")

    texts = Lines()
    for entry in entries[:MOST_ROWS]:
        shear = "friction" if has_friction(summary) else "shear" if _is_bonded(entry) else ""
        friction = f", {shear} {of(entry, 'friction_force')}" if shear else ""
        along = "" if kinematics.uniform else " along the axis"
        texts.append(f"{of(entry, 'contact_force')}{friction}{along}{entry['name']}")
    return texts


def _max_shear(summary: Summary) -> Lines:
    """Return the largest shear; nothing without friction."""
    shear = with_unit(figure(summary["max_shear"]), "stress")
    return [shear] if has_friction(summary) else []


def _zones(summary: Summary) -> Lines:
    return [
        row(
            f"{name} zone",
            ", ".join(f"{point_in_words(a)} to {point_in_words(b)}" for a, b in runs),
        )
        for name, runs in summary["zones"].items()
        if runs
    ]


def _areas(summary: Summary) -> Lines:
    """Return the contact area, and a note if friction also acts outside of it."""
    lines: Lines = [
        row(f"{name} area", f"{area:.6g}") for name, area in summary["areas"].items() if area
    ]
    laws = {effect["friction"]["law"] for effect in summary.get("scene", {}).get("contact", ())}
    if "tresca" in laws and summary.get("touching_nodes") != summary.get("contact_nodes"):
        lines.append(row("note", "Tresca friction also acts where there is no contact"))
    return lines


def _moment(key: str, summary: Summary) -> Lines:
    """Return a resultant moment about the origin; components within round-off of the moments count
    as zero; nothing if several bodies are in contact.
    """
    size = float(np.abs([summary["contact_moment"], summary["friction_moment"]]).max())
    if on_several_bodies(summary):
        return []
    moment = told(summary, key.replace("_", " "), clean(summary[key], size), "moment")
    return [f"{moment}, about the origin"]


def _boundaries(summary: Summary) -> Lines:
    areas = []
    friction = []
    for entry in summary["contact_boundaries"][:MOST_ROWS]:
        mean = (
            ""
            if entry["mean_pressure"] is None
            else f", mean pressure there {entry['mean_pressure']:.6g}"
        )
        areas.append(
            f"{entry['boundary']}: {entry['contact_area']:.6g} of {entry['area']:.6g}{mean}"
        )
        limit = entry["friction_limit"]
        if limit is not None and limit <= 0:
            continue
        force = f"{entry['tangential_force']:.6g}"
        if (
            entry["friction_moment"] is not None
            and entry["tangential_force"] < NEGLIGIBLE * entry["pressure_integral"]
        ):
            # The boundary transmits the moment.
            force = f"a moment of {np.linalg.norm(entry['friction_moment']):.6g} about its middle"
            limit = entry["moment_limit"]
        bonded = limit is None or np.isinf(limit)  # null in a file: infinite
        friction.append(
            f"{entry['boundary']}: {force}, {'bonded' if bonded else f'at most {limit:.6g}'}"
        )
    return [*labelled("in contact", areas), *labelled("friction", friction)]


def _rigid_bodies(summary: Summary) -> Lines:
    """Return the motions of the rigid bodies, and the forces of the elastic body on them."""
    motions = Lines()
    forces = Lines()
    for body in summary["rigid_bodies"]:
        error = body["gap_error"]
        gap = "" if error is None else f"; gap error {error:.1e}"
        name = body["boundary"]
        moved = told(summary, f"displacement of {name}", body["displacement"], "length")
        motions.append(
            f"{name}: displacement {moved}; rotation {figure(body['rotation'])} rad{gap}"
        )
        forces.append(
            f"{name}: contact force {figure(body['force'])}, moment "
            f"{figure(body['moment'])} about {figure(body['reference'])}"
        )
    return [*motions, *forces]


def _preloads(summary: Summary) -> Lines:
    return [
        f"{section['name'].removeprefix('preload ')}: force {section['force']:.6g}, shortened by "
        f"{section['shortening']:.6g}"
        for section in summary["preloads"]
    ]


def _resultants(summary: Summary) -> Lines:
    """Return the forces through the other boundaries, with their lines of action or the torque of a
    section; those of contacts only if there are several.
    """
    several = len(summary.get("contact_boundaries", ())) > 1
    kinematics = kinematics_of(summary)
    rows = [entry for entry in summary["resultants"] if entry["acts"] != ["contact"] or several]
    lines = Lines()
    for entry in rows[:MOST_ROWS]:
        moment = entry["moment"]
        couple = in_brackets(moment) if isinstance(moment, list) else f"{moment:.6g}"
        where = f", moment {couple}" if np.any(moment) else ", no moment"
        where = where if kinematics.uniform else ""
        where = (
            where if entry["acts_at"] is None else f", acts at {point_in_words(entry['acts_at'])}"
        )
        torque = f", torque {moment[1]:.6g}," if kinematics.out_of_section else ""
        name = "" if entry["boundary"] is None else f"{entry['boundary']}: "
        lines.append(
            f"{name}{in_brackets(entry['force'])}{torque} by {' and '.join(entry['acts'])}{where}"
        )
    if len(rows) > MOST_ROWS:
        lines.append(f"and {len(rows) - MOST_ROWS} more in summary.json")
    return lines


def _stress(summary: Summary) -> Lines:
    """Return the larger one of the raw and the recovered von Mises stress, its place, and the
    fraction of the yield stress that it uses.
    """
    largest = largest_von_mises(summary)
    if largest is None:
        return []
    share = (summary.get("utilisation") or {}).get("value")
    used = "" if share is None else f", {share_in_words(summary, 'yield')}"
    error = None if largest.get("no_limit") else largest.get("error")
    value = with_unit(with_error(largest["value"], error), "stress")
    unknown = ", error not known" * (error is None and not largest.get("no_limit"))
    text = f"von Mises {value}{unknown}{used}, {_place(largest)}{_no_limit(largest)}"
    return [row("stress", text, "" if share is None or share <= 1 else "warning")]


def _place(largest: dict[str, Any]) -> str:
    region = f" in {largest['region']}" if largest.get("region") else ""
    return f"at {with_unit(point_in_words(largest['place']), 'length')}{region}"


def _no_limit(largest: dict[str, Any]) -> str:
    why = largest.get("no_limit")
    return "" if why is None else f"; {NO_FINITE_VALUE}{why}"


def _plastic_strain(summary: Summary) -> Lines:
    """Return the largest plastic strain and its place, or that nothing has yielded."""
    largest = summary["plastic_strain"]
    return [
        "nothing has yielded"
        if largest["value"] == 0
        else f"{figure(largest['value'])} {_place(largest)}"
    ]


def _utilisation(summary: Summary) -> Lines:
    """Return the fraction of the yield stress, its place, and advice if it exceeds 1."""
    largest = summary["utilisation"]
    exceeded = largest["value"] is not None and largest["value"] > 1
    yields = '; above the yield stress: use law = "j2"' if exceeded else ""
    return [f"{share_in_words(summary)} {_place(largest)}{yields}{_no_limit(largest)}"]


def _deformation(summary: Summary) -> Lines:
    figures = summary["deformation"]
    return [
        f"strains and rotations of {figures['gradient']:.1e} on average, displacements of at most "
        f"{figures['displacement']:.1e} times the size of the body"
    ]


def _cost(summary: Summary) -> Lines:
    """Return the time that this error took and the time for a smaller error, or why there is no
    forecast.
    """
    cost = summary["cost"]
    if cost.get("error") is None:
        return [f"no forecast: {cost['statement']}"]
    if (
        summary.get("status") == Status.OUT_OF_REACH.value
    ):  # even if the observed rate suggests otherwise
        return [f"{cost['statement'].partition(';')[0]}; no finer mesh helps"]
    return [cost["statement"]]


def _error(summary: Summary) -> Lines:
    """Return the error of the results, guaranteed or estimated, or how to estimate it, and the
    error of time steps.
    """
    if not validity_of(summary).solved:
        return []
    steps = any(STEPS_UNESTIMATED in row["message"] for row in summary.get("findings", ()))
    of_time = [
        f"; of time steps {percent(row['time_error'])}, estimated"
        for row in summary.get("steps", ())
        if row.get("time_error") is not None
    ]
    return [_error_of_mesh(summary) + f"; {STEPS_UNESTIMATED}" * steps + "".join(of_time[-1:])]


def _error_of_mesh(summary: Summary) -> str:
    """Return the discretisation error as text."""
    relative = (summary.get("error_bound") or {}).get("relative_error")
    if relative is not None:
        return f"at most {percent(relative)} of the energy norm, guaranteed"
    prices = solved_prices(summary)
    errors = [
        f"{name} {percent(prices[of])}"
        for of, name in _ESTIMATED.items()
        if prices.get(of) is not None
    ]
    if errors:
        return f"{', '.join(errors)}, estimated"
    of_stress = (summary.get("stress") or {}).get("error")
    cost = summary.get("cost") or {}
    if of_stress is None and cost.get("of") == "energy":  # without fields the summary has no stress
        of_stress = cost.get("error")
    if of_stress is not None:
        return f"of the stress {percent(of_stress)} in the mean, estimated"
    scene = summary.get("scene") or {}
    refused = cost.get("statement", "").startswith(NO_ACCURACY)
    asks = scene.get("contact") and "forms" not in scene and "strain_energy" in summary
    finer = "solve on a finer mesh as well, and compare"
    how = "run with --accuracy 5%" if asks and not refused else finer
    return f"no estimate: {how}"


def _certificate(summary: Summary) -> Lines:
    figures = summary["certificate"]
    law = figures["law"].partition(",")[0]
    if figures["holds"]:
        return [row("certificate", f"holds for {law}, each condition to {figures['checked']:.0e}")]
    judged = {name.replace("_", " "): figures.get(name) for name in JUDGED}
    wrong = [
        f"{name} {value:.1e}"
        for name, value in judged.items()
        if value and not value <= CERTIFICATE_TOLERANCE
    ]
    figures_above = ", ".join(wrong) or "not a number"
    limit = f"limit {CERTIFICATE_TOLERANCE:.0e}"
    return [row("certificate", f"FAILED for {law}: {figures_above} ({limit})", "error")]


def _left(summary: Summary) -> Lines:
    """Return the error due to the penalties: penetration and elastic slip."""
    figures = summary["certificate"]
    penetration = f"{figures['penetration']:.1e}"
    slip = f"{figures['stick_slip']:.1e}"
    text = f"penetration {penetration}, elastic slip {slip} times the largest displacement"
    return [text] if "contact_force" in summary else []


def _effort(summary: Summary) -> Lines:
    ranks = f" on {summary['ranks']} ranks" if summary["ranks"] > 1 else ""
    solved = [
        row["seconds"] for row in summary.get("convergence_table", []) if not row["predicted"]
    ]
    seconds = sum(solved) if solved else sum(summary.get("timings", {}).values())
    return [f"{effort_in_words(summary)}, {summary['dofs']} unknowns{ranks}, {seconds:.1f} s"]


# Largest number of warnings that are printed without --verbose.
_MOST_WARNINGS = 3


def short_answer(summary: Summary, folder: Path | None = None) -> list[TerminalLine]:
    """Return what ``solve`` prints without ``--verbose``, in 80 columns: outcome, first warnings,
    advice unless it is a solution, the main results, and the result folder if there is one.
    """
    warnings = warning_lines(summary)
    if (more := len(warnings) - _MOST_WARNINGS) > 0:
        rest = row("warning", f"{more} more with --verbose, and in summary.json", "warning")
        warnings = [*warnings[:_MOST_WARNINGS], rest]
    brief = brief_lines(summary)
    first = int("limit" in summary)
    answer = [*outcome_lines(summary), *effect_lines(summary), *brief[first:]]
    lines = [*brief[:first], *warnings, *answer]
    lines += [row("results", f"{folder}/")] if folder else []
    return [heading(summary), *(narrow for line in lines for narrow in _narrow(line))]


def _narrow(line: TerminalLine) -> list[TerminalLine]:
    """Return a line in 80 columns with a short label; a longer label ends with a colon."""
    label = line.begin.strip()
    begin = f"  {label:12s}" if len(label) < 12 else f"  {label}: "
    # Keep an error on the line of its number.
    whole = printable(line.text).replace(" +- ", "\N{NO-BREAK SPACE}+-\N{NO-BREAK SPACE}")
    texts = textwrap.wrap(whole, COLUMNS - len(begin))
    return [
        TerminalLine(
            begin if k == 0 else " " * 14,
            text.replace("\N{NO-BREAK SPACE}", " "),
            line.kind * (k == 0),
        )
        for k, text in enumerate(texts)
    ]


def heading(summary: Summary) -> TerminalLine:
    """Return the first line: title and outcome."""
    good = summary["converged"] and not summary["incomplete"]
    title = printable(summary["title"]) or "scene"
    return TerminalLine(f"{title}: {status_in_words(summary)}", kind="good" if good else "")


def outcome_lines(summary: Summary) -> list[TerminalLine]:
    """Return the load step of the results, and the advice unless it is a solution."""
    lines = [row("results of", results_of(summary))] if "results_of" in summary else []
    return (
        lines if summary["converged"] else [*lines, row("what to do", summary["advice"], "advice")]
    )


def effect_lines(summary: Summary) -> list[TerminalLine]:
    """Return the notes about effects from step to step, such as wear, under their keys."""
    notes = [found for found in summary["findings"] if found["level"] == "note"]
    keyed = [(note["path"].rpartition(".")[2], note["message"]) for note in notes]
    return [row(key, message) for key, message in keyed if key in names_of(STEP_EFFECTS)]


def warning_lines(summary: Summary) -> list[TerminalLine]:
    """Return the warnings, those of a certain entry before those of the whole scene."""
    found = [
        finding
        for finding in summary["findings"]
        if finding["level"] == "warning"
        and finding["message"] not in summary["advice"]
        and summary["advice"] not in finding["message"]
    ]
    found.sort(key=lambda finding: "[" not in finding["path"])
    return [
        row("warning", f"{finding['path']}: {finding['message']}", "warning") for finding in found
    ]


_TABLE = (
    Shown("limit", "limit", _limit, brief=True),
    Shown("contact_force", "force", _forces, brief=True),
    Shown("rigid_bodies", "foundation", _rigid_bodies, brief=True),
    Shown("preloads", "preload", _preloads, brief=True),
    Shown("contact_nodes", "contact", _contact, brief=True),
    Shown("corners", "corner", _corners, brief=True),
    Shown("stress", "stress", _stress, brief=True),
    Shown("friction_used", "friction", _friction, brief=True),
    Shown("status", "error", _error, brief=True),
    Shown("cost", "cost", _cost, brief=True),
    Shown("certificate", "certificate", _certificate, brief=True),
    Shown("dofs", "effort", _effort, brief=True),
    Shown("certificate", "penalty error", _left),
    Shown("max_shear", "largest shear", _max_shear),
    Shown("zones", "zone", _zones),
    Shown("areas", "area", _areas),
    Shown("contact_moment", "contact moment", partial(_moment, "contact_moment")),
    Shown("friction_moment", "friction moment", partial(_moment, "friction_moment")),
    Shown("contact_boundaries", "in contact", _boundaries),
    Shown("resultants", "forces", _resultants),
    Shown("strain_energy", "strain energy"),
    Shown("plastic_strain", "plastic strain", _plastic_strain),
    Shown("utilisation", "yield stress used", _utilisation),
    Shown("deformation", "deformation", _deformation),
    Shown("error_bound", "error bound", lambda summary: [summary["error_bound"]["statement"]]),
)
