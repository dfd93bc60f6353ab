"""The results of a nonlinear body at a solution: its certificate, for which F is assembled again at
the displaced points, its load step, and the error of its stress P.

P is the factor of the gradient of the test function in the residual, see docs/theory.md.  Errors of
the material's state on a coarse mesh count only as far as they make the stress rough.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse.linalg
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh

from signorini_fx.arrays import Array, Flags, Indices, Ints
from signorini_fx.forms.elasticity import acting_on, prescribed_nodes
from signorini_fx.forms.nonlinear.linearised import Linearised, NonlinearBody, Solved
from signorini_fx.machine import parallel
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.assembly.mesh_entities import assemble, compile_form, facet_nodes
from signorini_fx.mechanics.body.deformation import deformation_of
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.model import Loads
from signorini_fx.mechanics.obstacles.paired_points import MovingPair, PairedSides
from signorini_fx.mechanics.statement.load_path import counted_path
from signorini_fx.records import Finding, Status
from signorini_fx.results.accuracy.stress_recovery import StressRecovery, squared_residual
from signorini_fx.results.certificate.certificate import Certificate, judged
from signorini_fx.results.certificate.contact_nodes import (
    ContactConditions,
    Law,
    PreviousStep,
    Tractions,
)
from signorini_fx.results.certificate.corner_feet import judged_corners
from signorini_fx.results.certificate.equilibrium import Balance, RigidPart
from signorini_fx.results.certificate.pair_points import PairPoints
from signorini_fx.results.mechanics import Mechanics, StepResult
from signorini_fx.results.resultants import ActingForces
from signorini_fx.results.stresses import RawStresses
from signorini_fx.solving.step import Report
from signorini_fx.tuned import CERTIFICATE_TOLERANCE, FACETS_OF_KEPT_PARTNERS

if TYPE_CHECKING:
    from ufl.core.expr import Expr


Norms = tuple[float, float]  # norms of stress and strain


@dataclass(frozen=True)
class ResidualMechanics:
    """Forces and contact conditions of a body at a displacement, from its residual."""

    forces: Balance  # the residual, as forces on the body without contact
    contact: ContactConditions | None  # conditions at the displaced points; None: no contact
    fixed: Flags  # flags of prescribed dofs, ghosts included, shape (dofs,)


@dataclass(frozen=True)
class NonlinearMechanics(Mechanics):
    """The mechanics of a model that is defined by its residual, at the displacements of its load
    steps.
    """

    no_bounds = "a nonlinear body has no guaranteed bound"

    ends: Sequence[tuple[StepResult, ResidualMechanics]]  # at least the last load step
    boundaries: Mapping[str, Indices]  # facets of the named parts of the boundary
    # Errors at the last load step, with or without those of the strain, see
    # ``NonlinearContactProblem._errors_now``.
    errors_now: Callable[[bool], tuple[Array, Norms] | str] = lambda strain: (
        "it is not computed yet"
    )

    def conditions(self, y: fem.Function) -> ContactConditions | None:
        return self._at(y).contact

    def stress(self, y: fem.Function, step: float) -> RawStresses | str:
        return "the stress of a nonlinear body is in its residual alone: evaluate your expression"

    def balance(self, y: fem.Function, step: float) -> Balance:
        return self._at(y).forces

    def acting(self, y: fem.Function, step: float) -> ActingForces:
        """Return the forces at the supports; loads are not separated, as they are part of the
        residual.
        """
        end = self._at(y)
        return acting_on(end.forces, self.boundaries, end.fixed, (), displaced=True)

    def _at(self, y: fem.Function) -> ResidualMechanics:
        """Return the mechanics of the load step with this displacement, or of the last one."""
        return next(
            (end for load_step, end in self.ends if load_step.displacement is y), self.ends[-1][1]
        )


def certified(
    residual: Array,
    solved: Solved,
    lost: Array | None = None,
    tractions: Tractions | None = None,
) -> tuple[Certificate, ResidualMechanics]:
    """Return the certificate of the present displacement, with the forces and conditions that it
    judges; collective.

    Args:
        residual: F at the owned dofs, force.
        solved: the last iteration.
        lost: round-off of the residual at the owned dofs; None: zero.
        tractions: contact tractions to judge; None: those of the solver.
    """
    body = solved.body
    linear = solved.linear
    foundations = body.foundations
    u = body.at
    space = body.space
    scales = linear.elastic.scales
    fixed, values = linear.prescribed
    boundary = solved.state.boundary
    forces = residual.reshape(-1, space.mesh.geometry.dim)
    nothing = np.zeros_like(forces)
    balance = Balance(
        RigidPart(space),
        forces,
        nothing,
        prescribed_nodes(fixed, values, space),
        scales,
        scales,
        nothing,
        lost=nothing if lost is None else lost.reshape(forces.shape),
        with_loads=True,
        displaced=bool(foundations.moving or foundations.sliding),
    )
    contact = _conditions(body, linear) if body.contact else None
    rigid_bodies = foundations.rigid_bodies
    before = linear.before
    if before is not None:
        moved = foundations.motion_at(boundary, linear.begin)
        if (
            moved is not None
        ):  # for rigid bodies only the motion beyond that of the undeformed points
            for motions, sign in ((rigid_bodies.motions, -1.0), (before.rigid, 1.0)):
                for motion in motions:
                    touching = np.isin(boundary.part, motion.body.parts)
                    moved[touching] += sign * motion.at(boundary.x[touching])
        before = replace(before, moved=moved)
    if contact is not None and contact.law is not None and contact.boundary.corners is not None:
        before = before or PreviousStep(fem.Function(space), Tractions.none(contact.boundary))
        before = replace(before, moved=_moved_with_corners(solved, contact.boundary, before))
    rigid = [*zip(rigid_bodies.motions, rigid_bodies.drives(), strict=True)]
    tractions = tractions or Tractions.of(solved.state)
    law = Law(*linear.task.promised(solved.outcome))
    certificate = judged(u, balance, contact, tractions, law=law, before=before, rigid=rigid)
    return certificate, ResidualMechanics(balance, contact, fixed)


def _moved_with_corners(solved: Solved, boundary: ContactBoundary, before: PreviousStep) -> Array:
    """Return the displacement of foundations at contact points in the step, length, shape (n, d).

    At corners it is chosen such that the slip is that of the material point that was under the
    corner; collective.
    """
    slips = solved.body.foundations.slips_at_corners(boundary, solved.linear.begin)
    places = solved.body.places
    begun = before.displacement.x.array.reshape(places.shape)
    way = boundary.moved(places) - boundary.moved(begun)
    moved = np.zeros_like(way) if before.moved is None else before.moved
    return np.where(boundary.at_nodes[:, None], moved, way - slips)


def _conditions(body: NonlinearBody, linear: Linearised) -> ContactConditions:
    """Return the conditions at the contact points: distances and normals of shapes, and maps of
    pairs, at displaced points; collective.
    """
    body.slide()
    data = [*linear.data]
    foundations = body.foundations
    places = body.places
    for number, moving in foundations.moving.items():
        gap = np.full(len(places), np.nan)
        along = np.full(places.shape, np.nan)
        gap[moving.nodes], along[moving.nodes] = moving.projected(linear=False)
        gap[moving.nodes] += moving.added
        data[number] = replace(
            data[number], gap=gap, shape=replace(data[number].shape, direction=along)
        )
    for number in foundations.sliding:  # their distance is that of the map
        data[number] = replace(data[number], gap=foundations.given_gap(number))
    boundary = foundations.points([entry.shape for entry in data], *linear.prescribed)
    of_body = body.settings, linear.elastic.scales
    regularised, law = foundations.problem(boundary, data, *of_body)
    both: Mapping[int, PairedSides | MovingPair] = {**foundations.pairs, **foundations.sliding}
    pairs = {number: PairPoints.of(pair) for number, pair in both.items()}
    shapes = foundations.placed_shapes
    added: Array | float = 0.0
    if body.effects:  # effects add what the problem was solved with
        first = linear.posed.first
        added, law = first.data.gap - linear.given_gap, first.law
    points = judged_corners(boundary, regularised.gap + added, shapes, foundations.displacement)
    return ContactConditions(*points, law, regularised.bilateral, pairs, None)


@dataclass(frozen=True)
class SolvedBody(Report):
    """A nonlinear body at the end of a load step.

    Attributes:
        mechanics: its mechanics.
        solved: the last iteration.
        iterations: number of Newton iterations.
    """

    mechanics: NonlinearMechanics
    solved: Solved
    iterations: int = 0

    @property
    def internal(self) -> Callable[[Array], Array]:  # type: ignore[override]
        """The function that returns the internal forces at a displacement, see ``StepEnd``."""
        return self.solved.body.evaluated.internal

    @property
    def end(self) -> tuple[StepResult, ResidualMechanics]:
        """The result of the step with its forces and contact conditions."""
        return self.result, self.mechanics.ends[-1][1]

    @classmethod
    def of(
        cls,
        solved: Solved,
        certificate: Certificate,
        end: ResidualMechanics,
        solves: int,
        iterations: int,
        status: Status = Status.CONVERGED,
    ) -> SolvedBody:
        """Return the end of a load step, and show its contact state to the user; collective.

        Args:
            solved: the last iteration.
            certificate: the certificate of the displacement.
            end: forces and contact conditions behind the certificate.
            solves: number of linear solves.
            iterations: number of Newton iterations.
            status: how the solve has ended.
        """
        body = solved.body
        linear = solved.linear
        elastic = linear.elastic
        body.show(solved.state)
        shapes = body.foundations.moving
        statement, _ = body.named
        contacts = tuple(
            named.model_copy(update={"foundation": shapes[k].as_given}) if k in shapes else named
            for k, named in enumerate(statement.contact)
        )
        number = linear.start.step
        u = body.at
        y = u.copy()
        y.name = u.name
        step = StepResult(
            step=number + 1,
            place=float(number),
            time=counted_path(number).time_at(number),
            name="",
            status=status,
            displacement=y,
            contact=solved.state if body.contact else None,
            certificate=certificate,
            deformation=deformation_of(elastic, u, linear.elastic.scales.size, moves=body.moves),
            strain_energy=certificate.strain_energy,
            linear_solves=solves,
            rigid_bodies=body.foundations.rigid_bodies.motions,
        )
        statement = statement.changed(contact=contacts)
        pairs: Any = {**body.foundations.pairs, **body.foundations.sliding}
        named = replace(elastic, contacts=contacts, law=linear.start.law, pairs=pairs)
        mechanics = NonlinearMechanics(named, statement, [(step, end)], body.forms.boundaries)
        forces = np.zeros(elastic.fixed.size) + body.evaluated.loads
        loads = Loads(forces, linear.prescribed[1], body.drives)
        if (given := body.model_of_scene) is not None:
            named = replace(
                named,
                coefficients=given.coefficients,
                materials=given.materials,
                contacts=given.contacts,
                tagged=given.tagged,
            )
        posed = replace(linear.posed, body=named, loads=loads)
        outcome = solved.outcome
        ended = (posed, linear.start, outcome, outcome.problem.data)
        return cls(step, mechanics, *ended, solved, iterations)


def lost_digits(certificates: Sequence[Certificate], residual: str) -> Iterator[Finding]:
    """Yield warnings where round-off may hide more at the ends of load steps than a certificate
    allows.

    Args:
        certificates: certificates of the load steps.  Those with a small fraction of the largest
            displacement are left out, as a body that is back at rest has nothing but round-off.
        residual: the name of the residual.
    """
    farthest = max((certificate.displacement for certificate in certificates), default=0.0)
    judged = [one for one in certificates if one.displacement > CERTIFICATE_TOLERANCE * farthest]
    hidden, placed = (
        max((getattr(certificate, name) for certificate in judged), default=0.0)
        for name in ("lost", "placed")
    )
    if hidden > CERTIFICATE_TOLERANCE:
        message = (
            f"round-off of the residual may hide errors of up to {hidden:.0e} of the forces, and "
            "of displacements as "
            "large: evaluate strains from grad u, without the difference of numbers near one such "
            "as I + grad u, or "
            "take a linear body, which one of such small strains is"
        )
        yield Finding("warning", residual, message)
    if placed > CERTIFICATE_TOLERANCE:
        message = (
            f"contact is met at displaced points, whose round-off is {placed:.0e} of the "
            "displacement: forces and "
            "displacements may be wrong by as much: take a linear body, which one of such small "
            "displacements is, or "
            "for contact of two bodies sliding = 'small'"
        )
        yield Finding("warning", "contact", message)


def slid_past_partners(solved: Solved) -> Iterator[Finding]:
    """Yield a warning for each pair whose touching points have moved farther than the limit for
    kept partners; collective.
    """
    body = solved.body
    mesh = body.space.mesh
    state = solved.state
    for number, entry in enumerate(body.contact):
        if entry.against is None or entry.slides or entry.bonded:
            continue
        lengths = mesh.h(mesh.topology.dim - 1, body.foundations.facets[number])
        total, count = parallel.global_sum(mesh.comm, np.array([lengths.sum(), lengths.size]))
        facet = total / count
        touching = (state.boundary.part == number) & state.in_contact
        farthest = parallel.largest(mesh.comm, np.linalg.norm(state.u_t[touching], axis=1))
        if farthest > FACETS_OF_KEPT_PARTNERS * facet:
            message = (
                f"points that keep their partners have moved by up to {farthest:.3g} along the "
                "other side, "
                f"{farthest / facet:.2g} facets: forces there may be wrong, and those on both "
                "sides act apart: let the "
                "sides slide"
            )
            yield Finding("warning", f"contact[{number}].sliding", message)


def squared_errors(
    field: fem.Function, u: fem.Function, parts: Sequence[Indices]
) -> tuple[Array, float]:
    """Return the squared L2 error of a stress or strain of ``stress_of`` in each owned cell, by its
    recovery, and its squared L2 norm; collective.

    Args:
        field: the stress or strain.
        u: the displacement.
        parts: cells of each material, local numbers, ghosts included.
    """
    stress = SimpleNamespace(
        displacement=u,
        components=field,
        parts=parts,
        squared=lambda difference, times, dx: times * ufl.inner(difference, difference) * dx,
        refresh=lambda step: None,
    )
    recovery = StressRecovery(stress, lambda z: (lambda step: None, None))
    return recovery.squares(u), 2 * recovery.energy(u)


def green_strain(u: fem.Function) -> ufl.Form:
    """Return the form E : grad v of Green's strain E, from which ``stress_of`` finds E like a
    stress.

    It does not depend on rotations of the body.  For displacements out of a section the rows of E
    are their gradients.
    """
    gradient = ufl.grad(u)
    rows, columns = gradient.ufl_shape
    products = gradient.T * gradient
    strain = [[gradient[i, j] for j in range(columns)] for i in range(rows)]
    for i, j in np.ndindex(columns, columns):
        strain[i][j] = (gradient[i, j] + gradient[j, i] + products[i, j]) / 2
    return ufl.inner(ufl.as_matrix(strain), ufl.grad(ufl.TestFunction(u.function_space))) * ufl.dx


def traction_left(body: NonlinearBody, loaded: Indices, field: fem.Function) -> Array:
    """Return the squared traction, times h, of the stress P on free facets, in each owned cell, see
    ``squared_residual``; collective.

    It should be zero there. Contact, ``loaded`` facets and prescribed components are left out.
    """
    space = body.space
    mesh = space.mesh
    dim = space.dofmap.index_map_bs
    touching = [*body.forms.facets, *body.forms.masters.values()]
    free = np.setdiff1d(
        dmesh.exterior_facet_indices(mesh.topology), np.concatenate([loaded, *touching])
    )
    free = free.astype(np.int32)
    held = np.all(body.supports()[0].reshape(-1, dim)[facet_nodes(space, free)], axis=1)
    components = np.array(list(field)).reshape(dim, -1)
    stress: Any = SimpleNamespace(
        displacement=body.at, sigma=ufl.as_matrix(components.tolist()), modulus=1.0, around=1.0
    )

    def of(numbers: Ints, residual: Expr) -> tuple[Expr, list[Expr], bool]:
        return ufl.as_vector([0.0 if k in numbers else residual[k] for k in range(dim)]), [], False

    cellwise = ufl.TestFunction(fem.functionspace(mesh, ("DG", 0)))
    form = squared_residual(stress, free, held, of, cellwise)
    count = mesh.topology.index_map(mesh.topology.dim).size_local
    return np.zeros(count) if form is None else np.asarray(assemble(compile_form(form)))


def stress_of(residual: ufl.Form, u: fem.Function) -> fem.Function:
    """Return the stress P of a residual as a polynomial of degree k - 1 in each cell, components
    row by row, by an L2 projection; collective.
    """
    mesh = u.function_space.mesh
    rows = u.ufl_shape[0]
    columns = mesh.geometry.dim
    degree = u.function_space.element.basix_element.degree - 1
    space, scalar = (
        fem.functionspace(mesh, ("DG", degree, shape)) for shape in ((rows * columns,), ())
    )
    tested = ufl.TestFunction(space)
    product = ufl.inner(ufl.TrialFunction(scalar), ufl.TestFunction(scalar))
    tensor = ufl.as_matrix([[tested[i * columns + j] for j in range(columns)] for i in range(rows)])
    over_cells = ufl.Form(
        [integral for integral in residual.integrals() if integral.integral_type() == "cell"]
    )
    (v,) = residual.arguments()
    with compiling():
        moments = fem.form(ufl.replace(over_cells, {ufl.grad(v): tensor, v: ufl.zero(v.ufl_shape)}))
        mass = fem.assemble_matrix(fem.form(product * ufl.dx)).to_scipy()
    owned = scalar.dofmap.index_map.size_local
    stress = fem.Function(space)
    values = assemble(moments).reshape(owned, rows * columns)
    if owned:
        stress.x.array[: values.size] = (
            scipy.sparse.linalg.splu(mass[:owned, :owned].tocsc()).solve(values).ravel()
        )
    stress.x.scatter_forward()
    return stress
