"""Accuracy against cost for every method: one list of methods, one reference, the same measure for all.

Errors are measured independently of the methods, against a solution of much higher accuracy (see ``reference``), whose
own error is estimated from coarser ones.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpi4py import MPI

from signorini_fx.addons.studies.methods import Method, methods
from signorini_fx.addons.studies.reference import Reference, reference_solution, studied_settings
from signorini_fx.errors import SceneError, SignoriniError
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.results.accuracy.price_list import peak_memory
from signorini_fx.results.solution import Solution
from signorini_fx.solving.varied_problem import VariedProblem
from signorini_fx.tuned import (
    LONG_RUN,
    MIDDLE_RUN,
    QUICK_STUDY_REFERENCE,
    QUICKLY_STUDIED_CELLS,
    QUICKLY_STUDIED_TARGETS,
    STUDIED_CELLS,
    STUDIED_TARGETS,
    STUDY_REFERENCE,
    TOO_LONG_RUN,
)

Row = dict[str, Any]
QUANTITIES = {
    "energy": "displacement, energy norm",
    "pressure": "contact pressure, $L^2(\\Gamma_c)$",
    "peak": "largest contact pressure",
    "zone": "ends of the contact zone",
    "force": "contact and friction force",
}
PHASES = ("mesh", "compile", "assemble", "condense", "iterate", "certify")


@dataclass(frozen=True)
class Study:
    """The results of a study.

    Attributes:
        title: of the problem.
        rows: one for each method on each mesh, failures included; the columns of work_precision.csv.
        floor: the estimated error of the reference itself for each quantity; None: it cannot be estimated.
        reference: description of the reference.
        seconds: wall time of the whole study.
    """

    title: str
    rows: list[Row]
    floor: dict[str, float | None]
    reference: str
    seconds: float


def run_study(
    problem: VariedProblem, *, quick: bool = False, repeats: int = 7, report: Callable[[str], None] = lambda _: None
) -> Study:
    """Run every method on every mesh; on one rank.

    Args:
        problem: with contact and one load step.
        quick: few methods, two coarse meshes, no repeats.
        repeats: rounds that are counted, long runs are part of three; medians are taken.  In a round before them
            forms may still be compiled.
        report: called with the progress as text.

    Raises:
        SceneError: the problem is not of that kind.
        ConvergenceError: there is no reference.
    """
    statement = problem.statement
    if not statement.contact or statement.several_steps:
        raise SceneError([("contact", "a study needs a scene with contact and one load step")])
    begin = time.perf_counter()
    factors = QUICKLY_STUDIED_CELLS if quick else STUDIED_CELLS
    reference, floor = reference_solution(problem, *(QUICK_STUDY_REFERENCE if quick else STUDY_REFERENCE))
    about = f"{reference.about}, {reference.solution.model.dofs} unknowns"
    report(f"reference: {about}; {time.perf_counter() - begin:.1f} s")
    natural = reference.solution.model.scales.gamma
    runs = []
    for method in methods(statement, quick=quick):
        if method.adaptive:
            targets = QUICKLY_STUDIED_TARGETS if quick else STUDIED_TARGETS[method.element]
            runs += [_Run(method, 1.0, problem, natural, asked=target) for target in targets]
            continue
        # Quadratic elements on twice as large cells have as many unknowns.
        mesh_factors = factors[:-1] if method.degree == 2 else factors[1:]
        runs += [_Run(method, factor, problem, natural) for factor in (mesh_factors if not quick else factors)]
    for repeat in range(1 if quick else repeats + 1):
        for run in runs:
            run.solve_once(reference if repeat == 0 else None, counted=repeat > 0 or quick)
        report(f"round {repeat} of {0 if quick else repeats}: {time.perf_counter() - begin:.1f} s")
    return Study(statement.title, [run.row() for run in runs], floor, about, time.perf_counter() - begin)


class _Run:
    """A method on a mesh, or on the meshes of a requested accuracy, solved as often as the study repeats it."""

    def __init__(
        self, method: Method, factor: float, problem: VariedProblem, natural: float, *, asked: float | None = None
    ) -> None:
        gamma = "auto" if method.gamma is None else method.gamma * natural
        goal = None
        if asked is not None:
            goal = Accuracy(target=asked, of="energy", refinement="adaptive", seconds=TOO_LONG_RUN)
        settings = {"gamma_n": gamma, "gamma_t": gamma, **method.settings}
        self._statement, self._settings = problem.statement, studied_settings(problem.statement, settings)
        self._solve = problem.on(factor, method.element, self._settings, goal)
        self._method, self._factor, self._asked = method, factor, asked
        self._times: list[dict[str, float]] = []
        self._about: Row = {}
        self._enough = 1000

    def solve_once(self, reference: Reference | None, *, counted: bool) -> None:
        """Solve once; measure the errors if there is a reference."""
        if len(self._times) >= self._enough:
            return
        _forget_peak_memory()
        memory_before, begin = peak_memory(MPI.COMM_SELF), time.perf_counter()
        try:
            solution = self._solve()
        except SignoriniError as error:
            self._about = {"status": " ".join(str(error).split()), **dict.fromkeys(QUANTITIES)}
            return
        total = time.perf_counter() - begin
        self._enough = 1 if total > LONG_RUN else 3 if total > MIDDLE_RUN else self._enough
        if counted or self._enough == 1:
            phases = {phase: solution.timings.seconds.get(phase, 0.0) for phase in PHASES}
            coarser = sum(level.seconds for level in solution.levels[:-1])
            remainder = max(0.0, total - sum(phases.values()) - coarser)
            memory = max(0.0, peak_memory(MPI.COMM_SELF) - memory_before)
            self._times.append({"seconds": total, **phases, "coarser": coarser, "rest": remainder, "memory": memory})
        if reference is None:
            return
        weight = solution.table.columns["weight"]
        self._about = {
            "h": float(weight.mean()),
            "dofs": solution.model.dofs,
            "linear_solves": solution.history.linear_solves,
            "work": work_of(solution),
            "factorisations": sum(record.factorised for record in solution.history.iterations),
            "linear_algebra": solution.linear_algebra.split(":")[0],
            "status": solution.status.value,
            **dict.fromkeys(QUANTITIES),
        }
        if solution.converged:
            key = None if self._asked else (self._method.element[0], self._factor)
            self._about |= reference.errors(solution, key)

    def row(self) -> Row:
        """The row of the table for this run."""
        settings, about = self._settings, self._about
        times: dict[str, float | None] = dict.fromkeys(
            ("seconds", *PHASES, "coarser", "rest", "fastest", "slowest", "memory")
        )
        if self._times:
            times |= {name: statistics.median(run[name] for run in self._times) for name in self._times[0]}
            totals = [run["seconds"] for run in self._times]
            times |= {"fastest": min(totals), "slowest": max(totals)}
        return {
            "method": self._method.name,
            "families": "; ".join(self._method.families),
            "element": self._method.element,
            "algorithm": settings.algorithm,
            "coulomb": settings.coulomb if self._statement.has_coulomb else "",
            "gamma": self._method.gamma if self._method.gamma is not None else "auto",
            "linear_algebra": about.get("linear_algebra", settings.linear_algebra),
            "levels": settings.levels,
            "size_of_cells": None if self._asked else self._factor,
            "asked": self._asked,
            "h": about.get("h"),
            "dofs": about.get("dofs"),
            "status": about.get("status", ""),
            **{name: about.get(name) for name in QUANTITIES},
            "linear_solves": about.get("linear_solves"),
            "work": about.get("work"),
            "factorisations": about.get("factorisations"),
            "repeats": len(self._times),
            **times,
        }


def work_of(solution: Solution) -> int:
    """Linear solves on every mesh times the unknowns there."""
    meshes = [(level.linear_solves, level.dofs) for level in solution.levels]
    meshes = meshes or [(solution.history.linear_solves, solution.model.dofs)]
    return sum(solves * dofs for solves, dofs in meshes)


def _forget_peak_memory() -> None:
    """Reset the peak, because the memory of earlier runs would hide that of this one."""
    gc.collect()
    with contextlib.suppress(OSError, AttributeError):  # not Linux
        ctypes.CDLL(None).malloc_trim(0)
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
