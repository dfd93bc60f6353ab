"""The sections on how a result was found and why it may be trusted: certificate, prices, iteration, scene, versions."""

from __future__ import annotations

import json
import math
from typing import Any

from signorini_fx.addons.report.markup import Markup, folded, in_text, is_number, joined, part, shown, table
from signorini_fx.mechanics.statement.units import unit
from signorini_fx.quantities.summary import CertificateFigures
from signorini_fx.quantities.text import was_solved
from signorini_fx.records import JUDGED
from signorini_fx.tuned import CERTIFICATE_TOLERANCE


def certificate(summary: dict[str, Any]) -> Markup:
    """Every figure of the certificate beside its limit."""
    rows, classes = [], []
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
    figures = {name: value for name, value in summary["certificate"].items() if is_number(value) and value is not None}
    worst = max((name for name in figures if name in JUDGED), key=figures.__getitem__)
    note = (
        "The conditions of the problem, checked after the iteration from the displacement and the contact tractions "
        f"alone; every figure is relative: to the largest stress, deformation or force.{law}"
    )
    missed = "missed" in classes
    verdict = "The certificate does NOT hold."
    if not missed:
        largest = f"{figures[worst]:.1e} ({worst.replace('_', ' ')})" if figures[worst] else "round-off"
        verdict = f"The certificate holds: no figure is above {largest}, the limit is {CERTIFICATE_TOLERANCE:g}."
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


# What the page says elsewhere.
_ELSEWHERE = {"title", "title_block", "incomplete", "units", "solver", "accuracy"}


def scene(summary: dict[str, Any]) -> Markup:
    """The tables of the scene, the method, and the scene as JSON."""
    scene, rows = summary["scene"], list[tuple[str, str]]()
    for key, section in scene.items():
        entries = section if section and isinstance(section, list) and isinstance(section[0], dict) else [section]
        texts = [] if key in _ELSEWHERE else [shown(entry) for entry in entries]
        if key == "mesh" and isinstance(section, str):  # the name of a type
            texts = ["made in Python"]
        rows += [(key.replace("_", " "), text) for text in texts if text and text != "()"]
    method = {"algorithm": summary["algorithm"], **summary["parameters"], "linear algebra": summary["linear_algebra"]}
    return joined(
        [
            table(["effect", "data"], rows),
            part("paragraph", in_text(f"Method: {shown(method)}.")),
            folded("The whole scene with all defaults", part("source", json.dumps(scene, indent=1))),
        ]
    )


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


def _two_digits(value: float | None) -> Any:
    """An estimate with the digits that it has."""
    return float(f"{value:.2g}") if isinstance(value, float) else value


def history(summary: dict[str, Any]) -> Markup:
    """How many linear solves it took, and what happened on demand."""
    solves, factorised = summary["linear_solves"], summary.get("factorisations")
    text = f"{summary['algorithm']}: {solves} linear solve{'s' * (solves != 1)}"
    if factorised is not None:
        text += f" with {factorised} factorisation{'s' * (factorised != 1)}"
    parts = [part("paragraph", f"{text}; history.csv has a row for each.")]
    if events := list(dict.fromkeys(summary.get("events", ()))):
        parts.append(folded("What happened", part("items", list(map(in_text, events)))))
    return joined(parts)


def made_with(summary: dict[str, Any]) -> Markup:
    """When and with what: date, versions, ranks and times."""
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
    took = f"{when} by {programs} on {ranks}: {summary['dofs']} unknowns."
    return joined([part("paragraph", took), folded("Times and versions", tables)])
