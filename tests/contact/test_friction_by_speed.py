"""Friction that follows the speed of slip: steady sliding of blocks on belts, and what refuses it."""

import re
from typing import Literal

import numpy as np
import pytest
from commands import run_python
from dolfinx import fem
from forms import box, hooke, side
from numpy.testing import assert_allclose
from on_meshes import no_load, trial_and_test, vector_space
from scene_tables import box_mesh, floor, rectangle_mesh

import signorini_fx as sfx
from signorini_fx.mechanics.laws.at_points import fault_of
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
    plane = floor()
    return sfx.Scene(
        **{
            "mesh": rectangle_mesh(8, 4, length=2.0, height=1.0),
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
    [(RISING, 0.4, "ssn"), (RISING, 0.4, "alm"), (FALLING, 0.4, "ssn"), (FALLING, 0.4, "alm")],
    ids=str,
)
def test_steady_sliding_on_a_belt(law, dt, algorithm):
    """The friction of the belt's speed, whatever the steps are."""
    times = dt * np.arange(1, 16)
    solution = sfx.solve(on_a_belt(law, times, solver={"algorithm": algorithm, "tolerance": 1e-9}))
    last = solution.steps[-1]
    assert all(step.certificate.holds for step in solution.steps)
    assert_allclose(ratio(last.contact), AT_SPEED[law.law], rtol=1e-6)
    # The belt goes along x, and the block stays where it is.
    assert_allclose(-last.contact.slip_length[:, 0] / dt, SPEED, rtol=1e-6)
    assert last.linear_solves <= 3


def test_short_steps():
    """Where friction grows with the speed every step has one solution, also a very short one."""
    solution = sfx.solve(on_a_belt(RISING, 0.002 * np.arange(1, 5)))
    assert solution.converged
    assert all(step.certificate.holds for step in solution.steps)


def dragged(friction, **settings):
    """The same of a user's own forms: the top is dragged with the speed; u and the problem."""
    mesh = box((2.0, 1.0), (8, 4))
    V = vector_space(mesh)
    u, v = trial_and_test(V)
    moved = fem.Function(V)
    top = fem.locate_dofs_topological(V, 1, side(mesh, 1, 1.0))
    contact = sfx.Foundation(side(mesh, 1, 0.0), friction=friction)
    load = no_load(mesh, v)
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
    assert_allclose(ratio(solution.steps[-1].contact), AT_SPEED[law.law], rtol=1e-6)
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
    assert_allclose(*forces, rtol=1e-10, atol=1e-12)


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
        assert_allclose(first.contact.forces[1], second.contact.forces[1], rtol=1e-7, atol=1e-9)


STRIBECK = {"law": "stribeck", "coefficient": 0.4, "kinetic": 0.2, "speed": 0.006}
TABLE = {"law": "speeds", "speeds": [0.0, 0.002, 0.02], "coefficients": [0.4, 0.3, 0.25]}
# Curves and their values at the speed of the belt.
CURVES = [
    (STRIBECK, 0.2 + 0.2 * np.exp(-25 / 9)),
    (STRIBECK | {"exponent": 1, "viscous": 3.0}, 0.23 + 0.2 * np.exp(-5 / 3)),
    (STRIBECK | {"coefficient": 0.2, "kinetic": 0.4}, 0.4 - 0.2 * np.exp(-25 / 9)),
    (TABLE, 0.3 - 0.05 * 8 / 18),
]


@pytest.mark.parametrize(("curve", "value"), CURVES, ids=str)
def test_curves(curve, value):
    """In a scene as in forms; the table of points has the speed, and the summary its extremes."""
    scene = on_a_belt(curve, 0.5 * np.arange(1, 25), solver={"tolerance": 1e-9})
    solution = sfx.solve(scene)
    assert_allclose(ratio(solution.contact), value, rtol=1e-6)
    assert_allclose(solution.table.columns["speed"], SPEED, rtol=1e-6)
    assert_allclose(solution.contact_figures[0].slip_speed, SPEED, rtol=1e-6)
    kind = sfx.Stribeck if curve["law"] == "stribeck" else sfx.SpeedTable
    problem, at = dragged(kind(**curve), tolerance=1e-9)
    steps = problem.run([0.5 * k for k in range(1, 9)], at).steps
    assert_allclose(ratio(steps[-1].contact), value, rtol=1e-6)


@pytest.mark.parametrize("curve", [curve for curve, _ in CURVES], ids=str)
def test_curves_have_their_derivatives(curve):
    """And no friction exceeds the envelope, which statics knows."""
    kind = sfx.Stribeck if curve["law"] == "stribeck" else sfx.SpeedTable
    law = kind(**curve).with_values(lambda _, value: np.full(3, value))
    assert not fault_of(law, 3, 1e3)


def test_in_space():
    """Dragged aslant; with another coefficient across a direction, along that."""
    box = {"length": 2.0, "width": 1.0, "height": 1.0, "nx": 4, "ny": 2, "nz": 2}
    for x, y, friction in ((0.006, 0.008, {}), (0.01, 0.0, {"ratio": 0.5, "along": [1, 0, 0]})):
        scene = sfx.Scene(
            mesh=box_mesh(**box),
            material={"young": 1000.0, "poisson": 0.3},
            displacement={"boundary": "top", "x": f"{x}*t", "y": f"{y}*t", "z": -0.001},
            contact={"boundary": "bottom", "friction": CURVES[1][0] | friction},
            load_steps={"times": [0.5, 1.0, 1.5, 2.0, 2.5]},
        )
        solution = sfx.solve(scene)
        assert_allclose(ratio(solution.contact), CURVES[1][1], rtol=1e-6)


def test_free_to_slide():
    """A body that viscous friction alone holds slides as fast as its load asks for."""
    scene = sfx.Scene(
        mesh=rectangle_mesh(8, 4, length=2.0),
        material={"young": 1000.0, "poisson": 0.3},
        traction={"boundary": "top", "x": 0.3, "y": -1.0, "factors": [1.0, 1.0, 1.0]},
        contact={
            "boundary": "bottom",
            "friction": STRIBECK | {"coefficient": 0.2, "kinetic": 0.2, "viscous": 5.0},
        },
        load_steps={"times": [0.1, 0.2, 0.3]},
    )
    contact = sfx.solve(scene).contact
    # In the mean, 0.3 = 0.2 + 5 v, weighted by the pressure.
    speeds = contact.speed @ (contact.points.weight * contact.pressure)
    assert_allclose(speeds, 0.02 * 2.0, rtol=1e-6)


STIFF = {
    "material": {"young": 1e6, "poisson": 0.3},
    "displacement": {"boundary": "top", "y": -1e-6},
}
# Of one kinetic coefficient: |F'| at the speed v of a block on a spring k, with a normal force N.
FALL = 0.2 / 0.006 * np.sqrt(2) * np.exp(-0.5)


def test_the_bound_on_the_step():
    """A stiff block on a spring needs steps of more than N |F'| / k."""
    with pytest.raises(sfx.ConvergenceError, match="take longer load steps") as caught:
        sfx.solve(on_a_belt(STRIBECK, 0.02 * np.arange(1, 100), **STIFF))
    solution = caught.value.solution
    assert solution.steps[-1].status is Status.JUMPS
    named = float(re.search(r"one of more than ([\d.]+) has", str(caught.value))[1])
    force = np.linalg.norm(solution.steps[-2].contact.forces[0])
    assert_allclose(named, force * FALL / 200.0, rtol=2e-2)
    longer = on_a_belt(STRIBECK, 1.1 * named * np.arange(1, 8), **STIFF)
    assert sfx.solve(longer).converged


def test_a_step_that_may_jump_warns():
    """A solution at whose lower speeds friction falls too fast need not be the only one."""
    solution = sfx.solve(on_a_belt(TABLE, 0.1 * np.arange(1, 10)))
    assert any("sliding may jump" in found.message for found in solution.findings)
    rising = sfx.solve(on_a_belt(CURVES[2][0], 0.1 * np.arange(1, 4)))
    assert not any("jump" in found.message for found in rising.findings)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (
            {"load_steps": {}},
            r"friction\.law: follows the speed of slip, .* give load_steps\.times",
        ),
        ({"load_steps": {"times": [0.0, 1.0]}}, "the first above 0"),
        ({"load_steps": {"steps": 3}}, r"give load_steps\.times"),
    ],
    ids=str,
)
def test_steps_without_a_duration(keys, message):
    """Leave no speed that friction could follow."""
    with pytest.raises(sfx.SceneError, match=message):
        on_a_belt(STRIBECK, [1.0], **keys)


