"""The state of a body between two load steps, as plain arrays: all that the next step starts from.

A state holds no matrix, form, frame or shape, and is immutable.  A file stores displacements cell
by cell in the order of the input mesh, and contact points with their coordinates, so that any
number of ranks can read it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, Self
from zipfile import BadZipFile

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
import numpy.typing as npt
from dolfinx import fem
from scipy.spatial import cKDTree

from signorini_fx.arrays import Array, Flags, Indices, Integers, Ints
from signorini_fx.errors import SceneError, cannot_be_written
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.statement.rigid_shape import Placement
from signorini_fx.tuned import SAME_LENGTH

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

_FORMAT = 13
_OF_POINTS = ("normal", "pressure", "shear", "elastic", "contact", "direction", "turning")


class HasPoints(Protocol):
    """A problem that has states: it gives contact points and the space of displacements."""

    def points(self) -> tuple[ContactBoundary, fem.FunctionSpace]:
        """Return the contact points of this rank, and the space of displacements; collective."""


def _frozen(record: DataclassInstance) -> None:
    """Make the arrays of a record read-only."""
    for entry in fields(record):
        values = getattr(record, entry.name)
        if isinstance(values, np.ndarray):
            values.flags.writeable = False


@dataclass(frozen=True, eq=False)
class ContactValues:
    """Contact quantities at the n points of this rank; vectors are in the axes of space, shape (n,
    d).

    Attributes:
        nodes: local numbers of the nodes, shape (n,).
        part: number of the contact that each point belongs to, shape (n,).
        normal: outward unit normals at the end of the step; the shear is turned with them later.
        pressure: contact pressure, stress, shape (n,).
        shear: friction traction, stress.
        elastic: the part of the slip so far that the regularisation causes, shear over gamma,
            length.
        contact: which points are in contact, shape (n,).
        direction: unit vectors of the shear where points slip, zero where they stick.
        turning: stiffness against slip across that direction, stress per length, shape (n,).
    """

    nodes: Indices
    part: Indices
    normal: Array
    pressure: Array
    shear: Array
    elastic: Array
    contact: Flags
    direction: Array
    turning: Array

    def __post_init__(self) -> None:
        _frozen(self)


@dataclass(frozen=True, eq=False)
class Field:
    """Values of an effect or of a user that are carried from step to step.

    Attributes:
        at: where the values are: "dofs" of the displacement, its "nodes", contact "points" or
            "cells" of this rank, the first two with ghosts, or "global", the same on all ranks.
        values: one row for each of these places.
    """

    at: str
    values: Array

    def __post_init__(self) -> None:
        _frozen(self)


@dataclass(frozen=True, eq=False)
class State:
    """The state of a body at the end of a load step, or before the first one.

    Attributes:
        number: how many load steps have ended.
        time: when the last one ended.
        displacement: from the initial position, ghosts included, length, shape (dofs,); empty at
            the start of a solve if it is not known.
        rigid: coordinates of rigid bodies with unknown motion, lengths, shape (k,).
        placed: translation and rotation of the shape of each contact; None: it has no shape.
        contact: values at the contact points; None: before the first load step.
        gammas: the last regularisation parameters of the method, normal and tangential, stress per
            length.
        error: the regularisation error that path-following has estimated, in the energy norm.
        found: the shortening of each bolt that a force tightens, length; nan: none has been found
            yet.
        fields: values of effects and users, internal variables of materials, and the pressure of a
            mixed element, by name.

    Examples:
        >>> problem = sfx.build_problem(scene)
        >>> state, result = problem.step(problem.initial(), time=1.0)
        >>> state.save("state.npz", problem)
        >>> again = sfx.State.load("state.npz", problem)
        >>> print(again.number, bool((again.displacement == state.displacement).all()))
        1 True
    """

    number: int
    time: float
    displacement: Array
    rigid: Array
    placed: tuple[Placement | None, ...]
    contact: ContactValues | None = None
    gammas: tuple[float, float] | None = None
    error: float | None = None
    found: Array = field(default_factory=lambda: np.zeros(0))
    fields: Mapping[str, Field] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _frozen(self)

    def with_field(self, name: str, at: str, values: npt.ArrayLike) -> Self:
        """Return the state with one more field of an effect or a user, see ``Field``.

        Raises:
            SceneError: ``at`` is no such place, or ``values`` has another number of rows.
        """
        points = 0 if self.contact is None else self.contact.nodes.size
        counts = {"dofs": self.displacement.size, "points": points, "nodes": None, "cells": None}
        rows = np.array(values, dtype=float)
        wrong = ""
        if at not in (*counts, "global"):
            wrong = f"must be at one of {', '.join((*counts, 'global'))}, not at {at!r}"
        elif counts.get(at) is not None and len(rows) != counts[at]:
            wrong = f"has {len(rows)} rows, and there are {counts[at]} {at} on this rank"
        if wrong:
            raise SceneError.at(f"field {name!r}", wrong)
        return replace(self, fields={**self.fields, name: Field(at, rows)})

    def save(self, path: str | Path, problem: HasPoints) -> None:
        """Write the state to a file, which any number of ranks can read; collective.

        Args:
            path: of the file.
            problem: whose state it is.

        Raises:
            OutputError: the file cannot be written.
        """
        boundary, space = problem.points()
        table = self.table(boundary, space)

        def write() -> None:
            try:
                write_table(Path(path), table)
            except OSError as reason:
                raise cannot_be_written(path, reason) from None

        parallel.on_root(space.mesh.comm, write)

    def table(self, boundary: ContactBoundary, space: fem.FunctionSpace) -> dict[str, Any]:
        """Return the arrays to store, by name, complete on the first rank only; collective."""
        values = self.contact
        rows = {} if values is None else {name: getattr(values, name) for name in _OF_POINTS}
        moved = self.displacement.reshape(-1, boundary.x.shape[1])[boundary.nodes]
        rows |= {"part": boundary.part, "corner": boundary.number, "x": boundary.x, "y": moved}
        of_cells = {"displacement": self.displacement}
        everywhere = {"rigid": self.rigid, "found": self.found}
        for name, entry in self.fields.items():
            place = {
                "dofs": of_cells,
                "nodes": of_cells,
                "cells": of_cells,
                "points": rows,
                "global": everywhere,
            }
            place[entry.at][f"field {name}"] = entry.values
        comm = space.mesh.comm
        topology = space.mesh.topology
        table = {name: parallel.rows_on_root(comm, column) for name, column in rows.items()}
        order = parallel.rows_on_root(
            comm, np.asarray(topology.original_cell_index[: _owned_cells(space)])
        )
        for name, column in of_cells.items():
            at_cells = (
                name != "displacement" and self.fields[name.removeprefix("field ")].at == "cells"
            )
            own = column[: _owned_cells(space)] if at_cells else _by_cell(space, column)
            # A rank without cells does not know how long rows are.
            width = max(comm.allgather(own.size // max(len(own), 1)))
            table[name] = parallel.rows_on_root(comm, own.reshape(len(own), width))
            if table[name] is not None:
                table[name] = table[name][np.argsort(order)]
        described = {
            "format": _FORMAT,
            "number": self.number,
            "time": self.time,
            "placed": self.placed,
            "gammas": self.gammas,
            "error": self.error,
            "fields": {name: [one.at, one.values.shape[1:]] for name, one in self.fields.items()},
        }
        return {"described": np.array(json.dumps(described)), **everywhere, **table}

    @classmethod
    def load(cls, path: str | Path, problem: HasPoints) -> State:
        """Read a state that ``save`` has written, on any number of ranks; collective.

        Args:
            path: of the file.
            problem: whose state it is.

        Raises:
            SceneError: the file holds no state, or one of another format, mesh or contact.
        """
        return cls.read(path, *problem.points())

    @classmethod
    def read(
        cls, path: str | Path, boundary: ContactBoundary | None, space: fem.FunctionSpace
    ) -> State:
        """Read a state for these contact points; collective.

        Args:
            path: of the file.
            boundary: the contact points; None: the state is read without contact values.
            space: of the displacement.

        Raises:
            SceneError: see ``load``.
        """
        comm = space.mesh.comm
        wrong = ""
        state = None
        try:
            with Path(path).open("rb") as stream, np.load(stream) as stored:
                table = dict(stored)
            described = json.loads(str(table["described"]))
            if described["format"] != _FORMAT:
                wrong = (
                    f"has the format {described['format']}, and this version reads {_FORMAT}: "
                    "solve these steps again"
                )
            else:
                state = cls._from(table, described, boundary, space)
        except (OSError, ValueError, EOFError, KeyError, TypeError, BadZipFile) as error:
            wrong = f"is no state of this mesh and contact: {error}"
        parallel.raise_together(comm, SceneError.at(str(path), wrong) if wrong else None)
        assert state is not None
        return state

    @classmethod
    def _from(
        cls,
        table: dict[str, Any],
        described: dict[str, Any],
        boundary: ContactBoundary | None,
        space: fem.FunctionSpace,
    ) -> State:
        displacement = _of_cells(space, table["displacement"])
        kinds = described["fields"]
        contact = None
        taken: Ints = np.arange(0)
        if boundary is not None and len(table["x"]):
            taken = _rows_of(
                table, boundary, displacement.reshape(-1, boundary.x.shape[1])[boundary.nodes]
            )
        if boundary is not None and "normal" in table:
            columns = {name: table[name][taken] for name in _OF_POINTS}
            contact = ContactValues(boundary.nodes.copy(), boundary.part.copy(), **columns)
        values = {}
        for name, (at, shape) in kinds.items():
            column = table[f"field {name}"]
            if at == "points":
                column = column[taken]
            elif at == "cells":
                column = column[np.asarray(space.mesh.topology.original_cell_index)]
            elif at != "global":
                column = _of_cells(space, column)
            values[name] = Field(at, column.reshape(-1, *shape))
        # JSON has made lists of the tuples.
        placed = [
            entry and tuple(tuple(one) if isinstance(one, list) else one for one in entry)
            for entry in described["placed"]
        ]
        return cls(
            described["number"],
            described["time"],
            displacement,
            table["rigid"],
            tuple(placed),
            contact,
            described["gammas"] and tuple(described["gammas"]),
            described["error"],
            table["found"],
            fields=values,
        )


def at_cells(fields: Mapping[str, Field], like: Mapping[str, Array]) -> dict[str, Array]:
    """Return the values of the fields named in ``like``, at the cells that this rank owns.

    Args:
        fields: the fields of a state.
        like: arrays with the expected shapes, by name.

    Raises:
        SceneError: a field is missing or has another shape.
    """
    rows = {name: fields[name].values[: len(one)] for name, one in like.items() if name in fields}
    shapes = {name: values.shape for name, values in rows.items()}
    if wrong := [name for name, one in like.items() if shapes.get(name) != one.shape]:
        reason = f"is that of another material: it has no such {', '.join(wrong)}"
        raise SceneError.at("state", reason)
    return rows


def write_table(path: Path, table: Mapping[str, Any]) -> None:
    """Write the arrays of ``State.table`` to a file; call it on one rank only."""
    with path.open("wb") as stream:
        np.savez(stream, **table)


def _owned_cells(space: fem.FunctionSpace) -> int:
    return int(space.mesh.topology.index_map(space.mesh.topology.dim).size_local)


def _by_cell(space: fem.FunctionSpace, values: Array) -> Array:
    """Return nodal values, ghosts included, for each owned cell and each of its nodes.

    Up to degree 2 the order of the nodes of a cell is that of the input.
    """
    nodes = space.dofmap.index_map.size_local + space.dofmap.index_map.num_ghosts
    of_nodes = values.reshape(nodes, values.size // max(nodes, 1))
    return of_nodes[space.dofmap.list[: _owned_cells(space)]]


def _of_cells(space: fem.FunctionSpace, stored: Array) -> Array:
    """Return nodal values from those stored by cell in the order of the input; the inverse of
    ``_by_cell``.

    Raises:
        ValueError: the values belong to another mesh.
    """
    nodes = np.asarray(space.dofmap.list)
    topology = space.mesh.topology
    if (
        len(stored) != topology.index_map(topology.dim).size_global
        or stored.shape[1] % nodes.shape[1]
    ):
        raise ValueError("it is of another mesh")
    size = stored.shape[1] // nodes.shape[1]
    values = np.zeros((space.dofmap.index_map.size_local + space.dofmap.index_map.num_ghosts, size))
    values[nodes.ravel()] = stored[np.asarray(topology.original_cell_index)].reshape(-1, size)
    return values.ravel()


def _rows_of(table: Mapping[str, Array], boundary: ContactBoundary, moved: Array) -> Ints:
    """Return the stored row of each contact point, shape (n,), found by position and displacement.

    Raises:
        ValueError: some point has no stored row.
    """
    size = float(np.ptp(table["x"], axis=0).max()) or 1.0
    far = float(np.abs(table["y"]).max(initial=0.0)) or 1.0

    def keys(part: Array | Integers, corner: Array | Integers, x: Array, y: Array) -> Array:
        x, y = (np.where(corner[:, None] < 0, values, 0.0) for values in (x, y))  # feet move
        return np.column_stack((part, corner, x / size, SAME_LENGTH * y / far))

    tree = cKDTree(keys(*(table[name] for name in ("part", "corner", "x", "y"))))
    distance, nearest = tree.query(keys(boundary.part, boundary.number, boundary.x, moved))
    if (distance > SAME_LENGTH).any():
        raise ValueError("its contact points are others")
    return nearest
