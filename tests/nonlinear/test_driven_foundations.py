"""Tools that forces move against nonlinear bodies: balance, limits, and outcomes."""

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI
from parameters import slow
from scene_tables import circle_shape, coulomb_friction, fixed, plane_shape, rectangle_mesh
from support.nonlinear_bodies import neo_hooke, rectangle, residual
from support.nonlinear_scenes import block, indented, material
from support.nonlinear_scenes import force as total

from signorini_fx import FormError, Foundation, NonlinearContactProblem, SceneError, Status, solve

LAWS = {
    "rubber": material("neo-hooke"),
    "metal": material("j2", yield_stress=2.0, hardening=[[0.2, 6.0]]),
}
CIRCLE = circle_shape([0.8, 1.5], 0.5)
ROUGH = coulomb_friction(0.3)
UPRIGHT = {"rotation": 0.0}


def rolled(tool, law="rubber", friction=ROUGH, **further):
    """A clamped block under a rough tool."""
    contact = {"boundary": "top", "foundation": tool} | ({"friction": friction} if friction else {})
    exact = {"solver": {"algorithm": "alm", "tolerance": 1e-11}}
    return indented(
        LAWS[law] if isinstance(law, str) else law,
        cells=(8, 4),
        **({"contact": contact} | exact | further),
    )


@pytest.mark.parametrize("law", ["saint-venant-kirchhoff", slow("j2")])
def test_linear_limit(law):
    """At small forces the tool moves as on the linear body: half the force, a quarter of the
    difference.
    """
    plate = {"shape": "plane", "point": [0.0, 1.0], "normal": [0.0, -1.0], "prescribed": UPRIGHT}
    differences = []
    for force in (2e-3, 1e-3):
        ways = [
            solve(
                rolled(plate | {"force": [0.1 * force, -force]}, body, load_steps={}), MPI.COMM_SELF
            )
            for body in (material(law), {"young": 100.0, "poisson": 0.3})
        ]
        ours, linear = (way.last_step.rigid_bodies[0].translation for way in ways)
        assert ours == pytest.approx(linear, rel=1e-3)
        differences.append(np.abs(ours - linear).max())
    if law != "j2":
        assert differences[0] == pytest.approx(4 * differences[1], rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [slow("plane strain"), "axisymmetric"])
def test_a_block_under_a_plate(kind):
    """A block between plates, one pressed by a force: its height is that of the stretches; a spring
    takes its part.
    """
    plate = plane_shape([0.0, 1.0], [0.0, -1.0])
    law = material("neo-hooke", hypothesis=kind)
    way = block(law, "0.3", cells=(2, 2), load_steps={"times": [1.0]})
    force = total(solve(way, MPI.COMM_SELF).last_step)[1]
    upright = UPRIGHT | {"x": 0.0} if kind == "plane strain" else {}
    for spring in ({}, {"spring": {"y": 10.0}}):
        pressed = force - 10.0 * 0.3 * bool(spring)
        tool = (
            plate
            | spring
            | {"force": [0.0, pressed]}
            | ({"prescribed": upright} if upright else {})
        )
        solution = solve(
            block(law, "0", cells=(2, 2), foundation=tool, load_steps={"steps": 3}), MPI.COMM_SELF
        )
        assert solution.last_step.rigid_bodies[0].translation == pytest.approx(
            [0.0, -0.3], abs=1e-8
        )
        assert total(solution.last_step)[1] == pytest.approx(force, rel=1e-9)


