"""The benchmark: the hand-written program solves the same problem, and a run on tiny meshes writes its rows."""

import csv

import example1
import linear
import pytest
import rival
import run
from mpi4py import MPI

from signorini_fx import solve
from signorini_fx.algebra.linalg.factorisation import has_package


@pytest.fixture(scope="module")
def tagged():
    """A coarse mesh of Example 1."""
    return example1.tagged_mesh(60)


def package(law, tagged, **settings):
    """The answer of the package."""
    return example1.Answer.of(solve(example1.scene(law, tagged, **settings), MPI.COMM_SELF))


needs_cholmod = pytest.mark.skipif(not has_package("cholmod", "cholesky"), reason="PETSc without CHOLMOD")


@needs_cholmod
@pytest.mark.parametrize(("law", "other"), [("tresca", rival.tresca), ("coulomb", rival.coulomb)])
def test_the_rival_takes_the_same_steps(tagged, law, other):
    """Same pressure, shear, sets, and number of linear solves: the paper's algorithms, written twice."""
    ours, theirs = package(law, tagged, coulomb="fp"), other(tagged)
    assert ours.differs(theirs) == ""
    assert ours.solves == theirs.solves


def test_a_difference_is_noticed(tagged, monkeypatch):
    """Nothing is measured of a program with another answer."""
    ours = package("tresca", tagged)
    assert "pressure" in ours.differs(package("tresca", tagged, gamma=1e7))
    monkeypatch.setitem(run.PLANE, "rival tresca", lambda tagged: package("coulomb", tagged))
    with pytest.raises(RuntimeError, match="rival tresca with 24 cells differs: pressure"):
        next(run.plane(run.QUICK))


@needs_cholmod
def test_the_linear_solves_agree(tagged):
    """MUMPS and CHOLMOD solve the same linear problem."""
    one, other = (linear.solve(tagged, package)[0] for package in ("mumps", "cholmod"))
    one.axpy(-1.0, other)
    assert one.norm() < 1e-10 * other.norm()


@needs_cholmod
@pytest.mark.one_quick
@pytest.mark.parametrize("group", ["plane", "memory", "space", "growth"])
def test_every_row_is_written(group, tmp_path):
    """A run on tiny meshes: every row is printed before, and has a value."""
    assert run.main(["--quick", "--only", group, "--out", str(tmp_path / "rows.csv")]) == 0
    with (tmp_path / "rows.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert {row["group"] for row in rows} == {group}
    assert all(0 < float(row["value"]) < float("inf") for row in rows)
    assert {row["verdict"] for row in rows} <= {"reached", "NOT REACHED", ""}
    assert len(rows) == {"plane": 14, "memory": 2, "space": 6, "growth": 4}[group]
