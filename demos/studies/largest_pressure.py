"""How good the estimate of the error of the largest contact pressure is: estimated over true error, mesh by mesh.

    ./env python3 demos/studies/largest_pressure.py --seed 3 --out results/largest_pressure

Every problem of ``peak_problems`` is drawn from the seed and solved with elements of degree 1 and 2 on meshes whose
cells are halved from mesh to mesh, the first with a third of the half width of the contact; with ``--adaptive`` it is
asked for its largest pressure with ``refinement = "adaptive"`` too.  The reference is the largest pressure on finer
meshes of degree 2, extrapolated; how far it may be wrong is half of what that adds, and errors of less than three times
this are left out.  Written are largest_pressure.csv and what is printed.

An error passes through zero where nodes miss the top by as much as it is wrong, which no estimate can see: then the
ratio is large by chance.  A ratio below 1/2 is the worse one.
"""

from __future__ import annotations

import argparse
import tempfile
import time
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mpi4py import MPI
from effectivity import as_asked
from peak_problems import PLANE, SPACE, Make

from signorini_fx.errors import SceneError, SignoriniError
from signorini_fx.machine.csv_text import write_csv
from signorini_fx.records import History
from signorini_fx.results.accuracy.convergence_table import Price, convergence_table
from signorini_fx.results.accuracy.mesh_level import LevelResult
from signorini_fx.scenes.mesh_sequence import meshed_scene
from signorini_fx.solving.meshed_problem import MeshedProblem, SolvedMesh

# Sizes of the cells of the meshes, relative to those that a problem names, by its dimension and the degree.
SIZES = {
    (2, 1): (2.0, 1.0, 0.5, 0.25),
    (2, 2): (2.0, 1.0, 0.5, 0.25, 0.125),
    (3, 1): (2.0, 1.0, 0.5),
    (3, 2): (2.0, 1.0, 0.5),
}
# The last of the meshes of degree 2 are those of the reference.
OF_REFERENCE = {2: 2, 3: 1}
ASKED = 0.005


@dataclass(frozen=True)
class Row:
    """The largest pressure on one mesh; errors are relative, ``reference_error`` is how far the reference is wrong."""

    problem: str
    seed: int
    meshes: str
    degree: int
    dofs: int
    touching: int
    estimated: float
    true: float
    reference_error: float

    @property
    def ratio(self) -> float:
        """Estimated over true error."""
        return self.estimated / self.true

    @property
    def doubtful(self) -> bool:
        """Whether the reference is not good enough for this error."""
        return self.true < 3 * self.reference_error


def meshes_of(make: Make, degree: int, sizes: Sequence[float]) -> list[tuple[MeshedProblem, SolvedMesh]]:
    """The meshes of one degree, each solved from the contact state of the one before."""
    history, state, found = History(), None, []
    for number, size in enumerate(sizes):
        problem = meshed_scene(make(degree, size), MPI.COMM_SELF, history)
        if found:
            problem = problem.keeping(found[-1][1])
        solved = problem.solved(number, state, None)
        if solved.level is None:
            raise SignoriniError(f"not solved: {solved.solution.status.value}")
        state = solved.solution.contact
        found.append((problem, solved))
    return found


def prices_of(meshes: Sequence[tuple[MeshedProblem, SolvedMesh]]) -> tuple[list[LevelResult], list[Price]]:
    """The meshes and their convergence table."""
    levels = [solved.level for _, solved in meshes]
    return levels, convergence_table(levels, 0.0)


def reference_of(levels: Sequence[LevelResult]) -> tuple[float, float]:
    """The largest pressure from meshes of degree 2, extrapolated, and how far it may be wrong, relative."""
    coarse, fine = (float(level.table.columns["pressure"].max()) for level in levels[-2:])
    return fine + (fine - coarse) / 3, abs(fine - coarse) / fine / 6


def rows_of(name: str, seed: int, folder: Path, *, adaptive: bool = False) -> list[Row]:
    """The meshes of one problem that have an estimate."""
    dimension = 2 if name in PLANE else 3
    make = (PLANE | SPACE)[name](np.random.default_rng([seed, zlib.crc32(name.encode())]), folder)
    solved = {degree: meshes_of(make, degree, SIZES[dimension, degree]) for degree in (2, 1)}
    reference, wrong = reference_of([mesh.level for _, mesh in solved[2]])
    runs = [("halved", 1, *prices_of(solved[1])), ("halved", 2, *prices_of(solved[2][: -OF_REFERENCE[dimension]]))]
    for degree in (1, 2) if adaptive else ():
        try:
            found, prices = as_asked(make(degree, 2.0), ASKED, of="peak", refinement="adaptive", seconds=60.0)
        except SceneError:  # its cells cannot be divided here and there
            continue
        runs.append(("adaptive", degree, [one.level for one in found], prices))
    rows = []
    for meshes, degree, levels, prices in runs:
        for level, price in zip(levels, prices, strict=False):
            if level is not None and price.peak is not None:
                true = float(abs(level.table.columns["pressure"].max() / reference - 1))
                touching = level.table.touching
                rows.append(Row(name, seed, meshes, degree, level.dofs, touching, price.peak, true, wrong))
    return rows


def summary(rows: Sequence[Row]) -> str:
    """How the ratios are distributed."""
    lines = []
    for meshes in dict.fromkeys(row.meshes for row in rows):
        for degree in (1, 2):
            own = [row for row in rows if (row.meshes, row.degree) == (meshes, degree)]
            ratios = np.array([row.ratio for row in own if not row.doubtful])
            if not ratios.size:
                continue
            below, above = int((ratios < 0.5).sum()), int((ratios > 2).sum())
            least, low, median, high = np.quantile(ratios, (0, 0.1, 0.5, 0.9))
            lines.append(
                f"{meshes}, degree {degree}: {ratios.size} ratios, {below} below 1/2 (least {least:.2f}), "
                f"{ratios.size - below - above} between, {above} above 2; nine of ten from {low:.2f}, median "
                f"{median:.2f}, nine of ten below {high:.1f}; {len(own) - ratios.size} left out"
            )
    return "\n".join(lines)


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("results/largest_pressure"), help="folder (%(default)s)")
    parser.add_argument("--problem", choices=PLANE | SPACE, action="append", help="only this one")
    parser.add_argument("--seed", type=int, action="append", help="of the parameters (default: 1)")
    parser.add_argument("--adaptive", action="store_true", help="meshes with refinement = 'adaptive' too")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    rows: list[Row] = []
    for seed in options.seed or [1]:
        for name in options.problem or PLANE | SPACE:
            begin = time.perf_counter()
            try:
                with tempfile.TemporaryDirectory() as folder:
                    found = rows_of(name, seed, Path(folder), adaptive=options.adaptive)
            except SignoriniError as error:
                print(f"{name}: {error}", flush=True)
                continue
            rows += found
            print(f"{name}, seed {seed}: {time.perf_counter() - begin:.0f} s", flush=True)
            for row in found:
                doubt = "  left out" if row.doubtful else ""
                print(
                    f"   {row.meshes:8s} degree {row.degree} {row.dofs:7d} unknowns {row.touching:4d} in contact: "
                    f"error {row.true:.1e}, estimate {row.estimated:.1e}, ratio {row.ratio:.2f}{doubt}",
                    flush=True,
                )
            table = [vars(row) | {"ratio": row.ratio, "left out": row.doubtful} for row in rows]
            write_csv(options.out / "largest_pressure.csv", table)
    print(summary(rows))


if __name__ == "__main__":
    main()
