"""Fluids that enter contact as it opens: uplift under a dam, against statics by hand."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from spaces import box

from signorini_fx import SceneError
from signorini_fx.addons.pictures.boundary_profiles import boundaries_of, panels_of
from signorini_fx.machine import parallel
from signorini_fx.machine.parallel import gather_rows
from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.loads.joint_loads import JointLoads
from signorini_fx.records import Status, StepRecord
from signorini_fx.results.certificate.certificate import certify
from signorini_fx.results.certificate.joint_loads import astray
from signorini_fx.results.certificate.nodal_forces import NodalForces
from signorini_fx.results.certificate.promised_law import Law, Tractions
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve
from signorini_fx.scenes.sweep import sweep

COMM = MPI.COMM_WORLD
LENGTH, HEIGHT, LAYER, WEIGHT = 2.0, 1.0, 0.05, 10.0


def dam(heavy, level=3.0, dim=2, up=None, notch=0.11, gap=None, cells=40, closed="none", unit=1.0, **more):
    """A stiff block on a thin soft layer without friction, held against the water on its left at a point; a joint at
    its heel is open from the beginning.  A number of a length is multiplied by ``unit``, stresses stay.
    """
    mesh = {"generator": "rectangle", "parameters": {"nx": cells, "ny": 20}}
    mesh["parameters"] |= {"length": LENGTH * unit, "height": HEIGHT * unit}
    at, axis = (LENGTH * unit, LAYER * unit), dim - 1
    held = [{"at": at, "x": 0.0}]
    if dim == 3:
        mesh = box("hexahedra", (20, 1, 10), size=(LENGTH, 1.0, HEIGHT), comm=COMM)
        held = [{"at": (LENGTH, y, 0.1), "x": 0.0} for y in (0.0, 1.0)] + [{"boundary": "front", "y": 0.0}]
    layer = 2 * LAYER if dim == 3 else LAYER
    fluid = {"boundary": "left", "level": level, "weight": WEIGHT / unit, "enters": ["bottom"], "closed": closed}
    return parse_scene(
        {
            "mesh": mesh,
            "material": {
                "young": 1e8,
                "poisson": 0.0,
                "grading": f"1e-4 if x[{axis}] < {(layer + 1e-7) * unit} else 1",
            },
            "body_force": {"xyz"[axis]: -heavy / (LENGTH * HEIGHT * unit)},
            "fluid": fluid,
            "contact": {"boundary": "bottom", "gap": gap or f"{0.01 * unit} if x[0] < {notch * unit} else 0"},
            "displacement": held,
        }
        | more
    )


def crack(heavy, level=3.0, arm=LAYER):
    """How far the base is open: the effective stress is linear from zero there, Navier, and its resultant, the weight
    without the full uplift, acts a third of what is closed from the toe.
    """
    pressure = WEIGHT * level
    thrust = pressure * HEIGHT - WEIGHT * HEIGHT**2 / 2
    turning = pressure * HEIGHT**2 / 2 - WEIGHT * HEIGHT**3 / 3 - thrust * arm
    pressed = heavy - pressure * LENGTH
    place = (heavy * LENGTH / 2 + turning - pressure * LENGTH**2 / 2) / pressed
    return LENGTH - 3 * (LENGTH - place)


def along(state, values):
    """Values at the contact points along x[0]."""
    rows = gather_rows(COMM, np.column_stack((state.boundary.x[:, 0], values)))
    return rows[np.argsort(rows[:, 0], kind="stable")].T


@pytest.mark.one_quick
@pytest.mark.mpi(slow=True)
@pytest.mark.parametrize(
    ("heavy", "solver"),
    [
        (75.0, {}),
        (80.0, {"algorithm": "alm"}),
        (80.0, {"algorithm": "path-following"}),
        (75.0, {"linear_algebra": "full"}),
        (75.0, {"algorithm": "exact"}),
    ],
)
def test_a_crack_under_a_dam(heavy, solver):
    """The base opens as far as Navier's formula says, to one cell, and the fluid follows it by one point."""
    solution = solve(dam(heavy, solver=solver), COMM)
    state = solution.contact
    x, wet = along(state, state.joint.pressure)
    _, open_ = along(state, state.pressure == 0.0)
    assert solution.certificate.holds
    assert x[open_ > 0].max() == pytest.approx(crack(heavy), abs=0.05)
    assert np.array_equal(np.flatnonzero(wet), np.arange(open_.sum() + 1))
    assert wet[wet > 0] == pytest.approx(30.0)
    # What it carries is the weight without the uplift under what is wet.
    at = solution.resultants.of("bottom")
    assert at.acts == ("contact", "fluid in contact")
    assert at.force == pytest.approx([0.0, heavy], abs=1e-6)
    assert state.forces[0][1] == pytest.approx(heavy - 30.0 * (0.05 * wet[wet > 0].size - 0.025), rel=1e-9)


