"""Solution to a given accuracy: the choice of the next mesh and gamma, and the test whether the
accuracy is reached.

The next mesh is only as fine as needed: uniform refinement uses the rate at which the error
decreases, adaptive refinement the share of the squared error that has to be removed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, inf

import numpy as np
from mpi4py import MPI

from signorini_fx.algebra.algorithms.task import Outcome, Task
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.machine import parallel
from signorini_fx.machine.display import duration
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.mesh.refinement import lengths_of_cells, mark, refine, shorter_lengths
from signorini_fx.mechanics.rigid.mesh_levels import MeshLevel
from signorini_fx.mechanics.statement.settings import Accuracy, SolverSettings
from signorini_fx.quantities.summary import Price
from signorini_fx.records import ACCURACY, History, Status
from signorini_fx.results.accuracy.convergence_table import (
    LevelResult,
    convergence_table,
    fineness_of,
    polygon_error_of,
    predict,
    seen_rate,
    with_polygon,
)
from signorini_fx.results.accuracy.next_accuracy import DIVIDED_FOR, LOCAL
from signorini_fx.results.accuracy.pressure_error import diverging_row
from signorini_fx.results.solution import Solution
from signorini_fx.solving.meshed_problem import MeshedProblem, SolvedMesh, Unsolved
from signorini_fx.tuned import (
    BULK,
    EXPECTED_RATES,
    FEW_NODES,
    LARGEST_GAMMA,
    LARGEST_JUMP,
    LEFT_BY_SOLVES,
    MANY_STEPS,
    MARGIN,
    MARGIN_OF_ENERGY,
    MEMORY_SHARE,
    REGULARISATION_SHARE,
    SHORTEST_CHILD,
    SMALLEST_JUMP,
)


def solve_to_accuracy(meshes: Meshes, budget: Budget) -> Solution:
    """Refine the mesh, and increase gamma, until the estimated error meets the target or the budget
    is spent; collective.

    A refinement that is predicted to exceed the budget is not started.  One that takes longer than
    predicted is stopped after the linear solve in which the time ends; on the first mesh there is
    then no solution.
    """
    goal = budget.goal
    comm = budget.comm
    history = meshes.problem.history
    levels: list[LevelResult] = []
    state: ContactState | None = None
    last: Solution | None = None
    polygon: float | None = None
    started = parallel.clock(comm)
    while True:
        try:
            solved = meshes.solve(state, len(levels))
        except Exception as failure:
            if last is None:
                raise
            return Unsolved.by_error(failure, "the next mesh", comm).leaves(last, history)
        solution = solved.solution
        task = solved.task
        outcome = solved.outcome
        level = solved.level
        late = history.overdue()
        if level is None:
            ended = (
                f"{goal.seconds:g} s have ended before mesh {len(levels) + 1} was solved"
                if late
                else ""
            )
            if last is not None:
                unsolved = Unsolved.by_outcome(solution, "the next mesh", late=ended)
                if unsolved is not None:
                    return unsolved.leaves(last, history)
            elif late:
                history.add(f"{ACCURACY}{ended}")
            return replace(solution, levels=tuple(levels))
        degree = solution.statement.element.degree
        # Adaptive meshes restore the rates of smooth solutions, which the ends of contact zones
        # limit on uniform ones.
        rates = {
            name: max(rate, degree if meshes.adaptive else 1)
            for name, rate in EXPECTED_RATES.items()
        }
        polygon = meshes.problem.polygon_error(solved, polygon)
        state = solved.state
        now = parallel.clock(comm)
        seconds = now - started
        started = now
        same_mesh = bool(levels) and levels[-1].dofs == level.dofs
        known = with_polygon(level, polygon).model_copy(update={"seconds": seconds})
        levels = [*levels[: len(levels) - same_mesh], known]
        rows = []
        if len(levels) > 1:
            rows = convergence_table(
                levels, budget.base_memory, rates=rates, uniform=not meshes.adaptive
            )
        solution = last = replace(solution, levels=tuple(levels), convergence_table=tuple(rows))
        regularisation = (
            level.pressure_regularisation if goal.of == "pressure" else level.regularisation
        )
        # Errors of other quantities are only known by comparing meshes.
        on_one = {"energy": level.energy, "pressure": level.pressure}
        estimate = getattr(rows[-2], goal.of) if rows else on_one.get(goal.of)
        margin = MARGIN_OF_ENERGY[degree] if goal.of == "energy" else MARGIN
        error = inf if estimate is None else estimate * margin
        enough = len(levels) >= (2 if goal.of in ("energy", "pressure") else 3)
        if enough and error + regularisation <= goal.target:
            return solution
        if hopeless := _out_of_reach(goal, levels, margin, solved.tagged.size):
            return Unsolved(Status.OUT_OF_REACH, hopeless).leaves(solution, history)
        if late:
            return replace(solution, status=Status.BUDGET)
        if task is not None and outcome is not None:
            meshes.raise_gamma(task, outcome, level.regularisation, regularisation / goal.target)
        allowed = goal.target * (1 - REGULARISATION_SHARE)
        if not enough or error > allowed:
            excess = error / (goal.target - min(regularisation, goal.target - allowed))
            # The contact zone ends at nodes, so that the error of the pressure decreases unevenly:
            # meshes that are hardly finer are not worth a solve.
            compared = goal.of not in LOCAL or goal.of == "pressure"
            rate = rates.get(goal.of) or seen_rate(levels, level.dimension)
            touching = level.table.touching if goal.of == "peak" else FEW_NODES
            jump = meshes.jump(
                excess, rate, compared=compared, dimension=level.dimension, touching=touching
            )
            beyond = None
            if enough and len(levels) >= MANY_STEPS:
                beyond = Unsolved(Status.OUT_OF_REACH, f"{MANY_STEPS} meshes have not reached it")
            elif enough and not meshes.adaptive:
                jump, beyond = budget.affordable(rows, jump, level, meshes)
            if beyond is None:
                try:
                    meshes.refine(solved, excess, jump)
                    if enough and meshes.adaptive:  # the size of the next mesh is known only now
                        beyond = budget.exceeded(rows, meshes.finer, level)
                except Exception as failure:
                    return Unsolved.by_error(failure, "to make the next mesh", comm).leaves(
                        solution, history
                    )
            if beyond is not None:
                return beyond.leaves(solution, history)
        elif (
            task is None
            or outcome is None
            or outcome.data.gamma_n >= LARGEST_GAMMA * task.natural_gamma
        ):
            reason = (
                "the regularisation leaves more, and gamma is as large as double precision allows"
            )
            return Unsolved(Status.OUT_OF_REACH, reason).leaves(solution, history)


def _out_of_reach(goal: Accuracy, levels: list[LevelResult], margin: float, size: float) -> str:
    """Return why no mesh will reach the accuracy, as a message; "" if one may."""
    table = levels[-1].table
    row = diverging_row([level.table for level in levels]) if goal.of == "peak" else None
    if row is not None:
        axes = [name for name in "xyz" if name in table.columns]
        # Rounded, and without minus zero.
        point = [round(float(table.columns[name][row]) / size, 9) * size + 0.0 for name in axes]
        at = ", ".join(f"{value:.6g}" for value in point)
        return (
            f"the largest pressure has no finite value: it grows with every refinement at ({at}); "
            "require the accuracy of the pressure, a force or the energy, or round off the "
            f"{'corner' if table.facets is None else 'edge'}"
        )
    polygon = margin * polygon_error_of(goal.of, levels[-1].polygon)
    if polygon > goal.target:
        return (
            "the straight facets of the mesh on a curved contact boundary are worth an error of "
            f"{polygon:.2g}, which "
            "no refinement makes smaller: give the .geo, or a mesh of second order"
        )
    spacings = [np.diff(table.arc(path)) for path in table.paths if len(path) > 1]
    spacing = min((float(lengths.min()) for lengths in spacings), default=inf)
    if spacing < LEFT_BY_SOLVES * size:
        return (
            "the contact pressure at a corner is too steep for this accuracy, and may have no "
            "finite norm: require that of a force or the energy, or round off the corner"
        )
    return ""


@dataclass(frozen=True)
class Budget:
    """A requested accuracy with its limits of time and memory.

    Attributes:
        goal: the accuracy and the limits.
        comm: the ranks.
        base_memory: memory in use at the start, MB.
        begin: clock time at the start, s.
    """

    goal: Accuracy
    comm: MPI.Comm
    base_memory: float
    begin: float

    @classmethod
    def begins(cls, goal: Accuracy, comm: MPI.Comm, history: History) -> Budget:
        """Start a budget; the history then reports when its time has passed, which ends all
        methods. Collective.
        """
        budget = cls(goal, comm, parallel.peak_memory(comm), parallel.clock(comm))
        allowed = goal.seconds
        if allowed is not None:
            history.is_late = lambda: parallel.clock(comm) - budget.begin >= allowed
        return budget

    def affordable(
        self, rows: list[Price], jump: float, last: LevelResult, meshes: Meshes
    ) -> tuple[float, Unsolved | None]:
        """Return the ratio of refinement, reduced if needed to keep to the budget, and how the next
        mesh would exceed the budget even so (None if it does not).
        """
        beyond = self.exceeded(rows, meshes.whole(jump), last)
        while beyond is not None and meshes.any_jump and jump > SMALLEST_JUMP:
            jump = max(jump / 2, SMALLEST_JUMP)
            beyond = self.exceeded(rows, meshes.whole(jump), last)
        return jump, beyond

    def exceeded(self, rows: list[Price], finer: float, last: LevelResult) -> Unsolved | None:
        """Return how a mesh ``finer`` times finer than the last one would exceed the budget or the
        memory of the machine; None if it would not.
        """
        goal = self.goal
        following = predict(
            rows[:-1],
            self.base_memory,
            finer=finer,
            dimension=last.dimension,
            krylov_from=last.krylov_from,
        )
        spent = parallel.clock(self.comm) - self.begin
        if goal.seconds is not None and spent + following.seconds > goal.seconds:
            reason = (
                f"about {duration(following.seconds)}, and {duration(spent)} of "
                f"{goal.seconds:g} s are spent"
            )
            return Unsolved(Status.BUDGET, f"the next mesh would take {reason}")
        # A process that exceeds the memory would be killed, and its results would be lost.
        available = parallel.machine_memory(self.comm) / 1024**3
        allowed = MEMORY_SHARE * available if goal.memory is None else goal.memory
        if following.memory <= 1024 * allowed:
            return None
        reason = (
            f"this machine has {available:.2g}"
            if goal.memory is None
            else f"{goal.memory:g} are allowed"
        )
        reason = (
            f"the next mesh would take about {following.memory / 1024:.2g} GB of memory, {reason}"
        )
        return Unsolved(Status.MEMORY if goal.memory is None else Status.BUDGET, reason)


# --- the meshes on the way: the coarsest one, each finer one after it, and the problem on it ------


class Meshes:
    """A sequence of ever finer meshes; ``problem`` is the one on the mesh to be solved next."""

    def __init__(
        self,
        problem: MeshedProblem,
        goal: Accuracy,
        *,
        adaptive: bool,
        made: bool,
        any_jump: bool,
    ) -> None:
        self._comm = problem.comm
        self._made = made
        self._of: str = DIVIDED_FOR.get(goal.of, goal.of)  # the quantity for which cells are marked
        self.adaptive: bool = (
            adaptive  # whether triangles or tetrahedra are divided where the error is large
        )
        # whether the next mesh may be any number of times finer, else some cells halve
        self.any_jump: bool = any_jump
        settings = problem.settings
        automatic = (settings.algorithm, settings.gamma_n, settings.gamma_t) == (
            "auto",
            "auto",
            "auto",
        )
        self._stated: SolverSettings | None = None  # where they are changed
        if goal.of == "pressure" and automatic and problem.augmentable:
            # The regularisation smears the pressure at a corner over a length that hardly depends
            # on the mesh.
            self._stated = settings
            problem = problem.with_settings(settings.model_copy(update={"algorithm": "alm"}))
        self.problem: MeshedProblem = problem
        self._divisions = 1
        self._coarser: MeshLevel | None = None
        self.finer: float = (
            1.0  # how much, on average, the last division of some cells has made the mesh
        )

    def _solved(self, state: ContactState | None, number: int) -> SolvedMesh:
        """Solve on the current mesh; the first mesh is refined until it has a solution."""
        while True:
            try:
                solved = self.problem.solved(number, state, self._coarser)
                self._coarser = solved.as_level()
                solution = solved.solution
                unsolved = solved.level is None
                retried = unsolved and (
                    solution.statement.sides[1] is not None or solved.task is None
                )
                spent = (
                    solution.history.late or solution.status is Status.NO_MEMORY
                )  # another try would end likewise
                if number > 0 or spent or not retried or not self.problem.coarsest > 1:
                    return solved
            except (SceneError, MeshError):
                if number > 0 or not self.problem.coarsest > 1:
                    raise
            self.problem = replace(self.problem, coarsest=self.problem.coarsest / 2).divided(1)

    def solve(self, state: ContactState | None, number: int) -> SolvedMesh:
        """Solve on the current mesh; if augmentation fails on it, finer meshes use the stated
        settings.
        """
        solved = self._solved(state, number)
        if number == 0 and solved.level is not None:
            self.problem = self.problem.keeping(solved)
        if self._stated is not None and solved.outcome is not None and not solved.outcome.augmented:
            self.problem = self.problem.with_settings(self._stated)
            self._stated = None
        return solved

    def jump(
        self, excess: float, rate: float, *, compared: bool, dimension: int, touching: int
    ) -> float:
        """Return how many times finer the next mesh should be.

        Args:
            excess: ratio of the error to the allowed one; infinite if the error is unknown: then
                the mesh becomes so fine that it has enough nodes in contact.
            rate: order of convergence.
            compared: whether the next mesh must be noticeably finer to be worth a solve.
            dimension: of the body.
            touching: number of nodes in contact.
        """
        if not self.any_jump:
            return (
                fineness_of(2.0, dimension) if self.adaptive and not self.problem.remakes else 2.0
            )
        if excess == inf:
            resolving = (FEW_NODES / max(touching, 1)) ** (1 / (dimension - 1))
            return float(np.clip(resolving, 2.0, LARGEST_JUMP[dimension]))
        smallest = SMALLEST_JUMP if compared else 1.0
        return float(np.clip(excess ** (1 / rate), smallest, LARGEST_JUMP[dimension]))

    def whole(self, jump: float) -> float:
        """Return how many times finer the next mesh will be: cells of newly made meshes are divided
        a whole number of times.
        """
        if not (self._made and self.any_jump):
            return jump
        return max(ceil(self._divisions * jump - 1e-9), self._divisions + 1) / self._divisions

    def refine(self, solved: SolvedMesh, excess: float, jump: float) -> None:
        """Make the next mesh; cells made by gmsh are on average at most ``jump`` times finer."""
        if self.problem.remakes:
            assert solved.errors is not None
            last = solved.tagged
            dim = solved.tagged.dimension
            squares = solved.errors.squares[self._of]
            lengths = lengths_of_cells(last)
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
            counts = [
                mesh.mesh.topology.index_map(mesh.dimension).size_global
                for mesh in (tagged, solved.tagged)
            ]
            self.finer = fineness_of(counts[0] / counts[1], tagged.dimension)
            self.problem = self.problem.on(tagged)

    def raise_gamma(
        self, task: Task, outcome: Outcome, regularisation_error: float, excess: float
    ) -> None:
        """Increase gamma so that the regularisation error, proportional to 1 / gamma, keeps to its
        share.
        """
        factor = excess / REGULARISATION_SHARE
        if factor <= 1:
            return
        settings = self.problem.settings
        data = outcome.data
        largest = LARGEST_GAMMA * task.natural_gamma
        update = {
            "gamma_n": min(data.gamma_n * factor, largest),
            "gamma_t": min(data.gamma_t * factor, largest),
        }
        if settings.algorithm == "path-following":  # it finds gamma itself
            allowed = (
                inf if settings.regularisation_error == "auto" else settings.regularisation_error
            )
            # With Coulomb friction the error of path-following is that of the start problem, so the
            # allowed error is at least halved, which ends the loop.
            update = {"regularisation_error": min(allowed, regularisation_error) / max(factor, 2.0)}
        self.problem = self.problem.with_settings(settings.model_copy(update=update))
