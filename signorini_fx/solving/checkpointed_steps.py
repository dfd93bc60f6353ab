"""Restart: the complete load steps of a run on disk, for any number of ranks, and how their
outcomes are rebuilt.

Each load step on each mesh has a folder of its own, which appears under its name when it is
complete: the displacement cell by cell in the order of the input of the mesh, which does not depend
on the ranks; the iterate and its sets, with the data of its problem, at the contact nodes with
their positions; and figures.  Multipliers, contact state and certificate are evaluated again on
restart, and a step whose certificate does not hold is solved again.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from mpi4py import MPI
from pydantic import BaseModel
from scipy.spatial import cKDTree

from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.algebra.contact.active_sets import ActiveSets, line_of_bound, release
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.contact.nodal_vectors import Nodal, unit
from signorini_fx.errors import MeshError, SceneError, cannot_be_written
from signorini_fx.machine import manifest, parallel
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary, no_points
from signorini_fx.mechanics.model import ElasticBody
from signorini_fx.records import History, IterationRecord, OuterRecord, Status, Timings
from signorini_fx.results.files import describe
from signorini_fx.results.folder import CHECKPOINT, refuse_foreign
from signorini_fx.results.mechanics import StepResult
from signorini_fx.tuned import SAME_LENGTH

Figures = dict[str, Any]

_FORMAT = 11
_SCENE = "scene.json"
_FIGURES = "figures.json"
_NODES = "nodes.npz"
_ABSENT = "(absent)"


class MeshCheckpoint:
    """The checkpoint of a run in its result folder, now on the mesh with the number ``level``;
    every method is collective but ``recall_history``.  ``scene``: that of the run, or plain data
    that tell it from others;
    ``restart``: whether to go on from the load steps that an earlier run has left, which the
    history says; otherwise these are removed as soon as a new one is complete.

    Raises:
        SceneError: the checkpoint is that of another scene; all keys that differ are named.
        OutputError: there are files in its place that no run has written.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        folder: str | Path,
        scene: BaseModel | Mapping[str, Any],
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
        """The figures of a load step, numbered from 0; None if it is not there, and then neither
        are later ones.
        """
        figures = self._complete.get((self.level, step))
        if figures is None:
            self.forget(step)
        return figures

    def beside(
        self, step: int, space: fem.FunctionSpace, names: Sequence[str]
    ) -> list[fem.Function] | None:
        """Displacements of a load step by their names; None: they cannot be read."""
        functions = [fem.Function(space, name=name) for name in names]
        failed = False
        try:
            for name, function in zip(names, functions, strict=True):
                _read_field(self._folder(self.level, step) / f"{name}.npy", function)
        except (OSError, ValueError, EOFError):
            failed = True
        return None if parallel.any_rank(self._comm, failed) else functions

    @staticmethod
    def recall_history(figures: Figures, history: History, timings: Timings) -> None:
        """Take the linear solves, problems and events of a load step of an earlier run for those of
        this one.
        """
        history.iterations += [IterationRecord(**row) for row in figures["iterations"]]
        history.outer += [OuterRecord(**row) for row in figures["outer"]]
        history.events += figures["events"]
        timings.seconds.update(figures["seconds"])

    def store(
        self,
        body: ElasticBody,
        timings: Timings,
        task: Task,
        start: Start,
        outcome: Outcome,
        result: StepResult,
        marks: tuple[int, int, int],
        more: Figures,
        beside: Mapping[str, fem.Function] | None = None,
    ) -> None:
        """Store a load step that has a solution; ``marks``: see ``load_steps``; ``more``: plain
        data, and its path;
        ``beside``: further displacements by their names.
        """
        problem = outcome.problem
        history = task.history
        boundary = body.boundary or no_points(body.space)
        tangents = boundary.tangents
        cotangents = boundary.cotangents
        sets = problem.sets
        nodal: dict[str, Nodal] = {
            "contact": sets.contact.astype(np.float64),
            "direction": _in_space(sets.direction, tangents),
            "turning": sets.turning,
        }
        data = problem.data
        rest_t = 0.0 if task.rest is None else task.rest.u_t
        nodal["lambda_hat"], nodal["mu_hat"] = data.lambda_hat, _in_space(data.mu_hat, tangents)
        nodal["slip_origin"] = _in_space(data.slip_origin + rest_t, cotangents)
        if data.bound is not None:
            nodal["bound"], slope = line_of_bound(sets, data)
            if data.follows is not None:
                nodal["coupling"] = slope
        solves, problems, events = marks
        figures = {
            "place": start.place,
            "parameters": [
                [each.gamma_n, each.gamma_t, each.sigma] for each in (outcome.data, data)
            ],
            "monolithic": outcome.monolithic,
            "augmented": outcome.augmented,
            "regularisation_error": outcome.regularisation_error,
            "iterations": [asdict(record) for record in history.iterations[solves:]],
            "outer": [asdict(record) for record in history.outer[problems:]],
            "events": history.events[events:],
            "seconds": parallel.largest_timings(body.comm, timings.seconds),
            **more,
        }
        if boundary.moving is not None:
            figures["tools"] = body.driven(outcome.displacement(), task.rest).tolist()
        functions = {"displacement": result.displacement, **(beside or {})}
        fields = {name: _by_cell(function) for name, function in functions.items()}
        moved = result.displacement.x.array.reshape(-1, boundary.x.shape[1])[boundary.nodes]
        columns: dict[str, Any] = {"part": boundary.part, "x": boundary.x, "y": moved, **nodal}
        table: dict[str, Any] = {
            name: parallel.rows_on_root(self._comm, values) for name, values in columns.items()
        }
        parallel.on_root(
            self._comm,
            lambda: self._write(self._folder(self.level, start.step), fields, table, figures),
        )
        self._begun = True

    def _write(
        self, target: Path, fields: Mapping[str, Nodal], table: Mapping[str, Any], figures: Figures
    ) -> None:
        """Write a load step; before the first one, remove what an earlier run has left; on one
        rank.
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
            for name, values in fields.items():
                np.save(part / f"{name}.npy", values)
            np.savez(part / _NODES, **table)
            (part / _FIGURES).write_text(json.dumps(figures), encoding="utf-8")
            shutil.rmtree(target, ignore_errors=True)
            manifest.add(
                self.path.parent,
                [f"{CHECKPOINT}/{target.name}/{name}" for name in manifest.files(part)],
            )
            part.rename(target)
        except OSError as reason:
            raise cannot_be_written(self.path, reason) from None

    def recall(self, body: ElasticBody, size: float, task: Task, start: Start) -> Outcome | None:
        """How a load step with ``figures`` ended, with its iterate in place; None if it cannot be
        read, or belongs to other nodes.  The mesh may be distributed in another way.
        """
        figures = self._complete[self.level, start.step]
        nodal = None
        boundary = body.boundary or no_points(body.space)
        fields = self.beside(start.step, body.space, ["displacement"])
        try:
            if fields is not None:
                with (
                    (self._folder(self.level, start.step) / _NODES).open("rb") as stream,
                    np.load(stream) as stored,
                ):
                    nodal = _placed(dict(stored), boundary, fields[0], size)
        except (OSError, ValueError, EOFError, KeyError, BadZipFile):  # the step is solved again
            pass
        if parallel.any_rank(self._comm, nodal is None) or fields is None or nodal is None:
            self.forget(start.step)
            return None
        (displacement,) = fields
        task.begin_step(start)
        if task.rest is not None:
            displacement.x.array[:] -= body.motions.displacement(task.rest.motion).ravel()
        all_unknowns = body.unknowns(displacement)
        if boundary.moving is not None:
            body.begin_driven(all_unknowns, np.array(figures["tools"]), task.rest)
        x = task.system.unknowns(all_unknowns)
        direction = _along(nodal["direction"], boundary.cotangents)
        slipping = np.linalg.norm(direction, axis=1) > 0.5
        direction = np.where(slipping[:, None], unit(direction), 0.0)
        sets = ActiveSets.of(nodal["contact"].ravel() > 0, direction, nodal["turning"].ravel())
        bound, slope = (
            nodal[name].ravel() if name in nodal else None for name in ("bound", "coupling")
        )
        origin = _along(nodal["slip_origin"], boundary.tangents) - (
            0.0 if task.rest is None else task.rest.u_t
        )
        posed, solved = (
            replace(start.data, gamma_n=gamma_n, gamma_t=gamma_t, sigma=sigma, slip_origin=origin)
            for gamma_n, gamma_t, sigma in figures["parameters"]
        )
        solved = replace(
            solved,
            lambda_hat=nodal["lambda_hat"].ravel(),
            mu_hat=_along(nodal["mu_hat"], boundary.cotangents),
            bound=bound,
            follows=None if bound is None or slope is None else PointFriction(bound, slope),
        )
        sets = release(sets, solved)  # in 3D points without a bound slip in no direction
        newton = task.newton
        newton.pose(solved, sets)
        newton.restore((x, sets, solved))
        return Outcome(
            Status.CONVERGED,
            newton,
            posed,
            monolithic=figures["monolithic"],
            augmented=figures["augmented"],
            regularisation_error=figures["regularisation_error"],
        )

    def _folder(self, level: int, step: int) -> Path:
        return self.path / f"{level}-{step:05d}"

    def forget(self, step: int) -> None:
        """Remove a load step and all later ones: they continue from another state."""
        later = [key for key in self._complete if key >= (self.level, step)]
        for key in later:
            del self._complete[key]

        def remove() -> None:
            for key in later:
                shutil.rmtree(self._folder(*key), ignore_errors=True)

        parallel.on_root(self._comm, remove)

    def _open(self) -> dict[tuple[int, int], Figures]:
        """The complete load steps on disk; on one rank."""
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


def _by_cell(function: fem.Function) -> Nodal:
    """Values in each cell on the first rank, in the order of the input: up to degree 2 that of
    nodes is the same.
    """
    space = function.function_space
    comm = function.function_space.mesh.comm
    cells = space.mesh.topology.index_map(space.mesh.topology.dim).size_local
    values = function.x.array.reshape(-1, space.dofmap.index_map_bs)[space.dofmap.list[:cells]]
    numbers = parallel.rows_on_root(
        comm, np.asarray(space.mesh.topology.original_cell_index[:cells])
    )
    rows = parallel.rows_on_root(comm, values.reshape(cells, values.shape[1] * values.shape[2]))
    return np.asarray(rows[np.argsort(numbers)])


def _read_field(path: Path, function: fem.Function) -> None:
    """Read what ``_by_cell`` has given, in all cells of this rank, those of other ranks that it
    knows too.
    """
    space = function.function_space
    topology = function.function_space.mesh.topology
    nodes = np.asarray(space.dofmap.list)
    size = space.dofmap.index_map_bs
    stored = np.load(path, mmap_mode="r")
    if stored.shape != (topology.index_map(topology.dim).size_global, nodes.shape[1] * size):
        raise ValueError(f"{path}: is of another mesh")
    rows = stored[np.asarray(topology.original_cell_index)]
    function.x.array.reshape(-1, size)[nodes.ravel()] = rows.reshape(-1, size)


def described_scene(scene: BaseModel | Mapping[str, Any]) -> dict[str, Any]:
    """The scene as JSON with all defaults, its files by content, without what changes no result:
    title, remarks.
    """
    description: dict[str, Any] = json.loads(json.dumps(describe(scene, of_file=_with_content)))
    if isinstance(scene, BaseModel):
        for remark in ("title", "incomplete"):
            description.pop(remark, None)
    return description


def _with_content(path: Path) -> str:
    """The name of a file with what tells the content of all files that it needs."""
    from signorini_fx.mechanics.mesh.files.formats import files_of

    try:
        digests = [hashlib.sha256(file.read_bytes()).hexdigest() for file in files_of(path)]
    except (OSError, MeshError):
        digests = ["unreadable"]
    return " ".join((path.name, *digests))


def _differences(stored: Any, current: Any, key: str = "") -> Iterator[tuple[str, str, str]]:
    """Every key whose value differs, with both values."""
    if isinstance(stored, dict) and isinstance(current, dict):
        for name in dict.fromkeys((*stored, *current)):
            inner = f"{key}.{name}" if key else str(name)
            yield from _differences(stored.get(name, _ABSENT), current.get(name, _ABSENT), inner)
    elif isinstance(stored, list) and isinstance(current, list) and len(stored) == len(current):
        for index, (stored_entry, current_entry) in enumerate(zip(stored, current, strict=True)):
            yield from _differences(stored_entry, current_entry, f"{key}[{index}]")
    elif stored != current:
        yield key, json.dumps(stored), json.dumps(current)


def _placed(
    stored: Mapping[str, Nodal], boundary: ContactBoundary, displacement: fem.Function, size: float
) -> dict[str, Nodal] | None:
    """Stored values at contact nodes, found by position and displacement; None if they belong to
    other nodes.
    """
    moved = displacement.x.array.reshape(-1, boundary.x.shape[1])[boundary.nodes]
    far = float(np.abs(stored["y"]).max(initial=0.0)) or 1.0

    def keys(part: npt.NDArray[Any], x: Nodal, y: Nodal) -> Nodal:
        return np.column_stack((part, x / size, SAME_LENGTH * y / far))

    tree = cKDTree(keys(stored["part"], stored["x"], stored["y"]))
    distance, nearest = tree.query(keys(boundary.part, boundary.x, moved))
    if (distance > SAME_LENGTH).any():
        return None
    return {
        name: values[nearest] for name, values in stored.items() if name not in ("part", "x", "y")
    }


def _in_space(vectors: Nodal, tangents: Nodal) -> Nodal:
    """Components, shape (n, d - 1), as vectors, shape (n, d): shears with the tangents, slips with
    their dual basis.
    """
    return np.einsum("ijk,ik->ij", tangents, vectors)


def _along(vectors: Nodal, tangents: Nodal) -> Nodal:
    """The inverse of ``_in_space``, with the dual basis."""
    return np.einsum("ijk,ij->ik", tangents, vectors)
