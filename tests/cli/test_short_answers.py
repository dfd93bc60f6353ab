"""What ``solve`` and ``check`` print unless they are asked for more: few lines, none of them long, and true."""

import random
import re
from pathlib import Path
from textwrap import wrap

import pytest
from scenes import example1

from signorini_fx import solve, write_results
from signorini_fx.machine.display import results_of
from signorini_fx.machine.terminal import clauses
from signorini_fx.records import SHORT_OF_ACCURACY, Status
from signorini_fx.results.short_answer import short_answer
from signorini_fx.results.summary import render
from signorini_fx.scenes.check_text import short_text
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.cli import main

FOLDER = Path("results/scene")
WORDS = ["a-rather-long-word", "contact[0].friction", "and", "the", "supports", "of", "12.5", "that", "hold", "it"]


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
    known = ["force", "contact", "stress", "safety", "error", "cost", "certificate", "effort", "results"]
    assert labels(lines)[1:] == known
    assert lines[0].endswith("converged")
    numbers = {
        label: re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", line) for label, line in zip(labels(lines), lines, strict=True)
    }
    assert float(numbers["force"][1]) == pytest.approx(summary["contact_force"][1], rel=1e-3)
    assert [int(n) for n in numbers["contact"][:2]] == [summary["touching_nodes"], summary["contact_nodes"]]
    assert float(numbers["stress"][0]) == pytest.approx(summary["stress"]["von_mises"]["value"], rel=1e-2)
    assert float(numbers["error"][0]) == pytest.approx(100 * summary["stress"]["error"], rel=5e-2)
    known, forecast = lines[6].split("; ")
    assert float(known.split()[1]) == pytest.approx(100 * summary["cost"]["error"], rel=5e-2)
    assert float(forecast.split()[0]) == pytest.approx(100 * summary["cost"]["next_error"], rel=2e-1)  # one digit
    assert int(numbers["effort"][0]) == summary["linear_solves"]
    assert lines[-1].endswith("results/scene/")


@pytest.mark.parametrize("seed", range(40))
def test_any_answer_is_short(summary, seed):
    """However long names and titles are, and however many: no sentence is cut, and one without an end takes more lines;
    the certificate is never left out.
    """
    dice = random.Random(seed)

    def text(most):
        return " ".join(dice.choices(WORDS, k=dice.randint(1, most)))

    row = summary["contact_boundaries"][0]
    drawn = summary | {
        "title": text(30),
        "advice": text(80),
        "findings": [{"level": "warning", "path": "mesh", "message": text(60)} for _ in range(dice.randrange(5))],
        "contact_boundaries": [
            row | {"boundary": text(20), "touching_nodes": dice.randint(0, 9)} for _ in range(dice.randint(1, 9))
        ],
        "status": dice.choices([status.value for status in Status], [30, *[1] * (len(Status) - 1)])[0],
        "ranks": dice.choice([1, 4096]),
    }
    drawn["converged"] = drawn["status"] == "converged"
    if dice.random() < 0.5:
        drawn["scene"] = summary["scene"] | {"contact": [{"boundary": "bottom", "against": "other", "friction": {}}]}
    if dice.random() < 0.5:
        drawn["results_of"] = {"step": 3, "name": text(10), "time": 1.25, "status": "converged"}
        drawn["steps"] = [{"step": k, "name": text(10), "time": 0.5 + k / 4} for k in range(1, 5)]
    if dice.random() < 0.5:
        errors = dict.fromkeys(("energy", "pressure", "force"), 0.0123)
        drawn["convergence_table"] = [{**errors, "seconds": 1.0, "predicted": False}, {**errors, "predicted": True}]
    if dice.random() < 0.5:
        drawn["preloads"] = [
            {"name": text(20), "force": 1.0 / 3.0, "shortening": 2.0 / 3.0} for _ in range(dice.randint(1, 5))
        ]
    lines = told(drawn)
    advised = 0 if drawn["converged"] else len(wrap(drawn["advice"], 66))
    named = 0 if "results_of" not in drawn else len(wrap(results_of(drawn), 66))
    warned = len(wrap(f"(1 of 9) mesh: {drawn['findings'][0]['message']}", 66)) if drawn["findings"] else 0
    assert len(lines) <= max(10, 2 + advised + named + warned + 6)
    assert max(map(len, lines)) <= 80
    assert not any("(--verbose)" in line and "results" not in line for line in lines)
    assert labels(lines)[-1] == "results"
    solved = drawn["converged"] or "results_of" in drawn or Status(drawn["status"]) in SHORT_OF_ACCURACY
    assert ("certificate" in labels(lines), "what to do" in labels(lines)) == (solved, not drawn["converged"])
    if drawn["converged"] or Status(drawn["status"]) in SHORT_OF_ACCURACY:
        assert "cost" in labels(lines)
    elif not solved:
        assert "cost" not in labels(lines)
    assert ("warning" in labels(lines)) == bool(drawn["findings"])


