"""The stress of elements with a reduced volumetric term: uniform where it must be, and right near nu = 1/2."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from test_stresses import INNER, OUTER, PRESSURE, cylinder

from signorini_fx.results.accuracy.stress_recovery import element_stress
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD
MEAN = PRESSURE * INNER**2 / (OUTER**2 - INNER**2)
KINDS = [(1, "quadrilateral"), (2, "quadrilateral"), (2, "triangle")]


def nearly(poisson, degree, cell, size, comm=COMM):
    """Lame's cylinder of a nearly incompressible material, with reduced integration, solved."""
    scene = cylinder(degree, size, cell)
    changes = {
        "element": scene.element.model_copy(update={"volumetric": "reduced"}),
        "material": tuple(own.model_copy(update={"poisson": poisson}) for own in scene.material),
    }
    return solve(scene.model_copy(update=changes), comm)


def exact_stress(x):
    """Lame's solution in 2D, as UFL, shape (2, 2); it does not depend on the material."""
    arm = ufl.as_vector((x[0], x[1] - OUTER))
    square = ufl.inner(arm, arm)
    return MEAN * ufl.Identity(2) + MEAN * OUTER**2 / square * (ufl.Identity(2) - 2 * ufl.outer(arm, arm) / square)


def true_error(solution):
    """Error of the stress of the elements in the energy norm, relative."""
    d = solution.model
    stress = element_stress(d, solution.displacement)
    exact = exact_stress(ufl.SpatialCoordinate(d.tagged.mesh))
    dx = ufl.dx(metadata={"quadrature_degree": 8})
    squares = [
        COMM.allreduce(
            fem.assemble_scalar(
                fem.form(stress.compliance(ufl.as_vector([tau[pair] for pair in stress.kinematics.pairs])) * dx)
            )
        )
        for tau in (exact - stress.sigma, exact)
    ]
    return float(np.sqrt(squares[0] / squares[1]))


@pytest.mark.one_quick
@pytest.mark.mpi(slow=True)
@pytest.mark.parametrize(("degree", "cell"), KINDS)
def test_nearly_incompressible_cylinder(degree, cell):
    """Errors and their estimates are the same at nu = 0.499 and 0.4999, fall with h, and agree with each other."""
    found = []
    for poisson in (0.499, 0.4999):
        for size in (0.5, 0.25):
            solution = nearly(poisson, degree, cell, size)
            error = true_error(solution)
            assert 0.85 < solution.stress.error / error < 1.7
            extremes = [one.largest("principal", 0).value for one in (solution.stress, solution.stress.recovered)]
            found.append((error, solution.stress.error, *extremes))
    coarse, fine, *others = np.array(found)
    np.testing.assert_allclose(np.array(others), [coarse, fine], rtol=0.02)
    assert fine[0] < {1: 0.6, 2: 0.4}[degree] * coarse[0]
    hoop = PRESSURE * (OUTER**2 + INNER**2) / (OUTER**2 - INNER**2)
    np.testing.assert_allclose(fine[2:], hoop, rtol={1: 0.18, 2: 0.03}[degree])


@pytest.mark.parametrize(("degree", "cell"), KINDS)
def test_uniform_stress(degree, cell):
    """A nearly incompressible block under uniform pressure has that stress everywhere; the estimate is nought."""
    scene = parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": {"nx": 5, "ny": 3, "cell": cell}},
            "element": {"degree": degree, "volumetric": "reduced"},
            "material": {"young": 6.0, "poisson": 0.4999},
            "displacement": [{"boundary": "left", "x": 0.0}, {"boundary": "bottom", "y": 0.0}],
            "traction": [{"boundary": "right", "x": -2.0}, {"boundary": "top", "y": -1.0}],
        }
    )
    stress = solve(scene, MPI.COMM_SELF).stress
    for one in (stress, stress.recovered):
        exact = np.diag([-2.0, -1.0, -3 * 0.4999])
        np.testing.assert_allclose(
            one.tensor.x.array.reshape(-1, 3, 3),
            np.broadcast_to(exact, (len(one.tensor.x.array) // 9, 3, 3)),
            atol=1e-5,
        )
    assert stress.error < 1e-5
