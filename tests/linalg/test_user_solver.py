"""Linear solvers of other packages: the same answer, however exact they are, and names for what
goes wrong.
"""

import runpy
from pathlib import Path

import numpy as np
import pytest
from scenes import example1

from signorini_fx import InstallationError, SceneError, Status, extensions, solve
from signorini_fx.extensions import LINEAR_SOLVERS
from signorini_fx.scenes.template import scene_schema

DEMO = Path(__file__).parents[2] / "demos" / "extensions" / "linear_solver.py"


@pytest.fixture
def register(monkeypatch):
    """Registers solvers for one test."""
    monkeypatch.setattr(extensions, "_registered", {})
    return lambda name, solver: extensions.register(LINEAR_SOLVERS, name, solver)


class Diagonal:
    """Divides by the diagonal: one of many steps."""

    def set_up(self, matrix):
        self.diagonal = matrix.getDiagonal()

    def solve(self, b, x):
        x.pointwiseDivide(b, self.diagonal)


class Nothing(Diagonal):
    """Does nothing."""

    def solve(self, b, x):
        x.set(0.0)


class Raises(Diagonal):
    """Fails on the last rank."""

    def solve(self, b, x):
        raise ZeroDivisionError("not today")


@pytest.mark.mpi
@pytest.mark.parametrize("kind", ["compressed", "diagonal"])
def test_same_answer(register, monkeypatch, kind):
    """As many linear solves as with a factorisation, and the same pressures."""
    monkeypatch.setattr(extensions, "_registered", {})
    solver = runpy.run_path(str(DEMO))["BlockLowRank"] if kind == "compressed" else Diagonal
    register(kind, solver)
    nx, ny = (24, 8) if kind == "compressed" else (12, 4)
    theirs, ours = (
        solve(example1(coefficient=0.3, nx=nx, ny=ny, linear_algebra=name))
        for name in (kind, "full")
    )
    assert theirs.converged
    assert theirs.linear_algebra == f"{kind}: as requested"
    assert theirs.history.linear_solves == ours.history.linear_solves
    pressures = [solution.table.columns["pressure"] for solution in (theirs, ours)]
    assert np.allclose(*pressures, rtol=0, atol=1e-7 * np.abs(pressures[1]).max())


class NotANumber(Diagonal):
    """Returns nothing that is one."""

    def solve(self, b, x):
        x.set(np.nan)


@pytest.mark.parametrize("kind", [Nothing, NotANumber])
def test_one_that_does_nothing(register, kind):
    """The outcome names the linear solver, and there is no traceback."""
    register("nothing", kind)
    solution = solve(example1(coefficient=0.3, nx=12, ny=4, linear_algebra="nothing"), check=False)
    assert solution.status is Status.LINEAR_SOLVER
    assert "the linear solver 'nothing' of another package" in solution.advice
    assert "'krylov'" in solution.advice


@pytest.mark.mpi
def test_exceptions_arrive(register):
    """What a solver raises ends the solve as itself."""
    register("raises", Raises)
    with pytest.raises(ZeroDivisionError, match="not today"):
        solve(example1(coefficient=0.3, nx=12, ny=4, linear_algebra="raises"))


def test_names(register, tmp_path, monkeypatch):
    """A name that is not known is refused with those that are; one that cannot be imported says
    where it is from.
    """
    register("mine", Diagonal)
    with pytest.raises(
        SceneError,
        match=r"linear_algebra.*must be one of 'auto', 'full', 'krylov', 'condensed', 'mine'",
    ):
        example1(linear_algebra="yours")
    assert (
        "mine" in scene_schema()["$defs"]["SolverSettings"]["properties"]["linear_algebra"]["enum"]
    )
    data = tmp_path / "theirs-1.dist-info"
    data.mkdir()
    (data / "METADATA").write_text("Name: theirs\nVersion: 1\n", encoding="utf-8")
    (data / "entry_points.txt").write_text(
        f"[{LINEAR_SOLVERS}]\ntheirs = no_such_module:Solver\n", encoding="utf-8"
    )
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(
        InstallationError, match=r"'theirs', no_such_module:Solver of theirs, cannot be imported"
    ):
        solve(example1(nx=12, ny=4, linear_algebra="theirs"))
    with pytest.raises(
        InstallationError, match=r"is no group of extensions; these are: .*linear_solvers"
    ):
        extensions.register("signorini_fx.solvers", "mine", None)
