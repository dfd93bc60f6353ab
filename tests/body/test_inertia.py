"""Inertia: bars, discs and blocks that meet walls, floors and each other, against closed forms."""

import subprocess
import sys
from dataclasses import replace
from types import FunctionType, SimpleNamespace

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from numpy.testing import assert_allclose, assert_array_equal
from on_meshes import trial_and_test, vector_space
from parameters import slow
from scene_tables import circle_shape, fixed, plane_shape, rectangle_mesh
from scenes import alone, changed

from signorini_fx import (
    ContactProblem,
    Foundation,
    NonlinearContactProblem,
    build_problem,
    sensitivity,
    solve,
)
from signorini_fx.addons.pictures.load_steps import load_steps
from signorini_fx.algebra.linalg.schur import SchurComplement
from signorini_fx.errors import FormError, SceneError
from signorini_fx.forms.nonlinear.residual import round_off
from signorini_fx.forms.nonlinear.results import certified
from signorini_fx.machine import parallel
from signorini_fx.machine.result_files import read_csv
from signorini_fx.mechanics.body.inertia import _mass, _times
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.state import State
from signorini_fx.mechanics.statement.load_path import LoadPath
from signorini_fx.records import Status, StepRecord
from signorini_fx.results.certificate.contact_nodes import Law, Tractions
from signorini_fx.results.solution import ConvergenceError
from signorini_fx.results.summary import summary_of
from signorini_fx.scenes import cli
from signorini_fx.scenes.checks import check_scene
from signorini_fx.solving import load_path
from signorini_fx.solving.increments import HalvedIncrements
from signorini_fx.solving.load_path import time_steps
from signorini_fx.solving.step import Failure, _added_forces, begun, step
from signorini_fx.tuned import ENCLOSED

# A bar of c = rho = E = 1 and length 1 that meets a wall: pressure 1 (in units of the velocity) for
# the time 2.
BAR = """
mesh = { generator = "rectangle", parameters = { length = 0.1, height = 1.0, nx = 2, ny = 50 } }
material = { young = 1.0, poisson = 0.0, density = 1.0 }
inertia = { time_step = 0.02 }
initial_velocity = { y = -1e-3 }
load_steps = { times = [0.0, 0.5, 1.0, 1.5, 2.0, 2.5] }
[[contact]]
boundary = "bottom"
"""
# A block that slides on a floor from the equilibrium of its weight.
BLOCK = """
mesh = { generator = "rectangle", parameters = { length = 1.0, height = 0.5, nx = 2, ny = 1 } }
material = { young = 1e5, poisson = 0.3, density = 1.0 }
inertia = { time_step = 0.1, start = "static" }
initial_velocity = { x = 1.0 }
gravity = { y = -1.0 }
load_steps = { times = [0.0, 2.0, 4.0] }
[[contact]]
boundary = "bottom"
friction = { law = "coulomb", coefficient = 0.3 }
"""


LAWS = ["linear", "neo-hooke"]


def of_law(law, **entries):
    """Keys of a material; of a linear one none says so."""
    named = {} if law == "linear" else {"law": law}
    return {"young": 1e5, "poisson": 0.3, "density": 1.0, **named, **entries}


def told(solution):
    """The times and figures of all time steps."""
    return [entry for each in solution.steps for entry in each.between]


def bar(cells, ratio, **entries):
    """The bar with time steps of ``ratio`` cells, all of which are results."""
    tau = ratio / cells
    times = [float(k * tau) for k in range(round(2.5 / tau) + 1)]
    mesh = rectangle_mesh(length=0.1, height=1.0, nx=2)
    mesh["parameters"]["ny"] = cells
    more = {"mesh": mesh, "inertia": {"time_step": tau}, "load_steps": {"times": times}}
    return solve(changed(BAR, **more, **entries))


# Bounds are twice what the scheme was designed with.
@pytest.mark.parametrize(
    ("cells", "ratio", "degree", "rms", "energy", "end"),
    [
        (50, 1.0, 1, 2.8e-3, 0.023, 0.034),
        (25, 1.0, 2, 0.02, 0.04, 0.06),
        slow(100, 0.5, 1, 1e-2, 0.008, 0.02),
        slow(100, 1.0, 1, 2e-3, 0.012, 0.04),
        slow(100, 2.0, 1, 2e-3, 0.020, 0.08),
        slow(100, 4.0, 1, 6e-3, 0.050, 0.12),
        slow(200, 1.0, 1, 2e-4, 0.0072, 0.014),
    ],
)
def test_bar_on_a_wall(cells, ratio, degree, rms, energy, end):
    """Pressure, energy that is lost, and the end of contact; the energies of a step balance."""
    solution = bar(cells, ratio, element={"degree": degree})
    middles = np.array([each.time for each in solution.steps]) - 0.5 * ratio / cells
    pressure = np.array([each.contact.pressure.mean() for each in solution.steps]) / 1e-3
    flat = (middles > 0.5) & (middles < 1.5)
    assert np.sqrt(np.mean((pressure[flat] - 1.0) ** 2)) < rms
    figures = [figures for _, figures in told(solution)]
    begun = 0.5 * 0.1 * 1e-6
    left = figures[-1]["kinetic_energy"] + figures[-1]["strain_energy"]
    assert 0.0 < 1.0 - left / begun < energy
    assert sum(each["contact_loss"] for each in figures) == pytest.approx(begun - left, rel=1e-8)
    assert abs(middles[pressure > 0.01].max() + 0.5 * ratio / cells - 2.0) < end
    assert max(abs(each["energy_error"]) for each in figures) < 1e-11
    assert all(each.certificate.holds for each in solution.steps)
    assert solution.history.linear_solves < 1.1 * len(solution.steps)


@pytest.mark.parametrize("gamma", [1e3, slow(1e6)])
def test_the_penalty_is_no_dashpot(gamma):
    """The energy that contact takes does not depend on gamma."""
    figures = told(bar(50, 1.0, solver={"gamma_n": gamma}))[-1][1]
    lost = 1.0 - (figures["kinetic_energy"] + figures["strain_energy"]) / (0.05 * 1e-6)
    assert 0.0 < lost < 0.03


