"""The guaranteed bound of ``error_bound`` in space, on straight tetrahedra.

Tractions are linear on faces, so that p >= 0 and |mu| <= g hold everywhere where they hold at the vertices: both sets
are convex.  |v_t| is at most the quadratic with the sizes of the coefficients of Bernstein of v_t, for the same reason.
Loads that the stress does not hold are refused: the constants of Korn's inequality that are known for triangles are not
known here.
"""

from __future__ import annotations

import numpy as np

from signorini_fx.bounds.arrays import Array, Ints
from signorini_fx.bounds.bounded_error import (
    ROUND_OFF,
    SAME_LENGTH,
    UNBALANCED,
    ErrorBound,
    out,
    small_rests,
    work_of_loads,
)
from signorini_fx.bounds.bounded_scene import Refused
from signorini_fx.bounds.cell_pieces import free_motions, of_each_piece
from signorini_fx.bounds.linear_displacement import PrescribedComponents, smallest_energy
from signorini_fx.bounds.stress_in_space import SpatialEquilibratedStress, SpatialLoads, equilibrated
from signorini_fx.bounds.tetrahedra import FACES, TWICE, Tetrahedra
from signorini_fx.bounds.tetrahedral import (
    GAUSS,
    WEIGHTS,
    FacesInContact,
    ProblemInSpace,
    bernstein,
    coefficients,
    onto_disc,
)

# Share of the square of the bound below which what is moved does not count.
_LITTLE = 0.1
# Attempts to balance a body that supports do not hold.
_BALANCES = 200


