"""The benchmark: both linear solves agree, and a run on tiny meshes writes its rows."""

import csv

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
