"""The generalised Maxwell material in contact: against its differential equations, and what is
refused.
"""

import itertools
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from parameters import slow
from scene_tables import circle_shape, coulomb_friction, fixed, floor, rectangle_mesh
from scenes import alone
from scipy.integrate import solve_ivp

from signorini_fx import SceneError, solve
from signorini_fx.quantities.shown import short_answer
from signorini_fx.records import STEPS_UNESTIMATED
from signorini_fx.results.summary import summary_of
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_WORLD
SHEAR, POISSON = 40.0, 0.3
YOUNG = 2 * SHEAR * (1 + POISSON)
BULK = YOUNG / (3 * (1 - 2 * POISSON))
BRANCHES = [[60.0, 0.5], [25.0, 4.0]]
MATERIAL = {"law": "maxwell", "young": YOUNG, "poisson": POISSON, "branches": BRANCHES}
PLATE = floor()
TIMES = [0.1, 0.25, 0.5, 0.7, 3.0, 40.0]


def confined_scene(top, times):
    """A block between smooth walls on a plate, whose strain is uniform."""
    walls = [fixed(side, "x") for side in ("left", "right")]
    return {
        "mesh": rectangle_mesh(4, 2, length=2.0, height=1.0),
        "material": MATERIAL,
        "displacement": [*walls, {"boundary": "top", "y": top}],
        "contact": {"boundary": "bottom", "foundation": PLATE},
        "load_steps": {"times": times},
        "solver": {"algorithm": "alm"},
    }


def confined(top, times, comm=COMM, **tables):
    """Its solution, with other tables."""
    return solve(parse_scene(confined_scene(top, times) | tables), comm)


def pressures(solution):
    """Of the plate, of each load step."""
    return np.array([step.contact.forces[0][1] / 2.0 for step in solution.steps])


def relaxed(strain, times):
    """The pressure under a strain in time, by a solver of differential equations that knows no load
    steps.
    """
    parts, found = np.zeros(2), []

    def rates(t, parts):
        rate = (strain(t + 1e-7) - strain(t - 1e-7)) / 2e-7
        return [
            4 / 3 * shear * rate - part / time
            for part, (shear, time) in zip(parts, BRANCHES, strict=True)
        ]

    breaks = sorted({0.0, 0.5, *times})
    for begin, end in pairwise(breaks):
        inside = begin + 1e-6 * (end - begin), end - 1e-6 * (end - begin)
        parts = solve_ivp(rates, inside, parts, rtol=1e-10, atol=1e-13, method="LSODA").y[:, -1]
        if end in times:
            found.append((BULK + 4 / 3 * SHEAR) * strain(end) + parts.sum())
    return np.array(found)


@pytest.mark.mpi
def test_a_strain_that_is_held_relaxes():
    """Load steps of any length are exact where the strain changes evenly in each of them."""
    found = pressures(confined("-0.02*t if t < 0.5 else -0.01", TIMES))
    assert found == pytest.approx(relaxed(lambda t: 0.02 * min(t, 0.5), TIMES), rel=2e-5)
    at_first, at_last = BULK + 4 / 3 * (SHEAR + 85.0), BULK + 4 / 3 * SHEAR
    assert at_last * 0.01 < found[-1] < found[2] < at_first * 0.01


def test_fast_and_slow_limits_are_those_of_the_linear_material():
    """A load step far shorter than all times knows the stiffness at first alone, a far longer one
    that at last.
    """
    for times, shear in (([1e-9], SHEAR + 85.0), ([1e9], SHEAR)):
        young = 9 * BULK * shear / (3 * BULK + shear)
        linear = {"young": young, "poisson": (3 * BULK - 2 * shear) / (2 * (3 * BULK + shear))}
        circle = circle_shape([1.0, -3.0], 3.0)
        contact = {"boundary": "bottom", "foundation": circle, "friction": coulomb_friction(0.2)}
        held = [{"boundary": "top", "x": 0.0, "y": -1e-6}]
        both = [
            confined("0", times, displacement=held, contact=contact, material=law)
            .steps[-1]
            .contact.forces[0]
            for law in (MATERIAL, linear)
        ]
        assert both[0] == pytest.approx(both[1], rel=2e-4, abs=1e-9)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"branches": []}, "branches"),
        ({"branches": [[1.0, 0.0]]}, "branches"),
        ({"branches": [[-1.0, 1.0]]}, "branches"),
    ],
)
def test_wrong_constants_are_refused(change, why):
    with pytest.raises(SceneError, match=why):
        confined("0", [1.0], material=MATERIAL | change)


def test_times_before_zero_are_refused():
    with pytest.raises(SceneError, match=r"load_steps.times: must be positive"):
        confined("0", [-1.0, 1.0])


def told(scene):
    """The lines error and cost of a solution, and its notes about load steps."""
    found = alone(parse_scene(scene))
    lines = " ".join(" ".join(map(str, short_answer(summary_of(found), Path()))).split())
    notes = [one.message for one in found.findings if STEPS_UNESTIMATED in one.message]
    return lines.partition(" error ")[2].partition(" certificate ")[0], notes


