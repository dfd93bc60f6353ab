"""Two result folders side by side."""

import json
import re

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scenes import alone, example1
from spaces import block

from signorini_fx.addons.report.comparison import compare
from signorini_fx.addons.report.page import page
from signorini_fx.errors import ResultError
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.results.files import write_results
from signorini_fx.scenes.reading import parse_scene


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


def in_pieces(nx, solver=None, factors=None):
    """A block on two feet, the second of which carries more: one boundary of two pieces."""
    mesh = dmesh.create_rectangle(MPI.COMM_SELF, [(0.0, 0.0), (3.0, 1.0)], (nx, nx // 3))
    feet = {"feet": lambda x: np.isclose(x[1], 0.0) & ((x[0] < 1.0 + 1e-9) | (x[0] > 2.0 - 1e-9))}
    return parse_scene(
        {
            "mesh": tag_boundaries(mesh, feet | {"top": lambda x: np.isclose(x[1], 1.0)}),
            "material": {"young": 5000.0, "poisson": 0.3},
            "displacement": {"boundary": "top", "x": 0.0, "y": "-0.01 * (1 + x[0])", "factors": factors},
            "solver": {"fallbacks": False, **(solver or {})},
            "contact": {"boundary": "feet", "friction": {"law": "tresca", "bound": 3.0}},
        }
    )


def nothing_computed(value, key=""):
    """A summary after a solve that could compute no figure; times, and what the scene says, are known."""
    if isinstance(value, dict):
        return {
            k: item if k in ("timings", "time", "scene") else nothing_computed(item, k) for k, item in value.items()
        }
    if isinstance(value, list):
        return [nothing_computed(item, key) for item in value]
    return None if isinstance(value, float) else value


@pytest.mark.one_quick
@pytest.mark.parametrize("where", ["plane", "space", "load steps"])
def test_nothing_could_be_computed(where, tmp_path):
    """Every number of a failed solve may be null: there is a report, and a comparison."""
    limits = {"max_iterations": 1, "fallbacks": False}
    scenes = {
        "plane": lambda: example1(coefficient=0.3, nx=6, ny=2, **limits),
        "space": lambda: block(3, coefficient=0.3, **limits),
        "load steps": lambda: in_pieces(6, {"max_iterations": 1}, [0.5, 1.0]),
    }
    write_results(alone(scenes[where](), check=False), tmp_path, pictures=False, fields=False)
    file = tmp_path / "summary.json"
    summary = json.loads(file.read_text())
    assert summary["status"] == "maximum iterations reached"
    file.write_text(json.dumps(nothing_computed(summary)))
    assert "maximum iterations reached" in page(tmp_path)
    assert "maximum iterations reached" in compare(tmp_path, tmp_path)
