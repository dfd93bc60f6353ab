"""What goes wrong around a solve: killed, interrupted, a full disk, a folder that is taken, a PETSc
without MUMPS.

A result folder holds a whole result or none: every test here ends by looking for half of one.
"""

import csv
import os
import resource
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from commands import summary_in
from mpi4py import MPI
from scenes import alone, example1

from signorini_fx.algebra.linalg import choice, factorisation
from signorini_fx.errors import OutputError, SceneError
from signorini_fx.machine import parallel
from signorini_fx.machine.manifest import MANIFEST, PART
from signorini_fx.mechanics.mesh.tagged import generate_mesh
from signorini_fx.results import files
from signorini_fx.results.folder import CHECKPOINT, ResultFolder
from signorini_fx.scenes.solver import build_problem, solve

SELF = MPI.COMM_SELF


@pytest.fixture(scope="module")
def solutions():
    """Two solutions that can be told apart, by the number of their contact nodes."""
    return alone(example1(bound=1.5, nx=6, ny=2)), alone(example1(coefficient=0.3, nx=12, ny=4))


def whole(folder):
    """The number of contact nodes of the result in a folder, None if it holds none; half a result
    is an error.
    """
    if not (folder / "summary.json").exists():
        return None
    nodes = summary_in(folder)["contact_nodes"]
    assert len(list(csv.DictReader((folder / "contact.csv").read_text().splitlines()))) == nodes
    assert (folder / "history.csv").stat().st_size > 0
    return nodes


