"""Half a disk on a plane, and what Hertz says of it."""

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI
from on_meshes import at_coordinate
from scene_tables import coulomb_friction, fixed

from signorini_fx import tag_boundaries
from signorini_fx.mechanics.contact_points.contact_table import contact_table
from signorini_fx.scenes.reading import parse_scene

YOUNG, POISSON, RADIUS = 200.0, 0.3, 8.0


MODULUS = YOUNG / (1 - POISSON**2)


def load(half_width):
    """The load per thickness that makes a contact of that half-width: a^2 = 4 P R / (pi E*)."""
    return np.pi * MODULUS * half_width**2 / (4 * RADIUS)


def peak(half_width):
    """p0 = 2 P / (pi a)."""
    return 2 * load(half_width) / (np.pi * half_width)


def half_disk(
    half_width=0.4, *, cell="triangle", degree=1, symmetric=True, size=0.02, friction=0.0, **changes
):
    """Pressed so that the formula gives ``half_width``, facets of length ``size`` around the
    contact.
    """
    parameters = {
        "radius": RADIUS,
        "contact_size": size,
        "contact_zone": 0.6,
        "symmetric": symmetric,
        "cell": cell,
    }
    support = {"boundary": "symmetry", "normal": 0.0} if symmetric else fixed("top", "x")
    contact = {
        "boundary": "arc",
        # The circle, not the chord on which midside nodes are: a polygon would press with its
        # corners.
        "gap": f"{RADIUS} - sqrt(max(0, {RADIUS**2} - x[0]**2))",
        "direction": [0, -1],
        "friction": coulomb_friction(friction),
    }
    return parse_scene(
        {
            "mesh": {"generator": "half_disk", "parameters": parameters},
            "element": {"degree": degree},
            "material": {"young": YOUNG, "poisson": POISSON},
            "displacement": support,
            "traction": {"boundary": "top", "pressure": load(half_width) / (2 * RADIUS)},
            "contact": contact | changes.pop("contact", {}),
            **changes,
        }
    )


def profile(solution, centre=0.0):
    """(distance from the centre, pressure, weight, state) along the contact boundary."""
    columns = contact_table(solution.contact, [solution.statement.contact[0].boundary]).columns
    return columns["x"] - centre, columns["pressure"], columns["weight"], columns["state"]


def width_from_moment(x, pressure, weight):
    """a from the mean of x^2, which is a^2 / 4 for an ellipse: it does not depend on where the last
    node is.
    """
    return 2 * np.sqrt(np.dot(weight, pressure * x**2) / np.dot(weight, pressure))


def ellipse(x, pressure, half_width):
    """(a, p0) of the ellipse that fits p^2 in the inner nine tenths."""
    inner = np.abs(x) < 0.9 * half_width
    terms = np.column_stack((np.ones(np.count_nonzero(inner)), x[inner] ** 2))
    square, slope = np.linalg.lstsq(terms, pressure[inner] ** 2, rcond=None)[0]
    return np.sqrt(-square / slope), np.sqrt(square)


def parabolic_block(columns):
    """Half of a block of height and width 4 whose lower side is a parabola of ``RADIUS``, with finer
    cells around its lowest point.
    """
    mesh = dmesh.create_rectangle(
        MPI.COMM_WORLD,
        [np.zeros(2), np.ones(2)],
        [columns, columns // 2],
        dmesh.CellType.quadrilateral,
    )
    x = mesh.geometry.x
    x[:, 0] = 4.0 * x[:, 0] ** 2
    low = x[:, 0] ** 2 / 2 / RADIUS
    x[:, 1] = low + x[:, 1] ** 1.3 * (4.0 - low)
    sides = {
        "low": lambda x: np.isclose(x[1], x[0] ** 2 / 2 / RADIUS),
        "top": at_coordinate(1, 4.0),
        "middle": at_coordinate(0, 0.0),
    }
    return tag_boundaries(mesh, sides)
