"""Loads beside tractions: total forces, weight, fluids, rotation, and functions of time; exact
states and statics.
"""

import numpy as np
import pytest
from boxes import Box, boxes_mesh, scene_on
from mpi4py import MPI
from on_meshes import nodes
from scene_tables import coulomb_friction, fixed
from scenes import alone
from steel_blocks import COMM, ELEMENTS, PLANE, SIZE, YOUNG, body, scene

from signorini_fx import SceneError
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.solver import solve

SOFT = {"young": YOUNG, "poisson": 0.0}


def axes(cells):
    """The letters of all axes."""
    return "xy" if cells in PLANE else "xyz"


def upwards(cells):
    """The axis against gravity, by its number and letter."""
    return (1, "y") if cells in PLANE else (2, "z")


# --- exact states ---------------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.one_quick("axis", [0, 1])
@pytest.mark.parametrize(("cells", "degree"), ELEMENTS)
def test_spread_of_a_total_force(cells, degree, axis):
    """In proportion to a value: the sum is the same, and it acts at the centroid of the value."""
    up, letter = upwards(cells)
    held = fixed("left", axes(cells))
    force = {"boundary": "right", "xyz"[axis]: 2.0, "spread": f"x[{up}]"}
    solution = solve(scene(body(cells), degree, displacement=held, force=force), COMM, check=False)
    found = solution.resultants.of("right")
    assert found.acts == ("force",)
    expected = np.zeros(up + 1)
    expected[axis] = 2.0
    assert found.force == pytest.approx(expected, abs=1e-12)
    if axis == 0:
        assert found.acts_at[up] == pytest.approx(2 / 3, rel=1e-12)
    assert solution.certificate.holds
    assert letter in "yz"


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("cells", "degree"), [("quadrilateral", 2), ("triangle", 2), ("tetrahedra", 2)]
)
def test_column_under_its_weight(cells, degree):
    """y = - rho g (H s - s^2 / 2) / E at the height s, by the density of its material."""
    up, letter = upwards(cells)
    density, gravity = 3.0, 9.81
    held = fixed("bottom", axes(cells))
    given = scene(
        body(cells),
        degree,
        {**SOFT, "density": density},
        displacement=held,
        gravity={letter: -gravity},
    )
    solution = solve(given, COMM, check=False)
    x, y = nodes(solution)
    expected = np.zeros_like(y)
    expected[:, up] = -density * gravity * (x[:, up] - x[:, up] ** 2 / 2) / YOUNG
    assert np.abs(y - expected).max(initial=0.0) <= 1e-11 * density * gravity / YOUNG
    assert solution.certificate.holds
    (weight,) = (one for one in solution.resultants.every() if one.boundary is None)
    assert weight.acts == ("gravity",)
    assert weight.force[up] == pytest.approx(-density * gravity * 2.0, rel=1e-12)


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("cells", "degree"), [("quadrilateral", 2), ("triangle", 2), ("tetrahedra", 2)]
)
def test_rotating_bar(cells, degree):
    """About an axis through its end: y = rho omega^2 (L^2 x / 2 - x^3 / 6) / E at the vertices and
    the free end.
    """
    density, speed, length = 2.0, 3.0, SIZE[0]
    held = fixed("left", axes(cells))
    axis = [0.0, 5.0, *([] if cells in PLANE else [0.0])]
    rotation = {
        "speed": speed,
        "axis": axis,
        "about": [0.0, 7.0, *([] if cells in PLANE else [0.0])],
    }
    material = {**SOFT, "density": density}
    given = scene(body(cells), degree, material, displacement=held, rotation=rotation)
    solution = solve(given, COMM, check=False)
    unit = density * speed**2 / YOUNG
    (drag,) = (one for one in solution.resultants.every() if one.boundary is None)
    assert drag.acts == ("rotation",)
    assert drag.force[0] == pytest.approx(density * speed**2 * length**2 / 2, rel=1e-12)
    assert solution.certificate.holds
    if cells == "quadrilateral":
        x, y = nodes(solution)
        end = np.abs(x[:, 0] - length) < 1e-9
        assert y[end, 0] == pytest.approx(unit * length**3 / 3, rel=1e-10)


