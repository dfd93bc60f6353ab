"""The benchmark: its rivals solve the same problem, and a run on tiny meshes fills its files."""

import csv
import subprocess
import sys
from pathlib import Path

import pytest
from mpi4py import MPI

BENCH = Path(__file__).parent.parent / "bench"
sys.path.insert(0, str(BENCH))

import contestants  # noqa: E402
import example1  # noqa: E402
import linear  # noqa: E402
import plain  # noqa: E402
import rival  # noqa: E402

from signorini_fx import solve  # noqa: E402

GROUPS = {
    "tresca",
    "coulomb",
    "sweep",
    "plain",
    "rival",
    "growth",
    "memory",
    "nested",
    "ranks",
    "counts",
    "import",
    "large",
    "space",
}


@pytest.fixture(scope="module")
def tagged():
    """A coarse mesh of Example 1."""
    return example1.tagged_mesh(60)


def package(law, tagged, **settings):
    """The answer of the package."""
    return example1.Answer.of(solve(example1.scene(law, tagged, **settings), MPI.COMM_SELF))


@pytest.mark.parametrize(("law", "other"), [("tresca", rival.tresca), ("coulomb", rival.coulomb)])
def test_the_rival_takes_the_same_steps(tagged, law, other):
    """Same pressure, shear, sets, and number of linear solves: the paper's algorithms, written twice."""
    ours, theirs = package(law, tagged, coulomb="fp"), other(tagged)
    assert ours.differs(theirs) == ""
    assert ours.solves == theirs.solves


def test_the_plain_way_arrives(tagged):
    """SNES on the max/min form comes to the same pressure and sets, with many more solves."""
    ours, theirs = package("tresca", tagged), plain.tresca(tagged)
    assert ours.differs(theirs) == ""
    assert theirs.solves > 5 * ours.solves


def test_a_difference_is_noticed(tagged):
    """The check before the clock starts is one."""
    ours = package("tresca", tagged)
    assert "pressure" in ours.differs(package("tresca", tagged, gamma=1e7))
    outcome = contestants.Outcome([package("coulomb", tagged)])
    reference = {"tresca": contestants.Outcome([ours])}
    with pytest.raises(RuntimeError, match=r"plain at .* cells differs: pressure"):
        contestants.check("plain", outcome, reference, tagged)


def test_the_linear_solves_agree(tagged):
    """MUMPS and CHOLMOD solve the same linear problem."""
    one, other = (linear.solve(tagged, package)[0] for package in ("mumps", "cholmod"))
    one.axpy(-1.0, other)
    assert one.norm() < 1e-10 * other.norm()


def test_the_plain_way_has_limited_time(tagged, monkeypatch):
    """Stopped before its last gamma it says so, and no answer is compared."""
    monkeypatch.setattr(contestants, "PATIENCE", 0.0)
    outcome = contestants.ALL["plain"](tagged)
    assert not outcome.answers
    assert "at least" in outcome.unfinished
    contestants.check("plain", outcome, {"tresca": contestants.Outcome([package("tresca", tagged)])}, tagged)


@pytest.mark.parametrize("groups", [{"tresca", "import"}, pytest.param(GROUPS, marks=pytest.mark.long)], ids=len)
def test_every_row_is_written(groups, tmp_path):
    """A run on tiny meshes writes all rows, every run behind them, and the picture."""
    command = [
        sys.executable,
        str(BENCH / "run.py"),
        "--quick",
        "--repeats",
        "1",
        "--levels",
        "2",
        "--only",
        ",".join(groups),
    ]
    ended = subprocess.run(
        [*command, "--sizes", "24,24,48,48", "--out", str(tmp_path)], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stderr
    with (tmp_path / "rows.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert {row["group"] for row in rows} == groups
    assert not [row for row in rows if "failed" in row["what"]]
    assert all(float(row["value"]) > 0 for row in rows)
    assert {row["verdict"] for row in rows} <= {"reached", "NOT REACHED", "information"}
    for row in rows:
        assert row["what"] in ended.stdout
    with (tmp_path / "samples.csv").open(newline="", encoding="utf-8") as file:
        ran = {row["contestant"] for row in csv.DictReader(file)}
    assert ran == (set(contestants.ALL) if groups == GROUPS else {"tresca", "mumps", "cholmod"})
    assert (tmp_path / "performance.png").stat().st_size > 10_000
