"""Compare with CalculiX: both programs solve the same Abaqus deck.

    ./env python3 benchmarks/costs/calculix.py block [--cells 8,16,24] [--law coulomb]  # contact in 3D
    ./env python3 benchmarks/costs/calculix.py deck part.inp [scene.toml]  # displacements of a deck of your own

The program is ccx (Debian's package calculix-ccx), or what CCX in the environment names; without it nothing is done.
A deck is drafted as a scene, unless one is given, such as the draft after it has been completed.  Times are CPU times
of one thread, from the deck to the solution, without starting Python and compiling forms.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from scipy.spatial import cKDTree

from signorini_fx import solve
from signorini_fx.addons.decks.draft import draft
from signorini_fx.mechanics.mesh.files.formats import read_file
from signorini_fx.results.solution import Solution
from signorini_fx.scenes.reading import read_scene

Floats = npt.NDArray[np.float64]

# The block, in its length: E and the stiffness of contact per area, of sticking less.
YOUNG, POISSON, CONTACT, STICK, COEFFICIENT = 1000.0, 0.3, 1e5, 1e4, 0.3
_PUSHED = (0.004, 0.0, -0.02)  # the displacement of its top
_BULGE = 0.04  # its bottom is a paraboloid, so much higher at the corners


def block(cells: int, law: str) -> str:
    """A block of ``cells`` x ``cells`` x ``cells / 2`` hexahedra, which its top presses and pushes on a rigid plate."""
    at = np.linspace(0.0, 1.0, cells + 1)
    z, y, x = np.stack(np.meshgrid(at[::2] / 2, at, at, indexing="ij")).reshape(3, -1)
    z = z + (1 - 2 * z) * 2 * _BULGE * ((x - 0.5) ** 2 + (y - 0.5) ** 2)
    nodes = [f"{n}, {a!r}, {b!r}, {c!r}" for n, (a, b, c) in enumerate(np.column_stack((x, y, z)).tolist(), 1)]
    row, layer = cells + 1, (cells + 1) ** 2
    first = [1 + i + j * row + k * layer for k in range(cells // 2) for j in range(cells) for i in range(cells)]
    around = (0, 1, row + 1, row)
    corners = [*around, *(layer + c for c in around)]
    lines = ["*NODE", *nodes, "*ELEMENT, TYPE=C3D8, ELSET=BLOCK"]
    lines += [f"{n}, {', '.join(str(c + k) for k in corners)}" for n, c in enumerate(first, 1)]
    count, elements = len(x), len(first)
    plate = [(a, b, c) for c in (-0.5, 0.0) for a, b in ((-0.5, -0.5), (1.5, -0.5), (1.5, 1.5), (-0.5, 1.5))]
    lines += ["*NODE, NSET=PLATE", *(f"{count + n}, {a}, {b}, {c}" for n, (a, b, c) in enumerate(plate, 1))]
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=GROUND", ", ".join(map(str, [elements + 1, *range(count + 1, count + 9)]))]
    lines += ["*ELSET, ELSET=LOW, GENERATE", f"1, {cells**2}", "*SURFACE, NAME=BOTTOM", "LOW, S1"]
    lines += ["*SURFACE, NAME=FLOOR", f"{elements + 1}, S2"]
    lines += ["*NSET, NSET=TOP, GENERATE", f"{count - layer + 1}, {count}", "*NSET, NSET=ALL, GENERATE", f"1, {count}"]
    lines += ["*MATERIAL, NAME=M", "*ELASTIC", f"{YOUNG}, {POISSON}"]
    lines += ["*SOLID SECTION, ELSET=BLOCK, MATERIAL=M", "*SOLID SECTION, ELSET=GROUND, MATERIAL=M"]
    lines += ["*SURFACE INTERACTION, NAME=S", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{CONTACT}"]
    lines += ["*FRICTION", f"{COEFFICIENT}, {STICK}"] if law == "coulomb" else []
    lines += ["*CONTACT PAIR, INTERACTION=S, TYPE=SURFACE TO SURFACE", "BOTTOM, FLOOR", "*BOUNDARY", "PLATE, 1, 3"]
    lines += ["*STEP", "*STATIC", "1., 1.", "*BOUNDARY", *(f"TOP, {k}, {k}, {u}" for k, u in enumerate(_PUSHED, 1))]
    return "\n".join([*lines, "*NODE PRINT, NSET=TOP, TOTALS=ONLY", "RF", "*END STEP"]) + "\n"


def ccx(program: str, deck: Path, folder: Path, plane: bool) -> tuple[Floats, Floats, Floats, float]:
    """Positions and displacements of nodes, the force on the set that the deck prints, and the CPU time.

    Raises:
        RuntimeError: the program has not solved the deck.
    """
    output = f"*NODE FILE{', OUTPUT=2D' if plane else ''}\nU\n\\1"
    text = re.sub(r"(?im)^(\*end ?step)", output, deck.read_text(encoding="utf-8", errors="replace"))
    (folder / "job.inp").write_text(text, encoding="utf-8")
    start = cpu()
    environment = os.environ | {"OMP_NUM_THREADS": "1", "CCX_NPROC_EQUATION_SOLVER": "1"}
    done = subprocess.run([program, "job"], cwd=folder, capture_output=True, text=True, env=environment, check=False)
    seconds = cpu() - start
    result = folder / "job.frd"
    x, u = nodal(result) if result.exists() else (np.empty((0, 3)),) * 2
    if not u.size or "*ERROR" in done.stdout:
        raise RuntimeError("\n".join(["ccx has not solved it:", *done.stdout.splitlines()[-20:]]))
    printed = (folder / "job.dat").read_text(encoding="utf-8")
    totals = re.findall(r"total force .*\n\s*\n?(.+)", printed)
    return x, u, np.array([float(word) for word in totals[-1].split()]) if totals else np.full(3, np.nan), seconds


def cpu() -> float:
    """CPU time of this process and of those that it has started."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def nodal(frd: Path) -> tuple[Floats, Floats]:
    """Positions of the nodes and their last displacements in a file of results, shape (n, 3) each."""
    x: dict[int, list[float]] = {}
    u: dict[int, list[float]] = {}
    into: dict[int, list[float]] | None = None
    for line in frd.read_text(encoding="utf-8").splitlines():
        if line.startswith("    2C"):
            into = x
        elif line.startswith(" -4"):
            into = None
            if line.split()[1] == "DISP":
                into = u = {}
        elif line.startswith(" -3"):
            into = None
        elif line.startswith(" -1") and into is not None:
            into[int(line[3:13])] = [float(line[k : k + 12]) for k in (13, 25, 37)]
    both = sorted(x.keys() & u.keys())
    return np.array([x[n] for n in both]).reshape(-1, 3), np.array([u[n] for n in both]).reshape(-1, 3)


