"""The positions of the nodes of a function space, computed once."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from dolfinx import fem

_KEPT = "_signorini_fx_node_positions"


def node_positions(space: fem.FunctionSpace) -> npt.NDArray[np.float64]:
    """X of the nodes of this rank, ghosts included: length, shape (nodes, 3), read-only.

    dolfinx passes over all cells at every call, and a solve with its certificate needs the positions at six places.
    They are kept with the space, which cannot be hashed, so that they live as long as it does.
    """
    found: npt.NDArray[np.float64] | None = getattr(space, _KEPT, None)
    if found is None:
        found = np.asarray(space.tabulate_dof_coordinates(), dtype=np.float64)
        found.flags.writeable = False
        setattr(space, _KEPT, found)
    return found
