"""The bound of the error with thermal strain: true errors of random scenes, exact states, and what each term is for."""

from dataclasses import replace

import heated_scenes
import numpy as np
import pytest
from error_bounds import energy_of_difference, on_finer_mesh
from scenes import alone

from signorini_fx.addons.bounds.error_bound import Bounded, error_bound
from signorini_fx.addons.bounds.initial_stress import simplex_rule
from signorini_fx.addons.bounds.johnson_mercier import LocalStress
from signorini_fx.addons.bounds.simplices import FACETS, IsotropicModuli, Simplices
from signorini_fx.addons.bounds.stress_products import from_strain, product
from signorini_fx.mechanics.effects.temperature import TemperatureChange
from signorini_fx.scenes.reading import parse_scene

YOUNG, POISSON, ALPHA = 1000.0, 0.3, 1e-3


def bar(change, *, degree=1, hypothesis="plane strain", cells=(4, 2), length=2.0, **more):
    """A heated block on rollers, free to expand, without contact or beside a foundation that it does not touch."""
    shape = {"length": length, "height": 1.0, "nx": cells[0], "ny": cells[1], "cell": "triangle"}
    return parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": shape},
            "element": {"degree": degree},
            "material": {"young": YOUNG, "poisson": POISSON, "expansion": ALPHA, "hypothesis": hypothesis},
            "displacement": [{"boundary": "left", "x": 0.0}, {"boundary": "bottom", "y": 0.0}],
            "temperature": change if isinstance(change, list) else [{"change": change}],
        }
        | more
    )


# --- true errors ------------------------------------------------------------------------------------------------------

SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    ("kind", "seeds"),
    [
        ("plane", (18,)),
        ("space", (22,)),
        pytest.param("plane", (2, 8), marks=SLOW),
        pytest.param("pair", (1, 3), marks=SLOW),
        pytest.param("shape", (2, 3, 5), marks=SLOW),
    ],
)
def test_true_errors(kind, seeds):
    """The bound is above the true error, and finer solutions refute no interval of the energy or of a force."""
    ratios = []
    for seed in seeds:
        found = heated_scenes.effectivity(kind, seed)
        assert not isinstance(found, str), found
        assert found[2] == []
        ratios.append(found[0])
    assert min(ratios) > 1
    assert np.median(ratios) < 4


@pytest.mark.long
@pytest.mark.parametrize(("kind", "many", "largest"), [("plane", 40, 2), ("pair", 30, 2), ("space", 20, 2.5)])
def test_true_errors_of_many(kind, many, largest):
    """The same of many, with their median."""
    found = [heated_scenes.effectivity(kind, seed) for seed in range(many)]
    found = [one for one in found if not isinstance(one, str)]
    assert all(one[2] == [] for one in found)
    assert min(one[0] for one in found) > 1
    assert np.median([one[0] for one in found]) < largest


@pytest.mark.parametrize("seed", [2, pytest.param(8, marks=SLOW)])
def test_displacements_and_pressures_that_are_wrong(seed):
    """Disturbed by some per cent each: the bound is one of the disturbed displacement."""
    scene, chance = heated_scenes.drawn("plane", seed), np.random.default_rng(seed)
    solution, reference = alone(scene), on_finer_mesh(scene)
    for size in (0.02, 0.2):
        wrong = solution.displacement.copy()
        values = wrong.x.array.reshape(-1, 2)
        far = np.abs(values).max()
        loose = np.abs(solution.model.tagged.mesh.geometry.x[:, 0]).max()
        at = solution.model.space.tabulate_dof_coordinates()[:, 0] / loose
        support = scene.displacement[0].boundary
        away = at if support == "left" else 1 - at  # which keeps to supports
        values += size * far * away[:, None] * chance.normal(size=values.shape)
        factor = 1 + size * chance.normal(size=solution.contact.pressure.shape)
        contact = replace(solution.contact, pressure=solution.contact.pressure * factor)
        bound = error_bound(solution.model, wrong, contact)
        true = energy_of_difference(replace(solution, displacement=wrong), reference)
        assert true < bound.error


# --- exact states -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("hypothesis", ["plane strain", "plane stress"])
@pytest.mark.parametrize(("change", "degree"), [("40.0", 1), ("40 + 20*x[0] - 10*x[1]", 2)])
def test_free_expansion(hypothesis, change, degree):
    """A temperature that is linear strains a free body without any stress in its plane, by a displacement of degree 2:
    the bound is round-off, and the energy is that of the stress across the plane, E (alpha T)^2 / 2."""
    # Rollers at two sides would bend it where the temperature varies.
    free = {} if degree == 1 else {"displacement": expanded(hypothesis)}
    bound = alone(bar(change, degree=degree, hypothesis=hypothesis, **free)).error_bound
    points, weights = simplex_rule(2, 3)
    half = points @ np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 1.0]])
    x, y = np.concatenate((half, [2.0, 1.0] - half)).T
    heat = 40 + (degree - 1) * (20 * x - 10 * y)
    squares = YOUNG * float(np.tile(weights, 2) @ (ALPHA * heat) ** 2)
    low, high = bound.strain_energy
    assert low <= (squares / 2 if hypothesis == "plane strain" else 0.0) <= high
    assert high - low < 1e-6 * squares
    assert bound.duality < 1e-8 * np.sqrt(squares)


