"""Tools that turn as forces and moments ask for it: rolling, statics, objectivity, and what is
refused.
"""

import numpy as np
import pytest
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from on_meshes import turn_by
from parameters import slow
from scene_tables import box_mesh, coulomb_friction, fixed
from scenes import alone
from support.nonlinear_bodies import held, neo_hooke, rectangle, residual
from support.nonlinear_scenes import indented, material

from signorini_fx import (
    Coulomb,
    FormError,
    Foundation,
    NonlinearContactProblem,
    SceneError,
    solve,
    write_results,
)
from signorini_fx.scenes.checks import check_scene

CENTRE, RADIUS = (0.8, 1.5), 0.5
ROLLER = {"shape": "circle", "centre": list(CENTRE), "radius": RADIUS, "pivot": list(CENTRE)}
LAWS = {
    "rubber": material("neo-hooke"),
    "metal": material("j2", yield_stress=2.0, hardening=[[0.2, 6.0]]),
}
TIMES = (1.0, 2.0, 3.0)
SPRING = 5.0
ROUGH = coulomb_friction(0.3)


def polyline(values):
    """An expression of t that is zero at 0 and has these values at 1, 2, 3."""
    steps = np.diff([0.0, *values])
    return " + ".join(
        f"({float(step)!r}) * min(max(t - {k}, 0), 1)" for k, step in enumerate(steps)
    )


def under(tool, law="rubber", **further):
    """A clamped block under a rough tool."""
    contact = {"boundary": "top", "foundation": tool, "friction": ROUGH}
    exact = {"solver": {"algorithm": "alm", "tolerance": 1e-11}}
    times = {"load_steps": {"times": list(TIMES)}}
    return indented(LAWS[law], cells=(8, 4), **({"contact": contact} | exact | times | further))


def wrench(contact, u, pivot):
    """Force and moment that a tool takes about a place, from the tractions at displaced points;
    collective.
    """
    boundary = contact.boundary
    forces = boundary.nodal_forces(contact.pressure, contact.shear)
    arms = boundary.x + u.x.array.reshape(-1, 2)[boundary.nodes] - pivot
    moment = arms[:, 0] * forces[:, 1] - arms[:, 1] * forces[:, 0]
    return boundary.comm.allreduce(np.append(forces.sum(axis=0), moment.sum()))


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.parametrize("law", ["rubber", slow("metal")])
def test_the_forces_of_a_way_give_the_way(law, tmp_path):
    """Pressed, and rolled by a prescribed way and turn; then the weight and the moment of these
    turn it as far.
    """
    way, turn = "0.1 * max(t - 1, 0)", "-0.21 * max(t - 1, 0)"
    placed = {
        "shift": [way, "-0.12 * min(t, 1)"],
        "rotation": f"{float(np.degrees(1.0))!r} * ({turn})",
    }
    by_way = solve(under(ROLLER | placed, law))
    places = np.array(
        [[0.1 * max(t - 1, 0), -0.12 * min(t, 1), -0.21 * max(t - 1, 0)] for t in TIMES]
    )
    wrenches = np.array(
        [
            wrench(step.contact, step.displacement, CENTRE + place[:2])
            for step, place in zip(by_way.steps, places, strict=True)
        ]
    )
    drive = {
        "force": ["0", polyline(-wrenches[:, 1])],
        "moment": polyline(-wrenches[:, 2]),
        "prescribed": {"x": way},
    }
    by_force = solve(under(ROLLER | drive, law))
    assert [step.time for step in by_force.steps] == list(TIMES)
    size = np.abs(wrenches).max()
    for step, place, taken in zip(by_force.steps, places, wrenches, strict=True):
        (tool,) = step.rigid_bodies
        assert [*tool.translation, *tool.rotation] == pytest.approx(place, abs=1e-8)
        assert wrench(step.contact, step.displacement, CENTRE + place[:2]) == pytest.approx(
            taken, abs=1e-8 * size
        )
        assert step.certificate.holds
    u, v = (solution.displacement.x.array for solution in (by_force, by_way))
    assert np.abs(u - v).max() < 1e-9
    (row,) = write_results(by_force, MPI.COMM_WORLD.bcast(str(tmp_path)), pictures=False)[
        "rigid_bodies"
    ]
    assert row["rotation"] == pytest.approx(places[-1, 2], abs=1e-8)
    assert [*row["force"], row["moment"]] == pytest.approx(wrenches[-1], abs=1e-8 * size)
    if law == "rubber":  # at small strains moments are in balance about the undeformed places
        held_by = by_force.resultants.of("bottom")
        arm = np.array(row["reference"]) + row["displacement"] - held_by.about
        moment = row["moment"] + arm[0] * row["force"][1] - arm[1] * row["force"][0]
        assert [*held_by.force, held_by.moment] == pytest.approx(
            [*row["force"], moment], abs=1e-8 * size
        )


