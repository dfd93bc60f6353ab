"""The meshes on the way to an accuracy: the coarsest one, each finer one after it, and the scene on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, inf

import numpy as np
from mpi4py import MPI

from signorini_fx import parallel
from signorini_fx.accuracy.error_estimates import Errors
from signorini_fx.accuracy.mesh_level import LevelResult
from signorini_fx.accuracy.plan import LOCAL, planned
from signorini_fx.accuracy.pressure_error import corners_of_error
from signorini_fx.accuracy.price_list import fineness_of
from signorini_fx.algorithms.task import Outcome, Task
from signorini_fx.body.contact_state import ContactState
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.mesh.hierarchy import scene_on, with_halved_bodies
from signorini_fx.mesh.refinement import cells_at, mark, refine
from signorini_fx.mesh.tagged import TaggedMesh, load_file
from signorini_fx.results.solution import Solution
from signorini_fx.scene.model import MeshFile, Scene
from signorini_fx.scene.settings import Accuracy
from signorini_fx.tuned import (
    BULK,
    COARSER_START,
    CORNER_DIVISIONS,
    CORNER_RATE,
    LARGEST_GAMMA,
    LARGEST_JUMP,
    REGULARISATION_SHARE,
    SMALLEST_JUMP,
)


@dataclass(frozen=True)
class SolvedMesh:
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
        self._original_scene: Scene = self._plan.scene
        self.adaptive: bool = self._plan.adaptive
        self.polygonal: bool = self._plan.polygonal
        how = "triangles divided where the error is" if self.adaptive else "all cells smaller"
        self._regularised = self._original_scene
        settings = self._original_scene.solver
        automatic = (settings.algorithm, settings.gamma_n, settings.gamma_t) == ("auto", "auto", "auto")
        paired = scene.sides[1] is not None
        if (goal.of == "pressure" or goal.certified) and automatic and not paired:
            # The regularisation smears the pressure at a corner over a length that hardly depends on the mesh.  Between
            # two bodies "exact" is not possible.
            solver = settings.model_copy(update={"algorithm": "exact"})
            self._original_scene = self._original_scene.model_copy(update={"solver": solver})
        self.degree: int = self._original_scene.element.degree
        self.replaced: str = f"degree {self.degree}, {how}" if self._plan.replaced else ""
        self._generated = self._original_scene.generated
        self.any_jump: bool = self._generated and not self.adaptive
        self._file = self._original_scene.mesh if isinstance(self._original_scene.mesh, MeshFile) else None
        self._coarsest, self._divisions, self._halvings = self._coarsest_factor(), 1, 0
        self.seconds: float = 0.0
        self.scene: Scene = self._scene()

    def _coarsest_factor(self) -> float:
        """How many times larger the first cells are; the coarse nodes must be nodes of the scene's own mesh.

        A mesh needs a node where a load jumps, and the scene's own mesh has one.
        """
        factor = float(COARSER_START[self.degree]) if self._generated else 1.0
        while factor > 1 and scene_on(scene_on(self._original_scene, factor), 1 / factor) != scene_on(
            self._original_scene, 1.0
        ):
            factor /= 2
        return factor

    def keep_sides(self, solved: Scene) -> None:
        """Leave the contact points of pairs on the sides that were chosen on the first mesh: forces have their sign."""
        if solved.sides[1] is None:
            return
        contacts = [
            model if model.against is None else model.model_copy(update={"points": "boundary"})
            for model in solved.contact
        ]
        update = {"contact": tuple(contacts)}
        self.scene, self._original_scene, self._regularised = (
            model.model_copy(update=update) for model in (self.scene, self._original_scene, self._regularised)
        )

    def first(self, solve_on: Callable[[Scene, ContactState | None, int], SolvedMesh]) -> SolvedMesh:
        """Solve on the coarsest mesh that has all boundaries of the scene's own mesh.

        Straight facets of two bodies that fit each other may be so far apart on it that there is no solution.
        """
        while True:
            try:
                solved = solve_on(self.scene, None, 0)
                apart = (
                    solved.level is None
                    and self._original_scene.sides[1] is not None
                    and not solved.solution.history.late
                )
                if not apart or not self._generated or self._coarsest <= 1:
                    return solved
            except (SceneError, MeshError):
                if not self._generated or self._coarsest <= 1:
                    raise
            self._coarsest /= 2
            self.scene = self._scene()

    def solve(
        self,
        solve_on: Callable[[Scene, ContactState | None, int], SolvedMesh],
        state: ContactState | None,
        number: int,
    ) -> SolvedMesh:
        """Solve on the current mesh; with regularisation if the scene leaves it open and nothing else works."""
        if self._original_scene.solver == self._regularised.solver:
            return self.first(solve_on) if number == 0 else solve_on(self.scene, state, number)
        try:
            solved = self.first(solve_on) if number == 0 else solve_on(self.scene, state, number)
            if solved.level is not None or solved.task is None or solved.solution.history.late:
                return solved
        except SceneError:
            solved = None
        self._original_scene = self._regularised
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

    def refine(self, solved: SolvedMesh, excess: float, jump: float) -> None:
        """Make the next mesh."""
        begin = parallel.clock(self._comm)
        if self._file is not None or (self._original_scene.body and not self._generated):
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

    def _divide_corners(self, tagged: TaggedMesh, solved: SolvedMesh, excess: float) -> TaggedMesh:
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

    def raise_gamma(self, task: Task, outcome: Outcome, regularisation_error: float, excess: float) -> None:
        """Make gamma so large that the regularisation error keeps to its share; it decreases like 1 / gamma.

        Path-following finds gamma itself: its allowed error is reduced.

        Args:
            task: the contact problem on the last mesh.
            outcome: how it ended.
            regularisation_error: its regularisation error, relative in the energy norm.
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
            update = {"regularisation_error": min(allowed, regularisation_error) / max(factor, 2.0)}
        solver = settings.model_copy(update=update)
        self.scene = self.scene.model_copy(update={"solver": solver})

    def _change_meshes(self) -> None:
        """Give the scene the mesh, or the bodies, with the current divisions."""
        made = self._scene()
        self.scene = self.scene.model_copy(update={"mesh": made.mesh, "body": made.body})

    def _scene(self) -> Scene:
        """The scene on the mesh with the current divisions."""
        if self._file is not None:
            scene, halvings, degree = self._original_scene, self._halvings, self._plan.geometry
            tagged = load_file(self._file, self._comm, halvings, degree, scene.sections, scene.touching)
            return self._original_scene.model_copy(update={"mesh": tagged})
        if self._generated:
            return scene_on(self._original_scene, self._coarsest / self._divisions)
        return (
            with_halved_bodies(self._original_scene, self._halvings, self._comm)
            if self._original_scene.body
            else self._original_scene
        )
