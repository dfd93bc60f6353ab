"""A quantity that a program adds: it is everywhere where those of the package are, and its failure
is a warning.
"""

import runpy
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from commands import summary_in
from quantities import markdown
from scenes import alone, example1

from signorini_fx import InstallationError, Quantity, extensions, read_results, solve, write_results
from signorini_fx.addons.report.page import page
from signorini_fx.extensions import QUANTITIES
from signorini_fx.quantities.shown import short_answer
from signorini_fx.quantities.summary import own_quantities
from signorini_fx.results.summary import lines_of
from signorini_fx.scenes.template import summary_schema

DEMO = Path(__file__).parents[2] / "demos" / "extensions" / "quantity.py"
KEY = "mean_pressure_right"


@pytest.fixture
def register(monkeypatch):
    """Registers quantities for one test."""
    monkeypatch.setattr(extensions, "_registered", {})
    return lambda quantity: extensions.register(QUANTITIES, quantity.key, quantity)


def scene(coefficient=0.3):
    """Two load steps."""
    loaded = example1(coefficient=coefficient, nx=12, ny=4)
    loads = [load.model_copy(update={"factors": (0.5, 1.0)}) for load in loaded.traction]
    return loaded.model_copy(update={"traction": tuple(loads)})


@pytest.mark.slow
def test_one_file(register, monkeypatch, tmp_path):
    """The demo: summary, schema, terminal, report, table of load steps, documentation; without it
    nothing of it is left.
    """
    assert KEY not in markdown()
    assert KEY not in summary_schema()["properties"]
    register(runpy.run_path(str(DEMO))["MeanPressureRight"])
    solution = alone(scene())
    summary = write_results(solution, tmp_path, pictures=False, fields=False)
    columns = solution.table.columns
    right = columns["x"] > 1.5 + 1e-6
    mean = np.average(columns["pressure"][right], weights=columns["weight"][right])
    assert summary[KEY] == pytest.approx(mean, rel=1e-13)
    written = summary_in(tmp_path)
    jsonschema.validate(written, summary_schema())
    results = read_results(tmp_path)
    assert getattr(results.summary, KEY) == written[KEY] == summary[KEY]
    first, last = results.table("steps")[KEY]
    assert last == pytest.approx(mean, rel=1e-13)
    assert 0 < first < last
    assert f"  mean pressure right {mean:.6g}" in "\n".join(map(str, lines_of(summary, tmp_path)))
    # Its label is longer than the column of the short answer.
    assert f"  mean pressure right: {mean:.6g}" in "\n".join(
        map(str, short_answer(summary, tmp_path))
    )
    assert f"<dt>mean pressure right</dt><dd>{mean:.6g}</dd>" in page(tmp_path)
    assert f"| `{KEY}` | stress | Mean pressure right of the middle |" in markdown()
    monkeypatch.setattr(extensions, "_registered", {})
    assert KEY not in summary_schema()["properties"]
    assert (
        getattr(read_results(tmp_path).summary, KEY) == summary[KEY]
    )  # a folder of somebody who has it


class Fails(Quantity):
    """Divides by zero."""

    key, title = "fails", "Fails."

    def value(self, solution):
        return 1 / 0


class Words(Fails):
    """Not of its type."""

    key = "words"

    def value(self, solution):
        return "many"


class Several(Fails):
    """Not the number that a column of the load steps has."""

    key = "several"

    def value(self, solution):
        return np.ones(2).tolist()


class Arrays(Several):
    """Nothing that JSON has."""

    key = "arrays"

    def value(self, solution):
        return np.ones(2)


def test_failures_are_warnings(register, tmp_path):
    """The results stand."""
    for quantity in (Fails, Words(), Several, Arrays):
        register(quantity)
    solution = alone(scene())
    summary = write_results(solution, tmp_path, fields=False, pictures=False)
    told = {row["path"]: row["message"] for row in summary["findings"]}
    assert "ZeroDivisionError in value: division by zero" in told["fails"]
    assert "ValidationError" in told["words"]
    assert "arrays" in told
    assert not {"fails", "words", "arrays"} & {*summary}
    assert not {"fails", "words", "several", "arrays"} & {*summary["steps"][0]}
    assert summary["several"] == [1.0, 1.0]
    assert summary["converged"]
    write_results(solution, tmp_path, pictures=False, fields=False)
    assert read_results(tmp_path).summary.converged


@pytest.mark.parametrize("key", ["status", "contact_force", "not a name", "step"])
def test_keys_that_are_taken(register, key):
    """And what is no quantity."""
    register(type("Taken", (Fails,), {"key": key}))
    with pytest.raises(InstallationError, match="needs a key that is its name"):
        solve(scene(), observers=[lambda record: pytest.fail("something is solved")])
    extensions.register(QUANTITIES, key, object())
    with pytest.raises(InstallationError, match="is no signorini_fx") as error:
        own_quantities()
    assert "FEniCSx" not in str(error.value)
