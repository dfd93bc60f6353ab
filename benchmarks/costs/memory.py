"""What is alive at the peak of memory of a whole solve in 3D: names, bytes per unknown.

    ./env python3 benchmarks/costs/memory.py [--cells 96] [--law coulomb]

After each phase of the finest mesh the largest resident memory since the last one is printed, and which arrays and
matrices of Python and PETSc are alive then, the largest first.  What C++ holds, such as meshes and Krylov vectors, is
the difference to what is resident.
"""

from __future__ import annotations

import argparse
import gc
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mpi4py import MPI  # first: with wheels of PyPI its library is not found otherwise

# isort: split
import numpy as np
import space
from petsc4py import PETSc
from space_rows import space_levels

from signorini_fx import records, solve
from signorini_fx.scenes import mesh_sequence
from signorini_fx.solving import meshed_problem

_MEGABYTE = 2**20
_INDEX = np.dtype(PETSc.IntType).itemsize
_LEAST = 0.004  # of what is alive, to have a line of its own


def resident(what: str) -> float:
    """VmRSS, resident memory, or VmHWM, its largest value since ``forget``, MB."""
    return int(Path("/proc/self/status").read_text(encoding="ascii").split(f"{what}:")[1].split()[0]) / 1024


def forget() -> None:
    """Let the largest value begin anew."""
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


def alive() -> dict[str, float]:
    """MB of arrays and matrices by the attribute that holds them; each once."""
    gc.collect()
    sizes: dict[str, float] = defaultdict(float)
    seen = set[int]()
    for holder in gc.get_objects():
        if isinstance(holder, type) or "__dict__" not in dir(type(holder)):
            continue
        attributes = object.__getattribute__(holder, "__dict__")
        for name, value in list(attributes.items()):
            for item in _parts(value):
                key, size = _size(item)
                if size and key not in seen:
                    seen.add(key)
                    sizes[f"{type(holder).__name__}.{name}"] += size / _MEGABYTE
    return sizes


def _parts(value: Any, depth: int = 2) -> Iterator[Any]:
    """The value itself, or what a container holds."""
    if depth and isinstance(value, dict):
        value = list(value.values())
    if depth and isinstance(value, list | tuple):
        for part in value:
            yield from _parts(part, depth - 1)
    else:
        yield value


def _size(item: Any) -> tuple[int, float]:
    """Its identity and its bytes; nothing of what is neither array nor matrix."""
    if isinstance(item, np.ndarray):
        while isinstance(item.base, np.ndarray):
            item = item.base
        return item.__array_interface__["data"][0], item.nbytes
    if isinstance(item, PETSc.Mat) and item.handle and item.getType().endswith("aij"):
        rows = item.getLocalSize()[0]
        return item.handle, item.getInfo()["nz_allocated"] * (8 + _INDEX) + 3 * rows * _INDEX
    if isinstance(item, PETSc.Vec) and item.handle:
        return item.handle, 8.0 * item.getLocalSize()
    return 0, 0.0


def main() -> None:
    """Solve and print what is alive after the phase with the peak."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--cells", type=int, default=96, help="along the block")
    parser.add_argument("--law", default="coulomb", choices=list(space.LAWS))
    given = parser.parse_args()
    phases: list[tuple[str, float, float, dict[str, float]]] = []
    timed = records.Timings.phase

    def note(name: str) -> None:
        phases.append((name, resident("VmHWM"), resident("VmRSS"), alive()))
        forget()

    @contextmanager
    def phase(timings: records.Timings, name: str) -> Iterator[None]:
        note(f"before {name}")
        with timed(timings, name):
            yield
        note(name)

    def noted(module: Any, name: str) -> None:
        inner = getattr(module, name)

        def call(*given: Any, **more: Any) -> Any:
            result = inner(*given, **more)
            note(name)
            return result

        setattr(module, name, call)

    made = space.scene(given.law, given.cells, "hexahedron", 1e7, space_levels(given.cells))
    solve(space.scene(given.law, 12, "hexahedron", 1e7, 2), MPI.COMM_SELF, check=False)  # loads and compiles
    start = resident("VmRSS")
    records.Timings.phase = phase  # type: ignore[method-assign]
    noted(mesh_sequence, "estimate_errors")
    noted(meshed_problem, "level_result")
    solution = solve(made, MPI.COMM_SELF, check=False)
    dofs = solution.model.dofs
    per_unknown = _MEGABYTE / dofs
    print(f"{solution.status.value}, {dofs} unknowns; before the solve {start:.0f} MB")
    finest = max(k for k, (name, *_) in enumerate(phases) if name == "before mesh")
    print(f"{'phase on the finest mesh':26s} peak MB  then MB")
    for name, peak, then, _ in phases[finest:]:
        print(f"{name:26s} {peak:7.0f} {then:8.0f}")
    name, peak, then, sizes = max(phases, key=lambda row: row[1])
    whole = sum(sizes.values())
    print(f"alive after the phase with the peak, {name}, {peak:.0f} MB, {peak * per_unknown:.0f} bytes per unknown:")
    rest = then - start - whole
    lines = {**sizes, "before the solve": start, "in C++: meshes, spaces, Krylov vectors": rest, "freed": peak - then}
    small = sum(size for size in lines.values() if size < _LEAST * peak)
    for what, size in sorted(lines.items(), key=lambda line: -line[1]):
        if size >= _LEAST * peak:
            print(f"{what:45s} {size:7.1f} MB {size * per_unknown:7.1f}")
    print(f"{'smaller ones':45s} {small:7.1f} MB {small * per_unknown:7.1f}")


if __name__ == "__main__":
    main()
