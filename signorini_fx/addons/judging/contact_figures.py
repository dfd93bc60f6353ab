"""Figures of contact and friction of a foreign result, each with the share of force or energy that it concerns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.addons.judging.problem_data import JudgedProblem
from signorini_fx.addons.judging.touching_surface import TouchingSurface
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.tuned import (
    JUDGED_APART,
    JUDGED_CARRIES,
    JUDGED_CONE_MARGIN,
    JUDGED_DEEP,
    JUDGED_ELASTIC_SLIP,
    JUDGED_PENETRATION_OF_PRESSURE,
    JUDGED_SAME_WAY,
    JUDGED_SOFT_ENERGY,
)


@dataclass(frozen=True)
class JudgedContactFigures:
    """Figures of one contact; shares of ``force``, the sum of the sizes of the forces at corners.

    Attributes:
        surface: of which they are.
        force: force.
        tension: share that pulls.
        pulling: the corner that pulls most.
        penetration: largest, over the largest displacement, without what contact at nodes does not see.
        entered: what of it the stiffness of contact does not explain, likewise.
        deepest: the corner where that is.
        stiffness: measured, stress per length; nan: nothing enters.
        penalty_energy: work of forces on what enters, over a(v, v).
        apart: share of corners around which the sides are apart.
        beside: the corner of these with most force.
        coarse: share of corners where it is, but where the clearance varies by more on the facets, of degree 2 or
            between two bodies: a mean of it with weights that are negative somewhere does not say where they touch.
        coarsest: the corner of these with most force.
        cone: shear over its bound where it is above it, 1 elsewhere; without friction the share of shear.
        cone_share: share of force of these corners.
        above: the corner that is most above it.
        cone_count: how many they are.
        wrong_way: work of shear along slip over a(v, v).
        forward: the corner with most of it.
        slips_below: share of the work of friction at its bound that is missing where nodes slip.
        slips_energy: the same over a(v, v).
        slack: the corner with most of it.
        used: largest share of its bound that shear takes: with a coefficient that is smaller by it the result is the
            same; 0 without friction.
        slip_work: work of friction at its bound where nodes slip over a(v, v), by which another coefficient is seen.
        touching: how many corners are pressed.
        gives_way: work of forces on the length by which the law of soft contact gives way, over a(v, v); 0: it is hard.
        unlawful: share of force that is not that of the law.
        misfit: the corner with most of it.
    """

    surface: TouchingSurface
    force: float
    tension: float
    pulling: int
    penetration: float
    entered: float
    deepest: int
    stiffness: float
    penalty_energy: float
    apart: float
    beside: int
    coarse: float
    coarsest: int
    cone: float
    cone_share: float
    above: int
    cone_count: int
    wrong_way: float
    forward: int
    slips_below: float
    slips_energy: float
    slack: int
    used: float
    slip_work: float
    touching: int
    gives_way: float
    unlawful: float
    misfit: int

    @property
    def is_soft(self) -> bool:
        """Whether contact gives way so much that its law is judged; a linear one may be a penalty that is meant to be
        hard.
        """
        law = self.surface.contact.law
        return law is not None and self.gives_way > JUDGED_SOFT_ENERGY


def contact_stiffness(problem: JudgedProblem, surface: TouchingSurface) -> float:
    """That of the deck, stress per length: 0 for contact that is hard."""
    contact = surface.contact
    if contact.stiffness is not None:
        return contact.stiffness
    owners = problem.mesh.owners(contact.facets)
    young = max(entry.young for entry in problem.materials if np.isin(owners, entry.cells).any())
    return problem.hard * young


def contact_figures(
    problem: JudgedProblem, surface: TouchingSurface, energy: float, largest: float, size: float
) -> JudgedContactFigures:
    """The figures of a surface.

    Args:
        problem: the problem.
        surface: one side of a contact.
        energy: a(v, v).
        largest: the largest displacement, length.
        size: the sum of the sizes of all forces at nodes: where contact carries hardly any of it, what it has is print
            round-off, and no shares of it are taken.
    """
    s = surface
    push = np.where(s.judged, s.push, 0.0)
    carried = float(np.abs(push).sum())
    least = JUDGED_CARRIES * size
    force = max(carried, least) or np.inf
    # Of shear a part acts along the normal, if that is another one.
    askew = s.rotation * np.linalg.norm(s.shear, axis=1)
    pulls = (-push - askew).clip(min=0.0)
    pressed = push > JUDGED_CARRIES * push.max(initial=0.0)
    stated = contact_stiffness(problem, s)
    deep = s.judged & (s.penetration > JUDGED_DEEP * s.penetration[s.judged].max(initial=0.0)) & (s.penetration > 0)
    volume = float((s.area * s.penetration)[deep].sum())
    stiffness = float(push[deep].sum()) / volume if volume > 0 else np.nan
    pressure = (push / s.area).clip(min=0.0)
    around = np.array([pressure[s.neighbours[[row]].indices].max(initial=0.0) for row in range(len(s.corners))])
    hardness = stated if stated > 0 else stiffness
    law = s.contact.law
    allowed = JUDGED_PENETRATION_OF_PRESSURE * around / hardness if hardness > 0 else np.zeros_like(around)
    entered = np.where(s.judged, s.penetration - allowed - s.uneven, 0.0)
    reach = 0.0 if law is None else law.reach
    is_apart = (s.clearance > JUDGED_APART * largest + reach) & s.judged
    weighted = problem.mesh.facet.degree > 1 or s.contact.opposite.size > 0
    is_coarse = is_apart & (s.clearance < s.varies) & weighted
    carries = (np.abs(push) - askew).clip(min=0.0)
    apart, coarse = np.where(is_apart & ~is_coarse, carries, 0.0), np.where(is_coarse, carries, 0.0)
    figures = _friction(s, push, force, energy, least) | _lawful(s, push, pressure, energy, least)
    return JudgedContactFigures(
        surface=s,
        force=carried,
        tension=float(pulls.sum() / force),
        pulling=int(np.argmax(pulls)),
        penetration=float((s.penetration - s.uneven)[s.judged].max(initial=0.0) / largest),
        entered=float(entered.max(initial=0.0) / largest),
        deepest=int(np.argmax(entered)),
        stiffness=stiffness,
        penalty_energy=float((push.clip(min=0.0) * s.penetration).sum() / energy),
        apart=float(apart.sum() / force),
        beside=int(np.argmax(apart)),
        coarse=float(coarse.sum() / force),
        coarsest=int(np.argmax(coarse)),
        touching=int(np.count_nonzero(pressed & s.judged)),
        **figures,
    )


def _lawful(s: TouchingSurface, push: Floats, pressure: Floats, energy: float, least: float) -> dict[str, Any]:
    """The figures of the law of soft contact."""
    law = s.contact.law
    if law is None or s.lawful is None:
        return {"gives_way": 0.0, "unlawful": 0.0, "misfit": 0}
    low, high = np.where(s.judged, s.lawful, 0.0)
    away = (low - push).clip(min=0.0) + (push - high).clip(min=0.0)
    most = max(float(push.clip(min=0.0).sum()), float(low.sum()), least)
    work = float((pressure * s.area * law.give(pressure)).sum())
    return {
        "gives_way": work / energy,
        "unlawful": float(away.sum()) / most if most > 0 else 0.0,
        "misfit": int(np.argmax(away)),
    }


def _friction(s: TouchingSurface, push: Floats, force: float, energy: float, least: float) -> dict[str, Any]:
    """The figures of friction."""
    push = np.where(s.sliding, push.clip(min=0.0), 0.0)
    shear = np.where(s.sliding[:, None], s.shear, 0.0)
    size = np.linalg.norm(shear, axis=1)
    carries = push > JUDGED_CARRIES * max(float(push.sum()), least)
    margin = (JUDGED_CONE_MARGIN - 1) * (s.bound if s.contact.rubs else push) + s.rotation * push
    over = carries & (size > s.bound + margin)
    cone = 1.0
    if s.contact.rubs and over.any():
        bound = float(s.bound[over].sum())
        cone = float((size - s.rotation * push)[over].sum()) / bound if bound > 0 else np.inf
    elif not s.contact.rubs:
        cone = 1.0 + (float(size[over].sum() / push[carries].sum()) if over.any() else 0.0)
    slip = np.linalg.norm(s.slip, axis=1)
    stick = s.contact.stick
    # Of friction that has acted before, sides spring back by what it had bent.
    spring = size + s.bound if s.rubbed else size
    elastic = spring / (stick * s.area) if stick else np.zeros_like(size)
    along = np.where(s.touched, np.einsum("cd,cd->c", shear, s.slip), 0.0).clip(min=0.0)
    if s.rubbed:
        along = np.where(slip > JUDGED_ELASTIC_SLIP * elastic, along, 0.0)
    beyond = (slip - JUDGED_ELASTIC_SLIP * elastic).clip(min=0.0) * (carries & s.touched & _same_way(s, slip))
    missing = (s.straight * s.bound - size - s.rotation * push).clip(min=0.0) * beyond
    rubbing = carries & (s.bound > 0) if s.contact.rubs else np.zeros_like(carries)
    work = float((s.bound * slip)[carries & s.touched].sum())
    return {
        "cone": cone,
        "cone_share": float(push[over].sum() / force),
        "above": int(np.argmax(np.where(over, size / np.maximum(s.bound, 1e-300), 0.0))),
        "cone_count": int(np.count_nonzero(over)),
        "wrong_way": float(along.sum() / energy) if s.contact.rubs else 0.0,
        "forward": int(np.argmax(along)),
        "slips_below": float(missing.sum() / work) if s.contact.rubs and work > 0 else 0.0,
        "slips_energy": float(missing.sum() / energy) if s.contact.rubs else 0.0,
        "slack": int(np.argmax(missing)),
        "used": float((size[rubbing] / s.bound[rubbing]).max(initial=0.0)),
        "slip_work": float((s.straight * s.bound * beyond)[rubbing].sum() / energy),
    }


def _same_way(s: TouchingSurface, slip: Floats) -> npt.NDArray[np.bool_]:
    """Whether all neighbours slip as a corner does: where slip turns inside a facet friction is below its bound."""
    unit = s.slip / np.maximum(slip, 1e-300)[:, None]
    rows, columns = s.neighbours.nonzero()
    cosines = np.einsum("nd,nd->n", unit[rows], s.slip[columns])
    aligned = np.ones(len(slip), dtype=bool)
    np.logical_and.at(aligned, rows, cosines >= JUDGED_SAME_WAY * slip[rows])
    return aligned
