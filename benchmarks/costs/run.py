"""Compare the package with one linear solve, and measure growth and memory.

    ./env python3 benchmarks/costs/run.py [--quick] [--only GROUP,...] [--out FILE]        (make
    bench)

plane: Example 1 of the paper over one linear solve of its size, with the same mesh in memory.
memory: the peak of a process for each of them.
space: whole solves of a block over one linear solve by CG with GAMG.  growth: the same on finer and
finer meshes.

Runs are interleaved, a ratio is taken within each round, and the median of the rounds counts.
Forms are compiled before.  Set OMP_NUM_THREADS to 1.
"""

from __future__ import annotations

import argparse
import gc
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from mpi4py import MPI  # first: with wheels of PyPI its library is not found otherwise

# isort: split
import example1
import linear
import numpy as np
import space

from signorini_fx import Solution, TaggedMesh, solve, sweep
from signorini_fx.machine.parallel import peak_memory
from signorini_fx.machine.result_files import write_csv

COEFFICIENTS = np.linspace(0.05, 1.0, 20).tolist()
# A run over another one, and what it may be at most.
RATIOS: tuple[tuple[str, str, float | None], ...] = (
    ("tresca", "mumps", 1.5),
    ("coulomb", "mumps", 1.7),
    ("tresca", "cholmod", 2.5),
    ("coulomb", "cholmod", None),
    ("sweep of 20 coefficients", "mumps", 3.0),
)
# At most, on the larger mesh.
OVER_GAMG = {"frictionless": 0.4, "tresca": 0.44, "coulomb": 0.48}
MEMORY_OVER_MUMPS = 1.5
WARM = 12  # cells along the bottom on which forms are compiled


@dataclass(frozen=True)
class Sizes:
    """Cells along the bottom: in 2D multiples of 3, in 3D of 12."""

    plane: tuple[int, ...] = (480, 960)
    space: tuple[int, ...] = (48, 96)
    growth: tuple[int, ...] = (48, 96, 144, 192)
    repeats: int = 5


QUICK = Sizes((24, 48), (12, 24), (12, 24), 1)


@dataclass(frozen=True)
class Row:
    """A measured value: the median of some rounds, and what it may be at most."""

    group: str
    what: str
    cells: int
    measured: Sequence[float]
    limit: float | None = None
    note: str = ""

    @property
    def cell_texts(self) -> dict[str, str]:
        """The row as text."""
        value = float(np.median(self.measured))
        verdict = must_be = ""
        if self.limit is not None:
            verdict, must_be = (
                "reached" if value <= self.limit else "NOT REACHED",
                f"at most {self.limit:g}",
            )
        return {
            "group": self.group,
            "what": self.what,
            "cells": str(self.cells),
            "value": f"{value:.4g}",
            "range": f"{min(self.measured):.4g} to {max(self.measured):.4g}",
            "must be": must_be,
            "verdict": verdict,
            "note": self.note,
        }


def package(law: str, tagged: TaggedMesh) -> Solution:
    """The package on Example 1."""
    return solve(example1.scene(law, tagged), MPI.COMM_SELF)


def swept(tagged: TaggedMesh) -> None:
    """All coefficients of friction.

    Raises:
        RuntimeError: one has no certificate.
    """
    points = sweep(
        example1.scene("coulomb", tagged),
        {"contact.friction.coefficient": COEFFICIENTS},
        MPI.COMM_SELF,
    )
    if not all(point.certificate.holds for point in points):
        raise RuntimeError("a point of the sweep has no certificate")


PLANE: dict[str, Callable[[TaggedMesh], Any]] = {
    "mumps": lambda tagged: linear.solve(tagged, "mumps"),
    "cholmod": lambda tagged: linear.solve(tagged, "cholmod"),
    "tresca": partial(package, "tresca"),
    "coulomb": partial(package, "coulomb"),
    "sweep of 20 coefficients": swept,
}


def plane(sizes: Sizes) -> Iterator[Row]:
    """Ratios of wall seconds on Example 1."""
    for nx in sizes.plane:
        tagged = example1.tagged_mesh(nx)
        for run in PLANE.values():
            run(tagged)
        seconds: dict[str, list[float]] = {name: [] for name in PLANE}
        for _ in range(sizes.repeats):
            for name, run in PLANE.items():
                gc.collect()
                start = time.perf_counter()
                run(tagged)
                seconds[name].append(time.perf_counter() - start)
        for name, over, limit in RATIOS:
            note = f"{np.median(seconds[name]):.3g} s over {np.median(seconds[over]):.3g} s"
            yield Row(
                "plane",
                f"{name} over {over}",
                nx,
                np.divide(seconds[name], seconds[over]),
                limit,
                note,
            )


