"""Solution to a given accuracy: which mesh comes next, with which gamma, and when the accuracy is reached.

The solve on every mesh starts from the contact state of the previous one, and estimates the error.  The next mesh is
only as fine as needed: uniform refinement uses the rate at which the error decreases, adaptive refinement the share of
the squared error that has to be removed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import ceil, inf

import numpy as np
from mpi4py import MPI

from signorini_fx import parallel
from signorini_fx.accuracy.error_estimates import Errors
from signorini_fx.accuracy.mesh_level import LevelResult
from signorini_fx.accuracy.plan import LOCAL, planned
from signorini_fx.accuracy.pressure_error import corners_of_error, polygon_error
from signorini_fx.accuracy.price_list import (
    Price,
    expected_rates,
    fineness_of,
    grows_for_ever,
    peak_memory,
    predict,
    price_list,
    with_polygon,
)
from signorini_fx.algorithms.task import Outcome, Task
from signorini_fx.body.contact_state import ContactState
from signorini_fx.display import duration
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.mesh.hierarchy import scene_on, with_halved_bodies
from signorini_fx.mesh.refinement import cells_at, mark, refine
from signorini_fx.mesh.tagged import (
    TaggedMesh,
    load_file,
)
from signorini_fx.records import Status
from signorini_fx.results.solution import Solution
from signorini_fx.scene.model import MeshFile, Scene
from signorini_fx.scene.settings import Accuracy
from signorini_fx.tuned import (
    BULK,
    COARSER_START,
    CORNER_DIVISIONS,
    CORNER_RATE,
    FEWEST_MESHES,
    LARGEST_GAMMA,
    LARGEST_JUMP,
    MARGIN,
    MARGIN_OF_OTHERS,
    MEMORY_SHARE,
    MOST_MESHES,
    REGULARISATION_SHARE,
    SMALLEST_JUMP,
)

# Nodes that are closer than this share of the body's size cannot be told apart reliably.
_ROUND_OFF = 1e-11
# Cells of this share of the body's size, and those of the next mesh, may have stiffnesses that are round-off of others.
_TINY = 1e-6
# The field with the polygon's error of a quantity.
_POLYGON_COLUMN = {"energy": "energy", "pressure": "pressure"}
# Outcomes on a mesh whose cells are as small as the round-off of their coordinates.
_TOO_FINE = (Status.NOT_CERTIFIED, Status.ROUND_OFF, Status.SINGULAR, Status.NOT_FINITE)


@dataclass(frozen=True)
class Solved:
    """A scene on one mesh.

    Attributes:
        solution: how it ended.
        task: the contact problem; None without one.
        outcome: how it ended; None where it has no solution.
        level: errors and cost of the mesh; None where it has no solution.
        errors: the estimates on the mesh; None where it has no solution.
    """

    solution: Solution
    task: Task | None
    outcome: Outcome | None = None
    level: LevelResult | None = None
    errors: Errors | None = None


def solve_to_accuracy(
    scene: Scene,
    goal: Accuracy,
    comm: MPI.Comm,
    solve_on: Callable[[Scene, ContactState | None, int], Solved],
    on_level: Callable[[Solution], object],
    notify: Callable[[str], object],
) -> Solution:
    """Refine the mesh, and increase gamma, until the estimated error meets the target or the budget ends.

    A refinement that would exceed the budget is not begun, and one that takes longer than predicted is given up, after
    the linear solve in which the time ends.  If it ends on the first mesh there is no solution.

    Args:
        scene: with the mesh and the gamma to begin from.
        goal: the requested accuracy.
        comm: the ranks that share the work.
        solve_on: solves a scene on its mesh from a contact state, as the level of that number; collective.
        on_level: called with the solution on each mesh but the last; collective.
        notify: called with messages for the user, such as that other elements than the scene's are used.
    """
    base_memory, begin = peak_memory(comm), parallel.clock(comm)
    meshes = Meshes(scene, goal, comm)
    if meshes.replaced:
        notify(f"elements: {meshes.replaced}; accuracy.refinement = 'uniform' or 'adaptive' keeps those of the scene")
    rates = expected_rates(meshes.degree if meshes.adaptive else 1)
    levels: list[LevelResult] = []
    state: ContactState | None = None
    last: Solution | None = None
    polygon = 0.0
    while True:
        before = parallel.clock(comm)
        solved = meshes.solve(solve_on, state, len(levels))
        solution, task, outcome, level = solved.solution, solved.task, solved.outcome, solved.level
        late = solution.history.overdue()
        if late and level is None:
            notify(f"accuracy: {goal.seconds:g} s have ended before mesh {len(levels) + 1} was solved")
        if last is not None and level is None and late:
            return replace(last, status=Status.BUDGET)
        if last is not None and solution.status in _TOO_FINE:
            # The coordinates of tiny cells have no digits left: the previous mesh is the last that has a solution.
            tiny = "; it is too fine for double precision" * _is_tiny(levels[-1], solution.discretisation.tagged.size)
            notify(f"accuracy: the next mesh ends with: {solution.status.value}{tiny}")
            return replace(last, status=Status.OUT_OF_REACH)
        if level is None or task is None or outcome is None:
            return replace(solution, levels=tuple(levels))
        if not levels:
            meshes.keep_sides(solution.scene)
        if meshes.polygonal and (not levels or scene.body):  # with several bodies, some may be made anew on true arcs
            polygon = polygon_error(level.table, max(material.plane_modulus for material in scene.material))
        state = solution.steps[0].contact
        seconds = parallel.clock(comm) - before + meshes.seconds
        meshes.seconds = 0.0
        same_mesh = bool(levels) and levels[-1].dofs == level.dofs
        levels = [*levels[: len(levels) - same_mesh], replace(with_polygon(level, polygon), seconds=seconds)]
        rows = price_list(levels, base_memory, rates=rates, uniform=not meshes.adaptive) if len(levels) > 1 else []
        solution = last = replace(solution, levels=tuple(levels), price_list=tuple(rows))
        left = level.pressure_regularisation if goal.of == "pressure" else level.regularisation
        estimate = (
            getattr(rows[-2], goal.of)
            if rows
            else {"energy": levels[0].energy, "pressure": levels[0].pressure}.get(goal.of)
        )
        margin = MARGIN.get((goal.of, meshes.degree), MARGIN_OF_OTHERS)
        error = inf if estimate is None else estimate * margin
        enough = len(levels) >= FEWEST_MESHES[level.dimension].get(goal.of, 3)
        certified = goal.certified and (len(levels) == 1 or error + left <= goal.target)
        if certified:  # where not even the estimate meets the target the bound does not; the first mesh may be refused
            solved, certain = _certified(solved)
            error, margin = max(certain - left, 0.0), 1.0  # the bound includes the regularisation
        if (enough or certified) and error + left <= goal.target:
            return solution
        hopeless = _out_of_reach(goal, levels, margin, solution.discretisation.tagged.size)
        if hopeless:
            notify(f"accuracy: {hopeless}")
            return replace(solution, status=Status.OUT_OF_REACH)
        if late:
            return replace(solution, status=Status.BUDGET)
        meshes.raise_gamma(task, outcome, level.regularisation, left / goal.target)
        allowed = goal.target * (1 - REGULARISATION_SHARE)
        if not enough or error > allowed:
            excess = error / (goal.target - min(left, goal.target - allowed))
            # That of the pressure is corrected by its change from mesh to mesh, which is extrapolated.
            compared, rate = goal.of not in LOCAL or goal.of == "pressure", rates.get(goal.of) or _seen_rate(levels)
            jump = meshes.jump(excess, rate, compared=compared, dimension=level.dimension)
            if enough:
                beyond = _beyond(goal, comm, rows, base_memory, begin, jump, level)
                while beyond and meshes.any_jump and jump > SMALLEST_JUMP:
                    jump = max(jump / 2, SMALLEST_JUMP)
                    beyond = _beyond(goal, comm, rows, base_memory, begin, jump, level)
                if beyond:
                    notify(f"accuracy: the next mesh would take {beyond}")
                if beyond or len(levels) >= MOST_MESHES:
                    return replace(solution, status=Status.BUDGET)
            on_level(solution)
            meshes.refine(solved, excess, jump)
        elif outcome.data.gamma_n >= LARGEST_GAMMA * task.natural_gamma:
            return replace(solution, status=Status.BUDGET)


def _certified(solved: Solved) -> tuple[Solved, float]:
    """The guaranteed bound of the relative error, and the mesh with its shares in place of the estimated ones.

    Raises:
        SceneError: there is no bound for the scene.
    """
    bound = solved.solution.error_bound
    assert bound is not None
    assert solved.errors is not None
    if isinstance(bound, str):
        raise SceneError([("accuracy.certified", bound)])
    squares = {**solved.errors.squares, "energy": bound.squares}
    return replace(solved, errors=replace(solved.errors, squares=squares)), bound.relative


def _out_of_reach(goal: Accuracy, levels: list[LevelResult], margin: float, size: float) -> str:
    """Why no mesh will reach the accuracy; "" if one may."""
    table = levels[-1].table
    if goal.of == "peak" and grows_for_ever(levels):
        row = int(np.argmax(table.columns["pressure"]))
        axes = [name for name in "xyz" if name in table.columns]
        place = [round(float(table.columns[name][row]) / size, 9) * size for name in axes]  # round-off is no position
        at = ", ".join(f"{value:.6g}" for value in place)
        return (
            f"the largest pressure has no finite value: it grows with every refinement at ({at}); ask for the "
            f"pressure, a force or the energy, or round off the {'corner' if table.facets is None else 'edge'}"
        )
    bare = replace(levels[-1], energy=0.0, pressure=0.0, data=0.0)
    polygon = getattr(with_polygon(bare, levels[-1].polygon), _POLYGON_COLUMN.get(goal.of, "data")) * margin
    if polygon > goal.target:
        return (
            f"the straight facets of the mesh on a curved contact boundary are worth an error of {polygon:.2g}, which "
            "no refinement makes smaller: give the .geo, or a mesh of second order"
        )
    spacings = [np.diff(table.arc(path)) for path in table.paths if len(path) > 1]
    spacing = min((float(own.min()) for own in spacings), default=inf)
    if spacing < _ROUND_OFF * size:
        return (
            "the contact pressure is so steep at a corner that round-off comes before the accuracy; it may have no "
            "finite norm there: ask for a force or the energy, or round off the corner"
        )
    return ""


def _beyond(
    goal: Accuracy, comm: MPI.Comm, rows: list[Price], base_memory: float, begin: float, jump: float, last: LevelResult
) -> str:
    """Why a mesh ``jump`` times finer than the last one would exceed the budget or the machine; "" if it would not."""
    following = predict(rows[:-1], base_memory, finer=jump, dimension=last.dimension, krylov_from=last.krylov_from)
    spent = parallel.clock(comm) - begin
    if goal.seconds is not None and spent + following.seconds > goal.seconds:
        return f"about {duration(following.seconds)}, and {duration(spent)} of {goal.seconds:g} s are spent"
    # A process that takes more memory than there is would be killed, and its results with it.
    there = parallel.machine_memory(comm) / 1024**3
    allowed = MEMORY_SHARE * there if goal.memory is None else goal.memory
    if following.memory <= 1024 * allowed:
        return ""
    told = f"this machine has {there:.2g}" if goal.memory is None else f"{goal.memory:g} are allowed"
    return f"about {following.memory / 1024:.2g} GB of memory, {told}"


def _is_tiny(level: LevelResult, size: float) -> bool:
    """Whether a contact point of a mesh stands for so small an area that round-off may be why the next mesh fails."""
    return float(level.table.columns["weight"].min()) < (_TINY * size) ** (level.dimension - 1)


def _seen_rate(levels: list[LevelResult]) -> float:
    """The rate at which the error in the energy norm decreases with h; with a single mesh, that of first order."""
    if len(levels) < 2 or not levels[-1].energy < levels[-2].energy:
        return 1.0
    finer = fineness_of(levels[-1].dofs / levels[-2].dofs, levels[-1].dimension)
    return float(np.clip(np.log(levels[-2].energy / levels[-1].energy) / np.log(finer), 0.5, 2.0))


class Meshes:
    """One finer mesh after the other, and the scene on it.

    Attributes:
        scene: the scene on the mesh that is to be solved next.
        degree: of the displacement.
        adaptive: whether triangles or tetrahedra are divided where the error is large.
        polygonal: whether straight facets stay although the shape may be curved.
        replaced: what replaces the scene's elements; "": they stay.
        any_jump: whether the next mesh may be any number of times finer; otherwise all cells, or some, are divided.
        seconds: time of the last refinement; 0 where the mesh is made with the solve.
    """

    def __init__(self, scene: Scene, goal: Accuracy, comm: MPI.Comm) -> None:
        self._comm, self._plan = comm, planned(scene, goal, comm)
        self._of: str = goal.of if goal.of in LOCAL else "force"  # the quantity for which cells are marked
        self._given: Scene = self._plan.scene
        self.adaptive: bool = self._plan.adaptive
        self.polygonal: bool = self._plan.polygonal
        how = "triangles divided where the error is" if self.adaptive else "all cells smaller"
        self._regularised = self._given
        settings = self._given.solver
        automatic = (settings.algorithm, settings.gamma_n, settings.gamma_t) == ("auto", "auto", "auto")
        paired = scene.sides[1] is not None
        if (goal.of == "pressure" or goal.certified) and automatic and not paired:
            # The regularisation smears the pressure at a corner over a length that hardly depends on the mesh.  Between
            # two bodies "exact" is not possible.
            solver = settings.model_copy(update={"algorithm": "exact"})
            self._given = self._given.model_copy(update={"solver": solver})
        self.degree: int = self._given.element.degree
        self.replaced: str = f"degree {self.degree}, {how}" if self._plan.replaced else ""
        self._generated = self._given.generated
        self.any_jump: bool = self._generated and not self.adaptive
        self._file = self._given.mesh if isinstance(self._given.mesh, MeshFile) else None
        self._coarsest, self._divisions, self._halvings = self._coarsest_factor(), 1, 0
        self.seconds: float = 0.0
        self.scene: Scene = self._scene()

    def _coarsest_factor(self) -> float:
        """How many times larger the first cells are; the coarse nodes must be nodes of the scene's own mesh.

        A mesh needs a node where a load jumps, and the scene's own mesh has one.
        """
        factor = float(COARSER_START[self.degree]) if self._generated else 1.0
        while factor > 1 and scene_on(scene_on(self._given, factor), 1 / factor) != scene_on(self._given, 1.0):
            factor /= 2
        return factor

    def keep_sides(self, solved: Scene) -> None:
        """Leave the contact points of pairs on the sides that were chosen on the first mesh: forces have their sign."""
        if solved.sides[1] is None:
            return
        contacts = [
            one if one.against is None else one.model_copy(update={"points": "boundary"}) for one in solved.contact
        ]
        kept = {"contact": tuple(contacts)}
        self.scene, self._given, self._regularised = (
            one.model_copy(update=kept) for one in (self.scene, self._given, self._regularised)
        )

    def first(self, solve_on: Callable[[Scene, ContactState | None, int], Solved]) -> Solved:
        """Solve on the coarsest mesh that has all boundaries of the scene's own mesh.

        Straight facets of two bodies that fit each other may be so far apart on it that there is no solution.
        """
        while True:
            try:
                solved = solve_on(self.scene, None, 0)
                apart = solved.level is None and self._given.sides[1] is not None and not solved.solution.history.late
                if not apart or not self._generated or self._coarsest <= 1:
                    return solved
            except (SceneError, MeshError):
                if not self._generated or self._coarsest <= 1:
                    raise
            self._coarsest /= 2
            self.scene = self._scene()

    def solve(
        self,
        solve_on: Callable[[Scene, ContactState | None, int], Solved],
        state: ContactState | None,
        number: int,
    ) -> Solved:
        """Solve on the current mesh; with regularisation if the scene leaves it open and nothing else works."""
        if self._given.solver == self._regularised.solver:
            return self.first(solve_on) if number == 0 else solve_on(self.scene, state, number)
        try:
            solved = self.first(solve_on) if number == 0 else solve_on(self.scene, state, number)
            if solved.level is not None or solved.task is None or solved.solution.history.late:
                return solved
        except SceneError:
            solved = None
        self._given = self._regularised
        self.scene = self.scene.model_copy(update={"solver": self._regularised.solver})
        try:
            return self.first(solve_on) if number == 0 else solve_on(self.scene, state, number)
        except SceneError:
            if solved is not None:
                return solved
            raise

    def jump(self, excess: float, rate: float, *, compared: bool, dimension: int) -> float:
        """How many times finer the next mesh is, for an error that is ``excess`` times too large."""
        if not self.any_jump:
            return fineness_of(2.0, dimension) if self.adaptive else 2.0
        if excess == inf:
            return 2.0
        smallest = SMALLEST_JUMP if compared else 1.0
        return float(np.clip(excess ** (1 / rate), smallest, LARGEST_JUMP[dimension]))

    def refine(self, solved: Solved, excess: float, jump: float) -> None:
        """Make the next mesh."""
        begin = parallel.clock(self._comm)
        if self._file is not None or (self._given.body and not self._generated):
            self._halvings += 1
            self._change_meshes()
        elif self.any_jump:
            # Whole multiples of the coarsest mesh keep its nodes, where loads may jump.
            self._divisions = max(ceil(self._divisions * jump - 1e-9), self._divisions + 1)
            self._change_meshes()
        else:
            cells = None
            if self.adaptive:
                assert solved.errors is not None
                squares = solved.errors.squares[self._of]
                cells = mark(self._comm, squares, float(np.clip(1 - excess**-2, *BULK)))
            tagged = refine(solved.solution.discretisation.tagged, cells)
            if self._of == "pressure" and self.adaptive and tagged.dimension == 2:
                tagged = self._divide_corners(tagged, solved, excess)
            self.scene = self.scene.model_copy(update={"mesh": tagged})
        self.seconds = parallel.clock(self._comm) - begin

    def _divide_corners(self, tagged: TaggedMesh, solved: Solved, excess: float) -> TaggedMesh:
        """Divide the cells at corners in contact several times, if they contain the error of the pressure.

        There it decreases so slowly with h, and so few cells are divided, that a solve after each division is wasteful.
        """
        assert solved.level is not None
        corners = corners_of_error(solved.level.table)
        for _ in range(round(np.clip(np.log2(min(excess, 1e3)) / CORNER_RATE - 1, 0, CORNER_DIVISIONS))):
            if not len(corners):
                break
            tagged = refine(tagged, cells_at(tagged, corners))
        return tagged

    def raise_gamma(self, task: Task, outcome: Outcome, left: float, excess: float) -> None:
        """Make gamma so large that the regularisation error keeps to its share; it decreases like 1 / gamma.

        Path-following finds gamma itself: its allowed error is reduced.

        Args:
            task: the contact problem on the last mesh.
            outcome: how it ended.
            left: its regularisation error, relative in the energy norm.
            excess: the regularisation error of the requested quantity, relative to the target.
        """
        factor = excess / REGULARISATION_SHARE
        if factor <= 1:
            return
        settings, data = self.scene.solver, outcome.data
        largest = LARGEST_GAMMA * task.natural_gamma
        update = {"gamma_n": min(data.gamma_n * factor, largest), "gamma_t": min(data.gamma_t * factor, largest)}
        if settings.algorithm == "path-following":
            allowed = inf if settings.regularisation_error == "auto" else settings.regularisation_error
            # With Coulomb friction its own figure is that of the start: halving, at least, comes to an end.
            update = {"regularisation_error": min(allowed, left) / max(factor, 2.0)}
        solver = settings.model_copy(update=update)
        self.scene = self.scene.model_copy(update={"solver": solver})

    def _change_meshes(self) -> None:
        """Give the scene the mesh, or the bodies, with the current divisions."""
        made = self._scene()
        self.scene = self.scene.model_copy(update={"mesh": made.mesh, "body": made.body})

    def _scene(self) -> Scene:
        """The scene on the mesh with the current divisions."""
        if self._file is not None:
            given, halvings, degree = self._given, self._halvings, self._plan.geometry
            tagged = load_file(self._file, self._comm, halvings, degree, given.sections)
            return self._given.model_copy(update={"mesh": tagged})
        if self._generated:
            return scene_on(self._given, self._coarsest / self._divisions)
        return with_halved_bodies(self._given, self._halvings, self._comm) if self._given.body else self._given
