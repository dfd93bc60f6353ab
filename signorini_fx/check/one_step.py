"""A finding about curved things that are pressed together in one step with friction."""

from __future__ import annotations

import numpy as np

from signorini_fx import parallel
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.records import Finding

# Gaps of one contact that differ by less than this share of its extent are the same.
_ALIKE = 1e-6


def one_step(body: Discretisation) -> list[Finding]:
    """That the way before the touch counts as slip where bodies close a gap that varies; collective."""
    scene, boundary, data = body.scene, body.boundary, body.data
    if scene.steps > 1 or scene.load_steps.steps is not None or boundary is None or data is None:
        return []
    findings = []
    for index, effect in enumerate(scene.contact):
        thing = effect.surface is not None or (effect.against is not None and effect.distance == "geometry")
        if effect.kind == "bonded" or not thing or not effect.friction.acts:
            continue
        on_part = boundary.part == index
        highest, lowest = (parallel.largest(body.comm, sign * data.gap[on_part], -np.inf) for sign in (1.0, -1.0))
        low, high = parallel.global_bounds(body.comm, boundary.x[on_part])
        if highest + lowest > _ALIKE * float(np.linalg.norm(high - low)):
            message = (
                "one step counts the way of a point before it touches as slip, so that less sticks than if the load "
                "grew: a sphere sticks within .37 of the radius of contact, in many load steps within .75"
            )
            findings.append(Finding("note", f"contact[{index}].friction", message))
    return findings
