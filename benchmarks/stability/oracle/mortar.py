"""The contact points between two bodies: integrals over the part of both sides that lies over each
other.

The discretisation is the package's, as its guide and docstrings define it; nothing of how it is
computed is the same. In 2D the ends of facets are found as roots of polynomials; in 3D the corners
of what two polygons share are those of each within the other, and the points where their sides
cross.  Facets are taken one by one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product

import numpy as np
from scipy.sparse import csr_array, lil_array
from scipy.spatial.distance import cdist

from benchmarks.stability.oracle import elements
from benchmarks.stability.oracle.body import Body, across, listed
from benchmarks.stability.oracle.conditions import Contact, Points, contact_of, points_of
from benchmarks.stability.oracle.elements import Array, Ints, at_points
from benchmarks.stability.oracle.symmetry import across_planes

# What belongs to the discretisation: normals of facets that face each other have at most this
# product; beyond the least distance of both sides partners are within this share of the smaller
# side; a function that keeps less than this share of its weight carries no point; of a node that is
# held so much along the normal neither does it, if more than half of it is over nodes of the other
# side that are held, too; where whole facets of both are held there is no contact.
_FACING, _REACH, _KEPT, _HELD, _MOSTLY = -0.2, 0.2, 0.03, 1e-8, 0.5
# Points along a line: of integrands that are rational, and of polynomials.
_MANY, _FEW = 14, 7
# Shares of a facet that are round-off, and of the largest singular value of one that does not
# count.
_NOTHING, _SINGULAR = 1e-10, 1e-10


@dataclass(frozen=True)
class Piece:
    """A piece of the overlap of two facets: places on both, and the area of the slave that each
    stands for.
    """

    master: int
    at: Array
    over: Array
    weight: Array


class Side:
    """The facets of a boundary.

    Attributes:
        nodes: of the displacement, shape (facets, k).
        x: places of all nodes of the body, shape (nodes, d).
        sign: +1 where the outward normal is that of the order of nodes, else -1, shape (facets,).
        undeformed: places of which areas are, where the nodes have moved to ``x``, likewise.
    """

    def __init__(self, nodes: Ints, x: Array, sign: Array, undeformed: Array | None = None) -> None:
        self.nodes, self.x, self.sign = nodes, x, sign
        self.undeformed = x if undeformed is None else undeformed
        self.flat = x.shape[1] == 2
        self.mirrors = np.zeros((*self.x.shape, self.x.shape[1]))
        self.rays: Array | None = (
            None  # at the nodes, along which both sides are projected, where not normals
        )

    @classmethod
    def of(cls, body: Body, name: str) -> Side:
        """A boundary of a body that has a name."""
        facets = body.facets(name)
        outward, middle = body.middle_frames(facets), np.full((1, body.dim - 1), 0.3)
        found = cls(facets.nodes, body.x, np.ones(len(facets.nodes)))
        for facet in range(len(facets.nodes)):
            found.sign[facet] = np.sign(found.across(facet, middle)[0] @ outward[facet])
        return found

    def mirrored(self, body: Body, master: Side) -> Side:
        """The same with the normals of its mirror images beyond planes of symmetry, too."""
        self.mirrors = across_planes(body, self.normals, self.nodes[:, : self.width], master.nodes)
        del self.normals
        return self

    @property
    def width(self) -> int:
        """How many nodes of a facet have test functions: on quadratic triangles the vertices."""
        return 3 if not self.flat and self.nodes.shape[1] == 6 else self.nodes.shape[1]

    def shape(self, xi: Array) -> tuple[Array, Array]:
        """Shape functions, shape (points, k), and their slopes, shape (points, k, d - 1)."""
        return elements.shape(self.x.shape[1] - 1, self.nodes.shape[1], xi)

    def tests(self, xi: Array) -> Array:
        """The functions that those of the points are dual to."""
        return (
            elements.shape(2, 3, xi)[0] if self.width == 3 and not self.flat else self.shape(xi)[0]
        )

    def place(self, facet: int, xi: Array) -> Array:
        """Positions, shape (points, d)."""
        return np.asarray(self.shape(xi)[0] @ self.x[self.nodes[facet]])

    def along(self, facet: int, xi: Array) -> Array:
        """Derivatives of the place, shape (points, d, d - 1)."""
        return np.einsum("pkj,ki->pij", self.shape(xi)[1], self.x[self.nodes[facet]])

    def across(self, facet: int, xi: Array) -> Array:
        """Outward normals times the area of a unit of the reference facet."""
        return np.asarray(self.sign[facet] * across(self.along(facet, xi)))

    def area(self, facet: int, xi: Array) -> Array:
        """The undeformed area of a unit of the reference facet, shape (points,)."""
        return np.linalg.norm(
            Side(self.nodes, self.undeformed, self.sign).across(facet, xi), axis=1
        )

    @cached_property
    def rule(self) -> tuple[Array, Array]:
        """A rule on a whole facet."""
        if self.flat:
            return elements.cube(1, _MANY)
        return (
            elements.simplex(2, _FEW) if self.nodes.shape[1] in (3, 6) else elements.cube(2, _FEW)
        )

    @cached_property
    def moments(self) -> tuple[Array, Array]:
        """Integrals of each node's test function, and of it times the normal."""
        xi, weights = self.rule
        area, normal = np.zeros(len(self.x)), np.zeros(self.x.shape)
        for facet, nodes in enumerate(self.nodes):
            tested, across = self.tests(xi) * weights[:, None], self.across(facet, xi)
            np.add.at(area, nodes[: self.width], tested.T @ self.area(facet, xi))
            np.add.at(normal, nodes[: self.width], tested.T @ across)
        return area, normal

    @cached_property
    def normals(self) -> Array:
        """Of length one at the nodes with test functions, zero at others."""
        moment = self.moments[1] - np.einsum("nij,nj->ni", self.mirrors, self.moments[1])
        size = np.linalg.norm(moment, axis=1, keepdims=True)
        return np.asarray(np.divide(moment, size, out=np.zeros_like(self.x), where=size > 0))

    @cached_property
    def directions(self) -> Array:
        """The same, and between the vertices of quadratic triangles the means of those at both."""
        found = self.normals.copy()
        if self.width < self.nodes.shape[1]:
            for nodes in self.nodes:
                for node, at in zip(nodes[3:], elements.reference_nodes(2, 6)[3:], strict=True):
                    mean = elements.shape(2, 3, at[None])[0][0] @ self.normals[nodes[:3]]
                    found[node] = mean / np.linalg.norm(mean)
        return found

    @property
    def used(self) -> Ints:
        """All nodes on it."""
        return np.unique(self.nodes)

    @cached_property
    def parts(self) -> list[Array]:
        """Corners of the linear parts of a reference facet, in order around."""
        square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
        corner = square[[0, 1, 3]]
        whole = corner if self.nodes.shape[1] in (3, 6) else square
        if self.nodes.shape[1] in (3, 4):
            return [whole]
        halves = [whole / 2 + shift for shift in whole / 2]
        return halves if len(whole) == 4 else [*halves, (1 - corner) / 2]


