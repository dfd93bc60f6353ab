"""The independent check on what the solver says of two sides that slide before they are deformed.

Which nodes carry points, which of them other contacts own, where supports hold the sides, planes of symmetry, areas of
nodes, and how far partners may be apart follow from facets, positions, supports and the other contacts of the problem.
What the solver says of them is compared with what is found here, so that all that is evaluated from it is right.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.distance import cdist

from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import from_owners
from signorini_fx.mechanics.assembly.mesh_entities import facet_nodes
from signorini_fx.results.certificate.mortar_integrals import along_normals
from signorini_fx.results.certificate.sliding_claim import BoundaryPolyline, SlidingClaim
from signorini_fx.results.certificate.supports import PrescribedNodes
from signorini_fx.tuned import ASKEW_NORMAL, DIGITS_OF_FILES, PARTNERS_REACH, SAME_LENGTH, ZERO_SUM

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Facets = npt.NDArray[np.int32]


def owned_by_others(claim: SlidingClaim, nodes: npt.NDArray[np.int64], facets: Facets) -> Flags:
    """Which nodes, global numbers, are on facets of this rank or of another one, shape (n,); collective."""
    names = claim.space.dofmap.index_map.local_to_global(np.unique(facet_nodes(claim.space, facets)))
    return np.isin(nodes, parallel.gather_rows(claim.comm, names))


@dataclass(frozen=True)
class UndeformedSide:
    """What is found of one side.

    Attributes:
        chain: its facets.
        loose: projectors onto the directions that supports leave at its nodes, shape (N, d, d).
        fixed: which components they prescribe there, shape (N, d).
        at_rest: which of these to zero, likewise.
    """

    chain: BoundaryPolyline
    loose: Array
    fixed: Flags
    at_rest: Flags

    @classmethod
    def of(cls, claim: SlidingClaim, chain: BoundaryPolyline, held: Array, supports: PrescribedNodes) -> UndeformedSide:
        """That of a chain; collective.

        Args:
            claim: what is claimed.
            chain: the facets.
            held: projectors onto the directions that supports prescribe, shape (owned nodes, d, d).
            supports: the same component by component.
        """
        dim = held.shape[1]
        at_rest = supports.fixed & (supports.value == 0.0)
        rows = np.column_stack(((np.eye(dim) - held).reshape(-1, dim**2), supports.fixed, at_rest))
        loose, fixed, rests = np.split(from_owners(rows, chain.nodes, claim.comm), [dim**2, dim**2 + dim], axis=1)
        return cls(chain, loose.reshape(-1, dim, dim), fixed > 0.5, rests > 0.5)

    @property
    def normals(self) -> Array:
        """Outward at the nodes, of length one, shape (N, d)."""
        sums = self.chain.normals(self.chain.x)
        return np.asarray(sums / np.linalg.norm(sums, axis=1, keepdims=True))

    def held(self, across: Array) -> Flags:
        """Which nodes supports hold along the normals, that have no part across planes of symmetry, shape (N,)."""
        normals = self.normals
        normals = normals - np.einsum("nij,nj->ni", across, normals)
        size = np.linalg.norm(normals, axis=1, keepdims=True)
        return along_normals(np.divide(normals, size, out=np.zeros_like(normals), where=size > 0.0), self.loose)

    @property
    def without_area(self) -> Flags:
        """Nodes whose functions have no area because of the measure, shape (N,)."""
        chain = self.chain
        if (chain.measure == 1.0).all():
            return np.zeros(chain.nodes.size, dtype=bool)
        least = ZERO_SUM * chain.measure.max() if chain.quadratic else -np.inf
        area = chain.nodal_areas
        return np.asarray((chain.measure <= least) | (area <= ZERO_SUM * area.max()))


def on_axis(slave: BoundaryPolyline, master: BoundaryPolyline) -> tuple[Flags, Flags, Flags]:
    """Nodes of the slave on an axis of revolution, where its measure is zero, those of the master, and those that may
    be, as the measure is not known there, shapes (N,), (M,) and (M,).
    """
    at_slave = slave.measure <= ZERO_SUM * slave.measure.max()
    near = np.abs(master.x[:, 0]) <= DIGITS_OF_FILES * float(np.ptp(master.x, axis=0).max())
    return at_slave, near & at_slave.any(), np.full(len(master.x), not (slave.measure == 1.0).all())


def planes_of_symmetry(sides: tuple[UndeformedSide, UndeformedSide], held: tuple[Flags, Flags], radial: Flags) -> Flags:
    """Across which axes there are planes at the nodes of the first side that hold both sides, shape (N, d).

    There is one where a component is held, the normal has hardly any of it, and a node of the other side that is not
    farther than a facet beyond the nearest one is held likewise and has the same coordinate, and where the facets
    around both nodes do not reach beyond the plane to opposite sides.

    Args:
        sides: that of the nodes, and the other one.
        held: components of their nodes that count as held, shapes (N, d) and (M, d).
        radial: nodes where the normal may have any part along the first axis, shape (N,): on an axis of revolution it
            is the mean all around.
    """
    nodal_side, other_side = sides
    x, y = nodal_side.chain.x, other_side.chain.x
    across, normals = np.zeros(held[0].shape, dtype=bool), np.abs(nodal_side.normals)
    largest = max(float(side.chain.diagonals.max()) for side in sides)
    beyond = DIGITS_OF_FILES * largest
    for axis in range(x.shape[1]):
        candidates = held[0][:, axis] & ((normals[:, axis] <= ASKEW_NORMAL) | (radial & (axis == 0)))
        candidate_nodes, holding = np.flatnonzero(candidates), np.flatnonzero(held[1][:, axis])
        ends, other_ends = (
            np.stack((lowest >= -beyond, highest <= beyond))
            for lowest, highest in (
                _reach_around(nodal_side.chain, axis, candidate_nodes),
                _reach_around(other_side.chain, axis, holding),
            )
        )
        # Those of all that hold are many, and those at an end few.
        candidate_nodes, ends = candidate_nodes[ends.any(axis=0)], ends[:, ends.any(axis=0)]
        holding, other_ends = holding[other_ends.any(axis=0)], other_ends[:, other_ends.any(axis=0)]
        if not candidate_nodes.size or not holding.size:
            continue
        far = cdist(x[candidate_nodes], y)
        in_plane = np.abs(x[candidate_nodes, None, axis] - y[None, holding, axis]) < beyond
        in_plane &= far[:, holding] <= largest + far.min(axis=1)[:, None]
        in_plane &= (ends[:, :, None] & other_ends[:, None]).any(axis=0)
        across[candidate_nodes, axis] = in_plane.any(axis=1)
    return across


def _reach_around(chain: BoundaryPolyline, axis: int, nodes: npt.NDArray[np.intp]) -> tuple[Array, Array]:
    """From where to where the facets around some nodes reach from these along an axis, lengths, shapes (n,)."""
    place = chain.x[:, axis]
    lowest, highest = place.copy(), place.copy()
    for ends, extreme in ((lowest, np.minimum), (highest, np.maximum)):
        of_facets = extreme.reduce(place[chain.facets], axis=1)
        extreme.at(ends, chain.facets, of_facets[:, None])
    return lowest[nodes] - place[nodes], highest[nodes] - place[nodes]


def usual_reach(x: Array, y: Array) -> float:
    """The distance beyond which facets are no partners where the problem names none, of sides that slide, length: it
    does not depend on the axes.

    Args:
        x: nodes of the one side, shape (n, d).
        y: those of the other one.
    """
    widths = [2.0 * float(np.sqrt(np.max(np.sum((nodes - nodes.mean(axis=0)) ** 2, axis=1)))) for nodes in (x, y)]
    nearest = min(float(cdist(x[first : first + 1024], y).min()) for first in range(0, len(x), 1024))
    return nearest + PARTNERS_REACH * min(widths)


def error_of_sides(claim: SlidingClaim, held: Array, supports: PrescribedNodes, taken: Iterable[Facets]) -> float:
    """How far what the solver says of both sides is from what they are: one where flags differ, of areas relative to
    the largest one, of directions relative to one; collective.

    Args:
        claim: what is claimed.
        held: projectors onto the directions that supports prescribe, shape (owned nodes, d, d).
        supports: the same component by component.
        taken: facets of other contacts, whose nodes carry no points of this one.
    """
    slave, master = sides = (
        UndeformedSide.of(claim, claim.chains[0], held, supports),
        UndeformedSide.of(claim, claim.chains[1], held, supports),
    )
    taken_facets = np.concatenate((*taken, claim.master))
    unable, bare = owned_by_others(claim, slave.chain.nodes, taken_facets), slave.without_area
    able = ~unable & ~bare & (slave.chain.nodal_areas > 0.0)
    agreements = [
        np.array_equal(np.flatnonzero(able), claim.carriers),
        np.array_equal(unable, claim.unable),
        np.array_equal(bare, claim.surface.without_area),
    ]
    reach = usual_reach(slave.chain.x, master.chain.x) if claim.allowed is None else claim.allowed
    agreements.append(bool(np.isclose(claim.reach, reach, rtol=SAME_LENGTH, atol=0.0)))
    if claim.memory.at_rest is None:
        claim.memory.at_rest = slave.at_rest, master.at_rest
    rests, fixed = claim.memory.at_rest, (slave.fixed, master.fixed)
    area, largest = slave.chain.nodal_areas, float(slave.chain.nodal_areas.max())
    worst = float(np.max(np.abs(claim.surface.area - area))) / largest
    at_slave, at_master, perhaps = on_axis(*claim.chains)
    loose = claim.held.loose
    agreements.append(loose is not None)
    for k, (side, surface, flags) in enumerate(
        zip(sides, (claim.surface, claim.other_surface), (claim.held.slave, claim.held.master), strict=True)
    ):
        in_order = sides if k == 0 else sides[::-1]
        required, allowed = (
            planes_of_symmetry(in_order, components if k == 0 else components[::-1], radial)
            for components, radial in ((rests, (at_slave, at_master)[k]), (fixed, (at_slave, perhaps)[k]))
        )
        planes = np.einsum("nii->ni", surface.across) > 0.5
        agreements.append(bool((planes | ~required).all() and (allowed | ~planes).all()))
        worst = max(worst, float(np.max(np.abs(surface.across - planes[:, :, None] * np.eye(planes.shape[1])))))
        agreements.append(np.array_equal(flags, side.held(surface.across)))
        if loose is not None:
            worst = max(worst, float(np.max(np.abs(loose[k] - side.loose))))
    return parallel.global_max(claim.comm, worst if all(agreements) else max(1.0, worst))
