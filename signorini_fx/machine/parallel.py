"""All MPI reductions of the package, and everything that only the first rank does.

A rank that is alone sends no message: MPI takes ten times as long for one as to return what was
given.
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
    """Return whether this rank prints and writes."""
    return comm.rank == 0


def clock(comm: MPI.Comm) -> float:
    """Return seconds on the clock of the first rank, the same on every rank: only differences mean
    anything; collective.
    """
    return float(comm.bcast(time.perf_counter()))


def peak_memory(comm: MPI.Comm) -> float:
    """Largest resident memory so far, summed over the ranks, MB; collective."""
    # Linux passes ru_maxrss on through fork and exec: in a small child it would be that of its
    # large parent.
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii")
        megabytes = int(status.split("VmHWM:")[1].split()[0]) / 1024
    except (OSError, IndexError):  # not Linux
        megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return float(global_sum(comm, np.array(megabytes)))


def global_sum(comm: MPI.Comm, values: npt.ArrayLike) -> npt.NDArray[Any]:
    """Sum over the ranks, entry by entry; shape and dtype of ``values`` are kept."""
    if comm.size == 1:
        return np.array(values, order="C")
    local = np.asarray(values, order="C")
    total = np.empty_like(local)
    comm.Allreduce(local, total, op=MPI.SUM)
    return total


def total(comm: MPI.Comm, values: npt.ArrayLike) -> float:
    """Return the sum of all values of all ranks; of flags the number of those that hold."""
    return float(global_sum(comm, np.sum(values)))


def sums_by(comm: MPI.Comm, numbers: Ints, values: Array, count: int) -> Array:
    """Sums over the ranks of values, shape (n, d), with the same number from 0 to count - 1,
    numbers: shape (n,); they have the shape (count, d), the same on every rank.
    """
    total = np.zeros(
        (count, values.shape[1])
    )  # a float on a rank without values too, where bincount gives integers
    for column in range(values.shape[1]):
        total[:, column] = np.bincount(numbers, values[:, column], minlength=count)
    return global_sum(comm, total)


def any_rank(comm: MPI.Comm, condition: npt.ArrayLike) -> bool:
    """Return whether ``condition`` holds on any rank, of an array anywhere."""
    holds = bool(np.any(condition))
    return holds if comm.size == 1 else bool(comm.allreduce(holds, op=MPI.LOR))


def global_max(comm: MPI.Comm, value: float) -> float:
    """Largest value over the ranks."""
    return float(value) if comm.size == 1 else float(comm.allreduce(float(value), op=MPI.MAX))


def global_bounds(comm: MPI.Comm, points: Array) -> Array:
    """Smallest and largest coordinates over the ranks of points of shape (n, d), shape (2, d)."""
    # Column by column, 20 times as fast as along the long axis.
    low = [column.min(initial=np.inf) for column in points.T]
    high = [column.max(initial=-np.inf) for column in points.T]
    signs = np.array([[-1.0], [1.0]])
    return signs * largest_of_each(comm, signs * np.array([low, high]))


def largest(comm: MPI.Comm, values: npt.NDArray[Any], default: float = 0.0) -> float:
    """Largest entry over the ranks of arrays, each of which may be empty: it then counts as
    ``default``.
    """
    return global_max(comm, values.max() if values.size else default)


def largest_of_each(comm: MPI.Comm, values: Array) -> Array:
    """Largest value over the ranks, entry by entry; the shape is kept."""
    if comm.size == 1:
        return np.array(values)
    most = np.empty_like(values)
    comm.Allreduce(np.ascontiguousarray(values), most, op=MPI.MAX)
    return most


def on_root(comm: MPI.Comm, function: Callable[[], T]) -> T:
    """Run ``function`` on the first rank and give its result, or its error, to all ranks, so that
    none waits.
    """
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
    """Return an error that all ranks can raise, in words where it cannot be sent: the others would
    wait for it.
    """
    try:
        MPI.pickle.loads(MPI.pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}").with_traceback(error.__traceback__)
    return error


def raise_together(comm: MPI.Comm, error: Exception | None) -> None:
    """Raise on every rank if any rank has an error: that of the lowest such rank."""
    errors = (
        [error] if comm.size == 1 else comm.allgather(None if error is None else _as_sent(error))
    )
    first = next((e for e in errors if e is not None), None)
    if first is not None:
        raise first


def machine_memory(comm: MPI.Comm) -> float:
    """Memory of all machines that the ranks run on, bytes, less if it is limited; collective.

    Limits are those of a control group, and of the address space of each rank (``ulimit -v``).
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
    """Return rows of all ranks stacked in rank order, on every rank: for what is of the size of the
    contact boundary at most.

    ``rows``: shape (n, ...), alike but for n, numbers or truth values.
    """
    if comm.size == 1:
        return np.array(rows, order="C")
    large = int(global_sum(comm, np.array(rows.nbytes))) > LARGEST_MESSAGE
    return np.concatenate((pkl5.Intracomm(comm) if large else comm).allgather(rows))


def rows_on_root(comm: MPI.Comm, rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return rows of all ranks, see ``gather_rows``, stacked in rank order on the first rank, none
    on the others: for what is of the size of the mesh.
    """
    if comm.size == 1:
        return np.array(rows, order="C")
    gathered = pkl5.Intracomm(comm).gather(rows)
    return rows[:0] if gathered is None else np.concatenate(gathered)


def exchanged(comm: MPI.Comm, parts: list[T]) -> list[T]:
    """Return what the ranks send to this one, in their order; collective.

    ``parts``: what this one sends to each of them.
    """
    return parts if comm.size == 1 else comm.alltoall(parts)


def rows_before(comm: MPI.Comm, count: int) -> int:
    """Return the number of rows of the ranks before this one, where each has ``count``;
    collective.
    """
    return 0 if comm.size == 1 else sum(comm.allgather(count)[: comm.rank])


def largest_timings(comm: MPI.Comm, seconds: dict[str, float]) -> dict[str, float]:
    """Return the largest time of each phase over the ranks; the phases are the same on all
    ranks.
    """
    return {name: global_max(comm, value) for name, value in seconds.items()}