def test_load_steps_are_divided(monkeypatch):
    """What is between the times is told, one body is condensed, and flight is no deformation."""
    made = []
    begin = SchurComplement.__init__
    monkeypatch.setattr(
        SchurComplement, "__init__", lambda *of, **more: made.append(0) or begin(*of, **more)
    )
    falling = changed(
        BAR,
        mesh=rectangle_mesh(40, 40),
        contact=[{"boundary": "bottom", "gap": 5.0}],
        initial_velocity=[{"y": -1.0}],
        load_steps={"times": [0.0, 2.4, 4.8]},
        inertia={"time_step": 0.05},
    )
    solution = solve(falling)
    assert [each.time for each in solution.steps] == [2.4, 4.8]
    assert [len(each.between) for each in solution.steps] == [48, 48]
    assert_allclose([time for time, _ in told(solution)], 0.05 * np.arange(1, 97))
    moved = solution.displacement.x.array.reshape(-1, 2)
    assert_allclose(moved, np.tile([0.0, -4.8], (len(moved), 1)), atol=1e-9)
    assert_allclose(solution.contact.gap - solution.contact.u_n, 0.2, rtol=1e-9)
    assert solution.steps[-1].deformation.largest < 1e-9
    assert len(made) == 1


@pytest.mark.mpi
def test_results_are_those_of_the_end_of_a_step(monkeypatch):
    """Displacement, energies and slip; friction takes the energy of a block that stops, and forces
    are in balance with inertia; the loads of each step are evaluated once.
    """
    loads = []
    at_place = Model.loads_at

    def counted(*of, **pushing):  # findings ask for those that push alone
        loads.extend([] if pushing else [0])
        return at_place(*of, **pushing)

    monkeypatch.setattr(Model, "loads_at", counted)
    times = [float(time) for time in np.arange(0.0, 3.6, 0.1)]
    solution = solve(changed(BLOCK, load_steps={"times": times}))
    assert len(loads) == len(times) + 1  # one more at the start
    assert_array_equal(solution.displacement.x.array, solution.state.displacement)
    assert solution.last_step.strain_energy == pytest.approx(
        solution.last_step.figures["strain_energy"], rel=1e-2
    )
    work = [each.contact.friction_work for each in solution.steps]
    assert sum(work) == pytest.approx(0.25, rel=1e-3)

    def mean(values):
        """Over the points of all ranks, of which one may have none."""
        total, count = MPI.COMM_WORLD.allreduce(np.array([values.sum(), values.size]))
        return total / count

    slips = [mean(each.contact.slip_length) for each in solution.steps[1:]]
    way = mean(solution.contact.u_t) - mean(solution.steps[0].contact.u_t)
    assert sum(slips) == pytest.approx(way, rel=1e-4)
    braked = solution.at(solution.steps[10]).resultants
    forces = [each.force for each in braked.every()]
    assert_allclose(np.sum(forces, axis=0), 0.0, atol=1e-9)
    assert braked.body_force().acts == ("gravity", "inertia")
    assert_allclose(abs(braked.body_force().force[0]), 0.15, rtol=1e-3)


@pytest.mark.parametrize("tau", [0.1, *(slow(tau) for tau in (0.05, 0.025))])
def test_sliding_block(tau):
    """It stops after v^2 / (2 F g), within twice the error of the design."""
    solution = solve(changed(BLOCK, inertia={"time_step": tau, "start": "static"}))
    way = solution.displacement.x.array.reshape(-1, 2)[:, 0].mean()
    assert way == pytest.approx(1.0 / 0.6, rel={0.1: 2.2e-4, 0.05: 6e-5, 0.025: 3e-5}[tau])
    assert np.abs(solution.state.fields["velocity"].values).max() < 0.02
    assert solution.history.linear_solves < 1.5 * 4.0 / tau
    assert max(abs(figures["energy_error"]) for _, figures in told(solution)) < 1e-8
    assert solution.steps[-1].deformation.largest < 1e-4


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("gamma", [{}, {"gamma_n": 1e4, "gamma_t": 1e4}, {"algorithm": "alm"}])
def test_a_static_state_stays(gamma, law):
    """Exactly, with friction that holds a shear, whatever gamma is."""
    pushed = changed(
        BLOCK,
        initial_velocity=None,
        inertia={"time_step": 0.1},
        traction=[{"boundary": "top", "x": 0.1}],
        load_steps={"times": [0.0, 1.0]},
        material=of_law(law, young=100.0),
        solver=gamma,
    )
    first, last = solve(pushed).steps
    size = np.abs(first.displacement.x.array).max()
    moved = np.abs(last.displacement.x.array - first.displacement.x.array).max()
    assert moved < 1e-9 * size
    assert_allclose(last.contact.pressure, first.contact.pressure, rtol=1e-7)
    assert last.figures["kinetic_energy"] < 1e-16


def test_an_obstacle_moves_into_a_body_at_rest():
    """Pressure rho c w, and penetration of at most w tau."""
    plate = {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0], "shift": [0.0, "1e-3*t"]}
    moving = changed(
        BAR,
        initial_velocity=None,
        contact=[{"boundary": "bottom", "foundation": plate}],
        load_steps={"times": [0.0, 0.5, 1.0]},
    )
    solution = solve(moving)
    for each in solution.steps:
        assert_allclose(each.contact.pressure, 1e-3, rtol=2e-3)
        assert each.certificate.holds
    x = solution.displacement.function_space.tabulate_dof_coordinates()
    moved = solution.state.displacement.reshape(-1, 2)[x[:, 1] < 1e-9, 1]
    assert moved.min() > 1e-3 - 1e-3 * 0.02


def test_a_support_that_starts_to_move():
    """Its reaction is rho c w: nothing flips from step to step; supports do work."""
    moving = changed(
        BAR,
        initial_velocity=None,
        contact=None,
        displacement=[{"boundary": "bottom", "x": 0.0, "y": "1e-3*t"}],
        load_steps={"times": [0.0, 0.3, 0.6, 0.9]},
    )
    solution = solve(moving)
    for each in solution.steps:
        assert abs(each.figures["energy_error"]) < 1e-11
    assert solution.resultants.of("bottom").force[1] == pytest.approx(1e-4, rel=2e-3)
    held = changed(
        BAR,
        initial_velocity=None,
        contact=None,
        material={"young": 1e4, "poisson": 0.0, "density": 1.0},
        displacement=[{"boundary": "bottom", "x": 0.0, "y": "1e-3*t**3"}],
        load_steps={"times": [0.0, 1.0]},
    )
    assert solve(held).resultants.of("bottom").force[1] == pytest.approx(5.94e-4, rel=0.02)