def problem(shape, angle=0.0, unit=1.0, friction=0.5, **settings):
    """A clamped block under a tool, all turned about the origin."""
    space, side = rectangle([2.0 * unit, unit], [8, 4])
    top, bottom = side(1, unit), side(1, 0.0)
    mesh = space.mesh
    mesh.geometry.x[:, :2] = mesh.geometry.x[:, :2] @ turn_matrix(angle).T
    u = fem.Function(space)
    contact = Foundation(top, shape=shape, friction=Coulomb(friction) if friction else None)
    settings = {"algorithm": "alm", "tolerance": 1e-11} | settings
    return NonlinearContactProblem(
        residual(u), u, bcs=[held(space, bottom)], contact=contact, **settings
    )


def turn_matrix(angle):
    """In 2D, of radians."""
    return turn_by(angle)


def turned_roller(angle, unit=1.0):
    """The roller in a scene that is turned as a whole."""
    centre = tuple(map(float, unit * turn_matrix(angle) @ CENTRE))
    return {"shape": "circle", "centre": centre, "radius": RADIUS * unit, "pivot": centre}


@pytest.mark.slow
def test_objectivity():
    """The whole scene is turned: so is all that a force askew and a moment do to a tool that
    springs hold.
    """
    unit, ends = 1e3, []
    for angle in (0.0, 0.7):
        turn = turn_matrix(angle)
        alike = {"x": SPRING, "y": SPRING}  # in 2D stiffnesses do not depend on the unit of length
        rolled = problem(
            turned_roller(angle, unit) | {"force": (0.0, 0.0), "spring": alike}, angle, unit
        )
        for force, moment in (
            ((0.0, -8.0), 0.0),
            ((1.0, -10.0), 0.6),
            ((1.25, -9.5), 0.8),
            ((1.5, -9.0), 1.0),
        ):
            rolled.place(0, force=tuple(map(float, unit * turn @ force)), moment=moment * unit**2)
            rolled.solve()
            assert rolled.certificate.holds
            rolled.advance()
        (tool,) = rolled.rigid_bodies
        loads = wrench(rolled.state, rolled.u, tool.reference + tool.translation)
        pushed = -loads[:2] + SPRING * tool.translation
        assert pushed @ turn == pytest.approx(unit * np.array([1.5, -9.0]), abs=1e-8 * unit)
        assert -loads[2] == pytest.approx(moment * unit**2, abs=1e-8 * unit**2)
        ends.append(
            (rolled.u.x.array.reshape(-1, 2) @ turn, tool.translation @ turn, tool.rotation)
        )
    assert abs(ends[0][2][0]) > 0.02
    for first, second in zip(*ends, strict=True):
        assert second == pytest.approx(first, abs=1e-9 * (unit if len(first) > 1 else 1.0))


