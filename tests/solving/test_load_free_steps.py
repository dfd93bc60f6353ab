"""Load steps in which nothing presses on bodies that contact alone holds: they stay near to where
they were.
"""

import tomllib

import numpy as np
import pytest
from dolfinx import mesh
from mpi4py import MPI
from numpy.testing import assert_allclose
from scene_tables import coulomb_friction, fixed, plane_shape, rectangle_mesh

from signorini_fx import ConvergenceError, Status, solve
from signorini_fx.scenes.reading import parse_scene

WIDTH, HEIGHT, FORCE, EXPANSION, CHANGE = 4.0, 4.0, 20.0, 1e-3, 10.0
ELASTIC = {"young": 1000.0, "poisson": 0.3, "expansion": EXPANSION}
LAWS = {
    "linear": ELASTIC,
    "neo-hooke": {"law": "neo-hooke", **ELASTIC},
    "j2": {"law": "j2", **ELASTIC, "yield_stress": 3.0, "hardening": 100.0},
}
# Of each path: what loads the body.
PATHS = {
    "first": ({"factors": [0.0, 0.5, 1.0]}, {}),
    "middle": ({"factors": [1.0, 0.0, 1.0]}, {}),
    "last": ({"factors": [0.5, 1.0, 0.0]}, {}),
    "twice": ({"factors": [0.0, 0.0, 1.0, 0.0, 0.0]}, {}),
    "ramp": ({"factors": [0.0, 1.0]}, {"load_steps": {"steps": 2}}),
    "of time": ({"y": f"-{FORCE}*t"}, {"load_steps": {"times": [0.0, 0.5, 1.0]}}),
    "heat first": (
        {"factors": [0.0, 1.0]},
        {"temperature": {"change": CHANGE, "factors": [1.0, 0.0]}},
    ),
    "heat last": (
        {"factors": [1.0, 0.0]},
        {"temperature": {"change": CHANGE, "factors": [0.0, 1.0]}},
    ),
    "heat alone": (None, {"temperature": {"change": CHANGE, "factors": [0.0, 1.0]}}),
}
# A body that was pressed, and that a support moves along a plane then, or that it only moves.
LET_GO = """
mesh = { generator = "rectangle", parameters = { length = 2.21, height = 0.714, nx = 18, ny = 10 } }
element.degree = 2
solver.algorithm = "alm"
material = { young = 248.0, poisson = 0.2 }
contact = { boundary = "bottom", gap = "0.00096*(x[0]-1.1)**2" }
displacement = { boundary = "left", x = 0.00064, factors = [0.0, 0.8, 0.2] }
traction = { boundary = "top", y = -0.879, factors = [1.0, 1.0, 0.0] }
"""
MOVED = """
mesh = { generator = "rectangle", parameters = { length = 3.0, nx = 24, ny = 8, cell = "triangle" } }
element.degree = 2
material = { young = 5.0, poisson = 0.4 }
displacement = { boundary = "top", x = 0.0, y = "-t" }
load_steps.times = [0.5, 1.0, 1.1]
contact.boundary = "bottom"
contact.foundation = { shape = "plane", point = [0.0, -1.0], normal = [0.0, 1.0] }
"""
COULOMB = coulomb_friction(0.3)


def stack(law, bodies, path, *, rough=False, held=True):
    """One block on a plane, or two, which the upper end presses on."""
    load, further = PATHS[path]
    names = [""] if bodies == 1 else ["lower.", "upper."]
    rubs = {"friction": COULOMB} if rough else {}
    plane = plane_shape([0.0, 0.0], [0.0, 1.0])
    blocks = []
    for k, name in enumerate(names):
        size = {"length": WIDTH, "height": HEIGHT, "nx": 3 - k, "ny": 2, "cell": "quadrilateral"}
        mesh = rectangle_mesh(**size)
        blocks.append({"name": name[:-1], "mesh": mesh, "shift": [0.0, k * HEIGHT]})
    scene = {
        "material": LAWS[law],
        "contact": [{"boundary": f"{names[0]}bottom", "foundation": plane, **rubs}],
        "displacement": [fixed(f"{name}left", "x") for name in names] if held else [],
    }
    if load is not None:
        scene["force"] = {"boundary": f"{names[-1]}top", "y": -FORCE, **load}
    if bodies == 1:
        return parse_scene(scene | {"mesh": blocks[0]["mesh"]} | further)
    scene["contact"].append({"boundary": "upper.bottom", "against": "lower.top", **rubs})
    return parse_scene(scene | {"body": blocks} | further)


