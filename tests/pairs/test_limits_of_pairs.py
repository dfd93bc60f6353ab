"""Maps of linear pairs at their limits: small parts of facets, the reach, and facets that another
contact owns.
"""

import numpy as np
import pytest
from dolfinx.mesh import compute_midpoints
from on_meshes import at_coordinate
from support.sliding_bodies import SlidingBodies, as_linear_bodies
from two_bodies import grid

from signorini_fx import Pair
from signorini_fx.errors import FormError


def stacked(kind, counts, low, high, degree):
    """A block below a part of the unit square, which has the points, both 0.3 high."""
    bodies = (
        grid(kind, (*counts[0], 1), [*low, -0.3], [*high, 0.0]),
        grid(kind, (*counts[1], 1), [0.0] * 3, [1.0, 1.0, 0.3]),
    )
    level = [at_coordinate(2, z) for z in (0.0, -0.3, 0.3)]
    scene = SlidingBodies(
        kind, bodies, [level[0]] * 2, level[1:], slave=1, degree=degree, pair={"sliding": "small"}
    )
    scene.drive.value[-1] = -1e-3
    return scene


@pytest.mark.slow
def test_functions_of_small_parts_of_facets_multiply_round_off():
    """Dual functions on a tenth of the width of 9-node facets are large: distances of sides that
    touch are round-off times these, which is no fault.
    """
    scene = stacked("hexahedron", [(2, 2), (2, 2)], (0.0, 0.0), (0.606, 0.967), 2)
    assert as_linear_bodies(scene).certificate.coupling < 1e-7


def test_whether_a_node_carries_a_point_is_no_matter_of_round_off():
    """The function at the corner keeps the share of its weight below which there is no point, but
    for round-off.
    """
    scene = stacked("tetrahedron", [(4, 4), (1, 4)], (0.2, 0.2), (0.7, 0.7), 1)
    assert as_linear_bodies(scene).certificate.coupling < 1e-9


@pytest.mark.parametrize("far", [0.1, 0.3, 0.7])
def test_facets_as_far_apart_as_the_reach_are_partners(far):
    """All of them, not those whose distance is more but for round-off."""
    bodies = (
        grid("triangle", (3, 1), [0.0, -0.3], [1.0, 0.0]),
        grid("triangle", (4, 1), [0.0, far], [1.0, far + 0.3]),
    )
    level = [at_coordinate(1, y) for y in (0.0, far, -0.3, far + 0.3)]
    scene = SlidingBodies(
        "triangle", bodies, level[:2], level[2:], slave=1, pair={"reach": far, "sliding": "small"}
    )
    scene.drive.value[-1] = -1e-3
    certificate = as_linear_bodies(scene).certificate
    assert certificate.holds
    assert certificate.coupling < 1e-9


def third_of_four(kind, degree=1):
    """A block on another one with four facets along its upper side, of which one contact has the
    first and the third, and a second contact the others: of the second facet all nodes belong to
    the first contact.
    """
    up = 2 if kind == "hexahedron" else 1
    bodies = (
        grid(kind, (4, *[2] * up), [0.0] * up + [-1.0], [1.0] * up + [0.0]),
        grid(kind, (5, *[2] * up), [0.0] * up + [1e-6], [1.0] * up + [1.0]),
    )
    level = [lambda x, z=z: np.isclose(x[up], z, atol=1e-9) for z in (0.0, 1e-6, -1.0, 1.0)]
    scene = SlidingBodies(
        kind, bodies, level[:2], level[2:], degree=degree, pair={"sliding": "small", "reach": 0.1}
    )
    slave, master = scene.sides
    quarter = np.floor(4 * compute_midpoints(scene.mesh, up, slave)[:, 0]).astype(int)
    parts = [slave[np.isin(quarter, numbers)] for numbers in ((0, 2), (1, 3))]
    scene.drive.value[-1] = -0.01
    scene.pair = [Pair(part, master, reach=0.1, sliding="small") for part in parts]
    return scene


@pytest.mark.parametrize(
    ("kind", "degree"), [("quadrilateral", 1), ("triangle", 1), ("hexahedron", 1)]
)
def test_facets_of_which_another_contact_owns_all_nodes(kind, degree):
    """Nobody carries what is between both bodies there: an error that names the contact and the
    place.
    """
    scene = third_of_four(kind, degree)
    count = 2 if kind == "hexahedron" else 1
    with pytest.raises(FormError) as raised:
        as_linear_bodies(scene)
    message = f"contact[1]: other contacts own all nodes of {count} facets"
    assert message in str(raised.value)
    assert "such as that at (0.375, " in str(raised.value)


def test_facets_beside_points_are_carried():
    """In the middle of a facet of degree 2 is a node that the other contact does not own."""
    certificate = as_linear_bodies(third_of_four("triangle", 2)).certificate
    assert certificate.holds
    assert certificate.coupling < 1e-9
