"""The stability suite: its short form has no red row, and what is wrong does come out red."""

import csv
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

from benchmarks.stability.case import GOOD, RED, REPORTED  # noqa: E402
from benchmarks.stability.groups import GROUPS, cases_of  # noqa: E402
from benchmarks.stability.report import table, tally  # noqa: E402
from benchmarks.stability.runner import Runner  # noqa: E402

# Groups whose cases are the tests themselves: tests/solving/test_faults.py.
RUN_BY_TESTS = {"faults"}
# What no other file of tests does: cases drawn at random, of which one run has many.
AT_RANDOM = ("scatter", "fuzz")


@pytest.mark.one_quick
@pytest.mark.parametrize("groups", [AT_RANDOM, tuple(GROUPS)], ids=["drawn at random", "every group"])
def test_the_short_form(tmp_path, groups):
    """``make stability`` with its cheapest cases: no red row, and all its files."""
    command = [
        sys.executable,
        "-m",
        "benchmarks.stability",
        "--short",
        "--only",
        ",".join(groups),
        "--out",
        str(tmp_path),
    ]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=500, check=False)
    with (tmp_path / "stability.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    red = [
        (row["group"], row["case"], row["outcome"], row["error"], row["note"]) for row in rows if row["verdict"] == RED
    ]
    assert not red
    assert run.returncode == 0, run.stderr
    assert {row["group"] for row in rows} == set(groups) - RUN_BY_TESTS
    assert all(row["note"] for row in rows if row["verdict"] == REPORTED)
    assert "RED" in run.stdout.splitlines()[-2]  # the tally names all verdicts
    assert (tmp_path / "stability.png").stat().st_size > 10_000


def test_what_is_wrong_is_red():
    """A hang, a crash, an error, a wrong answer, a lie: each is a red row, and the cases after it run."""
    with Runner(short=False) as runner:
        rows = list(runner.group("broken", 1))
    verdicts = {row.case: row.verdict for row in rows}
    expected = {
        "good": GOOD,
        "hangs": RED,
        "good after a hang": GOOD,
        "crashes": RED,
        "raises": RED,
        "wrong answer": RED,
        "no answer": RED,
        "not a number": RED,
        "no certificate": RED,
        "another outcome": RED,
        "allowed outcome": REPORTED,
        "good at the end": GOOD,
    }
    assert verdicts == expected
    outcomes = {row.case: row.outcome for row in rows}
    assert (outcomes["hangs"], outcomes["crashes"]) == ("time limit passed", "process died")
    assert "on purpose" in next(row.note for row in rows if row.case == "raises")
    assert "why" in table(rows)
    assert tally(rows) == "12 cases: 3 as expected, 1 failure reported, 8 RED"


@pytest.mark.parametrize("group", GROUPS)
def test_the_short_form_is_part_of_the_whole(group):
    """The tests run nothing that ``make stability`` does not, but for smaller batches of random scenes."""
    whole, short = ({case.name for case in cases_of(group, short=form)} for form in (False, True))
    assert short or group in RUN_BY_TESTS
    assert len(short - whole) <= (group in ("scatter", "fuzz"))
