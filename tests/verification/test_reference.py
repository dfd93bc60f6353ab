"""The reference that studies compare solutions with, and the meshes that they vary."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from reference import Reference, reference_errors, studied_settings
from scenes import example1
from varied import varied

from signorini_fx import LinearElastic, OrthotropicElastic
from signorini_fx.scenes.reading import read_scene
from signorini_fx.scenes.solver import solve

SCENES = Path(__file__).parents[2] / "demos" / "scenes"
CONSTANTS = {"young": [5000.0, 2000.0, 3000.0], "poisson": [0.3, 0.2, 0.25], "shear": [900.0, 1200.0, 1000.0]}


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("cell", "degree", "material"),
    [
        ("triangle", 1, {}),
        ("quadrilateral", 1, {}),
        ("quadrilateral", 2, {}),
        ("quadrilateral", 1, {"hypothesis": "axisymmetric"}),
        ("quadrilateral", 1, {"orthotropic": CONSTANTS}),
    ],
    ids=["triangle-1", "quadrilateral-1", "quadrilateral-2", "axisymmetric", "orthotropic"],
)
def test_measured_energy_error(cell, degree, material):
    """Against a nested finer mesh of the same space, measured at quadrature points = the energies' difference.

    Without contact a(y, y) / 2 of a Galerkin solution under a load only falls short by that of its error.
    """
    linear = example1(nx=24, ny=8, cell=cell, degree=degree)
    fixed = [effect.model_copy(update={"y": 0.0}) for effect in linear.displacement]
    # A body that the foundation does not reach.
    far = [linear.contact[0].model_copy(update={"gap": 1.0})]
    linear = linear.model_copy(update={"displacement": tuple(fixed), "contact": tuple(far)})
    kind = OrthotropicElastic if "orthotropic" in material else partial(LinearElastic, young=5000.0, poisson=0.4)
    linear = linear.model_copy(update={"material": (kind(**material),)})
    settings = studied_settings(linear.statement, {})
    reference = varied(linear, MPI.COMM_SELF).on(1 / 4, "Q2", settings, None)()
    coarse = solve(linear, MPI.COMM_SELF)
    energies = [s.steps[-1].strain_energy for s in (reference, coarse)]
    expected = np.sqrt((energies[0] - energies[1]) / energies[0])
    with np.errstate(invalid="ignore"):  # there is no contact force to compare
        measured = Reference(reference).errors(coarse)
    assert measured["energy"] == pytest.approx(expected, rel=0.05)
    assert measured["pressure"] is None


def test_no_error_against_itself():
    """All errors of the reference vanish."""
    solution = solve(example1(bound=1.0, nx=30, ny=10), MPI.COMM_SELF)
    assert all(error == pytest.approx(0.0, abs=1e-12) for error in Reference(solution).errors(solution).values())


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_notched_sides(cell):
    """Left and right begin at the given height, on every mesh of a nested iteration; the rest of them has no name."""
    scene = read_scene(SCENES / "example2_tresca.toml")
    for factor, ny in ((1.0, 40), (2.0, 20), (8.0, 5)):
        tagged = varied(scene, MPI.COMM_SELF).mesh(factor, "Q1" if cell[0] == "q" else "P1")
        for name, count in (("left", 0.8 * ny), ("right", 0.8 * ny), ("bottom", 3 * ny), ("top", 3 * ny)):
            assert tagged.facet_tags.find(tagged.boundaries[name]).size == round(count), (factor, name)


def test_example2_scene():
    """The scene file is the paper's second example, as demos/paper builds it (g = 1): 7.2 has stick and both slips."""
    solution = solve(read_scene(SCENES / "example2_tresca.toml"), MPI.COMM_SELF)
    states = set(solution.table.columns["state"])
    assert states >= {"open", "slip+", "slip-"}
    x, pressure = solution.table.columns["x"], solution.table.columns["pressure"]
    assert np.interp(3 - x[::-1], x, pressure) == pytest.approx(pressure[::-1], rel=1e-6, abs=1e-6)


def test_how_far_the_reference_may_be_wrong():
    """Of errors h^r the estimate is exact; it never takes a faster rate than expected, nor believes in luck."""
    for rate in (0.5, 1.0):
        near, far = 2**rate - 1, 4**rate - 1
        found = reference_errors({"zone": near}, {"zone": far})
        assert found["zone"] == pytest.approx(1.0)
        found = reference_errors({"energy": np.sqrt(4**rate - 1)}, {"energy": np.sqrt(16**rate - 1)})
        assert found["energy"] == pytest.approx(1.0)
    found = reference_errors({"pressure": 1.0, "peak": None}, {"pressure": 100.0, "peak": 1.0})
    assert found["pressure"] == pytest.approx(1 / (2**1.25 - 1))
    assert found["peak"] is None
