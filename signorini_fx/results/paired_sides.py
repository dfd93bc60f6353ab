"""The second opinion on the map of a pair of bodies: identities at all points, integrals at some.

What the solver claims of a pair are weights, distances, and shares of the nodes of both sides.  At all points

    D 1 = M 1 = 1,   D x - M x + d = 0,   B R = 0 for every joint rigid motion R,

and forces and moments balance because of the latter.  At some points, drawn at random, the integrals are computed again
by other code: facets of the mesh are evaluated by basix, in the plane rays from the slave find the master, in space the
slave is cut by each master in turn, and polygons are integrated by collapsed rules.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from dolfinx import fem

from signorini_fx.body.assembly import facet_entities
from signorini_fx.results.paired_facets import Cells, Facet, Piece, interpolated_normals, pieces_of

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int32]

# Points whose integrals are computed again, by the dimension.
_SAMPLED = {2: 16, 3: 6}
# A facet that is covered by less than this share is not among them: its dual functions have few digits.
_COVERED = 0.05


@dataclass(frozen=True)
class Claim:
    """What the solver claims of a pair with n contact points, on one rank; N nodes in all.

    Attributes:
        slave: facets of the side with the points, local numbers.
        master: those of the other side.
        points: local node of each point, shape (n,).
        weight: area (in the plane: length), shape (n,).
        distance: d_i, length, shape (n, d).
        own: D, scipy sparse, shape (n, N).
        others: M, scipy sparse, shape (n, N).
        operator: the relative displacement from displacements of all nodes, scipy sparse, shape (n d, N d).
        alone: points that have taken over no function of another node, shape (n,).
        covered: area of the overlap.
        hats: whether functions are the hats of the vertices themselves.
        reach: distance beyond which facets are no partners, length.
    """

    slave: Indices
    master: Indices
    points: npt.NDArray[np.int64]
    weight: Array
    distance: Array
    own: Any
    others: Any
    operator: Any
    alone: npt.NDArray[np.bool_]
    covered: float
    hats: bool
    reach: float

    @cached_property
    def reached(self) -> npt.NDArray[np.int64]:
        """Local nodes that the points act on, shape (m,)."""
        columns = np.unique(sp.csr_array(self.operator).indices) // self.distance.shape[1]
        return np.unique(columns).astype(np.int64)

    def gap(self, normal: Array) -> Array:
        """The distance of both sides along normals at the points, length, shape (n,)."""
        return np.asarray(np.sum(normal * self.distance, axis=1))

    def relative(self, every: Array) -> Array:
        """The relative displacement at the points from that of all nodes, shape (N, d)."""
        return np.asarray(self.operator @ every.ravel()).reshape(self.distance.shape)

    def forces(self, traction: Array) -> tuple[npt.NDArray[np.int64], Array, Array]:
        """What tractions at the points, shape (n, d), do to both bodies: nodes, forces on them, and their areas."""
        dim = self.distance.shape[1]
        forces = (self.operator.T @ (self.weight[:, None] * traction).ravel()).reshape(-1, dim)
        area = (abs(self.own) + abs(self.others)).T @ self.weight
        nodes = self.reached[area[self.reached] > 0]
        return nodes, forces[nodes], area[nodes]

    def moved(self, flags: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Whether a node that a point depends on has a flag, from shape (N, d) to shape (n, d)."""
        return np.asarray((abs(self.own) + abs(self.others)) @ flags.astype(np.float64) > 0)


