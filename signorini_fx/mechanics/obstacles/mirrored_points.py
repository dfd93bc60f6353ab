"""Contact points of two bodies on a plane across which supports hold both: a plane of symmetry.

The half that is not modelled is the mirror image of the one that is.  With both, the function of a point on the plane
is even across it, whereas the relative displacement across the plane is odd, and their product integrates to zero; the
half alone would meet what the other body moves beside the plane, and the point a shear that nothing determines, as the
node of the slave cannot follow it.  So at such a point the relative displacement has no component across the plane,
which leaves no traction across it, and the normal, the mean of those on both halves, is in 2D.  A model of one
half is then that of both.  A plane beyond which a side goes on is none of symmetry, whatever supports hold there: what
is found must not depend on whether nodes of both sides happen to be over each other.  On an axis of revolution the
normal is the mean all around, and so along the axis, also at the tip of a cone.  Where one body alone is held, or is
moved by its support, the point keeps all components.
(Multipliers where Dirichlet conditions meet a mortar interface: Wohlmuth, SIAM J. Numer. Anal. 38 (2000) 989-1012;
Puso and Laursen, Comput. Methods Appl. Mech. Engrg. 193 (2004) 601-629.)
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from signorini_fx.mechanics.pairs.pair_side import PairSurface
from signorini_fx.tuned import ASKEW_NORMAL, DIGITS_OF_FILES, SAME_DIRECTION

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Numbers = npt.NDArray[np.int64]


def mirrored(
    slave: PairSurface,
    master: PairSurface,
    at_rest: tuple[tuple[Array, Flags], tuple[Array, Flags]],
    on_axis: Flags | None = None,
) -> Array:
    """Projectors onto the directions across planes of symmetry at the nodes of the slave, shape (N, d, d).

    Args:
        slave: the side with the points.
        master: the other side.
        at_rest: of both sides a frame at each node, one direction per column, shape (N, d, d), and along which of them
            supports hold it where it is, shape (N, d).
        on_axis: nodes of the slave on the axis x[0] = 0 of a body of revolution, shape (N,); None: there is no axis.
    """
    (frames, held), (axes, master_held) = at_rest
    slave_projectors = np.zeros_like(frames)
    holding = np.flatnonzero(master_held.any(axis=1))
    on_slave, on_master = (np.zeros(len(side.x), dtype=bool) for side in (slave, master))
    on_slave[slave.points], on_master[master.nodes] = True, True
    held = held & on_slave[:, None]
    if not held.any() or not holding.size:
        return slave_projectors
    projectors = np.einsum("nik,nk,njk->nij", axes[holding], master_held[holding].astype(np.float64), axes[holding])
    size = max(float(np.linalg.norm(np.ptp(side.corners, axis=1), axis=1).max()) for side in (slave, master))
    within = DIGITS_OF_FILES * size
    nodes, columns = np.nonzero(held)
    across = frames[nodes, :, columns]
    along_side = np.abs(np.einsum("ni,ni->n", slave.nodal_normals[nodes], across)) <= ASKEW_NORMAL
    if on_axis is not None:
        along_side |= on_axis[nodes] & (np.abs(across[:, 1:]).max(axis=1) <= SAME_DIRECTION)
    own_sides = _sides_of_planes(slave, nodes, across, within)
    nodes, across, own_sides = (values[along_side & own_sides.any(axis=1)] for values in (nodes, across, own_sides))
    reach = size + cKDTree(master.x[on_master]).query(slave.x[nodes])[0]
    beside = cKDTree(master.x[holding]).query_ball_point(slave.x[nodes], reach)
    rows = np.repeat(np.arange(len(nodes)), [len(numbers) for numbers in beside])
    partners = np.concatenate([*beside, []]).astype(np.int64)
    apart, normals = master.x[holding[partners]] - slave.x[nodes[rows]], across[rows]
    left_over = np.einsum("nij,nj->ni", projectors[partners], normals) - normals
    in_plane = np.abs(np.einsum("ni,ni->n", apart, normals)) < within
    in_plane &= np.linalg.norm(left_over, axis=1) < DIGITS_OF_FILES
    rows, partners = rows[in_plane], partners[in_plane]
    both = own_sides[rows] & _sides_of_planes(master, holding[partners], across[rows], within)
    ends = np.unique(rows[both.any(axis=1)])
    np.add.at(slave_projectors, nodes[ends], np.einsum("ni,nj->nij", across[ends], across[ends]))
    return slave_projectors


def _sides_of_planes(surface: PairSurface, nodes: Numbers, across: Array, within: float) -> Flags:
    """Whether all facets around a node lie ahead of a plane through it, and whether all lie behind it: both where they
    are in it, and neither where the plane cuts the surface; shape (n, 2).

    Args:
        surface: with the nodes.
        nodes: their numbers, shape (n,).
        across: the normals of the planes, of length one, shape (n, d).
        within: how far facets may reach beyond a plane, length.
    """
    order = np.argsort(surface.nodes, axis=None, kind="stable")
    sorted_nodes = surface.nodes.ravel()[order]
    first, last = np.searchsorted(sorted_nodes, nodes), np.searchsorted(sorted_nodes, nodes, side="right")
    rows = np.repeat(np.arange(len(nodes)), last - first)
    at = np.arange(len(rows)) - np.repeat(np.cumsum(last - first) - last, last - first)
    around = surface.nodes[order[at] // surface.nodes.shape[1]]
    ahead = np.einsum("nki,ni->nk", surface.x[around] - surface.x[nodes[rows], None], across[rows])
    sides = np.ones((len(nodes), 2), dtype=bool)
    for column, sign in enumerate((1, -1)):
        sides[rows[(sign * ahead < -within).any(axis=1)], column] = False
    return sides
