"""Force per volume, such as weight."""

from __future__ import annotations

from signorini_fx.mechanics.statement.effect import VectorForce


class BodyForce(VectorForce):
    """Force per volume, f of (1.1a).

    Attributes:
        x: component along x[0], stress / length.
        y: component along x[1], stress / length.
        z: component along x[2], stress / length; only in 3D.
        factors: one number per load step; None: 1 in every step.
    """


Entry = BodyForce
