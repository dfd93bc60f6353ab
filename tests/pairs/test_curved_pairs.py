"""Two curved bodies: frames half-way between both, so that mirror images show no shear."""

import pytest
from curved_pairs import mirrored


@pytest.mark.one_quick(
    ("kind", "cells", "depth", "degree"),
    [
        ("quadrilateral", (14, 10), 0.18, 1),
        ("triangle", (10, 8), 0.18, 2),
        ("hexahedron", (4, 4), 0.4, 1),
    ],
)
def test_mirror_images(kind, cells, depth, degree):
    """Matching meshes at a/R of .1 to .2: no shear, and the force of one body on a plane.

    With the frame of one side friction took 15 and 55 % of F P, and the force was .5 and 4.6 % off.
    """
    force, share, ratio = mirrored(kind, (cells, cells), 8.0, depth, degree=degree)
    assert ratio > 0.08
    assert abs(force) < 5e-4
    assert share < 5e-3
