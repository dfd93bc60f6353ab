"""Supports that are not along an axis: their nodes get a rotated frame in which components are
prescribed.

A flat boundary that is not perpendicular to an axis prescribes n . y = g at its nodes, and other
supports may prescribe more there.  With an orthonormal frame Q_i at each such node, y_i = Q_i x_i,
the first components of x_i are prescribed and the others free.  The unknowns of the whole body are
then x with y = Q x, A = Q^T K Q and b = Q^T f, and supports are eliminated as if they were along
the axes.
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
    """A normal displacement that is prescribed on a flat boundary not perpendicular to an axis.

    It has the entry of the scene, its position in ``scene.displacement``, the local numbers of m
    nodes, ghosts included, the outward unit normal, shape (d,), and n . y at the nodes, length,
    shape (m,).
    """

    effect: Displacement
    position: int
    nodes: Indices
    normal: Array
    values: Array


@dataclass(frozen=True)
class TurnedNodes:
    """The m nodes of this rank, ghosts included, that have a ``SkewSupport``.

    Attributes:
        nodes: local numbers, shape (m,), in order.
        frames: Q_i, one direction per column, shape (m, d, d).
        fixed: which components in the frame are prescribed, shape (m, d).
        from_given: matrix from the prescribed values to y_i, shape (m, d, d + s): the components
            along the axes, then those along the normals of the s skew supports.
        supports: the s skew supports.
    """

    nodes: Indices
    frames: Array
    fixed: Flags
    from_given: Array
    supports: Sequence[SkewSupport]

    @classmethod
    def of(cls, supports: Sequence[SkewSupport], axes: Ints) -> TurnedNodes:
        """Return the frames of all nodes of the skew supports, of which there is at least one.

        Args:
            supports: the skew supports.
            axes: position in ``scene.displacement`` of the support that prescribes each component,
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
        """Add what skew supports prescribe to nodal displacements, in place.

        Args:
            y: displacements, shape (nodes, d), which already have the values of supports along the
                axes.
            active: the supports that act; the others prescribe zero.
        """
        given = np.zeros((len(y), y.shape[1] + len(self.supports)))
        given[:, : y.shape[1]] = y
        for column, support in enumerate(self.supports, start=y.shape[1]):
            if any(support.effect is effect for effect in active):
                given[support.nodes, column] = support.values
        y[self.nodes] = matvec(self.from_given, given[self.nodes])

    def frames_at(self, nodes: Integers) -> Array:
        """Return the frames of some nodes, shape (n, d, d); the identity at nodes without a skew
        support.
        """
        frames = np.tile(np.eye(self.frames.shape[1]), (len(nodes), 1, 1))
        turned = np.isin(nodes, self.nodes)
        frames[turned] = self.frames[np.searchsorted(self.nodes, nodes[turned])]
        return frames


def _frame(directions: Array, prescribes: Ints) -> tuple[Array, int, Array]:
    """Return the frame of a node, the number of prescribed components, and the matrix from
    prescribed values to its displacement.

    If supports contradict each other the later one in the scene wins.

    Args:
        directions: the axes, then the normals of the skew supports, one per row.
        prescribes: position of the support that prescribes each direction, -1: none does.
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
