"""Small solves and sweeps: the rows of whole solves, and of points of sweeps, over one linear solve of the same mesh.

The linear solve is assembly, factorisation by MUMPS and substitution, of ``linear.py``; all have the mesh in memory but
what is called *with its mesh*, which makes it too.  CPU seconds of processes that have compiled and loaded everything.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import example1
import linear
import numpy as np
from mpi4py import MPI
from row import Row, Say

from signorini_fx import solve, sweep

CELLS = (24, 60, 120)  # along the bottom: 450, 2,562 and 9,922 unknowns


def values(points: int) -> dict[str, tuple[str, list[Any]]]:
    """The entries that are swept, with so many values."""
    return {
        "F": ("contact.friction.coefficient", [float(v) for v in np.linspace(0.1, 0.5, points)]),
        "gaps": ("contact.gap", [f"0.003 * (x[0] - 1.5)**2 + {g}" for g in np.linspace(0.0, 0.002, points)]),
        "E": ("material.young", [float(v) for v in np.linspace(3000.0, 8000.0, points)]),
        "loads": ("traction.y", [f"{-q} if 1 <= x[0] <= 2 else 0" for q in np.linspace(10.0, 30.0, points)]),
    }


def _cpu(run: Callable[[], object]) -> float:
    gc.collect()
    start = time.process_time()
    run()
    return time.process_time() - start


def _certified(tagged: Any, path: str, swept: list[Any]) -> None:
    """A sweep, each point of which is certified.

    Raises:
        RuntimeError: one has no certificate.
    """
    points = sweep(example1.scene("coulomb", tagged), MPI.COMM_SELF, path=path, values=swept)
    if not all(point.certificate().holds for point in points):
        raise RuntimeError("a point of the sweep has no certificate")


def rows(repeats: int, say: Say, cells: Sequence[int] = CELLS, points: int = 100) -> Iterator[Row]:
    """Ratios of CPU seconds, each taken within a round; for information."""
    for nx in cells:
        tagged = example1.tagged_mesh(nx)
        runs: dict[str, tuple[Callable[[], object], int]] = {
            f"a solve, {law}{words}": (partial(solve, example1.scene(law, mesh), MPI.COMM_SELF), 1)
            for law in ("tresca", "coulomb")
            for words, mesh in (("", tagged), (", with its mesh", nx))
        }
        for name, (path, swept) in values(points).items():
            many = partial(_certified, tagged, path, swept)
            runs[f"a point of {points} {name}, Coulomb, certified"] = many, points
        unit = partial(linear.solve, tagged, "mumps")
        measured: dict[str, list[float]] = {name: [] for name in runs}
        units = []
        for repeat in range(-1, repeats):  # the first round compiles
            say(f"small, {nx} x {nx // 3}, round {repeat + 1} of {repeats}")
            one = min(_cpu(unit) for _ in range(3))
            units.append(one)
            for name, (run, count) in runs.items():
                measured[name].append(_cpu(run) / count / one)
        note = f"a linear solve takes {1e3 * np.median(units[1:]):.3g} ms of CPU"
        for name, ratios in measured.items():
            yield Row("small", f"{name}, over a linear solve, MUMPS", f"{nx}x{nx // 3}", ratios[1:], note=note)
