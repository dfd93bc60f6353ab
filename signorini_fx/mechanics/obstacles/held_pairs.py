"""Where supports hold both sides of a pair of bodies, so that they alone decide about the distance there.

Such a node of the side with the points has no contact point, and those beside it take over its function, see
``pairs.dual_functions.HeldSides``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpi4py import MPI

from signorini_fx.algebra.contact.points import inside
from signorini_fx.mechanics.assembly.averages import from_owners
from signorini_fx.mechanics.pairs.mortar_coupling import Coupling, closed_within
from signorini_fx.mechanics.pairs.pair_side import PairSurface
from signorini_fx.tuned import SAME_DIRECTION

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Nodes = npt.NDArray[np.int64]


def held_along(normal: Array, frames: Array, fixed: Flags) -> Flags:
    """Which nodes supports hold along a direction: no component that is free has any of it, shape (n,).

    Args:
        normal: shape (n, d).
        frames: that the components are told in, one direction per column, shape (n, d, d).
        fixed: which of them are prescribed, shape (n, d).
    """
    sizes = np.abs(np.einsum("nij,ni->nj", frames, normal))
    return np.asarray(np.where(fixed, 0.0, sizes).max(axis=1, initial=0.0) <= SAME_DIRECTION)


@dataclass(frozen=True)
class HeldPairs:
    """Nodes of the side with the points where supports hold both sides, m of them.

    Attributes:
        nodes: their global numbers, shape (m,).
        x: positions, length, shape (m, d).
        normal: outward unit normals, shape (m, d).
        distance: that of both sides along them, which is a part of the gap, length, shape (m,).
        others: global numbers of the nodes of the other side, shape (k,).
        shares: of each of these in the place over a node, sparse, shape (m, k).
        gap: length, shape (m,); None: not known yet.
        bilateral: whether contact cannot open.
    """

    nodes: Nodes
    x: Array
    normal: Array
    distance: Array
    others: Nodes
    shares: sp.csr_array
    gap: Array | None = None
    bilateral: bool = False

    @classmethod
    def of(
        cls,
        sides: tuple[PairSurface, PairSurface],
        names: tuple[Nodes, Nodes],
        coupling: Coupling,
        adjust: float | None,
    ) -> HeldPairs:
        """Those of a pair.

        Args:
            sides: the side with the points, and the other one.
            names: global numbers of their nodes, shape (N,) each.
            coupling: of both sides.
            adjust: up to which distance they count as closed, length; None: nowhere.
        """
        (slave, master), at, over = sides, coupling.constrained_slaves, coupling.over
        normal = slave.nodal_normals[at]
        distance = closed_within(np.einsum("md,md->m", normal, over @ master.x - slave.x[at]), adjust)
        return cls(names[0][at], slave.x[at], normal, distance, names[1], over)

    def with_gap(self, gap: Array, comm: MPI.Comm, *, by_geometry: bool, bilateral: bool) -> HeldPairs:
        """The same with its gap; collective.

        Args:
            gap: what is said of it at the owned nodes, length, shape (nodes,).
            comm: the ranks.
            by_geometry: whether the distance of both sides is added.
            bilateral: see ``HeldPairs``.
        """
        given = from_owners(gap[:, None], self.nodes, comm)[:, 0]
        return replace(self, gap=given + self.distance if by_geometry else given, bilateral=bilateral)

    def inside(self, displacement: Array, comm: MPI.Comm) -> Array:
        """How far they are behind the other side, or, where contact cannot open, off it too, length, shape (m,),
        otherwise negative where they are off it; collective.

        Args:
            displacement: of the owned nodes, length, shape (nodes, d).
            comm: the ranks.
        """
        moved = from_owners(displacement, self.nodes, comm) - self.shares @ from_owners(displacement, self.others, comm)
        assert self.gap is not None
        return inside(np.einsum("md,md->m", self.normal, moved) - self.gap, self.bilateral)
