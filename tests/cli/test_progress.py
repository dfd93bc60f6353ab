"""Where a solve is: told to whoever watches, shown on a terminal, and nowhere else."""

import io
import sys

import pytest
from mpi4py import MPI
from scenes import example1
from spaces import block
from test_cli import SCENE
from test_ranks import same_on_all_ranks

from signorini_fx.records import Progress
from signorini_fx.results import progress_line
from signorini_fx.results.progress_line import ProgressLine, progress_text
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


def test_the_forecast():
    """None for the first of several meshes, then one that is renewed for each; one mesh has that of ``check``."""
    moves, _ = seen(block(12, levels=1, bound=1.5))
    assert moves[-1].end is not None
    moves, _ = seen(example1(bound=1.5, nx=48, ny=16, levels=3))
    ends = [{move.end for move in moves if move.mesh == mesh} for mesh in (1, 2, 3)]
    assert ends[0] == {None}
    assert all(end is not None for end in ends[2])
    assert ends[1] != ends[2]


def test_load_steps():
    """Their number, from 1."""
    scene = example1(bound=1.5, nx=12, ny=4)
    traction = scene.traction[0].model_copy(update={"factors": (0.5, 0.8, 1.0)})
    moves, solution = seen(scene.model_copy(update={"traction": (traction,)}))
    assert len(solution.steps) == 3
    assert sorted({move.step for move in moves}) == [1, 2, 3]
    assert moves[-1].steps == 3


@pytest.mark.mpi
def test_the_same_on_all_ranks():
    """All ranks are told alike."""
    moves, _ = seen(example1(bound=1.5, nx=24, ny=8, levels=2, linear_algebra="krylov"), MPI.COMM_WORLD)
    same_on_all_ranks([(move.mesh, move.dofs, move.step, move.solve, move.krylov) for move in moves])


@pytest.mark.parametrize(
    ("progress", "text"),
    [
        (Progress(), "linear solve 1"),
        (Progress(dofs=42483, solve=7, krylov=3), "42,483 unknowns, linear solve 7, 3 Krylov steps"),
        (
            Progress(mesh=2, meshes=4, dofs=975, step=2, steps=5, solve=12, end=137.0),
            "mesh 2 of 4, 975 unknowns, load step 2 of 5, linear solve 12, about 37 s left",
        ),
        (Progress(mesh=3, meshes=None, end=99.0), "mesh 3, linear solve 1"),
        (Progress(end=700.0), "linear solve 1, about 10 min left"),
        (Progress(end=9100.0), "linear solve 1, about 2.5 h left"),
    ],
)
def test_in_words(progress, text):
    """At 100 s on the clock."""
    assert progress_text(progress, 100.0) == text


class Terminal(io.StringIO):
    """A standard error that is a terminal."""

    def isatty(self):
        """It is."""
        return True


def test_not_more_often_than_one_can_read(monkeypatch):
    """A line within a fifth of a second of the last is left out; an erased one comes back at once."""
    stream, now = Terminal(), [0.0]
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(progress_line.time, "perf_counter", lambda: now[0])
    line = ProgressLine()
    line.erase()
    for solve_number, now[0] in ((1, 1.0), (2, 1.1), (3, 1.3)):
        line(Progress(solve=solve_number))
    line.erase()
    line(Progress(solve=4))
    erase = "\r\x1b[K"
    shown = [f"{erase}linear solve {number}" for number in (1, 3)]
    assert stream.getvalue() == "".join([*shown, erase, f"{erase}linear solve 4"])


@pytest.mark.parametrize("terminal", [True, False])
def test_in_python(monkeypatch, terminal):
    """A line of a solve in Python is erased at its end, and is not there without a terminal."""
    stream = Terminal() if terminal else io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    with ProgressLine() as line:
        solve(example1(bound=1.5, nx=12, ny=4), MPI.COMM_SELF, on_progress=line)
    assert ("linear solve 1" in stream.getvalue()) is terminal
    assert stream.getvalue().endswith("\r\x1b[K" if terminal else "")
    assert bool(stream.getvalue()) is terminal


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
