"""Ctrl-C, SIGTERM and exceptions at every moment of a solve: they arrive, and are never taken for
numerics.
"""

import gc
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from commands import summary_in
from scenes import example1

from signorini_fx.algebra import regularised
from signorini_fx.algebra.algorithms import ssn
from signorini_fx.algebra.linalg import multigrid, petsc_calls, schur
from signorini_fx.machine import signals
from signorini_fx.machine.manifest import MANIFEST
from signorini_fx.results import files
from signorini_fx.results.accuracy import stress_recovery
from signorini_fx.results.certificate.nodal_forces import NodalForces
from signorini_fx.results.files import write_results
from signorini_fx.scenes import cli, mesh_sequence, solver
from signorini_fx.solving import solve_on_mesh

SCENE = """
mesh = { generator = "GENERATOR", parameters = { PARAMETERS } }
material = { young = 5000.0, poisson = 0.3 }
solver = { SOLVER }
[[displacement]]
boundary = "top"
x = 0.002
AXIS = "-0.01 - 0.001 * x[0]"
factors = [0.5, 1.0]
[[contact]]
boundary = "bottom"
friction = { law = "coulomb", coefficient = 0.3 }
"""
PLANE = {"GENERATOR": "rectangle", "PARAMETERS": "nx = 8, ny = 4", "AXIS": "y"}
SOLID = {"GENERATOR": "box", "PARAMETERS": "nx = 3, ny = 2, nz = 2", "AXIS": "z"}


def written(path, kind, solver):
    """The path of a scene of one kind."""
    text = SCENE
    for name, value in {**kind, "SOLVER": solver}.items():
        text = text.replace(name, value)
    path.write_text(text)
    return path


# Place -> the function that is entered there, and the scenes that enter it.
FULL, CONDENSED, KRYLOV = (f'linear_algebra = "{name}"' for name in ("full", "condensed", "krylov"))
PLACES = {
    "mesh": (mesh_sequence, "load_mesh", (PLANE, f"{FULL}, levels = 2")),
    "assembly": (solve_on_mesh, "prepare", (PLANE, f"{FULL}, levels = 2")),
    "condense": (schur.SchurComplement, "__init__", (PLANE, f"{CONDENSED}, levels = 2")),
    "residual": (regularised.RegularisedProblem, "_hold", (PLANE, FULL)),
    "residual, krylov": (regularised.RegularisedProblem, "_hold", (SOLID, KRYLOV)),
    "convergence, krylov": (ssn.SemismoothNewton, "record", (SOLID, KRYLOV)),
    "preconditioner": (multigrid.NodalBlocks, "split", (SOLID, KRYLOV)),
    "certificate": (NodalForces, "internal", (SOLID, FULL)),
    "estimate": (stress_recovery.StressRecovery, "squares", (PLANE, f"{FULL}, levels = 2")),
    "writing": (files, "write_csv", (PLANE, FULL)),
}


@pytest.fixture(autouse=True)
def collecting():
    """Garbage is collected all the time, also while an exception passes through PETSc, which was a
    crash.
    """
    thresholds = gc.get_threshold()
    gc.set_threshold(1)
    yield
    gc.set_threshold(*thresholds)


@pytest.fixture(scope="module")
def older(tmp_path_factory):
    """The folder of an earlier result."""
    folder = tmp_path_factory.mktemp("older")
    write_results(
        solver.solve(example1(bound=1.5, nx=6, ny=2)), folder, fields=False, pictures=False
    )
    return folder


def left_alone(older, folder):
    """Whether a folder is as it was, but for what an interrupted run can be gone on from."""
    added = {path.name for path in folder.iterdir()} - {path.name for path in older.iterdir()}
    kept = [path for path in older.iterdir() if path.name != MANIFEST]
    same = all((folder / path.name).read_bytes() == path.read_bytes() for path in kept)
    lines, older_lines = (
        set((place / MANIFEST).read_text().split("\n")) for place in (folder, older)
    )
    # The manifest lists what the interrupted run has made, so that the next one may remove it.
    listed = added <= {line.partition("/")[0] for line in lines} and older_lines <= lines
    return same and listed and added <= {"checkpoint"}


class Enough(Exception):
    """Raised by a test."""


def at_second_call(monkeypatch, place, act):
    """Act when a function is entered for the second time; returns the scene."""
    owner, name, scene = PLACES[place]
    function, count = getattr(owner, name), [0]

    def entered(*args, **options):
        count[0] += 1
        if count[0] == 2:
            act()
        return function(*args, **options)

    monkeypatch.setattr(owner, name, entered)
    return scene


