"""Restart: the states of a run on disk, one for each complete load step on each mesh.

Each load step has its own folder, which gets its final name when it is complete.  It holds the
state at the end of the step, and figures that later steps do not need, such as its linear solves.
The results of a step are evaluated again from the states before and after it; if its certificate
does not hold, this step and all later ones are solved again.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

from dolfinx import fem
from mpi4py import MPI
from pydantic import BaseModel

from signorini_fx.arrays import Plain
from signorini_fx.errors import MeshError, SceneError, cannot_be_written
from signorini_fx.machine import manifest, parallel
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.state import State, write_table
from signorini_fx.records import History, IterationRecord, OuterRecord, Status, Timings
from signorini_fx.results.files import describe
from signorini_fx.results.folder import CHECKPOINT, refuse_foreign
from signorini_fx.solving.increments import PathIncrements
from signorini_fx.solving.step import Ending, Failure, Report, StoredProblem, ended

Figures = dict[str, Any]
Marks = tuple[int, int, int]  # numbers of linear solves, regularised problems and events so far

_FORMAT = 14
_SCENE = "scene.json"
_FIGURES = "figures.json"
_STATE = "state.npz"
_ABSENT = "(absent)"


class StoredStates:
    """The stored load steps of a run in its result folder; every method is collective.

    Attributes:
        path: the folder of the stored steps.
        level: number of the present mesh.

    Args:
        comm: the ranks.
        folder: the result folder.
        scene: the scene of the run, or plain data that distinguish it from others.
        history: gets a note about the restart.
        restart: whether to continue from the load steps that an earlier run has left; otherwise
            these are removed as soon as a new one is complete.

    Raises:
        SceneError: the stored steps are those of another scene; all keys that differ are named.
        OutputError: the folder contains files that no run has written.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        folder: str | Path,
        scene: BaseModel | Mapping[str, Plain],
        history: History,
        *,
        restart: bool,
    ) -> None:
        self.path = Path(folder) / CHECKPOINT
        self.level = 0
        self._comm = comm
        self._scene = scene
        self._complete: dict[tuple[int, int], Figures] = {}
        self._begun = False
        parallel.on_root(comm, lambda: refuse_foreign(self.path.parent, [CHECKPOINT]))
        if restart:
            self._complete = parallel.on_root(comm, self._open)
            count = len(self._complete)
            self._begun = bool(self._complete)
            history.add(f"restart: {count} complete load step{'s' * (count != 1)} in {self.path}")
        elif parallel.on_root(comm, self.path.is_dir):
            history.add(
                f"restart: {self.path} of an unfinished run is replaced, as --restart is not given"
            )

    def figures(self, step: int) -> Figures | None:
        """Return the figures of a load step, numbered from 0; None if it is not stored, and then
        later ones are removed.
        """
        figures = self._complete.get((self.level, step))
        if figures is None:
            self.forget(step)
        return figures

    def recalled(
        self,
        problem: StoredProblem,
        state: State,
        way: PathIncrements,
    ) -> Iterator[tuple[State, Report, bool]]:
        """Yield the stored steps that follow a state, each with its report and whether it ends a
        load step; ``way`` is advanced.
        """
        while not way.ended and (figures := self.figures(state.number)) is not None:
            number = state.number
            end = recalled(problem, state, figures, partial(self.read, number))
            if end is None:
                return
            state, report = end
            if isinstance(report, Failure) or report.status is not Status.CONVERGED:
                problem.history.add(f"restart: {report}: it is solved again")
                self.forget(number)
                return
            recall_history(figures, problem.history, problem.timings)
            way.resume(figures["path"])
            problem.accept(state, report)
            yield state, report, figures["kept"]

    def read(
        self, step: int, space: fem.FunctionSpace, boundary: ContactBoundary | None = None
    ) -> State | None:
        """Return the state at the end of a load step, numbered from 0; None if it cannot be read,
        so that it must be solved again.
        """
        try:
            return State.read(self._folder(self.level, step) / _STATE, boundary, space)
        except SceneError:
            self.forget(step)
            return None

    def write(
        self,
        problem: StoredProblem,
        new: State,
        report: Report,
        way: PathIncrements,
        marks: Marks,
        *,
        kept: bool,
    ) -> None:
        """Store a step that has a solution.

        Args:
            problem: the problem of the step.
            new: the state at its end.
            report: its report.
            way: the position on the load path.
            marks: ``marks_of`` the history at its start.
            kept: whether it ends a load step.
        """
        solves, problems, events = marks
        history = problem.history
        outcome = report.outcome
        data = outcome.problem.data
        figures = {
            "place": report.result.place,
            "time": new.time,
            "kept": kept,
            "linear_solves": report.result.linear_solves,
            "path": way.stored(),
            "method": {
                "gammas": [data.gamma_n, data.gamma_t],
                "monolithic": outcome.monolithic,
                "augmented": outcome.augmented,
            },
            "iterations": [asdict(record) for record in history.iterations[solves:]],
            "outer": [asdict(record) for record in history.outer[problems:]],
            "events": history.events[events:],
            "seconds": parallel.largest_timings(self._comm, problem.timings.seconds),
        }
        table = new.table(report.posed.boundary, report.posed.body.space)
        target = self._folder(self.level, new.number - 1)
        parallel.on_root(self._comm, lambda: self._write(target, table, figures))
        self._begun = True

    def _write(self, target: Path, table: Mapping[str, Plain], figures: Figures) -> None:
        """Write a load step, on one rank; before the first one, remove the steps of an
        earlier run.
        """
        part = self.path / manifest.PART
        try:
            if not self._begun:
                manifest.remove(self.path.parent, f"{CHECKPOINT}/")
                self.path.mkdir(parents=True, exist_ok=True)
                manifest.add(
                    self.path.parent, [f"{CHECKPOINT}/{name}" for name in (_SCENE, manifest.PART)]
                )
                description = {"format": _FORMAT, "scene": described_scene(self._scene)}
                (self.path / _SCENE).write_text(json.dumps(description), encoding="utf-8")
            manifest.begin_part(self.path)
            write_table(part / _STATE, table)
            (part / _FIGURES).write_text(json.dumps(figures), encoding="utf-8")
            shutil.rmtree(target, ignore_errors=True)
            manifest.add(
                self.path.parent,
                [f"{CHECKPOINT}/{target.name}/{name}" for name in manifest.files(part)],
            )
            part.rename(target)
        except OSError as reason:
            raise cannot_be_written(self.path, reason) from None

    def _folder(self, level: int, step: int) -> Path:
        return self.path / f"{level}-{step:05d}"

    def forget(self, step: int) -> None:
        """Remove a load step and all later ones, which continue from another state."""
        later = [key for key in self._complete if key >= (self.level, step)]
        for key in later:
            del self._complete[key]

        def remove() -> None:
            for key in later:
                shutil.rmtree(self._folder(*key), ignore_errors=True)

        parallel.on_root(self._comm, remove)

    def _open(self) -> dict[tuple[int, int], Figures]:
        """Return the complete load steps on disk; on one rank."""
        try:
            description = json.loads((self.path / _SCENE).read_text(encoding="utf-8"))
            if description["format"] != _FORMAT:
                return {}
            stored_scene = description["scene"]
        except (OSError, ValueError, KeyError, TypeError):
            return {}
        differences = list(_differences(stored_scene, described_scene(self._scene)))
        if differences:
            remedy = f"restore it, or solve without restart, which removes {self.path}"
            raise SceneError(
                [
                    (key, f"was {was} in the run to go on from, and is {current}: {remedy}")
                    for key, was, current in differences
                ]
            )
        complete = {}
        for folder in sorted(self.path.glob("*-*")):
            level, _, step = folder.name.partition("-")
            if level.isdecimal() and step.isdecimal():
                try:
                    complete[int(level), int(step)] = json.loads(
                        (folder / _FIGURES).read_text(encoding="utf-8")
                    )
                except (OSError, ValueError):  # this step and later ones are solved again
                    continue
        return complete


