"""A sphere in 3D."""

from __future__ import annotations

from typing import Literal

from signorini_fx.mechanics.shapes.circle import Ball


class Sphere(Ball):
    """A sphere.

    Attributes:
        centre: its centre, length.
        radius: length.
    """

    exists_in = (3,)

    shape: Literal["sphere"] = "sphere"


Entry = Sphere
