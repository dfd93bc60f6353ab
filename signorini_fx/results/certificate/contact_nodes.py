"""The contact points as the certificate sees them: from the scene and the mesh, with the tractions that are claimed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from signorini_fx.machine import parallel
from signorini_fx.mechanics.rigid.rigid_bodies import Drive, RigidBodyMotion
from signorini_fx.results.certificate.law_of_method import Tractions
from signorini_fx.results.certificate.supports import PrescribedNodes
from signorini_fx.results.certificate.surface_quadrature import SurfaceQuadrature
from signorini_fx.tuned import SAME_DIRECTION, ZERO_SUM

if TYPE_CHECKING:
    from signorini_fx.results.certificate.pair_points import PairPoints

Nodal = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ContactSide:
    """What a problem says of one part of its boundary; values are those at local numbers of nodes, ghosts included.

    Attributes:
        boundary: the part, see ``SurfaceQuadrature.facets``.
        gap: nodes -> d, length, shape (n,).
        bound: (nodes, pressure at them) -> F g, stress, shape (n,).
        bilateral: whether contact cannot open.
        direction: nodes -> the direction of contact, of length one, shape (n, d); None: the outward normal.
        factor: of the measure, see ``SurfaceQuadrature.moments``.
        pair: the points of a pair; None: the foundation is rigid.
        by_geometry: whether the distance of both sides of a pair along the normal is added to the gap.
        adjust: the distance of both sides, length, that is taken for none, and all below it; None: there is none.
        directions: nodes -> the vector along which friction is that of ``bound``, shape (n, d), and the ratio of that
            across it, shape (n,); None: friction has no direction.
    """

    boundary: Any
    gap: Callable[[npt.NDArray[np.integer[Any]]], Nodal]
    bound: Callable[[npt.NDArray[np.integer[Any]], Nodal], Nodal]
    bilateral: bool
    direction: Callable[[npt.NDArray[np.integer[Any]]], Nodal] | None = None
    factor: Nodal | None = None
    pair: PairPoints | None = None
    by_geometry: bool = False
    directions: Callable[[npt.NDArray[np.integer[Any]]], tuple[Nodal, Nodal]] | None = None
    adjust: float | None = None


@dataclass(frozen=True)
class ContactNodes:
    """The contact points of this rank with the tractions at them; where they average, all methods are collective.

    Attributes:
        evaluation: weights and forces by quadrature.
        nodes: local number of the node at the point.
        weight: area (in 2D: length) that the point stands for.
        normal: outward unit normal, or the direction that the scene gives.
        gap: d, length.
        bound: F g of the friction law at the pressure at hand, stress.
        bilateral: whether contact cannot open.
        pressure: lambda.
        shear: mu, shape (n, d).
        spread: of each contact boundary, how its test functions meet the shape functions, ``NodalForces.products``,
            None for a pair; None where points do not average.
        counts: number of points of each contact boundary.
        pairs: of bodies, by the numbers of their contact boundaries, see ``ContactSide``.
        across: e, the unit vector across which friction has a ratio to that along, shape (n, d); None: it has none.
        ratio: r, of the friction along e, shape (n,).
    """

    evaluation: SurfaceQuadrature
    nodes: npt.NDArray[np.int64]
    weight: Nodal
    normal: Nodal
    gap: Nodal
    bound: Nodal
    bilateral: npt.NDArray[np.bool_]
    pressure: Nodal
    shear: Nodal
    spread: list[Any] | None
    counts: list[int]
    pairs: Mapping[int, PairPoints] = field(default_factory=dict)
    across: Nodal | None = None
    ratio: Nodal | None = None

    @classmethod
    def of(cls, forces: SurfaceQuadrature, sides: Sequence[ContactSide], tractions: Tractions) -> ContactNodes:
        """The contact points of a problem; collective.

        Args:
            forces: weights and forces of its space.
            sides: the parts of its boundary with contact.
            tractions: what is claimed.

        Raises:
            ValueError: the tractions are not those of the contact points of the problem.
        """
        columns: list[tuple[Any, ...]] = []
        spread: list[Any] = []
        unmatched = False
        for part, side in enumerate(sides):
            moment = forces.moments(side.boundary, side.factor)
            weight = np.linalg.norm(moment, axis=1)
            outward = moment / np.maximum(weight, 1e-300)[:, None]
            if side.pair is not None:
                weight = np.zeros_like(weight)
                weight[side.pair.points] = side.pair.weight
            if forces.averaging:
                spread.append(None if side.pair is not None else forces.products(side.boundary, side.factor))
                weight = weight if spread[-1] is None else _sums(forces, spread[-1].sum(axis=1))
            least = 0.0
            if side.factor is not None:  # which may be zero at a node: on the axis of a body of revolution
                least = ZERO_SUM * parallel.largest(forces.space.mesh.comm, weight)
            nodes = np.flatnonzero(weight > least)
            normal = outward[nodes] if side.direction is None else side.direction(nodes)
            if side.factor is not None and side.direction is None and side.pair is None:
                of_measure = np.nan_to_num(side.factor)
                tips = of_measure[nodes] <= ZERO_SUM * parallel.largest(forces.space.mesh.comm, of_measure)
                tips &= np.linalg.norm(normal[:, 1:], axis=1) > SAME_DIRECTION
                # On the axis of a body of revolution x[0] is the radius: all around, the mean is along the axis.
                normal[tips, 0] = 0.0
                normal[tips] /= np.linalg.norm(normal[tips], axis=1, keepdims=True)
            rows = np.flatnonzero(np.asarray(tractions.part) == part)
            rows = rows[np.argsort(np.asarray(tractions.nodes)[rows], kind="stable")]
            unmatched |= not np.array_equal(np.asarray(tractions.nodes)[rows], nodes)
            pressure, shear = (
                (values[rows] if not unmatched else np.zeros((nodes.size, *values.shape[1:])))
                for values in (tractions.pressure, tractions.shear)
            )
            if side.pair is None and spread:
                gap = _averaged(forces, spread[-1], side.gap)[nodes] / weight[nodes]
            else:
                gap = side.gap(nodes)
            bound, bilateral = side.bound(nodes, pressure), np.full(nodes.size, side.bilateral)
            if side.pair is not None:
                normal, bound = side.pair.normal, np.where(side.pair.facing, bound, 0.0)
                if side.by_geometry:
                    gap = gap + side.pair.gap(side.adjust)
            columns.append((nodes, weight[nodes], normal, gap, bound, bilateral, pressure, shear))
        if parallel.any_rank(forces.space.mesh.comm, unmatched):
            raise ValueError("the tractions are not those of the contact nodes of the scene")
        counts = [len(column[0]) for column in columns]
        nodes, *remaining = (np.concatenate(column) for column in zip(*columns, strict=True))
        weight, normal, gap, bound, bilateral, pressure, shear = remaining
        held = spread or None
        pairs = {number: side.pair for number, side in enumerate(sides) if side.pair is not None}
        contact_nodes = cls(forces, nodes, weight, normal, gap, bound, bilateral, pressure, shear, held, counts, pairs)
        if all(side.directions is None for side in sides):
            return contact_nodes
        across, ratio = np.zeros_like(normal), np.ones(nodes.size)
        for side, points in zip(sides, contact_nodes.parts(), strict=True):
            if side.directions is not None:
                along, ratio[points] = side.directions(nodes[points])
                across[points] = np.cross(normal[points], along)
                across[points] /= np.linalg.norm(across[points], axis=1, keepdims=True)
        return replace(contact_nodes, across=across, ratio=ratio)

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
            relative[part] = pair.relative(displacements[: self.evaluation.owned])
        for motion in rigid:
            points = self.part(*motion.body.parts)
            relative[points] -= self._at(motion.at(self._x))[points]
        return np.sum(relative * self.normal, axis=1), self.along(relative)

    @property
    def _x(self) -> Nodal:
        """Positions of the nodes with ghosts, length, shape (nodes, d)."""
        return np.asarray(self.evaluation.at_nodes[:, : self.normal.shape[1]])

    def _at(self, nodal_values: Nodal) -> Nodal:
        """Values of nodes with ghosts, shape (nodes, d), at the points of one body, shape (n, d)."""
        if self.spread is None:
            return np.array(nodal_values[self.nodes])
        sums = [
            nodal_values if products is None else self.evaluation.over_ranks(products @ nodal_values)
            for products in self.spread
        ]
        return np.asarray(self._at_points(sums) / self.weight[:, None])

    def pieces(self, of_node: npt.NDArray[np.int64]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """The piece of the body at each point, and that on the other side, -1 where the foundation is rigid, shape
        (n,); collective.

        Args:
            of_node: the piece that each owned node is in.
        """
        opposite = np.full(self.nodes.size, -1, dtype=np.int64)
        for pair, part in self._paired:
            opposite[part] = pair.on_other_side(of_node)
        return of_node[self.nodes], opposite

    def part(self, *numbers: int) -> npt.NDArray[np.int64]:
        """The points of some contact boundaries."""
        return np.concatenate([np.arange(self.nodes.size)[self.parts()[number]] for number in numbers])

    @property
    def area(self) -> float:
        """Of all contact boundaries; collective."""
        return float(parallel.global_sum(self.evaluation.space.mesh.comm, np.array(self.weight.sum())))

    def resultant(self, motion: RigidBodyMotion, displacements: Nodal) -> tuple[Nodal, float, float]:
        """What the tractions of its contact boundaries do to a rigid body: force and moment about its pivot, shape
        (m,), the sum of the magnitudes of forces, and how far from the pivot they act; collective.

        Args:
            motion: of the rigid body.
            displacements: of nodes with ghosts, shape (nodes, d).
        """
        numbers, comm = motion.body.parts, self.evaluation.space.mesh.comm
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
        traction = self.traction
        groups = [pair.forces(traction[part], self.evaluation.owned) for pair, part in self._paired]
        if self.spread is None:
            alone = self._of_one_body()
            groups.append((self.nodes[alone], (self.weight[:, None] * traction)[alone], self.weight[alone]))
        for products, points in zip(self.spread or [], self.parts() if self.spread else [], strict=True):
            if products is None:
                continue
            at_nodes = np.zeros((self.evaluation.owned, traction.shape[1]))
            at_nodes[self.nodes[points]] = traction[points]
            force = self.evaluation.over_ranks(products.T @ self.evaluation.with_ghosts(at_nodes))
            area = _sums(self.evaluation, abs(products).sum(axis=0))
            reached = np.flatnonzero(area > 0)
            groups.append((reached, force[reached], area[reached]))
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
        touch, is across it.

        Args:
            supports: what is prescribed.
            displacements: of nodes with ghosts, shape (nodes, d).
            rigid: how rigid bodies have moved, and what drives them.
        """
        movable = np.max(np.abs(self._movable(self.normal, supports)), axis=1, initial=0.0) > SAME_DIRECTION
        for motion, (_, prescribed) in rigid:
            points = self.part(*motion.body.parts)
            for component in np.flatnonzero(np.isnan(prescribed)):
                moves = self._at(motion.mode(int(component), self._x, displacements))[points]
                along = np.abs(np.sum(moves * self.normal[points], axis=1))
                movable[points] |= along > SAME_DIRECTION * np.linalg.norm(moves, axis=1)
        return ~movable

    def _movable(self, vectors: Nodal, supports: PrescribedNodes) -> Nodal:
        """The part of vectors at the points that is along directions in which something can move, shape (n, d)."""
        movable = (
            supports.left(vectors, self.nodes) if self.spread is None else vectors * self._any_of(supports.movable())
        )
        for pair, part in self._paired:
            movable[part] = vectors[part] * pair.moved(supports.movable())
        return movable

    def coupling_error(self) -> float:
        """The largest error of the maps of pairs of bodies."""
        return max((pair.error() for pair in self.pairs.values()), default=0.0)

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
        parts = self.parts()
        return [(pair, parts[number]) for number, pair in self.pairs.items()]

    def _of_one_body(self) -> npt.NDArray[np.bool_]:
        """The points on a rigid foundation, shape (n,)."""
        on_rigid = np.ones(self.nodes.size, dtype=bool)
        for _, part in self._paired:
            on_rigid[part] = False
        return on_rigid

    def _any_of(self, flags: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Whether a node that a point averages over has a flag, shape (n, d)."""
        if self.spread is None:
            return flags[self.nodes]
        nodal_flags = self.evaluation.with_ghosts(flags.astype(np.float64))
        shares = [
            nodal_flags if products is None else self.evaluation.over_ranks(abs(products) @ nodal_flags)
            for products in self.spread
        ]
        share = self._at_points(shares)
        return np.asarray(share > ZERO_SUM * self.weight[:, None])

    def _at_points(self, of_parts: list[Nodal]) -> Nodal:
        """What each contact boundary has at its own points."""
        return np.concatenate(
            [values[self.nodes[points]] for values, points in zip(of_parts, self.parts(), strict=True)]
        )

    def parts(self) -> list[slice]:
        """Which rows each part of the boundary has, one after the other."""
        ends = np.cumsum([0, *self.counts])
        return [slice(int(a), int(b)) for a, b in pairwise(ends)]


def _sums(forces: SurfaceQuadrature, values: Any) -> Nodal:
    """One number per node of this rank and its ghosts, summed over the ranks, shape (owned nodes,)."""
    return forces.over_ranks(np.repeat(np.ravel(values)[:, None], forces.dimension, axis=1))[:, 0]


def _averaged(forces: SurfaceQuadrature, products: Any, gap: Callable[[npt.NDArray[Any]], Nodal]) -> Nodal:
    """The gap times the test functions, shape (owned nodes,)."""
    values = np.zeros(products.shape[0])
    reached = np.unique(products.indices)
    values[reached] = gap(reached)
    return _sums(forces, products @ values)
