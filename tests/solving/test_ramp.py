"""Load steps with names and times, and ramps that find their own increments."""

import numpy as np
import pytest
from pushed_block import LENGTH, LIMIT, PRESSURE, block, friction_force
from scene_tables import coulomb_friction, fixed, rectangle_mesh, tresca_friction
from scenes import alone

from signorini_fx.errors import FormError, SceneError
from signorini_fx.mechanics.statement.load_path import LoadPath
from signorini_fx.quantities.shown import short_answer
from signorini_fx.records import Status
from signorini_fx.results.files import write_results
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve
from signorini_fx.solving.increments import Increments


def ramp(push, steps=10, *, factors=(0.0, 1.0), nx=30, friction=None, load_steps=None, **solver):
    """Pressed in full, then pushed on its left side up to ``push`` times the limit of friction."""
    pushed = {"boundary": "left", "x": push * LIMIT, "factors": list(factors)}
    scene = {
        "traction": [{"boundary": "top", "y": -PRESSURE}, pushed],
        "load_steps": {"steps": steps, "times": list(map(float, range(len(factors))))}
        | (load_steps or {}),
    }
    return block(nx, scene, **solver)


def increments(scene):
    return Increments(scene.statement.path, scene.solver)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"times": ()}, "times"),
        ({"times": (1.0, 1.0)}, "increase"),
        ({"times": (0.0, np.inf)}, "finite"),
        ({"times": (1.0, 2.0), "names": ("push",)}, "1 entries"),
        ({"times": (1.0,), "steps": 0}, "whole number"),
        ({"times": (1.0,), "from_nothing": True}, "give steps"),
        ({"times": (0.0, 1.0), "steps": 2, "from_nothing": True}, "positive"),
    ],
)
def test_bad_paths(arguments, message):
    with pytest.raises(FormError, match=message):
        LoadPath(**arguments)


# --- a limit load ---------------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.one_quick("push", [1.2, 40.0])
@pytest.mark.parametrize("method", [{}, {"coulomb": "newton"}, {"algorithm": "alm"}])
def test_limit_load(push, method):
    """Statics: the block slides at F times the normal force; the ramp ends within 1 % of that, with
    a certificate.
    """
    solution = solve(ramp(push, nx=18, **method), check=False)
    assert solution.status is Status.SLIDES
    last, failed = solution.last_step, solution.steps[-1]
    assert failed.linear_solves == 0  # statics proves it
    assert 0.99 / push <= last.time <= 1 / push < failed.time <= 1.01 / push
    assert friction_force(last.contact) == pytest.approx(last.time * push * LIMIT, rel=1e-8)
    assert solution.certificate.holds
    assert solution.limit.force == pytest.approx(friction_force(last.contact), rel=1e-8)
    assert solution.limit.full_force == pytest.approx(push * LIMIT, rel=1e-9)
    assert solution.limit.reason == "the body slides"
    assert solution.displacement is last.displacement
    assert solution.contact is last.contact
    assert all(step.status is Status.CONVERGED for step in solution.steps[:-1])


def test_limit_load_from_nothing():
    """Without factors all loads grow together; Tresca friction of bound g holds at most g times the
    length.
    """
    bound, push = 2.0, 2.1  # a limit that no increment meets exactly
    scene = block(
        30,
        {
            "traction": [{"boundary": "top", "x": push * bound, "y": -PRESSURE}],
            "contact": {"boundary": "bottom", "friction": tresca_friction(bound)},
            "load_steps": {"steps": 4},
        },
    )
    solution = alone(scene, check=False)
    assert solution.status is Status.SLIDES
    assert 0.99 / push <= solution.last_step.time <= 1 / push
    assert solution.steps[0].time == 0.25
    assert friction_force(solution.contact) == pytest.approx(
        solution.last_step.time * push * bound * LENGTH, rel=1e-8
    )


def test_a_ramp_is_the_same_as_its_factors():
    """With increments that are never changed it is the list of factors."""
    path = [0.0, 0.5, 1.0]
    by_hand = alone(ramp(0.9, None, factors=path, load_steps={"times": path}))
    found = alone(ramp(0.9, 2))
    assert [step.time for step in found.steps] == path
    for one, other in zip(found.steps, by_hand.steps, strict=True):
        np.testing.assert_allclose(
            one.contact.shear, other.contact.shear, rtol=0, atol=1e-12 * PRESSURE
        )
    assert found.history.linear_solves == by_hand.history.linear_solves


# --- the increments, apart from any solve ---------------------------------------------------------


def walk(path, limit, solves=2, most=200):
    """The places that a path tries, where there is a solution up to ``limit``."""
    tried = []
    while len(tried) < most:
        tried.append(path.next)
        if path.next <= limit:
            path.advance(path.next, solves)
            if path.ended:
                return tried
        elif not path.shorten(Status.SLIDES, path.next):
            return tried
    raise AssertionError("no end")


@pytest.mark.parametrize("limit", [1e-3, 0.0101, 0.3, 0.55555, 0.999, 2 / 3])
def test_the_limit_is_enclosed(limit):
    """The last place with a solution is within 1 % below the limit, the last one without within 1 %
    above.
    """
    path = increments(ramp(1.0))
    tried = walk(path, limit)
    assert 0.99 * limit <= path.reached <= limit < tried[-1] <= 1.01 * limit
    assert len(tried) < 60


