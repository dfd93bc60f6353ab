"""Round-off in bounds of forces: forces that statics determines in whole numbers, and what each allowance is for."""

from fractions import Fraction

import numpy as np
import pytest
from scenes import alone

from signorini_fx.addons.bounds import quantity_bounds
from signorini_fx.addons.bounds.round_off import of_boundary_values, of_strains, of_sum
from signorini_fx.addons.bounds.simplices import EDGES, IsotropicModuli, Simplices
from signorini_fx.addons.bounds.stress_products import energy
from signorini_fx.scenes.reading import parse_scene

GRADED = {"grading": "1 - 0.1*x[0] - 0.1*x[0]**2"}


def pushed_from_both_sides(seed, **more):
    """A block on another one, which contact alone holds; loads from the left and the right nearly cancel.

    Args:
        seed: of the draw.
        more: of the materials; with an expansion the blocks are heated.

    Returns:
        The scene, and the force on the upper block along x and y per area of its sides and of its top.
    """
    chance = np.random.default_rng(seed)
    left = float(chance.uniform(0.5, 1))
    right = -left + float(chance.choice([0.0, 1e-9])) * float(chance.normal())
    width, height = (float(length) for length in chance.uniform(0.5, 2, 2))

    def mesh(height, ny):
        shape = {"length": width, "height": height, "nx": int(chance.integers(2, 8)), "ny": ny, "cell": "triangle"}
        return {"generator": "rectangle", "parameters": shape}

    scene = {
        "element": {"degree": int(chance.choice([1, 2]))},
        "body": [
            {"name": "up", "mesh": mesh(height, int(chance.integers(2, 12))), "shift": [0.0, 1.0]},
            {"name": "low", "mesh": mesh(1.0, 3)},
        ],
        "material": [{"region": name, "young": 1000.0, "poisson": 0.3} | more for name in ("up", "low")],
        "displacement": [{"boundary": "low.bottom", "x": 0.0, "y": 0.0}],
        "traction": [
            {"boundary": "up.left", "x": left},
            {"boundary": "up.right", "x": right},
            {"boundary": "up.top", "y": -3.0},
        ],
        "contact": {
            "boundary": "up.bottom",
            "against": "low.top",
            "friction": {"law": "tresca", "bound": 10.0},
        },
    }
    if "expansion" in more:
        scene["temperature"] = [{"change": "40*x[0]"}]
    return parse_scene(scene), (-(Fraction(left) + Fraction(right)), Fraction(3))


def force_of_statics(solution, per_area, direction):
    """The force on the upper block along a direction, without round-off, from the numbers of the mesh."""
    x = solution.model.tagged.mesh.geometry.x
    height = Fraction(float(x[:, 1].max())) - 1
    width = Fraction(float(x[:, 0].max())) - Fraction(float(x[:, 0].min()))
    areas = height, width
    return sum(Fraction(c) * force * area for c, force, area in zip(direction, per_area, areas, strict=True))


@pytest.mark.parametrize(
    ("seed", "more"),
    [
        (0, {}),
        (1, {}),
        (2, GRADED),
        *(pytest.param(seed, {}, marks=pytest.mark.slow) for seed in range(2, 10)),
        *(pytest.param(seed, GRADED | {"expansion": 1e-5}, marks=pytest.mark.slow) for seed in range(3)),
    ],
)
def test_a_force_that_statics_determines(seed, more):
    """Its interval holds it to the last digit, also where it is zero or 1e-9 of the loads, and is not wider than it
    takes."""
    scene, per_area = pushed_from_both_sides(seed, **more)
    solution = alone(scene)
    for direction in ((1.0, 0.0), (0.0, 1.0), (0.6, 0.8)):
        low, high = solution.force_bounds("up.bottom", direction)
        assert Fraction(low) <= force_of_statics(solution, per_area, direction) <= Fraction(high)
        assert high - low < 1e-9


@pytest.mark.parametrize("allowed", [True, False])
def test_what_sums_lose(monkeypatch, allowed):
    """The dual displacement is a translation without any strain, as prescribed, so that nothing but the work of loads
    is summed up: without the round-off of this some intervals exclude their force."""
    original = quantity_bounds.smallest_energy
    monkeypatch.setattr(
        quantity_bounds, "smallest_energy", lambda *given, **more: (original(*given, **more)[0].round(9), 0.0)
    )
    monkeypatch.setattr(quantity_bounds, "of_boundary_values", lambda *given: 0.0)
    monkeypatch.setattr(quantity_bounds, "ROUND_OFF", 0.0)
    if not allowed:
        monkeypatch.setattr(quantity_bounds, "of_sum", lambda count: 0.0)
    held = []
    for seed in range(2):
        scene, per_area = pushed_from_both_sides(seed)
        solution = alone(scene)
        for direction in ((1.0, 0.0), (0.0, 1.0)):
            low, high = solution.force_bounds("up.bottom", direction)
            held.append(Fraction(low) <= force_of_statics(solution, per_area, direction) <= Fraction(high))
    assert all(held) == allowed


