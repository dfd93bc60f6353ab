"""Plane stress: a thin body without stress across its plane, which is the material's affair."""

from signorini_fx.mechanics.kinematics.protocol import Kinematics

PLANE_STRESS = Kinematics(
    "plane stress",
    2,
    ((0, 1),),
    refuses={"mixed element": "'mixed' is of no use in plane stress: nothing locks"},
)