@pytest.mark.parametrize(
    ("below", "law"),
    [
        (1.0, "linear"),
        slow(2.0, "linear"),
        slow(3.0, "linear"),
        slow(2.0, "neo-hooke"),
    ],
)
def test_two_bars_exchange_their_momentum(below, law):
    """A bar stops where it hits one at rest that is as long, or longer, and gives it its
    momentum.
    """
    bodies = [
        {
            "name": name,
            "mesh": rectangle_mesh(2, int(40 * height), length=0.1, height=height),
            "shift": [0.0, shift],
        }
        for name, height, shift in (("lower", below, 0.0), ("upper", 1.0, below))
    ]
    entries = {
        "mesh": None,
        "material": of_law(law, young=1.0, poisson=0.0),
        "body": bodies,
        "initial_velocity": [{"body": "upper", "y": -1e-3}],
        "contact": [{"boundary": "upper.bottom", "against": "lower.top"}],
        "load_steps": {"times": [0.0, 3.0]},
        "inertia": {"time_step": 0.025},
    }
    solution = solve(changed(BAR, **entries))
    velocity = solution.state.fields["velocity"].values.reshape(-1, 2)[:, 1]
    y = solution.displacement.function_space.tabulate_dof_coordinates()[:, 1]
    tagged = solution.model.tagged
    rows = solution.displacement.function_space.dofmap.list
    upper = np.isin(np.arange(y.size), rows[tagged.cells("upper")])
    assert "nothing is in contact" not in str(solution.findings)
    means = []
    for body, height in ((upper, 1.0), (~upper, below)):
        ends = np.isclose(y[body], y[body].min()) | np.isclose(y[body], y[body].max())
        means.append(np.average(velocity[body], weights=np.where(ends, 0.5, 1.0)) * height)
    assert sum(means) == pytest.approx(-1e-3, rel=1e-9)
    assert means[0] == pytest.approx(0.0, abs=5e-5)


def test_a_beam_falls_on_a_stop():
    """The impulse of the stop is the change of momentum; energy is lost in contact alone."""
    times = [float(time) for time in 0.1 * np.arange(81)]
    stop = circle_shape([6.0, -1.002], 1.0)
    entries = {
        "mesh": rectangle_mesh(60, 3, length=10.0, height=0.5),
        "material": {"young": 1.0, "poisson": 0.3, "density": 1.0},
        "inertia": {"time_step": 0.1},
        "contact": [{"boundary": "bottom", "foundation": stop}],
        "load_steps": {"times": times},
    }
    solution = solve(changed(BAR, **entries))
    forces = np.array([each.contact.forces[0][1] for each in solution.steps])
    assert forces[:10].max() == 0.0 < forces.max()
    moved = np.array([each.displacement.x.array for each in solution.steps])
    _, mass = _mass(solution.model)
    ones = np.zeros(moved.shape[1])
    ones[1::2] = 1.0
    velocity = solution.state.fields["velocity"].values.ravel()
    momentum = _times(mass, velocity) @ ones + 1e-3 * 5.0
    assert 0.1 * forces.sum() == pytest.approx(momentum, rel=1e-8)
    figures = [figures for _, figures in told(solution)]
    left = figures[-1]["kinetic_energy"] + figures[-1]["strain_energy"]
    lost = sum(each["contact_loss"] for each in figures)
    assert lost + left == pytest.approx(2.5e-6, rel=1e-8)
    assert 0.0 < lost < 0.02 * 2.5e-6


SPHERE = {"radius": 1.0, "contact_size": 0.015, "contact_zone": 0.05}
SPHERES = {
    "axisymmetric": {
        "mesh": {
            "generator": "half_disk",
            "parameters": {**SPHERE, "size": 0.15, "contact_size": 0.01, "symmetric": True},
        },
        "material": of_law("linear", young=1.0, hypothesis="axisymmetric"),
        "initial_velocity": {"y": -2e-4},
        "displacement": [fixed("symmetry", "x")],
        "contact": [{"boundary": "arc", "foundation": plane_shape([0.0, 0.0], [0.0, 1.0])}],
        "inertia": {"time_step": 0.2},
    },
    "quarter": {
        "mesh": {
            "generator": "half_sphere",
            "parameters": {**SPHERE, "size": 0.3, "part": "quarter", "order": 2},
        },
        "material": of_law("linear", young=1.0),
        "initial_velocity": {"z": -2e-4},
        "displacement": [fixed("symmetry_x", "x"), fixed("symmetry_y", "y")],
        "contact": [
            {"boundary": "sphere", "foundation": plane_shape([0.0, 0.0, 0.0], [0.0, 0.0, 1.0])}
        ],
        "element": {"degree": 2},
        "inertia": {"time_step": 0.3},
    },
}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "share"), [("axisymmetric", 1.0), ("quarter", 0.25)])
def test_a_sphere_bounces(name, share):
    """Contact time, largest force, momentum and rebound of Hertz."""
    velocity, modulus, mass = 2e-4, 1 / 0.91, 2 * np.pi / 3
    duration = 2.87 * (mass**2 / (modulus**2 * velocity)) ** 0.2
    depth = (15 * mass * velocity**2 / (16 * modulus)) ** 0.4
    tau = SPHERES[name]["inertia"]["time_step"]
    times = {"times": np.arange(0.0, 1.2 * duration, tau).tolist()}
    solution = solve(changed(BAR, load_steps=times, **SPHERES[name]))
    forces = np.array([each.contact.forces[0][-1] for each in solution.steps]) / share
    assert tau * np.count_nonzero(forces > 0) == pytest.approx(duration, rel=0.03)
    assert forces.max() == pytest.approx(4 / 3 * modulus * depth**1.5, rel=0.03)
    assert tau * forces.sum() == pytest.approx(2 * mass * velocity, rel=0.01)
    figures = told(solution)[-1][1]
    left = (figures["kinetic_energy"] + figures["strain_energy"]) / share
    assert 0.99 < left / (0.5 * mass * velocity**2) < 1.0


@pytest.mark.mpi
def test_a_body_on_a_spring():
    """Swings as a point does, with the root of stiffness over mass."""
    swings = changed(
        BLOCK,
        contact=None,
        gravity=None,
        springs=[{"boundary": "left", "x": 1.0}],
        inertia={"time_step": np.pi / 200},
        load_steps={"times": [0.0, np.pi / 2, np.pi]},
    )
    first, last = solve(swings).steps[-2:]
    assert_allclose(first.displacement.x.array[::2], 1.0, rtol=1e-3)
    assert_allclose(last.displacement.x.array[::2], 0.0, atol=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("speed", "period"), [(0.01, 8.499), (0.05, 9.072)])
