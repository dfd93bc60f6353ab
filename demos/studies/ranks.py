"""What a second rank buys: the same solves on one rank and on two, each under ``mpirun`` in processes of its own.

    ./env python3 demos/studies/ranks.py --out results/ranks

Counts and answers must not depend on the ranks; the seconds do, on a machine with a free core for each, and on the
linear algebra.  Written is ranks.csv.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import time
from pathlib import Path

RANKS = (1, 2)
REPEATS = 3
# Size of the cells relative to those of the demo, solver settings.
METHODS = {
    "Q1, condensed": (0.5, {"linear_algebra": "condensed"}),
    "Q1, full": (0.5, {"linear_algebra": "full"}),
    "Q1, full, nested": (0.5, {"linear_algebra": "full", "levels": 3}),
    "Q1, krylov, nested": (0.5, {"linear_algebra": "krylov", "levels": 3}),
}
SCENE = "example1_coulomb"


def run(name: str) -> None:
    """One method on the ranks that there are: what it took, as JSON from the first rank."""
    from mpi4py import MPI
    from cases import on_mesh, scene_of

    from signorini_fx.machine import parallel
    from signorini_fx.results.accuracy.convergence_table import peak_memory
    from signorini_fx.scenes.solver import solve

    factor, settings = METHODS[name]
    scene, comm = on_mesh(scene_of(SCENE), factor, "Q1", settings), MPI.COMM_WORLD
    times = []
    for _ in range(REPEATS + 1):
        comm.barrier()
        begin = time.perf_counter()
        solution = solve(scene, comm)
        times.append(parallel.global_max(comm, time.perf_counter() - begin))
    peak = float(solution.table.columns["pressure"].max())
    memory = peak_memory(comm)
    answer = {
        "dofs": solution.model.dofs,
        "linear_algebra": solution.linear_algebra.split(":")[0],
        "linear_solves": solution.history.linear_solves,
        "seconds": statistics.median(times[1:]),
        "memory": memory,
        "peak": peak,
    }
    parallel.log_on_root(comm, json.dumps(answer))


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("results/ranks"), help="folder (default: %(default)s)")
    parser.add_argument("--run", choices=METHODS, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.run:
        run(options.run)
        return
    from signorini_fx.machine.csv_text import write_csv

    rows = []
    for name in METHODS:
        for ranks in RANKS:
            command = ["mpirun", "-n", str(ranks), sys.executable, __file__, "--run", name]
            ended = subprocess.run(command, capture_output=True, text=True, check=True)
            answer = json.loads(ended.stdout.strip().splitlines()[-1])
            rows.append({"method": name, "ranks": ranks, **answer})
            told = f"{answer['linear_solves']} solves, {answer['seconds']:.2f} s, {answer['memory']:.0f} MB"
            told += f", peak {answer['peak']:.6f}"
            print(f"{name:20s} {ranks} ranks: {answer['linear_algebra']}, {told}", flush=True)
    options.out.mkdir(parents=True, exist_ok=True)
    write_csv(options.out / "ranks.csv", rows)


if __name__ == "__main__":
    main()
