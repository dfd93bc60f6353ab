"""A distorted block that is turned in 3D, and a scene of it, for the judge of random scenes."""

import numpy as np

from benchmarks.stability.oracle.body import Mesh
from benchmarks.stability.oracle.scenes_in_space import grid


def block(cell="hexahedron", inner=0.0, shape=(3, 2, 2)):
    """A distorted block of 1.5 x 1 x 1, turned in 3D, and its turn."""
    points, cells, boundaries = grid(*shape, cell)
    inside = (points > 1e-9).all(axis=1) & (points < 1 - 1e-9).all(axis=1)
    points[inside] += inner * np.sin(9 * points[inside][:, ::-1] + 1)
    axis = np.array([1.0, 2.0, 2.0]) / 3
    cross = np.cross(np.eye(3), axis)
    turn = np.eye(3) + np.sin(0.7) * cross + (1 - np.cos(0.7)) * cross @ cross
    high = points[cells].mean(axis=1)[:, 2] > 0.5
    regions = {"below": np.flatnonzero(~high), "above": np.flatnonzero(high)}
    return Mesh(points * [1.5, 1.0, 1.0] @ turn.T, cells, boundaries, regions), turn


def scene(friction, degree=1, solver=None, **others):
    """Two materials, pressed and pulled obliquely, over a gap that is not constant; in the frame of
    ``block``.
    """
    _, turn = block()
    down, along = turn @ [0.0, 0.0, -1.0], turn[:, 0]
    pulled = [float(v) for v in 4.0 * down + turn @ [0.9, 0.35, 0.0]]
    place = " + ".join(f"{float(c)!r}*x[{k}]" for k, c in enumerate(along))
    return {
        "mesh": {"file": "body.inp"},
        "element": {"degree": degree},
        "material": [
            {"region": "below", "young": 1000.0, "poisson": 0.3},
            {"region": "above", "young": 700.0, "poisson": 0.2},
        ],
        "displacement": [{"boundary": "left", "normal": 0.0}],
        "traction": [{"boundary": "top", **dict(zip("xyz", pulled, strict=True))}],
        "contact": [
            {"boundary": "bottom", "gap": f"0.01*(({place}) - 0.4)**2", "friction": friction}
        ],
        "solver": solver or {},
        **others,
    }
