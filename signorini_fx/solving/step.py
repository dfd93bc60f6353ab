"""The solution of one load step, from the state before it to the state at its end, with a
report.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np

from signorini_fx.algebra.algorithms.strategy import solve_task
from signorini_fx.algebra.algorithms.task import Outcome, Start
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.algebra.contact.motions import ReferenceMotion
from signorini_fx.arrays import Array, Plain
from signorini_fx.errors import FormError
from signorini_fx.mechanics.body.deformation import deformation_of
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.state import State
from signorini_fx.mechanics.statement.load_path import LoadPath, Place
from signorini_fx.mechanics.step_effect import AddedForces, StepContact, StepEffect, StepEnd
from signorini_fx.records import Finding, History, Status, StepRecord, Timings
from signorini_fx.results.certificate.contact_nodes import (
    ContactConditions,
    ContactNodes,
    Law,
    PreviousStep,
    Tractions,
    overclosures_of,
)
from signorini_fx.results.certificate.equilibrium import Balance
from signorini_fx.results.mechanics import Mechanics, StepResult
from signorini_fx.solving.frames import Posed, solution_of, start_of, state_of, vectors_of

if TYPE_CHECKING:
    from signorini_fx.results.resultants import ActingForces

_MOST_TURNS = 50  # repetitions of a step for effects that depend on its solution
_FOREVER = 1e150  # duration of a step in which motion starts from rest, time
_DIGITS = 9  # significant digits of durations, which have round-off


class Problem(Protocol):
    """A problem that is solved in load steps; its methods are collective."""

    @property
    def path(self) -> LoadPath:
        """The load steps: their times and names."""

    @property
    def history(self) -> History:
        """The history of all solves."""

    @property
    def timings(self) -> Timings:
        """The times that parts of the solve took."""

    @property
    def effects(self) -> Sequence[StepEffect]:
        """Effects in time, which act from load step to load step."""

    def equilibrium(
        self,
        state: State,
        place: float,
        time: float,
        guess: State | None = None,
        budget: int | None = None,
    ) -> tuple[State, Ending]:
        """Return the state at the end of a step without the contributions of effects in time, and
        its report; see ``step``.
        """

    def accept(self, new: State, report: Report) -> None:
        """Accept a step with a solution, from which the next step continues."""


class StoredProblem(Problem, Protocol):
    """A problem whose load steps can be stored and restored."""

    def recall(
        self,
        state: State,
        place: float,
        time: float,
        read: Callable[..., State | None],
        method: Mapping[str, Plain],
    ) -> tuple[State, Ending] | None:
        """Return the end of a stored step without the contributions of effects in time; see
        ``recalled_equilibrium``.
        """


class LinearProblem(Problem, Protocol):
    """A problem in which each load step is a contact problem of a linear body."""

    @property
    def waits(self) -> bool:
        """Whether a body without load stays where it is until it is loaded, see
        ``Start.several``.
        """

    def pose_at(self, state: State, place: float, dt: float) -> Posed:
        """Return the problem of the step from a state to a place on the path; ``dt`` is its
        duration.

        It depends on the state only, on nothing else that earlier steps have left.
        """

    def mechanics(self, model: Model) -> Mechanics:
        """Return the evaluation of forces and stresses for a body of this problem."""


@dataclass(frozen=True)
class Report:
    """The result of a load step and how it was found; later steps do not use it.

    Attributes:
        result: the results to show.
        mechanics: evaluates forces and stresses of the body in the step.
        posed: the problem of the step.
        start: its initial state.
        outcome: the outcome of the contact problem, with the iterate of the method as long as no
            other problem is solved.
        data: the regularised problem of the outcome.
        iterations: iterations of Newton's method for a nonlinear body.
        internal: see ``StepEnd``.
    """

    result: StepResult
    mechanics: Mechanics
    posed: Posed
    start: Start
    outcome: Outcome
    data: RegularisedData
    iterations = 0  # of Newton's method for a nonlinear body
    internal: ClassVar[Callable[[Array], Array] | None] = None  # see ``StepEnd``

    @property
    def status(self) -> Status:
        """The status of the step."""
        return self.result.status

    def __str__(self) -> str:
        return f"{self.result}: {self.status.value}"


@dataclass(frozen=True)
class Failure:
    """The failure of a load step of a nonlinear body, without a result to show.

    Attributes:
        record: description of the step.
        status: None if an error ended the step.
        why: why there is no solution, as a message.
        error: the error that ended the step, if any.
    """

    record: StepRecord
    status: Status | None
    why: str
    error: FormError | None = None

    def __str__(self) -> str:
        return f"{self.record}: {self.why}"


Ending = Report | Failure


def step(
    problem: Problem,
    state: State,
    place: float,
    time: float | None = None,
    *,
    guess: State | None = None,
    budget: int | None = None,
) -> tuple[State, Ending]:
    """Solve the step from a state to a place on the path; collective.

    A failure changes nothing that a later step starts from.

    Args:
        problem: the problem to solve.
        state: the end of the step before.
        place: position on the path, see ``statement.load_path``.
        time: time at the end of the step; None: that of the place.
        guess: a solution of the same step for other values, from which the iteration starts; None:
            there is none.
        budget: linear solves allowed; None: those of the settings.

    Returns:
        The state at the end and a ``Report``.  For a nonlinear body without a solution: the state
        before the step and a ``Failure``.
    """
    solves = problem.history.linear_solves
    time = problem.path.time_at(place) if time is None else time
    for turn in range(_MOST_TURNS):
        left = None if budget is None else budget - (problem.history.linear_solves - solves)
        new, report = problem.equilibrium(state, place, time, guess, left)
        if isinstance(report, Failure):
            break
        if report.status is not Status.CONVERGED or not problem.effects or turn == _MOST_TURNS - 1:
            break  # effects check whether the last repetition has converged
        end = _end_of(problem, state, report)
        turns = (effect.repeat(state, new, end) for effect in problem.effects)
        again = next((turned for turned in turns if turned is not None), None)
        if again is None:
            break
        state, guess = again, new
    if isinstance(report, Failure):
        return new, report
    if report.status is Status.CONVERGED:
        new, report = ended(problem, state, new, report)
    count = problem.history.linear_solves - solves
    return new, replace(report, result=replace(report.result, linear_solves=count))


def contact_equilibrium(
    problem: LinearProblem,
    state: State,
    place: float,
    time: float,
    guess: State | None = None,
    budget: int | None = None,
) -> tuple[State, Report]:
    """Solve a step that is one contact problem and return its end; see ``step``.  Collective."""
    posed, start, before = begun(problem, state, place, time, guess)
    body = posed.body
    reason = None
    with problem.timings.phase("iterate"):
        if body.tightens(place):
            from signorini_fx.solving.bolt_preloads import found_in, solve_tightened

            body, start, outcome, reason = solve_tightened(body, posed.task, start, budget)
            posed = replace(posed, body=body)
            if posed.loads is not None:
                posed = replace(posed, loads=problem.mechanics(body).loads_at(place))
            state = replace(state, found=found_in(body, place))
        else:
            outcome = solve_task(posed.task, start, budget)
    if reason is None and outcome.status is not Status.CONVERGED:
        from signorini_fx.solving.findings import explained

        when = f"load step {start.step + 1}: " if problem.waits else ""
        reason = explained(body, posed.task, outcome, place, when)
    new, report = judged(problem, posed, start, before, outcome, state, time)
    result = replace(report.result, reason=reason or report.result.reason)
    return new, replace(report, result=result)


def recalled_equilibrium(
    problem: LinearProblem,
    state: State,
    place: float,
    time: float,
    read: Callable[..., State | None],
    method: Mapping[str, Any],
) -> tuple[State, Report] | None:
    """Evaluate a step again whose solution an earlier run has stored, and return its end;
    collective.

    Args:
        problem: the problem that was solved.
        state: the end of the step before.
        place: see ``step``.
        time: time at the end of the step.
        read: returns the stored state for a space and contact points; None if it cannot be read.
        method: see ``solution_of``.

    Returns:
        The state at the end and the report; None if the stored state cannot be read.
    """
    from signorini_fx.solving.bolt_preloads import tightened

    posed, start, before = begun(problem, state, place, time)
    new = read(posed.body.space, posed.boundary)
    if new is None:
        return None
    if any(effect.overrides("last_begun") for effect in problem.effects):
        state = _last_begun(problem, state, new)
        posed, start, before = begun(problem, state, place, time)
    posed, start = tightened(posed, start, new.found)
    solved = new
    for effect in problem.effects:
        solved = effect.solved(state, solved)
    outcome = solution_of(posed, start, solved, **method)
    return new, judged(problem, posed, start, before, outcome, state, time)[1]


def ended(
    problem: Problem, state: State, new: State, report: Report, *, stored: bool = False
) -> tuple[State, Report]:
    """Apply the effects in time to the end of a step with a solution, and add their figures to the
    report; collective.

    Args:
        problem: the problem of the step.
        state: the state before the step.
        new: the state at its end, without the contributions of effects.
        report: its report.
        stored: whether ``new`` is read from an earlier run and contains these contributions
            already.
    """
    if not problem.effects:
        return new, report
    result = report.result
    if stored:
        state = _last_begun(problem, state, new)
    with problem.timings.phase("certify"):
        end = _end_of(problem, state, report)
        figures = dict[str, float]()
        told = list[Finding]()
        for effect in problem.effects:
            new = new if stored else effect.after(state, new, end)
            own = effect.figures(state, new, end)
            figures |= own
            told += effect.told(new, end, own)
        contact = result.contact
        if contact is not None:
            columns = {
                name: values
                for effect in problem.effects
                for name, values in effect.columns(new).items()
            }
            gap = contact.gap if report.posed.linear else report.posed.gap
            contact = replace(contact, columns=columns, gap=gap)
        result = replace(result, contact=contact, told=tuple(told))
        for effect in problem.effects:
            if (wrong := effect.outcome(state, new, end)) is not None:
                result = replace(result, status=wrong[0], reason=wrong[1])
        linear = report.posed.linear
        if linear and any(effect.overrides("solved") for effect in problem.effects):
            acting = _forces_of(problem, state, report)
            result = replace(_at_the_end(problem, report, new), acting=acting)
        elif linear and any(effect.overrides("forces") for effect in problem.effects):
            result = replace(result, acting=_forces_of(problem, state, report))
    return new, replace(report, result=replace(result, figures=figures))


def _last_begun(problem: Problem, state: State, new: State) -> State:
    """Return the state from which the step between two states was started in its last repetition;
    collective.
    """
    for effect in problem.effects:
        state = effect.last_begun(state, new)
    return state


def _forces_of(problem: Problem, state: State, report: Report) -> Callable[[], ActingForces]:
    """Return a function that evaluates the forces on the body at the end of a step; collective."""
    return partial(_acting, report, _added_forces(problem.effects, report.posed, state))


def _end_of(problem: Problem, state: State, report: Report) -> StepEnd:
    """Return the end of a step with a solution in the form that effects use; collective."""
    posed = report.posed
    result = report.result
    loads = posed.loads
    acting = _forces_of(problem, state, report)
    assert loads is not None
    return StepEnd(
        posed.body,
        result.contact,
        posed.gap,
        result.displacement.x.array,
        loads,
        lambda: _reactions(report, acting().balance),
        vectors_of(report.start.elastic_slip, posed.boundary.tangents),
        report.outcome.augmented,
        posed.dt,
        result.place,
        report.internal,
    )


def _at_the_end(problem: Problem, report: Report, new: State) -> StepResult:
    """Return the result of a step at the displacement of its end, where the contact problem was
    solved for another displacement; tractions are those of the contact problem.  Collective.
    """
    posed = report.posed
    body = posed.body
    result = report.result
    displacement = result.displacement.copy()
    displacement.x.array[:] = new.displacement
    contact = result.contact
    if contact is not None:
        u_n, u_t = body.contact.traces(body.unknowns_at(new.displacement, new.rigid))
        slip, xi = (np.divide(way, posed.part) for way in (contact.slip_length, contact.xi))
        dt = contact.dt / posed.part
        contact = replace(contact, gap=posed.gap, u_n=u_n, u_t=u_t, slip_length=slip, xi=xi, dt=dt)
    balance = report.mechanics.balance(displacement, report.start.place)
    owned = displacement.x.array[: balance.internal.size].reshape(balance.internal.shape)
    moves = any(effect.moves_bodies for effect in problem.effects)
    rigid = replace(body.rigid, bodies=report.mechanics.statement.rigid_bodies)
    return replace(
        result,
        displacement=displacement,
        contact=contact,
        rigid_bodies=rigid.moved(new.rigid) if new.rigid.size else (),
        deformation=deformation_of(body, displacement, body.tagged.size, moves=moves),
        strain_energy=balance.strain_energy(balance.works(owned)),
    )


def begun(
    problem: LinearProblem, state: State, place: float, time: float, guess: State | None = None
) -> tuple[Posed, Start, PreviousStep | None]:
    """Return the problem of a step, its initial state, and the state before it for the
    certificate.
    """
    dt = time - state.time
    if any(effect.overrides("body") for effect in problem.effects):
        # Steps of one duration have one matrix.
        dt = float(f"{dt:.{_DIGITS}g}")
    rests = not state.number and any(effect.moves_bodies for effect in problem.effects)
    posed = replace(problem.pose_at(state, place, dt), dt=dt)
    posed = _lasting(posed, _FOREVER if rests else dt)
    if problem.effects:
        computed = [effect.at_nodes(posed.body, state, time) for effect in problem.effects]
        place = Place.of(place, dict(item for each in computed for item in each.items()))
        posed = with_contact(posed, problem.effects, state)
        # ``with_contact`` has set the gammas of the state already.
        start, before = start_of(posed, replace(state, gammas=None), guess)
    else:
        start, before = start_of(posed, state, guess)
    data = start.data
    if data.bond is not None:
        data = replace(data, bond=data.bond.begun(data.gap, data.slip_origin))
        start = replace(start, data=data)
    body = posed.body
    start = replace(start, data=_softened(start.data, posed))
    mechanics = problem.mechanics(body)
    if problem.effects:
        posed = replace(posed, loads=mechanics.loads_at(place))
    factors = _loaded(mechanics, posed, problem.effects, state, place)
    return posed, replace(start, place=place, factors=factors, several=problem.waits), before


def _softened(data: RegularisedData, posed: Posed) -> RegularisedData:
    """Return the data with the stiffness of soft contact as a share of gamma_n.

    Points with an overclosure law have the stiffness of the law in place of gamma_n.  A compliance
    of the contact, ``posed.softness``, is in series with either.
    """
    boundary = posed.body.boundary
    laws = overclosures_of(posed.body.contacts)
    if boundary is None or not (laws or posed.softness is not None):
        return data
    share = np.ones(boundary.size)
    for number, law in laws.items():
        share[boundary.part == number] = law.stiffness / data.gamma_n
    if posed.softness is not None:
        share /= 1.0 + data.gamma_n * share * posed.softness
    return replace(data, share=share)


def _lasting(posed: Posed, dt: float) -> Posed:
    """Return the problem of a step with its duration in the friction law, if friction follows the
    speed of slip.

    Where motion starts from rest, ``dt`` is practically infinite.

    Raises:
        FormError: the duration is not positive.
    """
    law = posed.first.law
    if law is None or not law.follows_slip:
        return posed
    refuse_no_duration(dt)
    law = replace(law, dt=dt)
    body = posed.body
    return replace(posed, first=replace(posed.first, law=law), body=replace(body, law=law))


def refuse_no_duration(dt: float) -> None:
    """Refuse a step without a positive duration where friction follows the speed of slip.

    Raises:
        FormError: ``dt`` is not positive.
    """
    if not dt > 0:
        reason = f"must go on from the last load step, the next one would last {dt:g}"
        raise FormError.at("times", f"{reason}: friction follows the speed of slip")


def with_contact(posed: Posed, effects: Sequence[StepEffect], state: State) -> Posed:
    """Return the problem of a step with the changes that effects make to the contact points;
    collective.
    """
    body = posed.body
    first = posed.first
    data = first.data
    if state.contact is not None and state.gammas is not None:
        data = replace(data, gamma_n=state.gammas[0], gamma_t=state.gammas[1])
    boundary = posed.boundary
    contact = StepContact(
        body, boundary, data.gap, data, first.law, posed.drift, linear=posed.linear
    )
    for effect in effects:
        contact = effect.contact(contact, state, posed.dt)
    task = posed.task
    data = contact.data
    if body.data is not None:
        # The gap of the body is not relative to the reference motion.
        unshifted = body.data.gap + (data.gap - posed.first.data.gap)
        shown = replace(body.data, gap=unshifted, bond=data.bond)
        body = replace(body, data=shown, law=contact.law)
    if contact.reference is not None:
        u_n, u_t = body.contact.traces(body.vector(contact.reference))
        rest = ReferenceMotion(np.zeros(0), u_n, u_t, contact.reference)
        task, data = task.counted_from(rest), rest.data_from(data)
    first = replace(first, data=data, law=contact.law)
    return replace(
        posed,
        body=body,
        task=task,
        first=first,
        drift=contact.drift,
        gap=contact.gap,
        part=contact.part,
        softness=contact.softness,
    )


def _loaded(
    mechanics: Mechanics, posed: Posed, effects: Sequence[StepEffect], state: State, place: float
) -> Array:
    """Set the loads of a step in the system, and return the factors of its load cases;
    collective.
    """
    system = posed.task.system
    for effect in effects:
        assert posed.loads is not None
        if (case := effect.load(posed.body, posed.loads, state, posed.dt)) is not None:
            system.set_case(0, case)
            return np.eye(len(system.cases))[0]
    return mechanics.load(system, place)


def judged(
    problem: LinearProblem,
    posed: Posed,
    start: Start,
    before: PreviousStep | None,
    outcome: Outcome,
    state: State,
    time: float,
) -> tuple[State, Report]:
    """Return the state at the end of a step, and the report with the verdict of the certificate;
    collective.

    Args:
        problem: the problem of the step.
        posed: the problem as it was solved.
        start: its initial state.
        before: the state before the step for the certificate.
        outcome: how the contact problem has ended.
        state: the state before the step.
        time: time at the end of the step.
    """
    body = posed.body
    task = posed.task
    path = problem.path
    place = start.place
    mechanics = problem.mechanics(body)
    with problem.timings.phase("certify"):
        unknowns = outcome.displacement()
        displacement = body.from_rest(task.rest, unknowns)
        contact = None
        if body.boundary is not None:
            contact = ContactState.of(task.contact(outcome, start), body.boundary)
            if posed.softness is not None:
                contact = replace(contact, gap=contact.gap + posed.softness * contact.pressure)
        rigid = body.rigid.moved(body.driven(unknowns, task.rest)) if body.rigid.bodies else ()
        certificate = mechanics.certified(
            displacement,
            None if contact is None else Tractions.of(contact),
            law=Law(*task.promised(outcome), softness=posed.softness),
            step=place,
            last=before,
            rigid=rigid,
            more=_added_forces(problem.effects, posed, state),
        )
        moves = any(effect.moves_bodies for effect in problem.effects)
        deformation = deformation_of(body, displacement, body.tagged.size, moves=moves)
        status = outcome.status
        reason = None
        if status in (Status.CONVERGED, Status.ROUND_OFF):
            # This check comes first: a body that has moved far away is the usual reason of a
            # stagnating residual.
            if deformation.largest > body.settings.largest_deformation:
                status = Status.TOO_LARGE
            elif status is Status.CONVERGED and not certificate.holds:
                status = Status.NOT_CERTIFIED
            elif status is Status.CONVERGED and (shapes := mechanics.shapes(place)):
                from signorini_fx.mechanics.obstacles.corner_depths import deepest_corner

                deep = deepest_corner(shapes, displacement, rigid, body.boundary)
                if deep is not None:
                    status = Status.CORNER
                    reason = Finding("warning", deep.path, str(deep))
        result = StepResult(
            step=start.step + 1,
            place=place,
            time=time,
            name=path.name_at(place),
            status=status,
            displacement=displacement,
            contact=contact,
            certificate=certificate,
            deformation=deformation,
            strain_energy=certificate.strain_energy,
            linear_solves=0,
            rigid_bodies=rigid,
            reason=reason,
        )
    new = state_of(posed, start, outcome, unknowns, displacement, state)
    report = Report(result, mechanics, posed, start, outcome, outcome.problem.data)
    return replace(new, time=result.time), report


def _added_forces(
    effects: Sequence[StepEffect], posed: Posed, state: State
) -> list[Callable[[Array], AddedForces | None]]:
    """Return functions that evaluate the forces which effects add to the balance at a displacement;
    none for a nonlinear body.
    """
    return [
        partial(effect.forces, posed.body, posed.loads, state, posed.dt)
        for effect in effects
        if posed.loads is not None and posed.linear
    ]


def _acting(report: Report, more: Sequence[Callable[[Array], AddedForces | None]]) -> ActingForces:
    """Return the forces on the body other than contact, as in the contact problem, with those that
    effects add; collective.
    """
    y = report.result.displacement
    acting = report.mechanics.acting(y, report.start.place)
    for add in more:
        if (added := add(y.x.array)) is not None:
            acting = acting.with_added(added)
    return acting


def _reactions(report: Report, balance: Balance) -> Array:
    """Return the support forces on the owned nodes, shape (owned nodes, d); collective."""
    result = report.result
    conditions = report.mechanics.conditions(result.displacement)
    return reactions_of(balance, conditions, result.contact)


def reactions_of(
    balance: Balance, conditions: ContactConditions | None, contact: ContactState | None
) -> Array:
    """Return the support forces on the owned nodes, shape (owned nodes, d); collective.

    Args:
        balance: all forces on the body without contact.
        conditions: the contact conditions at nodes; None: there are no contact points.
        contact: the tractions at contact points; None: there are none.
    """
    pressing = np.zeros_like(balance.internal)
    if contact is not None and conditions is not None:
        nodes = ContactNodes.of(conditions, Tractions.of(contact))
        reached, forces, _ = nodes.forces(len(pressing))
        np.add.at(pressing, reached, forces)
    return balance.residual(pressing)
