"""The bound of the error with moduli that vary inside the cells: true errors, and what each of its terms is for."""

from dataclasses import replace
from fractions import Fraction

import error_bounds
import graded_scenes
import numpy as np
import pytest
from heated_scenes import drawn, effectivity
from scenes import alone
from test_bounds_of_heated_bodies import bar

from signorini_fx.addons.bounds.error_bound import Bounded, error_bound
from signorini_fx.addons.bounds.graded_moduli import GradedModuli
from signorini_fx.addons.bounds.initial_stress import simplex_rule
from signorini_fx.addons.bounds.quantity_bounds import _Quantity
from signorini_fx.addons.bounds.simplices import FACETS, TWICE
from signorini_fx.addons.bounds.stress_products import from_strain
from signorini_fx.scenes.reading import parse_scene

SLOW = pytest.mark.slow


def pulled(grading, *, degree=1, cells=(2, 1), heat=None, **material):
    """A graded block on rollers, pulled at its right and heated."""
    scene = bar(heat or "0.0", degree=degree, cells=cells, traction=[{"boundary": "right", "x": 1.0, "y": 0.3}])
    fields = {key: getattr(scene, key) for key in scene.model_fields_set - (set() if heat else {"temperature"})}
    one = {"young": 1000.0, "poisson": 0.3, "grading": grading, "expansion": 1.0 if heat else None} | material
    return parse_scene(fields | {"material": {key: value for key, value in one.items() if value is not None}})


# --- true errors ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "seeds", "change"),
    [
        ("plane", (12,), graded_scenes.graded),
        ("space", (22,), graded_scenes.graded),
        pytest.param("plane", (2,), graded_scenes.graded, marks=SLOW),
        pytest.param("pair", (1, 3), graded_scenes.graded, marks=SLOW),
        pytest.param("shape", (2, 3, 5), graded_scenes.graded, marks=SLOW),
        pytest.param("plane", (2, 13), graded_scenes.graded_and_heated, marks=SLOW),
        pytest.param("space", (5,), graded_scenes.graded_and_heated, marks=SLOW),
        pytest.param("pair", (1, 3), graded_scenes.graded_and_heated, marks=SLOW),
    ],
)
def test_true_errors(kind, seeds, change):
    """The bound is above the true error, and finer solutions refute no interval of the energy or of a force."""
    for seed in seeds:
        found = effectivity(kind, seed, change)
        assert not isinstance(found, str), found
        assert found[2] == []
        assert 1 < found[0] < 6


