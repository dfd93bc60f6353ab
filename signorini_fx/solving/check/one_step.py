"""Findings about curved things that are pressed together with friction: in one step, and by frames that are tilted."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.model import Model
from signorini_fx.records import Finding
from signorini_fx.tuned import CLOSED_GAP, NOTABLE_SHEAR, ONE_DIRECTION, SHEAR_OF_TILT


def one_step(body: Model) -> list[Finding]:
    """That the way before the touch counts as slip where bodies close a gap that varies; collective."""
    if body.statement.steps > 1 or body.statement.load_steps.steps is not None:
        return []
    message = (
        "one step counts the way of a point before it touches as slip, so that less sticks than if the load grew: with "
        "F = nu = .3 a circle sticks within .31 of the half width of contact and a sphere within .61 of its radius, in "
        "40 load steps within .71 and .91"
    )
    return [Finding("note", f"contact[{index}].friction", message) for index, _ in _curved(body)]


def tilted_frames(body: Model, moved: float, contact: ContactState | None = None) -> list[Finding]:
    """How much shear pressing alone makes because frames are tilted against the way on which bodies approach, where it
    is much; collective.

    Args:
        body: the model, with its foundations where they are in the result.
        moved: how far bodies move before there is a result, an estimate, length.
        contact: the result; None: there is none yet.
    """
    findings, law = [], body.law
    for index, extent in _curved(body):
        boundary, data, effect = body.boundary, body.data, body.statement.contact[index]
        assert boundary is not None
        assert data is not None
        on_part = boundary.part == index
        x, normal, gap = boundary.x[on_part], boundary.normal[on_part], data.gap[on_part]
        coefficient = np.zeros(len(x)) if law is None else law.coefficient[on_part]
        farther = gap + parallel.largest(body.comm, -gap, -np.inf)
        first = farther <= CLOSED_GAP * extent
        dim = x.shape[1]
        sums = parallel.global_sum(body.comm, np.column_stack((normal, x, np.ones(len(x))))[first].sum(axis=0))
        approach, touch = sums[:dim] / sums[-1], sums[dim:-1] / sums[-1]
        if np.linalg.norm(approach) < ONE_DIRECTION:
            continue
        reach = np.inf if effect.moves or effect.gap_timed or getattr(effect.surface, "driven", False) else moved
        near = (farther <= reach if contact is None else contact.pressure[on_part] > 0) & (coefficient > 0)
        tilt = np.arccos(np.clip(normal @ approach / np.linalg.norm(approach), -1.0, 1.0))
        share = np.where(near & ~first, SHEAR_OF_TILT * tilt / np.where(near, coefficient, 1.0), 0.0)
        much = share > NOTABLE_SHEAR
        largest = parallel.largest(body.comm, share)
        if largest > NOTABLE_SHEAR:
            away = -parallel.largest(body.comm, -np.linalg.norm(x[much] - touch, axis=1), -np.inf)
            most = f", and up to about {largest:.0%}," if largest < 1.0 else ""
            where = ("if", "reaches", "touch") if contact is None else ("as", "reached", "touched")
            message = (
                f"tilted frames alone make shear of more than {NOTABLE_SHEAR:.0%}{most} of the friction that is "
                f"possible, {where[0]} contact {where[1]} farther than {away:.2g} from where bodies first {where[2]}: "
                "the way on which they approach has a part along the surface there; if this matters give the gap along "
                "one direction as a formula"
            )
            findings.append(Finding("note", f"contact[{index}].friction", message))
    return findings


def _curved(body: Model) -> Iterator[tuple[int, float]]:
    """The contacts of things with friction whose gap varies, and the extent of each, length; collective."""
    boundary, data = body.boundary, body.data
    if boundary is None or data is None:
        return
    for index, effect in enumerate(body.statement.contact):
        thing = effect.surface is not None or (effect.against is not None and effect.distance == "geometry")
        if effect.bonded or not thing or not effect.friction.acts:
            continue
        on_part = boundary.part == index
        highest, lowest = (parallel.largest(body.comm, sign * data.gap[on_part], -np.inf) for sign in (1.0, -1.0))
        low, high = parallel.global_bounds(body.comm, boundary.x[on_part])
        extent = float(np.linalg.norm(high - low))
        if highest + lowest > CLOSED_GAP * extent:
            yield index, extent
