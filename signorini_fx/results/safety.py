"""The safety factor of a result: the multiple of the live loads beyond which statics lets the body move away."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace

import numpy as np
import numpy.typing as npt

from signorini_fx.algebra.contact.friction import as_given
from signorini_fx.algebra.contact.motions import total_work
from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.algebra.contact.reactions import Reactions, reactions
from signorini_fx.algebra.contact.reference_motion import reference_motion
from signorini_fx.algebra.contact.statics import Limit, along_contact, largest_multiple, null_space
from signorini_fx.machine import parallel
from signorini_fx.mechanics.body.statics_of_surface import (
    LimitSurface,
    Unproved,
    factor_at_least,
    factor_at_most,
    surface_of,
)
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.rigid.motion_names import names_of
from signorini_fx.mechanics.rigid.rigid_motions import RigidMotions
from signorini_fx.mechanics.statement.effect import Force
from signorini_fx.results.certificate.nodal_forces import NodalForces
from signorini_fx.tuned import ALONG_CONTACT, SAME_LENGTH, SAME_LIMIT


@dataclass(frozen=True)
class Safety:
    """The largest multiple of the live loads at which a body that supports do not hold stays; inf: there is no limit.

    The foundation can press at the nodes that touch it in this solution, or where the rigid body rests: no other node
    is counted on, since the body would have to move there first.

    Attributes:
        factor: pressures and shears that the law allows for were found that balance this multiple.
        bound: it is proved that none balance a larger one; ``factor`` but for round-off.
        exact: whether the body stays up to ``factor``: without Coulomb friction, because the other laws are associated.
            With Coulomb friction ``bound`` is an upper bound only, because the pressures that hold most need not be
            those that arise.
        friction_used: with Coulomb friction the share of the friction of this solution that its live loads use: they
            move the body away at 1 / ``friction_used`` of their size if no friction bound changes and only the nodes
            in contact press.  It describes this solution and sets no limit, because the pressures change with the
            loads.  None without Coulomb friction.
        motion: the motion beyond ``factor``, in words; "" where there is no limit.
        sliding: the largest multiple that the law balances in all translations, and in what else moves the body along
            the contact without opening it: however it would tip.  At least ``factor``.
        overturning: the largest multiple if friction had no limit where there is any: however it would slide.  At least
            ``factor``.
        body: between which multiples that of the body is, with every point of its surface that touches to one facet,
            round-off included; 0 and infinity where nothing is proved.
        reason: why nothing is proved of the body; "".
        assumed: what the factors rest on.
    """

    factor: float
    bound: float
    exact: bool
    friction_used: float | None
    motion: str
    sliding: float
    overturning: float
    body: tuple[float, float] = (0.0, np.inf)
    reason: str = ""
    assumed: str = ""

    @property
    def of_body(self) -> bool:
        """Whether ``factor`` is proved for the body and not only for its mesh."""
        low, high = self.body
        return bool(
            low >= self.factor * (1 - SAME_LIMIT) and high <= self.bound * (1 + SAME_LIMIT) and self.bound < np.inf
        ) or (low == np.inf)

    def as_dict(self) -> dict[str, object]:
        """All figures, JSON-safe: null where there is no limit."""
        figures: dict[str, object] = {name: None if value == np.inf else value for name, value in asdict(self).items()}
        return figures | {"body": [None if value == np.inf else value for value in self.body], "of_body": self.of_body}


def safety_of(model: Model, contact: ContactState, step: float) -> Safety | None:
    """The safety factor of a load step with a solution; collective.

    Args:
        model: the model.
        contact: the contact nodes of this rank in its solution.
        step: the place of the load step in the lists of factors.

    Returns:
        None if supports hold the body, if no live load acts on its free motions, if the tractions of the solution do
        not balance its loads at these nodes, or if a friction law has a larger bound there than it says.
    """
    motions, boundary, count = model.motions, contact.boundary, model.motions.free.shape[1]
    if not count or not model.applied:
        return None
    at_contact = motions.at(boundary)
    nothing: npt.NDArray[np.float64] = np.zeros(len(motions.of_all) - len(motions.free))
    driving = sum((factor * load.driven.forces for factor, load in model.applied_at(step) if load.driven), nothing)
    live, dead = (
        total_work([(1.0, motions.load_of(forces, model.comm, on))], count)
        for forces, on in zip(_loads(model, step), (driving, None), strict=True)
    )
    law, pressing = model.law, _touching(model, contact, live + dead, step)
    allowed = reactions(at_contact, law, contact.bilateral, pressing)
    present = None
    if model.statement.has_coulomb:
        bounds = as_given(contact.bound)
        present = reactions(at_contact, bounds, contact.bilateral, contact.bilateral | contact.in_contact)
    if parallel.any_rank(model.comm, not np.isfinite(contact.pressure).all()):
        return None
    if law is not None and parallel.any_rank(model.comm, bool(law.exceeds_envelope(contact.pressure).any())):
        return None
    surfaces, reason = _surfaces(model, pressing)
    low, high = np.inf, np.inf
    worst: tuple[Limit, str] | None = None
    used: list[float] = []
    sliding = overturning = np.inf
    for number, columns in at_contact.assemblies:
        if not live[columns].any():
            continue
        loads, here = (dead[columns], live[columns]), allowed.of(number, columns)
        limit = largest_multiple(here, *loads)
        if limit is None:
            return None
        if limit.factor < np.inf:
            along = _along_contact(here, motions, columns)
            driven = np.where(np.abs(loads[1] @ along) > SAME_LIMIT * np.abs(loads[1]).max(), loads[1] @ along, 0.0)
            sliding = min(sliding, _multiple(_on(here, along), loads[0] @ along, driven, limit.factor))
            overturning = min(overturning, _multiple(here.rough, *loads, limit.factor))
        if surfaces is not None:
            least = factor_at_least(here, surfaces[number], limit.found, *loads)
            low = min(low, 0.0 if least is None else least)
            if limit.motion is not None:
                high = min(high, factor_at_most(surfaces[number], limit.motion, *loads))
        if worst is None or limit.found < worst[0].found:
            words = ""
            if limit.motion is not None:
                beyond = along_contact(here, limit.motion, limit.pressed)
                members = np.flatnonzero(motions.pieces.assembly == number)
                words = names_of((motions.of_all[:, columns] @ beyond)[:, None], motions, members, one_way=True)
            worst = limit, words
        if present is not None:
            present_limit = largest_multiple(present.of(number, columns), *loads)
            if present_limit is None:
                return None
            used.append(1 / present_limit.found if present_limit.found > 0 else np.inf)
    if worst is None:
        return None
    limit, words = worst
    return Safety(
        limit.found,
        limit.factor,
        not model.statement.has_coulomb,
        max(used, default=None),
        words,
        sliding,
        overturning,
        (0.0, np.inf) if surfaces is None else (low, high),
        reason,
        _assumed(model),
    )


def _assumed(model: Model) -> str:
    """What the factors rest on, in words."""
    clauses = [
        "the foundation presses where the body touches it now",
        f"{model.law.unknown}, so that factors are upper bounds" if model.law is not None and model.law.unknown else "",
        *model.statement.assumed,
        model.statement.body_of_proofs,
    ]
    return "; ".join(filter(None, clauses))


def _along_contact(here: Reactions, motions: RigidMotions, columns: npt.NDArray[np.bool_]) -> Nodal:
    """The translations of an assembly, and its motions that open no contact, as combinations of its free motions.

    Returns:
        An orthonormal basis, shape (k, s).
    """
    moved = motions.of_all[:, columns].reshape(-1, motions.each, np.count_nonzero(columns))
    turned = moved[:, motions.x.shape[1] :].reshape(-1, moved.shape[2])
    both = np.column_stack((null_space(turned, ALONG_CONTACT), null_space(here.normal, ALONG_CONTACT)))
    vectors, values, _ = np.linalg.svd(both, full_matrices=False)
    return np.asarray(vectors[:, values > SAME_LIMIT])


def _on(here: Reactions, motions: Nodal) -> Reactions:
    """The same reactions on combinations of the motions, shape (k, s)."""
    return replace(here, normal=here.normal @ motions, tangential=here.tangential @ motions)


def _multiple(here: Reactions, dead: Nodal, live: Nodal, whole: float) -> float:
    """The largest multiple of a load, known to be at least ``whole``; infinite without a load."""
    if not live.any():
        return np.inf
    limit = largest_multiple(here, dead, live)
    return whole if limit is None else max(whole, limit.factor)


def _surfaces(model: Model, pressing: npt.NDArray[np.bool_]) -> tuple[dict[int, LimitSurface] | None, str]:
    """The contact surface of each assembly as far as it touches; or None, and why it is not known."""
    try:
        return surface_of(model, pressing), ""
    except Unproved as unproved:
        return None, str(unproved)


def _loads(model: Model, step: float) -> list[npt.NDArray[np.float64]]:
    """The live and the other loads of a load step at the owned dofs, shape (owned dofs,) each."""
    nodal, forces = NodalForces.on(model), model.statement.of(Force)
    return [nodal.external(step, some=[load for load in forces if load.live is live]).ravel() for live in (True, False)]


def _touching(model: Model, contact: ContactState, load: npt.NDArray[np.float64], step: float) -> npt.NDArray[np.bool_]:
    """The nodes that touch their foundation in the solution, or where the rigid body rests on it, shape (n,).

    Supports that move may keep the body away from where it would rest: then only the former.
    """
    touching = contact.in_contact | contact.bilateral
    if parallel.any_rank(model.comm, any(load.start.any() for _, load in model.applied_at(step))):
        return touching
    resting = reference_motion(contact.gap, contact.bilateral, model.motions.at(contact.boundary), load)
    gap = contact.gap if resting is None else contact.gap - resting.u_n
    return np.asarray(touching | (gap <= SAME_LENGTH * model.tagged.size))
