"""Contact points of two bodies on a plane across which supports hold both: a plane of symmetry.

The half that is not modelled is the mirror image of the one that is.  With both, the function of a point on the plane
is even across it, whereas the relative displacement across the plane is odd, and their product integrates to zero; the
half alone would meet what the other body moves beside the plane, and the point a shear that nothing determines, as the
node of the slave cannot follow it.  So at such a point the relative displacement has no component across the plane,
which leaves no traction across it, and the normal, the mean of those on both halves, is in the plane.  A model of one
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
    nearest = cKDTree(master.x[on_master])
    within = DIGITS_OF_FILES * size
    for node, k in np.argwhere(held):
        across = frames[node, :, k]
        radial = on_axis is not None and on_axis[node] and np.abs(across[1:]).max() <= SAME_DIRECTION
        if not radial and abs(slave.nodal_normals[node] @ across) > ASKEW_NORMAL:
            continue
        apart = master.x[holding] - slave.x[node]
        in_plane = (np.abs(apart @ across) < within) & (
            np.linalg.norm(projectors @ across - across, axis=1) < DIGITS_OF_FILES
        )
        reach = size + nearest.query(slave.x[node])[0]
        in_plane &= np.linalg.norm(apart, axis=1) <= reach
        own_sides = _sides_of_plane(slave, int(node), across, within)
        if any(own_sides & _sides_of_plane(master, int(beside), across, within) for beside in holding[in_plane]):
            slave_projectors[node] += np.outer(across, across)
    return slave_projectors


def _sides_of_plane(surface: PairSurface, node: int, across: Array, within: float) -> set[int]:
    """On which sides of a plane through a node all facets around it lie: {1} or {-1}, both where they are in it, and
    neither where the plane cuts the surface.

    Args:
        surface: with the node.
        node: its number.
        across: the normal of the plane, of length one, shape (d,).
        within: how far facets may reach beyond the plane, length.
    """
    around = surface.nodes[(surface.nodes == node).any(axis=1)]
    ahead = (surface.x[around] - surface.x[node]) @ across
    return {sign for sign in (1, -1) if (sign * ahead >= -within).all()}
