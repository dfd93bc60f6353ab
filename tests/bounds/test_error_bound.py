"""Guaranteed bounds of errors and contact forces: what they hold, and what has none."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bounds_under_references import KINDS, drawn, energy_of_difference, judged, on_finer_mesh
from dolfinx import fem
from plain_problems import problem
from scene_tables import circle_shape, coulomb_friction, rectangle_mesh
from scenes import alone

from signorini_fx.addons.bounds.bounded_scene import BOUNDED
from signorini_fx.addons.bounds.error_bound import error_bound
from signorini_fx.results.files import write_results
from signorini_fx.scenes.reading import parse_scene

SEEDS = [
    (kind, seed)
    for kind, seeds in zip(KINDS, [(0, 14), (3, 5), (1, 8), (2, 11)], strict=True)
    for seed in seeds
]
SQUARE = rectangle_mesh(4, 4, length=1.0, height=1.0, cell="triangle")


def square(**more):
    """A block on a foundation, pressed by its top."""
    scene = {
        "mesh": SQUARE,
        "material": {"young": 1000.0, "poisson": 0.3},
        "displacement": {"boundary": "top", "x": 0.0, "y": -0.01},
        "contact": {"boundary": "bottom"},
    }
    return parse_scene(scene | more)


@pytest.mark.one_quick(("kind", "seed"), SEEDS)
def test_true_errors(kind, seed):
    """Solutions on finer meshes refute neither the bounds of the error and the energy nor that of
    the force.
    """
    found = judged(drawn(kind, seed))
    assert not isinstance(found, str), found
    ratio, _, wrong, _ = found
    assert 1 < ratio < 5
    assert not wrong


@pytest.mark.one_quick(("kind", "seed"), SEEDS[::2])
def test_displacements_and_pressures_that_are_wrong(kind, seed):
    """Whatever is computed, the bound is above the distance from the solution, and not by orders of
    magnitude.
    """
    solution, chance = alone(drawn(kind, seed)), np.random.default_rng(seed)
    reference, wrong = on_finer_mesh(drawn(kind, seed)), solution.displacement.copy()
    values = wrong.x.array.reshape(-1, solution.model.dimension)
    tagged, space = solution.model.tagged, solution.displacement.function_space
    supports = np.concatenate(
        [tagged.facets(entry.boundary) for entry in solution.statement.displacement]
    )
    loose = np.setdiff1d(
        np.arange(len(values)), fem.locate_dofs_topological(space, tagged.dimension - 1, supports)
    )
    values[loose] += chance.normal(size=(len(loose), values.shape[1])) * np.abs(values).max() * 1e-2
    pressure = solution.contact.pressure * chance.uniform(0.5, 1.5, solution.contact.pressure.size)
    contact = replace(solution.contact, pressure=pressure)
    bound = error_bound(solution.model, wrong, contact)
    assert not isinstance(bound, str), bound
    true = energy_of_difference(
        SimpleNamespace(model=solution.model, displacement=wrong), reference
    )
    assert true < bound.error < 100 * true


@pytest.mark.one_quick(("kind", "seed"), [("two bodies: plane", 5), ("two bodies: space", 2)])
def test_both_sides_have_the_same_tractions(kind, seed):
    """Facets do not match: resultants of the tractions of both sides are opposite, and what is left
    is lifted.
    """
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


@pytest.mark.one_quick(("kind", "seed"), SEEDS)
def test_the_stress_is_in_equilibrium(kind, seed):
    """Without contact tractions and lifted parts its work on any displacement is that of loads and
    contact: it is the sum over the cells of the work of their forces on linear displacements that
    supports let be."""
    case, chance = problem(alone(drawn(kind, seed))), np.random.default_rng(1)
    t, stress = case.t, case.stress.stress
    y = chance.normal(size=t.x.shape)
    held = np.zeros((len(t.x), t.dimension, t.dimension))
    for column in t.facets[t.outer].T:
        np.add.at(held, column, case.held[t.outer])
    sizes, vectors = np.linalg.eigh(held)
    y = np.einsum("nik,nk,njk,nj->ni", vectors, sizes < 1e-9, vectors, y)
    strain = t.strain_at_corners(t.with_middles(y))[:, 0]
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


def test_what_has_no_bound():
    """One sentence names all that the scene has of it."""
    quadrilaterals = {**SQUARE, "parameters": {**SQUARE["parameters"], "cell": "quadrilateral"}}
    circle = circle_shape([0.5, -1.0], 1.0)
    for name, change in {
        "quadrilateral cells": {"mesh": quadrilaterals},
        "a gap of 'bottom' that is no polynomial of degree 2": {
            "contact": {"boundary": "bottom", "gap": "x[0]**3"}
        },
        "bilateral contact": {"contact": {"boundary": "bottom", "kind": "bilateral"}},
        "a foundation that is no plane at rest": {
            "contact": {"boundary": "bottom", "foundation": circle}
        },
        "coulomb friction": {"contact": {"boundary": "bottom", "friction": coulomb_friction(0.2)}},
        "a traction that is not linear": {"traction": {"boundary": "right", "x": "x[1]**2"}},
        "a traction that jumps or has a kink between nodes": {
            "traction": {"boundary": "right", "x": "abs(x[1] - 0.3)"}
        },
        "springs": {"springs": {"boundary": "right", "normal": 10.0}},
        "temperature": {
            "temperature": {"change": 10.0},
            "material": {"young": 1e3, "poisson": 0.3, "expansion": 1e-5},
        },
        "moduli or axes that vary": {
            "material": {"young": 1000.0, "poisson": 0.3, "grading": "1 - x[0]/2"}
        },
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


def test_the_summary(tmp_path):
    """Its figures, and the sentence."""
    scene = square(solver={"error_bound": True})
    summary = write_results(alone(scene), tmp_path / "results", pictures=False)
    told = summary["error_bound"]
    assert told["guaranteed"]
    assert told["error"] <= told["duality"] + told["moved"] + told["round_off"]
    assert told["statement"].startswith("at most")
