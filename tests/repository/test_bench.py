"""The benchmark: its rivals solve the same problem, and a run on tiny meshes fills its files."""

import csv
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

BENCH = Path(__file__).parents[2] / "benchmarks" / "costs"
sys.path.insert(0, str(BENCH))

import calculix  # noqa: E402
import contestants  # noqa: E402
import example1  # noqa: E402
import linear  # noqa: E402
import nonlinear_costs  # noqa: E402
import plain  # noqa: E402
import rival  # noqa: E402
import small  # noqa: E402
import space  # noqa: E402
import space_rival  # noqa: E402
import space_rows  # noqa: E402

from signorini_fx import solve  # noqa: E402
from signorini_fx.addons.decks.draft import draft  # noqa: E402
from signorini_fx.algebra.linalg.factorisation import has_package  # noqa: E402
from signorini_fx.mechanics.mesh.tagged import generate_mesh  # noqa: E402
from signorini_fx.scenes.reading import read_scene  # noqa: E402

GROUPS = {
    "tresca",
    "coulomb",
    "sweep",
    "plain",
    "rival",
    "growth",
    "memory",
    "nested",
    "ranks",
    "counts",
    "import",
    "large",
    "space",
    "space-sweep",
    "space-rivals",
    "two-bodies",
    "small",
}


@pytest.fixture(scope="module")
def tagged():
    """A coarse mesh of Example 1."""
    return example1.tagged_mesh(60)


def package(law, tagged, **settings):
    """The answer of the package."""
    return example1.Answer.of(solve(example1.scene(law, tagged, **settings), MPI.COMM_SELF))


needs_cholmod = pytest.mark.skipif(not has_package("cholmod", "cholesky"), reason="PETSc without CHOLMOD")


@pytest.mark.slow
def test_rows_of_small_solves():
    """Whole solves and certified points of sweeps, over one linear solve each."""
    rows = list(small.rows(1, lambda text: None, cells=[9], points=2))
    assert len(rows) == 4 + len(small.values(2))
    assert all(row.value > 0 and len(row.measured) == 1 for row in rows)


@needs_cholmod
@pytest.mark.parametrize(("law", "other"), [("tresca", rival.tresca), ("coulomb", rival.coulomb)])
def test_the_rival_takes_the_same_steps(tagged, law, other):
    """Same pressure, shear, sets, and number of linear solves: the paper's algorithms, written twice."""
    ours, theirs = package(law, tagged, coulomb="fp"), other(tagged)
    assert ours.differs(theirs) == ""
    assert ours.solves == theirs.solves


@pytest.mark.slow
def test_the_plain_way_arrives(tagged):
    """SNES on the max/min form comes to the same pressure and sets, with many more solves."""
    ours, theirs = package("tresca", tagged), plain.tresca(tagged)
    assert ours.differs(theirs) == ""
    assert theirs.solves > 5 * ours.solves


def test_a_difference_is_noticed(tagged):
    """The check before the clock starts is one."""
    ours = package("tresca", tagged)
    assert "pressure" in ours.differs(package("tresca", tagged, gamma=1e7))
    outcome = contestants.Outcome([package("coulomb", tagged)])
    reference = {"tresca": contestants.Outcome([ours])}
    with pytest.raises(RuntimeError, match=r"plain at .* cells differs: pressure"):
        contestants.check("plain", outcome, reference, tagged)


@needs_cholmod
def test_the_linear_solves_agree(tagged):
    """MUMPS and CHOLMOD solve the same linear problem."""
    one, other = (linear.solve(tagged, package)[0] for package in ("mumps", "cholmod"))
    one.axpy(-1.0, other)
    assert one.norm() < 1e-10 * other.norm()


def test_the_plain_way_has_limited_time(tagged, monkeypatch):
    """Stopped before its last gamma it says so, and no answer is compared."""
    monkeypatch.setattr(contestants, "PATIENCE", 0.0)
    outcome = contestants.ALL["plain"](tagged)
    assert not outcome.answers
    assert "at least" in outcome.unfinished
    contestants.check("plain", outcome, {"tresca": contestants.Outcome([package("tresca", tagged)])}, tagged)


@pytest.mark.one_quick
@pytest.mark.parametrize("cell", space.CELLS)
@pytest.mark.parametrize("law", space.LAWS)
def test_the_rival_in_space_comes_to_the_same_answer(law, cell):
    """Newton's method written by hand, with GAMG and loose solves: deflection, force and sets of the package.

    Both end their solves nine digits or more below the displacement.
    """
    ours = space.package(law, 12, cell, 1e8, 2)
    theirs = space_rival.solve(generate_mesh("box", space.parameters(12, cell), MPI.COMM_SELF), law, 1e8)
    assert ours.converged
    assert ours.answer.contact.any()
    assert ours.answer.slip.any() == (law != "frictionless")
    deflection, force, *sets = ours.answer.far(theirs.answer)
    assert deflection < 1e-8
    assert force < 1e-8
    assert sets == [0, 0]
    assert theirs.set_ups > 4  # one for each Newton matrix
    softer = space_rival.solve(generate_mesh("box", space.parameters(12, cell), MPI.COMM_SELF), law, 1e6, reuse=True)
    assert ours.answer.far(softer.answer)[0] == pytest.approx(3e-3, rel=0.3)  # its penalty


