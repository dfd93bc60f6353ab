"""The mutation check: small mistakes are made in a copy of the package, one at a time; the tests must notice each.

    ./env python3 -m stability.mutants [--only WORD,...] [--near] [--workers N] [--again] [--out DIR]   (make mutants)

The mistakes are listed in ``stability/mistakes.py``.  Each is tried on the number of ranks that it names, against the
test that noticed it the last time (docs/evidence/mutants.csv says which), then against the tests that it names, then
against quick ones about everything, then against all but the long ones; the first failure ends the trial.  A test
counts only if it passes on the code as it is.  What no test notices survives; that is right only for a mutant with
a reason why it changes no result.

An interrupted run goes on where it was, as long as neither package nor tests have changed.  A run of the whole list
writes the table.  The exit code is 1 if a mutant survives without a reason.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

from stability.mistakes import MUTANTS, QUICK, ROOT, Mutant, in_its_room

TABLE = ROOT / "docs" / "evidence" / "mutants.csv"
COLUMNS = ("mistake", "place", "ranks", "noticed by")
NOTICED, SURVIVES, LIMIT = "noticed", "survives", "limit"
# These tests fail because the source differs, and not because of the effect of the mistake.
_NOT_FOR_COPIES = ("tests/repository/test_mutants.py",)
# The first tests of the suite: quick ones of all parts.
_FIRST = (
    "complementarity", "algorithms", "forms", "patch_anywhere", "example1", "outcomes", "oracle", "fall_backs",
    "invariances", "ranks", "effects", "parts", "nested", "inexact", "refinement", "load_steps",
    "expressions",
)  # fmt: skip
# CPU seconds of a process, and wall seconds, by how much is run: a mutant may run endlessly.
_LIMITS = {"test": (120, 900), "files": (600, 2400), "suite": (3600, 7200)}
_MEMORY = 16_000_000  # kB of address space


@dataclass(frozen=True)
class Fate:
    """The fate of a mutant.

    Attributes:
        fate: noticed, survives, or limit: it took more time than allowed, or its process died, which is noticed too.
        by: the test that noticed it, the last line that was printed, or "".
        ranks: on how many ranks.
        seconds: what the trial took.
    """

    fate: str
    by: str
    ranks: int
    seconds: float


class Copy:
    """A copy of the checkout for one mutant, with compiled forms of its own.

    Args:
        folder: an empty folder.
        cache: of compiled forms.
        source: what to copy: the checkout, or a copy of it, whose bytecode spares mutants most of theirs.
    """

    def __init__(self, folder: Path, cache: Path, source: Path = ROOT) -> None:
        self.folder, self.cache = folder, folder / "cache"
        self._first = source == ROOT
        (folder / "tmp").mkdir()
        bytecode = ("__pycache__",) if self._first else ()
        anywhere = shutil.ignore_patterns(".git", ".*_cache", ".hypothesis", *bytecode)

        def ignored(place: str, names: list[str]) -> set[str]:
            """Files that are not in git; the package has a folder of the same name as that of the results."""
            return anywhere(place, names) | ({"results", "build"} & set(names) if Path(place) == source else set())

        shutil.copytree(source, folder / "code", symlinks=True, ignore=ignored)
        # Compilation locks of another mutant that ended would make this one wait.
        for name in ("fenics", "matplotlib"):
            if (cache / name).is_dir():
                shutil.copytree(cache / name, self.cache / name, copy_function=_link)

    @property
    def code(self) -> Path:
        """The checkout."""
        return self.folder / "code"

    def pytest(self, ranks: int, arguments: Sequence[str], limit: str, *, workers: int = 1) -> tuple[int | None, str]:
        """Run tests until one fails.

        Args:
            ranks: on so many ranks; on more than one those that are marked mpi.
            arguments: tests and files, and options of pytest.
            limit: a name of ``_LIMITS``.
            workers: processes side by side, on one rank.

        Returns:
            pytest's exit code, None where a limit or a signal ended it; what it printed.
        """
        cpu, wall = _LIMITS[limit]
        quiet = ["-x", "-q", "--no-header", "--color=no", "--tb=line", "-p", "no:cacheprovider", "--timeout=300"]
        marks = "not long" if ranks == 1 else "mpi and not long"
        command = [sys.executable, "-m", "pytest", *quiet, "-m", marks]
        if ranks == 1 and workers > 1:
            command += ["-n", str(workers)]
        if ranks > 1:
            command = ["mpirun", "-n", str(ranks), *command]
            cpu, wall = 2 * cpu, 2 * wall
        limited = f'ulimit -t {cpu} && ulimit -v {_MEMORY} && exec "$@"'
        environment = {
            **os.environ,
            "PYTHONPATH": str(self.code),
            "PYTHONDONTWRITEBYTECODE": "" if self._first else "1",
            "XDG_CACHE_HOME": str(self.cache),
            "TMPDIR": str(self.folder / "tmp"),
        }
        with (self.folder / "output").open("w+", encoding="utf-8", errors="replace") as output:
            process = subprocess.Popen(
                ["sh", "-c", limited, "sh", *command, *arguments],
                cwd=self.code,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
            _RUNNING.add(process.pid)
            try:
                if _STOP.is_set():
                    raise KeyboardInterrupt
                code: int | None = process.wait(timeout=wall)
            except subprocess.TimeoutExpired:
                code = None
            finally:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
                process.wait()
                _RUNNING.discard(process.pid)
            if _STOP.is_set():  # killed, not ended
                raise KeyboardInterrupt
            output.seek(0)
            return (code if code is not None and 0 <= code <= 5 else None), output.read()


# The running processes, and whether they are to end.
_RUNNING: set[int] = set()
_STOP = threading.Event()


def _link(source: str, target: str) -> None:
    """A second name for a file, or a copy where that cannot be."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