@pytest.mark.slow
def test_from_a_coarser_mesh():
    """The crack of nested meshes is that of one mesh, point by point: only the sets of the coarser one are taken."""
    held = [{"at": (LENGTH, 2 * LAYER), "x": 0.0}]
    alone, nested = (solve(dam(75.0, displacement=held, solver={"levels": n}), COMM) for n in (1, 2))
    assert [level.dofs for level in nested.levels][-1] == nested.model.dofs > nested.levels[0].dofs
    assert nested.certificate.holds
    assert np.array_equal(nested.contact.joint.reached, alone.contact.joint.reached)
    assert nested.contact.pressure == pytest.approx(alone.contact.pressure, rel=1e-7, abs=1e-6)


def test_sweep():
    """Multiples of all loads on one mesh against the scene with each of them, and statics."""
    friction = {"law": "coulomb", "coefficient": 0.5}
    contact = {"boundary": "bottom", "gap": "0.01 if x[0] < 0.21 else 0", "friction": friction}

    def loaded(factor):
        water = WATER | {"enters": ["bottom"], "factors": [factor]}
        return dam(75.0 * factor, cells=20, contact=contact, fluid=water)

    points = sweep(loaded(1.0), COMM, loads=[2.0, 1.0])
    for point, factor in zip(points, (2.0, 1.0), strict=True):
        alone = solve(loaded(factor), COMM).contact
        assert point.certificate().holds
        assert np.array_equal(point.contact.joint.reached, alone.joint.reached)
        assert point.contact.joint.pressure == pytest.approx(alone.joint.pressure)
        assert point.contact.pressure == pytest.approx(alone.pressure, rel=1e-6, abs=1e-4)
        uplift = point.contact.joint.pressure @ point.contact.boundary.weight
        assert point.contact.forces[0][1] == pytest.approx(75.0 * factor - uplift, rel=1e-6)
    assert points[0].contact.joint.reached.sum() > 0
    (slippery, rough) = sweep(loaded(1.0), COMM, coefficients=[0.4, 0.6])
    assert slippery.certificate().holds
    assert rough.certificate().holds


def test_an_anchored_block():
    """A tie through it is tightened by a force while the water enters below: by statics its base carries the force and
    the weight without the uplift.  The shortening that is found leads to the same crack when it is given.
    """

    def anchored(**tie):
        block = {"generator": "rectangle", "parameters": {"nx": 20, "ny": 10, "length": LENGTH, "height": HEIGHT}}
        rod = {"generator": "rectangle", "parameters": {"nx": 2, "ny": 8, "length": 0.2, "height": 2.0}}
        water = {"boundary": "block.left", "level": 3.0, "weight": WEIGHT, "enters": ["block.bottom"]}
        return parse_scene(
            {
                "body": [
                    {"name": "block", "mesh": block},
                    {"name": "rod", "mesh": rod, "shift": [0.6, HEIGHT]},
                ],
                "material": [
                    {"region": "block", "young": 1e5, "poisson": 0.2, "density": 1.0},
                    {"region": "rod", "young": 1e6, "poisson": 0.2, "density": 0.0},
                ],
                "displacement": [{"boundary": "rod.top", "x": 0.0, "y": 0.0}, {"boundary": "block.right", "x": 0.0}],
                "gravity": {"y": -60.0},
                "contact": [
                    {"boundary": "block.bottom", "gap": "0.01 if x[0] < 0.21 else 0"},
                    {"boundary": "rod.bottom", "against": "block.top", "kind": "bonded"},
                ],
                "preload": {"region": "rod", "point": [0.7, 2.1], "axis": [0.0, 1.0], **tie},
                "fluid": water,
            }
        )

    forced = solve(anchored(force=8.0), COMM)
    (section,) = forced.preloads
    assert section.force == pytest.approx(8.0, rel=1e-9)
    state = forced.contact
    base = state.boundary.part == 0
    weight = state.boundary.weight[base]
    uplift = state.joint.pressure[base] @ weight
    assert forced.certificate.holds
    assert uplift > 30.0 * 0.25
    assert state.pressure[base] @ weight == pytest.approx(120.0 - 8.0 - uplift, rel=1e-6)
    given = solve(anchored(shortening=section.shortening), COMM).contact
    assert np.array_equal(given.joint.reached, state.joint.reached)
    assert given.pressure == pytest.approx(state.pressure, rel=1e-6, abs=1e-5)


