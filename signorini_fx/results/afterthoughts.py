"""Statements about a result that stands: where one of them fails, this is said, and the result is kept."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from dataclasses import asdict
from typing import Any, TypeVar

from mpi4py import MPI

from signorini_fx.records import Finding
from signorini_fx.results.solution import Solution

T = TypeVar("T")


def afterthought(comm: MPI.Comm, what: str, findings: list[dict[str, Any]], state: Callable[[], T]) -> T | None:
    """A statement; None if it fails, with a warning among the findings.

    On several ranks an error may be that of one of them, while others wait for it: there it is raised as it is.

    Args:
        comm: the ranks.
        what: it is, a key of the summary.
        findings: rows of the summary.
        state: computes it.
    """
    if comm.size > 1:
        return state()
    try:
        return state()
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        told = str(error).strip().splitlines()
        reason = f"{type(error).__name__} in {last.name}{f': {told[-1]}' if told else ''}"
        message = f"was not computed, which changes nothing in the other results: {reason}"
        findings.append(asdict(Finding("warning", what, message)))
        return None


def proved(solution: Solution, findings: list[dict[str, Any]]) -> dict[str, Any]:
    """What is proved of a solution, as far as the scene asks for it: entries of the summary; collective.

    Args:
        solution: what was solved.
        findings: rows of the summary.
    """
    comm, goal, found = solution.comm, solution.scene.accuracy, dict[str, Any]()
    if solution.scene.solver.uniqueness:
        unique = afterthought(comm, "uniqueness", findings, lambda: solution.uniqueness)
        if unique is not None:
            found["uniqueness"] = unique.as_dict()
    asked = solution.scene.solver.error_bound or (goal is not None and goal.certified)
    if asked and (bound := afterthought(comm, "error_bound", findings, lambda: solution.error_bound)) is not None:
        found["error_bound"] = {"statement": f"none: {bound}"} if isinstance(bound, str) else bound.as_dict()
        if not isinstance(bound, str):
            fixed = afterthought(comm, "error_bound", findings, lambda: solution.fixed_point)
            found["error_bound"] |= {} if fixed is None else fixed.beside(bound)
    return found
