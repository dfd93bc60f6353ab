"""Large problems in 3D: CPU seconds over CG with GAMG, memory, growth, and a linear solve in the same storage.

    ./env python3 benchmarks/costs/run.py --only large-space,space-growth --repeats 3
    ./env python3 benchmarks/costs/large_space.py coulomb 144            # one solve in its own process: a line of JSON

The yardstick is one linear solve of the same body held at the bottom, as users of dolfinx write it: an assembled AIJ
matrix, CG, GAMG.  The making of meshes is not counted on either side; all coarser meshes are.
"""

from __future__ import annotations

import argparse
import ctypes
import gc
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from mpi4py import MPI  # first: with wheels of PyPI its library is not found otherwise

# isort: split
import numpy as np
import space
import two_bodies
from petsc4py import PETSc
from row import Row, Say
from space import Run
from space_rows import space_levels

from signorini_fx.algebra.linalg.multigrid import Hierarchy
from signorini_fx.algebra.linalg.petsc_c import call
from signorini_fx.mechanics.assembly.block_stiffness import block_stiffness, why_not
from signorini_fx.mechanics.body.discretisation import prepare
from signorini_fx.mechanics.rigid.mesh_levels import MeshLevel
from signorini_fx.records import Timings
from signorini_fx.results.accuracy.convergence_table import peak_memory
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.scene import Scene
from signorini_fx.tuned import KRYLOV_TOLERANCE, SMOOTHED_SPECTRUM

_GAMMA = 1e7
# Cells along the block: 316,899 unknowns, with linear elements; about as many of two bodies; 42,483 of degree 2.
_CELLS, _OF_TWO, _QUADRATIC = 96, 84, 24
_MILLION, _GROWTH = 144, (48, 96, 144, 192)
_LAWS = {"frictionless": 0.45, "tresca": 0.5, "coulomb": 0.55}
_WARM = 12


