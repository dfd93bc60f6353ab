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
_ARGUMENTS = ("-O2",)
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
    for turn in (comm.rank == 0, comm.rank > 0):  # the others find what the first rank has compiled
        error = None
        try:
            if turn:
                _LOADED[key] = _load(folder)
        except MachineError as found:
            error = found
        parallel.raise_together(comm, error)


def _load(folder: Path) -> Any:
    source = "#include <stdint.h>\n\n" + "\n".join(map(_function, SIZES))
    declarations = "".join(f"{_head(size)};\n" for size in SIZES)
    name = f"signorini_fx_blocks_{zlib.crc32((source + repr(_ARGUMENTS)).encode()):08x}"
    return library(folder, name, declarations, source, _ARGUMENTS)


def _head(size: int) -> str:
    return (
        f"void multiply_{size}(int64_t rows, const int64_t *starts, const int32_t *columns, "
        "const double *a, const double *x, double *y)"
    )


def _function(size: int) -> str:
    """Of blocks of one size, row by row."""
    each = range(size)
    sums = ", ".join(f"s{row} = 0.0" for row in each)
    values = ", ".join(f"x{column} = v[{column}]" for column in each)
    added = "\n".join(
        f"            s{row} += " + " + ".join(f"a[{size * row + column}] * x{column}" for column in each) + ";"
        for row in each
    )
    stored = "\n".join(f"        y[{size} * i + {row}] = s{row};" for row in each)
    return f"""{_head(size)}
{{
    a += {size * size} * starts[0];
    for (int64_t i = 0; i < rows; ++i) {{
        double {sums};
        for (int64_t k = starts[i]; k < starts[i + 1]; ++k, a += {size * size}) {{
            const double *v = x + {size} * (int64_t)columns[k];
            const double {values};
            __builtin_prefetch(a + {PREFETCHED_BYTES // 8}, 0, 3);
{added}
        }}
{stored}
    }}
}}
"""


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
