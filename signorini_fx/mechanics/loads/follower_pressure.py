"""Pressure that follows a body at finite strains: along the inward normal of the deformed boundary,
per deformed area.

Per undeformed area it is, by Nanson's formula, the traction -p cof(F) N with cof(F) = J F^-T.  Its
tangent is not symmetric where p varies, or where its boundary ends at a free edge (K. Schweizerhof,
E. Ramm, Comput. Struct. 18 (1984) 1099-1114).  Centrifugal forces follow the body too: they depend
on displaced positions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem

from signorini_fx.arrays import Expr
from signorini_fx.mechanics.effects.loads import Traction
from signorini_fx.mechanics.kinematics import AXISYMMETRIC, CARTESIAN, Kinematics, position
from signorini_fx.mechanics.loads.load_vectors import FormCoefficients
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.effect import Effect, ForceDensity, is_zero
from signorini_fx.mechanics.statement.statement import Statement


def follower_pressure(
    pressure: Expr | float, u: fem.Function, *, axisymmetric: bool = False
) -> Expr:
    """Return the traction of a pressure on the deformed boundary, per undeformed area, UFL, a
    stress, shape (d,).

        F -= ufl.inner(follower_pressure(p, u), v) * ds(1)

    Args:
        pressure: p, positive where it pushes on the body; a number, a Constant, or anything of UFL.
        u: the displacement, length.
        axisymmetric: whether the mesh is half of a section, x[0] is the radius, and the integral
            has its factor.

    Examples:
        >>> u = fem.Function(fem.functionspace(block.mesh, ("Lagrange", 1, (2,))))
        >>> traction = sfx.follower_pressure(3.0, u)
        >>> n = ufl.FacetNormal(block.mesh)
        >>> print(round(fem.assemble_scalar(fem.form(ufl.inner(traction, n) * ufl.ds)), 6))
        -18.0
    """
    kinematics = (
        AXISYMMETRIC if axisymmetric else CARTESIAN[int(u.function_space.mesh.geometry.dim)]
    )
    return _traction(pressure, u, kinematics)


def _traction(pressure: Expr | float, u: fem.Function, kinematics: Kinematics) -> Expr:
    mesh = u.function_space.mesh
    dim = len(u)
    gradient = ufl.Identity(3) + kinematics.gradient(u)
    outward = ufl.FacetNormal(mesh)
    normal = ufl.as_vector([outward[k] if k < dim else 0 for k in range(3)])
    along = ufl.cofac(gradient) * normal
    return -pressure * ufl.as_vector([along[k] for k in range(dim)])


def following(statement: Statement) -> list[Traction]:
    """Return the tractions of a statement whose pressure follows the body; none if materials have
    small strains.
    """
    tractions = statement.effects.get("traction", ()) if statement.finite_strains else ()
    return [traction for traction in tractions if not is_zero(traction.pressure)]


def carried_loads(statement: Statement) -> list[ForceDensity]:
    """Return the body forces of a statement that depend on displaced positions; none if materials
    have small strains.
    """
    forces = statement.of(ForceDensity) if statement.finite_strains else []
    return [force for force in forces if force.carried and force.acts]


@dataclass(frozen=True)
class _DisplacedCoefficients(FormCoefficients):
    """The values of a scene at material points, with the displaced ``position``."""

    displacement: fem.Function

    @property
    def position(self) -> Expr:
        """The displaced position X + u, UFL."""
        return super().position + self.displacement


def without_followers(statement: Statement) -> Statement:
    """Return the statement without pressures and body forces that follow the body."""
    leaving, pressed = ([*map(id, of(statement))] for of in (carried_loads, following))

    def kept(entries: tuple[Effect, ...]) -> tuple[Effect, ...]:
        staying = (entry for entry in entries if id(entry) not in leaving)
        return tuple(
            entry.model_copy(update={"pressure": 0.0}) if id(entry) in pressed else entry
            for entry in staying
        )

    return statement.changed(**{key: kept(entries) for key, entries in statement.effects.items()})


@dataclass(frozen=True)
class Followers:
    """The loads of a scene that follow the body."""

    works: Sequence[ufl.Form]  # minus the virtual work of each, as in a residual
    effects: Sequence[ForceDensity]  # the tractions with a pressure, then centrifugal forces
    factors: Sequence[fem.Constant]  # their current load factors
    on: FormCoefficients  # their values at the current time

    @classmethod
    def of(
        cls,
        statement: Statement,
        tagged: TaggedMesh,
        u: fem.Function,
        ds: ufl.Measure,
        dx: ufl.Measure,
    ) -> Followers:
        """Return the follower loads of a statement at the displacement ``u``.

        Args:
            statement: the entries of the scene.
            tagged: the mesh.
            u: the displacement.
            ds: surface measure; ``ds(1)`` and so on are the boundaries of the pressures.
            dx: volume measure.
        """
        pressures = following(statement)
        carried = carried_loads(statement)
        mesh = u.function_space.mesh
        effects = [*pressures, *carried]
        element = statement.element.degree
        on = _DisplacedCoefficients(statement, tagged, u.function_space, u)
        factors = [fem.Constant(mesh, np.float64(0.0)) for _ in effects]
        v = ufl.TestFunction(u.function_space)
        around = on.kinematics.measure(position(u))
        loads = [
            (
                _traction(on.value(effect.pressure), u, on.kinematics),
                ds(number),
                effect.degree(element) + element,
            )
            for number, effect in enumerate(pressures, start=1)
        ]
        loads += [(effect.density(on), dx, effect.degree(element)) for effect in carried]
        works = [
            -factor * ufl.inner(load, v) * around * part(metadata={"quadrature_degree": degree})
            for factor, (load, part, degree) in zip(factors, loads, strict=True)
        ]
        return cls(works, effects, factors, on)

    def move_to(self, step: float) -> None:
        """Set the loads to their values at a place in the lists of factors."""
        self.on.move_to(step)
        for effect, factor in zip(self.effects, self.factors, strict=True):
            factor.value = self.on.statement.now(effect, step)[0]