def best_linear(nx: int) -> Run:
    """One linear solve by the classes of the package: blocks, coarser meshes as levels, rough V-cycles."""
    meshes = [nx // 2**k for k in reversed(range(space_levels(nx)))]
    made = [(scene := _held(cells), load_mesh(scene, MPI.COMM_SELF)) for cells in meshes]
    why_not(MPI.COMM_SELF)  # loads the products by blocks
    start, cpu = time.perf_counter(), time.process_time()
    level: MeshLevel | None = None
    for scene, tagged in made:
        d = prepare(scene.statement, tagged, Timings())
        stiffness = block_stiffness(d.forms, d.fixed)
        level = MeshLevel(d.space, d.fixed, None, d.motions, level, None, stiffness)
    load, x = stiffness.createVecs()
    load.getArray()[:] = np.where(d.fixed, 0.0, sum(part.forces for part in d.applied))
    ksp = _with_v_cycles(stiffness, Hierarchy.of(stiffness, level))
    ksp.solve(load, x)
    seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
    steps, converged = ksp.getIterationNumber(), ksp.getConvergedReason() > 0
    return Run(seconds, cpu, steps, 1, load.getSize(), converged=converged)


def _held(nx: int) -> Scene:
    """The block held at the bottom, without contact."""
    made = space.scene("frictionless", nx, "hexahedron", _GAMMA, 1)
    (held, *others), axes = made.displacement, dict.fromkeys("xyz", 0.0)
    bottom = held.model_copy(update={"boundary": "bottom", **axes})
    return made.model_copy(update={"contact": (), "displacement": (bottom, held, *others)})


def _with_v_cycles(matrix: PETSc.Mat, levels: Hierarchy) -> PETSc.KSP:
    """CG with V-cycles of these levels, Chebyshev's iteration with Jacobi on each, as for contact."""
    ksp = PETSc.KSP().create(matrix.comm)
    ksp.setOperators(matrix, levels.smoothed)
    ksp.setType(PETSc.KSP.Type.CG)
    ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
    ksp.setTolerances(rtol=KRYLOV_TOLERANCE, max_it=1000)
    cycle, depth = ksp.getPC(), len(levels.interpolations)
    cycle.setType(PETSc.PC.Type.MG)
    cycle.setMGLevels(depth + 1)
    for k, interpolation in enumerate(levels.interpolations):
        cycle.setMGInterpolation(depth - k, interpolation)
    for k, coarse in enumerate(levels.coarse):
        smoother = cycle.getMGSmoother(depth - 1 - k) if k < depth - 1 else cycle.getMGCoarseSolve()
        smoother.setOperators(coarse)
    finest = cycle.getMGSmoother(depth)
    finest.setOperators(levels.smoothed)
    low, high = (share * levels.largest for share in SMOOTHED_SPECTRUM)
    call("KSPChebyshevSetEigenvalues", finest, *map(ctypes.c_double, (high, low)))
    for k in range(1, depth + 1):
        cycle.getMGSmoother(k).getPC().setType(PETSc.PC.Type.JACOBI)
    return ksp


def rows(repeats: int, say: Say) -> Iterator[Row]:
    """Whole solves over the yardstick, and what one with a million unknowns takes."""
    cell, tetrahedra = space.CELLS
    two = {"linear_algebra": "krylov", "levels": two_bodies.space_levels(_OF_TWO)}

    def of(law: str, cell: str = cell, nx: int = _CELLS, degree: int = 1) -> Callable[[], Run]:
        return lambda: space.package(law, nx, cell, _GAMMA, space_levels(nx), degree)

    pair = f"hexahedra, two bodies {_OF_TWO}"
    squares = f"hexahedra of degree 2, {_QUADRATIC}"
    # What is run, over what, and the largest ratio allowed.
    runs: dict[tuple[str, str], tuple[Callable[[], Run], str, float | None]] = {}
    for kind, name in ((cell, f"hexahedra {_CELLS}"), (tetrahedra, f"tetrahedra {_CELLS}")):
        runs["linear", name] = (lambda kind=kind: space.linear(_CELLS, kind)), name, None
        for law, limit in _LAWS.items():
            runs[law, name] = of(law, kind), name, limit if kind == cell else None
    runs["coulomb", pair] = (
        (lambda: two_bodies.package(two_bodies.scene(_OF_TWO, 3, gamma=_GAMMA, **two))[0]),
        f"hexahedra {_CELLS}",
        0.9,
    )
    runs["linear", squares] = (lambda: space.linear(_QUADRATIC, cell, degree=2)), squares, None
    runs["coulomb", squares] = of("coulomb", nx=_QUADRATIC, degree=2), squares, None
    runs["best linear", f"hexahedra {_CELLS}"] = (lambda: best_linear(_CELLS)), f"hexahedra {_CELLS}", None
    _warm_up(say)
    spent: dict[tuple[str, str], list[Run]] = {key: [] for key in runs}
    for repeat in range(repeats):
        for key, (run, _, _) in runs.items():
            say(f"large-space, {', '.join(key)}, round {repeat + 1} of {repeats}")
            gc.collect()
            spent[key].append(run())
    for key, (_, over, limit) in runs.items():
        unit, found = [run.cpu for run in spent["linear", over]], spent[key]
        seconds = float(np.median([run.cpu for run in found]))
        note = f"{found[0].dofs} unknowns, {seconds:.2f} s over {np.median(unit):.2f} s of CPU; {found[0].note}"
        if key[0] == "linear":
            measured = [run.cpu for run in found]
            note = f"{found[0].dofs} unknowns, {found[0].steps} steps"
            yield Row("large-space", "assembly, CG and GAMG, the yardstick", key[1], measured, unit="s", note=note)
            continue
        ratio = [run.cpu / one if run.converged else np.inf for run, one in zip(found, unit, strict=True)]
        yield Row("large-space", f"whole solve over the yardstick, {key[0]}", key[1], ratio, limit, note=note)
    yield from of_process("large-space", _MILLION, say, (24.0, 2800.0))


def _warm_up(say: Say) -> None:
    """Compile all forms."""
    say("large-space, forms")
    for kind in space.CELLS:
        space.linear(_WARM, kind)
        for law in space.LAWS:
            space.package(law, _WARM, kind, _GAMMA, 2)
    space.linear(_WARM, space.CELLS[0], degree=2)
    space.package("coulomb", _WARM, space.CELLS[0], _GAMMA, 2, 2)
    two_bodies.package(two_bodies.scene(_WARM, 3, gamma=_GAMMA, linear_algebra="krylov", levels=2))
    best_linear(2 * _WARM)


def of_process(
    group: str, nx: int, say: Say, limits: tuple[float | None, float | None] = (None, None)
) -> Iterator[Row]:
    """CPU seconds and peak memory of a whole solve with Coulomb friction in a process of its own."""
    say(f"{group}, {nx} cells")
    command = [sys.executable, str(Path(__file__)), "coulomb", str(nx)]
    said = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[-1])
    size, dofs = f"hexahedra {nx}", said["dofs"]
    note = f"{dofs} unknowns, {dofs / said['cpu']:.0f} a second; {said['note']}"
    cpu = [said["cpu"] if said["converged"] else np.inf]
    yield Row(group, "CPU seconds of a whole solve, coulomb", size, cpu, limits[0], unit="s", note=note)
    note = f"{said['peak'] * 2**20 / dofs:.0f} bytes per unknown"
    yield Row(group, "its peak memory", size, [said["peak"]], limits[1], unit="MB", note=note)


def growth(say: Say) -> Iterator[Row]:
    """The same on finer and finer meshes; the last one needs 7 GB."""
    for nx in _GROWTH:
        yield from of_process("space-growth", nx, say)


def main() -> None:
    """Solve once in this process, and print a line of JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("law", choices=list(space.LAWS))
    parser.add_argument("cells", type=int, help="along the block")
    given = parser.parse_args()
    space.package(given.law, _WARM, space.CELLS[0], _GAMMA, 2)
    run = space.package(given.law, given.cells, space.CELLS[0], _GAMMA, space_levels(given.cells))
    said = {name: getattr(run, name) for name in ("cpu", "steps", "dofs", "note", "converged")}
    print(json.dumps({**said, "peak": peak_memory(MPI.COMM_SELF)}))


if __name__ == "__main__":
    main()
