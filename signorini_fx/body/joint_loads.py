"""Loads that enter contact as it opens, such as a fluid: which contact points they reach, and with which pressure.

A load enters from the boundary that it presses on.  It reaches the contact points that this boundary shares with the
contact, and from each open point that it has reached the others of the same facets.  What it has reached it does not
leave again.  Its pressure p and that of the contact, the effective pressure lambda >= 0, add up: to p where a point is
open, to at least p where it is closed.  What a load has not reached carries a share of its pressure, or none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from dolfinx import fem, la

from signorini_fx import parallel
from signorini_fx.body.assembly import facet_nodes
from signorini_fx.body.contact_boundary import ContactBoundary, chains
from signorini_fx.body.joint_pressure import Flags
from signorini_fx.body.node_positions import node_positions
from signorini_fx.errors import SceneError
from signorini_fx.mesh.tagged import TaggedMesh
from signorini_fx.scene.model import Scene

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Entrance:
    """One load at one contact.

    Attributes:
        load: position in ``scene.joint_loads``.
        part: position in ``scene.contact``.
        pressure: of the load at the nodes of this rank, ghosts included, stress, shape (nodes,).
        begins: the nodes that the boundary of the load shares with the contact, shape (nodes,).
        facets: which nodes each facet of the contact on this rank has, sparse, shape (facets, nodes).
    """

    load: int
    part: int
    pressure: Array
    begins: Flags
    facets: sp.csr_array


@dataclass(frozen=True)
class _Line:
    """The points of one contact in the plane, of all ranks, r of them.

    Attributes:
        nodes: their global numbers, increasing, shape (r,).
        pieces: of each connected piece its points as positions in ``nodes``, in order.
        arc: their arc lengths.
        loop: the length of each piece that is closed; None: it has two ends.
    """

    nodes: npt.NDArray[np.int64]
    pieces: list[npt.NDArray[np.int64]]
    arc: list[Array]
    loop: list[float | None]

    @classmethod
    def of(cls, boundary: ContactBoundary, part: int) -> _Line:
        """That of a contact; collective."""
        here = boundary.part == part
        rows = parallel.gather_rows(boundary.comm, np.column_stack((boundary.global_nodes[here], boundary.x[here])))
        rows = rows[np.argsort(rows[:, 0])]
        nodes, x = rows[:, 0].astype(np.int64), rows[:, 1:]
        segments = parallel.gather_rows(boundary.comm, boundary.segments[boundary.segments[:, 0] == part])
        pieces, order, closed = chains(np.column_stack((np.full(nodes.size, part), nodes)), segments, x)
        along = [order[piece.start : piece.stop] for piece in pieces]
        steps = [np.linalg.norm(np.diff(x[piece], axis=0), axis=1) for piece in along]
        arc = [np.concatenate(([0.0], np.cumsum(step))) for step in steps]
        last = [float(np.linalg.norm(x[piece[-1]] - x[piece[0]])) for piece in along]
        ends = zip(arc, last, closed, strict=True)
        return cls(nodes, along, arc, [float(s[-1]) + end if shut else None for s, end, shut in ends])

    def between(self, nodes: npt.NDArray[np.int64], pressure: Array, reached: Flags) -> Array:
        """Pressures that change linearly between points where they are known and the ends, where they are zero.

        Args:
            nodes: global numbers of points of all ranks, shape (r,).
            pressure: at them, stress, shape (r,).
            reached: where it is known, shape (r,).

        Returns:
            In the order of ``nodes`` of the line; zero on a piece on which no load has reached a point.
        """
        order = np.argsort(nodes)
        known, values = reached[order], pressure[order]
        found = np.zeros(self.nodes.size)
        for piece, arc, loop in zip(self.pieces, self.arc, self.loop, strict=True):
            if not known[piece].any():
                continue
            at = known[piece].copy()
            if loop is None:
                at[[0, -1]] = True
            told = np.where(known[piece], values[piece], 0.0)
            found[piece] = np.interp(arc, arc[at], told[at], period=loop)
        return found


class JointLoads:
    """The loads that enter the contact of a scene, at a place in its lists of factors; all methods are collective.

    Args:
        scene: the scene.
        tagged: its mesh.
        space: the displacements.
        boundary: the contact points of this rank, n of them.
        place: see ``scene.load_steps``.

    Raises:
        SceneError: the boundary of a load does not meet a contact that it enters, or in space its pressure in closed
            contact is to be linear.
    """

    def __init__(
        self, scene: Scene, tagged: TaggedMesh, space: fem.FunctionSpace, boundary: ContactBoundary, place: float
    ) -> None:
        self._space, self._boundary, self._entrances = space, boundary, list[_Entrance]()
        self._closed: dict[int, str] = {}
        self._loads = len(scene.joint_loads)
        x, nodes = node_positions(space)[:, : boundary.x.shape[1]], space.dofmap.index_map
        parts = {contact.boundary: part for part, contact in enumerate(scene.contact)}
        problems = []
        for number, (path, load) in enumerate(scene.joint_loads.items()):
            if load.closed == "linear" and boundary.x.shape[1] == 3:
                wrong = "'linear' is for the plane: in space it needs the paths along which the load goes on"
                problems.append((f"{path}.closed", wrong))
            factor, now = scene.now(load, place)
            wall = np.zeros(len(x), dtype=bool)
            wall[facet_nodes(space, tagged.facets(load.boundary)).ravel()] = True
            for part, name in ((parts[name], name) for name in load.enters):
                own = boundary.segments[boundary.segments[:, 0] == part, 1:]
                rows, columns = np.repeat(np.arange(len(own)), own.shape[1]), nodes.global_to_local(own.ravel())
                facets = sp.csr_array((np.ones(own.size), (rows, columns)), shape=(len(own), len(x)))
                begins = self._over_ranks(wall) & self._over_ranks(facets.sum(axis=0) > 0)
                if not parallel.any_rank(boundary.comm, bool(begins.any())):
                    wrong = (
                        f"boundary {load.boundary!r} does not meet {name!r}: the {load.label} enters where both meet"
                    )
                    problems.append((f"{path}.enters", wrong))
                self._closed[part] = load.closed
                pressure = np.maximum(factor * now.pressure(x), 0.0)
                self._entrances.append(_Entrance(number, part, pressure, begins, facets))
        if problems:
            raise SceneError(problems)
        every = np.ones(len(x), dtype=bool)
        self._joints = [
            self._spread(one, every, one.begins) if self._closed[one.part] == "full" else one.begins
            for one in self._entrances
        ]
        self._lines = {part: _Line.of(boundary, part) for part, closed in self._closed.items() if closed == "linear"}

    def beginning(self, reached: Flags | None) -> list[Flags]:
        """The nodes that each load has reached at each contact where a load step begins, shape (nodes,) each.

        Args:
            reached: the contact points that loads had reached at the end of the last one, shape (n, m); None: there is
                none.
        """
        found = []
        for one in self._entrances:
            nodes = one.begins.copy()
            if reached is not None:
                here = self._boundary.part == one.part
                nodes[self._boundary.nodes[here]] |= reached[here, one.load]
            found.append(self._over_ranks(nodes))
        return found

    def grown(self, open_: Flags, reached: Sequence[Flags]) -> list[Flags]:
        """The nodes that each load reaches at each contact from others through open contact points.

        Args:
            open_: shape (n,).
            reached: the nodes that they have reached before.
        """
        found = []
        for one, begun in zip(self._entrances, reached, strict=True):
            here = self._boundary.part == one.part
            passes = np.zeros(begun.size, dtype=bool)
            passes[self._boundary.nodes[here]] = open_[here]
            found.append(self._spread(one, self._over_ranks(passes) & (one.pressure > 0), begun))
        return found

    def at_points(self, reached: Sequence[Flags]) -> Flags:
        """Which load has reached which contact point, shape (n, m)."""
        found = np.zeros((self._boundary.size, self._loads), dtype=bool)
        for one, nodes in zip(self._entrances, reached, strict=True):
            here = self._boundary.part == one.part
            found[here, one.load] = nodes[self._boundary.nodes[here]]
        return found

    def pressure(self, reached: Sequence[Flags]) -> Array:
        """The pressure of the loads at the contact points, stress, shape (n,), the largest one where they meet.

        Args:
            reached: the nodes that they have reached.
        """
        found, boundary = np.zeros(self._boundary.size), self._boundary
        some = np.zeros(boundary.size, dtype=bool)
        for one, nodes, joint in zip(self._entrances, reached, self._joints, strict=True):
            here = boundary.part == one.part
            at = boundary.nodes[here]
            there = (nodes | joint)[at]
            found[here] = np.maximum(found[here], np.where(there, one.pressure[at], 0.0))
            some[here] |= there
        for part, line in self._lines.items():
            here = boundary.part == part
            own = boundary.global_nodes[here]
            rows = parallel.gather_rows(boundary.comm, np.column_stack((own, found[here], some[here])))
            every = line.between(rows[:, 0].astype(np.int64), rows[:, 1], rows[:, 2] > 0)
            found[here] = every[np.searchsorted(line.nodes, own)]
        return found

    def _spread(self, entrance: _Entrance, passing: Flags, begun: Flags) -> Flags:
        """The nodes that a load reaches from others through nodes that it passes, shape (nodes,)."""
        reached, facets = begun, entrance.facets
        while True:
            before = reached
            while True:
                full = facets @ (reached & passing).astype(np.float64) > 0
                more = np.asarray(reached | (facets.T @ full.astype(np.float64) > 0), dtype=np.bool_)
                if np.array_equal(more, reached):
                    break
                reached = more
            reached = self._over_ranks(reached)
            if not parallel.any_rank(self._boundary.comm, not np.array_equal(reached, before)):
                return reached

    def _over_ranks(self, flags: Flags) -> Flags:
        """Flags of nodes that some rank has set, shape (nodes,)."""
        every = la.vector(self._space.dofmap.index_map, 1)
        every.array[:] = flags
        every.scatter_reverse(la.InsertMode.add)
        every.scatter_forward()
        return np.asarray(every.array > 0)
