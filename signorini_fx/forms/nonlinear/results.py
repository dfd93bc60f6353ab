"""The results of a ``NonlinearContactProblem`` as a ``Solution``, and the error of its stress from the residual alone.

The stress P is what the residual multiplies the gradient of its test function by (of finite strains the first
Piola-Kirchhoff stress).  In each cell it is taken as a polynomial of degree k - 1, and projected onto the continuous
functions of degree 1 in each material; its difference to the projection is measured in L2 (Zienkiewicz and Zhu).  The
error is that of the last load step: what a coarse mesh leaves in the state of a material counts as far as it makes the
stress rough.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse.linalg
import ufl
from dolfinx import fem
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.algorithms.apply_derivatives import apply_derivatives
from ufl.algorithms.map_integrands import map_integrand_dags
from ufl.corealg.multifunction import MultiFunction

from signorini_fx.algebra.algorithms.task import Outcome, Task
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.forms.given_forms import GivenForms, model_of, named_parts
from signorini_fx.forms.nonlinear.displaced_certificate import ResidualBody, ResidualMechanics
from signorini_fx.forms.nonlinear.linearised import LinearisedProblem
from signorini_fx.machine import parallel
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.assembly.mesh_entities import assemble
from signorini_fx.mechanics.body.deformation import deformation_of
from signorini_fx.mechanics.body.elastic_body import ElasticBody
from signorini_fx.mechanics.statement.load_path import LoadPath, counted_path
from signorini_fx.records import Finding, History, Status, Timings
from signorini_fx.results.accuracy.stress_recovery import StressRecovery
from signorini_fx.results.certificate.certificate import Certificate
from signorini_fx.results.mechanics import StepResult
from signorini_fx.results.solution import Solution
from signorini_fx.solving.solve_on_mesh import contact_solution
from signorini_fx.tuned import CERTIFICATE_TOLERANCE, FACETS_OF_KEPT_PARTNERS


@dataclass(frozen=True)
class SolvedBody:
    """A nonlinear body at a solution.

    Attributes:
        forms: tangent and residual, with the foundations where they are.
        elastic: the body of the last tangent.
        outcome: how its contact problem has ended; ``law``: its friction, None: no law can act; ``task``: this problem.
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
        """What there is after a solve, with its linear solves and how it has ended; collective."""
        assert linear.outcome is not None
        shapes = linear.shapes
        placed: Any = [
            replace(entry, shape=shapes[k].as_given) if k in shapes else entry for k, entry in enumerate(linear.contact)
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
            tools=linear.foundations.rigid_bodies.motions,
        )
        forms = replace(linear.forms, contact=tuple(placed))
        return cls(forms, linear.elastic, linear.outcome, linear.begun.law, linear.task, mechanics, step)

    def solution(
        self,
        rigid: Any,
        ends: Sequence[tuple[StepResult, ResidualMechanics]],
        ended: tuple[Status, tuple[Finding, ...]],
        spent: tuple[History, Timings],
        title: str,
    ) -> Solution:
        """It with all that results are made of; ``ends``: the load steps of a run, with what the residual says of them;
        none: the loop is the user's own; ``ended``: how the last solve or run has ended, and findings; collective.
        """
        steps = [step for step, _ in ends]
        names = tuple(step.name for step in steps) if any(step.name for step in steps) else ()
        path = LoadPath(tuple(step.time for step in steps), names) if steps else counted_path(self.step.step - 1)
        named = named_parts(self.forms, self.elastic.settings, ("F",))
        model = model_of(self.elastic, named, path, title, self.law, {}, rigid)
        ends = tuple(ends) or ((self.step, self.mechanics),)
        body = ResidualBody.of(model, ends=ends, boundaries=self.forms.boundaries)
        (status, found), (history, timings) = ended, spent
        outcome = self.outcome, self.outcome.problem.data
        solution = contact_solution(body, steps or (self.step,), self.task, outcome, timings, lambda: found)
        return replace(solution, status=status, algorithm=f"newton, {solution.algorithm}", history=history)


