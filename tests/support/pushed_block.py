"""A block that only its foundation holds, and the largest force that friction can balance."""

from scene_tables import coulomb_friction, rectangle_mesh

from signorini_fx.scenes.reading import parse_scene

FRICTION, PRESSURE, LENGTH = 0.3, 20.0, 3.0


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


def friction_force(contact):
    """What the foundation holds against, along x."""
    return -contact.forces[1][0]