@pytest.mark.parametrize(("closed", "torsion"), [("none", False), ("full", False), ("none", True)])
def test_under_a_cylinder(closed, torsion):
    """Water from outside below a cylinder on a flat base: the uplift is its pressure on the ring of the wet points, and
    the base carries the rest of the weight; where all of it is wet the effective stress is uniform.
    """
    radius, weight, pressure = 1.0, 50.0, 30.0
    gap = 0.0 if closed == "full" else "0.01 if x[0] > 0.71 else 0"
    parameters = {"nx": 10, "ny": 4, "length": radius, "height": 0.5}
    scene = parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": parameters},
            "material": {"young": 1e6, "poisson": 0.0, "hypothesis": "axisymmetric", "torsion": torsion},
            "body_force": {"y": -2 * weight},
            "fluid": {
                "boundary": "right",
                "level": 3.0,
                "weight": 10.0,
                "up": "y",
                "enters": ["bottom"],
                "closed": closed,
            },
            "contact": {"boundary": "bottom", "gap": gap},
            "displacement": [{"boundary": "right", "x": 0.0} | ({"z": 0.0} if torsion else {})],
        }
    )
    solution = solve(scene, COMM)
    state = solution.contact
    uplift = state.joint.pressure @ state.boundary.weight
    assert solution.certificate.holds
    assert state.pressure @ state.boundary.weight == pytest.approx(np.pi * weight - uplift, rel=1e-7)
    if closed == "full":
        assert uplift == pytest.approx(np.pi * pressure)
        assert state.pressure == pytest.approx(weight - pressure, rel=1e-6)
    else:
        r, wet = along(state, state.joint.pressure)
        inner = r[wet > 0].min()
        # The rule of a point is exact for a linear measure: half of the pressure of the facet inside belongs to it.
        assert inner == pytest.approx(0.7)
        inside = inner * 0.1 / 2 - 0.1**2 / 6
        assert uplift == pytest.approx(2 * np.pi * pressure * ((radius**2 - inner**2) / 2 + inside), rel=1e-9)
    linear = tuple(entry.model_copy(update={"closed": "linear"}) for entry in scene.fluid)
    with pytest.raises(SceneError, match="closed: 'linear' is for the plane"):
        solve(scene.model_copy(update={"fluid": linear}), COMM)


def test_in_space():
    """The same block, one wide, on a Krylov method: the coarser mesh knows the crack to its cells."""
    scene = dam(75.0, dim=3, solver={"linear_algebra": "krylov"})
    state = (solution := solve(scene, COMM)).contact
    assert solution.certificate.holds
    x, open_ = along(state, state.pressure == 0.0)
    assert x[open_ > 0].max() == pytest.approx(crack(75.0, arm=0.1), abs=0.1)
    assert solution.resultants.of("bottom").force[2] == pytest.approx(75.0)


def test_what_stays_closed_stays_dry():
    """A heavy block presses more than the water: only the open joint at its heel is wet.  An opening that is not
    connected with the water is dry.
    """
    gap = "0.01 if x[0] < 0.11 or 1.0 < x[0] < 1.2 else 0"
    solution = solve(dam(120.0, gap=gap), COMM)
    x, wet = along(solution.contact, solution.contact.joint.pressure)
    _, open_ = along(solution.contact, solution.contact.pressure == 0.0)
    assert solution.certificate.holds
    assert x[wet > 0] == pytest.approx([0.0, 0.05, 0.1, 0.15])
    assert x[open_ > 0] == pytest.approx([0.0, 0.05, 0.1, 1.05, 1.1, 1.15])


