"""What is said about a result that stands: where it fails, this is told, and the result is kept.

On several ranks an error of one of them leaves the others waiting for it in MPI.  So a result is in its place before
any of this begins.
"""

from __future__ import annotations

import json
import re
import time
import traceback
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from typing import Any, TypeVar

from mpi4py import MPI
from pydantic import TypeAdapter

from signorini_fx.quantities.kinds import Number
from signorini_fx.quantities.quantity import Quantity
from signorini_fx.quantities.registry import at_stage, is_added
from signorini_fx.records import Finding
from signorini_fx.results.solution import Solution
from signorini_fx.tuned import ERROR_PATIENCE

T = TypeVar("T")


def post_processing(comm: MPI.Comm, subject: str, findings: list[dict[str, Any]], state: Callable[[], T]) -> T | None:
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


def _afterwards(solution: Solution) -> list[Quantity]:
    return [quantity for quantity in at_stage("afterwards") if is_added(quantity) or quantity.asked(solution)]


def asked(solution: Solution) -> list[str]:
    """The keys of the summary that ``proved`` may add."""
    return [quantity.key for quantity in _afterwards(solution)]


def proved(solution: Solution, findings: list[dict[str, Any]]) -> dict[str, Any]:
    """What is computed once the results stand, as far as the scene asks for it: entries of the summary; collective.

    Args:
        solution: what was solved.
        findings: rows of the summary.
    """
    comm, entries = solution.comm, dict[str, Any]()
    for quantity in _afterwards(solution):
        added = post_processing(comm, quantity.key, findings, partial(_entries, quantity, solution)) or {}
        entries |= added
        if quantity.key in added and (message := quantity.missed(added[quantity.key])):
            findings.append(asdict(Finding("warning", quantity.key, message)))
    return entries


def columns_of(quantity: Quantity, solution: Solution, findings: list[dict[str, Any]]) -> dict[str, Any]:
    """The entries of a quantity in a row of the load steps; collective.

    One that is not of this package may fail, or have other values than numbers, or other columns than its own, which is
    told once.
    """
    if not is_added(quantity):
        return quantity.columns(solution)
    rows = list[dict[str, Any]]()
    columns = post_processing(solution.comm, quantity.key, rows, partial(_columns, quantity, solution))
    findings += [row for row in rows if row not in findings]
    return columns or {}


def _entries(quantity: Quantity, solution: Solution) -> dict[str, Any]:
    """The entries of a quantity; of one that is not of this package its own, of the type that it says.

    Raises:
        ValueError: they are not.
    """
    if not is_added(quantity):
        return quantity.entries(solution)
    if not quantity.asked(solution):
        return {}
    entries = quantity.entries(solution)
    _refuse_others(quantity, [name for name in entries if name != quantity.key])
    return {key: _as_json(quantity, value) for key, value in entries.items()}


def _columns(quantity: Quantity, solution: Solution) -> dict[str, Any]:
    """The columns of one that is not of this package, numbers."""
    columns = TypeAdapter(dict[str, Number]).validate_python(quantity.columns(solution))
    key = re.escape(quantity.key)  # as the schema of the summary has them
    _refuse_others(quantity, [name for name in columns if not re.fullmatch(rf"{key}(_[xyz])?( .+)?", name)])
    return dict(columns)


def _refuse_others(quantity: Quantity, names: list[str]) -> None:
    """Keys that are not those of a quantity.

    Raises:
        ValueError: there are some.
    """
    if names:
        raise ValueError(f"has {', '.join(map(repr, names))}, though only {quantity.key!r} is its own")


def _as_json(quantity: Quantity, value: Any) -> Any:
    """A value of the type that a quantity says, as JSON has it.

    Raises:
        ValueError: it is none.
    """
    adapter: TypeAdapter[Any] = TypeAdapter(quantity.kind)
    plain = adapter.dump_python(adapter.validate_python(value), mode="json", exclude_unset=True)
    json.dumps(plain)
    return plain