@pytest.mark.mpi
def test_a_rank_without_contact_points():
    """Of a tall block some rank has no part of its top: the tool rests where it does on one
    rank.
    """
    mesh = rectangle_mesh(2, 8, length=1.0, height=4.0)
    tool = {"shape": "circle", "centre": [0.5, 5.5], "radius": 1.5, "force": [0.0, -5.0]}
    tool |= {"prescribed": UPRIGHT | {"x": 0.0}}
    scene = rolled(tool, mesh=mesh, load_steps={"times": [1.0]})
    together, alone = (solve(scene, comm).last_step for comm in (MPI.COMM_WORLD, MPI.COMM_SELF))
    assert together.status is Status.CONVERGED
    assert MPI.COMM_WORLD.size == 1 or MPI.COMM_WORLD.allreduce(
        together.contact.boundary.size == 0, MPI.LOR
    )
    assert total(together)[1] == pytest.approx(-5.0, rel=1e-9)
    assert together.rigid_bodies[0].translation == pytest.approx(
        alone.rigid_bodies[0].translation, rel=1e-9, abs=1e-12
    )


@pytest.mark.mpi(slow=True)
def test_between_a_ground_and_a_tool():
    """Contact alone holds the block: it falls to the ground, and the tool with it, by the gap
    more.
    """
    plate = plane_shape([0.0, 1.0], [0.0, -1.0])
    plate |= {"force": ["0", "-20 * t"], "prescribed": UPRIGHT | {"x": 0.0}}
    ways = []
    for gap in (0.0, 0.05):
        contact = [{"boundary": "top", "foundation": plate}, {"boundary": "bottom", "gap": gap}]
        scene = block(
            LAWS["rubber"],
            "0",
            displacement=fixed("left", "x"),
            contact=contact,
            load_steps={"times": [1.0, 2.0]},
        )
        steps = solve(scene).steps
        ways.append([step.rigid_bodies[0].translation[1] for step in steps])
        for step, force in zip(steps, (20.0, 40.0), strict=True):
            assert step.contact.forces_of_each[:, 0, 1] == pytest.approx([-force, force], rel=1e-9)
    assert np.subtract(*ways) == pytest.approx([0.05, 0.05], abs=1e-9)


@pytest.mark.slow
def test_what_pulls_away():
    """A named outcome: at once, or after the load step that had a solution; and where nothing holds
    a tool.
    """
    away = CIRCLE | {"force": ["0", "5 * t"], "prescribed": UPRIGHT}
    later = CIRCLE | {"force": ["0", "-5 * t * (1.5 - t)"], "prescribed": UPRIGHT}
    loose = plane_shape([0.0, 1.0], [0.0, -1.0])
    loose |= {"force": ["t", "-5"], "prescribed": UPRIGHT}
    times = {"load_steps": {"times": [1.0, 2.0]}}
    ends = [
        solve(rolled(tool, friction=friction, **times), MPI.COMM_SELF, check=False)
        for tool, friction in ((away, ROUGH), (later, ROUGH), (loose, None))
    ]
    assert [end.status for end in ends] == [Status.LIMIT, Status.LIMIT, Status.NOT_HELD]
    assert [len(end.steps) > 1 for end in ends] == [False, True, False]
    assert not np.any([tool.translation for tool in ends[0].last_step.rigid_bodies])
    assert 1.4 < ends[1].last_step.time <= 1.5  # when it has no force, and stays where it is
    assert ends[1].last_step.certificate.holds
    assert "body not held" in ends[2].findings[0].message


def test_what_is_refused():
    """By one sentence that names the place: what moves it, and what turns it without a place to
    turn about.
    """
    with pytest.raises(SceneError, match="give the point where the force acts"):
        solve(rolled(CIRCLE | {"force": [0.0, -1.0]}, load_steps={}), MPI.COMM_SELF)
    space, side = rectangle([1.0, 1.0], [2, 2])
    u = fem.Function(space)
    circle = CIRCLE | {"force": (0.0, -1.0), "prescribed": UPRIGHT, "pivot": (0.8, 1.5)}
    problem = NonlinearContactProblem(
        residual(u, neo_hooke), u, contact=Foundation(side(1, 1.0), shape=circle)
    )
    with pytest.raises(FormError, match=r"contact\[0\].shape.shift: cannot be changed"):
        problem.place(0, shift=(0.0, -0.1))
