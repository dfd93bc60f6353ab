"""Checks that FEniCSx is installed and that the machine has enough memory for it, without importing it."""

from __future__ import annotations

import resource
from importlib.util import find_spec

from signorini_fx.errors import InstallationError, MachineError
from signorini_fx.tuned import LEAST_MEMORY

FENICSX = ("mpi4py", "petsc4py", "ufl", "basix", "dolfinx")


def check_fenicsx() -> None:
    """Raise ``InstallationError`` if a part of FEniCSx is not installed; ``compat`` checks its version."""
    missing = [name for name in FENICSX if find_spec(name) is None]
    if missing:
        raise needs_fenicsx(f"{', '.join(missing)} cannot be imported")


def check_machine() -> None:
    """Raise ``MachineError`` if a limit leaves too little memory to start."""
    for limit, option in ((resource.RLIMIT_AS, "-v"), (resource.RLIMIT_DATA, "-d")):
        allowed, _ = resource.getrlimit(limit)
        if allowed != resource.RLIM_INFINITY and allowed < LEAST_MEMORY:
            raise MachineError(
                f"the memory of each process is limited to {allowed / 1e6:.0f} MB (ulimit {option}): "
                f"at least {LEAST_MEMORY / 1e6:.0f} MB are needed, raise the limit"
            )


_WAYS = """\
    apt install python3-dolfinx python3-gmsh                              (Debian 13 or later, Python of the system)
    pip install '.[fenicsx]'                    (checkout, Python 3.12 or later on Linux, x86-64; not by FEniCS)
    conda install -c conda-forge fenics-dolfinx mpich python-gmsh         (not tried)
    docker build -t signorini-fx .                                        (in the checkout, or use its ./env)"""


def needs_fenicsx(message: str) -> InstallationError:
    """The error of an installation whose FEniCSx is missing, too old, or lacks something; it says where to get it."""
    return InstallationError(f"{message}: FEniCSx with dolfinx >= 0.9 is needed. Install it by one of\n{_WAYS}")
