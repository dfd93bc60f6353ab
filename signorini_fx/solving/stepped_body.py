"""A body that load steps lead through, where they start, and one of them from its beginning to its certified result.

Scenes and forms differ in one thing only: how the model of another place is made.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.algebra.linalg import ElasticSystem
from signorini_fx.mechanics.body.deformation import Deformation, deformation_of
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.statement.load_path import LoadPath
from signorini_fx.mechanics.statement.settings import SolverSettings
from signorini_fx.records import Status, Timings
from signorini_fx.results.certificate.certificate import Certificate
from signorini_fx.results.certificate.law_of_method import Law, PreviousStep, Tractions
from signorini_fx.results.mechanics import SolidBody, StepResult

if TYPE_CHECKING:
    from signorini_fx.results.step_frames import StepEnd


@dataclass(frozen=True)
class SteppedBody:
    """A body that load steps lead through, at the present one; places are those of ``statement.load_path``; all methods
    are collective.
    """

    model: SolidBody
    path: LoadPath
    timings: Timings

    def begun(self, path_step: float, task: Task, first: Start, end: StepEnd | None) -> BegunStep:
        """The load step that begins at a place, with foundations and friction as they are there: after the end of the
        last one, whose task this is, or as the first one.
        """
        raise NotImplementedError

    def load(self, system: ElasticSystem, path_step: float) -> Nodal:
        """Give a system its loads at a place, and return their factors for ``system.set_load``."""
        raise NotImplementedError

    def show(self, outcome: Outcome, result: StepResult) -> None:
        """Show a result to whoever looks at the load steps from outside."""

    def ended(self, end: StepEnd) -> SteppedBody:
        """The body at the end of a load step with a solution, from which the next one begins."""
        return self


@dataclass(frozen=True)
class BegunStep:
    """A load step that begins, with foundations where they are in it; ``last``: the end of the one before it; all
    methods are collective.
    """

    body: SteppedBody
    task: Task
    start: Start
    last: PreviousStep | None

    def certified(self, outcome: Outcome) -> StepResult:
        """The result with the certificate's verdict; recorded linear solves are not counted yet."""
        body = self.body
        with body.timings.phase("certify"):
            result = certified_result(body.model, body.path, (self.task, self.start, self.last), outcome)
            body.show(outcome, result)
        return result


@dataclass(frozen=True)
class LoadStep(BegunStep):
    """A load step with its result."""

    result: StepResult
    outcome: Outcome

    @classmethod
    def of(cls, begun: BegunStep, outcome: Outcome, result: StepResult) -> LoadStep:
        """The load step that has begun, with its result."""
        return cls(begun.body, begun.task, begun.start, begun.last, result, outcome)

    def __str__(self) -> str:
        return f"{self.result}: {self.result.status.value}"


def certified_result(
    model: SolidBody,
    path: LoadPath,
    begun: tuple[Task, Start, PreviousStep | None],
    outcome: Outcome,
) -> StepResult:
    """The result of a step; ``begun``: its task, start and last step; collective."""
    (task, start, last), unknowns = begun, outcome.displacement()
    displacement = model.from_rest(task.rest, unknowns)
    contact = None if model.boundary is None else model.state(task, outcome, start)
    rigid = model.rigid.moved(model.driven(unknowns, task.rest)) if model.rigid.bodies else ()
    certificate = model.certified(
        displacement,
        None if contact is None else Tractions.of(contact),
        law=Law(*task.promised(outcome)),
        step=start.place,
        last=last,
        rigid=rigid,
    )
    deformation = deformation_of(model, displacement, model.tagged.size)
    return StepResult(
        step=start.step + 1,
        place=start.place,
        time=path.time_at(start.place),
        name=path.name_at(start.place),
        status=judged(outcome.status, certificate, deformation, model.settings),
        displacement=displacement,
        contact=contact,
        certificate=certificate,
        deformation=deformation,
        strain_energy=certificate.strain_energy,
        linear_solves=0,
        tools=rigid,
    )


def judged(status: Status, certificate: Certificate, deformation: Deformation, settings: SolverSettings) -> Status:
    """The status of an iteration after its result has been checked.

    If the residual stagnates, the usual reason is a body that has moved far away: therefore this is checked first.
    """
    if status not in (Status.CONVERGED, Status.ROUND_OFF):
        return status
    if deformation.largest > settings.largest_deformation:
        return Status.TOO_LARGE
    return Status.NOT_CERTIFIED if status is Status.CONVERGED and not certificate.holds else status


def first_start(start: Start, boundary: ContactBoundary, state: ContactState | None) -> Start:
    """Where the first load step of a task starts, from the contact state of a coarser mesh if there is one;
    collective.
    """
    if state is None:
        return start
    from signorini_fx.solving.nested import carry_over

    return start.begin_from(*carry_over(state, boundary))