def defect(claim: Claim, space: fem.FunctionSpace) -> float:
    """The largest error of what is claimed, relative to one, to weights, or to sizes of facets."""
    dim = space.mesh.geometry.dim
    x = space.tabulate_dof_coordinates()[:, :dim]
    used = x[claim.reached]
    size, middle = float(np.linalg.norm(np.ptp(used, axis=0))), used.mean(axis=0)
    arm = (x - middle) / size
    found = [abs(claim.weight.sum() / claim.covered - 1.0), -float(claim.weight.min()) / claim.covered]
    found += [_largest(shares @ np.ones(len(x)) - 1.0) for shares in (claim.own, claim.others)]
    found.append(_largest(claim.own @ arm - claim.others @ arm + claim.distance / size))
    for motion in _rigid(arm):
        found.append(_largest(claim.relative(motion)))
    found.append(_sampled(claim, space))
    return float(max(found))


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values), initial=0.0))


def _rigid(arm: Array) -> list[Array]:
    dim = arm.shape[1]
    found = [np.tile(row, (len(arm), 1)) for row in np.eye(dim)]
    for first in range(dim):
        for second in range(first):
            turned = np.zeros_like(arm)
            turned[:, first], turned[:, second] = -arm[:, second], arm[:, first]
            found.append(turned)
    return found


def _sampled(claim: Claim, space: fem.FunctionSpace) -> float:
    """The largest error of the integrals of some points, relative to their weights and the sizes of facets."""
    dim = space.mesh.geometry.dim
    cells = Cells(space)
    slave, master = (
        [Facet(cells, *row) for row in facet_entities(space.mesh, own)] for own in (claim.slave, claim.master)
    )
    normals = interpolated_normals(slave) if dim == 2 else None
    low, high = (np.array(ends) for ends in zip(*(facet.bounds for facet in master), strict=True))
    around: dict[int, list[int]] = {}
    for number, facet in enumerate(slave):
        for node in facet.points:
            around.setdefault(int(node), []).append(number)
    choice = np.flatnonzero(claim.alone)
    choice = np.random.default_rng(len(claim.points)).permutation(choice)[: _SAMPLED[dim]]
    known: dict[int, list[Piece]] = {}
    worst = 0.0
    for point in choice:
        node = int(claim.points[point])
        total, own, others = 0.0, np.zeros(claim.own.shape[1]), np.zeros(claim.own.shape[1])
        distance, size, clear = np.zeros(dim), 0.0, True
        for number in around[node]:
            facet = slave[number]
            if number not in known:
                near = (low <= facet.bounds[1] + claim.reach).all(axis=1) & (high >= facet.bounds[0] - claim.reach).all(
                    axis=1
                )
                known[number] = pieces_of(facet, [master[k] for k in np.flatnonzero(near)], claim.reach, normals)
            pieces = known[number]
            if not pieces:
                continue
            clear &= sum(piece.weight.sum() for piece in pieces) > _COVERED * facet.area
            psi = _functions(facet, pieces, claim.hats)
            row = list(facet.points).index(node)
            size = max(size, facet.size)
            for piece, values in zip(pieces, psi, strict=True):
                weighted = values[:, row] * piece.weight
                total += weighted.sum()
                np.add.at(own, facet.nodes, weighted @ facet.shape(piece.at))
                np.add.at(others, piece.master.nodes, weighted @ piece.master.shape(piece.over))
                distance += weighted @ (piece.master.place(piece.over) - facet.place(piece.at))
        if not clear or total <= 0:
            continue
        weight = claim.weight[point]
        errors = [abs(total / weight - 1.0), _largest(distance / weight - claim.distance[point]) / size]
        for integrals, shares in ((own, claim.own), (others, claim.others)):
            errors.append(_largest(integrals / weight - shares[[point]].toarray().ravel()))
        worst = max(worst, *errors)
    return worst


def _functions(facet: Facet, pieces: list[Piece], hats: bool) -> list[Array]:
    """Values of the test functions at the points of the pieces, shape (q, t) each."""
    values = [facet.hats(piece.at) for piece in pieces]
    if hats:
        return values
    mass = sum(one.T @ (piece.weight[:, None] * one) for one, piece in zip(values, pieces, strict=True))
    dual: Array = np.diag(np.sum(mass, axis=1)) @ np.linalg.inv(mass)
    return [one @ dual.T for one in values]
