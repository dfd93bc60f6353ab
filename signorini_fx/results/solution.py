"""The result of a solve: the solution with everything that belongs to it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from math import floor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

import signorini_fx
from signorini_fx.arrays import Array, Plain
from signorini_fx.errors import SignoriniError
from signorini_fx.extensions import LINEAR_SOLVERS, add_on, names_of
from signorini_fx.machine import parallel
from signorini_fx.machine.display import html_table, point_in_words
from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.contact_points.contact_table import ContactTable, contact_table
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.state import State
from signorini_fx.mechanics.statement.effect import Load, is_zero
from signorini_fx.mechanics.statement.features import accuracy_refused
from signorini_fx.mechanics.statement.load_path import factor_at
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.records import (
    ACCURACY,
    NO_ACCURACY,
    SHORT_OF_ACCURACY,
    STEPS_UNESTIMATED,
    TOO_SHORT,
    Finding,
    History,
    Status,
    Timings,
)
from signorini_fx.results.accuracy.contact_surface import present_pressure
from signorini_fx.results.accuracy.next_accuracy import NAMES, next_cost
from signorini_fx.results.certificate.certificate import Certificate, another_law
from signorini_fx.results.contact_fields import BoundaryFields, boundary_fields
from signorini_fx.results.contact_figures import (
    contact_figures,
    corner_figures,
    friction_used,
    section_forces,
)
from signorini_fx.results.limit import UNDECIDED, ended_by, limit_of_ramp
from signorini_fx.results.mechanics import Mechanics, StatedMechanics, StepResult
from signorini_fx.results.resultants import Resultants
from signorini_fx.results.singularities import no_limit_of_pressure, singular_corners
from signorini_fx.results.stresses import RawStresses
from signorini_fx.tuned import ZERO_IN_SOLUTION

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pyvista import Plotter

    from signorini_fx.quantities.proved_statements import ErrorBound, Interval
    from signorini_fx.quantities.summary import (
        ContactFigures,
        CornerFigures,
        CostOfAccuracy,
        LimitOfRamp,
        Price,
        PrintedNumber,
        SectionForce,
    )
    from signorini_fx.results.accuracy.convergence_table import LevelResult

# A body that moves away although nothing would let it do so without a load.
_LEAVES = (Status.OPEN, Status.TIPS, Status.SLIDES)


@dataclass(frozen=True, repr=False)
class Solution:
    """The result of a solve; with load steps, that of the last load step with a solution.

    Attributes:
        status: how it ended; only ``Status.CONVERGED`` is a solution.
        algorithm: the algorithms that were used: ``linear``, ``ssn``, ``fp``, ...
        mechanics: forces and stresses of ``model``, the body on its mesh.
        displacement: y, a finite element function.
        contact: nodal state of the contact boundary of this rank (``table`` has that of all ranks),
            None without contact.
        certificate: the check of the conditions of the problem after the solve.
        steps: one result per load step, up to the last one that was tried; the fields above except
            model, status and algorithm are those of ``last_step``.
        history: every linear solve and every regularised problem.
        parameters: the values of gamma_n, gamma_t and sigma that were used.
        timings: wall seconds by phase, on this rank.
        linear_algebra: which kind of elastic system was used, and why.
        found: returns all of ``findings`` except the one about the contact law; collective on
            several ranks.
        state: the state at the end of the last load step with a solution, from which another solve
            can start; None without one, or if the body is nonlinear.
        levels: the meshes of a nested iteration, coarsest first; otherwise empty.
        convergence_table: errors and cost of each of these meshes, and a prediction for the next
            one; otherwise empty.
        remedy: what to do about the outcome, if more is known than the status; otherwise empty.
        reached: the load step of the results as it was solved, for adjoint states; None for a large
            or nonlinear body, for forms, and for earlier load steps.

    Examples:
        >>> print(np.round(solution.contact.forces[0], 6), solution.certificate.holds)
        [0. 4.] True
    """

    status: Status
    algorithm: str
    mechanics: Mechanics
    displacement: fem.Function
    contact: ContactState | None
    certificate: Certificate
    steps: tuple[StepResult, ...]
    history: History
    parameters: dict[str, float] = field(default_factory=dict)
    timings: Timings = field(default_factory=Timings)
    linear_algebra: str = "full"
    found: Callable[[], tuple[Finding, ...]] = tuple
    state: State | None = None
    levels: tuple[LevelResult, ...] = ()
    convergence_table: tuple[Price, ...] = ()
    remedy: str = ""
    reached: Any = None

    def __repr__(self) -> str:
        """Return one line, because the fields contain whole meshes and matrices."""
        title = self.model.title or "scene"
        return (
            f"<Solution of {title!r}: {self.status.value}, {self.algorithm}, {self.model.dofs} "
            "unknowns>"
        )

    def __str__(self) -> str:
        """Return what ``solve`` prints.

        On several ranks, where all ranks would have to compute it, return the line of ``repr``
        until ``summary`` has been called.
        """
        return "\n".join(map(str, self._answer)) if self._answer else repr(self)

    def _repr_html_(self) -> str:
        """Return the lines of ``str`` as a table for notebooks."""
        first, *lines = self._answer or [TerminalLine(repr(self))]
        rows = list[tuple[str, str]]()
        for line in lines:
            begin, text = line.begin.strip(), line.text.strip()
            if not begin and rows:  # a terminal is less wide than a cell
                begin, before = rows.pop()
                text = f"{before} {text}"
            rows.append((begin, text))
        return html_table(("", ""), rows, str(first))

    @property
    def _answer(self) -> list[TerminalLine]:
        """The lines that ``solve`` prints; empty where this rank cannot compute them alone."""
        from signorini_fx.quantities.shown import short_answer

        alone = self.comm.size == 1 or "_summary" in vars(self)
        return short_answer(self._summary) if alone else []

    def summary(self) -> dict[str, Any]:
        """Return the figures that ``write_results`` writes into summary.json; collective."""
        return self._summary

    @cached_property
    def _summary(self) -> dict[str, Any]:
        return signorini_fx.write_results(self, None)

    @property
    def model(self) -> Model:
        """The body on its mesh."""
        return self.mechanics.model

    @property
    def statement(self) -> Statement:
        """The entries of the solved problem by their names."""
        return self.mechanics.statement

    @property
    def converged(self) -> bool:
        """Whether this is a solution, certificate included."""
        return self.status is Status.CONVERGED

    @property
    def certified(self) -> bool:
        """Whether this is a certified solution, possibly less accurate than required."""
        return self.status in (Status.CONVERGED, *SHORT_OF_ACCURACY)

    @property
    def advice(self) -> str:
        """What to do about the outcome, without what the scene has done already.

        For a body that moves away it is the warning that names its motion; for a ramp it names the
        loads between which the ramp ended.
        """
        if self.remedy:
            return self.remedy
        settings = self.model.settings
        last = self.last_step
        failed = self.steps[-1]
        if self.status is Status.CORNER and failed.reason is not None:
            return failed.reason.message
        path = {Status.NOT_HELD: "displacement"} | dict.fromkeys(_LEAVES, self.model.forces_at)
        ended_between = self.model.path.steps is not None and last is not failed
        held = factors_held(self.statement, last.place, failed.place)
        reached = f"there is a solution at time {last.time:.6g}{held}, and none"
        if self.status in path:
            wanted = ("warning", path[self.status])
            of_step = [] if failed.reason is None else [failed.reason]
            named = (
                one.message for one in (*of_step, *self.findings) if (one.level, one.path) == wanted
            )
            between = f"{reached} at time {failed.time:.6g}; "
            why = next(named, self.status.advice).removeprefix(f"{self.status.value}: ")
            return between * ended_between + why
        if self.status in UNDECIDED and ended_between:
            # The slip that regularisation leaves in each load step wedges a body between several
            # walls.
            wedged = (
                self.model.has_coulomb
                and len(self.model.contacts) > 1
                and settings.algorithm != "alm"
            )
            early = (
                "; between several walls it may be higher: set solver.algorithm = 'alm' and "
                "solver.coulomb = 'newton'"
            )
            return (
                f"lower the load, raise the friction, or prescribe a displacement: {reached} was "
                "found at time "
                f"{failed.time:.6g}; most likely a limit load is between them, though it is not "
                f"proved{early * wedged}"
            )
        if self.history.late and self.status in UNDECIDED:
            return (
                "the time ended before the first mesh was solved: raise accuracy.seconds, or "
                "begin with a coarser mesh"
            )
        if self.status is Status.CYCLING:
            ways = (
                ["set solver.sigma = 'auto' (a node then passes through stick)"]
                if settings.sigma != "auto"
                else []
            )
            ways += [] if settings.fallbacks else ["set solver.fallbacks = true"]
            ways += [
                "lower solver.gamma_n and solver.gamma_t",
                "set another solver.initial_contact",
            ]
            return f"{', or '.join(ways)}; beyond a limit load there is no solution: lower the load"
        if self.status is Status.LINEAR_SOLVER and (name := settings.linear_algebra) in names_of(
            LINEAR_SOLVERS
        ):
            return (
                f"the linear solver {name!r} of another package does not solve: take 'auto', "
                "'full' or 'krylov'"
            )
        kind = {Status.JUMPS: TOO_SHORT} | dict.fromkeys(SHORT_OF_ACCURACY, ACCURACY)
        begins = kind.get(self.status)
        events = self.history.events
        reasons = [event for event in events if begins is not None and event.startswith(begins)]
        told = [reason.removeprefix(ACCURACY) for reason in reasons[-1:]]
        return "; ".join([self.status.advice, *told])

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Warnings and notes about the scene and the result; the first one warns if another contact
        law was used than requested.
        """
        law = None
        if self.contact is not None and self.last_step.status is Status.CONVERGED:
            laws = {step.step: step.certificate.law for step in self.shown_steps}
            error = self.parameters.get("regularisation_error")
            raises_gamma = self.statement.accuracy is not None
            law = another_law(self.model.settings, laws, error, raises_gamma=raises_gamma)
        found = self.found() if law is None else (law, *self.found())
        return tuple(dict.fromkeys(found))  # the scene and its outcome may have the same cause

    @property
    def last_step(self) -> StepResult:
        """The load step of the results: the last one with a solution, or the first one if there is
        none.
        """
        return self.shown_steps[-1]

    def at(self, step: StepResult) -> Solution:
        """Return the solution with the results of another load step; the steps before it are kept
        as its history.

        Raises:
            ValueError: it is none of ``steps``.
        """
        number = next((number for number, other in enumerate(self.steps) if other is step), None)
        if number is None:
            raise ValueError(
                f"step: must be one of the {len(self.steps)} steps of this solution, such as "
                "steps[0]"
            )
        past = self.steps[:number] if step.status is Status.CONVERGED else ()
        return replace(
            self,
            status=step.status,
            displacement=step.displacement,
            contact=step.contact,
            certificate=step.certificate,
            steps=(*past, step),
            reached=self.reached if step is self.last_step else None,
        )

    @property
    def shown_steps(self) -> tuple[StepResult, ...]:
        """The load steps with a solution, or all steps if none has one."""
        return tuple(step for step in self.steps if step.status is Status.CONVERGED) or self.steps

    @cached_property
    def table(self) -> ContactTable:
        """The contact boundary of all ranks as a table, the same on every rank; collective.

        Raises:
            ValueError: the scene has no contact.
        """
        if self.contact is None:
            raise ValueError("the scene has no contact, hence no contact table")
        table = contact_table(self.contact, *self.statement.sides)
        if not self.statement.finite_strains:
            return table
        revolved = not self.statement.kinematics_in(self.model.tagged.dimension).uniform
        present = present_pressure(table, self.contact, self.displacement, revolved=revolved)
        return replace(table, columns=table.columns | {"present_pressure": present})

    def boundary_fields(self, number: int | None = None) -> BoundaryFields:
        """Return pressure, shear, gap and slip on a mesh of the contact boundary, in new Functions.
        Collective.

        Args:
            number: position of the contact in the scene, from 0; of two bodies the side
                ``boundary`` is taken. None for all contacts; at a node of two contacts the later
                one counts.

        Raises:
            ValueError: the scene has no contact, or no contact of this number.
        """
        if self.contact is None:
            raise ValueError("the scene has no contact, hence no fields on its boundary")
        facets = [self.model.tagged.facets(entry.boundary) for entry in self.model.contacts]
        return boundary_fields(self.model.space, self.contact, facets, number)

    @property
    def stress(self) -> RawStresses:
        """The stress in the body, raw and recovered: tensor, von Mises stress, principal stresses
        and their extremes; with load steps, of the last one; collective.

        Raises:
            RuntimeError: the problem is given by forms whose stress is not known.
        """
        if isinstance(self._stress, str):
            raise RuntimeError(self._stress)
        return self._stress

    @property
    def known_stress(self) -> RawStresses | None:
        """The stress, or None if it is unknown; collective."""
        return None if isinstance(self._stress, str) else self._stress

    @cached_property
    def _stress(self) -> RawStresses | str:
        stress = self.mechanics.stress(self.displacement, self.place)
        return (
            stress
            if isinstance(stress, str)
            else replace(stress, strain_energy=self.last_step.strain_energy)
        )

    @cached_property
    def no_limit_of_pressure(self) -> str | None:
        """Why and where the contact pressure has no limit as the mesh is refined; collective.

        The place is a corner of the body, or an end of its contact boundary, towards which the
        pressure is convex.  None if nothing is known.
        """
        stated = isinstance(self.mechanics, StatedMechanics)
        return no_limit_of_pressure(self.model, self.table) if stated and self.certified else None

    @cached_property
    def resultants(self) -> Resultants:
        """Forces and moments on the body through each boundary; with load steps, of the last one;
        collective.
        """
        y = self.displacement
        acting = (self.last_step.acting or partial(self.mechanics.acting, y, self.place))()
        conditions = self.mechanics.conditions(y)
        return Resultants(self.model, self.statement, y, self.contact, conditions, acting)

    @cached_property
    def preloads(self) -> list[SectionForce]:
        """The forces through tightened sections; with load steps, in the last one; collective."""
        return section_forces(self.model, self.displacement, self.place)

    @cached_property
    def corner_figures(self) -> list[CornerFigures]:
        """The corners of foundations that are in contact between nodes; with load steps, in the
        last one; collective.
        """
        return [] if self.contact is None else corner_figures(self.model, self.contact)

    @cached_property
    def limit(self) -> LimitOfRamp | None:
        """The loads at which a ramp has ended; None if it has reached its end; collective."""
        last = self.last_step
        path = self.model.path
        whole = last.place >= len(path.times) - 1
        if path.steps is None or whole or self.certified or last.status is not Status.CONVERGED:
            return None
        failed = self.steps[-1]
        told = [one for one in self.findings if one.level == "warning" and one.path == "load_steps"]
        reasons = told if failed.reason is None else [failed.reason]
        held = factors_held(self.statement, last.place, floor(last.place) + 1.0).strip(" ()")
        reason = ended_by(self.status, reasons)
        return limit_of_ramp(self.model, last.time, last.place, held, reason)

    @cached_property
    def contact_figures(self) -> list[ContactFigures]:
        """Area and forces of each contact boundary, in the order of the scene; empty without
        contact; collective.
        """
        if self.contact is None:
            return []
        return contact_figures(self.model, self.statement.kinematics, self.contact)

    @cached_property
    def error_bound(self) -> ErrorBound | str | None:
        """A guaranteed bound of the error, or why there is none; None if this is no solution;
        collective.
        """
        if not self.certified:
            return None
        if reason := self.mechanics.no_bounds:
            return reason
        return add_on("error_bound")(self.model, self.displacement, self.contact, self.place)

    @cached_property
    def cost(self) -> CostOfAccuracy | str:
        """The cost of the accuracy and a forecast for a better one, or why there is no forecast;
        collective.
        """
        if self.last_step.status is not Status.CONVERGED:
            return "no solution"
        asked = "energy" if self.statement.accuracy is None else self.statement.accuracy.of
        prices = [price for price in self.convergence_table if not price.predicted]
        error = getattr(prices[-1], asked) if prices else None
        able = True
        if self.statement.units is not None and (why := accuracy_refused(self.statement, asked)):
            if self.model.contacts:
                return f"{NO_ACCURACY}{why}"
            able = False
        if not error:
            if prices and asked != "energy":
                return f"the error of {NAMES[asked]} is not estimated"
            if isinstance(known := self.mean_error, str):
                return known
            error = known
            able = able and (
                self.last_step.strain_energy is not None or self.statement.units is not None
            )
        if error < ZERO_IN_SOLUTION:
            if any(STEPS_UNESTIMATED in finding.message for finding in self.findings):
                return STEPS_UNESTIMATED
            return "this mesh is exact for this load"
        seconds = parallel.largest_timings(self.comm, self.timings.seconds)
        starting = seconds.get("compile", 0.0) + seconds.get("mesh", 0.0)
        solved = [(price.dofs, price.seconds) for price in prices] or [
            (self.model.dofs, sum(seconds.values()))
        ]
        cost = next_cost(
            self.statement, self.model.tagged, asked, error, solved, starting, able=able
        )
        plane = self.model.tagged.dimension == 2
        if self.statement.finite_strains and cost.local and plane:
            # Divided cells follow a stress without a limit until they fold.
            corners = [tuple(map(float, corner)) for corner, _ in singular_corners(self.model)]
            if corners:
                said = f"{cost.statement}, unless cells fold at {point_in_words(min(corners))}"
                return cost.model_copy(update={"statement": said})
        return cost

    @cached_property
    def mean_error(self) -> float | str:
        """The estimated relative error of the stress, which is that of the displacement in the
        energy norm, or why it is unknown; collective.
        """
        if self.last_step.strain_energy is None:
            known = self.error_shares
            if isinstance(known, str):
                return known
            return float(np.sqrt(parallel.global_sum(self.comm, known.sum())))
        if self.known_stress is None:
            return "forms alone have no error estimate: give stress="
        return self.known_stress.error or "there is no stress, or no error of it"

    @cached_property
    def numbers(self) -> dict[str, PrintedNumber]:
        """The numbers that ``solve`` prints, by name; collective.

        Each has an ``error``, half of the width of its interval, or a text ``why`` it is not known.
        Empty without a solution.

        Examples:
            >>> print(solution.numbers["force"])
            (0, 4) from the loads
        """
        from signorini_fx.results.number_errors import printed_numbers

        return printed_numbers(self) if self.last_step.status is Status.CONVERGED else {}

    @cached_property
    def error_shares(self) -> Array | str:
        """The share of each owned cell in the squared relative error of the stress of a nonlinear
        body, shape (cells,), or why it is unknown; collective.
        """
        mechanics: Any = self.mechanics  # of a residual
        known = mechanics.errors_now(False)
        return known if isinstance(known, str) else known[0]

    def force_bounds(self, boundary: str, direction: tuple[float, ...]) -> Interval | str:
        """Return guaranteed bounds of the contact force on a body at a boundary, in 2D per
        thickness, or why there are none.  Collective.

        Args:
            boundary: its name.
            direction: any vector; a unit vector gives the force along it.
        """
        if not self.certified:
            return "there is no solution"
        if reason := self.mechanics.no_bounds:
            return reason
        interval = add_on("force_bounds")(
            self.model, self.displacement, self.contact, boundary, direction, self.place
        )
        return interval

    @cached_property
    def friction_used(self) -> float | None:
        """The share of the friction that the loads use, with the friction bounds of this solution;
        with load steps, of the last one; collective.

        None without friction, where supports hold the body, or without a solution.
        """
        if self.contact is None or self.last_step.status is not Status.CONVERGED:
            return None
        return friction_used(self.model, self.contact, self.place)

    def plot(self, field: str | Sequence[str] = (), *, ax: Axes | None = None) -> Any:
        """Return pictures that a notebook displays, or draw a body in 2D on axes, see the function
        ``plot``; collective.
        """
        return signorini_fx.plot(self, field, ax=ax)

    def plotter(self, field: str = "", **options: Plain) -> Plotter | None:
        """Return a ``pyvista.Plotter`` with the deformed body, None on all ranks but the first;
        collective.

            solution.plotter("recovered_von_mises").show()

        Args:
            field: the field of the colours, among those that are written for ParaView; "" for the
                von Mises stress, or the displacement if there is no stress.
            options: ``times``, the magnification of displacements; all others are those of
                ``pyvista.Plotter``.

        Raises:
            ValueError: there is no such field.
            PictureError: PyVista is not installed, or has no display.
        """
        return add_on("plotter")(self, field, **options)

    def animate(self, file: str | Path, field: str = "", **options: Plain) -> None:
        """Write an animation of the load steps, or of the growing displacement of a single one;
        collective.

        Args:
            file: its path, which ends with .gif.
            field: see ``plotter``.
            options: see ``plotter``.

        Raises:
            OutputError: the file cannot be written.
            PictureError: see ``plotter``.
            ValueError: see ``plotter``.
        """
        add_on("animate")(self, file, field, **options)

    @property
    def place(self) -> float:
        """The position in the lists of load factors of the step that the displacement
        belongs to.
        """
        return self.last_step.place if self.steps else 0.0

    @property
    def comm(self) -> MPI.Comm:
        """The ranks that share the solution."""
        comm = self.model.tagged.mesh.comm
        return comm


