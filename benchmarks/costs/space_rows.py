"""The rows of the section for space."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import numpy as np
import space
import space_rival
from contestants import COEFFICIENTS
from mpi4py import MPI
from row import Row, Say, Sizes
from space import Run

from signorini_fx.mechanics.mesh.tagged import generate_mesh

# A gamma for the times, and all for which the counts must hold.
_SPACE_GAMMA, _SPACE_GAMMAS = 1e7, (1e5, 1e7, 1e9)


def space_levels(nx: int) -> int:
    """Meshes from one with 12 cells along the block, two at least, to one with ``nx``."""
    return max(2, 1 + round(np.log2(nx / 12)))


def in_space(sizes: Sizes, repeats: int, say: Say) -> list[Row]:
    """Krylov steps on the finest of three meshes, and whole solves, over one linear solve in 3D."""
    rows = []
    for cell in space.CELLS:
        once = {nx: space.linear(nx, cell) for nx in sizes.space}
        for law in space.LAWS:
            most: dict[int, list[int]] = {}
            for nx in sizes.space:
                runs = []
                for gamma in _SPACE_GAMMAS:
                    say(f"space, {law}, {cell} {nx}, gamma = {gamma:.0e}")
                    runs.append(space.package(law, nx, cell, gamma, space_levels(nx)))
                name = f"{cell} {nx}"
                most[nx] = [run.steps for run in runs]
                note = f"{[run.steps for run in runs]} over {once[nx].steps}, {runs[0].dofs} unknowns; {runs[1].note}"
                ratio = [max(run.steps if run.converged else np.inf for run in runs) / once[nx].steps]
                what = f"Krylov steps on the finest mesh over a linear solve, {law}, worst gamma"
                rows.append(Row("space", what, name, ratio, 2.5, note=note))
                set_ups = [max(run.set_ups for run in runs)]
                what = f"multigrid hierarchies on {space_levels(nx)} meshes, {law}"
                rows.append(Row("space", what, name, set_ups, float(space_levels(nx)), unit="set-ups"))
            coarse, fine = (most[nx] for nx in sizes.space)
            what = f"growth of the steps, {law}, worst gamma"
            growth = [max(np.divide(fine, coarse))]
            rows.append(Row("space", what, f"{cell} {sizes.space[0]} to {sizes.space[1]}", growth, 1.3))
        rows += _in_space_timed(sizes.space[-1], cell, repeats, say)
    return rows


def _in_space_timed(nx: int, cell: str, repeats: int, say: Say) -> list[Row]:
    seconds: dict[str, list[float]] = {law: [] for law in space.LAWS}
    for repeat in range(repeats):
        say(f"space, times, {cell} {nx}, round {repeat + 1} of {repeats}")
        unit = space.linear(nx, cell).seconds
        for law, found in seconds.items():
            found.append(space.package(law, nx, cell, _SPACE_GAMMA, space_levels(nx)).seconds / unit)
    what = "whole solve in 3D over a linear solve, CG with GAMG"
    return [Row("space", f"{what}, {law}", f"{cell} {nx}", found, 1.8) for law, found in seconds.items()]


def sweeps(sizes: Sizes, repeats: int, say: Say) -> Iterator[Row]:
    """20 friction coefficients over one linear solve."""
    cell = space.CELLS[0]
    space.sweep_coefficients(_WARM, _SPACE_GAMMA, [0.3], 2)
    for nx in sizes.space:
        found, notes = [], []
        for repeat in range(_rounds(nx, repeats)):
            say(f"space-sweep, {cell} {nx}, round {repeat + 1}")
            gc.collect()
            unit, run = (
                space.linear(nx, cell),
                space.sweep_coefficients(nx, _SPACE_GAMMA, COEFFICIENTS, space_levels(nx)),
            )
            found.append(run.cpu / unit.cpu if run.converged else np.inf)
            notes = [run.note, f"one linear solve {unit.steps}, {run.dofs} unknowns, {_cpu(run, unit)}"]
        what = f"{len(COEFFICIENTS)} values of F in 3D over a linear solve"
        yield Row("space-sweep", what, f"{cell} {nx}", found, 8.0, note="; ".join(notes))


# The gamma of package and rival, and the one with which the rival is fastest, where it also keeps the interpolation of
# GAMG. By how much the package must be faster at the largest size, for each law.
_STIFF, _BEST = 1e8, 1e6
_FASTER = {"frictionless": 3.0, "tresca": 4.0, "coulomb": 8.0}
_FASTER_THAN_BEST = 2.0
# Answers are the same if the deflection and the force differ by no more than this share, and no node is in another set.
SAME = 1e-6
# A mesh of that many cells on which all forms are compiled, and one from which on a rival runs once: it takes minutes.
_WARM, _SLOW = 12, 96


def rivals(sizes: Sizes, repeats: int, say: Say) -> Iterator[Row]:
    """The hand-written Newton's method with GAMG over the package.

    CPU seconds, because other processes use the machine during a run of minutes.
    """
    cell = space.CELLS[0]
    for law in space.LAWS:
        say(f"space-rivals, forms, {law}")
        list(_hand_written(law, _WARM, cell))
    for nx in sizes.space:
        for law in space.LAWS:
            ours: list[Run] = []
            stiff: list[Run | str] = []
            best: list[Run | str] = []
            for repeat in range(_rounds(nx, repeats)):
                say(f"space-rivals, {law}, {cell} {nx}, round {repeat + 1}")
                for found, run in zip((ours, stiff, best), _hand_written(law, nx, cell), strict=True):
                    found.append(run)
            last = nx == sizes.space[-1]
            what = f"Newton with GAMG by hand over the package, {law}"
            yield compared(what, f"{cell} {nx}", ours, stiff, _FASTER[law] if last else None, SAME)
            what = f"the same with gamma 1e6 instead of 1e8, {law}"
            yield compared(what, f"{cell} {nx}", ours, best, _FASTER_THAN_BEST if last else None, None)


def _rounds(nx: int, repeats: int) -> int:
    return 1 if nx >= _SLOW else repeats


def _hand_written(law: str, nx: int, cell: str) -> Iterator[Run | str]:
    """The package, the rival with the same gamma, and with its fastest one; a text: it has no solution."""
    yield space.package(law, nx, cell, _STIFF, space_levels(nx))
    tagged = generate_mesh("box", space.parameters(nx, cell), MPI.COMM_SELF)
    for gamma, reuse in ((_STIFF, False), (_BEST, True)):
        gc.collect()
        try:
            yield space_rival.solve(tagged, law, gamma, reuse=reuse)
        except RuntimeError as error:
            yield str(error)


def compared(
    what: str, size: str, ours: list[Run], theirs: list[Run | str], target: float | None, same: float | None
) -> Row:
    """The row of a rival.

    Args:
        what: as in the table.
        size: as in the table.
        ours: runs of the package, round by round.
        theirs: runs of the rival, or why it has none.
        target: how much faster the package must be.
        same: differences up to which the answers are the same; None: the rival solves another problem.
    """
    if any(isinstance(run, str) for run in theirs):
        reason = next(run for run in theirs if isinstance(run, str))
        return Row("space-rivals", f"{what}: {reason}", size, [np.inf], None, at_least=True)
    runs = [run for run in theirs if isinstance(run, Run)]
    assert ours[0].answer is not None
    assert runs[0].answer is not None
    deflection, force, contact, slip = ours[0].answer.far(runs[0].answer)
    parts = f"u_z by {deflection:.1e}, force by {force:.1e}, contact at {contact} nodes, slip at {slip}"
    other = same is not None and (max(deflection, force) > same or contact + slip > 0)
    said = f"{runs[0].note}; {_cpu(runs[0], ours[0])}; the package: {ours[0].note}"
    note = f"{'ANOTHER ANSWER' if other else 'answer'}: {parts}; {said}"
    if not all(run.converged for run in ours):
        note = f"the package has not converged; {note}"
    failed = other or not all(run.converged for run in ours)
    ratio = [their.cpu / our.cpu for their, our in zip(runs, ours, strict=True)]
    return Row("space-rivals", what, size, ratio, None if failed else target, at_least=True, note=note)


def _cpu(one: Run, other: Run) -> str:
    return f"{one.cpu:.1f} s over {other.cpu:.1f} s of CPU"
