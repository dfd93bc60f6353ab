"""Foundations that forces move: the same as prescribed motions, statics by hand, Hertz by force, named outcomes."""

import dataclasses
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from boxes import Box, boxes_mesh
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scipy.linalg import expm

from signorini_fx import ConvergenceError, SceneError, solve
from signorini_fx.addons.derivatives.of_scene import sensitivity
from signorini_fx.algebra.linalg.krylov import KrylovSystem
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.mechanics.rigid.rigid_bodies import RigidBodyMotion
from signorini_fx.mechanics.statement.rigid_motion import RigidBody, RigidMotion
from signorini_fx.quantities.differentiable import functional_of
from signorini_fx.records import Status
from signorini_fx.results.certificate.certificate import certify
from signorini_fx.results.certificate.law_of_method import Tractions
from signorini_fx.scenes.check_text import render
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene, read_scene
from signorini_fx.scenes.sweep import sweep

COMM = MPI.COMM_WORLD
GAMMAS = {"gamma_n": 1e9, "gamma_t": 1e9}
TOP = RigidBody("top", RigidMotion(), (0,))
HERE = Path(__file__).parents[1]
LAWS = {
    "none": {"law": "none"},
    "tresca": {"law": "tresca", "bound": 4.0},
    "coulomb": {"law": "coulomb", "coefficient": 0.3},
}


def block(
    dimension=2,
    law="none",
    algebra="full",
    *,
    degree=1,
    cell=None,
    parts=(5, 5, 3),
    unit=(1.0, 1.0),
    times=None,
    solver=None,
    accuracy=None,
    **tool,
):
    """A block on the ground, and a circle or a ball above it that is pressed down; ``unit``: of length and force."""
    length, force = unit
    stress = force / length**2  # in 2D forces are per thickness
    plane = dimension == 2
    mesh = {
        "generator": "rectangle" if plane else "box",
        "parameters": {"length": length, "height": length / 2, "nx": 12, "ny": 6, "cell": cell or "quadrilateral"}
        if plane
        else {
            "length": length,
            "height": length / 2,
            "width": length,
            **dict(zip(("nx", "ny", "nz"), parts, strict=True)),
            "cell": cell or "hexahedron",
        },
    }
    centre = [0.45 * length, 2.5 * length] if plane else [0.45 * length, 0.5 * length, 2.5 * length]
    friction = dict(LAWS[law])
    if "bound" in friction:
        friction["bound"] *= stress
    ground = dict.fromkeys("xyz"[:dimension], 0.0)
    return parse_scene(
        {
            "mesh": mesh,
            "element": {"degree": degree},
            "material": {"young": 1000.0 * stress, "poisson": 0.3},
            "displacement": {"boundary": "bottom", **ground},
            "contact": {
                "boundary": "top",
                "foundation": {
                    "shape": "circle" if plane else "sphere",
                    "centre": centre,
                    "radius": 2.0 * length,
                    "pivot": centre,
                    **tool,
                },
                "friction": friction,
            },
            "solver": {
                "linear_algebra": algebra,
                "gamma_n": 1e6 * stress / length,
                "gamma_t": 1e6 * stress / length,
                "tolerance": 1e-12,
                **(solver or {}),
            },
            **({} if times is None else {"load_steps": {"times": times}}),
            **({} if accuracy is None else {"accuracy": accuracy}),
        }
    )


NO_TURN = {"rotation_x": 0.0, "rotation_y": 0.0, "rotation_z": 0.0}


def pressed(dimension, law, unit=(1.0, 1.0)):
    """What drives the tool; without friction it may not move sideways."""
    length, force = unit
    per = force / length if dimension == 2 else force
    given = [value * per for value in ([1.0, -20.0] if dimension == 2 else [1.0, 0.5, -20.0])]
    still = {"rotation": 0.0} if dimension == 2 else dict(NO_TURN)
    if law == "none":
        still |= dict.fromkeys("xy"[: dimension - 1], 0.0)
    return {"force": given, "prescribed": still}


def prescribed(tool):
    """The motion of a tool as one that is prescribed."""
    names = ("x", "y", "rotation") if tool.reference.size == 2 else ("x", "y", "z", *NO_TURN)
    values = np.append(tool.translation, tool.rotation)
    return {"prescribed": dict(zip(names, map(float, values), strict=True))}


def apart(one, other):
    """The largest difference of two solutions, relative to the largest displacement or pressure."""
    found = []
    for a, b in (
        (one.displacement.x.array, other.displacement.x.array),
        *((getattr(one.contact, name), getattr(other.contact, name)) for name in ("pressure", "shear", "u_n", "u_t")),
    ):
        scale = COMM.allreduce(float(np.abs(a).max(initial=0.0)), op=MPI.MAX)
        found.append(COMM.allreduce(float(np.abs(a - b).max(initial=0.0)), op=MPI.MAX) / (scale or 1.0))
    return max(found)


WAYS = [
    (2, "none", "full", {}),
    (2, "tresca", "condensed", {}),
    (2, "coulomb", "full", {"degree": 2, "cell": "triangle"}),
    (2, "coulomb", "condensed", {}),
    (3, "coulomb", "condensed", {}),
    (3, "tresca", "full", {"degree": 2, "cell": "tetrahedron"}),
]