@pytest.mark.slow
def test_where_the_fluid_may_not_be_proves_nothing():
    """A dam that friction holds slides as soon as F times the weight without the uplift is less than the thrust: with
    one wet point fewer it held, so no region ahead of the fluid has been judged.
    """
    bottom = {"boundary": "bottom", "gap": "0.01 if x[0] < 0.11 else 0"}
    bottom["friction"] = {"law": "coulomb", "coefficient": 0.6}
    scene = dam(75.0, contact=bottom, displacement=[], material={"young": 1e6, "poisson": 0.3})
    solution = solve(scene, COMM, check=False)
    x, wet = along(solution.contact, solution.contact.joint.pressure)
    thrust, end = 30.0 - 5.0, x[wet > 0].max() + 0.025
    assert solution.status is Status.SLIDES
    assert 0.6 * (75.0 - 30.0 * end) < thrust
    assert 0.6 * (75.0 - 30.0 * (end - 0.05)) >= thrust


def test_rising_and_falling_water():
    """The crack grows with the level; when it falls, what the water has reached stays wet; at last the block tips or
    floats, which is a named outcome.
    """
    level = "3 if 1.5 < t < 2.5 else 3.6 if t > 3.5 else 2"
    scene = dam(75.0, level, load_steps={"times": [1.0, 2.0, 3.0, 4.0]})
    solution = solve(scene, COMM, check=False)
    rows = [along(step.contact, step.contact.joint.pressure) for step in solution.steps[:3]]
    ends = [x[wet > 0].max() for x, wet in rows]
    assert [step.status for step in solution.steps[:3]] == [Status.CONVERGED] * 3
    assert ends == pytest.approx([0.15, crack(75.0) + 0.02, crack(75.0) + 0.02], abs=0.04)
    assert solution.status in (Status.TIPS, Status.OPEN)


@pytest.mark.parametrize("gap", ["0.01 if x[0] < 0.61 else 0", 0.01])
def test_two_bodies(gap):
    """Between two blocks the fluid presses on both: under the joint its pressure is on the lower one as well.

    Where the gap is a number the points stay where it enters, although the lower mesh is much finer.
    """
    part = {"generator": "rectangle", "parameters": {"length": 2.0, "height": 0.5, "nx": 10, "ny": 2}}
    scene = parse_scene(
        {
            "body": [
                {"name": "lower", "mesh": part | {"parameters": part["parameters"] | {"nx": 25}}},
                {"name": "upper", "mesh": part, "shift": (0.0, 0.5)},
            ],
            "material": {"young": 1e5, "poisson": 0.0},
            "displacement": [
                {"boundary": "lower.bottom", "x": 0.0, "y": 0.0},
                {"boundary": "upper.right", "x": 0.0},
            ],
            "traction": {"boundary": "upper.top", "y": -50.0},
            "fluid": {"boundary": "upper.left", "level": 2.5, "weight": 10.0, "enters": ["upper.bottom"]},
            "contact": {
                "boundary": "upper.bottom",
                "against": "lower.top",
                "distance": "nominal",
                "gap": gap,
            },
        }
    )
    solution = solve(scene, COMM)
    x, wet = along(solution.contact, solution.contact.joint.pressure)
    assert solution.certificate.holds
    if gap != 0.01:
        assert x[wet > 0] == pytest.approx([0.0, 0.2, 0.4, 0.6, 0.8])
    below = solution.resultants.of("lower.bottom").force[1]
    assert below == pytest.approx(100.0)  # the foundation carries all that presses on the upper block
    assert solution.resultants.of("lower.top").force[1] == pytest.approx(-100.0)