def recalled(
    problem: StoredProblem, state: State, figures: Figures, read: Callable[..., State | None]
) -> tuple[State, Ending] | None:
    """Evaluate a stored load step again and return its end; collective.

    Args:
        problem: the problem of the step.
        state: the state before it.
        figures: its stored figures.
        read: returns the stored state for a space and contact points.

    Returns:
        The state at its end and the report; None if the state cannot be read.
    """
    place, time = (float(figures[name]) for name in ("place", "time"))
    with problem.timings.phase("restart"):
        found = problem.recall(state, place, time, read, figures["method"])
    if found is None:
        return None
    new, report = found
    if isinstance(report, Failure):
        return found
    if report.status is Status.CONVERGED:
        _, report = ended(problem, state, new, report, stored=True)
    result = replace(report.result, linear_solves=figures["linear_solves"])
    return new, replace(report, result=result)


def marks_of(history: History) -> Marks:
    """Return the numbers of linear solves, regularised problems and events so far."""
    return history.linear_solves, len(history.outer), len(history.events)


def recall_history(figures: Figures, history: History, timings: Timings) -> None:
    """Add the linear solves, problems and events of a stored load step to the history of this run,
    and take over its timings.
    """
    history.iterations += [IterationRecord(**row) for row in figures["iterations"]]
    history.outer += [OuterRecord(**row) for row in figures["outer"]]
    history.events += figures["events"]
    timings.seconds.update(figures["seconds"])


def described_scene(scene: BaseModel | Mapping[str, Plain]) -> dict[str, Plain]:
    """Return the scene as JSON with all defaults and with hashes of its files, without entries that
    change no result (title, remarks).
    """
    description = json.loads(json.dumps(describe(scene, of_file=_with_content)))
    if isinstance(scene, BaseModel):
        for remark in ("title", "incomplete"):
            description.pop(remark, None)
    return description


def _with_content(path: Path) -> str:
    """Return the name of a file with the hashes of all files that it needs."""
    from signorini_fx.mechanics.mesh.files.formats import files_of

    try:
        digests = [hashlib.sha256(file.read_bytes()).hexdigest() for file in files_of(path)]
    except (OSError, MeshError):
        digests = ["unreadable"]
    return " ".join((path.name, *digests))


def _differences(stored: Plain, current: Plain, key: str = "") -> Iterator[tuple[str, str, str]]:
    """Yield every key whose value differs, with both values."""
    if isinstance(stored, dict) and isinstance(current, dict):
        for name in dict.fromkeys((*stored, *current)):
            inner = f"{key}.{name}" if key else str(name)
            yield from _differences(stored.get(name, _ABSENT), current.get(name, _ABSENT), inner)
    elif isinstance(stored, list) and isinstance(current, list) and len(stored) == len(current):
        for index, (stored_entry, current_entry) in enumerate(zip(stored, current, strict=True)):
            yield from _differences(stored_entry, current_entry, f"{key}[{index}]")
    elif stored != current:
        yield key, json.dumps(stored), json.dumps(current)
