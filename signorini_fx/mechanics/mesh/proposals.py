"""Contacts that a mesh of several bodies suggests: pairs of surfaces that touch or nearly do.

A line from the middle of each facet along its normal finds the nearest facet of another body that
faces it.  Flat facets deviate from the arcs they represent, on both sides of a pair alike; so the
mean of the distances over both sides shows whether surfaces touch, while single distances do not.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from signorini_fx.arrays import Array, Ints, inner, rmatvec
from signorini_fx.mechanics.mesh.files.arrays import (
    MeshArrays,
    pieces_of,
    row_keys,
    rows_of,
    sides_of,
)
from signorini_fx.mechanics.mesh.files.cells import measures
from signorini_fx.tuned import JUDGED_SAME_PLACE, LEAST_PAIR, NEAR_BODIES, SAME_LENGTH, SHARP_EDGE

_SMOOTH = np.cos(np.radians(SHARP_EDGE))
# Facets face each other where the product of their normals is below this: within 45 degrees.
_OPPOSITE = -np.sqrt(0.5)


@dataclass(frozen=True)
class ProposedContact:
    """Two surfaces of two bodies that touch, overlap, or are near each other.

    Attributes:
        name: the names of both bodies, with a number where they have several contacts.
        bodies: the names of both bodies.
        sides: the names of the boundaries of each side; the first side should carry the contact
            points.
        gap: distance, length, negative where they overlap: the mean over both sides, or the
            smallest one of surfaces that diverge, as those of a roller on a track.
        extremes: smallest and largest distance of a facet, length.
        area: area of the parts that face each other, in 2D a length.
        sagitta: largest deviation of the facets of both sides from their arcs, length.
        kind: ``touches``, ``clearance`` or ``overlap``.
        shared: whether both sides are also sides of other contacts, so that no side can carry the
            points of this one.
    """

    name: str
    bodies: tuple[str, str]
    sides: tuple[tuple[str, ...], tuple[str, ...]]
    gap: float
    extremes: tuple[float, float]
    area: float
    sagitta: float
    kind: str
    shared: bool = False

    @property
    def fitted(self) -> bool:
        """Whether the sides are curved and run alongside each other, as a pin in a bore."""
        return self.sagitta > 0.0 and _alongside(self.extremes, self.sagitta)


@dataclass(frozen=True)
class Proposals:
    """The contacts that a mesh suggests, by decreasing area.

    Attributes:
        bodies: names of the pieces of the mesh.
        contacts: the pairs found.
        unnamed: points, shape (d,), at which a surface without a name is near another body.
    """

    bodies: tuple[str, ...]
    contacts: tuple[ProposedContact, ...]
    unnamed: tuple[Array, ...]


def proposed_contacts(mesh: MeshArrays, within: float | None = None) -> Proposals:
    """Return the contacts between the bodies of a mesh.

    Args:
        mesh: its boundaries have names or numbers.
        within: distance, length, up to which surfaces are near; None: a quarter of a facet.
    """
    names, piece = _bodies(mesh)
    facets = _Facets.of(mesh, piece)
    reach = NEAR_BODIES * facets.length
    if within is not None:
        reach = np.full(len(facets.length), within)
    found = _pairs(facets, *_nearest(facets, reach))
    pairs = [pair for pair in found if pair.share >= LEAST_PAIR]
    named = [pair for pair in pairs if min(pair.labels) >= 0]
    lost = [pair for pair in pairs if min(pair.labels) < 0]
    contacts = _joined(named, facets, list(mesh.boundaries), names, mesh.diagonal)
    return Proposals(tuple(names), tuple(_with_sides(contacts)), tuple(pair.place for pair in lost))


def _bodies(mesh: MeshArrays) -> tuple[list[str], Ints]:
    """Return the names of the pieces of a mesh, and the number of the piece of each cell, shape
    (m,).
    """
    piece = pieces_of(mesh)
    names = [f"body_{number + 1}" for number in range(piece.max() + 1)]
    for name, rows in sorted(mesh.regions.items(), key=lambda item: -len(item[1])):
        inside = np.unique(piece[rows])
        if len(inside) == 1 and len(rows) == np.count_nonzero(piece == inside[0]):
            names[inside[0]] = name
    return names, piece


@dataclass(frozen=True)
class _Facets:
    """The exterior facets of a mesh, f of them, as flat pieces.

    Attributes:
        corners: their positions, length, shape (f, c, d).
        normal: outward unit normals, shape (f, d).
        area: area of the curved facet, shape (f,).
        body: number of the body of each, shape (f,).
        label: number of the boundary of each, shape (f,); without a name a negative number, one for
            each smooth surface.
        length: longest edge of each, shape (f,).
        sagitta: deviation of each from its arc, length, shape (f,).
        neighbours: pairs of labels whose surfaces meet smoothly.
    """

    corners: Array
    normal: Array
    area: Array
    body: Ints
    label: Ints
    length: Array
    sagitta: Array
    neighbours: frozenset[tuple[int, int]]

    @classmethod
    def of(cls, mesh: MeshArrays, piece: Ints) -> _Facets:
        """Return the facets of a mesh.

        ``piece``: the body of each cell, shape (m,).
        """
        width = len(mesh.facet.corners)
        sides = sides_of(mesh.cells, mesh.cell)
        keys = row_keys(sides[:, :width])
        side = np.flatnonzero(np.bincount(keys)[keys] == 1)
        cell = side // len(mesh.cell.facet_nodes)
        nodes = sides[side, :width]
        corners = mesh.points[nodes]
        edges = corners[:, 1:] - corners[:, :1]
        if mesh.dim == 2:
            normal = np.stack((edges[:, 0, 1], -edges[:, 0, 0]), axis=1)
        else:
            normal = np.asarray(np.cross(edges[:, 0], edges[:, 1]), dtype=np.float64)
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        outward = corners.mean(axis=1) - mesh.points[mesh.corners[cell]].mean(axis=1)
        normal *= np.sign(inner(normal, outward))[:, None]
        ends = list(combinations(range(nodes.shape[1]), 2))
        length = np.max([np.linalg.norm(corners[:, a] - corners[:, b], axis=1) for a, b in ends], 0)
        first, second = _beside(nodes, mesh.dim)
        angle = np.arccos(np.clip(inner(normal[first], normal[second]), -1.0, 1.0))
        smooth = np.cos(angle) > _SMOOTH
        first = first[smooth]
        second = second[smooth]
        angle = angle[smooth]
        turn = np.zeros(len(side))
        np.maximum.at(turn, np.concatenate((first, second)), np.concatenate((angle, angle)))
        label = _labels(mesh, nodes, first, second)
        met = np.unique(np.sort(np.stack((label[first], label[second]), axis=1), axis=1), axis=0)
        return cls(
            corners,
            normal,
            measures(mesh.points, sides[side], mesh.facet),
            piece[cell],
            label,
            length,
            length * np.where(turn > np.sqrt(SAME_LENGTH), turn, 0.0) / 8.0,
            frozenset((int(a), int(b)) for a, b in met),
        )


def _beside(nodes: Ints, dimension: int) -> tuple[Ints, Ints]:
    """Return the pairs of facets that share an edge, in 2D a node: their numbers, shape (e,) each.

    ``nodes``: the corners of the facets, shape (f, c).
    """
    columns = list(combinations(range(nodes.shape[1]), dimension - 1))
    keys = row_keys(np.concatenate([nodes[:, list(ends)] for ends in columns]))
    facet = np.tile(np.arange(len(nodes)), len(columns))
    order = np.argsort(keys, kind="stable")
    same = np.flatnonzero(keys[order][1:] == keys[order][:-1])
    return facet[order[same]], facet[order[same + 1]]


def _labels(mesh: MeshArrays, nodes: Ints, first: Ints, second: Ints) -> Ints:
    """Return the number of the boundary of each exterior facet, shape (f,).

    If there are several, it is the one with the fewest facets; smooth surfaces without a name get
    negative numbers.

    Args:
        mesh: the mesh with its boundaries.
        nodes: corners of each exterior facet, shape (f, c).
        first: one facet of each pair that meets smoothly, shape (e,).
        second: the other facet of each pair.
    """
    row = rows_of(nodes, mesh.facet_corners)
    of_row = np.full(len(mesh.facets) + 1, -1)  # the last one is that of facets without a row
    boundaries = list(enumerate(mesh.boundaries.values()))
    for number, rows in sorted(boundaries, key=lambda item: -len(item[1])):
        of_row[rows] = number
    label = of_row[row]
    within = (label[first] < 0) & (label[second] < 0)
    links = coo_array(
        (np.ones(np.count_nonzero(within), dtype=bool), (first[within], second[within])),
        shape=(len(nodes), len(nodes)),
    )
    surface = connected_components(links, directed=False)[1]
    return np.where(label < 0, -1 - surface, label)


def _nearest(facets: _Facets, reach: Array) -> tuple[Ints, Ints, Array]:
    """Return the facet of another body that each facet faces first along its normal.

    Args:
        facets: the facets of all bodies.
        reach: distance up to which each facet looks, length, shape (f,); of two facets the larger
            one counts.

    Returns:
        The numbers of both facets of each pair, and their signed distance, length, shape (p,) each.
    """
    centre = facets.corners.mean(axis=1)
    radius = np.linalg.norm(facets.corners - centre[:, None], axis=2).max(axis=1)
    rows = []
    others = []
    # Classes of facets of about the same length, so that large ones do not make all balls large.
    classes = np.floor(np.log2(facets.length))
    for number in np.unique(classes):
        members = np.flatnonzero(classes == number)
        farthest = np.maximum(reach, reach[members].max()) + facets.sagitta
        farthest += facets.sagitta[members].max() + radius[members].max()
        near = cKDTree(centre[members]).query_ball_point(centre, farthest)
        sizes = [len(found) for found in near]
        rows.append(np.repeat(np.arange(len(centre)), sizes))
        others.append(members[np.concatenate([*near, []]).astype(np.int64)])
    first = np.concatenate(rows)
    second = np.concatenate(others)
    cosine = inner(facets.normal[first], facets.normal[second])
    facing = cosine < _OPPOSITE
    first = first[facing]
    second = second[facing]
    distance = _along_normal(facets, centre, first, second)
    allowed = np.maximum(reach[first], reach[second])
    allowed = allowed + facets.sagitta[first] + facets.sagitta[second]
    same = facets.body[first] == facets.body[second]
    # The back of its own body hides everything behind it.
    kept = np.where(same, distance < 0.0, np.abs(distance) <= allowed) & np.isfinite(distance)
    first, second, distance, same = (array[kept] for array in (first, second, distance, same))
    order = np.lexsort((np.abs(distance), first))
    once = order[np.unique(first[order], return_index=True)[1]]
    once = once[~same[once]]
    return first[once], second[once], distance[once]


def _along_normal(facets: _Facets, centre: Array, first: Ints, second: Ints) -> Array:
    """Return the distance from the middle of the first facets to the second ones along the normal
    of the first, length, shape (p,); infinite where the line misses the second.
    """
    x = centre[first]
    n = facets.normal[first]
    distance = inner(centre[second] - x, facets.normal[second])
    distance /= inner(n, facets.normal[second])
    met = x + distance[:, None] * n
    corners = facets.corners[second]
    hit = np.zeros(len(first), dtype=bool)
    # A quadrilateral is the union of the triangles of any three of its corners.
    for ends in combinations(range(corners.shape[1]), corners.shape[2]):
        origin = corners[:, ends[0]]
        edges = np.stack([corners[:, end] - origin for end in ends[1:]], axis=2)
        gram = np.einsum("pdi,pdj->pij", edges, edges)
        right = rmatvec(edges, met - origin)
        share = np.linalg.solve(gram, right[..., None])[..., 0]
        tiny = np.sqrt(SAME_LENGTH)
        hit |= (share >= -tiny).all(axis=1) & (share.sum(axis=1) <= 1.0 + tiny)
    return np.where(hit, distance, np.inf)


@dataclass(frozen=True)
class _Pair:
    """Two surfaces that face each other: ``labels`` and ``bodies`` of both, and their measured
    properties.
    """

    labels: tuple[int, int]
    bodies: tuple[int, int]
    gap: float
    extremes: tuple[float, float]
    area: float
    share: float
    sagitta: float
    lengths: tuple[float, float]
    place: Array
    exact: bool  # whether the gap is that of the surfaces, which facets leave


def _pairs(facets: _Facets, first: Ints, second: Ints, distance: Array) -> Iterator[_Pair]:
    """Yield the pairs of surfaces that the pairs of facets form."""
    keys = np.stack((facets.body[first], facets.label[first]), axis=1)
    opposite = np.stack((facets.body[second], facets.label[second]), axis=1)
    turned = (keys > opposite)[:, 0]
    keys[turned], opposite[turned] = opposite[turned], keys[turned]
    table, row = np.unique(np.hstack((keys, opposite)), axis=0, return_inverse=True)
    row = row.reshape(-1)
    for number in range(len(table)):
        body, label, other_body, other = (int(value) for value in table[number])
        of_pair = row == number
        directions = [of_pair & ~turned, of_pair & turned]
        areas = [facets.area[first[rows]].sum() for rows in directions]
        surfaces = [
            (facets.label == name) & (facets.body == of)
            for name, of in ((label, body), (other, other_body))
        ]
        wholes = [facets.area[rows].sum() for rows in surfaces]
        weight = facets.area[first[of_pair]]
        mean = float(distance[of_pair] @ weight / weight.sum())
        sagitta = float((facets.sagitta[first[of_pair]] + facets.sagitta[second[of_pair]]).max())
        extremes = float(distance[of_pair].min()), float(distance[of_pair].max())
        gap = mean if _alongside(extremes, sagitta) else extremes[0]
        exact = False
        if sagitta > 0.0 and _alongside(extremes, sagitta):
            radii = [_radius(facets.corners[rows], facets.normal[rows]) for rows in surfaces]
            exact = radii[0] * radii[1] < 0.0
            gap = -sum(radii) if exact else gap
        yield _Pair(
            (label, other),
            (body, other_body),
            gap,
            extremes,
            float(sum(areas) / max(np.count_nonzero(areas), 1)),
            float(max(area / whole for area, whole in zip(areas, wholes, strict=True))),
            sagitta,
            (facets.length[surfaces[0]].mean(), facets.length[surfaces[1]].mean()),
            facets.corners[first[of_pair][0]].mean(axis=0),
            exact,
        )


def _radius(corners: Array, normals: Array) -> float:
    """Return the radius of the circle, sphere or cylinder through the corners of facets, length,
    negative if concave; 0 if there is none.

    Corners of meshes lie on the true surface, while facets deviate from it.

    ``corners``: shape (f, c, d); ``normals``: outward normals of the facets.
    """
    middles = corners.mean(axis=1)
    x = np.unique(corners.reshape(-1, corners.shape[2]), axis=0)
    size = np.linalg.norm(np.ptp(x, axis=0))

    def ball(points: Array) -> tuple[Array, float, Array]:
        """Centre and radius of the ball closest to points, and by how much each is off it."""
        # |x|^2 = 2 c . x + r^2 - |c|^2
        rows = np.column_stack((2.0 * points, np.ones(len(points))))
        *centre, rest = np.linalg.lstsq(rows, (points**2).sum(axis=1), rcond=None)[0]
        radius = np.sqrt(max(rest + np.dot(centre, centre), 0.0))
        away = np.linalg.norm(points - centre, axis=1)
        return np.array(centre), float(radius), away - radius

    def across(turned: Array) -> Array:
        """Return two unit vectors across the axis of normals that is turned by two numbers."""
        axis = frame[2] + turned @ frame[:2]
        return np.linalg.svd(axis[None])[2][1:]

    plane = np.eye(x.shape[1])
    centre, radius, off = ball(x)
    if x.shape[1] == 3 and np.abs(off).max() > JUDGED_SAME_PLACE * size:
        from scipy.optimize import least_squares

        frame = np.linalg.svd(normals, full_matrices=True)[2]
        found = least_squares(lambda turned: ball(x @ across(turned).T)[2], np.zeros(2), xtol=1e-15)
        plane = across(found.x)
        centre, radius, off = ball(x @ plane.T)
    if np.abs(off).max() > JUDGED_SAME_PLACE * size:
        return 0.0
    outwards = inner(normals @ plane.T, middles @ plane.T - centre)
    return radius * float(np.sign(outwards.sum()))


def _alongside(extremes: tuple[float, float], sagitta: float) -> bool:
    """Return whether the extreme distances, length, differ by no more than the facets of both sides
    may deviate from their arcs.
    """
    return extremes[1] - extremes[0] <= 2.0 * sagitta


def _joined(
    pairs: Sequence[_Pair],
    facets: _Facets,
    labels: Sequence[str],
    bodies: Sequence[str],
    size: float,
) -> list[ProposedContact]:
    """Return the contacts; pairs of the same bodies and kind whose surfaces meet smoothly become
    one, as both halves of a bore.

    ``size``: size of the mesh, length.
    """

    def meet(one: int, other: int) -> bool:
        return one == other or (min(one, other), max(one, other)) in facets.neighbours

    def kind_of(pair: _Pair) -> str:
        # The mean is right within a twentieth of the sagitta, a single distance within all of it.
        share = 0.05 if _alongside(pair.extremes, pair.sagitta) else 1.0
        share = 0.0 if pair.exact else share
        if abs(pair.gap) <= max(JUDGED_SAME_PLACE * size, share * pair.sagitta):
            return "touches"
        return "clearance" if pair.gap > 0.0 else "overlap"

    kinds = [kind_of(pair) for pair in pairs]
    links = np.eye(len(pairs), dtype=bool)
    for (i, one), (j, other) in combinations(enumerate(pairs), 2):
        links[i, j] = (one.bodies, kinds[i]) == (other.bodies, kinds[j]) and all(
            map(meet, one.labels, other.labels)
        )
    group = connected_components(links, directed=False)[1] if pairs else []
    found = []
    for number in range(max(group, default=-1) + 1):
        members = [pair for pair, of in zip(pairs, group, strict=True) if of == number]
        area = sum(pair.area for pair in members)
        sides = [tuple(sorted({labels[pair.labels[k]] for pair in members})) for k in (0, 1)]
        lengths = np.mean([pair.lengths for pair in members], axis=0)
        names = [bodies[body] for body in members[0].bodies]
        if lengths[1] < lengths[0]:  # the finer side carries the points
            sides.reverse()
            names.reverse()
        found.append(
            ProposedContact(
                "_".join(sorted(names)),
                (names[0], names[1]),
                (sides[0], sides[1]),
                sum(pair.gap * pair.area for pair in members) / area,
                (min(p.extremes[0] for p in members), max(p.extremes[1] for p in members)),
                area,
                max(pair.sagitta for pair in members),
                kinds[pairs.index(members[0])],
            )
        )
    return sorted(found, key=lambda contact: -contact.area)


def _with_sides(contacts: Sequence[ProposedContact]) -> Iterator[ProposedContact]:
    """Yield the contacts with unique names, and with sides exchanged where the first side is used
    by several contacts but the second is not.
    """
    uses = Counter(name for contact in contacts for side in contact.sides for name in side)
    seen: Counter[str] = Counter()
    for contact in contacts:
        seen[contact.name] += 1
        number = seen[contact.name]
        several = [any(uses[name] > 1 for name in side) for side in contact.sides]
        if several[0] and not several[1]:
            contact = replace(contact, bodies=contact.bodies[::-1], sides=contact.sides[::-1])
        yield replace(
            contact,
            name=contact.name if number == 1 else f"{contact.name}_{number}",
            shared=all(several),
        )
