"""The mesh of a scene with its solution as plain arrays, which ranks send to the first one, where all is bounded.

Each rank gives what is of its own cells: corners by their global numbers, and all else at these.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.addons.bounds.simplices import COLUMNS, EDGES, FACETS, ROWS, Ints
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_entities
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.effects.displacement import PrescribedDisplacement
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.effect import Force

T = TypeVar("T")
# Arrays by their names, with the rows of one rank or of all of them.
Rows = dict[str, npt.NDArray[Any]]


def on_first_rank(
    model: Model, y: fem.Function, contact: ContactState | None, prove: Callable[[Rows], T], named: str | None
) -> T:
    """What ``prove`` says of the arrays of all ranks, see ``error_bound.proved``; collective.

    Raises:
        Exception: what was raised on any rank, the same on all of them.
    """
    comm, local, failure = model.comm, Rows(), None
    try:
        local = _of_cells(model, y) | _of_facets(model, named) | ({} if contact is None else _of_points(contact))
    except Exception as error:
        failure = error
    parallel.raise_together(comm, failure)
    rows = {name: parallel.rows_on_root(comm, values) for name, values in local.items()}
    return parallel.on_root(comm, lambda: prove(rows))


def _of_points(contact: ContactState) -> Rows:
    """The contact points, their pressure, and their shear as a vector, stresses."""
    boundary, d = contact.boundary, contact.boundary.normal.shape[1]
    return {
        "point": boundary.x[:, :d],
        "contact of point": boundary.part,
        "pressure": contact.pressure,
        "shear": np.einsum("nij,nj->ni", boundary.tangents, contact.shear),
    }


def _of_facets(model: Model, named: str | None) -> Rows:
    """Facets of the own cells of this rank by their vertices, shape (m, d), of boundaries and sides of contacts."""
    statement, tagged = model.statement, model.tagged
    boundaries = [load.where for load in statement.of(Force) if load.where is not None]
    boundaries += [str(entry.boundary) for entry in statement.of(PrescribedDisplacement)]
    facets = {f"at {name}": tagged.facets(name) for name in boundaries}  # in the same order on all ranks
    facets["named"] = np.zeros(0, dtype=np.int32) if named is None else tagged.facets(named)
    for number, effect in enumerate(statement.contact):
        if number in model.pairs:
            sides = model.pairs[number].sides
            facets |= {f"slave {number}": sides.slave.facets, f"master {number}": sides.master.facets}
        else:
            facets[f"slave {number}"] = tagged.facets(effect.boundary)
    rows, own = Rows(), tagged.mesh.topology.index_map(tagged.dimension).size_local
    cells = np.asarray(compat.geometry_cells(tagged.mesh), dtype=np.int64)
    for name, of_rank in facets.items():
        entities = facet_entities(tagged.mesh, of_rank)
        entities = entities[entities[:, 0] < own]
        nodes = np.take_along_axis(cells[entities[:, 0]], FACETS[tagged.dimension][entities[:, 1]], axis=1)
        rows[name] = np.sort(_numbers(model, nodes), axis=1)
    return rows


def _numbers(model: Model, nodes: npt.NDArray[Any]) -> Ints:
    """Global numbers of nodes of the mesh of this rank."""
    names = model.tagged.mesh.geometry.index_map().local_to_global(nodes.ravel().astype(np.int32))
    return np.asarray(names, dtype=np.int64).reshape(nodes.shape)


def _of_cells(model: Model, y: fem.Function) -> Rows:
    """Corners and their places, the displacement there and at the middles of edges in the order of ``EDGES``, the mass
    per volume, and Lame's parameters, or stiffness in the components ``ROWS`` and ``COLUMNS``.
    """
    tagged, d, elastic = model.tagged, model.tagged.dimension, model.elastic
    cells = np.arange(tagged.mesh.topology.index_map(d).size_local)
    corners = np.asarray(compat.geometry_cells(tagged.mesh), dtype=np.int64)[: len(cells)]
    values, mass = y.x.array.reshape(-1, d)[y.function_space.dofmap.list[: len(cells)]], np.zeros(len(cells))
    if values.shape[1] == d + 1:
        values = np.concatenate((values, values[:, EDGES[d]].mean(axis=2)), axis=1)
    for material in model.statement.material:
        inside = cells if material.region is None else np.isin(cells, tagged.cells(material.region))
        mass[inside] = material.density or 0.0
    x = np.asarray(tagged.mesh.geometry.x[corners][..., :d], dtype=np.float64)
    rows = {"corners": _numbers(model, corners), "x": x, "displacement": values, "mass": mass}
    if elastic.stiffness is None:
        return rows | {name: _values_of(part, cells) for name, part in zip(("lame", "mu"), elastic.lame, strict=True)}
    pairs = [(int(i), int(j)) for i, j in np.sort(np.column_stack((ROWS[d], COLUMNS[d])), axis=1)]
    axes = [model.kinematics.pairs.index(pair) for pair in pairs]
    moduli = elastic.stiffness.stiffness
    at_cells = moduli.x.array.reshape(-1, *moduli.ufl_shape)[moduli.function_space.dofmap.list[cells, 0]]
    return rows | {"stiffness": at_cells[:, axes][:, :, axes]}


def _values_of(part: Any, cells: Ints) -> npt.NDArray[np.float64]:
    """Of a coefficient in cells, shape (n,)."""
    if isinstance(part, fem.Function):
        return np.asarray(part.x.array[part.function_space.dofmap.list[cells, 0]])
    return np.full(len(cells), float(part.value))