def lost_digits(certificates: Sequence[Certificate], residual: str) -> list[Finding]:
    """What round-off may hide at the ends of load steps, where that is more than a certificate allows.

    Steps that displace the body by a share below that of the farthest one are round-off of others, as where a body
    comes back to rest.

    ``residual``: what F is called.
    """
    farthest = max((certificate.displacement for certificate in certificates), default=0.0)
    judged = [one for one in certificates if one.displacement > CERTIFICATE_TOLERANCE * farthest]
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


def slid_past_partners(linear: LinearisedProblem) -> list[Finding]:
    """A warning for each pair whose touching points have moved farther along the other side than partners may be kept;
    collective.
    """
    findings, mesh, state = list[Finding](), linear.space.mesh, linear.state
    for number, entry in enumerate(linear.contact):
        if entry.against is None or entry.sliding or entry.bonded:
            continue
        lengths = mesh.h(mesh.topology.dim - 1, linear.foundations.facets[number])
        total, count = parallel.global_sum(mesh.comm, np.array([lengths.sum(), lengths.size]))
        facet, touching = total / count, (state.boundary.part == number) & state.in_contact
        farthest = parallel.largest(mesh.comm, np.linalg.norm(state.u_t[touching], axis=1), 0.0)
        if farthest > FACETS_OF_KEPT_PARTNERS * facet:
            message = (
                f"points that keep their partners have moved by up to {farthest:.3g} along the other side, "
                f"{farthest / facet:.2g} facets: forces there may be wrong, and those on both sides act apart: let the "
                "sides slide"
            )
            findings.append(Finding("warning", f"contact[{number}].sliding", message))
    return findings


def stress_error(
    residual: Any, u: fem.Function, parts: Sequence[npt.NDArray[np.int32]]
) -> npt.NDArray[np.float64] | str:
    """What each owned cell has of the squared relative error of the stress in L2, or why it is not known; ``parts``:
    cells of each material, local numbers, ghosts included; collective.
    """
    stress = SimpleNamespace(
        displacement=u,
        components=stress_of(residual, u),
        parts=parts,
        squared=lambda difference, times, dx: times * ufl.inner(difference, difference) * dx,
        refresh=lambda step: None,
    )
    recovery = StressRecovery(stress, lambda z: (lambda step: None, None))
    size = 2 * recovery.energy(u)
    return np.asarray(recovery.squares(u) / size) if size > 0 else "there is no stress, and no error of it"


def stress_of(residual: Any, u: fem.Function) -> fem.Function:
    """P as a polynomial of degree k - 1 in each cell, its components row by row; collective."""
    mesh, rows = u.function_space.mesh, u.ufl_shape[0]
    columns, degree = mesh.geometry.dim, u.function_space.element.basix_element.degree - 1
    space, scalar = (fem.functionspace(mesh, ("DG", degree, shape)) for shape in ((rows * columns,), ()))
    tested, product = ufl.TestFunction(space), ufl.inner(ufl.TrialFunction(scalar), ufl.TestFunction(scalar))
    tensor = ufl.as_matrix([[tested[i * columns + j] for j in range(columns)] for i in range(rows)])
    lowered = apply_derivatives(apply_algebra_lowering(residual))
    over_cells = ufl.Form([integral for integral in lowered.integrals() if integral.integral_type() == "cell"])
    with compiling():
        moments = fem.form(map_integrand_dags(_GivenGradient(tensor), over_cells))
        mass = fem.assemble_matrix(fem.form(product * ufl.dx)).to_scipy()
    owned = scalar.dofmap.index_map.size_local
    stress = fem.Function(space)
    values = assemble(moments).reshape(owned, rows * columns)
    if owned:
        stress.x.array[: values.size] = scipy.sparse.linalg.splu(mass[:owned, :owned].tocsc()).solve(values).ravel()
    stress.x.scatter_forward()
    return stress


class _GivenGradient(MultiFunction):  # type: ignore[misc]  # UFL has no types
    """A tensor in the place of the gradient of an argument, and zero in that of the argument itself."""

    expr = MultiFunction.reuse_if_untouched

    def __init__(self, tensor: Any) -> None:
        super().__init__()
        self._tensor = tensor

    def grad(self, gradient: Any) -> Any:
        return self._tensor if isinstance(gradient.ufl_operands[0], ufl.Argument) else gradient

    def argument(self, argument: Any) -> Any:
        return ufl.zero(argument.ufl_shape)