def table():
    """The law, the number of bodies, the path, whether it is rough and whether supports hold it
    sideways.
    """
    cases = [("linear", bodies, path, bodies == 2, True) for bodies in (1, 2) for path in PATHS]
    cases += [
        ("neo-hooke", 1, path, False, True) for path in ("first", "last", "ramp", "heat alone")
    ]
    cases += [("neo-hooke", 2, path, True, True) for path in ("middle", "heat first")]
    cases += [("j2", 1, path, True, True) for path in ("middle", "twice", "heat last")]
    cases += [("j2", 2, "of time", False, True)]
    cases += [(law, 1, "middle", True, False) for law in LAWS]
    quick = [("neo-hooke", 1, "first"), ("neo-hooke", 1, "last"), ("j2", 1, "middle")]
    for case in cases:
        slow = case[0] != "linear" and case[:3] not in quick
        name = "-".join(map(str, (*case[:3], *("rough",) * case[3], *("held",) * case[4])))
        yield pytest.param(*case, id=name, marks=[pytest.mark.slow] * slow)


def nodes_of(displacement):
    """Places and displacements of the nodes of each body."""
    space = displacement.function_space
    x, y = space.tabulate_dof_coordinates()[:, :2], displacement.x.array.reshape(-1, 2)
    count = space.mesh.topology.index_map(2).size_local
    upper = np.zeros(len(x), dtype=bool)
    middles = mesh.compute_midpoints(space.mesh, 2, np.arange(count, dtype=np.int32))
    upper[space.dofmap.list[middles[:, 1] > HEIGHT]] = True
    return [(x[part], y[part]) for part in (~upper, upper) if part.any()]


@pytest.mark.one_quick(("law", "bodies", "path", "rough", "held"), list(table()))
def test_stays_near_to_where_it_was(law, bodies, path, rough, held):
    """No forces, no strain but that of heat and of yielding, each body on what is below it, and not
    moved sideways.
    """
    solution = solve(stack(law, bodies, path, rough=rough, held=held), MPI.COMM_SELF)
    assert solution.converged
    load, further = PATHS[path]
    free_steps = [
        step.step for step in solution.steps if load is None or share_of_load(load, step) == 0.0
    ]
    listed = ", ".join(map(str, free_steps))
    notes = [found.message for found in solution.findings if "nothing presses on" in found.message]
    assert len(notes) == 1
    assert notes[0].startswith(f"load step{'s' * (len(free_steps) > 1)} {listed}: ")
    hot = further.get("temperature", {"factors": [0.0]})
    size, last = FORCE / ELASTIC["young"], None
    for step in solution.steps:
        exerted = np.sum(step.contact.forces_of_each, axis=1)
        if step.step not in free_steps:
            assert_allclose(np.abs(exerted[:, 1]), FORCE * share_of_load(load, step), rtol=1e-5)
        else:
            assert not np.abs(step.contact.forces_of_each).any()
            warmth, floor = CHANGE * EXPANSION * share_of_load(hot, step), 0.0
            for x, y in nodes_of(step.displacement):
                if law != "j2":  # a rigid motion, and swelling
                    arms = np.column_stack((-x[:, 1], x[:, 0])).ravel()
                    rows = np.column_stack(
                        (np.tile(np.eye(2), (len(x), 1)), arms, *((x.ravel(),) if warmth else ()))
                    )
                    motion = np.linalg.lstsq(rows, y.ravel(), rcond=None)[0]
                    assert_allclose(rows @ motion, y.ravel(), rtol=0, atol=1e-8 * size)
                    assert_allclose(motion[3:], (1 + ELASTIC["poisson"]) * warmth, rtol=1e-2)
                bottom = np.isclose(x[:, 1], x[:, 1].min())
                places = x[bottom, 1] + y[bottom, 1]
                # What has yielded is not flat any more, and touches at its lowest place.
                lowest = places.min() if law == "j2" else places
                assert_allclose(lowest, floor, rtol=0, atol=2e-4 * size)
                assert places.min() > floor - 1e-6 * size
                floor = (x[:, 1] + y[:, 1]).max()
        if not held and law != "j2" and last is not None:
            of_last, of_now = (
                nodes_of(displacement)[0][1][:, 0].mean()
                for displacement in (last, step.displacement)
            )
            assert abs(of_now - of_last) < 1e-2 * size
        last = step.displacement
    assert solution.certificate.holds


def share_of_load(load, step):
    """By which a load is multiplied at the time of a load step."""
    if "factors" not in load:
        return step.time
    return np.interp(step.time, range(len(load["factors"]) + 1), [0.0, *load["factors"]])