def difference(solution: Solution, x: Floats, u: Floats) -> float:
    """The largest difference of displacements at nodes of the deck, relative to the largest displacement.

    Where nodes of two bodies coincide the closer displacement counts.
    """
    space = solution.displacement.function_space
    places, dim = space.tabulate_dof_coordinates(), space.mesh.geometry.dim
    values = solution.displacement.x.array.reshape(-1, dim)
    near = cKDTree(places).query_ball_point(x, 1e-5 * np.ptp(places, axis=0).max())
    apart = [np.linalg.norm(values[own] - u[n, :dim], axis=1).min() for n, own in enumerate(near) if own]
    if 2 * len(apart) < len(x):
        raise RuntimeError(f"only {len(apart)} of {len(x)} nodes are those of the scene")
    return float(max(apart) / np.linalg.norm(u, axis=1).max())


def of_block(text: str) -> str:
    """The draft of the block with a plate that does not deform."""
    foundation = 'gap = "x[2]"\ndirection = [0.0, 0.0, -1.0]'
    return text.replace('against = "FLOOR"', foundation)


def compare(
    program: str, deck: Path, scene: Path | None, complete: Callable[[str], str] = str
) -> tuple[Solution, float, Floats, tuple[float, float]]:
    """Solve a deck by both: the solution, the difference of displacements, ccx's force, and both CPU times.

    Args:
        program: ccx.
        deck: the file.
        scene: None: the draft.
        complete: makes a scene of the draft.
    """
    with tempfile.TemporaryDirectory() as name:
        own = Path(name) / "draft.toml"
        x, u, force, theirs = ccx(program, deck, Path(name), plane=read_file(deck).dim == 2)
        start = cpu()
        if scene is None:
            own.write_text(complete(draft(deck, own).text), encoding="utf-8")
        solution = solve(read_scene(scene or own), MPI.COMM_SELF)
        seconds = cpu() - start
    return solution, difference(solution, x, u), force, (theirs, seconds)


def blocks(program: str, sizes: Sequence[int], law: str) -> Iterator[str]:
    """One row for each number of cells."""
    yield "| cells | unknowns | vertical force, ccx | here | largest difference of u | ccx | here | times faster |"
    yield "|---|---|---|---|---|---|---|---|"
    with tempfile.TemporaryDirectory() as name:
        for cells in (min(sizes), *sizes):
            deck = Path(name) / "block.inp"
            deck.write_text(block(cells, law), encoding="utf-8")
            solution, apart, force, (theirs, ours) = compare(program, deck, None, of_block)
            unknowns = solution.displacement.x.array.size
            here = -solution.resultants.of("BOTTOM").force[2]
            row = f"| {cells} x {cells} x {cells // 2} | {unknowns:,} | {force[2]:.5g} | {here:.5g} | {apart:.1e} "
            yield f"{row}| {theirs:.1f} s | {ours:.1f} s | {theirs / ours:.1f} |"


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare, and print what was found."""
    parser = argparse.ArgumentParser(prog="benchmarks/costs/calculix.py", description=__doc__.split("\n\n")[0])
    kinds = parser.add_subparsers(dest="kind", required=True)
    own = kinds.add_parser("block", help="contact of a block with a plate")
    own.add_argument("--cells", default="8,16,24", metavar="N,...", help="even numbers of cells along the block")
    own.add_argument("--law", choices=("none", "coulomb"), default="coulomb")
    deck = kinds.add_parser("deck", help="a deck of your own")
    deck.add_argument("file", type=Path)
    deck.add_argument("scene", type=Path, nargs="?")
    given = parser.parse_args(arguments)
    program = shutil.which(os.environ.get("CCX", "ccx"))
    if program is None:
        print("there is no ccx: apt install calculix-ccx, or name it in CCX; nothing is compared")
        return 0
    if given.kind == "block":
        for line in blocks(program, [int(word) for word in given.cells.split(",")], given.law):
            print(line, flush=True)
        return 0
    solution, apart, _, (theirs, ours) = compare(program, given.file, given.scene)
    print(
        f"{given.file}: {solution.status}, displacements differ by {apart:.1e}; ccx {theirs:.2f} s, here {ours:.2f} s"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
