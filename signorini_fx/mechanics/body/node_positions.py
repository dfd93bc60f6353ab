"""The positions of the nodes of a function space, computed once."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from dolfinx import fem

_ATTRIBUTE = "_signorini_fx_node_positions"


def node_positions(space: fem.FunctionSpace) -> npt.NDArray[np.float64]:
    """X of the nodes of this rank, ghosts included: length, shape (nodes, 3), read-only.

    dolfinx passes over all cells at every call, and a solve with its certificate needs the positions at six places.
    They are kept with the space, which cannot be hashed, so that they live as long as it does.
    """
    positions: npt.NDArray[np.float64] | None = getattr(space, _ATTRIBUTE, None)
    if positions is None:
        positions = np.asarray(space.tabulate_dof_coordinates(), dtype=np.float64)
        positions.flags.writeable = False
        setattr(space, _ATTRIBUTE, positions)
    return positions