@pytest.mark.one_quick(
    ("law", "bodies"),
    [
        ("linear", 1),
        ("linear", 2),
        ("neo-hooke", 1),
        ("j2", 1),
        pytest.param("neo-hooke", 2, marks=pytest.mark.slow),
        pytest.param("j2", 2, marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("path", ["first", "middle"])
def test_nothing_holds_it_sideways(law, bodies, path):
    """The outcome has a name, whichever step is without a load."""
    with pytest.raises(ConvergenceError) as error:
        solve(stack(law, bodies, path, held=False), MPI.COMM_SELF)
    assert error.value.solution.status is Status.NOT_HELD


def test_a_wall_that_goes_back_leaves_a_body_where_it_is():
    """It pushes by 0.1 at first; then nothing acts, and the body would be in equilibrium at the
    origin, too.
    """
    scene = stack("linear", 1, "first").model_dump(exclude_unset=True)
    scene |= {
        "displacement": fixed("bottom", "y"),
        "contact": {"boundary": "left", "gap": "0.1*(t - 2)"},
    }
    solution = solve(
        parse_scene(scene | {"force": [], "load_steps": {"times": [1.0, 2.0]}}), MPI.COMM_SELF
    )
    assert_allclose(solution.displacement.x.array[::2], 0.1, rtol=1e-5)


def test_augmentation_after_a_step_without_a_load():
    """The body is pressed on as the first time: no elastic slip of the step in between is left."""
    scene = stack("linear", 1, "middle", rough=True).model_dump(exclude_unset=True) | {
        "solver": {"algorithm": "alm"}
    }
    first, _, again = solve(parse_scene(scene), MPI.COMM_SELF).steps
    assert_allclose(again.contact.shear, first.contact.shear, rtol=1e-4)


@pytest.mark.parametrize("law", LAWS)
def test_without_any_load(law):
    """One load step without a load has no solution of its own, and the outcome says why."""
    scene = stack(law, 1, "first")
    alone = parse_scene(scene.model_dump(exclude_unset=True) | {"force": fixed("top", "y")})
    with pytest.raises(
        ConvergenceError, match=r"nothing presses on the body|no load presses the body on"
    ) as error:
        solve(alone, MPI.COMM_SELF)
    assert error.value.solution.status is Status.NOT_HELD


def test_a_support_moves_a_body_that_is_let_go():
    """All forces are round-off of the way, and none is a residual."""
    solution = solve(parse_scene(tomllib.loads(LET_GO)), MPI.COMM_SELF)
    assert solution.converged
    last = solution.steps[-1]
    assert np.abs(last.displacement.x.array[::2] - 0.2 * 0.00064).max() < 1e-12
    assert not last.contact.in_contact.any()


@pytest.mark.one_quick("law", ["neo-hooke", "saint-venant-kirchhoff"])
@pytest.mark.parametrize("degree", [2, 1])
def test_a_nonlinear_body_moves_before_it_touches(law, degree):
    """Through the air and up to the plane it is only moved, which is a solution, and nothing is
    said of forces that there are not.
    """
    text = MOVED.replace("{ young", f'{{ law = "{law}", young')
    scene = parse_scene(tomllib.loads(text.replace("degree = 2", f"degree = {degree}")))
    solution = solve(scene, MPI.COMM_SELF)
    assert solution.converged
    assert [finding for finding in solution.findings if finding.path == "material"] == []
    moved = solution.steps[0].displacement.x.array.reshape(-1, 2)
    assert_allclose(moved, np.tile([0.0, -0.5], (len(moved), 1)), atol=1e-12)
    assert not solution.steps[0].contact.in_contact.any()
    assert solution.steps[-1].contact.in_contact.all()


@pytest.mark.one_quick("sliding", ["small", "finite"])
def test_what_pressed_before_does_not_turn_in_a_step_without_a_load(sliding):
    """A block on another one that nothing presses on any more: it stays, and no step is halved."""
    mesh = rectangle_mesh(4, 4)
    entry = {"boundary": "upper.bottom", "against": "lower.top"}
    scene = {
        "body": [
            {"name": "lower", "mesh": mesh},
            {"name": "upper", "mesh": mesh, "shift": [0.0, 1.0]},
        ],
        "material": LAWS["neo-hooke"],
        "displacement": [fixed("lower.bottom"), fixed("upper.left", "x")],
        "traction": {"boundary": "upper.top", "y": -50.0, "factors": [1.0, 0.0]},
        "contact": entry | ({"sliding": sliding} if sliding == "small" else {}),
    }
    solution = solve(parse_scene(scene), MPI.COMM_SELF)
    assert solution.converged
    assert np.abs(solution.displacement.x.array).max() < 1e-6
    assert not any("given up" in event for event in solution.history.events)
