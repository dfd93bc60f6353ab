"""Example 1 of the paper with the same mesh and numbers for every contestant, and the form of their answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from signorini_fx.mechanics.mesh.tagged import TaggedMesh, generate_mesh
from signorini_fx.results.solution import Solution
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.scene import Scene

Floats = npt.NDArray[np.float64]

LENGTH, HEIGHT = 3.0, 1.0
YOUNG, POISSON = 5000.0, 0.4
TRACTION = -20.0  # on 1 <= x[0] <= 2 of the top
LOAD_DEGREE = 4  # quadrature degree of the traction, exact where 1 and 2 are nodes: nx divisible by 3
GAMMA = 1e8
BOUND = 1.5
COEFFICIENT = 0.3
TOLERANCE = 1e-7


def gap(x: Floats) -> Floats:
    """The gap d of section 7.1, at points of shape (n,) along the bottom."""
    return 0.003 * (x - 1.5) ** 2 + 0.001


def parameters(nx: int) -> dict[str, Any]:
    """The generator's parameters for nx by nx / 3 squares."""
    return {"length": LENGTH, "height": HEIGHT, "nx": nx, "ny": nx // 3}


def tagged_mesh(nx: int, comm: MPI.Comm = MPI.COMM_SELF) -> TaggedMesh:
    """The mesh, which is in memory before any time is measured."""
    return generate_mesh("rectangle", parameters(nx), comm)


def scene(
    law: str, mesh: TaggedMesh | int, *, gamma: float = GAMMA, coefficient: float = COEFFICIENT, **settings: Any
) -> Scene:
    """The scene with friction ``law``, on a mesh or, for nested iteration, on the generator with nx cells along it."""
    friction = {"law": law} | ({"bound": BOUND} if law == "tresca" else {"coefficient": coefficient})
    data = {
        "mesh": {"generator": "rectangle", "parameters": parameters(mesh if isinstance(mesh, int) else 3)},
        "material": {"young": YOUNG, "poisson": POISSON},
        "displacement": [{"boundary": "left", "x": 0.0}, {"boundary": "right", "x": 0.0}],
        "traction": {"boundary": "top", "y": f"{TRACTION} if 1 <= x[0] <= 2 else 0"},
        "contact": {"boundary": "bottom", "gap": "0.003 * (x[0] - 1.5)**2 + 0.001", "friction": friction},
        "solver": {"gamma_n": gamma, "gamma_t": gamma, "tolerance": TOLERANCE, **settings},
    }
    made = parse_scene(data)
    return made if isinstance(mesh, int) else made.model_copy(update={"mesh": mesh})


@dataclass(frozen=True)
class Answer:
    """The answer of a contestant on the contact boundary, nodes from left to right.

    Attributes:
        x: position, shape (n,).
        pressure: lambda, stress.
        shear: mu, stress.
        contact: nodes of A_c.
        slip: +1, -1 on the slip sets, else 0.
        solves: linear solves.
    """

    x: Floats
    pressure: Floats
    shear: Floats
    contact: npt.NDArray[np.bool_]
    slip: npt.NDArray[np.int8]
    solves: int

    @classmethod
    def of(cls, solution: Solution) -> Answer:
        """The package's, on one rank."""
        c = solution.contact
        assert c is not None
        order = np.argsort(c.boundary.x[:, 0])
        slip = np.where(c.bound > 0, c.direction[:, 0], 0).astype(np.int8)
        nodal = (c.boundary.x[:, 0], c.pressure, c.shear[:, 0], c.in_contact, slip)
        return cls(*(values[order] for values in nodal), solution.history.linear_solves)

    def differs(self, other: Answer, tolerance: float = 1e-6) -> str:
        """The differences of ``other``; empty if there are none.

        Pressure and shear are compared relative to the largest pressure.
        """
        found = []
        for name in ("pressure", "shear"):
            far = np.abs(getattr(self, name) - getattr(other, name)).max() / self.pressure.max()
            if not far <= tolerance:
                found.append(f"{name} by {far:.1e}")
        for name in ("contact", "slip"):
            count = np.count_nonzero(getattr(self, name) != getattr(other, name))
            if count:
                found.append(f"{name} sets at {count} nodes")
        return ", ".join(found)
