"""A block that only its foundation holds, and the largest force that friction can balance."""

from mpi4py import MPI
from scene_tables import coulomb_friction, rectangle_mesh
from spaces import box

from signorini_fx.scenes.reading import parse_scene

FRICTION, PRESSURE, LENGTH = 0.3, 20.0, 3.0
DRAGGED_PRESSURE = 4.0

LIMIT = FRICTION * PRESSURE * LENGTH  # the largest force that friction can balance


def block(nx, loads, **solver):
    """A block 3 x 1 that only its foundation holds, with Coulomb friction."""
    return parse_scene(
        {
            "mesh": rectangle_mesh(nx, nx // 3, length=LENGTH),
            "material": {"young": 5000.0, "poisson": 0.3},
            "contact": {"boundary": "bottom", "friction": coulomb_friction(FRICTION)},
            "solver": solver,
            **loads,
        }
    )


def dragged_block(contact, dim=2, factors=None, **tables):
    """A low block, 2 long and 1 wide, pressed on its foundation while its top is dragged along
    it.
    """
    if dim == 2:
        mesh = rectangle_mesh(10, 2, length=2.0, height=0.2)
    else:
        mesh = box("hexahedra", (4, 2, 2), size=(2.0, 1.0, 0.2), comm=MPI.COMM_WORLD)
    top = {"boundary": "top", "x": 0.05, "factors": factors} | ({"y": 0.0} if dim == 3 else {})
    return parse_scene(
        {
            "mesh": mesh,
            "material": {"young": 1000.0, "poisson": 0.0},
            "displacement": [top],
            "traction": [{"boundary": "top", "xyz"[dim - 1]: -DRAGGED_PRESSURE}],
            "contact": {"boundary": "bottom", **contact},
            **tables,
        }
    )


def friction_force(contact):
    """What the foundation holds against, along x."""
    return -contact.forces[1][0]
