"""A boundary that touches itself: a pair of two of its parts, chosen at the beginning of each step,
see ``pairs.colours``.

All nodes of the boundary are contact points.  Those outside the part with points have no partner,
so that the points, and the data set up for them, are the same in all steps.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from signorini_fx.arrays import Array, Ints, extents
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import from_owners
from signorini_fx.mechanics.assembly.nodal_stiffness import JointStiffness
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.obstacles.paired_points import FacingSides, MovingPair
from signorini_fx.mechanics.pairs.colours import chosen_sides, walls
from signorini_fx.mechanics.pairs.search import default_reach
from signorini_fx.mechanics.pairs.sliding import SlidingCoupling, slide
from signorini_fx.mechanics.state import Field, State


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