@pytest.mark.one_quick
@pytest.mark.parametrize(("dimension", "law", "algebra", "element"), WAYS)
def test_a_force_and_the_motion_that_it_causes_give_the_same(dimension, law, algebra, element):
    forced = solve(block(dimension, law, algebra, **element, **pressed(dimension, law)))
    (tool,) = forced.last_step.tools
    row = tool.as_dict(forced.contact, forced.statement.contact, forced.model.kinematics)
    given = np.array(pressed(dimension, law)["force"])
    free = np.arange(dimension) if law != "none" else [dimension - 1]
    assert np.abs(np.array(row["force"]) + given)[free].max() < 1e-9 * np.abs(given).max()
    assert forced.contact.in_contact.any() or COMM.size > 1
    driven = solve(block(dimension, law, algebra, **element, **prescribed(tool)))
    assert apart(forced, driven) < 1e-10
    if law != "coulomb":  # whose fixed point contracts faster where the motion is prescribed
        assert forced.history.linear_solves <= 1.2 * driven.history.linear_solves + 1
    assert forced.certificate.worst < 1e-9


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("dimension", "algebra", "poisson"), [(2, "condensed", 0.49), (2, "full", 0.5), (3, "full", 0.5)]
)
def test_an_incompressible_body_under_a_tool(dimension, algebra, poisson):
    """The mixed element, whose pressure stands behind the unknowns of the tool: force, statics and motion agree."""

    def made(**tool):
        cell = {2: "triangle", 3: "tetrahedron"}[dimension]
        scene = block(dimension, "coulomb", algebra, degree=2, cell=cell, parts=(3, 3, 2), **tool)
        rubber = scene.material[0].model_copy(update={"poisson": poisson})
        element = scene.element.model_copy(update={"volumetric": "mixed"})
        return scene.model_copy(update={"material": (rubber,), "element": element})

    given = pressed(dimension, "coulomb")
    forced = solve(made(**given))
    (tool,) = forced.last_step.tools
    row = tool.as_dict(forced.contact, forced.statement.contact, forced.model.kinematics)
    assert np.allclose(row["force"], -np.array(given["force"]), atol=1e-9 * 20.0)
    assert forced.certificate.worst < 1e-9
    driven = solve(made(**prescribed(tool)))
    assert apart(forced, driven) < 1e-10
    hydrostatic = [one.displacement.hydrostatic.x.array for one in (forced, driven)]
    assert np.abs(hydrostatic[0] - hydrostatic[1]).max(initial=0.0) < 1e-8 * np.abs(hydrostatic[1]).max(initial=1e-300)


KRYLOV = [
    (2, "coulomb", {"degree": 2, "cell": "triangle"}),
    (3, "coulomb", {"cell": "tetrahedron"}),
    (3, "tresca", {"degree": 2, "cell": "tetrahedron"}),
]


@pytest.mark.one_quick
@pytest.mark.parametrize(("dimension", "law", "element"), KRYLOV)
def test_a_krylov_method_gives_the_same(dimension, law, element):
    given, free = pressed(dimension, law), {"pivot": [0.4, 0.5, 0.6][:dimension], "prescribed": {}}
    full, krylov = (solve(block(dimension, law, kind, **element, **given | free)) for kind in ("full", "krylov"))
    assert krylov.linear_algebra.startswith("krylov")
    assert apart(full, krylov) < 1e-8
    (tool,), (other,) = full.last_step.tools, krylov.last_step.tools
    far = np.abs(tool.translation).max()
    assert np.abs(np.append(tool.translation - other.translation, tool.rotation - other.rotation)).max() < 1e-8 * far


def test_multigrid_takes_as_many_steps_as_for_a_prescribed_motion(monkeypatch):
    """On two meshes, nested, with a tool that may tilt: it has a few unknowns more on each level, and no more steps."""
    spent, configure = {}, KrylovSystem.configure

    def watched(self, ksp, **how):
        def note(solver, b, _):
            spent[size] = spent.get((size := b.getSize()), 0) + solver.getIterationNumber()

        configure(self, ksp, **how)
        ksp.setPostSolve(note)

    def steps(**tool):
        spent.clear()
        solved = solve(block(3, "none", "krylov", parts=(10, 10, 6), solver={"levels": 2, "gamma_n": "auto"}, **tool))
        assert solved.converged
        assert len(solved.levels) == 2
        return spent[max(spent)], solved

    monkeypatch.setattr(KrylovSystem, "configure", watched)
    given, at = pressed(3, "none"), {"pivot": [0.45, 0.5, 0.5]}
    still = {"x": 0.0, "y": 0.0, "rotation_z": 0.0}
    forced, solution = steps(**given | {"prescribed": still} | at)
    (tool,) = solution.last_step.tools
    assert np.abs(tool.rotation).max() > 1e-6  # the ball is not above the middle of the block
    assert forced <= 1.3 * steps(**prescribed(tool), **at)[0] + 2


def posts(apart_by=10.0, width=0.1, height=1.0):
    """Two columns with one contact boundary, their tops."""
    both = [Box("1", -width / 2, 0.0, width, height, 4, 6), Box("2", apart_by - width / 2, 0.0, width, height, 4, 6)]
    mesh = boxes_mesh(COMM, both).mesh
    return tag_boundaries(
        mesh, {"tops": lambda x: np.isclose(x[1], height), "bottoms": lambda x: np.isclose(x[1], 0.0)}
    )