@contextlib.contextmanager
def copied(original: Copy | None = None) -> Iterator[Copy]:
    """A copy that is removed in the end: of another copy with its compiled forms, else of the checkout with the user's.

    What is changed in the checkout while mutants are tried does not matter.
    """
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    with tempfile.TemporaryDirectory(prefix="mutant-") as name:
        yield Copy(Path(name), cache) if original is None else Copy(Path(name), original.cache, original.code)


class Trials:
    """Tries mutants; tests are judged by whether they pass on the code as it is."""

    def __init__(self, original: Copy, recorded: dict[str, tuple[int, str]], *, near: bool, workers: int = 1) -> None:
        """Collect the tests.

        Args:
            original: a copy without a mistake.
            recorded: mutant -> number of ranks and test that noticed it the last time.
            near: leave out the suite: what survives is not known to survive.
            workers: processes side by side.

        Raises:
            SystemExit: they cannot be collected.
        """
        self._original, self._near, self._workers = original, near, workers
        self._right: set[tuple[int, str]] = set()
        code, text = original.pytest(1, ["--collect-only", "-m", "", "tests"], "files")
        if code != 0:
            raise SystemExit(f"the tests cannot be collected:\n{text}")
        self._tests = {line.strip() for line in text.splitlines() if "::" in line}
        files = {test.partition("::")[0] for test in self._tests} - set(_NOT_FOR_COPIES)
        self._quick = [path for name in _FIRST if (path := in_its_room(f"test_{name}.py")) in files]
        self._files = [*self._quick, *sorted(files - set(self._quick))]
        self._recorded = {idea: last for idea, last in recorded.items() if last[1] in self._tests}

    def warm_up(self, mutants: Sequence[Mutant]) -> None:
        """Run on the code as it is, all at once, what most mutants will meet: it must pass, and compiles the forms.

        Raises:
            SystemExit: it does not pass.
        """
        wanted = {(self._recorded[m.idea][0], self._recorded[m.idea][1]) for m in mutants if m.idea in self._recorded}
        if any(mutant.idea not in self._recorded for mutant in mutants):
            wanted |= {(1, file) for file in self._quick}
        for ranks in sorted({ranks for ranks, _ in wanted}):
            tests = sorted(test for n, test in wanted if n == ranks)
            code, text = self._original.pytest(ranks, tests, "suite", workers=self._workers)
            if code != 0:
                raise SystemExit(f"tests fail on the code as it is, on {ranks} ranks:\n{text}")
        self._right = wanted

    def wrong(self, fates: Iterable[Fate]) -> set[tuple[int, str]]:
        """Ranks and tests that noticed mutants and fail on the code as it is, too; what has passed is not run again."""
        noticed = {(fate.ranks, fate.by) for fate in fates if fate.fate == NOTICED and fate.by in self._tests}
        noticed = {(n, test) for n, test in noticed if not self._right & {(n, test), (n, test.partition("::")[0])}}
        found = set()
        for ranks in sorted({ranks for ranks, _ in noticed}):
            tests = sorted(test for n, test in noticed if n == ranks)
            code, text = self._original.pytest(ranks, [*tests, "--maxfail=0"], "suite", workers=self._workers)
            if code != 0:
                lines = [line.partition(" ")[2] for line in text.splitlines() if line.startswith(("FAILED ", "ERROR "))]
                failed = {(ranks, test) for test in tests if any(line.startswith(test) for line in lines)}
                found |= failed or {(ranks, test) for test in tests}
        return found

    def try_one(self, mutant: Mutant) -> Fate:
        """Run tests against a copy with the mistake in it."""
        begin = time.monotonic()
        named = mutant.named
        stages: list[tuple[str, int, list[str]]] = []
        if mutant.idea in self._recorded:
            ranks, test = self._recorded[mutant.idea]
            stages.append(("test", ranks, [test]))
        if named:
            stages.append(("files", mutant.ranks, named))
        if mutant.ranks == 1:
            stages.append(("files", 1, self._quick))
        if not self._near:
            stages.append(
                ("suite", mutant.ranks, self._files[len(self._quick) :] if mutant.ranks == 1 else self._files)
            )
            if mutant.ranks == 1:
                stages.append(("suite", 2, self._files))
        with copied(self._original) as copy:
            mutant.spoil(copy.code / "signorini_fx")
            for limit, ranks, arguments in stages:
                code, text = copy.pytest(ranks, arguments, limit)
                if code is None:
                    last = next((line for line in reversed(text.splitlines()) if line.strip()), "")
                    return Fate(LIMIT, last[:100], ranks, time.monotonic() - begin)
                if code in (1, 2):
                    return Fate(NOTICED, self._failed(text), ranks, time.monotonic() - begin)
                if code not in (0, 5):
                    raise SystemExit(f"{mutant.idea}: pytest ended with {code}:\n{text}")
        return Fate(SURVIVES, "", mutant.ranks, time.monotonic() - begin)

    def _failed(self, text: str) -> str:
        """The first test that failed, from what pytest printed."""
        for line in text.splitlines():
            name, stuck, _ = line.partition(": rank ")
            if stuck and name in self._tests:  # tests/conftest.py ends ranks that wait for another one
                return name
            if line.startswith(("FAILED ", "ERROR ")):
                rest = line.partition(" ")[2]
                return max((test for test in self._tests if rest.startswith(test)), key=len, default=rest)
        return "the process died"


