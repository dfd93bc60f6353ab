"""What is said about a result that stands: where it fails, this is told, and the result is kept.

On several ranks an error of one of them leaves the others waiting for it in MPI.  So a result is in its place before
any of this begins.
"""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable
from dataclasses import asdict
from typing import Any, TypeVar

from mpi4py import MPI

from signorini_fx.records import Finding
from signorini_fx.results.solution import Solution

T = TypeVar("T")
# How long a rank with an error waits for those that may have it later, seconds.
PATIENCE = 30.0


def afterthought(comm: MPI.Comm, subject: str, findings: list[dict[str, Any]], state: Callable[[], T]) -> T | None:
    """What ``state`` returns; None if it fails on any rank, with a warning among the findings; collective.

    Args:
        comm: the ranks.
        subject: what is computed, a key of the summary.
        findings: rows of the summary.
        state: computes it; collective.

    Raises:
        Exception: that of this rank, if the others do not come to an end, since they wait for it.
    """
    apart = comm.Dup()  # the others may be in a collective call of ``comm``
    result: T | None = None
    error: Exception | None = None
    try:
        result = state()
    except Exception as raised:
        error = raised
    everybody = apart.Ibarrier()
    if error is None:
        everybody.Wait()
    elif not _ends(everybody):
        error.add_note(f"The results are written, without this: {subject}.")
        raise error
    reasons = apart.allgather(None if error is None else failure_in_words(error))
    apart.Free()
    reason = next((known_reason for known_reason in reasons if known_reason is not None), None)
    if reason is None:
        return result
    message = f"was not computed, which changes nothing in the other results: {reason}"
    findings.append(asdict(Finding("warning", subject, message)))
    return None


def _ends(request: MPI.Request) -> bool:
    """Whether all ranks get there while this one has patience."""
    end = time.monotonic() + PATIENCE
    while not request.Test():
        if time.monotonic() > end:
            return False
        time.sleep(0.01)
    return True


def failure_in_words(error: Exception) -> str:
    """Kind, place and last line of an error that nobody expected."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    told = str(error).strip().splitlines()
    return f"{type(error).__name__} in {last.name}{f': {told[-1]}' if told else ''}"


def missing(what: list[str]) -> list[dict[str, Any]]:
    """Findings of a result to which these are not yet added."""
    return [asdict(Finding("warning", name, "is missing: the run ended before it was complete")) for name in what]


def asked(solution: Solution) -> list[str]:
    """The keys of the summary that ``proved`` may add."""
    goal, settings = solution.scene.accuracy, solution.scene.solver
    bounded = settings.error_bound or (goal is not None and goal.certified)
    names = {"safety": solution.contact is not None, "uniqueness": settings.uniqueness, "error_bound": bounded}
    return [name for name, wanted in names.items() if wanted]


def proved(solution: Solution, findings: list[dict[str, Any]]) -> dict[str, Any]:
    """What is proved of a solution, as far as the scene asks for it: entries of the summary; collective.

    Args:
        solution: what was solved.
        findings: rows of the summary.
    """
    comm, wanted, entries = solution.comm, asked(solution), dict[str, Any]()
    if "safety" in wanted and (safety := afterthought(comm, "safety", findings, lambda: solution.safety)) is not None:
        entries["safety"] = safety.as_dict()
    if "uniqueness" in wanted:
        unique = afterthought(comm, "uniqueness", findings, lambda: solution.uniqueness)
        if unique is not None:
            entries["uniqueness"] = unique.as_dict()
    if "error_bound" in wanted:
        bound = afterthought(comm, "error_bound", findings, lambda: solution.error_bound)
        if isinstance(bound, str):
            entries["error_bound"] = {"statement": f"none: {bound}"}
        elif bound is not None:
            fixed = afterthought(comm, "error_bound", findings, lambda: solution.fixed_point)
            entries["error_bound"] = bound.as_dict() | ({} if fixed is None else fixed.beside(bound))
    return entries