def on_posts(force=(0.0, -3.0), at=2.5, law=None, algebra="full", **solver):
    """A plate on two columns without Poisson's effect, under a force beside its middle."""
    tool = {"shape": "plane", "point": [0.0, 1.0], "normal": [0.0, -1.0], "pivot": [at, 1.0], "force": list(force)}
    return parse_scene(
        {
            "mesh": posts(),
            "material": {"young": 1e5, "poisson": 0.0},
            "displacement": {"boundary": "bottoms", "x": 0.0, "y": 0.0},
            "contact": {"boundary": "tops", "foundation": tool, "friction": law or LAWS["coulomb"]},
            "solver": {"linear_algebra": algebra, **solver},
        }
    )


def on_named_posts(others=None, **driving):
    """The same with a contact for each post, and one plate."""
    both = [Box("1", -0.05, 0.0, 0.1, 1.0, 4, 6), Box("2", 9.95, 0.0, 0.1, 1.0, 4, 6)]
    plate = {"shape": "plane", "point": [0.0, 1.0], "normal": [0.0, -1.0], "rigid": "plate"}
    driving = {"pivot": [2.5, 1.0], "force": [0.3, -3.0], **driving}
    return parse_scene(
        {
            "mesh": boxes_mesh(COMM, both),
            "material": {"young": 1e5, "poisson": 0.0},
            "displacement": [{"boundary": f"bottom {k}", "x": 0.0, "y": 0.0} for k in "12"],
            "contact": [
                {"boundary": f"top {k}", "foundation": {**plate, **keys}, "friction": LAWS["coulomb"]}
                for k, keys in (("1", others or {}), ("2", driving))
            ],
            "solver": GAMMAS,
        }
    )


def test_a_rigid_body_has_several_contacts():
    """One plate that two contacts name: as with one contact that both tops are, in motion, balance and words."""
    one, several = solve(on_posts((0.3, -3.0), **GAMMAS)), solve(on_named_posts())
    (plate,), (named,) = one.last_step.tools, several.last_step.tools
    assert (named.body.name, named.body.parts) == ("plate", (0, 1))
    assert np.allclose(named.translation, plate.translation, rtol=1e-9)
    assert np.allclose(named.rotation, plate.rotation, rtol=1e-9)
    rows = [
        solution.last_step.tools[0].as_dict(solution.contact, solution.statement.contact, solution.model.kinematics)
        for solution in (one, several)
    ]
    assert np.allclose(rows[0]["force"], rows[1]["force"], atol=1e-9)
    assert np.allclose(rows[0]["gap_error"], rows[1]["gap_error"], rtol=1e-6)
    assert several.certificate.holds
    tagged, tractions = several.model.tagged, Tractions.of(several.contact)
    wrong = on_named_posts(force=[0.3, -3.003])
    judged = certify(
        wrong.statement, tagged, several.displacement, tractions, law=several.certificate.law, rigid=(named,)
    )
    assert not judged.holds
    assert solve(on_named_posts(pivot=[12.0, 1.0]), check=False).status is Status.TIPS


@pytest.mark.parametrize("others", [{"force": [0.0, -1.0], "pivot": [0.0, 1.0]}, {"rigid": "another"}])
def test_one_contact_drives_a_rigid_body(others):
    with pytest.raises(SceneError, match=r"in one contact of .*, not in [02]"):
        on_named_posts(others)


@pytest.mark.parametrize("algebra", ["full", "condensed"])
def test_a_plate_on_two_posts_tilts_as_statics_says(algebra):
    """The posts take 3/4 and 1/4 of the force, sink by N H / (E A) each, and the plate turns by the difference."""
    solution = solve(on_posts(algebra=algebra))
    x, pressure, weight = solution.contact.boundary.x, solution.contact.pressure, solution.contact.boundary.weight
    taken = [COMM.allreduce(float((weight * pressure)[half].sum())) for half in (x[:, 0] < 5, x[:, 0] > 5)]
    assert np.allclose(taken, [2.25, 0.75], rtol=1e-4)
    (tool,) = solution.last_step.tools
    sunk = np.array(taken) / (1e5 * 0.1)
    # The force follows no motion: it stays where it is given.
    assert np.isclose(tool.rotation[0], (sunk[0] - sunk[1]) / 10.0, rtol=1e-3)
    assert np.isclose(tool.translation[1], -(0.75 * sunk[0] + 0.25 * sunk[1]), rtol=1e-3)
    assert solution.safety is not None


def test_a_sweep_solves_each_load():
    """Twice the force: twice the motion of a plate that stays on its posts, and what its own scene gives."""
    found = sweep(on_posts(), COMM, loads=[1.0, 2.0])
    wanted = solve(on_posts((0.0, -6.0)))
    (one,), (other,), (own,) = (*(point.tools() for point in found), wanted.last_step.tools)
    assert np.allclose(2 * one.translation, other.translation, rtol=1e-3)
    assert np.allclose(other.translation, own.translation, rtol=1e-9)
    assert np.allclose(found[1].contact.pressure, wanted.contact.pressure, rtol=1e-7)
    assert all(point.certificate().holds for point in found)


OUTCOMES = [
    ((1.0, -3.0), 2.5, LAWS["coulomb"], Status.SLIDES),  # more than 0.3 * 3
    ((0.0, -3.0), 10.2, LAWS["coulomb"], Status.TIPS),  # beside the last post
    ((0.0, 3.0), 2.5, LAWS["coulomb"], Status.OPEN),
    ((0.0, -3.0), 2.5, LAWS["none"], Status.NOT_HELD),
]


