"""Checkpoints: a run that is killed goes on from its last complete load step or mesh, on any number
of ranks.
"""

import csv
import os
import re
import signal
import subprocess
import sys
import tomllib

import numpy as np
import pytest
from mpi4py import MPI
from numpy.testing import assert_allclose
from parameters import slow
from ranks import shared
from scenes import alone

from signorini_fx.errors import SceneError
from signorini_fx.records import StepRecord
from signorini_fx.results.files import write_results
from signorini_fx.results.folder import CHECKPOINT
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

PUSHED = """
title = "block, pressed and pushed"
mesh = { generator = "rectangle", parameters = { length = 3.0, nx = 24, ny = 8 } }
material = { young = 5000.0, poisson = 0.3 }
[[traction]]
boundary = "top"
y = -20.0
[[traction]]
boundary = "top"
x = 4.0
factors = [0.0, 0.4, 0.8, 1.0, 0.5, -0.4]
[[contact]]
boundary = "bottom"
gap = "0.002 + 1e-4 * (x[0] - 1.5)**2"
friction = { law = "coulomb", coefficient = 0.3 }
"""
MIXED = '[element]\ndegree = 2\nvolumetric = "mixed"\n'
NESTED = """
mesh = { generator = "rectangle", parameters = { length = 3.0, nx = 64, ny = 16 } }
material = { young = 5000.0, poisson = 0.3 }
solver = { levels = 3 }
[[displacement]]
boundary = "top"
x = 0.002
y = -0.01
[[contact]]
boundary = "bottom"
gap = "0.002 * (x[0] - 1.5)**2"
friction = { law = "coulomb", coefficient = 0.3 }
"""
# A block of which one side is held along x, pushed along y, so that both tangents carry shear.
IN_SPACE = """
mesh = { generator = "box", parameters = { nx = 4, ny = 4, nz = 3 } }
material = { young = 5000.0, poisson = 0.3 }
[[displacement]]
boundary = "top"
x = 0.001
y = 0.0005
z = -0.004
factors = [0.3, 0.6, 0.8, 1.0]
[[contact]]
boundary = "bottom"
friction = { law = "coulomb", coefficient = 0.3 }
"""
# A solid body of revolution that is pressed and turned.
TWISTED = """
mesh = { generator = "rectangle", parameters = { length = 1.0, nx = 6, ny = 3 } }
material = { young = 5000.0, poisson = 0.3, hypothesis = "axisymmetric", torsion = true }
[[displacement]]
boundary = "top"
y = -0.01
rotation = 0.02
axis = [0.0, 1.0]
factors = [0.3, 0.6, 0.8, 1.0]
[[contact]]
boundary = "bottom"
friction = { law = "coulomb", coefficient = 0.3 }
"""
# It comes to rest by a motion that has a component along the foundation.
SLANTED = """
mesh = { generator = "rectangle", parameters = { length = 3.0, nx = 18, ny = 6 } }
material = { young = 5000.0, poisson = 0.3 }
[[displacement]]
boundary = "left"
x = 0.0
[[traction]]
boundary = "top"
y = -20.0
factors = [0.5, 0.8, 1.0, 0.6]
[[contact]]
boundary = "bottom"
gap = 0.01
direction = [0.2, -1.0]
friction = { law = "coulomb", coefficient = 0.1 }
"""
# A block between the ground, to which it drops, and a plate that forces move.
TOOL = """
mesh = { generator = "rectangle", parameters = { length = 3.0, nx = 18, ny = 6 } }
material = { young = 5000.0, poisson = 0.3 }
load_steps = { times = [1.0, 2.0, 3.0] }
[[contact]]
boundary = "bottom"
gap = 0.01
friction = { law = "coulomb", coefficient = 0.3 }
[[contact]]
boundary = "top"
foundation = { shape = "plane", point = [0.0, 1.0], normal = [0.0, -1.0], pivot = [1.4, 1.0], force = ["t - 1", "-20"] }
friction = { law = "coulomb", coefficient = 0.4 }
"""
# A roll that is shifted along a block and turned.
MOVING = """
mesh = { generator = "rectangle", parameters = { length = 3.0, nx = 24, ny = 8 } }
material = { young = 5000.0, poisson = 0.3 }
load_steps = { times = [1.0, 2.0, 3.0] }
[[displacement]]
boundary = "bottom"
x = 0.0
y = 0.0
[[contact]]
boundary = "top"
friction = { law = "coulomb", coefficient = 0.3 }
[contact.foundation]
shape = "circle"
centre = [1.4, 2.99]
radius = 2.0
shift = ["0.05 * (t - 1)", "-0.002 * t"]
rotation = "0.03 * (t - 1)"
"""
# A ball that is pressed into a block, shifted, and turned about an axis through its centre;
# friction has a direction.
SPINNING = """
mesh = { generator = "box", parameters = { length = 2.0, width = 2.0, height = 1.0, nx = 6, ny = 6, nz = 3 } }
material = { young = 5000.0, poisson = 0.3 }
load_steps = { times = [1.0, 2.0, 3.0] }
[[displacement]]
boundary = "bottom"
x = 0.0
y = 0.0
z = 0.0
[[contact]]
boundary = "top"
friction = { law = "coulomb", coefficient = 0.3, ratio = 0.4, along = [0.8, 0.6, 0.0] }
[contact.foundation]
shape = "sphere"
centre = [0.9, 1.0, 3.98]
radius = 3.0
shift = ["0.02 * (t - 1)", 0.0, "-0.01 * t"]
rotation = [0.0, "0.2 * (t - 1)", "2 * (t - 1)"]
pivot = [0.9, 1.0, 3.98]
"""
# A block that is pressed and pulled off its bond, obliquely, and rubs where this is broken.
TORN = """
mesh = { generator = "rectangle", parameters = { length = 3.0, nx = 18, ny = 4 } }
material = { young = 5000.0, poisson = 0.3 }
[[traction]]
boundary = "top"
pressure = 2.0
[[displacement]]
boundary = "left"
x = 0.02
y = 0.01
factors = [0.5, 1.0, 1.5, 1.2]
[[contact]]
boundary = "bottom"
friction = { law = "coulomb", coefficient = 0.3 }
cohesion = { strength = 8.0, energy = 0.1, shear_strength = 10.0, shear_energy = 0.3, exponent = 2.0 }
"""
TORN_IN_SPACE = (
    TORN.replace("rectangle", "box")
    .replace("nx = 18, ny = 4", "nx = 6, ny = 3, nz = 3")
    .replace("y = 0.01", "y = 0.01\nz = 0.01")
)
HEATED = """
load_steps = { times = [1.0, 2.0, 3.0, 4.0] }
[[material]]
region = "lower"
young = 5000.0
poisson = 0.3
expansion = 1e-5
conductivity = 2.0
[[material]]
region = "upper"
young = 3000.0
poisson = 0.3
expansion = 2e-5
conductivity = 1.0
[[body]]
name = "lower"
mesh = { generator = "rectangle", parameters = { length = 3.0, height = 1.0, nx = 9, ny = 3 } }
[[body]]
name = "upper"
mesh = { generator = "rectangle", parameters = { length = 2.0, height = 1.0, nx = 8, ny = 4 } }
shift = [0.5, 1.0]
[[displacement]]
boundary = "lower.bottom"
x = 0.0
y = 0.0
[[displacement]]
boundary = "upper.top"
x = "0.01*t"
y = -0.02
[[heat]]
boundary = "upper.top"
temperature = "50*t"
[[heat]]
boundary = "lower.bottom"
film = 2.0
ambient = 20.0
[[contact]]
boundary = "upper.bottom"
against = "lower.top"
conductance = { closed = 0.1, exponent = 0.9, open = 0.01, length = 0.01 }
friction_heat = { share = 0.3 }
friction = { law = "coulomb", coefficient = 0.3 }
"""
METHODS = {
    "fp": {},
    "newton": {"coulomb": "newton"},
    "alm": {"algorithm": "alm"},
    "continuation": {"algorithm": "continuation"},
    "path-following": {"algorithm": "path-following"},
    "full": {"linear_algebra": "full"},
    "krylov": {"linear_algebra": "krylov"},
    "two gammas": {"gamma_n": 1e7, "gamma_t": 2e6},
}


