"""Whether Coulomb friction has one discrete solution only, proved from the stiffness of the contact points.

Let v be the difference of the relative displacements of two solutions with the same loads, and r that of the nodal
contact forces, so that S v = -r with the condensed stiffness S.  At every point

    r_N v_N >= 0        and        r_T . v_T >= -F |r_N| |v_T|,

the second one because the bound of a point is Lipschitz continuous in its pressure with the constant F, and the shear
is monotone in the slip at a fixed bound.  Both hold with and without regularisation, for bounds with a limit, for
bilateral contact and for an increment of a load step.  With weights nu_i > 0, tau_i = 1 and
F |r_N| |v_T| <= F (d r_N^2 + v_T^2 / d) / 2,

    v^T D S v <= F / 2 (sum d_i (S v)_N,i^2 + |v_T,i|^2 / d_i),        D = diag(nu, tau).

So the solution is the only one if the symmetric part of D S minus the matrix on the right is positive definite.  Any
weights give a proof; they are chosen to make the largest such F as large as possible.  Tresca friction at a point is
F = 0: its shear stays in r.  A bond holds its point.  docs/theory.md derives it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.linalg import LinAlgError, cholesky, eigh
from scipy.optimize import minimize

from signorini_fx.addons.uniqueness.contact_stiffness import contact_stiffness
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.algebra.contact.state import PointState
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.model import Model
from signorini_fx.quantities.proved_statements import Uniqueness
from signorini_fx.tuned import (
    INDEFINITE,
    PROVED_SHARE,
    RANDOM_STARTS,
    ROUGH_MULTIPLE,
    SECOND_SOLUTION_DIFFERS,
    SECOND_SOLUTION_DIVERGED,
    SECOND_SOLUTION_HOLDS,
    SINGULAR,
    SOLVES_FROM_START,
    STEPS_ON_THE_WAY,
    WORTHWHILE_GAIN,
)

# Exponent of the norm that replaces the largest eigenvalue, and how often it is evaluated.
_SMOOTH, _EVALUATIONS = 60, 150

# Which normal components are closed, and +1 or -1 where a tangential one slips, 0 where it sticks.
_Sets = tuple[npt.NDArray[np.bool_], Nodal]


@dataclass(frozen=True)
class _Rough:
    """The components of contact points that move, condensed onto: normal ones first, then those with friction.

    Attributes:
        stiffness: S, force per length, shape (m, m).
        normal: the points of the first components, shape (n,).
        tangential: the points of the others, shape (m - n,).
        beside: for each of these the place of its point in ``normal``, shape (m - n,); any where F = 0.
        free: an orthonormal basis of the motions without a force, shape (m, k).
    """

    stiffness: Nodal
    normal: npt.NDArray[np.int64]
    tangential: npt.NDArray[np.int64]
    beside: npt.NDArray[np.int64]
    free: Nodal


def uniqueness(
    model: Model, contact: ContactState | None, *, place: float | None = None, search: bool | None = None
) -> Uniqueness:
    """The statement for a load step with a solution, given the ones before it.

    Args:
        model: the model.
        contact: its contact nodes in the solution; None: there is no solution yet, and no other one is searched for.
        place: of the load step in the lists of factors; None: the last one.
        search: for other solutions; None: where this one is not proved to be the only one.
    """
    law = model.law
    if model.statement.joint_loads:
        return Uniqueness(False, 0.0, reason="a load that enters the contact depends on what opens")
    # Without a coefficient the problem is the minimum of a convex functional.
    assumed = [
        "given the load steps before" if (model.statement.steps - 1 if place is None else place) > 0 else "",
        *model.statement.assumed,
    ]
    if law is None or not model.statement.has_coulomb:
        return Uniqueness(True, np.inf, assumed="; ".join(filter(None, assumed)))
    stiffness = contact_stiffness(model, place)
    if isinstance(stiffness, str):
        return Uniqueness(False, 0.0, reason=stiffness)
    assumed.append("the stiffness is taken as computed")
    return replace(uniqueness_of(*stiffness, law, contact, search=search), assumed="; ".join(filter(None, assumed)))


def uniqueness_of(
    stiffness: Nodal, operator: Nodal, law: PointFriction, state: PointState | None, *, search: bool | None = None
) -> Uniqueness:
    """Whether the solution of a problem with Coulomb friction is the only one; one rank.

    Args:
        stiffness: of some unknowns without the prescribed ones, the others eliminated, shape (u, u).
        operator: B on these, rows (n, T) of each of p points, shape (p d, u).
        law: of friction.
        state: the solution; None: no other one is searched for.
        search: for other ones; None: where it is not proved to be the only one.
    """
    rough = components(stiffness, operator, law)
    if isinstance(rough, str):
        return Uniqueness(False, 0.0, reason=rough)
    multiple, why, _ = critical(rough, law.coefficient)
    acting = law.coefficient[np.unique(rough.tangential)]
    acting = acting[acting > 0]
    uniform = acting.size and np.ptp(acting) <= SINGULAR * acting[0] and np.isfinite(multiple)
    proved = multiple > 1
    other_solutions: list[Nodal] = []
    starts = 0
    if state is not None and (search or (search is None and not proved)):
        if state.points.dimension > 2:
            why = "; ".join(filter(None, (why, "only solutions in the plane are searched for")))
        else:
            other_solutions, starts = _other_solutions(rough, law, state)
    return Uniqueness(
        proved, multiple, float(multiple * acting[0]) if uniform else None, tuple(other_solutions), starts, why
    )


def components(stiffness: Nodal, operator: Nodal, law: PointFriction) -> _Rough | str:
    """The stiffness of normal components and of tangential ones with friction; or why there is none."""
    coefficient, count = law.coefficient, law.coefficient.size
    moves = np.linalg.norm(operator, axis=1) > SINGULAR
    by_point = moves.reshape(count, -1)
    if ((coefficient > 0) & ~by_point[:, 0] & by_point[:, 1:].any(axis=1)).any():
        return "a support takes the pressure at a point that friction acts on"
    rows = operator[moves]
    q, r = np.linalg.qr(rows.T, mode="complete")
    r = r[: len(rows)]
    if len(rows) > len(stiffness) or np.abs(np.diag(r)).min(initial=np.inf) <= SINGULAR:
        return "some contact points share a node, or are held in a direction of their own"
    # x = q1 r^-T v + q2 z, of which z has no force.
    change = np.column_stack((np.linalg.solve(r, q[:, : len(rows)].T).T, q[:, len(rows) :]))
    transformed = change.T @ stiffness @ change
    point, component = np.nonzero(by_point)
    bonded = np.isinf(law.given[point])
    rubs = (component > 0) & ((coefficient[point] > 0) | (law.given[point] > 0))
    order = np.concatenate((np.flatnonzero((component == 0) & ~bonded), np.flatnonzero(rubs & ~bonded)))
    eliminated = np.setdiff1d(np.arange(len(transformed)), np.concatenate((order, np.flatnonzero(bonded))))
    schur = transformed[np.ix_(order, order)]
    if eliminated.size:
        coupling = transformed[np.ix_(eliminated, order)]
        values, vectors = np.linalg.eigh(transformed[np.ix_(eliminated, eliminated)])
        hard = values > SINGULAR * values[-1]
        inside = vectors[:, hard].T @ coupling
        schur = schur - inside.T @ (inside / values[hard, None])
    schur = (schur + schur.T) / 2
    normal = point[order[component[order] == 0]]
    tangential = point[order[component[order] > 0]]
    values, vectors = np.linalg.eigh(schur)
    free = vectors[:, values <= SINGULAR * values[-1]]
    beside = np.minimum(np.searchsorted(normal, tangential), max(normal.size - 1, 0))
    return _Rough(schur, normal, tangential, beside, free)


def critical(rough: _Rough, coefficient: Nodal, evaluations: int = _EVALUATIONS) -> tuple[float, str, Nodal]:
    """The multiple of the coefficients below which the solution is proved to be the only one; why it is zero; and the
    weights d of the tangential components, length per force, shape (m - n,).
    """
    normal, count = rough.normal.size, len(rough.stiffness)
    unit_weights = np.ones(count - normal)
    if not (coefficient[rough.tangential] > 0).any():
        return np.inf, "", unit_weights
    if np.abs(rough.free[normal:]).max(initial=0.0) > SINGULAR**0.5:
        return 0.0, "nothing but friction holds the body along its foundation", unit_weights
    unit = float(np.abs(rough.stiffness).max())
    # In units of the stiffness, so that nodal compliance is of order one.
    stiffness = rough.stiffness / unit
    rows, sizes = stiffness[rough.beside], coefficient[rough.tangential]
    basis = np.linalg.svd(rough.free, full_matrices=True)[0][:, rough.free.shape[1] :] if rough.free.size else None
    compliance = np.diag(np.linalg.pinv(stiffness, rcond=SINGULAR, hermitian=True))[normal:]
    first = np.concatenate(([0.0], np.log(np.sqrt(compliance / np.diag(stiffness)[rough.beside]))))

    def matrices(weights: Nodal) -> tuple[Nodal, Nodal, Nodal]:
        """The symmetric part of D S, half the right side for F, and D."""
        extra = weights[0] if rough.free.size else weights[: weights.size - sizes.size]
        d = np.exp(weights[-sizes.size :])
        scale = np.concatenate((np.full(normal, 1.0) * np.exp(extra), np.ones(sizes.size)))
        left_side = scale[:, None] * stiffness
        right = rows.T @ ((sizes * d)[:, None] * rows)
        places = np.arange(normal, count)
        right[places, places] += sizes / d
        return (left_side + left_side.T) / 2, right / 2, scale

    def reduced(matrix: Nodal) -> Nodal:
        return matrix if basis is None else basis.T @ matrix @ basis

    def value(weights: Nodal) -> tuple[float, Nodal]:
        """The logarithm of the smoothed largest eigenvalue, and its derivative."""
        left_side, right, scale = matrices(weights)
        try:
            values, vectors = eigh(reduced(right), reduced(left_side), driver="gvd")
        except LinAlgError:  # the left side is not positive definite
            return INDEFINITE, np.zeros_like(weights)
        values = np.maximum(values, 0.0)
        top = values[-1]
        share = (values / top) ** _SMOOTH
        x = vectors if basis is None else basis @ vectors
        weight = share / values.clip(min=1e-300) / share.sum()
        sx, d = stiffness @ x, np.exp(weights[-sizes.size :])
        by_d = 0.5 * sizes[:, None] * (d[:, None] * sx[rough.beside] ** 2 - x[normal:] ** 2 / d[:, None])
        by_nu = -values * scale[:normal, None] * x[:normal] * sx[:normal]
        gradient = np.concatenate((by_nu, by_d)) @ weight
        if rough.free.size:
            gradient = np.concatenate(([gradient[:normal].sum()], gradient[normal:]))
        return float(np.log(top) + np.log(share.sum()) / _SMOOTH), gradient

    nus = np.zeros(1 if rough.free.size else normal)
    best = np.concatenate((nus, first[1:]))
    spent, reached = 0, value(best)[0]
    while spent < evaluations:  # a search that leaves the weights with a proof ends early, and begins again
        minimum = minimize(value, best, jac=True, method="L-BFGS-B", options={"maxfun": evaluations - spent})
        spent += minimum.nfev
        if not minimum.fun < reached - WORTHWHILE_GAIN:
            break
        best, reached = minimum.x, minimum.fun
    left_side, right, _ = (*map(reduced, matrices(best)[:2]), None)
    multiple = 1.0 / float(
        eigh(right, left_side, eigvals_only=True, subset_by_index=(len(left_side) - 1, len(left_side) - 1))[0]
    )
    if not _definite(left_side - multiple * PROVED_SHARE * right):
        return 0.0, "round-off hides it", unit_weights
    return multiple * PROVED_SHARE, "", np.exp(best[-sizes.size :]) / unit


def _definite(matrix: Nodal) -> bool:
    """Whether a symmetric matrix is positive definite, proved with the round-off of the Cholesky factorisation.

    S. M. Rump, Verification of positive definiteness, BIT 46 (2006) 433-452: it is if the factorisation of the matrix
    minus (n + 2) eps times its trace succeeds; the entries of the matrix have the error of a few such sums.
    """
    scale = 1 / np.sqrt(np.diag(matrix)) if (np.diag(matrix) > 0).all() else None
    if scale is None:
        return False
    scaled = scale[:, None] * matrix * scale
    size = len(matrix)
    try:
        cholesky(scaled - 4 * (size + 2) * np.finfo(float).eps * np.trace(scaled) * np.eye(size), lower=True)
    except LinAlgError:
        return False
    return True


@dataclass(frozen=True)
class _Law:
    """The unregularised conditions of the kept components in the plane; forces are nodal, arrays one entry per point.

    Attributes:
        gap: of the normal components, length, shape (n,).
        origin: of the slip of the tangential ones, length, shape (t,).
        friction: of the tangential ones, with forces for stresses.
        bilateral: normal components that cannot open, shape (n,).
        load: S v + r, force, shape (n + t,).
        size: of displacements, length.
    """

    gap: Nodal
    origin: Nodal
    friction: PointFriction
    bilateral: npt.NDArray[np.bool_]
    load: Nodal
    size: float


def _other_solutions(rough: _Rough, law: PointFriction, state: PointState) -> tuple[list[Nodal], int]:
    """Solutions without regularisation that differ from the given one, as relative displacements; and the starts."""
    weight, n = state.points.weight, rough.normal.size
    v = np.concatenate((state.u_n[rough.normal], state.u_t[rough.tangential, 0]))
    force = np.concatenate(((weight * state.pressure)[rough.normal], (weight * state.shear[:, 0])[rough.tangential]))
    at, load = rough.tangential, rough.stiffness @ v + force
    alone = np.linalg.lstsq(rough.stiffness, load, rcond=SINGULAR)[0]
    data = _Law(
        gap=state.gap[rough.normal],
        origin=(state.u_t - state.slip_length)[at, 0],
        friction=law.forces(weight).at(at),
        bilateral=state.bilateral[rough.normal],
        load=load,
        size=float(max(np.abs(part).max() for part in (alone, v, state.gap))),
    )
    touching = state.in_contact[rough.normal]
    side = np.sign(state.direction[at, 0])
    nearby = _newton(rough, data, touching, side)
    solutions = [v if nearby is None else nearby[0]]
    chance = np.random.default_rng(0)
    no_slip, all_closed = np.zeros(at.size), np.ones(n, dtype=bool)
    starts: list[_Sets] = [
        (~all_closed, no_slip),
        (all_closed, no_slip),
        (all_closed, no_slip + 1),
        (all_closed, no_slip - 1),
    ]
    starts += [(touching, s) for s in (no_slip, no_slip + 1, no_slip - 1)]
    starts += [(chance.random(n) < 0.5, chance.integers(-1, 2, at.size).astype(float)) for _ in range(RANDOM_STARTS)]
    starts += [
        *_along_path(rough, data, np.linspace(0, 1, STEPS_ON_THE_WAY)[:-1]),
        *_along_path(rough, data, np.geomspace(ROUGH_MULTIPLE, 1, STEPS_ON_THE_WAY)[:-1]),
    ]
    for start in starts:
        solution = _newton(rough, data, *start)
        if solution is not None and all(_apart(solution[0], accepted) for accepted in solutions):
            solutions.append(solution[0])
    return solutions[1:], len(starts)


def _apart(a: Nodal, b: Nodal) -> bool:
    """Whether two displacements differ by more than what regularisation and round-off do."""
    return bool(np.abs(a - b).max() > SECOND_SOLUTION_DIFFERS * max(np.abs(a).max(), np.abs(b).max()))


def _along_path(rough: _Rough, data: _Law, factors: npt.NDArray[np.floating[Any]]) -> Iterator[_Sets]:
    """The sets of solutions with other multiples of the friction coefficient, each begun from the one before."""
    sets: _Sets = np.ones(rough.normal.size, dtype=bool), np.zeros(rough.tangential.size)
    for factor in factors:
        changed = replace(data, friction=replace(data.friction, coefficient=factor * data.friction.coefficient))
        solution = _newton(rough, changed, *sets)
        if solution is not None:
            sets = solution[1], solution[2]
    yield sets


def _newton(
    rough: _Rough, data: _Law, contact: npt.NDArray[np.bool_], side: Nodal
) -> tuple[Nodal, npt.NDArray[np.bool_], Nodal] | None:
    """An active set method; the solution with its sets if all conditions hold, None if it ends elsewhere."""
    n, stiffness, friction = rough.normal.size, rough.stiffness, data.friction
    seen: set[bytes] = set()
    for _ in range(SOLVES_FROM_START):
        contact = contact | data.bilateral
        pressed = contact[rough.beside] | (friction.given > 0)
        key = contact.tobytes() + side.tobytes()
        if key in seen:
            return None
        seen.add(key)
        # One row per component: a displacement, or a force r = load - S v.
        matrix, right = stiffness.copy(), data.load.copy()
        matrix[:n][contact], right[:n][contact] = np.eye(n, len(matrix))[contact], data.gap[contact]
        slips = side != 0
        stick = pressed & ~slips
        coefficient = np.where(pressed & slips, side * friction.coefficient, 0.0)
        matrix[n:] -= coefficient[:, None] * stiffness[rough.beside]
        right[n:] -= coefficient * data.load[rough.beside] + np.where(pressed & slips, side * friction.given, 0.0)
        matrix[n:][stick], right[n:][stick] = np.eye(len(matrix))[n:][stick], data.origin[stick]
        try:
            v: Nodal = np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)
        except np.linalg.LinAlgError:
            return None
        force = data.load - stiffness @ v
        scale, size = np.abs(data.load).max(), data.size
        if np.abs(v).max() > SECOND_SOLUTION_DIVERGED * size:  # of a matrix that is singular but for round-off
            return None
        away = (
            np.where(
                contact, force[:n] < -SECOND_SOLUTION_HOLDS * scale, v[:n] <= data.gap + SECOND_SOLUTION_HOLDS * size
            )
            & ~data.bilateral
        )
        bound = friction.bound(force[rough.beside])
        slip = v[n:] - data.origin
        turned = np.where(
            stick,
            np.abs(force[n:]) > bound + SECOND_SOLUTION_HOLDS * scale,
            slips & pressed & (side * slip < -SECOND_SOLUTION_HOLDS * size),
        )
        new_side = np.where(stick & turned, np.sign(force[n:]), np.where(turned, 0.0, side))
        new_contact = ~away
        if (new_contact == contact).all() and not turned.any():
            line = friction.given + friction.coefficient * np.abs(force[rough.beside])
            return None if (pressed & slips & (line > bound)).any() else (v, contact, side)
        contact, side = new_contact, new_side
    return None