@pytest.mark.parametrize(("force", "at", "law", "status"), OUTCOMES)
def test_a_tool_that_nothing_holds_ends_with_its_name(force, at, law, status):
    with pytest.raises(ConvergenceError) as raised:
        solve(on_posts(force, at, law))
    assert raised.value.solution.status is status
    assert raised.value.solution.history.linear_solves == 0


def test_a_force_just_below_the_limit_of_friction_is_held():
    assert solve(on_posts((0.89, -3.0))).converged


def test_the_safety_factor_counts_the_force_on_a_tool():
    """Half of the largest given friction, 10 on the tops of both posts: twice the force slides."""
    safety = solve(on_posts((1.0, -3.0), law={"law": "tresca", "bound": 10.0})).safety
    assert np.isclose(safety.factor, 2.0, rtol=1e-9)


def three_posts():
    """Three columns of hexahedra, cut out of a box, and the positions of their axes."""
    mesh = dmesh.create_box(COMM, [(0.0, 0.0, 0.0), (2.1, 2.1, 0.5)], (21, 21, 2), dmesh.CellType.hexahedron)
    axes = np.array([[0.15, 0.25], [1.95, 0.45], [0.65, 1.95]])
    middle = dmesh.compute_midpoints(mesh, 3, np.arange(mesh.topology.index_map(3).size_local, dtype=np.int32))
    near = (np.abs(middle[:, None, :2] - axes).max(axis=2) < 0.06).any(axis=1)
    columns = dmesh.create_submesh(mesh, 3, np.flatnonzero(near).astype(np.int32))[0]
    tops = {"tops": lambda x: np.isclose(x[2], 0.5), "bottoms": lambda x: np.isclose(x[2], 0.0)}
    return tag_boundaries(columns, tops), axes


@pytest.mark.parametrize("pivot", [(0.8, 0.7), (0.2, 1.5)])
def test_a_plate_on_three_posts_tilts_as_statics_says(pivot):
    """In 3D: three unknown forces from a force and two moments, and the plane through what sinks; the same with the
    force at another point, and its moment.
    """
    mesh, axes = three_posts()
    at, force = np.array([0.8, 0.7]), 2.0
    moment = np.cross([*(at - pivot), 0.0], [0.0, 0.0, -force])
    tool = {"shape": "plane", "point": [0.0, 0.0, 0.5], "normal": [0.0, 0.0, -1.0], "pivot": [*pivot, 0.5]}
    if moment.any():
        tool["moment"] = moment.tolist()
    scene = parse_scene(
        {
            "mesh": mesh,
            "material": {"young": 1e5, "poisson": 0.0},
            "displacement": {"boundary": "bottoms", "x": 0.0, "y": 0.0, "z": 0.0},
            "contact": {
                "boundary": "tops",
                "foundation": {**tool, "force": [0.0, 0.0, -force]},
                "friction": LAWS["coulomb"],
            },
        }
    )
    solution = solve(scene)
    wanted = np.linalg.solve(np.vstack((np.ones(3), axes.T)), force * np.array([1.0, *at]))
    boundary, pressure = solution.contact.boundary, solution.contact.pressure
    of = np.abs(boundary.x[:, None, :2] - axes).max(axis=2).argmin(axis=1)
    taken = COMM.allreduce(np.bincount(of, boundary.weight * pressure, minlength=3))
    assert np.allclose(taken, wanted, rtol=5e-3)
    (motion,) = solution.last_step.tools
    sunk = wanted * 0.5 / (1e5 * 0.01)
    assert np.allclose(motion.at(np.column_stack((axes, np.full(3, 0.5))))[:, 2], -sunk, rtol=5e-3)


