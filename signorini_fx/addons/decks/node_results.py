"""A solution at the nodes of the deck that it was drafted from, for each load step."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.addons.decks.content import Deck
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.mesh.files.cells import completed
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.mechanics.statement.effect import Resistance
from signorini_fx.results.certificate.nodal_forces import NodalForces
from signorini_fx.results.solution import Solution
from signorini_fx.tuned import DIGITS_OF_FILES

# Of a symmetric tensor, as CalculiX lists them in tables: xx, yy, zz, xy, xz, yz.
_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


@dataclass(frozen=True)
class NodeResults:
    """A load step at the nodes of a deck, in the order of its rows.

    Attributes:
        displacement: length, shape (n, 3).
        forces: of loads and supports, shape (n, 3).
        reactions: of supports, constraints and contact, shape (n, 3).
        stress: mean of the cells at a node, xx, yy, zz, xy, xz, yz, shape (n, 6).
        contact: clearance, slips, pressure and shears, shape (n, 6); NaN where no surface is touched.
        points: whether each is a contact point, shape (n,).
    """

    displacement: Floats
    forces: Floats
    reactions: Floats
    stress: Floats
    contact: Floats
    points: npt.NDArray[np.bool_]


def at_nodes(solution: Solution, deck: Deck | None) -> Iterator[NodeResults | None]:
    """The results of each load step, on the first rank; nothing where the mesh was refined; collective.

    Args:
        solution: the solution.
        deck: on the first rank what was read from the deck, on the others None.
    """
    numbers = _numbers(solution, deck)
    if not parallel.on_root(solution.comm, lambda: numbers is not None):
        return
    for step in solution.shown_steps:
        moment = solution.at(step)
        rows = [_by_node(moment), stress_by_node(moment), contact_by_node(moment)]
        yield None if deck is None or numbers is None else _sorted(deck, numbers, *rows)


def _geometry(solution: Solution) -> tuple[Ints, Ints]:
    """Nodes of the cells that this rank owns: those of the mesh, and those of the displacement."""
    space = solution.displacement.function_space
    owned = space.mesh.topology.index_map(space.mesh.topology.dim).size_local
    return compat.geometry_cells(space.mesh)[:owned].astype(np.int64), space.dofmap.list[:owned].astype(np.int64)


def _numbers(solution: Solution, deck: Deck | None) -> Ints | None:
    """The number of each node of the mesh in the order of the file, on the first rank, by its global number among the
    degrees of freedom; None: this is not the mesh of the deck.
    """
    mesh, space = solution.displacement.function_space.mesh, solution.displacement.function_space
    of_mesh, of_space = _geometry(solution)
    same = of_mesh.shape[1] == of_space.shape[1]
    given = np.asarray(mesh.geometry.input_global_indices)[of_mesh.ravel()]
    nodes = space.dofmap.index_map.local_to_global(of_space.ravel().astype(np.int32)) if same else given
    table = parallel.rows_on_root(solution.comm, np.column_stack((nodes, given, mesh.geometry.x[of_mesh.ravel()])))
    if deck is None:
        return None
    points, first = deck.mesh.points, np.unique(table[:, 0], return_index=True)[1]
    rows = table[first]
    if not same or len(rows) != len(points):
        return None
    numbers = rows[:, 1].astype(np.int64)
    near = DIGITS_OF_FILES * float(np.ptp(points, axis=0).max())
    away = np.abs(rows[:, 2 : 2 + deck.mesh.dim] - points[numbers]).max()
    return numbers if away <= near else None


def _by_node(moment: Solution) -> Floats:
    """Displacements, forces and reactions by the global number of the node."""
    space = moment.displacement.function_space
    dim, owned = space.dofmap.index_map_bs, space.dofmap.index_map.size_local
    balance, forces = moment.resultants.acting.balance, moment.resultants.at_nodes()
    reactions = balance.internal - (balance.external + balance.initial)
    if links := [effect for effect in moment.statement.of(Resistance) if effect.nodal]:
        nodal = NodalForces.on(moment.model)
        forces = forces - nodal.resisted(moment.displacement.x.array.reshape(-1, dim), links)
    y = moment.displacement.x.array.reshape(-1, dim)[:owned]
    return np.asarray(parallel.rows_on_root(moment.comm, np.column_stack((y, forces, reactions))))


def stress_by_node(moment: Solution) -> Floats:
    """The mean of the stress over the cells at a node, by its global number, shape (nodes, 6), on the first rank;
    collective.
    """
    space = moment.displacement.function_space
    degree = space.element.basix_element.degree
    tensor = fem.Function(fem.functionspace(space.mesh, ("DG", degree, (3, 3))))
    tensor.interpolate(moment.stress.tensor)
    cells = _geometry(moment)[1]
    values = tensor.x.array.reshape(-1, 9)[tensor.function_space.dofmap.list[: len(cells)].ravel()]
    nodes = space.dofmap.index_map.local_to_global(cells.ravel().astype(np.int32))
    rows = np.asarray(parallel.rows_on_root(moment.comm, np.column_stack((nodes, values))))
    numbers = rows[:, 0].astype(np.int64)
    counts = np.bincount(numbers)
    sums = [np.bincount(numbers, rows[:, 1 + 3 * i + j]) / counts for i, j in _PAIRS]
    return np.column_stack(sums)


def contact_by_node(moment: Solution) -> Floats:
    """Global number of the node, clearance, slips along two tangents, pressure and shears along them, of all contact
    points; NaN where nothing touches.

    The first tangent is the projection of axis x, or of z where that is the normal; the second one follows from the
    normal of the other side.
    """
    if moment.contact is None:
        return np.zeros((0, 7))
    table = moment.table
    columns: dict[str, Any] = table.columns
    assert table.nodes is not None
    count, axes = len(table.nodes), [axis for axis in "xyz" if f"n_{axis}" in columns]

    def vector(name: str) -> Floats:
        if f"{name}_x" in columns:
            return np.pad(np.column_stack([columns[f"{name}_{axis}"] for axis in axes]), ((0, 0), (0, 3 - len(axes))))
        return np.asarray(columns[name])[:, None] * tangent

    normal = np.pad(np.column_stack([columns[f"n_{axis}"] for axis in axes]), ((0, 0), (0, 3 - len(axes))))
    tangent = np.column_stack((-normal[:, 1], normal[:, 0], np.zeros(count)))
    along = np.eye(3)[np.where(np.abs(normal[:, 0]) > 1 - DIGITS_OF_FILES, 2, 0)]
    first = along - np.sum(along * normal, axis=1)[:, None] * normal
    first /= np.linalg.norm(first, axis=1)[:, None]
    second = np.cross(-normal, first)
    slip, shear = vector("u_t"), vector("shear")  # slips of a deck count from its beginning
    products = [np.sum(values * unit, axis=1) for values in (slip, shear) for unit in (first, second)]
    clearance, pressure = columns["gap"] - columns["u_n"], columns["pressure"]
    rows = np.column_stack((table.nodes[:, 1], clearance, *products[:2], pressure, *products[2:]))
    rows[columns["state"] == "open", 1:] = np.nan
    return np.asarray(rows)


def _sorted(deck: Deck, numbers: Ints, nodal: Floats, stress: Floats, contact: Floats) -> NodeResults:
    """Rows by global numbers as those of the nodes of the deck."""
    dim, count = deck.mesh.dim, len(deck.numbers)
    order = np.argsort(numbers)
    nodal, stress = nodal[order], stress[order]
    forces, reactions = (
        np.pad(part, ((0, 0), (0, 3 - dim))) for part in (nodal[:, dim : 2 * dim], nodal[:, 2 * dim :])
    )
    for part in (forces, reactions):
        _give_back(deck, part)
    touching = np.full((count, 6), np.nan)
    rows = numbers[contact[:, 0].astype(np.int64)]
    given = rows < count  # nodes that were added to the cells are none of the deck's
    touching[rows[given]] = contact[given, 1:]
    points = np.zeros(count, dtype=bool)
    points[rows[given]] = True
    displacement = np.pad(nodal[:count, :dim], ((0, 0), (0, 3 - dim)))
    share = deck.printed_share
    return NodeResults(
        displacement, share * forces[:count], share * reactions[:count], stress[:count], touching, points
    )


def _give_back(deck: Deck, forces: Floats) -> None:
    """Forces at nodes that complete the cells go to the nodes of the deck, by whose shape functions they move."""
    count = len(deck.numbers)
    if len(forces) == count:
        return
    for kind in {kind for kind, _ in deck.model.raw.blocks}:
        full_cell = completed(kind)
        if full_cell is None or full_cell[0].kind != deck.mesh.kind:
            continue
        weights = full_cell[1]
        existing = weights.shape[1]
        added, first = np.unique(deck.mesh.cells[:, existing:], return_index=True)
        cell, position = np.divmod(first, weights.shape[0] - existing)
        for node, row, column in zip(added, cell, position, strict=True):
            corners = deck.mesh.cells[row, :existing]
            if node >= count and (corners < count).all():
                forces[corners] += weights[existing + column][:, None] * forces[node]
