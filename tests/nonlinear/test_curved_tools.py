"""The table of iterations with curved tools."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from stability import curved_tools

CASES = {case.name: case for case in curved_tools.cases()}


def test_rows(monkeypatch, capsys):
    """The cases take as few iterations as the table promises, and it counts those that do not."""
    chosen = [CASES["circle, degree 1, mu 0.3, from rest"], CASES["rounded wedge, degree 1, mu 0.3, slid"]]
    monkeypatch.setattr(curved_tools, "cases", lambda: chosen)
    assert curved_tools.main() == 0
    monkeypatch.setattr(curved_tools, "MOST", 3)
    assert curved_tools.main() == 2
    assert capsys.readouterr().out.count("circle, degree 1, mu 0.3, from rest") == 2


def test_a_tool_that_does_not_touch():
    """The residual of the unstressed body is round-off, at some nodes more than one strain in its last place makes."""
    problem = CASES["bowl, degree 1, mu 0, slid"].posed()
    problem.place(0, shift=(0.0, -0.05))
    problem.solve()
    assert not problem.pressure.x.array.any()