def contacts_of(body: Body) -> Contact:
    """The points of all contacts of a scene, between bodies and on foundations."""
    return contact_of(body, _points)


def _points(body: Body, part: int) -> Points:
    """Those of one contact."""
    effect = listed(body.scene, "contact")[part]
    if "against" not in effect:
        return points_of(body, part)
    master = Side.of(body, effect["against"])
    slave = Side.of(body, effect["boundary"])
    mirrored = slave.mirrored(body, master)
    master = Side.of(body, effect["against"]).mirrored(body, Side.of(body, effect["boundary"]))
    slave = mirrored
    bonded = effect.get("kind") == "bonded"
    between = not bonded and effect.get("distance", "geometry") == "geometry"
    if between:
        slave.rays = _half_way(body, slave, master, part)
    still = (
        ()
        if bonded
        else tuple(_held(body, side)[side.nodes].all(axis=1) for side in (slave, master))
    )
    there, weight, distance, _, own, others, arms = _integrals(
        slave, master, bonded=bonded, still=still
    )
    dimension = body.x.shape[1]
    shares = _carried(body, slave, master, part, there, weight, others)
    nodes = np.flatnonzero(shares.sum(axis=1) > 0)
    shares = csr_array(shares[nodes])
    weight = shares @ weight
    distance = (shares @ distance) / weight[:, None]
    own, others = ((shares @ matrix).toarray() / weight[:, None] for matrix in (own, others))
    operator = np.einsum("nm,ij->nimj", own - others, np.eye(dimension))
    # Half-way between both, or where sides are nominally in contact the rotation of the master.
    for part_of_way, matrix in zip((0.5, 0.5) if between else (0.0, 1.0), arms, strict=True):
        operator += _turning((shares @ matrix).toarray(), body.x, part_of_way * distance)
    # Across a plane of symmetry nothing moves relative to the mirror image.
    operator -= np.einsum("nij,njmk->nimk", slave.mirrors[nodes], operator)
    normals = slave.normals[nodes]
    if between:
        normals = _unit(own @ slave.directions - others @ master.directions, slave.mirrors[nodes])
    gap = at_points(effect.get("gap", 0.0), body.x[nodes])
    if bonded:
        gap = np.zeros(len(nodes))
    elif between:
        gap = gap + (normals * distance).sum(axis=1)
    matrix = csr_array(operator.reshape(dimension * len(nodes), -1))
    return Points(body.x[nodes], matrix, weight, normals, gap)


