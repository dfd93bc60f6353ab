"""The independent check on the map of a pair of bodies.

What the solver claims of a pair are weights, distances, and shares of the nodes of both sides.  At all points

    D 1 = M 1 = 1,   D x - M x + d = 0,   B R = 0 for every joint rigid motion R,

and forces and moments balance because of the latter.  Where normals are those of deformed sides, a rotation R leaves
B R = - R d, as the distance turns with the sides.  Both sides consist of the facets that the problem names, no fewer
and no others.  The integrals that all of it is made of are evaluated anew (``mortar_integrals``), and what points do
not count of distances that supports fix (``uncounted_distances``).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from mpi4py import MPI
from scipy.spatial import cKDTree

from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import from_owners
from signorini_fx.mechanics.assembly.mesh_entities import facet_nodes, node_positions
from signorini_fx.results.certificate.mortar_integrals import MortarIntegrals, error_of_integrals
from signorini_fx.results.certificate.paired_claim import Claim
from signorini_fx.results.certificate.surface_quadrature import SurfaceQuadrature
from signorini_fx.results.certificate.uncounted_distances import error_of_uncounted
from signorini_fx.tuned import DIGITS_OF_FILES, PARTNERS_REACH

Array = npt.NDArray[np.float64]


def largest(values: Array) -> float:
    """The largest magnitude."""
    return float(np.max(np.abs(values), initial=0.0))


def not_held(claim: Claim, held: Array, y: Array) -> float:
    """How far the directions across planes of symmetry are from being held where they are at the nodes of the points,
    and for each at some node of the other side that a point sees, or at one in 2D that is not farther
    than a facet from the nearest: beside what supports hold on both sides a point may see none there; collective.

    Args:
        claim: what is claimed.
        held: projectors onto the directions that supports prescribe, shape (owned nodes, d, d).
        y: displacements of the owned nodes relative to the largest one, shape (owned nodes, d).
    """
    if not parallel.any_rank(claim.comm, bool(claim.across.any())):
        return 0.0
    nodal_rows = np.column_stack((held.reshape(-1, y.shape[1] ** 2), y))
    reached_rows: Array = from_owners(nodal_rows, claim.reached, claim.comm)
    of_master: Array = from_owners(nodal_rows, claim.pair.master.nodes, claim.comm)
    (own, other), dim, worst = (side.surface.x for side in (claim.pair.slave, claim.pair.master)), y.shape[1], 0.0
    size = max(
        float(np.linalg.norm(np.ptp(side.surface.corners, axis=1), axis=1).max())
        for side in (claim.pair.slave, claim.pair.master)
    )
    planes = np.array([node for node in claim.planes if node in claim.reached], dtype=np.int64)
    for node, k in zip(planes, np.searchsorted(claim.reached, planes), strict=True):
        plane, row = claim.planes[int(node)], reached_rows[k]
        worst = max(worst, largest(row[:-dim].reshape(dim, dim) @ plane - plane) + largest(plane @ row[-dim:]))
    for point in np.flatnonzero(claim.across.any(axis=(1, 2))):
        nodes = claim.others.indices[claim.others.indptr[point] : claim.others.indptr[point + 1]]
        values, ways = np.linalg.eigh(claim.across[point])
        apart = other - own[claim.pair.coupling.nodes[point]]
        away = np.linalg.norm(apart, axis=1)
        for way in ways[:, values > 0.5].T:
            in_plane = (np.abs(apart @ way) <= DIGITS_OF_FILES * size) & (away <= size + away.min())
            rows = [nodal_rows[claim.points[[point]]], np.concatenate((reached_rows[nodes], of_master[in_plane]))]
            worst = max(
                worst,
                *(
                    np.min(
                        np.linalg.norm(candidates[:, :-dim].reshape(-1, dim, dim) @ way - way, axis=1)
                        + abs(candidates[:, -dim:] @ way)
                    )
                    for candidates in rows
                ),
            )
    return parallel.global_max(claim.comm, float(worst))


def not_integrated(
    claim: Claim, evaluation: SurfaceQuadrature, held: Array, taken: Iterable[npt.NDArray[np.int32]]
) -> float:
    """How far what the solver claims of the points is from what the integrals make it, and what they do not count of
    distances from what supports fix there, see ``error_of_integrals`` and ``error_of_uncounted``; collective.

    Args:
        claim: what is claimed.
        evaluation: integrals over the sides.
        held: see ``not_held``.
        taken: facets of other contacts, whose nodes carry no points of this one.
    """
    known, key = claim.pair.independent_checks, (claim.slave.tobytes(), claim.master.tobytes(), claim.allowed)
    if key not in known:
        reach = _usual_reach(claim.space, (claim.slave, claim.master)) if claim.allowed is None else claim.allowed
        known[key] = MortarIntegrals.of(claim, evaluation, reach)
    found: MortarIntegrals = known[key]
    loose = tuple(_loose(held, side.nodes, claim.comm) for side in found.sides)
    tested = found.tested(claim, (loose[0], loose[1]), _owned_by(claim, found.sides[0].nodes, taken))
    worst = error_of_integrals(claim, found, tested)
    return worst if worst >= 1.0 else max(worst, error_of_uncounted(claim, found, tested, (loose[0], loose[1])))


def _owned_by(
    claim: Claim, nodes: npt.NDArray[np.int64], taken: Iterable[npt.NDArray[np.int32]]
) -> npt.NDArray[np.bool_]:
    """Which nodes of the slave, global numbers, other contacts own, or the other side, shape (N,); collective."""
    facets = np.concatenate((*taken, claim.master))
    names = claim.space.dofmap.index_map.local_to_global(np.unique(facet_nodes(claim.space, facets)))
    return np.isin(nodes, parallel.gather_rows(claim.comm, names))


def _loose(held: Array, nodes: npt.NDArray[np.int64], comm: MPI.Comm) -> Array:
    """Projectors onto the directions that supports leave at nodes, global numbers, shape (n, d, d); collective."""
    dim = held.shape[1]
    return from_owners((np.eye(dim) - held).reshape(-1, dim**2), nodes, comm).reshape(-1, dim, dim)


def defect(claim: Claim, space: fem.FunctionSpace) -> float:
    """The largest error of what is claimed, relative to one, to weights, or to sizes of facets; collective."""
    dim, comm, coupling = space.mesh.geometry.dim, claim.comm, claim.pair.coupling
    x = np.array(node_positions(space)[: space.dofmap.index_map.size_local, :dim], dtype=np.float64)
    used = from_owners(x, claim.reached, comm)
    low, high = parallel.global_bounds(comm, used)
    size, middle = float(np.linalg.norm(high - low)), (low + high) / 2
    arm = (used - middle) / size
    total = float(parallel.global_sum(comm, claim.weight.sum()))
    errors = [abs(total / coupling.covered - 1.0), parallel.local_max(-claim.weight, -np.inf) / coupling.covered]
    errors += [largest(shares @ np.ones(len(used)) - 1.0) for shares in (claim.own, claim.others)]
    errors.append(largest(claim.own @ arm - claim.others @ arm + claim.distance / size))
    turned_distances, zeros = _rigid(np.asarray(claim.distance / size)), np.zeros_like(claim.distance)
    turned_distances = [turned - np.einsum("nij,nj->ni", claim.across, turned) for turned in turned_distances]
    for number, motion in enumerate(_rigid((x - middle) / size)):
        remainder = turned_distances[number] if number >= dim and claim.followed is not None else zeros
        errors.append(largest(claim.relative(motion) + remainder))
    named, paired = (claim.slave, claim.master), (claim.pair.slave.facets, claim.pair.master.facets)
    errors.append(float(any(np.setxor1d(*facets).size for facets in zip(paired, named, strict=True))))
    reach = _usual_reach(space, named) if claim.allowed is None else claim.allowed
    errors.append(float(not np.isclose(coupling.reach, reach, atol=0.0)))  # which may be zero, or infinite
    return parallel.global_max(comm, float(max(errors)))


def _usual_reach(space: fem.FunctionSpace, sides: Iterable[npt.NDArray[np.int32]]) -> float:
    """The distance beyond which facets are no partners where the problem names none, length; collective."""
    dim = space.mesh.geometry.dim
    slave, master = (
        parallel.gather_rows(
            space.mesh.comm, node_positions(space)[fem.locate_dofs_topological(space, dim - 1, facets), :dim]
        )
        for facets in sides
    )
    nearest = float(cKDTree(master).query(slave)[0].min())
    return nearest + PARTNERS_REACH * min(float(np.linalg.norm(np.ptp(x, axis=0))) for x in (slave, master))


def _rigid(arm: Array) -> list[Array]:
    dim = arm.shape[1]
    motions = [np.tile(row, (len(arm), 1)) for row in np.eye(dim)]
    for first in range(dim):
        for second in range(first):
            turned = np.zeros_like(arm)
            turned[:, first], turned[:, second] = -arm[:, second], arm[:, first]
            motions.append(turned)
    return motions
