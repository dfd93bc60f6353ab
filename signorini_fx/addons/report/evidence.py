"""The sections on how a result was found and why it may be trusted: certificate, prices, iteration, scene, versions."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from signorini_fx.addons.report.markup import (
    drawn_by,
    folded,
    in_text,
    is_number,
    joined,
    long_table,
    shown,
    table,
)
from signorini_fx.addons.report.templating import Markup, part
from signorini_fx.machine.result_files import ResultFiles
from signorini_fx.mechanics.statement.units import unit
from signorini_fx.quantities.validity import was_solved
from signorini_fx.tuned import CERTIFICATE_TOLERANCE

_MOST_FACTORS = 8  # are listed in the table of the scene

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
    "coupling": (CERTIFICATE_TOLERANCE, "largest error of the map that joins two bodies"),
    "moduli": (CERTIFICATE_TOLERANCE, "by how much a material leaves the bounds of its moduli"),
    "displacement": (None, "largest displacement over the size of the body"),
    "penetration": (None, "deepest penetration; the regularised law allows pressure / gamma_n"),
    "complementarity": (None, "largest product of pressure and distance"),
    "stick_slip": (None, "largest slip where the body sticks; the regularised law allows shear / gamma_t"),
}


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
        digits = _two_digits(value) if math.isfinite(value) else "not finite"
        rows.append((_named(name.replace("_", " "), meaning), digits, verdict, judged))
        classes.append("missed" if missed else "")
    law = f" The law is {summary['certificate']['law']}." if "law" in summary["certificate"] else ""
    figures = {name: value for name, value in summary["certificate"].items() if is_number(value) and value is not None}
    worst = max((name for name in figures if JUDGED.get(name, (None,))[0] is not None), key=figures.__getitem__)
    note = (
        "The conditions of the problem, checked after the iteration from the displacement and the contact tractions "
        f"alone; every figure is relative: to the largest stress, deformation or force.{law}"
    )
    missed = "missed" in classes
    verdict = "The certificate does NOT hold."
    if not missed:
        largest = f"{figures[worst]:.1e} ({worst.replace('_', ' ')})"
        verdict = f"The certificate holds: no figure is above {largest}, the limit is {CERTIFICATE_TOLERANCE:g}."
    full_table = table(["figure", "value", "", "limit"], rows, classes)
    parts = [part("paragraph", in_text(verdict)), part("note", in_text(note))]
    parts.append(full_table if missed else folded("Every figure of the certificate", full_table))
    if "functionals" in summary:
        gap = summary["functionals"]["relative_duality_gap"]
        difference = f"{gap:.1e}" if gap else "zero"
        parts.append(
            part("paragraph", in_text(f"The relative difference of primal and dual functional is {difference}."))
        )
    error = summary.get("error_bound") or {}
    bound = "Guaranteed error" if error.get("guaranteed") else "Bound of the error"
    if error:
        statement = f"{bound}: {error['statement']}."
        if "energy between" in statement and unit("energy"):
            statement += f" Energies are in {unit('energy')}."
        parts.append(part("paragraph", in_text(statement)))
    return joined(parts)


# What a scene holds besides effects that have a row each.
_TOLD_APART = (
    *(
        "title",
        "incomplete",
        "forms",
        "mesh",
        "body",
        "element",
        "contact",
        "load_steps",
        "solver",
        "accuracy",
        "units",
        "title_block",
    ),
)


def scene(summary: dict[str, Any]) -> Markup:
    """The effects of the scene, the method, and the scene as JSON."""
    scene = summary["scene"]
    rows: list[tuple[str, str]] = [("forms", ", ".join(scene["forms"]))] if "forms" in scene else []
    bodies = scene.get("body") or ()
    for body in bodies:
        generator, data = _mesh(body["mesh"])
        moved = _data(body, "name", "mesh")
        rows.append((_named("body", body["name"]), "; ".join(filter(None, (f"{generator} {data}".strip(), moved)))))
    if not bodies:
        generator, data = _mesh(scene["mesh"])
        rows.append((_named("mesh", generator), data))
    rows.append(("element", shown(scene["element"])))
    for kind, section in scene.items():
        nothing = None if kind in ("material", "displacement") else 0.0
        name_key = "region" if kind == "material" else "boundary"
        for entry in (
            [] if kind in _TOLD_APART else section if isinstance(section, list) else [section] if section else []
        ):
            name = _named(kind.replace("_", " "), entry.get(name_key) or "")
            rows.append((name, _data(entry, name_key, nothing=nothing)))
    for entry in scene["contact"]:
        friction = entry.get("friction") or {"law": "none"}
        without_friction = {key: value for key, value in entry.items() if key != "friction"}
        rows.append(
            (_named(f"{entry['kind']} contact", entry["boundary"]), _data(without_friction, "boundary", "kind"))
        )
        rows.append((_named(f"friction: {friction['law']}", entry["boundary"]), _data(friction, "law")))
    steps = {key: value for key, value in (scene.get("load_steps") or {}).items() if value}
    if steps:
        rows.append(("load steps", shown(steps)))
    method = {"algorithm": summary["algorithm"], **summary["parameters"], "linear algebra": summary["linear_algebra"]}
    full_scene = part("source", json.dumps(scene, indent=1))
    return joined(
        [
            table(["effect", "data"], rows),
            part("paragraph", in_text(f"Method: {shown(method)}.")),
            folded("The whole scene with all defaults", full_scene),
        ]
    )


def _mesh(mesh: Any) -> tuple[str, str]:
    """The generator of a mesh, "" for another one, and the data of the mesh."""
    if isinstance(mesh, dict) and "generator" in mesh:
        return mesh["generator"], shown(mesh["parameters"]) + ", then divided" * bool(mesh.get("refined"))
    entries = {key: value for key, value in mesh.items() if value} if isinstance(mesh, dict) else {}
    return "", shown(entries) or "made in Python"


def _named(name: str, remark: str) -> Markup:
    """A name with a remark below it."""
    return part("named", name, remark)


def _data(entry: Mapping[str, Any], *leave_out: str, nothing: float | None = None) -> str:
    """The text for an effect; ``nothing`` is the text for an absent load."""
    entries = {key: value for key, value in entry.items() if key not in leave_out and value not in (None, nothing)}
    factors = entries.pop("factors", None)
    if not factors:
        return shown(entries)
    listed = ", ".join(map(shown, factors)) if len(factors) <= _MOST_FACTORS else f"{len(factors)} of them"
    return f"{shown(entries)}, times the factors {listed}"


def convergence_table(rows: list[dict[str, Any]]) -> Markup:
    """Estimated errors and costs of each mesh."""
    names = ["h", "dofs", "linear_solves", "seconds", "memory", "energy", "pressure", "force", "zone", "peak"]
    names += ["regularisation", "iteration"]
    shorter = [[_two_digits(row[name]) for name in names] + ["predicted" if row["predicted"] else ""] for row in rows]
    note = (
        "One row per mesh. Energy: displacement in the energy norm; pressure; force; zone: ends of the contact zones, "
        "in 3D the contact area; peak: largest pressure, without an estimate where it has no limit "
        "or the meshes are no finer where it is; the parts of the energy error due to regularisation and "
        "iteration. Memory in MB."
    )
    classes = ["predicted" if row["predicted"] else "" for row in rows]
    return joined([table([*(name.replace("_", " ") for name in names), ""], shorter, classes), part("note", note)])


def cost(summary: dict[str, Any]) -> Markup:
    """The picture of errors against what they took, which belongs to the answer how sure a result is."""
    from signorini_fx.addons.pictures.convergence import errors_and_costs

    if "convergence_table" not in summary:
        return Markup("")
    caption = "Estimated relative errors against unknowns and time; open: the next mesh, predicted."
    return drawn_by(errors_and_costs, summary["convergence_table"], caption=caption)


def _two_digits(value: float | None) -> Any:
    """An estimate with the digits that it has."""
    return float(f"{value:.2g}") if isinstance(value, float) else value


def history(summary: dict[str, Any], folder: ResultFiles, history: dict[str, Any], *, dimension: int = 2) -> Markup:
    """How many linear solves it took; the convergence history and its tables on demand."""
    from signorini_fx.addons.pictures.convergence import iteration_history

    solves, factorised = summary["linear_solves"], summary.get("factorisations")
    text = f"{summary['algorithm']}: {solves} linear solve{'s' * (solves != 1)}"
    if factorised is not None:
        text += f" with {factorised} factorisation{'s' * (factorised != 1)}"
    parts = [part("paragraph", f"{text}.")]
    if history:
        caption = "Sizes of the active sets and nodes that change, and residual, against the linear solves."
        drawn = drawn_by(iteration_history, history, caption=caption, dimension=dimension)
        if dimension == 3:  # slip has no sign
            history = {{"slip_plus": "slip"}.get(key, key): c for key, c in history.items() if key != "slip_minus"}
        parts += [folded("Convergence history", drawn), long_table("Every linear solve", history, "history.csv")]
    events = list(dict.fromkeys(summary.get("events", ())))
    if events:
        parts.append(folded("What happened", part("items", list(map(in_text, events)))))
    outer = folder.columns("outer.csv")
    if outer:
        parts.append(long_table("Every regularised problem", outer, "outer.csv"))
    return joined(parts)


def made_with(summary: dict[str, Any], size: str) -> Markup:
    """When and with what: date, versions, ranks, compiled forms and times; ``size``: of the problem, in words."""
    versions = summary["versions"]
    done = "Solved" if was_solved(summary) else "Tried"
    when = (
        f"{done} on {summary['finished'].replace('T', ' ').replace('+00:00', ' UTC')}"
        if "finished" in summary
        else done
    )
    ranks = f"{summary['ranks']} rank{'s' * (summary['ranks'] > 1)}"
    programs = " and ".join(f"{name} {versions[name]}" for name in ("signorini_fx", "dolfinx") if versions.get(name))
    timings = table(["phase", "seconds"], [(name, _two_digits(value)) for name, value in summary["timings"].items()])
    tables = part("beside", [timings, table(["program", "version"], list(versions.items()))])
    compiled = part("paragraph", f"Compiled: {', '.join(summary['compiled'])}.")
    took = f"{when} by {programs} on {ranks}: {size}."
    return joined([part("paragraph", took), folded("Times and versions", compiled, tables)])
