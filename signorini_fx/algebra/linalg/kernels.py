"""Products y = A x with symmetric matrices of small dense blocks, in C, compiled beside the forms.

Such a product is limited by the memory bandwidth.  So each pair of nodes has one block, which is
used for both orders.  PETSc's kernels for blocks prefetch in a way that some processors ignore;
these kernels prefetch ``PREFETCHED_BYTES`` ahead of the use, into all caches.
"""

from __future__ import annotations

import zlib
from pathlib import Path
from types import ModuleType

import numpy as np
from mpi4py import MPI

from signorini_fx.arrays import Array, Column, Indices, Ints
from signorini_fx.errors import MachineError
from signorini_fx.machine import parallel
from signorini_fx.machine.compilation import library
from signorini_fx.tuned import PREFETCHED_BYTES

SIZES = (2, 3)  # of blocks
_HEAD = (
    "void multiply_{size}(int64_t rows, const int64_t *starts, const int32_t *columns, "
    "const double *a, const double *x, double *restrict y)"
)
# Compilers unroll the loops over a block.
_BODY = """
{{
    for (int64_t i = 0; i < {size} * rows; ++i)
        y[i] = 0.0;
    for (int64_t i = 0; i < rows; ++i) {{
        double sum[{size}] = {{0.0}};
        const double *own = x + {size} * i;
        for (int64_t k = starts[i]; k < starts[i + 1]; ++k, a += {size} * {size}) {{
            const int64_t j = columns[k];
            const double *v = x + {size} * j;
            __builtin_prefetch(a + {ahead}, 0, 3);
            for (int n = 0; n < {size}; ++n) {{
                double other = 0.0;
                for (int m = 0; m < {size}; ++m) {{
                    sum[n] += a[{size} * n + m] * v[m];
                    other += a[{size} * m + n] * own[m];
                }}
                if (i < j && j < rows)
                    y[{size} * j + n] += other;
            }}
        }}
        for (int n = 0; n < {size}; ++n)
            y[{size} * i + n] += sum[n];
    }}
}}
"""
_ARGUMENTS = ("-O3",)
# The modules by their folders.
_LOADED: dict[str, ModuleType] = {}


def load(comm: MPI.Comm, folder: Path) -> None:
    """Compile the kernels into the folder of compiled forms on one rank, unless they are there, and
    load them on all ranks; collective.

    Raises:
        MachineError: they cannot be compiled.
    """
    key = str(folder)
    if not parallel.any_rank(comm, key not in _LOADED):
        return
    source = "#include <stdint.h>\n" + "".join(
        (_HEAD + _BODY).format(size=size, ahead=PREFETCHED_BYTES // 8) for size in SIZES
    )
    declarations = "".join(
        f"{_HEAD.format(size=size)};\n".replace("restrict ", "") for size in SIZES
    )
    name = f"signorini_fx_blocks_{zlib.crc32((source + repr(_ARGUMENTS)).encode()):08x}"
    for turn in (comm.rank == 0, comm.rank > 0):  # the others find what the first rank has compiled
        error = None
        try:
            if turn:
                _LOADED[key] = library(folder, name, declarations, source, _ARGUMENTS)
        except MachineError as found:
            error = found
        parallel.raise_together(comm, error)


class BlockProduct:
    """Products with the owned rows of a symmetric matrix of blocks; ``load`` must have succeeded.

    Args:
        folder: the folder of compiled forms.
        starts: where the rows begin, shape (n + 1,).
        columns: of the blocks, shape (m,); those of other ranks are numbered from n on.
        blocks: shape (m, d, d).
    """

    def __init__(
        self,
        folder: Path,
        starts: Ints,
        columns: Indices,
        blocks: Array,
    ) -> None:
        module = _LOADED[str(folder)]
        self._cast = module.ffi.cast
        self._kernel = getattr(module.lib, f"multiply_{blocks.shape[1]}")
        rows = np.repeat(np.arange(starts.size - 1), np.diff(starts))
        upper = columns >= rows
        counts = np.bincount(rows[upper], minlength=starts.size - 1)
        self._arrays: tuple[Column, ...] = (
            np.concatenate(([0], np.cumsum(counts))),
            columns[upper],
            np.compress(upper, blocks, axis=0),
        )
        kinds = "int64_t", "int32_t", "double"
        self._matrix = [self._address(*each) for each in zip(kinds, self._arrays, strict=True)]

    def _address(self, kind: str, array: Column) -> object:
        assert array.flags.c_contiguous
        return self._cast(f"{kind} *", array.ctypes.data)

    def __call__(self, x: Array, y: Array) -> None:
        """Write A x into y; x includes the entries of other ranks that the columns need."""
        vectors = (self._address("double", values) for values in (x, y))
        self._kernel(self._arrays[0].size - 1, *self._matrix, *vectors)
