"""Example 1 of the paper as every contestant gets it: the same mesh in memory, the same numbers; and what they answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from signorini_fx.mesh import TaggedMesh, generate_mesh
from signorini_fx.scene import Scene, parse_scene
from signorini_fx.solution import Solution

Floats = npt.NDArray[np.float64]

LENGTH, HEIGHT = 3.0, 1.0
YOUNG, POISSON = 5000.0, 0.4
TRACTION = -20.0  # on 1 <= x[0] <= 2 of the top
LOAD_DEGREE = 4  # quadrature degree of the traction, exact where 1 and 2 are nodes: nx divisible by 3
GAMMA = 1e8
BOUND = 1.5
COEFFICIENT = 0.3
TOLERANCE = 1e-7

LAWS = {
    "tresca": {"law": "tresca", "bound": BOUND},
    "coulomb": {"law": "coulomb", "coefficient": COEFFICIENT},
}


def gap(x: Floats) -> Floats:
    """d of section 7.1, at points of shape (n,) along the bottom."""
    return 0.003 * (x - 1.5) ** 2 + 0.001


def parameters(nx: int) -> dict[str, Any]:
    """The generator's parameters for nx by nx / 3 squares."""
    return {"length": LENGTH, "height": HEIGHT, "nx": nx, "ny": nx // 3}


def tagged_mesh(nx: int, comm: MPI.Comm = MPI.COMM_SELF) -> TaggedMesh:
    """The mesh, in memory before any clock starts."""
    return generate_mesh("rectangle", parameters(nx), comm)


def scene(law: str, mesh: TaggedMesh | int, gamma: float = GAMMA, **settings: Any) -> Scene:
    """The scene with friction ``law``, on a mesh or, for nested iteration, on the one that nx cells make."""
    data = {
        "mesh": {"generator": "rectangle", "parameters": parameters(mesh if isinstance(mesh, int) else 3)},
        "material": {"young": YOUNG, "poisson": POISSON},
        "displacement": [{"boundary": "left", "x": 0.0}, {"boundary": "right", "x": 0.0}],
        "traction": {"boundary": "top", "y": f"{TRACTION} if 1 <= x[0] <= 2 else 0"},
        "contact": {"boundary": "bottom", "gap": "0.003 * (x[0] - 1.5)**2 + 0.001", "friction": LAWS[law]},
        "solver": {"gamma_n": gamma, "gamma_t": gamma, "tolerance": TOLERANCE, **settings},
    }
    made = parse_scene(data)
    return made if isinstance(mesh, int) else made.model_copy(update={"mesh": mesh})


@dataclass(frozen=True)
class Answer:
    """What a contestant says of the contact boundary, nodes from left to right.

    Attributes:
        x: position, shape (n,).
        pressure: lambda, stress.
        shear: mu, stress.
        contact: nodes of A_c.
        slip: +1, -1 on the slip sets, else 0.
        solves: linear solves.
        factorisations: of them with a new factorisation.
        phases: seconds by phase, if it says so.
        note: anything else worth printing.
    """

    x: Floats
    pressure: Floats
    shear: Floats
    contact: npt.NDArray[np.bool_]
    slip: npt.NDArray[np.int8]
    solves: int
    factorisations: int
    phases: Mapping[str, float] = field(default_factory=dict)
    note: str = ""

    @classmethod
    def of(cls, solution: Solution) -> Answer:
        """The package's."""
        c = solution.contact
        assert c is not None
        order = np.argsort(c.boundary.x[:, 0])
        records = solution.history.iterations
        return cls(
            c.boundary.x[order, 0],
            c.pressure[order],
            c.shear[order],
            c.in_contact[order],
            np.where(c.bound > 0, c.slip, 0)[order].astype(np.int8),
            len(records),
            sum(record.factorised for record in records),
            solution.timings.seconds,
            solution.algorithm,
        )

    def differs(self, other: Answer, tolerance: float = 1e-6) -> str:
        """What is not the same in ``other``; empty if nothing is.

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