def test_hertz_by_force():
    """Half a cylinder that a plane presses with P: a^2 = 4 P R / (pi E*), p0 = 2 P / (pi a)."""
    from test_hertz import half_disk, load, peak, profile

    given = half_disk(0.4, size=0.02)
    plane = {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
    tool = {**plane, "force": [0.0, load(0.4) / 2], "prescribed": {"x": 0.0, "rotation": 0.0}}
    scene = parse_scene(
        {
            "mesh": given.mesh.model_dump(exclude_none=True),
            "material": given.material[0].model_dump(include={"young", "poisson"}),
            "displacement": [{"boundary": "symmetry", "normal": 0.0}, {"boundary": "top", "y": 0.0}],
            "contact": {"boundary": "arc", "foundation": tool},
        }
    )
    solution = solve(scene)
    x, pressure, weight, _ = profile(solution)
    assert np.isclose(pressure.max(), peak(0.4), rtol=0.01)
    assert np.isclose(weight @ pressure, load(0.4) / 2, rtol=1e-9)
    assert np.isclose(x[pressure > 1e-3 * pressure.max()].max(), 0.4, atol=0.03)


@pytest.mark.parametrize("turn", [0.0, 0.2])
def test_how_far_the_linearised_gap_is_off(turn):
    """A circle that moves along the surface: about v^2 / (2 r) below its centre; turning about it changes nothing."""
    step = np.array([0.1, -0.01])
    solution = solve(block(prescribed={"x": step[0], "y": step[1], "rotation": turn}))
    (tool,), contact = solution.last_step.tools, solution.contact
    row = tool.as_dict(contact, solution.statement.contact, solution.model.kinematics)
    away = contact.boundary.centre[contact.pressure > 0] - [0.45, 2.5]
    far = np.linalg.norm(away, axis=1)
    off = np.linalg.norm(away - step, axis=1) - far + away @ step / far
    largest = COMM.allreduce(float(off.max(initial=0.0)), op=MPI.MAX)
    assert np.isclose(row["gap_error"], largest, rtol=1e-9)
    assert np.isclose(largest, step[0] ** 2 / (2 * 2.0), rtol=0.05)


@pytest.mark.parametrize("dim", [2, 3])
def test_how_far_the_gap_of_a_plane_that_turns_is_off(dim):
    """Its distance where it ends up is that of the moved plane, by hand."""
    chance = np.random.default_rng(dim)
    centre, step, turn = chance.normal(size=dim), 0.1 * chance.normal(size=dim), 0.3 * chance.normal(size=2 * dim - 3)
    normal, point, x = chance.normal(size=dim), chance.normal(size=dim), chance.normal(size=(7, dim))
    normal /= np.linalg.norm(normal)
    x[6] *= 100.0  # where nothing is pressed
    velocity = np.zeros((3, 3))  # of a turn, whose exponential is the rotation
    axis = turn if dim == 3 else np.array([0.0, 0.0, turn[0]])
    velocity[[0, 0, 1], [1, 2, 2]] = -axis[2], axis[1], -axis[0]
    velocity = (velocity - velocity.T)[:dim, :dim]
    matrix = expm(velocity)
    moved = (x - centre - step - (point - centre) @ matrix.T) @ (matrix @ normal)
    linear = (x - point) @ normal - (step + (x - centre) @ velocity.T) @ normal
    shape = SimpleNamespace(distance=lambda x: ((x - point) @ normal, np.tile(normal, (len(x), 1))))
    boundary = SimpleNamespace(centre=x, part=np.zeros(7, dtype=int), comm=MPI.COMM_SELF)
    contact = SimpleNamespace(boundary=boundary, pressure=np.array([1.0] * 6 + [0.0]))
    found = RigidBodyMotion(TOP, centre, step, turn).gap_error(contact, {0: shape})
    assert np.isclose(found, np.abs(moved - linear)[:6].max(), rtol=1e-12)
    assert found < 0.5 * np.abs(moved - linear)[6]


def scaled(solution, length, force):
    (tool,) = solution.last_step.tools
    return np.append(tool.translation / length, tool.rotation), solution.contact.pressure * length**2 / force


@pytest.mark.parametrize("unit", [(1e-9, 1.0), (1e9, 1e-9), (1.0, 1e9)])
def test_units_do_not_matter(unit):
    reference = scaled(solve(block(2, "coulomb", **pressed(2, "coulomb"))), 1.0, 1.0)
    other = scaled(solve(block(2, "coulomb", unit=unit, **pressed(2, "coulomb", unit))), *unit)
    for one, another in zip(reference, other, strict=True):
        assert np.abs(one - another).max(initial=0.0) < 1e-8 * np.abs(one).max(initial=1e-300)


def test_load_steps_with_friction():
    """A tool that is pressed and then pulled by functions of the time, and the same by prescribed motions."""
    force = {"force": ["3 * max(0, t - 1)", "-20"], "prescribed": {"rotation": 0.0}}
    forced = solve(block(2, "coulomb", times=[1.0, 2.0, 3.0], **force))
    assert [step.status for step in forced.steps] == [Status.CONVERGED] * 3
    names = ("x", "y", "rotation")
    motion = [np.append(step.tools[0].translation, step.tools[0].rotation) for step in forced.steps]

    def through(values):
        a, b, c = map(float, values)  # the parabola through them at t = 1, 2, 3
        return f"{a!r} * (t - 2) * (t - 3) / 2 - {b!r} * (t - 1) * (t - 3) + {c!r} * (t - 1) * (t - 2) / 2"

    given = {name: through([one[k] for one in motion]) for k, name in enumerate(names)}
    driven = solve(block(2, "coulomb", times=[1.0, 2.0, 3.0], prescribed=given))
    assert apart(forced, driven) < 1e-9
    assert all(step.certificate.holds for step in forced.steps)


def test_the_certificate_knows_the_force():
    """Another force, another motion, and a tool that is said to stand still are refused."""
    given = pressed(2, "coulomb")
    solution = solve(block(2, "coulomb", **given))
    (tool,) = solution.last_step.tools

    def judged(statement=solution.statement, tools=(tool,)):
        tagged, tractions = solution.model.tagged, Tractions.of(solution.contact)
        return certify(statement, tagged, solution.displacement, tractions, law=solution.certificate.law, rigid=tools)

    assert judged().worst < 1e-9
    for force in ([1.0, -20.1], [1.01, -20.0]):
        assert judged(block(2, "coulomb", **{**given, "force": force}).statement).equilibrium > 1e-4
    for share in (1e-5, 1e-3):  # of the largest force at the tool
        other = judged(block(2, "coulomb", **{**given, "force": [1.0, -20.0 * (1 + share)]}).statement)
        assert 0.5 * share < other.equilibrium < 2 * share
    turned = block(2, "coulomb", **{**given, "moment": 0.1, "prescribed": {}}).statement
    assert judged(turned).equilibrium > 1e-4
    assert not judged(tools=(dataclasses.replace(tool, translation=1.01 * tool.translation),)).holds
    assert not judged(tools=()).holds
    assert not judged(tools=(dataclasses.replace(tool, rotation=np.array([1e-3])),)).holds


def test_the_certificate_knows_a_small_force():
    """On a body whose stress is that of another load a thousand times as large."""
    given = {"force": [0.0, -0.02], "prescribed": {"x": 0.0, "rotation": 0.0}}
    scene = block(2, "none", **given)
    side = {"boundary": "right", "x": 20.0}
    scene = parse_scene({**scene.model_dump(exclude_unset=True), "traction": side})
    solution = solve(scene)
    tools = solution.last_step.tools
    contact = scene.contact[0]

    def judged(force):
        entry = contact.model_copy(update={"foundation": contact.foundation.model_copy(update={"force": force})})
        other, tagged = scene.model_copy(update={"contact": (entry,)}), solution.model.tagged
        tractions, law = Tractions.of(solution.contact), solution.certificate.law
        return certify(other.statement, tagged, solution.displacement, tractions, law=law, rigid=tools)

    assert judged((0.0, -0.02)).holds
    assert not judged((0.0, -0.02 * (1 + 1e-4))).holds


@pytest.mark.parametrize("unit", [(1e-9, 1.0), (1e9, 1.0)])
def test_the_certificate_knows_each_component_in_any_unit(unit):
    """A rotation is no length, and a moment no force: a wrong one is seen beside large or small other ones."""
    length = unit[0]
    motion = {"x": 1e-3 * length, "y": -2e-3 * length, "rotation": 2e-3}
    solution = solve(block(2, "coulomb", unit=unit, pivot=[0.4 * length, 0.5 * length], prescribed=motion))
    tagged, tractions, tools = (
        solution.model.tagged,
        Tractions.of(solution.contact),
        solution.last_step.tools,
    )

    def judged(**changed):
        scene = block(2, "coulomb", unit=unit, pivot=[0.4 * length, 0.5 * length], prescribed=motion | changed)
        law = solution.certificate.law
        return certify(scene.statement, tagged, solution.displacement, tractions, law=law, rigid=tools).equilibrium

    assert judged() < 1e-9
    for name, value in motion.items():
        assert judged(**{name: 1.01 * value}) > 1e-3


def test_the_certificate_knows_a_moment_that_nothing_balances():
    (drive,) = block(moment=1e-3).statement.drives(2, 0, 1.0)
    tool = RigidBodyMotion(TOP, np.zeros(2), np.zeros(2), np.zeros(1))
    assert tool.unbalanced(drive, (np.zeros(3), 0.0, 1.0)) == 1.0


def test_motions_are_rigid():
    """The independent check's own formula: distances and angles stay to first order."""
    rng = np.random.default_rng(3)
    for dim, turns in ((2, 1), (3, 3)):
        x, centre = rng.normal(size=(5, dim)), rng.normal(size=dim)
        tool = RigidBodyMotion(TOP, centre, rng.normal(size=dim), rng.normal(size=turns))
        moved, arm = tool.at(x), x[:, None] - x[None]
        assert np.abs(np.einsum("ijk,ijk->ij", arm, moved[:, None] - moved[None])).max() < 1e-12
        assert np.allclose(tool.at(centre[None]), tool.translation)


REFUSED = [
    ({"moment": [0.0, 0.0, 1.0]}, "moment: the mesh is plane"),
    ({"force": [0.0, 0.0, 1.0]}, "force: the mesh is plane"),
    ({"prescribed": {"z": 0.0}}, "prescribed.z"),
    ({"force": [0.0, "x[0]"]}, "number or an expression of the time t"),
    ({"force": [0.0, -1.0], "shift": ["0.1 * t", 0.0]}, "choose one of both"),
    ({"force": [0.0, -1.0], "pivot": None}, "pivot: give the point where the force acts"),
]


@pytest.mark.parametrize(("entry", "words"), REFUSED)
def test_bad_input_is_one_error(entry, words):
    with pytest.raises(SceneError, match=words):
        solve(block(**entry))


def two_plates(push, second=2.0):
    """Two posts, each with a plate of its own, under forces 1 and ``second``; the second one is pushed aside."""
    both = [Box("1", 0.0, 0.0, 1.0, 1.0, 3, 3), Box("2", 3.0, 0.0, 1.0, 1.0, 3, 3)]
    plate = {"shape": "plane", "point": [0.0, 1.0], "normal": [0.0, -1.0], "prescribed": {"rotation": 0.0}}
    return parse_scene(
        {
            "mesh": boxes_mesh(COMM, both),
            "material": {"young": 1000.0, "poisson": 0.0},
            "displacement": [{"boundary": f"bottom {k}", "x": 0.0, "y": 0.0} for k in "12"],
            "contact": [
                {
                    "boundary": f"top {name}",
                    "foundation": {**plate, "force": [sideways, -force]},
                    "friction": LAWS["coulomb"],
                }
                for name, force, sideways in (("1", 1.0, 0.0), ("2", second, push))
            ],
        }
    )


def test_two_tools_are_two_bodies():
    """Each post has a plate of its own: they sink on their own, and only the one that is pushed too hard slides."""
    tools = solve(two_plates(0.0)).last_step.tools
    assert [tool.body.name for tool in tools] == ["top 1", "top 2"]
    assert np.allclose([tool.translation[1] for tool in tools], [-1e-3, -2e-3], rtol=1e-4)
    with pytest.raises(ConvergenceError) as raised:
        solve(two_plates(0.7))
    assert raised.value.solution.status is Status.SLIDES
    assert "contact[1]" in str(raised.value)
    assert "contact[0]" not in str(raised.value)


def test_a_tool_is_judged_by_the_body_that_it_touches():
    """A force that is 3e-9 of that on the other tool, and wrong by a tenth."""
    solution = solve(two_plates(0.0, 3e-9))
    tagged, tractions, tools = solution.model.tagged, Tractions.of(solution.contact), solution.last_step.tools

    def judged(second):
        law = solution.certificate.law
        return certify(
            two_plates(0.0, second).statement, tagged, solution.displacement, tractions, law=law, rigid=tools
        )

    assert judged(3e-9).holds
    assert not judged(3.3e-9).holds


def test_it_is_drawn_where_it_ends_up(tmp_path, monkeypatch):
    """The plate that tilts: below it the tops of the posts, which it presses down, and no picture of where it was."""
    from signorini_fx.addons.picture_data.of_solution import gather_pictures
    from signorini_fx.addons.pictures import deformed_body

    solution = solve(on_posts())
    (tool,) = solution.last_step.tools
    drawn = []
    monkeypatch.setattr(deformed_body, "deformed_mesh", lambda *_, foundation, **__: drawn.append(foundation))
    table = solution.table.columns
    gather_pictures(solution)._draw_in_the_plane(gather_pictures(solution).body, table, tmp_path, "", None)
    places = drawn[0].nodes + drawn[0].offset
    assert np.allclose(places, drawn[0].nodes + tool.at(drawn[0].nodes))  # it touched them
    assert np.ptp(places[:, 1]) > 1e-6


@pytest.mark.parametrize("algebra", ["full", "condensed"])
def test_rigid_coupling_bends_a_column_as_a_beam(algebra):
    """Force and moment through the top of a column without Poisson's effect: u_y = (N / A + M x / I) y / E is exact."""
    young, half, height, push, pull = 1000.0, 0.5, 4.0, -3.0, 0.2
    tool = {"shape": "plane", "point": [0.0, 7.0], "normal": [1.0, -1.0], "pivot": [half, height], "force": [0.0, push]}
    mesh = {"length": 2 * half, "height": height, "nx": 2, "ny": 4}
    scene = parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": mesh},
            "element": {"degree": 2},
            "material": {"young": young, "poisson": 0.0},
            "displacement": {"boundary": "bottom", "x": 0.0, "y": 0.0},
            "contact": {"boundary": "top", "kind": "bonded", "foundation": {**tool, "moment": pull}},
            "solver": {"linear_algebra": algebra, "algorithm": "alm", "tolerance": 1e-9},
        }
    )
    solution = solve(scene)
    (moved,) = solution.last_step.tools
    turned = -pull * height / (young * (2 * half) ** 3 / 12)
    row = moved.as_dict(solution.contact, scene.contact, solution.model.kinematics)
    # What the body does to the rigid body balances what drives it.
    assert np.allclose([*row["force"], row["moment"]], [0.0, -push, -pull], atol=1e-9)
    assert row["gap_error"] is None  # there is no gap
    assert np.isclose(moved.rotation[0], -turned, rtol=1e-8)
    assert np.allclose(moved.translation, [height / 2 * turned, push * height / young], rtol=1e-8)
    x = solution.contact.boundary.x
    relative = np.column_stack((solution.contact.u_n, solution.contact.u_t))
    assert np.abs(relative).max(initial=0.0) < 1e-10 * np.abs(moved.at(x)).max(initial=1.0)
    assert solution.certificate.worst < 1e-8


