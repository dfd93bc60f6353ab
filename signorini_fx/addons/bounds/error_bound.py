"""A guaranteed bound of the error of a displacement in the energy norm, for contact without or with
Tresca friction.

It is (B1) of docs/theory.md, the gap of the dual functionals (I. Ekeland and R. Temam, Convex
Analysis and Variational Problems), of which every part is local and not negative; between two
bodies it is (B2).  v is the finite element solution minus w, which removes its penetration; if the
solution itself is used in the first term only, the square of its error is at most the sum of (B1)
and |w|^2. tau is the stress of least complementary energy of ``equilibrated_stress``, with
tractions made of the nodal pressures; the loads and tractions that it cannot represent have
liftings with known norms.  docs/theory.md lists the assumptions.  With several ranks the first one
computes the bound of the whole body.

Tractions are linear on facets, so that p >= 0 and |mu| <= g hold everywhere if they hold at the
vertices: both sets are convex.  For the same reason |v_t| is at most the quadratic whose Bernstein
coefficients are the magnitudes of those of v_t.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from dolfinx import fem

from signorini_fx.addons.bounds.bounded_scene import refused, unbounded
from signorini_fx.addons.bounds.contact_displacement import admissible
from signorini_fx.addons.bounds.contact_parts import (
    MASTER,
    POINTS,
    SLAVE,
    WEIGHTS,
    bernstein,
    coefficients,
)
from signorini_fx.addons.bounds.equilibrated_stress import (
    AdmissibleTractions,
    EquilibratedStress,
    balanced,
    equilibrated,
)
from signorini_fx.addons.bounds.johnson_mercier import energy, from_strain, square
from signorini_fx.addons.bounds.liftings import Liftings, lifted_forces
from signorini_fx.addons.bounds.linear_displacement import free_motions
from signorini_fx.addons.bounds.plain_problem import (
    FacetsInContact,
    PlainProblem,
    Rows,
    on_first_rank,
)
from signorini_fx.addons.bounds.simplices import EPS, closest_linear, with_hats
from signorini_fx.algebra.contact.points import pushed
from signorini_fx.arrays import Array, matvec
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.model import Model
from signorini_fx.quantities.proved_statements import ErrorBound, Refused
from signorini_fx.tuned import PARTS_OF_EDGE

T = TypeVar("T")
# Share of displacements and forces below which they are round-off.
ROUND_OFF = 64 * EPS


@dataclass(frozen=True)
class Admissible:
    """A displacement v without penetration, with its contributions to the bound."""

    strain: Array  # at corners, shape (n, d + 1, 3 or 6)
    # its share of the gap of the functionals, twice, on the contact, energies, shape (n,)
    contact: Array
    moved: Array  # squares of the energy norm of its difference from the computed one, shape (n,)


def error_bound(
    model: Model, y: fem.Function, contact: ContactState | None, step: float = 0.0
) -> ErrorBound | str:
    """Return the bound for a solution, with the squares of the cells that this rank owns, or why
    there is none; collective.

    Args:
        model: the model.
        y: the displacement.
        contact: the contact points.
        step: position of the load step in the lists of factors.
    """
    bound = proved(model, y, contact, step, lambda problem: problem.bound())
    if isinstance(bound, str):
        return bound
    own = model.tagged.mesh.topology.index_map(model.tagged.dimension).local_range
    return replace(bound, squares=bound.squares[slice(*own)])


def proved(
    model: Model,
    y: fem.Function,
    contact: ContactState | None,
    step: float,
    prove: Callable[[Bounded], T],
    named: str | None = None,
) -> T | str:
    """Return the result of ``prove`` for a solution, on all ranks, or why there are no bounds;
    collective.

    Args:
        model: the model.
        y: the displacement.
        contact: the contact points.
        step: position of the load step in the lists of factors.
        prove: computes the result, which can be sent between ranks, on the first rank.
        named: a boundary whose facets it needs.
    """
    try:
        if names := list(unbounded(model)):
            raise refused(*names)
        outside = contact is not None and bool(pushed(contact.held_inside, model.tagged.size).any())
        if parallel.any_rank(model.comm, outside):
            raise Refused("supports push the body into its foundation")
        return on_first_rank(
            model, y, contact, lambda rows: prove(Bounded(rows, model, step)), named
        )
    except Refused as refusal:
        return str(refusal)


class Bounded(PlainProblem):
    """A problem with everything that its bounds need.

    Attributes:
        assumed: assumptions of the bound besides the data, in words.
    """

    def __init__(self, rows: Rows, model: Model, step: float) -> None:
        super().__init__(rows, model, step)
        # The mesh may stand for a body with arcs.
        self.assumed = (
            "of the body with the straight cells of the mesh" if model.statement.arcs else ""
        )
        self._balance()

    @cached_property
    def stress(self) -> EquilibratedStress:
        """The stress in equilibrium with the loads and the tractions of the contacts, except for
        the parts in ``lifted``.
        """
        t = self.t
        d = self.t.dimension
        traction = self.traction.copy()
        for surface in self.contacts:
            for side, sign in zip(surface.parts.sides, (1.0, -1.0), strict=False):
                facets = surface.parts.facets[side]
                closest, _ = surface.parts.projected(surface.traction, side, t.area)
                traction[facets] += sign * closest @ (np.eye(d) - self.held[facets])
        # The linear functions on the facets with the moments of the displacement.
        moments = POINTS[d].T @ (WEIGHTS[d][:, None] * bernstein(POINTS[d]))
        start = closest_linear(moments @ coefficients(self.y[t.nodes_of_facets]))
        return equilibrated(t, self.held, self.body_moments, traction, start)

    @cached_property
    def lifted(self) -> Array:
        """Bounds of the norms of the stresses that ``stress`` lacks in each cell, shape (n,): those
        of forces that are linear in the cell, and of tractions between facets that do not match.
        """
        t = self.t
        norms = lifted_forces(t, self.body)
        for surface in self.contacts:
            for side in surface.parts.sides:
                facets = surface.parts.facets[side]
                _, share = surface.parts.projected(surface.traction, side, t.area)
                rows = np.flatnonzero(share > ROUND_OFF)
                if not len(rows):
                    continue
                cells = t.sides[facets[rows], 0]
                opposite = (t.facets_of[cells] == facets[rows, None]).argmax(axis=1)
                apexes = t.x[t.corners[cells, opposite]]
                corners = np.concatenate((t.x[t.facets[facets[rows]]], apexes[:, None]), axis=1)
                liftings = Liftings.of(corners, t.moduli.of(cells), PARTS_OF_EDGE)
                pieces = liftings.facet.parts
                areas = t.area[facets[rows]]
                values = surface.parts.projected_on_pieces(
                    surface.traction, side, rows, pieces, areas
                )
                np.add.at(norms, cells, liftings.norms(*values))
        return norms

    @cached_property
    def admissible(self) -> Admissible:
        """The displacement v: the better one of two candidates."""
        far = np.abs(self.y).max() + max(
            (np.abs(surface.gap).max(initial=0.0) for surface in self.contacts), default=0
        )
        tiny = ROUND_OFF * float(far)
        tried = [
            self._beside(admissible(self, tiny, closed=closed))
            for closed in (False, bool(self.contacts))
        ]
        return min(tried, key=lambda one: float((one.contact + one.moved).sum()))

    def _beside(self, y: Array) -> Admissible:
        """Return a displacement without penetration with its contributions to the bound."""
        t = self.t
        contact = np.zeros(len(self.t.corners))
        strain = self.t.strain_at_corners(y)
        for surface in self.contacts:
            np.add.at(
                contact, t.sides[surface.parts.facet(SLAVE), 0], 2 * self._on_contact(surface, y)
            )
        return Admissible(strain, contact, energy(t, strain - self.strain))

    @cached_property
    def strain(self) -> Array:
        """The strain of the computed displacement at the corners, shape (n, d + 1, 3 or 6)."""
        return self.t.strain_at_corners(self.y)

    def between(self, strain: Array) -> Array:
        """Return the squared distance between the stress in equilibrium and the stress of a strain
        in each cell, energies, shape (n,).
        """
        apart = np.sqrt(square(self.t, from_strain(self.t, strain) - self.stress.stress))
        return (apart + self.lifted) ** 2

    @cached_property
    def size(self) -> float:
        """Energy norm of the computed displacement."""
        return float(np.sqrt(energy(self.t, self.strain).sum()))

    @cached_property
    def round_off(self) -> float:
        """Bound of the work of round-off in sums, per unit of the energy norm.

        Strains are sums of gradients times displacements of corners relative to the first one;
        gradients are known up to the condition of a cell, and no strain is larger than twice the
        slope of the displacement.
        """
        t = self.t
        d = self.t.dimension
        condition = np.linalg.norm(t.jacobian, axis=(1, 2)) * np.linalg.norm(
            t.gradients[:, 1:], axis=(1, 2)
        )
        apart = np.linalg.norm(self.y[t.corners] - self.y[t.corners[:, :1]], axis=2).max(axis=1)
        slopes = apart * np.linalg.norm(t.gradients, axis=2).sum(axis=1)
        turned = np.sqrt((t.volume * t.moduli.stiffest * ((1 + condition) * d * slopes) ** 2).sum())
        return float(
            self.stress.missing + ROUND_OFF * (turned + np.sqrt(len(t.corners)) * self.size)
        )

    @cached_property
    def gap(self) -> float:
        """Twice the gap of the functionals of v and the stress, an energy."""
        return float((self.admissible.contact + self.between(self.admissible.strain)).sum())

    @property
    def distance(self) -> float:
        """Bound of the energy norm A of v - u: A^2 + B^2 <= gap + 2 ``round_off`` A, where B is the
        distance of the stress.
        """
        return self.round_off + float(np.hypot(np.sqrt(self.gap), self.round_off))

    @property
    def radius(self) -> float:
        """Bound of the distance of the stress of the solution from the mean of the stress of v and
        the stress in equilibrium.
        """
        contact = float(self.admissible.contact.sum())
        return float(
            np.sqrt((self.gap - contact) / 4 + contact / 2 + self.round_off * self.distance)
        )

    def bound(self) -> ErrorBound:
        """Return the bound of the error."""
        of_duality = self.admissible.contact + self.between(self.strain)
        of_moved = self.admissible.moved
        duality = float(np.sqrt(of_duality.sum()))
        moved = float(np.sqrt(of_moved.sum()))
        squares = (of_duality + of_moved).reshape(-1, self.cells).sum(axis=0)
        total = float(np.hypot(duality, moved)) + self.round_off
        return ErrorBound(total, self.size, duality, moved, self.round_off, squares, self.assumed)

    def _on_contact(self, surface: FacetsInContact, y: Array) -> Array:
        """Return integrals of p (d - v_n) + g |v_t| - mu . v_t over the parts of a contact,
        energies, shape (m,).
        """
        d = self.t.dimension
        parts = surface.parts
        displacement = self.relative(surface, y)
        normal = matvec(displacement, parts.normal)
        tangential = displacement - normal[:, :, None] * parts.normal[:, None]
        values = bernstein(POINTS[d])
        linear = POINTS[d]

        def at_points(at_vertices: Array) -> Array:
            return np.einsum("qc,fc...->fq...", linear, parts.on_parts(at_vertices))

        pressure = at_points(surface.pressure)
        bound = at_points(surface.bound)
        shear = at_points(surface.shear)
        work = pressure * ((surface.gap - normal) @ values.T).clip(min=0.0)
        size = np.linalg.norm(tangential, axis=2) @ values.T
        work += (bound * size - (shear * (values @ tangential)).sum(axis=2)).clip(min=0.0)
        return parts.area * (work @ WEIGHTS[d])

    def _balance(self) -> None:
        """Change pressures and shears so that they balance the loads of bodies that supports do not
        hold.
        """
        t = self.t
        motions = free_motions(t, self.held)
        modes = motions.reshape(len(t.x), t.dimension, -1)
        if not modes.shape[2]:
            return
        if not self.contacts:
            raise Refused("the body is not held")
        loads = np.einsum("ncd,ncdk->k", self.body_moments, modes[t.corners])
        loads = loads + np.einsum("fad,fadk->k", self.traction, with_hats(modes[t.facets], t.area))
        contacts = []
        for surface in self.contacts:
            parts = surface.parts
            of_sides = [
                parts.on_parts(modes[t.facets[parts.facets[side]]], side) for side in parts.sides
            ]
            normal, across = surface.work(
                of_sides[SLAVE] - of_sides[MASTER] if surface.paired else of_sides[SLAVE]
            )
            contacts.append(
                AdmissibleTractions(
                    surface.pressure, surface.shear, surface.bound, normal, across, parts.covered()
                )
            )
        sizes = sum(
            np.abs(contact.normal * contact.pressure[:, :, None]).sum(axis=(0, 1))
            + np.abs(np.einsum("fadk,fad->fak", contact.across, contact.shear)).sum(axis=(0, 1))
            for contact in contacts
        )
        piece = t.piece_of_vertex[np.abs(motions).argmax(axis=0) // t.dimension]
        size = np.abs(loads) + sizes
        # A piece has its own scale, above the round-off of all pieces together.
        small = (
            ROUND_OFF * np.array([size[piece == number].max() for number in piece])
            + EPS * size.max()
        )
        for surface, (pressure, shear) in zip(
            self.contacts, balanced(loads, contacts, small), strict=True
        ):
            surface.pressure = pressure
            surface.shear = shear
