"""The solution of a ``ContactProblem``, which results, report, pictures and proofs read as that of a scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from dolfinx import fem

from signorini_fx import parallel
from signorini_fx.accuracy.stress_recovery import StressRecovery
from signorini_fx.body.deformation import deformation_of
from signorini_fx.check.findings import result_findings
from signorini_fx.check.pushed_nodes import held_in_result, pushed_nodes
from signorini_fx.forms.certificate import balance_of, sides_of
from signorini_fx.forms.named_parts import named_body, path_of
from signorini_fx.forms.parts import ProblemParts
from signorini_fx.forms.resultants import FormResultants, integrals_of
from signorini_fx.forms.stated_data import stated_body
from signorini_fx.forms.stress import stresses_of
from signorini_fx.model import Model
from signorini_fx.quantities.statements import Refused
from signorini_fx.records import Status
from signorini_fx.results.contact_nodes import ContactSide
from signorini_fx.results.equilibrium import Balance
from signorini_fx.results.functionals import functionals
from signorini_fx.results.resultants import Resultants
from signorini_fx.results.safety import Safety
from signorini_fx.results.sections import SectionForce
from signorini_fx.results.solution import Solution
from signorini_fx.results.stresses import RawStresses
from signorini_fx.solving.load_steps import step_result
from signorini_fx.solving.one_mesh import algorithm_name, used_parameters


@dataclass(frozen=True, repr=False)
class FormSolution(Solution):
    """The solution of a ``ContactProblem``; what forms cannot say is absent from its results.

    Attributes:
        model: the body, of which no moduli and loads are known.
        balance: the forces on a displacement of the body without contact, by the forms as they are now.
        stated: the body with loads, supports and moduli as a scene states them, see ``stated_body``.
        stress_of: the stress of a displacement; None: the problem was given none.
        contacts: the parts of the boundary with contact.
        forms: a and L as the user gave them.
        boundaries: the parts of the boundary with names given by the user.
        fixed: which dofs of this rank are prescribed, ghosts included, shape (dofs,).
    """

    balance: Callable[[fem.Function], Balance] = lambda y: NotImplemented
    stated: Callable[[Model], Model] = lambda body: body
    stress_of: Callable[[fem.Function, dict[str, StressRecovery]], RawStresses] | None = None
    contacts: Sequence[ContactSide] = ()
    forms: tuple[Any, Any] = (None, None)
    boundaries: dict[str, Any] | None = None
    fixed: Any = None

    @property
    def has_stress(self) -> bool:
        """See ``Solution``."""
        return self.stress_of is not None

    @cached_property
    def stated_body(self) -> Model | str:
        """See ``Solution``."""
        try:
            return self.stated(self.model)
        except Refused as refused:
            return str(refused)

    @cached_property
    def stress(self) -> RawStresses:  # type: ignore[override]
        """See ``Solution``.

        Raises:
            RuntimeError: the problem was given no ``stress``.
        """
        if self.stress_of is None:
            raise RuntimeError("only the form knows the stresses: give stress=, a function of the displacement")
        return self.stress_of(self.displacement, self.shared)

    @cached_property
    def sides(self) -> list[ContactSide]:
        """See ``Solution``."""
        return list(self.contacts)

    @cached_property
    def resultants(self) -> Resultants:
        """See ``Solution``: of contact, and through the parts of the boundary that have names."""
        return FormResultants(
            self.statement,
            self.model.tagged,
            self.displacement,
            self.contact,
            self.balance(self.displacement),
            self.contacts,
            integrals_of(*self.forms, self.displacement.function_space.mesh),
            self.boundaries or {},
            self.fixed,
        )

    @cached_property
    def preloads(self) -> list[SectionForce]:
        """None: forms name no sections."""
        return []

    @cached_property
    def safety(self) -> Safety | None:
        """None: forms do not say which loads are live."""
        return None


def solution_of(problem: ProblemParts, title: str = "") -> FormSolution:
    """The last solution of a problem, or its last iterate, with the values that its forms have now; collective.

    Args:
        problem: solved.
        title: of the results.

    Raises:
        RuntimeError: it has not been solved.
    """
    state, outcome, task, path = problem.state, problem._outcome, problem._task, problem._path
    if outcome is None:
        raise RuntimeError("there is no solution so far: call solve()")
    assert problem.status is not None
    assert problem.certificate is not None
    space, body = problem._space, named_body(problem, title)
    statement, load_path, count = body.statement, path_of(problem), problem._begun.step
    steps = () if path is None else path.steps
    if path is None:
        displacement = problem.u.copy()
        displacement.name = problem.u.name
        result = step_result(
            load_path,
            count,
            count,
            problem.status,
            displacement,
            state,
            problem.certificate,
            deformation_of(body, displacement, body.tagged.size),
            len(problem.history.iterations) - problem._marks,
        )
        steps = (replace(result, tools=problem.tools),)
    shown = ([step for step in steps if step.status is Status.CONVERGED] or [*steps])[-1]
    # Of a load step that has failed the forms are not those of the results, which are of one before it.
    settled = shown is steps[-1]
    data, values = problem._begun.data, None
    if settled and not task.has_coulomb:
        values = functionals(shown.certificate.potential_energy, state, replace(data, gap=state.gap))
    contacts = [step.contact.in_contact.any() for step in steps if step.contact is not None]
    touching = parallel.any_rank(body.comm, bool(np.any(contacts)))
    lost = sorted({piece for step in steps for piece in step.certificate.unjudged})
    unjudged = [body.motions.pieces.called(piece) for piece in lost]
    held = [held_in_result(step.contact, step.displacement, body.pairs) for step in steps]
    findings = [
        *pushed_nodes(body.comm, held, body.tagged.size),
        *result_findings([step.deformation for step in steps], touching=touching, unjudged=unjudged),
    ]
    law, fixed, values_of_bcs = problem._law, *problem._prescribed
    return FormSolution(
        status=steps[-1].status,
        algorithm=algorithm_name(statement, outcome),
        model=body,
        displacement=shown.displacement,
        contact=shown.contact,
        functionals=values,
        certificate=shown.certificate,
        steps=tuple(steps),
        history=problem.history,
        parameters=used_parameters(outcome, data, shown.strain_energy),
        timings=problem._timings if path is None else path.timings,
        linear_algebra=task.linear_algebra,
        found=lambda: tuple(findings),
        balance=lambda y: balance_of((problem._a, problem._L), y, fixed, values_of_bcs, problem._scales),
        stated=partial(stated_body, problem),
        stress_of=None if law is None else partial(_stress_of, problem),
        contacts=sides_of(problem._data, problem.contact, problem._named, space),
        forms=problem._forms if settled else (None, None),
        boundaries=problem._boundaries if settled else {},
        fixed=fixed,
    )


def _stress_of(problem: ProblemParts, y: fem.Function, shared: dict[str, StressRecovery]) -> RawStresses:
    """The stress of a displacement; what projects is made once for all load steps."""
    touching = [*problem._named[0], *problem._named[1].values()]
    assert problem._law is not None
    return stresses_of(problem._law, y, problem._parts, problem._forms, touching, problem._prescribed[0], shared)
