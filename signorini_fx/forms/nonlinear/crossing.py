"""Detection of parts of a body that have passed into each other where there is no contact.

All cells keep their orientation, so the winding number of the displaced boundary around a point is
the number of cells that cover it.  A point just inside the midpoint of a boundary facet is in the
cell of that facet.  If another cell, without a vertex in common, covers it too, two parts of the
body overlap.

The two sides of a contact may overlap by the error of their chords and by a given gap: their
distance is a contact condition, which the certificate checks.
"""

from __future__ import annotations

from dataclasses import dataclass

import basix
import numpy as np
from dolfinx import mesh as dmesh
from scipy.spatial import cKDTree

from signorini_fx.arrays import Array, Flags, Indices, Ints
from signorini_fx.forms.nonlinear.linearised import NonlinearBody
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_entities, facet_nodes, marked_nodes
from signorini_fx.mechanics.assembly.pieces import find_pieces
from signorini_fx.mechanics.obstacles.shapes_inside import BodyCells
from signorini_fx.mechanics.state import State
from signorini_fx.tuned import DIGITS_OF_FILES, NOTABLE


@dataclass(frozen=True)
class Crossing:
    """A part of the body that is inside another part.

    Attributes:
        itself: whether both parts belong to one piece of the mesh.
        text: the boundary, if it has a name, and the coordinates, as text.
    """

    itself: bool
    text: str


@dataclass(frozen=True)
class InnerPoints:
    """The n points just inside the midpoints of boundary facets.

    Attributes:
        x: their displaced positions, length, shape (n, d).
        vertices: global vertex numbers of their cells, shape (n, v).
        piece: numbers of the pieces of the mesh that they belong to, shape (n,).
        named: number of the named part of the boundary, -1 for none, shape (n,).
        touching: whether a node of the facet is on the first and on the second side of each of the
            k pairs, shape (n, k, 2).
    """

    x: Array
    vertices: Ints
    piece: Ints
    named: Ints
    touching: Flags

    @classmethod
    def of(cls, body: NonlinearBody, places: Array) -> InnerPoints:
        """Return the points at the boundary facets of this rank.

        Args:
            body: the body.
            places: displaced nodes, see ``BodyCells.placed``.
        """
        space, forms, cells = body.space, body.forms, body.foundations.cells
        facets = dmesh.exterior_facet_indices(space.mesh.topology)
        entities = facet_entities(space.mesh, facets)
        middles = _corners_of(cells, entities, places).mean(axis=1)
        x = middles + NOTABLE * (cells.corners(places)[entities[:, 0]].mean(axis=1) - middles)
        named = _named(body, facets)
        nodes = facet_nodes(space, facets)
        touching = np.zeros((facets.size, len(forms.masters), 2), dtype=bool)
        for pair, (number, master) in enumerate(forms.masters.items()):
            for side, part in enumerate((forms.facets[number], master)):
                marked = marked_nodes(space, facet_nodes(space, part))
                touching[:, pair, side] = marked[nodes].any(axis=1)
        piece = find_pieces(space.mesh).of_cell[entities[:, 0]]
        return cls(x, cells.vertices[entities[:, 0]], piece, named, touching)

    def taken(self, chosen: Ints | Flags) -> InnerPoints:
        """Return a selection of the points."""
        return InnerPoints(*(values[chosen] for values in vars(self).values()))

    def sent(self, body: NonlinearBody, corners: Array) -> InnerPoints:
        """Return the points of all ranks that may be inside cells of this rank; collective.

        Args:
            body: the body.
            corners: displaced vertices of the cells of this rank.
        """
        comm, corners = body.space.mesh.comm, corners.reshape(-1, self.x.shape[1])
        if comm.size == 1:
            return self
        bounds = corners.min(axis=0, initial=np.inf), corners.max(axis=0, initial=-np.inf)
        boxes = parallel.gather_rows(comm, np.array(bounds)[None])
        within = [((self.x >= low) & (self.x <= high)).all(axis=1) for low, high in boxes]
        parts = parallel.exchanged(comm, [self.taken(chosen) for chosen in within])
        columns = zip(*(vars(part).values() for part in parts), strict=True)
        return InnerPoints(*map(np.concatenate, columns))


def crossing(body: NonlinearBody) -> Crossing | None:
    """Return where the body has passed into itself or into another body of the mesh, at the present
    displacement; collective.

    Of several places it is the one with the largest coordinates; None if there is no overlap.
    """
    comm, cells = body.space.mesh.comm, body.foundations.cells
    places = cells.placed(body.at.x.array)
    points = InnerPoints.of(body, places).sent(body, cells.corners(places))
    at, cell = cells.covering(places, points.x)
    same = points.vertices[at][:, :, None] == cells.vertices[cell][:, None]
    apart = ~same.any(axis=(1, 2))
    found, cell = points.taken(at[apart]), cell[apart]
    if not parallel.any_rank(comm, bool(cell.size)):
        return None
    itself = find_pieces(body.space.mesh).of_cell[cell] == found.piece
    rows = np.column_stack((found.x, found.named, itself))[~_allowed(body, found)]
    rows = parallel.gather_rows(comm, rows)
    if not len(rows):
        return None
    # Places that differ by round-off have the same order on any number of ranks.
    rounded = np.round(rows[:, :-2] / (DIGITS_OF_FILES * body.named[1].size))
    *place, named, within = rows[np.lexsort(rounded.T[::-1])[-1]].tolist()
    names = [f"{name!r} " for name in body.names]
    at_place = f"at ({', '.join(f'{component:.4g}' for component in place)})"
    return Crossing(bool(within), [*names, ""][int(named)] + at_place)


