"""What statics proves of the body: flat faces, arcs of circles, and programmes with many points of the true surface."""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scenes import alone
from scipy.optimize import linprog
from test_safety import COULOMB, FRICTION, ROUGH, TRESCA, block, groove

from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.scenes.reading import parse_scene

RADIUS, OPENING = 2.0, 0.9


def cup(nx, friction, *, push=0.05, weight=1.0, young=1e5):
    """A body in a round seat, pressed down by a dead load and pushed sideways."""
    mesh = dmesh.create_rectangle(MPI.COMM_SELF, [(-1.0, 0.0), (1.0, 1.0)], (nx, 2), dmesh.CellType.quadrilateral)
    x = mesh.geometry.x
    angle, up = OPENING * x[:, 0], x[:, 1].copy()
    seat = -RADIUS * np.cos(angle)
    x[:, 0], x[:, 1] = RADIUS * np.sin(angle), seat + up * (0.5 - seat)
    names = {"seat": lambda p: np.abs(np.hypot(p[0], p[1]) - RADIUS) < 1e-9, "top": "x[1] > 0.5 - 1e-9"}
    circle = {"shape": "circle", "centre": [0.0, 0.0], "radius": RADIUS, "hollow": True}
    return parse_scene(
        {
            "mesh": tag_boundaries(mesh, names),
            "material": {"young": young, "poisson": 0.3},
            "traction": [{"boundary": "top", "y": -weight, "live": False}, {"boundary": "top", "x": push}],
            "contact": {"boundary": "seat", "friction": friction, "foundation": circle},
        }
    )


def many_points(coefficient, push=0.05, weight=1.0, count=4001):
    """The factor of the cup by a linear programme with forces at many points of the true arc."""
    angle = np.linspace(-OPENING, OPENING, count)
    inward = np.column_stack((-np.sin(angle), np.cos(angle)))
    along = np.column_stack((np.cos(angle), np.sin(angle)))
    at = RADIUS * np.column_stack((np.sin(angle), -np.cos(angle)))
    forces = np.concatenate([inward + sign * coefficient * along for sign in (1, -1)])
    moments = at[:, 0] * forces.reshape(2, -1, 2)[..., 1] - at[:, 1] * forces.reshape(2, -1, 2)[..., 0]
    columns = np.vstack((forces.T, moments.ravel()))
    width = 2 * RADIUS * np.sin(OPENING)
    dead, live = np.array([0.0, -weight * width, 0.0]), push * width * np.array([1.0, 0.0, -0.5])
    found = linprog(np.append(np.zeros(columns.shape[1]), -1.0), A_eq=np.column_stack((columns, live)), b_eq=-dead)
    return -found.fun


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("friction", "limit"), [(COULOMB, 2.4), (ROUGH, 4.5), (TRESCA, 3.0)], ids=["slides", "tips", "tresca"]
)
def test_flat_faces_are_exact(friction, limit):
    """On four meshes the factor of the mesh is that of the body to 1e-8, from below and from above."""
    for ny in (1, 2, 3, 4):
        safety = alone(block(0.5, friction, ny=ny)).safety
        low, high = safety.body
        assert safety.of_body
        assert limit / 0.5 * (1 - 1e-8) <= low <= limit / 0.5 <= high <= limit / 0.5 * (1 + 1e-8)


@pytest.mark.slow
@pytest.mark.parametrize(("coefficient", "limited"), [(0.05, "slides"), (0.3, "turns about the rim")])
def test_on_arcs_the_factors_nest(coefficient, limited):
    """That of the mesh increases, that of the surface decreases, and that of 4,001 points is between them."""
    exact = many_points(coefficient)
    before = 0.0, np.inf
    for nx in (4, 8, 16, 32):
        safety = alone(cup(nx, {"law": "coulomb", "coefficient": coefficient})).safety
        low, high = safety.body
        assert before[0] * (1 - 1e-8) <= low <= exact * (1 + 1e-6), limited
        assert exact * (1 - 1e-8) <= high <= before[1] * (1 + 1e-8)
        before = low, high
    assert high / low < 1.01


def test_given_friction_on_an_arc():
    """Its moment is g R times the length of the arc, from above."""
    exact = 0.1 * RADIUS * 2 * OPENING * RADIUS / (0.05 * 2 * RADIUS * np.sin(OPENING) * 0.5)
    before = np.inf
    for nx in (4, 8, 16, 32):
        safety = alone(cup(nx, {"law": "tresca", "bound": 0.1})).safety
        low, high = safety.body
        assert low == 0.0
        assert not safety.of_body
        assert safety.factor < exact < high < before
        before = high
    assert high < 1.001 * exact


@pytest.mark.one_quick
@pytest.mark.parametrize("counts", [(2, 2, 1), (3, 2, 2), (6, 4, 2), (9, 4, 3)])
def test_in_space(counts):
    """Flat walls with Coulomb friction are exact to 1e-8 on each of four meshes, W F / sqrt(sin^2 - F^2 cos^2); given
    friction, which is spread over facets, is bounded above.
    """
    sine, cosine = np.array([1.0, 2.0]) / np.sqrt(5)
    exact = 4.5 * FRICTION / np.sqrt(sine**2 - (FRICTION * cosine) ** 2) / 0.15
    safety = alone(groove(counts=counts)).safety
    assert safety.of_body
    low, high = safety.body
    assert exact * (1 - 1e-8) <= low <= exact <= high <= exact * (1 + 1e-8)
    low, high = alone(groove(law="tresca", counts=counts)).safety.body
    assert (low, high) == (0.0, pytest.approx(0.1 * np.sqrt(5) * 3 / 0.15, rel=1e-9))
