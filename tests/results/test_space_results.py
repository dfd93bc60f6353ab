"""What a result in 3D is written as: tables with vectors, areas and moments, the contact surface
and the fields.
"""

import csv

import numpy as np
import pytest
from commands import summary_in
from mesh_files import arrays_of
from numpy.testing import assert_allclose, assert_array_equal
from scenes import alone
from spaces import block, box, friction_of

from signorini_fx.results.files import write_results
from signorini_fx.scenes.reading import parse_scene

CELLS = {
    "tetrahedra": ("tetrahedra", 1),
    "quadratic tetrahedra": ("tetrahedra", 2),
    "hexahedra": ("hexahedra", 1),
    "quadratic": ("hexahedra", 2),
}


@pytest.fixture(params=CELLS)
def written(request, tmp_path):
    """A solution and its folder."""
    cells, degree = CELLS[request.param]
    solution = alone(block(6, cells, coefficient=0.3, gamma="auto", degree=degree))
    write_results(solution, tmp_path / "out", pictures=False)
    return solution, tmp_path / "out"


@pytest.mark.slow
def test_files(written):
    """Summary, table, contact surface; the surface has the area of the boundary and the numbers of
    the table.
    """
    _, folder = written
    summary = summary_in(folder)
    assert summary["dimension"] == 3
    assert "zones" not in summary
    assert summary["areas"]["stick"] + summary["areas"]["slip"] == pytest.approx(
        summary["areas"]["contact"]
    )
    with (folder / "contact.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {"x", "y", "z", "shear_x", "slip_z", "n_z", "state"} <= set(rows[0])
    for row in rows:
        vector = [float(row[f"shear_{axis}"]) for axis in "xyz"]
        assert np.linalg.norm(vector) == pytest.approx(float(row["shear"]), abs=1e-12)
    arrays = arrays_of(folder / "contact.vtu")
    assert_array_equal(arrays["pressure"][:, 0], [float(row["pressure"]) for row in rows])
    assert_array_equal(arrays["shear vector"][:, 1], [float(row["shear_y"]) for row in rows])
    cells = arrays["connectivity"].astype(int).reshape(len(arrays["offsets"]), -1)
    corners = arrays["points"][cells[:, : 3 if arrays["types"][0, 0] == 5 else 4]][:, :, :2]
    nxt = np.roll(corners, -1, axis=1)
    areas = (
        np.abs((corners[:, :, 0] * nxt[:, :, 1] - corners[:, :, 1] * nxt[:, :, 0]).sum(axis=1)) / 2
    )
    assert areas.sum() == pytest.approx(3.0)
    assert (folder / "fields.vtu").exists()


@pytest.mark.one_quick("kind", CELLS)
def test_moment_of_a_push(kind):
    """A push at a height tips the body: the pressure goes to the other end, where its resultant
    balances it.
    """
    height, press, push = 1.0, 10.0, 4.0
    scene = parse_scene(
        {
            "mesh": box(CELLS[kind][0], (8, 4, 4), size=(2.0, 1.0, height)),
            "element": {"degree": CELLS[kind][1]},
            "material": {"young": 1000.0, "poisson": 0.3},
            "traction": {"boundary": "top", "pressure": press, "x": push},
            "contact": {"boundary": "bottom", "friction": friction_of(coefficient=0.8)},
        }
    )
    solution = alone(scene)
    moment = solution.contact.moments[0] + solution.contact.moments[1]
    area = 2.0
    loads = np.array([0.5, -1.0, 0.0]) * -press * area + np.array([0.0, height, 0.0]) * push * area
    loads[2] = -0.5 * push * area
    assert_allclose(moment, -loads, atol=1e-8)
