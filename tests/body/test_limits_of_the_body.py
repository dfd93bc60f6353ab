"""What statics proves of the body: flat faces, arcs of circles, and programmes with many points of the true surface."""

from fractions import Fraction

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scenes import alone
from scipy.optimize import linprog
from test_safety import COULOMB, FRICTION, ROUGH, TRESCA, block, groove

from signorini_fx.algebra.contact.reactions import nearest, reactions
from signorini_fx.mechanics.body.statics_of_surface import (
    LimitSurface,
    _arcs,
    balanced,
    excluded,
    factor_at_most,
    surface_of,
)
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.results.summary import lines_of, summarise
from signorini_fx.scenes.checks import check_scene
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


def messages(scene):
    """What ``check`` finds."""
    return [finding.message for finding in check_scene(scene).findings]


@pytest.mark.parametrize(("push", "word"), [(1.3, "make it slide"), (1.1, "press the body on")])
def test_what_check_says(push, word):
    """A statement before the solve names what it is proved of."""
    flat = messages(block(2.0 * push, COULOMB))
    assert any(word in one and one.endswith("proved for the body") for one in flat)
    capped = messages(block(2.0 * push, COULOMB | {"cap": 100.0}))
    assert any(word in one and one.endswith("proved for its mesh (a cap limits the friction)") for one in capped)


def test_the_summary_says_it():
    """In words, and as figures."""
    solution = alone(cup(8, {"law": "tresca", "bound": 0.1}))
    summary = summarise(solution)
    assert summary["safety"]["body"][0] == 0.0
    told = "\n".join(map(str, lines_of(summary)))
    assert f"proved for its mesh, for the body at most {summary['safety']['body'][1]:.4g}" in told


def test_no_motion_is_trusted():
    """Of a motion that enters the foundation, by a mistake or by round-off, nothing wrong follows."""
    body = alone(block(0.5, COULOMB, ny=1)).model
    here, surface = reactions(body.motions.at(body.boundary), body.law, body.data.bilateral), surface_of(body)[0]
    modes = body.motions.free
    chance = np.random.default_rng(3)
    # The weight and the push act at the centre, about which the body turns.
    dead, live = modes.T @ np.array([0.0, -3.0, 0.0]), modes.T @ np.array([0.5, 0.0, 0.0])
    assert 4.8 <= factor_at_most(surface, nearest(here, dead + 5 * live).motion, dead, live) < 4.9
    for _ in range(200):
        motion = chance.normal(size=3)
        assert factor_at_most(surface, motion, dead, live) >= 4.8
        assert not excluded(surface, motion, dead + 4.7999 * live)
    assert balanced(here, surface, dead + 4.7999 * live)
    assert not balanced(here, surface, dead + 4.8 * live)
    assert not balanced(here, surface, dead + 4.8001 * live)


def test_round_off_counts():
    """What a motion enters, with the round-off of its sum, is never less than in exact arithmetic."""
    chance, none = np.random.default_rng(5), np.zeros((1, 1, 3))
    for row, motion in chance.normal(size=(200, 2, 3)):
        surface = LimitSurface(row[None], none, np.zeros(1), np.ones(1, bool), np.array([[0]]), np.zeros(1), flat=True)
        exact = sum(Fraction(a) * Fraction(b) for a, b in zip(row, motion, strict=True))
        assert Fraction(float(surface.pushed(motion)[0])) >= exact
    rows = np.array([[0.1, 0.7, 0.3], [0.1, 0.7, -0.3]])
    none = np.zeros((2, 1, 3))
    surface = LimitSurface(rows, none, np.zeros(2), np.ones(2, dtype=bool), np.array([[0, 1]]), np.zeros(1), flat=True)
    motion = np.array([0.7, -0.1, 0.0])
    opened = surface.open(motion)
    assert surface.pushed(opened).max() <= 0
    np.testing.assert_allclose(opened, motion, atol=1e-13)


@pytest.mark.parametrize("half", [0.05, 0.3])
def test_three_places_of_an_arc_contain_its_forces(half):
    """Force and moment of a push with friction anywhere on an arc or its chord are sums of pushes at these places."""

    def push(x, outward, sign):
        force = -outward + sign * 0.3 * np.array([-outward[1], outward[0]])
        return np.append(force, x[0] * force[1] - x[1] * force[0])

    ends = np.array([[np.sin(a), -np.cos(a)] for a in (-half, half)])
    places, normals, _ = _arcs(RADIUS * ends[None], ends[None])
    for sign in (1.0, -1.0):
        columns = np.column_stack([push(x, n, sign) for x, n in zip(places[0], normals[0], strict=True)])
        for angle in np.linspace(-half, half, 41):
            outward = np.array([np.sin(angle), -np.cos(angle)])
            for x in (RADIUS * outward, RADIUS * np.cos(half) / np.cos(angle) * outward):
                shares = np.linalg.solve(columns, push(x, outward, sign))
                assert shares.min() > -1e-9
                assert shares.sum() <= 1 / np.cos(half) + 1e-9
