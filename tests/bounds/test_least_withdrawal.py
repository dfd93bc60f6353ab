"""What is taken from a displacement that enters a foundation: its parts, and what the bound gains."""

from dataclasses import replace

import error_bounds
import error_bounds_in_space
import numpy as np
import pytest
from bounds_on_shapes import effectivity, on_shape
from scenes import alone
from test_bounds_on_shapes import CIRCLE, SPHERE, block, in_space

from signorini_fx.addons.bounds import error_bound
from signorini_fx.addons.bounds import least_withdrawal as module
from signorini_fx.addons.bounds.error_bound import Bounded
from signorini_fx.addons.bounds.simplices import EDGES_OF_FACET
from signorini_fx.addons.bounds.stress_products import energy

FLAT = {"shape": "plane", "point": [0.8, 0.002], "normal": [0.01, 1.0]}
CASES = [
    (block(CIRCLE), error_bounds),
    (block(FLAT, degree=2), error_bounds),
    (in_space(SPHERE), error_bounds_in_space),
    (in_space({"shape": "plane", "point": [0.4, 0.6, 0.002], "normal": [0.01, 0.0, 1.0]}), error_bounds_in_space),
]


@pytest.fixture(scope="module", params=CASES, ids=["circle", "plane", "sphere", "plane in space"])
def case(request):
    scene, study = request.param
    return study.problem(alone(scene))


def drawn(case):
    """A displacement at all vertices, bent along the edges of the contact alone; all of it as unknowns in a row."""
    chance, t = np.random.default_rng(0), case.t
    edges = np.unique(t.edges_of_facets[case.contacts[0].facets])
    y, bubbles = chance.normal(size=t.x.shape), np.zeros((len(t.edges), t.dimension))
    bubbles[edges] = chance.normal(size=(len(edges), t.dimension))
    middle = y[t.edges].mean(axis=1) + bubbles
    return edges, y, middle, np.concatenate((y, bubbles[edges])).ravel()


def test_energy_of_bubbles(case):
    """As ``energy`` has it."""
    edges, y, middle, flat = drawn(case)
    found = flat @ module._with_bubbles(case.t, edges) @ flat
    assert found == pytest.approx(energy(case.t, case.t.strain_at_corners(y, middle)).sum(), rel=1e-12)


def test_what_enters_and_the_work_of_pressures(case):
    """As the proof has them, of any displacement."""
    edges, y, middle, flat = drawn(case)
    surface = case.contacts[0]
    coefficients = module._coefficients(case.t, surface, edges) @ flat
    expected = case.on_facets(y, middle, surface.facets)
    np.testing.assert_allclose(coefficients, expected.ravel(), atol=1e-12)
    still = surface.excess(np.zeros_like(expected))
    entered = module._directions_of(surface) @ coefficients
    np.testing.assert_allclose(entered, (surface.excess(expected) - still).ravel(), atol=1e-12)
    far = replace(surface, bound=0 * surface.bound, gap=surface.gap + 1e3)  # so that nothing is cut off at zero
    y, middle = 1e-3 * y, 1e-3 * middle
    without = case._on_contact(far, 0 * y, 0 * middle).sum()
    with_it = case._on_contact(far, y, middle).sum()
    work = module._work(case.t, surface) @ (1e-3 * coefficients)
    assert without - with_it == pytest.approx(work, rel=1e-6, abs=1e-9 * without)


