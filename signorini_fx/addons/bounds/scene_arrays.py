"""A scene with its solution as plain arrays, which ranks send to the first one, where all is bounded.

Each rank gives what is of its own cells: corners by their global numbers, and all else at these.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.addons.bounds.bounded_scene import refused, switches
from signorini_fx.addons.bounds.simplices import COLUMNS, EDGES, EDGES_OF_FACET, FACETS, ROWS, Array, Ints
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_entities
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.effects.contact import Contact
from signorini_fx.mechanics.effects.displacement import PrescribedDisplacement
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.effect import Force, SampledPoints
from signorini_fx.mechanics.statement.expressions import Expression, in_space, sample
from signorini_fx.tuned import SAME_LENGTH

T = TypeVar("T")
# Arrays by their names, with the rows of one rank or of all of them.
Rows = dict[str, npt.NDArray[Any]]


def on_first_rank(
    model: Model,
    y: fem.Function,
    contact: ContactState | None,
    step: float,
    prove: Callable[[Rows], T],
    named: str | None = None,
) -> T:
    """What ``prove`` says of the arrays of all ranks, see ``error_bound.proved``; collective.

    Raises:
        Exception: what was raised on any rank, the same on all of them.
    """
    comm, local, failure = model.comm, Rows(), None
    areas = _areas(model, step)
    try:
        local = _SceneRows(model, y, step, areas).rows
        facets = np.zeros(0, dtype=np.int32) if named is None else model.tagged.facets(named)
        local["named"] = _Facets.of(model, facets).vertices
        if contact is not None:
            local |= _points(contact)
    except Exception as error:
        failure = error
    parallel.raise_together(comm, failure)
    rows = {name: parallel.rows_on_root(comm, values) for name, values in local.items()}
    return parallel.on_root(comm, lambda: prove(rows))


def _areas(model: Model, step: float) -> list[float]:
    """Of the boundary of each load, zero in the body; collective."""
    entries = model.statement.placed(step).of(Force)
    areas = np.zeros(len(entries))
    for number, load in enumerate(entries):
        if load.where is not None:
            areas[number] = _Facets.of(model, model.tagged.facets(load.where)).area.sum()
    return [float(area) for area in parallel.global_sum(model.comm, areas)]


def _points(contact: ContactState) -> Rows:
    """The contact points, their pressure, and their shear as a vector, stresses."""
    boundary, d = contact.boundary, contact.boundary.normal.shape[1]
    return {
        "point": boundary.x[:, :d],
        "contact of point": boundary.part,
        "pressure": contact.pressure,
        "shear": np.einsum("nij,nj->ni", boundary.tangents, contact.shear),
    }


@dataclass(frozen=True)
class _Facets:
    """Facets of the own cells of a rank."""

    cell: Ints  # of each, shape (m,)
    vertices: Ints  # their global numbers, ascending, shape (m, d)
    x: Array  # of these, length, shape (m, d, d)
    normal: Array  # outward, shape (m, d)
    area: Array  # shape (m,)

    @staticmethod
    def of(model: Model, facets: npt.NDArray[np.int32]) -> _Facets:
        """Those of the own cells among some of a rank."""
        mesh, d = model.tagged.mesh, model.tagged.dimension
        entities = facet_entities(mesh, facets).astype(np.int64)
        entities = entities[entities[:, 0] < mesh.topology.index_map(d).size_local]
        cells = np.asarray(compat.geometry_cells(mesh), dtype=np.int64)[entities[:, 0]]
        nodes = np.take_along_axis(cells, FACETS[d][entities[:, 1]], axis=1)
        numbers = _numbers(model, nodes)
        order = np.argsort(numbers, axis=1)
        nodes, numbers = (np.take_along_axis(of_facets, order, axis=1) for of_facets in (nodes, numbers))
        x = np.asarray(mesh.geometry.x[nodes][..., :d], dtype=np.float64)
        along = x[:, 1:] - x[:, :1]
        scaled = np.column_stack((along[:, 0, 1], -along[:, 0, 0])) if d == 2 else np.cross(along[:, 0], along[:, 1])
        inside = mesh.geometry.x[cells][..., :d].mean(axis=1)
        scaled = scaled * np.sign(np.einsum("md,md->m", scaled, x[:, 0] - inside))[:, None]
        size = np.linalg.norm(scaled, axis=1)
        return _Facets(entities[:, 0], numbers, x, scaled / size[:, None], size / (d - 1))

    def with_middles(self) -> Array:
        """Vertices and the middles of the edges, in the order of ``EDGES_OF_FACET``, length, shape (m, 3 or 6, d)."""
        return np.concatenate((self.x, self.x[:, EDGES_OF_FACET[self.x.shape[1]]].mean(axis=2)), axis=1)


def _numbers(model: Model, nodes: npt.NDArray[Any]) -> Ints:
    """Global numbers of nodes of the mesh of this rank."""
    names = model.tagged.mesh.geometry.index_map().local_to_global(nodes.ravel().astype(np.int32))
    return np.asarray(names, dtype=np.int64).reshape(nodes.shape)


class _SceneRows:
    """What a rank sends but for contact points.

    Attributes:
        rows: by name.  ``corners``, ``x`` and ``body``, the force per volume, at corners; ``displacement``; ``lame``
            and ``mu``, or ``stiffness``; ``loaded``, ``supported`` and for each contact k ``slave k`` and ``master k``,
            facets by their vertices, with values at these.
    """

    def __init__(self, model: Model, y: fem.Function, step: float, areas: list[float]) -> None:
        self._model, self._step, self._d = model, step, model.tagged.dimension
        self._statement = model.statement.placed(step)
        mesh = model.tagged.mesh
        self._count = int(mesh.topology.index_map(self._d).size_local)
        self._cells = np.asarray(compat.geometry_cells(mesh), dtype=np.int64)[: self._count]
        self._x = np.asarray(mesh.geometry.x[self._cells][..., : self._d], dtype=np.float64)
        self.rows: Rows = {"corners": _numbers(model, self._cells), "x": self._x}
        self.rows |= self._displacement(y) | self._moduli() | self._loads(areas) | self._supports()
        for number, effect in enumerate(self._statement.contact):
            self.rows |= self._contact(number, effect)

    def _displacement(self, y: fem.Function) -> Rows:
        """At corners, and at the middles of edges in the order of ``EDGES``, shape (n, 6 or 10, d)."""
        d = self._d
        values = y.x.array.reshape(-1, d)[y.function_space.dofmap.list[: self._count]]
        if values.shape[1] == d + 1:
            values = np.concatenate((values, values[:, EDGES[d]].mean(axis=2)), axis=1)
        return {"displacement": values}

    def _moduli(self) -> Rows:
        """Lame's parameters, or stiffness in the components ``ROWS`` and ``COLUMNS``, of the cells."""
        d, elastic, cells = self._d, self._model.elastic, np.arange(self._count)
        if elastic.stiffness is None:
            lame, mu = (_values_of(part, cells) for part in elastic.lame)
            return {"lame": lame, "mu": mu}
        pairs = [(int(i), int(j)) for i, j in np.sort(np.column_stack((ROWS[d], COLUMNS[d])), axis=1)]
        axes = [self._model.kinematics.pairs.index(pair) for pair in pairs]
        moduli = elastic.stiffness.stiffness
        at_cells = moduli.x.array.reshape(-1, *moduli.ufl_shape)[moduli.function_space.dofmap.list[cells, 0]]
        return {"stiffness": at_cells[:, axes][:, :, axes]}

    def _loads(self, areas: list[float]) -> Rows:
        """Force per volume at corners, and per area at the vertices of facets."""
        body, mass, cells = np.zeros_like(self._x), np.zeros(self._count), np.arange(self._count)
        for material in self._statement.material:
            inside = cells if material.region is None else np.isin(cells, self._model.tagged.cells(material.region))
            mass[inside] = material.density or 0.0
        vertices: list[Ints] = [np.zeros((0, self._d), dtype=np.int64)]
        tractions: list[Array] = [np.zeros((0, self._d, self._d))]
        for listed, area in zip(self._statement.of(Force), areas, strict=True):
            factor, load = self._statement.now(listed, self._step)
            if factor == 0:
                continue
            if load.where is None:
                body = body + factor * self._density(load, self._x, np.zeros((len(self._x), self._d)), mass, area)
                continue
            facets = _Facets.of(self._model, self._model.tagged.facets(load.where))
            vertices.append(facets.vertices)
            density = self._density(load, facets.x, facets.normal, mass[facets.cell], area)
            tractions.append(factor * density)
        return {"body": body, "loaded": np.concatenate(vertices), "traction": np.concatenate(tractions)}

    def _density(self, load: Force, x: Array, normal: Array, mass: Array, area: float) -> Array:
        """Of a load at vertices x of m cells or facets, seen from inside, (m, k, d); ``area``: of the boundary."""
        for value in load.given.values():
            _refuse_jumps(value, x, load.label)
        each = x.shape[1]
        places, across = _inside(x).reshape(-1, self._d).T, np.repeat(normal, each, axis=0).T
        at = SampledPoints(places, across, lambda effect: area * float(effect.spread), np.repeat(mass, each))
        return _from_inside(np.broadcast_to(load.density(at), places.shape).T.reshape(x.shape))

    def _supports(self) -> Rows:
        """Facets with the direction that is held, and the prescribed component at vertices and middles of edges."""
        d = self._d
        vertices: list[Ints] = [np.zeros((0, d), dtype=np.int64)]
        directions: list[Array] = [np.zeros((0, d))]
        prescribed: list[Array] = [np.zeros((0, d + len(EDGES_OF_FACET[d])))]
        for entry in self._statement.of(PrescribedDisplacement):
            if not entry.holding:
                continue
            factor, effect = self._statement.now(entry, self._step)
            facets = _Facets.of(self._model, self._model.tagged.facets(str(effect.boundary)))
            x = facets.with_middles()
            axes = [np.broadcast_to(axis, facets.normal.shape) for axis in np.eye(d)]
            for value, direction in ((effect.normal, facets.normal), *zip(effect.components[:d], axes, strict=True)):
                if value is not None:
                    vertices.append(facets.vertices)
                    directions.append(direction)
                    prescribed.append(factor * _sampled(value, x))
        return {
            "supported": np.concatenate(vertices),
            "direction": np.concatenate(directions),
            "prescribed": np.concatenate(prescribed),
        }

    def _contact(self, number: int, effect: Contact) -> Rows:
        """Facets with contact points, gap, friction bound, and where the foundation is, or facets of the other body."""
        d, pair = self._d, self._model.pairs.get(number)
        named = self._model.tagged.facets(effect.boundary) if pair is None else pair.sides.slave.facets
        facets = _Facets.of(self._model, named)
        bound = getattr(effect.friction, "bound", 0.0)  # that of Tresca friction
        _refuse_jumps(bound, facets.x, "friction bound")
        towards = facets.normal
        if effect.foundation is not None:
            towards = -effect.foundation.distance(facets.x.mean(axis=1))[1]
        elif effect.direction is not None:
            direction = np.array(effect.direction[:d])
            towards = np.broadcast_to(direction / np.linalg.norm(direction), facets.normal.shape)
        rows = {
            f"slave {number}": facets.vertices,
            f"towards {number}": towards,
            f"gap {number}": _sampled(effect.gap_in(d), facets.with_middles()),
            f"bound {number}": _from_inside(_sampled(bound, _inside(facets.x))),
        }
        if pair is not None:
            rows |= {
                f"master {number}": _Facets.of(self._model, pair.sides.master.facets).vertices,
                f"covered {number}": np.array([parallel.is_root(self._model.comm) * pair.coupling.met]),
                f"by geometry {number}": np.array([effect.distance == "geometry" and not effect.bonded]),
            }
        return rows


