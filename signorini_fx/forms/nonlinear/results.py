"""The results of a ``NonlinearContactProblem`` as a ``Solution``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from dolfinx import fem

from signorini_fx.algebra.algorithms.task import Outcome, Task
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.forms.given_forms import GivenForms, named_parts
from signorini_fx.forms.nonlinear.displaced_certificate import ResidualBody, ResidualMechanics
from signorini_fx.forms.nonlinear.linearised import LinearisedProblem
from signorini_fx.forms.nonlinear.moving_pairs import facet_size, sheared_across_gaps, slid_past_partners
from signorini_fx.mechanics.body.deformation import added_stiffness, deformation_of
from signorini_fx.mechanics.body.elastic_body import ElasticBody
from signorini_fx.mechanics.interfaces import Pair
from signorini_fx.mechanics.statement.load_path import LoadPath, counted_path
from signorini_fx.records import Finding, History, Status, Timings
from signorini_fx.results.certificate.certificate import Certificate
from signorini_fx.results.mechanics import StepResult
from signorini_fx.results.solution import Solution
from signorini_fx.solving.check.result_findings import held_in_result, pushed_nodes, shapes_in_results
from signorini_fx.solving.loose_bodies import loose_at_rest
from signorini_fx.solving.solve_on_mesh import contact_solution
from signorini_fx.tuned import CERTIFICATE_TOLERANCE, NOTABLE


@dataclass(frozen=True)
class SolvedBody:
    """A nonlinear body at a solution.

    Attributes:
        forms: tangent and residual, with the foundations where they are.
        elastic: the body of the last tangent.
        outcome: how its contact problem has ended.
        law: its friction; None: no law can act.
        task: this problem.
        mechanics: the forces and contact sides.
        step: the solution as a load step.
    """

    forms: GivenForms
    elastic: ElasticBody
    outcome: Outcome
    law: PointFriction | None
    task: Task
    mechanics: ResidualMechanics
    step: StepResult

    @classmethod
    def of(
        cls,
        linear: LinearisedProblem,
        u: fem.Function,
        certificate: Certificate,
        mechanics: ResidualMechanics,
        solves: int,
        status: Status = Status.CONVERGED,
    ) -> SolvedBody:
        """What there is after a solve; collective.

        Args:
            linear: the contact problem of the last iteration.
            u: the displacement.
            certificate: of it.
            mechanics: its forces and contact sides.
            solves: linear solves.
            status: how it has ended.
        """
        assert linear.outcome is not None
        shapes = linear.shapes
        placed: Any = [
            replace(entry, shape=shapes[k].as_given) if k in shapes else entry for k, entry in enumerate(linear.stated)
        ]
        number, y = linear.begun.step, u.copy()
        y.name = u.name
        step = StepResult(
            step=number + 1,
            place=float(number),
            time=counted_path(number).time_at(number),
            name="",
            status=status,
            displacement=y,
            contact=linear.state if linear.contact else None,
            certificate=certificate,
            deformation=deformation_of(linear.elastic, u, linear.scales.size),
            strain_energy=certificate.strain_energy,
            linear_solves=solves,
            tools=linear.moving_tools.motions,
        )
        forms = replace(linear.forms, contact=tuple(placed))
        return cls(forms, linear.elastic, linear.outcome, linear.begun.law, linear.task, mechanics, step)

    def solution(
        self,
        rigid: Any,
        steps: Sequence[StepResult],
        mechanics: Sequence[tuple[fem.Function, ResidualMechanics]],
        ended: tuple[Status, tuple[Finding, ...]],
        spent: tuple[History, Timings],
        title: str,
    ) -> Solution:
        """It with all that results are made of; collective.

        Args:
            rigid: the rigid bodies.
            steps: of a ramp, which end with this one; none: the loop is the user's own.
            mechanics: their displacements and what the residual says of them.
            ended: how the last solve or ramp has ended, and what is to be known about it.
            spent: every linear solve, and the seconds.
            title: of the results.
        """
        names = tuple(step.name for step in steps) if any(step.name for step in steps) else ()
        path = LoadPath(tuple(step.time for step in steps), names) if steps else counted_path(self.step.step - 1)
        parts = named_parts(self.forms, self.elastic.settings, ("F",)).along(path, title)
        model = parts.model(self.elastic, self.law, {}, rigid)
        body = ResidualBody.of(model, at_end=self.mechanics, at_steps=tuple(mechanics))
        (status, found), (history, timings) = ended, spent
        outcome = self.outcome, self.outcome.problem.data
        solution = contact_solution(body, tuple(steps) or (self.step,), self.task, outcome, timings, lambda: found)
        return replace(solution, status=status, algorithm=f"newton, {solution.algorithm}", history=history)


def without_digits(certificates: Sequence[Certificate]) -> bool:
    """Whether round-off may be all that there is at the ends of load steps that move the body, see ``lost_digits``."""
    judged = [certificate for certificate in _displaced(certificates) if certificate.placed < 1.0]
    return bool(judged) and all(certificate.lost >= 1.0 for certificate in judged)


def _displaced(certificates: Sequence[Certificate]) -> list[Certificate]:
    """Those of steps that displace the body by more than round-off of the farthest one."""
    farthest = max((certificate.displacement for certificate in certificates), default=0.0)
    return [one for one in certificates if one.displacement > CERTIFICATE_TOLERANCE * farthest]


def lost_digits(certificates: Sequence[Certificate], residual: str) -> list[Finding]:
    """What round-off may hide at the ends of load steps, where that is more than a certificate allows.

    Steps that displace the body by a share below that of the farthest one are round-off of others, as where a body
    comes back to rest.

    Args:
        certificates: of the load steps.
        residual: what F is called.
    """
    judged = _displaced(certificates)
    hidden, placed = (
        max((getattr(certificate, name) for certificate in judged), default=0.0) for name in ("lost", "placed")
    )
    findings = list[Finding]()
    if hidden > CERTIFICATE_TOLERANCE:
        message = (
            f"round-off of the residual may hide errors of up to {hidden:.0e} of the forces, and of displacements as "
            "large: evaluate strains from grad u, without the difference of numbers near one such as I + grad u, or "
            "take a linear body, which one of such small strains is"
        )
        findings.append(Finding("warning", residual, message))
    if placed > CERTIFICATE_TOLERANCE:
        message = (
            f"contact is met at displaced points, whose round-off is {placed:.0e} of the displacement: forces and "
            "displacements may be wrong by as much: take a linear body, which one of such small displacements is, or "
            "for contact of two bodies sliding = 'small'"
        )
        findings.append(Finding("warning", "contact", message))
    return findings


def too_stiff(step: StepResult, farthest: float) -> list[Finding]:
    """Whether cells of degree 1 make the body too stiff; collective.

    Args:
        step: a solution.
        farthest: the largest displacement of a certificate so far: a body that has come back to rest has no strain.
    """
    if step.status is not Status.CONVERGED or step.certificate.displacement <= CERTIFICATE_TOLERANCE * farthest:
        return []
    added = added_stiffness(step.displacement)
    if added <= NOTABLE:
        return []
    share = f"by about {100 * added:.0f} % (an estimate)" if added < np.inf else "by far"
    message = (
        "strains change too much from cell to cell for cells of degree 1, as where a body bends: it is too stiff "
        f"{share}: take degree 2, or smaller cells"
    )
    return [Finding("warning", "mesh", message)]


def findings_of(linear: LinearisedProblem, steps: Sequence[StepResult]) -> tuple[Finding, ...]:
    """What is to be known about a last solution, see ``NonlinearContactProblem.findings``; collective.

    Args:
        linear: the contact problem of the last iteration.
        steps: with a solution.
    """
    if not linear.has_state:
        return ()
    entries, mesh = linear.contact, linear.space.mesh
    held = [pair.held_nodes(bilateral=entries[k].bilateral) for k, pair in linear.pairs.items()]
    pushed = pushed_nodes(mesh.comm, [held], linear.scales.size)
    sizes = {
        number: facet_size(mesh, linear.foundations.facets[number])
        for number, entry in enumerate(entries)
        if isinstance(entry, Pair) and not entry.sliding and not entry.bonded
    }
    past = slid_past_partners(linear.state, sizes)
    loose = loose_at_rest(linear.elastic, steps, "contact", linear.bodies)
    held = held_in_result(linear.state, linear.u, linear.foundations.pairs)
    inside = pushed_nodes(linear.space.mesh.comm, [held], linear.scales.size)
    inside += shapes_in_results(linear.foundations.placed_shapes, linear.u)
    return (*inside, *pushed, *sheared_across_gaps(linear.pairs, linear.state), *past, *loose)