def in_a_child(action):
    """Fork, act, and tell how the child ended."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            action()
            code = 0
        finally:
            os._exit(code)
    return os.waitpid(child, 0)[1]


@pytest.mark.slow
def test_killed_at_every_third_step(tmp_path, solutions):
    """Killed before one of its operations on files, a second run leaves the first result, none, or
    its own, whole.
    """
    first, second = solutions
    seen = set()
    for steps in range(0, 200, 3):
        files.write_results(first, tmp_path / "out", fields=False, pictures=False)

        def write_and_die(steps=steps):
            left = steps

            def count(event, arguments):
                nonlocal left
                if event in (
                    "open",
                    "os.rename",
                    "os.remove",
                    "os.mkdir",
                    "os.rmdir",
                ) and "out" in str(arguments):
                    left -= 1
                    if left < 0:
                        os.kill(os.getpid(), signal.SIGKILL)

            sys.addaudithook(count)
            files.write_results(second, tmp_path / "out", fields=False, pictures=False)

        status = in_a_child(write_and_die)
        seen.add(whole(tmp_path / "out"))
        if os.WIFEXITED(status):
            assert os.WEXITSTATUS(status) == 0
            break
        assert os.WTERMSIG(status) == signal.SIGKILL
    assert steps > 15
    assert seen == {7, None, 13}
    assert not (tmp_path / "out" / PART).exists()


@pytest.mark.parametrize("fields", [False, True])
def test_no_space(tmp_path, solutions, fields):
    """Where a file may not grow there is one error, the older result stays, and nothing is left
    behind.
    """
    first, second = solutions
    files.write_results(first, tmp_path, fields=False, pictures=False)
    before = sorted(tmp_path.rglob("*"))

    def write():
        resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))
        with pytest.raises(OutputError, match="cannot be written: File too large"):
            files.write_results(second, tmp_path, fields=fields, pictures=False)

    assert in_a_child(write) == 0
    assert whole(tmp_path) == 7
    assert sorted(tmp_path.rglob("*")) == before


def test_no_space_for_a_load_step(tmp_path):
    """The error has the folder and the reason of the system."""
    scene = example1(nx=60, ny=20)
    steps = scene.model_copy(
        update={"traction": (scene.traction[0].model_copy(update={"factors": (0.5, 1.0)}),)}
    )
    assert alone(steps).converged  # forms are compiled

    def run():
        resource.setrlimit(resource.RLIMIT_FSIZE, (6000, 6000))
        with pytest.raises(OutputError, match=r"checkpoint: cannot be written: File too large$"):
            alone(steps, checkpoint=tmp_path)

    assert in_a_child(run) == 0


@pytest.mark.slow
def test_second_run_into_the_same_folder(tmp_path, solutions):
    """While one run holds a folder another one is refused; after it nothing of the first result is
    left.
    """
    first, second = solutions
    files.write_results(first, tmp_path, fields=True, pictures=True)
    assert (tmp_path / "deformed.png").exists()
    (tmp_path / "notes.txt").write_text("mine")
    mine = ResultFolder(SELF, tmp_path, files.FILES)
    with pytest.raises(OutputError, match="another run"):
        files.write_results(second, tmp_path)
    assert whole(tmp_path) == 7
    files.write_results(second, mine, fields=False, pictures=False)
    assert whole(tmp_path) == 13
    assert {path.name for path in tmp_path.iterdir()} == {
        *("summary.json", "contact.csv", "history.csv", "outer.csv", "notes.txt", MANIFEST)
    }


SCENE = """
mesh = { generator = "rectangle", parameters = { nx = NX, ny = NX } }
material = { young = 5000.0, poisson = 0.4 }
solver = { levels = 4, linear_algebra = "full" }
[[displacement]]
boundary = "top"
x = 0.0
y = -0.01
[[contact]]
boundary = "bottom"
friction = { law = "coulomb", coefficient = 0.3 }
"""


def start(tmp_path, *arguments, cells=200, **options):
    """Start the command line on a scene that takes a while; its output unbuffered."""
    (tmp_path / "scene.toml").write_text(SCENE.replace("NX", str(cells)))
    command = [
        sys.executable,
        "-m",
        "signorini_fx",
        "solve",
        str(tmp_path / "scene.toml"),
        "--verbose",
        "--out",
    ]
    return subprocess.Popen(
        [*command, str(tmp_path / "out"), "--no-pictures", *arguments],
        stdout=options.get("stdout", subprocess.PIPE),
        stderr=subprocess.PIPE,
        text=True,
        # Whoever runs the tests may ignore it, and a program that is started inherits that.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


@pytest.mark.slow
def test_interrupted(tmp_path):
    """It says how far it got, and keeps what a restart goes on from."""
    with start(tmp_path) as process:
        for line in process.stdout:
            if "level 2" in line:
                process.send_signal(signal.SIGTERM)
                break
        _, errors = process.communicate(timeout=120)
    assert process.returncode == 130
    assert errors.splitlines() == [
        "signorini-fx: interrupted; run again with --restart to continue"
    ]
    assert {path.name for path in (tmp_path / "out").iterdir()} == {CHECKPOINT, MANIFEST}


@pytest.mark.slow
def test_output_that_goes_nowhere(tmp_path):
    """A full disk behind standard output is said and ends with an exit code; the results are
    written all the same.
    """
    with open("/dev/full", "w") as nowhere, start(tmp_path, cells=16, stdout=nowhere) as process:
        _, errors = process.communicate(timeout=120)
    assert process.returncode == 2
    assert errors.splitlines() == [
        "signorini-fx: the output cannot be written: No space left on device"
    ]
    assert whole(tmp_path / "out") == 17


# --- a PETSc without packages, a machine without memory -------------------------------------------


@pytest.fixture
def without(monkeypatch):
    """Take packages for factorisation away from PETSc."""

    def take(*packages):
        real = factorisation.has_package

        def has(package, kind="cholesky"):
            return package not in packages and real(package, kind)

        monkeypatch.setattr(factorisation, "has_package", has)
        monkeypatch.setattr(choice, "has_package", has)

    return take


@pytest.mark.mpi
@pytest.mark.one_quick("packages", [("mumps",), ("mumps", "superlu_dist", "cholmod")])
@pytest.mark.parametrize("wanted", ["auto", "condensed", "full"])
def test_without_mumps(without, packages, wanted):
    """It says so and uses what there is, to the same answer: PETSc's own factorisation, on several
    ranks multigrid.
    """
    comm = MPI.COMM_WORLD
    scene = example1(coefficient=0.3, nx=30, ny=10, linear_algebra=wanted)
    reference = solve(scene, comm)
    without(*packages)
    solution = solve(scene, comm)
    if comm.size == 1:
        assert solution.linear_algebra == "full: PETSc has no MUMPS"
    elif len(packages) > 1:
        assert "no factorisation for more than one rank" in solution.linear_algebra
    pressure, shear = (solution.table.columns[name] for name in ("pressure", "shear"))
    largest = np.abs(reference.table.columns["pressure"]).max()
    np.testing.assert_allclose(
        pressure, reference.table.columns["pressure"], rtol=0, atol=1e-9 * largest
    )
    np.testing.assert_allclose(shear, reference.table.columns["shear"], rtol=0, atol=1e-9 * largest)


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("generator", "parameters"),
    [
        ("rectangle", {"nx": 20_000, "ny": 20_000}),
        ("block", {"nx": 5_000, "ny": 5_000}),
        ("half_disk", {"contact_size": 1e-9}),
        ("half_disk", {"size": 1e-9}),
        ("half_disk", {"radius": 1e9}),
    ],
)
def test_mesh_that_no_machine_holds(monkeypatch, generator, parameters):
    """It is refused before it is begun, on all ranks."""
    monkeypatch.setattr(parallel, "machine_memory", lambda comm: 8e9)
    begin = time.process_time()
    reasons = (
        r"mesh\.parameters(: about .* cells would need|\.\w+: .* is too short: .* facets along)"
    )
    with pytest.raises(SceneError, match=reasons):
        generate_mesh(generator, parameters, MPI.COMM_WORLD)
    assert time.process_time() - begin < 1.0


@pytest.mark.mpi
def test_scene_file_that_one_rank_alone_has(tmp_path):
    """One rank reads it; each rank by itself would wait for those that raise."""
    comm = MPI.COMM_WORLD
    file = tmp_path / f"scene-{comm.rank}.toml"
    if comm.rank == 0:
        file.write_text(
            'mesh = { generator = "rectangle" }\nmaterial = { young = 1.0, poisson = 0.3 }\n'
            'displacement = [{ boundary = "top", y = -1e-3 }]\ncontact = { boundary = "bottom" }\n',
            encoding="utf-8",
        )
    assert len(build_problem(file, comm).path.times) == 1
    with pytest.raises(SceneError, match="cannot be read"):
        build_problem(tmp_path / ("absent.toml" if comm.rank == 0 else file), comm)
