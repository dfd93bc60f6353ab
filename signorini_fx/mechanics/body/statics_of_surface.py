"""What statics proves of the body and not only of its mesh: all points of its surface count, and round-off.

The statements of ``contact.statics`` are about the contact points of a mesh.  On a flat facet with one normal a force
that the law allows for at any point is a combination of such forces at its vertices, so that nothing is lost.  In the
plane a curved surface is taken to be the arc of a circle between two nodes, or its chord, with the normals of the arc:
forces at three places contain all that it can do.  Between nodes F and g are at most the larger value of theirs.

Any motion gives a bound: no proof rests on the linear programme that has found it.  The motion is corrected until no
contact force does work on it; then the bound is evaluated with explicit terms for the round-off of each sum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.linalg import qr

from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.algebra.contact.reactions import Reactions, nearest
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.contact_points.contact_boundary import tangents_of
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.rigid.rigid_motions import rigid_modes
from signorini_fx.mechanics.statement.features import refused_by
from signorini_fx.tuned import BALANCED, LEANING_NORMAL, LOWERED_LIMITS, SAME_LENGTH

# Round-off of a sum of products of frames, positions and motions, per unit of the sum of their magnitudes.
_SUM = 64 * float(np.finfo(float).eps)
# Vertices of a facet in 3D.
_VERTICES = {"tetrahedron": 3, "hexahedron": 4}


# Features of a scene that statics does not know.
REFUSES = {
    "contact of two bodies": "two bodies touch each other, which is not derived yet",
    "driven foundation": "forces move a foundation, which is not derived yet",
}


class Unproved(Exception):
    """Why nothing is proved of the body."""


@dataclass(frozen=True)
class LimitSurface:
    """Places of one assembly, m of them, whose contact forces contain those of its surface, k motions.

    Attributes:
        normal: each motion along the normal, shape (m, k).
        tangential: along the tangents, shape (m, d - 1, k).
        coefficient: F, shape (m,).
        presses: whether a pressure can act there, shape (m,).
        places: of each facet among these, shape (f, c).
        given: bound of the friction that needs no pressure on each facet, force, shape (f,).
        flat: whether all facets are, and have one F and g each.
    """

    normal: Nodal
    tangential: Nodal
    coefficient: Nodal
    presses: npt.NDArray[np.bool_]
    places: npt.NDArray[np.int64]
    given: Nodal
    flat: bool

    def pushed(self, motion: Nodal) -> Nodal:
        """Bounds of the most work of contact forces with a unit of pressure on a motion, at the places that press."""
        normal, tangential, share = (field[self.presses] for field in (self.normal, self.tangential, self.coefficient))
        slips = np.linalg.norm(tangential @ motion, axis=1)
        sizes = np.abs(normal) @ np.abs(motion) + share * (np.abs(tangential).sum(axis=1) @ np.abs(motion))
        return np.asarray(normal @ motion + share * slips + _SUM * sizes)

    def taken(self, motion: Nodal) -> float:
        """A bound of the work that friction without pressure takes on a motion."""
        slips = np.linalg.norm(self.tangential @ motion, axis=1)
        slips += _SUM * (np.abs(self.tangential).sum(axis=1) @ np.abs(motion))
        facet_slips = slips[self.places]
        return float(self.given @ (facet_slips.mean(axis=1) if self.flat else facet_slips.max(axis=1))) * (
            1 + _SUM * len(facet_slips)
        )

    def holds(self, contact: Reactions) -> bool:
        """Whether the forces at the contact points are among those of the surface: friction without pressure is spread
        over facets, and only in 2D, on flat ones, is that the same.
        """
        return not contact.given.any() or (self.flat and self.tangential.shape[1] == 1)

    def open(self, motion: Nodal) -> Nodal | None:
        """A motion near this one on which no contact force does work, shape (k,); None: there is none."""
        if self.pushed(motion).max(initial=-np.inf) <= 0:
            return motion
        away = self._away()
        if away is None:
            return None
        margin = -float(self.pushed(away).max())
        for _ in range(8):
            excess = float(self.pushed(motion).max())
            if excess <= 0:
                return motion
            motion = motion + 2 * excess / margin * away
        return None

    def _away(self) -> Nodal | None:
        """A motion that moves the body off at all places, faster than F times its slip."""
        from scipy.optimize import linprog  # imported by what needs it alone: it takes 0.07 s

        normal, tangential, share = (field[self.presses] for field in (self.normal, self.tangential, self.coefficient))
        ways = np.array([[1.0], [-1.0]])
        if tangential.shape[1] == 2:  # an octagon around the disc
            angles = np.pi / 4 * np.arange(8)
            ways = np.column_stack((np.cos(angles), np.sin(angles))) / np.cos(np.pi / 8)
        work_rates = np.concatenate([normal + share[:, None] * np.einsum("t,mtk->mk", way, tangential) for way in ways])
        k = work_rates.shape[1]
        limits = [(-1.0, 1.0)] * k + [(None, 1.0)]
        rows = np.column_stack((work_rates, np.ones(len(work_rates))))
        optimum = linprog(np.append(np.zeros(k), -1.0), A_ub=rows, b_ub=np.zeros(len(rows)), bounds=limits)
        motion = None if optimum.x is None else np.asarray(optimum.x[:-1])
        return motion if motion is not None and self.pushed(motion).max() < 0 else None


def surface_of(model: Model, pressing: npt.NDArray[np.bool_] | None = None) -> dict[int, LimitSurface]:
    """The contact surface of each assembly; collective.

    Args:
        model: the model.
        pressing: the contact points of this rank that may press, shape (n,); a facet with one of them may; None: all.

    Raises:
        Unproved: something is not known of the surface.
    """
    boundary, motions, law = model.boundary, model.motions, model.law
    assert boundary is not None
    assert model.data is not None
    comm, dim = boundary.comm, boundary.x.shape[1]
    kind = model.tagged.mesh.topology.cell_name()
    for wrong, reason in (
        ("proof by statics" in model.kinematics.refuses, model.kinematics.refuses.get("proof by statics", "")),
        *((True, reason) for _, reason in refused_by(model.statement, REFUSES)),
        (parallel.any_rank(comm, bool(model.data.bilateral.any())), "the foundation can pull"),
        *(
            (contact.friction.acts, reason)
            for contact in model.statement.contact
            for reason in contact.friction.exceptions.values()
        ),
        (parallel.any_rank(comm, law is not None and bool(np.isinf(law.given).any())), "friction has no limit"),
        (parallel.any_rank(comm, bool(boundary.points.immovable.any())), "a support takes the pressure at a node"),
        (compat.geometry_degree(model.tagged.mesh) > model.space.element.basix_element.degree, "the cells are curved"),
        (dim == 3 and kind not in _VERTICES, "facets of several kinds"),
    ):
        if wrong:
            raise Unproved(reason)
    zero = np.zeros(boundary.size)
    base_bound, share = (zero, zero) if law is None else (law.given, law.coefficient)
    able = np.ones(boundary.size) if pressing is None else pressing
    piece = motions.piece[boundary.nodes]
    point_rows = np.column_stack(
        (boundary.part, boundary.global_nodes, boundary.x, boundary.normal, base_bound, share, able, piece)
    )
    all_rows = parallel.gather_rows(comm, point_rows)
    facets = parallel.gather_rows(comm, boundary.segments)
    rows: Nodal = np.asarray(all_rows[np.lexsort((all_rows[:, 1], all_rows[:, 0]))], dtype=np.float64)
    stride = int(max(rows[:, 1].max(), facets[:, 1:].max())) + 1
    keys = rows[:, 0].astype(np.int64) * stride + rows[:, 1].astype(np.int64)
    indices = np.searchsorted(keys, facets[:, :1] * stride + facets[:, 1:])
    if (indices >= len(keys)).any() or (keys[indices] != facets[:, :1] * stride + facets[:, 1:]).any():
        raise Unproved("a facet has nodes that are no contact points")
    return _surfaces(model, rows, indices[:, [0, -1]] if dim == 2 else indices[:, : _VERTICES[kind]], indices)


def _surfaces(
    model: Model, rows: Nodal, corners: npt.NDArray[np.int64], nodes: npt.NDArray[np.int64]
) -> dict[int, LimitSurface]:
    """The surfaces, from what is known of the contact points and the vertices and nodes of the facets among them."""
    motions, dim = model.motions, model.tagged.dimension
    x, normal = rows[:, 2 : 2 + dim], rows[:, 2 + dim : 2 + 2 * dim]
    base_bound, share, able, piece = rows[:, 2 + 2 * dim :].T
    size = model.tagged.size
    turned = np.abs(normal[nodes] - normal[nodes[:, :1]]).max(axis=(1, 2))
    bent = np.abs(np.einsum("fjd,fd->fj", x[nodes] - x[nodes[:, :1]], normal[nodes[:, 0]])).max(axis=1)
    along = bent <= SAME_LENGTH * size
    prescribed = np.array([getattr(contact, "direction", None) is not None for contact in model.statement.contact])
    straight = (turned <= SAME_LENGTH) & (along | prescribed[rows[nodes[:, 0], 0].astype(np.int64)])
    if dim == 3 and not straight.all():
        raise Unproved("the contact surface is not flat")
    # Facets are straight wherever nodes are in line; what bends in between is not known.
    if compat.geometry_degree(model.tagged.mesh) > 1 and not along.all():
        raise Unproved("the cells are curved")
    largest_bound, least = base_bound[nodes].max(axis=1), base_bound[nodes].min(axis=1)
    alike = bool(
        (largest_bound - least <= SAME_LENGTH * largest_bound).all()
        and (np.ptp(share[nodes], axis=1) <= SAME_LENGTH).all()
    )
    at, ways = x[corners], normal[corners]
    stretch: Nodal = np.ones(len(corners))
    if not straight.all():
        at, ways, stretch = _arcs(at, ways)
    count = at.shape[1]
    area = _areas(x[corners])
    free_modes = motions.free.reshape(motions.pieces.count, motions.each, -1)
    of = np.repeat(piece[corners[:, 0]].astype(np.int64), count)
    moved = rigid_modes(at.reshape(-1, dim), motions.centre[of], motions.length[of]) @ free_modes[of]
    flat_ways = ways.reshape(-1, dim)
    along_normal = np.einsum("md,mdk->mk", flat_ways, moved)
    across = np.einsum("mdt,mdk->mtk", tangents_of(flat_ways), moved)
    coefficient = np.repeat(share[nodes].max(axis=1), count)
    pressed = np.repeat(able[nodes].any(axis=1), count)
    surfaces = {}
    for number in np.unique(motions.assembly):
        columns = motions.assembly == number
        in_assembly = motions.pieces.assembly[piece[corners[:, 0]].astype(np.int64)] == number
        inside = np.repeat(in_assembly, count)
        surfaces[int(number)] = LimitSurface(
            along_normal[inside][:, columns],
            across[inside][:, :, columns],
            coefficient[inside],
            pressed[inside] > 0,
            np.arange(count * np.count_nonzero(in_assembly)).reshape(-1, count),
            (largest_bound * area * stretch)[in_assembly],
            flat=bool(straight.all() and alike),
        )
    return surfaces


def _arcs(x: Nodal, normal: Nodal) -> tuple[Nodal, Nodal, Nodal]:
    """Three places and normals of arcs of circles in 2D, shapes (f, 3, 2), and the length of each arc over the
    cosine of half its angle, over its chord, shape (f,).

    A force at the angle t of an arc has the lever r about its centre, on the chord r cos D / cos t, with the angle D
    between an end and the middle.  Both are combinations of forces at the ends and of one in the middle with the lever
    r cos 2D / cos D, two heights of the arc below the chord; their coefficients add up to at most 1 / cos D.

    Args:
        x: both ends, shape (f, 2, 2).
        normal: there, shape (f, 2, 2).
    """
    chord, bisector = x[:, 1] - x[:, 0], normal.sum(axis=1)
    length, cosine = np.linalg.norm(chord, axis=1), np.linalg.norm(bisector, axis=1) / 2
    if (cosine < 0.75).any():
        raise Unproved("the contact surface turns by more than 80 degrees between two nodes")
    if (np.abs(np.einsum("fd,fd->f", bisector, chord)) > LEANING_NORMAL * length).any():
        raise Unproved("the contact surface is neither flat nor an arc of a circle between two nodes")
    middle = bisector / (2 * cosine)[:, None]
    angle = np.arccos(cosine.clip(max=1.0)) * np.sign(np.einsum("fd,fd->f", normal[:, 1] - normal[:, 0], chord))
    third = x.mean(axis=1) - (length * np.tan(angle / 2))[:, None] * middle
    at, ways = np.stack((x[:, 0], x[:, 1], third), axis=1), np.stack((normal[:, 0], normal[:, 1], middle), axis=1)
    return at, ways, 1 / (np.sinc(angle / np.pi) * cosine)


def _areas(x: Nodal) -> Nodal:
    """Lengths or areas of facets from their vertices, shape (f,)."""
    if x.shape[2] == 2:
        return np.asarray(np.linalg.norm(x[:, 1] - x[:, 0], axis=1))
    first = np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1) / 2
    if x.shape[1] == 3:
        return np.asarray(first)
    return np.asarray(first + np.linalg.norm(np.cross(x[:, 1] - x[:, 3], x[:, 2] - x[:, 3]), axis=1) / 2)


def balanced(contact: Reactions, surface: LimitSurface, load: Nodal) -> bool:
    """Whether it is proved that contact tractions of the body balance a load.

    Args:
        contact: the contact points of the assembly.
        surface: its surface.
        load: its work on the motions, force, shape (k,).
    """
    return surface.holds(contact) and _balanced(contact, load)


def excluded(surface: LimitSurface, motion: Nodal, load: Nodal) -> bool:
    """Whether it is proved that no contact tractions of the body balance a load.

    Args:
        surface: of one assembly.
        motion: that the load drives, shape (k,).
        load: its work on the motions, force, shape (k,).
    """
    opened = surface.open(motion / np.linalg.norm(motion))
    if opened is None:
        return False
    driven = float(load @ opened) - _SUM * float(np.abs(load) @ np.abs(opened))
    return driven > surface.taken(opened)


def factor_at_most(surface: LimitSurface, motion: Nodal, dead: Nodal, live: Nodal) -> float:
    """A multiple of a load above which it is proved that no contact tractions of the body balance it; infinite: none.

    Args:
        surface: of one assembly.
        motion: that the load drives beyond its largest multiple, shape (k,).
        dead: the work of the other loads on the motions, force, shape (k,).
        live: that of the load.
    """
    opened = surface.open(motion / np.linalg.norm(motion))
    if opened is None:
        return np.inf
    sizes = np.abs(opened)
    driven = float(live @ opened) - _SUM * float(np.abs(live) @ sizes)
    if driven <= 0:
        return np.inf
    held = surface.taken(opened) - float(dead @ opened) + _SUM * float(np.abs(dead) @ sizes)
    return max(held / driven * (1 + _SUM), 0.0)


def factor_at_least(contact: Reactions, surface: LimitSurface, factor: float, dead: Nodal, live: Nodal) -> float | None:
    """A multiple of a load whose balance by contact tractions of the body is proved; None: that is not.

    Forces at the contact points balance a load that is smaller by those of k independent ones, but for round-off; what
    is missing these k forces take.

    Args:
        contact: the contact points of the assembly.
        surface: its surface.
        factor: a multiple that tractions balance but for round-off.
        dead: the work of the other loads on the motions, force, shape (k,).
        live: that of the load.
    """
    if not surface.holds(contact):
        return None
    if not np.isfinite(factor):
        return np.inf if _balanced(contact, live, unlimited=True) and _balanced(contact, dead + live) else None
    for share in LOWERED_LIMITS:
        if _balanced(contact, dead + factor * (1 - share) * live):
            return factor * (1 - share)
    return None


def _balanced(contact: Reactions, load: Nodal, *, unlimited: bool = False) -> bool:
    """Whether it is proved that forces at contact points balance a load."""
    size, k = float(np.linalg.norm(load)), load.size
    if size == 0.0:
        return False
    pulls = contact.tangential.transpose(1, 0, 2)
    cones = [
        contact.normal + sign * 0.5 * contact.coefficient[:, None] * pull for pull in pulls for sign in (1.0, -1.0)
    ]
    rays = np.concatenate((*cones, *pulls))
    node = np.tile(np.arange(len(contact.normal)), len(cones) + len(pulls))
    two_ways = np.arange(len(rays)) >= len(contact.normal) * len(cones)
    lengths = np.linalg.norm(rays, axis=1)
    able = (lengths > SAME_LENGTH) & (~two_ways | (contact.given > 0)[node])
    if np.count_nonzero(able) < k:
        return False
    rays, node, two_ways = rays[able] / lengths[able, None], node[able], two_ways[able]
    chosen = qr(rays.T, mode="economic", pivoting=True)[2][:k]
    independent = float(np.linalg.svd(rays[chosen], compute_uv=False)[-1])
    if independent <= 1e-3 / k:
        return False
    spare = BALANCED * size / independent
    # A pressure gives way on one side, and is raised by what is spared; friction without pressure on both.
    pushed, rubbed = chosen[~two_ways[chosen]], chosen[two_ways[chosen]]
    base_bound = contact.given.copy()
    base_bound[node[rubbed]] -= 2 * spare / lengths[able][rubbed]
    if base_bound.min(initial=0.0) < 0:
        return False
    near = nearest(replace(contact, given=base_bound), load - spare * rays[pushed].sum(axis=0), unlimited=unlimited)
    missed = (float(np.linalg.norm(near.motion)) + _SUM * k * (near.forces + 1)) * size
    return near.balanced and missed / independent <= spare