@pytest.mark.long
@pytest.mark.parametrize("change", [graded_scenes.graded, graded_scenes.graded_and_heated])
@pytest.mark.parametrize(("kind", "many", "largest"), [("plane", 40, 2), ("pair", 30, 2), ("space", 20, 2.5)])
def test_true_errors_of_many(kind, many, largest, change):
    """The same of many, with their median."""
    found = [effectivity(kind, seed, change) for seed in range(many)]
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
    ("grading", "less", "heat"),
    [
        ("1 - 0.45*x[0]", True, None),
        ("0.1 + 0.2*x[0]**2", False, None),
        ("1 - 0.45*x[0]", True, "1e-3*(1 + x[0]**2*x[1])"),
        pytest.param("where(x[0] < 0.7, 1, 0.2 + 0.1*x[1])", True, "1e-3*where(x[0] < 1.3, 1, x[1])", marks=SLOW),
    ],
)
def test_norms_of_stresses(grading, less, heat):
    """Against many points, of random stresses: energies and works are exact, squares not less; without the least share
    of the modulus they would be where its mean is that of the centre, and gamma is at most what it is said to be."""
    jumps = "where" in grading
    # Of degree 2 cells are divided, so that their centres are not the middles that the solver takes moduli from.
    degree = 1 if heat is None or jumps else 2
    solution, chance = alone(pulled(grading, heat=heat, degree=degree)), np.random.default_rng(3)
    case = Bounded(solution.model, solution.displacement, solution.contact, 0.0)
    t, graded = case.t, case.grading
    assert (case.initial is None) == (heat is None)
    in_centre = scene_value(grading, t.x[t.corners].mean(axis=1))
    elastic = from_strain(t, 1e-3 * chance.normal(size=(len(t.corners), 3, 3)))
    tau = 3 * chance.normal(size=elastic.shape) * np.abs(elastic).mean()  # of which 1 / gamma counts
    other = from_strain(t, 1e-3 * chance.normal(size=(len(t.corners), 3, 3)))
    dual = chance.normal(size=elastic.shape) * np.abs(other).mean()
    square, energy, work = graded.square(elastic, tau), graded.energy(elastic)[0], graded.work(elastic, other)[0]
    centre, around = graded.product((other, dual), (elastic, tau))
    exact = np.zeros((4, len(t.corners)))
    # Heat of one strains what is held in all directions by -1, and the body across the plane cannot expand.
    of_one, across = 1000.0 / 0.4 * np.array([1.0, 1.0, 0.0]), 1000.0
    for part, x, at, weight in points_of_parts(t, 50 if jumps else 8 // degree**2):
        gamma = scene_value(grading, x) / in_centre[:, None]
        s = 0.0 if heat is None else scene_value(heat, x)[..., None]
        sigma = at @ elastic[:, part] - s * of_one * in_centre[:, None, None]
        apart, beside = gamma[..., None] * sigma - at @ tau[:, part], gamma[..., None] * (at @ other[:, part])
        beside = beside - at @ dual[:, part]

        def product(one, two):
            return (one * t.strain(two) * TWICE[2]).sum(axis=2)

        held = across * in_centre[:, None] * np.broadcast_to(s, sigma.shape)[..., 0] ** 2
        for k, density in enumerate(
            (
                product(apart, apart) / gamma,
                (product(sigma, sigma) + held) * gamma,
                product(sigma, at @ other[:, part]) * gamma,
                product(apart, beside) / gamma,
            )
        ):
            exact[k] += t.volume / 3 * (density @ weight)
        assert (gamma <= graded.greatest[:, None]).all()
        assert (gamma >= graded.least[:, None]).all()
    np.testing.assert_allclose(energy, exact[1], rtol=0.03 if jumps else 1e-9)
    assert work == pytest.approx(exact[2].sum(), abs=(0.03 if jumps else 1e-9) * np.abs(exact[2]).sum())
    assert (square >= exact[0] * (0.97 if jumps else 1.0)).all()
    assert (square * graded.least < 0.99 * exact[0]).any() == less
    assert (np.abs(centre - exact[3]) <= around * (1.05 if jumps else 1.0)).all()
    assert (np.abs(centre - exact[3]) > 0.1 * around).any()


def points_of_parts(t, steps):
    """Points of the thirds of triangles: the number of the third, places, barycentric in the third, and weights."""
    at, weight = points_of_small_triangles(steps)
    for part, facet in enumerate(FACETS[2]):
        corners = np.array([*np.eye(3)[facet], np.full(3, 1 / 3)])
        yield part, np.einsum("qk,kc,ncd->nqd", at, corners, t.x[t.corners]), at, weight


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
    energy = graded.energy(moved)[0]
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
        case.grading = of_the_centres(case.grading)
    bound = case.bound()
    assert (bound.error > true) == counted
    assert true > 0.01 * bound.size


@pytest.mark.parametrize("part", ["product", "work"])
def test_what_is_not_known_of_products(monkeypatch, part):
    """Makes intervals wider: a half of what is not known of the product with the difference of both stresses, and all
    of what is not known of the work."""
    solution, _ = series(heat=False, free=True)
    original, unknown = getattr(GradedModuli, part), 1e-3

    def known_less(self, *stresses):
        value, around = original(self, *stresses)
        return value, around + unknown / np.size(around)

    low, high = solution.mean_displacement_bounds("right", (1.0, 0.0))
    monkeypatch.setattr(GradedModuli, part, known_less)
    lower, higher = solution.mean_displacement_bounds("right", (1.0, 0.0))
    share = 0.5 if part == "product" else 1.0
    assert (low - lower, higher - high) == pytest.approx((share * unknown, share * unknown), rel=1e-6)


def of_the_centres(grading):
    """As if stresses had the modulus of the centre of each cell."""
    parts = tuple(replace(part, share=np.ones_like(part.share)) for part in grading.rules[0])
    return replace(grading, rules=(parts,))


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


# --- forces and mean displacements ------------------------------------------------------------------------------------


def series(heat, free, cells=(6, 1)):
    """A graded bar in plane stress without Poisson's effect, pulled by one between rollers or heated between them; its
    mean displacement at the right, or the force there."""
    slope = 0.4
    sides = [{"boundary": "left", "x": 0.0}, {"boundary": "bottom", "y": 0.0}]
    loads = {"traction": [{"boundary": "right", "x": 1.0}]} if free else {}
    scene = bar(
        40.0 * heat,
        cells=cells,
        material={
            "young": 1000.0,
            "poisson": 0.0,
            "grading": f"1 - {slope}*x[0]",
            "expansion": 1e-3,
            "hypothesis": "plane stress",
        },
        displacement=sides if free else [*sides, {"boundary": "right", "x": 0.0}],
        **loads,
    )
    give, expansion = -np.log(1 - 2 * slope) / slope / 1000.0, 1e-3 * 40 * 2 * heat
    return alone(scene), give + expansion if free else -expansion / give


@pytest.mark.parametrize("counted", [True, False])
@pytest.mark.parametrize(("heat", "free"), [(False, True), (True, True), (True, False)])
def test_quantities_of_a_bar(heat, free, counted):
    """Mean displacements and forces of bars in series; where stresses had the modulus of the centre of each cell, the
    interval would not hold them."""
    (solution, exact), (finer, _) = series(heat, free), series(heat, free, cells=(24, 1))

    def interval(of):
        problem = _Quantity(of.model, of.displacement, of.contact, 0.0)
        if not counted:
            problem.grading = of_the_centres(problem.grading)
        low, high = (problem.mean if free else problem.force)("right", np.array([1.0, 0.0]))
        return low, high

    (low, high), (least, greatest) = interval(solution), interval(finer)
    assert (low <= exact <= high) == counted
    assert high - low < 0.1 * abs(exact)
    if counted:
        assert least <= exact <= greatest
        assert greatest - least < (high - low) / 12  # of second order in the length of the cells: 16


@pytest.mark.parametrize(
    ("seed", "change"),
    [
        (2, graded_scenes.graded_and_heated),
        pytest.param(4, graded_scenes.graded_and_heated, marks=SLOW),
        pytest.param(2, graded_scenes.graded, marks=SLOW),
        pytest.param(8, graded_scenes.graded, marks=SLOW),
    ],
)
def test_forces_that_a_mesh_decides(seed, change):
    """Of a body between a support and a foundation: those on a finer mesh are inside."""
    scene = drawn("pressed", seed, change)
    coarse, fine = alone(scene), error_bounds.on_finer_mesh(scene)
    for side in ("bottom", "top"):
        (low, high), (least, greatest) = (one.force_bounds(side, (0.0, 1.0)) for one in (coarse, fine))
        assert low <= (least + greatest) / 2 <= high
        assert 0 < greatest - least < 0.7 * (high - low)


def test_temperatures_that_quadrature_does_not_know():
    """One that is no polynomial is counted as far as rules differ, which holds for a smooth one."""
    heat = "0.02/(1 + 9*(x[0] - 0.7)**2)"
    solution = alone(pulled("1 - 0.3*x[0]", heat=heat))
    case = Bounded(solution.model, solution.displacement, solution.contact, 0.0)
    graded, t = case.grading, case.t
    elastic = from_strain(t, t.strain_at_corners(case.y, case.middle))
    rules = []
    for part, (_, x, at, weight) in zip(graded.rules[0], points_of_parts(t, 6), strict=True):
        gamma, middle = (scene_value("1 - 0.3*x[0]", of) for of in (x, t.x[t.corners].mean(axis=1)))
        places, volume = np.broadcast_to(at, (len(x), *at.shape)), t.volume[:, None] / 3 * weight
        share, strain = gamma / middle[:, None], scene_value(heat, x)
        rules.append(replace(part, at=places, weight=volume, share=share, strain=strain))
    energy, unknown = graded.energy(elastic)
    missed = np.abs(energy - replace(graded, rules=(tuple(rules),)).energy(elastic)[0])
    assert (missed <= unknown).all()
    assert missed.max() > 1e-3 * unknown.max()
    assert "temperature assumed to be as seen" in str(solution.error_bound)