@dataclass(frozen=True)
class MovedPoints:
    """The points of sides that slide on each other, by the nodes of the slave: their weights, gaps
    along rays, normals, and the shares of nodes of both sides, D and M.
    """

    nodes: Ints
    weight: Array
    gap: Array
    normal: Array
    own: Array
    others: Array


def points_of_moved(slave: Side, master: Side) -> MovedPoints:
    """Those of sides that have moved, where the slave is wholly over the master, so that no point
    takes over functions: rays are half-way between both sides as they have moved, and areas are
    undeformed.
    """
    for _ in range(2):
        _, weight, _, gap, own, others, _ = _integrals(slave, master, bonded=False)
        nodes = np.flatnonzero(weight > 0)
        shares = [matrix.toarray()[nodes] / weight[nodes, None] for matrix in (own, others)]
        normal = _unit(
            shares[0] @ slave.directions - shares[1] @ master.directions, slave.mirrors[nodes]
        )
        slave.rays = np.zeros_like(slave.x)
        slave.rays[nodes] = normal
    return MovedPoints(nodes, weight[nodes], gap[nodes] / weight[nodes], normal, *shares)


def _unit(vectors: Array, mirrors: Array) -> Array:
    """Of length one, without what they have across planes of symmetry."""
    found = vectors - np.einsum("nij,nj->ni", mirrors, vectors)
    return np.asarray(found / np.maximum(np.linalg.norm(found, axis=1, keepdims=True), 1e-300))


def _half_way(body: Body, slave: Side, master: Side, part: int) -> Array:
    """Normals half-way between both sides at the nodes of the slave, from a projection along its
    own.
    """
    there, weight, _, _, own, others, _ = _integrals(slave, master, bonded=False)
    shares = _carried(body, slave, master, part, there, weight, others, free=True)
    nodes = np.flatnonzero(shares.sum(axis=1) > 0)
    shares = csr_array(shares[nodes])
    whole = (shares @ weight)[:, None]
    seen = (shares @ others) @ master.directions / whole
    beside: dict[int, set[int]] = {}
    for tested in slave.nodes[:, : slave.width].tolist():
        for node in tested:
            beside.setdefault(node, set()).update(tested)
    spread = csr_array(_ring_by_ring(beside, set(nodes.tolist()), len(weight))[nodes])
    found = slave.normals - spread.T @ seen
    found[nodes] = (shares @ own) @ slave.directions / whole - seen
    return _unit(found, slave.mirrors)


