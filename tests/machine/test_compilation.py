"""Compilation of forms: processes that want the same form wait for each other, and killed ones
leave nothing behind.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import ufl
from dolfinx import fem, jit, mesh
from mpi4py import MPI

from signorini_fx.machine import compilation
from signorini_fx.records import Timings

# Compiles a form of the unit square by the compiler of the environment; the folder is the argument.
PROGRAM = """
import sys
from mpi4py import MPI  # before dolfinx, as its wheels need it
import ufl
from dolfinx import fem, jit, mesh
from signorini_fx.machine.compilation import compiling
jit.DOLFINX_DEFAULT_JIT_OPTIONS |= {"cache_dir": (sys.argv[1], ""), "timeout": (1, "")}
domain = mesh.create_unit_square(MPI.COMM_SELF, 1, 1)
with compiling():
    fem.form(fem.Constant(domain, 1.0) * ufl.dx)
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder of compiled forms, the same on all ranks, in which FFCx waits for one
    second.
    """
    common = Path(MPI.COMM_WORLD.bcast(str(tmp_path / "cache")))
    monkeypatch.setitem(jit.DOLFINX_DEFAULT_JIT_OPTIONS, "cache_dir", (str(common), ""))
    monkeypatch.setitem(jit.DOLFINX_DEFAULT_JIT_OPTIONS, "timeout", (1, ""))
    return common


def compile_it(comm=MPI.COMM_SELF):
    """A form that the folder may have; its value on the unit square is 1."""
    domain = mesh.create_unit_square(comm, 1, 1)
    with compilation.compiling():
        form = fem.form(fem.Constant(domain, 1.0) * ufl.dx)
    return comm.allreduce(fem.assemble_scalar(form))


def begin(folder, compiler, tmp_path):
    """A process that compiles the form with a shell script for a compiler."""
    script = tmp_path / "compiler"
    script.write_text(f"#!/bin/sh\n{compiler}\n")
    script.chmod(0o755)
    environment = {**os.environ, "CC": str(script)}
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(folder)],
        env=environment,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )


def wait_for(condition):
    """Until it holds."""
    end = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.mark.slow
def test_a_compilation_that_was_killed(folder, tmp_path):
    """The form is compiled again, by the first one that wants it."""
    process = begin(folder, f"touch {tmp_path}/begun; sleep 1000", tmp_path)
    wait_for((tmp_path / "begun").exists)
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    (source,) = folder.glob("*.c")
    assert not source.with_suffix(".c.cached").exists()
    assert compile_it() == pytest.approx(1.0)


@pytest.mark.slow
def test_two_processes_at_once(folder, tmp_path):
    """The second one waits as long as the first one compiles, which is longer than FFCx waits, and
    takes its form.
    """
    process = begin(folder, f'touch {tmp_path}/begun; sleep 2; exec cc "$@"', tmp_path)
    wait_for((tmp_path / "begun").exists)
    assert compile_it() == pytest.approx(1.0)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 0, errors
    assert not list(folder.glob("*.failed"))


def test_another_program_that_compiles(folder):
    """It has the time that FFCx gives it: what it has begun is not taken from it before."""
    folder.mkdir()
    source = folder / "form.c"
    source.touch()
    begun = time.monotonic()
    with compilation.ExitStack() as held:
        compilation.prepare(folder, "form", 0.5, held)
    assert not source.exists()
    assert 0.4 < time.monotonic() - begun < 5.0


@pytest.mark.mpi(slow=True)
@pytest.mark.one_quick("missing", ["*.c.cached", "*.so", "*.c"])
def test_what_is_not_whole_is_compiled_again(folder, missing):
    """On all ranks alike."""
    comm = MPI.COMM_WORLD
    assert compile_it(comm) == pytest.approx(1.0)
    comm.Barrier()
    if comm.rank == 0:
        (path,) = folder.glob(missing)
        path.unlink()
        for source in folder.glob("*.c"):
            os.utime(source, (0, 0))
    comm.Barrier()
    assert compile_it(comm) == pytest.approx(1.0)
    assert len(list(folder.glob(missing))) == 1


def test_a_form_that_is_loaded_is_not_looked_for_again(folder):
    """The third time it is not even missed: the first time it is compiled, which takes time of
    that phase wherever it happens, the second time it is loaded.
    """
    timings = Timings()
    for phases in (["certify", "compile"], ["certify"]):
        timings.seconds.clear()
        with timings.phase("certify"):
            assert compile_it() == pytest.approx(1.0)
        assert [*timings.seconds] == phases
        assert timings.seconds["certify"] < timings.seconds.get("compile", 1.0)
    for path in folder.iterdir():
        path.unlink()
    assert compile_it() == pytest.approx(1.0)
    assert not list(folder.glob("*.c"))
