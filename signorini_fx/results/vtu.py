"""One file of VTK's XML format for an unstructured grid, written by all ranks: ParaView, PyVista and meshio read it.

The numbers are in base64, array after array, and in each array rank after rank.  (meshio reads neither the raw form
reliably nor files of several pieces.)
"""

from __future__ import annotations

import base64
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from signorini_fx.machine import parallel

Array = npt.NDArray[Any]
_NAMES = {np.dtype(np.float64): "Float64", np.dtype(np.int64): "Int64", np.dtype(np.uint8): "UInt8"}


def bytes_of(points: int, cells: int, corners: int, components: int) -> float:
    """About the size of a file; ``corners``: points of a cell; ``components``: of all fields at a point together."""
    return 4 / 3 * (8.0 * points * (3 + components) + cells * (8.0 * (corners + 1) + 1))


def write_vtu(path: Path, comm: MPI.Comm, points: Array, cells: Array, kind: int, fields: Mapping[str, Array]) -> None:
    """Write the cells of all ranks as one grid; ``points``: of this rank, shape (n, 3); ``cells``: their local numbers
    in VTK's order, shape (cells, corners); ``kind``: VTK's number; ``fields``: values at the points, shape (n,) or (n,
    components); collective.

    Raises:
        OSError: the system refuses it.
        RuntimeError: MPI refuses it.
    """
    corners, first_cell = cells.shape[1], parallel.rows_before(comm, len(cells))
    ends = corners * np.arange(first_cell + 1, first_cell + len(cells) + 1)
    grid: dict[str, dict[str, Array]] = {
        "Points": {"points": points.astype(np.float64)},
        "Cells": {
            "connectivity": cells.ravel().astype(np.int64) + parallel.rows_before(comm, len(points)),
            "offsets": ends.astype(np.int64),
            "types": np.full(len(cells), kind, dtype=np.uint8),
        },
        "PointData": {name: values.astype(np.float64) for name, values in fields.items()},
    }
    counts = parallel.global_sum(comm, np.array([len(points), len(cells)]))
    order = "LittleEndian" if sys.byteorder == "little" else "BigEndian"
    described = f'type="UnstructuredGrid" version="1.0" byte_order="{order}" header_type="UInt64"'
    position = 0
    segments: list[tuple[int, bytes]] = []

    def add(text: str) -> None:
        nonlocal position
        if parallel.is_root(comm):
            segments.append((position, text.encode()))
        position += len(text)

    add(f"<VTKFile {described}>\n<UnstructuredGrid>\n")
    add(f'<Piece NumberOfPoints="{counts[0]}" NumberOfCells="{counts[1]}">\n')
    for group, arrays in grid.items():
        add(f"<{group}>\n")
        for name, values in arrays.items():
            components = f' NumberOfComponents="{values.shape[1]}"' if values.ndim > 1 else ""
            add(f'<DataArray type="{_NAMES[values.dtype]}" Name="{name}"{components} format="binary">')
            begin, encoded, length = _encoded(comm, np.ascontiguousarray(values).tobytes())
            segments.append((position + begin, encoded))
            position += length
            add("</DataArray>\n")
        add(f"</{group}>\n")
    add("</Piece>\n</UnstructuredGrid>\n</VTKFile>\n")
    _write(path, comm, segments)


def _encoded(comm: MPI.Comm, data: bytes) -> tuple[int, bytes, int]:
    """The part of this rank of the bytes of all ranks in base64, with their number first; collective.

    Base64 makes four characters of three bytes: for its last ones a rank takes the first bytes of the next one.

    Returns:
        Where its characters begin, these characters, and how many there are of all ranks.
    """
    every = comm.allgather((len(data), data[:2]))
    total = sum(size for size, _ in every)
    if parallel.is_root(comm):
        data = np.array([total], dtype=np.uint64).tobytes() + data
    size_bytes = np.dtype(np.uint64).itemsize
    begin = 0 if parallel.is_root(comm) else size_bytes + sum(size for size, _ in every[: comm.rank])
    end = begin + len(data)
    following = b"".join(first for _, first in every[comm.rank + 1 :])
    encoded = base64.b64encode(data[-begin % 3 :] + following[: -end % 3]) if -begin % 3 < len(data) else b""
    return 4 * -(-begin // 3), encoded, 4 * -(-(size_bytes + total) // 3)


def _write(path: Path, comm: MPI.Comm, segments: list[tuple[int, bytes]]) -> None:
    """Write what each rank has to where it belongs; collective."""
    assert isinstance(comm, MPI.Intracomm)
    file = MPI.File.Open(comm, str(path), MPI.MODE_CREATE | MPI.MODE_WRONLY)
    error: Exception | None = None
    try:
        for position, text in segments:
            file.Write_at(position, text)
    except (OSError, RuntimeError) as refused:
        error = refused
    finally:
        file.Close()
    parallel.raise_together(comm, error)