@pytest.mark.parametrize("axis", [[1.0, 2.0, 0.0], [0.0, -1.0, 3.0], None])
def test_rotation_about_any_axis_in_space(axis):
    """The resultant is m omega^2 times the arm of the centre of mass from the axis, all of whose
    numbers count.
    """
    about, density, speed = np.array([0.3, -0.4, 0.9]), 2.0, 3.0
    given = {"speed": speed, "about": about.tolist(), **({} if axis is None else {"axis": axis})}
    held = fixed("left", "xyz")
    material = {**SOFT, "density": density}
    solution = solve(
        scene(body("tetrahedra"), 1, material, displacement=held, rotation=given), COMM, check=False
    )
    along = np.array([0.0, 0.0, 1.0] if axis is None else axis)
    arm = np.array([*SIZE, 1.0]) / 2 - about
    arm -= along * (along @ arm) / (along @ along)
    wanted = density * np.prod([*SIZE, 1.0]) * speed**2 * arm
    drag = solution.resultants.body_force()
    assert drag.force == pytest.approx(wanted, abs=1e-11 * np.abs(wanted).max())
    assert solution.resultants.of("left").force == pytest.approx(
        -wanted, abs=1e-9 * np.abs(wanted).max()
    )


@pytest.mark.mpi
@pytest.mark.one_quick(("cells", "degree"), ELEMENTS)
def test_archimedes(cells, degree):
    """A body that is all under water is pushed up by the weight of the water that it displaces."""
    up, _ = upwards(cells)
    weight, level = 2.5, 1.7
    sides = ["left", "right", "bottom", "top", *([] if cells in PLANE else ["front", "back"])]
    tagged = body(cells)
    held = fixed("bottom", axes(cells))
    water = [
        {"boundary": side, "level": level, "weight": weight}
        for side in sides
        if side in tagged.boundaries
    ]
    solution = solve(scene(tagged, degree, displacement=held, fluid=water), COMM, check=False)
    total = COMM.allreduce(solution.resultants.acting.balance.external.sum(axis=0))
    expected = np.zeros(up + 1)
    expected[up] = weight * 2.0
    assert total == pytest.approx(expected, abs=1e-12)
    assert solution.certificate.holds


@pytest.mark.mpi
@pytest.mark.parametrize("cells", ["quadrilateral", "hexahedra"])
def test_water_at_a_wall(cells):
    """Up to a level within a facet: w h^2 / 2, at a third of the height; its upper part is dry."""
    up, letter = upwards(cells)
    weight, level = 2.5, 0.75
    held = fixed("bottom", axes(cells))
    water = {"boundary": "left", "level": level, "weight": weight, "up": letter}
    solution = solve(
        scene(body(cells, fine=2), 1, displacement=held, fluid=water), COMM, check=False
    )
    found = solution.resultants.of("left")
    assert found.force[0] == pytest.approx(weight * level**2 / 2, rel=1e-3)
    assert found.acts_at[up] == pytest.approx(level / 3, rel=1e-2)
    assert solution.certificate.holds


# --- functions of time ----------------------------------------------------------------------------

PRESSED = {
    "displacement": fixed("left", "x"),
    "contact": {"boundary": "bottom", "friction": coulomb_friction(0.3)},
}


def same_steps(one, other, exact=1e-9):
    """Whether two solutions have the same load steps."""
    assert len(one.steps) == len(other.steps)
    for first, second in zip(one.steps, other.steps, strict=True):
        y, same = first.displacement.x.array, second.displacement.x.array
        assert np.abs(y - same).max() <= exact * np.abs(same).max()
        assert first.certificate.holds


@pytest.mark.one_quick("linear_algebra", ["full", "condensed", "krylov"])
def test_time_is_a_list_of_factors(linear_algebra, tmp_path):
    """A load and a displacement that are linear in t: the same as factors, in load steps, a ramp
    and a restart.
    """
    times, solver = [0.5, 1.0, 0.25], {"linear_algebra": linear_algebra, "tolerance": 1e-12}
    given = {
        "traction": {"boundary": "top", "y": "-20*t", "x": "3*t"},
        "load_steps": {"times": sorted(times)},
    }
    given["displacement"] = [PRESSED["displacement"], {"boundary": "right", "x": "1e-3*t"}]
    listed = {"traction": {"boundary": "top", "y": -20.0, "x": 3.0, "factors": sorted(times)}}
    listed["displacement"] = [
        PRESSED["displacement"],
        {"boundary": "right", "x": 1e-3, "factors": sorted(times)},
    ]
    given = scene(body(comm=MPI.COMM_SELF), **{**PRESSED, **given}, solver=solver)
    timed = alone(given, check=False, checkpoint=tmp_path)
    factors = alone(
        scene(body(comm=MPI.COMM_SELF), **{**PRESSED, **listed}, solver=solver), check=False
    )
    same_steps(timed, factors)
    if linear_algebra != "krylov":  # whose solves end within a tolerance
        assert [step.linear_solves for step in timed.steps] == [
            step.linear_solves for step in factors.steps
        ]
    again = alone(given, check=False, checkpoint=tmp_path, restart=True)
    assert np.array_equal(again.displacement.x.array, timed.displacement.x.array)


