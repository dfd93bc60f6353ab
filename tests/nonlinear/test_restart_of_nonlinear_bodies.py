"""Checkpoints of nonlinear bodies: what goes on from there ends as what was not interrupted."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI
from support.nonlinear_bodies import Killed, held, rectangle, residual
from support.nonlinear_scenes import indented, material
from support.sliding_bodies import pillow, roller

from signorini_fx import (
    Coulomb,
    FormError,
    Foundation,
    NonlinearContactProblem,
    SceneError,
    Status,
    read_results,
    solve,
)
from signorini_fx.mechanics.contact_points.contact_table import contact_table
from signorini_fx.mechanics.statement.load_path import LoadPath
from signorini_fx.records import StepRecord
from signorini_fx.results import restart_files
from signorini_fx.results.folder import CHECKPOINT

LAWS = {"rubber": material("neo-hooke"), "metal": material("j2", yield_stress=2.0, hardening=[[0.2, 6.0]])}
METHODS = {"fp": {}, "newton": {"coulomb": "newton"}, "augmented": {"algorithm": "alm"}}
# Pressed, moved sideways and lifted by half; a wall closes in from the side and rises.
ROLL = {
    "shape": "circle",
    "centre": [0.8, 1.5],
    "radius": 0.5,
    "shift": ["max(0.1 * (min(t, 2) - 1), 0)", "-0.1 * min(t, 1) + 0.05 * max(t - 2, 0)"],
}
WALL = {"shape": "plane", "point": [2.005, 0.0], "normal": [-1.0, 0.0], "shift": ["-0.01 * t", "0.02 * t"]}


def pressed(law="rubber", steps=2, **further):
    """A block between two rough foundations that move."""
    rough = [("top", ROLL, 0.3), ("right", WALL, 0.4)]
    contact = [
        {"boundary": name, "foundation": shape, "friction": {"law": "coulomb", "coefficient": coefficient}}
        for name, shape, coefficient in rough
    ]
    steps = {"times": [1.0, 2.0, 3.0], "names": ["press", "slide", "lift"], "steps": steps}
    return indented(LAWS[law], cells=(6, 3), **({"contact": contact, "load_steps": steps} | further))


def interrupted(scene, comm, folder, at):
    """A run that ends where a load step begins."""

    def watch(record):
        if isinstance(record, StepRecord) and record.step == at:
            raise Killed

    with pytest.raises(Killed):
        solve(scene, comm, checkpoint=folder, observers=[watch])


def assert_same(solution, reference, tolerance):
    """All load steps have the same contact, on any number of ranks."""
    assert solution.converged
    assert not any("solved again" in event for event in solution.history.events)
    assert [step.linear_solves > 0 for step in solution.steps] == [step.linear_solves > 0 for step in reference.steps]
    sides = reference.statement.sides
    for ours, theirs in zip(solution.steps, reference.steps, strict=True):
        assert (ours.step, ours.place, ours.time, ours.name) == (theirs.step, theirs.place, theirs.time, theirs.name)
        assert ours.certificate.holds
        table, wanted = (contact_table(step.contact, *sides).columns for step in (ours, theirs))
        size = np.abs(wanted["pressure"]).max()
        for name in ("pressure", "shear"):
            np.testing.assert_allclose(table[name], wanted[name], rtol=0, atol=tolerance * size)
        for name in ("u_n", "u_t"):
            np.testing.assert_allclose(table[name], wanted[name], rtol=0, atol=tolerance)


def shared(tmp_path):
    """A folder that all ranks see."""
    return Path(MPI.COMM_WORLD.bcast(str(tmp_path)))


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("law", "method", "at"),
    [
        ("metal", "fp", 4),
        pytest.param("rubber", "newton", 2, marks=pytest.mark.slow),
        pytest.param("rubber", "augmented", 6, marks=pytest.mark.slow),
        pytest.param("metal", "newton", 6, marks=pytest.mark.slow),
    ],
)
def test_with_as_many_ranks(tmp_path, law, method, at):
    """Metal keeps what has flowed, friction where it began: all figures are those of the run in one go."""
    folder, scene = shared(tmp_path), pressed(law, solver=METHODS[method])
    interrupted(scene, MPI.COMM_WORLD, folder, at)
    solution, reference = solve(scene, checkpoint=folder, restart=True), solve(scene)
    assert solution.history.events[0].startswith(f"restart: {at - 1} complete load step")
    assert_same(solution, reference, 1e-8 if method == "augmented" else 1e-10)
    assert max(np.abs(step.contact.shear).max(initial=0.0) for step in solution.steps) > 0
    if method != "augmented":
        assert solution.history.linear_solves == reference.history.linear_solves


@pytest.mark.mpi
@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_from_one_rank_to_all(tmp_path, law):
    """To what the solver's tolerance leaves open."""
    folder, scene = shared(tmp_path), pressed(law)
    if MPI.COMM_WORLD.rank == 0:
        interrupted(scene, MPI.COMM_SELF, folder, 5)
    MPI.COMM_WORLD.barrier()
    solution = solve(scene, checkpoint=folder, restart=True)
    assert solution.history.events[0].startswith("restart: 4 complete load steps")
    assert_same(solution, solve(scene), 1e-8)


