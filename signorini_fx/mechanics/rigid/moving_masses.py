"""The inertia of rigid bodies whose motion is an unknown.

In a time step tau of the midpoint rule a mass m acts as a spring of stiffness 4 m / tau^2 at the
pivot with the force 4 m / tau^2 (q_n + tau v_n / 2), where the unknown q is the position in the
middle of the step.  Moments of inertia act likewise.  Newton's method of a nonlinear body solves
for the end of the step instead: 2 m / tau^2 and q_n + tau v_n.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from signorini_fx.arrays import Array
from signorini_fx.errors import SceneError
from signorini_fx.mechanics.rigid.rigid_bodies import Drive, Driven, RigidBodies
from signorini_fx.mechanics.state import State
from signorini_fx.mechanics.statement.rigid_body import COMPONENTS, RigidBody

_VELOCITY = "rigid velocity"
_LOAD = "rigid load"


def masses(rigid: RigidBodies) -> Array:
    """Return the masses of all unknowns, shape (k,); for rotations the moments of inertia
    over L^2.
    """
    dim = rigid.kinematics.dimension
    rows = [body.motion.masses(dim)[: rigid.units.size] / rigid.units**2 for body in rigid.bodies]
    return np.array(rows, dtype=np.float64).ravel()


def refuse_massless(rigid: RigidBodies) -> None:
    """Check that rigid bodies have inertia in all components that are free.

    Raises:
        SceneError: a free component has no mass or moment of inertia.
    """
    dim = rigid.kinematics.dimension
    covered = (rigid.fixed | (masses(rigid) > 0)).reshape(-1, rigid.units.size)
    problems = list[tuple[str, str]]()
    for body, has in zip(rigid.bodies, covered, strict=True):
        named = {"mass": has[:dim].all(), "moment_of_inertia": has[dim:].all()}
        problems += [
            (
                f"contact[{body.parts[0]}].foundation.{key}",
                "is needed by inertia: give it, or prescribe this motion",
            )
            for key, known in named.items()
            if not known
        ]
    if problems:
        raise SceneError(problems)


def heavier(
    rigid: RigidBodies, body: RigidBody, factor: float, **more: float | tuple[float, ...]
) -> RigidBody:
    """Return a rigid body with additional springs of ``factor`` times its masses.

    ``more``: further keys of its motion to be replaced.
    """
    dim = rigid.kinematics.dimension
    stiffness = body.motion.stiffness(dim) + factor * body.motion.masses(dim)
    spring = dict(zip(COMPONENTS[dim], map(float, stiffness), strict=True))
    return replace(body, motion=body.motion.model_copy(update={"spring": spring, **more}))


def driven_to_end(rigid: RigidBodies, state: State, dt: float) -> list[RigidBody]:
    """Return rigid bodies with the springs and forces of inertia that drive them to the end of a
    step.

    This is for nonlinear bodies, where rigid bodies rotate about one axis at most.
    """
    dim = rigid.kinematics.dimension
    count = rigid.units.size
    factor = 2.0 / dt**2
    aim = state.rigid + dt * velocity_of(state)
    loads = mean_loads(rigid, state, rigid.drives()) + factor * masses(rigid) * aim
    rows = loads.reshape(-1, count) * rigid.units
    driven = []
    for number, body in enumerate(rigid.bodies):
        force = tuple(map(float, rows[number]))
        more = {"force": force[:dim], "moment": force[dim:] if dim == 3 else force[dim]}
        driven.append(heavier(rigid, body, factor, **more))
    return driven


def set_in_motion(rigid: RigidBodies, state: State, drives: Sequence[Drive]) -> State:
    """Return a state with the given initial velocities of rigid bodies and with their present
    loads.
    """
    if not rigid.bodies:
        return state
    dim = rigid.kinematics.dimension
    given = [body.motion.velocities(dim)[: rigid.units.size] * rigid.units for body in rigid.bodies]
    return _moving(rigid, state, np.ravel(given), drives)


def _moving(rigid: RigidBodies, state: State, velocity: Array, drives: Sequence[Drive]) -> State:
    state = state.with_field(_VELOCITY, "global", velocity)
    return state.with_field(_LOAD, "global", _together(rigid, drives)[0])


def _together(rigid: RigidBodies, drives: Sequence[Drive]) -> tuple[Array, Array]:
    """Return the loads and the prescribed motions of all unknowns, shapes (k,); nan where a motion
    is free.
    """
    loads, motions = (np.ravel([drive[k] for drive in drives]) for k in (0, 1))
    units = np.tile(rigid.units, len(rigid.bodies))
    return loads / units, motions * units


def velocity_of(state: State) -> Array:
    """Return the velocities of the unknowns of rigid bodies, length / time, shape (k,)."""
    field = state.fields.get(_VELOCITY)
    return np.zeros_like(state.rigid) if field is None else field.values.ravel()


def mean_loads(rigid: RigidBodies, state: State, drives: Sequence[Drive]) -> Array:
    """Return the mean loads of all unknowns over a step that ends with ``drives``, shape (k,)."""
    if not rigid.bodies:
        return np.zeros(0)
    return np.asarray(0.5 * (_together(rigid, drives)[0] + state.fields[_LOAD].values.ravel()))


def in_middle(
    rigid: RigidBodies, state: State, drives: Sequence[Drive], dt: float
) -> tuple[Driven, list[Drive]]:
    """Return the loads, with inertia, and the motions of rigid bodies in the middle of a step: once
    for all unknowns, and once as a list by bodies.
    """
    aim = state.rigid + 0.5 * dt * velocity_of(state)
    forces = mean_loads(rigid, state, drives) + 4.0 / dt**2 * masses(rigid) * aim
    _, motions = _together(rigid, drives)
    motions = 0.5 * (state.rigid + motions)
    units = rigid.units
    each = zip(forces.reshape(-1, units.size), motions.reshape(-1, units.size), strict=True)
    by_body = [(load * units, motion / units) for load, motion in each]
    return Driven(forces, np.nan_to_num(motions)), by_body


def moved_on(
    rigid: RigidBodies, state: State, new: State, drives: Sequence[Drive], dt: float, part: float
) -> State:
    """Return the state at the end of a step, given the unknowns of rigid bodies after a part of it.

    ``part``: the fraction of the step after which ``new`` holds the unknowns, 0.5 for the midpoint.
    """
    if not rigid.bodies:
        return new
    mean = (new.rigid - state.rigid) / (part * dt)
    velocity = np.where(rigid.fixed, mean, 2.0 * mean - velocity_of(state))
    return _moving(rigid, replace(new, rigid=state.rigid + dt * mean), velocity, drives)


def free_motion(rigid: RigidBodies, values: Array) -> Array:
    """Return the unknowns of rigid bodies with zeros for prescribed ones, shape (k,)."""
    return np.where(rigid.fixed, 0.0, values) if rigid.bodies else values


def energy(rigid: RigidBodies, values: Array, stiffness: Array | None = None) -> float:
    """Return the energy of the free unknowns of rigid bodies.

    ``values``, ``stiffness``: displacements and stiffness of springs; without stiffness velocities,
    for the kinetic energy.
    """
    weights = masses(rigid) if stiffness is None else stiffness
    return float(0.5 * weights @ free_motion(rigid, values) ** 2)
