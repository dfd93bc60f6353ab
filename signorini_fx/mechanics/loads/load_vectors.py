"""Loads and prescribed displacements as right-hand sides, grouped by their load factors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import count
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import ufl
from dolfinx import default_scalar_type, fem

from signorini_fx.arrays import Array, Expr, Indices, Value
from signorini_fx.errors import SceneError, together
from signorini_fx.extensions import is_of_package
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import (
    assemble,
    compile_form,
    facet_vertices,
    measure,
)
from signorini_fx.mechanics.contact_points.turned_supports import TurnedNodes
from signorini_fx.mechanics.effects.displacement import Displacement
from signorini_fx.mechanics.elasticity.elastic_law import CellwiseLaw, IsotropicLaw, SceneLaw
from signorini_fx.mechanics.elasticity.moduli import (
    Coefficient,
    cellwise_stiffness,
    check_covers,
    lame_coefficients,
    of_materials,
    reduced_degree,
)
from signorini_fx.mechanics.kinematics import Kinematics
from signorini_fx.mechanics.loads.supports import forces_at_nodes
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.rigid.rigid_bodies import Driven, RigidBodies
from signorini_fx.mechanics.scales import Scales
from signorini_fx.mechanics.statement.effect import (
    Effect,
    ForceDensity,
    InitialStrain,
    Load,
    Resistance,
)
from signorini_fx.mechanics.statement.expressions import Expression, sample
from signorini_fx.mechanics.statement.load_path import factor_at
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.tuned import LARGEST_NUMBER, SAME_NUMBER

if TYPE_CHECKING:
    from signorini_fx.mechanics.effects.loads import Preload


@dataclass(frozen=True)
class AppliedLoad:
    """The loads and prescribed displacements that share one list of load factors, assembled as the
    scene states them.

    Loads that depend on the time are in separate groups, and are assembled for one time.
    """

    # Returns the load factor from a statement and a place in the lists of factors.
    factor: Callable[[Statement, float], float]
    # The compiled terms of L; empty if there are only prescribed displacements.
    forms: tuple[fem.Form, ...]
    forces: Array  # L at the owned dofs, shape (owned dofs,)
    prescribed: fem.Function  # the prescribed displacements, zero at other dofs
    # Assembles the load for the time of another place, collective; None: it does not depend on the
    # time.
    again: Callable[[float], AppliedLoad] | None = None
    driven: Driven | None = None  # forces and motions of rigid bodies; None: there are none
    # Whether its forces balance each other in each cell, as those of initial strains do.
    balanced: bool = False
    entry: Preload | None = None  # the preload whose jump this is; None: it is no jump
    # The term of an initial strain at the owned unknowns of a pressure, volumes; None: initial
    # strains act through ``forces``.
    pressure_load: Array | None = None

    def at(self, step: float) -> AppliedLoad:
        """Return the load at the time of a place in the lists of factors; collective."""
        return self if self.again is None else self.again(step)

    @property
    def pushing(self) -> Array:
        """The forces that may do work on rigid motions, shape (owned dofs,): zero for balanced
        loads, whose work is round-off.
        """
        return np.zeros_like(self.forces) if self.balanced else self.forces


@dataclass(frozen=True)
class FormCoefficients:
    """The values of a scene as UFL, see ``statement.effect.Coefficients``."""

    statement: Statement
    tagged: TaggedMesh
    space: fem.FunctionSpace  # of the displacement; a callable is interpolated at its nodes

    @cached_property
    def _time(self) -> fem.Constant:
        return fem.Constant(self.space.mesh, default_scalar_type(self.statement.time_at(0)))

    def move_to(self, step: float) -> None:
        """Set time-dependent values, and values that effects have computed, to a place in the lists
        of factors.
        """
        self.set_time(self.statement.time_at(step))
        for name, function in self._computed.items():
            function.x.array[:] = getattr(step, "computed", {}).get(name, 0.0)

    def set_time(self, time: float) -> None:
        """Set the time t in expressions."""
        self._time.value = time

    @cached_property
    def _computed(self) -> dict[str, fem.Function]:
        return {}

    def computed(self, name: str) -> fem.Function:
        """Return a nodal field that effects compute, such as the temperature, see
        ``BodyCoefficients``.
        """
        if name not in self._computed:
            space = fem.functionspace(self.space.mesh, ("Lagrange", self.degree))
            self._computed[name] = fem.Function(space)
        return self._computed[name]

    def entries(self, key: str) -> tuple[Effect, ...]:
        """Return the entries of the scene under a key."""
        return self.statement.effects.get(key, ())

    def of_material(self, key: str) -> Coefficient:
        """Return a material parameter: a constant, or a function that is constant in each cell; 0
        where it is not given.
        """
        (number,) = of_materials(
            self.statement, self.tagged, lambda material, _: (getattr(material, key) or 0.0,)
        )
        return number

    @property
    def degree(self) -> int:
        """The polynomial degree of the displacement."""
        return int(self.space.element.basix_element.degree)

    @property
    def normal(self) -> Expr:
        """The outward unit normal, UFL."""
        return ufl.FacetNormal(self.space.mesh)

    @property
    def position(self) -> Expr:
        """The position X, UFL."""
        return ufl.SpatialCoordinate(self.space.mesh)

    @cached_property
    def density(self) -> Coefficient:
        """The mass per volume."""
        return self.of_material("density")

    @cached_property
    def expansion(self) -> Coefficient:
        """The coefficient of thermal expansion."""
        return self.of_material("expansion")

    @cached_property
    def elastic(self) -> SceneLaw:
        """The elastic law with its coefficients; collective.

        Raises:
            SceneError: with all errors of the materials that the mesh reveals.
        """
        of = self.statement, self.tagged, self.space
        lame, stiffness, reduced, _ = together(
            partial(lame_coefficients, self.statement, self.tagged),
            partial(cellwise_stiffness, self.statement, self.tagged),
            partial(reduced_degree, self.statement, self.tagged.mesh),
            partial(check_covers, self.statement, self.tagged),
        )
        if self.statement.element.pressed:
            from signorini_fx.mechanics.elasticity.mixed_pressure import MixedLaw

            return MixedLaw(*of, lame)
        return (
            IsotropicLaw(*of, lame, None, reduced)
            if stiffness is None
            else CellwiseLaw(*of, lame, stiffness)
        )

    def value_in(self, region: str | None, value: Value) -> Expr:
        """Return a value in the cells of a region, 0 in the others; see ``BodyCoefficients``."""
        if region is None:
            return self.value(value)
        cells = self.tagged.cells(region)
        indicator = fem.Function(fem.functionspace(self.space.mesh, ("DG", 0)))
        indicator.x.array[indicator.function_space.dofmap.list[cells, 0]] = 1.0
        return indicator * self.value(value, cells)

    @cached_property
    def _totals(self) -> dict[tuple[str, Value], fem.Constant]:
        return {}

    @property
    def around(self) -> Expr | float:
        """The factor of areas and lengths of the mesh, see ``Kinematics.measure``."""
        return self.kinematics.measure(self.position)

    @property
    def kinematics(self) -> Kinematics:
        """The kinematics of the body."""
        return self.statement.kinematics_in(self.tagged.dimension)

    def total(self, effect: Any) -> fem.Constant:
        """Return the integral of ``effect.spread`` over the boundary of the effect; collective.

        Raises:
            SceneError: it is zero.
        """
        boundary = str(effect.where)
        spread = effect.spread
        mesh = self.space.mesh
        if (boundary, spread) not in self._totals:
            form = _compiled([effect], lambda effect: self.value(effect.spread), self)
            assert form is not None  # the effect has a boundary
            integral = parallel.total(mesh.comm, fem.assemble_scalar(form))
            corners = facet_vertices(mesh, self.tagged.facets(boundary))
            largest = parallel.largest(mesh.comm, np.abs(sample(spread, corners.reshape(-1, 3).T)))
            size = self.tagged.size
            scales = Scales(
                self.tagged.dimension, self.statement.young, size, self.kinematics.depth(size)
            )
            if not abs(integral) > SAME_NUMBER * largest * scales.surface:
                wrong = f"its integral over {boundary!r} is {integral:g}: it must not be 0"
                raise SceneError.at(f"{self.path(effect)}.spread", wrong)
            self._totals[boundary, spread] = fem.Constant(mesh, default_scalar_type(integral))
        return self._totals[boundary, spread]

    def path(self, effect: Effect) -> str:
        """Return the path of an effect in the scene, for messages."""
        return next(
            (path for path, entry in self.statement.listed() if entry is effect), effect.label
        )

    def value(self, value: Value, cells: Indices | None = None) -> Expr:
        """Return a value as a coefficient, UFL.

        Args:
            value: a number, an expression, UFL, or a callable, which is interpolated.
            cells: where a callable is interpolated; None: in all cells.

        Raises:
            SceneError: a callable fails.
        """
        mesh = self.space.mesh
        if isinstance(value, float):
            return fem.Constant(mesh, default_scalar_type(value))
        if isinstance(value, Expression):
            return value.ufl(mesh, self._time)
        if hasattr(value, "ufl_domain"):
            return value
        function = fem.Function(fem.functionspace(mesh, ("Lagrange", self.degree)))
        error: SceneError | None = None
        try:
            function.interpolate(lambda x: sample(value, x), cells0=cells)
        except Exception as failure:  # of a user's function, perhaps on one rank only
            keys = (
                (at, key, entry)
                for at, effect in self.statement.listed()
                for key, entry in vars(effect).items()
            )
            path = next((f"{at}.{key}" for at, key, entry in keys if entry is value), "scene")
            error = SceneError.at(
                path, f"cannot be evaluated at the nodes of the whole mesh: {failure}"
            )
        parallel.raise_together(mesh.comm, error)
        return function

    def vector(self, values: Sequence[Value]) -> Expr:
        """Return values along the axes as a UFL vector, shape (d,)."""
        return ufl.as_vector(
            [self.value(value) for value in values[: self.space.mesh.geometry.dim]]
        )


def measures(effects: Sequence[Effect], tagged: TaggedMesh) -> list[ufl.Measure]:
    """Return the integration measure of each effect: over the body, or over the facets of its
    boundary.
    """
    ds = measure(
        tagged.mesh,
        [tagged.facets(effect.where) for effect in effects if effect.where is not None],
        {},
    )
    number = count(1)
    return [ufl.dx if effect.where is None else ds(next(number)) for effect in effects]


# What loads of one vector have in common: their list of factors, None for loads that depend on the
# time and have no factors; whether they depend on the time; and whether they are balanced, see
# ``AppliedLoad``.
LoadGroup = tuple[Sequence[float] | None, bool, bool]
_Effect = TypeVar("_Effect", bound=Effect)
_Load = TypeVar("_Load", bound=Load)


def load_groups(statement: Statement, loads: Sequence[_Load]) -> dict[LoadGroup, list[_Load]]:
    """Return the loads grouped by what they share, see ``LoadGroup``.

    Loads that are zero, or that ``initial_strains`` assembles, are left out.
    """
    groups: dict[LoadGroup, list[_Load]] = {}
    for load in loads:
        if load.acts and load.grouped:
            factors = load.factors if load.timed else statement.factors_of(load)
            groups.setdefault((factors, load.timed, isinstance(load, InitialStrain)), []).append(
                load
            )
    return groups


# Returns prescribed displacements and supports along no axis, with their values at a place.
SupportsAt = Callable[
    [float], tuple[list[tuple[Displacement, fem.DirichletBC]], TurnedNodes | None]
]


def applied_load(
    group: LoadGroup,
    loads: list[Load],
    on: FormCoefficients,
    z: Expr,
    supports: SupportsAt,
    compiled: tuple[fem.Form, ...] | None = None,
    step: float = 0,
) -> AppliedLoad:
    """Compile and assemble the loads and prescribed displacements of a group at a place in the
    lists of factors; collective.

    Args:
        group: what the loads share.
        loads: the loads and supports of the group.
        on: the values of the scene.
        z: the test function of L.
        supports: returns the supports at a place.
        compiled: the forms, if they have been compiled for an earlier place; None: they have not.
        step: the place.
    """
    factors, timed, balanced = group
    space = on.space
    on.move_to(step)
    forms = compile_loads(loads, on, z) if compiled is None else compiled
    prescribed = fem.Function(space)
    axes, turned = supports(step)
    for effect, support in axes:  # the later one applies where two meet
        dofs, _ = support.dof_indices()
        prescribed.x.array[dofs] = 0.0
        if any(effect is one for one in loads):
            support.set(prescribed.x.array)
            prescribed.x.scatter_forward()
    if turned is not None:
        turned.place(prescribed.x.array.reshape(-1, space.mesh.geometry.dim), loads)
    owned = space.dofmap.index_map.size_local * space.dofmap.index_map_bs
    forces: Array
    forces, pressure_load = (
        on.elastic.assembled(forms, owned)
        if balanced
        else (sum(map(assemble, forms), np.zeros(owned)), None)
    )
    for load in loads:
        if load.nodal:
            forces = forces + forces_at_nodes(
                on.statement.now(load, step)[1], on.path(load), space, on.tagged
            )
    # No closure that refers to itself: such a cycle keeps the mesh in memory until the garbage
    # collector runs.
    reassemble = partial(applied_load, group, loads, on, z, supports, forms) if timed else None
    return AppliedLoad(
        _factor(factors),
        forms,
        forces,
        prescribed,
        reassemble,
        balanced=balanced,
        pressure_load=pressure_load,
    )


def _factor(factors: Sequence[float] | None) -> Callable[[Statement, float], float]:
    """Return ``AppliedLoad.factor`` for a list of factors; without a list the factor is 1."""
    return lambda statement, step: 1.0 if factors is None else factor_at(factors, step)


def driving_load(
    rigid: RigidBodies, number: int, statement: Statement, space: fem.FunctionSpace, step: float = 0
) -> AppliedLoad:
    """Return the forces and motions that drive one rigid body, at the time of a place in the lists
    of factors; collective.

    Args:
        rigid: all rigid bodies.
        number: of the rigid body.
        statement: the entries of the scene.
        space: of the displacement.
        step: the place.
    """
    timed = rigid.bodies[number].motion.driven_in_time
    return AppliedLoad(
        _factor(None if timed else (1.0,) * statement.steps),
        (),
        np.zeros(space.dofmap.index_map.size_local * space.dofmap.index_map_bs),
        fem.Function(space),
        partial(driving_load, rigid, number, statement, space) if timed else None,
        rigid.driven(statement.time_at(step), number),
    )


def compile_loads(loads: Sequence[Load], on: FormCoefficients, z: Expr) -> tuple[fem.Form, ...]:
    """Return the compiled terms of L of section 2.1, (f, z) and (h, z) in one form, or those of
    initial strains.
    """
    if strains := [load for load in loads if isinstance(load, InitialStrain)]:
        total_strain = sum(_asked(strain, "strain", on) for strain in strains)
        terms = on.elastic.strain_terms(z, total_strain, strains[0].degree(on.degree))
        return tuple(map(compile_form, terms))
    formed = (load for load in loads if isinstance(load, ForceDensity) and not load.nodal)
    forces = sorted(formed, key=lambda load: load.where is not None)
    return (
        (_compiled(forces, lambda load: ufl.inner(_asked(load, "density", on), z), on),)
        if forces
        else ()
    )


def compile_resistance(
    acting: Sequence[Resistance], on: FormCoefficients, y: Expr, z: Expr
) -> fem.Form | None:
    """Return the compiled terms of a(y, z) by which effects resist displacements of the boundary;
    None if there are no such effects.
    """
    return (
        _compiled(acting, lambda effect: ufl.inner(_asked(effect, "reaction", on, y), z), on)
        if acting
        else None
    )


def _asked(effect: Effect, method: str, on: FormCoefficients, *arguments: Expr) -> Expr:
    """Return the UFL value of a method of an effect.

    Raises:
        SceneError: a method of an effect of another package fails, or returns another shape.
    """
    if is_of_package(type(effect)):
        return getattr(effect, method)(*arguments, on)
    name = type(effect).__name__
    wanted = () if method == "strain" else (len(on.position),)
    try:
        value = ufl.as_ufl(getattr(effect, method)(*arguments, on))
    except NotImplementedError:
        reason = f"{name} must define {method}()"
    except Exception as error:
        reason = f"{method} of {name} fails: {type(error).__name__}: {error}"
    else:
        if value.ufl_shape == wanted:
            return value
        reason = f"{method} of {name} has the shape {value.ufl_shape}, not {wanted}"
    raise SceneError.at(on.path(effect), reason)


def _compiled(
    effects: Sequence[_Effect], integrand: Callable[[_Effect], Expr], on: FormCoefficients
) -> fem.Form:
    """Return the compiled sum of the integrals of effects, each over its boundary or the body."""
    where = measures(effects, on.tagged)
    terms = [
        integrand(effect) * on.around * d(metadata={"quadrature_degree": effect.degree(on.degree)})
        for effect, d in zip(effects, where, strict=True)
    ]
    return compile_form(sum(terms[1:], terms[0]))


def finite(load: AppliedLoad) -> bool:
    """Return whether the squares of forces and prescribed displacements are finite on this rank."""
    forces = load.forces if load.pressure_load is None else load.pressure_load
    small = np.abs(load.prescribed.x.array) <= LARGEST_NUMBER
    return bool(small.all() and (np.abs(forces) <= LARGEST_NUMBER**2).all())
