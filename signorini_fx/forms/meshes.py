"""A ``ContactProblem`` on one mesh after the other: nested iteration, and solution to a given accuracy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from dolfinx import mesh as dmesh

from signorini_fx.errors import FormError
from signorini_fx.forms.contact_problem import ContactProblem
from signorini_fx.forms.results import solution_of
from signorini_fx.forms.solver import FormSolver
from signorini_fx.forms.steps import Clock, checkpoint_of, solve_path
from signorini_fx.mechanics.body.contact_state import ContactState
from signorini_fx.mechanics.body.foundation import Pair
from signorini_fx.mechanics.body.mesh_levels import MeshLevel
from signorini_fx.mechanics.mesh.refinement import check_divisible, refine
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, tag_boundaries
from signorini_fx.mechanics.statement.load_steps import LoadPath
from signorini_fx.mechanics.statement.settings import Accuracy, SolverSettings
from signorini_fx.mechanics.statement.values import kind_of
from signorini_fx.records import History, Observer
from signorini_fx.results.accuracy.error_estimates import Errors
from signorini_fx.results.accuracy.mesh_level import LevelResult
from signorini_fx.results.accuracy.pressure_error import polygon_error
from signorini_fx.results.checkpoint import Checkpoint
from signorini_fx.results.solution import ConvergenceError, Solution, StepResult
from signorini_fx.solving import nested, to_accuracy
from signorini_fx.solving.finer_meshes import Meshes
from signorini_fx.solving.first_start import CoarserMesh
from signorini_fx.solving.meshed_problem import SolvedMesh, measured
from signorini_fx.solving.restart import MeshCheckpoint

if TYPE_CHECKING:
    pass

AnyMesh: TypeAlias = "dmesh.Mesh | TaggedMesh"
Make = Callable[[Any], Any]


@dataclass(frozen=True)
class FormMesh:
    """A ``ContactProblem`` on one of several meshes, see ``MeshedProblem``.

    Attributes:
        make: makes it on a mesh; with load steps, and what changes it to what it is at a time.
        family: makes a mesh with cells so many times as small as those of the first one; None: its cells are divided.
        tagged: the mesh.
        plain: whether ``make`` takes a mesh of dolfinx.
        path: the load steps.
        history: of all meshes.
        stored: the checkpoint; None: there is none.
        changed: how it is solved, in place of what ``make`` says; None: as it says.
    """

    make: Make
    family: Callable[[int], AnyMesh] | None
    tagged: TaggedMesh
    plain: bool
    path: LoadPath
    history: History
    stored: Checkpoint | None = None
    changed: SolverSettings | None = None

    @cached_property
    def made(self) -> tuple[ContactProblem, Clock]:
        """The problem on this mesh, and what changes it to what it is at a time; collective.

        Raises:
            FormError: ``make`` returns something else.
        """
        result = self.make(self.tagged.mesh if self.plain else self.tagged)
        problem, at = result if isinstance(result, tuple) and len(result) == 2 else (result, None)
        if not isinstance(problem, ContactProblem):
            raise FormError([("make", f"must return a ContactProblem, not {kind_of(problem)}")], "make")
        if (at is None) is self.path.several:
            wanted = "(problem, at), as run takes at" if self.path.several else "the problem alone without a path"
            raise FormError([("make", f"must return {wanted}")], "make")
        solver = problem.assembled
        solver.history = self.history
        if self.changed is not None:
            solver.settings = self.changed
            solver.foundations.check_driven(self.changed.algorithm)
        return problem, Clock((lambda time: None) if at is None else at)

    @property
    def problem(self) -> ContactProblem:
        """On this mesh; collective."""
        return self.made[0]

    @property
    def solver(self) -> FormSolver:
        """Of this problem; collective."""
        return self.problem.assembled

    @property
    def settings(self) -> SolverSettings:
        """See ``MeshedProblem``."""
        return self.problem.settings

    @property
    def degree(self) -> int:
        """See ``MeshedProblem``."""
        return int(self.solver.space.element.basix_element.degree)

    @property
    def paired(self) -> bool:
        """See ``MeshedProblem``."""
        return any(isinstance(contact, Pair) for contact in self.problem.contact)

    @property
    def estimable(self) -> bool:
        """Whether its errors can be estimated."""
        forms = self.solver.forms
        return forms.stress is not None and not forms.weighted

    @property
    def may_begin_finer(self) -> bool:
        """The first mesh is the user's."""
        return False

    def beginning_finer(self) -> FormMesh:
        """See ``may_begin_finer``."""
        return self

    def keeping(self, solved: SolvedMesh) -> FormMesh:
        """The contact points stay where ``make`` puts them."""
        return self

    def with_settings(self, settings: SolverSettings) -> FormMesh:
        """See ``MeshedProblem``."""
        return replace(self, changed=settings)

    def divided(self, times: int) -> FormMesh:
        """See ``MeshedProblem``."""
        assert self.family is not None
        return self.on(_tagged(self.family(times)))

    def on(self, tagged: TaggedMesh) -> FormMesh:
        """See ``MeshedProblem``."""
        return replace(self, tagged=tagged)

    def halved(self) -> FormMesh:
        """On cells half as large, all of them divided; collective."""
        return self.on(refine(self.tagged))

    def polygon_error(self, level: LevelResult, last: float | None) -> float:
        """See ``MeshedProblem``."""
        if self.family is not None:
            return 0.0
        return polygon_error(level.table, self.solver.scales.modulus) if last is None else last

    def solved(self, number: int, state: ContactState | None, coarser: MeshLevel | None) -> SolvedMesh:
        """See ``MeshedProblem``."""
        problem, clock = self.made
        problem.assembled.coarser = CoarserMesh(coarser, state, None if self.path.several else coarser)

        def solve(step_errors: list[Errors]) -> SolvedMesh:
            def estimate(result: StepResult) -> None:
                if self.estimable:
                    step_errors.append(problem.errors)

            checkpoint = None if self.stored is None else MeshCheckpoint(self.stored, number)
            solver = problem.assembled
            progress = solve_path(solver, self.path, clock, estimate, checkpoint)
            solution = solution_of(solver, self.path, progress)
            return SolvedMesh(solution, self.tagged, solver.elastic, solver.task, solver.outcome)

        return measured(number, self.history, self.tagged.mesh.comm, solve)


