"""A scene with its solution as plain arrays on triangles or tetrahedra: displacement, supports, contact."""

from __future__ import annotations

from dataclasses import dataclass

import basix
import numpy as np
from dolfinx import fem
from scipy.spatial import cKDTree

from signorini_fx.addons.bounds.applied_loads import LinearLoads, PlaneLoads
from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.bounded_scene import BoundPoints, grounds, moduli_of, refuse_unknown
from signorini_fx.addons.bounds.facets import NODES, POINTS, SEEN, bernstein, coefficients
from signorini_fx.addons.bounds.simplices import Simplices, divide
from signorini_fx.algebra.contact.points import pushed
from signorini_fx.machine import compat
from signorini_fx.mechanics.body.assembly import facet_entities
from signorini_fx.mechanics.body.contact_state import ContactState
from signorini_fx.mechanics.effects.contact import Contact
from signorini_fx.mechanics.effects.displacement import PrescribedDisplacement
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.effect import Force
from signorini_fx.quantities.statements import Grounds, Refused
from signorini_fx.tuned import SAME_LENGTH, ZERO_IN_SOLUTION

# Values at both ends and in the middle of the linear function whose moments with linear ones are those that Simpson's
# rule has from nodal values.
_LINEAR: Array = np.array([[4, 4, -2], [1, 4, 1], [-2, 4, 4]]) / 6


@dataclass
class FacetsInContact:
    """The facets of one contact.

    Attributes:
        facets: of the cells, shape (m,).
        normal: to the foundation, shape (m, d).
        gap: at ``POINTS``, and coefficients of Bernstein of a quadratic below it, lengths, shapes (m, q) and
            (m, 3 or 6).
        below: see ``gap``.
        bound: g at ``POINTS``, stress, shape (m, q).
        pressure: p at the vertices, stress, shape (m, d).
        shear: mu at the vertices, perpendicular to the normal, stress, shape (m, d, d).
        least: a linear function of which |mu| is at most, at the vertices, stress, shape (m, d).
        bilateral: whether the contact cannot open: then its facets are held along the normal, and ``pressure`` is zero.
        before: coefficients of Bernstein of the displacement from which slip counts, length, shape (m, 3 or 6, d); zero
            in the first load step.
    """

    facets: Ints
    normal: Array
    gap: Array
    below: Array
    bound: Array
    pressure: Array
    shear: Array
    least: Array
    before: Array
    bilateral: bool

    @property
    def traction(self) -> Array:
        """On the body at the vertices, stress, shape (m, d, d)."""
        return -self.pressure[:, :, None] * self.normal[:, None] - self.shear

    @property
    def tangents(self) -> list[Array]:
        """One in the plane, two in space, orthonormal, shapes (m, d)."""
        if self.normal.shape[1] == 2:
            return [np.column_stack((-self.normal[:, 1], self.normal[:, 0]))]
        first = np.cross(self.normal, np.eye(3)[np.abs(self.normal).argmin(axis=1)])
        first /= np.linalg.norm(first, axis=1)[:, None]
        return [first, np.asarray(np.cross(self.normal, first), dtype=np.float64)]