def test_a_block_on_a_belt(speed, period):
    """Sticks and slips with the period of a rigid one."""
    belt = {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0], "shift": ["0.1*t", 0.0]}
    law = {"law": "stribeck", "coefficient": 0.4, "kinetic": 0.2, "speed": speed}
    entries = {
        "inertia": {"time_step": 0.05, "start": "static"},
        "initial_velocity": None,
        "springs": [{"boundary": "left", "x": 1.0}],
        "contact": [{"boundary": "bottom", "foundation": belt, "friction": law}],
        "load_steps": {"times": np.arange(0.0, 22.0, 0.05).tolist()},
    }
    solution = solve(changed(BLOCK, **entries))
    assert solution.converged
    away = np.array([each.displacement.x.array[::2].mean() for each in solution.steps])
    times = np.array([each.time for each in solution.steps])
    inner = np.arange(1, away.size - 1)
    peaks = inner[(away[inner] > away[inner - 1]) & (away[inner] >= away[inner + 1])]
    peaks = peaks[away[peaks] > 0.9 * away.max()]
    assert np.diff(times[peaks]).mean() == pytest.approx(period, rel=0.01)


def tool(boundary="top", **keys):
    """A contact with a rigid plate above the block that flies on it, turning; None: without a
    key.
    """
    keys = {
        **plane_shape([0.5, 0.5], [0.0, -1.0]),
        "pivot": [0.6, 0.6],
        "mass": 0.7,
        "moment_of_inertia": 0.1,
        "velocity": {"x": 0.02, "y": -0.1, "rotation": 0.01},
        **keys,
    }
    return {"boundary": boundary, "foundation": {k: v for k, v in keys.items() if v is not None}}


SOFT = {
    "mesh": rectangle_mesh(6, 3, length=1.0, height=0.5),
    "material": of_law("linear", young=100.0),
    "inertia": {"time_step": 0.02},
    "initial_velocity": None,
    "gravity": None,
    "load_steps": {"times": [0.0, 0.04, 0.2]},
}


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("law", "coefficient", "error"),
    [("linear", 0.0, 1e-11), ("linear", 0.3, 1e-11), ("neo-hooke", 0.3, 2e-5)],
)
def test_a_rigid_plate_hits_a_free_block(law, coefficient, error):
    """Momentum of both stays, and so do its moment and the energy but for what contact takes, beside
    rubber with an error of the time step.
    """
    touches = {**tool(), "friction": {"law": "coulomb", "coefficient": coefficient}}
    material = of_law(law, young=100.0)
    solution = solve(changed(BLOCK, **{**SOFT, "material": material}, contact=[touches]))
    assert abs(solution.steps[0].contact.forces[0]).max() > 0.3
    (plate,) = solution.last_step.rigid_bodies
    rates = solution.state.fields["rigid velocity"].values / solution.model.rigid.units
    _, mass = _mass(solution.model)
    velocity = solution.state.fields["velocity"].values.ravel()
    momentum = _times(mass, velocity).reshape(-1, 2)
    x = solution.displacement.function_space.tabulate_dof_coordinates()
    arm = x[: len(momentum), :2] - plate.reference
    turning = arm[:, 0] * momentum[:, 1] - arm[:, 1] * momentum[:, 0]
    local = np.array([*momentum.sum(axis=0), turning.sum()])
    of_block = parallel.global_sum(MPI.COMM_WORLD, local)
    total = of_block + rates * [0.7, 0.7, 0.1]
    assert_allclose(total[:2], [0.014, -0.07], atol=1e-11)
    if law != "linear":  # arms are those of displaced points
        moved = solution.displacement.x.array.reshape(-1, 2)[: len(momentum)]
        local = moved[:, 0] @ momentum[:, 1] - moved[:, 1] @ momentum[:, 0]
        total[2] += parallel.total(MPI.COMM_WORLD, local)
        total[2] += 0.7 * np.linalg.det([plate.translation, rates[:2]])
    assert total[2] == pytest.approx(0.001, abs=error)
    figures = [figures for _, figures in told(solution)]
    assert max(abs(each["energy_error"]) for each in figures) < 50 * error
    lost = sum(each["contact_loss"] for each in figures)
    assert 0.0 < lost < 0.25 * figures[-1]["kinetic_energy"]
    slowed = plate.translation[0] < 0.004 - 1e-6
    assert slowed == (coefficient > 0.0)


def test_a_rigid_ball_turns_in_space():
    """Momentum and its moment stay, of a ball that hits one side of a box and rubs it."""
    centre = np.array([0.6, 0.55, 1.5])
    ball = {
        "shape": "sphere",
        "centre": centre.tolist(),
        "radius": 0.5,
        "pivot": centre.tolist(),
        "mass": 0.7,
        "moment_of_inertia": [0.1, 0.2, 0.3],
        "velocity": {"x": 0.02, "z": -0.1, "rotation_x": 0.01},
    }
    friction = {"law": "coulomb", "coefficient": 0.3}
    entries = {
        **SOFT,
        "mesh": {"generator": "box", "parameters": {"nx": 4, "ny": 4, "nz": 2}},
        "inertia": {"time_step": 0.1},
        "load_steps": {"times": [0.0, 0.8]},
        "contact": [{"boundary": "top", "foundation": ball, "friction": friction}],
    }
    solution = solve(changed(BLOCK, **entries))
    rates = solution.state.fields["rigid velocity"].values / solution.model.rigid.units
    _, mass = _mass(solution.model)
    momentum = _times(mass, solution.state.fields["velocity"].values.ravel()).reshape(-1, 3)
    arms = solution.displacement.function_space.tabulate_dof_coordinates() - centre
    assert abs(momentum).max() > 1e-4
    assert_allclose(momentum.sum(axis=0) + 0.7 * rates[:3], [0.014, 0.0, -0.07], atol=1e-11)
    turning = np.cross(arms, momentum).sum(axis=0) + [0.1, 0.2, 0.3] * rates[3:]
    assert_allclose(turning, [1e-3, 0.0, 0.0], atol=1e-11)


def test_a_rigid_plate_bounces_on_a_spring():
    """As a point of its mass on a light block: half a period, and the largest force."""
    stiffness, tau = 200.0, 0.005
    held = {"x": 0.0, "rotation": 0.0}
    entries = {
        "material": of_law("linear", young=100.0, poisson=0.0, density=0.01),
        "displacement": [fixed("bottom", "y"), fixed("left", "x")],
        "inertia": {"time_step": tau},
        "load_steps": {"times": (tau * np.arange(50)).tolist()},
        "contact": [tool(moment_of_inertia=None, prescribed=held, velocity={"y": -0.01})],
    }
    solution = solve(changed(BLOCK, initial_velocity=None, gravity=None, **entries))
    assert "the gap is negative" not in str(solution.findings)
    forces = np.array([-each.contact.forces[0][1] for each in solution.steps])
    half = np.pi * np.sqrt(0.7 / stiffness)
    assert tau * np.count_nonzero(forces) == pytest.approx(half, rel=0.03)
    assert forces.max() == pytest.approx(0.01 * np.sqrt(stiffness * 0.7), rel=0.01)
    assert solution.state.fields["rigid velocity"].values[1] == pytest.approx(0.01, rel=5e-3)
    figures = [figures for _, figures in told(solution)]
    assert max(abs(each["energy_error"]) for each in figures) < 1e-11


