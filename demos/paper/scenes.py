"""The two examples of section 7 as scenes on uniform Q1 meshes."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from mpi4py import MPI

from signorini_fx import Coulomb, Scene, TaggedMesh, Tresca, generate_mesh, tag_boundaries
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_SELF
GRID = (120, 40)
# Where tau_N y = d is forced at the start: the standard one of section 7.1, and the non-symmetric
# one of Table 3.
STARTS = {"symmetric": "1.25 <= x[0] <= 1.75", "nonsymmetric": "x[0] <= 0.5"}
GAP1 = "0.003*(x[0] - 1.5)**2 + 0.001"
GAP2 = f"max(0.0015, {GAP1})"


def tresca(bound: float) -> Tresca:
    """Given friction g."""
    return Tresca(bound=bound)


def coulomb(coefficient: float) -> Coulomb:
    """Coulomb friction with the coefficient F."""
    return Coulomb(coefficient=coefficient)


def example1(
    friction: Any, *, poisson: float = 0.4, grid: tuple[int, int] = GRID, **solver: Any
) -> Scene:
    """Section 7.1: a block, pressed in the middle of its top, free to move vertically but for the
    contact.
    """
    return _scene(
        mesh=_example1_mesh(*grid),
        material={"young": 5000.0, "poisson": poisson},
        displacement=[{"boundary": "left", "x": 0.0}, {"boundary": "right", "x": 0.0}],
        traction={"boundary": "top", "y": "-20 if 1 <= x[0] <= 2 else 0"},
        contact={"boundary": "bottom", "gap": GAP1, "friction": friction},
        solver=_settings(**{"start": STARTS["symmetric"]} | solver),
    )


def example2(friction: Any, *, grid: tuple[int, int] = GRID, **solver: Any) -> Scene:
    """Section 7.2: the same block, its sides pushed downwards and together, over a foundation with
    two kinks.
    """
    return _scene(
        mesh=_example2_mesh(*grid),
        material={"young": 10000.0, "poisson": 0.45},
        displacement=[
            {"boundary": "left", "x": "0.003*(1 - x[1])", "y": -0.004},
            {"boundary": "right", "x": "-0.003*(1 - x[1])", "y": -0.004},
        ],
        contact={"boundary": "bottom", "gap": GAP2, "friction": friction},
        solver=_settings(**{"start": "all"} | solver),
    )


def _settings(
    *, start: Any, gamma: float | tuple[float, float] = 1e8, sigma: Any = 1.0, **others: Any
) -> dict[str, Any]:
    """Solver settings in the paper's terms; ``start``: the part of Gamma_c that the first solve has
    in contact.
    """
    gamma_n, gamma_t = gamma if isinstance(gamma, tuple) else (gamma, gamma)
    return {
        "gamma_n": gamma_n,
        "gamma_t": gamma_t,
        "sigma": sigma,
        "initial_contact": start,
        **others,
    }


def _scene(**data: Any) -> Scene:
    # The paper integrates in full, and its counts for nu = 0.49 depend on that.
    return parse_scene({"element": {"degree": 1, "volumetric": "full"}, **data})


@cache
def _example1_mesh(nx: int, ny: int) -> TaggedMesh:
    return generate_mesh("rectangle", {"length": 3.0, "height": 1.0, "nx": nx, "ny": ny}, COMM)


@cache
def _example2_mesh(nx: int, ny: int) -> TaggedMesh:
    """The same mesh, but left and right begin at x_2 = 0.2."""
    near = 1e-9
    markers = {
        "left": lambda x: (np.abs(x[0]) < near) & (x[1] > 0.2 - near),
        "right": lambda x: (np.abs(x[0] - 3) < near) & (x[1] > 0.2 - near),
        "bottom": lambda x: np.abs(x[1]) < near,
    }
    return tag_boundaries(_example1_mesh(nx, ny).mesh, markers)
