"""One solve in a process of its own, on any number of ranks: prints its time and peak memory as one line of JSON.

    python3 benchmarks/costs/once.py WHAT NX [LEVELS [LINEAR_ALGEBRA]]

WHAT is tresca, fp, newton (the package) or mumps, cholmod (one linear solve).
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import example1
import linear
from mpi4py import MPI

from signorini_fx import TaggedMesh, solve
from signorini_fx.machine import parallel
from signorini_fx.results.accuracy.convergence_table import peak_memory
from signorini_fx.scenes import mesh_sequence, solver

_WARM = 96  # cells along the bottom of the first solve, which loads and compiles everything


@contextmanager
def stopwatch(clock: Callable[[], float] = time.perf_counter) -> Iterator[list[float]]:
    """The seconds of making each mesh."""
    make, seconds, callers = solver.load_mesh, [], (solver, mesh_sequence)

    def timed(*arguments: Any) -> TaggedMesh:
        start = clock()
        tagged = make(*arguments)
        seconds.append(clock() - start)
        return tagged

    for module in callers:
        module.load_mesh = timed
    try:
        yield seconds
    finally:
        for module in callers:
            module.load_mesh = make


def run(what: str, nx: int, levels: int, algebra: str) -> dict[str, Any]:
    """Solve once.

    Returns:
        Seconds, phases and, of the package, counts by level.
    """
    comm = MPI.COMM_WORLD
    if what in linear.PACKAGES:
        tagged = example1.tagged_mesh(nx, comm)
        start, before = time.perf_counter(), peak_memory(MPI.COMM_SELF)
        _, phases = linear.solve(tagged, what)
        return {"seconds": time.perf_counter() - start, "before": before, "phases": phases, "status": "converged"}
    law = "tresca" if what == "tresca" else "coulomb"
    settings: dict[str, Any] = {"levels": levels, "linear_algebra": algebra}
    if law == "coulomb":
        settings["coulomb"] = what
    # Nested iteration makes its meshes itself, which is not counted; otherwise the mesh is given.
    mesh = example1.tagged_mesh(nx, comm) if levels == 1 else nx
    with stopwatch() as making:
        start, before = time.perf_counter(), peak_memory(MPI.COMM_SELF)
        solution = solve(example1.scene(law, mesh, **settings), comm, check=False)
        seconds = time.perf_counter() - start - sum(making)
    phases = {name: value for name, value in solution.timings.seconds.items() if name != "mesh"}
    return {
        "seconds": seconds,
        "before": before,
        "phases": phases,
        "status": solution.status.value,
        "solves": [level.linear_solves for level in solution.levels] or [solution.history.linear_solves],
        "factorisations": [level.factorisations for level in solution.levels],
        "level_seconds": [level.seconds for level in solution.levels],
        "dofs": solution.model.dofs,
        "linear_algebra": solution.linear_algebra,
    }


def main(arguments: list[str]) -> int:
    """Solve once to compile, solve again, and print."""
    what, nx, levels, algebra = (*arguments, *("1", "auto")[len(arguments) - 2 :])
    run(what, _WARM, int(levels), algebra)
    found = run(what, int(nx), int(levels), algebra)
    comm = MPI.COMM_WORLD
    found["ranks"] = comm.size
    for name in ("seconds", "before"):
        found[name] = parallel.global_max(comm, found[name])
    found["peak"] = parallel.global_max(comm, peak_memory(MPI.COMM_SELF))
    parallel.log_on_root(comm, json.dumps(found))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