def expanded(hypothesis):
    """All sides held where they move to, by the integrals of alpha T with T = 40 + 20 x - 10 y."""
    k = ALPHA * (1 + POISSON if hypothesis == "plane strain" else 1.0)
    x, y = "x[0]", "x[1]"
    along = f"{k}*(40*{x} + 10*{x}**2 - 10*{x}*{y} - 10*{y}**2)"
    across = f"{k}*(40*{y} + 20*{x}*{y} - 5*{y}**2 + 5*{x}**2)"
    return [{"boundary": name, "x": along, "y": across} for name in ("left", "right", "top", "bottom")]


def test_temperatures_of_load_steps():
    """The temperature of the last load step, by factors, by the time, and of two entries, as that of one."""
    steps = [{"change": "20*x[0]", "factors": [0.5, 2.0]}]
    timed = [{"change": "20*t*x[0]"}]
    bounds = [
        alone(bar(change, **more)).error_bound
        for change, more in (
            ("40*x[0]", {}),
            (steps, {}),
            (timed, {"load_steps": {"times": [0.5, 2.0]}}),
            ([{"change": "30*x[0]"}, {"change": "10*x[0]"}], {}),
        )
    ]
    for bound in bounds[1:]:
        assert bound.error == pytest.approx(bounds[0].error, rel=1e-9)
        assert bound.strain_energy == pytest.approx(bounds[0].strain_energy, rel=1e-9)


@pytest.mark.parametrize(("law", "degree"), [("isotropic", 1), ("isotropic", 2), ("orthotropic", 1)])
def test_forces_and_means_of_heated_bodies(law, degree):
    """Between two rollers a heated body in plane stress is pressed by E alpha T; without one of them it gets longer by
    alpha T: the intervals close on these."""
    heat = 40.0
    sides = [{"boundary": "left", "x": 0.0}, {"boundary": "bottom", "y": 0.0}]
    material = {"young": YOUNG, "poisson": POISSON}
    if law == "orthotropic":
        constants = {"young": [YOUNG, 700.0, 500.0], "poisson": [0.2, 0.25, 0.1], "shear": [300.0, 200.0, 400.0]}
        material = {"orthotropic": constants}
    material |= {"expansion": ALPHA, "hypothesis": "plane stress"}
    held = bar(heat, degree=degree, material=material, displacement=[*sides, {"boundary": "right", "x": 0.0}])
    low, high = alone(held).force_bounds("right", (1.0, 0.0))
    assert low <= -YOUNG * ALPHA * heat <= high
    assert high - low < 1e-6 * YOUNG * ALPHA * heat
    free = bar(heat, degree=degree, material=material, displacement=sides)
    low, high = alone(free).mean_displacement_bounds("right", (1.0, 0.0))
    assert low <= 2 * ALPHA * heat <= high
    assert high - low < 1e-6 * ALPHA * heat


def test_a_force_that_a_mesh_decides():
    """Of a body whose temperature varies, between two walls: opposite forces, whose intervals hold those on a finer
    mesh and are not as wide as the stress that heat causes."""
    walls = [{"boundary": "left", "x": 0.0, "y": 0.0}, {"boundary": "right", "x": 0.0, "y": 0.0}]
    scenes = [bar("40 + 30*x[0]*x[1]", cells=cells, displacement=walls) for cells in ((8, 4), (24, 12))]
    coarse, fine = ([alone(scene).force_bounds(side, (1.0, 0.0)) for side in ("left", "right")] for scene in scenes)
    for (low, high), (least, greatest) in zip(coarse, fine, strict=True):
        assert low <= (least + greatest) / 2 <= high
        assert high - low < 0.1 * abs(low)
    for left, right in (coarse, fine):
        assert left[0] + right[0] <= 0 <= left[1] + right[1]


# --- what each term is for --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("d", [2, 3])
def test_the_work_on_an_initial_strain(d):
    """What an initial stress gives as moments does the work of any stress in balance on its strain."""
    chance = np.random.default_rng(d)
    x = np.concatenate((np.zeros((1, d)), np.eye(d))) + 0.2 * chance.normal(size=(d + 1, d))
    t = Simplices(x, np.arange(d + 1)[None], IsotropicModuli(np.full(1, 1.3), np.full(1, 0.7), d))
    local = LocalStress(t)
    initial = chance.normal(size=(1, d + 1, d + 1, 3 if d == 2 else 6))
    y = chance.normal(size=d * d * (d + 1))
    moments = (local.compliance[0] @ y).reshape(d + 1, d, d)
    tractions = (d * (d + 1) * moments - d * moments.sum(axis=1, keepdims=True)) / t.area[t.facets_of[0]][:, None, None]
    stress, _ = local.stress(tractions[None], np.zeros((1, d + 1, d)))
    assert float(y @ local.held_back(initial)[0]) == pytest.approx(float(product(t, stress, initial)[0]), rel=1e-9)
    # A strain that belongs to a displacement: nothing is held back that this does not take.
    slope = chance.normal(size=(d, d))
    strain = t.strain_at_corners(t.x @ slope.T, (t.x @ slope.T)[t.edges].mean(axis=1))
    vertices = (t.x @ slope.T)[t.corners[0][FACETS[d]]].ravel()
    np.testing.assert_allclose(local.held_back(from_strain(t, strain))[0], local.compliance[0] @ vertices, atol=1e-9)