def _sampled(value: Any, x: Array) -> Array:
    """A number or an expression at points, shapes (m, q, d) to (m, q)."""
    return sample(value, in_space(x.reshape(-1, x.shape[2]))).reshape(x.shape[:2])


def _inside(x: Array) -> Array:
    """Points inside simplices, half-way from their centroids to their corners, shape (m, k, d)."""
    return np.asarray((x + x.mean(axis=1, keepdims=True)) / 2)


def _from_inside(values: Array) -> Array:
    """Values of linear functions at corners from those at points ``_inside``, shape (m, k, ...)."""
    return np.asarray(2 * values - values.mean(axis=1, keepdims=True))


def _refuse_jumps(value: Any, x: Array, label: str) -> None:
    """Refuse a value with a jump or a kink inside a simplex, given by its corners, shape (m, k, d)."""
    if not isinstance(value, Expression) or not x.size:
        return
    at_corners = switches(value, in_space(x.reshape(-1, x.shape[2]))).reshape(-1, *x.shape[:2])
    tiny = SAME_LENGTH * np.abs(at_corners).max(axis=(1, 2), initial=0.0)[:, None]
    if ((at_corners.min(axis=2) < -tiny) & (at_corners.max(axis=2) > tiny)).any():
        raise refused(f"a {label} that jumps or has a kink between nodes")


def _values_of(part: Any, cells: Ints) -> Array:
    """Of a coefficient in cells, shape (n,)."""
    if isinstance(part, fem.Function):
        return np.asarray(part.x.array[part.function_space.dofmap.list[cells, 0]])
    return np.full(len(cells), float(part.value))