def test_friction_is_that_of_the_effective_pressure():
    """A block that is dragged: the pressure of the contact rubs, and that of the fluid does not."""
    scene = parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": {"length": 2.0, "height": 0.2, "nx": 10, "ny": 2}},
            "material": {"young": 1e6, "poisson": 0.0},
            "displacement": [{"boundary": "top", "x": 0.05}],
            "traction": {"boundary": "top", "y": -40.0},
            "fluid": {"boundary": "left", "level": 3.0, "weight": 10.0, "enters": ["bottom"]},
            "contact": {
                "boundary": "bottom",
                "gap": "0.01 if x[0] < 0.61 else 0",
                "friction": {"law": "coulomb", "coefficient": 0.5},
            },
        }
    )
    solution = solve(scene, COMM)
    normal, friction = solution.contact.forces
    uplift = np.dot(solution.contact.joint.pressure, solution.contact.boundary.weight)
    assert uplift == pytest.approx(30.0 * 0.9)  # five points, the first of them half
    assert normal[1] == pytest.approx(80.0 - uplift)
    assert friction[0] == pytest.approx(-0.5 * (80.0 - uplift), rel=1e-6)


@pytest.mark.one_quick
@pytest.mark.parametrize(
    "lie",
    [
        lambda q: np.where(np.arange(q.size) < 2, 0.0, q),  # dry although it is open and connected
        lambda q: 1.1 * q,  # another pressure
        lambda q: np.where(np.arange(q.size) == q.size - 5, 30.0, q),  # wet although nothing leads there
        lambda q: np.where(np.arange(q.size) < 5, 30.0, q),  # one point more than the open ones lead to
        lambda q: 0.0 * q,
    ],
)
def test_a_certificate_that_does_not_hold(lie):
    """Pressures that are not those of a fluid that has entered."""
    scene = dam(120.0)
    solution = solve(scene, COMM)
    tractions = Tractions.of(solution.contact)
    order = np.argsort(solution.contact.boundary.x[:, 0])
    told = np.zeros(order.size)
    told[order] = lie(tractions.joint.pressure[order])
    lied = replace(tractions, joint=replace(tractions.joint, pressure=told, reached=told[:, None] > 0))
    discretisation = solution.model
    law = Law(solution.parameters["gamma_n"], solution.parameters["gamma_t"])
    arguments = scene.statement, discretisation.tagged, solution.displacement
    assert certify(*arguments, tractions, law=law).holds
    assert certify(*arguments, lied, law=law).equilibrium > 1e-3
    # A displacement in equilibrium with such pressures would not help.
    forces = NodalForces(scene.statement, discretisation.tagged, solution.displacement.function_space)
    assert not astray(forces, tractions, 0)
    assert astray(forces, lied, 0)


@pytest.mark.slow
def test_the_smallest_region(monkeypatch):
    """Of all regions that begin at the water, each put on the base by hand, the solution has the first one at whose end
    the base is closed; the water stays where it is although all of the base would be wet on the way of larger steps.
    """
    solution = solve(dam(75.0), COMM)
    _, wet = along(solution.contact, solution.contact.joint.pressure)
    front = []
    for count in range(4, np.count_nonzero(wet) + 1):
        end = 0.05 * (count - 0.5)

        def given(self, reached, end=end):
            x = node_positions(self._space)
            return [(x[:, 0] < end) & (x[:, 1] < 1e-9)]

        with monkeypatch.context() as put:
            put.setattr(JointLoads, "beginning", given)
            put.setattr(JointLoads, "grown", lambda self, open_, reached: reached)
            state = solve(dam(75.0), COMM, check=False).contact
        front.append(along(state, state.pressure)[1][count - 1])
    assert front[:-1] == [0.0] * (len(front) - 1)
    assert front[-1] > 0.0


@pytest.mark.slow
def test_finer_meshes():
    """The front is Navier's to a cell on three meshes, and does not fall behind as the water rises."""
    level = "2.6 + 0.1*t"
    for cells in (20, 40, 80):
        notch = LENGTH / cells * 2.2
        scene = dam(75.0, level, cells=cells, notch=notch, load_steps={"times": [1.0, 2.0, 3.0, 4.0]})
        steps = solve(scene, COMM).steps
        ends = [along(one.contact, one.contact.joint.pressure) for one in steps]
        ends = [x[wet > 0].max() for x, wet in ends]
        assert ends == sorted(ends)
        assert ends[-1] == pytest.approx(crack(75.0), abs=2.1 * LENGTH / cells)
        alone = solve(dam(75.0, 3.0, cells=cells, notch=notch), COMM).contact
        x, wet = along(alone, alone.joint.pressure)
        assert ends[-1] == x[wet > 0].max()


