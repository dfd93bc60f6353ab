"""One side of a contact at its corners: forces, areas, clearances and slips, averaged by hat functions.

The hat of a corner is linear on the facets around it.  Forces of nodes are weighted by its values at the nodes, so that
elements of degree 2, whose forces at corners are none or pull under constant pressure, are judged like those of degree
1.  Clearance and slip are means over the hat, or of node-to-surface contact those of the corner itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array, csr_array

from signorini_fx.addons.judging.problem_data import JudgedContact, JudgedProblem, facet_points
from signorini_fx.addons.judging.projection import closest_points, rotated_by
from signorini_fx.addons.judging.reference_elements import ReferenceElement, gauss, reference_element
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.mechanics.statement.expressions import in_space, sample
from signorini_fx.tuned import JUDGED_APART, JUDGED_FACET_POINTS, JUDGED_FREE_NORMAL

_LINEAR = {"line": "line", "line3": "line", "triangle": "triangle", "triangle6": "triangle"}


@dataclass(frozen=True)
class TouchingSurface:
    """One side of a contact.

    Attributes:
        contact: it.
        corners: nodes, shape (c,).
        area: of each hat, shape (c,).
        push: force that presses onto the body, shape (c,).
        shear: force across the normal, shape (c, d).
        penetration: mean of what enters the other side, length, shape (c,).
        clearance: least on the facets around a corner, length, shape (c,).
        varies: by how much the clearance varies on these facets where it is known, length, shape (c,).
        slip: across the normal, of this side against the other one, in the last load step, length, shape (c, d).
        slip_known: whether it is that; else it counts from the beginning, as the displacement before is not known.
        rubbed: whether friction may have acted before the last load step.
        touched: where the sides touched, or nearly, when slip began to count, shape (c,).  Elsewhere they have slipped
            less than that: only since they touch.
        straight: of the direction of slip the length of its mean over the hat, weighted by what enters: 1 where all of
            it slips the same way, shape (c,).
        normal: to the other side, shape (c, d).
        judged: which corners no support holds and no other contact or link shares, shape (c,).
        sliding: of these the ones that no support holds in any direction, shape (c,).
        neighbours: which corners share a facet, shape (c, c).
        rotation: by which the normal may be another one, radians, shape (c,): that by which facets in contact turn at
            most, and those between the mean around a corner and the normals of its facets and of the two bodies.
        uneven: by how much the clearance before the deformation differs from a function of the elements on the facets
            around a corner, length, shape (c,): contact at nodes does not see it.
        bound: force that friction can have, shape (c,); zero without friction.
        lawful: the least and the largest force by the law of soft contact, shape (2, c); None: contact is hard.
    """

    contact: JudgedContact
    corners: Ints
    area: Floats
    push: Floats
    shear: Floats
    penetration: Floats
    clearance: Floats
    varies: Floats
    slip: Floats
    slip_known: bool
    rubbed: bool
    touched: npt.NDArray[np.bool_]
    straight: Floats
    normal: Floats
    judged: npt.NDArray[np.bool_]
    sliding: npt.NDArray[np.bool_]
    neighbours: csr_array
    rotation: Floats
    uneven: Floats
    bound: Floats
    lawful: Floats | None


def touching_surface(
    problem: JudgedProblem, contact: JudgedContact, v: Floats, residual: Floats, step_start: Floats | None = None
) -> TouchingSurface:
    """The side of a contact that carries it.

    Args:
        problem: the problem.
        contact: one of its contacts.
        v: the displacement, length, shape (n, d).
        residual: internal forces less loads, force, shape (n, d).
        step_start: the displacement at the end of the load step before, length, shape (n, d); None: there is none, or
            it is not known.
    """
    change = v if step_start is None else v - step_start
    mesh, facets = problem.mesh, contact.facets
    linear = reference_element(_LINEAR.get(mesh.facet.kind, "quad"))
    width = linear.corner_count
    corners, local = np.unique(facets[:, :width], return_inverse=True)
    local = local.reshape(-1, width)
    weights = _hats_at_nodes(facets, local, linear.shape(mesh.facet.nodes), len(corners), len(mesh.points))
    revolved = problem.hypothesis == "axisymmetric"
    at = facet_points(mesh, facets, JUDGED_FACET_POINTS, revolved=revolved)
    hats = linear.shape(gauss(JUDGED_FACET_POINTS, mesh.facet.dim, simplex=mesh.facet.simplex)[0])

    def mean(values: Floats) -> Floats:
        """Over the hats, of values at points, shape (f, q, ...) -> (c, ...)."""
        parts = np.einsum("fq,qc,fq...->fc...", at.weight, hats, values)
        sums = np.zeros((len(corners), *parts.shape[2:]))
        np.add.at(sums, local, parts)
        return np.asarray(sums / area.reshape(-1, *[1] * (sums.ndim - 1)))

    area: Floats = np.ones(len(corners))
    area = mean(np.ones(at.weight.shape))
    flat = at.x.reshape(-1, mesh.dim)
    moved, changed = (np.einsum("qk,fkd->fqd", at.shape, u[facets]).reshape(flat.shape) for u in (v, change))
    gap, normal, slip = _opposite(problem, contact, (v, change), flat, (moved, changed), at.normal.reshape(flat.shape))
    gap, normal, slip = gap.reshape(at.weight.shape), normal.reshape(at.x.shape), slip.reshape(at.x.shape)

    def clearance_at(u: Floats) -> Floats:
        """At the points with another displacement, length, shape (f, q)."""
        begun = np.einsum("qk,fkd->fqd", at.shape, u[facets]).reshape(flat.shape)
        opposite = _opposite(problem, contact, (u, change), flat, (begun, changed), at.normal.reshape(flat.shape))
        return opposite[0].reshape(at.weight.shape)

    undeformed = clearance_at(np.zeros_like(v))
    open_then = undeformed if step_start is None else clearance_at(step_start)
    near = JUDGED_APART * float(np.linalg.norm(v, axis=1).max())
    touched = np.zeros(len(corners), dtype=bool)
    touched[local[open_then.min(axis=1) <= near]] = True
    penetration, mean_slip = mean((-gap).clip(min=0.0)), mean(slip)
    clearance = np.full(len(corners), np.inf)
    np.minimum.at(clearance, local, np.repeat(_least(mesh.facet, at.shape, gap)[:, None], width, axis=1))
    widest = np.full(len(corners), -np.inf)
    largest_gaps = np.where(np.isfinite(gap), gap, -np.inf).max(axis=1)
    np.maximum.at(widest, local, np.repeat(largest_gaps[:, None], width, axis=1))
    varies = np.where(np.isfinite(widest), widest, 0.0) - np.where(np.isfinite(clearance), clearance, 0.0)
    toward = mean(normal)
    toward /= np.linalg.norm(toward, axis=1)[:, None]
    kink, uneven = np.zeros(len(corners)), np.zeros(len(corners))
    bent = np.linalg.norm(normal[:, None] - toward[local][:, :, None], axis=3).max(axis=2)
    np.maximum.at(kink, local, bent)
    outward = mean(at.normal)
    if contact.opposite.size:
        kink += np.linalg.norm(outward / np.linalg.norm(outward, axis=1)[:, None] - toward, axis=1)
    np.maximum.at(uneven, local, np.repeat(_uneven(at.shape, undeformed)[:, None], width, axis=1))
    straight = np.ones(len(corners)) if contact.nodal else _straight(mean, slip, normal, (-gap).clip(min=0.0))
    lawful = None
    if contact.law is not None and not contact.nodal:
        lawful = np.stack([mean(limit) * area for limit in contact.law.pressures(-gap)])
    at_corners = v[corners], change[corners]
    gap_at, _, slip_at = _opposite(problem, contact, (v, change), mesh.points[corners], at_corners, outward)
    clearance = np.minimum(clearance, gap_at)  # nodes may touch where the points of facets do not
    if contact.nodal:
        penetration, mean_slip = (-gap_at).clip(min=0.0), slip_at
    if contact.law is not None and (contact.nodal or contact.law.apart):
        of_nodes = np.stack(contact.law.pressures(-gap_at[:, None]))[..., 0] * area
        # Points of a scene are in nodes or in facets: the force is between both.
        pairs = of_nodes if lawful is None else np.concatenate((lawful, of_nodes))
        lawful = np.stack((pairs.min(axis=0), pairs.max(axis=0)))
    force = weights @ residual
    held = ~np.isnan(problem.prescribed)
    along = weights @ held.astype(float) > 0
    # Along what a support holds it has a share of the force.
    across = np.where(along, 0.0, toward)
    square = np.einsum("cd,cd->c", across, across)
    push = -np.einsum("cd,cd->c", force, across) / np.maximum(square, JUDGED_FREE_NORMAL)
    shear = force + push[:, None] * toward
    mean_slip = mean_slip - np.einsum("cd,cd->c", mean_slip, toward)[:, None] * toward
    shared_nodes = problem.linked.copy()  # what links exert is no contact
    for rival in problem.contacts:
        if rival is not contact:
            shared_nodes[rival.nodes] = True
    shared = weights @ (shared_nodes | held.all(axis=1)).astype(float) > 0
    judged = ~shared & (square > JUDGED_FREE_NORMAL)
    sliding = judged & ~along.any(axis=1)
    graph = coo_array(
        (np.ones(width * width * len(local)), (np.repeat(local, width, 1).ravel(), np.tile(local, width).ravel())),
        shape=(len(corners),) * 2,
    ).tocsr()
    touching = (gap.min(axis=1) <= 0) & (np.abs(residual[facets]).sum(axis=(1, 2)) > 0)
    turns = rotated_by(mesh, facets[touching], v)
    if contact.opposite.size:
        turns = np.concatenate((turns, rotated_by(mesh, _near(problem, contact, facets[touching]), v)))
    x = in_space(mesh.points[corners])
    bound = np.zeros(len(corners))
    if contact.rubs:
        bound = contact.entry.friction.sampled(x).limit((push / area).clip(min=0.0)) * area
    return TouchingSurface(
        contact,
        corners,
        area,
        push,
        shear,
        penetration,
        clearance,
        varies,
        mean_slip,
        step_start is not None or not problem.several_steps,
        problem.several_steps,
        touched,
        straight,
        toward,
        judged,
        sliding,
        graph,
        turns.max(initial=0.0) + kink,
        uneven,
        np.asarray(bound),
        lawful,
    )


def bond_jumps(problem: JudgedProblem, contact: JudgedContact, v: Floats) -> Floats:
    """By how much the sides of a bond of two bodies are apart, in the mean over each facet, length, shape (f,); zero
    where nothing is opposite.

    Args:
        problem: the problem.
        contact: the bond.
        v: the displacement, length, shape (n, d).
    """
    if not contact.opposite.size:
        return np.zeros(len(contact.facets))
    mesh = problem.mesh
    at = facet_points(mesh, contact.facets, JUDGED_FACET_POINTS, revolved=problem.hypothesis == "axisymmetric")
    closest = closest_points(mesh, contact.opposite, mesh.points, at.x.reshape(-1, mesh.dim))
    away = np.einsum("qk,fkd->fqd", at.shape, v[contact.facets])
    away -= closest.values(contact.opposite, v).reshape(away.shape)
    weight = np.where(np.isfinite(closest.distance).reshape(at.weight.shape), at.weight, 0.0)
    means = np.einsum("fq,fqd->fd", weight, away) / at.weight.sum(axis=1)[:, None]
    return np.asarray(np.linalg.norm(means, axis=1))


def _straight(mean: Callable[[Floats], Floats], slip: Floats, normal: Floats, depth: Floats) -> Floats:
    """Of the direction of slip the length of its mean, weighted by what enters, shape (c,).

    Args:
        mean: over the hats, of values at points.
        slip: length, shape (f, q, d).
        normal: shape (f, q, d).
        depth: of what enters, length, shape (f, q).
    """
    across = slip - np.einsum("fqd,fqd->fq", slip, normal)[..., None] * normal
    size = np.linalg.norm(across, axis=2)
    moves = size > 0
    direction = np.where(moves[..., None], across / np.where(moves, size, 1.0)[..., None], 0.0)
    weight = mean(depth)
    pressed = weight > 0
    weighted = mean(direction * depth[..., None]) / np.where(pressed, weight, 1.0)[:, None]
    length = np.linalg.norm(np.where(pressed[:, None], weighted, mean(direction)), axis=1)
    return np.where(length > 0, length, 1.0)


def _uneven(shape: Floats, gap: Floats) -> Floats:
    """By how much a clearance differs from its interpolation by shape functions, length, shape (f,).

    The function nearest at the points misses half of what the interpolation misses of a parabola or of a jump.

    Args:
        shape: of the nodes of a facet at the points, shape (q, l).
        gap: at the points, length, infinite where nothing is opposite, shape (f, q).
    """
    facing = np.isfinite(gap).all(axis=1)
    missed = np.zeros(len(gap))
    at_points = gap[facing].T
    missed[facing] = 2 * np.abs(at_points - shape @ np.linalg.lstsq(shape, at_points, rcond=None)[0]).max(axis=0)
    return missed


def _least(element: ReferenceElement, shape: Floats, gap: Floats) -> Floats:
    """The least clearance on facets, length, shape (f,): of elements of degree 2 it may be between the points, where a
    folded side enters.

    Args:
        element: that of the facets.
        shape: of the nodes of a facet at the points, shape (q, l).
        gap: at the points, length, infinite where nothing is opposite, shape (f, q).
    """
    least = gap.min(axis=1)
    if len(element.nodes) == element.corner_count:
        return np.asarray(least)
    known = np.isfinite(gap).all(axis=1)
    samples: Floats = np.array(list(product(np.linspace(0, 1, _SAMPLES), repeat=element.dim)))
    if element.simplex:
        samples = samples[samples.sum(axis=1) <= 1]
    at_nodes = np.linalg.lstsq(shape, gap[known].T, rcond=None)[0]
    least[known] = np.minimum(least[known], (element.shape(samples) @ at_nodes).min(axis=0))
    return np.asarray(least)


# Places along each axis of a facet of degree 2 where the clearance is looked at.
_SAMPLES = 17


def _hats_at_nodes(facets: Ints, local: Ints, values: Floats, corners: int, nodes: int) -> csr_array:
    """The value of the hat of each corner at each node, shape (corners, nodes)."""
    rows = np.repeat(local[:, None, :], facets.shape[1], axis=1)
    columns = np.repeat(facets[:, :, None], local.shape[1], axis=2)
    entries = np.broadcast_to(values, rows.shape)
    pairs, first = np.unique(rows.ravel() * nodes + columns.ravel(), return_index=True)
    held = entries.ravel()[first]
    return coo_array((held, (pairs // nodes, pairs % nodes)), shape=(corners, nodes)).tocsr()


def _near(problem: JudgedProblem, contact: JudgedContact, facets: Ints) -> Ints:
    """The facets of the other side that are opposite to some of this one."""
    if not facets.size:
        return contact.opposite[:0]
    middle = problem.mesh.points[facets].mean(axis=1)
    closest = closest_points(problem.mesh, contact.opposite, problem.mesh.points, middle)
    return contact.opposite[np.unique(closest.facet)]


def _opposite(
    problem: JudgedProblem,
    contact: JudgedContact,
    displaced: tuple[Floats, Floats],
    x: Floats,
    moves: tuple[Floats, Floats],
    outward: Floats,
) -> tuple[Floats, Floats, Floats]:
    """Of points of a surface the clearance, the normal to the other side, and the slip against it.

    Args:
        problem: the problem.
        contact: the contact.
        displaced: the displacement of all nodes, and its change since slip counts, length, shape (n, d).
        x: points, length, shape (p, d).
        moves: both displacements of these, length, shape (p, d).
        outward: normals of the surface there, shape (p, d).
    """
    entry, dim = contact.entry, problem.mesh.dim
    (v, change), (moved, changed) = displaced, moves
    if not contact.opposite.size:
        if entry.surface is not None:
            distance, normal = entry.surface.distance(x + moved)
            return distance + sample(entry.gap, in_space(x)), -normal, changed
        toward = outward
        if entry.direction is not None:
            unit = np.array(entry.direction[:dim]) / np.linalg.norm(entry.direction[:dim])
            toward = np.broadcast_to(unit, x.shape)
        gap = sample(entry.gap, in_space(x))
        return gap - np.einsum("pd,pd->p", moved, toward), np.array(toward), changed
    mesh = problem.mesh
    deformed = closest_points(mesh, contact.opposite, mesh.points + v, x + moved)
    undeformed = closest_points(mesh, contact.opposite, mesh.points, x)
    clearance = deformed.distance
    begun = undeformed.distance
    closed = np.isfinite(begun) & (entry.distance == "nominal")
    if entry.adjust is not None:
        closed |= begun <= entry.adjust
    clearance[closed] -= begun[closed]
    clearance = clearance + sample(entry.gap, in_space(x))
    return clearance, -deformed.normal, changed - undeformed.values(contact.opposite, change)
