"""Guaranteed bounds of errors and contact forces: what they hold, and what has none."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bounds_under_references import KINDS, drawn, energy_of_difference, judged, on_finer_mesh
from dolfinx import fem
from plain_problems import problem
from scenes import alone, example1

from signorini_fx.addons.bounds.bounded_scene import BOUNDED
from signorini_fx.addons.bounds.error_bound import error_bound, why_unbounded
from signorini_fx.errors import SceneError
from signorini_fx.mechanics.effects.displacement import PrescribedDisplacement
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.results.files import write_results
from signorini_fx.results.summary import lines_of
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.solving import to_accuracy

SEEDS = [(kind, seed) for kind, seeds in zip(KINDS, [(0, 14), (3, 5), (1, 8), (2, 11)], strict=True) for seed in seeds]
SQUARE = {"generator": "rectangle", "parameters": {"length": 1.0, "height": 1.0, "nx": 4, "ny": 4, "cell": "triangle"}}


def square(**more):
    """A block on a foundation, pressed by its top."""
    scene = {
        "mesh": SQUARE,
        "material": {"young": 1000.0, "poisson": 0.3},
        "displacement": {"boundary": "top", "x": 0.0, "y": -0.01},
        "contact": {"boundary": "bottom"},
    }
    return parse_scene(scene | more)


@pytest.mark.parametrize(("kind", "seed"), SEEDS)
def test_true_errors(kind, seed):
    """Solutions on finer meshes refute neither the bounds of the error and the energy nor that of the force."""
    found = judged(drawn(kind, seed))
    assert not isinstance(found, str), found
    ratio, _, wrong, _ = found
    assert 1 < ratio < 5
    assert not wrong


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_true_errors_of_many(kind):
    """The same of others."""
    found = [judged(drawn(kind, seed)) for seed in range(100, 115)]
    bounded = [one for one in found if not isinstance(one, str)]
    assert len(bounded) > 12
    assert not [wrong for _, _, wrong, _ in bounded if wrong]
    assert np.median([ratio for ratio, *_ in bounded]) < 3


@pytest.mark.parametrize(("kind", "seed"), SEEDS[::2])
def test_displacements_and_pressures_that_are_wrong(kind, seed):
    """Whatever is computed, the bound is above the distance from the solution, and not by orders of magnitude."""
    solution, chance = alone(drawn(kind, seed)), np.random.default_rng(seed)
    reference, wrong = on_finer_mesh(drawn(kind, seed)), solution.displacement.copy()
    values = wrong.x.array.reshape(-1, solution.model.dimension)
    tagged, space = solution.model.tagged, solution.displacement.function_space
    supports = np.concatenate([tagged.facets(entry.boundary) for entry in solution.statement.displacement])
    loose = np.setdiff1d(np.arange(len(values)), fem.locate_dofs_topological(space, tagged.dimension - 1, supports))
    values[loose] += chance.normal(size=(len(loose), values.shape[1])) * np.abs(values).max() * 1e-2
    pressure = solution.contact.pressure * chance.uniform(0.5, 1.5, solution.contact.pressure.size)
    contact = replace(solution.contact, pressure=pressure)
    bound = error_bound(solution.model, wrong, contact)
    assert not isinstance(bound, str), bound
    true = energy_of_difference(SimpleNamespace(model=solution.model, displacement=wrong), reference)
    assert true < bound.error < 100 * true


@pytest.mark.parametrize(("kind", "seed"), [("two bodies: plane", 5), ("two bodies: space", 2)])
def test_both_sides_have_the_same_tractions(kind, seed):
    """Facets do not match: resultants of the tractions of both sides are opposite, and what is left is lifted."""
    case = problem(alone(drawn(kind, seed)))
    (surface,) = case.contacts
    parts, forces = surface.parts, []
    assert not parts.by_facets
    for side in parts.sides:
        closest, share = parts.projected(surface.traction, side, case.t.area)
        forces.append(np.einsum("f,fad->d", case.t.area[parts.facets[side]], closest))
        assert share.max() > 1e-6
    assert forces[0] == pytest.approx(forces[1], rel=1e-9, abs=1e-12 * np.abs(forces[0]).max())
    assert case.lifted.max() > 0
    whole = case.bound().error
    case.lifted = np.zeros_like(case.lifted)
    assert case.bound().error < whole


@pytest.mark.parametrize(("kind", "seed"), SEEDS)
def test_the_stress_is_in_equilibrium(kind, seed):
    """Without contact tractions and lifted parts its work on any displacement is that of loads and contact: it is the
    sum over the cells of the work of their forces on linear displacements that supports let be."""
    case, chance = problem(alone(drawn(kind, seed))), np.random.default_rng(1)
    t, stress = case.t, case.stress.stress
    y = chance.normal(size=t.x.shape)
    held = np.zeros((len(t.x), t.dimension, t.dimension))
    for column in t.facets[t.outer].T:
        np.add.at(held, column, case.held[t.outer])
    sizes, vectors = np.linalg.eigh(held)
    y = np.einsum("nik,nk,njk,nj->ni", vectors, sizes < 1e-9, vectors, y)
    strain = t.strain_at_corners(y, y[t.edges].mean(axis=1))[:, 0]
    twice = np.where(np.arange(strain.shape[1]) < t.dimension, 1.0, 2.0)
    inside = float(t.volume @ (stress.mean(axis=(1, 2)) * strain * twice).sum(axis=1))
    acting = case.work(y)
    for surface in case.contacts:
        for side, sign in zip(surface.parts.sides, (1.0, -1.0), strict=False):
            closest, _ = surface.parts.projected(surface.traction, side, t.area)
            facets = surface.parts.facets[side]
            means = y[t.facets[facets]]
            sums = closest.sum(axis=1, keepdims=True) + closest
            unit = t.area[facets] / (t.dimension * (t.dimension + 1))
            acting += sign * float(np.einsum("f,fad,fad->", unit, sums, means))
    sizes = float(t.volume @ (np.abs(stress).mean(axis=(1, 2)) * np.abs(strain)).sum(axis=1))
    assert inside == pytest.approx(acting, abs=1e-9 * sizes)


def test_what_is_admissible():
    """V keeps to supports and contact, pressures are not negative, shears are within their bound."""
    for kind, seed in SEEDS:
        case = problem(alone(drawn(kind, seed)))
        for surface in case.contacts:
            assert surface.pressure.min() >= 0
            assert (np.linalg.norm(surface.shear, axis=2) <= surface.bound).all()
        assert case.admissible.contact.min() >= 0
        assert case.admissible.moved.min() >= 0


@pytest.mark.parametrize("degree", [1, 2])
def test_units(degree):
    """Other units of length and stress change no share."""
    first = example1(bound=1.5, nx=12, ny=4, cell="triangle", degree=degree)
    second = example1(bound=1.5, nx=12, ny=4, cell="triangle", degree=degree, length_unit=1e3, stress_unit=1e-6)
    ours, theirs = alone(first).error_bound, alone(second).error_bound
    assert ours.relative == pytest.approx(theirs.relative, rel=1e-6)


def test_a_body_beside_another_one():
    """Squares of the bounds of both add up."""
    blocks = {name: {"name": name, "mesh": SQUARE, "shift": [2.0 * k, 0.0]} for k, name in enumerate("ab")}

    def of(names):
        held = [{"boundary": f"{name}.top", "x": 1e-3 * k, "y": -0.01} for k, name in enumerate(names)]
        contact = [{"boundary": f"{name}.bottom"} for name in names]
        return square(body=[blocks[name] for name in names], mesh=None, displacement=held, contact=contact)

    first = of("ab")
    both, *each = (alone(scene).error_bound for scene in (first, of("a"), of("b")))
    assert both.error > each[0].error
    assert both.error < 1.2 * np.hypot(*(one.error for one in each))


def test_a_force_that_statics_determines():
    """Both of its bounds are that of the loads."""
    loads = [{"boundary": "top", "y": "-1 - x[0]"}]
    found = alone(square(displacement={"boundary": "left", "x": 0.0}, traction=loads)).force_bounds(
        "bottom", (0.0, 1.0)
    )
    assert tuple(found) == pytest.approx((1.5, 1.5), rel=1e-9)
    assert found[0] <= 1.5 <= found[1]


def test_where_a_force_has_no_bounds():
    """At supports."""
    assert "at contacts" in alone(square()).force_bounds("top", (0.0, 1.0))


def test_what_has_no_bound():
    """One sentence names all that the scene has of it, and the target that is to be certified is refused before."""
    quadrilaterals = {**SQUARE, "parameters": {**SQUARE["parameters"], "cell": "quadrilateral"}}
    circle = {"shape": "circle", "centre": [0.5, -1.0], "radius": 1.0}
    for name, change in {
        "quadrilateral cells": {"mesh": quadrilaterals},
        "a gap of 'bottom' that is no polynomial of degree 2": {"contact": {"boundary": "bottom", "gap": "x[0]**3"}},
        "bilateral contact": {"contact": {"boundary": "bottom", "kind": "bilateral"}},
        "a foundation that is no plane at rest": {"contact": {"boundary": "bottom", "foundation": circle}},
        "coulomb friction": {
            "contact": {"boundary": "bottom", "friction": {"law": "coulomb", "coefficient": 0.2}},
        },
        "a traction that is not linear": {"traction": {"boundary": "right", "x": "x[1]**2"}},
        "a traction that jumps or has a kink between nodes": {
            "traction": {"boundary": "right", "x": "abs(x[1] - 0.3)"}
        },
        "springs": {"springs": {"boundary": "right", "normal": 10.0}},
        "temperature": {"temperature": {"change": 10.0}, "material": {"young": 1e3, "poisson": 0.3, "expansion": 1e-5}},
        "moduli or axes that vary": {"material": {"young": 1000.0, "poisson": 0.3, "grading": "1 - x[0]/2"}},
        "the mixed element": {"element": {"degree": 2, "volumetric": "mixed"}},
        "axisymmetric": {
            "material": {"young": 1000.0, "poisson": 0.3, "hypothesis": "axisymmetric"},
            "displacement": {"boundary": "top", "y": -0.01},
        },
    }.items():
        solution = alone(square(**change))
        assert solution.error_bound.startswith(BOUNDED), name
        assert name in solution.error_bound
        assert name in solution.force_bounds("bottom", (0.0, 1.0))
        if "between nodes" not in name:
            assert name in why_unbounded(solution.model)
    asked = square(contact={"boundary": "bottom", "kind": "bilateral"}, accuracy={"target": 0.1, "certified": True})
    with pytest.raises(SceneError, match="bilateral contact"):
        alone(asked)


def test_a_support_of_a_point():
    """It has no bound, and neither have supports that contradict each other at a corner."""
    scene = square()
    pinned = scene.model_copy(
        update={"displacement": (*scene.displacement, PrescribedDisplacement(at=(0.0, 0.0), x=0.0))}
    )
    assert "a support of a point" in alone(pinned).error_bound
    corner = square(displacement=[{"boundary": "top", "x": 0.0, "y": -0.01}, {"boundary": "left", "x": 1e-3}])
    assert "different displacements" in alone(corner, check=False).error_bound


def test_planes():
    """A plane as a foundation is what a gap and a direction say."""
    leaning = {"shape": "plane", "point": [0.0, 0.005], "normal": [-0.01, 1.0]}
    ours = alone(square(contact={"boundary": "bottom", "foundation": leaning})).error_bound
    size = np.hypot(0.01, 1.0)
    said = {"boundary": "bottom", "gap": f"(x[1] - 0.005 - 0.01*x[0]) / {size}", "direction": [0.01, -1.0]}
    theirs = alone(square(contact=said)).error_bound
    assert ours.error == pytest.approx(theirs.error, rel=1e-6)


def test_an_accuracy_that_is_certified():
    """The bound meets the target on a mesh whose cells it has chosen."""
    scene = square(accuracy={"target": 0.08, "certified": True})
    solution = alone(scene)
    assert solution.error_bound.relative <= 0.08
    assert len(solution.levels) > 1


def test_the_summary(tmp_path):
    """Its figures, and the sentence."""
    scene = square(solver={"error_bound": True})
    summary = write_results(alone(scene), tmp_path / "results", pictures=False)
    told = summary["error_bound"]
    assert told["guaranteed"]
    assert told["error"] <= told["duality"] + told["moved"] + told["round_off"]
    assert told["statement"].startswith("at most")


@pytest.mark.parametrize("name", ["error_bound", "safety"])
def test_a_statement_that_fails_costs_no_result(tmp_path, monkeypatch, name):
    """The results are written, with a warning that names it."""
    solution = alone(square(solver={"error_bound": True}))

    def fails(self):
        raise ArithmeticError("a factorisation broke down")

    monkeypatch.setattr(type(solution), name, property(fails))
    summary = write_results(solution, tmp_path / "results", pictures=False)
    warned = [found for found in summary["findings"] if "a factorisation broke down" in found["message"]]
    assert [found["path"] for found in warned] == [name]
    assert summary["converged"]
    assert (tmp_path / "results" / "contact.csv").is_file()
    assert "a factorisation broke down" in "\n".join(map(str, lines_of(summary)))


@pytest.mark.parametrize("seed", [0, 1])
def test_the_regularisation_counts_once(monkeypatch, seed):
    """The bound holds it already: what exceeds the target by a part of it is too much, what just meets it is enough."""
    chance, met = np.random.default_rng(seed), seed == 0
    scene = example1(bound=1.5, nx=9, ny=3, cell="triangle", gamma=float(10 ** chance.uniform(4, 4.3)))
    target, bounds = float(chance.uniform(0.6, 0.8)), []

    def bounded(solved, **_):
        left = solved.level.regularisation
        beyond = -1e-9 if met or bounds else float(chance.uniform(0.2, 0.8)) * left
        bounds.append(target + beyond)
        assert left > 0.1 * target
        return solved, bounds[-1], ""

    monkeypatch.setattr(to_accuracy, "_certified", bounded)
    asked = alone(scene.model_copy(update={"accuracy": Accuracy(target=target, certified=True)}))
    assert len(bounds) == len(asked.levels) == 2 - met
    assert bounds[-1] < target
