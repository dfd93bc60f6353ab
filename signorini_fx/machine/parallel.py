"""All MPI reductions of the package, and functions that run on the first rank only.

On a single rank no message is sent, because MPI takes ten times as long as returning the values.
"""

from __future__ import annotations

import contextlib
import os
import resource
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from mpi4py.util import pkl5

from signorini_fx.arrays import Array, Ints

T = TypeVar("T")

# Bytes that all ranks together send in one message at most: MPI counts them by 32 bits.
LARGEST_MESSAGE = 2**30


def is_root(comm: MPI.Comm) -> bool:
    """Return whether this is the rank that prints and writes."""
    return comm.rank == 0


def clock(comm: MPI.Comm) -> float:
    """Return the clock of the first rank in seconds, the same on every rank, for time differences;
    collective.
    """
    return float(comm.bcast(time.perf_counter()))


def peak_memory(comm: MPI.Comm) -> float:
    """Return the largest resident memory so far, summed over the ranks, MB; collective."""
    # Linux passes ru_maxrss on through fork and exec: a small child process would report the value
    # of its large parent.
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii")
        megabytes = int(status.split("VmHWM:")[1].split()[0]) / 1024
    except (OSError, IndexError):  # not Linux
        megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return float(global_sum(comm, np.array(megabytes)))


def global_sum(comm: MPI.Comm, values: npt.ArrayLike) -> npt.NDArray[Any]:
    """Return the sum over the ranks, entry by entry; shape and dtype of ``values`` are kept."""
    if comm.size == 1:
        return np.array(values, order="C")
    local = np.asarray(values, order="C")
    total = np.empty_like(local)
    comm.Allreduce(local, total, op=MPI.SUM)
    return total


def total(comm: MPI.Comm, values: npt.ArrayLike) -> float:
    """Return the sum of all entries over all ranks; for flags the number that are True."""
    return float(global_sum(comm, np.sum(values)))


def sums_by(comm: MPI.Comm, numbers: Ints, values: Array, count: int) -> Array:
    """Return sums over all ranks of the values with the same number, shape (count, d), the same on
    every rank.

    Args:
        comm: the ranks.
        numbers: from 0 to count - 1, shape (n,).
        values: shape (n, d).
        count: how many numbers there are.
    """
    total = np.zeros(
        (count, values.shape[1])
    )  # float on every rank: bincount gives integers on a rank without values
    for column in range(values.shape[1]):
        total[:, column] = np.bincount(numbers, values[:, column], minlength=count)
    return global_sum(comm, total)


def any_rank(comm: MPI.Comm, condition: npt.ArrayLike) -> bool:
    """Return whether ``condition``, or any entry of an array, is True on any rank."""
    holds = bool(np.any(condition))
    return holds if comm.size == 1 else bool(comm.allreduce(holds, op=MPI.LOR))


def global_max(comm: MPI.Comm, value: float) -> float:
    """Return the largest value over the ranks."""
    return float(value) if comm.size == 1 else float(comm.allreduce(float(value), op=MPI.MAX))


def global_bounds(comm: MPI.Comm, points: Array) -> Array:
    """Return the smallest and largest coordinates of the points of all ranks, shape (2, d);
    ``points`` has shape (n, d).
    """
    # Column by column, 20 times as fast as along the long axis.
    low = [column.min(initial=np.inf) for column in points.T]
    high = [column.max(initial=-np.inf) for column in points.T]
    signs = np.array([[-1.0], [1.0]])
    return signs * largest_of_each(comm, signs * np.array([low, high]))


def largest(comm: MPI.Comm, values: npt.NDArray[Any], default: float = 0.0) -> float:
    """Return the largest entry over the arrays of all ranks; an empty array counts as
    ``default``.
    """
    return global_max(comm, values.max() if values.size else default)


def largest_of_each(comm: MPI.Comm, values: Array) -> Array:
    """Return the largest value over the ranks, entry by entry; the shape is kept."""
    if comm.size == 1:
        return np.array(values)
    most = np.empty_like(values)
    comm.Allreduce(np.ascontiguousarray(values), most, op=MPI.MAX)
    return most


