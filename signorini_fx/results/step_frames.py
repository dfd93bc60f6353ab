"""The end of a step in the frames of the next one, whose foundations may have turned and moved."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from signorini_fx import parallel
from signorini_fx.algorithms.task import Start
from signorini_fx.body.contact_boundary import ContactBoundary
from signorini_fx.contact.laws import Nodal as Array
from signorini_fx.contact.resting_place import Rest
from signorini_fx.errors import FormError
from signorini_fx.results.promised_law import Before


def carried(
    start: Start, rest: Rest | None, normal: Array, before: ContactBoundary, after: ContactBoundary
) -> tuple[Start, Rest | None, Array]:
    """The start of a step, the place from which its slips are counted, and the normal displacement at that start, in
    the frames that the same points have now; collective.

    A shear that is not along a foundation that has turned loses its part across it.

    Raises:
        FormError: the points are others, or their normals where contact alone holds the body.
    """
    comm = before.comm
    if parallel.any_rank(comm, not np.array_equal(before.nodes, after.nodes)):
        raise FormError([("contact", "its points cannot change between the steps of a loop")])
    turns = parallel.any_rank(comm, not np.allclose(before.normal, after.normal))
    if turns and rest is not None:
        wrong = "its directions cannot change between the steps of a loop where contact alone holds the body"
        raise FormError([("contact", wrong)])
    rotation = np.einsum("nij,nik->njk", after.cotangents, before.tangents)

    def turned(shear: Array) -> Any:
        return np.einsum("njk,nk->nj", rotation, shear)

    def moved(slip: Array | None) -> Any:
        return None if slip is None else np.einsum("nij,nik,nk->nj", after.tangents, before.cotangents, slip)

    data, multipliers, origin = start.data, start.multipliers, moved(start.data.slip_origin)
    if turns and origin is not None:
        relative = np.column_stack((normal, np.asarray(start.data.slip_origin)))
        coframes = np.concatenate((before.normal[:, :, None], before.cotangents), axis=2)
        relative = np.einsum("nki,nkj,nj->ni", after.frames, coframes, relative)
        normal, origin = relative[:, 0], relative[:, 1:]
    begun = replace(
        start,
        data=replace(data, mu_hat=turned(data.mu_hat), slip_origin=origin),
        multipliers=None if multipliers is None else (multipliers[0], turned(multipliers[1])),
        elastic_slip=moved(start.elastic_slip),
    )
    return begun, None if rest is None else replace(rest, u_t=moved(rest.u_t)), normal


def relative_to(before: Before, boundary: ContactBoundary, moved: Array) -> Before:
    """The end of the last step as one begins from it whose foundations have moved, its shears along them.

    Args:
        before: as it was.
        boundary: the points as they are now.
        moved: by which the foundations have moved at them, shape (n, d).
    """

    def along(vectors: Array) -> Array:
        return vectors - np.einsum("ni,ni->n", vectors, boundary.normal)[:, None] * boundary.normal

    tractions, elastic = before.tractions, before.elastic_slip
    tractions = replace(tractions, shear=along(tractions.shear))
    return replace(before, tractions=tractions, elastic_slip=None if elastic is None else along(elastic), moved=moved)
