"""The runner: verdicts, refusals by line, exit codes, skipped programs, and what it writes."""

import csv
import sys

import pytest

from .. import command
from ..adapters import ADAPTERS
from ..answers import CannotRun
from ..judging import (
    Result,
    ResultError,
    judge,
    read_results,
    without_value,
)
from ..problem import problem_names, read_problem

PROBLEM = read_problem("smooth-edge")
GOOD = (
    "quantity,value,unknowns,seconds\nforce,6.67,306,0.1\nmoment, 4.0,,\n\nopening,0.0121,,2e-1\n"
)


def written(tmp_path, text):
    path = tmp_path / "mine.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_is_read(tmp_path):
    """With other columns, in any order, with blank lines, blanks and a mark of byte order."""
    expected = [Result("force", 6.67), Result("moment", 4.0), Result("opening", 0.0121)]
    assert read_results(written(tmp_path, GOOD), PROBLEM) == expected
    assert read_results(written(tmp_path, "\ufeffvalue, Quantity\r\n-1e-3,force\r\n"), PROBLEM) == [
        Result("force", -0.001)
    ]
    assert without_value(PROBLEM, expected) == ["strain energy"]


BAD = {
    "empty": ("", "line 1: the columns must be"),
    "no value column": ("quantity\nforce\n", "line 1: the columns must be"),
    "a column twice": ("quantity,value,value\nforce,1,1\n", "line 1: the columns must be"),
    "no rows": ("quantity,value\n", "no row with a value"),
    "a cell too many": ("quantity,value\nforce,1\nmoment,1,2\n", "line 3: 3 cells instead of 2"),
    "a comma as the decimal mark": (
        'quantity,value\nforce,"6,67"\n',
        "line 2: value '6,67' is not a number",
    ),
    "not a number": ("quantity,value\nforce,nan\n", "line 2: value 'nan' is not finite"),
    "infinite": ("quantity,value\nforce,-inf\n", "line 2: value '-inf' is not finite"),
    "no value": ("quantity,value\n\nforce,\n", "line 3: value '' is not a number"),
    "another quantity": (
        "quantity,value\nweight,1\n",
        "line 2: smooth-edge has no quantity 'weight': it has force,",
    ),
}


@pytest.mark.parametrize("what", BAD)
def test_a_bad_file_is_refused_by_line(tmp_path, capsys, what):
    text, message = BAD[what]
    path = written(tmp_path, text)
    with pytest.raises(ResultError) as error:
        read_results(path, PROBLEM)
    assert message in str(error.value)
    assert str(error.value).startswith("mine.csv")
    assert command.main(["judge", "smooth-edge", str(path)]) == 2
    assert message in capsys.readouterr().err


def test_no_file(tmp_path, capsys):
    (tmp_path / "bytes.csv").write_bytes(b"quantity,value\nforce,\xff\n")
    for name in ("none.csv", "bytes.csv"):
        assert command.main(["judge", "smooth-edge", str(tmp_path / name)]) == 2
        assert "cannot be read as text" in capsys.readouterr().err
    assert command.main(["judge", "smooth", str(tmp_path / "bytes.csv")]) == 2
    assert "there is no problem 'smooth'" in capsys.readouterr().err


@pytest.mark.parametrize("name", problem_names())
def test_verdicts(name):
    """Beyond the tolerance of a reference on either side nothing passes; within it everything
    does.
    """
    problem = read_problem(name)
    for quantity in problem.quantities:
        step = quantity.tolerance * quantity.scale
        for side, end in ((-1, min(quantity.numbers)), (1, max(quantity.numbers))):
            for share, meets in ((0.99, True), (1.01, False)):
                verdict = judge(problem, [Result(quantity.name, end + side * share * step)])[0]
                assert verdict.meets == meets
                assert ("MISSES" in verdict.text) == (not meets)
        assert not judge(problem, [Result(quantity.name, -quantity.numbers[0])])[0].meets
        assert not judge(problem, [Result(quantity.name, 0.0)])[0].meets


def test_the_command_judges(tmp_path, capsys):
    path = written(tmp_path, GOOD)
    assert command.main(["judge", "smooth-edge", str(path)]) == 0
    text = capsys.readouterr().out
    assert "force: 6.67 is 0.05 % from the exact value 6.666667: meets 0.5 %" in text
    assert "strain energy: not given" in text
    path = written(tmp_path, GOOD.replace("6.67", "6.6"))
    assert command.main(["judge", "smooth-edge", str(path)]) == 1
    assert "force: 6.6 is 1 % from the exact value 6.666667" in capsys.readouterr().out


def test_meshes_are_written(tmp_path):
    assert (
        command.main(["mesh", "wedge", "sphere-space", "--levels", "2", "--out", str(tmp_path)])
        == 0
    )
    stems = [f"{name}-{level}" for name in ("wedge", "sphere-space") for level in (0, 1)]
    assert {path.name for path in tmp_path.iterdir()} == {
        stem + end for stem in stems for end in (".msh", ".inp")
    }
    assert command.main(["mesh", "nothing", "--out", str(tmp_path)]) == 2


def test_programs_that_are_not_there_are_named(monkeypatch, capsys, tmp_path):
    """No program is passed over in silence, no failure ends the others, and both are in the CSV."""
    for name in ("signorini_fx", "dolfinx", "getfem"):
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setenv("CCX", "no-such-program")
    assert command.main(["run", "wedge"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(": skipped: ")[0] for line in lines] == list(ADAPTERS)
    assert all(len(line.split(": skipped: ")[1]) > 20 for line in lines)

    def solve(problem, grid):
        if problem.name == "wedge":
            raise CannotRun("it has no wedges")
        raise RuntimeError("it diverged")

    monkeypatch.setattr(command, "adapter", lambda program: solve)
    table = tmp_path / "found.csv"
    arguments = ["run", "wedge", "ring", "--program", "getfem", "--csv", str(table)]
    assert command.main(arguments) == command.main(arguments) == 1
    with table.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["problem"], row["meets"], row["note"]) for row in rows] == [
        ("wedge", "skipped", "it has no wedges"),
        ("ring", "failed", "it diverged"),
    ]
    said = capsys.readouterr().out.splitlines()
    assert said.count("getfem, ring, level 0: FAILED: it diverged") == 1  # not run again
    assert said.count("getfem fails: ring") == 2
    assert said[-1] == "| getfem | 0 | 1 | 1 | 0 | 0 | 0 |"
