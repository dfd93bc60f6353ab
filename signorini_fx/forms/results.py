"""The results of a ``ContactProblem``: its solution and errors."""

from __future__ import annotations

from dataclasses import replace

from signorini_fx.errors import FormError
from signorini_fx.forms.solver import FormSolver
from signorini_fx.mechanics.contact_points.contact_table import contact_table
from signorini_fx.mechanics.statement.load_path import LoadPath
from signorini_fx.records import Status
from signorini_fx.results.accuracy.error_estimates import Errors, combined
from signorini_fx.results.solution import Solution
from signorini_fx.results.stresses import RawStresses
from signorini_fx.solving.load_steps import StepProgress
from signorini_fx.solving.solve_on_mesh import contact_solution, findings_of_steps


def solution_of(solver: FormSolver, path: LoadPath | None, progress: StepProgress | None, title: str = "") -> Solution:
    """The last solution, or the last iterate, with the values that the forms have now; of a run its path, and how its
    load steps have ended; collective.

    Raises:
        RuntimeError: there is none so far.
    """
    outcome = solver.outcome
    if outcome is None:
        raise RuntimeError("there is no solution so far: call solve()")
    alone = solver.result
    assert alone is not None
    steps = [alone] if progress is None else progress.results
    ended = (outcome, outcome.problem.data) if progress is None else progress.ended
    assert ended is not None
    # Of a load step that has failed the forms are not those of the results, which are of one before it.
    settled = steps[-1].status is Status.CONVERGED or len(steps) == 1
    body = replace(solver.model(path, title), settled=settled)
    findings = findings_of_steps(body, steps, [], solver.foundations.placed_shapes)
    return contact_solution(body, steps, solver.task, ended, solver.timings, lambda: tuple(findings))


def errors_of(solver: FormSolver, stress: RawStresses) -> Errors:
    """Estimated errors of the last solution, see ``ContactProblem.errors``; ``stress``: of it; collective.

    Raises:
        FormError: the forms are multiplied by a measure, which the estimate does not know; or there is no contact.
    """
    forms = solver.forms
    if not forms.contact:
        raise FormError([("contact", "there is none, and no error of its pressure: of the stress see stress.error")])
    if forms.weighted:
        raise FormError([("stress", "there is no error estimate where the forms are multiplied by a measure")])
    table, squares = contact_table(solver.state, forms.names), stress.recovery().squares(solver.u)
    return combined(solver.model(), table, squares, stress.energy())
