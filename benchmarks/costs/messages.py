"""Messages, reductions and gathered bytes of a nested solve in 3D, by phase, and the memory of each rank.

    ./env mpirun -n 4 python3 benchmarks/costs/messages.py [--cells 48] [--law coulomb]

PETSc counts the messages of its vectors and matrices; the gathers and reductions of the package go through
``machine.parallel``, where they are counted here.  What dolfinx sends while it makes meshes is not counted.
"""

from __future__ import annotations

import argparse
import tempfile
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
from signorini_fx.machine import parallel

_OUTSIDE = "estimates"


class Counters:
    """What is gathered and reduced by the package, by phase of the solve.

    Attributes:
        phase: the current one.
        gathered: bytes that each rank receives.
        reductions: their number.
    """

    def __init__(self) -> None:
        self.phase = _OUTSIDE
        self.gathered: dict[str, int] = defaultdict(int)
        self.reductions: dict[str, int] = defaultdict(int)

    @contextmanager
    def during(self, name: str) -> Iterator[None]:
        """Count for a phase, also in PETSc's log."""
        before, self.phase = self.phase, name
        stage = PETSc.Log.Stage(name)  # a name always gives the same stage
        stage.push()
        try:
            yield
        finally:
            stage.pop()
            self.phase = before

    def watch(self) -> None:
        """Insert the counters into the package."""
        timed, gather, total = records.Timings.phase, parallel.gather_rows, parallel.global_sum
        counters = self

        @contextmanager
        def phase(timings: records.Timings, name: str) -> Iterator[None]:
            with counters.during(name), timed(timings, name):
                yield

        def gather_rows(comm: MPI.Comm, rows: np.ndarray) -> np.ndarray:
            found = gather(comm, rows)
            counters.gathered[counters.phase] += found.nbytes
            return found

        def global_sum(comm: MPI.Comm, values: Any) -> Any:
            counters.reductions[counters.phase] += 1
            return total(comm, values)

        records.Timings.phase = phase  # type: ignore[method-assign]
        parallel.gather_rows, parallel.global_sum = gather_rows, global_sum


def petsc_counts(comm: MPI.Comm) -> dict[str, tuple[float, float, float]]:
    """Messages of all ranks, their mean length in bytes, and reductions, by stage of PETSc's log."""
    with tempfile.TemporaryDirectory() as folder:
        file = comm.bcast(str(Path(folder) / "log"))
        PETSc.Log.view(PETSc.Viewer().createASCII(file, comm=comm))
        text = Path(file).read_text(encoding="utf-8") if comm.rank == 0 else ""
        comm.barrier()
    found = {}
    for line in text.partition("Summary of Stages")[2].splitlines()[2:]:
        name, _, numbers = line.partition(": ")[2].partition(": ")
        values = numbers.replace("%", " ").split()
        if len(values) != 10:
            break
        found[name.strip()] = (float(values[4]), float(values[6]), float(values[8]))
    return found


def main() -> None:
    """Solve and print the counts."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--cells", type=int, default=48, help="along the block")
    parser.add_argument("--law", default="coulomb", choices=list(space.LAWS))
    given = parser.parse_args()
    comm = MPI.COMM_WORLD
    PETSc.Log.begin()
    counters = Counters()
    counters.watch()
    with counters.during(_OUTSIDE):
        solution = solve(
            space.scene(given.law, given.cells, "hexahedron", 1e7, space_levels(given.cells)), comm, check=False
        )
    sent = petsc_counts(comm)
    memory = comm.gather(int(Path("/proc/self/status").read_text(encoding="ascii").split("VmHWM:")[1].split()[0]))
    if comm.rank:
        return
    peak = " ".join(f"{own / 1024:.0f}" for own in memory or [])
    dofs = solution.model.dofs
    print(f"{solution.status.value}, {dofs} unknowns, {comm.size} ranks, peak MB of each: {peak}")
    print("     phase  messages mean bytes  PETSc reductions    own  gathered kB")
    for name, (messages, length, reductions) in sent.items():
        own, gathered = counters.reductions[name], counters.gathered[name] / 1024
        print(f"{name:>10s} {messages:9.0f} {length:10.0f} {reductions:17.0f} {own:6d} {gathered:12.1f}")


if __name__ == "__main__":
    main()
