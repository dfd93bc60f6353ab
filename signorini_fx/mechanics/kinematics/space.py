"""Displacements in space."""

from signorini_fx.mechanics.kinematics.protocol import Kinematics

SPACE = Kinematics("in space", 3, ((1, 2), (2, 0), (0, 1)), whole=True)
