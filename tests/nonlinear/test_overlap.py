"""Shapes that a step leads into the body, or through it: never *converged*, halved by a ramp, or seen in time."""

import meshio
import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI
from support.nonlinear_bodies import held, rectangle, residual

from signorini_fx import ConvergenceError, FormError, Foundation, NonlinearContactProblem, Status
from signorini_fx.mechanics.obstacles.users_shapes import on_way


def problem(corner, cells, circle, sides=((1, 1.0),), degree=1, comm=MPI.COMM_SELF):
    """A body that is held at its bottom, and a circle at some of its sides."""
    space, side = rectangle(corner, cells, comm, degree=degree)
    touching = np.unique(np.concatenate([side(*where) for where in sides]))
    u = fem.Function(space)
    shape = {"shape": "circle", **circle}
    contact = Foundation(touching, shape=shape)
    return NonlinearContactProblem(residual(u), u, bcs=[held(space, side(1, 0.0))], contact=contact)


@pytest.mark.one_quick
@pytest.mark.mpi
@pytest.mark.parametrize("degree", [1, 2])
def test_a_circle_that_is_moved_into_the_body_in_one_step(degree):
    """No node lies in it, and the residual is zero: all is left as it was before."""
    circle = {"centre": (1.52, 1.051), "radius": 0.05}
    found = problem((4.0, 1.0), (16, 4), circle, degree=degree, comm=MPI.COMM_WORLD)
    found.place(0, shift=(0.0, -0.3))
    with pytest.raises(ConvergenceError, match=r"rigid shape inside the body \(contact\[0\]: 0\.0\d+ at \(1\.5"):
        found.solve()
    assert found.status is Status.INSIDE
    assert not found.u.x.array.any()
    found.place(0, shift=(0.0, -0.01))
    assert found.solve() is found.u
    assert found.status is Status.CONVERGED


class Ball:
    """A circle that says its distance alone, and how far it has moved."""

    def __init__(self, centre, radius):
        self.centre, self.radius = np.array(centre), radius

    def distance(self, x):
        away = x - self.centre
        far = np.linalg.norm(away, axis=1)
        return far - self.radius, away / far[:, None]

    def placed(self, shift):
        moved = type(self)(self.centre, self.radius)
        moved.begun = getattr(self, "begun", self.centre)
        moved.centre = moved.begun + np.array(shift)
        return moved

    def moved_from(self, earlier, x):
        return np.broadcast_to(self.centre - earlier.centre, x.shape)


def with_shape(shape, corner=(1.0, 1.0), cells=(10, 10), sides=((1, 1.0),), comm=MPI.COMM_SELF):
    """A body that is held at its bottom, and a shape at some of its sides."""
    space, side = rectangle(list(corner), list(cells), comm)
    touching = np.unique(np.concatenate([side(*where) for where in sides]))
    u = fem.Function(space)
    contact = Foundation(touching, shape=shape)
    return NonlinearContactProblem(residual(u), u, bcs=[held(space, side(1, 0.0))], contact=contact)


@pytest.mark.one_quick
@pytest.mark.mpi
@pytest.mark.parametrize("radius", [0.05, 0.01, 0.002])
def test_a_shape_of_a_users_own_that_does_not_say_how_large_it_is(radius):
    """Is seen where no node is in it, however small it is beside cells; on its way too, and in time by a ramp."""
    found = with_shape(Ball((0.551, 1.0 + 1.05 * radius), radius), comm=MPI.COMM_WORLD)
    for depth, way in ((0.448, ""), (1.6, "on its way, ")):
        found.place(0, shift=(0.0, -depth))
        with pytest.raises(ConvergenceError, match=rf"rigid shape inside the body \(contact\[0\]: {way}0\.0"):
            found.solve()
    found.place(0, shift=(0.0, 0.5))
    found.solve()


