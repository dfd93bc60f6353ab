"""The contact points as the certificate sees them: evaluated anew, with the tractions that are claimed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import Averages, from_owners, to_owners
from signorini_fx.mechanics.rigid.rigid_bodies import Drive, RigidBodyMotion
from signorini_fx.results.certificate.body_nodes import BodyNodes
from signorini_fx.results.certificate.law_of_method import Tractions
from signorini_fx.results.certificate.supports import PrescribedNodes
from signorini_fx.tuned import ROOT_OF_EPS

if TYPE_CHECKING:
    from signorini_fx.results.certificate.pair_points import PairPoints

Nodal = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ContactSide:
    """One part of the boundary with contact at its n points on this rank, evaluated anew.

    Attributes:
        nodes: local number of the node at the point, shape (n,).
        weight: area (in 2D: length) that the point stands for, shape (n,).
        normal: outward unit normal, or the direction that the problem gives, shape (n, d).
        gap: d, length, shape (n,).
        bound: (nodes, pressure at them) -> F g, stress, shape (n,).
        bilateral: whether contact cannot open.
        averages: how the points average; None: they are nodes, or those of a pair.
        pair: the points of a pair; None: the foundation is rigid.
        axes: vectors along which friction is that of ``bound``, shape (n, d), and the ratio of that across them, shape
            (n,); None: friction has no direction.
    """

    nodes: npt.NDArray[Any]
    weight: Nodal
    normal: Nodal
    gap: Nodal
    bound: Callable[[npt.NDArray[Any], Nodal], Nodal]
    bilateral: bool
    averages: Averages | None = None
    pair: PairPoints | None = None
    axes: tuple[Nodal, Nodal] | None = None

    def at(self, values: Nodal, body: BodyNodes) -> Nodal:
        """Values at the nodes of this rank, ghosts included, shape (nodes, k), at the points of one body, shape
        (n, k); collective.
        """
        if self.averages is None:
            return np.asarray(values[self.nodes])
        reached = from_owners(np.nan_to_num(values[: body.owned]), self.averages.nodes, body.comm)
        return np.asarray(self.averages.shares @ reached)

    def movable(self, vectors: Nodal, supports: PrescribedNodes, body: BodyNodes) -> Nodal:
        """The part of vectors at the points that is along directions in which something can move, shape (n, d);
        collective.
        """
        if self.pair is not None:
            return np.asarray(vectors * self.pair.moved(supports.movable()))
        if self.averages is None:
            return supports.left(vectors, self.nodes)
        reached = from_owners(supports.movable().astype(np.float64), self.averages.nodes, body.comm)
        return np.asarray(vectors * self.averages.any_of(reached > 0))

    def forces(self, traction: Nodal, body: BodyNodes) -> tuple[npt.NDArray[Any], Nodal, Nodal]:
        """Global nodes, their nodal forces and areas, of tractions at the points; collective."""
        if self.pair is not None:
            return self.pair.forces(traction, body.owned)
        force = self.weight[:, None] * traction
        if self.averages is None:
            return self.nodes, force, self.weight
        shares, nodes = self.averages.shares, self.averages.nodes
        values = np.column_stack((shares.T @ force, abs(shares).T @ self.weight))
        rows = to_owners(values, nodes, body.comm, body.owned)
        reached = np.flatnonzero(rows[:, -1] > 0)
        return reached, rows[reached, :-1], rows[reached, -1]


@dataclass(frozen=True)
class ContactNodes:
    """The contact points of this rank with the tractions at them; methods are collective; the points of ``sides``
    follow each other; ``across``: e, the unit vector across which friction has the ratio r to that along, shape (n, d),
    None: it has no direction.
    """

    body: BodyNodes
    sides: Sequence[ContactSide]
    nodes: npt.NDArray[np.int64]
    weight: Nodal
    normal: Nodal
    gap: Nodal
    bound: Nodal
    bilateral: npt.NDArray[np.bool_]
    pressure: Nodal
    shear: Nodal
    across: Nodal | None = None
    ratio: Nodal | None = None

    @classmethod
    def of(cls, body: BodyNodes, sides: Sequence[ContactSide], tractions: Tractions) -> ContactNodes:
        """The contact points of a problem; collective.

        Raises:
            ValueError: the tractions are not those of the contact points of the problem.
        """
        rows, unmatched = [], False
        for part, side in enumerate(sides):
            claimed = np.flatnonzero(np.asarray(tractions.part) == part)
            claimed = claimed[np.argsort(np.asarray(tractions.nodes)[claimed], kind="stable")]
            order = np.argsort(side.nodes, kind="stable")
            if np.array_equal(np.asarray(tractions.nodes)[claimed], side.nodes[order]):
                rows.append(claimed[np.argsort(order)])
            else:
                unmatched = True
        if parallel.any_rank(body.comm, unmatched):
            raise ValueError("the tractions are not those of the contact nodes of the scene")
        names = ("nodes", "weight", "normal", "gap")
        given = {name: np.concatenate([getattr(side, name) for side in sides]) for name in names}
        across = ratio = None
        if any(side.axes is not None for side in sides):
            across, ratio = np.zeros_like(given["normal"]), np.ones(len(given["nodes"]))
            at = np.cumsum([0, *(len(side.nodes) for side in sides)])
            for side, first, last in zip(sides, at[:-1], at[1:], strict=True):
                if side.axes is not None:
                    along, ratio[first:last] = side.axes
                    crossed = np.cross(side.normal, along)
                    across[first:last] = crossed / np.linalg.norm(crossed, axis=1, keepdims=True)
        pressures = [tractions.pressure[of_side] for of_side in rows]
        return cls(
            body,
            sides,
            **given,
            bound=np.concatenate([side.bound(side.nodes, p) for side, p in zip(sides, pressures, strict=True)]),
            bilateral=np.concatenate([np.full(len(side.nodes), side.bilateral) for side in sides]),
            pressure=np.concatenate(pressures),
            shear=np.concatenate([tractions.shear[of_side] for of_side in rows]),
            across=across,
            ratio=ratio,
        )

    def rounded(self, vectors: Nodal, power: int) -> Nodal:
        """Tangential vectors, shape (n, d), with their part across the direction of friction times r^power: with -1
        admissible shears fill a disc, and with 1 slips that are normal to the ellipse are normal to that.
        """
        if self.across is None or self.ratio is None:
            return vectors
        part = np.sum(vectors * self.across, axis=1) * (self.ratio**power - 1)
        return np.asarray(vectors + part[:, None] * self.across)

    def along(self, vectors: Nodal) -> Nodal:
        """The part of vectors at the points, shape (n, d), that is tangential."""
        return np.asarray(vectors - np.sum(vectors * self.normal, axis=1)[:, None] * self.normal)

    @property
    def traction(self) -> Nodal:
        """Pressure and shear as one vector, stress, shape (n, d)."""
        return np.asarray(self.pressure[:, None] * self.normal + self.shear)

    def traces(self, displacements: Nodal, rigid: Sequence[RigidBodyMotion] = ()) -> tuple[Nodal, Nodal]:
        """(tau_N y, tau_T y) of displacements with ghosts, shape (nodes, d), relative to rigid bodies that have moved;
        the latter as a vector, shape (n, d).
        """
        relative = self._at(displacements)
        for pair, part in self._paired:
            relative[part] = pair.relative(displacements[: self.body.owned])
        for motion in rigid:
            points = self.part(*motion.body.parts)
            relative[points] -= self._at(motion.at(self._x))[points]
        return np.sum(relative * self.normal, axis=1), self.along(relative)

    @property
    def _x(self) -> Nodal:
        """Positions of the nodes with ghosts, length, shape (nodes, d)."""
        return np.asarray(self.body.at_nodes[:, : self.normal.shape[1]])

    def _at(self, nodal_values: Nodal) -> Nodal:
        """Values of nodes with ghosts, shape (nodes, d), at the points of one body, shape (n, d)."""
        return np.concatenate([side.at(nodal_values, self.body) for side in self.sides])

    def pieces(self, of_node: npt.NDArray[np.int64]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """The piece of the body at each point, and that on the other side, -1 where the foundation is rigid, shape
        (n,); ``of_node``: the piece that each owned node is in; collective.
        """
        opposite = np.full(self.nodes.size, -1, dtype=np.int64)
        for pair, part in self._paired:
            opposite[part] = pair.on_other_side(of_node)
        return of_node[self.nodes], opposite

    def part(self, *numbers: int) -> npt.NDArray[np.int64]:
        """The points of some contact boundaries."""
        return np.concatenate([np.arange(self.nodes.size)[self.parts()[number]] for number in numbers])

    def resultant(self, motion: RigidBodyMotion, displacements: Nodal) -> tuple[Nodal, float, float]:
        """What the tractions of its contact boundaries do to a rigid body: force and moment about its pivot, shape
        (m,), the sum of the magnitudes of forces, and how far from the pivot they act; ``displacements``: of nodes with
        ghosts, shape (nodes, d); collective.
        """
        numbers, comm = motion.body.parts, self.body.comm
        part = self.part(*numbers)
        force = self.weight[part, None] * self.traction[part]
        arm = motion.lever(self._at(self._x)[part], self._at(displacements)[part])
        plane = arm.shape[1] == 2
        moment = (arm[:, :1] * force[:, 1:] - arm[:, 1:] * force[:, :1]) if plane else np.cross(arm, force)
        size = np.linalg.norm(force, axis=1).sum()
        total = parallel.global_sum(comm, np.concatenate((force.sum(axis=0), moment.sum(axis=0), [size])))
        reach = parallel.largest(comm, np.linalg.norm(arm, axis=1))
        return total[:-1], float(total[-1]), reach

    def terms(self, owned: Nodal) -> Nodal:
        """The sums of the magnitudes of what relative displacements of two bodies are added up of, 0 at points on a
        rigid foundation, length, shape (n,), from displacements of shape (owned nodes, d).
        """
        magnitudes = np.zeros(self.nodes.size)
        for pair, part in self._paired:
            magnitudes[part] = np.linalg.norm(pair.terms(owned), axis=1)
        return magnitudes

    def forces(self) -> tuple[npt.NDArray[np.int64], Nodal, Nodal]:
        """What the tractions do to the body: the local nodes that they act on, shape (m,), the forces on them, shape
        (m, d), and the area that a node stands for, shape (m,); a node of two boundaries is there twice.
        """
        of_sides = zip(self.sides, self.parts(), strict=True)
        groups = [side.forces(self.traction[part], self.body) for side, part in of_sides]
        nodes, forces, area = (np.concatenate(column) for column in zip(*groups, strict=True))
        return nodes, forces, area

    def felt(self, supports: PrescribedNodes) -> Nodal:
        """The larger of pressure and shear without what supports take of them, stress, shape (n,).

        What supports alone take is not a scale for other nodes.  Neither is a part of the one that the other undoes.
        """
        tractions = self.pressure[:, None] * self.normal, self.shear
        *alone, combined = (
            np.linalg.norm(self._movable(part, supports), axis=1) for part in (*tractions, np.add(*tractions))
        )
        return np.minimum(np.maximum(*alone), combined)

    def immovable(
        self, supports: PrescribedNodes, displacements: Nodal, rigid: Sequence[tuple[RigidBodyMotion, Drive]] = ()
    ) -> npt.NDArray[np.bool_]:
        """Points that cannot move along their normal, because what is free at them, and at the rigid body that they
        touch, is across it; ``displacements``: of nodes with ghosts, shape (nodes, d); ``rigid``: see ``judged``.
        """
        movable = np.max(np.abs(self._movable(self.normal, supports)), axis=1, initial=0.0) > ROOT_OF_EPS
        for motion, (_, prescribed) in rigid:
            points = self.part(*motion.body.parts)
            for component in np.flatnonzero(np.isnan(prescribed)):
                moves = self._at(motion.mode(int(component), self._x, displacements))[points]
                along = np.abs(np.sum(moves * self.normal[points], axis=1))
                movable[points] |= along > ROOT_OF_EPS * np.linalg.norm(moves, axis=1)
        return ~movable

    def _movable(self, vectors: Nodal, supports: PrescribedNodes) -> Nodal:
        of_sides = zip(self.sides, self.parts(), strict=True)
        return np.concatenate([side.movable(vectors[part], supports, self.body) for side, part in of_sides])

    def coupling_error(self) -> float:
        """The largest error of the maps of pairs of bodies."""
        return max((pair.error() for pair, _ in self._paired), default=0.0)

    @property
    def shear_across(self) -> Nodal:
        """The shear across planes of symmetry, of which there is none, stress, shape (n, d)."""
        across = np.zeros_like(self.shear)
        for pair, part in self._paired:
            across[part] = np.einsum("nij,nj->ni", pair.across, self.shear[part])
        return across

    @cached_property
    def _paired(self) -> list[tuple[PairPoints, slice]]:
        """The pairs of bodies, and which points are theirs."""
        of_sides = zip(self.sides, self.parts(), strict=True)
        return [(side.pair, part) for side, part in of_sides if side.pair is not None]

    def parts(self) -> list[slice]:
        """Which rows each part of the boundary has, one after the other."""
        ends = np.cumsum([0, *(len(side.nodes) for side in self.sides)])
        return [slice(int(a), int(b)) for a, b in pairwise(ends)]