@pytest.mark.mpi
@pytest.mark.slow
def test_in_space(tmp_path):
    """A ball that comes to metal, is pressed into it, and is lifted as it spins: shears have two components, and turn
    with it; before, points that touch nothing slip in no direction.
    """
    ball = {
        "shape": "sphere",
        "centre": [0.5, 0.5, 2.01],
        "radius": 1.0,
        "shift": ["0.05 * max(t - 1, 0)", 0.0, "-0.06 * max(t - 1, 0) + 0.08 * max(t - 2, 0)"],
        "rotation": [0.0, 0.0, "5 * t"],
        "pivot": [0.45, 0.5, 1.0],
    }
    scene = pressed(
        "metal",
        mesh={"generator": "box", "parameters": {"nx": 4, "ny": 4, "nz": 2}},
        displacement={"boundary": "bottom", "x": 0.0, "y": 0.0, "z": 0.0},
        contact={"boundary": "top", "foundation": ball, "friction": {"law": "coulomb", "coefficient": 0.3}},
        load_steps={"times": [1.0, 2.0, 3.0]},
    )
    folder = shared(tmp_path)
    interrupted(scene, MPI.COMM_WORLD, folder, 3)
    solution = solve(scene, checkpoint=folder, restart=True)
    assert solution.history.events[0].startswith("restart: 2 complete load steps")
    assert_same(solution, solve(scene), 1e-10)
    touching = [int(np.count_nonzero(solution.at(step).table.columns["pressure"])) for step in solution.steps]
    assert touching[0] == 0 < touching[2]


