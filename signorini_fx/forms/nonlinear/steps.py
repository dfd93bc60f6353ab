"""The load steps of a nonlinear body: each is solved from the previous state, and the end of
Newton's method is judged.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from math import inf
from typing import Any

import numpy as np

from signorini_fx.arrays import Array
from signorini_fx.errors import FormError
from signorini_fx.forms.elasticity import NOT_FINITE, MatrixError
from signorini_fx.forms.nonlinear.crossing import behind, crossing
from signorini_fx.forms.nonlinear.linearised import NonlinearBody, Solved
from signorini_fx.forms.nonlinear.newton import Verdict, newton
from signorini_fx.forms.nonlinear.residual import Remembers, round_off
from signorini_fx.forms.nonlinear.results import ResidualMechanics, SolvedBody, certified
from signorini_fx.forms.nonlinear.verdicts import (
    corner_inside,
    jumping,
    leads,
    overlap,
    overlap_of_bodies,
    reason_for_none,
    sharp_end,
    stable,
)
from signorini_fx.machine import parallel
from signorini_fx.mechanics.pairs.mortar_coupling import PairingError
from signorini_fx.mechanics.state import Field, State
from signorini_fx.mechanics.statement.load_path import LoadPath
from signorini_fx.mechanics.step_effect import StepEffect
from signorini_fx.records import OF_THE_BODY, History, Status, StepRecord, Timings
from signorini_fx.results.certificate.certificate import Certificate
from signorini_fx.results.mechanics import StepResult
from signorini_fx.results.solution import ConvergenceError
from signorini_fx.solving.frames import solution_of
from signorini_fx.solving.increments import FINAL, HalvedIncrements
from signorini_fx.solving.load_path import run
from signorini_fx.solving.restart import StoredStates
from signorini_fx.solving.step import Failure, Report, refuse_no_duration

# Statuses that hold for linear bodies only.
OF_LINEAR_BODIES = (*OF_THE_BODY, Status.SLIDES_AT_PRESSURES, Status.SINGULAR)
# Statuses whose cause may be a boundary behind a foundation that it should touch.
NO_EQUILIBRIUM = (Status.NOT_SOLVED, Status.NOT_CERTIFIED, Status.UNSTABLE, Status.JUMPS)
# Statuses that say nothing about the stiffness.
NOT_BY_STIFFNESS = (
    *OF_THE_BODY,
    Status.PASSED,
    Status.CROSSED,
    Status.FOLDED,
    Status.AT_END,
    Status.INSIDE,
    Status.NOT_CERTIFIED,
)


@dataclass
class EquilibriumSolver:
    """Finds the equilibrium next to the present displacement of a nonlinear body, with its present
    loads and shapes.
    """

    body: NonlinearBody
    commit: Callable[[], None] | None  # the user's function, called at the end of a step
    remembers: Remembers | None  # the material's history of earlier steps
    max_newton: int
    asks_stability: bool
    extrapolates: bool = (
        False  # whether Newton's method begins with an extrapolation of the last step
    )
    too_large: Callable[[], str] = lambda: (
        ""
    )  # by how much the deformation is too large, as text; "": it is not; collective
    # Boundaries that have passed a foundation since the path began, see ``behind``.
    passed: dict[int, str] = field(default_factory=dict)
    # Advice on a status in place of ``Status.advice``.
    cures: Mapping[Status, str] = field(default_factory=dict)
    status: Status | None = (
        None  # status of the last attempt; None: there was none, or it raised an error
    )
    verdict: Verdict = field(init=False)  # verdict on the last attempt
    linear_solves: int = 0  # linear solves of the last attempt
    failure: str = ""  # how the last failed attempt has ended, as text
    solved: SolvedBody | None = None  # the last accepted solution, for results
    reached: State | None = None  # the end of the last step
    # The load steps of the path with a solution.
    ends: list[tuple[StepResult, ResidualMechanics]] = field(default_factory=list)
    timings: Timings = field(default_factory=Timings)
    # the largest displacement of accepted solutions, relative to the size of the body
    farthest: float = 0.0
    _since: State = field(init=False)  # the last solution before an attempt, or the initial state
    path: LoadPath = field(init=False)  # the load steps
    go_to: Callable[[float], None] = field(init=False)  # changes the body to a place on the path
    # The increments along the path; None: a single step of the user's loop is solved.
    way: HalvedIncrements | None = None
    # Returns as text which share of the loads at the failed place the reached place bears.
    held: Callable[[float, float], str] = lambda reached, failed: ""

    @property
    def history(self) -> History:
        """The history of all solves."""
        return self.body.history

    @property
    def effects(self) -> Sequence[StepEffect]:
        """The effects from load step to load step."""
        return self.body.effects

    def go_through(
        self,
        path: LoadPath,
        go_to: Callable[[float], None] = lambda place: None,
        way: HalvedIncrements | None = None,
    ) -> None:
        """Set the load path, see the attributes ``path``, ``go_to`` and ``way``."""
        self.path = path
        self.go_to = go_to
        self.way = way

    def begin_path(self) -> None:
        """Discard the load steps of another path, and the result of a failed first step."""
        self.timings = Timings()
        self.passed = {}
        self.ends = []
        if self.solved is not None and self.solved.status is not Status.CONVERGED:
            self.solved = None

    def attempt(self, *, final: bool = True) -> str:
        """Solve with the present values; ``take`` makes the result the last solution; collective.

        Returns "", or if there is no solution the reason and what to do about it. Then everything
        but ``status`` is reset to the last solution.

        Args:
            final: whether no smaller step will be tried, so that the reason of a failure is
                searched for.
        """
        body = self.body
        begin = body.at.x.array.copy()
        last = self._since = body.last or self._beginning(begin)
        self.status = None
        solves = len(body.history.iterations)
        search = partial(newton, body, self.judge, self.max_newton)
        try:
            verdict = self._ended("iterate", search)
            status = verdict.status
            if status is Status.CONVERGED and self._hidden(verdict.certificate):
                verdict = replace(verdict, status=Status.NO_DIGIT)
            elif status is Status.CONVERGED and self.asks_stability:
                assert body.solved is not None
                status, place = stable(body.solved)
                verdict = replace(verdict, status=status, detail=place)
            elif (
                final
                and status not in (Status.CONVERGED, *FINAL, *NOT_BY_STIFFNESS)
                and not verdict.without
                # The last iterate of a contact problem whose sets were not found is no equilibrium.
                and not verdict.detail
            ):
                without = reason_for_none(body, last.displacement, verdict.tried)
                verdict = replace(verdict, without=without)
        except Exception:
            self.show_last(begin)
            raise
        self.verdict = verdict
        status = self.status = verdict.status
        self.linear_solves = len(body.history.iterations) - solves
        if status is Status.CONVERGED:
            return ""
        reason = verdict.without or verdict.detail
        certificate = verdict.certificate
        if (
            not reason
            and certificate is not None
            and status in (Status.NOT_CERTIFIED, Status.NOT_SOLVED)
        ):
            reason = f"{certificate.worst_name} {certificate.worst:.1e}"
        ended = (
            "deformation too large for small strains"
            if status is Status.TOO_LARGE
            else status.value
        )
        self.failure = ended + (f" ({reason})" if reason else "")
        if (
            status is Status.INVERTED and verdict.without
        ):  # the inverted cells are only a consequence
            self.failure = verdict.without
        if final and status in NO_EQUILIBRIUM:
            passed = self.passed | behind(body, last)
            sharp = sharp_end(body.foundations, last.displacement)
            self.failure += "".join(f"; {text}" for text in (*passed.values(), sharp) if text)
        self.show_last(begin)
        return f"{self.failure}: {self.advice(status)}"

    def advice(self, status: Status) -> str:
        """Return what to do about the last attempt, which ended with this status."""
        cause = self.verdict.cause
        if cause is not None and status in (Status.NOT_SOLVED, Status.LIMIT):
            return cause.advice
        return self.cures.get(status, status.advice)

    def certify(self) -> Status:
        """Judge the present displacement, which an earlier run has found, without the stability,
        and return the status; collective.
        """
        self._since = self.body.begin
        values = self.body.at.x.array.copy()
        self.verdict = self._ended("certify", lambda: self.judge(self.body.evaluated.at(values)))
        return self.verdict.status

    def _ended(self, phase: str, solve: Callable[[], Verdict]) -> Verdict:
        """Return the verdict of ``solve``, also if it ends by an error that has a status;
        collective.
        """
        try:
            with self.timings.phase(phase):
                return solve()
        except PairingError as error:
            return Verdict(Status.FOLDED, str(error))
        except ConvergenceError as error:
            return self._not_solved(error.solution)
        except MatrixError as error:
            if error.fault != NOT_FINITE:
                raise
            return Verdict(Status.NOT_FINITE)

    def take(self) -> SolvedBody:
        """Accept the present displacement as the last solution, and return it; collective."""
        verdict = self.verdict
        certificate = verdict.certificate
        assert certificate is not None
        assert verdict.mechanics is not None
        self.passed |= behind(self.body, self._since)
        self.farthest = max(self.farthest, certificate.displacement)
        counts = self.linear_solves, verdict.iterations
        self.solved = SolvedBody.of(self.body.settled(), certificate, verdict.mechanics, *counts)
        return self.solved

    def before(self, status: Status, solves: int) -> SolvedBody | None:
        """Return the present body without contact, which is shown if there is no solution; None if
        it cannot be evaluated; collective.

        Args:
            status: how the search for a solution has ended.
            solves: number of linear solves of the search.
        """
        with suppress(FormError, MatrixError, PairingError):
            if (residual := self.body.evaluated.at(self.body.at.x.array.copy())) is None:
                return None
            solved = self.body.leave_open(status)
            return SolvedBody.of(solved, *certified(residual, solved), solves, 0, status)
        return None

    def initial(self) -> State:
        """Return the state before the first step, with the initial history of the material."""
        return self._remembered(self.body.initial())

    def _remembered(self, state: State) -> State:
        """Return the state with the present history of the material."""
        if self.remembers is None:
            return state
        values = self.remembers.remembered()
        kept = {name: Field("cells", rows) for name, rows in values.items()}
        return replace(state, fields={**state.fields, **kept})

    def _beginning(self, values: Array) -> State:
        """Return the state relative to which a step is checked; collective.

        It is the beginning of the step.  Before the first step, if the user has set ``u`` to other
        ``values``, it has these and the present places of the shapes.
        """
        begin = self.body.begin
        comm = self.body.space.mesh.comm
        if begin.number or not parallel.any_rank(
            comm, not np.array_equal(values, begin.displacement)
        ):
            return begin
        return replace(begin, displacement=values, placed=self.body.foundations.placed)

    def start(self, state: State) -> None:
        """Begin a step from a state, without data of any other step; collective.

        Raises:
            FormError: the material keeps its history outside of the state.
            SceneError: the state belongs to another material.
        """
        body = self.body
        known = state is body.begin or state is self.reached
        if not known and (state.number or body.begin.number):
            self.refuse_elsewhere()
        self._recall_material(state)
        body.start(state)
        size = parallel.largest(body.space.mesh.comm, np.abs(state.displacement))
        self.farthest = max(self.farthest, size / body.named[1].size)

    def refuse_elsewhere(self) -> None:
        """Refuse to begin from a state that lacks the history of the material.

        Raises:
            FormError: the material keeps its history outside of the state.
        """
        if self.commit is not None and self.remembers is None:
            reason = (
                "keeps what the material remembers where no state has it, so that no step can "
                "begin from one: give kept, the Functions that it changes"
            )
            raise FormError.at("commit", reason)

    def _recall_material(self, state: State) -> None:
        """Restore the history of the material from a state; collective."""
        if self.remembers is not None and (state.fields or state.number):
            self.remembers.recall(state.fields)

    def committed(self, time: float) -> State:
        """Commit the accepted solution and return the state at the end of its step; collective."""
        assert self.body.last is not None
        if self.commit is not None:
            self.commit()
        new = self._remembered(replace(self.body.last, time=time))
        begin = self.body.begin
        if not self.extrapolates or time <= begin.time:
            return new
        rate = (new.displacement - begin.displacement) / (time - begin.time)
        return new.with_field("rate", "dofs", rate)

    def extrapolate(self, state: State, time: float) -> None:
        """Begin Newton's method with the displacement extrapolated from a state to a time.

        A body that flows plastically is soft there, while at the state it has its elastic tangent.
        """
        if self.extrapolates and (rate := state.fields.get("rate")) is not None:
            self.body.at.x.array[:] = state.displacement + rate.values * (time - state.time)

    def show_last(self, begin: Array) -> None:
        """Reset ``u``, the fields and rigid bodies to the last solution, or before the first one to
        the values ``begin`` of u; loads and prescribed shapes stay; collective.
        """
        solved = self.solved
        if solved is not None and solved.status is not Status.CONVERGED:
            solved = None
        body = self.body
        body.now = None
        body.solved = None if solved is None else solved.solved
        body.show(None if body.solved is None else body.solved.state)
        body.foundations.carry_to((body.last or body.begin).rigid)
        body.at.x.array[:] = begin if solved is None else solved.result.displacement.x.array
        with suppress(FormError):  # before the first solution ``update`` may fail
            body.evaluated.updated()

    @property
    def certificate(self) -> Certificate | None:
        """The certificate of the last solution, or None if there is none."""
        solved = self.solved
        ended = solved is not None and solved.status is Status.CONVERGED
        return solved.result.certificate if solved is not None and ended else None

    def _not_solved(self, solved: Solved) -> Verdict:
        """Return the verdict if the linear contact problem of an iteration has no solution, which
        proves little about the nonlinear body.
        """
        inner = solved.status
        if inner in (Status.NOT_HELD, Status.OPEN) and solved.loose:
            return Verdict(inner, "nothing presses on the body, and the supports do not hold it")
        if inner is Status.NOT_HELD and not solved.linear.task.idle:
            return Verdict(inner)
        # What no load pushes may still be held by tractions of the step before.
        if inner in (Status.NOT_HELD, *OF_LINEAR_BODIES):
            if not leads(self.body, self.body.at.x.array.copy()):
                return Verdict(Status.NOT_SOLVED)
            without = f"the linearised body is not held: {inner.value}"
            return Verdict(Status.NOT_SOLVED, without=without, cause=inner)
        if inner not in (Status.CYCLING, Status.OUTER_MAX_ITERATIONS):
            return Verdict(inner)
        if inner is Status.CYCLING and (jumps := jumping(solved)):
            return Verdict(Status.JUMPS, jumps)
        return Verdict(Status.NOT_SOLVED, inner.value)

    def _hidden(self, certificate: Certificate | None) -> bool:
        """Return whether the solution may be nothing but round-off, unless the body has returned to
        its initial position.
        """
        assert certificate is not None
        return (
            certificate.displacement > self.farthest
            and certificate.placed < 1.0 <= certificate.lost
        )

    def judge(self, residual: Array | None) -> Verdict:
        """Return whether an iterate is a solution; collective.

        Args:
            residual: F at the present displacement; None: it cannot be evaluated.
        """
        if residual is None:
            return Verdict(Status.INVERTED)
        body = self.body
        foundations = body.foundations
        last = self._since
        if self.body.evaluated.turns_over(last.displacement):
            return Verdict(Status.INVERTED, "some turn over within the step")
        solved = body.solved
        assert solved is not None
        boundary = solved.linear.boundary
        for status, said in (
            (Status.TOO_LARGE, self.too_large),
            (Status.INSIDE, lambda: overlap(foundations, last)),
            (Status.CORNER, lambda: corner_inside(foundations, boundary)),
            (Status.PASSED, lambda: overlap_of_bodies(foundations, last)),
        ):
            if detail := said():
                return Verdict(status, detail)
        if (crossed := crossing(body)) is not None:
            return Verdict(Status.CROSSED if crossed.itself else Status.PASSED, crossed.text)
        body.slide()
        for number, pair in foundations.sliding.items():
            if body.contact[number].bilateral and (reached := pair.parted):
                return Verdict(Status.AT_END, reached)
        lost = round_off(body.evaluated, residual)
        certificate, mechanics = certified(residual, solved, lost)
        status = Status.CONVERGED if certificate.holds else Status.NOT_CERTIFIED
        return Verdict(status, "", certificate, mechanics)

    def accept(self, new: State, report: Report) -> None:
        """Make the end of a step the beginning of the next one."""
        assert isinstance(report, SolvedBody)
        self.solved = report
        self.reached = new

    def equilibrium(
        self,
        state: State,
        place: float,
        time: float,
        guess: State | None = None,
        budget: int | None = None,
    ) -> tuple[State, SolvedBody | Failure]:
        """Solve a step, before effects in time, and return the state at its end and the result;
        collective.

        After a failure it returns the given state, and results stay those of the last solution.

        Args:
            state: the end of the previous step.
            place: the place on the path, see ``statement.load_path``.
            time: the end of the step.
            guess: ignored.
            budget: largest number of linear solves; None: that of the settings.
        """
        body = self.body
        way = self.way
        kept = body.begin, body.at.x.array.copy()
        solves = self.history.linear_solves
        final = way is None or not way.may_halve
        error: FormError | None = None
        shown: SolvedBody | None = None
        try:
            self._begin(state, place, time)
            self.extrapolate(state, time)
            with self.history.at_most(inf if budget is None else budget):
                why = self.attempt(final=final)
            if not why:
                solved = self._named(self.take(), place, time)
                return self.committed(time), solved
            status = Status.LIMIT if self.verdict.without else self.status
            assert status is not None
            if (final or status in FINAL) and (way is None or self.solved is None):
                shown = self.before(status, self.history.linear_solves - solves)
        except FormError as raised:
            status, why, error = None, str(raised), raised
        except Exception:
            self._go_back(*kept)
            raise
        self._go_back(*kept)
        if shown is None:
            record = StepRecord(state.number + 1, self.path.name_at(place), time)
            return state, Failure(record, status, why, error)
        shown = self._named(shown, place, time)
        if self.solved is None:
            self.solved = shown
        return state, shown

    def _begin(self, state: State, place: float, time: float) -> None:
        """Put the body at the beginning of a step that ends at a place and a time; collective."""
        body = self.body
        foundations = body.foundations
        dt = time - state.time
        self.start(state)
        body.several = self.path.several
        foundations.dt = dt
        self.go_to(place)
        body.evaluated.begin(state, dt)
        rigid = foundations.rigid_bodies
        body.drives = rigid.drives()
        for effect in self.effects:
            foundations.drive(effect.driven(rigid, state, dt))
        laws = [entry.friction for entry in body.contact]
        if any(law is not None and law.follows_slip for law in laws):
            refuse_no_duration(dt)

    def _go_back(self, begin: State, values: Array) -> None:
        """Reset to the last solution after a failed step; a step of the user's own loop returns to
        the state where it began; collective.
        """
        if self.way is None:
            self.body.begin = begin
            self._recall_material(begin)
            self.body.settle()
            self.show_last(values)
        else:
            self.go_to(self.way.reached)

    def _named(self, solved: SolvedBody, place: float, time: float) -> SolvedBody:
        """Return the result with place, time and name of the step."""
        name = self.path.name_at(place)
        return replace(solved, result=replace(solved.result, place=place, time=time, name=name))

    def recall(
        self,
        state: State,
        place: float,
        time: float,
        read: Callable[..., State | None],
        method: Mapping[str, Any],
    ) -> tuple[State, SolvedBody | Failure] | None:
        """Restore the end of a step from a stored state, and check it; see
        ``recalled_equilibrium``; collective.
        """
        body = self.body
        self.refuse_elsewhere()
        self._begin(state, place, time)
        if (end := read(body.space)) is None:
            return None
        status = Status.NOT_CERTIFIED
        with suppress(FormError, MatrixError, PairingError):
            if body.evaluated.at(end.displacement.copy()) is not None:
                body.foundations.carry_to(end.rigid)
                linear = body.as_it_is()
                if (whole := read(body.space, linear.boundary)) is None:
                    return None
                end = whole
                body.take(linear, solution_of(linear.posed, linear.start, end, **method))
                assert end.contact is not None
                body.take_tractions(end.contact)
                status = self.certify()
        if status is not Status.CONVERGED:
            self.show_last(state.displacement)
            record = StepRecord(state.number + 1, self.path.name_at(place), time)
            return state, Failure(record, status, status.value)
        self.status = status
        return end, self._named(self.take(), place, time)

    def solve_path(
        self,
        state: State,
        on_step: Callable[[StepResult], None],
        stored: StoredStates | None = None,
    ) -> tuple[str, str]:
        """Solve the load steps of a path after a state; collective.

        The solver is left where the next step would begin.

        Returns:
            Why the path ended before its last step, and what to do about it, as text; "" if it is
            complete.

        Raises:
            FormError: the smallest step ended with one.
        """
        way = self.way
        assert way is not None
        self.begin_path()
        first = way.reached
        for new, ended in run(self, state, way, stored=stored):
            if isinstance(ended, SolvedBody) and ended.status is Status.CONVERGED:
                self.ends.append(ended.end)
                on_step(ended.result)
            self.start(new)
        if ended.status is Status.CONVERGED:
            return "", ""
        path = self.path
        end, reached = (f"time {path.time_at(place):g}" for place in (way.next, way.reached))
        last = "there is no solution before it"
        if way.reached > first:
            last = f"there is a solution at {reached}{self.held(way.reached, way.next)}"
        if (error := getattr(ended, "error", None)) is not None:
            reasons = [(key, f"{reason} (at {end}; {last})") for key, reason in error.problems]
            raise FormError(reasons, error.source) from error.__cause__
        status = self.status = ended.status
        assert status is not None
        failure = f"{self.failure}: at {end}; {last}"
        if status is Status.LIMIT:
            failure = f"{status.value}: {last}; a step to {end} ends with: {self.failure}"
        return failure, self.advice(status)
