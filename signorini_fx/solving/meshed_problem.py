"""What nested iteration and a requested accuracy ask of a problem: to be solved on one mesh after another."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from signorini_fx.algebra.algorithms.task import Outcome, Task
from signorini_fx.algebra.linalg.petsc_calls import memory_ended
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.rigid.mesh_levels import MeshLevel
from signorini_fx.mechanics.statement.settings import SolverSettings
from signorini_fx.records import ACCURACY, History, Status
from signorini_fx.results.accuracy.error_estimates import Errors, worst_of
from signorini_fx.results.accuracy.level_results import LevelResult, level_result
from signorini_fx.results.accuracy.pressure_error import polygon_error
from signorini_fx.results.solution import Solution
from signorini_fx.solving.checkpointed_steps import MeshCheckpoint

# What the finer mesh says of the body, not of its solve: statics excludes a solution, or there is one that is too
# large.  A coarser mesh does not refute this.
OF_THE_BODY = (Status.NOT_HELD, Status.OPEN, Status.TIPS, Status.SLIDES, Status.TOO_LARGE)


@dataclass(frozen=True)
class SolvedMesh:
    """A problem on one mesh, of a nonlinear body without a task; of a solution that is none, or has no estimate, the
    rest is None.
    """

    solution: Solution
    tagged: TaggedMesh
    task: Task | None
    outcome: Outcome | None = None
    level: LevelResult | None = None
    errors: Errors | None = None

    def as_level(self, coarser: MeshLevel | None) -> MeshLevel | None:
        """This mesh as a level of multigrid for finer ones, above those that there are; collective."""
        return None if self.task is None else self.solution.model.level(coarser)

    @property
    def state(self) -> ContactState | None:
        """The contact points after the first load step, with which the next mesh begins as well."""
        return self.solution.steps[0].contact


@dataclass(frozen=True, kw_only=True)
class MeshedProblem(ABC):
    """A problem on one of several meshes; what is changed is another one.  Scenes and forms differ in how the model of
    a mesh is made, and how meshes are.

    Attributes:
        comm: the ranks that share the work.
        history: of all meshes.
        remakes: whether gmsh makes cells anew where the error is large.
        coarsest: how many times larger than those that were stated the cells of the first mesh are.
        polygonal: whether straight facets stay although the shape may be curved.
        in_parts: whether some of several bodies may be made anew on true arcs.
    """

    comm: MPI.Comm
    history: History
    remakes: bool = False
    coarsest: float = 1.0
    polygonal: bool = False
    in_parts: bool = False

    @property
    @abstractmethod
    def augmentable(self) -> bool:
        """Whether augmentation may be chosen: not between two bodies, with which its estimates were not tested, and not
        where contact gives way by a law of its own, which it would make hard.
        """

    @property
    @abstractmethod
    def settings(self) -> SolverSettings:
        """How it is solved."""

    @abstractmethod
    def with_settings(self, settings: SolverSettings) -> Self:
        """The same, solved in another way."""

    @abstractmethod
    def solve(
        self, state: ContactState | None, coarser: MeshLevel | None, checkpoint: MeshCheckpoint | None
    ) -> tuple[SolvedMesh, list[Errors]]:
        """Solve it from the contact state of a coarser mesh, with coarser meshes as levels of multigrid, and with a
        checkpoint, each None where there is none; with the errors of each load step; collective.
        """

    @abstractmethod
    def on(self, tagged: TaggedMesh) -> Self:
        """The same on a mesh whose cells are those of the last one, divided."""

    @abstractmethod
    def divided(self, times: int) -> Self:
        """The same on a mesh that is made anew, with cells so many times as small as those of the first one."""

    def remade(self, last: TaggedMesh, lengths: npt.NDArray[np.float64], finer: float) -> tuple[Self, int]:
        """The same on cells of these lengths that gmsh makes anew, at most ``finer`` times finer than the last mesh,
        and how many there are; collective.
        """
        raise NotImplementedError

    def keeping(self, solved: SolvedMesh) -> Self:
        """The same with what was chosen on the first mesh."""
        return self

    def beginning_finer(self) -> Self:
        """The same with a first mesh whose cells are half as large; that one is coarser than the stated one."""
        return replace(self, coarsest=self.coarsest / 2).divided(1)

    def polygon_error(self, solved: SolvedMesh, last: float | None) -> float:
        """The effect of straight facets on a curved contact boundary, see ``pressure_error.polygon_error``."""
        if not self.polygonal or (last is not None and not self.in_parts):
            return last or 0.0
        assert solved.level is not None
        return polygon_error(solved.level.table, solved.solution.model.scales.modulus)

    def solved(
        self, number: int, state: ContactState | None, coarser: MeshLevel | None, stored: MeshCheckpoint | None = None
    ) -> SolvedMesh:
        """Solve it as one of several meshes, with its errors and its cost; collective."""
        history, comm = self.history, self.comm
        history.add(f"level {number}")
        solves_before = history.linear_solves
        solved, step_errors = self.solve(state, coarser, None if stored is None else stored.on(number))
        solution = solved.solution
        if not solution.converged:
            return replace(solved, outcome=None)
        if not step_errors:
            return solved
        errors = worst_of(step_errors)
        level = level_result(
            number,
            solution.model,
            solved.task,
            solved.outcome,
            step_errors[-1].size,
            errors,
            solution.table,
            own=history.iterations[solves_before:],
            cost=(sum(solution.timings.seconds.values()), parallel.peak_memory(comm)),
            # Of the load steps that all meshes have in common.
            contacts=[step.contact for step in solution.steps if step.contact and step.place.is_integer()],
        )
        return replace(solved, level=level, errors=errors)


@dataclass(frozen=True)
class Unsolved:
    """Why a finer mesh has no solution, or is not made, and the outcome of the coarser one that stands in its place."""

    status: Status
    reason: str

    @classmethod
    def by_outcome(cls, status: Status, mesh: str, *, late: str = "") -> Unsolved | None:
        """Of a solve that ended without a solution; ``late``: that the time has passed, in words; None where its
        outcome is what holds of the body.
        """
        if status is Status.NO_MEMORY:
            return cls(Status.MEMORY, f"{mesh} has used up the memory")
        if late:
            return cls(Status.BUDGET, late)
        if status in OF_THE_BODY:
            return None
        return cls(Status.COARSER, f"{mesh} ends with: {status.value}: {status.advice}")

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
        """The solution on the coarser mesh, with this outcome."""
        history.add(f"{ACCURACY}{self.reason}")
        return replace(coarser, status=self.status)
