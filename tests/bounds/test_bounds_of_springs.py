"""Bounds of bodies on springs: true errors, exact states, and what each part of (B11) is for."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from loaded_scenes import effectivity
from scenes import alone
from spaces import box

from signorini_fx.addons.bounds.applied_loads import PlaneLoads
from signorini_fx.addons.bounds.error_bound import Bounded, error_bound
from signorini_fx.addons.bounds.facets import GAUSS, POINTS, WEIGHTS, bernstein
from signorini_fx.addons.bounds.spring_facets import SpringFacets
from signorini_fx.addons.bounds.varying_springs import VaryingSprings
from signorini_fx.scenes.reading import parse_scene

SLOW, LONG = pytest.mark.slow, pytest.mark.long


# --- true errors ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "study", "seeds"),
    [
        ("springs", "plane", (1,)),
        ("pressed springs", "plane", (0,)),
        pytest.param("springs", "plane", (0, 4, 5), marks=SLOW),
        pytest.param("springs", "pressed", (1, 4), marks=SLOW),
        pytest.param("springs", "pair", (3, 5), marks=SLOW),
        pytest.param("springs", "space", (100, 103), marks=SLOW),
        pytest.param("pressed springs", "plane", (1, 2, 3), marks=SLOW),
        pytest.param("pressed springs", "pair", (3, 5), marks=SLOW),
        pytest.param("pressed springs", "space", (100,), marks=SLOW),
        pytest.param("facing springs", "pair", (4, 7), marks=SLOW),
        ("varying springs", "plane", (2,)),
        pytest.param("varying springs", "plane", (1, 4, 5, 9), marks=SLOW),
        pytest.param("varying springs", "pair", (3, 5), marks=SLOW),
        pytest.param("varying springs", "space", (1, 3), marks=SLOW),
    ],
)
def test_true_errors(kind, study, seeds):
    """In the norm of body and springs; finer solutions refute no interval of the strain energy or of a force."""
    for seed in seeds:
        found = effectivity(kind, study, seed)
        assert not isinstance(found, str), found
        assert found[2] == []
        assert 1 < found[0] < 6


@LONG
@pytest.mark.parametrize(("study", "many", "largest"), [("plane", 30, 2.2), ("pair", 30, 2), ("space", 12, 2.5)])
def test_true_errors_of_many(study, many, largest):
    """Of random scenes, most of which have a bound."""
    found = [row for row in (effectivity("springs", study, seed) for seed in range(100, 100 + many)) if len(row) == 3]
    assert len(found) > many / 2
    assert all(ratio > 1 and wrong == [] for ratio, _, wrong in found)
    assert np.median([ratio for ratio, _, _ in found]) < largest


# --- exact states -----------------------------------------------------------------------------------------------------

YOUNG, LONG_BAR, PULL = 100.0, 2.0, 0.7


def bar(springs, *, degree=1, dimension=2, **more):
    """A bar without Poisson's ratio that is pulled at its right, with springs at its left."""
    if dimension == 2:
        shape = {"length": LONG_BAR, "height": 1.0, "nx": 2, "ny": 1, "cell": "triangle"}
        mesh = {"generator": "rectangle", "parameters": shape}
    else:
        mesh = box("tetrahedra", (2, 1, 1), size=(LONG_BAR, 1.0, 1.0))
    scene = {
        "mesh": mesh,
        "element": {"degree": degree},
        "material": {"young": YOUNG, "poisson": 0.0},
        "springs": [{"boundary": "left", **entry} for entry in springs],
        "traction": [{"boundary": "right", "x": PULL}],
    }
    return parse_scene(scene | more)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(
    "springs", [[{"normal": 5.0, "tangential": 3.0}], [{"x": 4.0}, {"normal": 1.0, "tangential": 2.0}]]
)
def test_a_bar_that_springs_hold(springs, dimension):
    """Nothing but springs holds it; the elements have its displacement, so that the bound is round-off."""
    solution = alone(bar(springs, dimension=dimension))
    bound = solution.error_bound
    energy = PULL**2 / YOUNG * LONG_BAR / 2
    assert bound.error < 1e-5 * bound.size
    assert bound.strain_energy == pytest.approx((energy, energy), rel=1e-4)
    assert bound.size**2 / 2 == pytest.approx(energy + PULL**2 / 5 / 2, rel=1e-9)
    assert bound.work[0] <= PULL**2 * (LONG_BAR / YOUNG + 1 / 5) * (1 + 1e-12)
    assert bound.work[1] >= PULL**2 * (LONG_BAR / YOUNG + 1 / 5) * (1 - 1e-12)
    assert bound.as_dict()["guaranteed"]
    assert "in the energy norm of body and springs" in str(bound)