@pytest.mark.mpi
@pytest.mark.parametrize("push", [0.0, 1e-9, 1e-4])
def test_a_coupling_that_goes_along(push):
    """A column without Poisson's effect is moved with its coupled top by far more than a small force, or none,
    shortens it: what the penalty makes of the round-off of both is no stress.
    """
    young, height, far = 1000.0, 4.0, 0.25
    tool = {"shape": "plane", "point": [0.0, 7.0], "normal": [1.0, -1.0], "pivot": [0.5, height], "force": [0.0, -push]}
    scene = {
        "mesh": {"generator": "rectangle", "parameters": {"length": 1.0, "height": height, "nx": 2, "ny": 4}},
        "material": {"young": young, "poisson": 0.0},
        "displacement": {"boundary": "bottom", "x": far, "y": -far},
        "contact": {"boundary": "top", "kind": "bonded", "foundation": tool},
    }
    solution = solve(parse_scene(scene))
    (moved,) = solution.last_step.tools
    assert np.allclose(moved.translation, [far, -far - push * height / young], rtol=0, atol=1e-9 * far)
    assert abs(moved.rotation[0]) < 1e-9
    assert np.allclose(solution.contact.forces[0], [0.0, -push], rtol=0, atol=1e-11 * young)


def test_a_body_between_a_coupling_and_two_supports():
    """A force beside the middle of a coupled top: the supports take what statics says, none beyond them is held."""

    def scene(at):
        box = [Box("1", 0.0, 0.0, 10.0, 3.0, 40, 6)]
        near = {
            "feet": lambda x: np.isclose(x[1], 0.0) & ((x[0] < 0.26) | (x[0] > 9.74)),
            "top": lambda x: np.isclose(x[1], 3.0),
        }
        tool = {"shape": "plane", "point": [0.0, 3.0], "normal": [0.0, -1.0], "pivot": [at, 3.0], "force": [0.0, -2.0]}
        return parse_scene(
            {
                "mesh": tag_boundaries(boxes_mesh(COMM, box).mesh, near),
                "material": {"young": 1e5, "poisson": 0.0},
                "contact": [
                    {"boundary": "feet", "friction": LAWS["coulomb"]},
                    {"boundary": "top", "kind": "bonded", "foundation": tool},
                ],
            }
        )

    contact = solve(scene(3.0)).contact
    of, force = contact.boundary.part == 0, contact.boundary.weight * contact.pressure
    x = contact.boundary.x[:, 0]
    total = COMM.allreduce(np.array([force[of].sum(), force[of] @ x[of]]))
    assert np.allclose(total, [2.0, 6.0], rtol=1e-6)  # equilibrium of force and moment through body and coupling
    taken = COMM.allreduce(np.array([force[of & (x < 5)].sum(), force[of & (x > 5)].sum()]))
    assert 0.578 < taken[1] < 0.6  # pressed between the inner edges of the feet, at 0.25 and 9.75, and their ends
    with pytest.raises(ConvergenceError) as raised:
        solve(scene(10.5))
    assert raised.value.solution.status is Status.TIPS


