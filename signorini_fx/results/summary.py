"""The summary of a solve: one JSON-safe dictionary, and its rendering for a terminal."""

from __future__ import annotations

import platform
import time
import traceback
from collections.abc import Callable
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from mpi4py import MPI
from pydantic import TypeAdapter

import signorini_fx
from signorini_fx.machine import parallel
from signorini_fx.machine.terminal import TerminalLine, say_once
from signorini_fx.mechanics.assembly.pieces import extent
from signorini_fx.quantities.shown import (
    Summary,
    all_shown,
    effect_lines,
    heading,
    outcome_lines,
    row,
    shown_lines,
    warning_lines,
)
from signorini_fx.quantities.summary import SCHEMA_VERSION, Price, Quantity, own_quantities
from signorini_fx.quantities.values import NO_BOUND, afterwards, of_results, of_step
from signorini_fx.records import Finding, IterationRecord, Record, StepRecord
from signorini_fx.results.solution import Solution
from signorini_fx.tuned import ERROR_PATIENCE


def summary_of(solution: Solution) -> dict[str, Any]:
    """Return all figures of a solve that need no further computation, JSON-safe; collective, the
    same on every rank.
    """
    history = solution.history
    summary: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "title": solution.model.title,
        "incomplete": list(solution.statement.incomplete),
        "status": solution.status.value,
        "advice": solution.advice,
        "converged": solution.converged,
        "algorithm": solution.algorithm,
        "parameters": {
            k: v if np.isfinite(v) else "infinite" for k, v in solution.parameters.items()
        },
        "iterations": sum(record.iteration > 0 for record in history.iterations),
        "linear_solves": history.linear_solves,
        "factorisations": sum(record.factorised for record in history.iterations),
        "outer_iterations": len(history.outer),
        "events": history.events,
        "dimension": solution.model.tagged.dimension,
        "dofs": solution.model.dofs,
        "ranks": solution.comm.size,
        "linear_algebra": solution.linear_algebra,
        "pieces": solution.model.motions.pieces.as_rows(),
        "findings": [finding.as_row() for finding in solution.findings],
    }
    summary |= of_results(solution)
    if solution.convergence_table:
        summary["convergence_table"] = [row.model_dump() for row in solution.convergence_table]
    if solution.model.path.several:
        last = solution.last_step
        shown = solution.shown_steps
        summary["results_of"] = {
            "step": last.step,
            "name": last.name,
            "time": last.time,
            "status": last.status.value,
        }
        summary["steps"] = [
            _step_summary(solution.at(result), summary["findings"], figures=result in shown)
            for result in solution.steps
        ]
    summary["timings"] = parallel.largest_timings(solution.comm, solution.timings.seconds)
    summary["versions"] = versions()
    return summary


def _step_summary(
    solution: Solution, findings: list[dict[str, Any]], *, figures: bool
) -> dict[str, Any]:
    """Return a row of the table of load steps; figures without a meaning are nan.

    Args:
        solution: the solution with the results of the load step.
        findings: rows of findings, to which new ones are added.
        figures: whether the step has figures with a meaning.
    """
    result = solution.last_step
    row = {
        "step": result.step,
        "name": result.name,
        "time": result.time,
        "status": result.status.value,
        "linear_solves": result.linear_solves,
    }
    columns = {**of_step(solution), **result.figures}
    rows = list[dict[str, Any]]()
    for quantity in own_quantities():
        value = post_processing(
            solution.comm, quantity.key, rows, partial(_own_value, quantity, solution)
        )
        if isinstance(value, float):
            columns[quantity.key] = value
    findings += [told for told in rows if told not in findings]  # once for all load steps
    for name, value in columns.items():
        row[name] = value if figures or not isinstance(value, float) else float("nan")
    return row


_HEADER = "solve  outer  iter  contact   slip+   slip-  changed   residual   seconds\n"