def test_a_rival_with_another_answer_or_none_has_no_verdict():
    """It is named in the table, and no target is called reached on its account."""
    ours, other = space.package("tresca", 6, "hexahedron", 1e8, 1), space.package("coulomb", 6, "hexahedron", 1e8, 1)
    same = space_rows.compared("a", "", [ours], [ours], 0.5, 1e-6)
    assert (same.verdict, same.value) == ("reached", 1.0)
    assert same.note.startswith("answer: u_z by 0.0e+00")
    wrong = space_rows.compared("a", "", [ours], [other], 0.5, 1e-6)
    assert wrong.verdict == "information"
    assert wrong.note.startswith("ANOTHER ANSWER: u_z by")
    missing = space_rows.compared("a", "", [ours], ["not installed"], 0.5, 1e-6)
    assert (missing.what, missing.verdict) == ("a: not installed", "information")


@needs_cholmod
@pytest.mark.parametrize("groups", [{"tresca", "import"}, pytest.param(GROUPS, marks=pytest.mark.long)], ids=len)
def test_every_row_is_written(groups, tmp_path):
    """A run on tiny meshes writes all rows, every run behind them, and the picture."""
    command = [
        sys.executable,
        str(BENCH / "run.py"),
        "--quick",
        "--repeats",
        "1",
        "--levels",
        "2",
        "--only",
        ",".join(groups),
    ]
    ended = subprocess.run(
        [*command, "--sizes", "24,24,48,48", "--out", str(tmp_path)], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stderr
    with (tmp_path / "rows.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert {row["group"] for row in rows} == groups
    assert not [row for row in rows if "failed" in row["what"]]
    assert all(float(row["value"]) > 0 for row in rows)
    assert {row["verdict"] for row in rows} <= {"reached", "NOT REACHED", "information"}
    for row in rows:
        assert row["what"] in ended.stdout
    with (tmp_path / "samples.csv").open(newline="", encoding="utf-8") as file:
        ran = {row["contestant"] for row in csv.DictReader(file)}
    assert ran == (set(contestants.ALL) if groups == GROUPS else {"tresca", "mumps", "cholmod"})
    assert (tmp_path / "performance.png").stat().st_size > 10_000


def test_the_deck_for_calculix(tmp_path, capsys, monkeypatch):
    """Its draft is whole; without ccx nothing is compared."""
    deck, scene = tmp_path / "block.inp", tmp_path / "draft.toml"
    deck.write_text(calculix.block(4, "coulomb"))
    drafted = draft(deck, scene)
    assert not drafted.lost
    assert all("not written" in remark for remark in drafted.noted)
    scene.write_text(calculix.of_block(drafted.text))
    solution = solve(read_scene(scene), MPI.COMM_SELF)
    assert solution.certificate.holds
    assert solution.statement.contact[0].against is None
    assert solution.statement.solver.gamma_t == calculix.STICK
    monkeypatch.setenv("CCX", "no such program")
    assert calculix.main(["block"]) == 0
    assert "nothing is compared" in capsys.readouterr().out


def test_displacements_of_calculix(tmp_path):
    """The last ones of a file of results, at the nodes that have them."""
    row = " -1{:10d}{:12.5E}{:12.5E}{:12.5E}".format
    lines = ["    1C", "    2C", row(1, 0, 0, 0), row(7, -1e-10, 2, 0), row(9, 3, 0, 1), " -3"]
    for k in (1, 2):
        lines += [" -4  DISP        4    1", row(7, k, -k, 0), row(1, 0, 0, -0.5), " -3"]
        lines += [" -4  STRESS      6    1", row(7, 5, 5, 5), " -3"]
    (tmp_path / "job.frd").write_text("\n".join(lines))
    x, u = calculix.nodal(tmp_path / "job.frd")
    assert x.tolist() == [[0, 0, 0], [-1e-10, 2, 0]]
    assert u.tolist() == [[0, 0, -0.5], [2, -2, 0]]


@pytest.mark.skipif(shutil.which(os.environ.get("CCX", "ccx")) is None, reason="there is no ccx")
def test_the_answer_of_calculix():
    """Both programs press and push the block alike, to the difference of nodal and averaged conditions."""
    *_, row = calculix.blocks(shutil.which(os.environ.get("CCX", "ccx")), [8], "coulomb")
    cells = [word.strip() for word in row.split("|")]
    assert float(cells[4]) == pytest.approx(float(cells[3]), rel=2e-3)
    assert float(cells[5]) < 0.03


@pytest.mark.slow
def test_costs_of_nonlinear_contact():
    """Newton's method for the body alone, with the contact known, finds the same displacements."""
    problem = nonlinear_costs.sliding(1)
    whole, ends = nonlinear_costs.with_contact(problem)
    alone, same = nonlinear_costs.bonded(problem, ends)
    np.testing.assert_allclose(same, ends, atol=1e-10)
    assert alone.iterations == alone.solves < whole.iterations