class Killed(Exception):
    """The end of a run in these tests."""


def scene(text, **solver):
    data = tomllib.loads(text)
    data["solver"] = data.get("solver", {}) | solver
    return parse_scene(data)


def until(step):
    """An observer that ends the run where a load step begins, or a mesh."""

    def watch(record):
        if (isinstance(record, StepRecord) and record.step == step) or record == f"level {step}":
            raise Killed

    return watch


def interrupted(scene, comm, folder, step):
    """A run that ends where a load step or a mesh begins; what is complete before is in the
    folder.
    """
    with pytest.raises(Killed):
        solve(scene, comm, checkpoint=folder, observers=[until(step)])


def assert_same(solution, reference, tolerance=1e-8):
    """Every load step has the same contact state, on any number of ranks of the first."""
    assert [step.status for step in solution.steps] == [step.status for step in reference.steps]
    for one, other in zip(solution.steps, reference.steps, strict=True):
        assert (one.step, one.place, one.time) == (other.step, other.place, other.time)
        assert one.certificate.holds
        for ours, theirs in zip(one.contact.forces, other.contact.forces, strict=True):
            assert_allclose(
                ours, theirs, rtol=0, atol=tolerance * np.abs(other.contact.forces_of_each).max()
            )
        found, wanted = (
            np.array([[*tool.translation, *tool.rotation] for tool in result.rigid_bodies])
            for result in (one, other)
        )
        assert_allclose(found, wanted, rtol=0, atol=tolerance * np.abs(wanted).max(initial=0.0))
    ours, theirs = solution.table.columns, reference.table.columns
    assert (ours["state"] == theirs["state"]).all()
    assert (ours["friction"] == theirs["friction"]).all()
    for name, like in (("pressure", "pressure"), ("shear", "pressure"), ("u_n", "u_n")):
        assert_allclose(
            ours[name], theirs[name], rtol=0, atol=tolerance * np.abs(theirs[like]).max()
        )


