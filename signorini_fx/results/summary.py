"""The summary of a solve: one JSON-safe dictionary, and its rendering for a terminal."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from mpi4py import MPI

from signorini_fx import parallel
from signorini_fx.accuracy import price_list
from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.contact_table import ContactTable
from signorini_fx.body.pieces import extent
from signorini_fx.display import (
    clean,
    deformation_in_words,
    effort_in_words,
    on_several_bodies,
    point_in_words,
    preload_in_words,
    resultant_in_words,
    results_of,
    safety_in_words,
    status_in_words,
    tool_in_words,
    touch_each_other,
)
from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.records import CERTIFICATE_TOLERANCE, FEW_NODES, OuterRecord, Record, StepRecord
from signorini_fx.report.digits import between, estimated_errors, figure, percent
from signorini_fx.results.afterthoughts import proved
from signorini_fx.results.certificate import JUDGED
from signorini_fx.results.closed_boundaries import friction_in_words, one_or_three, turning_of
from signorini_fx.results.solution import Solution, StepResult
from signorini_fx.results.versions import versions
from signorini_fx.scene.model import Scene

# Of summary.schema.json: it grows when a key goes or changes its meaning, not when one is added.
SCHEMA_VERSION = 1
# Rows of a list that the terminal shows.
_MOST_ROWS = 8


def summarise(solution: Solution, table: ContactTable | None) -> dict[str, Any]:
    """All figures of a solve with what is ``proved``: arguments as for ``summary_of``."""
    summary = summary_of(solution, table)
    return summary | proved(solution, summary["findings"])


def summary_of(solution: Solution, table: ContactTable | None) -> dict[str, Any]:
    """All figures of a solve, JSON-safe; collective, the same on every rank.

    Args:
        solution: what was solved.
        table: its gathered contact boundary; None for a scene without contact.
    """
    history, linear = solution.history, solution.contact is None
    summary: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "title": solution.scene.title,
        "incomplete": list(solution.scene.incomplete),
        "status": solution.status.value,
        "advice": solution.advice,
        "converged": solution.converged,
        "algorithm": solution.algorithm,
        "parameters": {k: v if np.isfinite(v) else "infinite" for k, v in solution.parameters.items()},
        "iterations": sum(record.iteration > 0 for record in history.iterations),
        "linear_solves": sum(step.linear_solves for step in solution.steps) if linear else history.linear_solves,
        "factorisations": min(1, solution.steps[0].linear_solves)
        if linear
        else sum(record.factorised for record in history.iterations),
        "outer_iterations": len(history.outer),
        "events": history.events,
        "dimension": solution.discretisation.tagged.dimension,
        "dofs": solution.discretisation.dofs,
        "ranks": solution.comm.size,
        "linear_algebra": solution.linear_algebra,
        "strain_energy": solution.last_step.strain_energy,
        "deformation": asdict(max((step.deformation for step in solution.shown_steps), key=lambda one: one.largest)),
        "pieces": solution.discretisation.motions.pieces.as_rows(),
        "findings": [asdict(finding) for finding in solution.findings],
        "resultants": solution.resultants.as_rows(),
        **({"preloads": [one.as_dict() for one in solution.preloads]} if solution.preloads else {}),
    }
    if solution.contact is not None and table is not None:
        summary |= _contact_summary(solution, table)
    if solution.functionals is not None:
        values = solution.functionals
        summary["functionals"] = {
            "primal": values.primal,
            "dual": values.dual,
            "relative_duality_gap": values.relative_gap,
        }
    if solution.price_list:
        summary["price_list"] = [asdict(row) for row in solution.price_list]
    if solution.scene.several_steps:
        names = [effect.boundary for effect in solution.scene.contact]
        if len(names) == 1 or not any(effect.against for effect in solution.scene.contact):
            names = []
        last, shown = solution.last_step, solution.shown_steps
        summary["results_of"] = {"step": last.step, "name": last.name, "time": last.time, "status": last.status.value}
        summary["steps"] = [
            _step_summary(solution.scene, result, names, figures=result in shown) for result in solution.steps
        ]
    summary["compiled"] = solution.discretisation.inventory.forms
    summary["certificate"] = solution.certificate.as_dict()
    summary["timings"] = parallel.largest_timings(solution.comm, solution.timings.total)
    summary["versions"] = versions()
    return summary


def _step_summary(scene: Scene, result: StepResult, names: list[str], *, figures: bool) -> dict[str, Any]:
    """A row of the table of load steps; ``figures``: whether they mean anything, else they are not a number; ``names``:
    contact boundaries whose forces have no sum that acts on one body.
    """
    row: dict[str, Any] = {
        "step": result.step,
        "name": result.name,
        "time": result.time,
        "status": result.status.value,
        "linear_solves": result.linear_solves,
    }
    contact = result.contact
    if contact is not None:
        forces: list[Any] = list(contact.forces_of_each) if names else [contact.forces]
        motions = contact.mean_tangential_of_each if names else [contact.mean_tangential_displacement]
        for name, (pressing, rubbing) in zip(names or [""], forces, strict=True):
            row |= {**_by_axis("contact_force", pressing, name), **_by_axis("friction_force", rubbing, name)}
        row["max_pressure"] = parallel.largest(contact.boundary.comm, contact.pressure)
        for name, motion in zip(names or [""], motions, strict=True):
            row |= _by_axis("mean_tangential_displacement", motion, name)
        if names or len(scene.contact) == 1:
            for name, turning in zip(names or [""], turning_of(scene, contact), strict=True):
                if turning is not None:
                    row |= _by_axis("pressure_integral", turning.pressure_integral, name)
                    row |= _by_axis("friction_moment", one_or_three(turning.moment), name)
        row |= {
            "friction_work": contact.friction_work,
            **({"torque": float(contact.moments[1][1])} if contact.boundary.kinematics.out_of_section else {}),
        }
    row |= {"strain_energy": result.strain_energy, "certificate_holds": result.certificate.holds}
    return row if figures else {name: _nothing(name, value) for name, value in row.items()}


def _nothing(name: str, value: Any) -> Any:
    """Not a number, in place of a figure of a load step without a solution."""
    return float("nan") if isinstance(value, float) and name != "time" else value


def _by_axis(name: str, value: Any, boundary: str) -> dict[str, float]:
    """A number under its name, a vector with one entry for each axis; behind them the name of a boundary, if any."""
    of = f" {boundary}" if boundary else ""
    if np.ndim(value) == 0:
        return {f"{name}{of}": float(value)}
    return {f"{name}_{axis}{of}": float(component) for axis, component in zip("xyz", value, strict=False)}


def _tools(solution: Solution, contact: ContactState) -> list[dict[str, Any]]:
    """A row for each rigid tool; collective."""
    effects, kinematics = solution.scene.contact, solution.discretisation.kinematics
    return [motion.as_dict(contact, effects[motion.part], kinematics) for motion in solution.last_step.tools]


def _contact_summary(solution: Solution, table: ContactTable) -> dict[str, Any]:
    contact = solution.contact
    assert contact is not None
    columns = table.columns
    touching = columns["state"] != "open"
    # Tresca friction acts on open nodes too, which are no zone of the contact.
    acting = (columns["bound"] > 0) & touching
    contact_force, friction_force = contact.forces
    zones = {
        "contact": table.zones(touching),
        "stick": table.zones(acting & (columns["friction"] == "stick")),
        "slip": table.zones(acting & np.isin(columns["friction"], ["slip+", "slip-", "slip"])),
    }
    return {
        "contact_nodes": int(columns["x"].size),
        "touching_nodes": int(np.count_nonzero(touching)),
        "contact_force": [float(f) + 0.0 for f in contact_force],
        "friction_force": [float(f) + 0.0 for f in friction_force],
        "pressure_integral": float(np.dot(columns["weight"], columns["pressure"])),
        "max_pressure": float(columns["pressure"].max()),
        "max_shear": float(np.abs(columns["shear"]).max()),
        "contact_boundaries": [figures.as_dict() for figures in solution.contact_figures],
        **({"tools": tools} if (tools := _tools(solution, contact)) else {}),
        **({"zones": zones} if "s" in columns else {}),
        **(_in_space(contact) if contact.boundary.x.shape[1] == 3 else {}),
    }


def _in_space(contact: ContactState) -> dict[str, Any]:
    """For a contact surface: areas, moments, and where the contact force acts, which over a revolution is nowhere."""
    moments = contact.moments
    force = contact.forces[0]
    size = float(force @ force)
    through = np.cross(force, moments[0]) / size if size > 0 and contact.boundary.kinematics.uniform else None
    return {
        "areas": contact.areas,
        "contact_moment": [float(m) + 0.0 for m in moments[0]],
        "friction_moment": [float(m) + 0.0 for m in moments[1]],
        "contact_force_through": None if through is None else [float(x) + 0.0 for x in through],
    }


_HEADER = "solve  outer  iter  contact   slip+   slip-  changed   residual   seconds\n"


def table_row(record: Record) -> str:
    """One line of the iteration table, the first with its header; an outer record closes its regularised problem."""
    if isinstance(record, str):
        return f"       {record}"
    if isinstance(record, StepRecord):
        return f"--- {record} ".ljust(len(_HEADER), "-")
    if isinstance(record, OuterRecord):
        change = "" if record.change is None else f", change of the friction bound {record.change:.2e}"
        solves = f"{record.linear_solves} linear solve{'s' * (record.linear_solves != 1)}"
        return f"       {record.outer:5d}  {record.status} after {solves}{change}"
    header = _HEADER if record.solve == 1 else ""
    numbers = (
        f"{record.solve:5d}  {record.outer:5d} {record.iteration:5d} {record.active_contact:8d} {record.slip_plus:7d}"
        f" {record.slip_minus:7d} {record.changed:8d}   {record.residual:8.1e}  {record.seconds:8.3f}"
    )
    return header + numbers


def print_progress(record: Record) -> None:
    """An observer for ``solve``: prints each linear solve, each regularised problem and each event as one line.

    Rank 0 of all ranks prints. To be used as ``solve(scene, observers=[print_progress])``, in a script or a notebook.
    """
    parallel.log_on_root(MPI.COMM_WORLD, table_row(record))


def render(summary: dict[str, Any]) -> str:
    """The summary as text."""
    return "\n".join(map(str, lines_of(summary)))


def lines_of(summary: dict[str, Any]) -> list[TerminalLine]:
    """The summary for a terminal."""
    good = summary["converged"] and not summary["incomplete"]
    heading = TerminalLine(f"{summary['title'] or 'scene'}: {status_in_words(summary)}", kind="good" if good else "")
    lines = [heading, *_outcome(summary), *_warnings(summary)]
    if not summary["converged"] and summary["linear_solves"] == 0:  # follows from statics: there are no figures
        return lines
    errors = estimated_errors(summary)
    if "contact_force" in summary:
        lines += [
            _row("contact nodes", f"{summary['contact_nodes']}, {_touching(summary['touching_nodes'])}"),
            *_contact_forces(summary),
            _row("largest pressure", _digits(summary["max_pressure"], errors.get("max_pressure"))),
            *(_row(f"{name} zone", _zones(runs)) for name, runs in summary.get("zones", {}).items() if runs),
            *(_row(f"{name} area", f"{area:.6g}") for name, area in summary.get("areas", {}).items() if area),
            *_beside_contact(summary),
            *(
                _row(name.replace("_", " "), f"{_force(summary, name)}, about the origin")
                for name in ("contact_moment", "friction_moment")
                if name in summary and not on_several_bodies(summary)
            ),
            *_contact_boundaries(summary),
            *_labelled("foundation", [tool_in_words(tool) for tool in summary.get("tools", ())]),
        ]
    preloads = [preload_in_words(row) for row in summary.get("preloads", ())]
    lines += _labelled("preload", preloads) + _resultants(summary)
    lines.append(_row("strain energy", _digits(summary["strain_energy"], errors.get("strain_energy"))))
    if "stress" in summary:
        lines.append(_row("von Mises stress", _largest(summary)))
    lines.append(_row("deformation", deformation_in_words(summary["deformation"])))
    certificate = summary["certificate"]
    lines.append(_row("certificate", _certificate(certificate), "" if certificate["holds"] else "error"))
    if "contact_force" in summary:
        lines.append(_row("left by gamma", _remaining_misfit(certificate)))
    for name in ("error_bound", "uniqueness"):
        if name in summary:
            lines.append(_row(name.replace("_", " "), summary[name]["statement"]))
    if "functionals" in summary:
        lines.append(_row("duality gap", f"{summary['functionals']['relative_duality_gap']:.1e}"))
    lines.append(_row("seconds", ", ".join(f"{name} {value:.2f}" for name, value in summary["timings"].items())))
    if "price_list" in summary:
        lines.append(TerminalLine(price_list.render([price_list.Price(**row) for row in summary["price_list"]])))
    return lines


def _row(label: str, text: str, kind: str = "") -> TerminalLine:
    """A figure with its label."""
    return TerminalLine(f"  {label:16s} ", text, kind)


def _outcome(summary: dict[str, Any]) -> list[TerminalLine]:
    """How the solve ended, what to do about it, and how it went."""
    lines = []
    if "results_of" in summary:
        lines.append(_row("results of", results_of(summary)))
    if not summary["converged"]:
        lines.append(_row("what to do", summary["advice"], "advice"))
    if "safety" in summary:
        lines.append(_row("safety factor", safety_in_words(summary["safety"])))
    return [
        *lines,
        _row("algorithm", f"{summary['algorithm']}, {effort_in_words(summary)}"),
        *_events(summary["events"]),
        _row("unknowns", f"{summary['dofs']} on {summary['ranks']} rank{'s' * (summary['ranks'] > 1)}"),
        _row("linear algebra", summary["linear_algebra"]),
    ]


def _events(events: list[str]) -> list[TerminalLine]:
    """The events of the history by kind."""
    shown = dict.fromkeys(event for event in events if not event.startswith("level "))
    beginnings = {"increments": "load step ", **{name: f"{name}: " for name in ("accuracy", "elements", "restart")}}
    fall_backs = [event for event in shown if not event.startswith(tuple(beginnings.values()))]
    kinds = {"fall-backs": fall_backs} | {
        name: [event.removeprefix(f"{name}: ") for event in shown if event.startswith(begin)]
        for name, begin in beginnings.items()
    }
    if halved := len(kinds["increments"]):
        kinds["increments"] = [f"halved {halved} time{'s' * (halved > 1)}, where a load step had no solution"]
    return [_row(name, "; ".join(kind)) for name, kind in kinds.items() if kind]


def _beside_contact(summary: dict[str, Any]) -> list[TerminalLine]:
    """Why a body may stick or slip where it does not touch."""
    laws = {effect["friction"]["law"] for effect in summary.get("scene", {}).get("contact", ())}
    if "tresca" not in laws or summary["touching_nodes"] == summary["contact_nodes"]:
        return []
    return [_row("note", "Tresca friction also acts where there is no contact")]


def _force(summary: dict[str, Any], name: str) -> str:
    """A resultant force or moment; components that are round-off of those at work count as zero."""
    kind = name.partition("_")[2]
    size = float(np.abs([summary[f"contact_{kind}"], summary[f"friction_{kind}"]]).max())
    return "(" + ", ".join(f"{f:.6g}" for f in clean(summary[name], size)) + ")"


def _contact_forces(summary: dict[str, Any]) -> list[TerminalLine]:
    """Contact and friction force; between bodies those of each boundary on its body, as their sum acts on none."""
    names = ("contact_force", "friction_force")
    if not touch_each_other(summary):
        return [_row(name.replace("_", " "), _force(summary, name)) for name in names]
    rows = summary["contact_boundaries"][:_MOST_ROWS]
    size = float(np.abs([row[name] for row in rows for name in names]).max())
    return [
        line
        for name in names
        for line in _labelled(
            name.replace("_", " "),
            [f"({', '.join(f'{f:.6g}' for f in clean(row[name], size))}) on {row['boundary']}" for row in rows],
        )
    ]


def _resultants(summary: dict[str, Any]) -> list[TerminalLine]:
    """What acts through the other boundaries, and where; contact too if it has several."""
    several = len(summary.get("contact_boundaries", ())) > 1
    rows = [row for row in summary["resultants"] if row["acts"] != ["contact"] or several]
    lines = [resultant_in_words(row, summary.get("scene") or {}) for row in rows[:_MOST_ROWS]]
    if len(rows) > _MOST_ROWS:
        lines.append(f"and {len(rows) - _MOST_ROWS} more in summary.json")
    return _labelled("forces", lines)


def _contact_boundaries(summary: dict[str, Any]) -> list[TerminalLine]:
    """Area, mean pressure and friction of each contact boundary."""
    rows = summary["contact_boundaries"]
    areas, friction = [], []
    for row in rows[:_MOST_ROWS]:
        mean = "" if row["mean_pressure"] is None else f", mean pressure there {row['mean_pressure']:.6g}"
        areas.append(f"{row['boundary']}: {row['contact_area']:.6g} of {row['area']:.6g}{mean}")
        if row["friction_limit"] > 0:
            friction.append(f"{row['boundary']}: {friction_in_words(row)}")
    return [*_labelled("in contact", areas), *_labelled("friction", friction)]


def _labelled(label: str, texts: list[str]) -> list[TerminalLine]:
    """Lines of the table of which only the first has its label."""
    return [_row(label if k == 0 else "", text) for k, text in enumerate(texts)]


def _largest(summary: dict[str, Any]) -> str:
    """The largest von Mises stress, raw and recovered, with the digits that both have; or why it has no limit."""
    stress = summary["stress"]
    raw, recovered, apart = stress["von_mises"], stress["recovered"], between(stress)
    region = f" in {raw['region']}" if raw.get("region") else ""
    text = f"{_digits(raw['value'], apart)} at most, at {point_in_words(raw['place'])}{region}"
    if recovered is not None and apart is not None:
        text += f"; recovered {_digits(recovered['von_mises']['value'], apart)}"
    if (why := raw.get("no_limit")) is not None:
        text += f"; it has no limit as the mesh is refined: {why}"
    return text if stress["error"] is None else f"{text}; estimated error in the mean {percent(stress['error'])}"


def _digits(value: float, error: float | None) -> str:
    """A figure rounded to its estimated error; one without an estimate with six digits."""
    return f"{value:.6g}" if error is None else figure(value, error)


def _touching(nodes: int) -> str:
    few = ": too few for the ends of the zone or the largest pressure, refine there" if 0 < nodes < FEW_NODES else ""
    return f"{nodes or 'none'} in contact{few}"


def _warnings(summary: dict[str, Any]) -> list[TerminalLine]:
    """The warnings, and the pieces of a body that is not connected."""
    pieces = summary["pieces"]
    lines = [_row("pieces", f"{len(pieces)}: {_listed(pieces)}")] if len(pieces) > 1 else []
    for finding in summary["findings"]:
        if finding["level"] == "warning" and finding["message"] != summary["advice"]:
            lines.append(_row("warning", f"{finding['path']}: {finding['message']}", "warning"))
    return lines


def _listed(pieces: list[dict[str, Any]], limit: int = 4) -> str:
    """Where the first few pieces are."""

    def one(row: dict[str, Any]) -> str:
        name = "" if row["body"] is None else f"{row['body']}, "
        return f"{name}{row['cells']} cells, {extent(row['bounds'])}"

    return "; ".join([one(row) for row in pieces[:limit]] + ["..."] * (len(pieces) > limit))


def _certificate(figures: dict[str, Any]) -> str:
    """The verdict, with the figure that decides it."""
    judged = sorted(((figures[name], name.replace("_", " ")) for name in JUDGED), reverse=True)
    if figures["holds"]:
        value, name = judged[0]
        allowed = f"{CERTIFICATE_TOLERANCE:.0e} is allowed"
        return f"holds for {figures['law']}: no figure above {value:.1e} ({name}), {allowed}"
    wrong = [f"{name} {value:.1e}" for value, name in judged if not value <= CERTIFICATE_TOLERANCE]
    return f"DOES NOT HOLD for {figures['law']}: {', '.join(wrong)}"


def _remaining_misfit(figures: dict[str, Any]) -> str:
    return (
        f"penetration {figures['penetration']:.1e}, elastic slip {figures['stick_slip']:.1e} "
        "times the largest displacement"
    )


def _zones(runs: list[list[list[float]]]) -> str:
    return ", ".join(f"{point_in_words(a)} to {point_in_words(b)}" for a, b in runs)