@pytest.mark.mpi
@pytest.mark.parametrize(("closed", "share"), [("none", 0.0), ("linear", 0.5), ("full", 1.0)])
def test_closed_contact(closed, share):
    """Under a heavy block that stays closed: the uplift of what is closed, and the reaction of the contact."""
    solution = solve(dam(200.0, closed=closed, gap="0.01 if x[0] < 0.11 else 0"), COMM)
    state = solution.contact
    assert solution.certificate.holds
    x, pressure = along(state, state.joint.pressure)
    assert pressure[x < 0.16] == pytest.approx(30.0)
    rest = 0.5 * 0.05 if closed == "none" else share * (LENGTH - 0.15)
    total = parallel.global_sum(COMM, np.array(state.joint.pressure @ state.boundary.weight))
    assert total == pytest.approx(30.0 * (0.15 + rest), rel=1e-9)
    assert state.forces[0][1] == pytest.approx(200.0 - total, rel=1e-7)  # equilibrium
    assert solution.table.columns["water"] == pytest.approx(pressure)


def test_the_unsafe_default_is_told():
    """Only where closed contact is dry."""
    for closed, count in (("none", 1), ("linear", 0), ("full", 0)):
        found = [one for one in check_scene(dam(120.0, closed=closed), COMM).findings if one.path == "fluid[0].closed"]
        assert len(found) == count


@pytest.mark.one_quick
@pytest.mark.parametrize("closed", ["none", "full"])
def test_safety_with_the_water_in(closed):
    """A stiff block that friction holds: s (thrust + F uplift) = F weight, and the share of its friction."""
    bottom = {"boundary": "bottom", "gap": "0.01 if x[0] < 0.11 else 0"}
    bottom["friction"] = {"law": "coulomb", "coefficient": 0.5}
    scene = dam(200.0, closed=closed, contact=bottom, displacement=[], material={"young": 1e6, "poisson": 0.3})
    solution = solve(scene, COMM)
    joint, weight = solution.contact.joint, solution.contact.boundary.weight
    uplift, thrust = joint.pressure @ weight, 25.0
    assert solution.safety.bound == pytest.approx(0.5 * 200.0 / (thrust + 0.5 * uplift), rel=1e-6)
    # With its friction as it is the same block tips about its toe at full uplift, before it slides.
    turning = 30.0 / 2 - 10.0 / 3 + joint.pressure @ (weight * (LENGTH - solution.contact.boundary.x[:, 0]))
    used = max(thrust / (0.5 * (200.0 - uplift)), turning / 200.0)
    assert solution.safety.friction_used == pytest.approx(used, rel=1e-6)
    assert "translation along (1, 0)" in solution.safety.motion
    assert solution.safety.sliding == pytest.approx(0.5 * 200.0 / (thrust + 0.5 * uplift), rel=1e-6)
    assert solution.safety.overturning == pytest.approx(200.0 * LENGTH / 2 / turning, rel=1e-6)
    assert "a fluid in contact stays where it is" in solution.safety.assumed


@pytest.mark.slow
@pytest.mark.mpi
def test_restart_on_other_ranks(tmp_path):
    """Begun on one rank and ended on all of them the front is that of a whole run."""
    folder = Path(COMM.bcast(str(tmp_path)))
    level = "1.4 + 0.8*t if t < 2.5 else 2.4"
    scene = dam(75.0, level, cells=20, notch=0.21, load_steps={"times": [1.0, 2.0, 3.0]})

    def stop(record):
        if isinstance(record, StepRecord) and record.step == 3:
            raise KeyboardInterrupt

    if COMM.rank == 0:
        with pytest.raises(KeyboardInterrupt):
            solve(scene, MPI.COMM_SELF, checkpoint=folder, observers=[stop])
    COMM.barrier()
    again, whole = solve(scene, COMM, checkpoint=folder, restart=True), solve(scene, COMM)
    assert again.history.events[0].startswith("restart: 2 complete load steps")
    for step, other in zip(again.steps, whole.steps, strict=True):
        assert step.certificate.holds
        state, reference = step.contact, other.contact
        assert np.array_equal(*(along(end, end.joint.reached) for end in (state, reference)))
        ours, theirs = along(state, state.pressure)[1], along(reference, reference.pressure)[1]
        assert ours == pytest.approx(theirs, rel=0, abs=1e-6 * theirs.max())  # what a certificate allows
    assert along(again.contact, again.contact.joint.reached[:, 0])[1].sum() > 4


