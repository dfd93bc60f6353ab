"""Rigid motions of the body, and whether supports and contact resist them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from signorini_fx import parallel
from signorini_fx.boundary import ContactBoundary

# Share of a motion, against the best held one, below which it counts as not held at all.
_HELD = 1e-8


@dataclass(frozen=True)
class RigidMotions:
    """The rigid motions that the prescribed displacements leave free.

    Attributes:
        centre: the point about which rotations are taken, shape (2,).
        length: size of the body, by which rotations are made comparable with translations.
        free: combinations of (translation x, translation y, rotation), one a column, shape (3, k).
    """

    centre: npt.NDArray[np.float64]
    length: float
    free: npt.NDArray[np.float64]

    def at(self, x: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """The three rigid motions at points ``x`` of shape (n, 2), shape (n, 2, 3)."""
        return _modes(x, self.centre, self.length)

    def held_by(self, boundary: ContactBoundary, normal: npt.NDArray[np.bool_], stick: npt.NDArray[np.bool_]) -> bool:
        """Whether contact at ``normal`` nodes and stick at ``stick`` nodes resist every free motion; collective."""
        if self.free.shape[1] == 0:
            return True
        modes = self.at(boundary.x) * boundary.free[:, :, None]
        rows = np.concatenate(
            [
                np.einsum("ij,ijk->ik", boundary.normal[normal], modes[normal]),
                np.einsum("ij,ijk->ik", boundary.tangents[stick, :, 0], modes[stick]),
            ]
        )
        gram = parallel.global_sum(boundary.comm, self.free.T @ rows.T @ rows @ self.free)
        values = np.linalg.eigvalsh(gram)
        return bool(values[0] > _HELD * values[-1] > 0)


def _modes(x: npt.NDArray[np.float64], centre: npt.NDArray[np.float64], length: float) -> npt.NDArray[np.float64]:
    modes = np.zeros((x.shape[0], 2, 3))
    modes[:, 0, 0] = modes[:, 1, 1] = 1.0
    modes[:, 0, 2] = -(x[:, 1] - centre[1]) / length
    modes[:, 1, 2] = (x[:, 0] - centre[0]) / length
    return modes


def rigid_motions(
    comm: MPI.Comm, x: npt.NDArray[np.float64], fixed: npt.NDArray[np.bool_], length: float
) -> RigidMotions:
    """The rigid motions that the supports leave free.

    Args:
        comm: the ranks that share the body.
        x: positions of the nodes of this rank, shape (n, 2).
        fixed: which displacement components are prescribed there, shape (n, 2).
        length: size of the body.
    """
    total = parallel.global_sum(comm, np.array([x.shape[0], *x.sum(axis=0)]))
    centre = total[1:] / total[0]
    rows = _modes(x, centre, length)[fixed]
    gram = parallel.global_sum(comm, rows.T @ rows)
    values, vectors = np.linalg.eigh(gram)
    return RigidMotions(centre, length, vectors[:, values <= _HELD * max(values[-1], 1e-300)])
