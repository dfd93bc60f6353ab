"""A guaranteed bound of the error of a displacement in the energy norm, for contact without or with Tresca friction.

Let v be a displacement that keeps to its supports and does not enter the foundation, and tau a symmetric stress in
equilibrium with the loads, with a pressure p >= 0 and a shear |mu| <= g on the contact boundary.  The squared distances
of v and tau from the solution, in the norms of the energy and of the complementary energy, add up to at most

    |C eps(v) - tau|^2 + 2 int p (d - v_n) + 2 int (g |v_t| - mu v_t),

of which every part is local and not negative (W. Prager and J. L. Synge, Quart. Appl. Math. 5 (1947) 241-269; for
contact the gap of the dual functionals, I. Ekeland and R. Temam, Convex Analysis and Variational Problems).  v is the
finite element solution without what it enters the foundation, w; with the solution itself in the first term only, the
square of its error is at most the sum above plus that of |w|.  tau the stress of least complementary energy of
``equilibrated_stress`` with tractions made of the nodal pressures.  What the stress does not hold of the loads enters
with explicit constants.  docs/theory.md lists what is assumed.  In the plane; ``error_bound_in_space`` has the same in
space.  Straight cells, one rank.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.bounds.arrays import Array
from signorini_fx.bounds.bounded_error import (
    ROUND_OFF,
    SAME_LENGTH,
    UNBALANCED,
    ErrorBound,
    out,
    small_rests,
    work_of_loads,
)
from signorini_fx.bounds.bounded_scene import Refused, refuse_unknown
from signorini_fx.bounds.cell_pieces import free_motions, of_each_piece
from signorini_fx.bounds.equilibrated_stress import Equilibration, PlaneEquilibratedStress, PlaneLoads
from signorini_fx.bounds.linear_displacement import PrescribedComponents, smallest_energy
from signorini_fx.bounds.stress_products import from_strain, square
from signorini_fx.bounds.triangles import GAUSS, Triangles
from signorini_fx.bounds.triangulated import FacetsInContact, TriangulatedProblem, on_bernstein, on_line, quadratic

# Share of the square of the bound below which what is moved does not count.
_LITTLE = 0.1
# Attempts to balance a body that supports do not hold.
_BALANCES = 200


@dataclass(frozen=True)
class Admissible:
    """A displacement that does not enter the foundation.

    Attributes:
        y: at vertices, and at the middles of edges, length, shapes (v, 2) and (e, 2).
        middle: see ``y``.
        strain: at corners, shape (n, 3, 3).
        contact: its share of the gap of the functionals on the contact, energy per thickness, shape (n,).
        moved: squares of the energy norm of its difference from the computed one, shape (n,).
    """

    y: Array
    middle: Array
    strain: Array
    contact: Array
    moved: Array

    @property
    def squares(self) -> Array:
        """What it adds to the square of the bound, shape (n,)."""
        return self.contact + self.moved


@dataclass(frozen=True)
class Enclosure:
    """A displacement without penetration and a stress in equilibrium, with what is known of the solution between them.

    Attributes:
        v: the displacement.
        duality: gap of the functionals with the strain of the computed displacement, energies, shape (n,).
        stress: in equilibrium.
        data: squares of the bounds of what the stress does not hold of the loads, shape (n,).
        energy: squares of the energy norm of the computed displacement, shape (n,).
        t: the triangles.
        inside: the triangles of the pieces that are looked at, each of which is a body of its own, shape (n,).
    """

    v: Admissible
    duality: Array
    stress: PlaneEquilibratedStress
    data: Array
    energy: Array
    t: Triangles
    inside: npt.NDArray[np.bool_]

    def of(self, inside: npt.NDArray[np.bool_]) -> Enclosure:
        """The same of some pieces.

        Args:
            inside: their triangles, shape (n,).
        """
        return replace(self, inside=inside)

    @cached_property
    def size(self) -> float:
        """Energy norm of the computed displacement."""
        return float(np.sqrt(self.energy[self.inside].sum()))

    @cached_property
    def round_off(self) -> float:
        """Bound of the work of what sums leave, per unit of the energy norm."""
        return float(np.sqrt(self.stress.squares[self.inside].sum())) + ROUND_OFF * self.size

    @cached_property
    def difference(self) -> Array:
        """The stress in equilibrium less that of the displacement, on thirds, shape (n, 3, 3, 3)."""
        return self.stress.stress - from_strain(self.t, self.v.strain)

    @cached_property
    def gap(self) -> float:
        """Of the functionals, twice, energy per thickness."""
        return float((self.v.contact + square(self.t, self.difference))[self.inside].sum())

    @property
    def missed(self) -> float:
        """Bound of the work of what is not in equilibrium with the loads per unit of the energy norm."""
        return float(np.sqrt(self.data[self.inside].sum())) + self.round_off

    @property
    def distance(self) -> float:
        """Bound of the energy norm of v - u: A^2 + B^2 <= gap + 2 missed A, where B is the distance of the stress."""
        return self.missed + float(np.hypot(np.sqrt(self.gap), self.missed))

    @property
    def radius(self) -> float:
        """Bound of the distance of the stress of the solution from the mean of both stresses."""
        contact = float(self.v.contact[self.inside].sum())
        return float(np.sqrt((self.gap - contact) / 4 + contact / 2 + self.missed * self.distance))


def error_bound(
    d: Discretisation, y: fem.Function, contact: ContactState | None, step: float = 0.0
) -> ErrorBound | str:
    """The bound for a solution; or why there is none.

    Args:
        d: the discretised scene.
        y: the displacement.
        contact: the contact nodes.
        step: the place of the load step in the lists of factors.
    """
    try:
        if d.tagged.dimension == 3:
            from signorini_fx.bounds.error_bound_in_space import BoundedInSpace

            return BoundedInSpace(d, y, contact, step).bound()
        return Bounded(d, y, contact, step).bound()
    except Refused as refused:
        return str(refused)


def refuse_unbounded(d: Discretisation) -> None:
    """Raise where there is no bound, whatever the solution is.

    Args:
        d: the discretised scene, whose stiffness need not be assembled.

    Raises:
        Refused: with the reason.
    """
    refuse_unknown(d)
    prescribed = fem.Function(d.space)
    prescribed.x.array[:] = sum(factor * load.prescribed.x.array for factor, load in d.applied_at(0.0))
    if d.tagged.dimension == 3:
        from signorini_fx.bounds.tetrahedral import ProblemInSpace

        ProblemInSpace(d, prescribed, None, 0.0)
    else:
        TriangulatedProblem(d, prescribed, None, 0.0)


class Bounded(TriangulatedProblem):
    """A problem with what bounds its error."""

    @cached_property
    def equilibration(self) -> Equilibration:
        """The system of its stresses."""
        return Equilibration(self.t, self.held)

    @cached_property
    def enclosure(self) -> Enclosure:
        """Displacement and stress that enclose the solution."""
        t = self.t
        computed = t.strain_at_corners(self.y, self.middle)
        self._balance()
        traction = self.traction.copy()
        for entry in self.contacts:
            free = np.eye(2) - self.held[entry.edges]
            traction[entry.edges] += np.einsum("eij,eaj->eai", free, entry.traction)
        bubble = 2 / 3 * (self.middle - self.y[t.edges].mean(axis=1))
        stress = self.equilibration.stress(
            PlaneLoads(self.body, traction, self.unknown), self.y[t.edges] + bubble[:, None]
        )
        between = square(t, from_strain(t, computed) - stress.stress)
        v = self._beside(self._admissible(np.zeros_like(self.y)), computed)
        if v.moved.sum() > _LITTLE * between.sum():
            # The first one is cheap; the second one is better where the regularisation lets many nodes enter.
            v = min(v, self._beside(self._admissible(self._entered()), computed), key=lambda entry: entry.squares.sum())
        all_triangles = np.ones(len(t.corners), dtype=bool)
        return Enclosure(v, v.contact + between, stress, self._data(), _energy(t, computed), t, all_triangles)

    def bound(self) -> ErrorBound:
        """The bound of the error."""
        t, enclosure = self.t, self.enclosure
        v, data = enclosure.v, enclosure.data
        duality, missed, moved = (float(np.sqrt(squares.sum())) for squares in (enclosure.duality, data, v.moved))
        total = (np.hypot(duality, moved) + missed + enclosure.round_off) * (1 + ROUND_OFF * np.sqrt(len(t.corners)))
        squares: Array = np.zeros(len(self.cells))
        np.add.at(squares, self.owner, enclosure.duality + data + v.moved)
        work = None
        if not any(surface.bound.any() for surface in self.contacts):
            above = (float(np.sqrt(enclosure.gap)) + 2 * enclosure.missed) ** 2 / 2
            energy = _energy(t, v.strain).sum() / 2 - self.work(v.y, v.middle)
            least, greatest = work_of_loads(energy, above, enclosure.size, total, len(t.corners))
            unknown = self.unknown_work(v.y, v.middle)
            work = least - unknown, greatest + unknown
        round_off = enclosure.round_off
        return ErrorBound(float(total), enclosure.size, duality, missed, moved, round_off, squares, self.grounds, work)

    def _data(self) -> Array:
        """Squares of the bounds of the work of what the stress does not hold of the loads, by triangle."""
        t = self.t
        outer = (t.sides[t.of_triangle] < 0).any(axis=2)
        missed = np.where(outer, self.missed_on_edges[t.of_triangle], 0.0)
        bounds = t.korn[0] * np.sqrt(self.missed_inside) + (t.on_edges(*t.korn) * np.sqrt(missed)).sum(axis=1)
        return np.asarray(bounds**2 / t.softest)

    def _on_contact(self, surface: FacetsInContact, y: Array, middle: Array) -> Array:
        """Integrals of p (d - v_n) + g |v_t| - mu v_t over the facets, energies per thickness, shape (m,)."""
        s, w = GAUSS
        edges, length = surface.edges, self.t.length[surface.edges]
        v = quadratic(y, middle, self.t.edges, edges, s)
        normal = np.einsum("fqd,fd->fq", v, surface.normal)
        slip = np.einsum("fqd,fd->fq", v, surface.tangent)
        work = on_line(surface.pressure, s) * (surface.gap - normal).clip(min=0.0)
        # Where the slip changes its sign its size is bounded by those of its coefficients of Bernstein.
        a, b = (np.einsum("fd,fd->f", y[self.t.edges[edges, k]], surface.tangent) for k in (0, 1))
        m = 2 * np.einsum("fd,fd->f", middle[edges], surface.tangent) - (a + b) / 2
        bernstein = np.column_stack((a, m, b))
        changes = (bernstein.min(axis=1) < 0) & (bernstein.max(axis=1) > 0)
        size = np.where(changes[:, None], on_bernstein(np.abs(bernstein), s), np.abs(slip))
        work += (surface.bound * size - on_line(surface.shear, s) * slip).clip(min=0.0)
        return np.asarray(length * (work @ w))

    def _balance(self) -> None:
        """Change pressures and shears of a body that supports do not hold so that they balance its loads."""
        t = self.t
        modes = free_motions(t, self.held).reshape(len(t.x), 2, -1)
        if not modes.shape[2]:
            return
        if not self.contacts:
            raise Refused("the body is not held")

        def work(traction: Array, edges: npt.NDArray[np.int64]) -> Array:
            """Of linear tractions (m, 2, 2) on the modes, shape (m, k)."""
            a, b = traction[:, 0], traction[:, 1]
            ends = np.stack((2 * a + b, a + 2 * b), axis=1) * t.length[edges, None, None] / 6
            return np.einsum("ead,eadk->ek", ends, modes[t.edges[edges]])

        loads = np.einsum("ncd,ncdk->k", self.body, modes[t.corners]) + work(
            self.traction, np.arange(len(t.edges))
        ).sum(axis=0)
        pieces = of_each_piece(t, modes.reshape(t.x.size, -1))
        rows, low, high, start, weight = [], [], [], [], []
        for surface in self.contacts:
            for end in (0, 1):
                for direction, least, greatest, current in (
                    (
                        surface.normal,
                        np.zeros(len(surface.edges)),
                        np.full(len(surface.edges), np.inf),
                        surface.pressure[:, end],
                    ),
                    (surface.tangent, -surface.least[:, end], surface.least[:, end], surface.shear[:, end]),
                ):
                    unit = np.zeros((len(surface.edges), 2, 2))
                    unit[:, end] = -direction
                    rows.append(work(unit, surface.edges))
                    low.append(least)
                    high.append(greatest)
                    start.append(current)
                    weight.append(1 / t.length[surface.edges])
        a, least, greatest = np.concatenate(rows), np.concatenate(low), np.concatenate(high)
        z, flexible = np.concatenate(start), np.concatenate(weight)
        small = small_rests(loads, np.abs(a * z[:, None]).sum(axis=0), pieces)
        for _, columns in pieces:
            for _ in range(_BALANCES):
                residual = loads[columns] + a[:, columns].T @ z
                if np.abs(residual).max() <= small[columns].min():
                    break
                room = np.minimum(z - least, greatest - z) > 0
                use = a[:, columns] * (flexible * room)[:, None]
                z = np.clip(z - use @ np.linalg.lstsq(use.T @ a[:, columns], residual, rcond=1e-12)[0], least, greatest)
            else:
                raise Refused(UNBALANCED)
        parts = iter(np.split(z, np.cumsum([len(part) for part in start])[:-1]))
        for surface in self.contacts:
            for end in (0, 1):
                surface.pressure[:, end], surface.shear[:, end] = next(parts), next(parts)

    def _beside(self, v: tuple[Array, Array], computed: Array) -> Admissible:
        """What a displacement without penetration adds to the bound, given the strain of the computed one."""
        t, strain = self.t, self.t.strain_at_corners(*v)
        contact = np.zeros(len(t.corners))
        for surface in self.contacts:
            np.add.at(contact, t.sides[surface.edges].max(axis=1), 2 * self._on_contact(surface, *v))
        return Admissible(*v, strain, contact, _energy(t, strain - computed))

    def _entered(self) -> Array:
        """Of least energy with what the vertices enter the foundation, and slip where they stick; zero at supports."""
        t, rows = self.t, [PrescribedComponents.of_facets(self.t.edges, self.held, np.zeros(2))]
        values, vectors = self._held_at_vertices()
        for surface in self.contacts:
            for end, column in ((0, 0), (1, 2)):
                vertex = t.edges[surface.edges, end]
                depth = np.einsum("fd,fd->f", self.y[vertex], surface.normal) - surface.below[:, column]
                slip = np.einsum("fd,fd->f", self.y[vertex], surface.tangent)
                sticks = np.abs(surface.shear[:, end]) < (1 - SAME_LENGTH) * surface.least[:, end]
                for selected, direction, value in (
                    (np.ones(len(vertex), dtype=bool), surface.normal, depth.clip(min=0.0)),
                    (sticks, surface.tangent, slip),
                ):
                    axes, loose = vectors[vertex], values[vertex] <= SAME_LENGTH
                    free = np.einsum("fik,fk,fjk,fj->fi", axes, loose, axes, direction)
                    size = np.linalg.norm(free, axis=1)
                    selected = selected & (size > 0.5)
                    rows.append(
                        PrescribedComponents(
                            vertex[selected], free[selected] / size[selected, None], value[selected] / size[selected]
                        )
                    )
        constraints = PrescribedComponents.joined(*rows)
        displacement = smallest_energy(t, constraints)[0] if constraints.fixes(t) else np.zeros_like(self.y)
        return np.einsum("vik,vk,vjk,vj->vi", vectors, values <= SAME_LENGTH, vectors, displacement)

    def _held_at_vertices(self) -> tuple[Array, Array]:
        """Sizes and directions of what holds the vertices, shapes (v, 2) and (v, 2, 2)."""
        held = np.zeros((len(self.t.x), 2, 2))
        for k in (0, 1):
            np.add.at(held, self.t.edges[self.t.outer, k], self.held[self.t.outer])
        values, vectors = np.linalg.eigh(held)
        return values, vectors

    def _admissible(self, removed: Array) -> tuple[Array, Array]:
        """The displacement without what it enters the foundation, at vertices and middles of edges.

        Args:
            removed: what is taken away from it before at the vertices, linear between them, length, shape (v, 2).
        """
        t = self.t
        y, middle = self.y - removed, self.middle - removed[self.t.edges].mean(axis=1)
        unmoved = y.copy()
        tiny = ROUND_OFF * (
            np.abs(y).max() + max((np.abs(surface.below).max() for surface in self.contacts), default=0.0)
        )
        values, vectors = self._held_at_vertices()
        free = np.einsum("vik,vk,vjk->vij", vectors, np.where(values > SAME_LENGTH, 0.0, 1.0), vectors)
        wanted: dict[int, list[tuple[Array, float]]] = {}
        for surface in self.contacts:
            for end, column in ((0, 0), (1, 2)):
                vertex = t.edges[surface.edges, end]
                excess = np.einsum("fd,fd->f", y[vertex], surface.normal) - surface.below[:, column]
                for k in np.flatnonzero(excess > -tiny):
                    wanted.setdefault(int(vertex[k]), []).append((surface.normal[k], float(excess[k]) + tiny))
        for vertex, rows in wanted.items():
            y[vertex] -= out(np.array([row[0] for row in rows]), np.array([row[1] for row in rows]), free[vertex], tiny)
        middle += (y - unmoved)[t.edges].mean(axis=1)
        for surface in self.contacts:
            a, b = (np.einsum("fd,fd->f", y[t.edges[surface.edges, k]], surface.normal) for k in (0, 1))
            m = np.einsum("fd,fd->f", middle[surface.edges], surface.normal)
            # Twice the middle of a parabola minus the mean of its ends is its second coefficient of Bernstein.
            excess = 2 * (m - surface.below[:, 1]) - (a + b - surface.below[:, 0] - surface.below[:, 2]) / 2
            for k in np.flatnonzero(excess > -tiny):
                edge = surface.edges[k]
                middle[edge] -= out(
                    surface.normal[k : k + 1], excess[k : k + 1] / 2 + tiny, np.eye(2) - self.held[edge], tiny
                )
        return y, middle


def _energy(t: Triangles, strain: Array) -> Array:
    """Squares of energy norms of linear strains at corners, by triangle."""
    total = strain.sum(axis=1)
    stress = t.stress(strain)
    return np.asarray(t.area / 12 * (_product(stress, strain).sum(axis=1) + _product(stress.sum(axis=1), total)))


def _product(stress: Array, strain: Array) -> Array:
    return np.asarray((stress * strain * [1.0, 1.0, 2.0]).sum(axis=-1))
