"""Contact points of two bodies on a plane across which supports hold both: a plane of symmetry.

The half that is not modelled is the mirror image of the one that is.  With both, the function of a point on the plane
is even across it, whereas the relative displacement across the plane is odd, and their product integrates to zero; the
half alone would meet what the other body moves beside the plane, and the point a shear that nothing determines, as the
node of the slave cannot follow it.  So at such a point the relative displacement has no component across the plane,
which leaves no traction across it, and the normal, the mean of those on both halves, is in 2D.  A model of one
half is then that of both.  A plane beyond which a side goes on is none of symmetry, whatever supports hold there.  On
an axis of revolution the normal is the mean all around, and so along the axis, also at the tip of a cone.  Where one
body alone is held, or is moved by its support, the point keeps all components.
(Multipliers where Dirichlet conditions meet a mortar interface: Wohlmuth, SIAM J. Numer. Anal. 38 (2000) 989-1012;
Puso and Laursen, Comput. Methods Appl. Mech. Engrg. 193 (2004) 601-629.)
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from signorini_fx.mechanics.pairs.pair_side import PairSurface
from signorini_fx.tuned import ASKEW_NORMAL, DIGITS_OF_FILES, ROOT_OF_EPS

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
    on_slave, on_master = np.unique(slave.points), np.unique(master.nodes)
    nodes, columns = np.nonzero(held[on_slave])
    nodes = on_slave[nodes]
    across = frames[nodes, :, columns]
    along_side = np.abs(np.einsum("ni,ni->n", slave.nodal_normals[nodes], across)) <= ASKEW_NORMAL
    if on_axis is not None:
        along_side |= on_axis[nodes] & (np.abs(across[:, 1:]).max(axis=1) <= ROOT_OF_EPS)
    nodes, across = nodes[along_side], across[along_side]
    if not nodes.size or not master_held.any():
        return slave_projectors
    size = max(float(np.linalg.norm(np.ptp(side.corners, axis=1), axis=1).max()) for side in (slave, master))
    within, reach = DIGITS_OF_FILES * size, size + cKDTree(master.x[on_master]).query(slave.x[nodes])[0]
    _, first, direction = np.unique(np.round(across, 9), axis=0, return_index=True, return_inverse=True)
    for number, normal in enumerate(across[first]):
        along = np.einsum("nik,i->nk", axes, normal)
        held_across = np.linalg.norm(np.where(master_held, 0.0, along), axis=1) < DIGITS_OF_FILES
        heights = slave.x @ normal, master.x @ normal
        ends = np.zeros(nodes.size, dtype=bool)
        for height, opposite in (heights, tuple(-values for values in heights)):  # both sides ahead, and both behind
            plane = height[on_slave].min() + within
            partners = np.flatnonzero(held_across & (opposite <= plane))
            if partners.size and opposite[on_master].min() >= plane - 2 * within:
                ends |= (height[nodes] <= plane) & (cKDTree(master.x[partners]).query(slave.x[nodes])[0] <= reach)
        ends &= direction.ravel() == number
        np.add.at(slave_projectors, nodes[ends], np.outer(normal, normal))
    return slave_projectors