@pytest.mark.parametrize("factor", [1.0, 1.02, 0.98])
def test_a_stiffness_that_is_wrong(monkeypatch, factor):
    """The mean displacement of the pulled end has both bounds equal; seen with another stiffness they are refuted."""
    solution = alone(bar([{"normal": 5.0, "tangential": 3.0}]))
    of = SpringFacets.of

    def wrong(*args):
        found = of(*args)
        less = {"stiffness": factor * found.stiffness, "give": found.give / factor, "softest": factor * found.softest}
        return replace(found, **less)

    monkeypatch.setattr(SpringFacets, "of", staticmethod(wrong))
    exact = PULL * (LONG_BAR / YOUNG + 1 / 5)
    low, high = solution.mean_displacement_bounds("right", (1.0, 0.0))
    # Of the solution with another stiffness the computed one is wrong, so that the interval has a width.
    assert high - low < (1e-9 if factor == 1 else 0.05) * exact
    if factor == 1:
        assert low - 1e-12 * exact <= exact <= high + 1e-12 * exact
    else:
        theirs = PULL * (LONG_BAR / YOUNG + 1 / 5 / factor)
        assert low <= theirs <= high
        assert not low - 1e-12 * exact <= exact <= high + 1e-12 * exact


def test_the_force_of_a_support_beside_springs():
    """A bar between a support and springs: both take their share, by their stiffness."""
    held, load = {"boundary": "right", "x": 0.0, "y": 0.0}, {"boundary": "left", "x": 2.0}
    scene = bar([{"x": 30.0}], displacement=held, traction=load)
    exact = -2.0 * (YOUNG / LONG_BAR) / (YOUNG / LONG_BAR + 30.0)
    low, high = alone(scene).force_bounds("right", (1.0, 0.0))
    assert high - low < 1e-9
    assert low - 1e-12 <= exact <= high + 1e-12


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_bar_that_springs_of_a_varying_stiffness_hold(dimension):
    """Its left end moves as a whole, with a traction that is right for this: what the springs exert is linear there,
    the elements have its displacement, and the bound is round-off."""
    moved, strain = 0.1, PULL / YOUNG
    traction = [{"boundary": "right", "x": PULL}, {"boundary": "left", "x": f"{moved}*(2 + 6*x[1]) - {PULL}"}]
    solution = alone(bar([{"normal": "2 + 6*x[1]", "tangential": 3.0}], dimension=dimension, traction=traction))
    bound = solution.error_bound
    assert bound.error < 1e-5 * bound.size
    assert bound.size**2 == pytest.approx(PULL * strain * LONG_BAR + 5 * moved**2, rel=1e-9)
    if dimension == 2:
        low, high = solution.mean_displacement_bounds("right", (1.0, 0.0))
        assert low - 1e-10 <= moved + strain * LONG_BAR <= high + 1e-10
        assert high - low < 1e-8


@pytest.mark.parametrize("factor", [1.0, 1.02, 0.98])
def test_a_varying_stiffness_that_is_wrong(monkeypatch, factor):
    """Seen with another one, the mean displacement of the pulled end is refuted."""
    moved = 0.1
    traction = [{"boundary": "right", "x": PULL}, {"boundary": "left", "x": f"{moved}*(2 + 6*x[1]) - {PULL}"}]
    solution = alone(bar([{"normal": "2 + 6*x[1]", "tangential": 3.0}], traction=traction))
    of = VaryingSprings.stiffness_at
    monkeypatch.setattr(VaryingSprings, "stiffness_at", lambda *args: factor * of(*args))
    low, high = solution.mean_displacement_bounds("right", (1.0, 0.0))
    assert (low - 1e-10 <= moved + PULL / YOUNG * LONG_BAR <= high + 1e-10) == (factor == 1)


@pytest.mark.parametrize("degree", [1, 2])
def test_an_expression_that_is_a_number(degree):
    """It has the bound of the number, which is not the same code."""
    number, same = (alone(uneven(degree, springs=springs)).error_bound for springs in (
        {"boundary": "left", "normal": 20.0, "tangential": 30.0},
        {"boundary": "left", "normal": "20 + 0*x[1]", "tangential": "where(x[1] < 0.3, 30, 30)"},
    ))  # fmt: skip
    assert same.error == pytest.approx(number.error, rel=1e-9)


# --- what each part is for --------------------------------------------------------------------------------------------


