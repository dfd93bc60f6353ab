"""Where FEniCSx is missing or too old there is one sentence, with the ways to get it."""

import importlib
import subprocess
import sys

import dolfinx
import pytest

from signorini_fx.errors import InstallationError
from signorini_fx.machine import compat, fenicsx, requirements
from signorini_fx.scenes import cli
from signorini_fx.scenes.cli.exit_codes import EXIT_BAD_INPUT

CHANNELS = ("apt install python3-dolfinx", "conda install -c conda-forge fenics-dolfinx", "docker build")


@pytest.mark.parametrize("command", ["solve", "check", "info"])
def test_command_line(command, monkeypatch, capsys):
    """No traceback, exit code 2, and how to install it."""
    monkeypatch.setattr(requirements, "find_spec", lambda name: None if name == "dolfinx" else object())
    assert cli.main([command] if command == "info" else [command, "no.toml"]) == EXIT_BAD_INPUT
    said = capsys.readouterr().err
    assert said.startswith("signorini-fx: error: dolfinx cannot be imported: FEniCSx with dolfinx >= 0.9 is needed")
    assert all(channel in said for channel in CHANNELS)


def test_python():
    """``from signorini_fx import solve`` says the same; without FEniCSx the rest of the package works."""
    code = (
        "import sys; sys.modules['dolfinx'] = None; "
        "import importlib.util as u, signorini_fx.machine.requirements as r; "
        "r.find_spec = lambda n: None if n == 'dolfinx' else u.find_spec(n); import signorini_fx; "
        "signorini_fx.read_scene; signorini_fx.solve"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "InstallationError: dolfinx cannot be imported" in ended.stderr
    assert "During handling" not in ended.stderr


def test_too_old(monkeypatch):
    """dolfinx 0.8 is refused where versions are compared."""
    monkeypatch.setattr(dolfinx, "__version__", "0.8.0")
    try:
        with pytest.raises(InstallationError, match=r"dolfinx is 0\.8\.0: FEniCSx with dolfinx >= 0\.9"):
            importlib.reload(compat)
    finally:
        monkeypatch.undo()
        importlib.reload(compat)


def on(**other):
    """A machine: Python 3.12 of its own on Linux, or another one."""
    surroundings = {
        "python": (3, 12),
        "executable": "python3",
        "system": "Linux",
        "processor": "x86_64",
        "debian": False,
        "conda": False,
        "managed": False,
        "has_pip": True,
        "source": "/src",
        "runs": lambda name: name == "python3",
    }
    return fenicsx.Surroundings(**surroundings | other)


WHEELS = "'dolfinx-solver-real>=0.11' 'gmsh>=4.12'"
IN_A_NEW_PLACE = f"-m venv ~/signorini && ~/signorini/bin/pip install {WHEELS} /src"


@pytest.mark.parametrize(
    ("other", "command"),
    [
        ({}, f"python3 -m pip install {WHEELS}"),
        ({"has_pip": False}, f"pip --python python3 install {WHEELS}"),
        ({"has_pip": False, "runs": lambda name: name == "uv"}, f"uv pip install --python python3 {WHEELS}"),
        ({"debian": True, "managed": True, "python": (3, 13)}, "sudo apt install python3-dolfinx python3-gmsh"),
        ({"managed": True}, f"python3 {IN_A_NEW_PLACE}"),
        ({"python": (3, 11), "runs": lambda name: name == "python3.13"}, f"python3.13 {IN_A_NEW_PLACE}"),
        ({"conda": True}, "conda install -c conda-forge fenics-dolfinx mpich python-gmsh"),
        (
            {"system": "Darwin", "processor": "arm64", "runs": lambda name: name in ("conda", "python3.13")},
            "conda install -c conda-forge fenics-dolfinx mpich python-gmsh",
        ),
        ({"python": (3, 11)}, "cd /src && ./env signorini-fx info"),
        ({"managed": True, "runs": lambda name: False}, "cd /src && ./env signorini-fx info"),
        ({"processor": "aarch64"}, "cd /src && ./env signorini-fx info"),
    ],
)
def test_the_next_command(other, command):
    """What can be done on this machine, by Python's version, the platform, and who manages its packages."""
    assert on(**other).command == command
