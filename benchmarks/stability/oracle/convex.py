"""Contact with given friction a second time, as a second-order cone programme solved by CVXOPT.

With given friction the displacement minimises the energy a(u, u) / 2 - L(u) + (bound, |slip|) over
what does not enter the foundation; with regularisation constraint and cone are smoothed by a layer
of compliance 1 / gamma.  The body is condensed onto its contact points first.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np
from scipy.sparse.linalg import splu

from benchmarks.stability.oracle.body import Body
from benchmarks.stability.oracle.conditions import Contact, Origin, reached
from benchmarks.stability.oracle.elements import Array, Ints

try:
    import cvxopt
    import cvxopt.solvers
except ImportError:  # the verdict is then without it, which is reported
    cvxopt = None

# The programme is used if its own duality gap is below this share of the energy.
_USABLE = 1e-8
# And if it misses its constraints by no more than this, relative.
_RESIDUAL = 1e-7
# Forces below this share of stiffness times displacement are round-off.
_ROUND_OFF = 1e-8
# Near the boundary of a cone CVXOPT may fail by round-off: it is asked for less then.
_ACCURACIES = (1e-12, 1e-10, 1e-9, 1e-8)


@dataclass(frozen=True)
class Condensed:
    """The body condensed onto the free directions at contact: energy v S v / 2 - f v plus a
    constant.
    """

    columns: Ints  # which of the free directions
    stiffness: Array  # S
    load: Array  # f
    start: Array  # the displacement that meets the supports, shape (nodes, d)
    lift: Array  # the other free directions are ``rest`` - ``lift`` v
    rest: Array  # see ``lift``
    others: Ints  # which ones these are

    def displacement(self, body: Body, v: Array) -> Array:
        """The displacement of all nodes, shape (nodes, d)."""
        every = np.zeros(body.free.shape[1])
        every[self.columns] = v
        every[self.others] = self.rest - self.lift @ v
        return np.asarray(self.start + (body.free @ every).reshape(body.x.shape))


def condense(body: Body, contact: Contact, step: int) -> Condensed:
    """Eliminate what is not free at a contact point.

    Raises:
        RuntimeError: a part of the body is not held.
    """
    start = body.prescribed(step)
    matrix = (body.free.T @ body.stiffness @ body.free).tocsr()
    force = body.free.T @ (body.load(step) - body.stiffness @ start.ravel())
    kept = reached(body.free, contact)
    others = np.setdiff1d(np.arange(matrix.shape[0]), kept)
    inner = matrix[kept][:, kept].toarray()
    if not others.size:
        return Condensed(
            kept, inner, force[kept], start, np.zeros((0, len(kept))), np.zeros(0), others
        )
    factor = splu(matrix[others][:, others].tocsc())
    coupling = matrix[others][:, kept].toarray()
    lift, rest = factor.solve(coupling), factor.solve(force[others])
    condensed = inner - coupling.T @ lift
    return Condensed(
        kept,
        (condensed + condensed.T) / 2,
        force[kept] - coupling.T @ rest,
        start,
        lift,
        rest,
        others,
    )


@dataclass(frozen=True)
class Minimum:
    """The minimum of the energy."""

    displacement: Array  # of the unknowns of ``Condensed``
    pressure: Array  # contact pressure of every contact point
    shear: Array  # shear of every contact point, a vector
    primal: float  # the energy
    dual: float  # a lower bound of it
    residual: float  # by how much the constraints of both are missed, relative


@dataclass(frozen=True)
class Programme:
    """The comparison of an answer with the programme."""

    displacement: float  # distance of the answer from the programme's in the energy norm, relative
    distance: float  # the same, not relative
    force: float  # largest difference of the forces on contact points, relative
    stiffening: float  # how large such a difference can be for a distance of 1, relative
    gap: float  # the programme's own duality gap, relative to the energy
    usable: bool  # whether it is small enough to judge by
    residual: float = 0.0  # by how much the programme misses its own constraints, relative


def compare(
    body: Body,
    contact: Contact,
    step: int,
    u: Array,
    bound: Array,
    origin: Origin,
    compliance: tuple[float, float],
) -> Programme | None:
    """Solve with a given friction bound, and compare with an answer u (nodes, d); None where CVXOPT
    fails.
    """
    reduced = condense(body, contact, step)
    if not reduced.columns.size:
        return None
    ours = body.free.T[reduced.columns] @ (u - reduced.start).ravel()
    matrix, load = reduced.stiffness, reduced.load
    if not any(
        values.any() for values in (ours, load, contact.gap, origin.u_t)
    ):  # nothing is loaded or moves
        return Programme(0.0, 0.0, 0.0, 1.0, 0.0, usable=True)
    length = float(np.abs(ours).max()) or float(
        np.abs(contact.gap).max() + np.abs(origin.u_t).max()
    )
    found = minimise(contact, reduced, bound, origin, compliance, length, body)
    if found is None:
        return None
    theirs, stiff = found.displacement, float(np.abs(np.diag(matrix)).max())
    away = ours - theirs
    # Supports may take the loads: what is left of them at contact has their round-off.
    lost = _ROUND_OFF * float(np.abs(body.load(step)).max())
    force = max(
        float(np.abs(matrix @ theirs - load).max()),
        float(np.abs(load).max()),
        _ROUND_OFF * stiff * length,
        lost,
    )
    energy = max(
        float(ours @ matrix @ ours),
        float(theirs @ matrix @ theirs),
        abs(found.primal),
        lost**2 / stiff,
    )
    energy = max(energy, float(np.abs(load).max()) ** 2 / stiff) or stiff * length**2
    distance = np.sqrt(max(0.0, float(away @ matrix @ away)))
    gap = abs(found.primal - found.dual) / energy
    return Programme(
        displacement=distance / np.sqrt(energy),
        distance=distance,
        force=float(np.abs(matrix @ away).max()) / force,
        # |K a| <= sqrt(max K_ii) sqrt(a K a)
        stiffening=np.sqrt(stiff * energy) / force,
        gap=gap,
        usable=gap <= _USABLE,
        residual=found.residual,
    )


def minimise(
    contact: Contact,
    reduced: Condensed,
    bound: Array,
    origin: Origin,
    compliance: tuple[float, float],
    length: float,
    body: Body,
) -> Minimum | None:
    """The minimum for a given friction bound, None where CVXOPT fails; ``length`` is the size of
    displacements.
    """
    basis = body.free[:, reduced.columns].toarray()
    # Rows from the unknowns to each point: shape (points, d, unknowns), and what supports prescribe
    # there.
    moves = contact.moves(basis)
    shift = contact.of(reduced.start)
    normal = np.einsum("nik,ni->nk", moves, contact.normal)
    tangent = np.einsum("nik,nti->ntk", moves, contact.tangents)
    # Scaled unknowns: u = length v, forces in stiff * length.
    stiff = float(np.abs(np.diag(reduced.stiffness)).max())
    length = max(length, float(np.abs(reduced.load).max()) / stiff)
    gap = (contact.gap - (shift * contact.normal).sum(axis=1)) / length
    start = (
        origin.slip_from(compliance[1]) - compliance[1] * contact.rounded(origin.shear, -2) - shift
    )
    begin = np.einsum("nti,ni->nt", contact.tangents, start) / length
    soft_n, soft_t = (np.sqrt(c * stiff / contact.weight) for c in compliance)
    # Rows without unknowns are no condition.
    acts = np.abs(normal).max(axis=1) > 1e-8
    moves_across = np.abs(tangent).max(axis=(1, 2)) > 1e-8
    rub, tied = (
        np.flatnonzero(moves_across & (bound > 0) & (np.isinf(bound) == bonded))
        for bonded in (False, True)
    )
    across = contact.x.shape[1] - 1
    one, two = np.flatnonzero(acts & ~contact.bilateral), np.flatnonzero(acts & contact.bilateral)
    layer_n, layer_t = compliance[0] > 0, compliance[1] > 0
    # Unknowns: v, then the square root of the layers' energies, then the moduli of the slips.
    layers = (
        len(one) * layer_n,
        len(two) * layer_n,
        across * len(tied) * layer_t,
        across * len(rub) * layer_t,
    )
    ends = np.cumsum([0, len(reduced.load), *layers, len(rub)])
    v, p, q, b, m, t = (slice(a, b) for a, b in pairwise(ends))
    quadratic = np.zeros((ends[-1], ends[-1]))
    quadratic[v, v] = reduced.stiffness / stiff
    for block in (p, q, b, m):
        quadratic[block, block] = np.eye(block.stop - block.start)
    linear = np.zeros(ends[-1])
    linear[v] = -reduced.load / stiff / length
    linear[t] = contact.weight[rub] * bound[rub] / stiff / length
    rows = np.zeros((len(one) + (1 + across) * len(rub), ends[-1]))
    limits = np.zeros(len(rows))
    rows[: len(one), v], limits[: len(one)] = normal[one], gap[one]
    if layer_n:
        rows[: len(one), p] = -np.diag(soft_n[one])
    # Cones: (modulus, slip), as limits minus rows times unknowns.
    for number, point in enumerate(rub):
        first = len(one) + (1 + across) * number
        rows[first, t.start + number] = -1.0
        slip = slice(first + 1, first + 1 + across)
        rows[slip, v], limits[slip] = -tangent[point], -begin[point]
        if layer_t:
            rows[slip, m.start + across * number : m.start + across * (number + 1)] = soft_t[
                point
            ] * np.eye(across)
    # Equations: of contact that cannot open, then of bonds along both.
    equal = np.zeros((len(two) + across * len(tied), ends[-1]))
    equal[: len(two), v], equal[len(two) :, v] = (
        normal[two],
        tangent[tied].reshape(-1, len(reduced.load)),
    )
    if layer_n:
        equal[: len(two), q] = -np.diag(soft_n[two])
    if layer_t:
        equal[len(two) :, b] = -np.diag(np.repeat(soft_t[tied], across))
    cones = len(one), 1 + across
    found = _solve(
        quadratic,
        linear,
        rows,
        limits,
        cones,
        equal,
        np.concatenate((gap[two], begin[tied].ravel())),
    )
    if found is None:
        return None
    best, (pushing, holding), primal, dual, residual = found
    pressure = np.zeros(len(contact.weight))
    pressure[one], pressure[two] = pushing[: len(one)], holding[: len(two)]
    unit = stiff * length
    primal, dual = primal * unit * length, dual * unit * length
    shear = np.zeros((len(contact.weight), across))
    shear[rub] = -pushing[len(one) :].reshape(-1, 1 + across)[:, 1:]
    shear[tied] = holding[len(two) :].reshape(-1, across)
    vectors = np.einsum("nt,nti->ni", shear, contact.tangents) * (unit / contact.weight)[:, None]
    return Minimum(
        length * best[v], pressure * unit / contact.weight, vectors, primal, dual, residual
    )


def coulomb_state(
    body: Body, contact: Contact, step: int, origin: Origin, pressure: Array
) -> tuple[Array, Array, Array] | None:
    """Displacement (nodes, d), pressure and shear of a solution with Coulomb friction, if a fixed
    point finds one.

    Args:
        body: the body.
        contact: its contact points.
        step: the load step.
        origin: where friction counts from.
        pressure: where the iteration begins.
    """
    reduced = condense(body, contact, step)
    length = float(np.abs(contact.gap).max() + np.abs(origin.u_t).max())
    for _ in range(60):
        found = minimise(
            contact, reduced, contact.bound(pressure), origin, (0.0, 0.0), length, body
        )
        if found is None:
            return None
        change = np.abs(found.pressure - pressure).max()
        if change <= 1e-8 * np.abs(pressure).max():
            return reduced.displacement(body, found.displacement), found.pressure, found.shear
        pressure = (pressure + found.pressure) / 2
    return None


def _solve(
    quadratic: Array,
    linear: Array,
    rows: Array,
    limits: Array,
    cones: tuple[int, int],
    equal: Array,
    values: Array,
) -> tuple[Array, tuple[Array, Array], float, float, float] | None:
    """Minimise x P x / 2 + q x over h - G x in the cone and A x = b: (x, multipliers of both,
    primal, dual, residual).

    The cone is that of numbers that are not negative, and of vectors (t, y) with |y| <= t;
    ``cones``: how many numbers, and the length of the vectors.
    """
    signs, size = cones
    if not len(limits):  # linear equations
        blocks = np.block([[quadratic, equal.T], [equal, np.zeros((len(equal), len(equal)))]])
        solution = np.linalg.lstsq(blocks, np.concatenate([-linear, values]), rcond=None)[0]
        best, holding = solution[: len(linear)], solution[len(linear) :]
        value = float(best @ quadratic @ best / 2 + linear @ best)
        return best, (limits, holding), value, value, 0.0
    matrix = cvxopt.matrix
    dims = {"l": signs, "q": [size] * ((len(limits) - signs) // size), "s": []}
    arguments = [matrix(quadratic), matrix(linear), matrix(rows), matrix(limits), dims]
    if len(equal):
        arguments += [matrix(equal), matrix(values)]
    for accuracy, solver in product(
        _ACCURACIES, ("ldl", "chol") if len(limits) > signs else ("chol2", "ldl")
    ):
        options = {"abstol": accuracy / 100, "reltol": accuracy, "feastol": max(accuracy, 1e-11)}
        try:
            found = cvxopt.solvers.coneqp(
                *arguments,
                kktsolver=solver,
                options=options | {"show_progress": False, "maxiters": 60},
            )
        except (ValueError, ArithmeticError):
            continue
        if found["x"] is None or found["dual objective"] is None:
            continue
        residual = max(float(found[f"{name} infeasibility"]) for name in ("primal", "dual"))
        if residual <= _RESIDUAL:
            best, pushing, holding = (np.array(found[name]).ravel() for name in "xzy")
            values = (float(found[f"{name} objective"]) for name in ("primal", "dual"))
            return best, (pushing, holding), *values, residual
    return None