def pad(**more):
    """A pad under a plane that presses and lets go."""
    down = "-0.02*min(t/0.001, 1) + 0.01*min(max(t - 3, 0)/0.001, 1)"
    plane = {"shape": "plane", "point": [0.0, 1.0], "normal": [0.0, -1.0], "shift": ["0", down]}
    sides = [("bottom", "y"), ("left", "x"), ("right", "x")]
    return {
        "mesh": rectangle_mesh(4, 2, length=2.0, height=1.0),
        "material": {"law": "maxwell", "young": 10.0, "poisson": 0.3, "branches": [[30.0, 1.0]]},
        "displacement": [{"boundary": name, key: 0.0} for name, key in sides],
        "load_steps": {"times": [0.001, 3.0, 3.001, 5.0]},
        "contact": {"boundary": "top", "foundation": plane},
    } | more


def test_no_word_of_exactness_where_time_is_not_estimated():
    """A mesh that leaves no error says nothing of load steps, which are wrong by 41 % here."""
    lines, notes = told(pad())
    assert len(notes) == 1
    assert notes[0].startswith("contact of a body with memory closes or opens in load step 1")
    assert STEPS_UNESTIMATED in lines
    assert "exact" not in lines
    rubber = {"law": "neo-hooke", "young": 10.0, "poisson": 0.3}
    assert told(pad(material=rubber))[1] == []


@pytest.mark.parametrize(("coefficient", "steps", "warned"), [(0.5, 2, True), (0.5, 12, False)])
def test_a_shape_that_turns_far_in_a_step(coefficient, steps, warned):
    """Its slip is a chord: a note says which step turns it how far."""
    circle = {
        "shape": "circle",
        "centre": [1.0, 1.95],
        "radius": 1.0,
        "pivot": [1.0, 1.95],
        "rotation": "45*t",
    }
    scene = pad(
        material={"law": "neo-hooke", "young": 10.0, "poisson": 0.3},
        load_steps={"times": [(step + 1) / steps for step in range(steps)]},
        contact={
            "boundary": "top",
            "foundation": circle,
            "friction": coulomb_friction(coefficient),
        },
    )
    lines, notes = told(scene)
    assert (STEPS_UNESTIMATED in lines) is warned
    assert len(notes) == warned
    if warned:
        assert notes[0].startswith("load step 1 turns it by 0.39 rad")


def divided(scene, count):
    """The same with each of its load steps in equal parts."""
    ends = [0.0, *scene["load_steps"]["times"]]
    parts = [np.linspace(*pair, count + 1)[1:].tolist() for pair in itertools.pairwise(ends)]
    return scene | {"load_steps": {"times": [time for part in parts for time in part]}}


def moving(x, y):
    """Contact with a circle that moves."""
    circle = {"shape": "circle", "centre": [0.9, 2.0], "radius": 1.0, "shift": [x, y]}
    return {"boundary": "top", "foundation": circle, "friction": coulomb_friction(0.3)}


HELD = [fixed("bottom")]
METAL = {"law": "j2", "young": 1000.0, "poisson": 0.3, "yield_stress": 5.0, "hardening": 50.0}
LOADED = {"boundary": "top", "y": "-0.5*t", "x": "0.1*t"}
CREEPS = pad(
    contact=[], displacement=HELD, traction=[LOADED], load_steps={"times": [1.0, 2.0, 4.0]}
)
# Scenes, an accuracy, and into how many parts each load step is divided for the truth.
IN_TIME = {
    "creeps": (CREEPS, 0.1, 32),
    "creeps, short steps": (CREEPS, 0.03, 32),
    "pressed and let go": (pad(), 0.1, 32),
    "relaxes": (pad(load_steps={"times": [0.001, 1.0]}), 0.03, 64),
    "metal pressed": (
        pad(
            material=METAL,
            displacement=HELD,
            contact=moving("0.1*max(t-1, 0)", "-0.02*min(t, 1)"),
            load_steps={"times": [1.0, 2.0]},
        ),
        0.3,
        32,
    ),
    "metal sheared": (
        pad(
            material=METAL,
            displacement=HELD,
            contact=moving("0.1*max(t-1, 0)", "-0.02*t"),
            load_steps={"times": [1.0, 2.0]},
        ),
        0.3,
        32,
    ),
}


@pytest.mark.parametrize("name", [name if name == "creeps" else slow(name) for name in IN_TIME])
def test_errors_in_time(name):
    """Load steps are divided as an accuracy asks for, and the error of displacement and tractions
    is estimated, within a factor of four.
    """
    scene, accuracy, parts = IN_TIME[name]
    times = scene["load_steps"]["times"]
    asked = scene | {"load_steps": {"times": times, "time_accuracy": accuracy}}
    lines, notes = told(asked)
    assert "of time steps" in lines
    assert not notes
    found = solve(parse_scene(asked))
    truth = solve(parse_scene(divided(scene, parts)))
    assert [each.time for each in found.steps] == times
    errors = []
    for values in (lambda one: one.displacement.x.array, tractions):
        sizes = [np.linalg.norm(values(step)) for step in truth.steps]
        apart = np.linalg.norm(values(found.last_step) - values(truth.last_step))
        errors.append(apart / max(*sizes, 1e-300))
    assert 0.25 < found.last_step.figures["time_error"] / max(errors) < 4.0


def tractions(step):
    """Pressure and shear of a load step by the root of their areas."""
    if step.contact is None:
        return np.zeros(1)
    values = np.column_stack((step.contact.pressure, step.contact.shear))
    return np.sqrt(step.contact.boundary.weight)[:, None] * values
