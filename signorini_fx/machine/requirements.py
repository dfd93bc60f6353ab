"""Checks that FEniCSx is installed, without importing it."""

from __future__ import annotations

from importlib.util import find_spec

from signorini_fx.errors import InstallationError

FENICSX = ("mpi4py", "petsc4py", "ufl", "basix", "dolfinx")


def check_fenicsx() -> None:
    """Raise ``InstallationError`` if a part of FEniCSx is not installed; ``compat`` checks its version."""
    missing = [name for name in FENICSX if find_spec(name) is None]
    if missing:
        raise needs_fenicsx(f"{', '.join(missing)} cannot be imported")


_WAYS = """\
    apt install python3-dolfinx python3-gmsh                              (Debian 13 or later, Python of the system)
    pip install '.[fenicsx]'                    (checkout, Python 3.12 or later on Linux, x86-64; not by FEniCS)
    conda install -c conda-forge fenics-dolfinx mpich python-gmsh         (not tried)
    docker build -t signorini-fx .                                        (in the checkout, or use its ./env)"""


def needs_fenicsx(message: str) -> InstallationError:
    """The error of an installation whose FEniCSx is missing, too old, or lacks something; it says where to get it."""
    return InstallationError(f"{message}: FEniCSx with dolfinx >= 0.9 is needed. Install it by one of\n{_WAYS}")
