"""Signorini contact with Tresca and Coulomb friction on FEniCSx, by the semi-smooth Newton method
of Kunisch & Stadler.

Use ``from signorini_fx import Scene, read_scene, solve``. dolfinx is imported only when it is first
needed.

The examples of the public names begin with these lines::

    import numpy as np
    import ufl
    from dolfinx import fem
    from mpi4py import MPI
    import signorini_fx as sfx

    block = sfx.generate_mesh("rectangle", {"length": 2.0, "nx": 8, "ny": 4}, MPI.COMM_WORLD)
    cube = sfx.generate_mesh("box", {"nx": 2, "ny": 2, "nz": 2}, MPI.COMM_WORLD)
    steel = sfx.LinearElastic(young=1000.0, poisson=0.3)
    left = sfx.Displacement(boundary="left", x=0.0)
    pressed = sfx.Traction(boundary="top", pressure=2.0)
    below = sfx.Contact(boundary="bottom")
    scene = sfx.Scene(
        mesh=block, material=steel, displacement=left, traction=pressed, contact=below
    )
    solution = sfx.solve(scene)
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

# The module of each public name stands only in the stub, which type checkers read as well.
with open(f"{__file__}i", encoding="utf-8") as _stub:
    _IMPORTS = [line.split() for line in _stub if line.startswith("from ")]
_PUBLIC = {name: module for _, module, _, name, *_ in _IMPORTS}
_ADD_ONS = tuple(name for name, module in _PUBLIC.items() if ".addons." in module)

__all__ = sorted(_PUBLIC)


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        try:
            if name in _ADD_ONS:
                return import_module("signorini_fx.extensions").add_on(name)
            return getattr(import_module(_PUBLIC[name]), name)
        except ModuleNotFoundError as error:
            failure = error
        from signorini_fx.errors import check_fenicsx

        check_fenicsx()
        raise failure
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
