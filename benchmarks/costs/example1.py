"""Example 1 of the paper with the same mesh and numbers for the package and for one linear
solve.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from signorini_fx.mechanics.mesh.tagged import TaggedMesh, generate_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.scene import Scene

Floats = npt.NDArray[np.float64]

LENGTH, HEIGHT = 3.0, 1.0
YOUNG, POISSON = 5000.0, 0.4
TRACTION = -20.0  # on 1 <= x[0] <= 2 of the top
LOAD_DEGREE = (
    4  # quadrature degree of the traction, exact where 1 and 2 are nodes: nx divisible by 3
)
GAMMA = 1e8
BOUND = 1.5
COEFFICIENT = 0.3
TOLERANCE = 1e-7


def parameters(nx: int) -> dict[str, Any]:
    """The generator's parameters for nx by nx / 3 squares."""
    return {"length": LENGTH, "height": HEIGHT, "nx": nx, "ny": nx // 3}


def tagged_mesh(nx: int, comm: MPI.Comm = MPI.COMM_SELF) -> TaggedMesh:
    """The mesh, which is in memory before any time is measured."""
    return generate_mesh("rectangle", parameters(nx), comm)


def scene(
    law: str,
    mesh: TaggedMesh | int,
    *,
    gamma: float = GAMMA,
    coefficient: float = COEFFICIENT,
    **settings: Any,
) -> Scene:
    """The scene with friction ``law``, on a mesh or, for nested iteration, on the generator with nx
    cells along it.
    """
    friction = {"law": law} | (
        {"bound": BOUND} if law == "tresca" else {"coefficient": coefficient}
    )
    data = {
        "mesh": {
            "generator": "rectangle",
            "parameters": parameters(mesh if isinstance(mesh, int) else 3),
        },
        "material": {"young": YOUNG, "poisson": POISSON},
        "displacement": [{"boundary": "left", "x": 0.0}, {"boundary": "right", "x": 0.0}],
        "traction": {"boundary": "top", "y": f"{TRACTION} if 1 <= x[0] <= 2 else 0"},
        "contact": {
            "boundary": "bottom",
            "gap": "0.003 * (x[0] - 1.5)**2 + 0.001",
            "friction": friction,
        },
        "solver": {"gamma_n": gamma, "gamma_t": gamma, "tolerance": TOLERANCE, **settings},
    }
    made = parse_scene(data)
    return made if isinstance(mesh, int) else made.model_copy(update={"mesh": mesh})
