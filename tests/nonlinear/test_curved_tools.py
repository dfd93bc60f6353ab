"""The table of iterations with curved tools."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))

from benchmarks.stability import curved_tools

CASES = {case.name: case for case in curved_tools.cases()}


@pytest.mark.slow
def test_rows(monkeypatch, capsys):
    """The cases take as few iterations as the table promises, and it counts those that do not."""
    chosen = [CASES["circle, degree 1, mu 0.3, from rest"], CASES["rounded wedge, degree 1, mu 0.3, slid"]]
    monkeypatch.setattr(curved_tools, "cases", lambda: chosen)
    assert curved_tools.main() == 0
    monkeypatch.setattr(curved_tools, "MOST", 3)
    limits = []
    monkeypatch.setattr(curved_tools.ToolCase, "limit", lambda case, number: limits.append(number) or 1.0)
    assert curved_tools.main() == 2
    assert limits[:2] == [0, 1]
    assert capsys.readouterr().out.count("circle, degree 1, mu 0.3, from rest") == 2


@pytest.mark.slow
def test_a_limit_point(monkeypatch, capsys):
    """A corner that lets go of a bowl is told in its row: its force is largest before the last small step that has a
    solution, and the whole step takes the iterations of a jump.
    """
    case = CASES["bowl, degree 2, mu 0.3, slid"]
    monkeypatch.setattr(curved_tools, "cases", lambda: [case])
    assert curved_tools.main() == 0
    assert "(past a limit point at 0.9 of step 6)" in capsys.readouterr().out


def test_no_limit_point(monkeypatch):
    """Where all small steps have a solution there is none."""
    monkeypatch.setattr(curved_tools, "SMALL", 0.5)
    assert CASES["circle, degree 1, mu 0.3, from rest"].limit(1) == 1.0


def test_a_tool_that_does_not_touch():
    """The residual of the unstressed body is round-off, at some nodes more than one strain in its last place makes."""
    problem = CASES["bowl, degree 1, mu 0, slid"].posed()
    problem.place(0, shift=(0.0, -0.05))
    problem.solve()
    assert not problem.pressure.x.array.any()