COARSE = rectangle_mesh(2, 20, length=0.1, height=1.0)
BASE = [fixed("bottom")]
PULLED = {
    "initial_velocity": None,
    "inertia": {"start": "undeformed"},
    "contact": None,
    "displacement": BASE,
    "load_steps": {"times": [0.0, 1.0, 2.0, 4.0]},
}
PLATE = {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0], "shift": [0.0, "1e-3*t"]}
# Entries, an accuracy, and the step with which the truth is computed.
IN_TIME = {
    "bar": ({"load_steps": {"times": [0.0, 1.0, 2.5]}}, 0.15, 0.0251),
    "bar, long steps": ({"load_steps": {"times": [0.0, 1.0, 2.5]}}, 0.3, 0.0251),
    "flight": (
        {
            "contact": [{"boundary": "bottom", "gap": 5e-4}],
            "load_steps": {"times": [0.0, 1.0, 2.0, 3.0]},
        },
        0.1,
        0.0251,
    ),
    "plate": (
        {
            "initial_velocity": None,
            "contact": [{"boundary": "bottom", "foundation": PLATE}],
            "load_steps": {"times": [0.0, 1.0, 2.0]},
        },
        0.1,
        0.0251,
    ),
    "step": ({**PULLED, "traction": [{"boundary": "top", "y": 1e-3}]}, 0.3, 0.01),
    "sine": ({**PULLED, "traction": [{"boundary": "top", "y": "1e-3*sin(1.5*t)"}]}, 0.1, 0.01),
}


@pytest.mark.parametrize("name", [name if name == "flight" else slow(name) for name in IN_TIME])
def test_errors_in_time(name):
    """Steps are as long as an accuracy allows; the estimate is right within a factor of four."""
    entries, accuracy, short = IN_TIME[name]
    entries = {"mesh": COARSE, "inertia": {}, **entries}
    inertia = {**entries["inertia"], "time_step": short}
    truth = solve(changed(BAR, **{**entries, "inertia": inertia}))
    times = entries["load_steps"]["times"]
    entries["load_steps"] = {"times": times, "time_accuracy": accuracy}
    solution = solve(changed(BAR, **entries))
    assert [each.time for each in solution.steps] == [each.time for each in truth.steps]
    assert solution.state.number < 0.8 * truth.state.number
    away = solution.displacement.x.array - truth.displacement.x.array
    largest = max(np.linalg.norm(each.displacement.x.array) for each in truth.steps)
    error = solution.last_step.figures["time_error"]
    assert 0.25 < error / (np.linalg.norm(away) / largest) < 4.0
    warned = [one.path for one in solution.findings if one.level == "warning"]
    assert ("load_steps.time_accuracy" in warned) == (error > accuracy)
    assert summary_of(solution)["steps"][-1]["time_error"] == error


@pytest.mark.parametrize("call", [5, 8])
def test_a_step_that_was_too_long_is_not_stored(tmp_path, monkeypatch, call):
    """A run that is killed while a pair of steps is halved goes on from the last accepted one."""
    entries, accuracy, _ = IN_TIME["flight"]
    steps = entries["load_steps"] | {"time_accuracy": accuracy}
    scene = changed(BAR, **entries | {"mesh": COARSE, "inertia": {}, "load_steps": steps})
    whole = solve(scene)
    solved, calls = load_path.step, []

    def killed(*args, **more):
        calls.append(args)
        if len(calls) == call:
            raise KeyboardInterrupt
        return solved(*args, **more)

    monkeypatch.setattr(load_path, "step", killed)
    with pytest.raises(KeyboardInterrupt):
        solve(scene, checkpoint=tmp_path)
    monkeypatch.undo()
    solution = solve(scene, checkpoint=tmp_path, restart=True)
    assert solution.state.number == whole.state.number
    assert_allclose(solution.state.displacement, whole.state.displacement, atol=1e-12)


# --- forms ----------------------------------------------------------------------------------------


def disc(count):
    """A disc of radius 1 of mapped quadrilaterals."""
    mesh = dmesh.create_rectangle(
        MPI.COMM_WORLD, [[-1.0, -1.0], [1.0, 1.0]], [count, count], dmesh.CellType.quadrilateral
    )
    x, y = mesh.geometry.x[:, 0].copy(), mesh.geometry.x[:, 1].copy()
    mesh.geometry.x[:, 0] = x * np.sqrt(1 - y**2 / 2)
    mesh.geometry.x[:, 1] = y * np.sqrt(1 - x**2 / 2)
    return mesh


def ball(count, velocity=-0.02, density=1.0, weight=0.0, *, nonlinear=False, shape=None, **more):
    """A disc above a floor, linear or of a neo-Hookean material that is so at small strains, and the
    state that it begins with.
    """
    mesh = disc(count)
    space = vector_space(mesh)
    u, v = trial_and_test(space)
    strain = ufl.sym(ufl.grad(u))
    first, second = 0.3 / (1.3 * 0.4), 0.5 / 1.3
    a = ufl.inner(2 * second * strain, ufl.grad(v)) * ufl.dx
    a += first * ufl.div(u) * ufl.div(v) * ufl.dx
    L = ufl.inner(fem.Constant(mesh, (0.0, -weight)), v) * ufl.dx
    below = dmesh.locate_entities_boundary(mesh, 1, lambda x: x[1] < -0.5)
    floor = Foundation(below, gap=lambda x: x[1] + 1.0, direction=(0.0, -1.0))
    if shape is not None:
        floor = Foundation(below, shape=shape)
    more |= {"contact": floor}
    more["density"] = density(u, v) if isinstance(density, FunctionType) else density
    if nonlinear:
        y = fem.Function(space)
        change = ufl.variable(ufl.Identity(2) + ufl.grad(y))
        growth = ufl.ln(ufl.det(change))
        energy = second / 2 * (ufl.inner(change, change) - 2 - 2 * growth) + first / 2 * growth**2
        F = ufl.derivative(energy * ufl.dx, y, v) - L
        problem = NonlinearContactProblem(F, y, **more)
    else:
        problem = ContactProblem(a, L, **more)
    state = problem.initial()
    values = np.zeros_like(state.displacement)
    values[1::2] = velocity
    speed = np.sqrt(first + 2 * second)
    return problem, state.with_field("velocity", "dofs", values), speed


