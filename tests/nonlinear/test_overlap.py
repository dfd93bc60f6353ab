"""Shapes that a step leads into the body, or through it: never *converged*, halved by a ramp, or
seen in time.
"""

import numpy as np
import pytest
from mpi4py import MPI
from scene_tables import circle_shape
from support.nonlinear_bodies import under_shape

from signorini_fx import ConvergenceError, Status

BALL = circle_shape((1.52, 1.051), 0.05)
POST = {"corner": (0.5, 2.0), "cells": (3, 10), "sides": ((0, 0.0), (0, 0.5), (1, 2.0))}


@pytest.mark.mpi
@pytest.mark.one_quick("degree", [1, 2])
def test_a_circle_that_is_moved_into_the_body_in_one_step(degree):
    """No node lies in it, and the residual is zero: all is left as it was before."""
    found = under_shape(BALL, (4.0, 1.0), (16, 4), degree=degree, comm=MPI.COMM_WORLD)
    found.place(0, shift=(0.0, -0.3))
    with pytest.raises(
        ConvergenceError, match=r"rigid shape inside the body \(contact\[0\]: 0\.0\d+ at \(1\.5"
    ):
        found.solve()
    assert found.status is Status.INSIDE
    assert not found.u.x.array.any()
    found.place(0, shift=(0.0, -0.01))
    assert found.solve() is found.u
    assert found.status is Status.CONVERGED


@pytest.mark.one_quick(
    "shape",
    [
        {"shape": "circle", "centre": (-2.0, 1.5), "radius": 0.3},
        {"shape": "cone", "tip": (-2.0, 1.03), "axis": (0.0, 1.0), "angle": 20.0},
        {"shape": "polyline", "points": ((-1.0, 4.0), (-2.0, 1.03), (-3.0, 4.0))},
    ],
    ids=lambda shape: shape["shape"],
)
def test_the_way_through_a_body(shape):
    """A ball or a tip that is led through a post in one step has passed through it; around it, it
    has not.
    """
    found = under_shape(shape, **POST)
    found.solve()
    found.place(0, shift=(5.0, 0.0))
    with pytest.raises(
        ConvergenceError, match=r"rigid shape inside the body \(contact\[0\]: during the step, "
    ):
        found.solve()
    for place in ((0.0, 2.0), (5.0, 2.0), (5.0, 0.0)):
        found.place(0, shift=place)
        found.solve()
    assert found.status is Status.CONVERGED


@pytest.mark.one_quick("steps", [1, 24])
def test_a_post_is_not_passed_through(steps):
    """A circle that moves through a post bends it: the force is not zero in steps that touch it."""
    found = under_shape(circle_shape((-4.0, 1.5), 0.3), **POST)
    forces = []

    def on_step(step):
        forces.append((step.time, found.state.forces[0][0]))

    times = np.linspace(0.0, 0.49, steps + 1)[1:]
    found.run(times, lambda t: found.place(0, shift=(8.0 * t, 0.0)), on_step=on_step)
    assert forces[-1][0] == 0.49
    assert forces[-1][1] > 0.05


@pytest.mark.one_quick
def test_a_way_into_the_body_says_so():
    """The reason of its last step comes first, with the time, and the time that has a solution."""
    found = under_shape(BALL, (4.0, 1.0), (16, 4))
    reason = (
        r"^rigid shape inside the body \(contact\[0\]: .*\): at time 0\.1\d*; there is a "
        r"solution at time 0\.09\d*\. A"
    )
    with pytest.raises(ConvergenceError, match=reason):  # into it from 0.1 on
        found.run([1.0], lambda t: found.place(0, shift=(0.0, -0.03 * t if t < 0.1 else -0.3)))
    assert found.status is Status.INSIDE
