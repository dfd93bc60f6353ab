"""Plane strain: nothing moves across the plane, which takes a stress there."""

from signorini_fx.mechanics.kinematics.protocol import Kinematics

PLANE_STRAIN = Kinematics("plane strain", 2, ((0, 1),), prevented=True)
