"""The last solution of a nonlinear body with the derivative of its equilibrium there, as adjoint states take it."""

from __future__ import annotations

from typing import Any

from signorini_fx.errors import FormError
from signorini_fx.forms.nonlinear.linearised import LinearisedProblem
from signorini_fx.forms.nonlinear.newton import EquilibriumSolver


def linearised_at(solver: EquilibriumSolver, linear: LinearisedProblem) -> tuple[Any, ...]:
    """The last solution with its linearised problem, see ``SolvedStep.of``; collective.

    Args:
        solver: that has found it.
        linear: its contact problem, or a copy, which is assembled there.

    Raises:
        RuntimeError: it depends on the state of a material before the last step, which is not kept.
        FormError: its derivatives are not known.
        MatrixError: the tangent is not finite.
    """
    residual = solver.residual
    for number, entry in enumerate(linear.stated):
        if entry.against is not None and not entry.bonded:
            raise FormError([(f"contact[{number}]", "derivatives are not possible yet where two bodies touch")])
    if linear.moving_tools.coordinates.size:
        raise FormError([("contact", "derivatives are not possible yet where forces move a foundation")])
    begun = solver.begun
    assert begun is not None
    advanced = linear.beginning().last is not begun.beginning.last
    if residual.has_state and (advanced or linear.step > 0):
        why = "the solution depends on the state of the material before it, whose derivatives are not kept"
        raise RuntimeError(f"{why}: ask for derivatives of the first step, before advance()")
    values = solver.u.x.array.copy()
    residual.go_to(values)
    if not solver.stability.leads(values):
        raise FormError([("J", "is not the derivative of F at the solution: leave it out, or mend it")])
    with begun.returned_to(linear):
        return linear.derivative_at_solution()
