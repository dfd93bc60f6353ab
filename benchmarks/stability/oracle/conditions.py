"""The conditions that a solution of a contact problem has to meet, point by point, from plain
arrays.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.linalg import null_space
from scipy.sparse import coo_array, csr_array, eye_array, kron, vstack

from benchmarks.stability.oracle import elements
from benchmarks.stability.oracle.body import Body, listed
from benchmarks.stability.oracle.effects import from_shape
from benchmarks.stability.oracle.elements import Array, Ints, at_points

# Relative to the largest force, stress and length of the deformation at hand.
TOLERANCE = 1e-6
# Below it everything counts as zero: the square of such a number is none.
LEAST = 1e-150
_EPS = float(np.finfo(float).eps)
# Share of the forces by prescribed displacements at which a Krylov method ends.
_KRYLOV = 1e-11
# Units in the last place that the relative displacement of a contact point loses: half of one as it
# is stored, and as many as the sum of its terms, which have both signs.
_LOST = 4
# A support leaves a direction free if more than this of it is.
_FREE = 1e-8


@dataclass(frozen=True)
class Contact:
    """All contact points of a scene, a row for each point of each contact boundary."""

    part: Ints  # which contact boundary
    x: Array  # position
    # from displacements of nodes to those of the points, which between two bodies are relative:
    # those of its own node; with quadratic tetrahedra averages (psi_i, N_j) / w_i with the function
    # psi_i of the vertex, see ``points_of``; or see ``mortar``.  Shape (points d, nodes d)
    operator: csr_array
    weight: Array  # the area that it stands for
    normal: Array  # outward normal, or the scene's direction
    gap: Array  # distance to the foundation
    given: Array  # bound of given friction
    coefficient: Array  # coefficient of Coulomb friction
    cap: Array  # largest bound of Coulomb friction
    bilateral: npt.NDArray[np.bool_]  # whether the contact cannot open
    cohesive: npt.NDArray[
        np.bool_
    ]  # whether the given bound is that of a cohesion, which open nodes have not
    # by what the part of a slip across the direction of friction counts more, see ``rounded``, a
    # vector
    stretch: Array
    between: bool  # whether some points are between two bodies

    @cached_property
    def tangents(self) -> Array:
        """D - 1 vectors across the normal of each point, shape (points, d - 1, d), orthonormal but
        for ``rounded``: the work of friction is the bound times the length of the slip along them,
        and their multiples in a disc are the admissible shears.
        """
        _, _, rows = np.linalg.svd(self.normal[:, None, :])
        return np.stack([self.rounded(rows[:, k], 1) for k in range(1, rows.shape[1])], axis=1)

    def rounded(self, vectors: Array, power: int) -> Array:
        """Vectors whose parts across the direction of friction are multiplied by the ratio to a
        power.
        """
        ratio = np.linalg.norm(self.stretch, axis=1)
        across = self.stretch / np.where(ratio > 0, ratio, 1.0)[:, None]
        part = (vectors * across).sum(axis=1) * (np.where(ratio > 0, ratio, 1.0) ** power - 1)
        return np.asarray(vectors + part[:, None] * across)

    def across(self, vectors: Array) -> Array:
        """Vectors at the points without their normal parts."""
        return vectors - (vectors * self.normal).sum(axis=1)[:, None] * self.normal

    def bound(self, pressure: Array) -> Array:
        """The largest shear at a contact pressure."""
        acting = np.where(self.bilateral, np.abs(pressure), np.maximum(pressure, 0.0))
        bound = np.minimum(self.given + self.coefficient * acting, self.cap)
        return np.where(self.cohesive & (pressure == 0), 0.0, bound)

    @property
    def rubs(self) -> npt.NDArray[np.bool_]:
        """Which points can transmit any shear."""
        return (self.given > 0) | ((self.coefficient > 0) & (self.cap > 0))

    @property
    def follows_pressure(self) -> bool:
        """Whether a bound depends on the solution."""
        return bool(np.any(self.coefficient > 0) or np.any(self.cohesive))

    def forces(self, pressure: Array, shear: Array) -> Array:
        """What the contact tractions take from the body, a force per dof."""
        traction = self.weight[:, None] * (pressure[:, None] * self.normal + shear)
        return np.asarray(self.operator.T @ traction.ravel())

    @cached_property
    def meetings(self) -> tuple[Ints, Ints]:
        """Each point with each node that its displacement depends on."""
        dimension = self.x.shape[1]
        rows, columns = abs(self.operator).nonzero()
        pairs = np.unique(np.stack([rows // dimension, columns // dimension], axis=1), axis=0)
        return pairs[:, 0], pairs[:, 1]

    def of(self, u: Array) -> Array:
        """The displacement of each point from that of the nodes, shape (points, d)."""
        return np.asarray(self.operator @ u.ravel()).reshape(self.x.shape)

    def moves(self, motions: Array) -> Array:
        """Motions of the nodes, a column each, at the points: shape (points, d, motions)."""
        return np.asarray(self.operator @ motions).reshape(*self.x.shape, motions.shape[1])


def contact_of(body: Body, points: Callable[[Body, int], Points] | None = None) -> Contact:
    """The contact points of a scene; ``points``: those of a contact by its number, None: on a rigid
    foundation.
    """
    columns: dict[str, list[Any]] = {
        name: [] for name in Contact.__dataclass_fields__ if name != "between"
    }
    for part, effect in enumerate(listed(body.scene, "contact")):
        here = (points or points_of)(body, part)
        x, count, normal = here.x, len(here.x), here.normal
        if "foundation" in effect:
            _, normal = from_shape(effect["foundation"], x)
        if "direction" in effect:
            direction = np.array(effect["direction"], dtype=float)
            normal = np.tile(direction / np.linalg.norm(direction), (count, 1))
        friction = effect.get("friction", {"law": "none"})
        coulomb, tresca = friction["law"] == "coulomb", friction["law"] == "tresca"
        kind = effect.get("kind", "unilateral")
        columns["part"].append(np.full(count, part))
        columns["x"].append(x)
        columns["operator"].append(here.operator)
        columns["weight"].append(here.weight)
        columns["normal"].append(normal)
        columns["gap"].append(here.gap)
        given = (
            np.inf
            if kind == "bonded"
            else friction["bound"]
            if tresca
            else friction.get("cohesion", 0.0)
        )
        columns["cohesive"].append(np.full(count, "cohesion" in friction))
        columns["given"].append(at_points(given, x))
        columns["coefficient"].append(at_points(friction["coefficient"] if coulomb else 0.0, x))
        capped = coulomb and "cap" in friction
        columns["cap"].append(at_points(friction["cap"], x) if capped else np.full(count, np.inf))
        columns["bilateral"].append(np.full(count, kind != "unilateral"))
        stretch = np.zeros_like(x)
        if "ratio" in friction:
            along = np.stack(
                [at_points(value, x) for value in friction.get("along", [1.0, 0.0, 0.0])], axis=1
            )
            stretch = np.cross(normal, along)
            stretch *= (at_points(friction["ratio"], x) / np.linalg.norm(stretch, axis=1))[:, None]
        columns["stretch"].append(stretch)
    operator = csr_array(vstack(columns.pop("operator")))
    between = any("against" in effect for effect in listed(body.scene, "contact"))
    return Contact(
        operator=operator,
        between=between,
        **{name: np.concatenate(values) for name, values in columns.items()},
    )


@dataclass(frozen=True)
class Points:
    """The points of one contact boundary: see ``Contact``."""

    x: Array
    operator: csr_array
    weight: Array
    normal: Array
    gap: Array


def points_of(body: Body, part: int) -> Points:
    """The points of a boundary on a rigid foundation.

    The weight times the normal is the integral of the basis function times the normal; on quadratic
    tetrahedra, whose functions of vertices have the integral zero, that of the hat function, and
    the weight is that of its area. The shares there are those of the functions that are dual to the
    hats on each facet, or of the hats where the others find an overlap of a round gap.
    """
    effect = listed(body.scene, "contact")[part]
    facets = body.facets(effect["boundary"])
    averaged = body.cells.shape[1] == 10
    xi, weights = body.rule(6)
    values, _ = elements.shape(body.dim - 1, facets.nodes.shape[1], xi)
    points = facets.nodes[:, :3] if averaged else facets.nodes
    hats = elements.shape(2, 3, xi)[0] if averaged else values
    _, normal = body.frames(facets, xi)
    moments = np.zeros(body.x.shape)
    np.add.at(moments, points, np.einsum("fpi,p,pk->fki", normal, weights, hats))
    vertices = np.unique(points)
    size = np.linalg.norm(moments[vertices], axis=1)
    normals = moments[vertices] / size[:, None]

    reached = np.unique(facets.nodes)
    gaps = np.zeros(len(body.x))
    gaps[reached] = at_points(effect.get("gap", 0.0), body.x[reached])
    if "foundation" in effect:
        gaps[reached] += from_shape(effect["foundation"], body.x[reached])[0]

    def found(shares: csr_array, weight: Array, gap: Array) -> Points:
        return Points(
            body.x[vertices], csr_array(kron(shares, eye_array(body.dim))), weight, normals, gap
        )

    if not averaged:
        own = coo_array(
            (np.ones(len(vertices)), (np.arange(len(vertices)), vertices)),
            shape=(len(vertices), len(body.x)),
        )
        return found(own.tocsr(), size, gaps[vertices])
    area = np.linalg.norm(normal, axis=2)
    products, hats_only = (
        np.einsum("fp,p,pa,pb->fab", area, weights, hats, these) for these in (values, hats)
    )
    # The functions of the points on a facet: the hats' integrals are their own, and they are dual
    # to the hats.
    dual = np.linalg.solve(hats_only, products) * hats_only.sum(axis=2)[:, :, None]
    rows, columns = np.broadcast_arrays(points[:, :, None], facets.nodes[:, None, :])
    for integrals in (dual, products):
        every = coo_array(
            (integrals.ravel(), (rows.ravel(), columns.ravel())), shape=(len(body.x), len(body.x))
        ).tocsr()
        mine = every[vertices]
        weight = np.asarray(mine.sum(axis=1)).ravel()
        shares = csr_array(mine.multiply(1 / weight[:, None]))
        gap = averaged_gap(shares, body.x, gaps, vertices)
        if gap.min() >= gaps[reached].min() - 1e-9 * np.ptp(body.x[reached]):
            break
    return found(shares, weight, gap)


def averaged_gap(shares: csr_array, x: Array, gaps: Array, vertices: Ints) -> Array:
    """Averages of gaps at nodes, but that of the vertex where the average differs from it by no
    more than what the gap differs from a quadratic function of two coordinates may change both.
    """
    gap = gaps[vertices]
    for point, (first, last) in enumerate(pairwise(shares.indptr)):
        around, share = shares.indices[first:last], shares.data[first:last]
        away = (x[around] - x[around].mean(axis=0)) / np.ptp(x[around])
        one, two = np.linalg.svd(away)[2][:2] @ away.T
        basis = np.array([one**i * two**j for i in range(3) for j in range(3 - i)]).T
        off = gaps[around] - basis @ np.linalg.lstsq(basis, gaps[around])[0]
        mean = share @ gaps[around]
        rest = np.abs(off).max()
        smooth = rest <= 1e-3 * np.ptp(gaps[around])
        if smooth or abs(mean - gap[point]) >= (1 + np.abs(share).sum()) * rest:
            gap[point] = mean
    return gap


@dataclass(frozen=True)
class Origin:
    """Where friction counts from: tangential displacement and shear of the load step before, or
    zero.
    """

    u_t: Array  # tangential displacement, a vector
    shear: Array  # shear, a vector
    # the part of the tangential displacement that is elastic in the regularised law and no slip
    elastic: Array

    @classmethod
    def nothing(cls, contact: Contact) -> Origin:
        """The origin of the first load step."""
        return cls(*np.zeros((3, *contact.x.shape)))

    def after(self, u_t: Array, shear: Array, compliance: float, contact: Contact) -> Origin:
        """The origin of the next load step, where this one kept to a law with 1 / gamma_2 =
        ``compliance``.
        """
        added = compliance * contact.rounded(shear - self.shear, -2)
        return Origin(u_t, shear, self.elastic + added if compliance > 0 else 0 * u_t)

    def slip_from(self, compliance: float) -> Array:
        """The origin of the slip: without regularisation there is no elastic slip."""
        return self.u_t if compliance > 0 else self.u_t - self.elastic


@dataclass(frozen=True)
class Tractions:
    """Contact pressure, shear (vectors) and state of every point in a load step, as the package
    reports them.
    """

    pressure: Array
    shear: Array
    state: npt.NDArray[np.str_]


def null_motions(body: Body) -> Array:
    """Rigid motions of the pieces that the supports allow, a column each."""
    rigid = body.rigid.reshape(*body.x.shape, -1)
    resisted = np.einsum("nij,njk->nik", body.held, rigid).reshape(-1, rigid.shape[2])
    if listed(body.scene, "springs"):
        resisted = np.concatenate((resisted, np.asarray(body.springs @ body.rigid)))
    return body.rigid @ null_space(resisted, rcond=1e-9) if resisted.any() else body.rigid


def deformation(body: Body, u: Array) -> float:
    """The largest displacement that is no rigid motion of a piece, a length."""
    motion, *_ = np.linalg.lstsq(body.rigid, u.ravel(), rcond=None)
    return float(np.abs(u.ravel() - body.rigid @ motion).max())


def round_off(body: Body, step: int) -> float:
    """Displacements that the round-off of the loads may cause, a length: supports may take all that
    is more.
    """
    return 1e3 * _EPS * float(np.abs(body.load(step)).max()) / (body.young * body.size)


def violations(
    body: Body,
    contact: Contact,
    step: int,
    u: Array,
    said: Tractions,
    origin: Origin,
    compliance: tuple[float, float],
) -> dict[str, float]:
    """How far a displacement (nodes, d) with its tractions is from each condition, as a share of
    what is tolerated.

    Args:
        body: the body.
        contact: its contact points.
        step: the load step.
        u: displacement.
        said: contact tractions and states.
        origin: where friction counts from.
        compliance: 1 / gamma_1 and 1 / gamma_2 of the law that was promised; zero for the law
        itself.
    """
    pressure, shear = said.pressure, said.shear
    moved = float(np.abs(u).max())
    figures = {}
    wrong = np.einsum("nij,nj->ni", body.held, u - body.prescribed(step))
    figures["support"] = float(np.abs(wrong).max()) / max(1e-9 * moved, LEAST)
    # Equilibrium in every free direction, contact tractions included.
    inner, load = body.stiffness @ u.ravel(), body.load(step)
    taken = contact.forces(pressure, shear)
    most = max(float((abs(body.stiffness) @ np.abs(u.ravel())).max()), float(np.abs(load).max()))
    noise = 200 * _EPS * most
    # Contact forces in supported directions have no effect, however large they are.
    felt = body.free.T @ taken
    force = max(
        float(np.abs(inner).max()), float(np.abs(load).max()), float(np.abs(felt).max(initial=0.0))
    )
    residual = np.abs(body.free.T @ (inner - load + taken))
    # A Krylov method ends at a share of the forces that prescribed displacements would make, of a
    # rigid motion too.
    left = (
        _KRYLOV * most if body.scene.get("solver", {}).get("linear_algebra") == "krylov" else noise
    )
    left += _by_the_law(contact, u, compliance)
    figures["equilibrium"] = float(residual.max(initial=0.0)) / max(TOLERANCE * force + left, LEAST)
    # Scales of the deformation: of a rigid motion only the round-off is tolerated, however large it
    # is.
    shape = deformation(body, u)
    # Where a support holds a point in part, pressure and shear may be anything: what the body feels
    # sets the scale.
    loose = np.eye(body.x.shape[1]) - body.held
    traction = pressure[:, None] * contact.normal + shear
    acting = max(
        (
            float(np.abs(loose[node] @ traction[point]).max())
            for point, node in zip(*contact.meetings, strict=True)
        ),
        default=0.0,
    )
    stress = max(acting, 1e-3 * body.young * shape / body.size)
    length = max(shape, 1e-3 * stress / body.young * body.size)
    near = (
        TOLERANCE * length
        + 1e3 * _EPS * (moved + float(np.abs(contact.gap).max()))
        + round_off(body, step)
    )
    negligible = max(TOLERANCE * stress, noise / float(contact.weight.min()), LEAST)
    if contact.between:  # distances of both sides have the round-off of places
        near += 10 * _EPS * body.size
    # What is added to the slip and the shear of the step before has their round-off.
    near = max(near, 1e3 * _EPS * float(np.abs(origin.u_t).max(initial=0.0)), LEAST)
    negligible = max(negligible, 1e3 * _EPS * float(np.abs(origin.shear).max(initial=0.0)))
    at = contact.of(u)
    u_n, u_t = (at * contact.normal).sum(axis=1), contact.across(at)
    judged_n, judged_t = judged(body, contact)
    entered = u_n - contact.gap - compliance[0] * pressure
    one = ~contact.bilateral & judged_n
    two = contact.bilateral & judged_n
    figures["penetration"] = _most(np.where(two, np.abs(entered), entered)[judged_n]) / near
    figures["pressure below zero"] = _most(-pressure[one]) / negligible
    figures["pressure at a distance"] = _most(
        np.minimum(pressure / negligible, -entered / near)[one]
    )
    figures["state of contact"] = _most(pressure[one & (said.state == "open")]) / negligible
    bound, sheared = contact.bound(pressure), contact.rounded(shear, -1)
    size = np.linalg.norm(sheared, axis=1)
    figures["shear along the normal"] = (
        _most(np.abs((shear * contact.normal).sum(axis=1))) / negligible
    )
    figures["friction cone"] = _most((size - bound)[judged_t]) / negligible
    if not contact.rubs.any():
        return figures
    xi = contact.rounded(u_t - origin.slip_from(compliance[1]), 1)
    xi -= compliance[1] * (sheared - contact.rounded(origin.shear, -1))
    slipped = np.linalg.norm(xi, axis=1)
    # The law as one equation, mu = P(mu + xi) with the projection P onto the disc, in units of what
    # is tolerated.
    trial = sheared / negligible + xi / near
    with np.errstate(over="ignore"):
        excess = np.maximum(
            np.linalg.norm(trial, axis=1) / np.maximum(bound / negligible, 1e-300), 1.0
        )
    figures["law of friction"] = _most(
        np.linalg.norm(sheared / negligible - trial / excess[:, None], axis=1)[judged_t]
    )
    figures["state of stick"] = _most(slipped[(said.state == "stick") & judged_t]) / near
    sliding = (said.state == "slip") & judged_t & (bound > 0)
    figures["state of slip"] = _most((bound - size)[sliding]) / negligible
    return figures


def _by_the_law(contact: Contact, u: Array, compliance: tuple[float, float]) -> float:
    """The round-off of forces that a regularised law makes of displacements.

    It gives a traction as gamma times a difference of displacements and the gap, each of which is a
    rounded number.  A displacement that is the exact solution but for its last digits has just
    these forces, whatever solver it is from.
    """
    rate = max((1 / part for part in compliance if part > 0), default=0.0)
    terms = (abs(contact.operator) @ np.abs(u.ravel())).reshape(contact.x.shape) + np.abs(
        contact.gap
    )[:, None]
    forces = abs(contact.operator).T @ (contact.weight[:, None] * terms).ravel()
    return _LOST * _EPS * rate * float(forces.max(initial=0.0))


def judged(body: Body, contact: Contact) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """At which points normal and tangential conditions are judged: where a support leaves some
    direction free.
    """
    loose = np.eye(body.x.shape[1]) - body.held
    normal = np.zeros(len(contact.x), dtype=bool)
    tangential = np.zeros(len(contact.x), dtype=bool)
    for point, node in zip(*contact.meetings, strict=True):
        normal[point] |= bool(np.linalg.norm(loose[node] @ contact.normal[point]) > _FREE)
        tangential[point] |= bool(np.abs(loose[node] @ contact.tangents[point].T).max() > _FREE)
    return normal, tangential


def _most(values: Array) -> float:
    """The largest value; NaN counts as infinite."""
    return float(np.nan_to_num(values, nan=1e300, posinf=1e300).max(initial=0.0))


def reached(free: csr_array, contact: Contact) -> Ints:
    """The columns of free directions at nodes that contact points reach."""
    nodes, dimension = np.unique(contact.meetings[1]), contact.x.shape[1]
    dofs = (dimension * nodes[:, None] + np.arange(dimension)).ravel()
    return np.unique(free[dofs].nonzero()[1]).astype(np.int64)
