"""A ``ContactProblem`` on one mesh after the other: nested iteration, and solution to a given accuracy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from dolfinx import fem
from dolfinx import mesh as dmesh

from signorini_fx.accuracy.error_estimates import Errors
from signorini_fx.accuracy.mesh_level import LevelResult
from signorini_fx.accuracy.plan import refuse_adaptive_peak
from signorini_fx.accuracy.pressure_error import polygon_error
from signorini_fx.accuracy.price_list import Price
from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.contact_table import ContactTable, contact_table
from signorini_fx.body.foundation import Pair
from signorini_fx.body.mesh_levels import MeshLevel
from signorini_fx.errors import FormError, SceneError
from signorini_fx.forms.contact_problem import ContactProblem
from signorini_fx.forms.steps import Clock, SolvedPath
from signorini_fx.mesh.refinement import check_divisible, refine
from signorini_fx.mesh.tagged import TaggedMesh, tag_boundaries
from signorini_fx.records import History, Observer, Status, Timings
from signorini_fx.results.checkpoint import Checkpoint
from signorini_fx.results.solution import ConvergenceError, StepResult
from signorini_fx.scene.load_steps import LoadPath
from signorini_fx.scene.settings import Accuracy, SolverSettings
from signorini_fx.scene.values import kind_of
from signorini_fx.solving import nested, to_accuracy
from signorini_fx.solving.finer_meshes import Meshes
from signorini_fx.solving.first_start import CoarserMesh
from signorini_fx.solving.meshed_problem import SolvedMesh, measured
from signorini_fx.solving.restart import MeshCheckpoint

if TYPE_CHECKING:
    from signorini_fx.accuracy.next_digit import CostOfAccuracy
    from signorini_fx.quantities.statements import ErrorBound

AnyMesh: TypeAlias = "dmesh.Mesh | TaggedMesh"
Make = Callable[[Any], Any]


@dataclass(frozen=True, repr=False)
class SolvedMeshes:
    """How a ``ContactProblem`` has ended on the last of several meshes.

    Attributes:
        problem: on this mesh, at its last load step.
        path: its load steps.
        status: how it ended; only ``Status.CONVERGED`` is a solution, with the accuracy that was asked for.
        levels: errors and cost of each mesh, the coarsest first; empty without ``stress``.
        price_list: the same with what is expected of the next mesh; empty with fewer than two levels.
        accuracy: that was asked for; None: none was.
    """

    problem: ContactProblem
    path: SolvedPath
    status: Status
    levels: tuple[LevelResult, ...] = ()
    price_list: tuple[Price, ...] = ()
    accuracy: Accuracy | None = None

    def __repr__(self) -> str:
        return f"<SolvedMeshes: {self.status.value}, {len(self.levels)} meshes, {self.problem._elastic.dofs} unknowns>"

    @property
    def converged(self) -> bool:
        """Whether this is a solution with the accuracy that was asked for."""
        return self.status is Status.CONVERGED

    @property
    def displacement(self) -> fem.Function:
        """After the last load step with a solution."""
        return self.path.last_step.displacement

    @property
    def history(self) -> History:
        """Of all meshes."""
        return self.path.history

    @property
    def timings(self) -> Timings:
        """Of the last mesh."""
        return self.path.timings

    @property
    def steps(self) -> tuple[StepResult, ...]:
        """One result for each load step."""
        return self.path.steps

    @cached_property
    def table(self) -> ContactTable:
        """The contact boundary of all ranks after the last load step with a solution; collective."""
        state = self.path.last_step.contact
        assert state is not None
        return contact_table(state, self.problem._names)

    @property
    def error_bound(self) -> ErrorBound | str | None:
        """A guaranteed bound of the error of the last mesh, or why there is none, see ``Solution``; collective."""
        return self.problem.error_bound

    @property
    def cost(self) -> CostOfAccuracy | str:
        """What the accuracy took and what a better one would take, see ``Solution``; collective."""
        solution = self.problem.solution
        asked = replace(solution.model, statement=replace(solution.statement, accuracy=self.accuracy))
        return replace(solution, model=asked, price_list=self.price_list).cost

    def outcome(self) -> str:
        """How the last mesh ended, and what to do."""
        if self.path.converged:
            return f"{self.status.value}: {self.history.advice(self.status)}"
        return self.path.outcome()


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
        problem.history = self.history
        if self.changed is not None:
            problem.settings = self.changed
            problem._foundations.check_driven(self.changed.algorithm)
        return problem, Clock((lambda time: None) if at is None else at)

    @property
    def problem(self) -> ContactProblem:
        """On this mesh; collective."""
        return self.made[0]

    @property
    def settings(self) -> SolverSettings:
        """See ``MeshedProblem``."""
        return self.problem.settings

    @property
    def degree(self) -> int:
        """See ``MeshedProblem``."""
        return int(self.problem._space.element.basix_element.degree)

    @property
    def paired(self) -> bool:
        """See ``MeshedProblem``."""
        return any(isinstance(contact, Pair) for contact in self.problem.contact)

    @property
    def estimable(self) -> bool:
        """Whether its errors can be estimated."""
        unweighted = all(getattr(contact, "measure", None) is None for contact in self.problem.contact)
        return self.problem._law is not None and unweighted

    @property
    def may_begin_finer(self) -> bool:
        """The first mesh is the user's."""
        return False

    def beginning_finer(self) -> FormMesh:
        """See ``may_begin_finer``."""
        return self

    def keeping(self, solved: SolvedMesh[SolvedMeshes]) -> FormMesh:
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
        return polygon_error(level.table, self.problem._scales.modulus) if last is None else last

    def solved(self, number: int, state: ContactState | None, coarser: MeshLevel | None) -> SolvedMesh[SolvedMeshes]:
        """See ``MeshedProblem``."""
        problem, clock = self.made
        problem._coarser = CoarserMesh(coarser, state, None if self.path.several else coarser)

        def solve(step_errors: list[Errors]) -> SolvedMesh[SolvedMeshes]:
            def estimate(result: StepResult) -> None:
                if self.estimable:
                    step_errors.append(problem.errors)

            checkpoint = None if self.stored is None else MeshCheckpoint(self.stored, number)
            path = problem._run(self.path, clock, estimate, checkpoint)
            solution = SolvedMeshes(problem, path, path.status)
            return SolvedMesh(solution, self.tagged, problem._elastic, problem._task, problem._outcome)

        return measured(number, self.history, self.tagged.mesh.comm, solve)


def solve_nested(
    make: Make,
    mesh: AnyMesh | Callable[[int], AnyMesh],
    levels: int = 3,
    *,
    path: LoadPath | Sequence[float] | None = None,
    observers: Sequence[Observer] = (),
    on_level: Callable[[SolvedMeshes], object] = lambda solution: None,
    folder: str | Path | None = None,
    restart: bool = False,
) -> SolvedMeshes:
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
        first = replace(first, stored=first.problem._checkpoint_in(folder, first.path, restart=restart))

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
    on_level: Callable[[SolvedMeshes], object] = lambda solution: None,
) -> SolvedMeshes:
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
    try:
        refuse_adaptive_peak(accuracy)
    except SceneError as error:
        raise FormError(error.problems, "solve_to_accuracy") from None
    budget = to_accuracy.Budget.begins(accuracy, comm, first.history)
    meshes = Meshes(first, accuracy, comm, adaptive=adaptive, made=made, any_jump=made)
    solution = to_accuracy.solve_to_accuracy(meshes, budget, first.history, on_level)
    return _checked(replace(solution, accuracy=accuracy))


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


def _checked(solution: SolvedMeshes) -> SolvedMeshes:
    if not solution.converged:
        raise ConvergenceError(solution, solution.outcome())
    return solution
