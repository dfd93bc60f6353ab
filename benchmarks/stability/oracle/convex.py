"""Contact with given friction a second time, as a convex programme solved by CVXOPT.

With given friction the displacement minimises the energy a(u, u) / 2 - L(u) + (bound, |slip|) over what does not enter
the foundation; with regularisation the constraint and the kink are smoothed by a layer of compliance 1 / gamma.  Both
are a quadratic programme in the displacement of the contact nodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.sparse.linalg import splu

from benchmarks.stability.oracle.body import Body
from benchmarks.stability.oracle.conditions import Contact, Origin, free_dofs, interior
from benchmarks.stability.oracle.elements import Array, Ints

try:
    import cvxopt
    import cvxopt.solvers
except ImportError:  # the verdict is then without it, which is reported
    cvxopt = None

# The programme is used if its own duality gap is below this share of the energy.
_USABLE = 1e-9
# Forces below this share of stiffness times displacement are round-off.
_ROUND_OFF = 1e-8


@dataclass(frozen=True)
class Condensed:
    """The body condensed onto its free contact dofs: energy u S u / 2 - f u plus a constant."""

    dofs: Ints
    stiffness: Array
    load: Array


def condense(body: Body, contact: Contact, step: int) -> Condensed:
    """Eliminate what is neither prescribed nor of a contact node.

    Raises:
        RuntimeError: a part of the body is not held.
    """
    free = free_dofs(body, step)
    at_contact = np.zeros(len(free), dtype=bool)
    at_contact[2 * contact.nodes] = at_contact[2 * contact.nodes + 1] = True
    kept, rest = np.flatnonzero(free & at_contact), np.flatnonzero(free & ~at_contact)
    matrix = body.stiffness
    start = np.nan_to_num(body.prescribed(step))
    force = body.load(step) - matrix @ start
    if not rest.size:
        return Condensed(kept, matrix[kept][:, kept].toarray(), force[kept])
    inside = splu(matrix[rest][:, rest].tocsc())
    coupling = matrix[rest][:, kept].toarray()
    condensed = matrix[kept][:, kept].toarray() - coupling.T @ inside.solve(coupling)
    return Condensed(kept, (condensed + condensed.T) / 2, force[kept] - coupling.T @ inside.solve(force[rest]))


@dataclass(frozen=True)
class Minimum:
    """The minimum of the energy.

    Attributes:
        displacement: of the unknowns of ``Condensed``.
        pressure: contact pressure of every contact node, from the multipliers of the programme.
        primal: the energy.
        dual: a lower bound of it.
    """

    displacement: Array
    pressure: Array
    primal: float
    dual: float


@dataclass(frozen=True)
class Programme:
    """The comparison of an answer with the programme.

    Attributes:
        displacement: distance of the answer from the programme's in the energy norm, relative.
        distance: the same, not relative.
        force: largest difference of the forces on contact nodes, relative.
        stiffening: how large such a difference can be for a distance of 1, relative.
        gap: the programme's own duality gap, relative to the energy.
        usable: whether it is small enough to judge by.
        residual: by how much the programme misses its own constraints, relative.
    """

    displacement: float
    distance: float
    force: float
    stiffening: float
    gap: float
    usable: bool
    residual: float = 0.0


def compare(
    body: Body, contact: Contact, step: int, u: Array, bound: Array, origin: Origin, compliance: tuple[float, float]
) -> Programme | None:
    """Solve with a given friction bound, and compare with an answer u (nodes, 2); None where CVXOPT fails."""
    reduced = condense(body, contact, step)
    if not reduced.dofs.size:
        return None
    ours, matrix, load = u.ravel()[reduced.dofs], reduced.stiffness, reduced.load
    if not any(values.any() for values in (ours, load, contact.gap, origin.u_t)):  # nothing is loaded or moves
        return Programme(0.0, 0.0, 0.0, 1.0, 0.0, usable=True)
    length = float(np.abs(ours).max()) or float(np.abs(contact.gap).max() + np.abs(origin.u_t).max())
    found = minimise(body, contact, step, reduced, bound, origin, compliance, length)
    if found is None:
        return None
    theirs, stiff = found.displacement, float(np.abs(np.diag(matrix)).max())
    away = ours - theirs
    # Where the contact does not move at all, the displacement by the loads alone is the scale.
    # Where nothing loads the body, forces are round-off of stiffness times displacement.
    force = max(float(np.abs(matrix @ theirs - load).max()), float(np.abs(load).max()), _ROUND_OFF * stiff * length)
    energy = max(float(ours @ matrix @ ours), float(theirs @ matrix @ theirs), abs(found.primal))
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
    )


def minimise(
    body: Body,
    contact: Contact,
    step: int,
    reduced: Condensed,
    bound: Array,
    origin: Origin,
    compliance: tuple[float, float],
    length: float,
) -> Minimum | None:
    """The minimum for a given friction bound, None where CVXOPT fails; ``length`` is the size of displacements."""
    place = np.full(2 * len(body.x), -1)
    place[reduced.dofs] = np.arange(len(reduced.dofs))
    fixed = np.nan_to_num(body.prescribed(step))

    def trace(direction: Array) -> tuple[Array, Array]:
        """Rows that take the component along the direction from the unknowns, and what is prescribed of it."""
        rows, shift = np.zeros((len(contact.nodes), len(reduced.dofs))), np.zeros(len(contact.nodes))
        for axis in range(2):
            dofs = 2 * contact.nodes + axis
            known = place[dofs] < 0
            rows[np.flatnonzero(~known), place[dofs[~known]]] += direction[~known, axis]
            shift[known] += direction[known, axis] * fixed[dofs[known]]
        return rows, shift

    # Scaled unknowns: u = length v, forces in stiff * length.
    stiff = float(np.abs(np.diag(reduced.stiffness)).max())
    length = max(length, float(np.abs(reduced.load).max()) / stiff)
    (normal, normal_shift), (tangent, tangent_shift) = trace(contact.normal), trace(contact.tangent)
    gap = (contact.gap - normal_shift) / length
    start = (origin.slip_from(compliance[1]) - compliance[1] * origin.shear - tangent_shift) / length
    soft_n, soft_t = (np.sqrt(c * stiff / contact.weight) for c in compliance)
    # Rows without unknowns are no condition.
    acts_n, acts_t = np.abs(normal).max(axis=1) > 1e-8, (np.abs(tangent).max(axis=1) > 1e-8) & (bound > 0)
    one, two = np.flatnonzero(acts_n & ~contact.bilateral), np.flatnonzero(acts_n & contact.bilateral)
    rub = np.flatnonzero(acts_t)
    layer_n, layer_t = compliance[0] > 0, compliance[1] > 0
    # Unknowns: v, then the square root of the layers' energies, then the moduli of the slips.
    ends = np.cumsum([0, len(reduced.load), len(one) * layer_n, len(two) * layer_n, len(rub) * layer_t, len(rub)])
    v, p, q, m, t = (slice(a, b) for a, b in pairwise(ends))
    quadratic = np.zeros((ends[-1], ends[-1]))
    quadratic[v, v] = reduced.stiffness / stiff
    for block in (p, q, m):
        quadratic[block, block] = np.eye(block.stop - block.start)
    linear = np.zeros(ends[-1])
    linear[v] = -reduced.load / stiff / length
    linear[t] = contact.weight[rub] * bound[rub] / stiff / length
    rows = np.zeros((len(one) + 2 * len(rub), ends[-1]))
    limits = np.zeros(len(rows))
    rows[: len(one), v], limits[: len(one)] = normal[one], gap[one]
    if layer_n:
        rows[: len(one), p] = -np.diag(soft_n[one])
    for sign, first in ((1, len(one)), (-1, len(one) + len(rub))):
        here = slice(first, first + len(rub))
        rows[here, v], limits[here] = sign * tangent[rub], sign * start[rub]
        if layer_t:
            rows[here, m] = -sign * np.diag(soft_t[rub])
        rows[here, t] = -np.eye(len(rub))
    equal = np.zeros((len(two), ends[-1]))
    equal[:, v] = normal[two]
    if layer_n:
        equal[:, q] = -np.diag(soft_n[two])
    found = _solve(quadratic, linear, rows, limits, equal, gap[two])
    if found is None:
        return None
    best, (pushing, holding), primal, dual = found
    pressure = np.zeros(len(contact.nodes))
    pressure[one], pressure[two] = pushing[: len(one)], holding
    unit = stiff * length
    return Minimum(length * best[v], pressure * unit / contact.weight, primal * unit * length, dual * unit * length)


def coulomb_state(
    body: Body, contact: Contact, step: int, origin: Origin, pressure: Array
) -> tuple[Array, Array] | None:
    """Displacement (nodes, 2) and pressure of a solution with Coulomb friction, if a fixed point iteration finds one.

    Args:
        body: the body.
        contact: its contact nodes.
        step: the load step.
        origin: where friction counts from.
        pressure: where the iteration begins.
    """
    reduced = condense(body, contact, step)
    length = float(np.abs(contact.gap).max() + np.abs(origin.u_t).max())
    for _ in range(100):
        found = minimise(body, contact, step, reduced, contact.bound(pressure), origin, (0.0, 0.0), length)
        if found is None:
            return None
        change = np.abs(found.pressure - pressure).max()
        if change <= 1e-8 * np.abs(pressure).max():
            u = np.nan_to_num(body.prescribed(step))
            u[reduced.dofs] = found.displacement
            return interior(body, contact, step, u.reshape(-1, 2)[contact.nodes]), found.pressure
        pressure = (pressure + found.pressure) / 2
    return None


def _solve(
    quadratic: Array, linear: Array, rows: Array, limits: Array, equal: Array, values: Array
) -> tuple[Array, tuple[Array, Array], float, float] | None:
    """Minimise x P x / 2 + q x over G x <= h and A x = b: (x, the multipliers of both, primal, dual)."""
    if not len(limits):  # linear equations
        blocks = np.block([[quadratic, equal.T], [equal, np.zeros((len(equal), len(equal)))]])
        solution = np.linalg.lstsq(blocks, np.concatenate([-linear, values]), rcond=None)[0]
        best, holding = solution[: len(linear)], solution[len(linear) :]
        value = float(best @ quadratic @ best / 2 + linear @ best)
        return best, (limits, holding), value, value
    matrix = cvxopt.matrix
    options = {"show_progress": False, "abstol": 1e-14, "reltol": 1e-12, "feastol": 1e-11, "maxiters": 60}
    arguments = [matrix(quadratic), matrix(linear), matrix(rows), matrix(limits)]
    if len(equal):
        arguments += [{"l": len(limits), "q": [], "s": []}, matrix(equal), matrix(values)]
    for solver in ("chol2", "ldl"):
        try:
            found = cvxopt.solvers.coneqp(*arguments, kktsolver=solver, options=options)
        except (ValueError, ArithmeticError):
            continue
        if found["x"] is not None and found["dual objective"] is not None:
            best, pushing, holding = (np.array(found[name]).ravel() for name in "xzy")
            return best, (pushing, holding), float(found["primal objective"]), float(found["dual objective"])
    return None
