"""An accuracy that is asked for: which mesh comes next, with which gamma, and when it is enough.

Every mesh is solved from the contact state of the one before, and tells what is still missing.  The next one is as fine
as that needs, no finer: by the rate at which the error falls where the mesh is refined everywhere, by the share of the
squared error that has to go where it is refined where the error is.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import ceil, inf
from typing import Literal

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from signorini_fx import parallel
from signorini_fx.error_estimates import Errors
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.mesh import TaggedMesh, curved_parameters, load_mesh, triangle_parameters
from signorini_fx.nested import scene_on
from signorini_fx.price_list import LevelResult, Price, expected_rates, peak_memory, predict, price_list
from signorini_fx.pressure_error import corners_of_error
from signorini_fx.quantities import ContactState
from signorini_fx.refinement import cells_at, check_divisible, mark, refine
from signorini_fx.results import Status
from signorini_fx.scene import Accuracy, MeshGenerator, Scene
from signorini_fx.solution import Solution
from signorini_fx.strategy import LARGEST_GAMMA
from signorini_fx.task import Task

# Generated meshes begin with cells so many times as large as those of the scene; quadratic ones with as many unknowns.
_COARSER = {1: 4, 2: 8}
# Estimates that compare meshes need three of them, the others two: one to begin with and one to confirm it.
_FEWEST_MESHES = {"energy": 2, "pressure": 2}
_MOST_MESHES = 40
# What the estimates may be too small by (docs/accuracy.md); that of the displacement is the better one.
_SAFETY = {"energy": 1.4}
_UNSURE = 2.0
# What the regularisation may take of the error that is asked for.
_REGULARISATION_SHARE = 0.2
# A mesh is at most so many times finer than the one before (its contact state is a start, its rates are trusted), ...
_LARGEST_JUMP = 4.0
# ... and where meshes are compared at least so much: small changes tell little.
_SMALLEST_JUMP = 1.5
# The slowest that the pressure's error at a corner is taken to fall with h, and the divisions between two solves.
_CORNER_RATE, _CORNER_DIVISIONS = 0.25, 4
# Of the squared error at least half is refined, or there would be many meshes; and not much more than is worth it.
_BULK = (0.5, 0.75)


@dataclass(frozen=True)
class Solved:
    """A scene on one mesh.

    Attributes:
        solution: how it ended.
        task: the contact problem; None without one.
        level: what the mesh is worth; None where it has no solution.
        errors: what is estimated on the mesh; None where it has no solution.
    """

    solution: Solution
    task: Task | None
    level: LevelResult | None
    errors: Errors | None


def solve_to_accuracy(
    scene: Scene,
    goal: Accuracy,
    comm: MPI.Comm,
    solve_on: Callable[[Scene, ContactState | None, int], Solved],
    keep: Callable[[Solution], object],
    say: Callable[[str], object],
) -> Solution:
    """Refine the mesh, and raise gamma, until the estimated error is what is asked for or the budget ends.

    A refinement that the budget would not allow is not begun.

    Args:
        scene: with the mesh and the gamma to begin from.
        goal: what is asked for.
        comm: the ranks that share the work.
        solve_on: solves a scene on its mesh from a contact state, as the level of that number; collective.
        keep: called with the solution on each mesh but the last; collective.
        say: told what a user should know, such as that other elements than the scene's are used.
    """
    base_memory, begin = peak_memory(comm), time.perf_counter()
    meshes = Meshes(scene, goal, comm)
    if meshes.replaced:
        say(f"elements: {meshes.replaced}; accuracy.refinement = 'uniform' or 'adaptive' keeps those of the scene")
    rates = expected_rates(meshes.degree if meshes.adaptive else 1)
    levels: list[LevelResult] = []
    state: ContactState | None = None
    while True:
        before = time.perf_counter()
        solved = meshes.first(solve_on) if not levels else solve_on(meshes.scene, state, len(levels))
        solution, task, level = solved.solution, solved.task, solved.level
        if level is None or task is None:
            return replace(solution, levels=tuple(levels))
        state = solution.contact
        seconds = parallel.global_max(comm, time.perf_counter() - before + meshes.seconds)
        meshes.seconds = 0.0
        same_mesh = bool(levels) and levels[-1].dofs == level.dofs
        levels = [*levels[: len(levels) - same_mesh], replace(level, seconds=seconds)]
        rows = price_list(levels, base_memory, rates=rates, uniform=not meshes.adaptive) if len(levels) > 1 else []
        solution = replace(solution, levels=tuple(levels), price_list=tuple(rows))
        left = level.pressure_regularisation if goal.of == "pressure" else level.regularisation
        first = {"energy": level.energy, "pressure": level.pressure}
        estimate = getattr(rows[-2], goal.of) if rows else first.get(goal.of)
        error = inf if estimate is None else estimate * _SAFETY.get(goal.of, _UNSURE)
        enough = len(levels) >= _FEWEST_MESHES.get(goal.of, 3)
        if enough and error + left <= goal.target:
            return solution
        meshes.raise_gamma(task, level.regularisation, left / goal.target)
        allowed = goal.target * (1 - _REGULARISATION_SHARE)
        if not enough or error > allowed:
            excess = error / (goal.target - min(left, goal.target - allowed))
            jump = meshes.jump(excess, rates.get(goal.of) or _seen_rate(levels), compared=goal.of not in _FEWEST_MESHES)
            if enough:
                while jump > _SMALLEST_JUMP and _beyond(goal, comm, rows, base_memory, begin, jump):
                    jump = max(jump / 2, _SMALLEST_JUMP)
                if len(levels) >= _MOST_MESHES or _beyond(goal, comm, rows, base_memory, begin, jump):
                    return replace(solution, status=Status.BUDGET)
            keep(solution)
            meshes.refine(solved, excess, jump)
        elif task.data.gamma_n >= LARGEST_GAMMA * task.natural_gamma:
            return replace(solution, status=Status.BUDGET)


def _beyond(goal: Accuracy, comm: MPI.Comm, rows: list[Price], base_memory: float, begin: float, jump: float) -> bool:
    """Whether a mesh ``jump`` times finer would break the budget."""
    following = predict(rows[:-1], base_memory, finer=jump)
    spent = parallel.global_max(comm, time.perf_counter() - begin)
    late = goal.seconds is not None and spent + following.seconds > goal.seconds
    return late or (goal.memory is not None and following.memory > 1024 * goal.memory)


def _seen_rate(levels: list[LevelResult]) -> float:
    """How fast the error in the energy norm falls with h; of a single mesh, what the first order promises."""
    if len(levels) < 2 or not levels[-1].energy < levels[-2].energy:
        return 1.0
    finer = np.sqrt(levels[-1].dofs / levels[-2].dofs)
    return float(np.clip(np.log(levels[-2].energy / levels[-1].energy) / np.log(finer), 0.5, 2.0))


class Meshes:
    """One finer mesh after the other, and the scene on it.

    Attributes:
        scene: the scene on the mesh that is to be solved next.
        degree: of the displacement.
        adaptive: whether triangles are divided where the error is.
        replaced: what takes the place of the scene's elements; "": they stay.
        seconds: what the last refinement took; 0 where the mesh is made with the solve.
    """

    def __init__(self, scene: Scene, goal: Accuracy, comm: MPI.Comm) -> None:
        self._generated = isinstance(scene.mesh, MeshGenerator)
        if not self._generated:
            tagged = load_mesh(scene, comm)
            check_divisible(tagged)  # before hours have been spent on it as it is
            scene = scene.model_copy(update={"mesh": tagged})
        given = scene.element, scene.mesh
        scene, self.adaptive = _prepared(scene, goal)
        other = (scene.element, scene.mesh) != given
        how = "triangles divided where the error is" if self.adaptive else "all cells smaller"
        self.replaced = f"degree {scene.element.degree}, {how}" if other else ""
        self._given, self._comm = scene, comm
        self._of: Literal["energy", "pressure", "force"] = "force" if goal.of in ("zone", "peak") else goal.of
        self.degree = scene.element.degree
        self._coarsest, self._divisions = self._coarsest_factor(), 1
        self.seconds = 0.0
        self.scene = self._scene()

    def _coarsest_factor(self) -> float:
        """How many times larger the first cells are; a mesh that is no part of the scene's own would lose nodes of it.

        Where a load jumps a mesh needs a node, and the scene's own mesh is the one that has it.
        """
        factor = float(_COARSER[self.degree]) if self._generated else 1.0
        while factor > 1 and scene_on(scene_on(self._given, factor), 1 / factor) != scene_on(self._given, 1.0):
            factor /= 2
        return factor

    def first(self, solve_on: Callable[[Scene, ContactState | None, int], Solved]) -> Solved:
        """Solve on the coarsest mesh that has all the boundaries of the scene's own."""
        while True:
            try:
                return solve_on(self.scene, None, 0)
            except (SceneError, MeshError):
                if not self._generated or self._coarsest <= 1:
                    raise
            self._coarsest /= 2
            self.scene = self._scene()

    def jump(self, excess: float, rate: float, *, compared: bool) -> float:
        """How many times finer the next mesh is, for an error that is ``excess`` times too large."""
        if self.adaptive or not self._generated:
            return float(np.sqrt(2)) if self.adaptive else 2.0
        if excess == inf:
            return 2.0
        smallest = _SMALLEST_JUMP if compared else 1.0
        return float(np.clip(excess ** (1 / rate), smallest, _LARGEST_JUMP))

    def refine(self, solved: Solved, excess: float, jump: float) -> None:
        """Make the next mesh."""
        begin = time.perf_counter()
        if self.adaptive or not self._generated:
            cells = None
            if self.adaptive:
                assert solved.errors is not None
                squares = solved.errors.squares[self._of]
                cells = mark(self._comm, squares, float(np.clip(1 - excess**-2, *_BULK)))
            tagged = refine(solved.solution.discretisation.tagged, cells)
            if self._of == "pressure" and self.adaptive:
                tagged = self._divide_corners(tagged, solved, excess)
            self.scene = self.scene.model_copy(update={"mesh": tagged})
        else:
            # Whole multiples of the coarsest mesh keep its nodes, where loads may jump.
            self._divisions = max(ceil(self._divisions * jump - 1e-9), self._divisions + 1)
            mesh = self._scene().mesh
            self.scene = self.scene.model_copy(update={"mesh": mesh})
        self.seconds = time.perf_counter() - begin

    def _divide_corners(self, tagged: TaggedMesh, solved: Solved, excess: float) -> TaggedMesh:
        """Divide the cells at corners in contact several times, where they hold the error of the pressure.

        There it falls so slowly with h, and so few cells are divided, that a solve for each division would be a waste.
        """
        assert solved.level is not None
        corners = corners_of_error(solved.level.table)
        for _ in range(round(np.clip(np.log2(min(excess, 1e3)) / _CORNER_RATE - 1, 0, _CORNER_DIVISIONS))):
            if not len(corners):
                break
            tagged = refine(tagged, cells_at(tagged, corners))
        return tagged

    def raise_gamma(self, task: Task, left: float, excess: float) -> None:
        """Make gamma so large that the regularisation keeps to its share; its error falls like 1 / gamma.

        Path-following finds gamma itself: it is allowed less.

        Args:
            task: the contact problem on the last mesh.
            left: what its regularisation leaves, relative in the energy norm.
            excess: the same of what is asked for, relative to the target.
        """
        factor = excess / _REGULARISATION_SHARE
        if factor <= 1:
            return
        settings, data = self.scene.solver, task.data
        largest = LARGEST_GAMMA * task.natural_gamma
        update = {"gamma_n": min(data.gamma_n * factor, largest), "gamma_t": min(data.gamma_t * factor, largest)}
        if settings.algorithm == "path-following":
            allowed = inf if settings.regularisation_error == "auto" else settings.regularisation_error
            # With Coulomb friction its own figure is that of the start: halves, at least, come to an end.
            update = {"regularisation_error": min(allowed, left) / max(factor, 2.0)}
        solver = settings.model_copy(update=update)
        self.scene = self.scene.model_copy(update={"solver": solver})

    def _scene(self) -> Scene:
        """The scene on the mesh with the divisions that there are."""
        return scene_on(self._given, self._coarsest / self._divisions) if self._generated else self._given


