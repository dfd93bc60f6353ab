"""Contact points at the convex corners of rigid 2D foundations, which may lie between nodes of a
body.

A corner c, rounded by rho, touches the facet of the contact boundary that is closest to it.  With
its foot xi there, (c - x(xi)) . x'(xi) = 0, the outward normal n and the shape functions phi of the
nodes, the contact condition is

    n . sum phi_k(xi) u_k <= n . (c - x(xi)) + gap - rho.

Each corner has two points: on that facet, and, where the body is concave at the nearer vertex, on
the facet behind it, as the outside of a dent is the intersection of two half-planes.  Nodes next to
the foot whose contact direction differs from that of the facet would wrongly meet the side of the
foundation prolonged into the body, so their points are left out.  Points that are left out, and
those of corners without a foot, are marked ``alone``: nothing acts on them.  So the number of
points depends on the number of corners only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from dolfinx import fem

from signorini_fx.arrays import Array, Flags, Indices, Ints, inner
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import Averages, from_owners
from signorini_fx.mechanics.assembly.mesh_entities import (
    facet_cells,
    facet_nodes,
    node_positions,
)
from signorini_fx.mechanics.assembly.nodal_stiffness import JointStiffness
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary, CornerPoints
from signorini_fx.mechanics.statement.rigid_shape import Corners
from signorini_fx.tuned import (
    ALONG_FACET,
    BEYOND_FACET,
    DIGITS_OF_FILES,
    MANY_STEPS,
    PROLONGED_FACET,
    SAME_LENGTH,
    ZERO_COMPONENT,
)


@dataclass(frozen=True)
class BoundaryLine:
    """The m facets of a 2D contact boundary, of all ranks, in order along it with the body on their
    left.

    Attributes:
        nodes: global numbers of the p + 1 nodes of each facet, shape (m, p + 1).
        x: their present positions, length, shape (m, p + 1, 2).
        initial: their positions in the undeformed body, length, shape (m, p + 1, 2).
    """

    nodes: Ints
    x: Array
    initial: Array

    @classmethod
    def of(
        cls, space: fem.FunctionSpace, facets: Indices, displacement: Array | None
    ) -> BoundaryLine:
        """Return the line through the owned facets of all ranks; collective.

        ``displacement``: displacement of the nodes of this rank, ghosts included, length, shape
        (nodes,
            d); None: zero.
        """
        comm = space.mesh.comm
        dim = space.mesh.geometry.dim
        nodes = facet_nodes(space, facets)
        nodes = nodes[:, [0, *range(2, nodes.shape[1]), 1]]
        x = node_positions(space)[:, :2]
        middle = x[space.dofmap.list[facet_cells(space.mesh, facets)]].mean(axis=1)
        along = x[nodes[:, -1]] - x[nodes[:, 0]]
        inwards = middle - x[nodes[:, 0]]
        clockwise = along[:, 0] * inwards[:, 1] < along[:, 1] * inwards[:, 0]
        nodes[clockwise] = nodes[clockwise, ::-1]
        places = x if displacement is None else x + displacement[:, : min(dim, 2)]
        names = space.dofmap.index_map.local_to_global(nodes.ravel()).reshape(nodes.shape)
        every = parallel.gather_rows(comm, names)
        both = np.concatenate((x[nodes], places[nodes]), axis=2).reshape(len(nodes), -1)
        rows = parallel.gather_rows(comm, both).reshape(*every.shape, 4)
        order = _in_order(every, rows[..., :2].reshape(len(every), -1))
        return cls(every[order], rows[order][..., 2:], rows[order][..., :2])

    @property
    def lengths(self) -> Array:
        """The distance between both ends of each facet, length, shape (m,)."""
        return np.linalg.norm(self.x[:, -1] - self.x[:, 0], axis=1)

    def behind(self, facet: int, *, last: bool) -> int | None:
        """Return the facet that follows a facet (``last``) or precedes it; None if there is
        none.
        """
        begins, at = (0, -1) if last else (-1, 0)
        found = np.flatnonzero(self.nodes[:, begins] == self.nodes[facet, at])
        return int(found[0]) if found.size else None

    @property
    def sharp_ends(self) -> Ints:
        """The facets whose last vertex, and those whose first vertex ends the line or is a sharp
        convex one of the body, as rows of facet and end, 0 or -1, shape (k, 2).
        """
        found = list[tuple[int, int]]()
        for facet in range(len(self.nodes)):
            for last in (True, False):
                other = self.behind(facet, last=last)
                if other is not None:
                    pair = (facet, other) if last else (other, facet)
                    one, two = (self.normal(f, 1.0 - k) for k, f in enumerate(pair))
                    convex = one[0] * two[1] > one[1] * two[0]
                    if not convex or one @ two >= BEYOND_FACET:
                        continue
                found.append((facet, -int(last)))
        return np.array(found, dtype=np.int64).reshape(-1, 2)

    def place(self, facet: int, xi: float) -> tuple[Array, Array, Array]:
        """Return the shape functions at a coordinate along a facet, 0 to 1, shape (p + 1,), the
        position there, and its derivative, length, shape (2,).
        """
        phi, slope, _ = _functions(self.nodes.shape[1] - 1, xi)
        return phi, phi @ self.x[facet], slope @ self.x[facet]

    def normal(self, facet: int, xi: float) -> Array:
        """Return the outward unit normal at a coordinate along a facet, shape (2,)."""
        _, _, along = self.place(facet, xi)
        return np.array([along[1], -along[0]]) / np.linalg.norm(along)

    def foot(self, facet: int, c: Array, xi: float) -> float:
        """Return the coordinate of the orthogonal projection of c onto a facet, or onto its tangent
        beyond the ends, by Newton's method.

        ``xi``: initial guess.
        """
        for _ in range(MANY_STEPS):
            _, _, bend = _functions(self.nodes.shape[1] - 1, xi)
            _, at, along = self.place(facet, xi)
            curved = along @ along - (c - at) @ (bend @ self.x[facet])
            step = (c - at) @ along / (curved if curved > 0 else along @ along)
            xi += float(np.clip(step, -1.0, 1.0))
            if abs(step) <= ZERO_COMPONENT:
                break
        return xi

    def nearest(self, c: Array) -> tuple[int, float]:
        """Return the facet closest to c, the first one if several are, and an approximate
        coordinate of the closest point on it.
        """
        begin = self.x[:, :-1]
        along = np.diff(self.x, axis=1)
        share = np.einsum("mpd,mpd->mp", c - begin, along) / np.einsum("mpd,mpd->mp", along, along)
        share = np.clip(share, 0.0, 1.0)
        distance = np.linalg.norm(begin + share[..., None] * along - c, axis=2)
        tied = distance.min(axis=1) <= distance.min() + SAME_LENGTH * self.lengths
        facet = int(np.flatnonzero(tied)[0])
        piece = int(distance[facet].argmin())
        return facet, (piece + float(share[facet, piece])) / share.shape[1]


@dataclass(frozen=True)
class CornerFeet:
    """Feet of the k corners of a foundation, with two points each.

    Attributes:
        facet: the facet of the line on which each point is, shape (k, 2).
        xi: the coordinate along this facet, shape (k, 2).
        alone: whether nothing acts on the point, shape (k, 2).
        beside: global numbers of the nodes of the facets with feet.
        on: global numbers of the nodes that coincide with a foot.
        first: which of the two points of each corner, 0 or 1, is on the closest facet; -1: the
            corner has no foot, shape (k,).
    """

    facet: Ints
    xi: Array
    alone: Flags
    beside: Ints
    on: Ints
    first: Ints

    @classmethod
    def of(cls, line: BoundaryLine, corners: Corners) -> CornerFeet:
        """Return the feet of the corners on a line."""
        count = len(corners.places)
        facets = np.zeros((count, 2), dtype=np.int64)
        xis = np.full((count, 2), 0.5)
        alone = np.ones((count, 2), dtype=bool)
        nearest = np.full(count, -1)
        beside = list[int]()
        on = []
        for k in range(count):
            c = corners.places[k]
            facet, near = line.nearest(c)
            xi = line.foot(facet, c, near)
            last = xi > 0.5
            other = line.behind(facet, last=last)
            turn = cosine = 0.0
            if other is not None:
                one = line.normal(facet, float(last))
                two = line.normal(other, float(not last))
                turn = (one[0] * two[1] - one[1] * two[0]) * (1.0 if last else -1.0)
                cosine = float(one @ two)
            within = -SAME_LENGTH <= xi <= 1.0 + SAME_LENGTH
            if not within and (other is None or cosine < BEYOND_FACET):
                continue  # c is beside the boundary, or a vertex of the body sees it
            nearest[k] = slot = facet % 2
            facets[k, slot] = facet
            xis[k, slot] = xi
            alone[k, slot] = False
            if other is not None and turn < -SAME_LENGTH and other != facet:
                beyond = np.clip(line.foot(other, c, float(not last)), *PROLONGED_FACET)
                facets[k, 1 - slot] = other
                xis[k, 1 - slot] = float(beyond)
                alone[k, 1 - slot] = False
            beside += line.nodes[facet].tolist()
            degree = line.nodes.shape[1] - 1
            node = int(np.clip(round(degree * xi), 0, degree))
            if abs(xi - node / degree) <= DIGITS_OF_FILES:
                on.append(int(line.nodes[facet, node]))
        return cls(
            facets,
            xis,
            alone,
            np.unique(np.array(beside, dtype=np.int64)),
            np.unique(np.array(on, dtype=np.int64)),
            nearest,
        )

    def rows(self, line: BoundaryLine, corners: Corners) -> tuple[Array, Ints, Array, Array, Array]:
        """Return data of the 2 k points: shape functions and numbers of the nodes, shapes (2 k, p +
        1), the normal at the foot, shape (2 k, 2), and, with shape (2 k,), the gap without the
        prescribed part and the tangent of the angle between the facet and the nearer side of the
        corner.
        """
        facet = self.facet.ravel()
        xi = self.xi.ravel()
        both = [*zip(facet.tolist(), xi.tolist(), strict=True)]
        phi = np.array([line.place(*at)[0] for at in both])
        x = np.array([line.place(*at)[1] for at in both])
        normal = np.array([line.normal(*at) for at in both])
        c = np.repeat(corners.places, 2, axis=0)
        radius = np.repeat(corners.radius, 2)
        opening = inner(normal, c - x) - radius
        cosine = -np.einsum("nd,nsd->ns", normal, np.repeat(corners.sides, 2, axis=0)).max(axis=1)
        nearer = np.clip(cosine, ZERO_COMPONENT, 1.0)
        return phi, line.nodes[facet], normal, opening, np.sqrt(1.0 - nearer**2) / nearer

    def stiffness(self, line: BoundaryLine, corners: Corners, forces: Array) -> JointStiffness:
        """Return the stiffness that normal forces at the points, shape (2 k,), add to the tangent
        as facets rotate under the corners.

        It is minus the force times the second variation of the gap g, which is (a . x)(n . x' +
        kappa xi) / m^2 - (n . x') xi with the variation of the foot xi = (g n . x' - a . x) / (m^2
        - g kappa), the derivative a of the facet, m = |a|, and kappa = n . x''.
        """
        nodes = []
        pieces = []
        for point in np.flatnonzero((forces != 0.0) & ~self.alone.ravel()):
            facet = int(self.facet.ravel()[point])
            xi = float(self.xi.ravel()[point])
            phi, slopes, bends = _functions(line.nodes.shape[1] - 1, xi)
            at = phi @ line.x[facet]
            a = slopes @ line.x[facet]
            n = line.normal(facet, xi)
            g = n @ (corners.places[point // 2] - at)
            kappa = n @ (bends @ line.x[facet])
            along = np.outer(phi, a).ravel()
            turn = np.outer(slopes, n).ravel()
            foot = (g * turn - along) / (a @ a - g * kappa)
            second = np.outer(along, turn + kappa * foot) / (a @ a) - np.outer(turn, foot)
            nodes.append(line.nodes[facet])
            pieces.append(-forces[point] * (second + second.T) / 2)
        every, place = np.unique(np.array(nodes, dtype=np.int64), return_inverse=True)
        size = 2 * every.size
        matrix = np.zeros((size, size))
        for piece, rows in zip(pieces, place.reshape(-1, line.nodes.shape[1]), strict=True):
            both = (2 * rows[:, None] + np.arange(2)).ravel()
            matrix[np.ix_(both, both)] += piece
        return JointStiffness(every, sp.csr_array(matrix))

    def slips(self, line: BoundaryLine, places: Array) -> Array:
        """Return the displacements of the body points under these feet relative to the corners,
        length, shape (2 k, 2); zero for corners without a foot.

        ``line``: the present line; ``places``: the present positions of the corners, shape (k, 2).
        """
        moved = np.zeros((len(places), 2))
        for k, slot in enumerate(self.first):
            if slot >= 0:
                at = int(self.facet[k, slot]), float(self.xi[k, slot])
                moved[k] = line.place(*at)[1] - places[k]
        return np.repeat(moved, 2, axis=0)

    def left_out(self, line: BoundaryLine, nodes: Ints, direction: Array) -> Flags:
        """Return the flags of nodes whose points are left out, shape (n,).

        ``nodes``: global numbers, shape (n,); ``direction``: their contact directions, shape (n,
        2).
        """
        out = np.isin(nodes, self.on)
        for k in np.flatnonzero(np.isin(nodes, self.beside) & ~out):
            facets, at = np.nonzero(line.nodes == nodes[k])
            degree = line.nodes.shape[1] - 1
            normals = [
                line.normal(int(f), float(j) / degree) for f, j in zip(facets, at, strict=True)
            ]
            out[k] = max(normal @ direction[k] for normal in normals) < ALONG_FACET
        return out


def with_corners(
    part: ContactBoundary,
    corners: Corners,
    line: BoundaryLine,
    feet: CornerFeet,
    fixed: Flags,
    factor: Array | None,
    reach: float,
) -> ContactBoundary:
    """Return the points of a foundation together with those of its corners, which a single rank
    owns; collective.

    ``fixed``: flags of the owned dofs that are prescribed, shape (owned dofs,). ``factor``: factor
    of the surface measure at the nodes of this rank. ``reach``: the gap assigned to points that are
    alone, length.
    """
    comm = part.comm
    dim = part.x.shape[1]
    first = parallel.gather_rows(comm, np.array([[part.size]]))[:, 0] > 0
    here = bool(first.any()) and comm.rank == int(first.argmax())
    count = feet.xi.size if here else 0
    alone = feet.alone.ravel()[:count]
    facet = feet.facet.ravel()[:count]
    rows = feet.rows(line, corners)
    phi = rows[0][:count]
    names = rows[1][:count]
    along = rows[2][:count]
    opening = rows[3][:count]
    slope = rows[4][:count]
    nodes, at = np.unique(names, return_inverse=True)
    entries = phi.ravel(), at.ravel(), np.arange(count + 1) * phi.shape[1]
    shares = sp.csr_array(entries, shape=(count, nodes.size))
    x, normal = np.zeros((2, count, dim))
    normal[:, :2] = along
    x[:, :2] = np.einsum("np,npd->nd", phi, line.initial[facet])
    weight = np.linalg.norm(line.initial[facet, -1] - line.initial[facet, 0], axis=1)
    held = from_owners(fixed.reshape(-1, dim).astype(np.float64), nodes, comm) > 0
    known = np.zeros((nodes.size, dim))
    known[:, :2][at.ravel()] = line.initial[facet].reshape(-1, 2)
    averages = Averages(shares, nodes, known, held)
    if factor is not None:
        owned = np.nan_to_num(factor[: fixed.size // dim, None])
        at_nodes = from_owners(owned, nodes, comm)[:, 0]
        weight = weight * (abs(shares.astype(bool)) @ at_nodes) / phi.shape[1]
    named = feet.left_out(line, part.global_nodes, part.normal[:, :2])
    place = np.full((count, dim), np.nan)
    place[:, :2] = np.repeat(corners.places, 2, axis=0)[:count]
    of_corners = CornerPoints(
        np.arange(count),
        np.where(alone, reach, opening),
        alone,
        place,
        line.lengths[facet],
        slope,
    )
    points = CornerPoints.joined([CornerPoints.at_nodes(named, reach, dim), of_corners])
    free = np.concatenate((part.free, averages.any_of(~held)))
    free[points.alone] = False
    home = part.nodes[:1] if here else part.nodes[:0]
    beyond = int(parallel.largest(comm, part.global_nodes, -1)) + 1 + np.arange(count)
    return replace(
        part,
        nodes=np.concatenate((part.nodes, np.repeat(home, count))),
        x=np.concatenate((part.x, x)),
        weight=np.concatenate((part.weight, weight)),
        normal=np.concatenate((part.normal, normal)),
        part=np.concatenate((part.part, np.full(count, part.surface[0][2], dtype=np.int32))),
        free=free,
        global_nodes=np.concatenate((part.global_nodes, beyond)),
        averages=Averages.joined([part.averages, averages]),
        axes=np.concatenate((part.axes, np.tile(np.eye(dim), (count, 1, 1)))),
        corners=points,
    )


def _functions(degree: int, xi: float) -> tuple[Array, Array, Array]:
    """Return the Lagrange functions of a facet at a coordinate from 0 to 1 and their first two
    derivatives, nodes in order along the facet, shapes (p + 1,); beyond the ends they continue
    linearly.
    """
    if degree == 1:
        return np.array([1.0 - xi, xi]), np.array([-1.0, 1.0]), np.zeros(2)
    at = min(max(xi, 0.0), 1.0)
    values = np.array([(1 - at) * (1 - 2 * at), 4 * at * (1 - at), at * (2 * at - 1)])
    slopes = np.array([4 * at - 3, 4 - 8 * at, 4 * at - 1])
    bends = np.array([4.0, -8.0, 4.0]) * (at == xi)
    return values + (xi - at) * slopes, slopes, bends


def _in_order(nodes: Ints, rows: Array) -> Sequence[int]:
    """Return the facets in order along the boundary; its pieces are sorted by their positions."""
    behind = {int(first): k for k, first in enumerate(nodes[:, 0])}
    follows = np.isin(nodes[:, 0], nodes[:, -1])
    begins = np.lexsort((*rows.T[::-1], follows)).tolist()
    order = []
    seen = set[int]()
    for begin in begins:
        facet = begin
        while facet is not None and facet not in seen:
            order.append(facet)
            seen.add(facet)
            facet = behind.get(int(nodes[facet, -1]))
    return order