# --- what is said, and refused --------------------------------------------------------------------


HEAVY = {**SOFT, "density": 1.0}
REFUSED = {
    "no density": (
        SOFT,
        {"gravity": {"y": -1.0}},
        r"material: has no density, which gravity needs",
    ),
    "no density that rotates": (
        SOFT,
        {"rotation": {"speed": 1.0}},
        r"material: has no density, which rotation needs",
    ),
    "negative density": ({**SOFT, "density": -1.0}, {}, r"material.*density.*must not be negative"),
    "no level": (SOFT, {"fluid": {"boundary": "left", "weight": 1.0}}, r"fluid.*level: is missing"),
    "no weight": (
        SOFT,
        {"fluid": {"boundary": "left", "weight": -1.0, "level": 1.0}},
        r"fluid.*weight.*must not be negative",
    ),
    "level": (
        SOFT,
        {"fluid": {"boundary": "left", "weight": 1.0, "level": "x[2]"}},
        r"fluid.*level: the mesh is plane",
    ),
    "up": (
        SOFT,
        {"fluid": {"boundary": "left", "weight": 1.0, "level": 1.0, "up": "z"}},
        r"fluid\[0\]\.up: the mesh is plane",
    ),
    "axis": (
        HEAVY,
        {"rotation": {"speed": 1.0, "axis": [0.0, 0.0, 1.0]}},
        r"rotation\[0\]\.axis.*give 2 numbers",
    ),
    "no axis": (
        HEAVY,
        {"rotation": {"speed": 1.0, "axis": [0.0, 0.0]}},
        r"rotation.*axis: must not be zero",
    ),
    "about": (HEAVY, {"rotation": {"speed": 1.0, "about": [1.0]}}, r"rotation.*about"),
    "spread": (
        SOFT,
        {"force": {"boundary": "right", "x": 1.0, "spread": "x[1] - 0.5"}},
        r"spread.*must not be 0",
    ),
    "no spread": (
        SOFT,
        {"force": {"boundary": "right", "x": 1.0, "spread": 0.0}},
        r"spread.*must not be 0",
    ),
    "time of a spread": (
        SOFT,
        {"force": {"boundary": "right", "x": 1.0, "spread": "t"}},
        r"t, the time, is for loads",
    ),
    "time of springs": (
        SOFT,
        {"springs": {"boundary": "top", "normal": "t"}},
        r"springs.*t, the time, is for loads",
    ),
    "times": (
        SOFT,
        {
            "traction": [
                {"boundary": "top", "y": "t"},
                {"boundary": "top", "x": 1.0, "factors": [1.0, 2.0, 3.0]},
            ],
            "load_steps": {"times": [1.0, 2.0]},
        },
        r"load_steps\.times: has 2 entries, one for each of 3 load steps",
    ),
}


@pytest.mark.mpi
@pytest.mark.parametrize("mistake", REFUSED)
def test_mistakes(mistake):
    """Each with its path, on all ranks."""
    material, more, message = REFUSED[mistake]
    with pytest.raises(SceneError, match=message):
        check_scene(scene(body(), 1, material, **{"displacement": fixed("left"), **more}), COMM)


# --- prescribed rotations, and supports at points -------------------------------------------------


@pytest.mark.mpi
@pytest.mark.one_quick("angle", [1e-3, "1e-3*t", "1e-3 + 0*x[0]"])
@pytest.mark.parametrize(("cells", "degree"), ELEMENTS)
def test_rotated_without_stress(cells, degree, angle):
    """Both ends rotate and move alike: y = w x (x - c) + d, without any stress."""
    turn = {
        "rotation": angle,
        "about": [0.5, 0.25, *([] if cells in PLANE else [1.0])],
        "x": 2e-3,
        "y": 0.0,
    }
    along, shift = np.array([0.0, 0.0, 1.0]), np.array([2e-3, 0.0, 0.0])
    if cells not in PLANE:
        turn |= {"axis": [0.0, 3.0, 4.0], "z": 1e-3}
        along, shift = np.array([0.0, 0.6, 0.8]), np.array([2e-3, 0.0, 1e-3])
    held = [{"boundary": side, **turn} for side in ("left", "right")]
    contact = {"boundary": "bottom", "gap": 1.0}
    solution = solve(
        scene(body(cells), degree, displacement=held, contact=contact), COMM, check=False
    )
    x, y = nodes(solution)
    centre = np.zeros(3)
    centre[: y.shape[1]] = turn["about"]
    expected = (np.cross(1e-3 * along, x - centre) + shift)[:, : y.shape[1]]
    assert np.abs(y - expected).max(initial=0.0) <= 1e-12
    assert solution.certificate.holds
    assert solution.certificate.strain_energy < 1e-12


