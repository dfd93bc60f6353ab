"""What ``solve`` and ``check`` print unless they are asked for more: few lines, none of them long,
and true.
"""

import re
from pathlib import Path

import pytest
from scenes import example1

from signorini_fx import solve, write_results
from signorini_fx.quantities.shown import short_answer
from signorini_fx.results.summary import lines_of
from signorini_fx.scenes.cli import main

FOLDER = Path("results/scene")


@pytest.fixture(scope="module")
def summary(tmp_path_factory):
    """Of results with fields."""
    folder = tmp_path_factory.mktemp("results") / "scene"
    return write_results(solve(example1(coefficient=0.3, nx=24, ny=8)), folder, pictures=False)


def told(summary):
    return list(map(str, short_answer(summary, FOLDER)))


def labels(lines):
    return [line[:14].strip() for line in lines]


def test_what_is_said(summary):
    """The lines in their order, with the figures of the summary."""
    lines = told(summary)
    known = [
        "warning",
        "force",
        "contact",
        "stress",
        "friction",
        "error",
        "cost",
        "certificate",
        "effort",
        "results",
    ]
    assert [label for label in labels(lines)[1:] if label] == known
    assert lines[0].endswith("converged")
    numbers = {
        label: re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", line)
        for label, line in zip(labels(lines), lines, strict=True)
    }
    assert float(numbers["force"][1]) == pytest.approx(summary["contact_force"][1], rel=1e-3)
    assert [int(n) for n in numbers["contact"][:2]] == [
        summary["touching_nodes"],
        summary["contact_nodes"],
    ]
    assert float(numbers["stress"][0]) == pytest.approx(
        summary["stress"]["von_mises"]["value"], rel=1e-2
    )
    assert float(numbers["error"][0]) == pytest.approx(100 * summary["stress"]["error"], rel=5e-2)
    at = labels(lines).index("cost")
    known, forecast = " ".join(lines[at : at + 2]).split("; ")
    assert float(known.split()[1]) == pytest.approx(100 * summary["cost"]["error"], rel=5e-2)
    assert float(forecast.split()[0]) == pytest.approx(
        100 * summary["cost"]["next_error"], rel=2e-1
    )  # one digit
    assert int(numbers["effort"][0]) == summary["linear_solves"]
    assert lines[-1].endswith("results/scene/")


def test_a_long_forecast_is_whole(summary):
    """It goes on on a second line."""
    statement = (
        "6.2 % error of the stress took 0.6 s; 0.6 %: 4 to 48 s with --accuracy 0.87%, "
        "all cells smaller"
    )
    lines = told(summary | {"cost": summary["cost"] | {"statement": statement}})
    at = labels(lines).index("cost")
    assert all(len(line) <= 80 for line in lines)
    assert " ".join(f"{lines[at]} {lines[at + 1]}".split()).endswith(statement.partition("took")[2])


@pytest.mark.parametrize("warnings", [0, 1])
def test_certificate_that_does_not_hold(summary, warnings):
    """It is said aloud, whatever has to be said beside it."""
    findings = [{"level": "warning", "path": "mesh", "message": "word " * 60}] * warnings
    prices = {"convergence_table": [{"energy": 0.1, "seconds": 1.0, "predicted": False}]}
    certificate = {"certificate": summary["certificate"] | {"holds": False}}
    (line,) = (
        line
        for line in told(summary | certificate | prices | {"findings": findings})
        if "certifi" in line
    )
    assert "FAILED" in line
    assert line.split()[0] == "certificate"


def test_exit_code_of_an_incomplete_scene(tmp_path, capsys):
    """A scene that lacks something is solved, and its exit code is not that of an answer."""
    file = tmp_path / "scene.toml"
    file.write_text(
        """
incomplete = ["a load"]
mesh = { generator = "block", parameters = { length = 3.0, height = 1.0, nx = 6, ny = 2 } }
material = { young = 5000.0, poisson = 0.4 }
traction = { boundary = "top", y = -20.0 }
contact = { boundary = "bottom", gap = 0.001 }
displacement = { boundary = "left", x = 0.0 }
"""
    )
    command = ["solve", str(file), "--out", str(tmp_path / "out"), "--no-fields", "--no-pictures"]
    assert main(command) == 4
    said = capsys.readouterr()
    assert said.out.splitlines()[0].endswith("converged, incomplete")
    assert "not the results of your model" in said.err
    file.write_text(file.read_text().replace('incomplete = ["a load"]', ""))
    assert main(command) == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("nodes", [0, 1, 2, 3, 7, 8])
def test_contact_that_the_mesh_does_not_resolve(summary, nodes):
    """Boundaries that touch with fewer than eight nodes are named, however many nodes of other
    boundaries touch.
    """
    row = summary["contact_boundaries"][0] | {"boundary": "wide", "touching_nodes": 40}
    rows = [row, row | {"boundary": "rim", "touching_nodes": nodes}]
    drawn = summary | {"contact_boundaries": rows, "touching_nodes": 40 + nodes}
    for lines in (told(drawn), map(str, lines_of(drawn, Path()))):
        text = " ".join(" ".join(lines).split())
        assert (f"only {nodes} on rim: refine there" in text) == (0 < nodes < 8)
        assert "on wide: refine" not in text
