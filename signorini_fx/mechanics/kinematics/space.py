"""Displacements in 3D."""

from signorini_fx.mechanics.kinematics.protocol import Kinematics

SPACE = Kinematics("in 3D", 3, ((1, 2), (2, 0), (0, 1)), whole=True)
