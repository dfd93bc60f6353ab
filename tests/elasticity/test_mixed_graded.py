"""Moduli that vary within a material, and the mixed element: exact states, and displacements
alone.
"""

import numpy as np
import pytest
from mpi4py import MPI
from on_meshes import tensors
from steel_blocks import PLANE, body

from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD
MIXED = {"degree": 2, "volumetric": "mixed"}
YOUNG, PRESSURE = 5000.0, 3.0


@pytest.mark.mpi
@pytest.mark.one_quick("linear_algebra", ["full", "condensed"])
@pytest.mark.parametrize("cells", ["quadrilateral", "hexahedra"])
def test_bar_between_walls(cells, linear_algebra):
    """It shortens by the integral of p (1 + nu) (1 - 2 nu) / (E (1 - nu)), by the midpoint rule,
    and its stress does not depend on E.
    """
    nu = 0.3
    axes = "y" if cells in PLANE else "yz"
    sides = [("bottom", "top")] if cells in PLANE else [("front", "back"), ("bottom", "top")]
    walls = [
        {"boundary": side, axis: 0.0}
        for axis, both in zip(axes, sides, strict=True)
        for side in both
    ]
    given = parse_scene(
        {
            "mesh": body(cells),
            "element": MIXED,
            "material": {"young": YOUNG, "poisson": nu, "grading": "1 / (1 + 0.5*x[0])"},
            "displacement": walls,
            "traction": {"boundary": "right", "pressure": PRESSURE},
            "contact": {"boundary": "left"},
            "solver": {"algorithm": "alm", "linear_algebra": linear_algebra},
        }
    )
    solution = solve(given, COMM)
    assert solution.certificate.worst < 1e-9
    x = solution.displacement.function_space.tabulate_dof_coordinates()
    end = np.isclose(x[:, 0], 2.0)
    shortened = PRESSURE / YOUNG * (1 + nu) * (1 - 2 * nu) / (1 - nu) * (2 + 0.25 * 4)
    assert -solution.displacement.x.array.reshape(len(x), -1)[end, 0] == pytest.approx(
        shortened, rel=1e-9
    )
    assert solution.contact.pressure == pytest.approx(PRESSURE, rel=1e-8)
    lateral = PRESSURE * nu / (1 - nu)
    assert solution.displacement.hydrostatic.x.array == pytest.approx(lateral, rel=1e-9)
    tensor = tensors(solution.stress.tensor)
    expected = np.diag([-PRESSURE, -lateral, -lateral])
    np.testing.assert_allclose(tensor, np.broadcast_to(expected, tensor.shape), atol=1e-8)
    assert solution.certificate.strain_energy == pytest.approx(PRESSURE * shortened / 2, rel=1e-9)
