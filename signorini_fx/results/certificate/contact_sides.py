"""The parts of the boundary with contact as a scene describes them, for its certificate."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.expressions import in_space, sample
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.results.certificate.contact_nodes import ContactSide

if TYPE_CHECKING:
    from signorini_fx.mechanics.obstacles.paired_points import PairedSides
    from signorini_fx.results.certificate.pair_points import FrozenPoints

Nodal = npt.NDArray[np.float64]


def sides_of(
    statement: Statement, tagged: TaggedMesh, space: fem.FunctionSpace, pairs: Mapping[int, PairedSides] | None = None
) -> list[ContactSide]:
    """The parts of the boundary with contact as a scene describes them.

    Args:
        statement: what is stated of the problem.
        tagged: its mesh.
        space: the displacements.
        pairs: bodies in contact as the solver has paired them, by their places in ``statement.contact``; None: they are
            paired anew.
    """
    x = node_positions(space)[:, : space.mesh.geometry.dim]
    factor = statement.kinematics.measure_at(x)
    points: dict[int, FrozenPoints] = {}
    if any(effect.against is not None for effect in statement.contact):
        from signorini_fx.mechanics.body.discretisation import pairs_of
        from signorini_fx.results.certificate.pair_points import FrozenPoints

        paired = pairs_of(statement, tagged, space) if pairs is None else pairs
        for part, pair in paired.items():
            effect = statement.contact[part]
            slave, master = map(tagged.facets, (effect.boundary, str(effect.against)))
            points[part] = FrozenPoints.of(pair, space, (slave, master))

    def side(part: int, effect: Any) -> ContactSide:
        gap = effect.gap_in(tagged.dimension)

        def along(nodes: npt.NDArray[Any]) -> Nodal:
            directions = np.zeros((nodes.size, x.shape[1]))  # the rest is around the axis
            directions[:, : tagged.dimension] = (
                np.asarray(effect.direction) / np.linalg.norm(effect.direction)
                if effect.surface is None
                else gap.direction(in_space(x[nodes])).T
            )
            return directions

        return ContactSide(
            effect.boundary,
            lambda nodes: sample(gap, in_space(x[nodes])),
            friction_bound(effect, x),
            not effect.opens,
            None if effect.direction is None and effect.surface is None else along,
            factor,
            pair=points.get(part),
            by_geometry=_by_geometry(effect),
            adjust=effect.adjust,
            directions=(lambda nodes: effect.friction.directions(in_space(x[nodes])))
            if effect.friction.directed
            else None,
        )

    return [side(part, effect) for part, effect in enumerate(statement.contact)]


def friction_bound(effect: Any, x: Nodal) -> Callable[[npt.NDArray[Any], Nodal], Nodal]:
    """The bound of a contact of a scene, see ``ContactSide``; ``x``: of all nodes, length, shape (nodes, d)."""

    def bound(nodes: npt.NDArray[Any], pressure: Nodal) -> Nodal:
        if effect.bonded:
            return np.full(nodes.size, np.inf)
        return np.asarray(effect.friction.sampled(in_space(x[nodes])).limit(np.abs(pressure)))

    return bound


def _by_geometry(effect: Any) -> bool:
    """Whether the gap of a contact is the distance of both sides."""
    return not effect.bonded and effect.distance == "geometry"
