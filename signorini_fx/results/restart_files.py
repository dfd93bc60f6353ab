"""Checkpoints: the complete load steps of a run on disk, for any number of ranks.

Each load step on each mesh has a folder of its own, which appears under its name when it is complete: the displacement
cell by cell in the order of the input of the mesh, which does not depend on the ranks; what belongs to the contact
nodes with their positions; and figures.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from mpi4py import MPI
from pydantic import BaseModel
from scipy.spatial import cKDTree

from signorini_fx.errors import MeshError, OutputError, SceneError, cannot_be_written
from signorini_fx.machine import manifest, parallel
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.results.files import describe
from signorini_fx.results.folder import CHECKPOINT
from signorini_fx.tuned import SAME_LENGTH

Nodal = npt.NDArray[np.float64]
Figures = dict[str, Any]

_FORMAT = 11
_SCENE, _FIGURES, _NODES = "scene.json", "figures.json", "nodes.npz"
_ABSENT = "(absent)"


class Checkpoint:
    """The checkpoint of a run; every method is collective.

    Args:
        comm: the ranks of the run.
        folder: the result folder.
        scene: the scene of the run, or plain data that tell this run from others.
        restart: whether to go on from the load steps that an earlier run has left; otherwise these are removed as soon
            as a new one is complete.

    Attributes:
        path: where the load steps are.
        level: number of the mesh that load steps are of.
        found: how many complete load steps there are to go on from.

    Raises:
        SceneError: the checkpoint is that of another scene; all keys that differ are named.
        OutputError: there are files in its place that no run has written.
    """

    def __init__(
        self, comm: MPI.Comm, folder: str | Path, scene: BaseModel | Mapping[str, Any], *, restart: bool
    ) -> None:
        self.path, self.level = Path(folder) / CHECKPOINT, 0
        self._comm = comm
        self._scene = scene
        self._complete: dict[tuple[int, int], Figures] = {}
        self._begun = False
        parallel.on_root(comm, self._refuse_foreign)
        if restart:
            self._complete = parallel.on_root(comm, self._open)
            self._begun = bool(self._complete)
        self.found = len(self._complete)

    def figures(self, step: int) -> Figures | None:
        """The figures of a load step, numbered from 0; None if it is not there, and then neither are later ones."""
        figures = self._complete.get((self.level, step))
        if figures is None:
            self.forget(step)
        return figures

    def read(
        self, step: int, space: fem.FunctionSpace, boundary: ContactBoundary, size: float
    ) -> tuple[fem.Function, dict[str, Nodal]] | None:
        """The displacement of a load step, and the values at the contact nodes of this rank, as they were written; None
        if they cannot be read, or belong to other nodes.  The mesh may be distributed in another way.
        """
        beside, contact_values = self.beside(step, space, ["displacement"]), None
        try:
            if beside is not None:
                with (self._folder(self.level, step) / _NODES).open("rb") as stream, np.load(stream) as stored:
                    contact_values = _placed(dict(stored), boundary, beside[0], size)
        except (OSError, ValueError, EOFError, KeyError, BadZipFile):  # the step is solved again
            pass
        if parallel.any_rank(self._comm, contact_values is None) or beside is None or contact_values is None:
            return None
        return beside[0], contact_values

    def beside(self, step: int, space: fem.FunctionSpace, names: Sequence[str]) -> list[fem.Function] | None:
        """Displacements of a load step by their names; None: they cannot be read."""
        functions, failed = [fem.Function(space, name=name) for name in names], False
        try:
            for name, function in zip(names, functions, strict=True):
                _read_field(self._folder(self.level, step) / f"{name}.npy", function)
        except (OSError, ValueError, EOFError):
            failed = True
        return None if parallel.any_rank(self._comm, failed) else functions

    def write(
        self,
        step: int,
        displacement: fem.Function,
        boundary: ContactBoundary,
        nodal: Mapping[str, Nodal],
        figures: Figures,
        beside: Mapping[str, fem.Function] | None = None,
    ) -> None:
        """Store a load step: the displacement, further ones by their names, and plain data for JSON.  Values at the
        contact nodes of this rank have the shape (n,) or (n, k), and are in the axes of space.

        Raises:
            OutputError: it cannot be written.
        """
        part = self.path / manifest.PART
        self._begin()
        functions = {"displacement": displacement, **(beside or {})}
        fields = {name: _by_cell(function) for name, function in functions.items()}
        moved = displacement.x.array.reshape(-1, boundary.x.shape[1])[boundary.nodes]
        columns: dict[str, Any] = {"part": boundary.part, "x": boundary.x, "y": moved, **nodal}
        table: dict[str, Any] = {name: parallel.rows_on_root(self._comm, values) for name, values in columns.items()}

        def finish() -> None:
            try:
                for name, values in fields.items():
                    np.save(part / f"{name}.npy", values)
                np.savez(part / _NODES, **table)
                (part / _FIGURES).write_text(json.dumps(figures), encoding="utf-8")
                target = self._folder(self.level, step)
                shutil.rmtree(target, ignore_errors=True)
                stored = [f"{CHECKPOINT}/{target.name}/{name}" for name in manifest.files(part)]
                manifest.add(self.path.parent, stored)
                part.rename(target)
            except OSError as reason:
                raise cannot_be_written(self.path, reason) from None

        parallel.on_root(self._comm, finish)

    def _folder(self, level: int, step: int) -> Path:
        return self.path / f"{level}-{step:05d}"

    def _refuse_foreign(self) -> None:
        try:
            foreign_files = manifest.foreign(self.path.parent, [CHECKPOINT])
        except OSError as reason:
            raise cannot_be_written(self.path, reason) from None
        if foreign_files:
            raise OutputError(f"{self.path.parent}: {foreign_files[0]}: no earlier run lists this as its own: move it")

    def _begin(self) -> None:
        """Make room for a load step; before the first one, remove what an earlier run has left."""

        def make() -> None:
            try:
                if not self._begun:
                    manifest.remove(self.path.parent, f"{CHECKPOINT}/")
                    self.path.mkdir(parents=True, exist_ok=True)
                    inner = [f"{CHECKPOINT}/{name}" for name in (_SCENE, manifest.PART)]
                    manifest.add(self.path.parent, inner)
                    description = {"format": _FORMAT, "scene": _described(self._scene)}
                    (self.path / _SCENE).write_text(json.dumps(description), encoding="utf-8")
                manifest.begin_part(self.path)
            except OSError as reason:
                raise cannot_be_written(self.path, reason) from None

        parallel.on_root(self._comm, make)
        self._begun = True

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
        differences = list(_differences(stored_scene, _described(self._scene)))
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
                    complete[int(level), int(step)] = json.loads((folder / _FIGURES).read_text(encoding="utf-8"))
                except (OSError, ValueError):  # this step and later ones are solved again
                    continue
        return complete


def _by_cell(function: fem.Function) -> Nodal:
    """Values in each cell on the first rank, in the order of the input: up to degree 2 that of nodes is the same."""
    space, comm = function.function_space, function.function_space.mesh.comm
    cells = space.mesh.topology.index_map(space.mesh.topology.dim).size_local
    values = function.x.array.reshape(-1, space.dofmap.index_map_bs)[space.dofmap.list[:cells]]
    numbers = parallel.rows_on_root(comm, np.asarray(space.mesh.topology.original_cell_index[:cells]))
    return np.asarray(parallel.rows_on_root(comm, values.reshape(cells, -1))[np.argsort(numbers)])


def _read_field(path: Path, function: fem.Function) -> None:
    """Read what ``_by_cell`` has given, in all cells of this rank, those of other ranks that it knows too."""
    space, topology = function.function_space, function.function_space.mesh.topology
    nodes, size = np.asarray(space.dofmap.list), space.dofmap.index_map_bs
    stored = np.load(path, mmap_mode="r")
    if stored.shape != (topology.index_map(topology.dim).size_global, nodes.shape[1] * size):
        raise ValueError(f"{path}: is of another mesh")
    rows = stored[np.asarray(topology.original_cell_index)]
    function.x.array.reshape(-1, size)[nodes.ravel()] = rows.reshape(-1, size)


def _described(scene: BaseModel | Mapping[str, Any]) -> dict[str, Any]:
    """The scene as JSON with all defaults, its files by content, without what changes no result: title, remarks."""
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
    """Stored values at contact nodes, found by position and displacement; None if they belong to other nodes."""
    moved = displacement.x.array.reshape(-1, boundary.x.shape[1])[boundary.nodes]
    far = float(np.abs(stored["y"]).max(initial=0.0)) or 1.0

    def keys(part: npt.NDArray[Any], x: Nodal, y: Nodal) -> Nodal:
        return np.column_stack((part, x / size, SAME_LENGTH * y / far))

    tree = cKDTree(keys(stored["part"], stored["x"], stored["y"]))
    distance, nearest = tree.query(keys(boundary.part, boundary.x, moved))
    if (distance > SAME_LENGTH).any():
        return None
    return {name: values[nearest] for name, values in stored.items() if name not in ("part", "x", "y")}