def test_a_shape_of_a_users_own_that_turns():
    """On its way round a pivot it is in the body, at both ends it is not."""

    class Swinging(Ball):
        angle = 0.0

        def placed(self, rotation):
            moved = type(self)(self.centre, self.radius)
            moved.angle = rotation
            moved.centre = np.array([0.5, 0.5]) + 0.9 * np.array([-np.cos(rotation), np.sin(rotation)])
            return moved

        def moved_from(self, earlier, x):
            turn = earlier.angle - self.angle  # back, clockwise
            back = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
            signed, normal = self.distance(x)
            closest = x - signed[:, None] * normal - 0.5
            return closest - closest @ back.T

    turned = Swinging((-0.4, 0.5), 0.03)
    for share in (0.0, 0.25, 1.0):
        end = turned.placed(rotation=3.0)
        between = on_way(MPI.COMM_SELF, end, turned, share, np.array([[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.2, 0.4]]))
        centre = turned.placed(rotation=3.0 * share).centre
        signed, normal = between.distance(centre[None] + [[0.05, 0.0]])
        assert signed == pytest.approx([0.02])
        assert normal[0] == pytest.approx([1.0, 0.0])


def test_what_a_shape_of_a_users_own_must_have():
    """One that moves by itself, by ``placed`` itself, or does not say how far, is refused: its way is not known."""
    ball = Ball((0.5, 1.2), 0.02)
    found = with_shape(ball)
    found.solve()
    ball.centre = np.array([0.5, 0.5])
    with pytest.raises(
        FormError, match=r"contact\[0\].shape: Ball has changed by itself, so that its way is not known"
    ):
        found.solve()
    ball.centre = np.array([0.5, 1.2])
    found.solve()

    class Itself(Ball):
        def placed(self, shift):
            self.centre = np.array(shift)
            return self

    class Silent(Ball):
        moved_from = property()

    for shape, wrong in ((Itself, "placed of Itself changes the shape itself"), (Silent, "Silent needs moved_from")):
        with pytest.raises(FormError, match=wrong):
            with_shape(shape((0.5, 1.2), 0.02)).place(0, shift=(0.0, 0.5))


POST = {"corner": (0.5, 2.0), "cells": (3, 10), "sides": ((0, 0.0), (0, 0.5), (1, 2.0))}


@pytest.mark.one_quick
@pytest.mark.parametrize(
    "shape",
    [
        {"shape": "cone", "tip": (-2.0, 1.03), "axis": (0.0, 1.0), "angle": 20.0},
        {"shape": "edge", "point": (-2.0, 1.03), "normals": ((-1.0, -0.3), (1.0, -0.3))},
        {"shape": "polyline", "points": ((-1.0, 4.0), (-2.0, 1.03), (-3.0, 4.0))},
        {"shape": "spline", "points": ((-1.0, 4.0), (-1.7, 2.0), (-2.0, 1.03), (-2.3, 2.0), (-3.0, 4.0))},
    ],
    ids=lambda shape: shape["shape"],
)
def test_the_way_of_what_has_no_largest_ball(shape):
    """A tip that is led through a post in one step has passed through it; around it, it has not."""
    found = with_shape(shape, **POST)
    found.solve()
    found.place(0, shift=(5.0, 0.0))
    with pytest.raises(ConvergenceError, match=r"rigid shape inside the body \(contact\[0\]: on its way, 0\."):
        found.solve()
    for place in ((0.0, 2.0), (5.0, 2.0), (5.0, 0.0)):
        found.place(0, shift=place)
        found.solve()
    assert found.status is Status.CONVERGED


@pytest.mark.slow
@pytest.mark.parametrize("angle", [30.0, 75.0])
def test_a_tip_that_slides_far_in_one_step(angle):
    """Over many cells, in its dent: between both ends the body is not flat, as it is on the straight way."""
    wedge = {"shape": "cone", "angle": angle, "tip": (0.5, 1.01), "axis": (0.0, 1.0)}
    found = with_shape(wedge, (3.0, 1.0), (48, 16))
    found.place(0, shift=(0.0, -0.13))
    found.solve()
    found.advance()
    found.place(0, shift=(2.0, -0.13))
    found.u.x.array[:] = 0.0
    found.solve()
    assert found.status is Status.CONVERGED
    assert found.state.forces[0][1] < 0.0


def test_a_surface_of_a_file_that_is_moved_into_the_body(tmp_path):
    """As a circle, and out of it on the other side."""
    x = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    meshio.write(tmp_path / "square.vtu", meshio.Mesh(0.05 * x + [1.52, 1.051, 0.0], {"quad": np.array([range(4)])}))
    found = problem((4.0, 1.0), (16, 4), {"shape": "surface", "file": tmp_path / "square.vtu"})
    for depth, way in ((0.3, ""), (1.5, "on its way, ")):
        found.place(0, shift=(0.0, -depth))
        with pytest.raises(ConvergenceError, match=rf"rigid shape inside the body \(contact\[0\]: {way}0\.0"):
            found.solve()
    found.place(0, shift=(0.0, 0.5))
    found.solve()


