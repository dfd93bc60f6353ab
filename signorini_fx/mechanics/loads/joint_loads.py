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

from signorini_fx.errors import SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_nodes, node_positions
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary, chains
from signorini_fx.mechanics.contact_points.joint_pressure import Flags
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.statement import Statement

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Entrance:
    """One load at one contact.

    Attributes:
        load: position in ``scene.joint_loads``.
        part: position in ``statement.contact``.
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
class _JointPoints:
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
    def of(cls, boundary: ContactBoundary, part: int) -> _JointPoints:
        """That of a contact; collective."""
        on_part = boundary.part == part
        rows = parallel.gather_rows(
            boundary.comm, np.column_stack((boundary.global_nodes[on_part], boundary.x[on_part]))
        )
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
        known_points, values = reached[order], pressure[order]
        interpolated = np.zeros(self.nodes.size)
        for piece, arc, loop in zip(self.pieces, self.arc, self.loop, strict=True):
            if not known_points[piece].any():
                continue
            at = known_points[piece].copy()
            if loop is None:
                at[[0, -1]] = True
            known_values = np.where(known_points[piece], values[piece], 0.0)
            interpolated[piece] = np.interp(arc, arc[at], known_values[at], period=loop)
        return interpolated


class JointLoads:
    """The loads that enter the contact of a scene, at a place in its lists of factors; all methods are collective.

    Args:
        statement: what is stated of the problem.
        tagged: its mesh.
        space: the displacements.
        boundary: the contact points of this rank, n of them.
        place: see ``statement.load_path``.

    Raises:
        SceneError: the boundary of a load does not meet a contact that it enters, or its pressure in closed contact is
            to be linear elsewhere than in the plane.
    """

    def __init__(
        self, statement: Statement, tagged: TaggedMesh, space: fem.FunctionSpace, boundary: ContactBoundary, step: float
    ) -> None:
        self._space, self._boundary, self._entrances = space, boundary, list[_Entrance]()
        self._closed: dict[int, str] = {}
        self._loads = len(statement.joint_loads)
        x, nodes = node_positions(space)[:, : boundary.x.shape[1]], space.dofmap.index_map
        parts = {contact.boundary: part for part, contact in enumerate(statement.contact)}
        problems = []
        for number, (path, load) in enumerate(statement.joint_loads.items()):
            if load.closed == "linear" and statement.kinematics_in(tagged.dimension).whole:
                wrong = "'linear' is for the plane: what spreads on a surface needs the paths along which it goes on"
                problems.append((f"{path}.closed", wrong))
            factor, current_load = statement.now(load, step)
            wall = np.zeros(len(x), dtype=bool)
            wall[facet_nodes(space, tagged.facets(load.boundary)).ravel()] = True
            for part, name in ((parts[name], name) for name in load.enters):
                segments = boundary.segments[boundary.segments[:, 0] == part, 1:]
                rows, columns = (
                    np.repeat(np.arange(len(segments)), segments.shape[1]),
                    nodes.global_to_local(segments.ravel()),
                )
                facets = sp.csr_array((np.ones(segments.size), (rows, columns)), shape=(len(segments), len(x)))
                begins = self._over_ranks(wall) & self._over_ranks(facets.sum(axis=0) > 0)
                if not parallel.any_rank(boundary.comm, bool(begins.any())):
                    wrong = (
                        f"boundary {load.boundary!r} does not meet {name!r}: the {load.label} enters where both meet"
                    )
                    problems.append((f"{path}.enters", wrong))
                self._closed[part] = load.closed
                pressure = np.maximum(factor * current_load.pressure(x), 0.0)
                self._entrances.append(_Entrance(number, part, pressure, begins, facets))
        if problems:
            raise SceneError(problems)
        everywhere = np.ones(len(x), dtype=bool)
        self._joints = [
            self._spread(entrance, everywhere, entrance.begins)
            if self._closed[entrance.part] == "full"
            else entrance.begins
            for entrance in self._entrances
        ]
        self._lines = {
            part: _JointPoints.of(boundary, part) for part, closed in self._closed.items() if closed == "linear"
        }

    def beginning(self, reached: Flags | None) -> list[Flags]:
        """The nodes that each load has reached at each contact where a load step begins, shape (nodes,) each.

        Args:
            reached: the contact points that loads had reached at the end of the last one, shape (n, m); None: there is
                none.
        """
        node_flags = []
        for entrance in self._entrances:
            nodes = entrance.begins.copy()
            if reached is not None:
                on_part = self._boundary.part == entrance.part
                nodes[self._boundary.nodes[on_part]] |= reached[on_part, entrance.load]
            node_flags.append(self._over_ranks(nodes))
        return node_flags

    def grown(self, open_: Flags, reached: Sequence[Flags]) -> list[Flags]:
        """The nodes that each load reaches at each contact from others through open contact points.

        Args:
            open_: shape (n,).
            reached: the nodes that they have reached before.
        """
        node_flags = []
        for entrance, begun in zip(self._entrances, reached, strict=True):
            on_part = self._boundary.part == entrance.part
            passes = np.zeros(begun.size, dtype=bool)
            passes[self._boundary.nodes[on_part]] = open_[on_part]
            node_flags.append(self._spread(entrance, self._over_ranks(passes) & (entrance.pressure > 0), begun))
        return node_flags

    def at_points(self, reached: Sequence[Flags]) -> Flags:
        """Which load has reached which contact point, shape (n, m)."""
        point_flags = np.zeros((self._boundary.size, self._loads), dtype=bool)
        for entrance, nodes in zip(self._entrances, reached, strict=True):
            on_part = self._boundary.part == entrance.part
            point_flags[on_part, entrance.load] = nodes[self._boundary.nodes[on_part]]
        return point_flags

    def pressure(self, reached: Sequence[Flags]) -> Array:
        """The pressure of the loads at the contact points, stress, shape (n,), the largest one where they meet.

        Args:
            reached: the nodes that they have reached.
        """
        pressure, boundary = np.zeros(self._boundary.size), self._boundary
        loaded = np.zeros(boundary.size, dtype=bool)
        for entrance, nodes, joint in zip(self._entrances, reached, self._joints, strict=True):
            on_part = boundary.part == entrance.part
            at = boundary.nodes[on_part]
            newly_loaded = (nodes | joint)[at]
            pressure[on_part] = np.maximum(pressure[on_part], np.where(newly_loaded, entrance.pressure[at], 0.0))
            loaded[on_part] |= newly_loaded
        for part, line in self._lines.items():
            on_part = boundary.part == part
            global_nodes = boundary.global_nodes[on_part]
            rows = parallel.gather_rows(
                boundary.comm, np.column_stack((global_nodes, pressure[on_part], loaded[on_part]))
            )
            line_pressure = line.between(rows[:, 0].astype(np.int64), rows[:, 1], rows[:, 2] > 0)
            pressure[on_part] = line_pressure[np.searchsorted(line.nodes, global_nodes)]
        return pressure

    def _spread(self, entrance: _Entrance, passing: Flags, begun: Flags) -> Flags:
        """The nodes that a load reaches from others through nodes that it passes, shape (nodes,)."""
        reached, facets = begun, entrance.facets
        while True:
            earlier = reached
            while True:
                full = facets @ (reached & passing).astype(np.float64) > 0
                grown = np.asarray(reached | (facets.T @ full.astype(np.float64) > 0), dtype=np.bool_)
                if np.array_equal(grown, reached):
                    break
                reached = grown
            reached = self._over_ranks(reached)
            if not parallel.any_rank(self._boundary.comm, not np.array_equal(reached, earlier)):
                return reached

    def _over_ranks(self, flags: Flags) -> Flags:
        """Flags of nodes that some rank has set, shape (nodes,)."""
        flag_vector = la.vector(self._space.dofmap.index_map, 1)
        flag_vector.array[:] = flags
        flag_vector.scatter_reverse(la.InsertMode.add)
        flag_vector.scatter_forward()
        return np.asarray(flag_vector.array > 0)
