"""Every MPI reduction of the package, and everything that only the first rank does."""

from __future__ import annotations

import contextlib
import os
import resource
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from signorini_fx.errors import SignoriniError
from signorini_fx.machine import terminal

T = TypeVar("T")


def is_root(comm: MPI.Comm) -> bool:
    """Whether this rank prints and writes."""
    return comm.rank == 0


def log_on_root(comm: MPI.Comm, text: str, *, error: bool = False) -> None:
    """Print ``text`` once."""
    if is_root(comm):
        terminal.say(text, error=error)


def global_sum(comm: MPI.Comm, values: npt.ArrayLike) -> npt.NDArray[Any]:
    """Sum over the ranks, entry by entry; shape and dtype of ``values`` are kept."""
    local = np.asarray(values, order="C")
    total = np.empty_like(local)
    comm.Allreduce(local, total, op=MPI.SUM)
    return total


def sums_by(
    comm: MPI.Comm, numbers: npt.NDArray[np.int64], values: npt.NDArray[np.float64], count: int
) -> npt.NDArray[np.float64]:
    """Sums over the ranks of values, shape (n, d), by the numbers 0 to count - 1 that they have, shape (n,).

    Returns:
        The sums, shape (count, d), the same on every rank.
    """
    total = np.zeros((count, values.shape[1]))  # a float on a rank without values too, where bincount gives integers
    for column in range(values.shape[1]):
        total[:, column] = np.bincount(numbers, values[:, column], minlength=count)
    return global_sum(comm, total)


def any_rank(comm: MPI.Comm, condition: bool) -> bool:
    """Whether ``condition`` holds on any rank."""
    return bool(comm.allreduce(bool(condition), op=MPI.LOR))


def global_max(comm: MPI.Comm, value: float) -> float:
    """Largest value over the ranks."""
    return float(comm.allreduce(float(value), op=MPI.MAX))


def global_bounds(comm: MPI.Comm, points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Smallest and largest coordinates over the ranks of points of shape (n, d), shape (2, d)."""
    dim = points.shape[1]
    low = points.min(axis=0) if points.size else np.full(dim, np.inf)
    high = points.max(axis=0) if points.size else np.full(dim, -np.inf)
    bounds = np.empty((2, dim))
    comm.Allreduce(low, bounds[0], op=MPI.MIN)
    comm.Allreduce(high, bounds[1], op=MPI.MAX)
    return bounds


def local_max(values: npt.NDArray[Any], default: float = 0.0) -> float:
    """Largest entry of an array that may be empty (a rank without contact nodes)."""
    return float(values.max()) if values.size else default


def on_root(comm: MPI.Comm, function: Callable[[], T]) -> T:
    """Run ``function`` on the first rank and give its result, or its error, to all ranks alike.

    Raises:
        Exception: what ``function`` raised, the same on every rank, so that none waits for the others.
    """
    outcome: tuple[T | None, Exception | None] = (None, None)
    if is_root(comm):
        try:
            outcome = (function(), None)
        except Exception as error:
            outcome = (None, error)
    result, failure = comm.bcast(outcome)
    if failure is not None:
        raise failure
    return cast(T, result)


def raise_together(comm: MPI.Comm, error: SignoriniError | None) -> None:
    """Raise on every rank if any rank brings an error: the one of the lowest such rank."""
    first = next((e for e in comm.allgather(error) if e is not None), None)
    if first is not None:
        raise first


def machine_memory(comm: MPI.Comm) -> float:
    """Memory of all machines that the ranks run on, or what limits leave of it, bytes; collective.

    Limits are those of a control group, and the address space that each rank may have (``ulimit -v``).
    """
    own = float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    with contextlib.suppress(OSError, ValueError):  # no control group, or one without a limit
        own = min(own, float(Path("/sys/fs/cgroup/memory.max").read_text(encoding="ascii")))
    machine = comm.Split_type(MPI.COMM_TYPE_SHARED)
    first = machine.rank == 0
    allowed, _ = resource.getrlimit(resource.RLIMIT_AS)
    if allowed != resource.RLIM_INFINITY:
        own = min(own, float(allowed) * machine.size)
    machine.Free()
    return float(global_sum(comm, np.array(own if first else 0.0)))


def gather_rows(comm: MPI.Comm, rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Rows of all ranks stacked in rank order, on every rank."""
    return np.concatenate(comm.allgather(rows), axis=0)


def rows_before(comm: MPI.Comm, count: int) -> int:
    """How many rows the ranks before this one have, where each has ``count``; collective."""
    return sum(comm.allgather(count)[: comm.rank])


def largest_timings(comm: MPI.Comm, seconds: dict[str, float]) -> dict[str, float]:
    """Phase by phase the largest time over the ranks; the phases are the same on all ranks."""
    return {name: global_max(comm, value) for name, value in seconds.items()}