def bounced(count, ratio, **how):
    """Forces and figures of the steps until the disc has left the floor."""
    problem, state, speed = ball(count, **how)
    tau = ratio * 2.0 / count / speed
    forces, figures = [], []
    while len(forces) < 10 or forces[-1] > 0:
        state, result = problem.step(state, state.time + tau)
        assert result.status.value == "converged"
        forces.append(float(result.contact.forces[0][1]))
        figures.append(result.figures)
    return np.array(forces), figures, state


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("count", "ratio", "energy", "roughness", "force"),
    [
        (12, 2.0, 0.03, 0.3, 0.0296),
        slow(24, 1.0, 0.0048, 0.22, 0.0302),
        slow(24, 2.0, 0.0084, 0.18, 0.0301),
        slow(48, 2.0, 0.0040, 0.14, 0.0300),
    ],
)
def test_bouncing_disc(count, ratio, energy, roughness, force):
    """In forms: its energy, and how smooth the force is."""
    forces, figures, _ = bounced(count, ratio)
    lost = sum(each["contact_loss"] for each in figures)
    left = figures[-1]["kinetic_energy"] + figures[-1]["strain_energy"]
    assert 0.0 < lost / (left + lost) < energy
    assert np.abs(np.diff(forces, 2)).sum() / (4 * forces.max()) < roughness
    assert forces.max() == pytest.approx(force, rel=0.02)
    assert max(abs(each["energy_error"]) for each in figures) < 1e-11


@pytest.mark.parametrize("nonlinear", [False, True])
def test_a_form_of_the_mass(nonlinear):
    """It is the same as its density."""
    how = {"nonlinear": nonlinear}
    with_form = bounced(8, 2.0, density=lambda u, v: ufl.inner(u, v) * ufl.dx, **how)[0]
    assert_allclose(with_form, bounced(8, 2.0, **how)[0], rtol=1e-9, atol=1e-12)


@pytest.mark.mpi
@pytest.mark.parametrize(("velocity", "lost"), [(-2e-5, 0.03), (-0.2, 0.08)])
def test_a_nonlinear_disc_bounces(velocity, lost):
    """As a linear one where it is slow; where strains are a fifth, too, contact alone takes energy,
    but for an error of second order in the step.
    """
    forces, figures, _ = bounced(8, 2.0, velocity=velocity, nonlinear=True)
    taken = sum(each["contact_loss"] for each in figures)
    left = figures[-1]["kinetic_energy"] + figures[-1]["strain_energy"]
    assert 0.0 < taken / (left + taken) < lost
    errors = [each["energy_error"] for each in figures]
    if velocity == -0.2:
        finer = bounced(8, 1.0, velocity=velocity, nonlinear=True)[1]
        assert max(map(abs, errors)) < 2e-3
        assert max(abs(each["energy_error"]) for each in finer) < max(map(abs, errors)) / 3.5
        return
    slow, linear, _ = bounced(8, 2.0, velocity=velocity)
    assert_allclose(forces, slow, atol=1e-3 * slow.max())
    for name in ("kinetic_energy", "strain_energy"):
        ours, theirs = ([each[name] for each in both] for both in (figures, linear))
        assert_allclose(ours, theirs, atol=1e-3 * max(theirs))
    assert max(map(abs, errors)) < 1e-6


def test_a_rubber_block_tumbles_onto_a_floor():
    """It turns by half a circle in flight, with its moment of momentum, and by gravity meets the
    floor with one side after the other.
    """
    floor = plane_shape([0.0, -0.7], [0.0, 1.0])
    entries = {
        **SOFT,
        "material": of_law("neo-hooke", young=50.0),
        "inertia": {"time_step": np.pi / 40},
        "initial_velocity": [{"rotation": 1.0, "about": [0.5, 0.25]}],
        "contact": [{"boundary": one, "foundation": floor} for one in ("bottom", "right", "top")],
        "load_steps": {"times": [0.0, np.pi]},
    }
    solution = solve(changed(BLOCK, **entries))
    places = solution.displacement.function_space.tabulate_dof_coordinates()[:, :2]
    arm = places + solution.displacement.x.array.reshape(-1, 2) - [0.5, 0.25]
    _, mass = _mass(solution.model)
    momentum = _times(mass, solution.state.fields["velocity"].values.ravel()).reshape(-1, 2)
    turning = arm[:, 0] @ momentum[:, 1] - arm[:, 1] @ momentum[:, 0]
    assert turning == pytest.approx(0.5 * (1.0 + 0.25) / 12, rel=1e-10)
    assert_allclose(momentum.sum(axis=0), 0.0, atol=1e-12)
    assert not [one for one in solution.findings if one.level == "warning"]
    fallen = solve(changed(BLOCK, **{**entries, "gravity": {"y": -1.0}}))
    assert max(figures["contact_loss"] for _, figures in told(fallen)) > 1e-3
    assert fallen.last_step.certificate.holds


def test_a_time_step_without_a_solution_is_halved():
    """It, and not the load step that it is a part of, down to the share that increments of loads
    have; the message names the time that was reached.
    """
    way = HalvedIncrements(LoadPath((0.0, 1.0)))
    way.begin_at(0.0)
    tried = [0.01]
    while way.shorten(Status.NOT_SOLVED, tried[-1]):
        tried.append(way.next)
    assert_allclose(tried, 0.01 / 2.0 ** np.arange(len(tried)))
    assert 0.5 < tried[-1] / (0.01 * ENCLOSED) < 2.0
    squeezed = of_law("saint-venant-kirchhoff", young=1.0)
    with pytest.raises(ConvergenceError, match=r"inside out: at .* a solution at time 0"):
        solve(changed(BAR, material=squeezed, initial_velocity=[{"y": -0.4}]))


def test_a_pair_of_steps_without_a_solution_is_halved():
    """Also of a nonlinear body, whose failure leaves no body to tell its shortest step."""
    effect = SimpleNamespace(moves_bodies=True, order=2, next_time=lambda state, end: end)
    problem = SimpleNamespace(path=LoadPath((0.0, 1.0), time_accuracy=0.1), effects=[effect])
    first = State(1, 0.0, np.zeros(4), np.zeros(0), ())

    def failing(state, place, time):
        return state, Failure(StepRecord(2, "", time), Status.NOT_SOLVED, "")

    ((_, report, _, time),) = time_steps(problem, first, 0.0, 1.0, failing)
    assert report.status is Status.NOT_SOLVED
    assert 0.5 < time / ENCLOSED <= 2.0