def solve_nested(
    make: Make,
    mesh: AnyMesh | Callable[[int], AnyMesh],
    levels: int = 3,
    *,
    path: LoadPath | Sequence[float] | None = None,
    observers: Sequence[Observer] = (),
    on_level: Callable[[Solution], object] = lambda solution: None,
    folder: str | Path | None = None,
    restart: bool = False,
) -> Solution:
    """Solve a problem on nested meshes, each starting from the solution on the one before; collective.

        solution = solve_nested(make, mesh)
        print(solution.price_list[-2].pressure)

    With ``stress`` the errors on each mesh are estimated.

    Args:
        make: a function of a mesh that returns a ``ContactProblem``; with ``path``, a pair of it and of ``at``, see
            ``ContactProblem.run``.
        mesh: the coarsest mesh, whose triangles or tetrahedra are divided, of dolfinx or with named boundaries, as
            ``make`` takes it; or a function of n that makes a mesh with cells n times as small as those of n = 1.
        levels: how many meshes, each with cells half as large as the one before.
        path: the load steps on each mesh; None: a single one.
        observers: see ``solve``.
        on_level: called with the solution on each mesh but the last.
        folder: see ``ContactProblem.run``.
        restart: see ``ContactProblem.run``.

    Raises:
        ConvergenceError: there is no solution; its ``solution`` has the last iterate.
        FormError: an argument is wrong; see also ``ContactProblem``.
        MeshError: the cells cannot be divided.
    """
    if not isinstance(levels, int) or levels < 1:
        raise FormError([("levels", f"must be a whole number from 1, got {levels!r}")], "solve_nested")
    if restart and folder is None:
        raise FormError([("restart", "needs the folder of the checkpoint")], "solve_nested")
    first = _first(make, mesh, path, observers)
    if folder is not None:
        first = replace(first, stored=checkpoint_of(first.solver, folder, first.path, restart=restart))

    def problems() -> Any:
        problem = first
        for number in range(levels):
            if number > 0:
                problem = problem.halved() if problem.family is None else problem.divided(2**number)
            yield problem

    return _checked(nested.solve_nested(problems(), levels, first.tagged.mesh.comm, first.history, on_level))