def uneven(degree=1, **more):
    """A stiff block on springs, loaded on a part of its top, with a foundation below its right side."""
    return parse_scene(
        {
            "mesh": {
                "generator": "rectangle",
                "parameters": {"length": 2.0, "height": 1.0, "nx": 4, "ny": 2, "cell": "triangle"},
            },
            "element": {"degree": degree},
            "material": {"young": 1000.0, "poisson": 0.3},
            "springs": {"boundary": "left", "normal": 20.0, "tangential": 30.0},
            "traction": {"boundary": "top", "y": "where(x[0] < 1, -1, -3)"},
            "contact": {"boundary": "bottom", "gap": "0.02 + 0.02*x[0]"},
            **more,
        }
    )


def error_of(solution, displaced):
    """The bound of a displacement."""
    return error_bound(solution.model, displaced, solution.contact)


@pytest.mark.parametrize("counted", [True, False])
def test_a_displacement_that_the_springs_alone_know_to_be_wrong(monkeypatch, counted):
    """It is lifted as a whole: its strain is right. Without what the stress leaves of the springs nobody sees it."""
    light = {"boundary": "top", "y": -0.01}
    solution = alone(uneven(contact={"boundary": "bottom", "gap": 1.0}, traction=light))
    displaced = solution.displacement.copy()
    displaced.x.array[1::2] += 0.05
    if not counted:
        monkeypatch.setattr(Bounded, "_misfit", lambda self, *_: np.zeros(len(self.t.corners)))
    # Nothing is in contact: the true error is at least that of the lift in springs less that of the solution.
    lifted, own = 0.05 * np.sqrt(30.0), error_of(solution, solution.displacement).error
    assert (error_of(solution, displaced).error > lifted - own) == counted


@pytest.mark.parametrize("counted", [True, False])
def test_what_linear_functions_miss_of_springs(monkeypatch, counted):
    """A stiffness with a part that is orthogonal to linear functions on the one facet of a bar: the elements and the
    linear tractions see uniform tension, and only the rest of the load knows that it is wrong."""
    springs = {"boundary": "left", "x": "5 + 9*(6*x[1]**2 - 6*x[1] + 1)", "y": 3.0}
    scene = bar([]).model_copy(update={"springs": ()})

    def solved(many):
        shape = {"length": LONG_BAR, "height": 1.0, "nx": 2 * many, "ny": many, "cell": "triangle"}
        fields = {key: getattr(scene, key) for key in scene.model_fields_set}
        return alone(
            parse_scene(fields | {"mesh": {"generator": "rectangle", "parameters": shape}, "springs": springs})
        )

    coarse, fine = solved(1), solved(16)
    if not counted:
        monkeypatch.setattr(PlaneLoads, "missed_beside", lambda self, _: np.zeros(len(self._t.corners)))
    # The energy norm of the error is at least that of what the body and the springs store beyond the coarse solution.
    bound, finer = (solution.error_bound for solution in (coarse, fine))
    apart = np.sqrt(abs(finer.size**2 - bound.size**2))
    assert (bound.error > apart) == counted


@pytest.mark.parametrize("degree", [1, 2])
def test_energies_in_springs_that_vary(degree):
    """As below, of a stiffness that jumps inside a facet, vanishes at a place of another one, and has a kink."""
    springs = {"boundary": "left", "normal": "where(x[1] < 0.3, 50*x[1]**2, 7)", "tangential": "max(0, 40*x[1] - 6)"}
    solution = alone(uneven(degree, springs=springs))
    displaced = solution.displacement.copy()
    displaced.x.array[:] = np.random.default_rng(degree).normal(size=len(displaced.x.array))
    case = Bounded(solution.model, displaced, solution.contact, 0.0)
    facets = case._facets("left")
    up = case.t.x[case.t.facets[facets]][..., 1]
    exact, own, (points, weights) = 0.0, case.on_facets(case.y, case.middle, facets), GAUSS
    for (low, high), coefficients in zip(up, own, strict=True):
        marks = np.unique(np.clip([min(low, high), 0.15, 0.3, max(low, high)], min(low, high), max(low, high)))
        for begin, end in pairwise(marks):
            at = begin + (end - begin) * points
            share = (at - low) / (high - low)
            normal = np.where(at < 0.3, 50 * at**2, 7)
            moved = bernstein(np.column_stack((1 - share, share))) @ coefficients
            density = normal * moved[:, 0] ** 2 + np.maximum(0, 40 * at - 6) * moved[:, 1] ** 2
            exact += (end - begin) * float(density @ weights)
    assert case._stored(case.y, case.middle)[0].sum() == pytest.approx(exact, rel=1e-9)
    least = case.springs.stiffness
    assert (least >= 0).all()
    # No facet has a larger one than its least: that is zero where it vanishes on a part.
    assert np.abs(least[case.t.x[case.t.facets[case.springs.facets]][..., 1].min(axis=1) < 0.1]).max(initial=0.0) < 1e-9


