"""A ``ContactProblem`` on a sequence of meshes: nested iteration, and solution to an accuracy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self, TypeAlias

from dolfinx import mesh as dmesh

from signorini_fx.errors import FormError
from signorini_fx.forms.contact_problem import ContactProblem
from signorini_fx.forms.solver import FormSolver, solve_now
from signorini_fx.forms.steps import converged
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.mesh.refinement import check_divisible, refine
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, tag_boundaries
from signorini_fx.mechanics.rigid.mesh_levels import MeshLevel
from signorini_fx.mechanics.statement.settings import Accuracy, SolverSettings
from signorini_fx.mechanics.statement.values import kind_of
from signorini_fx.records import History, Observer
from signorini_fx.results.solution import Solution
from signorini_fx.solving import meshed_problem, to_accuracy
from signorini_fx.solving.restart import StoredStates

if TYPE_CHECKING:
    from collections.abc import Iterator

AnyMesh: TypeAlias = "dmesh.Mesh | TaggedMesh"
Make = Callable[[Any], Any]


@dataclass(frozen=True, kw_only=True)
class MeshedForms(meshed_problem.MeshedProblem):
    """A ``ContactProblem`` on one mesh of a sequence.

    Attributes:
        make: the user's function that makes the problem on a mesh.
        tagged: the mesh with names of boundaries.
        plain: whether ``make`` takes the mesh of dolfinx instead.
        family: the user's function of n that makes a mesh with cells n times smaller; None: cells
            are divided.
        changed: settings in place of those of the problem; None: they stay.
    """

    make: Make
    tagged: TaggedMesh
    plain: bool
    family: Callable[[int], AnyMesh] | None
    changed: SolverSettings | None = None

    @cached_property
    def made(self) -> ContactProblem:
        """The problem on this mesh; collective."""
        problem = self.make(self.tagged.mesh if self.plain else self.tagged)
        if not isinstance(problem, ContactProblem):
            raise FormError.at(
                "make", f"must return a ContactProblem, not {kind_of(problem)}", "make"
            )
        if not problem.contact:
            raise FormError.at(
                "make",
                "must return a problem with contact; others need no sequence of meshes",
                "make",
            )
        if self.changed is not None:
            problem.assembled.settings = self.changed
        problem.assembled.history = self.history
        return problem

    @property
    def solver(self) -> FormSolver:
        """The solver of this problem; collective."""
        return self.made.assembled

    @property
    def estimable(self) -> bool:
        """Whether errors can be estimated: there is a stress, and no measure."""
        return self.solver.forms.stress is not None and not self.solver.forms.measures

    @property
    def augmentable(self) -> bool:
        return all(contact.against is None for contact in self.solver.contact)

    @property
    def settings(self) -> SolverSettings:
        return self.solver.settings

    def with_settings(self, settings: SolverSettings) -> Self:
        return replace(self, changed=settings)

    def on(self, tagged: TaggedMesh) -> Self:
        return replace(self, tagged=tagged)

    def divided(self, times: int) -> Self:
        assert self.family is not None
        return self.on(_tagged(self.family(times)))

    def solve(
        self, state: ContactState | None, coarser: MeshLevel | None, checkpoint: StoredStates | None
    ) -> meshed_problem.SolvedMesh:
        solver = self.solver
        solver.coarser = coarser
        solver.coarser_state = state
        unsolved = solve_now(solver)
        errors = [self.made.errors] if self.estimable and not unsolved else []
        assert solver.report is not None
        solved = self.made.solution, self.tagged, solver.task, solver.report.outcome
        return meshed_problem.SolvedMesh(*solved, step_errors=errors)


def solve_nested(
    make: Make,
    mesh: AnyMesh | Callable[[int], AnyMesh],
    levels: int = 3,
    *,
    observers: Sequence[Observer] = (),
) -> Solution:
    """Solve a problem on nested meshes, on each starting from the solution on the previous one;
    collective.

        solution = solve_nested(make, mesh)
        print(solution.convergence_table[-2].pressure)

    With ``stress`` the errors on each mesh are estimated.

    Args:
        make: a function of a mesh that returns a ``ContactProblem``.
        mesh: the coarsest mesh of triangles or tetrahedra, which are divided, either a mesh of
            dolfinx or a ``TaggedMesh``, whichever ``make`` takes; or a function of n that makes a
            mesh with cells n times smaller than for n = 1.
        levels: number of meshes; each halves the cell size of the previous one.
        observers: see ``solve``.

    Raises:
        ConvergenceError: there is no solution; the ``solution`` of the error is the last iterate.
        FormError: an argument is wrong; see also ``ContactProblem``.
        MeshError: the cells cannot be divided.

    Examples:
        >>> def make(mesh):
        ...     V = fem.functionspace(mesh.mesh, ("Lagrange", 1, (2,)))
        ...     u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
        ...     a, L = ufl.inner(ufl.grad(u), ufl.grad(v)) * ufl.dx, -0.01 * v[1] * ufl.dx
        ...     rough = sfx.Foundation(mesh.facets("bottom"), friction=sfx.Coulomb(0.3))
        ...     return sfx.ContactProblem(a, L, contact=rough, stress=ufl.grad)
        >>> size = {"nx": 4, "ny": 2, "cell": "triangle"}
        >>> mesh = sfx.generate_mesh("rectangle", size, MPI.COMM_WORLD)
        >>> print([row.dofs for row in sfx.solve_nested(make, mesh, levels=2).convergence_table])
        [30, 90, 270]
    """
    if not isinstance(levels, int) or levels < 1:
        raise FormError.at(
            "levels", f"must be a whole number from 1, got {levels!r}", "solve_nested"
        )
    first = _first(make, mesh, observers)

    def problems() -> Iterator[MeshedForms]:
        problem = first
        for number in range(levels):
            if number > 0:
                problem = (
                    problem.divided(2**number)
                    if callable(mesh)
                    else problem.on(refine(problem.tagged))
                )
            yield problem

    return converged(meshed_problem.solve_nested(problems(), levels, first.comm, first.history))


def solve_to_accuracy(
    make: Make,
    mesh: AnyMesh | Callable[[int], AnyMesh],
    accuracy: Accuracy,
    *,
    observers: Sequence[Observer] = (),
) -> Solution:
    """Solve a problem on finer and finer meshes until the estimated error meets the accuracy;
    collective.

        solution = solve_to_accuracy(make, mesh, Accuracy(target="1%", of="peak"))

    With ``refinement="adaptive"`` cells are divided where the error is large, otherwise everywhere.
    The element degree stays the same.

    Args:
        make: see ``solve_nested``; its problems need ``stress``.
        mesh: see ``solve_nested``.
        accuracy: the required accuracy.
        observers: see ``solve``.

    Raises:
        ConvergenceError: there is no solution, or the accuracy is not reached; the ``solution`` of
            the error is that on the last mesh.
        FormError: an argument is wrong; see also ``ContactProblem``.
        MeshError: the cells cannot be divided.

    Examples:
        >>> def make(mesh):
        ...     V = fem.functionspace(mesh.mesh, ("Lagrange", 1, (2,)))
        ...     u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
        ...     a, L = ufl.inner(ufl.grad(u), ufl.grad(v)) * ufl.dx, -0.01 * v[1] * ufl.dx
        ...     rough = sfx.Foundation(mesh.facets("bottom"), friction=sfx.Coulomb(0.3))
        ...     return sfx.ContactProblem(a, L, contact=rough, stress=ufl.grad)
        >>> size = {"nx": 4, "ny": 2, "cell": "triangle"}
        >>> mesh = sfx.generate_mesh("rectangle", size, MPI.COMM_WORLD)
        >>> table = sfx.solve_to_accuracy(make, mesh, sfx.Accuracy(target=0.2)).convergence_table
        >>> print(table[-2].energy < 0.2, [row.dofs for row in table][:1])
        True [30]
    """
    first = _first(make, mesh, observers)
    adaptive = accuracy.refinement == "adaptive"
    made = callable(mesh)
    wrong = []
    if not first.estimable:
        wrong.append(
            (
                "stress",
                "is needed for an accuracy: errors are estimated from stresses, without a measure",
            )
        )
    if adaptive and made:
        wrong.append(
            (
                "accuracy.refinement",
                "'adaptive' divides cells: give the coarsest mesh, not a function",
            )
        )
    if adaptive and not first.augmentable and accuracy.of != "energy":
        message = (
            "two bodies show the error of contact on one side only: use 'uniform', or of='energy'"
        )
        wrong.append(("accuracy.refinement", message))
    if wrong:
        raise FormError(wrong, "solve_to_accuracy")
    budget = to_accuracy.Budget.begins(accuracy, first.comm, first.history)
    meshes = to_accuracy.Meshes(first, accuracy, adaptive=adaptive, made=made, any_jump=made)
    solution = to_accuracy.solve_to_accuracy(meshes, budget)
    asked = replace(solution.statement, accuracy=accuracy)
    return converged(replace(solution, mechanics=replace(solution.mechanics, statement=asked)))


def _first(
    make: Make,
    mesh: AnyMesh | Callable[[int], AnyMesh],
    observers: Sequence[Observer],
) -> MeshedForms:
    """Return the problem on the coarsest mesh; collective."""
    coarsest = mesh(1) if callable(mesh) else mesh
    tagged = _tagged(coarsest)
    if not callable(mesh):
        check_divisible(tagged)
    return MeshedForms(
        comm=tagged.mesh.comm,
        history=History(observers=list(observers)),
        polygonal=not callable(mesh),
        make=make,
        tagged=tagged,
        plain=not isinstance(coarsest, TaggedMesh),
        family=mesh if callable(mesh) else None,
    )


def _tagged(mesh: AnyMesh) -> TaggedMesh:
    """Return the mesh as a ``TaggedMesh``; a mesh of dolfinx has no named boundaries."""
    if isinstance(mesh, TaggedMesh):
        return mesh
    if not isinstance(mesh, dmesh.Mesh):
        raise FormError.at(
            "mesh",
            f"must be a mesh, a TaggedMesh, or a function that makes one, not {kind_of(mesh)}",
        )
    return tag_boundaries(mesh, {})
