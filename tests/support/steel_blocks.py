"""A block of steel-like material with names of its sides, in 2D and in 3D."""

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI
from spaces import box

from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_WORLD


YOUNG, POISSON = 5000.0, 0.3


SIZE = (2.0, 1.0)


PLANE = {"triangle": dmesh.CellType.triangle, "quadrilateral": dmesh.CellType.quadrilateral}


ELEMENTS = [
    ("quadrilateral", 1),
    ("triangle", 1),
    ("triangle", 2),
    ("hexahedra", 1),
    ("tetrahedra", 2),
]


def body(cells="quadrilateral", comm=COMM, fine=1):
    """A block from the origin, 2 long, with names of its sides; in 3D it is as wide as it is
    high.
    """
    if cells not in PLANE:
        return box(cells, (4 * fine, 2 * fine, 2 * fine), size=(*SIZE, 1.0), comm=comm)
    mesh = dmesh.create_rectangle(comm, [(0.0, 0.0), SIZE], (6 * fine, 3 * fine), PLANE[cells])
    near = {"left": (0, 0.0), "right": (0, 2.0), "bottom": (1, 0.0), "top": (1, 1.0)}
    return tag_boundaries(
        mesh,
        {name: lambda x, k=k, at=at: np.abs(x[k] - at) < 1e-9 for name, (k, at) in near.items()},
    )


def scene(tagged, degree=1, material=None, **more):
    """A block of steel-like material."""
    material = material or {"young": YOUNG, "poisson": POISSON}
    return parse_scene(
        {"mesh": tagged, "element": {"degree": degree}, "material": material, **more}
    )


def pushed_down(tagged, material, turn=None, **more):
    """A block that is pushed down and sideways on a rough plane; ``turn``: a rotation of
    everything.
    """
    dim = tagged.dimension
    turn = np.eye(dim) if turn is None else turn
    down, push = -turn[:, dim - 1], turn @ np.array([0.5, *[0.2] * (dim - 2), -1.0])
    return parse_scene(
        {
            "mesh": tagged,
            "material": material,
            "traction": {"boundary": "top", **dict(zip("xyz", 4 * push, strict=False))},
            "contact": {
                "boundary": "bottom",
                "direction": list(down),
                "friction": {"law": "coulomb", "coefficient": 0.6},
            },
            **more,
        }
    )
