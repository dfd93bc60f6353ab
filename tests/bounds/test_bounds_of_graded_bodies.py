"""The bound of the error with moduli that vary inside the cells: true errors, and what each of its terms is for."""

from dataclasses import replace
from fractions import Fraction

import error_bounds
import graded_scenes
import numpy as np
import pytest
from scenes import alone
from test_bounds_of_heated_bodies import bar

from signorini_fx.addons.bounds.error_bound import Bounded, error_bound
from signorini_fx.addons.bounds.initial_stress import simplex_rule
from signorini_fx.addons.bounds.simplices import FACETS, TWICE
from signorini_fx.addons.bounds.stress_products import from_strain
from signorini_fx.scenes.reading import parse_scene

SLOW = pytest.mark.slow


def pulled(grading, *, degree=1, cells=(2, 1), **material):
    """A graded block on rollers, pulled at its right."""
    scene = bar("0.0", degree=degree, cells=cells, traction=[{"boundary": "right", "x": 1.0, "y": 0.3}])
    fields = {key: getattr(scene, key) for key in scene.model_fields_set - {"temperature"}}
    one = {"young": 1000.0, "poisson": 0.3, "grading": grading} | material
    return parse_scene(fields | {"material": {key: value for key, value in one.items() if value is not None}})


# --- true errors ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "seeds"),
    [
        ("plane", (12,)),
        ("space", (22,)),
        pytest.param("plane", (2,), marks=SLOW),
        pytest.param("pair", (1, 3), marks=SLOW),
        pytest.param("shape", (2, 3, 5), marks=SLOW),
    ],
)
def test_true_errors(kind, seeds):
    """The bound is above the true error, and the finer solution does not refute the interval of the energy."""
    for seed in seeds:
        found = graded_scenes.effectivity(kind, seed)
        assert not isinstance(found, str), found
        assert found[2] == []
        assert 1 < found[0] < 6


@pytest.mark.long
@pytest.mark.parametrize(("kind", "many", "largest"), [("plane", 40, 2), ("pair", 30, 2), ("space", 20, 2.5)])
def test_true_errors_of_many(kind, many, largest):
    """The same of many, with their median."""
    found = [graded_scenes.effectivity(kind, seed) for seed in range(many)]
    found = [one for one in found if not isinstance(one, str)]
    assert all(one[2] == [] for one in found)
    assert min(one[0] for one in found) > 1
    assert np.median([one[0] for one in found]) < largest


@pytest.mark.parametrize("seed", [2, pytest.param(12, marks=SLOW)])
def test_displacements_and_pressures_that_are_wrong(seed):
    """Disturbed by some per cent each: the bound is one of the disturbed displacement."""
    scene, chance = graded_scenes.drawn("plane", seed), np.random.default_rng(seed)
    solution, reference = alone(scene), error_bounds.on_finer_mesh(scene)
    at = solution.model.space.tabulate_dof_coordinates()[:, 0] / scene.mesh.parameters["length"]
    away = at if scene.displacement[0].boundary == "left" else 1 - at  # which keeps to supports
    for size in (0.02, 0.2):
        wrong = solution.displacement.copy()
        values = wrong.x.array.reshape(-1, 2)
        values += size * np.abs(values).max() * away[:, None] * chance.normal(size=values.shape)
        factor = 1 + size * chance.normal(size=solution.contact.pressure.shape)
        contact = replace(solution.contact, pressure=solution.contact.pressure * factor)
        bound = error_bound(solution.model, wrong, contact)
        true = error_bounds.energy_of_difference(replace(solution, displacement=wrong), reference)
        assert true < bound.error


@pytest.mark.parametrize("degree", [1, 2])
def test_the_same_factor_everywhere(degree):
    """As of a smaller modulus, which the grading is written as a function of: all parts of the bound, loads that jump
    inside a facet included."""
    load = {"boundary": "top", "y": "where(x[0] < 0.77, -2, -0.1)"}
    bounds = []
    for grading, young in (("0.25 + 0*x[0]", 1000.0), (None, 250.0)):
        scene = pulled(grading, degree=degree, young=young)
        fields = {key: getattr(scene, key) for key in scene.model_fields_set}
        bounds.append(alone(parse_scene(fields | {"traction": [load]})).error_bound)
    graded, plain = bounds
    assert graded.data > 1e-3 * graded.size
    for name in ("error", "size", "duality", "data"):
        assert getattr(graded, name) == pytest.approx(getattr(plain, name), rel=1e-9)
    assert graded.work == pytest.approx(plain.work, rel=1e-9)
    assert graded.round_off < 2 * plain.round_off


