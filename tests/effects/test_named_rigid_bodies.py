"""Rigid bodies that several contacts name: rollers, a sphere in a seat, keys and wedges, by statics and by hand."""

import math
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from test_tools import on_named_posts

from signorini_fx import ConvergenceError, SceneError, solve
from signorini_fx.addons.derivatives.of_scene import sensitivity
from signorini_fx.records import Status, StepRecord
from signorini_fx.results.certificate.certificate import certify
from signorini_fx.results.certificate.law_of_method import Tractions
from signorini_fx.results.short_answer import short_answer
from signorini_fx.results.summary import summarise
from signorini_fx.scenes.check_text import render
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_WORLD
F = 0.3
FRICTION = {"law": "coulomb", "coefficient": F}


def rectangle(name, length, height, nx, ny, **place):
    parameters = {"length": length, "height": height, "nx": nx, "ny": ny, "cell": "quadrilateral"}
    return {"name": name, "mesh": {"generator": "rectangle", "parameters": parameters}, **place}


def rows(solution):
    """The rows of rigid bodies in the summary."""
    return [
        tool.as_dict(solution.contact, solution.statement.contact, solution.model.kinematics)
        for tool in solution.last_step.tools
    ]


def sums(solution):
    """Of each contact: its pressures and its shears times weights, one row each."""
    contact = solution.contact
    forces = np.column_stack((contact.pressure, contact.shear)) * contact.boundary.weight[:, None]
    of = np.arange(len(solution.statement.contact))[:, None] == contact.boundary.part
    return COMM.allreduce(of @ forces)


def roller(*, upper=None, load=None, law=FRICTION, cells=15, unit=(1.0, 1.0), mirrored=False, radius=1.0, **driving):
    """A rigid roller between two plates; the upper one is moved, or else a load presses it down."""
    length, stress = unit
    sign = -1.0 if mirrored else 1.0
    plate = {"length": length, "height": length / 2, "nx": cells, "ny": 6}
    middle = radius * length
    top = {"x": 0.0} if upper is None else {"x": sign * upper[0] * length, "y": upper[1] * length}
    scene = {
        "body": [
            rectangle("lower", **plate, shift=[-length / 2, -length / 2]),
            rectangle("upper", **plate, shift=[-length / 2, 2 * middle]),
        ],
        "material": {"young": 1000.0 * stress, "poisson": 0.3},
        "displacement": [{"boundary": "lower.bottom", "x": 0.0, "y": 0.0}, {"boundary": "upper.top", **top}],
        "rigid": {
            "name": "roller",
            "shape": {"shape": "circle", "centre": [0.0, middle], "radius": middle},
            "pivot": [0.0, middle],
            **driving,
        },
        "contact": [
            {"boundary": name, "foundation": "roller", "friction": law} for name in ("lower.top", "upper.bottom")
        ],
        "solver": {"tolerance": 1e-11},
    }
    if load is not None:
        scene["traction"] = {"boundary": "upper.top", "y": -load * stress}
    return scene


FREE = {}  # what is not prescribed is free


def test_a_roller_rolls():
    """Between plates of which one moves by s it moves by s / 2 and turns by s / (2 R), and it resists with nothing."""
    s, radius = 2.5e-3, 4.0
    solution = solve(parse_scene(roller(upper=(s, -0.01), radius=radius, **FREE)))
    (row,), (below, above) = rows(solution), sums(solution)
    pressed = below[0]
    assert pressed > 1.0
    assert np.allclose(row["displacement"], [s / 2, -0.005], rtol=1e-8)
    # Plates whose surface is strained where they are pressed turn it a little less.
    assert np.isclose(row["rotation"], -s / (2 * radius), rtol=0.01)
    assert np.abs([*row["force"], row["moment"]]).max() < 1e-9 * pressed
    assert abs(below[1]) + abs(above[1]) < 1e-5 * pressed
    assert solution.certificate.holds
    assert solution.certificate.equilibrium < 1e-9