def test_it_is_nearly_the_least(case):
    """What is left inside is little, no random change away from the foundation adds less, and to move vertices one by
    one adds more.
    """
    t, surface = case.t, case.contacts[0]
    removed, bubbles = case._withdrawn()
    excess = surface.excess(case.on_facets(case.y, case.middle, surface.facets))
    computed = t.strain_at_corners(case.y, case.middle)

    def adds(y, middle):
        return case._beside((y, middle), computed).squares.sum()

    y, middle = case.y - removed, case.middle - removed[t.edges].mean(axis=1) - bubbles
    left = surface.excess(case.on_facets(y, middle, surface.facets))
    assert left.max() < 0.05 * excess.max()
    hats = case._beside(case._admissible(np.zeros_like(case.y)), computed)
    found = case._beside(case._admissible(removed, bubbles), computed)
    assert found.squares.sum() < 1.05 * hats.squares.sum()
    chance, towards = np.random.default_rng(1), surface.directions[:, 0]
    free = case._loose(t.facets, len(t.x), case.held)
    size = np.abs(removed).max()
    for _ in range(20):
        change = np.zeros_like(y)
        facet = chance.integers(len(surface.facets))
        change[t.facets[surface.facets[facet]]] = -chance.uniform(0, 0.3) * size * towards[facet]
        change = np.einsum("vij,vj->vi", free, change)
        assert adds(y + change, middle + change[t.edges].mean(axis=1)) > 0.97 * adds(y, middle)


def test_supports_stay(case):
    """Nothing is taken away where the body is held."""
    removed, bubbles = case._withdrawn()
    t = case.t
    held = np.einsum("fij,fcj->fci", case.held, removed[t.facets])
    assert np.abs(held).max() <= 1e-12 * np.abs(removed).max()
    edges = np.einsum("fij,fkj->fki", case.held, bubbles[t.edges_of_facets])
    assert np.abs(edges).max() <= 1e-12 * np.abs(removed).max()
    assert len(EDGES_OF_FACET[t.dimension]) == edges.shape[1]


@pytest.mark.parametrize("seed", [5, 10])
def test_the_best_share_of_the_tractions(seed):
    """Of all shares that are tried it has the least sum of both parts of the gap, and its stress is theirs."""
    case = error_bounds_in_space.problem(alone(on_shape(error_bounds_in_space.drawn(seed), seed)))
    t, surface = case.t, case.contacts[0]
    computed = t.strain_at_corners(case.y, case.middle)
    case._balance()
    stress, full = case._stress(), surface.pressure
    v = case._outside(computed, float(case._between(computed, stress).sum()))
    assert case._may_press_less

    def gap(share):
        surface.pressure = share * full
        return case._between(computed, case._stress()).sum() + case._beside((v.y, v.middle), computed).contact.sum()

    shares = np.linspace(0, 1, 9)
    gaps = [gap(share) for share in shares]
    surface.pressure = full
    share, mixed, less = case._pressing_less(computed, stress, v)
    found = case._between(computed, mixed).sum() + less.contact.sum()
    assert found == pytest.approx(gap(share), rel=1e-6)
    assert found <= min(gaps) * (1 + 1e-9)
    assert found < 0.95 * gaps[-1]
    assert 0 <= share < 1


def bound_of(seed):
    scene = on_shape(error_bounds_in_space.drawn(seed), seed)
    solution = alone(scene)
    bound = Bounded(solution.model, solution.displacement, solution.contact, 0.0).bound()
    return bound.error / bound.size


@pytest.mark.one_quick
@pytest.mark.parametrize(("seed", "before", "now"), [(3, 10.3, 4.5), (11, 5.1, 2.5)])
def test_foundations_enter_facets_between_their_nodes(seed, before, now, monkeypatch):
    """Bound over the energy norm: vertices and edges that are moved one by one have several times as much."""
    found = bound_of(seed)
    assert found < now
    monkeypatch.setattr(error_bound.Bounded, "_withdrawn", lambda self: None)
    assert bound_of(seed) > 0.9 * before


@pytest.mark.one_quick
@pytest.mark.parametrize("seed", [0, 19])
def test_a_pressure_of_a_single_node_is_not_that_of_its_facets(seed, monkeypatch):
    """A body that supports hold is in equilibrium with less of it: the bound is no longer many times the solution."""
    assert bound_of(seed) < 1.3
    monkeypatch.setattr(error_bound.Bounded, "_may_press_less", False)
    assert bound_of(seed) > 10


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "largest"), [(0, 1.3), (3, 4.0), (11, 2.0), (19, 2.0)])
def test_true_errors_of_the_tail(seed, largest):
    """The bound was 60, 8.2, 3.4 and more times the true error."""
    found = effectivity(3, seed)
    assert not isinstance(found, str), found
    assert 1 < found[0] < largest
