"""How solves and ramps of nonlinear bodies end: which outcomes mean what, and in words."""

from __future__ import annotations

from signorini_fx.errors import FormError
from signorini_fx.records import Status
from signorini_fx.results.certificate.certificate import Certificate

# What the statics of linear bodies prove.
OF_LINEAR_BODIES = (
    Status.OPEN,
    Status.TIPS,
    Status.SLIDES,
    Status.SLIDES_AT_PRESSURES,
    Status.TOO_LARGE,
    Status.SINGULAR,
)
# How a solve ends because of where two bodies, or a body and a shape, are.
BETWEEN_BODIES = (Status.PASSED, Status.FOLDED, Status.AT_END)
# How a solve ends that says nothing of the stiffness.
NOT_BY_STIFFNESS = (
    *BETWEEN_BODIES,
    Status.INSIDE,
    Status.TOO_LARGE,
    Status.NO_DIGIT,
    Status.NOT_CERTIFIED,
    Status.NO_MEMORY,
    Status.NOT_HELD,
    Status.OPEN,
)
_NEWTON_FAILS = "Newton's method fails, which does not prove that there is no solution"
# What smaller steps do not change.
FINAL = (Status.STABILITY_UNKNOWN, Status.NO_DIGIT, Status.NO_MEMORY, Status.NOT_HELD, Status.OPEN)


def failure(status: Status, certificate: Certificate | None, says_no: str, detail: str) -> str:
    """How a solve ends that has no solution, in words; ``certificate``: of its last iterate; ``says_no``: why there may
    be no solution; ``detail``: what is wrong, or where; empty: nothing is known.
    """
    reason = says_no
    if status in (Status.INSIDE, Status.TOO_LARGE, *BETWEEN_BODIES):
        reason = detail
    elif status in (Status.NOT_SOLVED, Status.OPEN, Status.UNSTABLE):
        reason = says_no or detail
    elif certificate is not None and status in (Status.NOT_CERTIFIED, Status.MAX_ITERATIONS):
        reason = f"{certificate.worst_name} {certificate.worst:.1e}"
    ended = "deformation too large for small strains" if status is Status.TOO_LARGE else status.value
    return ended + (f" ({reason})" if reason else "")


def advice_on_forms(status: Status) -> str:
    """What to do about the outcome of a solve of forms, whose arguments it names."""
    if status in (Status.NOT_SOLVED, Status.MAX_ITERATIONS):
        return (
            f"{_NEWTON_FAILS}: take smaller steps, near a limit point prescribe a displacement instead of a force, "
            "raise max_newton, give the derivative of F as J, or refine the mesh"
        )
    return status.advice


def last_solution(reached: float | None, to: float | None) -> str:
    """Up to which load of a ramp ``to`` one, or which time of a path, there is a solution, in words; None: to none."""
    if reached is None:
        return "there is no solution before it"
    return f"there is a solution at time {reached:g}" if to is None else f"there is a solution at {reached:g} of {to:g}"


def at_load(error: FormError, where: str, last: str) -> FormError:
    """An error of the last step of a ramp; ``where``: its load or time, in words; ``last``: see ``last_solution``."""
    reasons = [(key, f"{reason} (at {where}; {last})") for key, reason in error.problems]
    return FormError(reasons, error.source)


def end_of_ramp(status: Status, failure: str, where: str, last: str, advice: str) -> str:
    """The message of a ramp whose last step, to ``where``, has no solution: ``failure``; ``last``: see
    ``last_solution``.
    """
    if status is Status.LIMIT:
        text = f"{status.value}: {last}; a step to {where} ends with: {failure}"
    else:
        text = f"{failure}: at {where}; {last}"
    return f"{text}. {advice[0].upper()}{advice[1:]}"
