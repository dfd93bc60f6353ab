"""What pictures of bodies in 3D need."""

import pytest


def needs_pictures_in_3d():
    """Skip a test where PyVista is missing, or its VTK needs a display and there is neither one nor
    Xvfb.
    """
    pytest.importorskip("pyvista")
    from signorini_fx.addons.pictures.solid import can_draw

    if not can_draw():
        pytest.skip("VTK 9.4 draws without a display")