@pytest.mark.parametrize("algorithm", ["ssn", "alm"])
def test_a_roller_that_springs_hold_clear_of_a_body(algorithm):
    """A force that lifts it, over the stiffness: its springs balance the load alone, and the plates have none."""
    stiffness, force = {"x": 100.0, "y": 50.0, "rotation": 7.0}, [0.0, 3.0]
    scene = roller(spring=stiffness, force=force)
    scene["contact"], scene["body"], scene["displacement"] = (
        scene[key][:1] for key in ("contact", "body", "displacement")
    )
    scene["solver"]["algorithm"] = algorithm
    solution = solve(parse_scene(scene))
    (row,) = rows(solution)
    assert solution.status is Status.CONVERGED
    assert np.allclose(row["displacement"], [0.0, 3.0 / 50.0], rtol=1e-12, atol=1e-15)
    assert abs(solution.displacement.x.array).max() < 1e-12
    # Springs that are wrong by 1e-5 are refused.
    (tool,) = solution.last_step.tools
    wrong = replace(tool, translation=tool.translation * (1 + 1e-5))
    tagged, law = solution.model.tagged, solution.certificate.law
    tractions = Tractions.of(solution.contact)
    found = certify(solution.statement, tagged, solution.displacement, tractions, law=law, rigid=(wrong,))
    assert found.equilibrium == pytest.approx(1e-5, rel=1e-3)


def test_a_roller_that_may_not_turn_slides():
    """It drags both plates with all of their friction; the couple is that of both on the radius."""
    solution = solve(parse_scene(roller(upper=(0.05, -0.04), prescribed={"rotation": 0.0})))
    (row,), (below, above) = rows(solution), sums(solution)
    contact = solution.contact
    lever = np.linalg.norm(contact.boundary.centre - [0.0, 1.0], axis=1)
    couple = COMM.allreduce(float(F * (contact.pressure * contact.boundary.weight) @ lever))
    assert np.isclose(row["moment"], -couple, rtol=1e-9)
    assert np.isclose(couple, F * (below[0] + above[0]), rtol=0.01)
    assert np.isclose(row["displacement"][0], 0.025, rtol=1e-8)
    assert np.abs(row["force"]).max() < 1e-9 * below[0]
    assert solution.certificate.equilibrium < 1e-9


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_a_couple_turns_a_roller_as_soon_as_friction_gives_way(share):
    """Statics: it is held up to F P R at each of two plates."""
    load, radius = 4.0, 4.0
    scene = parse_scene(roller(load=load, radius=radius, force=[0.0, 0.0], moment=share * 2 * F * load * radius))
    if share < 1:
        (row,) = rows(solve(scene))
        assert np.isclose(row["moment"], -share * 2 * F * load * radius, rtol=1e-9)
        return
    with pytest.raises(ConvergenceError) as raised:
        solve(scene)
    assert raised.value.solution.status in (Status.SLIDES, Status.SLIDES_AT_PRESSURES)


def seat(turn=45.0, law=None, **driving):
    """A sphere in a conical seat of revolution, a washer whose inner face is inclined by ``turn``."""
    radius, angle, length, height = 2.0, math.radians(turn), 1.0, 0.5
    # Where the sphere about the origin touches the cone, in the middle of the upper side of the washer's section.
    touched = radius * np.array([math.sin(angle), -math.cos(angle)])
    along, normal = np.array([math.cos(angle), math.sin(angle)]), np.array([math.sin(angle), -math.cos(angle)])
    corner = touched - length / 2 * along + height * normal
    return {
        "body": rectangle("seat", length, height, 20, 10, rotation=turn, shift=corner.tolist()),
        "material": {"young": 1e4, "poisson": 0.3, "hypothesis": "axisymmetric"},
        "displacement": {"boundary": "seat.bottom", "x": 0.0, "y": 0.0},
        "rigid": {
            "name": "ball",
            "shape": {"shape": "circle", "centre": [0.0, 0.0], "radius": radius},
            "pivot": [0.0, 0.0],
            **driving,
        },
        "contact": {"boundary": "seat.top", "foundation": "ball", "friction": law or {"law": "none"}},
    }


