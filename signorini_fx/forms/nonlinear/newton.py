"""Newton's method for a nonlinear body, starting at its present displacement.

Each iteration solves a linear ``ContactProblem`` for the whole displacement by the semi-smooth
Newton method, see ``linearised``.  Contact pressure and friction are those of the new displacement,
so the old ones enter only through the curvature of the shapes.  A line search follows d . (R(u + s
d) + B^T (lambda, mu)), the slope of the energy with contact where an energy exists; it needs no
energy itself (P. Wriggers, Computational Contact Mechanics, 2006, chapter 10).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from signorini_fx.arrays import Array
from signorini_fx.errors import FormError
from signorini_fx.forms.nonlinear.linearised import Iterate, NonlinearBody, Solved
from signorini_fx.forms.nonlinear.results import ResidualMechanics
from signorini_fx.machine import parallel
from signorini_fx.records import Status
from signorini_fx.results.certificate.certificate import Certificate
from signorini_fx.tuned import (
    CERTIFICATE_TOLERANCE,
    KEPT_TANGENT,
    LINE_SEARCH_STEPS,
    NO_FORCE,
    ROOT_OF_EPS,
    SAME_NUMBER,
    UNITS_OF_PLACES,
    WHOLE_SLOPE,
)


@dataclass(frozen=True)
class Verdict:
    """The judgement of a displacement, or of a search for one that has failed.

    Attributes:
        status: how it has ended.
        detail: what is wrong, or where, as text; "": nothing is known.
        certificate: of the last displacement that was judged; None: none was.
        mechanics: the forces and contact conditions behind the certificate.
        iterations: number of iterations of Newton's method.
        without: why there may be no solution, as text; "": there is no indication.
        cause: why the linear contact problem has no solution; None: it has one, or the cause says
            nothing about the body.
        tried: the displacement at the end of the full increment if no part of it is possible, see
            ``reason_for_none``.
    """

    status: Status
    detail: str = ""
    certificate: Certificate | None = None
    mechanics: ResidualMechanics | None = None
    iterations: int = 0
    without: str = ""
    cause: Status | None = None
    tried: Array | None = None


def newton(
    body: NonlinearBody,
    judge: Callable[[Array | None], Verdict],
    max_newton: int,
) -> Verdict:
    """Run Newton's method from the present displacement and return the verdict of ``judge``;
    collective.

    It ends where increments are small and the certificate holds, or where further iterations do not
    improve the certificate, as with a J that is not the derivative of F. One increment is enough if
    F and contact are linear. Increments within round-off end it, too, with a given J only once they
    are no longer being halved. If the displacement has become negligible, the method restarts once
    from the undeformed body.

    Args:
        body: the body, at the displacement to begin with.
        judge: returns the verdict on the present displacement, given F there.
        max_newton: the largest number of iterations.
    """
    foundations = body.foundations
    u = body.at
    evaluated = body.evaluated
    tangents = body.tangents
    verdict = Verdict(Status.NOT_SOLVED)
    worst = np.inf
    last_change = np.inf
    keeps = False
    comm = body.space.mesh.comm
    iterate: Iterate | None = None
    begun = parallel.largest(comm, np.abs(u.x.array))
    first = farthest = u.x.array.copy()
    residual: Array | None = None
    rests = False
    follows = foundations.moving or any(entry.slides for entry in body.contact)
    is_linear = not follows and evaluated.update is None and tangents.bilinear is not None
    for iteration in range(1, max_newton + 1):
        old = u.x.array.copy()
        coordinates = foundations.coordinates
        residual = evaluated.at(old) if residual is None else residual
        if residual is None:
            return Verdict(Status.INVERTED, "at the values of u before the solve")
        body.slide()
        # Rigid bodies have their own unknowns in the stiffness, so it is assembled anew.
        keeps = keeps and not foundations.rigid_bodies.bodies
        if iterate is None:
            iterate = Iterate(body.bend(symmetric=False), residual)
        else:
            bent = iterate.bent if keeps else body.bend(symmetric=False)
            iterate = replace(iterate, bent=bent, residual=residual)
        solved = body.solve_at(iterate, keeps=keeps)
        iterate = solved.linear.iterate
        increment = solved.values - old
        at = old, increment, residual
        length, residual = line_search(solved, evaluated.at, at, search=iteration > 1)
        if length == 0.0:
            return Verdict(Status.INVERTED, tried=old + increment)
        u.x.array[:] = old + length * increment
        ways = [parallel.largest(comm, np.abs(at - first)) for at in (u.x.array, farthest)]
        if ways[0] > ways[1]:
            farthest = u.x.array.copy()
        moved = length * (solved.rigid - coordinates)
        foundations.carry_to(coordinates + moved)
        change, size = (
            max(
                parallel.largest(comm, np.abs(values)),
                float(np.abs(further).max(initial=0.0)),
            )
            for values, further in ((length * increment, moved), (u.x.array, coordinates + moved))
        )
        small = change <= ROOT_OF_EPS * size
        least = change <= least_increment(solved)
        keeps = length == 1.0 and change <= min(
            KEPT_TANGENT[0] * size, KEPT_TANGENT[1] * last_change
        )
        shortened = tangents.given and 2 * change < last_change
        last_change = change
        ends = small or (length == 1.0 and is_linear)
        if ends or (least and not (shortened and iteration < max_newton)):
            verdict = replace(judge(residual), iterations=iteration)
            certificate = verdict.certificate
            if verdict.status is not Status.NOT_CERTIFIED or certificate is None:
                return verdict
            if certificate.worst < worst:
                worst = certificate.worst
            elif rests or parallel.largest(comm, np.abs(u.x.array)) > ROOT_OF_EPS * begun:
                return verdict
            else:
                u.x.array[:], residual, keeps, rests = 0.0, None, False, True
    # Iterates may alternate between both sides of a limit point: go beyond it to test the tangent.
    u.x.array[:] = farthest
    return replace(verdict, status=Status.NOT_SOLVED)


def least_increment(solved: Solved) -> float:
    """Return the largest increment that may be round-off of the displacement, of node coordinates,
    or of the position of loose bodies, length; collective.
    """
    scales = solved.linear.elastic.scales
    bounds = np.abs(solved.linear.elastic.pieces.bounds)
    places = UNITS_OF_PLACES * float(np.finfo(float).eps * bounds.max())
    loose = scales.coordinate_error / NO_FORCE if solved.loose else 0.0
    return max(SAME_NUMBER * scales.size, places, loose)


def line_search(
    solved: Solved,
    forces_at: Callable[[Array], Array | None],
    at: tuple[Array, Array, Array],
    *,
    search: bool,
) -> tuple[float, Array | None]:
    """Return the accepted fraction of an increment, and F there; or 0 and None if F cannot be
    evaluated at any fraction; collective.

    The fraction is halved while F cannot be evaluated (also if ``Residual.at`` raises a FormError),
    and if ``search`` holds while the slope of the energy along the increment is not small enough.

    Args:
        solved: the solution of the contact problem.
        forces_at: returns F at values of ``u``, or None if it is not finite.
        at: values of ``u`` and the increment, ghosts included, and F at the owned unknowns.
        search: whether to check the slope; prescribed values must arrive in the first iteration.

    Raises:
        FormError: ``forces_at`` raised it at the smallest fraction.
    """
    old, increment, residual = at
    comm = solved.body.space.mesh.comm
    owned = len(residual)
    internal, turning, on_rigid = solved.internal(increment)
    ahead = np.where(solved.linear.prescribed[0][:owned], 0.0, increment[:owned])

    def along(forces: Array) -> float:
        return parallel.total(comm, ahead @ forces)

    first = -along(internal) - on_rigid
    size, change = (parallel.largest(comm, np.abs(values)) for values in (old, increment))
    search = search and first < 0 and change > CERTIFICATE_TOLERANCE * size
    steepest = WHOLE_SLOPE * abs(first) if search else np.finfo(float).max
    share = 2.0
    slope = np.inf
    for _ in range(LINE_SEARCH_STEPS + 1):
        share = share / 2
        failed = None
        slope = np.inf
        try:
            forces = forces_at(old + share * increment)
        except FormError as error:
            forces, failed = None, error
        if forces is not None:
            # The contact forces of the linearised problem are -a(d, .) - R(u); along d they turn
            # with the normals.
            slope = along(forces - internal - residual + share * turning) - (1.0 - share) * on_rigid
        if slope <= steepest:
            break
    if np.isfinite(slope):
        return share, forces
    if failed is not None:
        raise failed
    return 0.0, None
