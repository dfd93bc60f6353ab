"""Displacements in 3D, and in a plane: plane strain, and plane stress, of a thin body without stress across its plane,
which is the material's affair.
"""

from signorini_fx.mechanics.kinematics.protocol import Kinematics

SPACE = Kinematics("in 3D", 3, ((1, 2), (2, 0), (0, 1)), whole=True)
PLANE_STRAIN = Kinematics("plane strain", 2, ((0, 1),), prevented=True)
PLANE_STRESS = Kinematics(
    "plane stress",
    2,
    ((0, 1),),
    refuses={"mixed element": "'mixed' is of no use in plane stress: nothing locks"},
)
