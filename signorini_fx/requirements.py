"""Whether FEniCSx is there: found out without importing it."""

from __future__ import annotations

from importlib.util import find_spec

from signorini_fx.errors import InstallationError

FENICSX = ("mpi4py", "petsc4py", "ufl", "basix", "dolfinx")


def check_fenicsx() -> None:
    """Raise ``InstallationError`` where a part of FEniCSx is not installed; ``compat`` looks at its version."""
    missing = [name for name in FENICSX if find_spec(name) is None]
    if missing:
        raise InstallationError(f"{', '.join(missing)} cannot be imported")
