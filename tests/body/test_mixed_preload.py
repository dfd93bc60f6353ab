"""The mixed element with shortened sections: exact states, statics of a bolted joint, and
displacements alone.
"""

import numpy as np
import pytest
from bolts import PULL, TIGHT, clamped, figures
from mpi4py import MPI
from numpy.testing import assert_allclose
from on_meshes import tensors
from spaces import uneven

from signorini_fx.results.contact_figures import section_forces
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD
MIXED = {"degree": 2, "volumetric": "mixed"}


@pytest.mark.mpi
@pytest.mark.one_quick(
    ("cell", "poisson", "heat", "unit"),
    [
        ("triangle", 0.5, 0.02, 1.0),
        ("quadrilateral", 0.3, 0.02, 1e3),
        ("quadrilateral", 0.5, 0.0, 1e-6),
        ("tetrahedra", 0.5, 0.02, 1.0),
    ],
)
def test_shortened_bar(cell, poisson, heat, unit):
    """A bar between walls, in plane strain, heated by e and shortened by s: E (s / l - (1 + nu) e)
    / (1 - nu^2).
    """
    tagged, shortened, young, length = uneven(cell, COMM, unit), 0.06 * unit, 10.0, 3.0 * unit
    dim = tagged.dimension
    point = np.array([1.6, 0.5, 0.5])[:dim] * unit
    walls = [("low0", "x"), ("high0", "x"), ("low1", "y"), ("low2", "z"), ("high2", "z")][
        : 2 * dim - 1
    ]
    scene = parse_scene(
        {
            "mesh": tagged,
            "element": MIXED,
            "material": {"young": young, "poisson": poisson, "expansion": 0.01},
            "displacement": [{"boundary": side, axis: 0.0} for side, axis in walls],
            **({"temperature": {"change": heat / 0.01}} if heat else {}),
            "preload": {
                "point": point.tolist(),
                "axis": [2.0, 0.0, 0.0][:dim],
                "shortening": shortened,
            },
        }
    )
    solution = solve(scene, COMM)
    assert solution.certificate.worst < 1e-9
    strain = shortened / length
    sigma = young * (strain - (1 + poisson) * heat) / (1 - poisson**2)
    out = poisson * sigma - young * heat
    across = heat - poisson * (sigma + out) / young
    tensor = tensors(solution.stress.tensor)
    expected = np.diag([sigma, 0.0, out])
    assert_allclose(tensor, np.broadcast_to(expected, tensor.shape), atol=1e-8)
    pressure = (
        young / (1 + poisson) * (across - heat) + young / (1 + poisson) * heat
    )  # sigma_yy = 0
    assert_allclose(solution.displacement.hydrostatic.x.array, pressure, rtol=1e-8)
    energy = 3.0 * unit**dim * (sigma * (strain - heat) - out * heat) / 2
    assert solution.last_step.strain_energy == pytest.approx(energy, rel=1e-9)
    (section,) = section_forces(solution.model, solution.displacement, 0)
    assert section.force == pytest.approx(sigma * unit ** (dim - 1), rel=1e-9)
    x = solution.model.space.tabulate_dof_coordinates()[:, 1]
    found = solution.displacement.x.array.reshape(-1, dim)[:, 1]
    assert_allclose(found, across * x, rtol=0, atol=1e-10 * unit)


@pytest.mark.mpi(slow=True)
@pytest.mark.one_quick(("cell", "unit"), [("triangle", (1.0, 1.0)), ("quadrilateral", (1e-6, 1e3))])
def test_bolted_joint(cell, unit):
    """Of rubber, tightened by a force and then pulled: forces of statics, with friction between
    bolt and sleeves.
    """
    friction = {"law": "coulomb", "coefficient": 0.2}
    element = {"element": MIXED}
    solution = solve(clamped(cell, unit=unit, poisson=0.5, friction=friction, more=element), COMM)
    assert solution.converged
    bolt, clamp, shortening = figures(solution, 0, unit)
    assert bolt == pytest.approx(TIGHT, rel=1e-6)
    assert clamp == pytest.approx(TIGHT, rel=1e-6)
    bolt, clamp, kept = figures(solution, 1, unit)
    assert kept == shortening
    assert bolt - clamp == pytest.approx(PULL, rel=1e-6)
    assert all(step.certificate.worst < 1e-6 for step in solution.steps)