ELLIPSE = IN_SPACE.replace(
    "coefficient = 0.3", "coefficient = 0.3, ratio = 0.4, along = [0.8, 0.6, 0.0]"
)
SEEPING = PUSHED.replace("1e-4 * (x[0] - 1.5)**2", "where(x[0] < 0.4, 0.01, 0)")
SEEPING += 'seeping = { pressure = "t", side = "left" }\n'
STORES = "density = 2.0\nspecific_heat = 3.0\n"
# A scene, its method, and the step that is not begun any more.
IN_TIME = PUSHED.replace("coefficient = 0.3", 'coefficient = "0.3 + 0.01 * t"')
CASES = {
    "friction in time": (IN_TIME, "fp", 4),
    **{method: (PUSHED, method, 4) for method in METHODS},
    # Displacements are kept from the initial position, not from where the body came to rest.
    "reference motion": (SLANTED, "fp", 4),
    "reference motion, newton": (SLANTED, "newton", 4),
    # Directions of slip are kept as vectors, which do not depend on the choice of tangents.
    "space": (IN_SPACE, "fp", 3),
    "space, newton": (IN_SPACE, "newton", 3),
    "ellipse": (ELLIPSE, "fp", 3),
    "torsion": (TWISTED, "fp", 3),
    # By forces, where their motion is stored too, or with the time, where each load step has its
    # own problem.
    "tool": (TOOL, "full", 3),
    "tool, alm": (TOOL, "alm", 3),
    # What is worn, and the slip that wears it.
    "wear": (f"{PUSHED}wear.coefficient = 1e-5\n", "fp", 4),
    # Which points a fluid has reached.
    "seeping": (SEEPING, "fp", 4),
    "mixed": (PUSHED.replace("nx = 24", "nx = 12") + MIXED, "fp", 4),
    "moving": (MOVING, "fp", 3),
    "spinning": (SPINNING, "fp", 3),
    # The temperature, and that from which the turns of contact and heat begin.
    "heated": (HEATED, "newton", 3),
    "warming": (HEATED.replace("expansion", STORES + "expansion"), "newton", 3),
    "torn": (TORN, "fp", 3),
    "torn, newton": (TORN, "newton", 3),
    "torn in space": (TORN_IN_SPACE, "newton", 3),
    "spinning, alm": (SPINNING, "alm", 3),
}


