"""A problem on a sequence of meshes, for nested iteration and for a requested accuracy.

In nested iteration a node of the fine mesh starts in the active set of its coarse neighbours, so
that only a few linear solves remain on the fine mesh.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

from signorini_fx.algebra.algorithms.task import Outcome, Task
from signorini_fx.algebra.linalg.choice import krylov_from
from signorini_fx.algebra.linalg.petsc_calls import memory_ended
from signorini_fx.arrays import Array, Column, length, matvec, quotient
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.rigid.mesh_levels import MeshLevel
from signorini_fx.mechanics.state import ContactValues, State
from signorini_fx.mechanics.statement.settings import SolverSettings
from signorini_fx.records import ACCURACY, OF_THE_BODY, History, Status
from signorini_fx.results.accuracy.convergence_table import (
    LevelResult,
    convergence_table,
    mean_spacing,
    regularisation_errors,
    with_polygon,
)
from signorini_fx.results.accuracy.error_estimates import Errors, worst_of
from signorini_fx.results.accuracy.pressure_error import polygon_error
from signorini_fx.results.solution import Solution
from signorini_fx.solving.restart import StoredStates
from signorini_fx.tuned import FEW_NODES, MIDDLE_RATIO


@dataclass(frozen=True)
class SolvedMesh:
    """The solution of a problem on one mesh.

    A nonlinear body has no task; without a solution or an error estimate the other values are None.
    """

    solution: Solution
    tagged: TaggedMesh
    task: Task | None
    outcome: Outcome | None = None
    level: LevelResult | None = None
    errors: Errors | None = None
    step_errors: Sequence[Errors] = ()  # of each load step

    def as_level(self) -> MeshLevel | None:
        """Return this mesh as a level of multigrid for finer meshes, on top of its own coarser
        levels; None without a task.
        """
        if self.task is None:
            return None
        level = self.task.system.elasticity.level
        assert isinstance(level, MeshLevel)
        level.solved = self.solution.displacement
        return level

    @property
    def state(self) -> ContactState | None:
        """The contact points after the first load step, from which the next mesh also starts."""
        return self.solution.steps[0].contact


@dataclass(frozen=True, kw_only=True)
class MeshedProblem(ABC):
    """A problem on one of several meshes; scenes and forms differ in how they make the model and a
    finer mesh.
    """

    comm: MPI.Comm  # the ranks that share the work
    history: History  # of all meshes
    remakes: bool = False  # whether gmsh makes a new mesh, finer where the error is large
    coarsest: float = 1.0  # size of the cells of the first mesh, relative to the stated size
    polygonal: bool = False  # whether straight facets stay although the shape may be curved
    in_parts: bool = False  # whether some of several bodies may be made anew on true arcs

    @property
    @abstractmethod
    def augmentable(self) -> bool:
        """Whether the augmented Lagrangian method may be chosen automatically.

        It may not be between two bodies, where its estimates were not tested, nor with soft
        contact, which it would make hard.
        """

    @property
    @abstractmethod
    def settings(self) -> SolverSettings:
        """The settings of the solver."""

    @abstractmethod
    def with_settings(self, settings: SolverSettings) -> Self:
        """Return the problem with other settings of its solver."""

    @abstractmethod
    def solve(
        self, state: ContactState | None, coarser: MeshLevel | None, checkpoint: StoredStates | None
    ) -> SolvedMesh:
        """Solve the problem on this mesh; collective.

        The ``level`` and ``errors`` of the result are set by ``solved``.

        Args:
            state: contact state of a coarser mesh to start from; None: there is none.
            coarser: coarser meshes as levels of multigrid; None: there are none.
            checkpoint: stored load steps for restart; None: nothing is stored.
        """

    @abstractmethod
    def on(self, tagged: TaggedMesh) -> Self:
        """Return the problem on a mesh that refines the cells of the last one."""

    @abstractmethod
    def divided(self, times: int) -> Self:
        """Return the problem on a newly made mesh, with cells ``times`` times smaller than those of
        the first one.
        """

    def remade(self, last: TaggedMesh, lengths: Array, finer: float) -> tuple[Self, int]:
        """Return the problem on a mesh made by gmsh, and its number of cells; collective.

        Args:
            last: the last mesh.
            lengths: wanted lengths of the cells.
            finer: largest ratio of refinement.
        """
        raise NotImplementedError

    def keeping(self, solved: SolvedMesh) -> Self:
        """Return the problem with the choices that were made on the first mesh."""
        return self

    def polygon_error(self, solved: SolvedMesh, last: float | None) -> float:
        """Return the error due to straight facets on a curved contact boundary, see
        ``pressure_error.polygon_error``.
        """
        if not self.polygonal or (last is not None and not self.in_parts):
            return last or 0.0
        assert solved.level is not None
        return polygon_error(solved.level.table, solved.solution.model.scales.modulus)

    def solved(
        self,
        number: int,
        state: ContactState | None,
        coarser: MeshLevel | None,
        stored: StoredStates | None = None,
    ) -> SolvedMesh:
        """Solve the problem as one of several meshes, with its error estimates and its cost;
        collective.
        """
        history = self.history
        comm = self.comm
        history.add(f"level {number}")
        solves_before = history.linear_solves
        if stored is not None:
            stored.level = number
        solved = self.solve(state, coarser, stored)
        solution = solved.solution
        step_errors = solved.step_errors
        if not solution.converged:
            return replace(solved, outcome=None)
        if not step_errors:
            return solved
        errors = worst_of(step_errors)
        body = solution.model
        table = solution.table
        task = solved.task
        # Contact states of the load steps that all meshes have in common.
        contacts = [
            step.contact for step in solution.steps if step.contact and step.place.is_integer()
        ]
        own = history.iterations[solves_before:]
        regularisation = (0.0, 0.0)
        krylov = np.inf
        left = [record.residual for record in own[-1:]]
        if task is not None and solved.outcome is not None:
            regularisation = regularisation_errors(
                task, solved.outcome, step_errors[-1].size, contacts[-1]
            )
            left.append(task.history.outer[-1].change or 0.0)
            krylov = krylov_from(body.system_size(), body.settings.linear_algebra)
        level = LevelResult(
            level=number,
            h=mean_spacing(table, revolved=not body.kinematics.uniform),
            dofs=body.dofs,
            linear_solves=len(own),
            factorisations=sum(record.factorised for record in own),
            seconds=parallel.global_max(comm, sum(solution.timings.seconds.values())),
            memory=parallel.peak_memory(comm),
            energy=errors.energy,
            pressure=errors.pressure,
            loads=errors.loads,
            points=errors.points if table.touching < FEW_NODES else 0.0,
            regularisation=regularisation[0],
            pressure_regularisation=regularisation[1],
            iteration=max(left, default=0.0),
            table=table,
            forces=np.concatenate([contact.forces_of_each.ravel() for contact in contacts]),
            krylov_from=krylov,
        )
        return replace(solved, level=level, errors=errors, step_errors=())


@dataclass(frozen=True)
class Unsolved:
    """Why a finer mesh has no solution, or is not made; the solution on the coarser mesh is
    returned in its place.
    """

    status: Status
    reason: str

    @classmethod
    def by_outcome(cls, solution: Solution, mesh: str, *, late: str = "") -> Unsolved | None:
        """Return why a solve has no solution; None if its outcome is a property of the body.

        Args:
            solution: the result of the solve.
            mesh: name of the mesh for the message.
            late: message that the time has passed; "" if it has not.
        """
        if solution.status is Status.NO_MEMORY:
            return cls(Status.MEMORY, f"{mesh} has used up the memory")
        if late:
            return cls(Status.BUDGET, late)
        if solution.status in OF_THE_BODY:
            return None
        reason = f"{solution.status.value}: {solution.status.advice}"
        if solution.statement.nonlinear and not solution.converged and (found := solution.findings):
            reason = found[0].message  # how far it has come, and where it gives way
        return cls(Status.COARSER, f"{mesh} ends with: {reason}")

    @classmethod
    def by_error(cls, error: Exception, mesh: str, comm: MPI.Comm) -> Unsolved:
        """Return why a mesh could not be made or solved, from an error that all ranks have.

        Args:
            error: the error.
            mesh: name of the mesh for the message.
            comm: the ranks.

        Raises:
            Exception: the error itself, if it is of another kind, or lack of memory on several
                ranks, as the other ranks would wait.
        """
        if comm.size == 1 and memory_ended(error):
            return cls(Status.MEMORY, f"{mesh} has used up the memory")
        if isinstance(error, (SceneError, MeshError)):
            return cls(Status.COARSER, f"{mesh} cannot be solved: {str(error).splitlines()[0]}")
        raise error

    def leaves(self, coarser: Solution, history: History) -> Solution:
        """Return the solution on the coarser mesh with this status."""
        history.add(f"{ACCURACY}{self.reason}")
        return replace(coarser, status=self.status)


# --- nested iteration -----------------------------------------------------------------------------


def solve_nested(
    problems: Iterable[MeshedProblem],
    count: int,
    comm: MPI.Comm,
    history: History,
    stored: StoredStates | None = None,
) -> Solution:
    """Solve on one mesh after the other, each starting from the contact state of the previous one;
    collective.

    If the last mesh has no solution, that of the finest mesh with a solution is returned, see
    ``Unsolved``.
    """
    base_memory = parallel.peak_memory(comm)
    state: ContactState | None = None
    coarser: MeshLevel | None = None
    levels: list[LevelResult] = []
    sides, polygon = None, None
    certified: Solution | None = None
    unsolved: Unsolved | None = None
    following = iter(problems)
    for number in range(count):
        name = f"mesh {number + 1} of {count}"
        try:
            problem = next(following)
            solved = problem.solved(number, state, coarser, stored)
        except Exception as error:
            if certified is None:
                raise
            unsolved = Unsolved.by_error(error, name, comm)
            break
        solution = solved.solution
        state = None
        if levels and solution.statement.sides != sides:
            history.add(
                "the convergence table begins here: on the coarser meshes the contact points are "
                "on other boundaries"
            )
            levels.clear()
        sides = solution.statement.sides
        coarser = solved.as_level()
        if solution.converged:
            state = solved.state
            certified = solution
        elif certified is not None and number + 1 == count:
            unsolved = Unsolved.by_outcome(solution, name)
        if solved.level is not None:
            if levels and levels[-1].dofs >= solved.level.dofs:  # there is no coarser mesh
                levels.pop()
            polygon = problem.polygon_error(solved, polygon)
            levels.append(with_polygon(solved.level, polygon))
        if number + 1 < count:  # to free memory, as the next mesh needs nothing else of this one
            del solved, solution
    if certified is not None and unsolved is not None:
        solution = unsolved.leaves(certified, history)
    solved_one = solution.converged or unsolved is not None
    prices = convergence_table(levels, base_memory) if len(levels) > 1 and solved_one else ()
    return replace(solution, levels=tuple(levels), convergence_table=tuple(prices))


def carry_over(coarse: ContactState, fine: ContactBoundary, state: State) -> State:
    """Return a guess for the step after ``state``, interpolated from the nearest contact nodes of a
    coarser mesh; collective.
    """
    boundary = coarse.boundary
    tangents = boundary.tangents
    # Directions and shears as vectors in 3D, because the tangents of neighbours need not agree.
    columns: list[Column] = [
        boundary.part,
        boundary.x,
        coarse.in_contact,
        coarse.pressure,
        matvec(tangents, coarse.direction),
        matvec(tangents, coarse.shear),
        length(coarse.slip_length),
        coarse.bound,
        boundary.normal,
    ]
    dim = boundary.x.shape[1]
    rows = parallel.gather_rows(boundary.comm, np.column_stack(columns)[boundary.at_nodes])
    # Of equally distant neighbours the search takes the first ones, so they are sorted by position,
    # independently of the ranks.
    rows = rows[np.lexsort(rows[:, dim::-1].T)]
    contact = np.zeros(fine.size, dtype=bool)
    direction, shear = (np.zeros((fine.size, dim)) for _ in range(2))
    pressure = np.zeros(fine.size)
    turning = np.zeros(fine.size)
    for part in np.unique(fine.part):
        on_part = fine.part == part
        coarse_rows = rows[rows[:, 0] == part]
        if not len(coarse_rows):  # for example a boundary of one facet without contact points
            contact[on_part] = True
            continue
        # Two neighbours are used: a node in the middle between two sets joins the one that
        # constrains it more, contact and stick, as the iteration releases superfluous nodes faster
        # than it finds missing ones.
        count = min(2, len(coarse_rows))
        places = cKDTree(coarse_rows[:, 1 : 1 + dim])
        distance, nearest = (a.reshape(-1, count) for a in places.query(fine.x[on_part], count))
        share = (
            distance[:, ::-1] / np.maximum(distance.sum(axis=1, keepdims=True), 1e-300)
            if count == 2
            else 1.0
        )
        near = (distance <= MIDDLE_RATIO * distance[:, :1]) | (np.arange(count) == 0)
        ends = np.cumsum((1, 1, dim, dim, 1, 1))
        touching, load, sliding, sheared, slipped, bound, normal = np.split(
            coarse_rows[nearest][:, :, 1 + dim :], ends, axis=2
        )
        # Between two bodies the points may have changed sides, so that tractions and directions
        # change sign.
        side = np.where(matvec(normal, fine.normal[on_part]) < 0, -1.0, 1.0)[:, :, None]
        sliding = side * sliding
        sheared = side * sheared
        contact[on_part] = (near & (touching[:, :, 0] > 0)).any(axis=1)
        sliding = np.where(near[:, :, None], sliding, sliding[:, :1])
        together = np.all(matvec(sliding, sliding[:, 0]) > 0, axis=1)
        direction[on_part] = np.where(together[:, None], sliding.sum(axis=1), 0.0)
        pressure[on_part] = (share * load[:, :, 0]).sum(axis=1)
        shear[on_part] = (np.atleast_2d(share)[:, :, None] * sheared).sum(axis=1)
        # The stiffness of the shear against slip perpendicular to its direction is bound / slip.
        bound = np.where(np.isfinite(bound), bound, 0.0)  # where nothing slips
        far, shear_bound = ((share * values[:, :, 0]).sum(axis=1) for values in (slipped, bound))
        turning[on_part] = quotient(shear_bound, far)
    of_points = fine.nodes.copy(), fine.part.copy(), fine.normal.copy()
    elastic = np.zeros_like(shear)
    values = ContactValues(*of_points, pressure, shear, elastic, contact, direction, turning)
    return replace(state, number=state.number + 1, displacement=np.zeros(0), contact=values)
