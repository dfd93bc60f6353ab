"""The stiffness of a body by blocks, as dolfinx assembles it: for ``linalg.blocks``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
import numpy.typing as npt
from dolfinx import fem, jit, la
from petsc4py import PETSc

from signorini_fx.algebra.linalg import kernels
from signorini_fx.algebra.linalg.blocks import BlockRows, block_matrix
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.nodal_stiffness import NodalStiffness


def block_stiffness(
    forms: Sequence[fem.Form], fixed: npt.NDArray[np.bool_], beside: NodalStiffness | None = None
) -> PETSc.Mat:
    """The matrix of a sum of bilinear forms of a vector Lagrange space by blocks; rows and columns of ``fixed``
    unknowns of this rank are left out, and have the largest entry of the diagonal; ``beside``: what is added;
    collective.
    """
    folder = Path(jit.get_options()["cache_dir"])  # of compiled forms
    kernels.load(forms[0].mesh.comm, folder)
    entries = fem.create_matrix(forms[0], la.BlockMode.compact)
    for form in forms:
        fem.assemble_matrix(entries, form)  # type: ignore[arg-type]
    entries.scatter_reverse()
    size, comm, nodes = entries.block_size[0], forms[0].mesh.comm, entries.index_map(1)
    owned = entries.index_map(0).size_local
    starts = np.asarray(entries.indptr[: owned + 1], dtype=np.int64)
    columns, blocks = entries.indices[: starts[-1]], entries.data.reshape(-1, size, size)[: starts[-1]]
    of_row = np.repeat(np.arange(owned, dtype=columns.dtype), np.diff(starts))
    if beside is not None:
        blocks[np.flatnonzero(of_row == columns)[beside.nodes]] += beside.blocks
    extended = la.vector(nodes, size)
    extended.array[: fixed.size] = fixed
    extended.scatter_forward()
    held = extended.array.reshape(-1, size) > 0
    some: npt.NDArray[np.bool_] = np.asarray(held.any(axis=1))
    block = np.flatnonzero(some[of_row] | some[columns])
    blocks[block] = np.where(held[of_row[block], :, None] | held[columns[block], None, :], 0.0, blocks[block])
    rows = BlockRows(
        starts,
        columns,
        blocks,
        1.0,
        nodes.local_to_global(np.arange(nodes.size_local + nodes.num_ghosts, dtype=np.int32)),
        kernels.BlockProduct(folder, size, starts, columns),
        extended.array,
        extended.scatter_forward if comm.size > 1 else None,
    )
    largest = parallel.largest(comm, rows.diagonal) or 1.0
    rows.set_diagonal(np.flatnonzero(fixed), largest)
    return block_matrix(rows, comm)