@pytest.mark.parametrize(
    ("safety", "sentence"),
    [
        ({"sliding": 2.4, "overturning": None}, "sliding: 2.4 times these loads; overturning: no limit"),
        ({"exact": False, "friction_used": 0.41}, "at most 2.4 times these loads; friction used: 41 %"),
        ({"factor": None, "bound": None, "friction_used": 0.1}, "no limit by statics; friction used: 10 %"),
    ],
)
def test_safety_is_a_sentence(summary, safety, sentence):
    """With what Coulomb friction leaves open."""
    known = {"factor": 2.4, "bound": 2.4, "exact": True, "friction_used": None, "motion": "slides"}
    (line,) = (line for line in told(summary | {"safety": known | safety}) if "safety" in line)
    assert line.split(maxsplit=1)[1] == sentence


def test_a_force_of_which_no_digit_is_known(summary):
    """Its first digit stands with the error: 0 would be a claim."""
    price = {**dict.fromkeys(("energy", "pressure", "zone", "peak")), "force": 1.9, "predicted": False, "seconds": 1.0}
    price |= {"dofs": 100, "level": 0}
    found = summary | {"contact_force": [0.0, 544.8], "friction_force": [30.0, 0.0], "convergence_table": [price]}
    (line,) = (line for line in told(found) if "force" in line[:14])
    assert "(0, 500) (error 190 %)" in line


@pytest.mark.parametrize("warnings", [0, 1])
def test_certificate_that_does_not_hold(summary, warnings):
    """It is said aloud, whatever has to be said beside it."""
    findings = [{"level": "warning", "path": "mesh", "message": "word " * 60}] * warnings
    prices = {"convergence_table": [{"energy": 0.1, "seconds": 1.0, "predicted": False}]}
    certificate = {"certificate": summary["certificate"] | {"holds": False}}
    (line,) = (line for line in told(summary | certificate | prices | {"findings": findings}) if "certifi" in line)
    assert "NOT" in line
    assert line.split()[0] == "certificate"


def test_error_that_stands_in_another_line(summary):
    """Of one mesh the line of the cost has it, where there is no room for both; of several each says another thing."""
    findings = {"findings": [{"level": "warning", "path": "mesh", "message": "word " * 60}]}
    lines = told(summary | findings)
    assert "error" not in labels(lines)
    assert "certificate" in labels(lines)
    (line,) = (line for line in lines if line.split()[0] == "cost")
    assert float(line.split()[1]) == pytest.approx(100 * summary["stress"]["error"], rel=5e-2)
    bound = {"error_bound": {"relative_error": 0.1, "guaranteed": True}}
    assert "error" in labels(told(summary | findings | bound))


