"""Ties of single nodes and cyclic symmetry of an Abaqus input file, as links between nodes.  No dolfinx here.

A node is linked to the place of the other side that is closest to it: its displacement is that of this place, by the
shape functions there, in cyclic symmetry turned by the angle of a sector.
"""

from __future__ import annotations

import numpy as np

from signorini_fx.addons.decks.content import Deck
from signorini_fx.addons.decks.keywords import UNTOUCHED_SECTOR
from signorini_fx.addons.decks.nodal import Term, link_nodes
from signorini_fx.mechanics.mesh.files.abaqus_blocks import DeckBlock, real
from signorini_fx.mechanics.mesh.files.abaqus_sectors import Sectors, asks_for_contact, sectors_of
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.cells import Cell
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.tuned import FACET_DIFFERENCE, SAME_LENGTH, SAME_POSITION, TIED_AT_MOST

# Steps of Newton's method for the closest place of a facet, and facets that are tried for each node.
_STEPS, _FACETS_OF_NODE = 12, 8


def surface_nodes(deck: Deck, name: str) -> Ints:
    """Nodes of the mesh on a surface of faces, or those of a set with what completes whole facets between them."""
    if (where := deck.boundary(name)) is not None:
        on_facets = np.unique(deck.mesh.facets[deck.mesh.boundaries[where]])
    else:
        on_facets = np.empty(0, np.int64)
    listed = np.searchsorted(deck.numbers, deck.nodes(name))
    return np.union1d(on_facets, listed).astype(np.int64)


def surface_facets(deck: Deck, nodes: Ints) -> Ints:
    """Rows of the facets of the mesh all of whose corners are among some nodes."""
    return np.flatnonzero(np.isin(deck.mesh.facet_corners, nodes).all(axis=1))


def distances(deck: Deck, nodes: Ints, where: str) -> Floats:
    """How far some nodes of the mesh are from a boundary, length, shape (n,)."""
    x, fixed = deck.mesh.points, np.unique(deck.mesh.facets[deck.mesh.boundaries[where]])
    near = SAME_POSITION * float(np.linalg.norm(np.ptp(x, axis=0)))
    closest = _closest(deck, x[nodes], fixed, near)
    places = [sum(weight * x[other] for other, weight in weights.items()) for weights in closest]
    return np.linalg.norm(x[nodes] - np.array(places).reshape(len(nodes), x.shape[1]), axis=1)


def tie_nodes(deck: Deck, block: DeckBlock, slave: str, master: str) -> bool:
    """Tie the nodes of one side, which fill no whole facets, to the other one.

    Returns:
        Whether both sides are there.
    """
    moving, fixed = surface_nodes(deck, slave), surface_nodes(deck, master)
    if not moving.size or not fixed.size:
        return False
    tolerance = block.parameters.get("POSITIONTOLERANCE")
    reach = np.inf if tolerance is None else real(tolerance)
    far = _link(deck, block, np.setdiff1d(moving, fixed), fixed, np.eye(3), reach)
    if far:
        deck.note(block, f"{far} nodes of {slave!r} are further than {reach:g} from {master!r}: they are not tied")
    return True


def link_sectors(deck: Deck, block: DeckBlock) -> None:
    """*CYCLIC SYMMETRY MODEL: one side of a sector moves as the other one, turned about the axis.

    Raises:
        DeckError: the number of sectors or the axis is wrong.
    """
    sectors = sectors_of(block, deck.model.blocks)
    slave, master = sectors.slave, sectors.master
    if asks_for_contact(block):
        _link_images(deck, block, sectors)
        return
    moving, fixed = surface_nodes(deck, slave), surface_nodes(deck, master)
    missing = [name for name, nodes in ((slave, moving), (master, fixed)) if not nodes.size]
    if missing or deck.mesh.dim == 2:
        deck.lose(block, f"cyclic symmetry: {missing[0]!r} is no surface of the body" if missing else "in the plane")
        return
    x = deck.mesh.points
    turn = sectors.turn(x[moving], x[fixed])
    size = float(np.linalg.norm(np.ptp(x, axis=0)))
    far = _link(deck, block, moving, fixed, turn, TIED_AT_MOST * size, sectors.first)
    if far:
        deck.lose(block, f"cyclic symmetry: {far} of {len(moving)} nodes of {slave!r} find no place of {master!r}")


