"""What pictures of bodies in 3D need."""

import pytest


def needs_pictures_in_3d():
    """Skip a test where PyVista is missing, or its VTK needs a display."""
    if pytest.importorskip("pyvista").vtk_version_info < (9, 4):
        pytest.skip("VTK 9.4 draws without a display")