def digest() -> str:
    """Of everything that a fate depends on, but for the mutant."""
    total = hashlib.sha256()
    for folder in ("signorini_fx", "meshes", "tests", "demos"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts and "results" not in path.parts:
                total.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return total.hexdigest()


class Record:
    """The fates of an interrupted run, in a file."""

    def __init__(self, path: Path, *, again: bool) -> None:
        self._path, self._lock, self._digest = path, threading.Lock(), digest()
        self.fates: dict[str, Fate] = {}
        self.tests: dict[str, tuple[int, str]] = {}
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
            data = json.loads(path.read_text(encoding="utf-8"))
            fates = data["fates"].items()
            self.tests = {idea: (row["ranks"], row["by"]) for idea, row in fates if row["fate"] == NOTICED}
            if data["digest"] == self._digest and not again:
                known = {_key(mutant): mutant.idea for mutant in MUTANTS}
                self.fates = {
                    known[row.pop("key")]: Fate(**row) for row in data["fates"].values() if row["key"] in known
                }

    def add(self, mutant: Mutant, fate: Fate) -> None:
        """Keep a fate."""
        with self._lock:
            self.fates[mutant.idea] = fate
            self._write()

    def drop(self, ideas: Iterable[str]) -> None:
        """Forget fates."""
        with self._lock:
            self.fates = {idea: fate for idea, fate in self.fates.items() if idea not in set(ideas)}
            self._write()

    def _write(self) -> None:
        keys = {mutant.idea: _key(mutant) for mutant in MUTANTS}
        fates = {idea: {"key": keys[idea], **asdict(fate)} for idea, fate in self.fates.items()}
        part = self._path.with_suffix(".part")
        part.write_text(json.dumps({"digest": self._digest, "fates": fates}, indent=1), encoding="utf-8")
        part.replace(self._path)


def _key(mutant: Mutant) -> str:
    return hashlib.sha256(repr(mutant).encode()).hexdigest()


def recorded_tests() -> dict[str, tuple[int, str]]:
    """Mutant -> number of ranks and test, from the table."""
    with contextlib.suppress(OSError), TABLE.open(encoding="utf-8", newline="") as file:
        rows = [(row["mistake"], row["ranks"], row["noticed by"]) for row in csv.DictReader(file)]
        return {idea: (int(ranks), in_its_room(test)) for idea, ranks, test in rows if test.startswith("test_")}
    return {}


def rows_of(fates: dict[str, Fate]) -> list[tuple[str, str, str, str]]:
    """The rows of docs/evidence/mutants.csv."""
    rows = []
    for mutant in MUTANTS:
        fate = fates[mutant.idea]
        noticed = re.sub("^tests/([a-z_]+/)?", "", fate.by) if "::" in fate.by else fate.by
        if fate.fate == LIMIT:
            noticed = "a limit of time or memory"
        if fate.fate == SURVIVES:
            noticed = f"equivalent: {mutant.equivalent}" if mutant.equivalent else "survives"
        rows.append((mutant.idea, mutant.place(ROOT / "signorini_fx"), str(fate.ranks), noticed))
    return rows


def write_table(fates: dict[str, Fate]) -> None:
    """Write the table, and print how many are noticed."""
    rows = rows_of(fates)
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([COLUMNS, *rows])
    survive = sum(row[3] == "survives" for row in rows)
    equal = sum(row[3].startswith("equivalent: ") for row in rows)
    print(f"Of {len(rows)} mutants {len(rows) - survive - equal} are noticed, {equal} equivalent, {survive} survive.")


def misfits() -> list[str]:
    """What of the list does not fit the code."""
    found = []
    for mutant in MUTANTS:
        try:
            mutant.spoilt(ROOT / "signorini_fx")
        except (ValueError, SyntaxError) as error:
            found.append(f"{mutant.idea}: {error}")
    return found


def _try(left: Sequence[Mutant], record: Record, *, near: bool, workers: int) -> set[tuple[int, str]]:
    """Try mutants and keep their fates.

    Returns:
        Ranks and tests that fail on the code as it is; what they noticed is forgotten.
    """
    with copied() as original:
        known = {**recorded_tests(), **record.tests}
        trials = Trials(original, known, near=near, workers=workers)
        trials.warm_up(left)

        def work(mutant: Mutant) -> None:
            fate = trials.try_one(mutant)
            if not (near and fate.fate == SURVIVES):
                record.add(mutant, fate)
            told = f"{fate.fate:9s}{fate.seconds:5.0f} s  {fate.ranks}  {mutant.module:15s} {mutant.idea:50s} {fate.by}"
            print(told, flush=True)

        # Those of which nothing is known may take long, and nothing else is to wait for them in the end.
        left = sorted(left, key=lambda mutant: mutant.idea in known)
        # Several ranks need the machine for themselves.
        for several in (True, False):
            with ThreadPoolExecutor(1 if several else workers) as pool:
                jobs = [pool.submit(work, mutant) for mutant in left if (mutant.ranks > 1) == several]
                try:
                    for job in jobs:
                        job.result()
                except BaseException:
                    _STOP.set()
                    pool.shutdown(wait=False, cancel_futures=True)
                    for group in list(_RUNNING):
                        with contextlib.suppress(ProcessLookupError):
                            os.killpg(group, signal.SIGKILL)
                    raise
        wrong_tests = trials.wrong(record.fates[mutant.idea] for mutant in left if mutant.idea in record.fates)
        record.drop([idea for idea, fate in record.fates.items() if (fate.ranks, fate.by) in wrong_tests])
    return wrong_tests


def main(arguments: Sequence[str] | None = None) -> int:
    """Try the mutants."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as shells leave it in the background; a test interrupts
        signal.signal(signal.SIGINT, signal.default_int_handler)
    parser = argparse.ArgumentParser(prog="python3 -m stability.mutants", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--quick", action="store_true", help=f"{len(QUICK)} of the {len(MUTANTS)}")
    parser.add_argument(
        "--only", metavar="WORD,...", default="", help="those whose module, or a word of whose idea, it is"
    )
    parser.add_argument("--workers", type=int, default=min(2, os.cpu_count() or 1), metavar="N", help="side by side")
    parser.add_argument("--again", action="store_true", help="forget what an interrupted run has found")
    parser.add_argument("--near", action="store_true", help="leave out the tests that are far from the mistake")
    parser.add_argument("--check", action="store_true", help="only say which mutants do not fit the code")
    parser.add_argument("--out", type=Path, default=Path("results/stability"), metavar="DIR")
    given = parser.parse_args(arguments)
    wrong = misfits()
    if wrong or given.check:
        print("\n".join(wrong) or f"{len(MUTANTS)} mutants fit the code")
        return int(bool(wrong))
    words = set(filter(None, given.only.split(",")))
    chosen = [
        m for m in (QUICK if given.quick else MUTANTS) if not words or words & {m.module, m.idea, *m.idea.split()}
    ]
    given.out.mkdir(parents=True, exist_ok=True)
    record = Record(given.out / "mutants.json", again=given.again)
    left = [mutant for mutant in chosen if mutant.idea not in record.fates]
    begin = time.monotonic()
    wrong_tests = _try(left, record, near=given.near, workers=given.workers) if left else set()
    if wrong_tests:
        names = "\n".join(f"{test} on {ranks} ranks" for ranks, test in sorted(wrong_tests))
        print(f"These tests fail on the code as it is, and what they noticed does not count; run it again:\n{names}")
        return 2
    survivors = [m for m in chosen if m.idea not in record.fates or record.fates[m.idea].fate == SURVIVES]
    bare = [m for m in survivors if not m.equivalent]
    if len(record.fates) == len(MUTANTS):
        write_table(record.fates)
    print(
        f"{len(chosen)} mutants, {len(chosen) - len(survivors)} noticed, {len(survivors) - len(bare)} equivalent, "
        f"{len(bare)} survive; {time.monotonic() - begin:.0f} s"
    )
    for mutant in bare:
        print(f"survives: {mutant.module}: {mutant.idea}")
    return int(bool(bare))


if __name__ == "__main__":
    sys.exit(main())
