"""Values at nodes that round-off of their positions puts beside the body."""

import pytest
from scene_tables import coulomb_friction, rectangle_mesh, tresca_friction
from scenes import alone

from signorini_fx.scenes.reading import parse_scene


@pytest.mark.parametrize("law", [{}, {"law": "neo-hooke"}], ids=["linear", "neo-hooke"])
def test_values_that_are_zero_at_an_end(law):
    """A coefficient of friction or a bound that vanishes at an end of the body is one."""
    for friction in (coulomb_friction("0.3*sqrt(x[0])"), tresca_friction("0.01*x[0]")):
        scene = parse_scene(
            {
                "mesh": rectangle_mesh(8, 4, length=2.0, height=1.0),
                "material": {"young": 1.0, "poisson": 0.3, **law},
                "displacement": {"boundary": "bottom", "x": 0.0, "y": 0.01},
                "contact": {"boundary": "top", "friction": friction},
            }
        )
        assert alone(scene).converged
