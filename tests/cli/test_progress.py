"""Where a solve is: told to whoever watches, shown on a terminal, and nowhere else."""

import io
import sys

import pytest
from mpi4py import MPI
from ranks import same_on_all_ranks
from scenes import example1
from test_cli import SCENE

from signorini_fx.scenes.cli import main
from signorini_fx.scenes.solver import solve


def seen(scene, comm=MPI.COMM_SELF):
    """All that a watcher of a solve is told, and the solution."""
    moves = []
    solution = solve(scene, comm, on_progress=moves.append)
    return moves, solution


def test_meshes_solves_and_krylov_steps():
    """Every mesh, every linear solve and every step of the Krylov method, in order."""
    moves, solution = seen(example1(bound=1.5, nx=48, ny=16, levels=3, linear_algebra="krylov"))
    assert {move.meshes for move in moves} == {3}
    assert sorted({(move.mesh, move.dofs) for move in moves if move.dofs}) == [
        (number, level.dofs) for number, level in enumerate(solution.levels, start=1)
    ]
    assert max(move.solve for move in moves) == solution.history.linear_solves + 1
    assert [(move.mesh, move.solve) for move in moves] == sorted((move.mesh, move.solve) for move in moves)
    most = max(move.krylov for move in moves)
    assert most >= 5
    for steps in range(1, most):  # none is left out
        assert any(move.krylov == steps for move in moves)


@pytest.mark.mpi
def test_the_same_on_all_ranks():
    """All ranks are told alike."""
    moves, _ = seen(example1(bound=1.5, nx=24, ny=8, levels=2, linear_algebra="krylov"), MPI.COMM_WORLD)
    same_on_all_ranks([(move.mesh, move.dofs, move.step, move.solve, move.krylov) for move in moves])


class Terminal(io.StringIO):
    """A standard error that is a terminal."""

    def isatty(self):
        """It is."""
        return True


@pytest.mark.parametrize(
    ("terminal", "quiet", "shown"), [(True, False, True), (True, True, False), (False, False, False)]
)
def test_only_on_a_terminal(tmp_path, monkeypatch, capsys, terminal, quiet, shown):
    """Without one, or if nothing is to be printed, not a byte of it; with one it is erased in the end."""
    scene = tmp_path / "small.toml"
    scene.write_text(SCENE, encoding="utf-8")
    stream = Terminal() if terminal else io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    arguments = ["solve", str(scene), "--out", str(tmp_path / "out"), "--no-fields", "--no-pictures"]
    assert main([*arguments, *["--quiet"] * quiet]) == 0
    assert ("linear solve" in stream.getvalue()) is shown
    assert "\x1b" not in capsys.readouterr().out
    if shown:
        assert stream.getvalue().endswith("\r\x1b[K")
