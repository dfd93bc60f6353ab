"""A scene with its solution as plain arrays: displacement, supports, loads and contact on triangles
or tetrahedra.

Each rank contributes the rows of its own cells: corners by their global numbers, and all values at
these.  The first rank, which computes the bounds, makes the problem of these rows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from scipy.spatial import cKDTree

from signorini_fx.addons.bounds.bounded_scene import refuse_jumps, refused
from signorini_fx.addons.bounds.contact_parts import MASTER, SLAVE, ContactParts, coefficients
from signorini_fx.addons.bounds.equilibrated_stress import onto_disc
from signorini_fx.addons.bounds.simplices import (
    COLUMNS,
    EDGES,
    EDGES_OF_FACET,
    FACETS,
    ROWS,
    TWICE,
    Moduli,
    Simplices,
    divide,
    with_hats,
)
from signorini_fx.arrays import Array, Ints, Value, matvec
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_entities
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.effects.contact import Contact
from signorini_fx.mechanics.effects.displacement import Displacement
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.effect import ForceDensity, SampledPoints
from signorini_fx.mechanics.statement.expressions import in_space, sample
from signorini_fx.tuned import SAME_LENGTH, ZERO_IN_SOLUTION

T = TypeVar("T")
# Arrays by name, with the rows of one rank or of all ranks.
Rows = dict[str, npt.NDArray[Any]]


def on_first_rank(
    model: Model,
    y: fem.Function,
    contact: ContactState | None,
    prove: Callable[[Rows], T],
    named: str | None,
) -> T:
    """Return the result of ``prove`` for the arrays of all ranks, see ``error_bound.proved``;
    collective.

    Raises:
        Exception: what was raised on any rank, the same on all of them.
    """
    comm = model.comm
    local = Rows()
    failure = None
    try:
        local = (
            _of_cells(model, y)
            | _of_facets(model, named)
            | ({} if contact is None else _of_points(contact))
        )
    except Exception as error:
        failure = error
    parallel.raise_together(comm, failure)
    rows = {name: parallel.rows_on_root(comm, values) for name, values in local.items()}
    return parallel.on_root(comm, lambda: prove(rows))


def _of_points(contact: ContactState) -> Rows:
    """Return the contact points, their pressure, and their shear as a vector, stresses."""
    boundary = contact.boundary
    d = contact.boundary.normal.shape[1]
    return {
        "point": boundary.x[:, :d],
        "contact of point": boundary.part,
        "pressure": contact.pressure,
        "shear": matvec(boundary.tangents, contact.shear),
    }


def _of_facets(model: Model, named: str | None) -> Rows:
    """Return the facets of the own cells of this rank by their vertices, shape (m, d), for
    boundaries with loads or supports and for the sides of contacts.
    """
    statement = model.statement
    tagged = model.tagged
    boundaries = [load.where for load in statement.of(ForceDensity) if load.where is not None]
    boundaries += [str(entry.boundary) for entry in statement.of(Displacement)]
    facets = {
        f"at {name}": tagged.facets(name) for name in boundaries
    }  # in the same order on all ranks
    facets["named"] = np.zeros(0, dtype=np.int32) if named is None else tagged.facets(named)
    for number, effect in enumerate(model.contacts):
        if number in model.pairs:
            sides = model.pairs[number].sides
            facets |= {
                f"slave {number}": sides.slave.facets,
                f"master {number}": sides.master.facets,
            }
        else:
            facets[f"slave {number}"] = tagged.facets(effect.boundary)
    rows = Rows()
    own = tagged.mesh.topology.index_map(tagged.dimension).size_local
    cells = np.asarray(compat.geometry_cells(tagged.mesh), dtype=np.int64)
    for name, of_rank in facets.items():
        entities = facet_entities(tagged.mesh, of_rank)
        entities = entities[entities[:, 0] < own]
        nodes = np.take_along_axis(
            cells[entities[:, 0]], FACETS[tagged.dimension][entities[:, 1]], axis=1
        )
        rows[name] = np.sort(_numbers(model, nodes), axis=1)
    return rows


def _numbers(model: Model, nodes: Ints) -> Ints:
    """Return the global numbers of nodes of the mesh of this rank."""
    names = model.tagged.mesh.geometry.index_map().local_to_global(nodes.ravel().astype(np.int32))
    return np.asarray(names, dtype=np.int64).reshape(nodes.shape)


def _of_cells(model: Model, y: fem.Function) -> Rows:
    """Return the data of the cells of this rank.

    These are their corners with positions, the displacement there and at the middles of edges in
    the order of ``EDGES``, the mass per volume, and Lame's parameters, or the stiffness in the
    components ``ROWS`` and ``COLUMNS``.
    """
    tagged = model.tagged
    d = model.tagged.dimension
    elastic = model.scene_law
    cells = np.arange(tagged.mesh.topology.index_map(d).size_local)
    corners = np.asarray(compat.geometry_cells(tagged.mesh), dtype=np.int64)[: len(cells)]
    values = y.x.array.reshape(-1, d)[y.function_space.dofmap.list[: len(cells)]]
    mass = np.zeros(len(cells))
    if values.shape[1] == d + 1:
        values = np.concatenate((values, values[:, EDGES[d]].mean(axis=2)), axis=1)
    for material in model.materials:
        inside = cells if material.region is None else np.isin(cells, tagged.cells(material.region))
        mass[inside] = material.density or 0.0
    x = np.asarray(tagged.mesh.geometry.x[corners][..., :d], dtype=np.float64)
    rows = {"corners": _numbers(model, corners), "x": x, "displacement": values, "mass": mass}
    if elastic.stiffness is None:
        return rows | {
            name: _values_of(part, cells)
            for name, part in zip(("lame", "mu"), elastic.lame, strict=True)
        }
    pairs = [(int(i), int(j)) for i, j in np.sort(np.column_stack((ROWS[d], COLUMNS[d])), axis=1)]
    axes = [model.kinematics.pairs.index(pair) for pair in pairs]
    moduli = elastic.stiffness.stiffness
    at_cells = moduli.x.array.reshape(-1, *moduli.ufl_shape)[
        moduli.function_space.dofmap.list[cells, 0]
    ]
    return rows | {"stiffness": at_cells[:, axes][:, :, axes]}


def _values_of(part: fem.Function | fem.Constant, cells: Ints) -> Array:
    """Return the values of a coefficient in cells, shape (n,)."""
    if isinstance(part, fem.Function):
        return part.x.array[part.function_space.dofmap.list[cells, 0]]
    return np.full(len(cells), float(part.value))


# --- the problem on the first rank ----------------------------------------------------------------

# Values at both ends of the linear function whose moments with linear ones are those that Simpson's
# rule has from nodal values, those at the ends first.
_LINEAR: Array = np.array([[4, -2, 4], [-2, 4, 4]]) / 6
# Of linear functions on an edge the values on its halves, which end with its middle, as that has
# the higher number.
_ON_HALVES: Array = np.array([[[2, 0], [1, 1]], [[0, 2], [1, 1]]]) / 2


@dataclass
class FacetsInContact:
    """The facets of one contact, with its gap and its tractions."""

    parts: ContactParts  # the m parts of the contact, on f facets with contact points
    gap: Array  # coefficients of Bernstein on the parts, length, shape (m, 3 or 6)
    bound: Array  # g at the vertices of the facets, stress, shape (f, d)
    pressure: Array  # p, see ``bound``
    shear: Array  # mu there, perpendicular to the normal, stress, shape (f, d, d)
    share: float  # of a change of the jump that the side with the contact points takes

    @property
    def paired(self) -> bool:
        """Whether it is between two bodies."""
        return len(self.parts.facets) == 2

    @property
    def traction(self) -> Array:
        """The traction on the first body at the vertices of the parts, stress, shape (m, d, d)."""
        pressure = self.parts.on_parts(self.pressure)
        shear = self.parts.on_parts(self.shear)
        return -pressure[:, :, None] * self.parts.normal[:, None] - shear

    def excess(self, displacement: Array) -> Array:
        """Return Bernstein coefficients of the penetration of a displacement, length, shape (m, c).

        Args:
            displacement: Bernstein coefficients of the displacement relative to the other side.
        """
        return matvec(displacement, self.parts.normal) - self.gap

    def work(self, motions: Array) -> tuple[Array, Array]:
        """Return the work of unit pressures and shears at the vertices of the facets, shapes (f, d,
        k) and (f, d, d, k).

        Args:
            motions: k linear displacements at the vertices of the parts, relative to the other
                side, length, shape (m, d, d, k).
        """
        parts = self.parts
        moments = with_hats(motions, parts.area)
        normal = -np.einsum("fadk,fd->fak", moments, parts.normal)
        across = -(moments + np.einsum("fak,fd->fadk", normal, parts.normal))
        return parts.moments(normal), parts.moments(across)


class PlainProblem:
    """A scene with its solution as plain arrays.

    Attributes:
        t: the cells; triangles of degree 2 are divided.
        y: the displacement at vertices, and at the middles of edges, length, shape (v + e, d).
        held: projectors onto the directions in which supports hold facets, shape (f, d, d).
        body: force per volume at the corners of the cells, shape (n, d + 1, d).
        traction: traction of loads at the vertices of the facets, without the part that supports
            take, stress, shape (f, d, d).
        named: the facets of the requested boundary.
        contacts: the contacts of the scene, in its order.
        cells: number of cells of the mesh.
    """

    def __init__(self, rows: Rows, model: Model, step: float) -> None:
        self._rows = rows
        self.cells = len(rows["corners"])
        self._model = model
        self._step = step
        d = int(rows["x"].shape[2])
        numbers, corners = np.unique(rows["corners"], return_inverse=True)
        corners = corners.reshape(-1, d + 1)
        self._numbers = numbers
        x = np.zeros((len(numbers), d))
        x[corners] = rows["x"]
        ends = np.sort(corners[:, EDGES[d]], axis=2)
        turned = np.linalg.det(x[corners][:, 1:] - x[corners][:, :1]) < 0
        order = np.where(turned[:, None], [*range(d - 1), d, d - 1], np.arange(d + 1))
        t = Simplices(x, np.take_along_axis(corners, order, axis=1), _moduli(rows, d))
        y: Array = np.zeros((len(x) + len(t.edges), d))
        y[np.column_stack((corners, len(x) + np.searchsorted(t.keys(t.edges), t.keys(ends))))] = (
            rows["displacement"]
        )
        self._given = t
        self.t = t
        self.y = y
        self._halves = np.arange(len(t.facets))[:, None]
        if d == 2 and model.space.element.basix_element.degree == 2:
            # The stress is linear: on four triangles it is as accurate as that of degree 2.
            self.t, self.y, self._halves = divide(t, y)
        self._statement = model.statement
        self.held = self._supports()
        self.body, self.traction = self._loads()
        self.named: Ints = self._facets("named")
        contacts = enumerate(self._statement.contacts_at(step)) if "point" in rows else ()
        self.contacts = [self._contact(number, effect) for number, effect in contacts]

    @property
    def body_moments(self) -> Array:
        """Integrals of the force per volume times the barycentric coordinates, force, shape (n, d +
        1, d).
        """
        return with_hats(self.body, self.t.volume)

    def work(self, y: Array) -> float:
        """Return the work of the loads on a displacement that is linear on the cells, an energy.

        Args:
            y: the displacement at the vertices, length, shape (v, d).
        """
        t = self.t
        on_facets = np.einsum("fad,fad->", with_hats(self.traction, t.area), y[t.facets])
        return float(on_facets + np.einsum("ncd,ncd->", self.body_moments, y[t.corners]))

    def relative(self, surface: FacetsInContact, y: Array) -> Array:
        """Return Bernstein coefficients on the parts of a contact of a displacement of degree 2,
        relative to the other body.
        """
        parts = surface.parts
        nodes = self.t.nodes_of_facets
        of_sides = [
            parts.restricted(coefficients(y[nodes[parts.facet(side)]]), side)
            for side in parts.sides
        ]
        return of_sides[SLAVE] - of_sides[MASTER] if surface.paired else of_sides[SLAVE]

    def _undivided(self, name: str) -> Ints:
        """Return the numbers of the facets in the rows of this name, among those of the undivided
        cells.
        """
        t = self._given
        return np.searchsorted(
            t.keys(t.facets), t.keys(np.searchsorted(self._numbers, self._rows[name]))
        )

    def _facets(self, name: str) -> Ints:
        """Return the facets of a boundary, the halves of each one together."""
        return self._halves[self._undivided(name)].ravel()

    def _loads(self) -> tuple[Array, Array]:
        """Return the force per volume at the corners of cells, and per area at the vertices of
        facets.
        """
        t = self.t
        mass = np.tile(self._rows["mass"], self.t.parts)
        body = np.zeros((*t.corners.shape, t.dimension))
        traction = np.zeros((*t.facets.shape, t.dimension))
        for listed in self._statement.of(ForceDensity):
            factor, load = self._statement.now(listed, self._step)
            if factor == 0:
                continue
            if load.where is None:
                body += factor * _density(
                    load, t.x[t.corners], np.zeros((len(mass), t.dimension)), mass, 0.0
                )
                continue
            facets = self._facets(f"at {load.where}")
            x = t.x[t.facets[facets]]
            area = float(t.area[facets].sum())
            traction[facets] += factor * _density(
                load, x, t.normal[facets], mass[t.sides[facets, 0]], area
            )
        return body, traction @ (np.eye(t.dimension) - self.held)

    def _supports(self) -> Array:
        """Return projectors onto the directions that supports hold; the displacement must agree
        with the prescribed values there.
        """
        t = self.t
        missed = 0.0
        largest = float(np.abs(self.y).max())
        places = t.with_middles(t.x)
        held = np.zeros((*t.facets.shape, t.dimension))
        for entry in self._statement.of(Displacement):
            if not entry.holds_at(self._step):
                continue
            factor, effect = self._statement.now(entry, self._step)
            facets = self._facets(f"at {effect.boundary}")
            nodes = t.nodes_of_facets[facets]
            normal = t.normal[facets]
            axes = [np.broadcast_to(axis, normal.shape) for axis in np.eye(t.dimension)]
            for value, along in (
                (effect.normal, normal),
                *zip(effect.components, axes, strict=False),
            ):
                if value is not None:
                    held[facets] += along[:, :, None] * along[:, None]
                    prescribed = factor * _sampled(value, places[nodes])
                    apart = matvec(self.y[nodes], along) - prescribed
                    missed = max(missed, float(np.abs(apart).max(initial=0.0)))
                    largest = max(largest, float(np.abs(prescribed).max(initial=0.0)))
        if missed > ZERO_IN_SOLUTION * largest:
            raise refused("supports that prescribe different displacements where they meet")
        sizes, vectors = np.linalg.eigh(held)
        return np.einsum(
            "fik,fk,fjk->fij", vectors, np.where(sizes > SAME_LENGTH, 1.0, 0.0), vectors
        )

    def _contact(self, number: int, effect: Contact) -> FacetsInContact:
        """Return the facets of a contact with admissible tractions near the nodal ones."""
        t = self.t
        rows = self._rows
        d = self.t.dimension
        facets = self._facets(f"slave {number}")
        x = t.x[t.facets[facets]]
        pair = self._model.pairs.get(number)
        given_bound = getattr(effect.friction, "bound", 0.0)  # that of Tresca friction
        refuse_jumps(given_bound, x, "friction bound")
        bound = _from_inside(_sampled(given_bound, _inside(x)))
        gap = coefficients(
            _sampled(effect.gap_in(d), t.with_middles(t.x)[t.nodes_of_facets[facets]])
        )
        if pair is not None:
            parts = ContactParts.between(t, facets, self._facets(f"master {number}"))
            self._refuse_pair(float(pair.coupling.met), parts, acts=bool(bound.any()))
        else:
            towards = t.normal[facets]
            if effect.foundation is not None:
                towards = -effect.foundation.distance(x.mean(axis=1))[1]
            elif effect.direction is not None:
                direction = np.array(effect.direction[:d])
                towards = np.broadcast_to(direction / np.linalg.norm(direction), towards.shape)
            parts = ContactParts.on_foundation(t, facets, towards)
        points = np.flatnonzero(rows["contact of point"] == number)
        undivided = self._undivided(f"slave {number}")
        at = rows["point"][points]
        pressure = self._linear(undivided, at, rows["pressure"][points], positive=True)
        shear = self._linear(undivided, at, rows["shear"][points])
        order = np.argsort(facets)
        of_facets = order[np.searchsorted(facets, parts.facets[SLAVE], sorter=order)]
        normal = np.zeros((len(of_facets), d))
        normal[parts.row[SLAVE]] = parts.normal
        shear = shear[of_facets]
        bound = bound[of_facets].clip(min=0.0)
        shear = onto_disc(shear - np.einsum("fad,fd,fe->fae", shear, normal, normal), bound)
        gap = parts.restricted(gap[of_facets][parts.row[SLAVE]], SLAVE)
        if pair is not None and effect.distance == "geometry" and not effect.bonded:
            apart = self._away(parts)
            gap += np.concatenate((apart, apart[:, EDGES_OF_FACET[d]].mean(axis=2)), axis=1)
        surface = FacetsInContact(parts, gap, bound, pressure[of_facets].clip(min=0.0), shear, 1.0)
        if surface.paired:
            soft = [float(t.moduli.stiffest[t.sides[side, 0]].mean()) for side in parts.facets]
            surface.share = soft[MASTER] / (soft[SLAVE] + soft[MASTER])
        return surface

    def _linear(
        self, undivided: Ints, points: Array, values: Array, *, positive: bool = False
    ) -> Array:
        """Return linear functions at the vertices of facets from values at the points of a contact,
        shape (m, d, ...).
        """
        t = self.t
        given = self._given
        # Of this side alone: vertices of the other body may be at the same places.
        halved = len(t.x) > len(given.x)  # then the middles of edges are vertices, too
        nodes = (given.nodes_of_facets if halved else given.facets)[undivided]
        own = np.unique(nodes)
        nodal = np.zeros((len(t.x), *values.shape[1:]))
        nodal[own[cKDTree(t.x[own]).query(points)[1]]] = values
        tractions = nodal[nodes]
        if halved:
            tractions = np.einsum("ab,mb...->ma...", _LINEAR, tractions)
            if positive:  # with the resultant of each facet, of which a thin body takes notice
                cut = tractions.clip(min=0.0)
                share = tractions.sum(axis=1) / np.maximum(cut.sum(axis=1), np.finfo(float).tiny)
                tractions = cut * share.clip(0.0, 1.0)[:, None]
            tractions = np.einsum("hab,fb...->fha...", _ON_HALVES, tractions).reshape(
                -1, 2, *values.shape[1:]
            )
        return tractions

    def _away(self, parts: ContactParts) -> Array:
        """Return the distance of both sides along the normal at the vertices of the parts, length,
        shape (m, d).
        """
        x = [
            parts.local[side] @ self.t.x[self.t.facets[parts.facet(side)]]
            for side in (SLAVE, MASTER)
        ]
        return matvec(x[MASTER] - x[SLAVE], parts.normal)

    def _refuse_pair(self, covered: float, parts: ContactParts, *, acts: bool) -> None:
        """Refuse two sides for which the bound is not proved.

        Args:
            covered: area in which the solver couples both sides.
            parts: the parts of the contact.
            acts: whether the contact has friction.
        """
        if abs(float(parts.area.sum()) - covered) > SAME_LENGTH * covered or not covered > 0:
            raise refused("sides of two bodies that neither match nor are flat and parallel")
        if acts and np.abs(self._away(parts)).max() > SAME_LENGTH * float(
            np.ptp(self.t.x, axis=0).max()
        ):
            raise refused("friction of sides that are apart")


def _sampled(value: Value, x: Array) -> Array:
    """Return the values of a number or an expression at points, from shape (m, q, d) to (m, q)."""
    return sample(value, in_space(x.reshape(-1, x.shape[2]))).reshape(x.shape[:2])


def _inside(x: Array) -> Array:
    """Return points inside simplices, half-way from their centroids to their corners, shape (m, k,
    d).
    """
    return (x + x.mean(axis=1, keepdims=True)) / 2


def _from_inside(values: Array) -> Array:
    """Return values of linear functions at corners from those at points ``_inside``, shape (m, k,
    ...).
    """
    return 2 * values - values.mean(axis=1, keepdims=True)


def _density(load: ForceDensity, x: Array, normal: Array, mass: Array, area: float) -> Array:
    """Return the density of a load at the vertices of m cells or facets, as its limit from inside,
    shape (m, k, d).

    Args:
        load: the load.
        x: the vertices, shape (m, k, d).
        normal: normals of the facets, shape (m, d).
        mass: mass per volume, shape (m,).
        area: area of the boundary.
    """
    for value in load.given.values():
        refuse_jumps(value, x, load.label)
    each, d = x.shape[1:]
    places = _inside(x).reshape(-1, d).T
    across = np.repeat(normal, each, axis=0).T
    at = SampledPoints(
        places, across, lambda effect: area * float(effect.spread), np.repeat(mass, each)
    )
    return _from_inside(np.broadcast_to(load.density(at), places.shape).T.reshape(x.shape))


def _moduli(rows: Rows, d: int) -> Moduli:
    """Return the moduli of the cells of the mesh."""
    if "stiffness" not in rows:
        return Moduli.isotropic(rows["lame"], rows["mu"], d)
    stiffness = rows["stiffness"]
    return Moduli(stiffness * TWICE[d], np.linalg.inv(stiffness) / TWICE[d][:, None])
