"""One solve in a process of its own, on any number of ranks: prints its time and peak memory as one line of JSON.

    python3 bench/once.py WHAT NX [LEVELS [LINEAR_ALGEBRA]]

WHAT is tresca, fp, newton (the package) or mumps, cholmod (one linear solve).
"""

from __future__ import annotations

import json
import resource
import sys
import time
from typing import Any

import example1
import linear
from mpi4py import MPI

from signorini_fx import parallel, solve

_WARM = 96  # cells along the bottom of the solve that loads and compiles everything


def peak() -> float:
    """Largest resident memory of this process so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def run(what: str, nx: int, levels: int, algebra: str) -> dict[str, Any]:
    """Solve once.

    Returns:
        Phases and, of the package, counts by level; ``mesh`` is the making of the finest mesh, which does not count.
    """
    comm = MPI.COMM_WORLD
    if what in linear.PACKAGES:
        tagged = example1.tagged_mesh(nx, comm)
        start, before = time.perf_counter(), peak()
        _, phases = linear.solve(tagged, what)
        return {"seconds": time.perf_counter() - start, "before": before, "phases": phases, "status": "converged"}
    law = "tresca" if what == "tresca" else "coulomb"
    settings: dict[str, Any] = {"levels": levels, "linear_algebra": algebra}
    if law == "coulomb":
        settings["coulomb"] = what
    # Nested iteration makes its meshes itself, the other kind gets its mesh.
    mesh = example1.tagged_mesh(nx, comm) if levels == 1 else nx
    start, before = time.perf_counter(), peak()
    solution = solve(example1.scene(law, mesh, **settings), comm, check=False)
    phases = dict(solution.timings.seconds)
    making = phases.pop("mesh")
    return {
        "seconds": time.perf_counter() - start - making,
        "before": before,
        "phases": phases,
        "status": solution.status.value,
        "solves": [level.linear_solves for level in solution.levels] or [solution.history.linear_solves],
        "factorisations": [level.factorisations for level in solution.levels],
        "dofs": solution.discretisation.dofs,
        "linear_algebra": solution.linear_algebra,
    }


def main(arguments: list[str]) -> int:
    """Warm up, solve, print."""
    what, nx, levels, algebra = (*arguments, *("1", "auto")[len(arguments) - 2 :])
    run(what, _WARM, int(levels), algebra)
    found = run(what, int(nx), int(levels), algebra)
    comm = MPI.COMM_WORLD
    found["ranks"] = comm.size
    for name in ("seconds", "before"):
        found[name] = parallel.global_max(comm, found[name])
    found["peak"] = parallel.global_max(comm, peak())
    parallel.log_on_root(comm, json.dumps(found))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
