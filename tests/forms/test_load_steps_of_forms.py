"""``ContactProblem.run``: the load steps, ramps and restarts of scenes, for forms of the user's own."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from runpy import run_path

import forms
import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from support.nonlinear_bodies import PLATE, held, rectangle, residual
from test_load_steps import FRICTION, LIMIT, PRESSURE
from test_ramp import ramp

from signorini_fx import (
    ContactProblem,
    ConvergenceError,
    Coulomb,
    FormError,
    Foundation,
    LoadPath,
    NonlinearContactProblem,
    solve,
)
from signorini_fx.records import Status
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_WORLD
GAMMA = {"gamma_n": 1e6, "gamma_t": 1e6}


def block(mesh, pushing=0.0, young=5000.0, friction=FRICTION, **settings):
    """The block of ``test_load_steps``, and the Constant with the force that pushes it on its left side."""
    V = fem.functionspace(mesh, ("Lagrange", 1, (2,)))
    u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
    facets = [forms.side(mesh, axis, at) for axis, at in ((0, 0.0), (1, 1.0), (1, 0.0))]
    numbers, marks = np.concatenate(facets[:2]), np.repeat([1, 2], [part.size for part in facets[:2]]).astype(np.int32)
    order = np.argsort(numbers)
    ds = ufl.ds(domain=mesh, subdomain_data=dmesh.meshtags(mesh, 1, numbers[order], marks[order]))
    push = fem.Constant(mesh, pushing)
    L = push * v[0] * ds(1) - PRESSURE * v[1] * ds(2)
    floor = Foundation(facets[2], friction=Coulomb(friction))
    return ContactProblem(forms.hooke(u, v, young), L, [], floor, **GAMMA, **settings), push


@pytest.mark.one_quick
@pytest.mark.mpi
@pytest.mark.parametrize("steps", [None, 3])
def test_a_path_is_a_loop(steps):
    """Its steps are those of ``solve`` and ``advance``, to the last bit."""
    mesh, times = forms.box((3.0, 1.0), (9, 3)), [0.0, 0.4, 0.8, -0.4]
    problem, push = block(mesh)

    def at(time):
        push.value = LIMIT * np.interp(time, range(4), times)

    solved = problem.run(LoadPath(range(4), ("press", "push", "on", "back"), steps=steps), at)
    at_times = [(step.time, step.name) for step in solved.steps if step.time == int(step.time)]
    assert at_times == list(enumerate(("press", "push", "on", "back")))
    assert solved.converged
    by_hand, push = block(mesh)
    for step in solved.steps:
        at(step.time)
        y = by_hand.solve()
        by_hand.advance()
        np.testing.assert_array_equal(step.displacement.x.array, y.x.array)
        np.testing.assert_array_equal(step.contact.shear, by_hand.state.shear)
    assert problem.history.linear_solves == by_hand.history.linear_solves == sum(s.linear_solves for s in solved.steps)
    np.testing.assert_array_equal(problem.u.x.array, y.x.array)


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.parametrize("settings", [{}, {"algorithm": "alm"}], ids=["ssn", "alm"])
def test_a_ramp_is_that_of_a_scene(settings):
    """The same increments, limit load and linear solves; the problem goes on from the last solution."""
    scene = ramp(1.2, nx=12, **GAMMA, **settings)
    solution = solve(scene, COMM, check=False)
    problem, push = block(solution.model.tagged.mesh, **settings)

    def at(time):
        push.value = 1.2 * LIMIT * time

    with pytest.raises(ConvergenceError, match=r"there is a solution at time 0\.8") as error:
        problem.run(LoadPath((0.0, 1.0), steps=10), at)
    solved = error.value.solution
    assert [(step.time, step.status) for step in solved.steps] == [(s.time, s.status) for s in solution.steps]
    assert (solved.status, problem.status) == (Status.SLIDES, Status.SLIDES)
    assert solved.history.linear_solves == solution.history.linear_solves
    assert solved.history.events == solution.history.events
    scale = np.abs(solution.displacement.x.array).max()
    assert np.abs(solved.last_step.displacement.x.array - solution.displacement.x.array).max() <= 1e-9 * scale
    at(solved.last_step.time)
    problem.solve()
    assert abs(-problem.state.forces[1][0] - push.value) <= 1e-6 * LIMIT


@pytest.mark.slow
@pytest.mark.parametrize("settings", [{}, {"algorithm": "alm"}], ids=["ssn", "alm"])
def test_slip_of_the_first_time_is_that_of_a_scene(settings):
    """A circle that moves from where it is given, of which the first time is not 0: what it has moved until then is
    slip, of scenes, forms, and forms that are solved one by one.  All of the contact slides: friction is F times the
    pressure, and against the motion of the circle in the first step already.
    """
    times, circle = (0.4, 0.6, 0.8, 1.0), {"shape": "circle", "centre": [0.5, 1.3], "radius": 0.3}
    sides, centre = {"length": 1.0, "height": 1.0, "nx": 8, "ny": 8, "cell": "quadrilateral"}, (0.05, -0.02)
    law = {"law": "coulomb", "coefficient": 0.4}
    scene = parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": sides},
            "material": {"young": 100.0, "poisson": 0.3},
            "displacement": {"boundary": "bottom", "x": 0.0, "y": 0.0, "factors": [1.0] * 4},
            "contact": {
                "boundary": "top",
                "foundation": circle | {"shift": [f"{v} * t" for v in centre]},
                "friction": law,
            },
            "load_steps": {"times": times},
            "solver": {**GAMMA, **settings},
        }
    )
    solution = solve(scene, check=False)
    expected = [step.contact.forces_of_each[0] for step in solution.steps]
    for pressed, friction in expected:
        assert friction[0] > 0.3 * abs(pressed[1]) > 0.0
    mesh = forms.box((1.0, 1.0), (8, 8), dmesh.CellType.quadrilateral)
    V = fem.functionspace(mesh, ("Lagrange", 1, (2,)))
    u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
    held = fem.dirichletbc(np.zeros(2), fem.locate_dofs_topological(V, 1, forms.side(mesh, 1, 0.0)), V)
    tool = Foundation(forms.side(mesh, 1, 1.0), shape=circle, friction=Coulomb(0.4))

    def problem():
        return ContactProblem(
            forms.hooke(u, v, 100.0),
            ufl.inner(fem.Constant(mesh, (0.0, 0.0)), v) * ufl.dx,
            [held],
            tool,
            **GAMMA,
            **settings,
        )

    def shift(time):
        return [component * time for component in centre]

    by_run = problem()
    steps = by_run.run(times, lambda t: by_run.place(0, shift=shift(t))).steps
    for step, force in zip(steps, expected, strict=True):
        assert step.contact.forces_of_each[0] == pytest.approx(force, rel=1e-7)
    by_hand = problem()
    for time, force in zip(times, expected, strict=True):
        for tried in (1.1 * time, time):  # what was tried before does not count
            by_hand.place(0, shift=shift(tried))
            by_hand.solve()
        by_hand.advance()
        assert by_hand.state.forces_of_each[0] == pytest.approx(force, rel=1e-7)
        assert by_hand.certificate.holds


def test_limit_load():
    """Statics: the block slides at the coefficient times its weight, which the ramp encloses to 1 %."""
    found = run_path(str(Path(__file__).parents[2] / "demos" / "forms" / "limit_load.py"))
    assert 0.99 * 18.0 <= found["limit"] <= 18.0


# A program that is killed in its fourth load step, where a second argument says so.
PROGRAM = """
import os, signal, sys
import numpy as np
from mpi4py import MPI
import forms
from test_load_steps_of_forms import LIMIT, block

