"""The sections of the page, each from the summary and the files of a result folder."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Mapping
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.display import clean, results_of
from signorini_fx.records import CERTIFICATE_TOLERANCE, FEW_NODES, Status
from signorini_fx.report.markup import Markup, is_number, joined, long_table, picture, shown, table, tag
from signorini_fx.report.pyvista_pictures import FIELDS
from signorini_fx.report.reading import ResultFiles

# Every figure of the certificate: its limit, None if it is only reported, and its meaning.
JUDGED: dict[str, tuple[float | None, str]] = {
    "equilibrium": (CERTIFICATE_TOLERANCE, "forces out of balance, contact tractions included"),
    "supports": (CERTIFICATE_TOLERANCE, "largest difference from a prescribed displacement"),
    "negative_pressure": (CERTIFICATE_TOLERANCE, "largest tension that the contact transmits"),
    "friction_cone": (CERTIFICATE_TOLERANCE, "largest shear beyond the friction bound"),
    "wrong_way_slip": (CERTIFICATE_TOLERANCE, "slip in the direction of the friction force"),
    "entered": (CERTIFICATE_TOLERANCE, "deepest penetration beyond that allowed by the law"),
    "pressure_at_distance": (CERTIFICATE_TOLERANCE, "largest pressure where there is a distance"),
    "slip_below_bound": (CERTIFICATE_TOLERANCE, "largest slip where the shear is below its bound"),
    "displacement": (None, "largest displacement over the size of the body"),
    "penetration": (None, "deepest penetration; the regularised law allows pressure / gamma_n"),
    "complementarity": (None, "largest product of pressure and distance"),
    "stick_slip": (None, "largest slip where the body sticks; the regularised law allows shear / gamma_t"),
}
# A solution, less accurate than required.
_SHORT_OF_ACCURACY = (Status.BUDGET.value, Status.OUT_OF_REACH.value)


def file_of(suffix: str, draw: Any, *arguments: Any, **options: Any) -> bytes:
    """The file that a drawing function writes."""
    with tempfile.TemporaryDirectory() as folder:
        if suffix == ".svg":
            draw(Path(folder) / "picture", *arguments, suffixes=[suffix], **options)
        else:
            draw(Path(folder) / f"picture{suffix}", *arguments, **options)
        return (Path(folder) / f"picture{suffix}").read_bytes()


def in_space(summary: dict[str, Any]) -> bool:
    """Whether the body is in space, not in the plane."""
    return bool(summary.get("dimension") == 3)


def outcome(summary: dict[str, Any]) -> Markup:
    """Status, verdict of the certificate, warnings and the most important figures."""
    good = summary["status"] == Status.CONVERGED.value
    short = summary["status"] in _SHORT_OF_ACCURACY
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
    text = [tag("strong", summary["status"]), tag("p", verdict)]
    if not good:
        text.append(tag("p", f"What to do: {summary['advice']}."))
    status = tag("div", *text, class_=f"status {'good' if good else 'short' if short else 'bad'}")
    warned = _findings(summary, "warning")
    names = {
        "contact_force": "contact force on the body",
        "friction_force": "friction force on the body",
        "max_pressure": "largest contact pressure",
        "max_shear": "largest shear",
        "strain_energy": "strain energy",
        "dofs": "unknowns",
        "contact_nodes": "contact nodes",
        "linear_solves": "linear solves",
    }
    largest = max((abs(f) for key in ("contact_force", "friction_force") for f in summary.get(key, [])), default=0.0)
    figures = [(label, shown(clean(summary[key], largest))) for key, label in names.items() if key in summary]
    figures.append(("seconds", f"{sum(summary['timings'].values()):.3g}"))
    cards = [tag("div", tag("dt", label), tag("dd", value)) for label, value in figures]
    measure = "what" if in_space(summary) else "per unit thickness, and what"
    note = f"Forces are {measure} the foundation exerts on the body; units are those of the scene."
    return joined([status, *warned, tag("dl", *cards, class_="figures"), tag("p", note, class_="note")])


def _findings(summary: dict[str, Any], level: str) -> list[Markup]:
    """The findings of one level about the scene and the result; empty if there are none."""
    found = [finding for finding in summary.get("findings", []) if finding["level"] == level]
    items = [tag("li", tag("code", finding["path"]), f": {finding['message']}.") for finding in found]
    return [tag("p", f"{level.capitalize()}s:"), tag("ul", *items)] if items else []


def certificate(summary: dict[str, Any]) -> Markup:
    """Every figure of the certificate beside its limit."""
    rows, classes = [], []
    for name, value in summary["certificate"].items():
        if name in ("holds", "law"):
            continue
        limit, meaning = JUDGED.get(name, (None, ""))
        missed = limit is not None and not (is_number(value) and value <= limit)
        verdict = "reported" if limit is None else "violated" if missed else "holds"
        judged = "" if limit is None else f"<= {limit:g}"
        rows.append((_named(name.replace("_", " "), meaning), _two_digits(value), verdict, judged))
        classes.append("missed" if missed else "")
    law = f" The law is {summary['certificate']['law']}." if "law" in summary["certificate"] else ""
    note = (
        "The conditions of the problem, checked after the iteration from the displacement and the contact "
        f"tractions alone.{law} Every figure is relative: to the largest stress, deformation or force."
    )
    parts = [tag("p", note, class_="note"), table(["figure", "value", "", "limit"], rows, classes)]
    if "functionals" in summary:
        gap = summary["functionals"]["relative_duality_gap"]
        parts.append(tag("p", f"The relative difference of primal and dual functional is {gap:.1e}."))
    return joined(parts)


def scene(summary: dict[str, Any]) -> Markup:
    """The effects of the scene, the method, and the scene as JSON."""
    scene = summary["scene"]
    mesh = scene["mesh"]
    rows: list[tuple[str, str]] = []
    if isinstance(mesh, dict) and "generator" in mesh:
        rows.append((_named("mesh", mesh["generator"]), shown(mesh["parameters"])))
    else:
        said = {key: value for key, value in mesh.items() if value} if isinstance(mesh, dict) else {}
        rows.append(("mesh", shown(said) or "made by refinement, or in Python"))
    rows.append(("element", shown(scene["element"])))
    for kind, place in (("material", "region"), ("displacement", "boundary"), ("traction", "boundary")):
        nothing = 0.0 if kind == "traction" else None
        rows += [(_named(kind, entry.get(place) or ""), _data(entry, place, nothing=nothing)) for entry in scene[kind]]
    if scene.get("body_force"):
        rows.append(("body force", _data(scene["body_force"], nothing=0.0)))
    for entry in scene["contact"]:
        friction = entry.get("friction") or {"law": "none"}
        rest = {key: value for key, value in entry.items() if key != "friction"}
        rows.append((_named(f"{entry['kind']} contact", entry["boundary"]), _data(rest, "boundary", "kind")))
        rows.append((_named(f"friction: {friction['law']}", entry["boundary"]), _data(friction, "law")))
    method = {"algorithm": summary["algorithm"], **summary["parameters"], "linear algebra": summary["linear_algebra"]}
    whole = tag("pre", json.dumps(scene, indent=1))
    return joined(
        [
            table(["effect", "data"], rows),
            tag("p", f"Method: {shown(method)}."),
            tag("details", tag("summary", "The whole scene with all defaults"), whole),
        ]
    )


def _named(name: str, remark: str) -> Markup:
    """A name with a remark below it."""
    return joined([name, tag("small", remark)] if remark else [name])


def _data(entry: Mapping[str, Any], *leave_out: str, nothing: float | None = None) -> str:
    """The text for an effect; ``nothing`` is the text for an absent load."""
    said = {key: value for key, value in entry.items() if key not in leave_out and value not in (None, nothing)}
    factors = said.pop("factors", None)
    return shown(said) + (f", times {len(factors)} factors, one per load step" if factors else "")


_PLANE_BODY = (
    "Colour: von Mises stress at the midpoints of the cells; hatched lines: the foundation. The title says what is "
    "magnified; where a magnified gap would bend the foundation it is drawn beside, with the body as it is."
)
_SOLID_BODY = (
    "Displacement magnified as stated in the title; colour: von Mises stress, shaded; dashed lines: undeformed body; "
    "gray plane or dashed frame: the foundation where it is flat, magnified with the gap."
)


def deformed(folder: ResultFiles, *, solid: bool = False) -> Markup:
    """The picture of the deformed body, and the pictures of pyvista."""
    data = folder.picture("deformed.png")
    if data is None:
        reason = "this was solved with --no-pictures" + (", or has too many facets to be drawn" if solid else "")
        return tag("p", f"No picture: {reason}.", class_="note")
    caption = _SOLID_BODY if solid else _PLANE_BODY
    whole = picture(data, "png", "deformed body on its foundation", caption)
    fields = {caption: folder.picture(f"{stem}.png") for stem, caption in FIELDS.items()}
    others = [picture(data, "png", caption, caption) for caption, data in fields.items() if data is not None]
    return joined([whole, tag("div", *others, class_="pictures")] if others else [whole])


def profiles(contact: dict[str, Any]) -> Markup:
    """Curves along the contact boundary, contact and friction beside each other."""
    from signorini_fx.report.boundary_profiles import boundary_profiles

    frictional = bool(np.any(contact["bound"] != 0) or np.any(contact["friction"] != "none"))
    sides = {"contact": "Contact pressure, normal displacement and foundation; below, what is in contact."}
    if frictional:
        sides["friction"] = "Shear, its bounds and tangential displacement; below, where friction sticks and slips."
    drawn = [
        picture(file_of(".svg", boundary_profiles, contact, sides=[side]), "svg+xml", caption, caption)
        for side, caption in sides.items()
    ]
    signs = "Normal displacement above the foundation is penetration; shear has the sign of the slip."
    return joined([tag("div", *drawn, class_="pictures"), tag("p", signs, class_="note")])


def zones(summary: dict[str, Any]) -> Markup:
    """The zones of contact, stick and slip."""
    size = max((abs(c) for runs in summary["zones"].values() for run in runs for end in run for c in end), default=0.0)
    rows = []
    for name, runs in summary["zones"].items():
        for first, last in runs:
            rows.append((name, shown(clean(first, size)), shown(clean(last, size)), math.dist(first, last)))
    if not rows:
        return tag("p", "Nothing is in contact.")
    note = "From node to node: the true ends lie up to one element further out. Stick and slip where friction can act."
    return joined([table(["zone", "from", "to", "chord"], rows), tag("p", note, class_="note")])


def steps(folder: ResultFiles, steps: dict[str, Any]) -> Markup:
    """Forces step by step, the animation, and the table of the steps."""
    from signorini_fx.report.load_steps import load_steps, step_animation

    parts = []
    body = folder.picture("deformed.gif")
    if body is not None:
        caption = "The deformed body, load step by load step; magnification and colours stay the same."
        parts.append(picture(body, "gif", caption, caption, "moving"))
    if "contact_force_x" in steps:
        caption = "Above: forces of the foundation on the body. Below: friction force over displacement."
        pictures = [picture(file_of(".svg", load_steps, steps), "svg+xml", caption, caption)]
        if "contact_force_z" not in steps and (folder.path / "contact_steps.csv").is_file():
            moving = file_of(".gif", step_animation, folder.columns("contact_steps.csv"))
            caption = "Pressure, shear and states along the contact boundary, step by step."
            pictures.append(picture(moving, "gif", caption, caption, "moving"))
        parts.append(tag("div", *pictures, class_="pictures"))
    return joined([*parts, long_table("Every load step", steps, "steps.csv")])


def price_list(rows: list[dict[str, Any]]) -> Markup:
    """Estimated errors and costs of each mesh."""
    from signorini_fx.report.convergence import errors_against_time

    names = ["h", "dofs", "linear_solves", "seconds", "memory", "energy", "pressure", "force", "zone", "peak"]
    names += ["regularisation", "iteration"]
    shorter = [[_two_digits(row[name]) for name in names] + ["predicted" if row["predicted"] else ""] for row in rows]
    caption = "Estimated relative errors against the time of each mesh; open: the next mesh, predicted."
    note = (
        "One row per mesh. Energy: displacement in the energy norm; pressure; force; zone: ends of the contact zones, "
        "in space the contact area; peak: largest pressure; the parts of the energy error due to regularisation and "
        "iteration. Memory in MB."
    )
    classes = ["predicted" if row["predicted"] else "" for row in rows]
    return joined(
        [
            table([*(name.replace("_", " ") for name in names), ""], shorter, classes),
            tag("p", note, class_="note"),
            picture(file_of(".svg", errors_against_time, rows), "svg+xml", caption, caption),
        ]
    )


def _two_digits(value: float | None) -> Any:
    """An estimate with the digits that it has."""
    return float(f"{value:.2g}") if isinstance(value, float) else value


def history(folder: ResultFiles, history: dict[str, Any], *, dimension: int = 2) -> Markup:
    """The convergence history, and its tables."""
    from signorini_fx.report.convergence import iteration_history

    parts = []
    if history:
        caption = "Sizes of the active sets and nodes that change, and residual, against the linear solves."
        drawn = file_of(".svg", iteration_history, history, dimension=dimension)
        if dimension == 3:  # slip has no sign
            history = {{"slip_plus": "slip"}.get(key, key): c for key, c in history.items() if key != "slip_minus"}
        parts = [
            picture(drawn, "svg+xml", caption, caption),
            long_table("Every linear solve", history, "history.csv"),
        ]
    outer = folder.columns("outer.csv")
    if outer:
        parts.append(long_table("Every regularised problem", outer, "outer.csv"))
    return joined(parts)


def next_steps(summary: dict[str, Any], contact: dict[str, Any]) -> list[str]:
    """What to do with this result, most urgent first.

    Args:
        summary: the content of summary.json.
        contact: columns of contact.csv; empty without contact.
    """
    advice = []
    if summary["status"] != Status.CONVERGED.value:
        advice.append(
            "The first thing to do is stated at the top. Before the next solve, signorini-fx check SCENE reports what "
            "may go wrong, and why."
        )
        if summary["status"] not in _SHORT_OF_ACCURACY:
            return advice
    prices = summary.get("price_list", [])
    if prices:
        *_, last, following = prices
        errors = {name: last[name] for name in ("energy", "pressure", "force", "zone", "peak") if last[name]}
        told = ", ".join(f"{name} {_percent(value)}" for name, value in errors.items())
        cost = f"{following['seconds']:.2g} s and {following['memory']:.0f} MB, {following['dofs']} unknowns"
        energy = f", energy error then {_percent(following['energy'])}" if following["energy"] else ""
        advice.append(f"Estimated errors of this mesh: {told}. The next one would take about {cost}{energy}.")
        if last["energy"] and last["regularisation"] > 0.2 * last["energy"]:
            advice.append(
                "The regularisation takes a notable part of the error: raise solver.gamma_n and solver.gamma_t, or "
                "take solver.algorithm = 'path-following' or 'exact'."
            )
    elif contact and "steps" not in summary:
        advice.append(
            "How accurate this is has not been estimated: solve on a finer mesh as well, and compare."
            if in_space(summary)
            else "How accurate this is has not been estimated: solve with --levels 3 (a mesh from a generator), or ask "
            "for an accuracy, as with --accuracy 0.05."
        )
    if contact:
        runs = _zone_sizes(contact)
        if runs and min(runs) < FEW_NODES:
            advice.append(
                f"A contact zone has only {min(runs)} node{'s' * (min(runs) > 1)}: refine there before its ends or "
                "its largest pressure are used."
            )
        if np.any(contact["bound"] > 0) and not np.any(contact["friction"] == "stick"):
            advice.append("Every node with friction slips: friction is at its limit.")
    if summary.get("fields"):
        advice.append(f"Look at the fields in ParaView: {', '.join(summary['fields'])}.")
    return advice


def _zone_sizes(contact: dict[str, Any]) -> list[int]:
    """The number of nodes in contact in each zone of a curve, in space on each boundary in contact."""
    closed = contact["state"] != "open"
    if "s" not in contact:
        return [int(count) for count in np.unique(contact["boundary"][closed], return_counts=True)[1]]
    # The arc length starts again with each connected piece, and so with each boundary.
    piece = np.cumsum(np.diff(contact["s"], prepend=-1.0) <= 0)
    return [len(list(run)) for (_, touching), run in groupby(zip(piece, closed, strict=True)) if touching]


def _percent(value: float) -> str:
    return f"{100 * value:.2g} %" if value > 1e-5 else "below 0.001 %"


def made_with(summary: dict[str, Any]) -> Markup:
    """Ranks, compiled forms, times and versions."""
    timings = table(["phase", "seconds"], [(name, _two_digits(value)) for name, value in summary["timings"].items()])
    versions = table(["program", "version"], list(summary["versions"].items()))
    ranks = f"{summary['ranks']} rank{'s' * (summary['ranks'] > 1)}; compiled: {', '.join(summary['compiled'])}."
    return joined([tag("p", ranks), tag("div", timings, versions, class_="pictures")])
