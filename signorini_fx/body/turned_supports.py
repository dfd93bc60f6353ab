"""Supports along no axis: nodes turned into a frame in which what is prescribed there is a component.

A boundary that is flat, but across no axis, prescribes n . y = g at its nodes, and other supports may prescribe more
there.  With an orthonormal frame Q_i at each such node, y_i = Q_i x_i, the first components of x_i are prescribed and
the others free; so the unknowns of the whole body are x with y = Q x, A = Q^T K Q and b = Q^T f, in which supports are
eliminated as they are along axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from signorini_fx.scene.model import PrescribedDisplacement

_Floats = npt.NDArray[np.float64]
# What is left of a direction, taken across others, when it adds nothing to them.
_DEPENDENT = 1e-8


@dataclass(frozen=True)
class SkewSupport:
    """A normal displacement on a flat boundary across no axis.

    Attributes:
        effect: of the scene.
        nodes: local numbers, ghosts included, shape (m,).
        normal: outward unit normal, shape (d,).
        values: n . y at the nodes, length, shape (m,).
    """

    effect: PrescribedDisplacement
    nodes: npt.NDArray[np.int32]
    normal: _Floats
    values: _Floats


@dataclass(frozen=True)
class TurnedNodes:
    """The nodes of this rank with a ``SkewSupport``, m of them, ghosts included.

    Attributes:
        nodes: local numbers, shape (m,), in order.
        frames: Q_i, one direction per column, shape (m, d, d).
        fixed: which components in the frame are prescribed, shape (m, d).
        from_given: from what the supports prescribe to y_i, shape (m, d, d + s): the components along the axes, then
            along the normals of the s skew supports.
        supports: the skew supports, s of them.
    """

    nodes: npt.NDArray[np.int32]
    frames: _Floats
    fixed: npt.NDArray[np.bool_]
    from_given: _Floats
    supports: Sequence[SkewSupport]

    @classmethod
    def of(cls, supports: Sequence[SkewSupport], axes: npt.NDArray[np.bool_]) -> TurnedNodes:
        """The frames of all nodes with skew supports.

        Args:
            supports: at least one; a later one wins where two contradict each other.
            axes: which components supports along the axes prescribe, ghosts included, shape (nodes, d).
        """
        dim = axes.shape[1]
        nodes = np.unique(np.concatenate([support.nodes for support in supports]))
        given = np.column_stack((axes[nodes], *(np.isin(nodes, support.nodes) for support in supports)))
        directions = np.vstack((np.eye(dim), *(support.normal for support in supports)))
        frames, fixed = np.empty((nodes.size, dim, dim)), np.zeros((nodes.size, dim), dtype=bool)
        from_given = np.zeros((nodes.size, dim, len(directions)))
        kinds, kind = np.unique(given, axis=0, return_inverse=True)
        for number, listed in enumerate(kinds):
            here = kind.ravel() == number
            last_first = [*np.flatnonzero(listed[dim:])[::-1] + dim, *np.flatnonzero(listed[:dim])]
            chosen: list[int] = []
            for one in last_first:
                added = np.linalg.svd(directions[[*chosen, one]], compute_uv=False)
                if len(added) == len(chosen) + 1 and added[-1] > _DEPENDENT:
                    chosen.append(int(one))
            q, r = np.linalg.qr(directions[chosen].T, mode="complete")
            count = len(chosen)
            frames[here], fixed[here, :count] = q, True
            whole = np.zeros((dim, len(directions)))
            whole[:, chosen] = q[:, :count] @ np.linalg.inv(r[:count]).T
            from_given[here] = whole
        return cls(nodes.astype(np.int32), frames, fixed, from_given, supports)

    def place(self, y: _Floats, active: Sequence[Any]) -> None:
        """Put what the active effects prescribe into nodal displacements, shape (nodes, d), which have what supports
        along the axes prescribe.
        """
        given = [y[self.nodes]]
        for support in self.supports:
            values = np.zeros(len(y))
            if any(support.effect is effect for effect in active):
                values[support.nodes] = support.values
            given.append(values[self.nodes, None])
        y[self.nodes] = np.einsum("nij,nj->ni", self.from_given, np.concatenate(given, axis=1))

    def matrix(self, like: PETSc.Mat) -> PETSc.Mat:
        """Q of the owned nodes, with the layout of ``like``."""
        dim = self.frames.shape[1]
        rotation = PETSc.Mat().createAIJ(like.getSizes(), nnz=(dim, 0), comm=like.comm)
        first, last = rotation.getOwnershipRange()
        rotation.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)
        for row in range(first, last):
            rotation.setValue(row, row, 1.0)
        rotation.assemble()
        owned = self.nodes < (last - first) // dim
        if owned.any():
            rows = (first + dim * self.nodes[owned, None] + np.arange(dim)).astype(PETSc.IntType)
            rotation.setValuesRCV(rows, rows, np.ascontiguousarray(self.frames[owned]))
        rotation.assemble()
        return rotation

    def frames_at(self, nodes: npt.NDArray[np.integer[Any]]) -> _Floats:
        """The frame of each of some nodes, the axes where it is not turned, shape (n, d, d)."""
        dim = self.frames.shape[1]
        found = np.tile(np.eye(dim), (len(nodes), 1, 1))
        place = np.minimum(np.searchsorted(self.nodes, nodes), self.nodes.size - 1)
        here = self.nodes[place] == nodes if self.nodes.size else np.zeros(len(nodes), dtype=bool)
        found[here] = self.frames[place[here]]
        return found
