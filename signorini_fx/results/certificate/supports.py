"""What the supports prescribe at a place in the lists of factors, evaluated anew for the certificate."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.loads.supports import Supports

if TYPE_CHECKING:
    from signorini_fx.mechanics.contact_points.turned_supports import TurnedNodes
    from signorini_fx.results.certificate.nodal_forces import NodalForces

Nodal = npt.NDArray[np.float64]


@dataclass(frozen=True)
class PrescribedNodes:
    """The prescribed displacements of the owned nodes; ``fixed``: at turned nodes in their frames; ``value``: in the
    axes of space; ``by``: position in ``scene.displacement`` of what prescribes each component along the axes, -1 where
    nothing does.
    """

    fixed: npt.NDArray[np.bool_]
    value: Nodal
    by: npt.NDArray[np.int64]
    turned: TurnedNodes | None = None

    @classmethod
    def of(cls, forces: NodalForces, step: float) -> PrescribedNodes:
        """Those of a load step; collective."""
        statement, tagged, space = forces.statement, forces.tagged, forces.space
        now = [statement.now(entry.in_step(step), step) for entry in statement.displacement]
        factors = {id(effect): factor for factor, effect in now}
        position = {id(effect): number for number, (_, effect) in enumerate(now)}
        facets = {str(effect.boundary): tagged.facets(effect.boundary) for _, effect in now if effect.at is None}
        entries = tuple(effect for _, effect in now)
        supports = Supports.of(statement.changed(displacement=entries), space, facets, tagged)
        value = np.zeros((len(forces.at_nodes), forces.dimension))
        by = np.full(value.shape, -1)
        for effect, condition in supports.conditions:  # the last one is what holds nodes on an axis of revolution
            condition.set(value.reshape(-1), alpha=factors.get(id(effect), 1.0))
            by.reshape(-1)[condition.dof_indices()[0]] = position.get(id(effect), len(now))
        turned = supports.turned
        if turned is not None:
            scaled = [replace(skew, values=factors[id(skew.effect)] * skew.values) for skew in turned.supports]
            turned = replace(turned, supports=scaled)
            turned.place(value, entries)
        owned = forces.owned
        return cls(supports.fixed.reshape(value[:owned].shape), value[:owned], by[:owned], turned)

    def missed(self, y: Nodal) -> Nodal:
        """How far displacements of the owned nodes are from what is prescribed, length, as a list."""
        away = y - self.value
        if self.turned is not None:
            away = np.einsum("nij,ni->nj", self._frames, away)
        return np.abs(away[self.fixed])

    def among(self, of_node: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """Numbers that the owned nodes have, in the order of ``missed``."""
        return np.asarray(np.broadcast_to(of_node[:, None], self.fixed.shape)[self.fixed])

    def left(self, vectors: Nodal) -> Nodal:
        """Vectors at the owned nodes without the directions that are prescribed, shape (owned nodes, d)."""
        if self.turned is None:
            return np.where(self.fixed, 0.0, vectors)
        free = np.where(self.fixed, 0.0, np.einsum("nij,ni->nj", self._frames, vectors))
        return np.einsum("nij,nj->ni", self._frames, free)

    def taken(self, forces: Nodal, position: int) -> Nodal:
        """The part of nodal forces that one entry of ``scene.displacement`` takes, shape (owned nodes, d).

        A support takes forces along what it prescribes: those that do the work of all on a displacement that it alone
        prescribes.
        """
        taken = np.where(self.by == position, forces, 0.0)
        if self.turned is None:
            return taken
        here = self.turned.nodes < len(forces)
        nodes, dim = self.turned.nodes[here], forces.shape[1]
        along = np.einsum("nij,ni->nj", self.turned.from_given[here], forces[nodes])
        taken[nodes] = np.where(self.by[nodes] == position, along[:, :dim], 0.0)
        for number, support in enumerate(self.turned.supports):
            if support.position == position:
                taken[nodes] += along[:, dim + number, None] * support.normal
        return taken

    @property
    def _frames(self) -> Nodal:
        """The frames of the owned nodes that ``fixed`` is told in, shape (owned nodes, d, d)."""
        assert self.turned is not None
        return self.turned.frames_at(np.arange(len(self.fixed)))