@pytest.mark.slow
def test_units():
    """With lengths in thousandths the front, the pressures and the safety factors are the same."""
    found = []
    for unit in (1.0, 1e-3):
        friction = {"law": "coulomb", "coefficient": 0.5}
        contact = {"boundary": "bottom", "gap": f"{0.01 * unit} if x[0] < {0.11 * unit} else 0", "friction": friction}
        held = dam(75.0, 3.0 * unit, unit=unit, cells=20)
        alone = dam(200.0, 3.0 * unit, unit=unit, cells=20, contact=contact, displacement=[], closed="linear")
        safety, state = solve(alone, COMM).safety, solve(held, COMM).contact
        x, wet = along(state, state.joint.pressure)
        found.append((x / unit, wet, along(state, state.pressure)[1], [safety.sliding, safety.overturning]))
    for one, other in zip(*found, strict=True):
        assert one == pytest.approx(other, rel=1e-6, abs=1e-6)


@pytest.mark.slow
def test_a_ramp():
    """Increments that the solver chooses lead to the front of one load step and of given ones."""
    weight, water = -75.0 / (LENGTH * HEIGHT), WATER | {"enters": ["bottom"]}
    fronts = []
    for factors, steps in (((0.7, 1.0), {"steps": 3}), ((0.7, 0.8, 0.9, 1.0), {}), ((1.0,), {})):
        loads = {"body_force": {"y": weight, "factors": [1.0] * len(factors)}, "fluid": water | {"factors": factors}}
        solution = solve(dam(75.0, cells=20, notch=0.21, load_steps=steps, **loads), COMM)
        assert all(step.certificate.holds for step in solution.steps)
        wet = [along(step.contact, step.contact.joint.pressure)[1] > 0 for step in solution.steps]
        assert all((now >= before).all() for before, now in pairwise(wet))
        fronts.append(wet[-1])
    assert 4 < fronts[0].sum() < 20
    assert all(np.array_equal(front, fronts[0]) for front in fronts)


def test_pictures_show_the_fluid():
    """Its pressure beside that of the contact."""
    solution = solve(dam(120.0), COMM)
    (boundary,) = boundaries_of(solution.table.columns)
    names = {curve.name: curve.values for curve in panels_of(boundary.near(), "contact")[0].curves}
    assert names["pressure of the fluid"].max() == pytest.approx(30.0)
    (dry,) = boundaries_of({key: column for key, column in solution.table.columns.items() if key != "water"})
    assert len(panels_of(dry, "contact")[0].curves) == 1


WATER = {"boundary": "left", "level": 3.0, "weight": 10.0}


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"fluid": WATER | {"enters": ["top"]}}, "enters: 'top' is no boundary in contact; these are: 'bottom'"),
        ({"fluid": WATER | {"boundary": "top", "enters": ["bottom"]}}, "enters: boundary 'top' does not meet 'bottom'"),
        ({"fluid": WATER | {"enters": "bottom"}}, "enters"),
        ({"contact": {"boundary": "bottom", "kind": "bilateral"}}, "enters: contact of 'bottom' cannot open"),
        ({"fluid": WATER | {"closed": "full"}}, "closed: is of a fluid that enters contact"),
        ({"accuracy": {"target": 0.1}}, "accuracy: a requested accuracy is not possible yet where a fluid enters"),
    ],
)
def test_bad_values(changes, match):
    """One error each."""
    with pytest.raises(SceneError, match=match) as caught:
        solve(dam(80.0, **changes), COMM)
    assert len(caught.value.problems) == 1
