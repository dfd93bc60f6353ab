"""The benchmark: both linear solves agree, and a run on tiny meshes writes its rows."""

import csv
import re
from pathlib import Path

import example1
import linear
import pytest
import run

from signorini_fx.algebra.linalg.factorisation import has_package

needs_cholmod = pytest.mark.skipif(
    not has_package("cholmod", "cholesky"), reason="PETSc without CHOLMOD"
)


@needs_cholmod
def test_the_linear_solves_agree():
    """MUMPS and CHOLMOD solve the same linear problem."""
    tagged = example1.tagged_mesh(60)
    one, other = (linear.solve(tagged, package) for package in ("mumps", "cholmod"))
    one.axpy(-1.0, other)
    assert one.norm() < 1e-10 * other.norm()


@needs_cholmod
@pytest.mark.slow
@pytest.mark.parametrize("group", ["plane", "memory", "space", "growth"])
def test_every_row_is_written(group, tmp_path):
    """A run on tiny meshes: every row is printed before, and has a value."""
    assert run.main(["--quick", "--only", group, "--out", str(tmp_path / "rows.csv")]) == 0
    with (tmp_path / "rows.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert {row["group"] for row in rows} == {group}
    assert all(0 < float(row["value"]) < float("inf") for row in rows)
    assert {row["verdict"] for row in rows} <= {"reached", "NOT REACHED", ""}
    assert len(rows) == {"plane": 10, "memory": 2, "space": 6, "growth": 4}[group]


def test_the_readme_has_the_figures_of_the_table():
    """What Coulomb friction costs there is what docs/evidence/costs.csv says."""
    root = Path(__file__).parents[2]
    with (root / "docs" / "evidence" / "costs.csv").open(newline="", encoding="utf-8") as file:
        found = {(row["group"], row["what"], row["cells"]): row for row in csv.DictReader(file)}
    plane = found["plane", "coulomb over mumps", "960"]
    space = found["space", "coulomb over CG with GAMG", "96"]
    seconds, memory = (found["growth", what, "192"] for what in ("CPU seconds", "peak memory, MB"))
    unknowns = [f"{int(re.match('[0-9]+', row['note'])[0]):,}" for row in (space, seconds)]
    text = (root / "README.md").read_text(encoding="utf-8")
    for figure in (
        f"| {float(plane['value']):.1f} times one linear solve by MUMPS |",
        f"| 3D, {unknowns[0]} unknowns | {float(space['value']):.2f} times one",
        f"| 3D, {unknowns[1]} unknowns | {float(seconds['value']):.0f} s, "
        f"{float(memory['value']) / 1000:.1f} GB |",
    ):
        assert figure in text
