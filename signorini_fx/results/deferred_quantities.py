"""What is said about a result that stands: where it fails, this is told, and the result is kept.

On several ranks an error of one of them leaves the others waiting for it in MPI.  So a result is in its place before
any of this begins.
"""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from typing import Any, TypeVar

from mpi4py import MPI
from pydantic import TypeAdapter

from signorini_fx.quantities.quantity import Quantity, own_quantities
from signorini_fx.quantities.values import NO_BOUND, afterwards, of_step
from signorini_fx.records import Finding
from signorini_fx.results.solution import Solution
from signorini_fx.tuned import ERROR_PATIENCE

T = TypeVar("T")


def post_processing(comm: MPI.Comm, subject: str, findings: list[dict[str, Any]], state: Callable[[], T]) -> T | None:
    """What ``state`` returns; None if it fails on any rank, with a warning among the findings; ``subject``: a key of
    the summary; ``findings``: its rows; collective.

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
    end = time.monotonic() + ERROR_PATIENCE
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


def _afterwards(solution: Solution) -> dict[str, Callable[[Solution], Any]]:
    own = {quantity.key: partial(_own_value, quantity) for quantity in own_quantities()}
    return {**afterwards(solution), **own}


def asked(solution: Solution) -> list[str]:
    """The keys of the summary that ``proved`` may add."""
    return list(_afterwards(solution))


def proved(solution: Solution, findings: list[dict[str, Any]]) -> dict[str, Any]:
    """What is computed once the results stand, as far as the scene asks for it: entries of the summary; collective."""
    entries: dict[str, Any] = {}
    for key, value_of in _afterwards(solution).items():
        value = post_processing(solution.comm, key, findings, partial(value_of, solution))
        if value is not None:
            entries[key] = value
    statement = entries.get("error_bound", {}).get("statement", "")
    if statement.startswith(NO_BOUND):
        message = f"there is no guaranteed bound: {statement.removeprefix(NO_BOUND)}"
        findings.append(asdict(Finding("warning", "error_bound", message)))
    return entries


def columns_of(solution: Solution, findings: list[dict[str, Any]]) -> dict[str, Any]:
    """The columns of a load step; a quantity of one's own that fails has none, which is told once; collective."""
    columns, rows = of_step(solution), list[dict[str, Any]]()
    for quantity in own_quantities():
        value = post_processing(solution.comm, quantity.key, rows, partial(_own_value, quantity, solution))
        if isinstance(value, float):
            columns[quantity.key] = value
    findings += [row for row in rows if row not in findings]
    return columns


def _own_value(quantity: Quantity, solution: Solution) -> Any:
    """The value of a quantity of one's own, as JSON has it.

    Raises:
        ValueError: it is no number, and no list of numbers.
    """
    adapter: TypeAdapter[Any] = TypeAdapter(float | list[float] | None)
    return adapter.validate_python(quantity.value(solution), strict=True)