@pytest.mark.parametrize("turn", [30.0, 45.0])
def test_a_sphere_in_a_conical_seat(turn):
    """Statics: all of the seat together pushes with P / cos of its inclination, whatever its radius is."""
    load = 1.0
    solution = solve(parse_scene(seat(turn, force=[0.0, -load])))
    (row,), ((pressed, _),) = rows(solution), sums(solution)
    assert np.isclose(row["force"][1], load, rtol=1e-9)
    assert np.isclose(pressed, load / math.cos(math.radians(turn)), rtol=2e-3)
    assert solution.certificate.equilibrium < 1e-9


def key(force, law=None):
    """A rigid key, half of it in the shaft and half in the hub; the shaft pushes it to the right, without Poisson."""
    sides = {"lower": [[-2.0, 0.0], "right", "left"], "upper": [[1.0, 0.5], "left", "right"]}
    shape = {"shape": "polyline", "points": [[-1.0, -0.2], [-1.0, 1.2], [1.0, 1.2], [1.0, -0.2], [-1.0, -0.2]]}
    return {
        "body": [rectangle(name, 1.0, 0.5, 4, 4, shift=shift) for name, (shift, *_) in sides.items()],
        "material": {"young": 1e4, "poisson": 0.0},
        "displacement": [
            {"boundary": "upper.right", "x": 0.0, "y": 0.0},
            {"boundary": "lower.bottom", "y": 0.0},
        ],
        "traction": {"boundary": "lower.left", "x": force / 0.5},
        "rigid": {
            "name": "key",
            "shape": shape,
            "pivot": [0.0, 0.5],
            "prescribed": {"y": 0.0, "rotation": 0.0},
        },
        "contact": [
            {"boundary": f"{name}.{touched}", "foundation": "key", "friction": law or {"law": "none"}}
            for name, (_, touched, _) in sides.items()
        ],
    }


def test_a_key():
    """It moves by what the hub yields, P L / (E A), and carries P from one half to the other: the couple P h / 2."""
    force = 5.0
    solution = solve(parse_scene(key(force)))
    (row,), ((shaft, _), (hub, _)) = rows(solution), sums(solution)
    assert np.allclose([shaft, hub], force, rtol=1e-9)
    assert np.isclose(row["displacement"][0], force * 1.0 / (1e4 * 0.5), rtol=1e-4)
    assert abs(row["force"][0]) < 1e-9 * force
    assert np.isclose(row["moment"], force * 0.5, rtol=1e-6)
    assert solution.certificate.equilibrium < 1e-9


def wedge(share, *, law=FRICTION, mirrored=False, **driving):
    """A rigid wedge between two blocks that are pressed on its sides, inclined by an angle whose tangent is a share of
    F.
    """
    angle = math.degrees(math.atan(share * F))
    cos, sin = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    # The right block lies along the normal of the right side of the wedge, (cos, sin), the left one mirrored.
    right = rectangle("right", 1.0, 1.0, 4, 4, rotation=angle, shift=[1.0, 0.0])
    left = rectangle("left", 1.0, 1.0, 4, 4, rotation=-angle, shift=[-1.0 - cos, sin])
    planes = {
        "right": {"shape": "plane", "point": [1.0, 0.0], "normal": [cos, sin]},
        "left": {"shape": "plane", "point": [-1.0, 0.0], "normal": [-cos, sin]},
    }
    faces = {"right": ("left", "right"), "left": ("right", "left")}
    order = ("left", "right") if mirrored else ("right", "left")
    return {
        "body": [{"right": right, "left": left}[name] for name in order],
        "material": {"young": 1000.0, "poisson": 0.0},
        "displacement": [{"boundary": f"{name}.{side}", "normal": 0.0} for name in order for side in ("top", "bottom")],
        "traction": [{"boundary": f"{name}.{faces[name][1]}", "pressure": 2.0} for name in order],
        "rigid": {"name": "wedge", "pivot": [0.0, 0.0], "force": [0.0, 0.0], **driving},
        "contact": [
            {
                "boundary": f"{name}.{faces[name][0]}",
                "foundation": {**planes[name], "rigid": "wedge"},
                "friction": law,
            }
            for name in order
        ],
    }


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_wedge_locks_itself_where_its_slope_is_below_the_friction(mirrored):
    solution = solve(parse_scene(wedge(0.99, mirrored=mirrored)))
    (row,), pressed = rows(solution), sums(solution)[:, 0]
    assert np.allclose(pressed, 2.0, rtol=1e-9)
    assert np.allclose(np.abs(sums(solution)[:, 1]), 2.0 * 0.99 * F, rtol=1e-9)
    assert np.abs(row["force"]).max() < 1e-9 * 2.0
    assert solution.certificate.equilibrium < 1e-9


