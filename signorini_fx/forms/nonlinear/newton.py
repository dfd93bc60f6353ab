"""Newton's method for a nonlinear body, from where it is.

It has the semi-smooth method for contact inside: each of its iterations is a linear
``ContactProblem`` for the whole displacement, see ``linearised``.  Contact pressure and friction
are those of the new displacement, so the old ones only enter through the curvature of the shapes.
A line search follows d . (R(u + s d) + B^T (lambda, mu)), the slope of the energy with
contact where there is one; it needs no energy (P. Wriggers, Computational Contact Mechanics, 2006,
chapter 10).
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
    """What is said of a displacement, or of the search for one.

    Attributes:
        status: how it has ended.
        detail: what is wrong, or where, in words; "": nothing is known.
        certificate: of the last displacement that was judged; None: none was.
        mechanics: what the certificate is of.
        iterations: of Newton's method.
        without: why there may be no solution, in words; "": nothing says so.
        cause: why the linear contact problem has no solution; None: it has one, or that says
            nothing of the body.
        tried: see ``reason_for_none``.
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
    """Newton's method from where the body is, with one increment where F and contact are linear,
    and what ``judge`` says of its end, where F is given; collective.

    It ends where increments are small and the certificate holds, or, as with a J that is not
    the derivative of F, iterations no longer make it better.  With a J the residual of a body
    at rest is round-off once increments are no longer halved; where the displacement is
    round-off, it goes on from the undeformed body.
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
        # Rigid bodies have unknowns in the stiffness.
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
    # On both sides of a limit point in turn: its tangent is asked beyond it.
    u.x.array[:] = farthest
    return replace(verdict, status=Status.NOT_SOLVED)


def least_increment(solved: Solved) -> float:
    """Return increments that may be round-off of the body, its places, or loose bodies, length;
    collective.
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
    """Return the share of an increment to take, and F there; 0 and None: there is no F however
    short it is; collective.

    It is halved where F cannot be evaluated, by a FormError of ``Residual.at``, too, or where
    ``search`` and the slope of the energy along it has not become smaller; prescribed values must
    arrive.  ``at``: values of ``u`` and the increment to them, ghosts included, and F at the owned
    unknowns.
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
            # The contact forces of the linearised problem are - a(d, .) - R(u); along d they turn
            # with the normals.
            slope = along(forces - internal - residual + share * turning) - (1.0 - share) * on_rigid
        if slope <= steepest:
            break
    if np.isfinite(slope):
        return share, forces
    if failed is not None:
        raise failed
    return 0.0, None