def memory(sizes: Sizes) -> Iterator[Row]:
    """Peak memory of a process that solves Example 1, over that of one linear solve."""
    nx = sizes.plane[-1]
    peaks = {name: alone(name, nx)["peak"] for name in ("mumps", "tresca", "coulomb")}
    for name in ("tresca", "coulomb"):
        note = f"{peaks[name]:.0f} MB over {peaks['mumps']:.0f} MB"
        what = f"peak memory, {name} over mumps"
        yield Row(
            "memory", what, nx, [peaks[name] / peaks["mumps"]], limit=MEMORY_OVER_MUMPS, note=note
        )


def in_space(sizes: Sizes) -> Iterator[Row]:
    """Ratios of CPU seconds of whole solves of the block, meshes included."""
    space.linear(WARM)
    for law in space.LAWS:
        space.package(law, WARM)
    for nx in sizes.space:
        runs: dict[str, list[space.Run]] = {name: [] for name in ("linear", *space.LAWS)}
        for _ in range(sizes.repeats):
            for name, found in runs.items():
                gc.collect()
                found.append(space.linear(nx) if name == "linear" else space.package(name, nx))
        for law in space.LAWS:
            pairs = list(zip(runs[law], runs["linear"], strict=True))
            ratios = [run.cpu / unit.cpu if run.converged else np.inf for run, unit in pairs]
            run, unit = pairs[0]
            note = (
                f"{run.dofs} unknowns, {run.cpu:.3g} s, {run.note}, over {unit.cpu:.3g} s, "
                f"{unit.note}"
            )
            limit = OVER_GAMG[law] if nx == sizes.space[-1] else None
            yield Row("space", f"{law} over CG with GAMG", nx, ratios, limit=limit, note=note)


def growth(sizes: Sizes) -> Iterator[Row]:
    """CPU seconds and peak memory of the block with Coulomb friction, each mesh in a process; the
    last takes 7 GB.
    """
    for nx in sizes.growth:
        found = alone("space", nx)
        dofs = found["dofs"]
        note = f"{dofs} unknowns, {dofs / found['cpu']:.0f} a second, {found['note']}"
        yield Row(
            "growth", "CPU seconds", nx, [found["cpu"] if found["converged"] else np.inf], note=note
        )
        note = f"{found['peak'] * 2**20 / dofs:.0f} bytes per unknown"
        yield Row("growth", "peak memory, MB", nx, [found["peak"]], note=note)


def alone(name: str, nx: int) -> dict[str, Any]:
    """A run in a process of its own, which ``once`` reports."""
    command = [sys.executable, __file__, "--once", name, str(nx)]
    ended = subprocess.run(command, capture_output=True, text=True, check=True)
    found: dict[str, Any] = json.loads(ended.stdout.splitlines()[-1])
    return found


def once(name: str, nx: int) -> dict[str, Any]:
    """Compile, run, and report the peak memory, and of the block what it took."""
    found: dict[str, Any] = {}
    if name == "space":
        space.package("coulomb", WARM)
        found = vars(space.package("coulomb", nx))
    else:
        for cells in (WARM, nx):
            PLANE[name](example1.tagged_mesh(cells))
    return {**found, "peak": peak_memory(MPI.COMM_SELF)}


GROUPS = {"plane": plane, "memory": memory, "space": in_space, "growth": growth}


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(
        prog="benchmarks/costs/run.py", description=(__doc__ or "").split("\n\n")[0]
    )
    parser.add_argument(
        "--quick", action="store_true", help="small meshes, one round: the limits mean little there"
    )
    parser.add_argument("--only", metavar="GROUP,...", help=f"some of {', '.join(GROUPS)}")
    parser.add_argument("--out", type=Path, default=Path("results/bench.csv"), metavar="FILE")
    parser.add_argument("--once", nargs=2, metavar=("NAME", "CELLS"), help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    if given.once:
        print(json.dumps(once(given.once[0], int(given.once[1]))))
        return 0
    groups = given.only.split(",") if given.only else list(GROUPS)
    if unknown := set(groups) - set(GROUPS):
        parser.error(f"no group {', '.join(sorted(unknown))}")
    rows: list[dict[str, str]] = []
    given.out.parent.mkdir(parents=True, exist_ok=True)
    for group in groups:
        for row in GROUPS[group](QUICK if given.quick else Sizes()):
            rows.append(row.cell_texts)
            print(*rows[-1].values(), sep="  ", flush=True)
            write_csv(given.out, rows)  # after each row, because the whole takes hours
    return 0


if __name__ == "__main__":
    sys.exit(main())