def raise_enough():
    raise Enough


@pytest.mark.one_quick("place", PLACES)
def test_a_signal(place, older, tmp_path, monkeypatch, capfd):
    """Exit code 130 and one line about it; the older result stays, and what is complete can be gone
    on from.
    """
    out = tmp_path / "out"
    shutil.copytree(older, out)
    kind = (signal.SIGINT, signal.SIGTERM)[list(PLACES).index(place) % 2]
    scene = written(
        tmp_path / "scene.toml",
        *at_second_call(monkeypatch, place, lambda: os.kill(os.getpid(), kind)),
    )
    assert cli.main(["solve", str(scene), "--out", str(out), "--no-pictures", "--no-fields"]) == 130
    told = capfd.readouterr().err
    assert told.count("signorini-fx: ") == told.count("signorini-fx: interrupted") == 1
    assert told.endswith("\n")
    assert left_alone(older, out)
    assert not signals.arrived


@pytest.mark.one_quick("place", [place for place in PLACES if place != "writing"])
def test_an_exception(place, tmp_path, monkeypatch):
    """It reaches the caller as it is, and the next solve knows nothing of it."""
    scene = written(tmp_path / "scene.toml", *at_second_call(monkeypatch, place, raise_enough))
    with pytest.raises(Enough) as caught:
        solver.solve(scene)
    assert caught.value.__context__ is None
    assert not petsc_calls._raised
    assert solver.solve(scene).converged


def test_a_signal_ends_a_linear_solve(tmp_path, monkeypatch):
    """Not the last one that PETSc would make, but the first one after it."""
    apply, applied = multigrid.ContactPreconditioner.apply, []

    def interrupted(self, *args):
        applied.append(self)
        if len(applied) == 2:
            os.kill(os.getpid(), signal.SIGINT)
        apply(self, *args)

    monkeypatch.setattr(multigrid.ContactPreconditioner, "apply", interrupted)
    with pytest.raises(KeyboardInterrupt):
        solver.solve(written(tmp_path / "scene.toml", SOLID, KRYLOV))
    assert len(applied) == 2


def test_a_signal_between_two_results(older, tmp_path, monkeypatch):
    """While the new result takes the place of the older one: it is there as a whole."""
    out = tmp_path / "out"
    shutil.copytree(older, out)
    replace, moved = Path.replace, []

    def interrupted(self, target):
        moved.append(target)
        if len(moved) == 1:
            os.kill(os.getpid(), signal.SIGINT)
        return replace(self, target)

    solution = solver.solve(example1(bound=1.5, nx=12, ny=4))
    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_results(solution, out, fields=False, pictures=False)
    assert len(moved) > 1
    assert summary_in(out)["contact_nodes"] == 13
    assert len((out / "contact.csv").read_text().splitlines()) == 14
    assert not (out / ".part").exists()


MANY = """
import os, signal, sys
from mpi4py import MPI
from signorini_fx.scenes import cli
from signorini_fx.algebra.linalg.multigrid import ContactPreconditioner

applied, rank = [0], int(sys.argv[1])
apply = ContactPreconditioner.apply

def counted(self, pc, right, x):
    applied[0] += 1
    if applied[0] == 5 and MPI.COMM_WORLD.rank == rank:
        os.kill(os.getpid(), signal.SIGINT)
    apply(self, pc, right, x)

ContactPreconditioner.apply = counted
sys.exit(cli.main(sys.argv[2:]))
"""


@pytest.mark.slow
def test_a_signal_on_one_of_two_ranks(older, tmp_path):
    """Whichever rank it reaches inside a linear solve in 3D: all ranks end, and the older result
    stays.
    """
    if shutil.which("mpirun") is None:
        pytest.skip("there is no mpirun")
    out = tmp_path / "out"
    shutil.copytree(older, out)
    scene = written(tmp_path / "scene.toml", SOLID, KRYLOV)
    (tmp_path / "run.py").write_text(MANY)
    command = [
        "mpirun",
        "-n",
        "2",
        sys.executable,
        str(tmp_path / "run.py"),
        "1",
        "solve",
        str(scene),
    ]
    ended = subprocess.run(
        [*command, "--out", str(out)], capture_output=True, text=True, timeout=120
    )
    assert ended.returncode == 130
    assert "singular" not in ended.stdout + ended.stderr
    assert "Traceback" not in ended.stderr
    assert left_alone(older, out)
