"""Nonlinear bodies against known solutions: a thin ring between plates (the elastica), and the load
that a half-plane of metal bears under a punch (R. Hill, The Mathematical Theory of Plasticity,
1950, chapter IX).
"""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scene_tables import coulomb_friction, fixed

from signorini_fx import solve
from signorini_fx.mechanics.mesh.tagged import tagged_mesh
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_SELF
# P R^2 / EI, half the closing over R, and half the growth of the width over R where a point is
# known; from the fifth row on the ring is flat between two forces.
ELASTICA = [
    (0.1, 0.0075249, 0.0068580),
    (0.5, 0.0393995, 0.0347900),
    (1.0, 0.0834719, 0.0706101),
    (2.0, 0.1867646, 0.1432563),
    (2.7864079, 0.2822300, None),
    (3.1781864, 0.3279246, None),
    (4.2572832, 0.4193140, None),
    (5.9961252, 0.5107033, None),
]


def on_unit_square(cells, cell=dmesh.CellType.quadrilateral, **sides):
    """A mesh of it, and facets by functions of its coordinates that are zero on them."""
    mesh = dmesh.create_rectangle(COMM, [[0, 0], [1, 1]], cells, cell)
    facets = {
        name: dmesh.locate_entities(mesh, 1, lambda x, where=where: np.isclose(where(x), 0.0))
        for name, where in sides.items()
    }
    return mesh, facets


def ring_between_plates(thickness, cells):
    """A quarter of it, of radius and bending stiffness one, closed as the elastica is."""
    mesh, facets = on_unit_square(
        [cells, 1], foot=lambda x: x[0], top=lambda x: x[0] - 1, outside=lambda x: x[1] - 1
    )
    along, across = mesh.geometry.x.T[:2].copy()
    radius, angle = 1 + thickness * (across - 0.5), along * np.pi / 2
    mesh.geometry.x[:, :2] = np.column_stack((radius * np.cos(angle), radius * np.sin(angle)))
    closing = np.diff([0.0, *(row[1] for row in ELASTICA)])
    way = " + ".join(
        f"{share} * min(max(t - {k}, 0), 1)" for k, share in enumerate(closing.tolist())
    )
    plate = {
        "shape": "plane",
        "point": [0.0, 1 + thickness / 2],
        "normal": [0.0, -1.0],
        "shift": [0.0, f"-({way})"],
    }
    scene = {
        "mesh": tagged_mesh(mesh, facets),
        "element": {"degree": 2},
        "material": {"law": "saint-venant-kirchhoff", "young": 12 / thickness**3, "poisson": 0.0},
        "displacement": [fixed("foot", "y"), fixed("top", "x")],
        "contact": {"boundary": "outside", "foundation": plate},
        "load_steps": {"times": [float(k + 1) for k in range(len(ELASTICA))]},
        "solver": {"algorithm": "alm"},
    }
    return solve(parse_scene(scene), COMM)


@pytest.mark.slow
def test_a_ring_between_plates_is_the_elastica():
    """Forces and widths at given closings, also where the ring has become flat and bears on two
    points alone.
    """
    within, solution = 9e-4, ring_between_plates(0.02, 48)
    x = solution.model.space.tabulate_dof_coordinates()
    foot = np.isclose(x[:, 1], 0.0)
    for step, (force, _, growth) in zip(solution.steps, ELASTICA, strict=True):
        assert -2 * np.sum(step.contact.forces, axis=0)[1] == pytest.approx(force, rel=within)
        if growth is not None:
            moved = step.displacement.x.array.reshape(-1, 2)[foot, 0].mean()
            assert moved == pytest.approx(growth, rel=within)
    flat = solution.steps[-1].contact
    pressed = np.sort(flat.boundary.x[flat.pressure > 1e-6 * flat.pressure.max(), 0])
    assert pressed.size <= 2
    assert pressed[0] > 0.3


def spaced(cells, until):
    """Places: cells of one size up to 1, and growing ones beyond."""
    places, size = list(np.linspace(0, 1, cells + 1)), 1 / cells
    while places[-1] < until:
        size *= 1.15
        places.append(min(places[-1] + size, until))
    return np.array(places)


def punched(cells, friction):
    """Mean pressures of a rigid punch over the shear strength, as it is pressed into half of a wide
    block.
    """
    x, y = spaced(cells, 6.0), 5.0 - spaced(cells, 5.0)[::-1]
    counts = [x.size - 1, y.size - 1]
    mesh, facets = on_unit_square(
        counts,
        left=lambda x: x[0],
        right=lambda x: x[0] - 1,
        bottom=lambda x: x[1],
        under=lambda x: np.where(x[0] * counts[0] < cells + 0.5, x[1] - 1, 1.0),
    )
    column, row = (np.rint(mesh.geometry.x[:, k] * counts[k]).astype(int) for k in (0, 1))
    mesh.geometry.x[:, :2] = np.column_stack((x[column], y[row]))
    contact = {"boundary": "under", "gap": "-0.04*t"}
    scene = {
        "mesh": tagged_mesh(mesh, facets),
        "element": {"degree": 2, "volumetric": "reduced"},
        "material": {"law": "j2", "young": 1e4, "poisson": 0.3, "yield_stress": np.sqrt(3)},
        "displacement": [fixed("left", "x"), fixed("right", "x"), fixed("bottom")],
        "contact": contact if friction is None else contact | {"friction": friction},
        "load_steps": {"times": [0.1, 0.2, 0.4, 0.7, 0.85, 1.0]},
        "solver": {"algorithm": "alm"},
    }
    solution = solve(parse_scene(scene), COMM)
    return [-np.sum(step.contact.forces, axis=0)[1] for step in solution.steps]


@pytest.mark.slow
@pytest.mark.parametrize("friction", [None, coulomb_friction(1.0)], ids=["smooth", "rough"])
def test_a_punch_meets_the_limit_of_prandtl_and_hill(friction):
    """(2 + pi) k, rough or smooth: from above on meshes, and as their size goes to zero."""
    coarse, fine = (punched(cells, friction) for cells in (4, 8))
    for pressures in (coarse, fine):
        assert pressures[-1] == pytest.approx(pressures[-2], rel=1e-3)
        assert 2 + np.pi < pressures[-1] < 1.06 * (2 + np.pi)
    assert 2 * fine[-1] - coarse[-1] == pytest.approx(2 + np.pi, rel=5e-3)