# --- names, times, counting -----------------------------------------------------------------------

NAMED = {"names": ["press", "push"], "times": [0.0, 2.0]}


@pytest.fixture(scope="module")
def failed(tmp_path_factory):
    """A ramp that slides, and its result folder."""
    solution = alone(ramp(1.9, 4, nx=12, load_steps=NAMED), check=False)
    folder = tmp_path_factory.mktemp("failed")
    return solution, write_results(solution, folder), folder


def test_the_load_that_is_held_is_named(failed):
    """By its factor in the scene, not by the time alone."""
    solution, _, _ = failed
    held = solution.steps[-2].place
    assert f"({held:.4g} times traction[1])" in solution.advice


def test_what_moves_on_what(failed):
    """The first line has the force, its share of the whole one, and which body slides on which."""
    _, summary, _ = failed
    whole = 1.9 * LIMIT
    held = summary["limit"]["force"]
    line = f"  limit       {held:.4g} ({held / whole:.4g} of {whole:.4g}): the body slides"
    assert str(short_answer(summary)[1]) == line
    blocks = {
        "body": [
            {"name": "lower", "mesh": rectangle_mesh(6, 2, length=3.0)},
            {"name": "upper", "mesh": rectangle_mesh(5, 2, length=2.0), "shift": [0.5, 1.0]},
        ],
        "material": {"young": 5000.0, "poisson": 0.3},
        "displacement": [fixed("lower.bottom")],
        "contact": {
            "boundary": "upper.bottom",
            "against": "lower.top",
            "friction": coulomb_friction(0.25),
        },
        "traction": {"boundary": "upper.top", "y": -20.0},
        "force": {"boundary": "upper.left", "x": 21.0, "factors": [0.0, 1.0]},
        "load_steps": {"steps": 4, "times": [0.0, 1.0]},
    }
    limit = alone(parse_scene(blocks), check=False).limit
    assert limit.reason == "upper slides on lower"
    assert 0.99 * 10.0 <= limit.force <= 10.0
    assert limit.full_force == pytest.approx(21.0)


def test_a_ramp_of_rubber_names_its_limit():
    """Friction of a coefficient 0.1 holds a tenth of the pressure."""
    scene = {
        "mesh": rectangle_mesh(6, 3, length=2.0),
        "material": {"law": "neo-hooke", "young": 50.0, "poisson": 0.4},
        "contact": {"boundary": "bottom", "friction": coulomb_friction(0.1)},
        "traction": [
            {"boundary": "top", "y": -1.0},
            {"boundary": "top", "x": 0.3, "factors": [0.0, 1.0]},
        ],
        "load_steps": {"steps": 2, "times": [0.0, 1.0]},
    }
    limit = alone(parse_scene(scene), check=False).limit
    assert 0.99 * 0.2 <= limit.force <= 0.2
    assert limit.reason == "the body slides"


def test_a_ramp_without_contact_says_where_it_ends():
    """At the load at which the deformation reaches its limit: it is proportional to the load; the
    history has the attempts beyond it, too.
    """
    scene = {
        "mesh": rectangle_mesh(6, 2, length=3.0),
        "material": {"young": 5000.0, "poisson": 0.3},
        "displacement": [fixed("bottom")],
        "traction": [{"boundary": "top", "y": -4000.0}],
        "load_steps": {"steps": 4},
    }
    solution = alone(parse_scene(scene), check=False)
    held, failed = solution.steps[-2:]
    assert failed.status is Status.TOO_LARGE
    limit = held.time * solution.model.settings.largest_deformation / held.deformation.largest
    assert held.time <= limit < failed.time < 1.1 * limit
    expected = f"there is a solution at time {held.time:.6g}, and none at time {failed.time:.6g}"
    assert solution.history.events[-1].startswith(f"the ramp ends: {expected}")
    assert solution.limit.reason == Status.TOO_LARGE.value
    assert {step.linear_solves for step in solution.steps} == {1}
    assert solution.history.linear_solves > len(solution.steps)


# --- bad input ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"steps": 0}, "load_steps.steps"),
        ({"steps": 2.5}, "load_steps.steps"),
        ({"names": ["one"]}, "load_steps.names: has 1 entries, one for each of 2 load steps is"),
        ({"times": [1.0, 1.0]}, "load_steps.times: must be finite and increase"),
        ({"times": [0.0, 1.0, 2.0]}, "load_steps.times: has 3 entries"),
        ({"ramp": 3}, "load_steps.ramp"),
    ],
)
def test_bad_load_steps(given, message):
    with pytest.raises(SceneError, match=message.replace(".", r"\.")):
        ramp(1.0, load_steps={"times": [0.0, 1.0]} | given)


def test_loads_that_begin_before_time_0():
    loads = {"traction": {"boundary": "top", "y": -1.0}, "load_steps": {"steps": 2, "times": [0.0]}}
    with pytest.raises(SceneError, match="must be positive"):
        block(6, loads)