def solve_to_accuracy(
    make: Make,
    mesh: AnyMesh | Callable[[int], AnyMesh],
    accuracy: Accuracy,
    *,
    path: LoadPath | Sequence[float] | None = None,
    observers: Sequence[Observer] = (),
    on_level: Callable[[Solution], object] = lambda solution: None,
) -> Solution:
    """Solve a problem on finer and finer meshes until the estimated error is what was asked for; collective.

        solution = solve_to_accuracy(make, mesh, Accuracy(target="1%", of="peak"))

    Cells are divided where the error is with ``refinement="adaptive"``, otherwise everywhere.  The elements stay.

    Args:
        make: see ``solve_nested``; its problems need ``stress``.
        mesh: see ``solve_nested``.
        accuracy: the accuracy.
        path: see ``solve_nested``.
        observers: see ``solve``.
        on_level: called with the solution on each mesh but the last.

    Raises:
        ConvergenceError: there is no solution, or the accuracy is not reached; its ``solution`` has the last mesh.
        FormError: an argument is wrong; see also ``ContactProblem``.
        MeshError: the cells cannot be divided.
    """
    first = _first(make, mesh, path, observers)
    adaptive, made, comm = accuracy.refinement == "adaptive", first.family is not None, first.tagged.mesh.comm
    wrong = []
    if not first.estimable:
        wrong.append(("stress", "is needed for an accuracy: errors are estimated from stresses, without a measure"))
    if accuracy.certified:
        wrong.append(("accuracy.certified", "is for scenes: ask the result for error_bound"))
    if adaptive and made:
        wrong.append(("accuracy.refinement", "'adaptive' divides cells: give the coarsest mesh, not a function"))
    if adaptive and first.paired:
        wrong.append(("accuracy.refinement", "two bodies show their error on one side only: use 'uniform'"))
    if wrong:
        raise FormError(wrong, "solve_to_accuracy")
    budget = to_accuracy.Budget.begins(accuracy, comm, first.history)
    meshes = Meshes(first, accuracy, comm, adaptive=adaptive, made=made, any_jump=made)
    solution = to_accuracy.solve_to_accuracy(meshes, budget, first.history, on_level)
    asked = replace(solution.model, statement=replace(solution.statement, accuracy=accuracy))
    return _checked(replace(solution, model=asked))


def _first(
    make: Make,
    mesh: AnyMesh | Callable[[int], AnyMesh],
    path: LoadPath | Sequence[float] | None,
    observers: Sequence[Observer],
) -> FormMesh:
    """The problem on the coarsest mesh; collective."""
    family = mesh if callable(mesh) else None
    coarsest = mesh(1) if callable(mesh) else mesh
    tagged = _tagged(coarsest)
    if family is None:
        check_divisible(tagged)
    steps = LoadPath((0.0,)) if path is None else path if isinstance(path, LoadPath) else LoadPath(tuple(path))
    history = History(observers=list(observers))
    return FormMesh(make, family, tagged, not isinstance(coarsest, TaggedMesh), steps, history)


def _tagged(mesh: Any) -> TaggedMesh:
    """A mesh with names of boundaries, which one of dolfinx has none of.

    Raises:
        FormError: it is no mesh.
    """
    if isinstance(mesh, TaggedMesh):
        return mesh
    if not isinstance(mesh, dmesh.Mesh):
        raise FormError([("mesh", f"must be a mesh, a TaggedMesh, or a function that makes one, not {kind_of(mesh)}")])
    return tag_boundaries(mesh, {})


def _checked(solution: Solution) -> Solution:
    if not solution.converged:
        raise ConvergenceError(solution)
    return solution
