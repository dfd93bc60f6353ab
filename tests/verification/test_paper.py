"""demos/paper.py: the paper's tables, computed through its command line, against the printed
numbers.
"""

import json
from itertools import pairwise
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[2]
PRINTED = json.loads((ROOT / "demos" / "paper" / "printed.json").read_text())


def run(main, folder, *options):
    """Run the command; the numbers that it writes."""
    numbers = folder / "numbers.json"
    assert main([*options, "--json", str(numbers), "--out", str(folder)]) == 0
    return json.loads(numbers.read_text())


@pytest.fixture(scope="module")
def command():
    """That of the script, in this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT / "demos")
        from paper.command import main

        yield main


@pytest.fixture(scope="module")
def tables(command, tmp_path_factory):
    """Tables 2, 4 and 5."""
    return run(command, tmp_path_factory.mktemp("tables"), "--tables", "2", "4", "5")


def test_tables_1_and_3(command, tmp_path):
    """All 66 entries; nothing else is computed."""
    found = run(command, tmp_path, "--tables", "1", "3")
    assert sorted(found) == ["table1", "table3"]
    assert found["table1"]["iterations"] == PRINTED["table1"]["iterations"]
    for grid in ("60x20", "120x40", "240x80"):
        assert found["table3"][grid] == PRINTED["table3"][grid]
    assert "36 of 36 printed numbers equal" in (tmp_path / "table1.txt").read_text()
    assert "30 of 30 printed numbers equal" in (tmp_path / "table3.txt").read_text()
    assert not [*tmp_path.glob("figure*")]


def test_table_2(tables):
    """Superlinear convergence: the quotients fall to 0."""
    q = tables["table2"]["q"]
    assert len(q) >= len(PRINTED["table2"]["q"])
    assert all(following < before for before, following in pairwise(q))
    assert q[-1] == 0


@pytest.mark.parametrize("grid", ["60x20", "120x40", "240x80"])
def test_table_4(tables, grid):
    """Continuation: the warm stage takes one linear solve less than is printed."""
    found, printed = tables["table4"][grid], PRINTED["table4"][grid]
    assert found["first"] == printed["first"]
    assert found["direct"] == printed["direct"]
    assert found["second"] == printed["second"]
    assert found["second_linear_solves"] == [printed["second"] - 1] * 2
    assert all(
        abs(ours - theirs) <= 1 for ours, theirs in zip(found["sum"], printed["sum"], strict=True)
    )


@pytest.mark.parametrize(
    ("name", "inner_off", "d_off"),
    [("gamma=1e6", 0, 0.02), ("gamma=1e7", 1, 0.15), ("gamma=10^(4+l)", 0, 0.01)],
)
def test_table_5(tables, name, inner_off, d_off):
    """Inexact (ALM): the inner iterations but one, and the distances but for two digits."""
    found, printed = tables["table5"][name], PRINTED["table5"][name]
    assert (
        sum(ours != theirs for ours, theirs in zip(found["inner"], printed["inner"], strict=True))
        <= inner_off
    )
    assert found["d"] == pytest.approx(printed["d"], rel=d_off)


@pytest.mark.parametrize(
    ("name", "solves"), [("exact gamma=1e7", 19), ("exact gamma=1e6 growing tenfold", 16)]
)
def test_exact_augmented_lagrangian(tables, name, solves):
    """Two updates, and as many solves as are printed."""
    found, printed = tables["table5"][name], PRINTED["table5"][name]
    assert found["linear_solves"] == printed["linear_solves"] == solves
    assert found["outer"] == printed["outer"]
    assert found["d"] == pytest.approx(printed["d"], rel=0.03)
