"""Where FEniCSx comes from: the next command on this machine, and the ways on others.  It is not imported here."""

from __future__ import annotations

import json
import platform
import subprocess
import sys
import sysconfig
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path

from signorini_fx.errors import InstallationError
from signorini_fx.tuned import VERSION_PATIENCE

# As the extra ``fenicsx`` of pyproject.toml has them, whose markers say where there are such wheels.
WHEELS = ("dolfinx-solver-real>=0.11", "gmsh>=4.12")
_OLDEST_PYTHON, _SYSTEM, _PROCESSOR = (3, 12), "Linux", "x86_64"
_NEWER = ("python3.14", "python3.13", "python3.12")
_CONDA = "install -c conda-forge fenics-dolfinx mpich python-gmsh"
_ELSEWHERE = """or, on other machines, by one of
    apt install python3-dolfinx python3-gmsh                              (Debian 13 or later, Python of the system)
    pip install '.[fenicsx]'                    (checkout, Python 3.12 or later on Linux, x86-64; not by FEniCS)
    conda install -c conda-forge fenics-dolfinx mpich python-gmsh         (not tried)
    docker build -t signorini-fx .                                        (in the checkout, or use its ./env)"""


@dataclass(frozen=True)
class Surroundings:
    """What decides about the command.

    Attributes:
        python: its version, two numbers.
        executable: its path.
        system: such as ``Linux``.
        processor: such as ``x86_64``.
        debian: whether it is the Python of Debian 13 or later.
        conda: whether it is that of an environment of conda.
        managed: whether pip must not install into it, since the system does.
        has_pip: whether it has pip of its own, unlike environments of uv, and of Debian without ``python3-venv``.
        source: of this package, a path for pip.
        runs: whether a program is there, and runs; of a Python, whether it can make environments.
    """

    python: tuple[int, int]
    executable: str
    system: str
    processor: str
    debian: bool
    conda: bool
    managed: bool
    has_pip: bool
    source: str
    runs: Callable[[str], bool]

    @classmethod
    def present(cls) -> Surroundings:
        """Those of this process."""
        alone = sys.prefix != sys.base_prefix
        return cls(
            python=(sys.version_info.major, sys.version_info.minor),
            executable=sys.executable or "python3",
            system=platform.system(),
            processor=platform.machine(),
            debian=not alone and sys.prefix == "/usr" and _debian() >= 13,
            conda=(Path(sys.prefix) / "conda-meta").is_dir(),
            managed=not alone and (Path(sysconfig.get_path("stdlib")) / "EXTERNALLY-MANAGED").is_file(),
            has_pip=find_spec("pip") is not None,
            source=_source(),
            runs=_runs,
        )

    @property
    def words(self) -> str:
        """This machine."""
        return f"Python {'.'.join(map(str, self.python))}, {self.system} on {self.processor}"

    @property
    def command(self) -> str:
        """That installs FEniCSx here."""
        if self.debian:
            return "sudo apt install python3-dolfinx python3-gmsh"
        if self.conda:
            return f"conda {_CONDA}"
        wheels = " ".join(f"'{wheel}'" for wheel in WHEELS)
        if self._has_wheels(self.python) and not self.managed:
            return f"{self._installer} {wheels}"
        pythons = [self.executable] * self._has_wheels(self.python) + [*_NEWER] * self._has_wheels(_OLDEST_PYTHON)
        if suitable := next((python for python in pythons if self.runs(python)), None):
            place = "~/signorini"  # with this package once more, as it is installed for another Python
            return f"{suitable} -m venv {place} && {place}/bin/pip install {wheels} {self.source}"
        return f"conda {_CONDA}" if self.runs("conda") else f"cd {self.source} && ./env signorini-fx info"

    @property
    def _installer(self) -> str:
        """What installs into the environment of this Python."""
        if self.has_pip:
            return f"{self.executable} -m pip install"
        return (
            f"uv pip install --python {self.executable}"
            if self.runs("uv")
            else f"pip --python {self.executable} install"
        )

    def _has_wheels(self, python: tuple[int, int]) -> bool:
        return python >= _OLDEST_PYTHON and (self.system, self.processor) == (_SYSTEM, _PROCESSOR)


def _debian() -> int:
    """The release of Debian; zero: it is none, or has no number."""
    try:
        release = platform.freedesktop_os_release()
        return int(release["VERSION_ID"]) if release["ID"] == "debian" else 0
    except (OSError, KeyError, ValueError):
        return 0


def _runs(program: str) -> bool:
    """See ``Surroundings``: what is on the path may be a placeholder that starts nothing."""
    arguments = ["-c", "import ensurepip, venv"] if "python" in program else ["--version"]
    try:
        ended = subprocess.run([program, *arguments], capture_output=True, check=False, timeout=VERSION_PATIENCE)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return ended.returncode == 0


def _source() -> str:
    """The folder that pip has this package from, or its checkout."""
    try:
        url = json.loads(distribution("signorini_fx").read_text("direct_url.json") or "{}").get("url", "")
    except PackageNotFoundError:
        url = ""
    checkout = Path(__file__).parents[2]
    return str(url).removeprefix("file://") or (
        str(checkout) if (checkout / "pyproject.toml").is_file() else "signorini_fx"
    )


def needs_fenicsx(message: str) -> InstallationError:
    """The error of an installation whose FEniCSx is missing, too old, or lacks something; it says where to get it."""
    here = Surroundings.present()
    wanted = f"FEniCSx with dolfinx >= 0.9 is needed. Install it here ({here.words}) by"
    return InstallationError(f"{message}: {wanted}\n    {here.command}\n{_ELSEWHERE}")
