"""The conditions that a solution of a contact problem has to meet, node by node, from plain arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse.linalg import splu

from benchmarks.stability.oracle.body import Body, listed
from benchmarks.stability.oracle.effects import from_shape
from benchmarks.stability.oracle.elements import Array, Ints, at_points

# Relative to the largest force, stress and length of the deformation at hand.
TOLERANCE = 1e-6
# Below it everything counts as zero: the square of such a number is none.
LEAST = 1e-150
_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Contact:
    """All contact nodes of a scene, a row for each node of each contact boundary.

    Attributes:
        part: which contact boundary.
        nodes: number of the node.
        weight: the length that it stands for.
        normal: outward normal, or the scene's direction.
        gap: distance to the foundation.
        given: bound of given friction.
        coefficient: coefficient of Coulomb friction.
        cap: largest bound of Coulomb friction.
        bilateral: whether the contact cannot open.
        cohesive: whether the given bound is that of a cohesion, which open nodes have not.
    """

    part: Ints
    nodes: Ints
    weight: Array
    normal: Array
    gap: Array
    given: Array
    coefficient: Array
    cap: Array
    bilateral: npt.NDArray[np.bool_]
    cohesive: npt.NDArray[np.bool_]

    @property
    def tangent(self) -> Array:
        """T = (-n_2, n_1)."""
        return np.stack([-self.normal[:, 1], self.normal[:, 0]], axis=1)

    def bound(self, pressure: Array) -> Array:
        """The largest shear at a contact pressure."""
        acting = np.where(self.bilateral, np.abs(pressure), np.maximum(pressure, 0.0))
        bound = np.minimum(self.given + self.coefficient * acting, self.cap)
        return np.where(self.cohesive & (pressure == 0), 0.0, bound)

    @property
    def has_friction(self) -> bool:
        """Whether a law can transmit any shear."""
        return bool(np.any(((self.given > 0) | (self.coefficient > 0)) & (self.cap > 0)))

    @property
    def follows_pressure(self) -> bool:
        """Whether a bound depends on the solution."""
        return bool(np.any(self.coefficient > 0) or np.any(self.cohesive))

    def forces(self, pressure: Array, shear: Array, size: int) -> Array:
        """What the contact tractions take from the body, a force per dof: w (lambda n + mu t)."""
        total = np.zeros((size, 2))
        per_node = (self.weight * pressure)[:, None] * self.normal + (self.weight * shear)[:, None] * self.tangent
        np.add.at(total, self.nodes, per_node)
        return total.ravel()


def contact_of(body: Body) -> Contact:
    """The contact nodes of a scene with their data."""
    columns: dict[str, list[Any]] = {name: [] for name in Contact.__dataclass_fields__}
    for side, effect in zip(body.sides, listed(body.scene, "contact"), strict=True):
        x, count = body.x[side.nodes], len(side.nodes)
        friction = effect.get("friction", {"law": "none"})
        coulomb, tresca = friction["law"] == "coulomb", friction["law"] == "tresca"
        columns["part"].append(np.full(count, side.part))
        columns["nodes"].append(side.nodes)
        columns["weight"].append(side.weight)
        columns["normal"].append(side.normal)
        distance = from_shape(effect["foundation"], x)[0] if "foundation" in effect else 0.0
        columns["gap"].append(at_points(effect.get("gap", 0.0), x) + distance)
        columns["given"].append(at_points(friction["bound"] if tresca else friction.get("cohesion", 0.0), x))
        columns["cohesive"].append(np.full(count, "cohesion" in friction))
        columns["coefficient"].append(at_points(friction["coefficient"] if coulomb else 0.0, x))
        capped = coulomb and "cap" in friction
        columns["cap"].append(at_points(friction["cap"], x) if capped else np.full(count, np.inf))
        columns["bilateral"].append(np.full(count, effect.get("kind", "unilateral") == "bilateral"))
    return Contact(**{name: np.concatenate(values) for name, values in columns.items()})


@dataclass(frozen=True)
class Origin:
    """Where friction counts from: tangential displacement and shear of the load step before, or zero.

    Attributes:
        u_t: tangential displacement.
        shear: shear.
        elastic: the part of the tangential displacement that is elastic in the regularised law and no slip.
    """

    u_t: Array
    shear: Array
    elastic: Array

    @classmethod
    def nothing(cls, count: int) -> Origin:
        """The origin of the first load step."""
        return cls(*np.zeros((3, count)))

    def after(self, u_t: Array, shear: Array, compliance: float) -> Origin:
        """The origin of the next load step, where this one kept to a law with 1 / gamma_2 = ``compliance``."""
        return Origin(u_t, shear, self.elastic + compliance * (shear - self.shear) if compliance > 0 else 0 * u_t)

    def slip_from(self, compliance: float) -> Array:
        """The origin of the slip: without regularisation there is no elastic slip."""
        return self.u_t if compliance > 0 else self.u_t - self.elastic


@dataclass(frozen=True)
class Tractions:
    """Contact pressure, shear and state of every contact node in a load step, as the package reports them."""

    pressure: Array
    shear: Array
    state: npt.NDArray[np.str_]


def free_dofs(body: Body, step: int) -> npt.NDArray[np.bool_]:
    """The dofs that no support prescribes."""
    return np.isnan(body.prescribed(step))


def interior(body: Body, contact: Contact, step: int, at_contact: Array) -> Array:
    """The displacement (nodes, 2) with given values at the contact nodes that is in balance everywhere else.

    Args:
        body: the body.
        contact: its contact nodes.
        step: the load step.
        at_contact: their displacement, shape (contact nodes, 2).
    """
    prescribed = body.prescribed(step)
    u = np.nan_to_num(prescribed).reshape(-1, 2)
    known = ~np.isnan(prescribed).reshape(-1, 2)
    u[contact.nodes] = at_contact
    known[contact.nodes] = True
    free = np.flatnonzero(~known.ravel())
    flat = u.ravel()
    if free.size:
        rest = (body.load(step) - body.stiffness @ flat)[free]
        flat[free] = splu(body.stiffness[free][:, free].tocsc()).solve(rest)
    return flat.reshape(-1, 2)


def deformation(body: Body, u: Array) -> float:
    """The largest displacement that is no rigid motion of a piece, a length."""
    motion, *_ = np.linalg.lstsq(body.rigid, u.ravel(), rcond=None)
    return float(np.abs(u.ravel() - body.rigid @ motion).max())


def violations(
    body: Body,
    contact: Contact,
    step: int,
    u: Array,
    said: Tractions,
    origin: Origin,
    compliance: tuple[float, float],
) -> dict[str, float]:
    """How far a displacement (nodes, 2) with its tractions is from each condition, as a share of what is tolerated.

    Args:
        body: the body.
        contact: its contact nodes.
        step: the load step.
        u: displacement.
        said: contact tractions and states.
        origin: where friction counts from.
        compliance: 1 / gamma_1 and 1 / gamma_2 of the law that was promised; zero for the law itself.
    """
    prescribed = body.prescribed(step)
    free = np.isnan(prescribed)
    pressure, shear = said.pressure, said.shear
    moved = float(np.abs(u).max())
    figures = {}
    wrong = np.abs(u.ravel() - prescribed)[~free]
    figures["support"] = float(wrong.max(initial=0.0)) / max(1e-9 * moved, LEAST)
    # Equilibrium at every free dof, contact tractions included.
    inner, load = body.stiffness @ u.ravel(), body.load(step)
    taken = contact.forces(pressure, shear, len(u))
    noise = 200 * _EPS * float((abs(body.stiffness) @ np.abs(u.ravel())).max())
    # Contact forces on supported unknowns have no effect, however large they are.
    force = max(float(np.abs(inner).max()), float(np.abs(load).max()), float(np.abs(taken[free]).max(initial=0.0)))
    residual = np.abs(inner - load + taken)[free]
    figures["equilibrium"] = float(residual.max(initial=0.0)) / max(TOLERANCE * force + noise, LEAST)
    # Scales of the deformation: of a rigid motion only the round-off is tolerated, however large it is.
    shape = deformation(body, u)
    # At a node that a support holds in part, pressure and shear may be anything: only what the body feels sets a scale.
    loose = free.reshape(-1, 2)[contact.nodes]
    felt = loose * (pressure[:, None] * contact.normal + shear[:, None] * contact.tangent)
    acting = np.abs(felt).max(initial=0.0)
    stress = max(float(acting), 1e-3 * body.young * shape / body.size)
    length = max(shape, 1e-3 * stress / body.young * body.size)
    near = TOLERANCE * length + 1e3 * _EPS * (moved + float(np.abs(contact.gap).max()))
    negligible = max(TOLERANCE * stress, noise / float(contact.weight.min()), LEAST)
    # What is added to the slip and the shear of the step before has their round-off.
    near = max(near, 1e3 * _EPS * float(np.abs(origin.u_t).max(initial=0.0)), LEAST)
    negligible = max(negligible, 1e3 * _EPS * float(np.abs(origin.shear).max(initial=0.0)))
    at = u[contact.nodes]
    u_n, u_t = (at * contact.normal).sum(axis=1), (at * contact.tangent).sum(axis=1)
    # In a direction that a support holds, the support determines the force.
    judged_n = (np.abs(contact.normal) * loose).max(axis=1) > 1e-8
    judged_t = (np.abs(contact.tangent) * loose).max(axis=1) > 1e-8
    entered = u_n - contact.gap - compliance[0] * pressure
    one = ~contact.bilateral & judged_n
    two = contact.bilateral & judged_n
    figures["penetration"] = _most(np.where(two, np.abs(entered), entered)[judged_n]) / near
    figures["pressure below zero"] = _most(-pressure[one]) / negligible
    figures["pressure at a distance"] = _most(np.minimum(pressure / negligible, -entered / near)[one])
    figures["state of contact"] = _most(pressure[one & (said.state == "open")]) / negligible
    bound = contact.bound(pressure)
    if not contact.has_friction:
        figures["shear without friction"] = _most(np.abs(shear)[judged_t]) / negligible
        return figures
    xi = u_t - origin.slip_from(compliance[1]) - compliance[1] * (shear - origin.shear)
    below = bound - np.abs(shear)
    figures["friction cone"] = _most(-below[judged_t]) / negligible
    figures["slip below the bound"] = _most(np.minimum(np.abs(xi) / near, below / negligible)[judged_t])
    figures["slip against the shear"] = _most(
        np.minimum(np.abs(shear) / negligible, -xi * np.sign(shear) / near)[judged_t]
    )
    stick = (said.state == "stick") & judged_t
    figures["state of stick"] = _most(np.abs(xi)[stick]) / near
    for name, sign in (("slip+", 1), ("slip-", -1)):
        sliding = (said.state == name) & judged_t & (bound > 0)
        figures[f"state of {name}"] = max(
            _most((bound - sign * shear)[sliding]) / negligible, _most((-sign * xi)[sliding]) / near
        )
    return figures


def _most(values: Array) -> float:
    """The largest value; NaN counts as infinite."""
    return float(np.nan_to_num(values, nan=1e300, posinf=1e300).max(initial=0.0))
