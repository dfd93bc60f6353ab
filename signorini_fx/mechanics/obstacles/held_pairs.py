"""Where supports hold both sides of a pair of bodies, so that they alone decide about the distance there.

Where supports hold facets of both sides over each other there is no contact.  Anywhere else a node of the side with the
points that supports hold along its normal carries a point, which moves the other side.  If the place of the other side
over it is held along that normal too, nothing can move it out: it has no contact point, and those beside it take over
its function.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpi4py import MPI

from signorini_fx.algebra.contact.points import inside
from signorini_fx.mechanics.assembly.averages import from_owners
from signorini_fx.mechanics.pairs.mortar_coupling import Coupling, closed_within
from signorini_fx.mechanics.pairs.overlap_quadrature import Overlap
from signorini_fx.mechanics.pairs.pair_side import PairSurface
from signorini_fx.tuned import SAME_DIRECTION, SAME_PLACE_IN_CELL

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
    """Nodes of the side with the points where supports hold both sides, as far as this rank has found them, m of them.

    Attributes:
        nodes: their global numbers, shape (m,).
        x: positions, length, shape (m, d).
        normal: outward unit normals, shape (m, d).
        distance: that of both sides along them, which is a part of the gap, length, shape (m,).
        others: global numbers of the nodes of the other side over them, shape (k,).
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
        held: Flags,
        supports: tuple[Array, Flags],
        coupling: Coupling,
        adjust: float | None,
    ) -> HeldPairs:
        """Those of a pair.

        Args:
            sides: the side with the points, and the other one.
            names: global numbers of their nodes, shape (N,) each.
            held: the nodes of the first one that carry no point because both sides are held there, shape (N,).
            supports: the frames of the nodes of the other one, and what is prescribed in them, see ``held_along``.
            coupling: of both sides.
            adjust: up to which distance they count as closed, length; None: nowhere.
        """
        (slave, master), dim = sides, sides[0].dimension
        rows: dict[int, tuple[Nodes, Array]] = {}
        for node, facet, place in chain.from_iterable(
            _over(slave, part, held) for part in (coupling.still, coupling.overlap)
        ):
            shape = master.functions.values(place[None])[0]
            nodes = master.nodes[facet][np.abs(shape) > SAME_PLACE_IN_CELL]
            normal = np.tile(slave.nodal_normals[node], (nodes.size, 1))
            certain = held_along(normal, supports[0][nodes], supports[1][nodes]).all()  # supports alone decide there
            if node not in rows or certain:
                rows[node] = nodes, shape[np.abs(shape) > SAME_PLACE_IN_CELL]
        at = np.array(list(rows), dtype=np.int64)
        shares = sp.lil_array((at.size, len(master.x)))
        for row, (nodes, share) in enumerate(rows.values()):
            shares[row, nodes] = share
        normal = slave.nodal_normals[at].reshape(-1, dim)
        distance = closed_within(np.einsum("md,md->m", normal, shares @ master.x - slave.x[at]), adjust)
        over = np.flatnonzero(shares.sum(axis=0))
        reached = sp.csr_array(shares.tocsr()[:, over])
        return cls(names[0][at], slave.x[at], normal, distance, names[1][over], reached)

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


def _over(slave: PairSurface, overlap: Overlap, held: Flags) -> Iterator[tuple[int, int, Array]]:
    """The places of the other side over nodes: the node, the facet of the other side, and the place in it, shape
    (d - 1,).

    A piece of the overlap that begins at a node has no point there: the place over it is that of the affine map through
    the points of the piece.  The other side ends before the node where that place is outside of its facet.
    """
    places = slave.functions.places[: len(slave.tests.places)]
    for piece, (facet, other) in enumerate(zip(overlap.slave, overlap.master, strict=True)):
        for node, place in zip(slave.points[facet], places, strict=True):
            if not held[node]:
                continue
            at, over = overlap.at[piece] - place, overlap.over[piece]
            extent = float(np.ptp(at, axis=0).max())
            affine, _, rank, _ = np.linalg.lstsq(np.column_stack((np.ones(len(at)), at)), over, rcond=None)
            begins = float(np.abs(at).max(axis=1).min()) <= extent
            if begins and rank > at.shape[1] and _in_facet(affine[0], simplex=slave.functions.simplex):
                yield int(node), int(other), np.clip(affine[0], 0.0, 1.0)


def _in_facet(place: Array, *, simplex: bool) -> bool:
    """Whether a place is in the reference facet, or off it by round-off."""
    highest = float(place.sum()) if simplex else float(place.max())
    return bool(place.min() >= -SAME_PLACE_IN_CELL and highest <= 1.0 + SAME_PLACE_IN_CELL)
