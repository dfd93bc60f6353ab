"""What each rank receives and holds, on as many ranks as this program has.

    ./env mpirun -n 4 python3 benchmarks/costs/bytes_of_ranks.py block file pair sliding [--cells N]

block, file: a block of hexahedra with results, from its generator or from a file of dolfinx.
pair, sliding: two blocks; with the linear law, or nonlinear and with large slips.
map, sliding-map: the map of a pair alone; of one that slides with its stiffness.

It prints the unknowns, the contact points, the peak of each rank's memory, and the bytes that a
rank receives at each place that calls ``machine.parallel``; messages of dolfinx and PETSc are not
counted.  Ranks may be more than cores.  A peak is that of the process: measure one problem at a
time.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mpi4py import MPI  # first: with wheels of PyPI its library is not found otherwise

# isort: split
import numpy as np

from signorini_fx import Solution, solve, write_results
from signorini_fx.machine import parallel
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_WORLD
LARGE = 1000  # bytes from which a place is printed
# Functions of ``parallel`` that send arrays, and the bytes of what they return.
SENDING: dict[str, Callable[[Any], int]] = {
    "gather_rows": lambda rows: rows.nbytes,
    "rows_on_root": lambda rows: rows.nbytes,
    "global_sum": lambda sums: sums.nbytes,
    "exchanged": lambda parts: sum(len(MPI.pickle.dumps(part)) for part in parts),
}


@contextmanager
def counted() -> Iterator[Counter[str]]:
    """Count the bytes that this rank receives by the place that asks for them."""
    received: Counter[str] = Counter()
    before = {name: getattr(parallel, name) for name in SENDING}

    def counting(name: str) -> Callable[..., Any]:
        def call(comm: MPI.Comm, data: Any) -> Any:
            frame = sys._getframe(1)
            while frame.f_code.co_filename == parallel.__file__ and frame.f_back:
                frame = frame.f_back
            result = before[name](comm, data)
            if comm.size > 1:
                code = frame.f_code
                place = code.co_filename.rpartition("signorini_fx/")[2]
                received[f"{place} {code.co_name}"] += SENDING[name](result)
            return result

        return call

    try:
        for name in SENDING:
            setattr(parallel, name, counting(name))
        yield received
    finally:
        for name, function in before.items():
            setattr(parallel, name, function)


def on_any_rank(received: Counter[str]) -> dict[str, int]:
    """Return the most bytes that any rank has received at each place; collective."""
    every = COMM.allgather(dict(received))
    return {place: max(one.get(place, 0) for one in every) for place in sorted(set().union(*every))}


def block(cells: int, **settings: object) -> dict[str, Any]:
    """A block 3 x 1 x 1 over a plane, ``cells`` along its short sides."""
    numbers = {"length": 3.0, "nx": 3 * cells, "ny": cells, "nz": cells}
    return {
        "mesh": {"generator": "box", "parameters": {**numbers, "cell": "hexahedron"}},
        "material": {"young": 5000.0, "poisson": 0.3},
        "displacement": {"boundary": "top", "x": 0.002, "y": 0.0, "z": -0.01},
        "contact": {"boundary": "bottom", "friction": {"law": "coulomb", "coefficient": 0.3}},
        "solver": {"linear_algebra": "krylov", **settings},
    }


def of_file(cells: int, folder: Path) -> dict[str, Any]:
    """The same block in a file that dolfinx has written."""
    from dolfinx.io import XDMFFile

    from signorini_fx.mechanics.mesh.tagged import generate_mesh

    scene = block(cells)
    file = folder / "block.xdmf"
    made = generate_mesh("box", scene["mesh"]["parameters"], COMM)
    with XDMFFile(COMM, file, "w") as out:
        out.write_mesh(made.mesh)
    names = {"top": "x[2] > 1 - 1e-9", "bottom": "x[2] < 1e-9"}
    return scene | {"mesh": {"file": str(file), "boundaries": names}}


def pair(cells: int, layers: int, **law: object) -> dict[str, Any]:
    """A block on another one, whose cells are not opposite its own, with layers of cells."""

    def body(name: str, shift: float, count: int) -> dict[str, Any]:
        numbers = {"nx": count, "ny": count, "nz": layers, "height": 0.5}
        parameters = {"length": 1.0, "width": 1.0, **numbers, "cell": "hexahedron"}
        mesh = {"generator": "box", "parameters": parameters}
        return {"name": name, "shift": [0.0, 0.0, shift], "mesh": mesh}

    held = {"x": 0.0, "y": 0.0, "z": 0.0}
    return {
        "body": [body("lower", 0.0, cells + 1), body("upper", 0.5, cells)],
        "material": {"young": 100.0, "poisson": 0.3, **law},
        "displacement": [
            {"boundary": "lower.bottom", **held},
            {"boundary": "upper.top", **held, "x": 0.002, "z": -0.01},
        ],
        "contact": {
            "boundary": "upper.bottom",
            "against": "lower.top",
            "friction": {"law": "coulomb", "coefficient": 0.3},
        },
    }


SCENES: dict[str, Callable[[int, Path], dict[str, Any]]] = {
    "block": lambda cells, folder: block(cells, levels=1 + round(np.log2(max(cells, 8) / 4))),
    "file": of_file,
    "pair": lambda cells, folder: pair(cells, max(cells // 4, 1)),
    "sliding": lambda cells, folder: pair(cells, max(cells // 4, 1), law="neo-hooke"),
}

MAPS = {"map": False, "sliding-map": True}  # whether the sides slide


def solved(scene: dict[str, Any], folder: Path) -> tuple[Solution, dict[str, int]]:
    """Solve a problem, write its results, and return what the ranks have received; collective."""
    read = parse_scene(scene)
    with counted() as received:
        solution = solve(read, COMM)
        write_results(solution, folder, pictures=False)
    return solution, on_any_rank(received)


def side(cells: int, height: float, low: float) -> Any:
    """A square side of a body, with a curvature."""
    from signorini_fx.mechanics.pairs.pair_side import Lagrange, PairSurface

    x, y = np.meshgrid(*[np.linspace(low, low + 1, cells + 1)] * 2, indexing="ij")
    places = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    first = np.add.outer((cells + 1) * np.arange(cells), np.arange(cells)).ravel()[:, None]
    nodes = first + np.array([0, cells + 1, 1, cells + 2])
    at = np.column_stack((x.ravel(), y.ravel(), height - 0.01 * (x.ravel() ** 2 + y.ravel() ** 2)))
    sign = np.full(len(nodes), 1.0 if height == 0 else -1.0)
    return PairSurface.of(nodes, at, Lagrange(places), sign)


def maps(cells: int, *, slides: bool) -> list[float]:
    """Return each rank's peak of memory above the modules, MB, for a map of a pair; collective."""
    from signorini_fx.mechanics.pairs.mortar_coupling import couple
    from signorini_fx.mechanics.pairs.pair_side import Sharing
    from signorini_fx.mechanics.pairs.sliding import slide

    def made(count: int) -> None:
        slave, master = side(count, 0.0, 0.0), side(count * 7 // 6, 0.02, 0.0)
        owner = np.arange(len(slave.x)) * COMM.size // len(slave.x)
        if not slides:
            couple(slave, master, reach=0.5, sharing=Sharing(COMM, owner))
            return
        slave, master = (one.displaced(0.001 * one.x) for one in (slave, master))
        points = np.arange(len(slave.x))
        found = slide(slave, master, points, 0.5, sharing=Sharing(COMM, owner))
        found.stiffness(np.ones(len(found.nodes)), np.ones((len(found.nodes), 2)), symmetric=False)

    made(4)  # what is imported or compiled first
    alone = parallel.peak_memory(MPI.COMM_SELF)
    made(cells)
    return COMM.allgather(parallel.peak_memory(MPI.COMM_SELF) - alone)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("problems", nargs="+", choices=[*SCENES, *MAPS])
    parser.add_argument("--cells", type=int, default=6, help="along a short side")
    given = parser.parse_args()
    lines: list[str] = []
    for name in given.problems:
        if name in MAPS:
            peaks = " ".join(f"{peak:.0f}" for peak in maps(given.cells, slides=MAPS[name]))
            lines.append(f"{name}: {(given.cells + 1) ** 2} points, MB above the modules {peaks}")
            continue
        folder = Path(COMM.bcast(tempfile.mkdtemp()))
        solution, received = solved(SCENES[name](given.cells, folder), folder / "results")
        peaks = " ".join(f"{mb:.0f}" for mb in COMM.allgather(parallel.peak_memory(MPI.COMM_SELF)))
        points = int(parallel.total(COMM, solution.contact.boundary.points.size))
        head = f"{name}: {solution.model.dofs} unknowns, {points} points, peaks {peaks} MB"
        lines.append(f"{head}, {solution.status.value}")
        largest = sorted(received.items(), key=lambda item: -item[1])
        lines += [
            f"  {count:10} {count / points:8.0f} a point  {place}"
            for place, count in largest
            if count > LARGE
        ]
    if COMM.rank == 0:
        print(f"{COMM.size} ranks", *lines, sep="\n", flush=True)


if __name__ == "__main__":
    main()
