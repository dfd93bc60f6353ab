"""Run all cases of some folders, each in a process of its own with a limit of time.  No dolfinx here."""

from __future__ import annotations

import fnmatch
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path

from signorini_fx.addons.gauntlet.outcomes import CRASHED, SLOW, Gauntlet, GauntletCase, commit_of
from signorini_fx.addons.gauntlet.sources import PROGRAM, decks_of
from signorini_fx.errors import MeshError

_WORKER = "signorini_fx.addons.gauntlet.worker"
# Of a crash the last line is told, up to so many characters.
_LONGEST = 200


def gauntlet(
    folders: Sequence[Path],
    *,
    seconds: float = 120.0,
    only: Sequence[str] = (),
    report: Callable[[GauntletCase], object] = lambda case: None,
) -> Gauntlet:
    """Run the cases of other programs that are in some folders.

    Args:
        folders: with input files of CalculiX beside their printed results, NAME.dat.ref or NAME.frd.ref.
        seconds: that each case has; one that takes longer is a row that says so.
        only: patterns of names, such as ``contact*``; none: all.
        report: is called with each case as it has ended.

    Raises:
        MeshError: a folder is none, or has no case.
    """
    begun = datetime.now(UTC)
    cases = []
    for folder in folders:
        if not folder.is_dir():
            raise MeshError(f"{folder}: is no folder")
        decks = [deck for deck in decks_of(folder) if not only or any(fnmatch.fnmatch(deck.stem, p) for p in only)]
        if not decks:
            raise MeshError(f"{folder}: has no NAME.inp with contact and NAME.dat.ref or NAME.frd.ref beside it")
        for deck in decks:
            cases.append(run_case(deck, seconds))
            report(cases[-1])
    sources = tuple((folder.resolve().name, commit_of(folder)) for folder in folders)
    return Gauntlet(tuple(cases), sources, seconds, f"{begun:%Y-%m-%d}")


def run_case(deck: Path, seconds: float) -> GauntletCase:
    """A case, however it ends."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "outcome.json"
        command = [sys.executable, "-m", _WORKER, str(deck.resolve()), folder, str(file)]
        begun = time.perf_counter()
        try:
            ended = subprocess.run(command, capture_output=True, text=True, timeout=seconds, cwd=folder, check=False)
        except subprocess.TimeoutExpired:
            ended = None
        took = time.perf_counter() - begun
        case = GauntletCase.read(file) if file.exists() else GauntletCase(deck.stem, PROGRAM, CRASHED)
        if ended is None:
            if case.quantities:  # it is compared, and differences were being explained
                return case.ended(case.state, f"{case.why}; explaining it took too long".removeprefix("; "), took)
            return case.ended(SLOW, f"more than {seconds:g} s", took)
        if ended.returncode:
            last = (ended.stderr.strip().splitlines() or [f"exit code {ended.returncode}"])[-1]
            return case.ended(CRASHED, last[:_LONGEST], took)
        return case.ended(case.state, case.why, took)
