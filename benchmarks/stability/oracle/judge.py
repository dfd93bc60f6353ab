"""The verdict on the results of a scene, from the text of the scene and plain arrays alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from benchmarks.stability.oracle import convex, statics
from benchmarks.stability.oracle.body import Body, Mesh, behind, listed
from benchmarks.stability.oracle.conditions import LEAST, Contact, Origin, Tractions, violations
from benchmarks.stability.oracle.elements import Array, Ints
from benchmarks.stability.oracle.mortar import contacts_of

# Kinds of verdicts, in the order of the table.
RIGHT = "converged, correct"
NO_BALANCE = "no equilibrium, confirmed"
REPORTED = "failure reported"
REFUSED = "scene refused"
DOUBTFUL = "no equilibrium of Coulomb friction, though statics would allow for one"
DENIED = "no equilibrium, but there is one: WRONG"
UNCERTIFIED = "certificate does not hold: WRONG"
REFUSED_WRONGLY = "scene refused: WRONG"
WRONG = "converged, but WRONG"
CRASHED = "no outcome: traceback, crash or time limit"
KINDS = (
    RIGHT,
    NO_BALANCE,
    REPORTED,
    REFUSED,
    DOUBTFUL,
    UNCERTIFIED,
    REFUSED_WRONGLY,
    DENIED,
    WRONG,
    CRASHED,
)
FAILURES = (UNCERTIFIED, REFUSED_WRONGLY, DENIED, WRONG, CRASHED)

CONVERGED = "converged"
NOT_HELD, OPEN, SLIDES = (
    "body not held",
    "contact opens, no static equilibrium",
    "slides, no static equilibrium",
)
TIPS = "tips over, no static equilibrium"
NO_EQUILIBRIUM = (NOT_HELD, OPEN, TIPS, SLIDES)
NOT_CERTIFIED = "certificate does not hold"

# Distance from the convex programme, in the energy norm and in the forces, for a programme without
# any error; with Coulomb friction the bound of the programme is that of the answer, which is a
# fixed point to ``tolerance`` only.
AGREE, AGREE_COULOMB = 1e-6, 1e-5
# The error allowed for the model of path-following.
MODEL = 2.0
# The penalty of gamma = auto, in units of E over the size of the body: docs/theory.md.
AUTOMATIC_GAMMA = 1e5

# Distance that is allowed for what the cone programme misses of its own constraints.
_PER_RESIDUAL = 100.0
# Relative difference of what the table and the second program compute from the same displacement;
# between two bodies by quadratures of rational functions, where cells are distorted.
_TABLE, _TABLE_BETWEEN = 1e-9, 1e-6
# Share of the stress by a displacement whose round-off is a bound where nothing presses.
_FAINT = 1e-3


@dataclass(frozen=True)
class Step:
    """A load step as a user gets it."""

    displacement: Array  # at the places of the answer, shape (n, d)
    table: Mapping[str, npt.NDArray[Any]]  # the contact table
    regularised: bool = False  # whether its certificate says that it keeps to the regularised law


@dataclass(frozen=True)
class Answer:
    """What a user gets for a scene."""

    outcome: str  # how it ended
    place: Array  # where displacements are given, shape (n, d)
    steps: Sequence[Step]  # load steps, as far as they went
    gamma: tuple[
        float, float
    ]  # gamma_1 and gamma_2 that the package reports, of the last load step
    events: Sequence[str] = ()  # what the run said of fall-backs
    # what path-following says that gamma leaves, relative, in the energy norm
    regularisation_error: float | None = None
    # the mean of the middles of the cells around each place, by which nodes of two bodies at one
    # place differ; None: not told
    behind: Array | None = None


@dataclass(frozen=True)
class Verdict:
    """What the oracle thinks of an answer."""

    kind: str  # one of ``KINDS``
    outcome: str  # what the package called it
    # each condition as a share of what is tolerated; above 1 it is violated
    figures: dict[str, float] = field(default_factory=dict)
    compared: int = 0  # load steps that a convex programme was computed for
    note: str = ""  # what is to be said of it

    @property
    def worst(self) -> tuple[str, float]:
        """The figure that is nearest to its limit, or farthest beyond it."""
        return max(self.figures.items(), key=lambda item: item[1], default=("nothing", 0.0))


def judge(scene: dict[str, Any], mesh: Mesh, answer: Answer) -> Verdict:
    """Judge an answer."""
    body = Body(scene, mesh)
    if answer.outcome == CONVERGED:
        return _converged(body, contacts_of(body), answer)
    if answer.outcome in NO_EQUILIBRIUM:
        return _no_equilibrium(body, contacts_of(body), answer)
    return Verdict(UNCERTIFIED if answer.outcome == NOT_CERTIFIED else REPORTED, answer.outcome)


def _converged(body: Body, contact: Contact, answer: Answer) -> Verdict:
    figures: dict[str, float] = {}
    compared, notes = 0, []

    def worse(found: Mapping[str, float]) -> None:
        for name, value in found.items():
            figures[name] = max(figures.get(name, 0.0), np.inf if np.isnan(value) else float(value))

    if len(answer.steps) != body.steps:
        return Verdict(WRONG, answer.outcome, {"load steps": np.inf}, note="load steps are missing")
    x, place = body.x, answer.place
    if contact.between and answer.behind is not None:
        x, place = (
            np.hstack((x, behind(x, body.cells, body.corners.shape[1]))),
            np.hstack((place, answer.behind)),
        )
    nodes = _in_order(x, place, body.size)
    if nodes is None:
        return Verdict(
            WRONG, answer.outcome, {"nodes": np.inf}, note="displacements are not at the nodes"
        )
    origin, before = Origin.nothing(contact), 0.0
    for number, step in enumerate(answer.steps):
        order = _rows(body, contact, step.table)
        if order is None:
            return Verdict(
                WRONG,
                answer.outcome,
                {"contact table": np.inf},
                note="rows are not the contact points",
            )
        table = {name: np.asarray(column)[order] for name, column in step.table.items()}
        said = Tractions(table["pressure"], _vectors(table, "shear"), _states(table))
        u = step.displacement[nodes]
        worse(_table(contact, table, u, origin, before, body.young / body.size))
        law = _promised(body, contact, number, u, said, origin, answer, worse)
        worse(violations(body, contact, number, u, said, origin, law))
        if convex.cvxopt is not None:
            programme = convex.compare(
                body, contact, number, u, contact.bound(said.pressure), origin, law
            )
            if programme is not None and programme.usable:
                compared += 1
                # The energy is strongly convex: a gap of that size allows for no larger distance.
                far = np.sqrt(2 * programme.gap) + _PER_RESIDUAL * programme.residual
                near = AGREE_COULOMB if contact.follows_pressure else AGREE
                worse({"convex: displacement": programme.displacement / (near + far)})
                worse(
                    {
                        "convex: force": programme.force
                        / (near + far * max(1.0, programme.stiffening))
                    }
                )
            else:
                notes.append(
                    f"step {number}: the convex programme is not accurate enough to judge by"
                )
            if (
                answer.regularisation_error is not None
                and body.steps == 1
                and not contact.follows_pressure
            ):
                worse(_left_by_gamma(body, contact, u, origin, answer.regularisation_error))
        before = float(np.abs(u).max())
        origin = origin.after(contact.across(contact.of(u)), said.shear, law[1], contact)
    kind = RIGHT if all(value <= 1 for value in figures.values()) else WRONG
    return Verdict(kind, answer.outcome, figures, compared, "; ".join(notes))


def _left_by_gamma(
    body: Body, contact: Contact, u: Array, origin: Origin, said: float
) -> dict[str, float]:
    """Path-following promises a distance from the unregularised solution: the one asked for, and
    the one it reports.
    """
    limit = convex.compare(
        body, contact, 0, u, contact.bound(np.zeros(len(contact.weight))), origin, (0.0, 0.0)
    )
    if limit is None or not limit.usable:
        return {}
    distance = limit.distance / np.sqrt(u.ravel() @ (body.stiffness @ u.ravel()))
    near = AGREE + np.sqrt(2 * limit.gap) + _PER_RESIDUAL * limit.residual
    found = {"regularisation error reported": distance / (MODEL * said + near)}
    asked = body.scene["solver"].get("regularisation_error", "auto")
    if asked != "auto":
        found["regularisation error asked for"] = distance / (asked + near)
    return found


def _promised(
    body: Body,
    contact: Contact,
    number: int,
    u: Array,
    said: Tractions,
    origin: Origin,
    answer: Answer,
    worse: Any,
) -> tuple[float, float]:
    """The compliance of the law that the method promises: none, or 1 / gamma of the gamma that was
    asked for.
    """
    solver = body.scene.get("solver", {})
    algorithm = solver.get("algorithm", "auto")
    # Augmentation may have taken over in a later load step only.
    augmented = any("augmented Lagrangian" in event for event in answer.events)
    if (algorithm == "alm" or augmented) and not answer.steps[number].regularised:
        return 0.0, 0.0
    if algorithm == "alm":  # whose fall-back is regularised, with the gamma that it tells
        return 1 / answer.gamma[0], 1 / answer.gamma[1]
    automatic = AUTOMATIC_GAMMA * body.young / body.size
    asked = [solver.get(name, "auto") for name in ("gamma_n", "gamma_t")]
    asked = [automatic if gamma == "auto" else gamma for gamma in asked]
    if algorithm != "path-following":
        # What is told is the gamma of the last load step.
        for name, told, gamma in zip(("gamma_n", "gamma_t"), answer.gamma, asked, strict=True):
            worse({name: 0.0 if augmented else abs(told / gamma - 1) / 1e-9})
        return 1 / asked[0], 1 / asked[1]
    if number == body.steps - 1:
        return 1 / answer.gamma[0], 1 / answer.gamma[1]
    # What it found in an earlier step is not told: one gamma for all points, and the ratio that was
    # asked for.
    at = contact.of(u)
    most = int(np.argmax(np.abs(said.pressure)))
    ratio = float(np.clip(asked[0] / asked[1], 0.1, 10.0))  # a path takes no other
    if said.pressure[most] != 0:
        soft = float(at[most] @ contact.normal[most] - contact.gap[most]) / float(
            said.pressure[most]
        )
        return soft, soft * ratio
    # Given friction acts on open points too: those that stick tell.
    below = np.linalg.norm(said.shear, axis=1) < (1 - 1e-9) * contact.bound(said.pressure)
    added = np.where(below[:, None], said.shear - origin.shear, 0.0)
    most = int(np.argmax(np.linalg.norm(added, axis=1)))
    slip = (contact.across(at) - origin.u_t)[most]
    soft = (
        float(slip @ added[most] / (added[most] @ added[most]))
        if added[most].any()
        else 1 / answer.gamma[1]
    )
    return soft / ratio, soft


def _states(table: Mapping[str, npt.NDArray[Any]]) -> npt.NDArray[np.str_]:
    """The states without the signs that they have in 2D."""
    return np.char.rstrip(table["state"].astype(str), "+-")


def _vectors(table: Mapping[str, Array], name: str) -> Array:
    """Tangential vectors, in 2D from components along (-n_2, n_1)."""
    if "n_z" in table:
        return np.stack([table[f"{name}_{axis}"] for axis in "xyz"], axis=1)
    return np.stack([-table["n_y"], table["n_x"]], axis=1) * table[name][:, None]


def _table(
    contact: Contact,
    table: Mapping[str, Array],
    u: Array,
    origin: Origin,
    before: float,
    stiffness: float,
) -> dict[str, float]:
    """Columns of the contact table that the displacement and the scene say as well; ``before``: of
    the step before.
    """
    at = contact.of(u)
    u_n, u_t = (at * contact.normal).sum(axis=1), contact.across(at)
    slip = u_t - origin.u_t
    moved = max(float(np.abs(u).max()), LEAST)
    axes = "xyz"[: u.shape[1]]
    columns: dict[str, tuple[Array, Array, float]] = {
        "u_n": (table["u_n"], u_n, moved),
        "u_t": (_vectors(table, "u_t"), u_t, moved),
        "gap": (table["gap"], contact.gap, max(float(np.abs(contact.gap).max()), moved)),
        "weight": (table["weight"], contact.weight, float(contact.weight.max())),
        "normal": (np.stack([table[f"n_{axis}"] for axis in axes], axis=1), contact.normal, 1.0),
    }
    if "u_t_x" in table:
        columns["length of u_t"] = (table["u_t"], np.linalg.norm(u_t, axis=1), moved)
    rubs = contact.rubs & np.isfinite(contact.given)
    if rubs.any():
        bound = contact.bound(table["pressure"])
        # Where nothing presses, the bound is round-off of the stress by the displacement.
        pressing = max(float(bound[rubs].max()), _FAINT * stiffness * moved, LEAST)
        columns["bound"] = (table["bound"][rubs], bound[rubs], pressing)
        columns["slip"] = (_vectors(table, "slip"), slip, max(moved, before))
        if "shear_x" in table:
            # Where nothing presses on the boundaries with friction, their shear is round-off of the
            # pressure elsewhere.
            pressed = max(float(bound.max()), float(np.abs(table["pressure"]).max()), LEAST)
            columns["shear"] = (
                table["shear"],
                np.linalg.norm(_vectors(table, "shear"), axis=1),
                pressed,
            )
        if "n_z" not in table:  # in 2D states have the sign of the shear
            sign = 1.0 * np.char.endswith(table["state"].astype(str), "+") - np.char.endswith(
                table["state"].astype(str), "-"
            )
            columns["sign of slip"] = (
                np.maximum(-sign * table["shear"], 0.0),
                np.zeros(len(sign)),
                pressing,
            )
    near = _TABLE_BETWEEN if contact.between else _TABLE
    return {
        f"table: {name}": float(np.nan_to_num(np.abs(said - own), nan=1e300).max()) / (near * scale)
        for name, (said, own, scale) in columns.items()
    }


def _in_order(x: Array, place: Array, size: float) -> Ints | None:
    """Which of the given places each node is; None where they do not match one to one."""
    if len(x) != len(place):
        return None
    away, order = cKDTree(place).query(x)
    if away.max() > 1e-7 * size or len(np.unique(order)) != len(x):
        return None
    return order.astype(np.int64)


def _rows(body: Body, contact: Contact, table: Mapping[str, npt.NDArray[Any]]) -> Ints | None:
    """The row of the table that each contact point is."""
    place = np.stack([table[axis] for axis in "xyz"[: contact.x.shape[1]]], axis=1)
    names = [effect["boundary"] for effect in listed(body.scene, "contact")]
    rows = np.zeros(len(contact.weight), dtype=np.int64)
    if len(place) != len(rows):
        return None
    for part, name in enumerate(names):
        theirs, ours = (
            np.flatnonzero(table["boundary"] == name),
            np.flatnonzero(contact.part == part),
        )
        order = _in_order(contact.x[ours], place[theirs], body.size) if len(theirs) else None
        if order is None:
            return None
        rows[ours] = theirs[order]
    return rows


def _no_equilibrium(body: Body, contact: Contact, answer: Answer) -> Verdict:
    """Outcomes without equilibrium are checked by statics."""
    step = max(len(answer.steps) - 1, 0)
    if answer.outcome == NOT_HELD:
        kind = DENIED if statics.held(body, contact) else NO_BALANCE
        return Verdict(kind, answer.outcome)
    if convex.cvxopt is None:
        return Verdict(REPORTED, answer.outcome, note="no cone programme without CVXOPT")
    room, pressure = statics.slack(body, contact, step)
    if np.isnan(room):
        return Verdict(DOUBTFUL, answer.outcome, note="the cone programme of statics has no result")
    if room <= 1e-6:
        return Verdict(NO_BALANCE, answer.outcome)
    note = f"contact forces balance the loads with {room:.1e} of them to spare"
    if not contact.follows_pressure:
        return Verdict(DENIED, answer.outcome, note=note)
    # Where the bound follows the pressure, balance does not prove a solution; a solution that is
    # found does.
    if _solution_exists(body, contact, step, answer, pressure):
        return Verdict(DENIED, answer.outcome, note=f"{note}; and here is a solution")
    return Verdict(DOUBTFUL, answer.outcome, note=note)


def _solution_exists(
    body: Body, contact: Contact, step: int, answer: Answer, pressure: Array
) -> bool:
    """Whether the oracle finds a solution with Coulomb friction of its own, from the load step
    before.
    """
    origin = Origin.nothing(contact)
    if step > 0:
        table = answer.steps[step - 1].table
        if (order := _rows(body, contact, table)) is None:
            return False
        origin = origin.after(
            _vectors(table, "u_t")[order], _vectors(table, "shear")[order], 0.0, contact
        )
    if (found := convex.coulomb_state(body, contact, step, origin, pressure)) is None:
        return False
    u, pressure, shear = found
    said = Tractions(pressure, shear, np.full(len(pressure), "unknown"))
    # The programme is as exact as its duality gap, not as a Newton iteration.
    return max(violations(body, contact, step, u, said, origin, (0.0, 0.0)).values()) <= 10
