"""A block that is pressed on its foundation, and what is said of it before it is solved."""

from mpi4py import MPI
from scene_tables import fixed, rectangle_mesh, tresca_friction

from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene

BLOCK = {
    "mesh": rectangle_mesh(12, 4),
    "material": {"young": 5000.0, "poisson": 0.3},
    "displacement": fixed("left"),
    "traction": {"boundary": "top", "y": -20.0},
    "contact": {"boundary": "bottom"},
}


def block(**changes):
    """A block that is pressed on its foundation, with other tables in the place of its own."""
    return parse_scene({**BLOCK, **changes})


def contact(**options):
    """The table of its contact."""
    return {"contact": {"boundary": "bottom", **options}}


def coulomb(coefficient, **options):
    """The same with Coulomb friction."""
    return contact(friction={"law": "coulomb", "coefficient": coefficient, **options})


def tresca(bound):
    """The same with given friction."""
    return contact(friction=tresca_friction(bound))


def check(data):
    """What is said of a scene on this rank."""
    return check_scene(data, MPI.COMM_SELF)
