"""Inertia: bodies that move, collide and separate, from time step to time step.

The scheme is the implicit midpoint rule with contact that persists along the normal.  A step of
duration tau from u_n, v_n solves one contact problem for y, the displacement in its middle,

    (K + 4 M / tau^2) y + B^T (lambda, mu) = f + 4 M / tau^2 p,    p = u_n + tau v_n / 2,

with f the mean of the loads at both ends.  Then v_m = 2 (y - u_n) / tau, u_(n+1) = u_n + tau v_m
and v_(n+1) = 2 v_m - v_n; points held by supports or friction keep v_m along these directions.  If
the old velocity would bring a point inside the obstacle, it must not penetrate further; any other
point must not be inside at the end:

    gap of y:  B_n u_n / 2 + max(g_(n+1), B_n (u_n + tau v_n / 2) + (g_(n+1) - g_n) / 2 - lambda_n /
    gamma) / 2.

The term of lambda_n removes the penetration of the regularisation, which would otherwise grow with
each step like that of a dashpot.  The law of y is twice as stiff, so that u_(n+1) has gamma.

For a nonlinear body Newton's method finds w = u_(n+1), because contact with shapes is evaluated at
X + w:

    F((u_n + w) / 2) + 2 M (w - u_n - tau v_n) / tau^2 + B(w)^T (lambda, mu) = f.

A point under pressure keeps its penetration.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, Self

import numpy as np
import ufl
from dolfinx import default_scalar_type, fem
from petsc4py import PETSc
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.algorithms.apply_derivatives import apply_derivatives

from signorini_fx.algebra.linalg import LoadCase
from signorini_fx.arrays import Array, Expr, Flags, inner
from signorini_fx.errors import FormError, SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import (
    action,
    compile_form,
    heights,
    node_positions,
)
from signorini_fx.mechanics.model import Loads, Model, sum_of, vector_like
from signorini_fx.mechanics.rigid.moving_masses import (
    driven_to_end,
    energy,
    free_motion,
    heavier,
    in_middle,
    masses,
    mean_loads,
    moved_on,
    refuse_massless,
    set_in_motion,
    velocity_of,
)
from signorini_fx.mechanics.rigid.rigid_bodies import RigidBodies
from signorini_fx.mechanics.state import State
from signorini_fx.mechanics.statement.rigid_body import RigidBody
from signorini_fx.mechanics.statement.values import kind_of
from signorini_fx.mechanics.step_effect import (
    AddedForces,
    StepContact,
    StepEffect,
    StepEnd,
    SteppedForms,
)
from signorini_fx.records import Finding
from signorini_fx.tuned import SAME_LENGTH, SAME_NUMBER

if TYPE_CHECKING:
    from signorini_fx.mechanics.effects.inertia import Inertia

_POINTS_OF_WORK = 3  # Gauss points along a step; the error of the work has twice this order
_LEAST_STEP = 0.5  # shortest step over the time of a wave through a cell; below it the mesh rings


@dataclass(frozen=True)
class MidpointRule(StepEffect):
    """Inertia of all bodies, with time steps of the midpoint rule.

    Attributes:
        time_step: longest duration of a step, time; each load step is divided into equal ones;
            None: each load step is one time step.
        start: see ``Inertia``.
    """

    moves_bodies = True
    # A compromise: the order is two for smooth motions, one where waves have fronts.
    order = 4 / 3

    time_step: float | None = None
    start: Literal["static", "undeformed"] | None = None

    @classmethod
    def of(cls, entry: Inertia) -> Self:
        return cls(entry.time_step, entry.start)

    # --- where motion begins ---

    def initial(self, model: Model | None, state: State) -> State:
        """Return the state before the first step: with the initial velocity, or for a static start
        with that velocity set aside until the static step has been solved.

        A static start is the default if loads act at the beginning and no initial velocity is
        given.
        """
        if model is None:
            return state.with_field("velocity", "dofs", np.zeros_like(state.displacement))
        self._check(model)
        loads = model.loads_at(0.0)
        loaded = parallel.any_rank(model.comm, bool(loads.forces.any() or loads.prescribed.any()))
        if self.start is None:
            static = loaded and not model.statement.effects.get("initial_velocity", ())
        else:
            static = self.start == "static"
        drives = model.statement.drives(model.dimension, 0.0)
        state = set_in_motion(model.rigid, state, drives)
        if static:
            return state.with_field("first velocity", "dofs", self._initial_velocity(model))
        contacts = model.statement.contacts_at(0.0)
        placed = tuple(getattr(one.foundation, "placement", None) for one in contacts)
        state = replace(state, number=1, time=model.path.time_at(0.0), placed=placed)
        state = state.with_field("velocity", "dofs", self._initial_velocity(model))
        return state.with_field("load", "dofs", _with_ghosts(model, loads.forces))

    def _initial_velocity(self, model: Model) -> Array:
        """Return the initial velocity at the dofs of this rank, ghosts included, shape (dofs,).

        Raises:
            SceneError: a prescribed node moves.
        """
        space = model.space
        dim = model.dimension
        x = node_positions(space).T.astype(np.float64)
        velocity = np.zeros((x.shape[1], dim))
        for entry in model.statement.effects.get("initial_velocity", ()):
            nodes = np.arange(x.shape[1])
            if entry.body is not None:
                nodes = np.unique(space.dofmap.list[model.tagged.cells(entry.body)])
            velocity[nodes] += entry.velocities(x[:, nodes])[:dim].T
        held = model.vector(velocity.ravel()).getArray(readonly=True)[: model.fixed.size]
        size = parallel.largest(model.comm, np.abs(velocity), 0.0)
        if parallel.any_rank(model.comm, np.abs(held[model.fixed]) > SAME_LENGTH * size):
            reason = "moves a node whose displacement is prescribed: leave these nodes at rest"
            raise SceneError.at("initial_velocity", reason)
        return velocity.ravel()

    def _check(self, model: Model) -> None:
        """Raise an error if a rigid body has no mass, or the time step is too short for the cells
        in contact; collective.
        """
        refuse_massless(model.rigid)
        if model.boundary is None or self.time_step is None:
            return
        passing, height = self.smallest_cell(model)
        least = _LEAST_STEP * passing
        if self.time_step < least * (1 - SAME_NUMBER):
            reason = (
                f"is {self.time_step:g}: waves pass {self.time_step / passing:.2g} of the smallest "
                f"cell in contact, {height:.3g} high, and the mesh rings: make it {least:.3g} at "
                "least"
            )
            raise SceneError.at("inertia.time_step", reason)

    def shortest(self, model: Model) -> float:
        if model.boundary is None or not model.materials:  # unknown for a user's forms
            return 0.0
        return _LEAST_STEP * self.smallest_cell(model)[0]

    def smallest_cell(self, model: Model) -> tuple[float, float]:
        """Return the time that a wave needs to pass the smallest cell in contact, and the height of
        this cell, length; collective.
        """
        speed = 0.0
        for material in model.materials:
            first, second = material.lame
            speed = max(speed, float(np.sqrt((first + 2 * second) / material.density)))
        mesh = model.space.mesh
        each = [heights(mesh, model.tagged.facets(one.boundary)) for one in model.contacts]
        height = -parallel.largest(model.comm, -np.concatenate(each), -np.inf)
        return height / speed, height

    def findings(self, model: Model) -> Iterator[Finding]:
        self._check(model)
        (entry,) = model.statement.effects["inertia"]
        if self.time_step is None:
            return
        text = f"{entry.time_steps(model.path.times)} time steps"
        if model.boundary is not None:
            passing, height = self.smallest_cell(model)
            text += (
                f", in each of which waves pass {self.time_step / passing:.3g} of the smallest "
                f"cell in contact, {height:.3g} high"
            )
        yield Finding("note", "inertia", text)

    # --- a step ---

    def next_time(self, state: State, end: float) -> float:
        if self.time_step is None or "velocity" not in state.fields:
            return end
        left = end - state.time
        count = int(np.ceil(left / self.time_step * (1 - SAME_NUMBER)))
        return end if count <= 1 else state.time + left / count

    def body(self, model: Model, state: State, dt: float) -> Model:
        if "velocity" not in state.fields:
            return model
        mass, _ = _mass(model)
        resists = None if model.resists is None else (mass, *model.resists)  # the larger pattern
        factor = 4.0 / dt**2

        def terms() -> tuple[fem.Form, ...]:
            return *model.forms, _mass_form(model, factor)

        return _with_masses(replace(model, terms=terms, resists=resists), factor)

    def stepped(
        self, F: ufl.Form, J: ufl.Form | None, u: fem.Function, density: Expr | ufl.Form
    ) -> SteppedForms:
        space = u.function_space
        share = fem.Constant(space.mesh, default_scalar_type(1.0))
        factor = fem.Constant(space.mesh, default_scalar_type(0.0))
        begun = fem.Function(space)
        aim = fem.Function(space)
        middle = {u: share * u + (1.0 - share) * begun}
        if isinstance(J, fem.Form):
            raise FormError.at("J", "must be UFL, not compiled, with inertia")
        mass = _mass_of(density, space)
        # Integrals of one form share their subdomains.
        data = next(one.subdomain_data() for one in F.integrals_by_type("cell"))
        integrals = [one.reconstruct(subdomain_data=data) for one in mass.integrals()]
        mass = factor * ufl.Form(integrals)
        trial = mass.arguments()[1]

        def begin(state: State, dt: float, loads: Array | float) -> Array | float:
            moves = "velocity" in state.fields
            share.value = 0.5 if moves else 1.0
            factor.value = 2.0 / dt**2 if moves else 0.0
            if not moves:
                return 0.0
            begun.x.array[:] = state.displacement
            aim.x.array[:] = state.displacement + dt * _velocity(state)
            return -_half_change(loads, state)

        def in_middle(form: ufl.Form) -> ufl.Form:
            return ufl.replace(apply_derivatives(apply_algebra_lowering(form)), middle)

        residual = in_middle(F) + ufl.replace(mass, {trial: u - aim})
        return SteppedForms(residual, None if J is None else share * in_middle(J) + mass, begin)

    def driven(self, rigid: RigidBodies, state: State, dt: float) -> Sequence[RigidBody]:
        if "velocity" not in state.fields or not rigid.bodies:
            return rigid.bodies
        return driven_to_end(rigid, state, dt)

    def load(self, model: Model, loads: Loads, state: State, dt: float) -> LoadCase | None:
        if "velocity" not in state.fields:
            return None
        _, matrix = _mass(model)
        forces = loads.forces - _half_change(loads.forces, state)
        # The unknown is y - u_n: small displacements have small round-off, which gamma multiplies.
        for form in model.forms[:-1]:
            forces -= _action(form, model.space, state.displacement)
        forces += 2.0 / dt * _times(matrix, _velocity(state))
        held = model.vector(state.displacement)
        held.getArray()[: model.fixed.size][~model.fixed] = 0.0
        driven = None
        if model.rigid.bodies:
            driven, _ = in_middle(model.rigid, state, loads.drives, dt)
        return model.case(forces, 0.5 * (loads.prescribed - model.function(held).x.array), driven)

    def contact(self, contact: StepContact, state: State, dt: float) -> StepContact:
        if "velocity" not in state.fields:
            return contact
        model = contact.model
        data = contact.data
        law = contact.law
        if law is not None and law.follows_slip:
            law = replace(law, dt=0.5 * dt)
        drift = None if contact.drift is None else 0.5 * contact.drift
        if model.boundary is None:
            return replace(contact, reference=state.displacement)
        if not contact.linear:
            return self._persistent(contact, state, dt)
        velocity = _velocity(state)
        u, _ = model.contact.traces(model.unknowns_at(state.displacement, state.rigid))
        v, _ = model.contact.traces(model.unknowns_at(velocity, velocity_of(state)))
        moved = np.zeros_like(contact.gap)
        still: Flags = np.ones(moved.size, dtype=bool)
        if contact.drift is not None:
            moved = inner(contact.drift, contact.boundary.normal)
            still = np.logical_not(contact.drift.any(axis=1))
        given_back = np.zeros_like(moved)
        if (earlier := state.fields.get("contact")) is not None:
            moved = np.where(still, contact.gap - earlier.values[:, 0], moved)
            given_back = earlier.values[:, 1]
        # Where the old velocity would bring a point inside it must not go on into the obstacle.
        arriving = u + 0.5 * dt * v + 0.5 * moved - given_back
        arriving = np.where(data.bilateral, contact.gap, np.maximum(contact.gap, arriving))
        gap = 0.5 * (u + arriving)
        for number, entry in enumerate(model.contacts):
            if getattr(entry, "overclosure", None) is not None:
                on = contact.boundary.part == number
                gap[on] = contact.gap[on] - 0.5 * moved[on]
        data = replace(data, gap=gap, gamma_n=2 * data.gamma_n, gamma_t=2 * data.gamma_t)
        reference = state.displacement
        return replace(contact, data=data, law=law, drift=drift, reference=reference, part=0.5)

    @staticmethod
    def _persistent(contact: StepContact, state: State, dt: float) -> StepContact:
        """Return the contact conditions of a nonlinear body at the end of the step.

        Points under pressure keep their penetration; others may get as deep as the old velocity
        would bring them in half a step.
        """
        model = contact.model
        data = contact.data
        rigid = state.rigid + 0.5 * dt * velocity_of(state)
        reached, _ = model.contact.traces(model.unknowns_at(_aim(state, dt), rigid))
        if contact.drift is not None:
            reached = reached + 0.5 * inner(contact.drift, contact.boundary.normal)
        depth = np.maximum(reached - contact.gap, 0.0)
        if state.contact is not None and (earlier := state.fields.get("contact")) is not None:
            depth = np.where(state.contact.pressure > 0.0, earlier.values.ravel(), depth)
        depth[data.bilateral] = 0.0
        return replace(contact, data=replace(data, gap=contact.gap + depth))

    def forces(
        self, model: Model, loads: Loads, state: State, dt: float, y: Array
    ) -> AddedForces | None:
        if "velocity" not in state.fields:
            return None
        mass, matrix = _mass(model)
        dim = model.dimension
        owned = model.fixed.size
        factor = 4.0 / dt**2
        velocity = _velocity(state)
        kinetic = 0.5 * _times(matrix, velocity) * velocity[:owned]
        space = model.space
        resisting = factor * _action(mass, space, y - _aim(state, dt)).reshape(-1, dim)
        lost = np.finfo(float).eps * factor * _action(mass, space, np.abs(y))
        prescribed = 0.5 * (state.displacement + loads.prescribed)[:owned]
        return AddedForces(
            resisting=resisting,
            named=[(None, "inertia", -resisting)],
            loads=-np.reshape(_half_change(loads.forces, state), (-1, dim)),
            prescribed=prescribed.reshape(-1, dim),
            lost=lost.reshape(-1, dim),
            drives=in_middle(model.rigid, state, loads.drives, dt)[1] if loads.drives else (),
            energy=np.abs(kinetic).reshape(-1, dim).sum(axis=1),
        )

    def solved(self, state: State, new: State) -> State:
        if "velocity" not in state.fields:
            return new
        rigid = 0.5 * (state.rigid + new.rigid)
        return replace(new, displacement=0.5 * (state.displacement + new.displacement), rigid=rigid)

    def after(self, state: State, new: State, ended: StepEnd) -> State:
        model = ended.model
        if "velocity" in state.fields:
            new = self._moved(state, new, ended)
        elif ended.place < 0.0:  # a part of the loads of statics
            return new
        else:
            fields = {**new.fields, "velocity": new.fields["first velocity"]}
            del fields["first velocity"]
            new = replace(new, fields=fields)
            if ended.internal is not None:
                strained = _strain_work(ended, np.zeros_like(new.displacement), new.displacement)
                new = new.with_field("energy", "global", [abs(strained), strained])
        new = new.with_field("load", "dofs", _with_ghosts(model, ended.loads.forces))
        if ended.contact is None:
            return new
        if ended.internal is not None:
            depth = np.maximum(ended.contact.gap - ended.gap, 0.0)
            return new.with_field("contact", "points", depth)
        assert new.gammas is not None
        penetration = ended.contact.pressure / new.gammas[0]
        if ended.augmented:
            penetration = 0.0 * penetration
        return new.with_field("contact", "points", np.column_stack((ended.gap, penetration)))

    def _moved(self, state: State, new: State, ended: StepEnd) -> State:
        """Return the state at the end of a step from the solution of its contact problem."""
        model = ended.model
        mean, free = _velocities_of(state, ended)
        velocity = free + _held_change(model, new, mean - free)
        energies = _energies(state)
        if ended.internal is not None:
            energies[1:] += _strain_work(ended, state.displacement, new.displacement)
        else:
            assert new.gammas is not None
            energies = energies[:1]
            contact = new.contact
            if contact is not None and not ended.augmented:
                # The law of the middle is twice as stiff.
                elastic = 2.0 * contact.elastic - ended.elastic
                contact = replace(contact, elastic=elastic)
            new = replace(
                new,
                displacement=state.displacement + ended.dt * mean,
                contact=contact,
                gammas=(0.5 * new.gammas[0], 0.5 * new.gammas[1]),
            )
        part = 0.5 if ended.internal is None else 1.0
        new = moved_on(model.rigid, state, new, ended.loads.drives, ended.dt, part)
        kinetic = [_kinetic(model, one) for one in (_velocity(state), velocity)]
        of_rigid = [energy(model.rigid, velocity_of(one)) for one in (state, new)]
        energies[0] = max(energies[0], *np.add(kinetic, of_rigid), *np.abs(energies[1:]))
        new = new.with_field("energy", "global", energies)
        return new.with_field("velocity", "dofs", velocity)

    def figures(self, state: State, new: State, ended: StepEnd) -> Mapping[str, float]:
        model = ended.model
        owned = model.fixed.size
        moves = "velocity" in state.fields
        static = model.forms[:-1] if moves else model.forms
        factor = (4.0 if ended.internal is None else 2.0) / ended.dt**2 if moves else 0.0
        rigid = model.rigid

        def strain(of: State) -> float:
            springs = energy(rigid, of.rigid, rigid.stiffness - factor * masses(rigid))
            if ended.internal is not None:
                return float(_energies(of)[1]) + springs
            u = of.displacement
            forces = sum(_action(form, model.space, u) for form in static)
            return 0.5 * _sum(model, np.asarray(forces) @ u[:owned]) + springs

        if "velocity" not in new.fields:
            return {}
        end = _kinetic(model, _velocity(new))
        of_rigid = energy(rigid, velocity_of(new))
        energies = {"kinetic_energy": end + of_rigid, "strain_energy": strain(new)}
        if not moves:
            return {**energies, "contact_loss": 0.0, "energy_error": 0.0}
        _, free = _velocities_of(state, ended)
        before = _kinetic(model, _velocity(state))
        before += energy(rigid, velocity_of(state)) - of_rigid
        unheld = _kinetic(model, free)
        step = (new.displacement - state.displacement)[:owned]
        work = _sum(model, (ended.loads.forces - _half_change(ended.loads.forces, state)) @ step)
        if ended.loads.drives:
            driven = free_motion(rigid, new.rigid - state.rigid)
            work += float(mean_loads(rigid, state, ended.loads.drives) @ driven)
        pressed, lost = self._contact_work(state, new, ended)
        supported = self._support_work(step, ended)
        # The change of the energies before contact takes any is the work of loads and supports less
        # that of the contact forces.
        change = unheld - before + energies["strain_energy"] - strain(state)
        largest = max(float(new.fields["energy"].values[0]), abs(work), abs(pressed))
        error = change - work - supported + pressed
        return {
            **energies,
            "contact_loss": lost + unheld - end,
            "energy_error": error / largest if largest else 0.0,
        }

    @staticmethod
    def _contact_work(state: State, new: State, ended: StepEnd) -> tuple[float, float]:
        """Return the work that contact takes from the body in a step: by pressure and shear, and by
        pressure alone.
        """
        contact = ended.contact
        if contact is None:
            return 0.0, 0.0
        model = ended.model
        later, earlier = (
            model.contact.traces(
                model.unknowns_at(of.displacement, free_motion(model.rigid, of.rigid))
            )
            for of in (new, state)
        )
        weight = contact.boundary.weight
        pressure = (weight * contact.pressure) @ (later[0] - earlier[0])
        shear = weight @ inner(contact.shear, later[1] - earlier[1])
        return _sum(model, pressure + shear), _sum(model, pressure)

    @staticmethod
    def _support_work(step: Array, ended: StepEnd) -> float:
        """Return the work of moving supports in a step.

        Args:
            step: displacement of the owned dofs in the step.
            ended: results of the step.
        """
        model = ended.model

        def held(values: Array) -> Array:
            along = model.vector(values).getArray(readonly=True)[: model.fixed.size]
            return np.array(along[model.fixed])

        way = held(step)
        if not parallel.any_rank(model.comm, way):
            return 0.0
        return _sum(model, held(ended.reactions().ravel()) @ way)


# --- parts ----------------------------------------------------------------------------------------


def density_of(given: Expr | ufl.Form | float, space: fem.FunctionSpace) -> Expr | ufl.Form:
    """Return a density, or a mass form, from what the user passes with the forms.

    Raises:
        FormError: it is neither.
    """
    if isinstance(given, ufl.Form):
        spaces = [one.ufl_function_space() for one in given.arguments()]
        if len(spaces) != 2 or any(one != space for one in spaces):
            reason = "must be bilinear on the space of a, where it is a form: the mass"
            raise FormError.at("density", reason)
        return given
    if isinstance(given, int | float) and not isinstance(given, bool) and 0 < given < np.inf:
        return fem.Constant(space.mesh, default_scalar_type(given))
    if isinstance(given, ufl.core.expr.Expr) and not given.ufl_shape:
        return given
    reason = "must be a positive number, UFL without components, or the form of the mass"
    raise FormError.at("density", f"{reason}, not {kind_of(given)}")


def _mass_form(model: Model, factor: float | None = None) -> fem.Form:
    """Return the compiled mass form times a factor, None: 1; collective."""
    space = model.space
    assert model.density is not None
    scale = fem.Constant(space.mesh, default_scalar_type(1.0 if factor is None else factor))
    return compile_form(scale * _mass_of(model.density(), space))


def _mass_of(density: Expr | ufl.Form, space: fem.FunctionSpace) -> ufl.Form:
    """Return the mass form of a density, UFL; a form is returned as it is."""
    if isinstance(density, ufl.Form):
        return density
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    degree = 2 * space.element.basix_element.degree + 2
    return density * ufl.inner(u, v) * ufl.dx(metadata={"quadrature_degree": degree})


def _mass(model: Model) -> tuple[fem.Form, PETSc.Mat]:
    """Return the compiled mass form and the mass matrix, made once; collective."""
    if "mass" not in model.of_mesh:
        form = _mass_form(model)
        model.of_mesh["mass"] = form, sum_of([form], [])
    kept: tuple[fem.Form, PETSc.Mat] = model.of_mesh["mass"]
    return kept


def _times(matrix: PETSc.Mat, values: Array) -> Array:
    """Return a matrix times values at the dofs of this rank, shape (owned dofs,)."""
    return np.array((matrix * vector_like(matrix, values)).getArray(readonly=True))


def _action(form: fem.Form, space: fem.FunctionSpace, values: Array) -> Array:
    """Return the product of a bilinear form with values at the dofs of this rank, shape (owned
    dofs,); collective.
    """
    function = fem.Function(space)
    function.x.array[:] = values
    nodes = np.arange(values.size // space.dofmap.index_map_bs, dtype=np.int32)
    return action((form,), function, nodes)


def _kinetic(model: Model, velocity: Array) -> float:
    """Return the kinetic energy of a velocity; collective."""
    _, matrix = _mass(model)
    return 0.5 * _sum(model, _times(matrix, velocity) @ velocity[: model.fixed.size])


def _energies(state: State) -> Array:
    """Return the largest energy so far, and the strain energy of a nonlinear body."""
    earlier = state.fields.get("energy")
    return np.zeros(2) if earlier is None else earlier.values.astype(np.float64)


def _strain_work(ended: StepEnd, begin: Array, end: Array) -> float:
    """Return the work of the internal forces of a nonlinear body along the straight path from one
    displacement to another; collective.

    It is the difference of the strain energies if the material has one.
    """
    assert ended.internal is not None
    way = end - begin
    points, weights = np.polynomial.legendre.leggauss(_POINTS_OF_WORK)
    forces = [ended.internal(begin + 0.5 * (1.0 + point) * way) for point in points]
    return _sum(ended.model, 0.5 * (weights @ forces) @ way[: ended.model.fixed.size])


def _velocity(state: State) -> Array:
    """Return the velocities of a state at the dofs of this rank, ghosts included, shape (dofs,)."""
    return state.fields["velocity"].values.ravel()


def _with_ghosts(model: Model, owned: Array) -> Array:
    """Return values at all dofs of this rank from those at the owned ones; collective."""
    function = fem.Function(model.space)
    function.x.array[: owned.size] = owned
    function.x.scatter_forward()
    return np.array(function.x.array)


def _sum(model: Model, local: Array) -> float:
    return parallel.total(model.comm, local)


def _aim(state: State, dt: float) -> Array:
    """Return the displacement after half a step with the old velocity, length, shape (dofs,)."""
    return state.displacement + 0.5 * dt * _velocity(state)


def _half_change(forces: Array | float, state: State) -> Array | float:
    """Return the loads at the end of a step minus the mean of both ends, shape (owned dofs,); zero
    if the state has no loads.
    """
    earlier = state.fields.get("load")
    if earlier is None:
        return 0.0 * forces
    return 0.5 * (forces - earlier.values.ravel()[: np.size(forces)])


def _velocities_of(state: State, ended: StepEnd) -> tuple[Array, Array]:
    """Return the mean velocity of a step, and the velocity at its end if no support or friction
    changes it, shapes (dofs,).
    """
    way = ended.solved - state.displacement
    mean = np.asarray((2.0 if ended.internal is None else 1.0) * way / ended.dt)
    return mean, 2.0 * mean - _velocity(state)


def _held_change(model: Model, new: State, change: Array) -> Array:
    """Return the part of changes of the dofs, ghosts included, along prescribed directions, and
    along the tangents of points that stick to a foundation; collective.
    """
    along = model.vector(change)
    along.getArray()[: model.fixed.size][~model.fixed] = 0.0
    held = np.array(model.function(along).x.array)
    values = new.contact
    boundary = model.boundary
    if values is None or boundary is None or model.law is None:
        return held
    sticks = values.contact & ~values.direction.any(axis=1) & model.law.acts
    sticks &= ~np.isin(boundary.part, [*model.pairs, *model.rigid.parts])
    nodes = boundary.nodes[sticks]
    function = fem.Function(model.space)
    function.x.array[:] = held
    at_nodes = function.x.array.reshape(-1, model.dimension)
    moved = change.reshape(at_nodes.shape)[nodes]
    normal = boundary.normal[sticks]
    across = inner(moved, normal)[:, None] * normal
    kept = inner(at_nodes[nodes], normal)[:, None] * normal
    at_nodes[nodes] = moved - across + kept
    function.x.scatter_forward()
    return np.array(function.x.array)


def _with_masses(model: Model, factor: float) -> Model:
    """Return a model whose rigid bodies have additional springs with the stiffness of a factor
    times their masses.
    """
    rigid = model.rigid
    boundary = model.boundary
    if not rigid.bodies or boundary is None or boundary.moving is None:
        return model
    bodies = [heavier(rigid, body, factor) for body in rigid.bodies]
    rigid = replace(rigid, bodies=bodies)
    moving = replace(boundary.moving, stiffness=rigid.stiffness, bodies=bodies)
    return replace(model, rigid=rigid, boundary=replace(boundary, moving=moving))