def _integrals(
    slave: Side, master: Side, *, bonded: bool, still: tuple[Array, ...] = ()
) -> tuple[list[int], Array, Array, Array, csr_array, csr_array, list[csr_array]]:
    """Covered facets; by the nodes of the slave weights, and these times distances, as vectors and
    along the rays, and times shares of both sides; and the areas in which nodes of both are seen;
    ``still``: facets of both that are held, which over each other count not.
    """
    pieces = [
        (facet, piece)
        for facet, piece in _pieces(slave, master)
        if not (still and still[0][facet] and still[1][piece.master])
    ]
    size = len(slave.x)
    weight, distance, along = np.zeros(size), np.zeros(slave.x.shape), np.zeros(size)
    own, others, beside, arms = (lil_array((size, size)) for _ in range(4))
    there = sorted({facet for facet, _ in pieces})
    for facet in there:
        here = [piece for number, piece in pieces if number == facet]
        tests = [slave.tests(piece.at) for piece in here]
        dual = np.eye(slave.width)
        if not (bonded and slave.width < slave.nodes.shape[1]):
            mass = sum(
                t.T @ (piece.weight[:, None] * t) for t, piece in zip(tests, here, strict=True)
            )
            dual = np.diag(mass.sum(axis=1)) @ np.linalg.pinv(mass, rcond=_SINGULAR)
        nodes = slave.nodes[facet]
        for t, piece in zip(tests, here, strict=True):
            weighted = (t @ dual.T) * piece.weight[:, None]
            seen = master.nodes[piece.master]
            apart = master.place(piece.master, piece.over) - slave.place(facet, piece.at)
            gap = np.copysign(
                np.linalg.norm(apart, axis=1), (apart * slave.across(facet, piece.at)).sum(axis=1)
            )
            for k, node in enumerate(nodes[: slave.width]):
                weight[node] += weighted[:, k].sum()
                distance[node] += weighted[:, k] @ apart
                along[node] += weighted[:, k] @ gap
                own[node, nodes] += weighted[:, k] @ slave.shape(piece.at)[0]
                others[node, seen] += weighted[:, k] @ master.shape(piece.over)[0]
                arms[node, seen] += piece.weight.sum() * np.ones(len(seen))
                beside[node, nodes] += piece.weight.sum() * np.ones(len(nodes))
    return (
        there,
        weight,
        distance,
        along,
        own.tocsr(),
        others.tocsr(),
        [beside.tocsr(), arms.tocsr()],
    )


def _carried(
    body: Body,
    slave: Side,
    master: Side,
    part: int,
    there: list[int],
    weight: Array,
    met: csr_array,
    *,
    free: bool = False,
) -> csr_array:
    """How points take over the functions of nodes that carry none: a row for each node; ``met``:
    the integrals of these times the functions of the master; ``free``: as if nothing were held, and
    there were no other contact.
    """
    effects = listed(body.scene, "contact")
    taken = set(master.nodes.ravel().tolist())
    for number, effect in enumerate(effects):
        if number != part and (number < part or "against" not in effect):
            taken |= set(Side.of(body, effect["boundary"]).nodes.ravel().tolist())
    covered = [slave.nodes[facet, : slave.width].tolist() for facet in there]
    beside: dict[int, set[int]] = {}
    for nodes in covered:
        for node in nodes:
            beside.setdefault(node, set()).update(nodes)
    area = slave.moments[0]
    over_held = met @ (_held(body, master) * 1.0) > _MOSTLY * (met @ np.ones(len(body.x)))
    moves = ~(_held(body, slave) & over_held)

    def able(node: int, least: float) -> bool:
        return bool(
            weight[node] > least * area[node] and (free or (moves[node] and node not in taken))
        )

    for least in (_KEPT, 0.0):
        carry = {node for node in beside if able(node, least)}
        while carry:
            found = _ring_by_ring(beside, carry, len(weight))
            weak = {node for node in carry if (found[[node]] @ weight)[0] <= least * area[node]}
            if not weak:
                return found
            carry -= weak
    raise ValueError("no node can carry a point")


def _held(body: Body, side: Side) -> Array:
    """Which nodes of the body are held along the normals of a side."""
    loose = np.eye(body.x.shape[1]) - body.held
    return np.asarray(
        np.linalg.norm(np.einsum("nij,nj->ni", loose, side.directions), axis=1) <= _HELD
    )


def _ring_by_ring(beside: dict[int, set[int]], carry: set[int], count: int) -> csr_array:
    """Equal shares of the function of each other node for its neighbours that have points or shares
    already.
    """
    found = lil_array((count, count))
    for node in carry:
        found[node, node] = 1.0
    done, left = set(carry), set(beside) - carry
    while left:
        ring = {node: sorted(beside[node] & done) for node in left if beside[node] & done}
        if not ring:
            break
        rows = found.tocsr()
        for node, known in ring.items():
            found[:, [node]] = sum(rows[:, [k]].toarray() for k in known) / len(known)
        done |= set(ring)
        left -= set(ring)
    return csr_array(found.tocsr())


