"""Which quantities can be estimated on meshes that are divided in some places only."""

from __future__ import annotations

from signorini_fx.errors import SceneError
from signorini_fx.mechanics.statement.settings import Accuracy

# Quantities that are estimated well on meshes that are fine in one place and coarse in another; the other estimates
# compare meshes point by point, which is unreliable on such meshes.
LOCAL = ("energy", "pressure", "force")


def refuse_adaptive_peak(goal: Accuracy) -> None:
    """Refuse a request for the largest pressure on adaptive meshes.

    Raises:
        SceneError: that is what is asked for.
    """
    if goal.refinement == "adaptive" and goal.of == "peak":
        message = (
            "the largest pressure has no estimate on meshes that are divided in some places only: use 'uniform', with "
            "contact_size where cells far away cost too much"
        )
        raise SceneError([("accuracy.refinement", message)])