@pytest.mark.mpi(slow=True)
@pytest.mark.parametrize(
    "name",
    [
        name
        if name in ("fp", "tool", "torn", "wear", "heated", "warming", "seeping")
        else slow(name)
        for name in CASES
    ],
)
def test_from_one_rank_to_all(tmp_path, name):
    """Begun on one rank and ended on all of them, load steps are those of an uninterrupted run."""
    text, method, step = CASES[name]
    folder, given = shared(tmp_path), scene(text, **METHODS[method])
    if MPI.COMM_WORLD.rank == 0:
        interrupted(given, MPI.COMM_SELF, folder, step)
    MPI.COMM_WORLD.barrier()
    solution, reference = solve(given, checkpoint=folder, restart=True), solve(given)
    steps = "1 complete load step" if step == 2 else f"{step - 1} complete load steps"
    assert solution.history.events[0] == f"restart: {steps} in {folder / CHECKPOINT}"
    assert not any("solved again" in event for event in solution.history.events)
    assert_same(solution, reference)
    if MPI.COMM_WORLD.size == 1 and "times" in text:
        assert solution.history.linear_solves == reference.history.linear_solves


def a_ramp(push, **solver):
    """Pressed in full, then pushed up to so many times what friction can hold, in eight increments
    to begin with.
    """
    text = PUSHED.replace("x = 4.0", f"x = {push * 6.0}").replace(
        "[0.0, 0.4, 0.8, 1.0, 0.5, -0.4]", "[0.0, 1.0]"
    )
    data = tomllib.loads(text)
    return parse_scene({**data, "solver": solver, "load_steps": {"steps": 8}})


@pytest.mark.mpi(slow=True)
@pytest.mark.one_quick("push", [0.9, 1.3])
@pytest.mark.parametrize("method", [{"gamma_n": 1e7, "gamma_t": 2e6}, {"algorithm": "alm"}])
def test_a_ramp(tmp_path, push, method):
    """It takes the load steps that it would have taken, with the same linear solves, and ends at
    the same load.
    """
    folder, given = shared(tmp_path), a_ramp(push, **method)
    for step in (3, 5):
        if MPI.COMM_WORLD.rank == 0:
            with pytest.raises(Killed):
                alone(given, checkpoint=folder, restart=step > 3, observers=[until(step)])
        MPI.COMM_WORLD.barrier()
    solution, reference = (
        solve(given, checkpoint=folder, restart=True, check=False),
        solve(given, check=False),
    )
    assert solution.status is reference.status
    for one, other in zip(solution.steps, reference.steps, strict=True):
        assert (one.step, one.place, one.status) == (other.step, other.place, other.status)
        assert one.linear_solves == other.linear_solves
        ours, theirs = one.contact.forces, other.contact.forces
        assert_allclose(ours, theirs, rtol=0, atol=1e-7 * np.abs(theirs).max())
    assert solution.parameters == pytest.approx(reference.parameters)