@pytest.mark.one_quick
@pytest.mark.parametrize("degree", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_steps_that_were_halved(tmp_path, degree):
    """A way in which steps are halved is gone on with the steps that it has come to, also one load step alone."""

    def problem():
        space, side = rectangle([1.0, 1.0], [3, 3], MPI.COMM_SELF, degree=degree)
        u = fem.Function(space)
        walls = [held(space, side(0, 0.0), 0), held(space, side(1, 0.0), 1)]
        plate = {"shape": "plane", "point": (0.0, 1.0), "normal": (0.0, -1.0)}
        contact = Foundation(side(1, 1.0), shape=plate, friction=Coulomb(0.2))
        made = NonlinearContactProblem(residual(u), u, bcs=walls, contact=contact, max_newton=4)
        return made, lambda time: made.place(0, shift=(0.0, -0.5 * time if time <= 1 else 0.1 * time - 0.6))

    def kill(step):
        if step.step == 3:
            raise Killed

    path = LoadPath((1.0, 2.0), steps=1)
    whole, at = problem()
    begun = []
    whole.history.observers.append(lambda record: begun.append(record) if isinstance(record, StepRecord) else None)
    reference = whole.run(path, at)
    assert len(reference.steps) > 3
    assert [record.step for record in begun] == sorted(record.step for record in begun)  # again where it is halved
    ends = {record.step: record.time for record in begun}
    assert ends == {step.step: step.time for step in reference.steps}
    assert {record.step for record in whole.history.iterations} == ends.keys()
    first, at = problem()
    with pytest.raises(Killed):
        first.run(path, at, folder=tmp_path, on_step=kill)
    again, at = problem()
    solution = again.run(path, at, folder=tmp_path, restart=True)
    assert again.history.events[0].startswith("restart: 2 complete load steps")
    assert [step.time for step in solution.steps] == [step.time for step in reference.steps]
    assert [step.linear_solves for step in solution.steps] == [step.linear_solves for step in reference.steps]
    assert np.abs(again.u.x.array - whole.u.x.array).max() < 1e-10
    assert again.history.events[1:] == whole.history.events
    assert again.state.pressure == pytest.approx(whole.state.pressure, abs=1e-10 * whole.state.pressure.max())


def test_a_tangent_that_is_not_symmetric(tmp_path):
    """A pressure follows the body: what is recalled says once that it is factorised as LU."""
    scene = pressed(steps=None, traction={"boundary": "left", "pressure": 2.0})
    interrupted(scene, MPI.COMM_SELF, tmp_path, 3)
    solution, reference = solve(scene, MPI.COMM_SELF, checkpoint=tmp_path, restart=True), solve(scene, MPI.COMM_SELF)
    assert_same(solution, reference, 1e-10)
    assert solution.history.events[1:] == reference.history.events
    assert sum("not symmetric" in event for event in reference.history.events) == 1


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
def test_two_bodies(tmp_path, dimension):
    """They go on to slide over the facets where they were."""

    def made():
        if dimension == 2:
            bodies = roller(ratio=10.0, cells=(16, 4), around=10, friction=Coulomb(0.3))
        else:
            bodies = pillow("tetrahedron", lower=(8, 6, 1), upper=(4, 4, 1), ratio=10.0, friction=Coulomb(0.3))

        def at(time):
            bodies.drive.value[0], bodies.drive.value[-1] = 0.2 * max(time - 1, 0), -0.1 * min(time, 1)

        return bodies.problem, at

    def kill(step):
        if step.step == 4:
            raise Killed

    def end(problem):
        return np.concatenate((problem.u.x.array, problem.state.pressure, problem.state.shear.ravel()))

    times = (0.5, 1.0, 1.5, 2.0, 2.5)
    whole, at = made()
    whole.run(times, at)
    first, at = made()
    with pytest.raises(Killed):
        first.run(times, at, folder=tmp_path, on_step=kill)
    again, at = made()
    again.run(times, at, folder=tmp_path, restart=True)
    assert again.history.events[0].startswith("restart: 3 complete load steps")
    assert not any("solved again" in event for event in again.history.events)
    assert end(again) == pytest.approx(end(whole), abs=1e-10 * np.abs(end(whole)).max())


def test_another_scene_is_refused(tmp_path):
    """By what differs, before anything is solved; so is a folder of another problem of forms."""
    interrupted(pressed(), MPI.COMM_SELF, tmp_path, 2)
    stiffer = pressed(material=LAWS["rubber"] | {"young": 110.0})
    with pytest.raises(SceneError, match=r"material\[0\].*: was .* in the run to go on from") as refused:
        solve(stiffer, MPI.COMM_SELF, checkpoint=tmp_path, restart=True)
    assert "solve without restart" in str(refused.value)
    space, side = rectangle([1.0, 1.0], [2, 2], MPI.COMM_SELF)
    u = fem.Function(space)
    problem = NonlinearContactProblem(residual(u), u, contact=Foundation(side(1, 0.0)))
    with pytest.raises(FormError, match="restart: needs the folder"):
        problem.run((1.0,), lambda time: None, restart=True)
    with pytest.raises(FormError, match="in the run to go on from"):
        problem.run((1.0,), lambda time: None, folder=tmp_path, restart=True)


@pytest.mark.one_quick
@pytest.mark.parametrize("wrong", ["solution.bin", "tangent.bin", "certificate"])
def test_what_is_damaged_is_solved_again(tmp_path, wrong, monkeypatch):
    """A file that lacks a digit, and a load step that is no solution: it and all later ones."""
    scene = pressed(steps=None)
    interrupted(scene, MPI.COMM_SELF, tmp_path, 3)
    folder = tmp_path / CHECKPOINT / "0-00001"
    if wrong == "certificate":  # all digests fit, the displacement does not
        values = np.fromfile(folder / "solution.bin")
        (1.001 * values).tofile(folder / "solution.bin")
        figures = json.loads((folder / "figures.json").read_text())
        figures.pop("files")
        figures["files"] = restart_files._digests(folder, figures)
        (folder / "figures.json").write_text(json.dumps(figures))
    else:
        content = bytearray((folder / wrong).read_bytes())
        content[100] ^= 1
        (folder / wrong).write_bytes(content)
    solution = solve(scene, MPI.COMM_SELF, checkpoint=tmp_path, restart=True)
    said = "load step 2: certificate does not hold: it is solved again" if wrong == "certificate" else "damaged"
    assert any(said in event for event in solution.history.events)
    reference = solve(scene, MPI.COMM_SELF)
    assert solution.displacement.x.array == pytest.approx(reference.displacement.x.array, abs=1e-10)


@pytest.mark.slow
def test_a_path_that_ended(tmp_path):
    """What had no solution has none after a restart, with the same load steps before."""
    down = {"shape": "plane", "point": [0.0, 1.0], "normal": [0.0, -1.0], "shift": [0.0, "-0.4*t"]}
    scene = pressed(contact={"boundary": "top", "foundation": down}, load_steps={"times": [1.0, 2.0, 3.0]})
    scenes = [solve(scene, MPI.COMM_SELF, check=False, checkpoint=tmp_path, restart=again) for again in (False, True)]
    first, second = scenes
    assert first.status is second.status
    assert first.status is not Status.CONVERGED
    assert [step.time for step in first.steps] == [step.time for step in second.steps]
    assert np.abs(first.displacement.x.array - second.displacement.x.array).max() < 1e-10


KILL = """
import os, signal, sys
from mpi4py import MPI
from signorini_fx import solve
from signorini_fx.records import StepRecord

def kill(record):
    if isinstance(record, StepRecord) and record.step == 3:
        MPI.COMM_WORLD.barrier()
        os.kill(os.getpid(), signal.SIGKILL)

solve(sys.argv[1], checkpoint=sys.argv[2], observers=[kill])
"""
FILE = """
mesh = { generator = "rectangle", parameters = { length = 2.0, nx = 6, ny = 3 } }
material = { law = "j2", young = 100.0, poisson = 0.3, yield_stress = 2.0, hardening = [[0.2, 6.0]] }
displacement = { boundary = "bottom", x = 0.0, y = 0.0 }
load_steps = { times = [1.0, 2.0, 3.0], steps = 2 }
[contact]
boundary = "top"
friction = { law = "coulomb", coefficient = 0.3 }
[contact.foundation]
shape = "circle"
centre = [0.8, 1.5]
radius = 0.5
shift = ["max(0.1 * (min(t, 2) - 1), 0)", "-0.1 * min(t, 1) + 0.05 * max(t - 2, 0)"]
"""


def run(ranks, *arguments):
    """A Python process on several ranks: how it ends, and what it prints."""
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    own = {name: value for name, value in os.environ.items() if not name.startswith(("OMPI_COMM", "PMIX"))}
    command = [*launcher, sys.executable, *map(str, arguments)]
    return subprocess.run(command, env=own, capture_output=True, text=True, timeout=500, check=False)


@pytest.mark.slow
@pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="starts ranks itself")
def test_killed(tmp_path):
    """With -9, and restarted by the command line on two ranks: the table of load steps is that of a run in one go."""
    file, out = tmp_path / "scene.toml", tmp_path / "out"
    file.write_text(FILE)
    assert run(1, "-c", KILL, file, out).returncode == -signal.SIGKILL
    command = ("-m", "signorini_fx", "solve", file, "--no-pictures", "--no-fields", "--out")
    ended = run(2, *command, out, "--restart", "--verbose")
    assert ended.returncode == 0, ended.stderr
    assert "restart 2 complete load steps" in " ".join(ended.stdout.split())
    assert not (out / CHECKPOINT).exists()
    assert run(1, *command, tmp_path / "whole").returncode == 0
    ours, theirs = (read_results(folder).summary.steps for folder in (out, tmp_path / "whole"))
    for one, other in zip(ours, theirs, strict=True):
        assert (one.time, one.status) == (other.time, other.status)
        for name in ("contact_force_x", "contact_force_y", "friction_force_x", "max_pressure"):
            assert getattr(one, name) == pytest.approx(getattr(other, name), rel=1e-7, abs=1e-9)
