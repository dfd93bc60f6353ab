"""Programs on the problems: ours meets each reference on the coarsest mesh, others where they are
installed.
"""

import csv
import shutil
from pathlib import Path

import numpy as np
import pytest
from parameters import slow

from benchmarks.contactbench.adapters import ADAPTERS, adapter
from benchmarks.contactbench.adapters.calculix_deck import deck
from benchmarks.contactbench.answers import CannotRun, measured
from benchmarks.contactbench.command import summary
from benchmarks.contactbench.elasticity import nodal_loads
from benchmarks.contactbench.grids import make_grid
from benchmarks.contactbench.judging import distance
from benchmarks.contactbench.problem import problem_names, read_problem

NAMES = problem_names()
# One of each kind: dimension, law, one and two bodies, degree of the element, with and without
# supports.
QUICK = [
    "smooth-edge",
    "example1-coulomb",
    "cattaneo-mindlin",
    "smooth-edge-coulomb",
    "tube-on-shaft",
]
QUICK += ["press-fit-plane", "patch-slip-space", "ring"]
each_problem = pytest.mark.parametrize(
    "name", [name if name in QUICK else slow(name) for name in NAMES]
)


def errors(program, name):
    problem = read_problem(name)
    grid = make_grid(problem)
    answer = adapter(program)(problem, grid)
    values = measured(problem, grid, answer)
    assert answer.unknowns >= grid.points.size
    assert answer.seconds > 0
    return {
        q.name: (distance(q, values[q.name]), q.tolerance)
        for q in problem.quantities
        if q.name in values
    }


@pytest.mark.one_quick
@each_problem
def test_the_package_meets_every_reference(name):
    """On the coarsest mesh within the tolerance of the file."""
    found = errors("signorini_fx", name)
    assert {key: value for key, value in found.items() if value[0] > value[1]} == {}


@pytest.mark.parametrize(
    ("program", "name"), [slow("dolfinx", "smooth-edge-tresca"), ("getfem", "patch-stick")]
)
def test_other_programs(program, name):
    """A penalty by hand, and a brick, meet a reference as well."""
    compared(program, name)


def compared(program, name):
    try:
        found = errors(program, name)
    except CannotRun as why:
        pytest.skip(f"{program}: {why}")
    assert {key: value for key, value in found.items() if value[0] > value[1]} == {}


def test_calculix_deck():
    """Fields of at most 20 characters, a foundation at the gap, forces that add up; where ccx is,
    it solves it.
    """
    for name in ("hertz-line", "patch-slip-space", "sphere"):
        problem = read_problem(name)
        grid = make_grid(problem)
        lines = deck(problem, grid)
        fields = [
            word.strip() for line in lines if not line.startswith("*") for word in line.split(",")
        ]
        assert max(map(len, fields)) <= 20
        numbers = {}
        for line in lines[lines.index("*NODE, NSET=GROUND") + 1 :]:
            if line.startswith("*"):
                break
            number, *x = line.split(",")
            numbers[int(number)] = [float(c) for c in x]
        own = grid.nodes(problem.contacts[0].boundary)
        assert len(numbers) == 2 * len(own)
        surface = np.array([numbers[len(grid.points) + 1 + k] for k in range(len(own))])
        gap = grid.points[own] - surface
        np.testing.assert_allclose(gap[:, :-1], 0.0, atol=1e-10)
        radius = (grid.points[own][:, :-1] ** 2).sum(axis=1)
        expected = 0.0 if "patch" in name else radius / (2 * problem.numbers["R"])
        np.testing.assert_allclose(gap[:, -1], expected, atol=1e-10)
        if "*CLOAD" in lines:
            rows = [
                line.split(",") for line in lines[lines.index("*CLOAD") + 1 :] if line[0].isdigit()
            ]
            total = sum(float(value) for _, axis, value in rows if int(axis) == problem.dimension)
            assert total == pytest.approx(nodal_loads(problem, grid)[:, -1].sum(), abs=1e-9)
    if shutil.which("ccx") is None:
        pytest.skip("there is no ccx")
    for name in ("patch-compression", "tube-on-shaft"):
        compared("calculix", name)


@pytest.mark.slow
def test_the_recorded_table_is_judged_by_the_references():
    """Errors and verdicts of docs/evidence/contactbench.csv follow from its values and the files;
    ours meets all; each program has each problem; the README of the problems has its summary.
    """
    root = Path(__file__).parents[2]
    with (root / "docs" / "evidence" / "contactbench.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    pairs = {(row["program"], row["problem"]) for row in rows}
    assert pairs == {(program, name) for program in ADAPTERS for name in NAMES}
    readme = (root / "benchmarks" / "contactbench" / "README.md").read_text(encoding="utf-8")
    lines = list(summary(rows))
    assert set(lines) <= set(readme.splitlines())
    cells = [line.strip("| ").split(" | ") for line in lines if line.startswith("|")]
    found = {row[0]: f"{row[1]}, {row[5]}" for row in cells[2:]}
    wanted = f"| {found['signorini_fx']} | - | {found['calculix']} | - | {found['getfem']} |"
    text = (root / "README.md").read_text(encoding="utf-8")
    assert wanted in text.replace("\N{EN DASH}", "-")
    for row in rows:
        if row["meets"] in ("skipped", "failed"):
            continue
        quantity = read_problem(row["problem"]).quantity(row["quantity"])
        assert float(row["error"]) == pytest.approx(
            distance(quantity, float(row["value"])), rel=2e-3, abs=2e-8
        )
        assert row["meets"] == ("yes" if float(row["error"]) <= quantity.tolerance else "no")
    assert {row["meets"] for row in rows if row["program"] == "signorini_fx"} == {"yes"}
