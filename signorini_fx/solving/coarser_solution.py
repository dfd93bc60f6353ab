"""When a finer mesh has no solution the certified one of the mesh before stands, with the reason in its outcome."""

from __future__ import annotations

from dataclasses import dataclass, replace

from mpi4py import MPI

from signorini_fx.algebra.linalg.failures import memory_ended
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.records import ACCURACY, History, Status
from signorini_fx.results.solution import Solution

# What the finer mesh says of the body, not of its solve: statics excludes a solution, or there is one that is too
# large.  A coarser mesh does not refute this.
OF_THE_BODY = (Status.NOT_HELD, Status.OPEN, Status.TIPS, Status.SLIDES, Status.TOO_LARGE)
# Outcomes on a mesh whose cells are as small as the round-off of their coordinates.
_TOO_FINE = (Status.NOT_CERTIFIED, Status.ROUND_OFF, Status.SINGULAR, Status.NOT_FINITE)


@dataclass(frozen=True)
class Unsolved:
    """Why a finer mesh has no solution, and the outcome of the coarser one that stands in its place."""

    status: Status
    reason: str

    @classmethod
    def by_outcome(cls, status: Status, mesh: str, *, late: str = "", tiny: bool = False) -> Unsolved | None:
        """Of a solve that ended without a solution; ``late``: that the time has passed, in words; ``tiny``: whether the
        coordinates of the mesh before have hardly any digits left.  None where its outcome is what holds of the body.
        """
        if status is Status.NO_MEMORY:
            return cls(Status.MEMORY, f"{mesh} has used up the memory")
        if late:
            return cls(Status.BUDGET, late)
        if status in OF_THE_BODY:
            return None
        ended = f"{mesh} ends with: {status.value}"
        if tiny and status in _TOO_FINE:
            return cls(Status.OUT_OF_REACH, f"{ended}; it is too fine for double precision")
        return cls(Status.COARSER, f"{ended}: {status.advice}")

    @classmethod
    def by_error(cls, error: Exception, mesh: str, comm: MPI.Comm) -> Unsolved:
        """Of an error while a mesh was made or solved, which all ranks have, as those that the package raises on
        purpose.

        Raises:
            Exception: the error itself, where it is none of these, or memory of one of several ranks: the others wait.
        """
        if comm.size == 1 and memory_ended(error):
            return cls(Status.MEMORY, f"{mesh} has used up the memory")
        if isinstance(error, (SceneError, MeshError)):
            return cls(Status.COARSER, f"{mesh} cannot be solved: {str(error).splitlines()[0]}")
        raise error

    def leaves(self, coarser: Solution, history: History) -> Solution:
        """The certified solution on the coarser mesh, with this outcome."""
        history.add(f"{ACCURACY}{self.reason}")
        return replace(coarser, status=self.status)