def test_texts_end_at_a_clause():
    """A sentence or a clause that fits is whole; where none does, the first one is whole all the same."""
    text = "mesh: the first clause is here; the second one is so long that it does not fit. And a third one."
    assert clauses(text, 60, 1) == ["mesh: the first clause is here ... (--verbose)"]
    assert " ".join(clauses(text, 60, 2)) == text
    assert clauses(f"{'word ' * 7}word; and more", 30, 1) == ["word " * 5 + "word", "word word ... (--verbose)"]
    assert " ".join(clauses("word " * 40, 30, 1)) == ("word " * 40).strip()
    assert len(clauses("word; " * 40, 30, None)) == 8


@pytest.mark.parametrize("length", [1, 40])
def test_any_check_is_short(length):
    """Titles of any length; warnings come before notes, and what does not fit is counted."""
    scene = example1(coefficient=3.0, nx=24, ny=8)
    checked = check_scene(scene | {"title": "title " * length} if isinstance(scene, dict) else scene)
    lines = short_text(checked).splitlines()
    assert len(lines) <= 15
    assert max(map(len, lines)) <= 80
    levels = [line.split()[0] for line in lines if line.startswith(("  warning ", "  note "))]
    assert levels == sorted(levels, reverse=True)


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
    assert "results of another problem" in said.err
    file.write_text(file.read_text().replace('incomplete = ["a load"]', ""))
    assert main(command) == 0
    assert capsys.readouterr().err == ""


def test_forces_around_an_axis_are_those_along_it(summary):
    """Radial components cancel each other over a revolution."""
    around = {"material": [{"hypothesis": "axisymmetric"}], "contact": [{"boundary": "bottom", "friction": {}}]}
    forces = {"contact_force": [13760.0, 25.0], "friction_force": [0.0, -1376.0]}
    rubs = around["contact"][0] | {"friction": {"law": "coulomb"}}
    (line,) = (line for line in told(summary | forces | {"scene": around | {"contact": [rubs]}}) if "force" in line)
    assert line.split(maxsplit=1)[1] == "25, friction -1376 along the axis"


@pytest.mark.parametrize("nodes", [0, 1, 2, 3, 7, 8])
@pytest.mark.parametrize("coarse", [1, 5])
def test_contact_that_the_mesh_does_not_resolve(summary, coarse, nodes):
    """Boundaries that touch with one or two nodes are named in the answer, those with fewer than eight in the whole
    text, however many nodes of other boundaries touch.
    """
    row = summary["contact_boundaries"][0] | {"boundary": "wide", "touching_nodes": 40}
    names = [f"rim {number}" for number in range(coarse)]
    rows = [row, *(row | {"boundary": name, "touching_nodes": nodes} for name in names)]
    drawn = summary | {"contact_boundaries": rows, "touching_nodes": 40 + coarse * nodes}
    (line,) = [line for line in told(drawn) if line.startswith("  contact ")]
    assert line.endswith({1: "; too few on rim 0", 5: "; too few on 5 sides"}[coarse]) == (nodes in (1, 2))
    assert "wide" not in line
    (whole,) = [line for line in render(drawn).splitlines() if line.startswith("  contact nodes")]
    assert (f"too few on {', '.join(names)} for the ends" in whole) == (0 < nodes < 8)


def test_no_figure_is_cut(summary):
    """The first statement of a figure is whole, on as many lines as it takes; all of them go, or none."""
    reason = "the errors of the last two meshes do not decrease as they should for a forecast that anybody could trust"
    told_more = summary | {"cost": {"statement": f"{reason}; one mesh more may help"}}
    lines = told(told_more)
    first, last = (labels(lines).index(label) for label in ("cost", "certificate"))
    assert " ".join(line[14:] for line in lines[first:last]) == f"no forecast: {reason} ... (--verbose)"
    assert max(map(len, lines)) <= 80
    lines = told(told_more | {"findings": [{"level": "warning", "path": "mesh", "message": "odd. " * 60}]})
    assert "cost" not in labels(lines)
    assert not any("trust" in line for line in lines)
