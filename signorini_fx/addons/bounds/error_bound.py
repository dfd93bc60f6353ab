"""A guaranteed bound of the error of a displacement in the energy norm, for contact without or with Tresca friction.

Let v be a displacement that keeps to its supports and does not enter the foundation, and tau a symmetric stress in
equilibrium with the loads, with a pressure p >= 0 and a shear |mu| <= g on the contact boundary.  The squared distances
of v and tau from the solution, in the norms of the energy and of the complementary energy, add up to at most

    |C eps(v) - tau|^2 + 2 int p (d - v_n) + 2 int (g |v_t| - mu v_t),

of which every part is local and not negative (W. Prager and J. L. Synge, Quart. Appl. Math. 5 (1947) 241-269; for
contact the gap of the dual functionals, I. Ekeland and R. Temam, Convex Analysis and Variational Problems); between two
bodies v_n and v_t are those of the jump, (B1) and (B2) of docs/theory.md; springs add (B11) of docs/bounds.md, those
whose stiffness varies (B14).  v is the finite element solution without what it enters the foundation, w; with the
solution itself in the first term only, the square of its error is at most the sum above plus that of |w|.  tau the
stress of least complementary energy of ``equilibrated_stress`` with tractions made of the nodal pressures.  What the
stress does not hold of the loads enters with explicit constants.  In a later load step v_t is the increment, whose
beginning is taken as computed.  docs/theory.md lists what is assumed.  Straight cells; of several ranks the first one
bounds the whole, see ``whole_problem``.

Tractions are linear on facets, so that p >= 0 and |mu| <= g hold everywhere where they hold at the vertices: both sets
are convex.  |v_t| is at most the quadratic with the sizes of the coefficients of Bernstein of v_t, for the same reason.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from dolfinx import fem
from scipy.sparse.csgraph import connected_components

from signorini_fx.addons.bounds.applied_loads import PlaneLoads, SpatialLoads
from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.balanced_tractions import AdmissibleTractions, balanced
from signorini_fx.addons.bounds.biquadratic_cells import StrainBeyond
from signorini_fx.addons.bounds.bounded_error import ROUND_OFF, out, small_rests, work_of_loads
from signorini_fx.addons.bounds.bounded_scene import (
    HELD_BY_VARYING_SPRINGS,
    LONG_FACETS,
    refuse_unknown,
    why_estimated,
)
from signorini_fx.addons.bounds.cell_pieces import free_motions, of_each_piece
from signorini_fx.addons.bounds.common_refinement import CommonRefinement
from signorini_fx.addons.bounds.equilibrated_stress import EquilibratedStress, Equilibration, Loads
from signorini_fx.addons.bounds.facets import POINTS, WEIGHTS, bernstein, cubic, times_linear
from signorini_fx.addons.bounds.graded_moduli import GradedModuli
from signorini_fx.addons.bounds.initial_stress import InitialStress, elastic_stress
from signorini_fx.addons.bounds.korn import work_beside_linear
from signorini_fx.addons.bounds.least_withdrawal import least_withdrawal
from signorini_fx.addons.bounds.lifted_tractions import Liftings, finest
from signorini_fx.addons.bounds.linear_displacement import PrescribedComponents, smallest_energy
from signorini_fx.addons.bounds.paired_parts import MASTER, SLAVE
from signorini_fx.addons.bounds.plain_scene import FacetsInContact, PlainProblem, turn
from signorini_fx.addons.bounds.preloaded_sections import LooseMotions, TightenedSection, loose_motions
from signorini_fx.addons.bounds.round_foundations import RoundFacets
from signorini_fx.addons.bounds.round_off import of_strains
from signorini_fx.addons.bounds.separated_bodies import Shut, separate, separate_unmatched
from signorini_fx.addons.bounds.simplices import EDGES_OF_FACET, Simplices, moments_of
from signorini_fx.addons.bounds.stress_products import energy, from_strain, product, square
from signorini_fx.addons.bounds.tightened_stress import TightenedStress
from signorini_fx.addons.bounds.whole_problem import WholeProblem, of_rank, of_whole
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.model import Model
from signorini_fx.quantities.proved_statements import ErrorBound, Refused
from signorini_fx.tuned import DIVISIONS, LITTLE_LIFTED, LITTLE_OF_BOUND, PARTS_OF_EDGE, SAME_LENGTH

# Times that bodies are moved out of foundations and each other.
_ATTEMPTS = 5
# Linear functions on a facet with the moments of 4 l_a l_b: at a and b, and at the third vertex.
_OF_BUBBLE = {2: (2 / 3, 0), 3: (3 / 5, -1 / 5)}


@dataclass(frozen=True)
class Admissible:
    """A displacement that does not enter the foundation.

    Attributes:
        y: at vertices, and at the middles of edges, length, shapes (v, d) and (e, d).
        middle: see ``y``.
        strain: at corners, shape (n, d + 1, 3 or 6).
        contact: its share of the gap of the functionals on the contact, energy, shape (n,).
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
        rounded: those of the round-off of the strains of both displacements, energies, shape (n,).
        energy: squares of the energy norm of the computed displacement, without initial strains, shape (n,).
        unknown: how far these are not known by quadrature of initial strains, energies, shape (n,).
        t: the cells.
        inside: the cells of the pieces that are looked at, each of which is a body of its own, shape (n,).
        lifted: bounds of the norms of the stresses that ``stress`` lacks of one in equilibrium, shape (n,), see
            ``Bounded._lifted``.
        misfit: what tau leaves of the forces of springs that v exerts, (B14) of docs/bounds.md, energies, shape (n,).
        initial: the stress that initial strains take from the body; None: there are none.
        grading: how moduli vary inside the cells; None: they do not.
    """

    v: Admissible
    duality: Array
    stress: EquilibratedStress
    data: Array
    rounded: Array
    energy: Array
    unknown: Array
    t: Simplices
    inside: npt.NDArray[np.bool_]
    lifted: Array
    misfit: Array
    initial: InitialStress | None = None
    grading: GradedModuli | None = None

    def of(self, inside: npt.NDArray[np.bool_]) -> Enclosure:
        """The same of some pieces.

        Args:
            inside: their cells, shape (n,).
        """
        return replace(self, inside=inside)

    @cached_property
    def size(self) -> float:
        """Energy norm of the computed displacement."""
        return float(np.sqrt(self.energy[self.inside].sum()))

    @cached_property
    def round_off(self) -> float:
        """Bound of the work of what sums leave, per unit of the energy norm."""
        sums = float(np.sqrt(self.stress.squares[self.inside].sum())) + ROUND_OFF * self.size
        sums += float(np.sqrt(self.rounded[self.inside].sum()))
        if (unknown := float(self.unknown[self.inside].sum())) > 0:
            sums += min(float(np.sqrt(unknown)), unknown / self.size if self.size > 0 else np.inf)
        return sums

    @cached_property
    def difference(self) -> Array:
        """The stress in equilibrium less that of the displacement, see ``LocalStress.stress``."""
        return self.stress.stress - elastic_stress(self.t, self.v.strain, self.initial)

    @cached_property
    def gap(self) -> float:
        """Of the functionals, twice, an energy."""
        if self.grading is not None:
            between = self.grading.square(from_strain(self.t, self.v.strain), self.stress.stress)
        elif self.initial is not None:
            between = square(self.t, self.difference) + self.initial.added(self.difference)
        else:
            between = square(self.t, self.difference)
        between = (np.sqrt(between.clip(min=0.0)) + self.lifted) ** 2
        return float((self.v.contact + between + self.misfit)[self.inside].sum())

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
    model: Model,
    y: fem.Function,
    contact: ContactState | None,
    step: float = 0.0,
    before: fem.Function | None = None,
) -> ErrorBound | str:
    """The bound for a solution, with the squares of the cells that this rank owns; or why there is none; collective.

    Args:
        model: the model.
        y: the displacement.
        contact: the contact nodes.
        step: the place of the load step in the lists of factors.
        before: the displacement of the load step before, from which slip counts; None: there is none.
    """

    def prove(problem: WholeProblem) -> ErrorBound:
        bound = Bounded(problem.model, problem.displacement, problem.contact, step, problem.before).bound()
        return replace(bound, squares=problem.by_ranks(bound.squares))

    try:
        bound = of_whole(model, y, contact, before, prove)
    except Refused as refused:
        return str(refused)
    return replace(bound, squares=of_rank(model, bound.squares))


def why_unbounded(model: Model) -> str:
    """Why there is no guaranteed bound, whatever the solution is; "": there may be one; collective.

    Args:
        model: the model, whose stiffness need not be assembled.
    """

    def prove(problem: WholeProblem) -> None:
        PlainProblem(problem.model, problem.displacement, None, last)

    try:
        refuse_unknown(model)
        prescribed, last = fem.Function(model.space), float(model.statement.steps - 1)
        prescribed.x.array[:] = sum(factor * load.prescribed.x.array for factor, load in model.applied_at(last))
        of_whole(model, prescribed, None, None, prove)
    except Refused as refused:
        return str(refused)
    why = why_estimated(model, last)
    return why and f"there is no guaranteed bound, as {why}"


class Bounded(PlainProblem):
    """A problem with what bounds its error."""

    @cached_property
    def equilibration(self) -> Equilibration:
        """The system of its stresses."""
        return Equilibration(self.t, self.held, self.springs)

    @property
    def tightened(self) -> list[TightenedSection]:
        """The sections that forces tighten."""
        return [] if self.jump is None else self.jump.tightened

    @cached_property
    def loose(self) -> LooseMotions:
        """What these let move."""
        return loose_motions(self.t, self.tightened, self.stopped)

    @cached_property
    def tensions(self) -> TightenedStress:
        """What changes the resultants of a stress on these."""
        least = 1.0 if self.grading is None else float(self.grading.least.min())
        return TightenedStress.of(self.t, self.tightened, self.loose, self.equilibration, least)

    @cached_property
    def _reaction(self) -> PlaneLoads | SpatialLoads | None:
        """What the stress holds of springs whose stiffness varies, under the computed displacement."""
        return self.reaction_of_springs(self.y, self.middle)

    @cached_property
    def enclosure(self) -> Enclosure:
        """Displacement and stress that enclose the solution."""
        t = self.t
        computed = self.strained(self.y, self.middle)
        self._balance()
        stress, (size, unknown) = self._stress(), self._energy(computed, self.beyond)
        in_springs, not_known = self._stored(self.y, self.middle)
        size, unknown = size + in_springs, unknown + not_known
        between = self._between(computed, stress)
        # Where the displacement is nearly exact, what is round-off need not be known better.
        lifted = self._lifted(float(np.sqrt(max(between.sum(), LITTLE_LIFTED**2 * size.sum()))))
        between = (np.sqrt(between) + lifted) ** 2 + self._misfit(stress, self.y, self.middle)
        v = self._outside(computed, float(between.sum()))
        # Another stress is worth its cost where pressures work on what is open, or say more than the displacement does.
        doubtful = v.contact.sum() > LITTLE_OF_BOUND * between.sum() or between.sum() > size.sum()
        if doubtful and self._may_press_less:
            share, stress, less = self._pressing_less(computed, stress, v)
            if share < 1:
                between, v = self._between(computed, stress), less
                again = self._outside(computed, float(between.sum()))
                v = min(v, again, key=lambda entry: entry.squares.sum())
        inside = np.ones(len(t.corners), dtype=bool)
        rounded = 2 * np.sqrt(of_strains(t, self.y, self.middle)) + np.sqrt(of_strains(t, v.y, v.middle))
        if self.jump is not None:
            rounded += 2 * np.sqrt(self.jump.rounded)
        if self.initial is not None:
            rounded += ROUND_OFF * np.sqrt(square(t, self.initial.stress))
        if self.grading is not None:
            rounded *= np.sqrt(self.grading.greatest)
        squares = v.contact + between
        return Enclosure(
            v,
            squares,
            stress,
            self._missed,
            rounded**2,
            size,
            unknown,
            t,
            inside,
            lifted,
            self._misfit(stress, v.y, v.middle),
            self.initial,
            self.grading,
        )

    def _stored(self, y: Array, middle: Array) -> tuple[Array, Array]:
        """Twice the energy of springs under a displacement, by cell, and how far it is not known, shapes (n,)."""
        squares, unknown = np.zeros((2, len(self.t.corners)))
        if self.springs is not None:
            reaction = self.springs.reaction(self.on_facets(y, middle, self.springs.facets))
            squares = self.springs.by_cell(self.springs.product(reaction, reaction), len(self.t.corners))
        if self.varying is not None:
            along = self.on_facets(y, middle, self.varying.facets)
            beyond, unknown = self.varying.product(along, along)
            squares = squares + beyond
        return squares, unknown

    def misfit_of_springs(self, stress: EquilibratedStress, y: Array, middle: Array) -> Array:
        """K v + t of a displacement v and the springs of a stress at ``POINTS``, stress, shape (m, q, d)."""
        assert self.springs is not None
        misfit = self.springs.reaction(self.on_facets(y, middle, self.springs.facets))
        return misfit if stress.of_springs is None else misfit + self.springs.at_points(stress.of_springs)

    def _misfit(self, stress: EquilibratedStress, y: Array, middle: Array) -> Array:
        """What a stress leaves of the forces of springs, see ``Enclosure``, shape (n,)."""
        squares: Array = np.zeros(len(self.t.corners))
        if self.springs is not None:
            misfit = self.misfit_of_springs(stress, y, middle)
            squares = self.springs.by_cell(self.springs.product(misfit, misfit), len(self.t.corners))
        if self.varying is not None:  # it holds what these exert under the computed displacement
            apart = self.on_facets(y - self.y, middle - self.middle, self.varying.facets)
            squares = np.add(squares, np.add(*self.varying.product(apart, apart)))
        return squares

    def _between(self, computed: Array, stress: EquilibratedStress) -> Array:
        """Squares of the distance of a stress from that of the computed displacement, energies, shape (n,)."""
        if self.grading is not None:
            return self.grading.square(from_strain(self.t, computed), stress.stress)
        elastic = elastic_stress(self.t, computed, self.initial)
        return np.add(*self._squares(elastic - stress.stress, self.beyond))

    def _squares(self, difference: Array, beyond: StrainBeyond | None) -> tuple[Array, Array]:
        """Squares of the norm of stresses that are linear on the parts of cells, with what a displacement is ``beyond``
        and initial strains miss, and how far they are not known, energies, shapes (n,).

        Args:
            difference: at the corners of the parts.
            beyond: of the displacement; None: nothing.
        """
        squares = square(self.t, difference)
        unknown: Array = np.zeros(len(difference))
        if beyond is not None:
            squares = squares + beyond.added(difference)
        if self.initial is not None:
            squares = squares + self.initial.missed
            unknown = 2 * self.initial.unknown_work(difference)
            if beyond is not None:
                unknown += 2 * np.sqrt(beyond.squares * self.initial.missed)
        return squares.clip(min=0.0), unknown

    def _energy(self, strain: Array, beyond: StrainBeyond | None) -> tuple[Array, Array]:
        """Squares of the energy norm of the strain of a displacement without initial ones, and how far they are not
        known, see ``_squares``.
        """
        if self.grading is not None:
            return self.grading.energy(from_strain(self.t, strain))
        elastic = elastic_stress(self.t, strain, self.initial)
        squares, unknown = self._squares(elastic, beyond)
        return squares if self.initial is None else squares + self.initial.prevented, unknown

    def _outside(self, computed: Array, between: float) -> Admissible:
        """The displacement without penetration that adds the least of those that are tried.

        Args:
            computed: strain of the computed displacement.
            between: square of the distance of the stress from that of it, an energy.
        """
        best = self._beside(self._admissible(np.zeros_like(self.y)), computed)

        def better(*tried: tuple[Array, Array]) -> Admissible:
            return min(best, *(self._beside(v, computed) for v in tried), key=lambda entry: entry.squares.sum())

        if self._pairs:
            best = better(*(self._admissible(np.zeros_like(self.y), shut=shut) for shut in list(Shut)[1:]))
        if best.squares.sum() > LITTLE_OF_BOUND * between:
            # The first one is cheap; the second one is better where the regularisation lets many nodes enter, the last
            # one where a foundation enters facets between their nodes.
            best = better(self._admissible(self._entered()))
            withdrawn = self._withdrawn()
            if withdrawn is not None:
                best = better(self._admissible(*withdrawn))
        return best

    @property
    def _may_press_less(self) -> bool:
        """Whether the body is in equilibrium with any share of its contact tractions, and these act on nothing else."""
        free = free_motions(self.t, self.held).size + self.loose.piece.size
        return not (self._pairs or self.tools or self.sprung or free)

    def _pressing_less(
        self, computed: Array, stress: EquilibratedStress, v: Admissible
    ) -> tuple[float, EquilibratedStress, Admissible]:
        """The share of the contact tractions with the least sum of both parts of the gap, its stress, and what v adds.

        The stress is an affine function of the tractions.  Nodal pressures may act far from where v touches: on facets
        that are long beside the radius of a foundation they do much work on what is open.
        """
        full = [(surface.pressure, surface.shear) for surface in self.contacts]

        def scale(share: float) -> None:
            for surface, (pressure, shear) in zip(self.contacts, full, strict=True):
                surface.pressure, surface.shear = share * pressure, share * shear

        scale(0.0)
        without, without_contact = self._stress(), self._beside((v.y, v.middle), computed).contact.sum()
        change = stress.stress - without.stress
        rest = elastic_stress(self.t, computed, self.initial) - without.stress
        slope, bend = product(self.t, change, rest).sum(), square(self.t, change).sum()
        wanted = slope - (v.contact.sum() - without_contact) / 2
        share = float(np.clip(wanted / bend, 0.0, 1.0)) if bend > 0 else 1.0
        scale(share)
        mixed = EquilibratedStress(
            without.stress + share * change,
            without.tractions + share * (stress.tractions - without.tractions),
            (share * np.sqrt(stress.squares) + (1 - share) * np.sqrt(without.squares)) ** 2,
        )
        return share, mixed, self._beside((v.y, v.middle), computed)

    def bound(self) -> ErrorBound:
        """The bound of the error."""
        t, enclosure = self.t, self.enclosure
        v, data = enclosure.v, enclosure.data
        duality, missed, moved = (float(np.sqrt(squares.sum())) for squares in (enclosure.duality, data, v.moved))
        if (further := self.interpolated) > 0:  # (B3) of docs/theory.md: counted as a part of what is moved
            moved = float(np.sqrt(moved**2 + further * (2 * np.sqrt(duality**2 + moved**2) + further)))
        total = (np.hypot(duality, moved) + missed + enclosure.round_off) * (1 + ROUND_OFF * np.sqrt(len(t.corners)))
        squares: Array = np.zeros(self.cells)
        np.add.at(squares, self.owner, enclosure.duality + data + v.moved)
        work = None
        if not (self.tools or self.tightened or any(surface.bound.any() for surface in self.contacts)):
            above = (float(np.sqrt(enclosure.gap)) + 2 * enclosure.missed) ** 2 / 2
            strained, strain_unknown = self._energy(v.strain, None)
            stored, stored_unknown = self._stored(v.y, v.middle)
            worked, unknown = self.loads.work(v.y, v.middle), self.loads.unknown_work(v.y, v.middle)
            for section in [] if self.jump is None else self.jump.moved:
                worked += self.loads.work(section.y, section.middle, section.cells)
                unknown += self.loads.unknown_work(section.y, section.middle, section.cells)
            functional = (strained + stored).sum() / 2 - worked
            least, greatest = work_of_loads(functional, above, enclosure.size, total, len(t.corners))
            unknown += float((strain_unknown + stored_unknown).sum()) / 2
            work = least - unknown, greatest + unknown
        round_off, size = enclosure.round_off, enclosure.size
        in_springs = float(self._stored(self.y, self.middle)[0].sum())
        alone = float(np.sqrt(max(size**2 - in_springs, 0.0))) if self.sprung else None
        return ErrorBound(float(total), size, duality, missed, moved, round_off, squares, self.grounds, work, alone)

    @property
    def _missed(self) -> Array:
        """Squares of bounds of the work of what the stress does not hold of loads and contact, see ``PlaneLoads``."""
        norms = np.zeros(len(self.t.facets))
        for surface in self.contacts:
            norms[surface.facets] += np.sqrt(self.t.area[surface.facets] * surface.missed)
        missed = self.loads.missed_beside(norms)
        if (reaction := self._reaction) is not None:
            missed = (np.sqrt(missed) + np.sqrt(reaction.missed_beside(np.zeros_like(norms)))) ** 2
        return missed if self.grading is None else missed / self.grading.least

    def _lifted(self, size: float) -> Array:
        """Bounds of the norms of the stresses in each cell, shape (n,), that the tractions between facets which do not
        match have beyond those of ``_stress``.

        Args:
            size: norm beside which they count.
        """
        t, norms = self.t, np.zeros(len(self.t.corners))
        for surface, refined in self._unmatched:
            for side in (SLAVE, MASTER):
                faces = refined.facets[side]
                cells = t.sides[faces, 0]
                _, squares = refined.projected(surface.traction, side, t.area)
                bounds = work_beside_linear(t, faces, squares) / np.sqrt(t.moduli.softest[cells])
                order = np.argsort(bounds)
                small = np.sqrt(np.cumsum(bounds[order] ** 2)) <= LITTLE_LIFTED * size
                rows = order[~small]
                if len(rows):
                    corners = np.concatenate((t.x[t.facets[faces]], self._apexes(faces)[:, None]), axis=1)[rows]
                    liftings = Liftings.of(corners, t.moduli.of(cells[rows]), PARTS_OF_EDGE)
                    parts = finest(liftings.face, DIVISIONS)
                    lifted = liftings.norms(
                        *refined.projected_on_parts(surface.traction, side, rows, parts, t.area[faces[rows]])
                    )
                    bounds[rows] = np.minimum(bounds[rows], lifted)
                np.add.at(norms, cells, bounds)
        return norms if self.grading is None else norms / np.sqrt(self.grading.least)

    def _apexes(self, faces: Ints) -> Array:
        """Of the cells at faces the corners opposite these, length, shape (m, 3)."""
        t, cells = self.t, self.t.sides[faces, 0]
        opposite = (t.facets_of[cells] == faces[:, None]).argmax(axis=1)
        return np.asarray(t.x[t.corners[cells, opposite]])

    def _stress(self) -> EquilibratedStress:
        """In equilibrium with the loads and the tractions of the contacts."""
        t, d, acting = self.t, self.t.dimension, self.loads.acting
        traction, not_known = acting.traction.copy(), acting.unknown
        if self._reaction is not None:
            of_springs = self._reaction.acting
            traction, not_known = traction + of_springs.traction, not_known + of_springs.unknown
        for surface, refined in self._unmatched:
            for side, sign in ((SLAVE, 1.0), (MASTER, -1.0)):
                faces = refined.facets[side]
                closest, _ = refined.projected(surface.traction, side, t.area)
                traction[faces] += sign * closest @ (np.eye(d) - self.held[faces])
        for surface in self.contacts:
            if surface.refined is not None:
                continue
            traction[surface.facets] += surface.traction @ (np.eye(d) - self.held[surface.facets])
            if (opposite := surface.opposite) is not None:  # the same force on as much of the other body
                back = -opposite.under(surface.traction) * opposite.ratio[:, None, None]
                traction[opposite.facets] += back @ (np.eye(d) - self.held[opposite.facets])
        # The linear functions on the facets with the moments of the displacement.
        start, bubble = self.y[t.facets], (self.middle - self.y[t.edges].mean(axis=1))[t.edges_of_facets]
        (ends, third), start = _OF_BUBBLE[d], start + _OF_BUBBLE[d][1] * bubble.sum(axis=1, keepdims=True)
        for k, pair in enumerate(EDGES_OF_FACET[d]):
            start[:, pair] += (ends - third) * bubble[:, k, None]
        initial = None if self.initial is None else self.initial.stress
        if self.jump is not None:  # the stress is to be near that of the displacement with its jumps
            of_jump = from_strain(t, self.jump.strain)
            initial = -of_jump if initial is None else initial - of_jump
        loads = Loads(acting.body, traction, not_known, initial)
        stress = self.equilibrated(loads, start)
        if not self.tightened:
            return stress
        forces = np.array([section.force for section in self.tightened])
        return self.tensions.with_tensions(stress, forces + self.tensions.work(loads))

    def equilibrated(self, loads: Loads, prescribed: Array) -> EquilibratedStress:
        """A stress in equilibrium, see ``Equilibration.stress``, with work per unit of the energy norm of the body."""
        stress = self.equilibration.stress(loads, prescribed)
        return stress if self.grading is None else replace(stress, squares=stress.squares / self.grading.least)

    def _on_contact(self, surface: FacetsInContact, y: Array, middle: Array) -> Array:
        """Integrals of p (d - v_n) + g |v_t| - mu . v_t over the facets, energies, shape (m,)."""
        d = self.t.dimension
        displacement = self.relative(surface, y, middle)
        if surface.round is not None:
            return self._on_round_contact(surface, surface.round, displacement)
        normal = np.einsum("fcd,fd->fc", displacement, surface.normal)
        slip = displacement - surface.before
        tangential = slip - np.einsum("fcd,fd,fe->fce", slip, surface.normal, surface.normal)
        values, linear = bernstein(POINTS[d]), POINTS[d]
        open_by = surface.gap - normal @ values.T
        if surface.bilateral:  # zero but for round-off
            work = np.abs(surface.pressure @ linear.T) * np.abs(open_by)
        else:
            work = surface.pressure @ linear.T * open_by.clip(min=0.0)
        size = np.linalg.norm(tangential, axis=2) @ values.T
        shear = np.einsum("qc,fcd->fqd", linear, surface.shear)
        bound = np.linalg.norm(shear, axis=2) if surface.bonded else surface.bound
        work += (bound * size - (shear * (values @ tangential)).sum(axis=2)).clip(min=0.0)
        return np.asarray(surface.area(self.t.area) * (work @ WEIGHTS[d]))

    def _on_round_contact(self, surface: FacetsInContact, foundation: RoundFacets, displacement: Array) -> Array:
        """The same of a round foundation, see ``round_foundations``.

        Args:
            surface: the contact.
            foundation: of it.
            displacement: coefficients of Bernstein, length, shape (m, 3 or 6, d).
        """
        d, carries = self.t.dimension, surface.pressure.any(axis=1) | surface.bound.any(axis=1)
        if (carries & ~foundation.short).any():
            raise Refused(LONG_FACETS)
        linear, values = POINTS[d], bernstein(POINTS[d]) @ displacement
        open_by = surface.gap - np.einsum("fqd,fqd->fq", linear @ foundation.direction, values)
        work = surface.pressure @ linear.T * open_by.clip(min=0.0)
        missed = surface.pressure.max(axis=1) * foundation.missed_gap
        if d == 2:
            turned = turn(foundation.direction)
            along = times_linear(turned, displacement - surface.before)
            size = np.abs(along) @ cubic(linear).T
            shear = np.einsum("fad,fad->fa", surface.shear, turned) / (turned**2).sum(axis=2)
            slip = surface.bound * size * foundation.stretch - shear @ linear.T * (along @ cubic(linear).T)
            work += slip.clip(min=0.0)
            # A linear bound is at an end at most as much larger as the outermost point is inside.
            largest = surface.bound.max(axis=1) / linear.max()
            missed += largest * np.abs(along).max(axis=1) * foundation.missed_stretch
        return np.asarray(self.t.area[surface.facets] * (work @ WEIGHTS[d] + missed))

    def _balance(self) -> None:
        """Change pressures and shears so that they balance the loads of bodies that supports do not hold, and of tools
        that forces move.
        """
        t = self.t
        modes = free_motions(t, self.stopped).reshape(len(t.x), t.dimension, -1)
        of_bodies, of_tools, loose = modes.shape[2], sum(len(tool.free) for tool in self.tools), self.loose
        if not of_bodies + of_tools + loose.piece.size:
            return
        if not self.contacts:
            raise Refused("the body is not held" if self.varying is None else HELD_BY_VARYING_SPRINGS)

        def on(facets: Ints) -> Array:
            """Free motions at the vertices of facets of the boundary, shape (m, d, d, k)."""
            return np.concatenate((modes[t.facets[facets]], loose.on_facets(t, facets)), axis=3)

        motions_of_facets = np.zeros((len(t.facets), t.dimension, t.dimension, of_bodies + loose.piece.size))
        motions_of_facets[t.outer] = on(t.outer)
        moments = moments_of(t, motions_of_facets)
        corners = np.concatenate((modes[t.corners], loose.corners), axis=3)
        loads = np.einsum("ncd,ncdk->k", self.loads.body, corners)
        loads = loads + np.einsum("fad,fadk->k", self.loads.traction, moments)
        if self._reaction is not None:
            loads = loads + np.einsum("fad,fadk->k", self._reaction.traction, moments)
        loads[of_bodies:] += np.array([section.force for section in self.tightened]) @ loose.closing
        loads = np.concatenate((loads, *(tool.force for tool in self.tools)))
        contacts = []
        for number, surface in enumerate(self.contacts):
            refined, opposite = surface.refined, surface.opposite
            if refined is not None:
                of_slave, of_master = (refined.on_triangles(on(refined.facets[side]), side) for side in (SLAVE, MASTER))
                motions = of_slave - of_master
            else:
                motions = on(surface.facets)
                if opposite is not None:
                    motions = motions - opposite.over(on(opposite.facets))
            x = t.x[t.facets[surface.facets]]  # what it has of a tool's motion, it has not of the body's
            of_each = (-float(number in tool.parts) * tool.modes(x)[..., tool.free] for tool in self.tools)
            normal, across = surface.work(t.area, np.concatenate((motions, *of_each), axis=3))
            linear, area = surface.on_whole or surface, surface.area(t.area)
            if refined is not None:
                normal, across, area = refined.moments(normal), refined.moments(across), refined.covered()
            count = normal.shape[1]  # of vertices with tractions of their own
            contacts.append(
                AdmissibleTractions(
                    linear.pressure[:, :count],
                    linear.shear[:, :count],
                    linear.least[:, :count],
                    -np.inf if surface.bilateral else 0.0,
                    normal,
                    across,
                    area,
                )
            )
        pieces, first = of_each_piece(t, modes.reshape(t.x.size, -1)), of_bodies + loose.piece.size
        pieces += [(int(piece), np.array([of_bodies + k])) for k, piece in enumerate(loose.piece)]
        for tool in self.tools:
            pieces.append((-1, np.arange(first, first := first + len(tool.free))))
        sizes = (
            np.abs(contact.normal * contact.pressure[:, :, None]).sum(axis=(0, 1))
            + np.abs(np.einsum("fadk,fad->fak", contact.across, contact.shear)).sum(axis=(0, 1))
            for contact in contacts
        )
        small = small_rests(loads, sum(sizes, np.zeros(loads.size)), pieces)
        # Tools join the bodies that they touch: all of them are balanced together.
        group = self.group_of_piece * (not self.tools)
        for number in np.unique([group[piece] for piece, _ in pieces]):
            together = [columns for piece, columns in pieces if group[piece] == number]
            part = np.concatenate(together)
            rests = np.concatenate([np.full(len(columns), small[columns].min()) for columns in together])
            of_group = [
                replace(contact, normal=contact.normal[..., part], across=contact.across[..., part])
                for contact in contacts
            ]
            for surface, contact, (pressure, shear) in zip(
                self.contacts, contacts, balanced(loads[part], of_group, rests), strict=True
            ):
                contact.pressure, contact.shear = pressure, shear
                surface.press(pressure, shear)

    def _free_at(self, parts: Ints, count: int, projectors: Array) -> tuple[Array, Array]:
        """Sizes and directions of what holds vertices or edges, shapes (count, d) and (count, d, d).

        Args:
            parts: those of each facet, shape (f, k).
            count: of all of them.
            projectors: onto the directions in which facets are held, shape (f, d, d).
        """
        held = np.zeros((count, *projectors.shape[1:]))
        for k in range(parts.shape[1]):
            np.add.at(held, parts[self.t.outer, k], projectors[self.t.outer])
        sizes, vectors = np.linalg.eigh(held)
        return sizes, vectors

    def _beside(self, v: tuple[Array, Array], computed: Array) -> Admissible:
        """What a displacement without penetration adds to the bound, given the strain of the computed one."""
        t, strain = self.t, self.strained(*v)
        contact = np.zeros(len(t.corners))
        for surface in self.contacts:
            np.add.at(contact, t.sides[surface.facets, 0], 2 * self._on_contact(surface, *v))
        moved = energy(t, strain - computed)
        if self.grading is not None:
            moved = moved * self.grading.greatest
        if self.beyond is not None:
            moved = (moved + self.beyond.added(from_strain(t, computed - strain))).clip(min=0.0)
        moved = moved + np.add(*self._stored(v[0] - self.y, v[1] - self.middle))
        return Admissible(*v, strain, contact, moved)

    def _entered(self) -> Array:
        """Of least energy with what the vertices enter the foundation, and slip where they stick; zero at supports."""
        t, rows = self.t, [PrescribedComponents.of_facets(self.t.facets, self.held, np.zeros(self.t.dimension))]
        sizes, vectors = self._free_at(t.facets, len(t.x), self.held)
        for surface in self._on_foundations:
            for corner in range(t.dimension):
                vertex = t.facets[surface.facets, corner]
                towards = surface.directions[:, corner]
                depth = np.einsum("fd,fd->f", self.y[vertex], towards) - surface.below[:, corner]
                slip = self.y[vertex] - surface.before[:, corner]
                sticks = np.linalg.norm(surface.shear[:, corner], axis=1) < (1 - SAME_LENGTH) * surface.least[:, corner]
                for selected, direction, value in (
                    (np.ones(len(vertex), dtype=bool), towards, depth.clip(min=0.0)),
                    *((sticks, along, np.einsum("fd,fd->f", slip, along)) for along in surface.tangents),
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

    def _withdrawn(self) -> tuple[Array, Array] | None:
        """What is taken from the displacement with the least share in the bound, see ``least_withdrawal``; None: no
        foundation may be left.
        """
        surfaces = [surface for surface in self._on_foundations if not surface.bilateral]
        surfaces += [surface for surface, _ in self._unmatched]
        if not surfaces:
            return None
        t = self.t
        excess = [surface.excess(self.relative(surface, self.y, self.middle)) for surface in surfaces]
        entities = self._entities(self.y, self.middle)
        free = [self._free_at(parts, len(values), self.held) for parts, values in entities]
        return least_withdrawal(t, surfaces, excess, (free[0], free[1]))

    def _admissible(
        self, removed: Array, bubbles: Array | None = None, shut: Shut = Shut.NOTHING
    ) -> tuple[Array, Array]:
        """The displacement without what it enters foundations and other bodies, at vertices and middles of edges.

        Args:
            removed: what is taken away from it before at the vertices, length, shape (v, d).
            bubbles: the same at the middles of edges beyond what is linear between the vertices, length, shape (e, d).
            shut: what is closed between two bodies.
        """
        y, middle = self.y - removed, self.middle - removed[self.t.edges].mean(axis=1)
        if bubbles is not None:
            middle -= bubbles
        t, tiny = self.t, ROUND_OFF * self._far
        projectors = [self._loose(parts, len(values), self.held) for parts, values in self._entities(y, middle)]
        for attempt in range(_ATTEMPTS):
            self._leave_foundations(y, middle)
            if self._pairs:
                kind, matched = (
                    Shut.NOTHING if attempt else shut,
                    [pair for pair in self._pairs if pair.refined is None],
                )
                separate(t, matched, self.relative, y, middle, (projectors[0], projectors[1]), tiny, kind)
                separate_unmatched(t, self._unmatched, self.relative, y, middle, projectors[0], tiny)
            if all(self._admits(surface, y, middle, 2 * tiny) for surface in self.contacts):
                return y, middle
        raise Refused("no displacement near the computed one keeps all bodies out of each other and of foundations")

    def _admits(self, surface: FacetsInContact, y: Array, middle: Array, tiny: float) -> bool:
        """Whether a displacement keeps to a contact."""
        relative = self.relative(surface, y, middle)
        excess = surface.excess(relative)
        if surface.bonded:
            return bool(np.abs(relative).max(initial=0.0) <= SAME_LENGTH * self._far)
        return bool((np.abs(excess) if surface.bilateral else excess).max(initial=-np.inf) <= tiny)

    def _entities(self, y: Array, middle: Array) -> tuple[tuple[Ints, Array], tuple[Ints, Array]]:
        """Vertices and edges of facets, with a displacement there."""
        return (self.t.facets, y), (self.t.edges_of_facets, middle)

    def _loose(self, parts: Ints, count: int, projectors: Array) -> Array:
        """Projectors onto the directions in which supports let vertices or edges move, see ``_free_at``."""
        sizes, vectors = self._free_at(parts, count, projectors)
        return np.einsum("vik,vk,vjk->vij", vectors, np.where(sizes > SAME_LENGTH, 0.0, 1.0), vectors)

    def _leave_foundations(self, y: Array, middle: Array) -> None:
        """Move a displacement out of foundations, and to those that contact cannot leave, in place."""
        t, tiny = self.t, ROUND_OFF * self._far
        if any(surface.bilateral for surface in self._on_foundations):
            self._close(y, middle)
        unmoved, opening = y.copy(), [surface for surface in self._on_foundations if not surface.bilateral]
        for kind, (entities, values) in enumerate(self._entities(y, middle)):
            free = self._loose(entities, len(values), self.held)
            wanted: dict[int, list[tuple[Array, float]]] = {}
            for surface in opening:
                excess = surface.excess(self.on_facets(y, middle, surface.facets))
                for moved, place, column, directions, share in surface.ways_out:
                    for k in np.flatnonzero(excess[:, column] > -tiny) if moved == kind else ():
                        wanted.setdefault(int(entities[surface.facets[k], place]), []).append(
                            (directions[k], share * float(excess[k, column]))
                        )
            for where, rows in wanted.items():
                normals, depths = np.array([row[0] for row in rows]), np.array([row[1] for row in rows])
                values[where] -= out(normals, depths + tiny, free[where], tiny)
            if kind == 0:
                middle += (y - unmoved)[t.edges].mean(axis=1)

    def _close(self, y: Array, middle: Array) -> None:
        """Move a displacement to the foundations that contact cannot leave, in directions in which supports let it.

        Vertices first, then middles, of which an edge has half its coefficient of Bernstein.
        """
        t, unmoved = self.t, y.copy()
        for (entities, values), first, share in zip(
            self._entities(y, middle), (0, t.dimension), (1.0, 0.5), strict=True
        ):
            free = self._loose(entities, len(values), self.supported)
            rows: dict[int, list[tuple[Array, float]]] = {}
            for surface in filter(lambda contact: contact.bilateral, self._on_foundations):
                along = np.einsum("fcd,fd->fc", self.on_facets(y, middle, surface.facets), surface.normal)
                for column in range(first, first + entities.shape[1]):
                    missed = share * (surface.below - along)[:, column]
                    for k, where in enumerate(entities[surface.facets, column - first]):
                        rows.setdefault(int(where), []).append((surface.normal[k], float(missed[k])))
            for where, pairs in rows.items():
                normals = np.array([pair[0] for pair in pairs]) @ free[where]
                lengths = np.array([pair[1] for pair in pairs])
                change = free[where] @ np.linalg.lstsq(normals, lengths, rcond=SAME_LENGTH)[0]
                tiny = SAME_LENGTH * np.abs(lengths).max() + ROUND_OFF * self._far
                if np.abs(normals @ change - lengths).max() > tiny:
                    raise Refused("supports and contact that cannot open prescribe different displacements")
                values[where] += change
            if first == 0:
                middle += (y - unmoved)[t.edges].mean(axis=1)

    @property
    def _on_foundations(self) -> list[FacetsInContact]:
        """The contacts with rigid foundations."""
        return [surface for surface in self.contacts if surface.opposite is None]

    @property
    def _pairs(self) -> list[FacetsInContact]:
        """The contacts of two bodies."""
        return [surface for surface in self.contacts if surface.opposite is not None]

    @property
    def _unmatched(self) -> list[tuple[FacetsInContact, CommonRefinement]]:
        """Those of facets that do not match, with the triangles that these share."""
        return [(surface, surface.refined) for surface in self.contacts if surface.refined is not None]

    @cached_property
    def group_of_piece(self) -> Ints:
        """A number for each piece, the same for those that contacts join: their bounds are known together."""
        t, links = self.t, np.zeros((0, 2), dtype=np.int64)
        for surface in self._pairs:
            assert surface.opposite is not None
            sides = [t.piece[t.sides[facets, 0]] for facets in (surface.facets, surface.opposite.facets)]
            links = np.concatenate((links, np.stack(sides, axis=1)))
        count = int(t.piece.max()) + 1
        graph = sp.csr_matrix((np.ones(len(links)), tuple(links.T)), shape=(count, count))
        return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)

    @property
    def _far(self) -> float:
        """The largest displacement or gap, length."""
        return float(
            np.abs(self.y).max() + max((np.abs(surface.below).max() for surface in self.contacts), default=0.0)
        )
