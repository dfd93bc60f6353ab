"""The reference that studies compare solutions with, and the meshes that they vary."""

from functools import partial

import numpy as np
import pytest
from reference import Reference, varied
from scenes import alone, example1

from signorini_fx import LinearElastic, OrthotropicElastic

CONSTANTS = {
    "young": [5000.0, 2000.0, 3000.0],
    "poisson": [0.3, 0.2, 0.25],
    "shear": [900.0, 1200.0, 1000.0],
}


@pytest.mark.one_quick(
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
    """Against a nested finer mesh of the same space, measured at quadrature points = the energies'
    difference.

    Without contact a(y, y) / 2 of a Galerkin solution under a load only falls short by that of its
    error.
    """
    linear = example1(nx=24, ny=8, cell=cell, degree=degree)
    fixed = [effect.model_copy(update={"y": 0.0}) for effect in linear.displacement]
    # A body that the foundation does not reach.
    far = [linear.contact[0].model_copy(update={"gap": 1.0})]
    linear = linear.model_copy(update={"displacement": tuple(fixed), "contact": tuple(far)})
    kind = (
        OrthotropicElastic
        if "orthotropic" in material
        else partial(LinearElastic, young=5000.0, poisson=0.4)
    )
    linear = linear.model_copy(update={"material": (kind(**material),)})
    reference = alone(varied(linear, 1 / 4, "Q2", {}))
    coarse = alone(linear)
    energies = [s.steps[-1].strain_energy for s in (reference, coarse)]
    expected = np.sqrt((energies[0] - energies[1]) / energies[0])
    with np.errstate(invalid="ignore"):  # there is no contact force to compare
        measured = Reference(reference).errors(coarse)
    assert measured["energy"] == pytest.approx(expected, rel=0.05)
    assert measured["pressure"] is None
