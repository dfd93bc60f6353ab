"""Which tests `make test` leaves to `make test-slow`: measured, and chosen by a rule (``tests/slow_tests.txt``).

    ./env python3 tests/tiers.py measure [FILE ...]    # CPU time and lines of each test of one rank, in build/tiers
    ./env python3 tests/tiers.py choose                # lists the slow tests of the files that were measured

A test is slow if it takes more than ``DEAR`` seconds, or what stays of its function more than ``TOGETHER``, if another
set of parameters of its function stays or it takes more than ``ALONE`` seconds, and if the tests that stay run every
line of the package that it runs.  What notices a mistake of docs/evidence/mutants.csv stays, and so do the tables of
the paper.  ``REPEATED`` names what is slow because a test of another function shows the same.

On several ranks stays what notices a mistake there; of the functions that take at most ``COSTLY`` seconds on one rank
also, on two, the first set of parameters, and on three the last test of each file, and the last set of parameters of
each function of the files that are about ranks.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections import Counter
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))
LIST = ROOT / "tests" / "slow_tests.txt"
NOT_THERE = pytest.StashKey[list[str]]()  # what LIST names and the collected files have not
MEASURED = ROOT / "build" / "tiers"
# CPU seconds above which a test may be slow, above which one of a function with many sets of parameters may be, and
# above which all of a function may be.
DEAR, TOGETHER, ALONE = 0.3, 0.7, 0.7
# CPU seconds on one rank above which a function is slow on several; it is listed behind this mark.
COSTLY, ON_SEVERAL = 0.3, "on several ranks: "
# What is never slow, beside what notices a mistake.
ALWAYS = {"test_paper.py"}
# What is slow although no other set of parameters stays: what other tests show is named behind it.
REPEATED = {
    "test_demos.py::test_sphere_under_tangential_load",  # test_space_known.py, test_two_bodies_scenes.py
}


@dataclass(frozen=True)
class Test:
    """A test as it was measured.

    Attributes:
        name: its node, without folders.
        seconds: CPU time, its fixtures included.
        lines: of the package.
        on_ranks: whether it is marked mpi.
    """

    __test__ = False

    name: str
    seconds: float
    lines: frozenset[Hashable]
    on_ranks: bool

    @property
    def function(self) -> str:
        """Its function, whatever the parameters."""
        return self.name.partition("[")[0]


def slow_on(names: Sequence[str], ranks: int) -> set[str]:
    """Which of some tests, in the order of their files, are slow on a number of ranks."""
    slow = listed()
    if ranks > 1:
        dear, there = costly(), set()
        notice = {name for count, name in noticing() if count == ranks}
        for name in names if ranks == 2 else reversed(names):
            file, function = name.partition("::")[0], name.partition("[")[0]
            one = function if ranks == 2 or "ranks" in file else file
            if name not in slow and (one in there or {name, function} & dear) and not {name, function, file} & notice:
                slow.add(name)
            elif name not in slow:
                there.add(one)
    return slow


def listed() -> set[str]:
    """The tests of ``slow_tests.txt`` that are slow on any number of ranks."""
    return {line for line in _lines() if not line.startswith(ON_SEVERAL)}


def costly() -> set[str]:
    """The functions of ``slow_tests.txt``, or tests of them, that are slow on several ranks."""
    return {line.removeprefix(ON_SEVERAL) for line in _lines() if line.startswith(ON_SEVERAL)}


def _lines() -> list[str]:
    return [line for line in LIST.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]


def node_of(item: pytest.Item) -> str:
    """A test by its file and name: files have different names, whichever folder they lie in."""
    return f"{item.path.name}::{item.nodeid.partition('::')[2]}"


def noticing() -> set[tuple[int, str]]:
    """Ranks and tests, or functions or files of them, that notice the mistakes of docs/evidence/mutants.csv."""
    from stability.mistakes import MUTANTS
    from stability.mutants import recorded_tests

    recorded = recorded_tests()
    every = [[recorded[m.idea]] if m.idea in recorded else [(m.ranks, name) for name in m.named] for m in MUTANTS]
    return {(ranks, re.sub("^tests/([a-z_]+/)?", "", name)) for tests in every for ranks, name in tests}


def chosen(tests: list[Test], noticing: set[tuple[int, str]]) -> list[str]:
    """The tests that are slow."""
    kept = ALWAYS | {name for _, name in noticing}
    runs, of = Counter(line for test in tests for line in test.lines), Counter(test.function for test in tests)
    slow, seconds = [], Counter()
    for test in tests:
        seconds[test.function] += test.seconds
    for test in sorted(tests, key=lambda test: -test.seconds):
        stays = {test.name, test.function, test.name.partition("::")[0]} & kept
        dear = of[test.function] > 1 and (test.seconds > DEAR or seconds[test.function] > TOGETHER)
        # What runs in processes of its own has no lines, so that nothing says that others show the same.
        dear |= test.seconds > ALONE and len(test.lines) > 0
        if dear and not stays and all(runs[line] > 1 for line in test.lines):
            slow.append(test.name)
            of[test.function] -= 1
            seconds[test.function] -= test.seconds
            runs.subtract(test.lines)
    return sorted(slow)


def measured() -> list[Test]:
    """What ``measure`` has left, from all of its processes."""
    from stability.lines import recorded

    return [
        Test(re.sub("^tests/([a-z_]+/)?", "", node), seconds, lines, on_ranks)
        for file in sorted(MEASURED.glob("*.pickle"))
        for node, seconds, on_ranks, lines in recorded(file)
    ]


def main(command: str, *files: str) -> int:
    """Measure, in a process for each file, or choose."""
    if command == "measure":
        MEASURED.mkdir(parents=True, exist_ok=True)
        for file in files or sorted(map(str, (ROOT / "tests").rglob("test_*.py"))):
            record = ["-p", "stability.lines", "--lines", str(MEASURED / f"{Path(file).stem}.pickle")]
            subprocess.run([sys.executable, "-m", "pytest", "-qm", "not long", *record, file], cwd=ROOT, check=True)
        return 0
    tests = measured()
    files, names = {test.name.partition("::")[0] for test in tests}, {test.name for test in tests}
    slow = set(chosen(tests, noticing())) | (REPEATED & names)
    head = [line for line in LIST.read_text(encoding="utf-8").splitlines() if line.startswith("#")]
    every = sorted(slow | (listed() - names))
    on_several = {test.function for test in tests if test.on_ranks and test.seconds > COSTLY and test.name not in slow}
    on_several |= {name for name in costly() if name.partition("::")[0] not in files}
    LIST.write_text(
        "\n".join([*head, *every, *(ON_SEVERAL + name for name in sorted(on_several)), ""]), encoding="utf-8"
    )
    total, saved = (sum(test.seconds for test in tests if all_ or test.name in slow) for all_ in (True, False))
    print(f"slow: {len(slow)} of {len(tests)} tests of {len(files)} files, {saved:.0f} of {total:.0f} CPU seconds")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
