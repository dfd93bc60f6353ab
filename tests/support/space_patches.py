"""Constant states of stress in 3D on distorted meshes at any angle."""

import numpy as np
from on_meshes import turn_by
from scenes import alone
from spaces import box, rotation

from signorini_fx.scenes.reading import parse_scene

YOUNG, POISSON = 5000.0, 0.3
PRESSURE, SHEAR, GAP, GAMMA = 20.0, 4.0, 0.002, 1e6
OBLIQUE = np.radians(37.0)


SIZE = (1.5, 1.2, 1.0)


ROUND_OFF = 1e-10


ELEMENTS = {
    "P1": ("tetrahedra", 1),
    "P2": ("tetrahedra", 2),
    "Q1": ("hexahedra", 1),
    "Q2": ("hexahedra", 2),
}


TURNS = {
    "upright": (0.0, (0.0, 0.0, 1.0)),
    "turned": (0.9, (0.3, -0.8, 0.5)),
    "leaning": (0.6, (0.0, 1.0, 0.0)),
    "leaning sideways": (0.6, (1.0, 0.0, 0.0)),
}


SIDES = {
    "left": (0, -1.0),
    "right": (0, 1.0),
    "front": (1, -1.0),
    "back": (1, 1.0),
    "top": (2, 1.0),
    "bottom": (2, -1.0),
}


def patch_mesh(element, turn):
    """Vertices are moved by up to a fifth of a cell, those of the boundary along it, then all are
    turned.
    """
    shape = (4, 3, 3)
    tagged = box(ELEMENTS[element][0], shape, size=SIZE)
    x = tagged.mesh.geometry.x
    rng = np.random.default_rng(7)
    moved = np.zeros_like(x)
    for axis in range(3):
        inside = (x[:, axis] > 1e-9) & (x[:, axis] < SIZE[axis] - 1e-9)
        moved[inside, axis] = (rng.random(inside.sum()) - 0.5) * 0.4 * SIZE[axis] / shape[axis]
    x[:] = (x + moved) @ rotation(*TURNS[turn]).T
    return tagged


class State:
    """A constant state of stress in the frame of the body, with the displacement that it has
    there.
    """

    def __init__(self, stress, origin):
        """``stress`` has xx, yy, zz, xy, xz, yz; the bottom is moved by ``origin``, and not
        turned.
        """
        xx, yy, zz, xy, xz, yz = stress
        self.stress = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        trace = np.trace(self.stress)
        strain = (1 + POISSON) / YOUNG * self.stress - POISSON / YOUNG * trace * np.eye(3)
        self.slope = np.array(strain)
        self.slope[:2, 2] += strain[:2, 2]  # the rotation that leaves the bottom where it is
        self.slope[2, :2] = 0.0
        self.origin = np.array(origin)

    def tractions(self, turn, *names):
        """The tractions of the state on some sides, turned."""
        matrix, found = rotation(*TURNS[turn]), []
        for name in names:
            axis, sign = SIDES[name]
            force = matrix @ (sign * self.stress[:, axis])
            found.append({"boundary": name, **dict(zip("xyz", map(float, force), strict=True))})
        return found

    def displacement(self, turn, x):
        """At points (n, 3)."""
        matrix = rotation(*TURNS[turn])
        return (x @ matrix @ self.slope.T + self.origin) @ matrix.T


CONFINED = -POISSON / (1 - POISSON) * PRESSURE


def pressed(shear=0.0, angle=0.0, creep=0.0):
    """No widening: pressure, and a shear in a direction, at which the bottom has moved by ``creep``
    more.
    """
    way = turn_by(angle)[:, 0]
    along = (shear / GAMMA + creep) * way
    return State(
        (CONFINED, CONFINED, -PRESSURE, 0.0, *(shear * way)), (*along, -GAP - PRESSURE / GAMMA)
    )


def run(element, turn, **effects):
    """Solve on the distorted mesh."""
    given = {
        "mesh": patch_mesh(element, turn),
        "element": {"degree": ELEMENTS[element][1]},
        "material": {"young": YOUNG, "poisson": POISSON},
        "solver": {"gamma_n": GAMMA, "gamma_t": GAMMA, "tolerance": 1e-12},
        **effects,
    }
    return alone(parse_scene(given))


def assert_displacement(solution, state, turn):
    """The displacement is that of the state, to round-off."""
    x = solution.model.space.tabulate_dof_coordinates()
    exact = state.displacement(turn, x)
    found = solution.displacement.x.array.reshape(-1, 3)
    np.testing.assert_allclose(found, exact, rtol=0, atol=ROUND_OFF * np.abs(exact).max())


def contact(**more):
    """The foundation below the bottom."""
    return {"boundary": "bottom", "gap": GAP, **more}
