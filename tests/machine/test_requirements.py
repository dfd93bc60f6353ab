"""Where FEniCSx is missing or too old there is one sentence, with the ways to get it."""

import importlib

import dolfinx
import pytest
from commands import run_python

from signorini_fx import errors
from signorini_fx.errors import InstallationError
from signorini_fx.machine import compat
from signorini_fx.scenes import cli
from signorini_fx.scenes.cli.grammar import EXIT_BAD_INPUT

CHANNELS = (
    "apt install python3-dolfinx",
    "conda install -c conda-forge fenics-dolfinx",
    "docker build",
)


@pytest.mark.parametrize("command", ["solve", "check", "info"])
def test_command_line(command, monkeypatch, capsys):
    """No traceback, exit code 2, and how to install it."""
    monkeypatch.setattr(errors, "find_spec", lambda name: None if name == "dolfinx" else object())
    assert cli.main([command] if command == "info" else [command, "no.toml"]) == EXIT_BAD_INPUT
    said = capsys.readouterr().err
    assert said.startswith(
        "signorini-fx: error: dolfinx cannot be imported: FEniCSx with dolfinx >= 0.9 is needed"
    )
    assert all(channel in said for channel in CHANNELS)


def test_python():
    """``from signorini_fx import solve`` says the same; without FEniCSx the rest of the package
    works.
    """
    code = (
        "import sys; sys.modules['dolfinx'] = None; "
        "import importlib.util as u, signorini_fx.errors as r; "
        "r.find_spec = lambda n: None if n == 'dolfinx' else u.find_spec(n); import signorini_fx; "
        "signorini_fx.read_scene; signorini_fx.solve"
    )
    ended = run_python(code, check=False)
    assert "InstallationError: dolfinx cannot be imported" in ended.stderr
    assert "During handling" not in ended.stderr


def test_too_old(monkeypatch):
    """dolfinx 0.8 is refused where versions are compared."""
    monkeypatch.setattr(dolfinx, "__version__", "0.8.0")
    try:
        with pytest.raises(
            InstallationError, match=r"dolfinx is 0\.8\.0: FEniCSx with dolfinx >= 0\.9"
        ):
            importlib.reload(compat)
    finally:
        monkeypatch.undo()
        importlib.reload(compat)
