"""How figures and tables are shown, in a notebook, on a page and on a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

from signorini_fx.kinematics import of_data
from signorini_fx.machine.terminal import printable
from signorini_fx.records import Status


def html_table(columns: Sequence[str], rows: Iterable[Sequence[Any]], caption: str = "") -> str:
    """A table in HTML; numbers with six digits."""

    def safe(text: str) -> str:
        return escape(printable(text))

    def cell(value: Any) -> str:
        return safe(f"{value:.6g}" if isinstance(value, float) else str(value))

    head = "".join(f"<th>{safe(name)}</th>" for name in columns)
    body = "".join(f"<tr>{''.join(f'<td>{cell(value)}</td>' for value in row)}</tr>" for row in rows)
    return f"<table><caption>{safe(caption)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def clean(value: Any, scale: float) -> Any:
    """Components of a vector that are round-off beside the scale are zero; a single number stays."""
    return [0.0 if abs(c) <= 1e-9 * scale else c for c in value] if isinstance(value, list) else value


def duration(seconds: float) -> str:
    """A time that is only known roughly."""
    if seconds < 10:
        return "below 0.01 s" if seconds < 0.01 else f"{seconds:.1g} s"
    if seconds < 600:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def storage(size: float) -> str:
    """A number of bytes that is only known roughly."""
    if size < 1e6:
        return "below 1 MB"
    return f"{size / 1e6:.0f} MB" if size < 1e9 else f"{size / 1e9:.1f} GB"


def status_in_words(summary: dict[str, Any]) -> str:
    """How a solve has ended, and whether its scene lacks something of what was meant."""
    return str(summary["status"]) + (", incomplete" if summary.get("incomplete") else "")


def deformation_in_words(figures: dict[str, float]) -> str:
    """How small the deformation is."""
    return (
        f"strains and rotations of {figures['gradient']:.1e} on average, displacements of at most "
        f"{figures['displacement']:.1e} times the size of the body"
    )


def touch_each_other(summary: dict[str, Any]) -> bool:
    """Whether bodies touch each other: then the contact force of a boundary acts on the body that it is of."""
    return any(effect.get("against") for effect in (summary.get("scene") or {}).get("contact", ()))


def on_several_bodies(summary: dict[str, Any]) -> bool:
    """Whether the contact forces have no resultant that acts on one body: they are those of several such boundaries."""
    return touch_each_other(summary) and len(summary.get("contact_boundaries", ())) > 1


def results_of(summary: dict[str, Any]) -> str:
    """The load step that the results are of."""
    of, count = summary["results_of"], len(summary["steps"])
    if of["status"] != Status.CONVERGED.value:
        qualifier = "the last iterate of "
    else:
        qualifier = "" if summary["converged"] else "the last one with a solution, "
    named = f"{of['name']}, " if of["name"] else ""
    failed = "" if summary["converged"] or of["step"] == count else f"; load step {count} has none"
    until = f" at time {summary['steps'][-1]['time']:.6g}" if failed else ""
    return f"{qualifier}load step {of['step']} ({named}time {of['time']:.6g}){failed}{until}"


def safety_in_words(safety: dict[str, Any]) -> str:
    """The safety factor of a summary, the motion beyond it, and what it does not say."""
    beyond = "" if safety["factor"] is None else f"; beyond, {safety['motion']}"
    return "; ".join(
        [safety_factor(safety) + beyond, *friction_in_use(safety), safety_proved(safety), *safety_assumed(safety)]
    )


def safety_assumed(safety: dict[str, Any]) -> list[str]:
    """What a safety factor rests on."""
    return [f"assumed: {safety['assumed']}"] if safety.get("assumed") else []


def safety_proved(safety: dict[str, Any]) -> str:
    """Of what a safety factor is proved: of the body, or only of its mesh."""
    if safety["of_body"]:
        return "proved for the body"
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
    share = "" if used is None else f": the live loads use {100 * used:.3g} % of it, with the pressures as they are"
    return [f"friction may give way before{share}"]


def effort_in_words(summary: dict[str, Any]) -> str:
    """How many linear solves and factorisations a solve took."""
    counts = (summary["linear_solves"], "linear solve"), (summary["factorisations"], "factorisation")
    return ", ".join(f"{count} {noun}{'s' * (count != 1)}" for count, noun in counts)


def preload_in_words(row: dict[str, Any]) -> str:
    """The force through a section that is tightened, from a row of a summary."""
    return f"{row['name'].removeprefix('preload ')}: force {row['force']:.6g}, shortened by {row['shortening']:.6g}"


def tool_in_words(tool: dict[str, Any]) -> str:
    """How a foundation that forces move has moved, and what the body does to it, from a row of a summary."""

    def told(value: Any) -> str:
        return f"({', '.join(map(told, value))})" if isinstance(value, list) else f"{value:.6g}"

    names = ("displacement", "rotation", "force", "moment", "reference")
    moved, turned, force, moment, point = (told(tool[name]) for name in names)
    off = "" if tool["gap_error"] is None else f"; gap linearised, off by {tool['gap_error']:.1e}"
    return f"{tool['boundary']}: moved by {moved}, turned by {turned}, takes {force}, about {point} {moment}{off}"


def point_in_words(point: Sequence[float]) -> str:
    """The coordinates of a point, without round-off."""
    return "(" + ", ".join(f"{round(x, 9) + 0.0:.6g}" for x in point) + ")"


def resultant_in_words(row: dict[str, Any], scene: dict[str, Any]) -> str:
    """What acts through a boundary and where, from a row of a summary with its scene, and the torque of a section."""
    kinematics = of_data(scene)
    moment = row["moment"] if isinstance(row["moment"], list) else [row["moment"]]
    couple = f"({', '.join(f'{m:.6g}' for m in moment)})" if len(moment) > 1 else f"{moment[0]:.6g}"
    nowhere = "" if not kinematics.uniform else f", a couple of {couple}" if any(moment) else ", no couple"
    where = nowhere if row["acts_at"] is None else f", acts at {point_in_words(row['acts_at'])}"
    torque = f", torque {row['moment'][1]:.6g}," if kinematics.out_of_section else ""
    name = "" if row["boundary"] is None else f"{row['boundary']}: "
    return f"{name}({', '.join(f'{f:.6g}' for f in row['force'])}){torque} by {' and '.join(row['acts'])}{where}"
