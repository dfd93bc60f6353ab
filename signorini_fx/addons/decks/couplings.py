"""*COUPLING of an Abaqus input file: a surface that moves as its reference node, or that shares the force there.

No dolfinx here.
"""

from __future__ import annotations

import numpy as np

from signorini_fx.addons.decks.content import Deck, DeckLoad
from signorini_fx.addons.decks.keywords import CONSTRAINT, PARTLY
from signorini_fx.mechanics.mesh.files.abaqus_blocks import DeckBlock, DeckError
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints, nodal_measures


def read_coupling(deck: Deck, coupling: DeckBlock | None, block: DeckBlock) -> None:
    """*KINEMATIC or *DISTRIBUTING after its *COUPLING.

    Raises:
        DeckError: there is no *COUPLING in front of it, or it lacks surface or node, or its components are none.
    """
    if coupling is None:
        deck.lose(block, CONSTRAINT)
        return
    for key in ("REFNODE", "SURFACE"):
        if key not in coupling.parameters:
            raise DeckError(coupling, f"{key} is missing")
    node, name = deck.single(coupling.parameters["REFNODE"]), coupling.parameters["SURFACE"]
    where = deck.boundary(name)
    if node is None or where is None or "ORIENTATION" in coupling.parameters:
        reason = "it has an orientation" if node is not None and where is not None else f"{name!r} or its node"
        deck.lose(coupling, f"{CONSTRAINT}: {reason}")
        return
    try:
        rows = [[int(word) for word in row] for row in block.rows]
        held = {component for first, *last in rows for component in range(first, (last or [first])[0] + 1)}
    except ValueError as error:
        raise DeckError(block, str(error)) from None
    if block.keyword == "DISTRIBUTING":
        deck.distributed[node] = where
        if "CYCLICSYMMETRY" in block.parameters:
            deck.cyclic.add(node)
    elif rows and not {*range(1, deck.mesh.dim + 1)} <= held:
        deck.lose(block, PARTLY)
    else:
        deck.coupled.append((name, node))


def spread(deck: Deck, block: DeckBlock, node: int, force: Floats, moment: Floats) -> list[DeckLoad]:
    """The forces at the nodes of a surface that have a force and a moment at a reference node as their resultants.

    Each node has a share of the area.  Of a moment they are those of a rotation, times these shares.

    Args:
        deck: what has been read.
        block: that gives both.
        node: the number of the reference node.
        force: shape (3,).
        moment: shape (3,).
    """
    facets = deck.mesh.facets[deck.mesh.boundaries[deck.distributed[node]]]
    shares = nodal_measures(deck.mesh.points, facets, deck.mesh.facet)
    weights = np.bincount(facets.ravel(), np.abs(shares).ravel(), minlength=len(deck.mesh.points))
    nodes: Ints = np.flatnonzero(weights)
    weight = weights[nodes] / weights.sum()
    x, reference = np.zeros((len(nodes), 3)), np.zeros(3)
    x[:, : deck.mesh.dim] = deck.mesh.points[nodes]
    position = deck.model.raw.points[deck.model.places[node]]
    reference[: len(position)] = position
    middle = weight @ x
    if node in deck.cyclic:  # those of all sectors have no moment across the axis, and no force across it
        forces = weight[:, None] * force
        turning = np.cross(moment, x - reference)
        scale = float(weight @ np.sum(np.cross(x - reference, turning) * moment, axis=1))
        forces = forces + (weight[:, None] * turning * (moment @ moment) / scale if scale else 0.0)
    else:
        arm = x - middle
        about = moment + np.cross(reference - middle, force)
        inertia = np.einsum("n,nij->ij", weight, np.sum(arm**2, axis=1)[:, None, None] * np.eye(3)) - np.einsum(
            "n,ni,nj->ij", weight, arm, arm
        )
        turn = np.linalg.pinv(inertia, hermitian=True) @ about
        forces = weight[:, None] * (force + np.cross(turn, arm))
    return [
        DeckLoad("point_force", str(number), (axis,), block, direction=tuple(np.eye(3)[k]), values={deck.step: value})
        for number, vector in zip(nodes, forces, strict=True)
        for k, (axis, value) in enumerate(zip("xyz", map(float, vector), strict=True))
        if value and k < deck.mesh.dim
    ]