@pytest.mark.parametrize("degree", [1, 2])
def test_energies_in_springs(degree):
    """Of a displacement that is drawn, beside a rule of quadrature at points of the scene's own mesh."""
    solution = alone(uneven(degree))
    displaced = solution.displacement.copy()
    displaced.x.array[:] = np.random.default_rng(degree).normal(size=len(displaced.x.array))
    case = Bounded(solution.model, displaced, solution.contact, 0.0)
    facets = case._facets("left")
    at = bernstein(POINTS[2]) @ case.on_facets(case.y, case.middle, facets)
    exact = case.t.area[facets] @ (20 * at[..., 0] ** 2 + 30 * at[..., 1] ** 2) @ WEIGHTS[2]
    assert case._stored(case.y, case.middle)[0].sum() == pytest.approx(exact, rel=1e-12)
    away = np.array([0.3, 0.1])
    moved = case._beside((case.y + away, case.middle + away), case.t.strain_at_corners(case.y, case.middle))
    assert moved.moved.sum() == pytest.approx(20 * 0.09 + 30 * 0.01, rel=1e-9)
    traction = np.random.default_rng(3).normal(size=(len(facets), 2, 2))
    left = case.springs.reaction(case.on_facets(case.y, case.middle, facets)) + case.springs.at_points(traction)
    along = POINTS[2] @ traction
    exact = (20 * at[..., 0] + along[..., 0]) ** 2 / 20 + (30 * at[..., 1] + along[..., 1]) ** 2 / 30
    assert case.springs.product(left, left).sum() == pytest.approx(case.t.area[facets] @ exact @ WEIGHTS[2], rel=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
def test_tractions_of_springs_are_in_equilibrium(dimension):
    """What the stress exerts where springs alone hold the body balances its loads, in each direction."""
    solution = alone(bar([{"normal": 5.0, "tangential": 3.0}], dimension=dimension, body_force={"y": 0.004}))
    problem = Bounded(solution.model, solution.displacement, solution.contact, 0.0)
    traction = problem.enclosure.stress.of_springs
    force = problem.springs.area @ traction.mean(axis=1)
    assert force[:2] == pytest.approx([-PULL, -0.004 * LONG_BAR], rel=1e-7)


def test_springs_of_one_direction_exert_no_other_force():
    """Along the boundary there are none, and the support takes all of its own direction."""
    scene = uneven(springs={"boundary": "left", "normal": 20.0}, displacement={"boundary": "right", "y": -0.01})
    problem = Bounded(*(lambda s: (s.model, s.displacement, s.contact))(alone(scene)), 0.0)
    traction = problem.enclosure.stress.of_springs
    assert np.abs(traction[..., 0]).max() > 0
    assert np.abs(traction[..., 1]).max() == 0
    # Beside a support in one direction they act in the other.
    scene = uneven(displacement={"boundary": "left", "x": 0.0})
    problem = Bounded(*(lambda s: (s.model, s.displacement, s.contact))(alone(scene)), 0.0)
    assert np.abs(problem.springs.stiffness - np.diag([0.0, 30.0])).max() < 1e-12


@pytest.mark.parametrize(
    ("more", "reason"),
    [
        (
            {"springs": {"boundary": "left", "normal": "100*(x[1] - 0.3)*(x[1] - 0.4)", "tangential": 30.0}},
            "is not negative",
        ),
        (
            {"springs": {"boundary": "left", "normal": "1e5*(x[1] - 0.5)**2", "tangential": 300.0}, "contact": []},
            "vanishes nowhere on some facets",
        ),
        (
            {"contact": {"boundary": "bottom", "gap": 0.02, "kind": "bilateral", "direction": [0.6, -0.8]},
             "springs": [{"boundary": "bottom", "x": 5.0}, {"boundary": "left", "normal": 20.0, "tangential": 30.0}]},
            "along or across them so far",
        ),
        ({"springs": {"boundary": "left", "normal": 1e9, "tangential": 0.5}}, "more than 1e-09 of the largest"),
        (
            {"springs": [{"boundary": "left", "normal": 1e9}, {"boundary": "left", "y": 0.5}]},
            "more than 1e-09 of the largest",
        ),
    ],
)  # fmt: skip
def test_what_has_no_bound(more, reason):
    """Springs whose stiffness is negative, or vanishes somewhere on each facet where they alone hold the body; that are
    not along what holds the boundary, or of which one is round-off."""
    assert reason in alone(uneven(**more)).error_bound


def test_a_support_with_springs_has_no_force_of_its_own():
    """Both act on the same boundary."""
    solution = alone(uneven(displacement={"boundary": "left", "x": 0.0}))
    assert "springs act on 'left'" in solution.force_bounds("left", (1.0, 0.0))
