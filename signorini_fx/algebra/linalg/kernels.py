"""Products y = A x with matrices of small dense blocks, in C, compiled beside the forms.

Such a product takes the time in which the entries arrive from memory.  PETSc's kernels for blocks ask for them ahead in
a way that some processors ignore; these ask for them ``PREFETCHED_BYTES`` ahead of their use, into all caches.
"""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from signorini_fx.errors import MachineError
from signorini_fx.machine import parallel
from signorini_fx.machine.compilation import library
from signorini_fx.tuned import PREFETCHED_BYTES

Array = npt.NDArray[np.float64]
SIZES = (2, 3)  # of blocks
_HEAD = (
    "void multiply_{size}(int64_t rows, const int64_t *starts, const int32_t *columns, "
    "const double *a, const double *x, double *y)"
)
# Compilers unroll the loops over a block.
_BODY = """
{{
    a += {size} * {size} * starts[0];
    for (int64_t i = 0; i < rows; ++i) {{
        double sum[{size}] = {{0.0}};
        for (int64_t k = starts[i]; k < starts[i + 1]; ++k, a += {size} * {size}) {{
            const double *v = x + {size} * (int64_t)columns[k];
            __builtin_prefetch(a + {ahead}, 0, 3);
            for (int row = 0; row < {size}; ++row)
                for (int column = 0; column < {size}; ++column)
                    sum[row] += a[{size} * row + column] * v[column];
        }}
        for (int row = 0; row < {size}; ++row)
            y[{size} * i + row] = sum[row];
    }}
}}
"""
_ARGUMENTS = ("-O3",)
# The modules by their folders.
_LOADED: dict[str, Any] = {}


def load(comm: MPI.Comm, folder: Path) -> None:
    """Compile the kernels into the folder of compiled forms on one rank, unless they are there, and load them on all;
    collective.

    Raises:
        MachineError: they cannot be compiled.
    """
    key = str(folder)
    if not parallel.any_rank(comm, key not in _LOADED):
        return
    source = "#include <stdint.h>\n" + "".join(
        (_HEAD + _BODY).format(size=size, ahead=PREFETCHED_BYTES // 8) for size in SIZES
    )
    declarations = "".join(f"{_HEAD.format(size=size)};\n" for size in SIZES)
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
    """Products with matrices of blocks of one size and pattern: where rows of blocks begin, shape (rows + 1,), and
    their columns; ``load`` must have succeeded.
    """

    def __init__(self, folder: Path, size: int, starts: npt.NDArray[np.int64], columns: npt.NDArray[np.int32]) -> None:
        module = _LOADED[str(folder)]
        self._cast = module.ffi.cast
        self._kernel = getattr(module.lib, f"multiply_{size}")
        self._arrays = np.ascontiguousarray(starts, np.int64), np.ascontiguousarray(columns, np.int32)
        self._pattern = self._address("int64_t", self._arrays[0]), self._address("int32_t", self._arrays[1])

    def _address(self, kind: str, array: npt.NDArray[Any]) -> Any:
        assert array.flags.c_contiguous
        return self._cast(f"{kind} *", array.ctypes.data)

    def __call__(self, blocks: Array, x: Array, y: Array) -> None:
        """Write A x into y; ``blocks``: A, ``x``: with what columns of other ranks need."""
        vectors = (self._address("double", values) for values in (blocks, x, y))
        self._kernel(self._arrays[0].size - 1, *self._pattern, *vectors)