def test_a_steeper_wedge_slides_and_says_so():
    with pytest.raises(ConvergenceError) as raised:
        solve(parse_scene(wedge(1.01)))
    assert raised.value.solution.status is Status.SLIDES
    assert "contact[0]" in str(raised.value)


def test_a_spring_at_the_pivot_takes_its_share():
    """A rigid plate on a block of stiffness E A / L and on its own spring: they share the force by their stiffness."""
    young, spring, load = 1000.0, 500.0, 3.0
    for dimension, algebra in ((2, "full"), (2, "condensed"), (3, "krylov")):
        names, up = "xyz"[:dimension], [0.0] * (dimension - 1) + [1.0]
        mesh = {"length": 1.0, "height": 0.5, **({"nx": 4, "ny": 4} if dimension == 2 else {"width": 1.0})}
        scene = parse_scene(
            {
                "mesh": {"generator": "rectangle" if dimension == 2 else "box", "parameters": mesh},
                "material": {"young": young, "poisson": 0.0},
                "displacement": {"boundary": "bottom", **dict.fromkeys(names, 0.0)},
                "rigid": {
                    "name": "plate",
                    "shape": {"shape": "plane", "point": [0.5 * one for one in up], "normal": [-one for one in up]},
                    "pivot": [0.5] * dimension,
                    "force": [-load * one for one in up],
                    # The plate would slide without friction, but for its springs.
                    "spring": {names[-1]: spring, **dict.fromkeys(names[:-1], 1.0)}
                    | ({"rotation": 2.0} if dimension == 2 else dict.fromkeys(["rotation_y", "rotation_x"], 2.0))
                    | ({} if dimension == 2 else {"rotation_z": 1.0}),
                },
                "contact": {"boundary": "top", "foundation": "plate"},
                "solver": {"linear_algebra": algebra},
            }
        )
        solution = solve(scene)
        (row,) = rows(solution)
        stiffness = young * 1.0 / 0.5
        assert np.isclose(row["displacement"][-1], -load / (stiffness + spring), rtol=1e-4)
        assert np.isclose(row["force"][-1], load - spring * -row["displacement"][-1], rtol=1e-9)
        assert solution.certificate.equilibrium < 1e-8


def test_a_spring_holds_what_would_slide():
    """The steeper wedge rests where its spring takes what friction does not; a couple turns a roller by M / k."""
    spring = 50.0
    solution = solve(parse_scene(wedge(1.5, spring={"y": spring})))
    (row,), both = rows(solution), sums(solution)
    angle = math.atan(1.5 * F)
    pushed = 2 * (2.0 * math.sin(angle) - F * 2.0 * math.cos(angle))
    assert np.allclose(both[:, 0], 2.0, rtol=1e-9)
    assert np.isclose(row["force"][1], -pushed, rtol=1e-9)
    assert np.isclose(row["displacement"][1], -pushed / spring, rtol=1e-9)
    tagged, tractions, law = solution.model.tagged, Tractions.of(solution.contact), solution.certificate.law
    (tool,) = solution.last_step.tools

    def judged(stiffness):
        scene = parse_scene(wedge(1.5, spring={"y": stiffness}))
        moved = replace(tool, body=scene.statement.rigid_bodies[0])
        return certify(scene.statement, tagged, solution.displacement, tractions, law=law, rigid=(moved,))

    assert judged(spring).holds
    assert judged(1.001 * spring).equilibrium > 1e-5
    slippery = roller(load=4.0, law={"law": "none"}, force=[0.0, 0.0], moment=0.1, spring={"rotation": 20.0, "x": 1.0})
    (row,) = rows(solve(parse_scene(slippery)))
    assert np.isclose(row["rotation"], 0.1 / 20.0, rtol=1e-9)


