"""Friction that depends on the time: coefficient and bound of each load step, against statics by
hand.
"""

import pytest
from mpi4py import MPI
from pushed_block import DRAGGED_PRESSURE, dragged_block
from scene_tables import coulomb_friction, tresca_friction

from signorini_fx import SceneError
from signorini_fx.mechanics.body.discretisation import prepare
from signorini_fx.records import Timings
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD
AREA = 2.0


def dragged(friction, factors=(1.0, 2.0, 3.0), dim=2, more=None, **solver):
    """A low block that is pressed on its foundation, and dragged along it in load steps."""
    return dragged_block({"friction": friction}, dim, factors, solver=solver, **more or {})


def pull(solution):
    """The friction forces of the load steps over the pressing force, along the drag."""
    assert solution.converged
    assert all(step.certificate.holds for step in solution.steps)
    return [-step.contact.forces[1][0] / (DRAGGED_PRESSURE * AREA) for step in solution.steps]


@pytest.mark.mpi
@pytest.mark.one_quick(
    ("dim", "solver"),
    [
        (2, {}),
        (2, {"coulomb": "newton"}),
        (2, {"algorithm": "alm"}),
        (2, {"algorithm": "path-following"}),
        (3, {}),
        (3, {"linear_algebra": "krylov"}),
        (2, {"levels": 2}),
    ],
)
def test_a_coefficient_that_grows_and_falls(dim, solver):
    """The block slides in every step, so that friction is F(t) times the pressing force."""
    law = coulomb_friction("0 if t < 1.5 else 0.6 - 0.1*t")
    assert pull(solve(dragged(law, dim=dim, **solver), COMM)) == pytest.approx(
        [0.0, 0.4, 0.3], rel=1e-8, abs=1e-12
    )


def test_only_the_fall_makes_a_block_at_rest_slide():
    """The drag stays: a larger coefficient changes nothing, and a smaller one lets the body relax
    to its bound.
    """
    law = coulomb_friction("0.2 if t < 1.5 else 0.5 if t < 2.5 else 0.1")
    assert pull(solve(dragged(law, (1.0, 1.0, 1.0)), COMM)) == pytest.approx(
        [0.2, 0.2, 0.1], rel=1e-6
    )


NONLINEAR = [{"law": "neo-hooke"}, {"law": "j2", "yield_stress": 5.0}]


@pytest.mark.mpi
@pytest.mark.one_quick("law", NONLINEAR)
def test_a_nonlinear_body(law):
    """Of a body that is rubber, or metal that does not yield here: coefficients that grow and fall
    while it is dragged, a fall that lets it relax, and steps between the times of the factors.
    """
    material = {"material": {"young": 1000.0, "poisson": 0.0} | law}
    grows = dragged(coulomb_friction("0.1 if t < 1.5 else 0.6 - 0.1*t"), more=material)
    assert pull(solve(grows, COMM)) == pytest.approx([0.1, 0.4, 0.3], rel=1e-6)
    falls = dragged(
        coulomb_friction("0.2 if t < 1.5 else 0.5 if t < 2.5 else 0.1"),
        (1.0, 1.0, 1.0),
        more=material,
    )
    assert pull(solve(falls, COMM)) == pytest.approx([0.2, 0.2, 0.1], rel=1e-6)
    between = dragged(
        tresca_friction("t*x[0]"),
        (1.0, 2.0),
        more=material | {"load_steps": {"steps": 2, "times": [1.0, 2.0]}},
    )
    assert pull(solve(between, COMM)) == pytest.approx(
        [2.0 * t / (DRAGGED_PRESSURE * AREA) for t in (1.0, 1.5, 2.0)], rel=1e-6
    )


def test_place_and_time():
    """Of a Tresca bound t x the integral over the length is 2 t, whatever the pressure."""
    law = tresca_friction("t*x[0]")
    assert pull(solve(dragged(law), COMM)) == pytest.approx(
        [2.0 * t / (DRAGGED_PRESSURE * AREA) for t in (1, 2, 3)], rel=1e-8
    )


def test_a_ramp():
    """Times between the factors: friction alone depends on them."""
    more = {"load_steps": {"steps": 2, "times": [10.0, 20.0]}}
    found = pull(solve(dragged(coulomb_friction("0.01*t"), (1.0, 2.0), more=more), COMM))
    assert found == pytest.approx([0.1, 0.15, 0.2], rel=1e-8)


def test_times_alone_make_load_steps():
    """Without factors there is a load step for each time."""
    more = {"load_steps": {"times": [1.0, 2.0]}}
    assert pull(solve(dragged(coulomb_friction("0.4/t"), None, more=more), COMM)) == pytest.approx(
        [0.4, 0.2], rel=1e-6
    )


@pytest.mark.parametrize(
    ("friction", "more", "message"),
    [
        (coulomb_friction("0.5 - 0.2*t"), {}, "friction.coefficient.*not negative"),
        (coulomb_friction("1/(t - 2)**2"), {}, "friction.coefficient: is inf"),
        (coulomb_friction(0.3) | {"cap": "2 - t"}, {}, "friction.cap.*not negative"),
    ],
)
def test_bad_values(friction, more, message):
    """One error that names the key, before the first load step."""

    def check():
        scene = dragged(friction, more=more)
        prepare(scene.statement, load_mesh(scene, COMM), Timings())

    with pytest.raises(SceneError, match=message) as caught:
        check()
    assert len(caught.value.problems) == 1