def _prepared(scene: Scene, goal: Accuracy) -> tuple[Scene, bool]:
    """The scene with the elements that are to be used, and whether to refine where the error is.

    Raises:
        SceneError: cells on arcs are to be divided, which would converge to the solution on a polygon.
    """
    if goal.refinement == "adaptive" and isinstance(scene.mesh, MeshGenerator):
        name = scene.mesh.generator
        if triangle_parameters(name, scene.mesh.parameters) is None:
            message = f"the arcs of {name} would stay the polygon that they are on the first mesh: use 'uniform'"
            raise SceneError([("accuracy.refinement", message)])
    if goal.refinement != "auto":
        return scene, goal.refinement == "adaptive"
    # The other estimates compare meshes point by point, which those that differ from place to place do not bear well.
    if goal.of not in ("energy", "pressure", "force"):
        return scene, False
    element = scene.element.model_copy(update={"degree": 2})
    if isinstance(scene.mesh, MeshGenerator):
        parameters = triangle_parameters(scene.mesh.generator, scene.mesh.parameters)
        divided = parameters is not None
        if parameters is None:  # arcs: cells of degree 2 on them, and all of them smaller
            parameters = curved_parameters(scene.mesh.generator, scene.mesh.parameters)
        if parameters is None:
            return scene, False
        mesh = MeshGenerator(generator=scene.mesh.generator, parameters=parameters)
        return scene.model_copy(update={"mesh": mesh, "element": element}), divided
    return scene.model_copy(update={"element": element}), True
