"""Two result folders side by side."""

import re

import numpy as np
import pytest
from scenes import alone, example1

from signorini_fx.errors import ResultError
from signorini_fx.report.comparison import compare
from signorini_fx.results.files import write_results


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """The same scene on a coarse and on a fine mesh, and with a larger bound."""
    root = tmp_path_factory.mktemp("results")
    scenes = {"coarse": example1(bound=1.5, nx=12, ny=4), "fine": example1(bound=1.5, nx=48, ny=16)}
    scenes["rough"] = example1(bound=3.0, nx=12, ny=4)
    solutions = {name: alone(scene) for name, scene in scenes.items()}
    for name, solution in solutions.items():
        write_results(solution, root / name, pictures=False, fields=name != "rough")
    return root, solutions


def rows(text):
    return {line[:18].strip(): line[18:] for line in text.splitlines() if line[:18].strip()}


def test_a_result_with_itself(folders):
    """Nothing differs, and no node."""
    root, _ = folders
    text = compare(root / "coarse", root / "coarse")
    assert "differs" not in text
    assert "0 of 13 nodes in another state" in text
    assert rows(text)["strain energy"].split()[-1] == "equal"


def test_two_bounds(folders):
    """Differences are those of the solutions, node by node."""
    root, solutions = folders
    text = compare(root / "coarse", root / "rough")
    one, other = (solutions[name].table.columns for name in ("coarse", "rough"))
    states = int((one["state"] != other["state"]).sum())
    assert states > 0
    assert f"{states} of 13 nodes in another state" in text
    gap, weight = one["pressure"] - other["pressure"], one["weight"]
    share = float(re.search(r"pressure (\S+) of its norm", text)[1])
    assert share == pytest.approx(np.sqrt(weight @ gap**2 / (weight @ one["pressure"] ** 2)), rel=0.06)
    assert float(re.search(r"at most (\S+) at", text)[1]) == pytest.approx(np.abs(gap).max(), rel=1e-2)
    largest = rows(text)["largest shear"].split()
    assert float(largest[0]) == pytest.approx(1.5)
    assert largest[1] != "1.5"
    assert rows(text)["von Mises stress"].split()[1] == "-"  # without fields nobody asked for stresses


def test_two_meshes(folders):
    """Curves are interpolated along the boundary: a finer mesh differs by little, and states are not compared."""
    root, _ = folders
    text = compare(root / "coarse", root / "fine")
    assert rows(text)["unknowns"].split()[-1] == "differs"
    assert float(re.search(r"pressure (\S+) of its norm", text)[1]) < 0.2
    assert "in another state" not in text


def test_no_result(folders, tmp_path):
    """One line that names the folder."""
    root, _ = folders
    with pytest.raises(ResultError, match="no summary"):
        compare(root / "coarse", tmp_path)