@pytest.mark.slow
def test_a_disc_that_bounces_ten_times():
    """Its energy with that of its weight is never above the first one."""
    problem, state, speed = ball(16, velocity=0.0, weight=1e-3)
    mean = state.with_field("x", "dofs", np.zeros_like(state.displacement))
    tau, energies, lost = 4.0 / 16 / speed, [], 0.0
    state = mean
    impacts, touched = 0, False
    lifted = np.zeros_like(state.displacement)
    lifted[1::2] = 0.2
    state = State(0, 0.0, lifted, np.zeros(0), state.placed, fields=state.fields)
    while impacts < 10:
        state, result = problem.step(state, state.time + tau)
        assert result.status.value == "converged"
        pressed = result.contact.forces[0][1] > 0
        impacts += touched and not pressed
        touched = pressed
        figures = result.figures
        weight = 1e-3 * np.pi * state.displacement[1::2].mean()
        energies.append(figures["kinetic_energy"] + figures["strain_energy"] + weight)
        lost += figures["contact_loss"]
    assert max(energies) < energies[0] * (1 + 2e-3)
    assert lost > 0


# --- states, ranks, and what is refused -----------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.parametrize("law", LAWS)
def test_each_step_again(tmp_path, law):
    """In a fresh problem from a file; on all ranks as on one."""
    comm = MPI.COMM_WORLD
    folder = comm.bcast(tmp_path)
    times = {"times": [0.0, 0.1, 0.2]}
    scene = changed(BLOCK, load_steps=times, material=of_law(law))
    problem = build_problem(scene)
    state = problem.initial()
    for time in times["times"][:2]:
        state, _ = problem.step(state, time)
    path = folder / "state.npz"
    state.save(path, problem)
    later, _ = problem.step(state, 0.2)
    fresh = build_problem(scene)
    again, result = fresh.step(State.load(path, fresh), 0.2)
    assert result.certificate.holds
    assert_allclose(again.displacement, later.displacement, rtol=1e-9, atol=1e-12)
    for name in ("velocity", "load", "contact"):
        size = np.abs(later.fields[name].values).max(initial=1e-12)
        assert_allclose(again.fields[name].values, later.fields[name].values, atol=1e-8 * size)


class Killed(Exception):
    """As a signal would raise it."""


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("law", "accuracy", "plate"),
    [
        *((law, accuracy, False) for law in LAWS for accuracy in (None, 0.01)),
        *((law, None, True) for law in LAWS),
    ],
)
def test_a_killed_run_goes_on(tmp_path, law, accuracy, plate):
    """From one rank, in the middle of its load steps, on any number of them."""
    comm = MPI.COMM_WORLD
    folder = comm.bcast(tmp_path)
    inertia = {"time_step": None if accuracy else 0.1, "start": "static"}
    times = {"times": [0.0, 0.5, 1.0], "time_accuracy": accuracy}
    scene = changed(BLOCK, inertia=inertia, load_steps=times, material=of_law(law))
    if plate:
        contact = [tool(), {"boundary": "bottom"}]
        scene = {**SOFT, "load_steps": times, "material": of_law(law, young=100.0)}
        scene = changed(BLOCK, **scene, contact=contact)

    def stop(record):
        if isinstance(record, StepRecord) and record.time == 1.0:
            raise Killed

    if comm.rank == 0:
        with pytest.raises(Killed):
            alone(scene, checkpoint=folder, observers=[stop])
    comm.barrier()
    ended = solve(scene, checkpoint=folder, restart=True)
    whole = solve(scene)
    assert [each.time for each in ended.steps] == [0.0, 0.5, 1.0][plate:]
    assert len(told(ended)) == len(told(whole)) >= 5
    assert ended.last_step.figures == pytest.approx(whole.last_step.figures, rel=1e-4, abs=1e-9)
    for (_, ours), (_, theirs) in zip(told(ended), told(whole), strict=True):
        assert ours["kinetic_energy"] == pytest.approx(theirs["kinetic_energy"], rel=1e-6)
    assert_allclose(ended.displacement.x.array, whole.displacement.x.array, rtol=1e-7, atol=1e-10)