def pressed_and_rolled(unit=(1.0, 1.0), *, mirrored=False, **keys):
    """Load steps of a roller with friction and a spring: pressed, rolled forth and back."""
    length, stress = unit
    scene = roller(
        upper=(0.02, -0.02),
        mirrored=mirrored,
        unit=unit,
        force=[0.0, 0.0],
        spring={"x": 5.0 * stress, "rotation": 3000.0 * stress * length**2},
        **keys,
    )
    upper = scene["displacement"][1]
    way = upper.pop("x")
    scene["displacement"][1:] = [
        {"boundary": "upper.top", "y": upper["y"], "factors": [1.0, 1.0, 1.0]},
        {"boundary": "upper.top", "x": way, "factors": [0.0, 1.0, 0.0]},
    ]
    return scene


def histories(solution, unit=(1.0, 1.0)):
    """The motion of the first rigid body in each load step, without unit."""
    return np.array([np.append(step.tools[0].translation / unit[0], step.tools[0].rotation) for step in solution.steps])


@pytest.mark.slow
def test_load_steps_with_friction_in_other_units_and_mirrored():
    scene = parse_scene(pressed_and_rolled())
    assert "spring = {x = 5, rotation = 3000}, " in scene.contact[0].foundation.said
    wanted = solve(scene)
    assert all(step.certificate.equilibrium < 1e-9 for step in wanted.steps)
    motions = histories(wanted)
    assert abs(motions[2, 2]) > 0.1 * abs(motions[1, 2])  # friction remembers the way
    for unit in ((1e-9, 1.0), (1e6, 1e-6)):
        other = histories(solve(parse_scene(pressed_and_rolled(unit))), unit)
        assert np.abs(other - motions).max() < 1e-8 * np.abs(motions).max()
    mirrored = histories(solve(parse_scene(pressed_and_rolled(mirrored=True))))
    assert np.abs(mirrored * [-1.0, 1.0, -1.0] - motions).max() < 1e-8 * np.abs(motions).max()


def test_a_run_that_was_ended_goes_on(tmp_path):
    """After the second load step; with a checkpoint of the motion and of what sticks."""
    scene, folder = parse_scene(pressed_and_rolled()), COMM.bcast(str(tmp_path))

    def until_the_third(record):
        if isinstance(record, StepRecord) and record.step == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        solve(scene, checkpoint=folder, observers=[until_the_third])
    solution, wanted = solve(scene, checkpoint=folder, restart=True), histories(solve(scene))
    assert solution.history.events[0].startswith("restart: 2 complete load steps")
    assert np.abs(histories(solution) - wanted).max() < 1e-8 * np.abs(wanted).max()


def test_a_spring_is_none_that_a_derivative_is_taken_by():
    """Derivatives by a force know it: the spring takes its share of each newton."""
    scenes = [parse_scene(wedge(0.5, force=[0.0, push], spring={"y": 50.0})) for push in (0.09, 0.1, 0.11)]
    scene, path = scenes[1], "contact[0].foundation."
    (of_force,) = sensitivity(scene, ["force right.left y"], [f"{path}force[1]"])
    low, _, high = (rows(solve(one))[0]["displacement"][1] for one in scenes)
    share = 1 - 50.0 * (high - low) / 0.02
    assert 0.5 < share < 0.99
    assert np.isclose(2 * of_force.derivatives[0], share, rtol=1e-6)
    with pytest.raises(SceneError, match="is none that a derivative can be taken by"):
        sensitivity(scene, ["force right.left y"], [f"{path}spring.y"])