def table_row(record: Record) -> str:
    """Return one line of the iteration table; the first line has the header above it.

    An outer record ends its regularised problem.
    """
    if isinstance(record, StepRecord):
        return f"--- {record} ".ljust(len(_HEADER), "-")
    if isinstance(record, IterationRecord):
        return f"{_HEADER * (record.solve == 1)}{record}"
    return f"       {record}"


def print_progress(record: Record) -> None:
    """Print each linear solve, each regularised problem and each event as one line; an observer for
    ``solve``.

    Rank 0 of all ranks prints. To be used as ``solve(scene, observers=[print_progress])``, in a
    script or a notebook.

    Examples:
        >>> records = []
        >>> result = sfx.solve(scene, observers=[records.append])  # or [sfx.print_progress]
        >>> print(len(result.history.iterations), len(records))
        1 2
    """
    say_once(MPI.COMM_WORLD, table_row(record))


def lines_of(summary: Summary, folder: Path) -> list[TerminalLine]:
    """Return the whole summary and the folder of the results as lines for a terminal."""
    return [*_figures(summary), row("results", f"{folder}/")]


def _figures(summary: Summary) -> list[TerminalLine]:
    from signorini_fx.results.accuracy import convergence_table

    method = [row("algorithm", summary["algorithm"]), *_events(summary["events"])]
    method.append(row("linear algebra", summary["linear_algebra"]))
    lines = [
        heading(summary),
        *outcome_lines(summary),
        *method,
        *_pieces(summary["pieces"]),
        *warning_lines(summary),
        *effect_lines(summary),
    ]
    if (
        not summary["converged"] and summary["linear_solves"] == 0
    ):  # follows from statics: there are no figures
        return lines
    lines += [line for shown in all_shown() for line in shown_lines(shown, summary)]
    lines.append(
        row(
            "seconds",
            ", ".join(f"{name} {value:.2f}" for name, value in summary["timings"].items()),
        )
    )
    if "convergence_table" in summary:
        prices = [Price(**price) for price in summary["convergence_table"]]
        lines.append(TerminalLine(convergence_table.render(prices)))
    return lines


def _events(events: list[str]) -> list[TerminalLine]:
    """Return one line for each kind of event of the history."""
    shown = dict.fromkeys(event for event in events if not event.startswith("level "))
    beginnings = {
        "increments": "load step ",
        **{name: f"{name}: " for name in ("accuracy", "elements", "restart", "sets")},
    }
    fall_backs = [event for event in shown if not event.startswith(tuple(beginnings.values()))]
    kinds = {"fall-backs": fall_backs} | {
        name: [event.removeprefix(f"{name}: ") for event in shown if event.startswith(begin)]
        for name, begin in beginnings.items()
    }
    if halved := len(kinds["increments"]):
        kinds["increments"] = [
            f"halved {halved} time{'s' * (halved > 1)}, where a load step had no solution"
        ]
    return [row(name, "; ".join(kind)) for name, kind in kinds.items() if kind]


def _pieces(pieces: list[dict[str, Any]], limit: int = 4) -> list[TerminalLine]:
    """Return the bounding boxes of the first few pieces of a body that is not connected."""
    shown = []
    for piece in pieces[:limit]:
        name = "" if piece["body"] is None else f"{piece['body']}, "
        shown.append(f"{name}{piece['cells']} cells, {extent(piece['bounds'])}")
    listed = "; ".join(shown + ["..."] * (len(pieces) > limit))
    return [row("pieces", f"{len(pieces)}: {listed}")] if len(pieces) > 1 else []


_PACKAGES = ("fenics-basix", "fenics-ufl", "fenics-ffcx", "petsc4py", "mpi4py", "numpy", "pydantic")


