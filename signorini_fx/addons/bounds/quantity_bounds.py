"""Two-sided bounds of the mean displacement of a boundary, and of the force of a support or a contact.

Let v be a displacement that does not enter the foundation and tau a stress in equilibrium, as for the bound of the
error.  The stress of the solution is within rho of their mean, (C eps(v) + tau) / 2, with

    rho^2 = |C eps(v) - tau|^2 / 4 + int p (d - v_n) + int (g |v_t| - mu v_t)

(the hypercircle of W. Prager and J. L. Synge, Quart. Appl. Math. 5 (1947) 241-269).  A mean displacement Q and a force
R along c follow from a stress tau' and a displacement w or z that their dual problem approximates
(R. Becker and R. Rannacher, Acta Numerica 10 (2001) 1-102):

    Q(u) = Q(v) + L(w) - a(v, w) + int (tau' - C eps(w)) : eps(u - v),
    R(u) = a(u, z) - L(z) = a(v, z) - L(z) + int (C eps(z) - tau') : eps(u - v).

For Q, tau' is in equilibrium with a unit load on the boundary, and w vanishes where forces of supports and contacts
act.  For R, tau' has no load, and z is c on the boundary and vanishes where other forces of supports and contacts act.
In both tau' has no traction on the contact boundary, because nothing is assumed of u - v there.  With w = -z and -tau'
instead of tau' both are the same but for Q(v).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.addons.bounds.applied_loads import PlaneLoads
from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.bounded_error import ROUND_OFF
from signorini_fx.addons.bounds.cell_pieces import free_motions, of_each_piece
from signorini_fx.addons.bounds.equilibrated_stress import EquilibratedStress, Loads
from signorini_fx.addons.bounds.error_bound import Bounded, Enclosure
from signorini_fx.addons.bounds.initial_stress import elastic_stress
from signorini_fx.addons.bounds.linear_displacement import PrescribedComponents, smallest_energy
from signorini_fx.addons.bounds.round_off import of_boundary_values, of_strains, of_sum
from signorini_fx.addons.bounds.simplices import COLUMNS, ROWS, TWICE
from signorini_fx.addons.bounds.stress_products import energy, from_strain, product, square
from signorini_fx.addons.bounds.whole_problem import WholeProblem, of_whole
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.effect import Force
from signorini_fx.quantities.proved_statements import Interval, Refused
from signorini_fx.tuned import SAME_LENGTH, SAME_NUMBER, SINGULAR

# Products that a cell adds to a sum, at most: those of three components on the thirds at their corners.
_TERMS = 27


def mean_displacement(
    model: Model,
    y: fem.Function,
    contact: ContactState | None,
    boundary: str,
    direction: tuple[float, float],
    step: float = 0.0,
    before: fem.Function | None = None,
) -> Interval | str:
    """Bounds of the mean of u . direction over a boundary, a length; or why there are none; collective.

    They rest on what the bound of the error rests on, and print it.

    Args:
        model: the model.
        y: the displacement.
        contact: the contact nodes.
        boundary: its name.
        direction: any vector; a unit one gives a length.
        step: the place of the load step in the lists of factors.
        before: see ``error_bound``.
    """

    def prove(problem: WholeProblem) -> Interval:
        quantity = _Quantity(problem.model, problem.displacement, problem.contact, step, problem.before)
        return quantity.mean(boundary, np.asarray(direction, dtype=np.float64))

    try:
        return of_whole(model, y, contact, before, prove)
    except Refused as refused:
        return str(refused)


def force(
    model: Model,
    y: fem.Function,
    contact: ContactState | None,
    boundary: str,
    direction: tuple[float, float],
    step: float = 0.0,
    before: fem.Function | None = None,
) -> Interval | str:
    """Bounds of the force on the body along a direction of a support or contact; or why there are none; collective.

    They rest on what the bound of the error rests on, and print it.  Where statics determines the force they are equal.

    Args:
        model: the model.
        y: the displacement.
        contact: the contact nodes.
        boundary: of a support or of a contact.
        direction: any vector; a unit one gives a force per thickness.
        step: the place of the load step in the lists of factors.
        before: see ``error_bound``.
    """

    def prove(problem: WholeProblem) -> Interval:
        quantity = _Quantity(problem.model, problem.displacement, problem.contact, step, problem.before)
        return quantity.force(boundary, np.asarray(direction, dtype=np.float64))

    try:
        return of_whole(model, y, contact, before, prove)
    except Refused as refused:
        return str(refused)


@dataclass(frozen=True)
class _Dual:
    """What the dual problem of a quantity is approximated by.

    Attributes:
        w: the displacement at vertices, length, shape (v, 2).
        stress: tau'.
        constraints: of w.
        missed: how far w is from these, length.
        pieces: whose quantity it is.
        sprung: whether the stress holds what springs whose stiffness varies exert under w.
        prescribed: size of what is prescribed in directions that are known up to round-off, length.
        shortened: by how much w shortens the sections that forces tighten, length, shape (m,).
    """

    w: Array
    stress: EquilibratedStress
    constraints: PrescribedComponents
    missed: float
    pieces: Ints
    sprung: bool = True
    prescribed: float = 0.0
    shortened: Array = field(default_factory=lambda: np.zeros(0))


class _Quantity(Bounded):
    """A problem with what bounds quantities of its solution."""

    def __init__(
        self,
        model: Model,
        y: fem.Function,
        contact: ContactState | None,
        step: float,
        before: fem.Function | None = None,
    ) -> None:
        if model.tagged.dimension != 2:
            raise Refused("in space the error alone has a guaranteed bound")
        super().__init__(model, y, contact, step, before)

    def mean(self, boundary: str, direction: Array) -> Interval:
        """See ``mean_displacement``."""
        t, edges = self.t, self._facets(boundary)
        if self.jump is not None and any(moved.cells[t.sides[edges, 0]].any() for moved in self.jump.moved):
            raise Refused(f"a preloaded section is at {boundary!r}: its displacement jumps there")
        pieces = np.unique(t.piece_of_vertex[t.edges[edges]])
        free = [piece for piece, _ in of_each_piece(t, free_motions(t, self.stopped))]
        if np.isin([*free, *self.loose.piece], pieces).any():
            raise Refused("a mean displacement has bounds where supports hold the body without its contact")
        unit = np.zeros((len(t.edges), 2, 2))
        unit[edges] = direction / t.area[edges].sum()  # what supports take of it neither stress nor w know
        load = np.zeros((len(t.x), 2))
        for k in (0, 1):
            np.add.at(load, t.edges[:, k], t.area[:, None] * (2 * unit[:, k] + unit[:, 1 - k]) / 6)
        constraints = self._closed(np.zeros((len(t.edges), 2)), pieces)
        w, missed = smallest_energy(t, constraints, load, self.sprung)
        w, shortened = self._shortening(w, constraints)
        stress = self._dual_stress(unit, w, np.zeros_like(unit))
        y, middle = self.enclosure.v.y, self.enclosure.v.middle
        share = t.area[edges] / t.area[edges].sum()
        mean = float(share @ ((y[t.edges[edges]].sum(axis=1) + 4 * middle[edges]) / 6 @ direction))
        tiny = of_sum(2 * edges.size) * float(np.abs(direction).sum()) * self._far
        return self._interval(_Dual(w, stress, constraints, missed, pieces, shortened=shortened), mean, tiny)

    def force(self, boundary: str, direction: Array) -> Interval:
        """See ``force``."""
        t, edges = self.t, self._facets(boundary)
        names = [name for effect in self._model.statement.contact for name in (effect.boundary, effect.against)]
        support = boundary not in names
        if support and not self.held[edges].any(axis=(1, 2)).all():
            raise Refused(f"{boundary!r} is neither a support nor a contact")
        closed = any(
            boundary in (effect.boundary, effect.against) and not effect.opens
            for effect in self._model.statement.contact
        )
        if (support or closed) and any(
            np.isin(self._facets(load.where), edges).any()
            for load in self._model.statement.of(Force)
            if load.where is not None
        ):
            raise Refused(f"loads act on {boundary!r}: its own force is not known apart from them")
        if (support or closed) and any(np.isin(part.facets, edges).any() for part in self.sprung):
            raise Refused(f"springs act on {boundary!r}: its own force is not known apart from them")
        value = np.zeros((len(t.edges), 2))
        value[edges] = -direction
        pieces = np.unique(t.piece_of_vertex[t.edges[edges]])
        constraints = self._closed(value, pieces)
        no_displacement = np.zeros_like(value)
        if not PrescribedComponents.joined(
            constraints, PrescribedComponents.of_facets(t.edges, self.stopped - self.held, no_displacement)
        ).fixes(t):
            raise Refused("a force has bounds where supports and contacts hold the body")
        w, missed = smallest_energy(t, constraints, springs=self.sprung)
        if missed > SAME_LENGTH * np.abs(direction).max():
            raise Refused(
                f"the force on {boundary!r} has no bounds: it shares a corner with another support or contact"
            )
        w, shortened = self._shortening(w, constraints)
        no_traction = np.zeros((len(t.edges), 2, 2))
        stress = EquilibratedStress(np.zeros((len(t.corners), 3, 3, 3)), no_traction, np.zeros(len(t.corners)))
        if support:
            stress = self._dual_stress(no_traction, w, np.stack((value, value), axis=1))
        exact = not constraints.value.any() and (np.count_nonzero(constraints.direction, axis=1) == 1).all()
        prescribed = 0.0 if exact else float(np.abs(direction).max())
        return self._interval(_Dual(w, stress, constraints, missed, pieces, support, prescribed, shortened))

    def _shortening(self, w: Array, constraints: PrescribedComponents) -> tuple[Array, Array]:
        """The displacement of least energy of those that shorten the sections which forces tighten, too, from the one
        that does not: it without its jumps, and the shortenings, lengths.
        """
        t, sections = self.t, self.tightened
        if not sections:
            return w, np.zeros(0)
        at_rest, fields = replace(constraints, value=np.zeros_like(constraints.value)), []
        for strain in self.tensions.strains:
            forces, of_cells = np.zeros((len(t.x), 2)), np.zeros((len(t.corners), 2, 2))
            of_cells[:, ROWS[2], COLUMNS[2]] = of_cells[:, COLUMNS[2], ROWS[2]] = t.stress(strain)
            np.subtract.at(forces, t.corners, np.einsum("n,nij,ncj->nci", t.volume, of_cells, t.gradients))
            fields.append(smallest_energy(t, at_rest, forces, self.sprung)[0])
        strains = [self._strain(v)[:, 0] + strain for v, strain in zip(fields, self.tensions.strains, strict=True)]

        def works(strain: Array) -> Array:
            """Of the stress of a strain on those of J_k, energies per length, shape (m,)."""
            stress = t.stress(strain) * TWICE[2] * t.volume[:, None]
            return np.array([(stress * other).sum() for other in self.tensions.strains])

        matrix = np.stack([works(strain) for strain in strains])
        shortened = np.linalg.lstsq(matrix, -works(self._strain(w)[:, 0]), rcond=SINGULAR)[0]
        return w + np.einsum("m,mvd->vd", shortened, np.stack(fields)), np.asarray(shortened, dtype=np.float64)

    def _dual_stress(self, traction: Array, w: Array, prescribed: Array) -> EquilibratedStress:
        """In equilibrium with tractions and what springs whose stiffness varies exert under w, with what it does not
        hold of this among the work that it misses.
        """
        body, reaction = np.zeros((len(self.t.corners), 3, 2)), self.reaction_of_springs(w, self._middles(w))
        loads = Loads(body, traction)
        if reaction is not None:
            loads = Loads(body, traction + reaction.acting.traction, reaction.acting.unknown)
        stress = self.equilibrated(loads, prescribed)
        if self.tightened:  # the dual problem has no tensions
            stress = self.tensions.with_tensions(stress, self.tensions.work(loads), loaded=bool(traction.any()))
        if reaction is None:
            return stress
        missed = reaction.missed_beside(np.zeros(len(self.t.facets)))
        if self.grading is not None:
            missed = missed / self.grading.least
        return replace(stress, squares=(np.sqrt(stress.squares) + np.sqrt(missed)) ** 2)

    def _closed(self, value: Array, pieces: Ints) -> PrescribedComponents:
        """Components where forces of supports and contacts act; without friction there is none along a contact.

        Args:
            value: of the displacement on edges, shape (e, 2).
            pieces: whose quantity it is; others do not move.
        """
        t, parts = self.t, [PrescribedComponents.of_facets(self.t.edges, self.held, value)]
        parts.append(PrescribedComponents.at_rest(np.flatnonzero(~np.isin(t.piece_of_vertex, pieces)), 2))
        for surface in self.contacts:
            # A linear displacement has no normal component all along facets only where the normal is the same.
            slips = surface.round is None and not (surface.bound.any() or surface.least.any())
            projectors = np.zeros_like(self.held)
            for facets in (surface.facets, *([] if surface.opposite is None else [surface.opposite.facets])):
                projectors[facets] = surface.normal[:, :, None] * surface.normal[:, None] if slips else np.eye(2)
            parts.append(PrescribedComponents.of_facets(t.edges, projectors, value))
        return PrescribedComponents.joined(*parts)

    def _joined(self, pieces: Ints) -> npt.NDArray[np.bool_]:
        """The cells of some pieces, and of those that contacts join with them, shape (n,)."""
        group = self.group_of_piece
        return np.isin(group[self.t.piece], group[pieces])

    def _strain(self, w: Array) -> Array:
        """Of a displacement that is linear on triangles, at corners, shape (n, 3, 3)."""
        return self.t.strain_at_corners(w, self._middles(w))

    def _interval(self, dual: _Dual, begin: float = 0.0, tiny: float = 0.0) -> Interval:
        """A quantity that is ``begin``, which is known up to ``tiny``, plus the work of the solution.

        This is L(w) - a(v, w) + int (tau' - C eps(w)) : eps(u - v).
        """
        t, enclosure = self.t, self.enclosure.of(self._joined(dual.pieces))
        strain = self._strain_of(dual)
        elastic, missing = from_strain(t, strain), dual.stress.missing
        tau, difference = dual.stress.stress, dual.stress.stress - elastic
        residual, unknown = self._residual(dual.w, strain)
        if self.tightened:
            forces = np.array([section.force for section in self.tightened])
            residual += float(dual.shortened @ (forces + self.tensions.work(self.loads.acting)))
        if self.grading is not None:
            of_v = from_strain(t, enclosure.v.strain)
            products, around = self.grading.product((elastic, tau), (of_v, enclosure.stress.stress))
            squares = replace(self.grading, free=None).square(elastic, tau)
        else:
            products, squares = product(t, difference, enclosure.difference), square(t, difference)
            around = np.zeros_like(squares) if self.initial is None else self.initial.unknown_work(difference)
        if self.springs is not None:
            of_w = self.misfit_of_springs(dual.stress, dual.w, self._middles(dual.w))
            of_v = self.misfit_of_springs(enclosure.stress, enclosure.v.y, enclosure.v.middle)
            products = products + self.springs.by_cell(self.springs.product(of_w, of_v), len(t.corners))
            squares = squares + self.springs.by_cell(self.springs.product(of_w, of_w), len(t.corners))
        if self.varying is not None and not dual.sprung:
            of_w = self.on_facets(dual.w, self._middles(dual.w), self.varying.facets)
            of_v = self.on_facets(enclosure.v.y - self.y, enclosure.v.middle - self.middle, self.varying.facets)
            work, not_known = self.varying.product(of_w, of_v)
            products, around = products + work, around + not_known
            squares = squares + np.add(*self.varying.product(of_w, of_w))
        size = float(np.sqrt(squares.sum()))
        rounded = of_strains(t, dual.w, self._middles(dual.w))[enclosure.inside].sum()
        norm = size + self._growth * float(np.sqrt(rounded))
        half = enclosure.radius * norm + enclosure.distance * missing + self._round_off(dual, enclosure, size)
        half += tiny + unknown + float(around[enclosure.inside].sum()) / 2
        centre = begin + residual + float(products.sum()) / 2
        return Interval(centre - half, centre + half, self.grounds)

    @property
    def _growth(self) -> float:
        """The largest factor from norms of C to those of moduli that vary inside cells."""
        return 1.0 if self.grading is None else float(np.sqrt(self.grading.greatest.max()))

    def _middles(self, w: Array) -> Array:
        """A displacement that is linear on triangles at the middles of the edges, shape (e, 2)."""
        return np.asarray(w[self.t.edges].mean(axis=1))

    def _strain_of(self, dual: _Dual) -> Array:
        """Of a dual displacement with its jumps, at corners, shape (n, 3, 3)."""
        strain = self._strain(dual.w)
        for size, of_jump in zip(dual.shortened, self.tensions.strains if self.tightened else (), strict=True):
            strain = strain + size * of_jump[:, None]
        return strain

    def _residual(self, w: Array, strain: Array) -> tuple[float, float]:
        """The work L(w) - a(v, w), and how far it is not known by quadrature.

        Args:
            w: at vertices, without its jumps.
            strain: of it with these, at corners.
        """
        t, middle = self.t, self._middles(w)
        elastic, unknown = from_strain(t, strain), self.loads.unknown_work(w, middle)
        if self.grading is not None:
            inside, unknown_part = self.grading.work(from_strain(t, self.enclosure.v.strain), elastic)
        else:
            # The strain of w is constant: the mean of that of v is enough.
            mean_stress = elastic_stress(t, self.enclosure.v.strain, self.initial).mean(axis=(1, 2))
            inside = float(t.volume @ (mean_stress * strain[:, 0] * TWICE[2]).sum(axis=1))
            unknown_part = 0.0 if self.initial is None else float(self.initial.unknown_work(elastic).sum())
        if (springs := self.springs) is not None:
            v = self.enclosure.v
            of_v, of_w = (
                springs.reaction(self.on_facets(*values, springs.facets)) for values in ((v.y, v.middle), (w, middle))
            )
            inside += float(springs.product(of_v, of_w).sum())
        if (varying := self.varying) is not None:
            v = self.enclosure.v
            of_v, of_w = (self.on_facets(*values, varying.facets) for values in ((v.y, v.middle), (w, middle)))
            work, not_known = varying.product(of_v, of_w)
            inside, unknown_part = inside + float(work.sum()), unknown_part + float(not_known.sum())
        return float(self.loads.work(w, middle) - inside), unknown + unknown_part

    def _round_off(self, dual: _Dual, enclosure: Enclosure, size: float) -> float:
        """Bound of the round-off of a quantity.

        Strains, sums, and what w misses of the values that are prescribed: w is less by another one, r, that is zero
        but near these, and forces of supports and contacts do the work a(u, r) - L(r) on it.

        Args:
            dual: of it.
            enclosure: of the pieces that are joined with those of the quantity.
            size: norm of tau' - C eps(w).
        """
        t, w, inside, loads, growth = self.t, dual.w, enclosure.inside, self.loads, self._growth
        assert isinstance(loads, PlaneLoads)  # in space quantities have no bounds
        v, middle = enclosure.v, self._middles(w)

        def norm(squares: Array) -> float:
            return growth * float(np.sqrt(squares[inside].sum()))

        of_v, of_w = norm(of_strains(t, v.y, v.middle)), norm(of_strains(t, w, middle))
        size_v = norm(energy(t, v.strain) + self._stored(v.y, v.middle)[0])
        strain = self._strain_of(dual)
        size_w = norm(energy(t, strain) + self._stored(w, middle)[0])
        of_w += ROUND_OFF * norm(energy(t, strain - self._strain(w)))
        between = float(np.sqrt(enclosure.gap))
        strains = of_v * (size_w + of_w + size / 2) + of_w * (size_v + between / 2)
        if self.initial is not None:
            size_v += norm(square(t, self.initial.stress))
        work = size_v * size_w + size * (between + enclosure.radius)
        loaded = loads.size_of_work(w, middle)
        for shortened, section in zip(dual.shortened, self.tightened, strict=True):
            loaded += abs(shortened) * (abs(section.force) + float(np.abs(loads.body).sum()))
        sums = of_sum(_TERMS * len(t.corners)) * (loaded + work)
        if self.grading is not None:
            # Stresses at points come from those at corners, whose squares are up to d + 2 times as large; and gamma is
            # known as its bounds are.
            work += size_w * (between + enclosure.radius) + size_v * size
            steepest = float((self.grading.greatest / self.grading.least).max())
            sums += ((t.dimension + 2) * of_sum(self.grading.terms) + SAME_NUMBER * steepest) * work
        moved = dual.missed + ROUND_OFF * (float(np.abs(w).max(initial=0.0)) + dual.prescribed)
        vertices = np.intersect1d(dual.constraints.vertex, t.corners[inside])
        near = np.zeros_like(w)
        near[vertices] = moved
        of_values = growth * of_boundary_values(t, vertices, np.sqrt(2) * moved)
        of_values += norm(self._stored(near, self._middles(near))[0])
        forces = of_values * (enclosure.size + enclosure.distance) + loads.size_of_work(near, self._middles(near))
        return strains + sums + forces
