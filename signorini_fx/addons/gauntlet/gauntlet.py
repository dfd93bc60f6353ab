"""Run all cases of some folders, each in a process of its own with a limit of time.  No dolfinx here."""

from __future__ import annotations

import fnmatch
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

from signorini_fx.addons.aster.command_file import read_commands
from signorini_fx.addons.cases.frontistr import other_solution
from signorini_fx.addons.cases.kratos import other_solver
from signorini_fx.addons.gauntlet.aster_kinds import other_kind
from signorini_fx.addons.gauntlet.outcomes import CRASHED, OTHER_KIND, SLOW, Gauntlet, GauntletCase, commit_of
from signorini_fx.addons.gauntlet.sources import ASTER, FRONTISTR, KRATOS, cases_of, name_of, program_of
from signorini_fx.errors import MeshError

_WORKER = "signorini_fx.addons.gauntlet.worker"
# Of a crash the last line is told, up to so many characters.
_LONGEST = 200


def gauntlet(
    folders: Sequence[Path],
    *,
    seconds: float = 120.0,
    only: Sequence[str] = (),
    jobs: int = 1,
    report: Callable[[GauntletCase], object] = lambda case: None,
) -> Gauntlet:
    """Run the cases of other programs that are in some folders.

    Args:
        folders: with input files of CalculiX beside their printed results, NAME.dat.ref or NAME.frd.ref, with command
            files of code_aster, in which their values are, with parameters of Kratos and the values they check, or with
            control files of FrontISTR and its results.
        seconds: that each case has; one that takes longer is a row that says so.
        only: patterns of names, such as ``contact*``; none: all.
        jobs: how many run at a time.
        report: is called with each case as it has ended.

    Raises:
        MeshError: a folder is none, or has no case.
    """
    begun = datetime.now(UTC)
    cases = []
    for folder in folders:
        if not folder.is_dir():
            raise MeshError(f"{folder}: is no folder")
        files = [file for file in cases_of(folder) if not only or any(fnmatch.fnmatch(file.stem, p) for p in only)]
        if not files:
            raise MeshError(
                f"{folder}: has no NAME.inp with contact and NAME.dat.ref or NAME.frd.ref beside it, no NAME.comm with "
                "contact and tests, no NAME_parameters.json with contact and values to check, and no NAME.cnt with "
                "contact and NAME.msh and results beside it"
            )
        with ThreadPoolExecutor(jobs) as pool:
            for case in pool.map(lambda file: run_case(file, seconds), files):
                cases.append(case)
                report(case)
    sources = tuple((folder.resolve().name, commit_of(folder)) for folder in folders)
    return Gauntlet(tuple(cases), sources, seconds, f"{begun:%Y-%m-%d}")


def run_case(file: Path, seconds: float) -> GauntletCase:
    """A case, however it ends; one of another kind of problem needs no process."""
    if (case := _of_another_kind(file)) is not None:
        return case
    with tempfile.TemporaryDirectory() as folder:
        written = Path(folder) / "outcome.json"
        command = [sys.executable, "-m", _WORKER, str(file.resolve()), folder, str(written)]
        begun = time.perf_counter()
        try:
            ended = subprocess.run(command, capture_output=True, text=True, timeout=seconds, cwd=folder, check=False)
        except subprocess.TimeoutExpired:
            ended = None
        took = time.perf_counter() - begun
        crashed = GauntletCase(name_of(file), program_of(file), CRASHED)
        case = GauntletCase.read(written) if written.exists() else crashed
        if ended is None:
            if case.quantities:  # it is compared, and differences were being explained
                return case.ended(case.state, f"{case.why}; explaining it took too long".removeprefix("; "), took)
            return case.ended(SLOW, f"more than {seconds:g} s", took)
        if ended.returncode:
            last = (ended.stderr.strip().splitlines() or [f"exit code {ended.returncode}"])[-1]
            return case.ended(CRASHED, last[:_LONGEST], took)
        return case.ended(case.state, case.why, took)


def _of_another_kind(file: Path) -> GauntletCase | None:
    """A case that is no statics of elastic bodies; None: it is, or cannot be read."""
    program, why = program_of(file), ""
    with suppress(MeshError):
        if program == ASTER:
            why = other_kind(read_commands(file))
        elif program == KRATOS:
            why = other_solver(file)
        elif program == FRONTISTR:
            why = other_solution(file)
    return GauntletCase(name_of(file), program, OTHER_KIND, why) if why else None