def versions() -> dict[str, str]:
    """Return the versions of all libraries, and the BLAS in use."""
    import dolfinx
    from petsc4py import PETSc

    by_package = {"signorini_fx": signorini_fx.__version__, "python": platform.python_version()}
    by_package["dolfinx"] = dolfinx.__version__
    by_package["petsc"] = ".".join(map(str, PETSc.Sys.getVersion()))
    by_package["mpi"] = MPI.Get_library_version().split(",")[0].split("\n")[0].strip("\x00 ")
    for package in _PACKAGES:
        try:
            by_package[package.removeprefix("fenics-")] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    by_package["blas"] = blas_in_use()
    return by_package


def blas_in_use() -> str:
    """Return the file name of the BLAS library that this process has loaded, because a reference
    BLAS is several times slower.
    """
    try:
        maps = Path("/proc/self/maps").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return "unknown"
    files = map(Path, sorted({line.split()[-1] for line in maps if "/" in line and ".so" in line}))
    libraries = ("libblas", "openblas", "blis", "mkl_rt")
    blas_files = [file for file in files if any(word in file.name for word in libraries)]
    names = [
        f"{file.parent.name}/{file.name}" if file.name.startswith("libblas") else file.name
        for file in blas_files
    ]
    return ", ".join(dict.fromkeys(names)) or "unknown"


T = TypeVar("T")


def post_processing(
    comm: MPI.Comm, subject: str, findings: list[dict[str, Any]], state: Callable[[], T]
) -> T | None:
    """Return the result of ``state``, or None if it fails on any rank; then a warning is added to
    the findings.  Collective.

    If the other ranks do not return, because they wait for this one in a collective call, the error
    is raised.

    Args:
        comm: the ranks.
        subject: a key of the summary.
        findings: rows of findings.
        state: what to compute.
    """
    apart = comm.Dup()  # the others may be in a collective call of ``comm``
    result: T | None = None
    error: Exception | None = None
    try:
        result = state()
    except Exception as raised:
        error = raised
    everybody = apart.Ibarrier()
    end = time.monotonic() + ERROR_PATIENCE
    while error is not None and not everybody.Test():
        if time.monotonic() > end:
            error.add_note(f"The results are written, without this: {subject}.")
            raise error
        time.sleep(0.01)
    everybody.Wait()  # without an error for as long as it takes
    reasons = apart.allgather(None if error is None else failure_in_words(error))
    apart.Free()
    reason = next((known_reason for known_reason in reasons if known_reason is not None), None)
    if reason is None:
        return result
    message = f"could not be computed ({reason}); other results are not affected"
    findings.append(Finding("warning", subject, message).as_row())
    return None


def failure_in_words(error: Exception) -> str:
    """Return the type, the function and the last line of an unexpected error."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    told = str(error).strip().splitlines()
    return f"{type(error).__name__} in {last.name}{f': {told[-1]}' if told else ''}"


def asked(solution: Solution) -> dict[str, Callable[[Solution], Any]]:
    """Return a function for each key of the summary that ``proved`` may add."""
    own = {quantity.key: partial(_own_value, quantity) for quantity in own_quantities()}
    return {**afterwards(solution), **own}


def proved(solution: Solution, findings: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the entries of the summary that are computed after the results are written, if the
    scene requests them.  Collective.
    """
    entries: dict[str, Any] = {}
    for key, value_of in asked(solution).items():
        value = post_processing(solution.comm, key, findings, partial(value_of, solution))
        if value is not None:
            entries[key] = value
    statement = entries.get("error_bound", {}).get("statement", "")
    if statement.startswith(NO_BOUND):
        message = f"there is no guaranteed bound: {statement.removeprefix(NO_BOUND)}"
        findings.append(Finding("warning", "error_bound", message).as_row())
    return entries


def _own_value(quantity: Quantity, solution: Solution) -> float | list[float] | None:
    """Return the value of a user-defined quantity, checked to be valid JSON."""
    adapter: TypeAdapter[float | list[float] | None] = TypeAdapter(float | list[float] | None)
    return adapter.validate_python(quantity.value(solution), strict=True)