def seesaw(**driven):
    """A lever with two smooth rollers on a block, pressed at a point between them."""
    space, side = rectangle([2.0, 1.0], [16, 6])
    mesh, u = space.mesh, fem.Function(space)
    top = side(1, 1.0)
    x = dmesh.compute_midpoints(mesh, 1, top)[:, 0]
    rollers = [
        {"shape": "circle", "centre": (at, 1.25), "radius": 0.25, "rigid": "lever"} | more
        for at, more in ((0.5, {"pivot": (0.8, 1.5)} | driven), (1.5, {}))
    ]
    contact = [
        Foundation(top[on], shape=roller)
        for on, roller in zip((x < 1.0, x > 1.0), rollers, strict=True)
    ]
    return NonlinearContactProblem(
        residual(u), u, bcs=[held(space, side(1, 0.0))], contact=contact, algorithm="alm"
    )


def test_a_lever_on_two_rollers():
    """Statics of where it is: both rollers share the force as their arms, which turn with the
    lever, ask for it.
    """
    tilted = seesaw(force=(0.0, -10.0), prescribed={"x": 0.0})
    tilted.solve()
    assert tilted.iterations <= 6
    (tool,) = tilted.rigid_bodies
    assert tool.rotation[0] > 0.01  # it sinks at the nearer roller
    pivot = tool.reference + tool.translation
    boundary, state = tilted.state.boundary, tilted.state
    forces = boundary.nodal_forces(state.pressure, state.shear)
    assert wrench(state, tilted.u, pivot)[1:] == pytest.approx([10.0, 0.0], abs=1e-8)
    # Without friction the forces of each roller pass through its centre, wherever that has gone.
    moment = 0.0
    for part, at in enumerate((0.5, 1.5)):
        centre = np.array([[at, 1.25]])
        arm = (centre + tool.at(centre))[0] - pivot
        total = forces[boundary.part == part].sum(axis=0)
        assert total[1] > 1.0
        moment += arm[0] * total[1] - arm[1] * total[0]
        there = tilted.shapes[part].shape
        signed, _ = there.distance(centre + tool.at(centre))
        assert signed == pytest.approx([-0.25], abs=1e-12)
    assert moment == pytest.approx(0.0, abs=1e-8)


def on_a_box(drive, law="rubber", **further):
    """A clamped cube under a rough cylinder along x[1], or another tool."""
    roller = {
        "shape": "cylinder",
        "axis": [0.0, 1.0, 0.0],
        "centre": [0.4, 0.0, 1.5],
        "radius": 0.5,
    }
    return under(
        roller | {"pivot": [0.4, 0.5, 1.5]} | drive,
        law,
        mesh=box_mesh(5, 2, 3),
        displacement=fixed("bottom", "xyz"),
        **further,
    )


def test_what_is_refused():
    """By one sentence that names the place."""
    drive = {"force": [0.0, 0.0, -1.0], "prescribed": {"rotation_x": 0.0}}
    with pytest.raises(
        SceneError, match="turn about more than one axis is not possible yet"
    ) as refused:
        alone(on_a_box(drive, load_steps={}))
    assert "contact[0].foundation.prescribed" in str(refused.value)
    assert "prescribe rotation_x = 0 and rotation_z = 0, or all of" in str(refused.value)
    drive["prescribed"] = {"rotation_x": 0.2, "rotation_z": 0.0}
    with pytest.raises(SceneError, match="turn about more than one axis"):
        alone(on_a_box(drive, load_steps={}))
    drive |= {"prescribed": {"rotation_x": 0.0, "rotation_z": 0.0}, "rotation": [0.0, 0.0, 10.0]}
    with pytest.raises(
        SceneError, match=r"foundation\.rotation: forces turn this rigid body about another axis"
    ):
        check_scene(on_a_box(drive, load_steps={}), MPI.COMM_SELF)
    space, side = rectangle([1.0, 1.0], [2, 2])
    u = fem.Function(space)
    contact = Foundation(
        side(1, 1.0), shape=ROLLER | {"force": (0.0, -1.0)}, measure=lambda x: x[0]
    )
    with pytest.raises(FormError, match="a rigid body that forces turn is not possible"):
        NonlinearContactProblem(residual(u, neo_hooke), u, contact=contact)
