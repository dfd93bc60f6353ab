"""Supports along no axis: nodes turned into a frame in which what is prescribed there is a
component.

A boundary that is flat, but across no axis, prescribes n . y = g at its nodes, and other supports
may prescribe more there.  With an orthonormal frame Q_i at each such node, y_i = Q_i x_i, the first
components of x_i are prescribed and the others free; so the unknowns of the whole body are x with y
= Q x, A = Q^T K Q and b = Q^T f, in which supports are eliminated as they are along axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from signorini_fx.arrays import Array, Flags, Indices, Integers, Ints, matvec
from signorini_fx.mechanics.effects.displacement import Displacement
from signorini_fx.mechanics.statement.effect import Effect
from signorini_fx.tuned import ROOT_OF_EPS


@dataclass(frozen=True)
class SkewSupport:
    """A normal displacement on a flat boundary across no axis: its effect, and the position of that
    in ``scene.displacement``, m nodes, local numbers, ghosts included, the outward unit normal,
    shape (d,), and n . y at the nodes, length, shape (m,).
    """

    effect: Displacement
    position: int
    nodes: Indices
    normal: Array
    values: Array


@dataclass(frozen=True)
class TurnedNodes:
    """The nodes of this rank with a ``SkewSupport``, m of them, ghosts included.

    Attributes:
        nodes: local numbers, shape (m,), in order.
        frames: Q_i, one direction per column, shape (m, d, d).
        fixed: which components in the frame are prescribed, shape (m, d).
        from_given: from what the supports prescribe to y_i, shape (m, d, d + s): the components
            along the axes, then along the normals of the s skew supports.
        supports: the skew supports, s of them.
    """

    nodes: Indices
    frames: Array
    fixed: Flags
    from_given: Array
    supports: Sequence[SkewSupport]

    @classmethod
    def of(cls, supports: Sequence[SkewSupport], axes: Ints) -> TurnedNodes:
        """Return the frames of all nodes with skew supports, of which there is one.

        ``axes``: position in ``scene.displacement`` of the support that prescribes each component,
            -1 where none does, ghosts included, shape (nodes, d).
        """
        dim = axes.shape[1]
        nodes = np.unique(np.concatenate([support.nodes for support in supports]))
        skew = (
            np.where(np.isin(nodes, support.nodes), support.position, -1) for support in supports
        )
        directions = np.vstack((np.eye(dim), *(support.normal for support in supports)))
        frames = np.empty((nodes.size, dim, dim))
        fixed = np.zeros((nodes.size, dim), dtype=bool)
        from_given = np.zeros((nodes.size, dim, len(directions)))
        kinds, kind = np.unique(np.column_stack((axes[nodes], *skew)), axis=0, return_inverse=True)
        for number, prescribes in enumerate(kinds):
            of_kind = kind.ravel() == number
            frames[of_kind], count, from_given[of_kind] = _frame(directions, prescribes)
            fixed[of_kind, :count] = True
        return cls(nodes.astype(np.int32), frames, fixed, from_given, supports)

    def place(self, y: Array, active: Sequence[Effect]) -> None:
        """Put what the active effects prescribe into nodal displacements, shape (nodes, d), which
        have what supports along the axes prescribe.
        """
        given = np.zeros((len(y), y.shape[1] + len(self.supports)))
        given[:, : y.shape[1]] = y
        for column, support in enumerate(self.supports, start=y.shape[1]):
            if any(support.effect is effect for effect in active):
                given[support.nodes, column] = support.values
        y[self.nodes] = matvec(self.from_given, given[self.nodes])

    def frames_at(self, nodes: Integers) -> Array:
        """Return the frame of each of some nodes, the axes where it is not turned, shape (n, d,
        d).
        """
        frames = np.tile(np.eye(self.frames.shape[1]), (len(nodes), 1, 1))
        turned = np.isin(nodes, self.nodes)
        frames[turned] = self.frames[np.searchsorted(self.nodes, nodes[turned])]
        return frames


def _frame(directions: Array, prescribes: Ints) -> tuple[Array, int, Array]:
    """Return the frame of a node, how many components are prescribed, and its motion: later
    supports apply before earlier.
    """
    identity = np.eye(len(directions))
    free = np.eye(directions.shape[1])
    matrix = np.zeros(directions.T.shape)
    held = free[:, :0]
    for position in np.unique(prescribes[prescribes >= 0])[::-1]:
        selected = prescribes == position
        if free.shape[1] == 0:
            break
        left_vectors, size, along = np.linalg.svd(directions[selected] @ free)
        count = int(np.count_nonzero(size > ROOT_OF_EPS))
        added = free @ along[:count].T
        free = free @ along[count:].T
        matrix += added @ (
            left_vectors[:, :count].T
            @ (identity[selected] - directions[selected] @ matrix)
            / size[:count, None]
        )
        held = np.hstack((held, added))
    return np.hstack((held, free)), held.shape[1], matrix