HEAVY = {"young": 1.0, "poisson": 0.0}
REFUSED = {
    "no density": ({"material": HEAVY}, "density, which inertia needs"),
    "step": ({"inertia": {"time_step": 0.0}}, "inertia"),
    "long step": ({"inertia": {"time_step": 0.6}}, "longer than a load step of 0.5"),
    "short step": ({"inertia": {"time_step": 0.001}}, "the mesh rings: make it 0.01 at least"),
    "no step": ({"inertia": {}}, "needs a time_step, or load_steps.time_accuracy"),
    "no times": ({"load_steps": None}, "must be given with inertia"),
    "ramp": ({"load_steps": {"times": [0.0, 1.0], "steps": 4}}, "no ramp with inertia"),
    "levels": ({"solver": {"levels": 2}}, "not possible yet with inertia"),
    "mixed": ({"element": {"volumetric": "mixed"}}, "not possible yet with inertia"),
    "no inertia": ({"inertia": None}, "needs inertia"),
    "support": (
        {"displacement": [fixed("top", "y")]},
        "moves a node whose displacement is prescribed",
    ),
    "body": ({"initial_velocity": [{"body": "ball", "y": -1.0}]}, "has no region 'ball'"),
    "tool without a mass": (
        {"contact": [tool(mass=None)]},
        r"contact\[0\].foundation.mass: is needed by inertia: give it, or prescribe",
    ),
    "tool that may turn": (
        {"contact": [tool(moment_of_inertia=None)]},
        r"contact\[0\].foundation.moment_of_inertia: is needed by inertia",
    ),
    "tool in the plane": ({"contact": [tool(moment_of_inertia=[1.0] * 3)]}, "give a number"),
    "speed that is held": (
        {"contact": [tool(prescribed={"y": 0.0})]},
        "velocity.y: has no effect on a component that is prescribed",
    ),
    "mass at rest": (
        {"inertia": None, "initial_velocity": None, "contact": [tool()]},
        "foundation.mass: needs inertia",
    ),
    "metal": (
        {"material": of_law("j2", yield_stress=1.0)},
        "is not possible yet with inertia: take one without memory",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused(name):
    """By one error that says what to do."""
    entries, reason = REFUSED[name]
    with pytest.raises(SceneError, match=reason):
        solve(changed(BAR, **entries))


@pytest.mark.parametrize("nonlinear", [False, True])
def test_forms_refuse(nonlinear):
    """What has no duration, no derivative, or is no density."""
    problem, state, _ = ball(4, nonlinear=nonlinear)
    with pytest.raises(FormError, match="use step"):
        problem.solve()
    problem.step(state, 0.5)
    with pytest.raises(FormError, match="derivatives of motions with inertia"):
        problem.gradient(of="force foundation x", by=problem.u)
    for density in (-1.0, "7800", fem.Function(problem.u.function_space)):
        with pytest.raises(FormError, match="density"):
            ball(4, density=density, nonlinear=nonlinear)
    plate = tool()["foundation"]
    with pytest.raises(FormError, match="density: rigid bodies that forces move have no mass in"):
        ball(4, nonlinear=nonlinear, shape=plate)
    if nonlinear:
        with pytest.raises(FormError, match="what a material remembers is not possible yet"):
            ball(4, nonlinear=True, update=lambda: None)
    with pytest.raises(SceneError, match="derivatives of motions with inertia"):
        sensitivity(changed(BAR), "force bottom y", "material.young")


def test_check_tells_of_time_steps():
    """Their number, how far waves go in one, and solves of all; too short ones are refused."""
    scene = changed(BAR)
    checked = check_scene(scene)
    found = [str(finding) for finding in checked.findings]
    assert any("125 time steps" in one and "waves pass 1 of the smallest" in one for one in found)
    low, high = checked.cost.linear_solves
    assert low <= solve(scene).history.linear_solves <= high
    with pytest.raises(SceneError, match="the mesh rings"):
        check_scene(changed(BAR, inertia={"time_step": 0.001}))


def test_nothing_is_imported_without_it():
    """A scene without inertia, and forms."""
    code = (
        "import sys, tomllib; from signorini_fx import ContactProblem, solve\n"
        "from signorini_fx.scenes.reading import parse_scene\n"
        f"text = tomllib.loads({BAR!r})\n"
        "del text['inertia'], text['initial_velocity'], text['load_steps']\n"
        "text['displacement'] = [{'boundary': 'top', 'y': -0.01, 'x': 0.0}]\n"
        "assert solve(parse_scene(text)).converged\n"
        "assert not [name for name in sys.modules if name.endswith('.inertia')]\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


def test_no_accuracy_is_advised_where_none_can_be_requested(tmp_path, capsys):
    """What is printed of a bar does not name an option that inertia refuses."""
    (tmp_path / "bar.toml").write_text(BAR)
    assert (
        cli.main(
            [
                str(tmp_path / "bar.toml"),
                "--out",
                str(tmp_path / "out"),
                "--no-pictures",
                "--no-fields",
            ]
        )
        == 0
    )
    shown = " ".join(capsys.readouterr().out.split())
    assert "no estimate: solve on a finer mesh as well" in shown
    assert "--accuracy" not in shown
    rows = read_csv(tmp_path / "out" / "time_steps.csv")
    assert len(rows["time"]) == 125
    assert set(rows) == {"time", "kinetic_energy", "strain_energy", "contact_loss", "energy_error"}


def test_energies_are_drawn():
    """Over the times of all time steps, their sum first."""
    told = [(0.1, {"kinetic_energy": 2.0, "strain_energy": 1.0}), (0.2, {"other": 1.0})]
    status = np.array(["converged"])
    figure = load_steps({"status": status, "time": np.array([0.2])}, between=told)
    (axes,) = figure.axes
    assert axes.get_ylabel().startswith("energy")
    assert [line.get_label() for line in axes.get_lines()[:3]] == [
        "both",
        "kinetic energy",
        "strain energy",
    ]
    assert axes.get_lines()[0].get_xdata().tolist() == [0.1]


@pytest.mark.parametrize("spoilt", ["nothing", "displacement", "pressure", "velocity", "mass"])
def test_what_is_spoilt_is_refused(spoilt):
    """A step in contact is certified, and one of which a thousandth is wrong, or that lacks its
    mass, is not.
    """
    problem = build_problem(changed(BAR))
    state, place = problem.initial(), problem.path.place_of(0.5)
    for _ in range(5):
        earlier = state
        state, report = step(problem, earlier, place, time=earlier.time + 0.02)
    middle = 0.5 * (earlier.displacement + state.displacement)
    factor = dict.fromkeys(["displacement", "pressure", "velocity"], 1.0)
    factor |= {} if spoilt in ("nothing", "mass") else {spoilt: 1.001}
    y = report.result.displacement.copy()
    y.x.array[:] = middle * factor["displacement"]
    tractions = Tractions.of(report.result.contact)
    velocity = earlier.fields["velocity"].values * factor["velocity"]
    begun_at = earlier.with_field("velocity", "dofs", velocity)
    more = _added_forces(problem.effects, report.posed, begun_at)
    certificate = report.mechanics.certified(
        y,
        replace(tractions, pressure=factor["pressure"] * tractions.pressure),
        law=Law(*report.posed.task.promised(report.outcome)),
        step=place,
        last=begun(problem, earlier, place, earlier.time + 0.02)[2],
        rigid=(),
        more=[] if spoilt == "mass" else more,
    )
    assert certificate.holds == (spoilt == "nothing")


@pytest.mark.parametrize("spoilt", ["nothing", "displacement", "pressure", "velocity", "mass"])
def test_what_is_spoilt_of_a_nonlinear_body_is_refused(spoilt):
    """Likewise where Newton's method finds the end of a step."""
    times = {"times": (0.02 * np.arange(6)).tolist()}
    rubber = of_law("neo-hooke", young=1.0, poisson=0.0)
    problem = build_problem(changed(BAR, material=rubber, load_steps=times))
    state = problem.initial()
    for _ in range(5):
        earlier = state
        state, result = problem.step(earlier, earlier.time + 0.02)
    assert result.certificate.holds
    factor = {"displacement": 1.0, "pressure": 1.0, "velocity": 1.0, spoilt: 1.001}
    residual, solved = problem.linear.evaluated, problem._solver.solved.solved
    velocity = earlier.fields["velocity"].values * factor["velocity"]
    begun_at = earlier.with_field("velocity", "dofs", velocity)
    if spoilt == "mass":
        begun_at = replace(begun_at, fields={})
    residual.begin(begun_at, 0.02)
    at = problem.u.x.array * factor["displacement"]
    forces = residual.at(at)
    pressure = factor["pressure"] * result.contact.pressure
    tractions = replace(Tractions.of(solved.state), pressure=pressure)
    lost = round_off(residual, forces)
    certificate, _ = certified(forces, solved, lost, tractions)
    assert certificate.holds == (spoilt == "nothing")