def factors_held(statement: Statement, reached: float, failed: float) -> str:
    """Return the factors of the growing loads that a solution carries, in words, such as: (0.5
    times traction[1]).

    Loads are compared between the position ``reached`` on the path, with a solution, and the
    position ``failed`` without one.
    """
    factors = {
        path: [factor_at(statement.factors_of(load), place) for place in (reached, failed)]
        for path, load in statement.listed()
        if isinstance(load, Load) and not all(map(is_zero, load.given.values()))
    }
    growing = [f"{held:.4g} times {path}" for path, (held, end) in factors.items() if held != end]
    return f" ({', '.join(growing)})" if growing else ""


class ConvergenceError(SignoriniError):
    """No solution was reached.

    Attributes:
        solution: the last iterate with its status, history and certificate: a ``Solution``, or the
            ``ContactProblem`` or ``NonlinearContactProblem`` whose ``solve`` was called.

    Examples:
        >>> lifted = sfx.Traction(boundary="top", y=1.0)
        >>> try:
        ...     sfx.solve(scene.model_copy(update={"traction": lifted}))
        ... except sfx.ConvergenceError as error:
        ...     print(error.solution.status.name, error.solution.history.linear_solves)
        OPEN 0
    """

    def __init__(self, solution: Any, message: str | None = None) -> None:
        self.solution = solution
        if message is not None:
            super().__init__(message)
            return
        found = [
            found
            for found in solution.findings
            if found.level == "warning" and found.message not in solution.advice
        ]
        super().__init__(
            "\n".join(
                [outcome(solution), *(f"{warning.path}: {warning.message}" for warning in found)]
            )
        )


def outcome(solution: Solution, *, advice: bool = True) -> str:
    """Return how a solve without a solution ended; with load steps, which step failed, and of which
    step the results are.
    """
    status = solution.status
    last = solution.last_step
    failed = solution.steps[-1]
    text = f"{status.value}: {solution.advice}" if advice else status.value
    if not solution.model.path.several or failed.status is Status.CONVERGED:
        return text
    remark = f"; the results are those of {last}" if last is not failed else ""
    return f"{failed}: {text}{remark}"
