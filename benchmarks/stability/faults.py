"""Faults: killed, interrupted, a full disk, a folder that is taken, a PETSc without MUMPS; see test_faults.py."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from benchmarks.stability.case import CONVERGED, Case, Finding

ROOT = Path(__file__).parents[2]
# Fault -> the tests of it.
TRIED = {
    "killed at every step of writing": ("killed_at_every_step",),
    "killed between two meshes": ("killed_between_meshes",),
    "Ctrl-C, SIGTERM": ("interrupted",),
    "file size limit": ("no_space",),
    "standard output on a full disk": ("output_that_goes_nowhere",),
    "folder that cannot be": ("folder_that_cannot_be",),
    "two runs into one folder": ("second_run_into_the_same_folder",),
    "PETSc without MUMPS": ("without_mumps", "body_without_contact_and_mumps"),
    "mesh that no machine holds": ("mesh_that_no_machine_holds", "scene_without_end"),
}
_SCENE = ROOT / "demos" / "scenes" / "example1_coulomb.toml"


def cases(*, short: bool) -> Iterator[Case]:
    """The tests, which are the short form, and cases that need root or mpirun."""
    if short:
        return
    for name, tests in TRIED.items():
        yield Case(name, partial(_tests, tests), seconds=300)
    yield Case("PETSc without MUMPS, 2 ranks", partial(_tests, TRIED["PETSc without MUMPS"], 2), seconds=300)
    for ranks in (1, 2):
        for size in ("16k", "200k"):
            yield Case(
                f"disk of {size}, {ranks} rank{'s' * (ranks > 1)}",
                partial(_full_disk, size, ranks),
                wanted=("cannot be written: No space left on device",),
                allowed=("no small disk can be mounted",),
                note="needs root",
            )
    yield Case("Ctrl-C to mpirun", _interrupted_mpirun, wanted=("keeps the last complete mesh",))


def _tests(names: Sequence[str], ranks: int = 1) -> Finding:
    """Run tests of tests/solving/test_faults.py."""
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    chosen = " or ".join(names)
    command = [*launcher, sys.executable, "-m", "pytest", "-q", "--color=no", "-p", "no:cacheprovider", "-k", chosen]
    file = str(ROOT / "tests" / "solving" / "test_faults.py")
    done = subprocess.run(
        [*command, *(["-m", "mpi"] if ranks > 1 else []), file],
        cwd=ROOT,
        env=_environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    said = [line for line in done.stdout.splitlines() if "passed" in line or "failed" in line]
    note = said[-1] if said else done.stderr.strip()[-200:]
    return Finding(CONVERGED if done.returncode == 0 else "a test fails", note=note)


def _environment() -> dict[str, str]:
    """The environment without the variables of a launcher, so that other launchers can be started."""
    return {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_COMM", "PMIX_", "PMI_"))}


def _command(folder: Path, ranks: int, scene: Path = _SCENE) -> list[str]:
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    solve = [sys.executable, "-m", "signorini_fx", "solve", str(scene), "--out", str(folder), "--no-pictures"]
    return [*launcher, *solve]


def _full_disk(size: str, ranks: int) -> Finding:
    """A disk of a few blocks: one error in one sentence, no hang, and no file remains."""
    place = Path(tempfile.mkdtemp())
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(place)], capture_output=True, check=False
    )
    if mounted.returncode != 0:
        place.rmdir()
        return Finding("no small disk can be mounted")
    try:
        done = subprocess.run(
            _command(place / "out", ranks),
            env=_environment(),
            capture_output=True,
            text=True,
            timeout=100,
            check=False,
        )
        left = [path.name for path in place.rglob("*")]
    finally:
        subprocess.run(["umount", str(place)], check=False)
        shutil.rmtree(place, ignore_errors=True)
    (said,) = [line for line in done.stderr.splitlines() if line.startswith("signorini-fx")] or [""]
    outcome = said.split("out: ")[-1] if done.returncode == 2 and not left else f"exit code {done.returncode}"
    return Finding(outcome, note=f"left behind: {', '.join(left)}" if left else "")


def _interrupted_mpirun() -> Finding:
    """Mpirun asks its ranks to end and kills them half a second later: the last complete result is kept."""
    with tempfile.TemporaryDirectory() as name:
        out = Path(name) / "out"
        command = [*_command(out, 2), "--levels", "4"]
        text = _SCENE.read_text(encoding="utf-8").replace("nx = 120", "nx = 960").replace("ny = 40", "ny = 320")
        (Path(name) / "scene.toml").write_text(text, encoding="utf-8")
        command[command.index(str(_SCENE))] = str(Path(name) / "scene.toml")
        with subprocess.Popen(
            command, env=_environment(), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        ) as process:
            assert process.stdout is not None
            for line in process.stdout:
                if "level 2" in line:
                    process.terminate()
                    break
            process.stdout.read()
            process.wait(60)
        if (out / "summary.json").exists():
            return Finding("ended before it was interrupted")
        kept = (out / "last_level" / "summary.json").exists()
        return Finding(
            "keeps the last complete mesh" if kept else "keeps nothing", note=f"exit code {process.returncode}"
        )
