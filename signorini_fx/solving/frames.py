"""Transformations between a state, whose vectors have components in space, and the frames at the
contact points in which a step is solved.

Foundations may have turned and moved since the end of the last step; the normals stored in the
state are those at that time.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.algebra.contact.active_sets import ActiveSets, release
from signorini_fx.arrays import Array, inner, length, matvec, quotient, rmatvec, unit
from signorini_fx.errors import FormError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary, no_points
from signorini_fx.mechanics.model import Loads, Model
from signorini_fx.mechanics.state import ContactValues, Field, State, at_cells
from signorini_fx.mechanics.statement.rigid_shape import Placement
from signorini_fx.records import Status
from signorini_fx.results.certificate.contact_nodes import PreviousStep, Tractions
from signorini_fx.tuned import ROOT_OF_EPS

_PRESSURE = "hydrostatic pressure"  # of a mixed element at the vertices of cells, a stress


@dataclass(frozen=True)
class Posed:
    """The problem of a step.

    Attributes:
        body: the body with the contact points of this step.
        task: the contact problem.
        first: initial state of the step as if no step came before it: gap, friction, and gammas of
            the settings.
        placed: shift and rotation of the shapes in the step.
        drift: motion of the foundations at the contact points since the state, length, shape (n,
            d); None: they have not moved.
        spin: see ``rotations``.
        gap: distances from foundations at the end of the step, length, shape (n,).
        dt: duration of the step.
        part: see ``StepContact``.
        loads: loads at the end of the step, if effects in time need them; else None.
        softness: increase of the gap with the pressure, length per stress, shape (n,); None: zero.
        linear: whether the body is linear: the iterate of a step then starts from the last
            solution.
    """

    body: Model
    task: Task
    first: Start
    placed: tuple[Placement | None, ...]
    drift: Array | None = None
    spin: Array | None = None
    gap: Array = field(default_factory=lambda: np.zeros(0))
    dt: float = 0.0
    part: float = 1.0
    loads: Loads | None = None
    softness: Array | None = None
    linear: bool = True

    @property
    def boundary(self) -> ContactBoundary:
        """The contact points, which may be none."""
        return self.body.boundary or no_points(self.body.space)


def start_of(
    posed: Posed, state: State, guess: State | None = None
) -> tuple[Start, PreviousStep | None]:
    """Return the initial state of a step, and the previous step for the certificate; collective.

    Slip is relative to foundations, and the friction bound is that of the pressure in the state.
    The previous step is None if it does not matter.

    Args:
        posed: the problem of the step.
        state: the state before the step.
        guess: a solution of the same step for other values, or that of a coarser mesh; None: there
            is none.

    Raises:
        FormError: the contact points have changed.
    """
    task = posed.task
    boundary = posed.boundary
    start, before = (
        _first(posed, state) if state.contact is None else _following(posed, state, state.contact)
    )
    # State at which the iterate starts; None: at the prescribed displacements, which would tear
    # bonds.
    begins = None if state.contact is None and posed.first.data.bond is None else state
    if guess is not None and guess.number == state.number + 1 and _fits(guess.contact, boundary):
        if posed.linear:
            begins = guess if guess.displacement.size else None
        elif not task.motions.count:
            begins = None
        if (values := guess.contact) is not None:
            start = start.begin_from(
                *in_frames(values, rotations(values.normal, boundary.normal), boundary)
            )
    x = (
        task.system.start.copy()
        if begins is None
        else task.system.unknowns(_unknowns(posed, begins))
    )
    sets = start.sets or ActiveSets.all_in_contact(*start.data.mu_hat.shape)
    task.newton.restore((x, sets, start.data))
    return start, before


def _fits(values: ContactValues | None, boundary: ContactBoundary) -> bool:
    """Return whether values belong to these contact points, or are None; collective."""
    return values is None or not parallel.any_rank(
        boundary.comm, not np.array_equal(values.nodes, boundary.nodes)
    )


def _first(posed: Posed, state: State) -> tuple[Start, PreviousStep | None]:
    """Return the start of the first step: slip counts from the body without loads and the shapes as
    given.
    """
    first = replace(posed.first, step=state.number)
    if posed.drift is None:
        return first, None
    boundary = posed.boundary
    before = PreviousStep(
        fem.Function(posed.body.space), Tractions.none(boundary), moved=posed.drift
    )
    # The slip origin of a body that only contact holds is not zero at its reference motion.
    origin = first.data.slip_origin + _along(boundary, posed.drift)
    return replace(first, data=replace(first.data, slip_origin=origin)), before


def _following(posed: Posed, state: State, values: ContactValues) -> tuple[Start, PreviousStep]:
    """Return the start of a step after another one, and the previous step; collective."""
    body = posed.body
    first = posed.first
    boundary = posed.boundary
    if not _fits(values, boundary):
        raise FormError.at("contact", "its points cannot change between the steps of a loop")
    rotation = rotations(values.normal, boundary.normal, posed.spin)
    sets, (pressure, mu) = in_frames(values, rotation, boundary)
    _, slips = body.contact.traces(_unknowns(posed, state))
    gamma_n, gamma_t = state.gammas or (first.data.gamma_n, first.data.gamma_t)
    data = replace(
        first.data,
        gamma_n=gamma_n,
        gamma_t=gamma_t,
        mu_hat=mu,
        bound=None if first.law is None else first.law.evaluate(pressure, 0.0)[0],
        slip_origin=slips + _along(boundary, posed.drift),
    )
    shear, elastic = (matvec(rotation, vectors) for vectors in (values.shear, values.elastic))
    start = replace(
        first,
        data=data,
        elastic_slip=components(elastic, boundary.cotangents),
        sets=sets,
        iteration=1,
        multipliers=(pressure, mu),
        step=state.number,
        regularisation_error=state.error,
    )
    displacement = _displacement(posed, state)
    rigid = body.rigid.moved(state.rigid) if body.rigid.bodies else ()
    return start, PreviousStep(
        displacement, Tractions(values.pressure, shear), elastic, posed.drift, rigid
    )


def _unknowns(posed: Posed, state: State) -> PETSc.Vec:
    """Return all unknowns of the body in a state, relative to the present reference motion;
    collective.
    """
    body = posed.body
    rest = posed.task.rest
    unknowns = body.unknowns(_displacement(posed, state))
    if rest is not None:
        unknowns.axpy(-1.0, body.vector(body.displacement_of(rest)))
    if body.rigid.bodies:
        body.begin_driven(unknowns, state.rigid, rest)
    return unknowns


def _displacement(posed: Posed, state: State) -> fem.Function:
    body = posed.body
    if body.mixed is None:
        displacement = fem.Function(body.space)
    else:
        displacement = body.mixed.displacement()
        pressure = displacement.hydrostatic
        vertices = pressure.function_space.dofmap.list
        like = {_PRESSURE: np.zeros(vertices.shape)}
        pressure.x.array[vertices] = at_cells(state.fields, like)[_PRESSURE]
    displacement.x.array[:] = state.displacement
    return displacement


def state_of(
    posed: Posed,
    start: Start,
    outcome: Outcome,
    unknowns: PETSc.Vec,
    displacement: fem.Function,
    state: State,
) -> State:
    """Return the state at the end of a step with a solution; values that no step changes are kept.
    Collective.

    Args:
        posed: the problem of the step.
        start: the initial state of its contact problem.
        outcome: the outcome of the contact problem.
        unknowns: ``outcome.displacement()``, passed because its interior takes a back substitution.
        displacement: from the initial position.
        state: the state before the step.
    """
    body = posed.body
    task = posed.task
    boundary = posed.boundary
    sets = outcome.problem.sets
    solved = outcome.problem.data
    tangents = boundary.tangents
    pressure, shear = outcome.newton.multipliers()
    elastic = start.elastic_slip
    if start.law is not None:
        kept = elastic + (shear - solved.mu_hat) / solved.gamma_t
        elastic = np.zeros_like(shear) if outcome.augmented else kept
    fields = state.fields
    if body.mixed is not None:
        values = unknowns.getArray(readonly=True)[unknowns.getLocalSize() - body.mixed.count :]
        hydrostatic = body.mixed.displacement(values).hydrostatic
        rows = hydrostatic.x.array[hydrostatic.function_space.dofmap.list]
        fields = {**fields, _PRESSURE: Field("cells", rows)}
    return replace(
        state,
        number=state.number + 1,
        displacement=displacement.x.array.copy(),
        rigid=body.driven(unknowns, task.rest),
        placed=posed.placed,
        contact=contact_values(
            boundary, sets, pressure, vectors_of(shear, tangents), vectors_of(elastic, tangents)
        ),
        gammas=(outcome.data.gamma_n, outcome.data.gamma_t),
        error=outcome.regularisation_error,
        fields=fields,
    )


def solution_of(
    posed: Posed,
    start: Start,
    state: State,
    *,
    gammas: tuple[float, float],
    monolithic: bool,
    augmented: bool,
) -> Outcome:
    """Return the outcome of the contact problem whose solution is a stored state, and restore the
    iterate.

    Args:
        posed: the problem of the step.
        start: its initial state.
        state: the state at its end.
        gammas: of the last problem of the method.
        monolithic: see ``Outcome``.
        augmented: see ``Outcome``.
    """
    task = posed.task
    boundary = posed.boundary
    values = state.contact
    assert values is not None
    sets, (pressure, shear) = in_frames(values, rotations(values.normal, boundary.normal), boundary)
    task.begin_step(start)
    unknowns = _unknowns(posed, state)
    u_n, u_t = posed.body.contact.traces(unknowns)
    posed_data, solved = (
        replace(start.data, gamma_n=gamma_n, gamma_t=gamma_t)
        for gamma_n, gamma_t in (state.gammas or gammas, gammas)
    )
    if start.law is not None:
        # The method may have ended with the friction bound of the previous pressure.
        slip = u_t - start.data.slip_origin
        bound, _, _ = start.law.evaluate(pressure, length(slip))
        bound = np.where(sets.slip, inner(shear, sets.direction), bound)
        if monolithic:
            where = pressure, start.data.bilateral, length(slip), inner(sets.direction, slip)
            sets = replace(sets, line=start.law.line(*where))
            bound, _, _ = start.law.evaluate(0.0 * pressure, 0.0)
        elif start.data.bond is not None:
            broken = start.data.bond.damaged((u_n, u_t))
            bound = quotient(bound, broken, sets.slip & (broken > 0), otherwise=bound)
        solved = replace(solved, bound=bound, follows=start.law if monolithic else None)
    if augmented:
        # Shifts with which the iterate has the tractions of the state; see ``sliding_shear``.
        lambda_hat = np.where(sets.contact, pressure - solved.stiffness * (u_n - solved.gap), 0.0)
        slips = solved.gamma_t * (u_t - solved.slip_origin)
        factor = solved.gamma_t / np.where(sets.turning > 0, sets.turning, solved.gamma_t)[:, None]
        sliding = shear + sets.across(factor * shear - slips - shear)
        solved = replace(
            solved,
            lambda_hat=lambda_hat,
            mu_hat=np.where(sets.slip[:, None], sliding, shear - slips),
        )
    sets = release(sets, solved)  # in 3D points without a bound slip in no direction
    task.newton.pose(solved, sets)
    task.newton.restore((task.system.unknowns(unknowns), sets, solved))
    error = state.error
    return Outcome(Status.CONVERGED, task.newton, posed_data, monolithic, augmented, error)


def contact_values(
    boundary: ContactBoundary, sets: ActiveSets, pressure: Array, shear: Array, elastic: Array
) -> ContactValues:
    """Return sets and tractions at contact points, with shears and directions as vectors in space,
    shape (n, d).
    """
    return ContactValues(
        nodes=boundary.nodes.copy(),
        part=boundary.part.copy(),
        normal=boundary.normal.copy(),
        pressure=pressure.copy(),
        shear=shear,
        elastic=elastic,
        contact=sets.contact.copy(),
        direction=vectors_of(sets.direction, boundary.tangents),
        turning=sets.turning.copy(),
    )


def in_frames(
    values: ContactValues, rotation: Array, boundary: ContactBoundary
) -> tuple[ActiveSets, tuple[Array, Array]]:
    """Return the stored sets and (lambda, mu) in the present frames of the contact points.

    Args:
        values: the stored values.
        rotation: from the earlier frames, see ``rotations``.
        boundary: the present contact points.
    """
    shear, direction = (
        components(matvec(rotation, vectors), boundary.cotangents)
        for vectors in (values.shear, values.direction)
    )
    slips = (values.direction != 0.0).any(axis=1) & (length(direction) > 0)
    direction = np.where(slips[:, None], unit(direction), 0.0)
    return ActiveSets.of(values.contact, direction, values.turning), (values.pressure, shear)


def vectors_of(components: Array, tangents: Array) -> Array:
    """Return tangential components, shape (n, d - 1), as vectors in space, shape (n, d)."""
    return matvec(tangents, components)


def components(vectors: Array, cotangents: Array) -> Array:
    """Return the tangential components of vectors in space by the dual basis, the inverse of
    ``vectors_of``.
    """
    return rmatvec(cotangents, vectors)


def _along(boundary: ContactBoundary, moved: Array | None) -> Array | float:
    """Return the tangential components of motions, shape (n, d - 1); 0 without motions."""
    return 0.0 if moved is None else rmatvec(boundary.tangents, moved)


def rotations(earlier: Array, later: Array, spin: Array | None = None) -> Array:
    """Return the smallest rotation from each earlier normal to the later one, shape (n, d, d).

    This rotation has no part about the normal.  ``spin`` adds that of the foundation, with which
    the shear turns, so that a common motion of body and foundation changes nothing.

    Args:
        earlier: unit normals, shape (n, d).
        later: unit normals, shape (n, d).
        spin: rotation of the foundation at each point, shape (n, d, d), less directions in which
            there is no shear any more; None: none.
    """
    if spin is not None:
        earlier = matvec(spin, earlier)
    identity = np.eye(later.shape[1])
    cosine = inner(earlier, later)
    both = earlier + later
    # For opposite normals the smallest rotation is not unique: then directions are kept.
    turns = (earlier != later).any(axis=1) & (1 + cosine > ROOT_OF_EPS)
    across = np.einsum("ni,nj->nij", both, both) / np.where(turns, 1 + cosine, 1.0)[:, None, None]
    rotation = identity + np.where(
        turns[:, None, None], 2 * np.einsum("ni,nj->nij", later, earlier) - across, 0.0
    )
    return rotation if spin is None else rotation @ spin


def turned(earlier: ContactBoundary, later: ContactBoundary, spin: Array | None = None) -> Array:
    """Return matrices that take components of a shear in earlier frames to those in later ones,
    shape (n, d - 1, d - 1).
    """
    rotation = rotations(earlier.normal, later.normal, spin)
    return np.einsum("nij,nil,nlk->njk", later.cotangents, rotation, earlier.tangents)