@pytest.mark.slow
@pytest.mark.mpi(slow=True)
@pytest.mark.parametrize("method", ["fp", "krylov"])
def test_meshes(tmp_path, method):
    """Of a nested iteration the complete meshes are kept, and the convergence table has a row with
    all errors for each.
    """
    folder, given = shared(tmp_path), scene(NESTED, **METHODS[method])
    interrupted(given, MPI.COMM_WORLD, folder, 2)
    solution = solve(given, checkpoint=folder, restart=True)
    assert solution.history.events[0] == f"restart: 2 complete load steps in {folder / CHECKPOINT}"
    reference = solve(given)
    assert_same(solution, reference)
    assert solution.history.linear_solves == reference.history.linear_solves
    for ours, theirs in zip(solution.convergence_table, reference.convergence_table, strict=True):
        assert ours.dofs == theirs.dofs
        assert ours.linear_solves == theirs.linear_solves
        assert ours.energy == pytest.approx(theirs.energy, rel=1e-6)
        assert ours.regularisation == pytest.approx(theirs.regularisation, rel=1e-3)


def broken(folder, what):
    """Damage the last of three load steps, or the scene."""
    step = folder / CHECKPOINT / "0-00002"
    if what == "removed":
        (step / "state.npz").unlink()
    elif what == "figures":
        (step / "figures.json").write_text('{"place": {')
    elif what == "scene":
        (folder / CHECKPOINT / "scene.json").write_text("{")
    else:
        file = step / "state.npz"
        file.write_bytes(file.read_bytes()[:-100])


@pytest.mark.one_quick("what", ["removed", "figures", "state", "scene"])
def test_truncated(tmp_path, what):
    """A load step that is not whole is solved again."""
    given = scene(PUSHED)
    interrupted(given, MPI.COMM_SELF, tmp_path, 4)
    broken(tmp_path, what)
    solution = alone(given, checkpoint=tmp_path, restart=True)
    assert solution.history.events[0].startswith("restart: 0 " if what == "scene" else "restart: ")
    assert_same(solution, alone(given))


def test_the_certificate_judges(tmp_path):
    """A whole checkpoint with a wrong displacement is not believed."""
    given = scene(PUSHED)
    interrupted(given, MPI.COMM_SELF, tmp_path, 4)
    files = [tmp_path / CHECKPOINT / f"0-0000{step}" / "state.npz" for step in (1, 2)]
    with np.load(files[0]) as other, np.load(files[1]) as own:
        changed = {**own, **{name: other[name] for name in ("displacement", "y")}}
    with files[1].open("wb") as stream:
        np.savez(stream, **changed)
    solution = alone(given, checkpoint=tmp_path, restart=True)
    assert solution.history.events[0].startswith("restart: 3 complete load step")
    assert re.search(r"load step 3 .*certificate does not hold", solution.history.events[1])
    assert_same(solution, alone(given))


def test_another_scene(tmp_path):
    """Every key that differs is named, with both values; the title may change."""
    interrupted(scene(PUSHED), MPI.COMM_SELF, tmp_path, 3)
    changed = PUSHED.replace("coefficient = 0.3", "coefficient = 0.4").replace("-0.4]", "-0.5]")
    with pytest.raises(SceneError) as error:
        alone(scene(changed, tolerance=1e-8), checkpoint=tmp_path, restart=True)
    assert [key for key, _ in error.value.problems] == [
        "traction[1].factors[5]",
        "contact[0].friction.coefficient",
        "solver.tolerance",
    ]
    assert error.value.problems[1][1].startswith("was 0.3 in the run to go on from, and is 0.4: ")
    renamed = scene(PUSHED.replace("block,", "brick,"))
    assert alone(renamed, checkpoint=tmp_path, restart=True).converged


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            PUSHED.replace("factors = [0.0, 0.4, 0.8, 1.0, 0.5, -0.4]", ""),
            "a scene with one load step on one mesh has no",
        ),
        (PUSHED + "[accuracy]\ntarget = 0.1\n", "requested accuracy"),
    ],
)
def test_nothing_to_go_on_from(tmp_path, text, message):
    """A scene of one piece, and meshes that are made on the way, have no checkpoint: the error says
    which it is.
    """
    with pytest.raises(SceneError, match=message):
        alone(scene(text), checkpoint=tmp_path, restart=True)