def behind(body: NonlinearBody, last: State) -> dict[int, str]:
    """Return the boundaries that have passed the surface of a foundation without contact since the
    last solution; collective.

    The key is the number of the contact; the text has name, coordinates and depth of the deepest
    facet.

    Args:
        body: the body at the present displacement.
        last: the last solution.
    """
    foundations = body.foundations
    cells = foundations.cells
    mesh = body.space.mesh
    facets = dmesh.exterior_facet_indices(mesh.topology)
    entities = facet_entities(mesh, facets)
    now = _corners_of(cells, entities, cells.placed(body.at.x.array))
    then = _corners_of(cells, entities, cells.placed(last.displacement)).mean(axis=1)
    allowed = NOTABLE * np.linalg.norm(np.ptp(now, axis=1), axis=1)
    names = list(map(repr, body.names))
    moved = foundations.moved_shapes(last.placed)
    passed = dict[int, str]()
    for number, moving in foundations.moving.items():
        others = foundations.moving.items()
        same = [k for k, other in others if other.shape == moving.shape]
        touching = np.isin(facets, np.concatenate([body.forms.facets[k] for k in same]))
        middles = now.mean(axis=1)
        depth = -moving.shape.distance(middles)[0]
        _, earlier = moved.get(number, (None, moving.shape))
        was_outside = -earlier.distance(then)[0] <= allowed
        found = np.flatnonzero(~touching & (depth > allowed) & was_outside)
        named = _named(body, facets[found])
        rows = np.column_stack((depth[found], middles[found], named))
        rows = parallel.gather_rows(mesh.comm, rows)
        if len(rows):
            deepest, *place, name = max(map(tuple, rows))
            who = [*names, "a boundary without a name"][int(name)]
            at_place = ", ".join(f"{component:.4g}" for component in place)
            passed[number] = (
                f"{who} is behind the surface of contact[{number}], by {deepest:.3g} at "
                f"({at_place}), where nothing holds it"
            )
    return passed


def _corners_of(cells: BodyCells, entities: Indices, places: Array) -> Array:
    """Return the displaced vertices of facets, given as pairs (cell, facet of the cell), length,
    shape (n, v, d).
    """
    corners = cells.corners(places)[entities[:, 0]]
    on_facets = np.array(basix.topology(cells.kind)[-2])[entities[:, 1]]
    return np.take_along_axis(corners, on_facets[:, :, None], axis=1)


def _named(body: NonlinearBody, facets: Indices) -> Ints:
    """Return the number of the named boundary part of each facet, -1 for none, shape (n,)."""
    named = np.full(facets.size, -1)
    for number, part in enumerate(body.names.values()):
        named[np.isin(facets, part)] = number
    return named


def _allowed(body: NonlinearBody, points: InnerPoints) -> Flags:
    """Return the flags of points on a side of a contact whose distance to the other side is within
    the allowed overlap, one facet plus the given gap, shape (n,); collective.
    """
    foundations, allowed = body.foundations, np.zeros(len(points.x), dtype=bool)
    dim = points.x.shape[1]
    owned = body.at.x.array.reshape(-1, dim)[: body.space.dofmap.index_map.size_local]
    facing = {number: pair.sides for number, pair in foundations.pairs.items()}
    facing |= {number: pair.sides for number, pair in foundations.sliding.items()}
    for pair, number in enumerate(body.forms.masters):
        sides = facing[number]
        gap = foundations.given_gap(number)
        added = max(parallel.largest(body.space.mesh.comm, gap[np.isfinite(gap)]), 0.0)
        moved = np.split(sides.gathered(owned), [sides.slave.nodes.size])
        both = (sides.slave.surface, sides.master.surface)
        near = list[Flags]()
        for side, way in zip(both, moved, strict=True):
            nodes = np.unique(side.nodes)
            if not nodes.size:  # a surface that may touch itself, but does not
                near.append(np.zeros(len(points.x), dtype=bool))
                continue
            extent = np.linalg.norm(np.ptp(side.displaced(way).corners, axis=1), axis=1)
            size = np.zeros(len(side.x))
            np.maximum.at(size, side.nodes, extent[:, None])
            distance, nearest = cKDTree((side.x + way)[nodes]).query(points.x)
            near.append(distance <= size[nodes[nearest]] + added)
        opposite = points.touching[:, pair] & np.column_stack(near[::-1])
        # On a surface that touches itself it is near both parts.
        allowed |= opposite.all(axis=1) if sides.one else opposite.any(axis=1)
    return allowed
