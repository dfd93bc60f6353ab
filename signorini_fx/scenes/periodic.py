"""Cells of periodic bodies: links and forces between the nodes of two opposite sides of a mesh."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
import numpy.typing as npt
from dolfinx import fem
from scipy.spatial import cKDTree

from signorini_fx.errors import MeshError, cannot_be_written
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.effects.links import Links
from signorini_fx.mechanics.effects.point_force import PointForce
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.tuned import SAME_POSITION

Array = npt.NDArray[np.float64]


def periodic_sides(
    tagged: TaggedMesh,
    side: str,
    opposite: str,
    file: str | Path,
    *,
    stiffness: float,
    difference: Sequence[float] | None = None,
    degree: int = 1,
) -> tuple[Links, PointForce | None]:
    """Make the displacement of a side that of the opposite one, but for a constant difference; collective.

    ``links, force = periodic_sides(mesh, "left", "right", "sides.csv", stiffness=1e5 * young)`` are entries of a
    ``Scene`` on the mesh.  The difference is missed by the force that a pair of nodes carries over the stiffness.

    Args:
        tagged: the mesh, whose sides have nodes at the same places but for a shift, the period.
        side: the name of one of them.
        opposite: that of the other one.
        file: the table of links, ``.csv``; forces are in a file beside it, whose name ends with ``_forces``.
        stiffness: of each pair of nodes, force per length (in the plane per thickness).
        difference: of the displacement of ``opposite`` from that of ``side``, length, shape (d,): of a mean gradient G
            of the displacement G times the period; None: zero.
        degree: of the displacement in the scene.

    Returns:
        The links, and the forces that the difference needs, None without one.

    Raises:
        MeshError: there is no such side, or a node has no partner.
        OutputError: the file cannot be written.
    """
    path, comm, dim = Path(file), tagged.mesh.comm, tagged.dimension
    jump = np.zeros(dim) if difference is None else np.asarray(difference, dtype=np.float64)
    space = fem.functionspace(tagged.mesh, ("Lagrange", degree))
    sides = [_positions(space, tagged, name) for name in (side, opposite)]
    tolerance = SAME_POSITION * tagged.size  # collective
    at, partner = parallel.on_root(comm, lambda: _pairs(*sides, names=(side, opposite), tolerance=tolerance))
    axes = "xyz"[:dim]
    rows = _rows(at, partner, np.eye(dim))
    numbered = np.column_stack((np.arange(len(rows)) // 2, rows))
    parallel.on_root(comm, lambda: _write(path, ["link", *axes, *(f"c{x}" for x in axes)], numbered))
    links = Links(file=path, stiffness=stiffness)
    if not jump.any():
        return links, None
    forces = path.with_stem(f"{path.stem}_forces")
    pushed = _rows(at, partner, stiffness * jump[None, :])
    parallel.on_root(comm, lambda: _write(forces, [*axes, *(f"f{x}" for x in axes)], pushed))
    return links, PointForce(file=forces)


def _rows(first: Array, second: Array, vectors: Array) -> Array:
    """For each pair of nodes and each vector two rows: the first node with minus the vector, the second one with it."""
    shape = (len(first), len(vectors), 2, first.shape[1])
    places = np.broadcast_to(np.stack((first, second), axis=1)[:, None], shape)
    signed = np.broadcast_to(np.array([-1.0, 1.0])[:, None] * vectors[:, None, :], shape)
    return np.concatenate((places, signed), axis=3).reshape(-1, 2 * shape[3])


def _positions(space: fem.FunctionSpace, tagged: TaggedMesh, name: str) -> Array:
    """The nodes of a side, on the first rank, each once for each rank that has it, shape (n, d); collective."""
    nodes = fem.locate_dofs_topological(space, tagged.dimension - 1, tagged.facets(name))
    mine = node_positions(space)[nodes][:, : tagged.dimension]
    parts = tagged.mesh.comm.gather(mine)
    return np.concatenate(parts) if parts is not None else mine


def _pairs(first: Array, second: Array, *, names: tuple[str, str], tolerance: float) -> tuple[Array, Array]:
    """The nodes of the first side and their partners, shape (n, d) each.

    Raises:
        MeshError: a node has none.
    """
    first, second = (_distinct(points, tolerance) for points in (first, second))
    period = (second.min(axis=0) + second.max(axis=0) - first.min(axis=0) - first.max(axis=0)) / 2
    distance, number = cKDTree(second).query(first + period)
    if len(first) != len(second) or distance.max() > tolerance:
        where = f"({', '.join(f'{x:g}' for x in first[int(np.argmax(distance))])})"
        raise MeshError(
            f"the sides {names[0]!r} and {names[1]!r} have no nodes at the same places: {len(first)} and {len(second)} "
            f"nodes, that of {names[0]!r} at {where} is {distance.max():.2g} away from the next one"
        )
    return first, second[number]


def _distinct(points: Array, tolerance: float) -> Array:
    """Points without those that lie at the place of an earlier one."""
    pairs = cKDTree(points).query_pairs(tolerance, output_type="ndarray")
    return np.delete(points, np.unique(pairs[:, 1]), axis=0)


def _write(path: Path, head: Sequence[str], rows: Array) -> None:
    """A table in text, with all digits.

    Raises:
        OutputError: it cannot be written.
    """
    try:
        with path.open("w", encoding="utf-8", newline="") as stream:
            writer = csv.writer(stream)
            writer.writerow(head)
            writer.writerows(list(row) for row in rows)
    except OSError as error:
        raise cannot_be_written(path, error) from None