@pytest.mark.one_quick
@pytest.mark.parametrize("first", [None, 0.02])
def test_a_post_is_not_passed_through(first):
    """A circle that a ramp moves through a post bends it: the force is not zero in steps that touch it."""
    sides = ((0, 0.0), (0, 0.5), (1, 2.0))
    found = problem((0.5, 2.0), (3, 10), {"centre": (-4.0, 1.5), "radius": 0.3}, sides)
    forces = []

    def on_step(step):
        forces.append((step.load, found.state.forces[0][0]))

    found.ramp(lambda t: found.place(0, shift=(8.0 * t, 0.0)), 0.49, first=first, on_step=on_step)
    assert forces[-1][0] == 0.49
    assert forces[-1][1] > 0.05


def test_a_step_through_is_refused():
    """After a solution on one side there is none on the other, however free of overlap both are."""
    sides = ((0, 0.0), (0, 0.5), (1, 2.0))
    found = problem((0.5, 2.0), (2, 8), {"centre": (-1.0, 1.5), "radius": 0.3}, sides)
    found.solve()
    found.place(0, shift=(3.0, 0.0))
    with pytest.raises(ConvergenceError, match=r"rigid shape inside the body \(contact\[0\]: on its way, "):
        found.solve()
    for place in ((0.0, 2.0), (3.0, 2.0), (3.0, 0.0)):  # around it
        found.place(0, shift=place)
        found.solve()
    assert found.status is Status.CONVERGED


def test_a_wedge():
    """One that comes in from a side that is in no contact is in the body; a sharp one that dents the top is not, though
    the facet at its tip is a chord.
    """
    wedge = {"shape": "cone", "angle": 30.0}
    space, side = rectangle((2.0, 1.0), (12, 6), MPI.COMM_SELF)
    u = fem.Function(space)

    def led(tip, axis):
        contact = Foundation(side(1, 1.0), shape=wedge | {"tip": tip, "axis": axis})
        return NonlinearContactProblem(residual(u), u, bcs=[held(space, side(1, 0.0))], contact=contact)

    from_the_side = led((-0.1, 0.5), (-1.0, 0.0))
    from_the_side.place(0, shift=(0.8, 0.0))
    with pytest.raises(ConvergenceError, match=r"rigid shape inside the body \(contact\[0\]: 0\.\d+ at \("):
        from_the_side.solve()
    on_the_top = led((1.04, 1.0), (0.0, 1.0))
    on_the_top.ramp(lambda t: on_the_top.place(0, shift=(0.0, -0.2 * t)), first=0.25)
    assert on_the_top.state.forces[0][1] < 0.0


def test_a_shape_that_is_given_inside_and_placed_outside():
    """Nothing is said of the way before the first solution from where the shape was only defined."""
    found = problem((2.0, 1.0), (4, 2), {"centre": (1.0, 0.5), "radius": 0.3})
    found.place(0, shift=(0.0, 0.9))
    found.solve()
    assert found.status is Status.CONVERGED


@pytest.mark.one_quick
@pytest.mark.parametrize("before", [False, True])
def test_a_ramp_into_the_body_says_so(before):
    """The reason of its last step comes first, with the load, and the load that has a solution."""
    found = problem((4.0, 1.0), (16, 4), {"centre": (1.52, 1.051), "radius": 0.05})
    first, load, last = (
        (0.01, r"0\.11", r"a solution at 0\.09\d* of 1") if before else (1.0, "1", "no solution before it")
    )
    reason = rf"^rigid shape inside the body \(contact\[0\]: .*\): at load {load}\d*; there is {last}\. A part of"
    with pytest.raises(ConvergenceError, match=reason):  # into it from 0.1 on, and no step is halved
        found.ramp(lambda t: found.place(0, shift=(0.0, -0.03 * t if t < 0.1 else -0.3)), first=first, smallest=first)
    assert found.status is Status.INSIDE
