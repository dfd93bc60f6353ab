"""A scene whose solution was made up: its errors are known exactly.

It has contact, stick and slip in both directions.  The pressure is max(0, s), the shear the bound
times clip(r, -1, 1), the slip grows where |r| > 1; the gap and the loads follow.  The zeros of s
and |r| - 1 are at sixths of the length: on the nodes of meshes whose number of facets is a multiple
of six, else always at the same distance from one, so that the errors of a sequence of meshes can be
compared.  The slip grows like (|r| - 1)^3, which leaves the displacement smooth enough for the
rates of degree 2.
"""

from types import SimpleNamespace

import numpy as np
import ufl

from signorini_fx.scenes.reading import parse_scene

YOUNG, POISSON = 200.0, 0.3
MU = YOUNG / (2 * (1 + POISSON))
LAME = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
LENGTH, HEIGHT = 2.0, 1.0
BOUND, COEFFICIENT = 1.2, 0.4
LAWS = {
    "tresca": {"law": "tresca", "bound": BOUND},
    "coulomb": {"law": "coulomb", "coefficient": COEFFICIENT},
}

# One text for both algebras: numbers at points and UFL.
NUMBERS = SimpleNamespace(
    sin=np.sin, cos=np.cos, pos=lambda v: np.maximum(v, 0.0), clip=lambda v: np.clip(v, -1, 1)
)
SYMBOLS = SimpleNamespace(
    sin=ufl.sin,
    cos=ufl.cos,
    pos=lambda v: ufl.max_value(v, 0.0),
    clip=lambda v: ufl.max_value(-1.0, ufl.min_value(v, 1.0)),
)


def s_of(m, x):
    """Positive in contact, 1/3 < x < 5/3."""
    return 8 * (1 - (1.5 * (x[0] - 1)) ** 2)


def r_of(m, x):
    """Slip along the tangent below 2/3, stick up to 4/3, slip against it above."""
    return 3 * (1 - x[0])


def pressure(m, x):
    return m.pos(s_of(m, x))


def shear(m, x, law):
    bound = BOUND if law == "tresca" else COEFFICIENT * pressure(m, x)
    return bound * m.clip(r_of(m, x))


def displacement(m, x):
    slip = 0.002 * (m.pos(r_of(m, x) - 1) ** 3 - m.pos(-r_of(m, x) - 1) ** 3)
    across = slip * (1 - x[1]) ** 2 + 0.01 * x[1] * m.sin(2 * x[0])
    up = 0.01 * m.cos(1.7 * x[0]) * (1 + x[1]) + 0.01 * m.sin(2 * x[1])
    return across, up


def gap(x):
    """Closed in contact, open beside it."""
    return -displacement(NUMBERS, x)[1] + 0.02 * np.maximum(0, -s_of(NUMBERS, x))


def made_up(tagged, degree, law, **solver):
    """The scene that has this solution."""
    x = ufl.SpatialCoordinate(tagged.mesh)
    epsilon = ufl.sym(ufl.grad(ufl.as_vector(displacement(SYMBOLS, x))))
    sigma = LAME * ufl.tr(epsilon) * ufl.Identity(2) + 2 * MU * epsilon
    force = -ufl.div(sigma)
    side = ufl.dot(sigma, ufl.FacetNormal(tagged.mesh))
    # sigma n + lambda n + mu t with n = (0, -1) and t = (1, 0).
    below = -sigma[0, 1] + shear(SYMBOLS, x, law), -sigma[1, 1] - pressure(SYMBOLS, x)
    loads = {"left": side, "right": side, "bottom": below}
    return parse_scene(
        {
            "mesh": tagged,
            "element": {"degree": degree},
            "material": {"young": YOUNG, "poisson": POISSON},
            "displacement": {
                "boundary": "top",
                "x": lambda x: displacement(NUMBERS, x)[0],
                "y": lambda x: displacement(NUMBERS, x)[1],
            },
            "traction": [
                {"boundary": name, "x": load[0], "y": load[1]} for name, load in loads.items()
            ],
            "body_force": {"x": force[0], "y": force[1]},
            "contact": {"boundary": "bottom", "gap": gap, "friction": LAWS[law]},
            "solver": {"algorithm": "alm", **solver},
        }
    )