@pytest.mark.mpi
@pytest.mark.parametrize(("cells", "degree"), ELEMENTS)
def test_points_carry_a_force(cells, degree):
    """Statics: of a force that acts at two thirds of the length the far end carries two thirds."""
    up, letter = upwards(cells)
    load = {"boundary": "top", letter: -6.0, "spread": "x[0]"}
    held = [{"at": [0.0, 0.0], "x": 0.0, "y": 0.0}, {"at": [2.0, 0.0], "y": 0.0}]
    if cells not in PLANE:
        held = [
            {"at": [0.0, 0.0, 0.0], "x": 0.0, "y": 0.0, "z": 0.0},
            {"at": [0.0, 1.0, 0.0], "x": 0.0, "z": 0.0},
            {"at": [2.0, 0.0, 0.0], "z": 0.0},
            {"at": [2.0, 1.0, 0.0], "z": 0.0},
        ]
    solution = solve(scene(body(cells), degree, displacement=held, force=load), COMM, check=False)
    assert solution.certificate.holds
    reactions = [
        solution.resultants.of(f"({', '.join(f'{x:g}' for x in one['at'])})") for one in held
    ]
    assert all(one.acts == ("support",) for one in reactions)
    near, far = (
        sum(
            one.force[up]
            for one, where in zip(reactions, held, strict=True)
            if where["at"][0] == at
        )
        for at in (0.0, 2.0)
    )
    assert (near, far) == pytest.approx((2.0, 4.0), abs=1e-9)
    assert [row["boundary"] for row in solution.resultants.as_rows()] == [
        "top",
        *(one.boundary for one in reactions),
    ]


SUPPORTS_REFUSED = {
    "nowhere": ({"x": 0.0}, r"give either a boundary or at"),
    "twice": ({"x": 0.0, "boundary": "left", "at": [0.0, 0.0]}, r"give either a boundary or at"),
    "no node": (
        {"x": 0.0, "at": [0.1, 0.01]},
        r"displacement\[0\]\.at: no node .* \(0\.1, 0\.01\); near is \(0, 0\)",
    ),
    "normal": ({"normal": 0.0, "at": [0.0, 0.0]}, r"a point has no normal"),
    "three numbers": (
        {"x": 0.0, "at": [0.0, 0.0, 0.0]},
        r"displacement\[0\]\.at: the mesh is plane: give 2 numbers",
    ),
    "rotation and normal": (
        {"normal": 0.0, "rotation": 1.0, "boundary": "left"},
        r"give either normal or",
    ),
    "about": (
        {"x": 0.0, "about": [0.0, 0.0], "boundary": "left"},
        r"about and axis need a rotation",
    ),
    "axis in 2D": (
        {"rotation": 0.0, "axis": [0.0, 0.0, 1.0], "boundary": "left"},
        r"displacement\[0\]\.axis: the mesh is plane",
    ),
    "no axis": (
        {"rotation": 0.0, "axis": [0.0, 0.0, 0.0], "boundary": "left"},
        r"axis: must not be zero",
    ),
}


@pytest.mark.mpi
@pytest.mark.parametrize("mistake", SUPPORTS_REFUSED)
def test_mistakes_of_supports(mistake):
    """Each with its path, on all ranks."""
    held, message = SUPPORTS_REFUSED[mistake]
    with pytest.raises(SceneError, match=message):
        check_scene(scene(body(), displacement=[held]), COMM)


@pytest.mark.mpi
def test_a_point_with_nodes_of_two_bodies():
    """Which of them is supported is not guessed, on all ranks alike."""
    mesh = boxes_mesh(COMM, [Box("lower", 0.0, 0.0, 1.0, 1.0), Box("upper", 0.0, 1.0, 1.0, 1.0)])
    held = [fixed("bottom lower"), {"at": [0.0, 1.0], "x": 0.0}]
    contact = {"boundary": "bottom upper", "against": "top lower"}
    with pytest.raises(
        SceneError, match=r"displacement\[1\]\.at: 2 nodes of the mesh are at \(0, 1\)"
    ):
        check_scene(scene_on(mesh, displacement=held, contact=contact), COMM)