# --- what each term is for --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("grading", "less"),
    [
        ("1 - 0.45*x[0]", True),
        ("0.1 + 0.2*x[0]**2", False),
        pytest.param("where(x[0] < 0.7, 1, 0.2 + 0.1*x[1])", True, marks=SLOW),
    ],
)
def test_norms_of_stresses(grading, less):
    """Against many points, of random stresses: energies are exact, squares not less; without the least share of the
    modulus they would be where its mean is that of the centre, and gamma is at most what it is said to be."""
    solution, chance = alone(pulled(grading)), np.random.default_rng(3)
    case = Bounded(solution.model, solution.displacement, solution.contact, 0.0)
    t, graded, jumps = case.t, case.grading, "where" in grading
    at, weight = points_of_small_triangles(50 if jumps else 8)
    in_centre = scene_value(grading, t.x[t.corners].mean(axis=1))
    elastic = from_strain(t, chance.normal(size=(len(t.corners), 3, 3)))
    tau = 3 * chance.normal(size=elastic.shape) * np.abs(elastic).mean()  # of which 1 / gamma counts
    square, energy = graded.square(elastic, tau), graded.energy(elastic, elastic)
    exact = np.zeros((2, len(t.corners)))
    for part, facet in enumerate(FACETS[2]):
        corners = np.array([*np.eye(3)[facet], np.full(3, 1 / 3)])
        gamma = scene_value(grading, np.einsum("qk,kc,ncd->nqd", at, corners, t.x[t.corners])) / in_centre[:, None]
        sigma, other = at @ elastic[:, part], at @ tau[:, part]
        apart = gamma[..., None] * sigma - other
        products = [(one * t.strain(one) * TWICE[2]).sum(axis=2) for one in (apart, sigma)]
        exact[0] += t.volume / 3 * (products[0] / gamma @ weight)
        exact[1] += t.volume / 3 * (products[1] * gamma @ weight)
        assert (gamma <= graded.greatest[:, None]).all()
        assert (gamma >= graded.least[:, None]).all()
    np.testing.assert_allclose(energy, exact[1], rtol=0.03 if jumps else 1e-9)
    assert (square >= exact[0] * (0.97 if jumps else 1.0)).all()
    assert (square * graded.least < 0.99 * exact[0]).any() == less


def test_the_least_modulus_at_a_corner():
    """Where it is a millionth of the largest one in its cell, which is what round-off goes with: still not below."""
    most, slope = 0.950001, 0.475
    solution = alone(pulled(f"{most} - {slope}*x[0]", cells=(1, 1)))
    case = Bounded(solution.model, solution.displacement, solution.contact, 0.0)
    x = case.t.x[case.t.corners][..., 0].tolist()
    assert case.grading.greatest.max() > 5e5 * case.grading.least.min()
    for corners, least, greatest in zip(x, case.grading.least, case.grading.greatest, strict=True):
        gamma = [Fraction(most) - Fraction(slope) * Fraction(place) for place in corners]
        centre = sum(gamma) / 3
        assert Fraction(float(least)) <= min(gamma) / centre
        assert Fraction(float(greatest)) >= max(gamma) / centre


def test_what_a_modulus_that_varies_makes_larger():
    """The energy of what is taken from the displacement has the modulus at each point, where that is large; what loads
    do beyond the stress is the more work the smaller the modulus is."""
    scene = pulled("where(x[0] < 0.7, 0.2 + 0.3*x[0]**2, 1)", cells=(3, 2))
    fields = {key: getattr(scene, key) for key in scene.model_fields_set}
    load = {"boundary": "top", "y": "where(x[0] < 0.9, -0.5, -0.1)"}
    more = {"traction": [load], "contact": {"boundary": "bottom", "gap": "0.0005*(x[0] - 1)**2"}}
    support = {"displacement": [{"boundary": "left", "x": 0.0, "y": 0.0}]}
    solution = alone(parse_scene(fields | more | support))
    case = Bounded(solution.model, solution.displacement, solution.contact, 0.0)
    t, graded, v = case.t, case.grading, case.enclosure.v
    moved = from_strain(t, v.strain - t.strain_at_corners(case.y, case.middle))
    energy = graded.energy(moved, moved)
    assert (v.moved >= energy * (1 - 1e-12)).all()
    some = energy > 1e-9 * energy.max()
    assert (graded.greatest[some] > 1.01).any()
    alike = case.loads.missed_beside(np.zeros(len(t.facets)))
    loaded = alike > 0
    local = points_of_small_triangles(4)[0]
    x = np.einsum("qc,ncd->nqd", local, t.x[t.corners])
    seen = (
        scene_value(scene.material[0].grading.text, x)
        / scene_value(scene.material[0].grading.text, t.x[t.corners].mean(axis=1))[:, None]
    )
    assert (case._missed >= alike / seen.min(axis=1)).all()
    assert (seen.min(axis=1)[loaded] < 0.99).any()


