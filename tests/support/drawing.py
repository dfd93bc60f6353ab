"""What pictures of bodies in 3D need."""

import pytest


def needs_pictures_in_3d():
    """Skip a test where PyVista is missing, or its VTK needs a display and there is none."""
    pyvista = pytest.importorskip("pyvista")
    if pyvista.vtk_version_info < (9, 4) and not pyvista.system_supports_plotting():
        pytest.skip("VTK 9.4 draws without a display")