def test_results_remove_the_checkpoint(tmp_path):
    """Until the result is complete it stays, and a restart without one begins at the beginning."""
    given = scene(PUSHED)
    solution = alone(given, checkpoint=tmp_path, restart=True)
    assert (
        solution.history.events[0] == f"restart: 0 complete load steps in {tmp_path / CHECKPOINT}"
    )
    assert sorted(path.name for path in (tmp_path / CHECKPOINT).iterdir()) == [
        *(f"0-0000{step}" for step in range(6)),
        "scene.json",
    ]
    write_results(solution, tmp_path, fields=False, pictures=False)
    assert not (tmp_path / CHECKPOINT).exists()


# --- the command line, and signals that nobody can catch ------------------------------------------

# The observer of a run that kills each of its ranks where the fourth load step begins.
SUICIDE = """
import os, signal, sys
from mpi4py import MPI
from signorini_fx.records import Status, StepRecord
from signorini_fx.scenes.solver import solve

def kill(record):
    if isinstance(record, StepRecord) and record.step == 4:
        MPI.COMM_WORLD.barrier()
        os.kill(os.getpid(), signal.SIGKILL)

solve(sys.argv[1], checkpoint=sys.argv[2], observers=[kill])
"""


def run(ranks, *arguments):
    """A Python process on several ranks: its exit code, and what it has printed."""
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    command = [*launcher, sys.executable, *map(str, arguments)]
    own = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(("OMPI_COMM", "PMIX"))
    }
    with subprocess.Popen(
        command, env=own, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            output, errors = process.communicate(timeout=500)
        except subprocess.TimeoutExpired:
            process.terminate()  # a launcher that is killed leaves its ranks behind
            raise
    return process.returncode, output, errors


def rows(file):
    with file.open() as text:
        return list(csv.DictReader(text))


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    """The result folder of PUSHED, solved in one go."""
    folder = tmp_path_factory.mktemp("reference")
    write_results(alone(scene(PUSHED)), folder, fields=False, pictures=False)
    return folder


@pytest.mark.slow
@pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="starts ranks itself")
@pytest.mark.parametrize(("before", "after"), [(1, 2), (2, 1)])
def test_killed(tmp_path, uninterrupted, before, after):
    """Killed with -9 and restarted on another number of ranks, the tables are those of an
    uninterrupted run.
    """
    file, out = tmp_path / "scene.toml", tmp_path / "out"
    file.write_text(PUSHED)
    code, _, _ = run(before, "-c", SUICIDE, file, out)
    assert code == -signal.SIGKILL if before == 1 else code != 0
    assert sum(path.name.startswith("0-") for path in (out / CHECKPOINT).iterdir()) == 3
    command = ("-m", "signorini_fx", "solve", file, "--no-pictures", "--no-fields", "--out")
    code, output, errors = run(after, *command, out, "--restart", "--verbose")
    assert code == 0, errors
    assert f"restart 3 complete load steps in {out / CHECKPOINT}" in " ".join(
        output.split()
    )  # lines are wrapped
    assert not (out / CHECKPOINT).exists()
    solved = [row["step"] for row in rows(out / "history.csv")]
    assert all(
        solved.count(row["step"]) == int(row["linear_solves"]) for row in rows(out / "steps.csv")
    )
    for name in ("steps.csv", "contact.csv", "contact_steps.csv"):
        ours, theirs = rows(out / name), rows(uninterrupted / name)
        assert len(ours) == len(theirs)
        for column in theirs[0]:
            one, other = ([row[column] for row in table] for table in (ours, theirs))
            try:
                one, other = np.array(one, dtype=float), np.array(other, dtype=float)
            except ValueError:
                assert one == other
                continue
            # Coordinates, displacements and forces that are round-off are compared with the unit.
            scale = max(np.abs(other).max(), 1e-6)
            if column != "linear_solves":
                assert_allclose(one, other, rtol=0, atol=1e-8 * scale, err_msg=f"{name} {column}")