def _link_images(deck: Deck, block: DeckBlock, sectors: Sectors) -> None:
    """What a sector touches of the next one moves as its own nodes, turned."""
    sector = deck.model.sectors.get(block.number)
    region = None if sector is None else deck.region(sector.region)
    if sector is None or region is None:
        names = f"*CONTACT PAIR of {sectors.slave!r} and the faces {sectors.master!r}"
        deck.lose(block, f"{UNTOUCHED_SECTOR}: no {names}")
        deck.unpaired.add(frozenset((sectors.slave.upper(), sectors.master.upper())))
        return
    x, cells, of_file = deck.mesh.points, deck.mesh.cells, len(deck.numbers)
    images, originals = (
        np.array([deck.node(deck.model.places[name]) for name in names])
        for names in (sector.images, sector.images.values())
    )
    # Nodes that complete the cells of the file, or divide them, are images of those of the same cells.
    added = np.setdiff1d(cells[deck.mesh.regions[region]], images)
    if added.size:
        from scipy.spatial import cKDTree

        sector_cells = cells[(np.isin(cells, originals) | (cells >= of_file)).all(axis=1)]
        completing = np.setdiff1d(sector_cells, originals)
        nearest = cKDTree(sectors.turned(x[completing], sector.turn)).query(x[added])[1]
        images, originals = np.append(images, added), np.append(originals, completing[nearest])
    unit = np.eye(3)
    for image, original in zip(plain(images), plain(originals), strict=True):
        for k in range(3):
            link_nodes(deck, block, [(image, unit[k]), (original, -sector.turn[k])])


def _link(
    deck: Deck, block: DeckBlock, moving: Ints, fixed: Ints, turn: Floats, reach: float, about: Floats | None = None
) -> int:
    """Link nodes to the closest places of the other side: R y of the node is the displacement of the place.

    Args:
        deck: what has been read.
        block: that ties them.
        moving: nodes of the mesh.
        fixed: those of the other side.
        turn: R, from the node to the place, shape (3, 3).
        reach: nodes further from the other side are left free.
        about: a point of the axis of R.

    Returns:
        How many are.
    """
    dim = deck.mesh.dim
    about, turn = (np.zeros(3) if about is None else about)[:dim], turn[:dim, :dim]
    x = deck.mesh.points
    places = (x[moving] - about) @ turn.T + about
    near = SAME_POSITION * float(np.linalg.norm(np.ptp(x, axis=0)))
    free = 0
    for node, point, weights in zip(moving, places, _closest(deck, places, fixed, near), strict=True):
        away = float(np.linalg.norm(sum(weight * x[other] for other, weight in weights.items()) - point))
        if away > reach:
            free += 1
            continue
        for k in range(dim):
            along: Floats = np.zeros(3)
            along[:dim] = turn[k]
            unit = np.eye(3)[k]
            terms: list[Term] = [(int(node), along), *((other, -weight * unit) for other, weight in weights.items())]
            link_nodes(deck, block, terms)
    return free


def _closest(deck: Deck, places: Floats, fixed: Ints, near: float) -> list[dict[int, float]]:
    """For each place the nodes of the closest one of a surface, and their weights there."""
    from scipy.spatial import cKDTree

    x, cell = deck.mesh.points, deck.mesh.facet
    away, closest = cKDTree(x[fixed]).query(places)
    facets = deck.mesh.facets[surface_facets(deck, fixed)]
    result: list[dict[int, float]] = [{int(fixed[row]): 1.0} for row in closest]
    lonely = np.flatnonzero(away > near)
    if not lonely.size or not len(facets):
        return result
    middles = x[facets].mean(axis=1)
    count = min(_FACETS_OF_NODE, len(facets))
    candidates = np.asarray(cKDTree(middles).query(places[lonely], k=count)[1]).reshape(lonely.size, count)
    for row, rows in zip(lonely, candidates, strict=True):
        best = float(away[row])
        for nodes in facets[rows]:
            weights = _weights_at(cell, x[nodes], places[row])
            distance = float(np.linalg.norm(weights @ x[nodes] - places[row]))
            if distance < best:
                best = distance
                pairs = zip(plain(nodes), plain(weights), strict=True)
                result[row] = {node: weight for node, weight in pairs if abs(weight) > SAME_LENGTH}
    return result


def _weights_at(cell: Cell, x: Floats, point: Floats) -> Floats:
    """Shape functions at the closest place of a facet with nodes of shape (n, d)."""
    at = np.mean(np.array(cell.corners, dtype=np.float64), axis=0)
    dim = cell.dim
    for _ in range(_STEPS):
        steps = np.vstack((at, at + FACET_DIFFERENCE * np.eye(dim), at - FACET_DIFFERENCE * np.eye(dim)))
        positions = cell.shape(steps) @ x
        slopes = (positions[1 : dim + 1] - positions[dim + 1 :]) / (2 * FACET_DIFFERENCE)
        move = np.linalg.lstsq(slopes.T, point - positions[0], rcond=None)[0]
        at = _inside(cell, at + move)
        if np.abs(move).max() < SAME_LENGTH:
            break
    return np.asarray(cell.shape(at[None])[0])


def _inside(cell: Cell, at: Floats) -> Floats:
    """A place of the reference facet: the closest one to another place, of a triangle nearly."""
    at = np.clip(at, 0.0, 1.0)
    return np.asarray(at / max(1.0, float(at.sum()))) if cell.simplex else at
