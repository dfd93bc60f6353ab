"""Where a solve is: shown on a terminal, and nowhere else."""

import io
import sys

import pytest
from test_cli import SCENE

from signorini_fx.scenes.cli import main


class Terminal(io.StringIO):
    """A standard error that is a terminal."""

    def isatty(self):
        """It is."""
        return True


@pytest.mark.parametrize(
    ("terminal", "quiet", "shown"),
    [(True, False, True), (True, True, False), (False, False, False)],
)
def test_only_on_a_terminal(tmp_path, monkeypatch, capsys, terminal, quiet, shown):
    """Without one, or if nothing is to be printed, not a byte of it; with one it is erased in the
    end.
    """
    scene = tmp_path / "small.toml"
    scene.write_text(SCENE, encoding="utf-8")
    stream = Terminal() if terminal else io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    arguments = [
        "solve",
        str(scene),
        "--out",
        str(tmp_path / "out"),
        "--no-fields",
        "--no-pictures",
    ]
    assert main([*arguments, *["--quiet"] * quiet]) == 0
    assert ("linear solve" in stream.getvalue()) is shown
    assert "\x1b" not in capsys.readouterr().out
    if shown:
        assert stream.getvalue().endswith("\r\x1b[K")
