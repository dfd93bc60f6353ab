"""A boundary that touches itself: a pair of two of its parts, chosen at the beginning of each step.

All nodes of the boundary are contact points.  Those outside the part with points have no partner,
so that the points, and the data set up for them, are the same in all steps.

The surface is divided into facets that carry points and facets opposite.  The partner g of a facet
f is the nearest facet that it faces, see ``search``, except those around itself.  Neighbours are on
one side, partners on opposite sides:

    s_f = s_n for neighbours n,   s_f = - s_g.

Facets that stay opposite to their partner keep the side of the previous step, and the sides spread
from them.  In a connected patch without such facets the part with the smaller facets carries
points.  Facets without a partner take the side of those next to them, within reach, so that parts
may slide there during the step.  Facets within two rings of the other side are on neither side, so
that the sides have no common node.  Odd cycles, as where three sheets meet, cannot be divided:
facets are left out where both sides meet.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from signorini_fx.arrays import Array, Flags, Ints, extents, inner
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import from_owners
from signorini_fx.mechanics.assembly.nodal_stiffness import JointStiffness
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.obstacles.paired_points import FacingSides, MovingPair
from signorini_fx.mechanics.pairs.pair_side import PairSurface
from signorini_fx.mechanics.pairs.search import Parts, candidates, default_reach
from signorini_fx.mechanics.pairs.sliding import SlidingCoupling, slide
from signorini_fx.mechanics.state import Field, State
from signorini_fx.tuned import COARSER_FACETS, DIGITS_OF_FILES, NOTABLE


class FoldedSide(MovingPair):
    """A side that may touch itself, and its present position.

    Attributes:
        whole: the undeformed surface, with the walls behind its facets.
        side: 1 where facets carry points, -1 where they are opposite, else 0, shape (f,).
        name: name of the field of a state that stores the side at nodes.
        changed: how many facets were on the other side in the previous step.
    """

    side: Ints
    changed = 0

    def __init__(self, sides: FacingSides, reach: float | None) -> None:
        """Put one undeformed surface on both sides.

        ``reach``: see ``Pair``.
        """
        surface = sides.slave.surface
        within = default_reach(surface.x, surface.x) if reach is None else reach
        self.whole = replace(surface, wall=walls(surface, within))
        # What is farther does not touch in this step, and rows of far partners are less exact.
        reach = float(extents(surface.corners).mean()) if reach is None else reach
        self.name = f"sides of contact[{sides.index}]"
        self.side = np.zeros(len(surface.nodes), dtype=np.int64)
        self._parts = (self.whole.chosen(np.flatnonzero(self.side)),) * 2
        super().__init__(sides, reach)

    def settle(self, state: State) -> None:
        """Choose both sides at the beginning of a step, from those of the previous one;
        collective.
        """
        space = self.sides.space
        owned = space.dofmap.index_map.size_local
        displacement = state.displacement.reshape(-1, self.whole.dimension)[:owned]
        before = np.zeros((owned, 1))
        if self.name in state.fields:
            before = state.fields[self.name].values[:owned]
        rows = from_owners(
            np.column_stack((displacement, before)), self.sides.slave.nodes, space.mesh.comm
        )
        of_nodes = rows[self.whole.nodes, -1]
        known = np.where((of_nodes == of_nodes[:, :1]).all(axis=1), of_nodes[:, 0], 0.0)
        surface = self.whole.displaced(rows[:, :-1])
        side = chosen_sides(surface, self.reach, known.astype(np.int64))
        self.changed = np.count_nonzero(side * known < 0)
        if not np.array_equal(side, self.side):
            self.side = side
            first, second = (self.whole.chosen(np.flatnonzero(side == sign)) for sign in (1, -1))
            self._parts = first, second
            slave = replace(self.sides.slave, surface=first)
            master = replace(self.sides.master, surface=second)
            self.sides = replace(self.sides, slave=slave, master=master)
            self.displacement = self.settled = np.tile(rows[:, :-1], (2, 1))
            self.coupling = self.begun = self._at(self.displacement)
        super().settle(state)

    def remembered(self) -> dict[str, Field]:
        """Return the side of the nodes of this rank as a field: 1 with points, -1 opposite, 0
        neither.
        """
        index_map = self.sides.space.dofmap.index_map
        count = index_map.size_local + index_map.num_ghosts
        names = index_map.local_to_global(np.arange(count, dtype=np.int32))
        of_nodes = np.zeros((count, 1))
        for sign, part in zip((1.0, -1.0), self._parts, strict=True):
            on_part = self.sides.slave.nodes[np.unique(part.nodes)]
            of_nodes[np.isin(names, on_part)] = sign
        return {self.name: Field("nodes", of_nodes)}

    def in_words(self, state: ContactState) -> str:
        """Return a text that states where the side touches itself; collective."""
        own = state.boundary.part == self.sides.index
        forces = (state.boundary.weight * state.pressure)[own]
        count, force = parallel.global_sum(
            state.boundary.comm, np.array([np.count_nonzero(state.in_contact[own]), forces.sum()])
        )
        on_sides = self.side != 0
        facing = np.count_nonzero(on_sides)
        beside = np.count_nonzero(self.whole.around_neighbours @ on_sides * ~on_sides)
        text = (
            f"touches itself at {count:.0f} of {len(self.points)} nodes, with a force of "
            f"{force:.4g}; {facing} of {len(self.side)} facets face each other"
        )
        if self.changed:
            text += f", {self.changed} with points on the other side than in the step before"
        if beside:
            text += f"; {beside} beside them, as in folds, have no partner"
        return text

    def _at(self, displacement: Array) -> SlidingCoupling:
        on_nodes = displacement[: len(self.whole.x)]
        slave, master = (part.displaced(on_nodes) for part in self._parts)
        whole = self.whole.displaced(on_nodes)
        return slide(slave, master, self.points, self.reach, whole, self.sharing)

    def stiffness(self, state: ContactState, *, symmetric: bool = True) -> JointStiffness:
        joint = super().stiffness(state, symmetric=symmetric)
        return JointStiffness.of_nodes(joint.nodes, joint.matrix, self.whole.dimension)


def facing(surface: PairSurface, reach: float) -> tuple[Ints, Ints, Array]:
    """Return the pairs of facets of a surface that face each other within ``reach``, length, and
    are more than two facets apart.

    Returns both numbers and how far the second facet is in front of the first one along its normal,
    negative behind it, length; shape (m,) each.
    """
    count = len(surface.nodes)
    parts = Parts.of(surface, np.arange(count))
    first, second = candidates(parts, parts, reach, np.zeros(len(parts.facet)))
    way = parts.centre[second] - parts.centre[first]
    ahead = inner(way, parts.normal[first])
    first = parts.facet[first]
    second = parts.facet[second]
    around = surface.around_neighbours.tocoo()
    apart = ~np.isin(first * count + second, around.row * count + around.col)
    return first[apart], second[apart], ahead[apart]


def walls(surface: PairSurface, reach: float) -> Array:
    """Return the distance from each facet of an undeformed surface back through its body, length,
    shape (f,); inf: nothing within ``reach``.

    It is measured along the normal to the plane of the nearest facet behind.  Parts that touch,
    with their usual overlap, do not count.
    """
    first, second, _ = facing(surface, reach)
    parts = Parts.of(surface, np.arange(len(surface.nodes)))
    way = parts.centre[second] - parts.centre[first]
    normal = parts.normal[first]
    opposite = parts.normal[second]
    away = inner(way, opposite) / inner(normal, opposite)
    met = away < -2.0 * NOTABLE * parts.radius[first]
    behind = np.full(len(surface.nodes), np.inf)
    np.minimum.at(behind, first[met], -away[met])
    return behind


def chosen_sides(surface: PairSurface, reach: float, before: Ints) -> Ints:
    """Return the side of each facet, shape (f,): 1 carries points, -1 is opposite, 0 is on neither.

    Args:
        surface: the deformed surface, with its walls.
        reach: distance beyond which facets are not paired, length.
        before: the sides in the previous step, shape (f,).
    """
    count = len(surface.nodes)
    first, second, ahead = facing(surface, reach)
    by_distance = np.lexsort((np.abs(ahead), first))
    found, nearest = np.unique(first[by_distance], return_index=True)
    partner = second[by_distance][nearest]
    has = np.isin(np.arange(count), found)
    beside = surface.neighbours.tocoo()
    same = has[beside.row] & has[beside.col] & (beside.row < beside.col)
    opposite = has[partner]
    rows = np.concatenate((beside.row[same], found[opposite]))
    columns = np.concatenate((beside.col[same], partner[opposite]))
    signs = np.repeat([1.0, -1.0], [np.count_nonzero(same), np.count_nonzero(opposite)])
    joined = sp.csr_array((signs, (rows, columns)), shape=(count, count))
    side = np.zeros(count, dtype=np.int64)
    stays = before[partner] != before[found]
    side[found[stays]] = before[found[stays]]
    _, patch = connected_components(abs(joined), directed=False)
    fresh = ~np.isin(patch, patch[side != 0])
    # The first facet of a patch in the order of places, which is the same on all ranks.
    start = (surface.undeformed or surface).corners.mean(axis=1)
    order = np.lexsort(np.round(start / (DIGITS_OF_FILES * np.ptp(start))).T)
    order = order[(has & fresh)[order]]
    side[order[np.unique(patch[order], return_index=True)[1]]] = 1
    _spread(side, joined + joined.T, has)
    side[fresh & _coarser(surface, side, patch)] *= -1
    _spread(side, surface.neighbours, _near(surface, has, reach))
    near = [surface.around_neighbours @ (side == sign) > 0.0 for sign in (1, -1)]
    return np.where(near[0] & near[1], 0, side)


def _spread(side: Ints, joined: sp.csr_array, within: Flags) -> None:
    """Assign sides to facets that have none from those they are joined to, until nothing changes.

    ``joined``: positive entries join facets of the same side, negative ones facets of opposite
    sides; ``within``: which facets may be assigned a side, shape (f,).
    """
    new = within
    while new.any():
        votes = joined @ side
        new = within & (side == 0) & (votes != 0.0)
        side[new] = np.sign(votes[new])


def _near(surface: PairSurface, facets: Flags, reach: float) -> Flags:
    """Return the flags of facets, shape (f,), so near to one of ``facets`` that it may slide there
    in this step, except in folds.
    """
    middles = surface.corners.mean(axis=1)
    if not facets.any():
        return facets
    near = cKDTree(middles[facets]).query(middles)[0] <= reach
    return near & (2.0 * reach * surface.focus < 1.0)


def _coarser(surface: PairSurface, side: Ints, patch: Ints) -> Flags:
    """Return the flags of facets, shape (f,), in patches whose facets with points are larger than
    those opposite.
    """
    extent = extents(surface.corners)
    count = len(side)
    sums = [np.bincount(patch, extent * (side == sign), count) for sign in (1, -1)]
    sizes = [np.bincount(patch, side == sign, count) for sign in (1, -1)]
    coarser = sums[0] * sizes[1] > COARSER_FACETS * sums[1] * sizes[0]
    return coarser[patch]
