"""The bodies of a scene in 2D as those in 3D are told: directions that are held, vectors for each node."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.sparse import csr_array, eye_array

from benchmarks.stability.oracle import body
from benchmarks.stability.oracle.elements import Array


class PlaneBody(body.Body):
    """Of supports only components along the axes."""

    @cached_property
    def held(self) -> Array:
        """The projection onto the directions that supports hold at each node, shape (nodes, 2, 2)."""
        return np.asarray(self._fixed[:, :, None] * np.eye(2))

    @cached_property
    def _fixed(self) -> Array:
        return np.isfinite(super().prescribed(0)).reshape(-1, 2).astype(float)

    def prescribed(self, step: int) -> Array:
        """A displacement that meets the supports of a load step and is zero elsewhere, shape (nodes, 2)."""
        return np.nan_to_num(super().prescribed(step)).reshape(-1, 2)

    @cached_property
    def free(self) -> csr_array:
        """Free directions of all nodes, a column each."""
        every = eye_array(2 * len(self.x), format="csc")
        return csr_array(every[:, self._fixed.ravel() == 0])
