"""The parts of the boundary with contact, evaluated anew for the certificate."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.obstacles.foundations_on_points import ShapeDistances, rigid_points, without_small
from signorini_fx.mechanics.statement.expressions import in_space, sample
from signorini_fx.results.certificate.body_nodes import BodyNodes
from signorini_fx.results.certificate.contact_nodes import ContactSide

if TYPE_CHECKING:
    from signorini_fx.mechanics.obstacles.paired_points import PairedSides
    from signorini_fx.results.certificate.nodal_forces import NodalForces
    from signorini_fx.results.certificate.pair_points import PairPoints

Nodal = npt.NDArray[np.float64]
Bound = Callable[[npt.NDArray[Any], Nodal], Nodal]


def rigid_side(
    body: BodyNodes,
    unit_form: Any,
    facets: npt.NDArray[np.int32],
    shape: ShapeDistances,
    gap: Nodal,
    bound: Bound,
    *,
    bilateral: bool,
    axes: tuple[Nodal, Nodal] | None = None,
) -> ContactSide:
    """The points of a rigid foundation; ``unit_form``: see ``foundations_on_points.unit_form``, which is assembled
    here; ``gap`` and ``axes``: at all nodes of this rank; for the rest see ``ContactSide``; collective.
    """
    free = np.zeros(body.owned * body.dimension, dtype=bool)
    part = rigid_points(body.space, unit_form, facets, 0, shape, free)
    at = part.nodes
    return ContactSide(at, part.weight, part.normal, gap[at], bound, bilateral, part.averages, None, _at(axes, at))


def paired_side(
    pair: PairPoints,
    gap: Nodal,
    bound: Bound,
    *,
    bilateral: bool,
    by_geometry: bool,
    adjust: float | None,
    axes: tuple[Nodal, Nodal] | None = None,
) -> ContactSide:
    """The points of two bodies; ``by_geometry``: whether their distance is added to the gap, see ``rigid_side``."""
    at = pair.points
    own = gap[at] + pair.gap(adjust) if by_geometry else gap[at]

    def facing(nodes: npt.NDArray[Any], pressure: Nodal) -> Nodal:
        return np.where(pair.facing, bound(nodes, pressure), 0.0)

    return ContactSide(at, pair.weight, pair.normal, own, facing, bilateral, None, pair, _at(axes, at))


def _at(axes: tuple[Nodal, Nodal] | None, nodes: npt.NDArray[Any]) -> tuple[Nodal, Nodal] | None:
    return None if axes is None else (axes[0][nodes], axes[1][nodes])


def sides_of(forces: NodalForces, pairs: Mapping[int, PairedSides] | None = None) -> list[ContactSide]:
    """The parts of the boundary with contact as a scene describes them; ``pairs``: bodies in contact as the solver has
    paired them, by their places in ``statement.contact``; None: they are paired anew; collective.
    """
    statement, tagged, space = forces.statement, forces.tagged, forces.space
    if pairs is None and any(effect.against is not None for effect in statement.contact):
        from signorini_fx.mechanics.body.discretisation import pairs_of

        pairs = pairs_of(statement, tagged, space)
    sides = []
    for part, effect in enumerate(statement.contact):
        gap = forces.on_boundary(effect.boundary, partial(sample, effect.gap_in(tagged.dimension)))
        bound, said = friction_bound(effect, forces), dict[str, Any](bilateral=not effect.opens)
        if effect.friction.directed:
            axes = forces.on_boundary(effect.boundary, partial(_directions, effect.friction))
            said["axes"] = axes[:, :-1], axes[:, -1]
        if effect.against is None:
            form, facets = forces.unit_form(effect.boundary), tagged.facets(effect.boundary)
            sides.append(rigid_side(forces, form, facets, _shape(effect, forces), gap, bound, **said))
            continue
        from signorini_fx.results.certificate.pair_points import FrozenPoints

        assert pairs is not None
        named = tagged.facets(effect.boundary), tagged.facets(effect.against)
        points = FrozenPoints.of(pairs[part], space, named)
        by_geometry = not effect.bonded and effect.distance == "geometry"
        sides.append(paired_side(points, gap, bound, by_geometry=by_geometry, adjust=effect.adjust, **said))
    return sides


def friction_bound(effect: Any, forces: NodalForces) -> Bound:
    """The bound of a contact of a scene, see ``ContactSide``."""

    def bound(nodes: npt.NDArray[Any], pressure: Nodal) -> Nodal:
        if effect.bonded:
            return np.full(nodes.size, np.inf)
        return np.asarray(effect.friction.sampled(in_space(forces.at_nodes[nodes])).limit(np.abs(pressure)))

    return bound


def _directions(law: Any, x: Nodal) -> Nodal:
    """Along which friction is that of the bound, and the ratio of that across them."""
    return np.column_stack(law.directions(x))


def _shape(effect: Any, forces: NodalForces) -> ShapeDistances:
    """Direction and measure of a rigid foundation of a scene."""
    dimension, components = forces.tagged.dimension, forces.dimension

    def along(x: Nodal) -> Nodal:
        directions = np.zeros((x.shape[1], components))  # the rest is around the axis
        given = effect.direction
        directions[:, :dimension] = (
            effect.gap_in(dimension).direction(x).T if given is None else np.asarray(given) / np.linalg.norm(given)
        )
        return directions

    factor = direction = None
    if not forces.kinematics.uniform:
        kinematics: Any = forces.kinematics
        measure = forces.on_boundary(effect.boundary, lambda x: kinematics.measure_at(x[:components].T))
        factor = without_small(measure, forces.comm)
    if effect.direction is not None or effect.surface is not None:
        direction = forces.on_boundary(effect.boundary, along)
    return ShapeDistances(factor, direction)
