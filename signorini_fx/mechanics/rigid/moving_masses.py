"""The inertia of rigid bodies whose motion is an unknown.

In a time step of the midpoint rule a mass m is a spring of stiffness 4 m / tau^2 at the pivot, and
the force 4 m / tau^2 (q_n + tau v_n / 2) that it has there, likewise a moment of inertia: for q,
the place in the middle of the step.  Newton's method of a nonlinear body finds the end of the step:
2 m / tau^2 and q_n + tau v_n.
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
    """Return the masses of all unknowns, of rotations moments of inertia over L^2, shape (k,)."""
    dim = rigid.kinematics.dimension
    rows = [body.motion.masses(dim)[: rigid.units.size] / rigid.units**2 for body in rigid.bodies]
    return np.array(rows, dtype=np.float64).ravel()


def refuse_massless(rigid: RigidBodies) -> None:
    """Refuse rigid bodies that are free to move where they have no inertia.

    Raises:
        SceneError: there is one.
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
    """Return a rigid body with springs of a factor times its masses, and other keys of its
    motion.
    """
    dim = rigid.kinematics.dimension
    stiffness = body.motion.stiffness(dim) + factor * body.motion.masses(dim)
    spring = dict(zip(COMPONENTS[dim], map(float, stiffness), strict=True))
    return replace(body, motion=body.motion.model_copy(update={"spring": spring, **more}))


def driven_to_end(rigid: RigidBodies, state: State, dt: float) -> list[RigidBody]:
    """Rigid bodies with what drives them to the end of a step, beside a nonlinear body, where they
    turn about one axis at most.
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
    """Return a state from which rigid bodies move with the velocities that are given, under
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
    """Return loads and prescribed motions of all unknowns, nan where they are free, shapes (k,)."""
    loads, motions = (np.ravel([drive[k] for drive in drives]) for k in (0, 1))
    units = np.tile(rigid.units, len(rigid.bodies))
    return loads / units, motions * units


def velocity_of(state: State) -> Array:
    """Return the velocities of the unknowns of rigid bodies, length / time, shape (k,)."""
    field = state.fields.get(_VELOCITY)
    return np.zeros_like(state.rigid) if field is None else field.values.ravel()


def mean_loads(rigid: RigidBodies, state: State, drives: Sequence[Drive]) -> Array:
    """Return the mean loads of all unknowns in a step that ends with drives, shape (k,)."""
    if not rigid.bodies:
        return np.zeros(0)
    return np.asarray(0.5 * (_together(rigid, drives)[0] + state.fields[_LOAD].values.ravel()))


def in_middle(
    rigid: RigidBodies, state: State, drives: Sequence[Drive], dt: float
) -> tuple[Driven, list[Drive]]:
    """Return what drives rigid bodies in the middle of a step, by their unknowns and for each."""
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
    """Return the end of a step whose unknowns of rigid bodies are those after a part of it."""
    if not rigid.bodies:
        return new
    mean = (new.rigid - state.rigid) / (part * dt)
    velocity = np.where(rigid.fixed, mean, 2.0 * mean - velocity_of(state))
    return _moving(rigid, replace(new, rigid=state.rigid + dt * mean), velocity, drives)


def free_motion(rigid: RigidBodies, values: Array) -> Array:
    """Return unknowns of rigid bodies without those that are prescribed, which others move, shape
    (k,).
    """
    return np.where(rigid.fixed, 0.0, values) if rigid.bodies else values


def energy(rigid: RigidBodies, values: Array, stiffness: Array | None = None) -> float:
    """Return the energy of the motions that are free, of springs or, None, of the masses at
    velocities.
    """
    weights = masses(rigid) if stiffness is None else stiffness
    return float(0.5 * weights @ free_motion(rigid, values) ** 2)