@pytest.mark.parametrize(
    ("friction", "message"),
    [
        (STRIBECK | {"speed": 0.0}, r"friction\.speed: must be greater than 0"),
        (STRIBECK | {"exponent": 0.5}, r"friction\.exponent: must be at least 1"),
        (STRIBECK | {"kinetic": -0.1}, r"friction\.kinetic: must not be negative"),
        (STRIBECK | {"kinetics": 0.1}, r"friction\.kinetics: unknown key"),
        ({"law": "stribeck", "coefficient": 0.4}, r"friction\.kinetic: is missing"),
        (TABLE | {"speeds": [0.1, 0.2, 0.3]}, r"friction\.speeds: must begin with 0 and increase"),
        (TABLE | {"coefficients": [0.3, 0.2]}, r"friction\.coefficients: must be 3, one for each"),
        ({"law": "stribek"}, r"friction\.law: must be one of .*'stribeck', 'speeds'.*'stribek'"),
    ],
    ids=str,
)
def test_bad_input(friction, message):
    """One clear error each."""
    with pytest.raises(sfx.SceneError, match=message):
        on_a_belt(friction, [1.0])


def test_nothing_of_it_is_imported_unless_it_is_named():
    """Neither by the package, nor by scenes and solves with other laws."""
    code = (
        "import sys; import signorini_fx as sfx; sfx.ContactProblem; "
        "sfx.solve(sfx.read_scene('demos/scenes/example1_coulomb.toml')); "
        "print([name for name in sys.modules if 'stribeck' in name or 'sliding_jumps' in name])"
    )
    ended = run_python(code)
    assert ended.stdout.splitlines()[-1] == "[]"


def test_derivatives_are_refused():
    """They would be those of friction at rest."""
    scene = on_a_belt(STRIBECK, [0.4])
    with pytest.raises(sfx.SignoriniError, match="not possible yet where it follows the speed"):
        sfx.sensitivity(scene, "force bottom x", ["contact.friction.kinetic"])