class PlainProblem:
    """A scene with its solution as plain arrays.

    Attributes:
        t: the cells; triangles of degree 2, and quadrilaterals, are divided.
        owner: the cell of the mesh that each of them is in, shape (n,).
        y: the displacement at vertices, and at the middles of edges, length, shapes (v, d) and (e, d).
        middle: see ``y``.
        held: projectors onto the directions in which facets are held, by supports and by contact that cannot open,
            shape (f, d, d).
        supported: those of supports alone.
        loads: what acts on the body.
        contacts: the contacts of the scene.
    """

    def __init__(
        self,
        d: Model,
        y: fem.Function,
        contact: ContactState | None,
        step: float,
        before: fem.Function | None = None,
    ) -> None:
        self._d, self._position, self._dimension = d, step, d.tagged.dimension
        self._statement = d.statement.placed(step)
        refuse_unknown(d)
        if contact is not None and pushed(contact.held_inside, d.tagged.size).any():
            raise Refused("supports push the body into its foundation")
        self._divide(y)
        self._before = self._begin_of_slip(contact, before)
        self.held: Array = np.zeros((len(self.t.facets), self._dimension, self._dimension))
        self._supports()
        self.supported = self._projectors()
        for effect in self._statement.contact:
            if not effect.opens:
                facets, normal = self._towards(effect)
                self.held[facets] += normal[:, :, None] * normal[:, None]
        self.held = self._projectors()
        acting = [self._statement.now(load, step) for load in self._statement.of(Force)]
        forces = [
            (factor, load, None if load.where is None else self._facets(load.where))
            for factor, load in acting
            if factor != 0
        ]
        self.loads = (PlaneLoads if self._dimension == 2 else LinearLoads)(self.t, self.held, forces)
        self.contacts = (
            []
            if contact is None
            else [self._contact(number, effect, contact) for number, effect in enumerate(self._statement.contact)]
        )

    @property
    def grounds(self) -> Grounds:
        """What all that is proved rests on."""
        return grounds(
            self._d,
            self._position,
            coulomb=self._d.statement.has_coulomb,
            later=self._before is not None,
            unknown=self.loads.unknown_share,
        )

    def _divide(self, y: fem.Function) -> None:
        """Simplices of the cells, with degree 2 four of each triangle, and the displacement on them."""
        mesh, dofs, d = self._d.tagged.mesh, y.function_space.dofmap.list, self._dimension
        used, cells = np.unique(np.asarray(compat.geometry_cells(mesh), dtype=np.int64), return_inverse=True)
        x, cells = np.asarray(mesh.geometry.x[:, :d], dtype=np.float64)[used], cells.reshape(len(dofs), -1)
        if mesh.topology.cell_name() == "quadrilateral":
            across = x[cells[:, 0]] - x[cells[:, 1]] - x[cells[:, 2]] + x[cells[:, 3]]
            if np.abs(across).max() > SAME_LENGTH * self._d.tagged.size:
                raise Refused("a guaranteed bound is for quadrilaterals that are parallelograms: use triangles")
            corners = np.concatenate((cells[:, [0, 1, 3]], cells[:, [0, 3, 2]]))
        else:
            corners = cells
        owner = np.arange(len(corners)) % len(cells)
        turned = np.linalg.det(x[corners][:, 1:] - x[corners][:, :1]) < 0
        corners = np.where(turned[:, None], corners[:, [*range(d - 1), d, d - 1]], corners)
        t = Simplices(x, corners, moduli_of(self._d, owner))
        local = basix.topology(getattr(basix.CellType, mesh.topology.cell_name()))
        self._corners_of_facets, self._cells, self._edges_of_cells = np.array(local[d - 1]), cells, np.array(local[1])
        self.owner, self._undivided, self._parts, self.t = owner, t, np.arange(len(t.facets))[:, None], t
        self.y, self.middle = self._on_cells(y)
        if d == 2 and self._degree_2(
            y
        ):  # the stress is linear: on four triangles it is as accurate as that of degree 2
            self.t, self.y, self.middle, self._parts = divide(t, self.y, self.middle)
            self.owner = np.tile(owner, 4)

    def _degree_2(self, y: fem.Function) -> bool:
        """Whether a displacement has unknowns at the middles of the edges of simplices."""
        return (
            len(self._undivided.corners) == len(self._cells) < y.function_space.dofmap.list.size / self._cells.shape[1]
        )

    def _on_cells(self, y: fem.Function) -> tuple[Array, Array]:
        """A displacement at the vertices of cells that are not divided, and at the middles of their edges."""
        t, cells, d = self._undivided, self._cells, self._dimension
        values = y.x.array.reshape(-1, d)[y.function_space.dofmap.list]
        at: Array = np.zeros((len(t.x), d))
        at[cells] = values[:, : cells.shape[1]]
        middle: Array = at[t.edges].mean(axis=1)

        def numbers(ends: Ints) -> Ints:
            """Of the edges between vertices."""
            return np.searchsorted(t.keys(t.edges), t.keys(np.sort(ends, axis=-1)))

        if len(t.corners) > len(cells):  # the middle of the diagonal is that of the quadrilateral
            middle[numbers(cells[:, [0, 3]])] = values.mean(axis=1)
        elif self._degree_2(y):
            middle[numbers(cells[:, self._edges_of_cells])] = values[:, d + 1 :]
        return at, middle

    def _begin_of_slip(self, contact: ContactState | None, before: fem.Function | None) -> tuple[Array, Array] | None:
        """The displacement from which slip counts at vertices and middles of edges; None: slip is all of it."""
        if contact is None or not contact.has_friction or np.array_equal(contact.slip_length, contact.u_t):
            return None
        if before is None:
            raise Refused("slip counts from the displacement of the load step before, which is not known")
        values = self._on_cells(before)
        return values if self.t is self._undivided else divide(self._undivided, *values)[1:3]

    @property
    def cells(self) -> int:
        """How many the mesh has."""
        return len(self._cells)

    def _facets(self, name: str) -> Ints:
        """The facets of a boundary, the parts of each facet of the mesh one after the other."""
        entities, t = facet_entities(self._d.tagged.mesh, self._d.tagged.facets(name)), self._undivided
        corners = np.take_along_axis(self._cells[entities[:, 0]], self._corners_of_facets[entities[:, 1]], axis=1)
        return self._parts[np.searchsorted(t.keys(t.facets), t.keys(np.sort(corners, axis=1)))].ravel()

    def on(self, facets: Ints, local: Array) -> BoundPoints:
        """Points on facets at barycentric places, with their normals."""
        x = np.einsum("qc,fcd->fqd", local, self.t.x[self.t.facets[facets]])
        return BoundPoints(x, np.broadcast_to(self.t.normal[facets][:, None], x.shape))

    def on_facets(self, y: Array, middle: Array, facets: Ints) -> Array:
        """Coefficients of Bernstein of a displacement of degree 2 on facets, length, shape (m, 3 or 6, d)."""
        nodal = np.concatenate((y[self.t.facets[facets]], middle[self.t.edges_of_facets[facets]]), axis=1)
        return coefficients(nodal)

    def _supports(self) -> None:
        """Directions in which facets are held; the displacement there is one that the elements hold."""
        statement, size, d = self._statement, np.abs(self.y).max(), self._dimension
        for entry in statement.of(PrescribedDisplacement):
            factor, effect = statement.now(entry, self._position)
            facets = self._facets(str(effect.boundary))
            points = self.on(facets, POINTS[d])
            displacement = bernstein(POINTS[d]) @ self.on_facets(self.y, self.middle, facets)
            rows = [(effect.normal, self.t.normal[facets])]
            rows += [(value, np.tile(np.eye(d)[k], (len(facets), 1))) for k, value in enumerate(effect.components[:d])]
            for value, direction in rows:
                if value is None:
                    continue
                component, prescribed = np.einsum("fqd,fd->fq", displacement, direction), factor * points.value(value)
                if np.abs(component - prescribed).max(initial=0.0) > ZERO_IN_SOLUTION * max(
                    size, np.abs(prescribed).max(initial=0.0)
                ):
                    raise Refused(f"the displacement of {effect.boundary!r} is no polynomial of the elements")
                self.held[facets] += direction[:, :, None] * direction[:, None]

    def _projectors(self) -> Array:
        """Onto the directions that are held at all."""
        sizes, vectors = np.linalg.eigh(self.held)
        return np.einsum("fik,fk,fjk->fij", vectors, np.where(sizes > SAME_LENGTH, 1.0, 0.0), vectors)

    def _towards(self, effect: Contact) -> tuple[Ints, Array]:
        """The facets of a contact, and unit vectors to its foundation, shape (m, d)."""
        facets, d = self._facets(effect.boundary), self._dimension
        if effect.direction is None:
            return facets, self.t.normal[facets]
        direction = np.array(effect.direction[:d])
        return facets, np.tile(direction / np.linalg.norm(direction), (len(facets), 1))

    def _contact(self, number: int, effect: Contact, contact: ContactState) -> FacetsInContact:
        """The facets of a contact, with admissible tractions near the nodal ones."""
        t, d, boundary, (facets, normal) = self.t, self._dimension, contact.boundary, self._towards(effect)
        fine = self.on(facets, SEEN[d]).value(effect.gap)
        below = coefficients(fine[:, NODES[d]])
        above = below @ bernstein(SEEN[d]).T - fine
        if effect.opens:
            below -= above.max(axis=1, initial=0.0)[:, None]
        elif np.abs(above).max(initial=0.0) > ZERO_IN_SOLUTION * np.abs(fine).max(initial=0.0):
            raise Refused(f"the gap of {effect.boundary!r}, which cannot open, is no polynomial of degree 2")
        rows = np.flatnonzero(boundary.part == number)
        near = cKDTree(t.x).query(boundary.x[rows][:, :d])[1]

        def linear(values: Array, *, positive: bool = False) -> Array:
            """Linear functions on the facets from values of contact points, which are zero where there is none; on
            divided ones with the moments of the nodal rule, or not negative with its resultants.
            """
            nodal = np.zeros((len(t.x), *values.shape[1:]))
            nodal[near] = values[rows]
            tractions = nodal[t.facets[facets]]
            if t.parts == 1:
                return np.asarray(tractions)
            # Each half of a facet ends with its middle, which has the higher number.
            together = np.concatenate((tractions[::2], tractions[1::2, :1]), axis=1)  # an end, the middle, an end
            together = np.einsum("ab,mb...->ma...", _LINEAR, together)
            if positive:  # with the resultant of each facet, of which a thin body takes notice
                cut = together.clip(min=0.0)
                share = together @ [0.25, 0.5, 0.25] / np.maximum(cut @ [0.25, 0.5, 0.25], np.finfo(float).tiny)
                together = cut * share.clip(0.0, 1.0)[:, None]
            return np.stack((together[:, :2], together[:, [2, 1]]), axis=1).reshape(tractions.shape)

        pressure, points = linear(contact.pressure, positive=True).clip(min=0.0), self.on(facets, POINTS[d])
        gap = points.value(effect.gap)
        if not effect.opens:
            pressure = np.zeros_like(pressure)
        if effect.coulomb:
            least = linear(contact.bound).clip(min=0.0)
            bounds = least @ POINTS[d].T
        else:
            given = effect.friction.given_bound if effect.friction.acts else 0.0
            bounds, seen = points.value(given), self.on(facets, SEEN[d]).value(given)
            least = seen[:, NODES[d][:d]]
            least = (least - (least @ SEEN[d].T - seen).max(axis=1, initial=0.0)[:, None]).clip(min=0.0)
        before = np.zeros((*below.shape, d)) if self._before is None else self.on_facets(*self._before, facets)
        none = np.zeros((*pressure.shape, d))
        surface = FacetsInContact(facets, normal, gap, below, bounds, pressure, none, least, before, not effect.opens)
        if d == 2:
            shear = linear(contact.shear) * surface.tangents[0][:, None]
        else:
            shear = linear(np.einsum("nij,nj->ni", boundary.tangents, contact.shear))
            shear -= np.einsum("fad,fd,fe->fae", shear, normal, normal)
        surface.shear = onto_disc(shear, least)
        return surface


def onto_disc(shear: Array, least: Array) -> Array:
    """The closest vectors of a size of at most ``least``, shape (..., d)."""
    size = np.linalg.norm(shear, axis=-1)
    share = np.divide(least, size, out=np.ones_like(size), where=size > least) * (1 - 2 * np.finfo(float).eps)
    return np.asarray(shear * share[..., None])