def _turning(arms: Array, x: Array, distance: Array) -> Array:
    """The motion omega x d of each point from displacements of nodes, shape (points, d, nodes,
    d).
    """
    dimension = x.shape[1]
    extended, far = (np.pad(a, ((0, 0), (0, 3 - dimension))) for a in (x, distance))
    found = np.zeros((len(arms), dimension, len(x), dimension))
    for point, a in enumerate(arms):
        seen = np.flatnonzero(a)
        r = extended[seen] - a[seen] @ extended[seen] / a[seen].sum()
        inertia = sum(
            w * (v @ v * np.eye(3) - np.outer(v, v)) for w, v in zip(a[seen], r, strict=True)
        )
        inverse = np.linalg.pinv(inertia, rcond=1e-12)
        if dimension == 2:
            inverse = np.diag([0.0, 0.0, 1 / inertia[2, 2]])
        for node, v in zip(seen, r, strict=True):
            for axis in range(dimension):
                omega = inverse @ (a[node] * np.cross(v, np.eye(3)[axis]))
                found[point, :, node, axis] = np.cross(omega, far[point])[:dimension]
    return found


def _pieces(slave: Side, master: Side) -> list[tuple[int, Piece]]:
    """All pieces of the overlap with the slave facets that they are of."""
    both = [side.undeformed[side.used] for side in (slave, master)]
    sizes = [2 * float(np.linalg.norm(x - x.mean(axis=0), axis=1).max()) for x in both]
    reach = cdist(*both).min() + _REACH * min(sizes)
    found = []
    for facet, other in product(range(len(slave.nodes)), range(len(master.nodes))):
        some = (
            _in_plane(slave, facet, master, other)
            if slave.flat
            else _in_space(slave, facet, master, other)
        )
        for piece in some:
            apart = master.place(other, piece.over) - slave.place(facet, piece.at)
            if np.linalg.norm(apart, axis=1).min() <= reach:
                found.append((facet, piece))
    return found


def _facing(a: Array, b: Array) -> bool:
    return bool(a @ b < _FACING * np.linalg.norm(a) * np.linalg.norm(b))


# ---- the plane


def _roots(values: Array, at: Array, degree: int) -> Array:
    """The real roots of the polynomial of that degree with these values."""
    scale = np.abs(values).max()
    roots = np.roots(np.polyfit(at, values / scale, degree)) if scale > 0 else np.zeros(0)
    return np.asarray(roots[np.abs(roots.imag) < 1e-9].real)


def _in_plane(slave: Side, facet: int, master: Side, other: int) -> Iterator[Piece]:
    """Along the continuous direction of the slave, which interpolates those at the nodes."""
    middle = np.array([[0.5]])
    if not _facing(slave.across(facet, middle)[0], master.across(other, middle)[0]):
        return
    normals = (slave.normals if slave.rays is None else slave.rays)[slave.nodes[facet]]
    degree = slave.nodes.shape[1] - 1
    samples = np.linspace(0.0, 1.0, 2 * degree + 1)

    def ray(s: Array) -> tuple[Array, Array]:
        values, _ = slave.shape(s[:, None])
        return values @ slave.x[slave.nodes[facet]], values @ normals

    def cross(a: Array, b: Array) -> Array:
        return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])

    def met(s: float) -> float:
        """The place on the line of the master that the ray from s meets."""
        (x,), (n,) = ray(np.array([s]))
        at = np.linspace(0.0, 1.0, master.nodes.shape[1])
        roots = _roots(cross(master.place(other, at[:, None]) - x, n), at, len(at) - 1)
        return float(roots[np.abs(roots - 0.5).argmin()]) if roots.size else np.inf

    cuts = {0.0, 1.0}
    x, n = ray(samples)
    for end in master.place(other, np.array([[0.0], [1.0]])):
        cuts |= {float(s) for s in _roots(cross(end - x, n), samples, 2 * degree) if 0 < s < 1}
    places, weights = elements.cube(1, _MANY)
    for low, high in pairwise(sorted(cuts)):
        if high - low > _NOTHING and 0 < met((low + high) / 2) < 1:
            at = low + (high - low) * places
            over = np.array([[met(float(value))] for value in at[:, 0]])
            size = slave.area(facet, at)
            yield Piece(other, at, over, weights * (high - low) * size)


# ---- space


