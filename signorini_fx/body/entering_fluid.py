"""Fluids that enter contact as it opens: which contact points their pressure reaches.

A fluid enters from the boundary that it presses on.  It reaches the contact points that this boundary shares with the
contact, and from each open point that it has reached the others of the same facets.  At a point that it has reached,
its pressure p and that of the contact, the effective pressure lambda >= 0, add up: to p where the point is open, to at
least p where it is closed.  At all other points the contact is dry.
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
from signorini_fx.body.contact_boundary import ContactBoundary
from signorini_fx.body.node_positions import node_positions
from signorini_fx.errors import SceneError
from signorini_fx.mesh.tagged import TaggedMesh
from signorini_fx.scene.model import Scene

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class _Entrance:
    """One fluid at one contact.

    Attributes:
        part: position in ``scene.contact``.
        pressure: of the fluid at the nodes of this rank, ghosts included, stress, shape (nodes,).
        begins: the nodes that the boundary of the fluid shares with the contact, shape (nodes,).
        facets: which nodes each facet of the contact on this rank has, sparse, shape (facets, nodes).
    """

    part: int
    pressure: Array
    begins: Flags
    facets: sp.csr_array


class EnteringFluid:
    """The fluids that enter the contact of a scene, at a place in its lists of factors; all methods are collective.

    Args:
        scene: the scene.
        tagged: its mesh.
        space: the displacements.
        boundary: the contact points of this rank, n of them.
        place: see ``scene.load_steps``.

    Raises:
        SceneError: the boundary of a fluid does not meet a contact that it enters.
    """

    def __init__(
        self, scene: Scene, tagged: TaggedMesh, space: fem.FunctionSpace, boundary: ContactBoundary, place: float
    ) -> None:
        self._space, self._boundary, self._entrances = space, boundary, list[_Entrance]()
        x, nodes = node_positions(space)[:, : boundary.x.shape[1]], space.dofmap.index_map
        parts = {contact.boundary: part for part, contact in enumerate(scene.contact)}
        problems = []
        for number, fluid in enumerate(scene.fluids):
            if not fluid.enters:
                continue
            factor, now = scene.now(fluid, place)
            wall = np.zeros(len(x), dtype=bool)
            wall[facet_nodes(space, tagged.facets(fluid.boundary)).ravel()] = True
            for part, name in ((parts[name], name) for name in fluid.enters):
                own = boundary.segments[boundary.segments[:, 0] == part, 1:]
                rows, columns = np.repeat(np.arange(len(own)), own.shape[1]), nodes.global_to_local(own.ravel())
                facets = sp.csr_array((np.ones(own.size), (rows, columns)), shape=(len(own), len(x)))
                begins = self._over_ranks(wall) & self._over_ranks(facets.sum(axis=0) > 0)
                if not parallel.any_rank(boundary.comm, bool(begins.any())):
                    wrong = f"boundary {fluid.boundary!r} does not meet {name!r}: the fluid enters where both meet"
                    problems.append((f"fluid[{number}].enters", wrong))
                self._entrances.append(_Entrance(part, np.maximum(factor * now.pressure(x), 0.0), begins, facets))
        if problems:
            raise SceneError(problems)

    def grown(self, passes: Flags, wet: Sequence[Flags] | None = None) -> list[Flags]:
        """The nodes that each fluid reaches at each contact, ghosts included, shape (nodes,).

        Args:
            passes: the contact points that fluids pass, shape (n,).
            wet: the nodes that they have reached before; None: where they enter.
        """
        before = [one.begins for one in self._entrances] if wet is None else wet
        return [self._spread(one, passes, begun) for one, begun in zip(self._entrances, before, strict=True)]

    def beyond(self, wet: list[Flags], facets: int) -> list[Flags]:
        """The nodes that fluids reach, and those that are fewer facets away from them."""
        for _ in range(facets - 1):
            wet = self.grown(self.pressure(wet) > 0, wet)
        return wet

    def pressure(self, wet: Sequence[Flags] | None = None) -> Array:
        """The pressure of the fluids at the contact points, stress, shape (n,), the largest one where they meet; zero
        where the contact is dry.

        Args:
            wet: the nodes that they reach; None: all of them.
        """
        found = np.zeros(self._boundary.size)
        for number, one in enumerate(self._entrances):
            here = self._boundary.part == one.part
            nodes = self._boundary.nodes[here]
            there = one.pressure[nodes] if wet is None else np.where(wet[number][nodes], one.pressure[nodes], 0.0)
            found[here] = np.maximum(found[here], there)
        return found

    def _spread(self, entrance: _Entrance, passes: Flags, begun: Flags) -> Flags:
        """The nodes that a fluid reaches from others through points of its contact, shape (nodes,)."""
        here = self._boundary.part == entrance.part
        wet, open_ = begun, np.zeros(begun.size, dtype=bool)
        open_[self._boundary.nodes[here]] = passes[here]
        passing, facets = self._over_ranks(open_) & (entrance.pressure > 0), entrance.facets
        while True:
            before = wet
            while True:
                full = facets @ (wet & passing).astype(np.float64) > 0
                more = np.asarray(wet | (facets.T @ full.astype(np.float64) > 0), dtype=np.bool_)
                if np.array_equal(more, wet):
                    break
                wet = more
            wet = self._over_ranks(wet)
            if not parallel.any_rank(self._boundary.comm, not np.array_equal(wet, before)):
                return wet

    def _over_ranks(self, flags: Flags) -> Flags:
        """Flags of nodes that some rank has set, shape (nodes,)."""
        every = la.vector(self._space.dofmap.index_map, 1)
        every.array[:] = flags
        every.scatter_reverse(la.InsertMode.add)
        every.scatter_forward()
        return np.asarray(every.array > 0)
