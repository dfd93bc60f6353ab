"""Parameter sweeps: a solution of a scene for each combination of values of some entries, and the
rows of a table.

Each problem starts from the contact state of the previous one.  If only gaps and friction of rigid
foundations differ, it reuses the condensed elastic system, too.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, suppress
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
from mpi4py import MPI

from signorini_fx.algebra.algorithms.task import Task
from signorini_fx.algebra.linalg import petsc_options
from signorini_fx.errors import SceneError
from signorini_fx.machine import manifest, parallel
from signorini_fx.machine.display import dataframe
from signorini_fx.machine.result_files import write_csv
from signorini_fx.mechanics.body.discretisation import with_gap_and_friction
from signorini_fx.mechanics.statement.base import Table
from signorini_fx.records import History, Status, Timings
from signorini_fx.results.files import write_results
from signorini_fx.results.folder import ResultFolder
from signorini_fx.results.solution import Solution
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import as_scene, changed, parse_scene
from signorini_fx.scenes.scene import Scene
from signorini_fx.scenes.solver import refuse_other_than_comm, solve
from signorini_fx.solving.findings import refuse_beforehand
from signorini_fx.solving.restart import described_scene
from signorini_fx.solving.solve_on_mesh import (
    StatedProblem,
    contact_task,
    solve_contact,
    solve_mesh,
)
from signorini_fx.tuned import ZERO_IN_SOLUTION

if TYPE_CHECKING:
    from pandas import DataFrame

    from signorini_fx.arrays import Plain

Row = dict[str, bool | float | str | None]  # results of a solution, with the changed values
_TABLE, _STORED = "sweep.csv", "sweep.json"
# The results in a row.
FIGURES = (
    "contact_force",
    "friction_force",
    "max_pressure",
    "max_shear",
    "contact_area",
    "stick_area",
    "strain_energy",
)


def sweep(
    scene: Scene | str | Path,
    entries: Mapping[str, Iterable[Plain | Table]],
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> Sweep:
    """Solve a scene for each combination of values of its entries, one at each step of the
    iterator; collective.

    Args:
        scene: the scene, or the path of its file.
        entries: values by the paths of entries, such as ``contact[0].friction.coefficient`` or
            ``material.young``; those of the last path vary fastest.
        comm: the ranks that share the work.

    Returns:
        An iterator over the solutions, or the last iterates: look at ``Solution.status``;
        ``to_dataframe()`` solves the remaining ones and returns a row of results for each.

    Raises:
        TypeError: an argument is of the wrong kind.
        SceneError: there is no such entry, or a value is wrong; all are checked before the first
            solve.

    Examples:
        >>> results = sfx.sweep(scene, {"material.young": [500.0, 1000.0]})
        >>> print([float(round(result.contact.forces[0][1], 6)) for result in results])
        [4.0, 4.0]
    """
    scene = as_scene(scene)
    refuse_other_than_comm(comm)
    petsc_options.refuse_exchanged()
    return Sweep(scene, combinations(entries), comm)


class Sweep(Iterator[Solution]):
    """The solutions of a scene for several values of its entries, one after the other; every method
    is collective.
    """

    def __init__(
        self, scene: Scene, changes: Sequence[Mapping[str, Plain | Table]], comm: MPI.Comm
    ) -> None:
        self._solved = zip(changes, solutions_of(scene, changes, comm), strict=True)

    def __next__(self) -> Solution:
        return next(self._solved)[1]

    def to_dataframe(self) -> DataFrame:
        """Solve the remaining combinations, and return a row of results for each, see ``row_of``,
        as a ``pandas.DataFrame``.

        Raises:
            InstallationError: pandas is not installed.
        """
        dataframe([])  # raises before the solves if pandas is missing
        return dataframe([row_of(values, solution) for values, solution in self._solved])


def combinations(entries: Mapping[str, Iterable[Plain | Table]]) -> list[dict[str, Plain | Table]]:
    """Return all combinations of values, each as a dictionary by the paths of the entries."""
    if not isinstance(entries, Mapping):
        raise TypeError("entries: a dictionary of values by paths is expected")
    return [dict(zip(entries, values, strict=True)) for values in product(*entries.values())]


def solutions_of(
    scene: Scene, changes: Sequence[Mapping[str, Plain | Table]], comm: MPI.Comm
) -> Iterator[Solution]:
    """Yield the solution of a scene for each change of its entries; all changes are validated
    first.
    """
    return _solutions([parse_scene(changed(scene, change)) for change in changes], comm)


def _solutions(scenes: Sequence[Scene], comm: MPI.Comm) -> Iterator[Solution]:
    last: tuple[Scene, Solution, Task] | None = None
    for given in scenes:
        scene = as_scene(given, comm)
        statement = scene.statement
        several = (
            statement.nonlinear
            or statement.path.several
            or statement.preloads
            or scene.accuracy is not None
        )
        if several or not scene.contact or scene.solver.levels > 1:
            yield solve(scene, comm, check=False)
            continue
        solution, task = _solved(scene, comm, last)
        last = (scene, solution, task) if solution.status is Status.CONVERGED else None
        yield solution


def _solved(
    scene: Scene, comm: MPI.Comm, last: tuple[Scene, Solution, Task] | None
) -> tuple[Solution, Task]:
    """Return the solution and the task of a scene on one mesh, starting from the last one;
    collective.
    """
    history = History()
    statement = scene.statement
    if last is None or not _same_system(scene, last[0]):
        state = None if last is None else last[1].contact
        solution, task, _ = solve_mesh(statement, lambda: load_mesh(scene, comm), history, state)
        return solution, task
    _, earlier, solved = last
    model = with_gap_and_friction(earlier.model, statement)
    refuse_beforehand(model)
    task = contact_task(model, history, choose=lambda *_: (solved.system, solved.linear_algebra))
    solution, task, _ = solve_contact(
        StatedProblem(model, task, Timings(), history), earlier.contact
    )
    return solution, task


def _same_system(scene: Scene, last: Scene) -> bool:
    """Return whether two scenes differ only in gaps and friction of rigid foundations."""
    others = set(type(scene).model_fields) - {"contact"}
    if any(getattr(scene, key) != getattr(last, key) for key in others) or len(
        scene.contact
    ) != len(last.contact):
        return False
    return all(
        type(effect) is type(rival)
        and effect.against is None
        and not (effect.friction.directed or rival.friction.directed)
        and effect.model_copy(update={"gap": rival.gap, "friction": rival.friction}) == rival
        for effect, rival in zip(scene.contact, last.contact, strict=True)
    )


class SweepFolder(ResultFolder):
    """The folder of a sweep: its table, and a result folder ``001``, ``002`` and so on for each
    combination of values.

    Each result is stored as soon as it is solved.  Every method is collective.

    Attributes:
        rows: the rows that are stored, in their order.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        path: Path,
        scene: Scene,
        changes: Sequence[Mapping[str, Plain | Table]],
    ) -> None:
        super().__init__(comm, path, (_TABLE, _STORED))
        self._changes = changes
        study = {"values": list(changes), "scene": described_scene(scene)}
        self._study = json.loads(json.dumps(study))
        self.rows: list[Row] = []

    def recall(self) -> None:
        """Load the rows that an interrupted sweep has stored.

        Raises:
            SceneError: the folder belongs to another sweep.
        """
        self.rows = parallel.on_root(self._comm, self._stored)

    def solved(self, scene: Scene, jobs: int, begin: Callable[[], None]) -> Iterator[Row]:
        """Solve the remaining combinations, write each result, and yield its row.

        Args:
            scene: the scene.
            jobs: number of parallel processes of one rank each.
            begin: called at the start of each process.
        """
        done = len(self.rows)
        left = list(enumerate(self._changes))[done:]
        if not done:
            parallel.on_root(self._comm, self._remove_older)
        points = [(scene, change, self.path / f"{number + 1:03d}") for number, change in left]
        with ExitStack() as ends:
            if jobs > 1:
                spawn = get_context("spawn")
                pool = ends.enter_context(ProcessPoolExecutor(jobs, spawn, initializer=begin))
                ends.callback(pool.shutdown, wait=False, cancel_futures=True)
                rows = pool.map(_solved_alone, points)
            else:
                solutions = solutions_of(scene, [change for _, change in left], self._comm)
                rows = map(_written, solutions, points)
            for row in rows:
                self.rows.append(row)
                parallel.on_root(self._comm, self._write)
                if len(self.rows) == 1:
                    self.commit()
                else:
                    self.add()
                yield row

    def _remove_older(self) -> None:
        """Remove the results of an earlier sweep."""
        for folder in self.path.glob("[0-9][0-9][0-9]*"):
            if (folder / manifest.MANIFEST).is_file():
                manifest.remove(folder)
                (folder / manifest.MANIFEST).unlink()
                with suppress(OSError):  # the folder contains something else
                    folder.rmdir()

    def _write(self) -> None:
        write_csv(self.part / _TABLE, self.rows)
        stored = {"study": self._study, "rows": self.rows}
        (self.part / _STORED).write_text(json.dumps(stored), encoding="utf-8")

    def _stored(self) -> list[Row]:
        """Return the rows of an earlier run; called on one rank."""
        try:
            stored = json.loads((self.path / _STORED).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return []
        for key, value in self._study.items():
            if stored["study"][key] != value:
                reason = "is another one in the sweep to go on from: leave out --restart"
                raise SceneError.at(key, reason)
        return list(stored["rows"])


def _written(solution: Solution, point: tuple[Scene, Mapping[str, Plain | Table], Path]) -> Row:
    """Write the result of a combination, and return its row; collective."""
    _, change, folder = point
    write_results(solution, folder, fields=False, pictures=False)
    return row_of(change, solution)


def _solved_alone(point: tuple[Scene, Mapping[str, Plain | Table], Path]) -> Row:
    """Solve a combination in a separate process, and return its row."""
    scene, change, _ = point
    (solution,) = solutions_of(scene, [change], MPI.COMM_SELF)
    return _written(solution, point)


def row_of(change: Mapping[str, Any], solution: Solution) -> Row:
    """Return the row of a combination in sweep.csv; collective.

    It has the changed values by their paths, ``status``, ``linear_solves``, ``certificate_holds``
    and ``FIGURES``: magnitudes of contact and friction force (per thickness in 2D; between bodies
    the sum over all boundaries), and areas of contact and stick (lengths in 2D); nan if there is no
    solution.

    With several load steps they are those of the last step with a solution, and ``solved_until`` is
    its time.  If a ramp ends before its full load, ``limit_force`` is the force that it reached.
    Results of effects, such as wear, follow.
    """
    energy = solution.last_step.strain_energy
    figures = {
        "strain_energy": float("nan") if energy is None else energy
    }  # unknown for a nonlinear body
    if solution.contact is not None:
        columns = solution.table.columns
        touching = columns["state"] != "open"
        # Between bodies each force acts on another body, so the vector sum has no meaning.
        between = any(effect.against for effect in solution.model.contacts)
        forces = solution.contact.forces_of_each if between else np.array([solution.contact.forces])
        contact, friction = map(float, np.linalg.norm(forces, axis=2).sum(axis=0))
        figures |= {
            "contact_force": contact,
            "friction_force": friction if friction > ZERO_IN_SOLUTION * contact else 0.0,
            "max_pressure": float(columns["pressure"].max(initial=0.0)),
            "max_shear": float(np.abs(columns["shear"]).max(initial=0.0)),
            "contact_area": float(columns["weight"][touching].sum()),
            "stick_area": float(
                columns["weight"][touching & (columns["friction"] == "stick")].sum()
            ),
        }
        errors = {"contact_force": "force", "friction_force": "friction"}
        errors |= {"max_pressure": "largest pressure", "contact_area": "contact area"}
        for figure, name in errors.items():
            error = solution.numbers[name].error if name in solution.numbers else None
            figures[f"{figure}_error"] = float("nan") if error is None else error
    figures |= solution.last_step.figures
    if solution.last_step.status is not Status.CONVERGED:
        figures = dict.fromkeys(figures, float("nan"))
    if solution.contact is None:  # no iterations were recorded
        solves = sum(step.linear_solves for step in solution.steps)
    else:
        solves = solution.history.linear_solves
    outcome = {
        **change,
        "status": solution.status.value,
        "linear_solves": solves,
    }
    if solution.model.path.several:
        times = [step.time for step in solution.steps if step.status is Status.CONVERGED]
        outcome["solved_until"] = times[-1] if times else float("nan")
        if solution.limit is not None and solution.limit.force is not None:
            outcome["limit_force"] = solution.limit.force
    return {**outcome, "certificate_holds": solution.certificate.holds, **figures}


def heading(paths: Sequence[str]) -> str:
    """Return the heading of the table, with the last part of each path."""
    entries = [f"{path.rpartition('.')[2]:>12s}" for path in paths]
    return "  ".join([*entries, *(f"{name:>14s}".replace("_", " ") for name in FIGURES), "outcome"])


def line_of(paths: Sequence[str], row: Row) -> str:
    """Return a row as a line of text; results that do not exist are shown as "-"."""
    values = [f"{row[path]!s:>12s}" for path in paths]
    figures = [f"{row[name]:14.6g}" if name in row else f"{'-':>14s}" for name in FIGURES]
    unsolved = "solved_until" in row and row["status"] != Status.CONVERGED.value
    limit = f" after time {row['solved_until']:g}" if unsolved else ""
    if "limit_force" in row:
        limit = f": limit {row['limit_force']:.4g}"
    return "  ".join([*values, *figures, f"{row['status']}{limit}"])
