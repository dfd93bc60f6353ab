"""The verdict on a scene of several bodies."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import coo_array, csr_array

from benchmarks.stability.oracle.bodies.mortar import points_between
from benchmarks.stability.oracle.bodies.plane import PlaneBody
from benchmarks.stability.oracle.body import Mesh, listed
from benchmarks.stability.oracle.judge import Answer, Verdict
from benchmarks.stability.oracle.space.body import Body
from benchmarks.stability.oracle.space.conditions import Contact, Points, contact_of, points_of
from benchmarks.stability.oracle.space.judge import judged_by


def judge(scene: dict[str, Any], mesh: Mesh, answer: Answer) -> Verdict:
    """Judge an answer."""
    body = body_of(scene, mesh)
    return judged_by(body, contacts_of(body), answer)


def body_of(scene: dict[str, Any], mesh: Mesh) -> Any:
    """All bodies of a scene."""
    return PlaneBody(scene, mesh) if mesh.points.shape[1] == 2 else Body(scene, mesh)


def contacts_of(body: Any) -> Contact:
    """The points of all contacts, between bodies and on foundations."""
    return contact_of(body, _points)


def _points(body: Any, part: int) -> Points:
    effect = listed(body.scene, "contact")[part]
    if "against" in effect:
        return points_between(body, part)
    if not isinstance(body, PlaneBody):
        return points_of(body, part)
    side = body.sides[part]
    count = 2 * len(side.nodes)
    columns = (2 * side.nodes[:, None] + np.arange(2)).ravel()
    own = coo_array((np.ones(count), (np.arange(count), columns)), shape=(count, 2 * len(body.x)))
    x = body.x[side.nodes]
    return Points(x, csr_array(own), side.weight, side.normal, np.zeros(len(x)))
