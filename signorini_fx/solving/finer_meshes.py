"""The meshes on the way to an accuracy: the coarsest one, each finer one after it, and the problem on it."""

from __future__ import annotations

from math import ceil, inf

import numpy as np

from signorini_fx.algebra.algorithms.task import Outcome, Task
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.mesh.refinement import lengths_of_cells, mark, refine, shorter_lengths
from signorini_fx.mechanics.rigid.mesh_levels import MeshLevel
from signorini_fx.mechanics.statement.settings import Accuracy, SolverSettings
from signorini_fx.records import Status
from signorini_fx.results.accuracy.convergence_table import fineness_of
from signorini_fx.results.accuracy.next_accuracy import DIVIDED_FOR
from signorini_fx.solving.meshed_problem import MeshedProblem, SolvedMesh
from signorini_fx.tuned import (
    BULK,
    FEW_NODES,
    LARGEST_GAMMA,
    LARGEST_JUMP,
    REGULARISATION_SHARE,
    SHORTEST_CHILD,
    SMALLEST_JUMP,
)


class Meshes:
    """One finer mesh after the other, and the problem on it.

    Attributes:
        problem: on the mesh that is to be solved next.
        adaptive: whether triangles or tetrahedra are divided where the error is large.
        any_jump: whether the next mesh may be any number of times finer; otherwise all cells, or some, are halved.
        seconds: time of the last refinements; 0 where the mesh is made with the solve.
        finer: how many times finer, on average over the body, the last division of some cells has made the mesh.
    """

    def __init__(
        self,
        problem: MeshedProblem,
        goal: Accuracy,
        *,
        adaptive: bool,
        made: bool,
        any_jump: bool,
    ) -> None:
        self._comm, self._made = problem.comm, made
        self._of: str = DIVIDED_FOR.get(goal.of, goal.of)  # the quantity for which cells are marked
        self.adaptive: bool = adaptive
        self.any_jump: bool = any_jump
        settings = problem.settings
        automatic = (settings.algorithm, settings.gamma_n, settings.gamma_t) == ("auto", "auto", "auto")
        self._stated: SolverSettings | None = None  # where they are changed
        if goal.of == "pressure" and automatic and problem.augmentable:
            # The regularisation smears the pressure at a corner over a length that hardly depends on the mesh.
            self._stated = settings
            problem = problem.with_settings(settings.model_copy(update={"algorithm": "alm"}))
        self.problem: MeshedProblem = problem
        self._divisions = 1
        self._coarser: MeshLevel | None = None
        self.seconds: float = 0.0
        self.finer: float = 1.0

    def keep(self, solved: SolvedMesh) -> None:
        """Keep what was chosen on the first mesh."""
        self.problem = self.problem.keeping(solved)

    def _solved(self, state: ContactState | None, number: int) -> SolvedMesh:
        """The current mesh, the first one as fine as it must be.

        Straight facets of two bodies that fit each other may be so far apart on it that there is no solution, and a
        nonlinear body may be too coarse for one.
        """
        while True:
            try:
                solved = self.problem.solved(number, state, self._coarser)
                self._coarser = solved.as_level(self._coarser)
                retried = solved.solution.statement.sides[1] is not None or solved.task is None
                apart = solved.level is None and retried and not _used_up(solved)
                if number > 0 or not apart or not self.problem.coarsest > 1:
                    return solved
            except (SceneError, MeshError):
                if number > 0 or not self.problem.coarsest > 1:
                    raise
            self.problem = self.problem.beginning_finer()

    def solve(self, state: ContactState | None, number: int) -> SolvedMesh:
        """Solve on the current mesh; with regularisation on all finer ones if augmentation fails on it."""
        solved = self._solved(state, number)
        if self._stated is not None and solved.outcome is not None and solved.outcome.regularised:
            self.problem = self.problem.with_settings(self._stated)
            self._stated = None
        return solved

    def jump(self, excess: float, rate: float, *, compared: bool, dimension: int, touching: int) -> float:
        """How many times finer the next mesh is, for an error that is ``excess`` times too large; where it is not known
        because of the nodes ``touching``, so many times that they are enough.
        """
        if not self.any_jump:
            return fineness_of(2.0, dimension) if self.adaptive and not self.problem.remakes else 2.0
        if excess == inf:
            resolving = (FEW_NODES / max(touching, 1)) ** (1 / (dimension - 1))
            return float(np.clip(resolving, 2.0, LARGEST_JUMP[dimension]))
        smallest = SMALLEST_JUMP if compared else 1.0
        return float(np.clip(excess ** (1 / rate), smallest, LARGEST_JUMP[dimension]))

    def whole(self, jump: float) -> float:
        """How many times finer the next mesh will be: where meshes are made anew, cells are divided a whole number of
        times.
        """
        if not (self._made and self.any_jump):
            return jump
        return max(ceil(self._divisions * jump - 1e-9), self._divisions + 1) / self._divisions

    def refine(self, solved: SolvedMesh, excess: float, jump: float) -> None:
        """Make the next mesh, of cells made anew at most ``jump`` times finer on average over the body."""
        begin = parallel.clock(self._comm)
        if self.problem.remakes:
            assert solved.errors is not None
            last, dim = solved.tagged, solved.tagged.dimension
            squares, lengths = solved.errors.squares[self._of], lengths_of_cells(last)
            factor = float(np.clip(excess, SMALLEST_JUMP, 1 / SHORTEST_CHILD))
            degree = solved.solution.statement.element.degree
            lengths = shorter_lengths(self._comm, squares, lengths, factor, degree, dim, jump)
            self.problem, count = self.problem.remade(last, lengths, jump)
            self.finer = fineness_of(count / last.mesh.topology.index_map(dim).size_global, dim)
        elif self._made:
            # Whole multiples of the coarsest mesh keep its nodes, where loads may jump.
            self._divisions = round(self._divisions * (self.whole(jump) if self.any_jump else 2))
            self.problem = self.problem.divided(self._divisions)
        else:
            cells = None
            if self.adaptive:
                assert solved.errors is not None
                squares = solved.errors.squares[self._of]
                cells = mark(self._comm, squares, float(np.clip(1 - excess**-2, *BULK)))
            tagged = refine(solved.tagged, cells)
            counts = [mesh.mesh.topology.index_map(mesh.dimension).size_global for mesh in (tagged, solved.tagged)]
            self.finer = fineness_of(counts[0] / counts[1], tagged.dimension)
            self.problem = self.problem.on(tagged)
        self.seconds += parallel.clock(self._comm) - begin

    def raise_gamma(self, task: Task, outcome: Outcome, regularisation_error: float, excess: float) -> None:
        """Make gamma so large that the regularisation error keeps to its share; it decreases like 1 / gamma.

        Path-following finds gamma itself: its allowed error is reduced.
        """
        factor = excess / REGULARISATION_SHARE
        if factor <= 1:
            return
        settings, data = self.problem.settings, outcome.data
        largest = LARGEST_GAMMA * task.natural_gamma
        update = {"gamma_n": min(data.gamma_n * factor, largest), "gamma_t": min(data.gamma_t * factor, largest)}
        if settings.algorithm == "path-following":
            allowed = inf if settings.regularisation_error == "auto" else settings.regularisation_error
            # With Coulomb friction its own figure is that of the start: halving, at least, comes to an end.
            update = {"regularisation_error": min(allowed, regularisation_error) / max(factor, 2.0)}
        self.problem = self.problem.with_settings(settings.model_copy(update=update))


def _used_up(solved: SolvedMesh) -> bool:
    """Whether time or memory ended, so that another try would end likewise."""
    return solved.solution.history.late or solved.solution.status is Status.NO_MEMORY
