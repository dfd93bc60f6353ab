"""Friction that follows the speed of slip: steady sliding of blocks on belts, and what refuses it."""

from typing import Literal

import numpy as np
import pytest
import ufl
from dolfinx import fem
from forms import box, hooke, side

import signorini_fx as sfx
from signorini_fx.records import Status

SPEED = 0.01


class Creep(sfx.FrictionLaw):
    """F(v) = coefficient + gain ln(1 + v / speed), which grows with the speed."""

    law: Literal["creep"] = "creep"
    coefficient: sfx.Parameter
    gain: sfx.Parameter
    speed: sfx.Parameter
    follows_slip = True

    def evaluate(self, pressure, slip, dt):
        ratio = slip / dt / self.speed
        grown = self.coefficient + self.gain * np.log1p(ratio)
        by_slip = self.gain / (1 + ratio) / self.speed / dt * pressure
        return grown * pressure, grown, by_slip


class Fading(sfx.FrictionLaw):
    """F(v) = coefficient + loss exp(-v / speed), which falls with the speed."""

    law: Literal["fading"] = "fading"
    coefficient: sfx.Parameter
    loss: sfx.Parameter
    speed: sfx.Parameter
    follows_slip = True

    def evaluate(self, pressure, slip, dt):
        left = self.loss * np.exp(-slip / dt / self.speed)
        return (
            (self.coefficient + left) * pressure,
            self.coefficient + left,
            (-left / self.speed / dt * pressure),
        )


RISING, FALLING = Creep(0.3, 0.05, 0.001), Fading(0.3, 0.1, 0.005)
# 0.3 + 0.05 ln 11 and 0.3 + 0.1 exp(-2), the friction at the speed of the belt.
AT_SPEED = {"creep": 0.4198947636399186, "fading": 0.3135335283236613}


def on_a_belt(friction, times, **keys):
    """A block that springs hold, pressed onto a plane that moves under it."""
    plane = {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
    return sfx.Scene(
        **{
            "mesh": {
                "generator": "rectangle",
                "parameters": {"length": 2.0, "height": 1.0, "nx": 8, "ny": 4},
            },
            "material": {"young": 1000.0, "poisson": 0.3},
            "springs": {"boundary": "left", "x": 200.0},
            "displacement": {"boundary": "top", "y": -0.001},
            "contact": {
                "boundary": "bottom",
                "friction": friction,
                "foundation": plane | {"shift": [f"{SPEED}*t", "0"]},
            },
            "load_steps": {"times": list(times)},
        }
        | keys
    )


def ratio(contact):
    """Friction force over contact force."""
    contact_force, friction = contact.forces
    return np.linalg.norm(friction) / np.linalg.norm(contact_force)


@pytest.mark.parametrize(
    ("law", "dt", "algorithm"),
    [
        (RISING, 0.4, "ssn"),
        (RISING, 0.4, "alm"),
        (FALLING, 0.4, "ssn"),
        (FALLING, 0.4, "alm"),
    ],
    ids=str,
)
def test_steady_sliding_on_a_belt(law, dt, algorithm):
    """The friction of the belt's speed, whatever the steps are."""
    times = dt * np.arange(1, 16)
    solution = sfx.solve(on_a_belt(law, times, solver={"algorithm": algorithm, "tolerance": 1e-9}))
    last = solution.steps[-1]
    assert all(step.certificate.holds for step in solution.steps)
    np.testing.assert_allclose(ratio(last.contact), AT_SPEED[law.law], rtol=1e-6)
    # The belt goes along x, and the block stays where it is.
    np.testing.assert_allclose(-last.contact.slip_length[:, 0] / dt, SPEED, rtol=1e-6)
    assert last.linear_solves <= 3


def test_short_steps():
    """Where friction grows with the speed every step has one solution, also a very short one."""
    solution = sfx.solve(on_a_belt(RISING, 0.002 * np.arange(1, 5)))
    assert solution.converged
    assert all(step.certificate.holds for step in solution.steps)


def dragged(friction, **settings):
    """The same of a user's own forms: the top is dragged with the speed; u and the problem."""
    mesh = box((2.0, 1.0), (8, 4))
    V = fem.functionspace(mesh, ("Lagrange", 1, (2,)))
    u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
    moved = fem.Function(V)
    top = fem.locate_dofs_topological(V, 1, side(mesh, 1, 1.0))
    contact = sfx.Foundation(side(mesh, 1, 0.0), friction=friction)
    load = ufl.inner(fem.Constant(mesh, (0.0, 0.0)), v) * ufl.dx
    bcs = [fem.dirichletbc(moved, top)]
    problem = sfx.ContactProblem(hooke(u, v), load, bcs, contact, **settings)

    def at(time):
        moved.interpolate(lambda x: np.array([SPEED * time + 0 * x[0], -0.001 + 0 * x[0]]))

    return problem, at


@pytest.mark.parametrize("law", [RISING, FALLING], ids=str)
def test_steady_sliding_of_forms(law):
    """The same in load steps of forms."""
    problem, at = dragged(law, tolerance=1e-9)
    solution = problem.run([0.4 * k for k in range(1, 7)], at)
    assert solution.converged
    np.testing.assert_allclose(ratio(solution.steps[-1].contact), AT_SPEED[law.law], rtol=1e-6)
    with pytest.raises(sfx.FormError, match="solve by run, whose load steps have times"):
        problem.solve()


def test_a_law_without_the_slip_is_not_asked_for_it():
    """A bound that ignores slip and duration is Coulomb's, with its solves and digits."""

    class Plain(sfx.FrictionLaw):
        law: Literal["plain"] = "plain"
        coefficient: sfx.Parameter
        follows_slip = True

        def evaluate(self, pressure, slip, dt):
            return self.coefficient * pressure, self.coefficient, 0.0

        def envelope(self, zero):
            return zero, self.coefficient, None

    forces = []
    for law in (Plain(0.3), sfx.Coulomb(0.3)):
        problem, at = dragged(law, coulomb="newton", tolerance=1e-10)
        forces.append(problem.run([1.0, 2.0], at).steps[-1].contact.forces[1])
        assert problem.status is Status.CONVERGED
    np.testing.assert_allclose(*forces, rtol=1e-10, atol=1e-12)


def test_restart(tmp_path):
    """A killed run goes on as if it had not been."""
    scene = on_a_belt(RISING, [0.4, 0.8, 1.2])
    whole = sfx.solve(scene)

    def stop(step):
        if getattr(step, "step", 0) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sfx.solve(scene, checkpoint=tmp_path, observers=[stop])
    again = sfx.solve(scene, checkpoint=tmp_path, restart=True)
    for first, second in zip(whole.steps, again.steps, strict=True):
        np.testing.assert_allclose(
            first.contact.forces[1], second.contact.forces[1], rtol=1e-7, atol=1e-9
        )
