"""The one table of the results that a terminal and the report print, and the estimates of their errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from signorini_fx.machine.display import clean, effort_in_words, on_several_bodies, touch_each_other
from signorini_fx.machine.result_files import seconds_of
from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.mechanics.statement.units import with_unit
from signorini_fx.quantities.quantity import Quantity, own_quantities
from signorini_fx.quantities.text import (
    MOST_ROWS,
    Validity,
    between,
    cost_in_words,
    digits,
    error_in_words,
    figure,
    figure_or_error,
    friction_in_words,
    has_friction,
    in_brackets,
    kinematics_of,
    labelled,
    largest_von_mises,
    named_components,
    percent,
    point_in_words,
    resultant_in_words,
    row,
    share_in_words,
    solved_prices,
    tool_in_words,
    validity_of,
)
from signorini_fx.records import JUDGED
from signorini_fx.tuned import CERTIFICATE_TOLERANCE, FEW_NODES

# Figures of a summary.
Summary = dict[str, Any]


@dataclass(frozen=True)
class Shown:
    """How a key of the summary is shown, if it is there."""

    key: str  # the key
    label: str  # what it is
    # its lines, each as its text, or with a label of its own; None: the number
    format: Callable[[Summary], list[str | TerminalLine]] | None = None
    brief: bool = False  # whether the terminal shows it without --verbose, and the report first


def table() -> list[Shown]:
    """All that is shown, in its order, those of others last."""
    own = (Shown(one.key, one.key.replace("_", " "), partial(_own, one), brief=True) for one in own_quantities())
    return [*_TABLE, *own]


def _own(quantity: Quantity, summary: Summary) -> list[str | TerminalLine]:
    return [with_unit(digits(summary[quantity.key]), quantity.unit)]


def shown_lines(shown: Shown, summary: Summary) -> list[TerminalLine]:
    """The lines of a result."""
    value = summary.get(shown.key)
    if value is None:
        return []
    texts = [digits(value, error_of(summary, shown.key))] if shown.format is None else shown.format(summary)
    if any(isinstance(text, TerminalLine) for text in texts):
        return [text if isinstance(text, TerminalLine) else row(shown.label, text) for text in texts]
    return labelled(shown.label, list(map(str, texts)))


def brief_lines(summary: Summary) -> list[TerminalLine]:
    """What is asked first of a solution, be it that of an earlier load step; without one there is nothing."""
    if not validity_of(summary).solved:
        return []
    return [line for shown in table() if shown.brief for line in shown_lines(shown, summary)]


def error_of(summary: Mapping[str, Any], key: str) -> float | None:
    """The estimated error of a figure of a summary, relative to its size; None: there is no estimate."""
    prices = solved_prices(summary)
    if key == "strain_energy":  # the square of that in the energy norm
        energy = prices.get("energy")
        return None if energy is None else float(energy**2)
    if key in ("max_pressure", "max_shear"):
        return prices.get("peak" if key == "max_pressure" else "pressure")
    return _error_of_force(summary, key, prices.get("force")) if key in ("contact_force", "friction_force") else None


def _error_of_force(summary: Mapping[str, Any], key: str, error: float | None) -> float | None:
    """It is relative to the forces of all boundaries, and so large where these nearly cancel, or where friction, which
    is as uncertain as the contact force is, nearly vanishes.
    """
    if error is None:
        return None
    contact, friction = (math.hypot(*summary.get(name, [0.0])) for name in ("contact_force", "friction_force"))
    rows = summary.get("contact_boundaries", ())
    components = [f for row in rows for name in ("contact_force", "friction_force") for f in row.get(name, ())]
    if len(rows) > 1 and contact + friction > 0:
        error *= max(1.0, math.hypot(*components) / math.hypot(contact, friction))
    return error * contact / friction if key == "friction_force" and 0 < friction < contact else error


def _friction(summary: Summary) -> list[str | TerminalLine]:
    """How much of its friction the body uses; beyond the load step of the figures there is a limit, which is told."""
    if validity_of(summary) is Validity.EARLIER_STEP:
        return []
    used = summary["friction_used"]
    return [f"{percent(used)} used" if used else "the loads need none"]


def _contact(summary: Summary) -> list[str | TerminalLine]:
    touching = summary["touching_nodes"]
    peak = with_unit(figure_or_error(summary["max_pressure"], error_of(summary, "max_pressure")), "stress")
    pressed = f", largest pressure {peak}" if touching else ""
    boundaries = summary.get("contact_boundaries") or ()
    coarse = [row["boundary"] for row in boundaries if row.get("touching_nodes") in range(1, FEW_NODES)]
    few = f"; too few on {', '.join(coarse)} for the ends of the zone or the largest pressure, refine there"
    return [f"at {touching} of {summary['contact_nodes']} nodes{pressed}{few if coarse else ''}"]


def _forces(summary: Summary) -> list[str | TerminalLine]:
    """The normal and the tangential force on the body; where bodies touch each other those of each boundary."""
    entries = [{**entry, "name": f" on {entry['boundary']}"} for entry in summary.get("contact_boundaries", ())]
    if not (touch_each_other(summary) and entries):
        entries = [{**summary, "name": ""}]
    size = max(abs(part) for entry in entries for key in ("contact_force", "friction_force") for part in entry[key])
    kinematics = kinematics_of(summary)

    def of(entry: dict[str, Any], key: str) -> str:
        force = clean(entry[key], size)
        names = named_components(kinematics, len(force))
        shown = force if len(names) == len(force) else force[next(iter(names))]
        return with_unit(figure_or_error(shown, error_of(summary, key)), "force")

    texts = list[str | TerminalLine]()
    for entry in entries[:MOST_ROWS]:
        friction = f", friction {of(entry, 'friction_force')}" if has_friction(summary) else ""
        along = "" if kinematics.uniform else " along the axis"
        texts.append(f"{of(entry, 'contact_force')}{friction}{along}{entry['name']}")
    return texts


def _resultant(summary: Summary, key: str) -> str:
    """A resultant force or moment; components that are round-off of those at work count as zero."""
    kind = key.partition("_")[2]
    size = float(np.abs([summary[f"contact_{kind}"], summary[f"friction_{kind}"]]).max())
    return in_brackets(clean(summary[key], size))


def _max_shear(summary: Summary) -> list[str | TerminalLine]:
    """None without friction."""
    shear = with_unit(figure_or_error(summary["max_shear"], error_of(summary, "max_shear")), "stress")
    return [shear] if has_friction(summary) else []


def _zones(summary: Summary) -> list[str | TerminalLine]:
    return [
        row(f"{name} zone", ", ".join(f"{point_in_words(a)} to {point_in_words(b)}" for a, b in runs))
        for name, runs in summary["zones"].items()
        if runs
    ]


def _areas(summary: Summary) -> list[str | TerminalLine]:
    """With it that friction acts beside the contact too."""
    lines: list[str | TerminalLine] = [
        row(f"{name} area", f"{area:.6g}") for name, area in summary["areas"].items() if area
    ]
    laws = {effect["friction"]["law"] for effect in summary.get("scene", {}).get("contact", ())}
    if "tresca" in laws and summary.get("touching_nodes") != summary.get("contact_nodes"):
        lines.append(row("note", "Tresca friction also acts where there is no contact"))
    return lines


def _moment(key: str) -> Callable[[Summary], list[str | TerminalLine]]:
    return lambda summary: [] if on_several_bodies(summary) else [f"{_resultant(summary, key)}, about the origin"]


def _boundaries(summary: Summary) -> list[str | TerminalLine]:
    areas, friction = [], []
    for entry in summary["contact_boundaries"][:MOST_ROWS]:
        mean = "" if entry["mean_pressure"] is None else f", mean pressure there {entry['mean_pressure']:.6g}"
        areas.append(f"{entry['boundary']}: {entry['contact_area']:.6g} of {entry['area']:.6g}{mean}")
        if entry["friction_limit"] is None or entry["friction_limit"] > 0:  # null in a file: infinite
            friction.append(f"{entry['boundary']}: {friction_in_words(entry)}")
    return [*labelled("in contact", areas), *labelled("friction", friction)]


def _tools(summary: Summary) -> list[str | TerminalLine]:
    return [text for texts in zip(*map(tool_in_words, summary["tools"]), strict=True) for text in texts]


def _preloads(summary: Summary) -> list[str | TerminalLine]:
    return [
        f"{section['name'].removeprefix('preload ')}: force {section['force']:.6g}, shortened by "
        f"{section['shortening']:.6g}"
        for section in summary["preloads"]
    ]


def _resultants(summary: Summary) -> list[str | TerminalLine]:
    """What acts through the other boundaries, and where; contact too if it has several."""
    several = len(summary.get("contact_boundaries", ())) > 1
    rows = [row for row in summary["resultants"] if row["acts"] != ["contact"] or several]
    lines: list[str | TerminalLine] = [resultant_in_words(row, summary.get("scene") or {}) for row in rows[:MOST_ROWS]]
    return [*lines, *([f"and {len(rows) - MOST_ROWS} more in summary.json"] if len(rows) > MOST_ROWS else [])]


def _stress(summary: Summary) -> list[str | TerminalLine]:
    """The larger one of the raw and the recovered von Mises stress, how much of the yield stress it uses, and where."""
    largest = largest_von_mises(summary)
    if largest is None:
        return []
    share = (summary.get("utilisation") or {}).get("value")
    used = "" if share is None else f", {share_in_words(summary, 'yield')}"
    value = with_unit(figure(largest["value"], between(summary["stress"])), "stress")
    text = f"von Mises {value}{used}, {_place(largest)}{_no_limit(largest)}"
    return [row("stress", text, "" if share is None or share <= 1 else "warning")]


def _place(largest: dict[str, Any]) -> str:
    region = f" in {largest['region']}" if largest.get("region") else ""
    return f"at {with_unit(point_in_words(largest['place']), 'length')}{region}"


def _no_limit(largest: dict[str, Any]) -> str:
    why = largest.get("no_limit")
    return "" if why is None else f"; no limit as the mesh is refined: {why}"


def _plastic_strain(summary: Summary) -> list[str | TerminalLine]:
    """The largest one and its place; or that nothing has yielded."""
    largest = summary["plastic_strain"]
    return ["nothing has yielded" if largest["value"] == 0 else f"{figure(largest['value'])} {_place(largest)}"]


def _utilisation(summary: Summary) -> list[str | TerminalLine]:
    """The share, where it is reached, and what follows if it is above 1."""
    largest = summary["utilisation"]
    exceeded = largest["value"] is not None and largest["value"] > 1
    yields = "; it would yield, which linear elasticity does not know" if exceeded else ""
    return [f"{share_in_words(summary)} {_place(largest)}{yields}{_no_limit(largest)}"]


def _deformation(summary: Summary) -> list[str | TerminalLine]:
    figures = summary["deformation"]
    return [
        f"strains and rotations of {figures['gradient']:.1e} on average, displacements of at most "
        f"{figures['displacement']:.1e} times the size of the body"
    ]


def _error(summary: Summary) -> list[str | TerminalLine]:
    return [error_in_words(summary)] if validity_of(summary).solved else []


def _certificate(summary: Summary) -> list[str | TerminalLine]:
    figures = summary["certificate"]
    law = figures["law"].partition(",")[0]
    if figures["holds"]:
        return [row("certificate", f"holds for {law}, each condition to {CERTIFICATE_TOLERANCE:.0e}")]
    judged = {name.replace("_", " "): figures.get(name) for name in JUDGED}
    wrong = [f"{name} {value:.1e}" for name, value in judged.items() if value and not value <= CERTIFICATE_TOLERANCE]
    return [row("certificate", f"DOES NOT HOLD for {law}: {', '.join(wrong) or 'not a number'}", "error")]


def _left(summary: Summary) -> list[str | TerminalLine]:
    """What regularisation leaves."""
    figures = summary["certificate"]
    penetration, slip = f"{figures['penetration']:.1e}", f"{figures['stick_slip']:.1e}"
    left = f"penetration {penetration}, elastic slip {slip} times the largest displacement"
    return [left] if "contact_force" in summary else []


def _effort(summary: Summary) -> list[str | TerminalLine]:
    ranks = f" on {summary['ranks']} ranks" if summary["ranks"] > 1 else ""
    return [f"{effort_in_words(summary)}, {summary['dofs']} unknowns{ranks}, {seconds_of(summary):.1f} s"]


_TABLE = (
    Shown("contact_force", "force", _forces, brief=True),
    Shown("tools", "foundation", _tools, brief=True),
    Shown("preloads", "preload", _preloads, brief=True),
    Shown("contact_nodes", "contact", _contact, brief=True),
    Shown("stress", "stress", _stress, brief=True),
    Shown("friction_used", "friction", _friction, brief=True),
    Shown("status", "error", _error, brief=True),
    Shown("cost", "cost", lambda summary: [cost_in_words(summary)], brief=True),
    Shown("certificate", "certificate", _certificate, brief=True),
    Shown("dofs", "effort", _effort, brief=True),
    Shown("certificate", "left by gamma", _left),
    Shown("max_shear", "largest shear", _max_shear),
    Shown("zones", "zone", _zones),
    Shown("areas", "area", _areas),
    Shown("contact_moment", "contact moment", _moment("contact_moment")),
    Shown("friction_moment", "friction moment", _moment("friction_moment")),
    Shown("contact_boundaries", "in contact", _boundaries),
    Shown("resultants", "forces", _resultants),
    Shown("strain_energy", "strain energy"),
    Shown("plastic_strain", "plastic strain", _plastic_strain),
    Shown("utilisation", "yield stress used", _utilisation),
    Shown("deformation", "deformation", _deformation),
    Shown("error_bound", "error bound", lambda summary: [summary["error_bound"]["statement"]]),
)
