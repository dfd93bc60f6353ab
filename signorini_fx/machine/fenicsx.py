"""Where FEniCSx comes from.  It is not imported here."""

from __future__ import annotations

from signorini_fx.errors import InstallationError

_WAYS = """\
    apt install python3-dolfinx python3-gmsh                              (Debian 13 or later, Python of the system)
    pip install '.[fenicsx]'                    (checkout, Python 3.12 or later on Linux, x86-64; not by FEniCS)
    conda install -c conda-forge fenics-dolfinx mpich python-gmsh         (not tried)
    docker build -t signorini-fx .                                        (in the checkout, or use its ./env)"""


def needs_fenicsx(message: str) -> InstallationError:
    """The error of an installation whose FEniCSx is missing, too old, or lacks something; it says where to get it."""
    return InstallationError(f"{message}: FEniCSx with dolfinx >= 0.9 is needed. Install it by one of\n{_WAYS}")