@pytest.mark.slow
def test_a_requested_accuracy():
    """The same meshes, estimates and state as for the motion that the force causes on the last one."""
    tool = {"cell": "triangle", "accuracy": {"target": 0.15, "refinement": "uniform"}, "pivot": [0.4, 0.5]}
    forced = solve(block(2, "tresca", **tool, force=[1.0, -20.0]))
    (moved,) = forced.last_step.tools
    driven = solve(block(2, "tresca", **tool, **prescribed(moved)))
    assert len(forced.levels) > 1
    assert [level.dofs for level in forced.levels] == [level.dofs for level in driven.levels]
    assert forced.levels[-1].energy <= 0.15
    assert np.isclose(forced.levels[-1].energy, driven.levels[-1].energy, rtol=1e-6)
    assert apart(forced, driven) < 1e-9
    assert abs(moved.rotation[0]) > 1e-4
    adaptive = solve(
        block(2, "tresca", **tool | {"accuracy": {"target": 0.15, "refinement": "adaptive"}}, force=[1.0, -20.0])
    )
    assert len(adaptive.levels) > 2
    assert np.isclose(adaptive.last_step.tools[0].translation[1], moved.translation[1], rtol=0.02)


@pytest.mark.one_quick
@pytest.mark.parametrize(("law", "algebra"), [("coulomb", "condensed"), ("tresca", "full")])
def test_derivatives(law, algebra):
    """By what drives a tool and where it is: statics, and central differences of solutions."""
    given = {"force": [1.0, -20.0], "moment": 0.3, "pivot": [0.42, 0.5]}

    def scene(**changed):
        return block(2, law, algebra, **given | {"centre": [0.45, 2.5], "prescribed": {}} | changed)

    of, at = (
        ["force top x", "force top y", "moment top", "pressure top 4", "displacement 0.3,0.5 y"],
        "contact[0].foundation.",
    )
    by = [at + name for name in ("force[0]", "force[1]", "moment", "pivot[0]", "centre[0]")]
    found = np.array([one.derivatives for one in sensitivity(scene(), of, [*by, "material[0].young"])])
    # The force on the body is that on the tool, and its moment about the origin.
    wanted = [[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0, 0.0, 0.0], [-0.5, 0.42, 1.0, -20.0, 0.0, 0.0]]
    assert np.allclose(found[:3], wanted, rtol=0, atol=1e-6)

    def results(**changed):
        solution = solve(scene(**changed))
        quantities = [functional_of(solution.model, name) for name in of[3:]]
        contact = solution.contact
        return np.array(
            [one.value(solution.displacement, contact.boundary, contact.pressure, contact.shear) for one in quantities]
        )

    def by_difference(step, change):
        return (results(**change(step)) - results(**change(-step))) / (2 * step)

    changes = [
        (1e-3, lambda h: {"force": [1.0, -20.0 + h]}),
        (1e-4, lambda h: {"moment": 0.3 + h}),
        (1e-5, lambda h: {"centre": [0.45 + h, 2.5]}),
    ]
    differences = np.column_stack([by_difference(*change) for change in changes])
    assert np.allclose(found[3:, [1, 2, 4]], differences, rtol=1e-4, atol=1e-6 * np.abs(differences).max(axis=0))