def _in_space(slave: Side, facet: int, master: Side, other: int) -> Iterator[Piece]:
    """In 2D through the middle of each linear part of the slave."""
    for part in slave.parts:
        corners = slave.place(facet, part)
        centre, normal = corners.mean(axis=0), _normal(corners)
        ray = normal
        if slave.rays is not None:
            ray = (
                slave.tests(part.mean(axis=0)[None])[0]
                @ slave.rays[slave.nodes[facet, : slave.width]]
            )
        axes = np.linalg.svd(ray[None] / np.linalg.norm(ray))[2][1:]
        flat = (corners - centre) @ axes.T
        outward = slave.sign[facet] * normal
        for window in master.parts:
            theirs = master.place(other, window)
            if not _facing(outward, master.sign[other] * _normal(theirs)):
                continue
            target = (theirs - centre) @ axes.T
            shared = _common(flat, target)
            if len(shared) < 3 or _area(shared) < _NOTHING * _area(flat):
                continue
            xi, weights = elements.simplex(2, _FEW)
            for a, b in pairwise([*shared[1:], shared[0]]):
                first, second = a - shared[0], b - shared[0]
                size = abs(first[0] * second[1] - first[1] * second[0])
                p = shared[0] + xi[:, :1] * first + xi[:, 1:] * second
                at, projected = _back(flat, part, p)
                over, _ = _back(target, window, p)
                area = slave.area(facet, at)
                if max(slave.nodes.shape[1], master.nodes.shape[1]) > 4:
                    p = (slave.place(facet, at) - centre) @ axes.T
                    for _ in range(20):
                        miss = (master.place(other, over) - centre) @ axes.T - p
                        slopes = np.einsum("ki,pij->pkj", axes, master.along(other, over))
                        over = over - np.linalg.solve(slopes, miss[:, :, None])[:, :, 0]
                yield Piece(other, at, over, size * weights * area / projected)


def _normal(corners: Array) -> Array:
    """Of a part: of a triangle, or across the diagonals."""
    found = np.cross(corners[2] - corners[0], corners[-1] - corners[1])
    return np.asarray(found / np.linalg.norm(found))


def _area(polygon: Array) -> float:
    x, y = polygon.T
    return float(abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)) / 2)


def _common(one: Array, two: Array) -> Array:
    """The corners of what two convex polygons share, in order around."""
    near = 1e-13 * max(float(np.ptp(one)), float(np.ptp(two)))

    def inside(points: Array, polygon: Array) -> Array:
        ends = np.roll(polygon, -1, axis=0)
        sides = (ends - polygon)[None]
        arms = points[:, None] - polygon[None]
        heights = sides[..., 0] * arms[..., 1] - sides[..., 1] * arms[..., 0]
        heights *= np.sign(np.linalg.det(polygon[1:3] - polygon[0]))
        return points[(heights >= -near * np.linalg.norm(sides, axis=2)).all(axis=1)]

    found = [*inside(one, two), *inside(two, one)]
    for (a, b), (c, d) in product(
        *(zip(p, np.roll(p, -1, axis=0), strict=True) for p in (one, two))
    ):
        matrix = np.stack([b - a, c - d], axis=1)
        if abs(np.linalg.det(matrix)) > 1e-12 * np.linalg.norm(b - a) * np.linalg.norm(d - c):
            s, t = np.linalg.solve(matrix, c - a)
            if 0 <= s <= 1 and 0 <= t <= 1:
                found.append(a + s * (b - a))
    if len(found) < 3:
        return np.zeros((0, 2))
    points = np.array(found)
    arms = points - points.mean(axis=0)
    return points[np.argsort(np.arctan2(arms[:, 1], arms[:, 0]))]


def _back(flat: Array, part: Array, p: Array) -> tuple[Array, Array]:
    """Where points of the plane are in the reference facet, and the area in 2D of a unit of it."""
    if len(part) == 3:
        s = np.linalg.solve(
            np.stack([flat[1] - flat[0], flat[2] - flat[0]], axis=1), (p - flat[0]).T
        ).T
        return part[0] + s @ (part[1:] - part[0]), np.full(len(p), _area(flat) / _area(part))
    order = [0, 1, 3, 2]
    s = np.full(p.shape, 0.5)
    for _ in range(30):
        values, slopes = elements.shape(2, 4, s)
        jacobian = np.einsum("pkj,ki->pij", slopes, flat[order])
        s = s - np.linalg.solve(jacobian, (values @ flat[order] - p)[:, :, None])[:, :, 0]
    values, slopes = elements.shape(2, 4, s)
    size, unit = (
        np.abs(np.linalg.det(np.einsum("pkj,ki->pij", slopes, c[order]))) for c in (flat, part)
    )
    return values @ part[order], size / unit
