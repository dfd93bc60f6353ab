"""Findings about curved things that are pressed together with friction: in one step, and what their frames neglect."""

from __future__ import annotations

import numpy as np

from signorini_fx import parallel
from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.records import Finding
from signorini_fx.scene.model import Scene

# Gaps of one contact that differ by less than this share of its extent are the same.
_ALIKE = 1e-6
# Of F P what frames half-way make of pressing alone, over the mean angle between both normals over F: .3 a/(F R) on a
# circle (docs/theory.md).  Said where it is more than a share.
_LEFT, _SAID = 0.7, 0.05


def one_step(body: Discretisation) -> list[Finding]:
    """That the way before the touch counts as slip where bodies close a gap that varies; collective."""
    scene, boundary, data = body.scene, body.boundary, body.data
    if scene.steps > 1 or scene.load_steps.steps is not None or boundary is None or data is None:
        return []
    found = []
    for index, effect in enumerate(scene.contact):
        thing = effect.surface is not None or (effect.against is not None and effect.distance == "geometry")
        if effect.kind == "bonded" or not thing or not effect.friction.acts:
            continue
        here = boundary.part == index
        highest, lowest = (parallel.largest(body.comm, sign * data.gap[here], -np.inf) for sign in (1.0, -1.0))
        low, high = parallel.global_bounds(body.comm, boundary.x[here])
        if highest + lowest > _ALIKE * float(np.linalg.norm(high - low)):
            message = (
                "one step counts the way of a point before it touches as slip, so that less sticks than if the load "
                "grew: with F = nu = .3 a circle sticks within .28 of the half width of contact, a sphere within .56, "
                "in 40 load steps within .67 and .9"
            )
            found.append(Finding("note", f"contact[{index}].friction", message))
    return found


def neglected(scene: Scene, contact: ContactState) -> list[Finding]:
    """How much friction comes of the frames on round foundations in a result, where it is much; collective.

    Args:
        scene: with its foundations where they are in the result.
        contact: the state at its contact points.
    """
    found, boundary = [], contact.boundary
    for index, effect in enumerate(scene.contact):
        if effect.kind == "bonded" or not getattr(effect.surface, "curved", False) or scene.torsion:
            continue
        here = (boundary.part == index) & (contact.pressure > 0)
        _, normal = effect.surface.distance(boundary.x[here])
        angle = 2.0 * np.linalg.norm(boundary.normal[here] + normal, axis=1)
        weight = boundary.weight[here]
        terms = np.array([weight @ (contact.pressure[here] * angle), weight @ contact.bound[here]])
        tilted, bound = parallel.global_sum(boundary.comm, terms)
        if bound > 0 and _LEFT * tilted > _SAID * bound:
            message = (
                f"pressing alone takes up to about {_LEFT * tilted / bound:.0%} of the friction that is possible on a "
                "round foundation, as frames are half-way between both normals: where that matters give the gap as a "
                "formula"
            )
            found.append(Finding("note", f"contact[{index}].foundation", message))
    return found