class BoundedInSpace(ProblemInSpace):
    """A problem with what bounds its error."""

    def bound(self) -> ErrorBound:
        """The bound of the error."""
        t = self.t
        computed = t.strain_at_corners(self.y, self.middle)
        self._balance()
        stress = self._stress()
        between = square(t, from_strain(t, computed) - stress.stress)
        y, middle = self._admissible(np.zeros_like(self.y))
        contact, moved = self._added(y, middle, computed)
        if moved.sum() > _LITTLE * between.sum():
            # The first one is cheap; the second one is better where the regularisation lets many nodes enter.
            alternative = self._admissible(self._entered())
            added = self._added(*alternative, computed)
            if added[0].sum() + added[1].sum() < contact.sum() + moved.sum():
                (y, middle), (contact, moved) = alternative, added
        size = float(np.sqrt(energy(t, computed).sum()))
        round_off = stress.missing + ROUND_OFF * size
        squares = contact + between + moved
        total = float((np.sqrt(squares.sum()) + round_off) * (1 + ROUND_OFF * np.sqrt(len(t.corners))))
        work = None
        if not any(surface.bound.any() for surface in self.contacts):
            strain = t.strain_at_corners(y, middle)
            gap = float((contact + square(t, stress.stress - from_strain(t, strain))).sum())
            lowest = energy(t, strain).sum() / 2 - self.work(y, middle)
            work = work_of_loads(lowest, (np.sqrt(gap) + 2 * round_off) ** 2 / 2, size, total, len(t.corners))
        duality, displaced = (float(np.sqrt(part.sum())) for part in (contact + between, moved))
        return ErrorBound(total, size, duality, 0.0, displaced, round_off, squares, self.grounds, work)

    def _stress(self) -> SpatialEquilibratedStress:
        """In equilibrium with the loads and the tractions of the contacts."""
        t = self.t
        traction = self.traction.copy()
        for surface in self.contacts:
            traction[surface.faces] += surface.traction @ (np.eye(3) - self.held[surface.faces])
        # The linear functions on the faces with the moments of the displacement.
        bubble = (self.middle - self.y[t.edges].mean(axis=1))[t.edges_of_faces]
        start = self.y[t.faces] + 0.6 * (bubble.sum(axis=1, keepdims=True) - bubble) - 0.2 * bubble
        return equilibrated(t, self.held, SpatialLoads(self.body, traction), start)

    def _added(self, y: Array, middle: Array, computed: Array) -> tuple[Array, Array]:
        """What a displacement without penetration adds to the square of the bound by contact, and as it is not the
        computed one, energies, shapes (n,).
        """
        t = self.t
        contact = np.zeros(len(t.corners))
        for surface in self.contacts:
            np.add.at(contact, t.sides[surface.faces, 0], 2 * self._on_contact(surface, y, middle))
        return contact, energy(t, t.strain_at_corners(y, middle) - computed)

    def _on_contact(self, surface: FacesInContact, y: Array, middle: Array) -> Array:
        """Integrals of p (d - v_n) + g |v_t| - mu . v_t over the faces, energies, shape (m,)."""
        displacement = coefficients(self.nodal(y, middle, surface.faces))
        normal = np.einsum("fcd,fd->fc", displacement, surface.normal)
        tangential = displacement - normal[:, :, None] * surface.normal[:, None]
        values, linear = bernstein(GAUSS), GAUSS
        work = surface.pressure @ linear.T * (surface.gap - normal @ values.T).clip(min=0.0)
        slip = np.einsum("qc,fcd->fqd", values, tangential)
        size = np.linalg.norm(tangential, axis=2) @ values.T
        shear = np.einsum("qc,fcd->fqd", linear, surface.shear)
        work += (surface.bound * size - (shear * slip).sum(axis=2)).clip(min=0.0)
        return np.asarray(self.t.area[surface.faces] * (work @ WEIGHTS))

    def _balance(self) -> None:
        """Change pressures and shears of a body that supports do not hold so that they balance its loads."""
        t = self.t
        modes = free_motions(t, self.held).reshape(len(t.x), 3, -1)
        if not modes.shape[2]:
            return
        if not self.contacts:
            raise Refused("the body is not held")

        def moved(faces: Ints) -> Array:
            """Integrals of the modes times the hat functions of the vertices of faces, shape (m, 3, 3, k)."""
            corner_modes = modes[t.faces[faces]]
            return np.asarray(
                t.area[faces, None, None, None] / 12 * (corner_modes + corner_modes.sum(axis=1, keepdims=True))
            )

        all_faces = np.arange(len(t.faces))
        volume = t.volume[:, None, None]
        loads = np.einsum("nd,ndk->k", self.body, modes[t.corners].mean(axis=1) * volume)
        loads = loads + np.einsum("fad,fadk->k", self.traction, moved(all_faces))
        work = [moved(surface.faces) for surface in self.contacts]
        normal = [
            -np.einsum("fadk,fd->fak", part, surface.normal) for part, surface in zip(work, self.contacts, strict=True)
        ]
        across = [
            -(part + np.einsum("fak,fd->fadk", push, surface.normal))
            for part, push, surface in zip(work, normal, self.contacts, strict=True)
        ]
        pieces = of_each_piece(t, modes.reshape(t.x.size, -1))
        sizes = (
            np.abs(push * surface.pressure[:, :, None]).sum(axis=(0, 1))
            for push, surface in zip(normal, self.contacts, strict=True)
        )
        small = small_rests(loads, sum(sizes, np.zeros(loads.size)), pieces)
        for _, part in pieces:
            self._balance_piece(
                loads[part],
                [push[..., part] for push in normal],
                [pull[..., part] for pull in across],
                small[part].min(),
            )

    def _balance_piece(self, loads: Array, normal: list[Array], across: list[Array], small: float) -> None:
        """Change pressures and shears so that they balance the loads of a piece.

        Args:
            loads: their work on its free motions, force, shape (k,).
            normal: that of unit pressures at the vertices of the faces of each contact, shapes (m, 3, k).
            across: that of unit shears, shapes (m, 3, 3, k).
            small: what may be left of it, force.
        """
        t = self.t
        for _ in range(_BALANCES):
            residual, flexible = loads.copy(), np.zeros((loads.size, loads.size))
            for push, pull, surface in zip(normal, across, self.contacts, strict=True):
                residual += np.einsum("fak,fa->k", push, surface.pressure) + np.einsum(
                    "fadk,fad->k", pull, surface.shear
                )
                inside = np.linalg.norm(surface.shear, axis=2) < surface.least * (1 - SAME_LENGTH)
                flexible += np.einsum(
                    "fak,fal->kl", push / t.area[surface.faces, None, None], push * self._room(surface)
                )
                flexible += np.einsum(
                    "fadk,fadl->kl", pull / t.area[surface.faces, None, None, None], pull * inside[:, :, None, None]
                )
            if np.abs(residual).max() <= small:
                return
            step = np.linalg.lstsq(flexible, residual, rcond=1e-12)[0]
            for push, pull, surface in zip(normal, across, self.contacts, strict=True):
                area = t.area[surface.faces, None]
                inside = np.linalg.norm(surface.shear, axis=2) < surface.least * (1 - SAME_LENGTH)
                surface.pressure = (surface.pressure - self._room(surface)[:, :, 0] * (push @ step) / area).clip(
                    min=0.0
                )
                changed = surface.shear - inside[:, :, None] * (pull @ step) / area[:, :, None]
                surface.shear = onto_disc(changed, surface.least)
        raise Refused(UNBALANCED)

    @staticmethod
    def _room(surface: FacesInContact) -> Array:
        """1 where a pressure can become smaller and larger, shape (m, 3, 1)."""
        return (surface.pressure > 0)[:, :, None].astype(np.float64)

    def _free_at(self, parts: Ints, count: int) -> tuple[Array, Array]:
        """Sizes and directions of what holds vertices or edges, shapes (count, 3) and (count, 3, 3).

        Args:
            parts: those of each face, shape (f, 3).
            count: of all of them.
        """
        held = np.zeros((count, 3, 3))
        for k in range(3):
            np.add.at(held, parts[self.t.outer, k], self.held[self.t.outer])
        sizes, vectors = np.linalg.eigh(held)
        return sizes, vectors

    def _entered(self) -> Array:
        """Of least energy with what the vertices enter the foundation, and slip where they stick; zero at supports."""
        t, rows = self.t, [PrescribedComponents.of_facets(self.t.faces, self.held, np.zeros(3))]
        sizes, vectors = self._free_at(t.faces, len(t.x))
        for surface in self.contacts:
            first = np.cross(surface.normal, np.eye(3)[np.abs(surface.normal).argmin(axis=1)])
            first /= np.linalg.norm(first, axis=1)[:, None]
            across = (first, np.cross(surface.normal, first))
            for corner in range(3):
                vertex = t.faces[surface.faces, corner]
                depth = np.einsum("fd,fd->f", self.y[vertex], surface.normal) - surface.below[:, corner]
                sticks = np.linalg.norm(surface.shear[:, corner], axis=1) < (1 - SAME_LENGTH) * surface.least[:, corner]
                for selected, direction, value in (
                    (np.ones(len(vertex), dtype=bool), surface.normal, depth.clip(min=0.0)),
                    *((sticks, along, np.einsum("fd,fd->f", self.y[vertex], along)) for along in across),
                ):
                    axes, loose = vectors[vertex], sizes[vertex] <= SAME_LENGTH
                    free = np.einsum("fik,fk,fjk,fj->fi", axes, loose, axes, direction)
                    length = np.linalg.norm(free, axis=1)
                    selected = selected & (length > 0.5)
                    rows.append(
                        PrescribedComponents(
                            vertex[selected],
                            free[selected] / length[selected, None],
                            value[selected] / length[selected],
                        )
                    )
        constraints = PrescribedComponents.joined(*rows)
        displacement = smallest_energy(t, constraints)[0] if constraints.fixes(t) else np.zeros_like(self.y)
        return np.einsum("vik,vk,vjk,vj->vi", vectors, sizes <= SAME_LENGTH, vectors, displacement)

    def _admissible(self, removed: Array) -> tuple[Array, Array]:
        """The displacement without what it enters the foundation, at vertices and middles of edges.

        Args:
            removed: what is taken away from it before at the vertices, linear between them, length, shape (v, 3).
        """
        t = self.t
        y, middle = self.y - removed, self.middle - removed[t.edges].mean(axis=1)
        tiny = ROUND_OFF * (
            np.abs(y).max() + max((np.abs(surface.below).max() for surface in self.contacts), default=0.0)
        )
        unmoved = y.copy()
        for entities, columns in ((t.faces, (0, 1, 2)), (t.edges_of_faces, (3, 4, 5))):
            at_vertices = columns[0] == 0
            values = y if at_vertices else middle
            sizes, vectors = self._free_at(entities, len(values))
            free = np.einsum("vik,vk,vjk->vij", vectors, np.where(sizes > SAME_LENGTH, 0.0, 1.0), vectors)
            wanted: dict[int, list[tuple[Array, float]]] = {}
            for surface in self.contacts:
                excesses = (
                    np.einsum("fcd,fd->fc", coefficients(self.nodal(y, middle, surface.faces)), surface.normal)
                    - surface.below
                )
                for column in columns:
                    for k in np.flatnonzero(excesses[:, column] > -tiny):
                        # Twice the middle of an edge is what its coefficient of Bernstein has of it.
                        excess = float(excesses[k, column]) if at_vertices else float(excesses[k, column]) / 2
                        wanted.setdefault(int(entities[surface.faces[k], column % 3]), []).append(
                            (surface.normal[k], excess)
                        )
            for where, rows in wanted.items():
                normals, depths = np.array([row[0] for row in rows]), np.array([row[1] for row in rows])
                values[where] -= out(normals, depths + tiny, free[where], tiny)
            if at_vertices:
                middle += (y - unmoved)[t.edges].mean(axis=1)
        return y, middle


def from_strain(t: Tetrahedra, strain: Array) -> Array:
    """The stress on quarters at their corners, shape (n, 4, 4, 6), of linear strains at corners, shape (n, 4, 6)."""
    corner_stress = t.stress(strain)
    centre = np.repeat(corner_stress.mean(axis=1)[:, None, None], 4, axis=1)
    return np.concatenate((corner_stress[:, FACES], centre), axis=2)


def square(t: Tetrahedra, stress: Array) -> Array:
    """Squares of the norm of the complementary energy of stresses on quarters, by tetrahedron, energies."""
    strain = t.strain(stress) * TWICE
    sums = (stress * strain).sum(axis=(1, 2, 3)) + (stress.sum(axis=2) * strain.sum(axis=2)).sum(axis=(1, 2))
    return np.asarray(t.volume / 80 * sums).clip(min=0.0)


def energy(t: Tetrahedra, strain: Array) -> Array:
    """Squares of energy norms of linear strains at corners, by tetrahedron, energies."""
    stress = t.stress(strain) * TWICE
    sums = (stress * strain).sum(axis=(1, 2)) + (stress.sum(axis=1) * strain.sum(axis=1)).sum(axis=1)
    return np.asarray(t.volume / 20 * sums)