def points_of_small_triangles(steps):
    """Barycentric points and weights of a rule on a triangle whose sides are divided."""
    points, weights = simplex_rule(2, 6)
    lattice = np.array([(i, j) for i in range(steps) for j in range(steps - i)])
    up = np.stack([lattice + np.array(corner) for corner in ((0, 0), (1, 0), (0, 1))], axis=1)
    inner = lattice[lattice.sum(axis=1) < steps - 1]
    down = np.stack([inner + np.array(corner) for corner in ((1, 1), (0, 1), (1, 0))], axis=1)
    small = np.concatenate((up, down)) / steps
    at = np.einsum("qk,mkc->mqc", points, np.concatenate((1 - small.sum(axis=2, keepdims=True), small), axis=2))
    return at.reshape(-1, 3), np.tile(weights, len(small)) / len(small)


def scene_value(text, x):
    """An expression at points of shape (..., 2)."""
    where = {"where": np.where, "x": np.moveaxis(x, -1, 0)}
    return np.broadcast_to(eval(text, {}, where), x.shape[:-1])


@pytest.mark.parametrize("counted", [True, False])
def test_stresses_of_the_modulus_at_each_point(counted):
    """Both displacement and stress are those of moduli that are constant in each cell: only what varies inside tells
    of the error."""
    # The same in the middles of both triangles, so that nothing else is wrong.
    scene = pulled("1 - 0.8*(x[0] - 1)**2", cells=(1, 1), poisson=0.0)
    fields = {key: getattr(scene, key) for key in scene.model_fields_set}
    scene = parse_scene(fields | {"traction": [{"boundary": "right", "x": 1.0}]})
    solution, reference = alone(scene), error_bounds.on_finer_mesh(scene)
    true = error_bounds.energy_of_difference(solution, reference)
    case = Bounded(solution.model, solution.displacement, solution.contact, 0.0)
    if not counted:
        case.grading = replace(
            case.grading, parts=tuple(replace(part, share=np.ones_like(part.share)) for part in case.grading.parts)
        )
    bound = case.bound()
    assert (bound.error > true) == counted
    assert true > 0.01 * bound.size


# --- what is refused --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("grading", "more", "reason"),
    [
        ("exp(-x[0])", {}, "where it is a polynomial of degree 5 at most"),
        ("where(x[0]**2 + x[1]**2 < 0.5, 1, 0.5)", {}, "where it is a polynomial of degree 5 at most"),
        (None, {"poisson_grading": "1 - 0.1*x[0]"}, "Poisson's ratio or axes that vary"),
        ("0.05 + 0.9*(x[0] - 1)**2", {}, "moduli that do not vanish"),
    ],
)
def test_what_has_no_bound(grading, more, reason):
    """Each with its reason."""
    assert reason in alone(pulled(grading, cells=(1, 1), **more)).error_bound


def test_forces_of_graded_bodies():
    """The error alone has a bound, and where the body is heated, too, it has none."""
    scene = pulled("1 - 0.2*x[0]")
    solution = alone(scene)
    assert not isinstance(solution.error_bound, str)
    assert "graded body the error alone" in solution.force_bounds("left", (1.0, 0.0))
    fields = {key: getattr(scene, key) for key in scene.model_fields_set}
    material = {"young": 1000.0, "poisson": 0.3, "grading": "1 - 0.2*x[0]", "expansion": 1e-5}
    heated = parse_scene(fields | {"material": material, "temperature": [{"change": 1.0}]})
    assert "graded body with initial strains" in alone(heated).error_bound