HELD_BY_NOTHING = [
    (roller(load=4.0, law={"law": "none"}, force=[0.0, 0.0], moment=0.1), Status.NOT_HELD),
    (wedge(0.5, law={"law": "none"}), Status.NOT_HELD),
    (seat(force=[0.0, 1.0]), Status.OPEN),
    (wedge(0.5, force=[0.0, 10.0]), Status.SLIDES),
]


@pytest.mark.parametrize(("scene", "status"), HELD_BY_NOTHING)
def test_what_nothing_holds_ends_with_its_name(scene, status):
    with pytest.raises(ConvergenceError) as raised:
        solve(parse_scene(deepcopy(scene)))
    assert raised.value.solution.status is status
    assert raised.value.solution.history.linear_solves == 0


def test_a_table_of_its_own_is_the_same_as_what_one_contact_says():
    """Motion and fields bit by bit; the scene can be read again from its tables."""
    several = on_named_posts()
    data = several.model_dump(exclude_unset=True)
    assert "rigid" not in data
    driven = data["contact"][1]["foundation"]
    table = {"name": "plate", "pivot": driven.pop("pivot"), "force": driven.pop("force")}
    scene = parse_scene(data | {"mesh": several.mesh, "rigid": table})
    again = parse_scene(scene.model_dump(exclude_unset=True) | {"mesh": several.mesh})
    first, second, third = (solve(one) for one in (several, scene, again))
    assert np.array_equal(second.displacement.x.array, third.displacement.x.array)
    assert np.allclose(first.displacement.x.array, second.displacement.x.array, rtol=0, atol=1e-15)
    assert rows(second)[0]["boundary"] == "plate"
    assert "rigid" in render(check_scene(scene))


MISTAKES = [
    ({"name": "another"}, r"contact\[0\].foundation: no \[\[rigid\]\] has the name 'roller'; there are: 'another'"),
    ({"shape": None}, r"contact\[0\].foundation: \[\[rigid\]\] 'roller' has no shape"),
    ({"force": [0.0, 0.0, 0.0]}, "the mesh is plane"),
    ({"pivot": None}, "give the point where the force acts"),
    ({"spring": {"z": 1.0}}, "spring.z: the mesh is plane"),
    ({"spring": {"x": 1.0}, "prescribed": {"x": 0.0}}, "spring.x: has no effect on a component that is prescribed"),
    ({"colour": "red"}, r"rigid\[?0?\]?.colour: unknown key"),
]


@pytest.mark.parametrize(("change", "words"), MISTAKES)
def test_mistakes_are_named(change, words):
    scene = roller(upper=(0.0, -0.04), **FREE)
    table = {key: value for key, value in (scene["rigid"] | change).items() if value is not None}
    with pytest.raises(SceneError, match=words):
        check_scene(parse_scene(scene | {"rigid": [table]}))


def test_a_rigid_body_needs_a_contact_and_one_name():
    scene = roller(upper=(0.0, -0.04), **FREE)
    for other, words in (("key", "no contact names it"), ("roller", "two rigid bodies have the name 'roller'")):
        with pytest.raises(SceneError, match=words):
            parse_scene(scene | {"rigid": [scene["rigid"], scene["rigid"] | {"name": other}]})


def test_the_first_lines_have_each_contact_and_the_motion():
    """The forces of both plates on the roller cancel: each contact has its own line, and the roller one of its motion;
    that it is moved by supports is no reason to say that nothing presses it.
    """
    solution = solve(parse_scene(roller(upper=(2.5e-3, -0.01))))
    contacts = [{"foundation": {"rigid": contact.foundation.rigid}} for contact in solution.statement.contact]
    summary = summarise(solution) | {"scene": {"contact": contacts}}
    lines = [line.text for line in short_answer(summary, "out")]
    forces = [line for line in lines if line.endswith((" on lower.top", " on upper.bottom"))]
    assert len(forces) == 2
    assert any("roller: moved by (0.00125, -0.005" in line for line in lines)
    assert not any("no load presses" in found.message for found in solution.findings if found.level == "warning")