def on_root(comm: MPI.Comm, function: Callable[[], T]) -> T:
    """Run ``function`` on the first rank and give its result, or its error, to all ranks."""
    if comm.size == 1:
        return function()
    outcome: tuple[T | None, Exception | None] = (None, None)
    if is_root(comm):
        try:
            outcome = (function(), None)
        except Exception as error:
            outcome = (None, _as_sent(error))
    # A message of mpi4py has less than 2^31 bytes; those of pkl5 are sent in pieces.
    result, failure = pkl5.Intracomm(comm).bcast(outcome)
    if failure is not None:
        raise failure
    return cast(T, result)


def _as_sent(error: Exception) -> Exception:
    """Return an error that can be sent to all ranks; one that cannot be pickled becomes a
    RuntimeError with its message.
    """
    try:
        MPI.pickle.loads(MPI.pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}").with_traceback(error.__traceback__)
    return error


def raise_together(comm: MPI.Comm, error: Exception | None) -> None:
    """Raise on every rank if any rank has an error: the error of the lowest such rank."""
    errors = (
        [error] if comm.size == 1 else comm.allgather(None if error is None else _as_sent(error))
    )
    first = next((e for e in errors if e is not None), None)
    if first is not None:
        raise first


def machine_memory(comm: MPI.Comm) -> float:
    """Return the memory of all machines on which the ranks run, bytes, or its limit if that is
    lower; collective.

    The limits are those of a control group, and of the address space of each rank (``ulimit -v``).
    """
    memory = float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    with contextlib.suppress(OSError, ValueError):  # there is no control group, or it has no limit
        memory = min(memory, float(Path("/sys/fs/cgroup/memory.max").read_text(encoding="ascii")))
    first, ranks = True, 1
    if comm.size > 1:
        machine = comm.Split_type(MPI.COMM_TYPE_SHARED)
        first = machine.rank == 0
        ranks = machine.size
        machine.Free()
    allowed, _ = resource.getrlimit(resource.RLIMIT_AS)
    if allowed != resource.RLIM_INFINITY:
        memory = min(memory, float(allowed) * ranks)
    return float(global_sum(comm, np.array(memory if first else 0.0)))


def gather_rows(comm: MPI.Comm, rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return the rows of all ranks stacked in rank order, on every rank.

    For data of at most the size of the contact boundary.

    Args:
        comm: the ranks.
        rows: shape (n, ...), equal on all ranks except for n; numbers or truth values.
    """
    if comm.size == 1:
        return np.array(rows, order="C")
    large = int(global_sum(comm, np.array(rows.nbytes))) > LARGEST_MESSAGE
    return np.concatenate((pkl5.Intracomm(comm) if large else comm).allgather(rows))


def rows_on_root(comm: MPI.Comm, rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return the rows of all ranks stacked in rank order on the first rank, and no rows on the
    others, see ``gather_rows``.

    For data of the size of the mesh.
    """
    if comm.size == 1:
        return np.array(rows, order="C")
    gathered = pkl5.Intracomm(comm).gather(rows)
    return rows[:0] if gathered is None else np.concatenate(gathered)


def exchanged(comm: MPI.Comm, parts: list[T]) -> list[T]:
    """Return the objects that the ranks send to this one, in rank order; collective.

    Args:
        comm: the ranks.
        parts: the objects that this rank sends, one to each rank.
    """
    return parts if comm.size == 1 else comm.alltoall(parts)


def rows_before(comm: MPI.Comm, count: int) -> int:
    """Return the sum of ``count`` over the ranks before this one; collective."""
    return 0 if comm.size == 1 else sum(comm.allgather(count)[: comm.rank])


def largest_timings(comm: MPI.Comm, seconds: dict[str, float]) -> dict[str, float]:
    """Return the largest time of each phase over the ranks; all ranks must have the same phases."""
    return {name: global_max(comm, value) for name, value in seconds.items()}
