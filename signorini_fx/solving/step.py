"""One load step: from the state before it to the state at its end, and a report of how it has
ended.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from signorini_fx.algebra.algorithms.strategy import solve_task
from signorini_fx.algebra.algorithms.task import Outcome, Start
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.errors import FormError
from signorini_fx.mechanics.body.deformation import deformation_of
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.state import State
from signorini_fx.mechanics.statement.load_path import LoadPath
from signorini_fx.mechanics.step_effect import StepEffect
from signorini_fx.records import Finding, History, Status, Timings
from signorini_fx.results.certificate.law_of_method import (
    Law,
    PreviousStep,
    Tractions,
    overclosures_of,
)
from signorini_fx.results.mechanics import SolidBody, StepResult
from signorini_fx.solving.frames import Posed, start_of, state_of


class Problem(Protocol):
    """What load steps are solved of; its methods are collective."""

    @property
    def path(self) -> LoadPath:
        """The load steps: their times and names."""

    @property
    def history(self) -> History:
        """Of all solves."""

    @property
    def timings(self) -> Timings:
        """Of what takes time."""

    @property
    def effects(self) -> Sequence[StepEffect]:
        """What else happens from load step to load step."""

    @property
    def waits(self) -> bool:
        """Whether a body that nothing loads waits where it is for its load, see
        ``Start.several``.
        """

    def pose_at(self, state: State, place: float) -> Posed:
        """What the step to a place is solved with after a state: nothing else that an earlier step
        has left counts.
        """

    def accept(self, report: Report) -> None:
        """A step has ended with a solution, from which the next one goes on."""


@dataclass(frozen=True)
class Report:
    """How a load step has ended; no step goes on from it.

    Attributes:
        result: what is shown of it.
        body: as it is in the step.
        posed: what it was solved with.
        start: where it began.
        outcome: how its contact problem has ended, with the iterate of the method as long as no
            other is solved.
        data: of that problem.
    """

    result: StepResult
    body: SolidBody
    posed: Posed
    start: Start
    outcome: Outcome
    data: RegularisedData


def step(
    problem: Problem,
    state: State,
    place: float,
    *,
    guess: State | None = None,
    budget: int | None = None,
) -> tuple[State, Report]:
    """Solve the step from a state to a place on the path; nothing is changed by a failure;
    collective.

    Args:
        problem: what is solved.
        state: the end of the step before.
        place: see ``statement.load_path``.
        guess: a solution of the same step for other values, from which the iteration begins; None:
            there is none.
        budget: linear solves that it may take; None: those of the settings.

    Returns:
        The state at its end, whatever the status of the report is, and the report.
    """
    solves = problem.history.linear_solves
    posed, start, before = begun(problem, state, place, guess)
    body = posed.body
    reason = None
    assert isinstance(body, SolidBody)
    with problem.timings.phase("iterate"):
        if body.statement.tightens(place):
            from signorini_fx.solving.bolt_preloads import found_in, solve_tightened

            body, start, outcome, reason = solve_tightened(body, posed.task, start, budget)
            posed = replace(posed, body=body)
            state = replace(state, found=found_in(body, place))
        else:
            outcome = solve_task(posed.task, start, budget)
    if reason is None and outcome.status is not Status.CONVERGED:
        from signorini_fx.solving.findings import explained

        when = f"load step {start.step + 1}: " if problem.waits else ""
        reason = explained(body, posed.task, outcome, place, when)
    new, report = judged(problem, posed, start, before, outcome, state)
    count = problem.history.linear_solves - solves
    result = replace(report.result, linear_solves=count, reason=reason or report.result.reason)
    if result.status is Status.CONVERGED and result.contact is not None:
        for effect in problem.effects:
            new = effect.after(state, new, result.contact)
    return new, replace(report, result=result)


def begun(
    problem: Problem, state: State, place: float, guess: State | None = None
) -> tuple[Posed, Start, PreviousStep | None]:
    """A step that begins: what it is solved with, where it starts, and the state as its certificate
    sees it.
    """
    posed = problem.pose_at(state, place)
    posed = _lasting(posed, problem.path.time_at(place) - state.time)
    for effect in problem.effects:
        posed = _with_gap(
            posed, effect.added_gap(state, posed.boundary, problem.path.time_at(place))
        )
    body = posed.body
    assert isinstance(body, SolidBody)
    start, before = start_of(posed, state, guess)
    laws = overclosures_of(body.statement)
    if (
        body.boundary is not None and laws
    ):  # points of soft contact have the stiffness of their law for gamma_n
        share = np.ones(body.boundary.size)
        for number, law in laws.items():
            share[body.boundary.part == number] = law.stiffness / start.data.gamma_n
        start = replace(start, data=replace(start.data, share=share))
    factors = body.load(posed.task.system, place)
    return posed, replace(start, place=place, factors=factors, several=problem.waits), before


def _lasting(posed: Posed, dt: float) -> Posed:
    """What a step is solved with where laws that follow the slip count it over its duration, time.

    Raises:
        FormError: it is no duration.
    """
    law = posed.first.law
    if law is None or not law.follows_slip:
        return posed
    if not dt > 0:
        reason = f"must go on from the last load step, the next one would last {dt:g}"
        raise FormError([("times", f"{reason}: friction follows the speed of slip")])
    law = replace(law, dt=dt)
    body = posed.body
    assert isinstance(body, SolidBody)
    return replace(posed, first=replace(posed.first, law=law), body=replace(body, law=law))


def _with_gap(posed: Posed, added: npt.NDArray[np.float64] | None) -> Posed:
    """What a step is solved with where the gap is another one; None: it is not."""
    body, data = posed.body, posed.first.data
    if added is None or body.boundary is None:
        return posed
    assert isinstance(body, SolidBody)
    assert body.data is not None
    first = replace(posed.first, data=replace(data, gap=data.gap + added))
    body = replace(body, data=replace(body.data, gap=body.data.gap + added))
    return replace(posed, body=body, first=first)


def judged(
    problem: Problem,
    posed: Posed,
    start: Start,
    before: PreviousStep | None,
    outcome: Outcome,
    state: State,
) -> tuple[State, Report]:
    """The end of a step that began from a state, and the verdict of the certificate; collective."""
    body = posed.body
    task = posed.task
    path = problem.path
    place = start.place
    assert isinstance(body, SolidBody)
    with problem.timings.phase("certify"):
        unknowns = outcome.displacement()
        displacement = body.from_rest(task.rest, unknowns)
        contact = None
        if body.boundary is not None:
            contact = ContactState.of(task.contact(outcome, start), body.boundary)
        rigid = body.rigid.moved(body.driven(unknowns, task.rest)) if body.rigid.bodies else ()
        certificate = body.certified(
            displacement,
            None if contact is None else Tractions.of(contact),
            law=Law(*task.promised(outcome)),
            step=place,
            last=before,
            rigid=rigid,
        )
        deformation = deformation_of(body, displacement, body.tagged.size)
        status = outcome.status
        reason = None
        if status in (Status.CONVERGED, Status.ROUND_OFF):
            # First this, as a body that has moved far away is the usual reason of a residual that
            # stagnates.
            if deformation.largest > body.settings.largest_deformation:
                status = Status.TOO_LARGE
            elif status is Status.CONVERGED and not certificate.holds:
                status = Status.NOT_CERTIFIED
            elif status is Status.CONVERGED and (shapes := body.shapes(place)):
                from signorini_fx.mechanics.obstacles.corner_depths import deepest_corner

                deep = deepest_corner(shapes, displacement, rigid, body.boundary)
                if deep is not None:
                    status = Status.CORNER
                    reason = Finding("warning", deep.path, str(deep))
        result = StepResult(
            step=start.step + 1,
            place=place,
            time=path.time_at(place),
            name=path.name_at(place),
            status=status,
            displacement=displacement,
            contact=contact,
            certificate=certificate,
            deformation=deformation,
            strain_energy=certificate.strain_energy,
            linear_solves=0,
            tools=rigid,
            reason=reason,
        )
    new = state_of(posed, start, outcome, displacement, state)
    report = Report(result, body, posed, start, outcome, outcome.problem.data)
    return replace(new, time=result.time), report