@pytest.mark.parametrize("counted", [True, False])
def test_what_linear_functions_miss(counted):
    """A temperature that goes up and down inside the cells, Legendre's polynomial of degree 5 along the bar:
    displacement and stress know hardly anything of it."""
    u = "(x[0] - 1)"
    scene = bar(f"300*(63*{u}**5 - 70*{u}**3 + 15*{u})/8", cells=(1, 1), length=2.0)
    solution, reference = alone(scene), on_finer_mesh(scene)
    true = energy_of_difference(solution, reference)
    case = Bounded(solution.model, solution.displacement, solution.contact, 0.0)
    if not counted:
        case.initial = replace(case.initial, missed=np.zeros_like(case.initial.missed))
    assert (case.bound().error > true) == counted
    assert (case.enclosure.distance > true) == counted  # of which forces and the work of loads are made
    assert true > 0.01 * case.bound().size


@pytest.mark.parametrize("counted", [True, False])
def test_energy_across_the_plane(counted):
    """In plane strain the body cannot expand across the plane: the interval of its energy holds that of the mesh."""
    solution = alone(bar("40 + 20*x[0]*x[1]"))
    case = Bounded(solution.model, solution.displacement, solution.contact, 0.0)
    if not counted:
        case.initial = replace(case.initial, prevented=np.zeros_like(case.initial.prevented))
    low, high = case.bound().strain_energy
    assert (low <= solution.last_step.strain_energy <= high) == counted


@pytest.mark.parametrize("hypothesis", ["plane strain", pytest.param("plane stress", marks=SLOW)])
def test_what_quadrature_does_not_know(hypothesis):
    """A temperature that is no polynomial is counted as far as two rules differ, which holds for a smooth one; what is
    said names it."""
    solution = alone(bar("60/(1 + 9*(x[0] - 0.7)**2)", hypothesis=hypothesis))
    case = Bounded(solution.model, solution.displacement, solution.contact, 0.0)
    points, weights = simplex_rule(2, 24)
    t, initial, work = case.t, case.initial, np.zeros(len(case.t.corners))
    f, missed, beside = t.stress(initial.strain[:, None])[:, 0], [], np.zeros_like(initial.stress)
    for part, facet in enumerate(FACETS[2]):
        corners = np.array([*np.eye(3)[facet], np.full(3, 1 / 3)])
        x = np.einsum("qk,kc,ncd->nqd", points, corners, t.x[t.corners])
        s = ALPHA * 60 / (1 + 9 * (x[..., 0] - 0.7) ** 2)
        p = np.einsum("nck,nk->nc", initial.stress[:, part], f) / (f**2).sum(axis=1)[:, None]
        moments = t.volume[:, None] / 3 * np.einsum("q,qc,nq->nc", weights, points, s - p @ points.T)
        missed.append(np.abs(moments) / initial.unknown[:, part])
        beside[:, part] = np.sign(moments)[..., None] * f[:, None]
        work += np.abs(moments).sum(axis=1) * (f * initial.strain * [1.0, 1.0, 2.0]).sum(axis=1)
    assert 1e-3 < np.max(missed) < 1
    # A stress that is not perpendicular to what is missed.
    large = 1e6
    assert (initial.added(large * beside) - initial.missed >= 2 * large * work * (1 - 1e-6)).all()
    assert work.max() > 0
    assert "temperature assumed to be as seen" in str(solution.error_bound)
    assert "temperature" not in str(alone(bar("0.6*x[0]**5")).error_bound)


def test_what_is_an_estimate(tmp_path):
    """A function of Python, and a file, are not known between points; a form has no bound at all."""
    scene = bar("1.0")
    function = TemperatureChange(change=lambda x: 30 * x[0])
    found = alone(scene.model_copy(update={"temperature": (function,)})).error_bound
    assert "estimate and no guaranteed bound, as the temperature is a function of Python" in str(found)
    table = tmp_path / "temperature.csv"
    table.write_text("x,y,change\n0,0,1\n2,0,30\n2,1,30\n0,1,1\n", encoding="utf-8")
    found = alone(scene.model_copy(update={"temperature": (TemperatureChange(file=table),)})).error_bound
    assert "as the temperature is known at the points of a file alone" in str(found)