problem, push = block(forms.box((3.0, 1.0), (9, 3)))

def at(time):
    push.value = LIMIT * np.interp(time, range(6), [0.0, 0.4, 0.8, 0.2, -0.4, -0.8])

def kill(step):
    if step.step == 4 and sys.argv[2] == "kill":
        MPI.COMM_WORLD.barrier()
        os.kill(os.getpid(), signal.SIGKILL)

solved = problem.run(range(6), at, folder=sys.argv[1], restart=sys.argv[2] == "restart", on_step=kill)
if MPI.COMM_WORLD.rank == 0:
    print([event for event in problem.history.events if "restart" in event])
np.save(f"{sys.argv[1]}/{sys.argv[2]}.npy", [problem.state.forces[1][0], float(problem.history.linear_solves)])
"""


def program(ranks, folder, what):
    """How the program ends on several ranks, and what it prints."""
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    alone = {name: value for name, value in os.environ.items() if not name.startswith(("OMPI_COMM", "PMIX"))}
    alone["PYTHONPATH"] = os.pathsep.join(map(str, [Path(__file__).parent, *sys.path]))
    command = [*launcher, sys.executable, "-c", PROGRAM, str(folder), what]
    return subprocess.run(command, env=alone, capture_output=True, text=True, timeout=500, check=False)


@pytest.mark.skipif(COMM.size > 1, reason="starts ranks itself")
def test_a_killed_program_goes_on(tmp_path):
    """Killed with -9 and restarted on two ranks, it solves what is missing, and ends as one that was not."""
    assert program(1, tmp_path, "kill").returncode == -signal.SIGKILL
    ended = program(2, tmp_path, "restart")
    assert ended.returncode == 0, ended.stderr
    assert "restart: 3 complete load steps" in ended.stdout
    assert program(1, tmp_path, "whole").returncode == 0
    again, whole = (np.load(tmp_path / f"{name}.npy") for name in ("restart", "whole"))
    np.testing.assert_allclose(again, whole, rtol=1e-8)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((), print), "times"),
        (((1.0,), 3.0), "function of the time"),
        (((1.0,), "push"), "function of the time"),
    ],
)
def test_bad_paths_of_forms(arguments, message):
    problem, _ = block(forms.box((3.0, 1.0), (3, 1)))
    with pytest.raises(FormError, match=message):
        problem.run(*arguments)
    with pytest.raises(FormError, match="folder"):
        problem.run((1.0,), print, restart=True)


def test_another_problem(tmp_path):
    """A folder of another problem is refused, with what differs."""
    problem, push = block(forms.box((3.0, 1.0), (3, 1)))
    problem.run((1.0, 2.0), push, folder=tmp_path)
    finer, push = block(forms.box((3.0, 1.0), (6, 2)))
    with pytest.raises(FormError, match="cells: was 6"):
        finer.run((1.0, 2.0), push, folder=tmp_path, restart=True)
    problem, push = block(forms.box((3.0, 1.0), (3, 1)))
    solved = problem.run((1.0, 2.0), push, folder=tmp_path, restart=True)
    assert "restart: 2 complete load steps" in solved.history.events[0]


@pytest.mark.parametrize("nonlinear", [False, True])
def test_each_run_has_its_folder(tmp_path, monkeypatch, nonlinear):
    """A second run does not replace the load steps of the first, however the folder is written: with folders of their
    own a restart of the whole program goes on from both.
    """

    def program(*, restart):
        if nonlinear:
            space, side = rectangle([1.0, 1.0], [2, 2], MPI.COMM_SELF)
            u = fem.Function(space)
            plate = Foundation(side(1, 1.0), shape=PLATE)
            problem = NonlinearContactProblem(residual(u), u, bcs=[held(space, side(1, 0.0))], contact=plate)

            def push(time):
                problem.place(0, shift=(0.0, -0.05 * time))
        else:
            problem, push = block(forms.box((3.0, 1.0), (3, 1)))
        problem.run((1.0, 2.0), push, folder=tmp_path / "first", restart=restart)
        if not nonlinear:
            problem.advance()
        with pytest.raises(FormError, match=r"folder: first has the load steps of another run of this problem: give"):
            problem.run((3.0,), push, folder="first")
        problem.run((3.0,), push, folder=tmp_path / "second", restart=restart)
        return problem

    monkeypatch.chdir(tmp_path)
    program(restart=False)
    again = program(restart=True)
    counted = [event.partition(" complete")[0] for event in again.history.events if "restart" in event]
    assert counted == ["restart: 2", "restart: 1"]


@pytest.mark.parametrize("of", ["young", "friction"])
def test_constants_that_hardly_differ(tmp_path, of):
    """A Constant that has changed by 1e-9 makes another problem; one that ``at`` moves does not."""

    def made(change):
        mesh = forms.box((3.0, 1.0), (3, 1))
        values = {"young": 5000.0, "friction": FRICTION}
        values[of] *= 1 + change
        return block(mesh, **{name: fem.Constant(mesh, value) for name, value in values.items()})

    problem, push = made(0.0)
    problem.run((1.0, 2.0), push, folder=tmp_path)
    problem, push = made(0.0)
    assert "2 complete load steps" in problem.run((1.0, 2.0), push, folder=tmp_path, restart=True).history.events[0]
    problem, push = made(1e-9)
    with pytest.raises(FormError, match="constants"):
        problem.run((1.0, 2.0), push, folder=tmp_path, restart=True)
