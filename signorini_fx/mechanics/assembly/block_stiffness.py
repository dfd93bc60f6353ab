"""The stiffness of a body by blocks, as dolfinx assembles it: for ``linalg.blocks``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mpi4py.MPI as MPI  # first, see signorini_fx.mechanics.body
import numpy as np
import numpy.typing as npt
from dolfinx import fem, jit, la
from petsc4py import PETSc

from signorini_fx.algebra.linalg import kernels
from signorini_fx.algebra.linalg.blocks import BlockRows, block_matrix
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.nodal_stiffness import NodalStiffness


def why_not(comm: MPI.Comm) -> str | None:
    """Why products by blocks cannot be compiled; None: they are; collective."""
    return kernels.load(comm, _folder())


def _folder() -> Path:
    """Of compiled forms."""
    return Path(jit.get_options()["cache_dir"])


def block_stiffness(
    forms: Sequence[fem.Form], fixed: npt.NDArray[np.bool_], beside: NodalStiffness | None = None
) -> PETSc.Mat:
    """The matrix of a sum of bilinear forms of a vector Lagrange space by blocks; collective.

    Args:
        forms: the bilinear forms.
        fixed: which unknowns of this rank are prescribed: their rows and columns are left out, and have the largest
            entry of the diagonal.
        beside: what is added to it; None: nothing.
    """
    entries = fem.create_matrix(forms[0], la.BlockMode.compact)
    for form in forms:
        fem.assemble_matrix(entries, form)  # type: ignore[arg-type]
    entries.scatter_reverse()
    size, comm, nodes = entries.block_size[0], forms[0].mesh.comm, entries.index_map(1)
    owned = entries.index_map(0).size_local
    starts = np.asarray(entries.indptr[: owned + 1], dtype=np.int64)
    columns, blocks = entries.indices[: starts[-1]], entries.data.reshape(-1, size, size)[: starts[-1]]
    if beside is not None:
        of_node = np.repeat(np.arange(owned), np.diff(starts))
        blocks[np.flatnonzero(of_node == columns)[beside.nodes]] += beside.blocks
    extended = la.vector(nodes, size)
    extended.array[: fixed.size] = fixed
    extended.scatter_forward()
    _leave_out(blocks, starts, columns, extended.array.reshape(-1, size) > 0)
    rows = BlockRows(
        starts,
        columns,
        blocks,
        1.0,
        nodes.local_to_global(np.arange(nodes.size_local + nodes.num_ghosts, dtype=np.int32)),
        kernels.BlockProduct(_folder(), size, starts, columns),
        extended.array,
        extended.scatter_forward if comm.size > 1 else None,
    )
    largest = parallel.largest(comm, rows.diagonal) or 1.0
    rows.set_diagonal(np.flatnonzero(fixed), largest)
    return block_matrix(rows, comm)


def _leave_out(
    blocks: npt.NDArray[np.floating[Any]],
    starts: npt.NDArray[np.int64],
    columns: npt.NDArray[np.int32],
    fixed: npt.NDArray[np.bool_],
) -> None:
    """Set rows and columns of prescribed unknowns to zero.

    Args:
        blocks: shape (m, d, d).
        starts: where rows of blocks begin.
        columns: of the blocks.
        fixed: which unknowns are prescribed, at the nodes of this rank and those of others, shape (n, d).
    """
    rows = np.repeat(np.arange(starts.size - 1, dtype=columns.dtype), np.diff(starts))
    some = np.asarray(fixed.any(axis=1))
    block = np.flatnonzero(some[rows] | some[columns])
    blocks[block] = np.where(fixed[rows[block], :, None] | fixed[columns[block], None, :], 0.0, blocks[block])