@pytest.mark.parametrize("counted", [True, False])
def test_boundary_values_that_are_missed(monkeypatch, counted):
    """A dual displacement that is a little longer than what is prescribed on the contact: forces do work on the
    difference."""
    scene, per_area = pushed_from_both_sides(2)
    solution, original, longer = alone(scene), quantity_bounds.smallest_energy, 5e-10

    def disturbed(*given, **more):
        z, missed = original(*given, **more)
        return (1 + longer) * z, longer if counted else missed

    monkeypatch.setattr(quantity_bounds, "smallest_energy", disturbed)
    low, high = solution.force_bounds("up.bottom", (0.0, 1.0))
    exact = force_of_statics(solution, per_area, (0.0, 1.0))
    assert (Fraction(low) <= exact <= Fraction(high)) == counted
    assert high - low < 1e-5


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(3))
def test_what_strains_lose(d, seed):
    """Strains of thin cells that have moved far, against fractions; the bound is not far above what is lost."""
    chance = np.random.default_rng([seed, d])
    x = np.concatenate((np.zeros((1, d)), np.eye(d))) @ np.diag([1.0, 10 ** chance.uniform(-2, 0), 1.0][:d])
    x = 10 ** chance.uniform(-3, 3) * (x + 0.05 * chance.normal(size=x.shape) * np.abs(x).max(axis=0))
    corners = np.arange(d + 1)[None]
    t = Simplices(x, corners, IsotropicModuli(np.full(1, 1.3), np.full(1, 0.7), d))
    if np.linalg.det(t.jacobian[0]) < 0:
        t = Simplices(x, corners[:, [1, 0, *range(2, d + 1)]], t.moduli)
    y = 1e3 + chance.normal(size=x.shape)
    middle = y[t.edges].mean(axis=1) + 0.3 * chance.normal(size=(len(t.edges), d))
    exact = exact_strain(t, y, middle)
    lost = float(np.sqrt(energy(t, t.strain_at_corners(y, middle) - exact).sum()))
    bound = float(np.sqrt(of_strains(t, y, middle).sum()))
    size = float(np.sqrt(energy(t, exact).sum()))
    assert lost <= bound
    assert bound < 1e-9 * size


def exact_strain(t, y, middle):
    """Of one cell at its corners, by fractions."""
    d, whole = t.dimension, np.vectorize(Fraction, otypes=[object])
    corners = t.corners[0]
    x, at, between = whole(t.x[corners]), whole(y[corners]), whole(middle[t.edges_of[0]])
    matrix = [list(row) + [Fraction(int(i == k)) for k in range(d)] for i, row in enumerate((x[1:] - x[0]).T)]
    for k in range(d):  # Gauss and Jordan
        pivot = max(range(k, d), key=lambda row: abs(matrix[row][k]))
        matrix[k], matrix[pivot] = matrix[pivot], matrix[k]
        matrix[k] = [value / matrix[k][k] for value in matrix[k]]
        for row in range(d):
            if row != k:
                matrix[row] = [a - matrix[row][k] * b for a, b in zip(matrix[row], matrix[k], strict=True)]
    inverse = np.array([row[d:] for row in matrix], dtype=object)
    gradients = np.concatenate((-inverse.sum(axis=0, keepdims=True), inverse))
    slope = [sum(np.outer(at[c], gradients[c]) for c in range(d + 1)) for _ in range(d + 1)]
    for k, (a, b) in enumerate(EDGES[d]):
        bubble = 4 * (between[k] - (at[a] + at[b]) / 2)
        slope[a] = slope[a] + np.outer(bubble, gradients[b])
        slope[b] = slope[b] + np.outer(bubble, gradients[a])
    pairs = [(0, 0), (1, 1), (0, 1)] if d == 2 else [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]
    rows = [[(corner[i, j] + corner[j, i]) / 2 for i, j in pairs] for corner in slope]
    return np.array([[[float(value) for value in row] for row in rows]])


def test_boundary_values_in_energy():
    """Random displacements of the vertices of an edge of a grid, zero at the others."""
    chance = np.random.default_rng(5)
    s = np.linspace(0, 1, 5)
    x = np.array([(a, b) for b in s for a in s])
    first = (np.arange(4)[:, None] * 5 + np.arange(4)).ravel()
    halves = np.column_stack((first, first + 1, first + 6)), np.column_stack((first, first + 6, first + 5))
    corners = np.concatenate(halves)
    t = Simplices(x, corners, IsotropicModuli(np.full(32, 1.3), np.full(32, 0.7), 2))
    low, bound = np.flatnonzero(x[:, 1] < 1e-12), of_boundary_values(t, np.flatnonzero(x[:, 1] < 1e-12), 0.2)
    reached = []
    for _ in range(200):
        y, turn = np.zeros_like(x), chance.uniform(0, 2 * np.pi, len(low))
        y[low] = 0.2 * np.column_stack((np.cos(turn), np.sin(turn)))
        reached.append(np.sqrt(energy(t, t.strain_at_corners(y, y[t.edges].mean(axis=1))).sum()))
    assert 0.2 * bound < max(reached) <= bound


def test_sums():
    """Of numbers that cancel, one after the other."""
    chance = np.random.default_rng(1)
    for _ in range(20):
        terms = chance.normal(size=2000) * 10 ** chance.uniform(0, 8, 2000)
        total = 0.0
        for term in np.concatenate((terms, -terms[chance.permutation(2000)])):
            total += term
        assert abs(total) <= of_sum(4000) * 2 * np.abs(terms).sum()
    assert of_sum(4000) < 1e-12