def test_check_says_what_moves():
    """What drives a tool, how many unknowns it adds, and what must hold it."""
    found = render(check_scene(block(2, "coulomb", **pressed(2, "coulomb")), COMM))
    (line,) = [line for line in found.splitlines() if line.lstrip().startswith("contact top")]
    assert "force = [1, -20], prescribed = {rotation = 0}" in line
    assert "+2" in line.split()
    assert "the foundation of contact[0] in translations" in found
    every = {"prescribed": {"x": 0.0, "y": -0.01, "rotation": 0.0}}
    moving, still = (check_scene(block(2, "coulomb", **given), COMM) for given in (pressed(2, "coulomb"), every))
    assert moving.cost.unknowns == still.cost.unknowns + 2


def test_the_wheel_of_the_gallery():
    """A braked wheel on rubber: the mat carries its weight in each step, and friction the push, as far as it can."""
    scene = read_scene(HERE.parent / "demos" / "scenes" / "braked_wheel.toml")
    mesh = scene.mesh.model_copy(update={"parameters": {**scene.mesh.parameters, "nx": 40, "ny": 12}})
    solution = solve(scene.model_copy(update={"mesh": mesh}))
    for step, push in zip(solution.steps, (0.0, 3.0, 6.0), strict=True):
        on_the_mat = np.sum(step.contact.forces, axis=0)
        assert np.allclose(on_the_mat, [push, -20.0], atol=1e-6)
