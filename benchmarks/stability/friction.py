"""Friction: coefficients of every size, bounds that vanish or jump, several solutions, no contraction."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, partial
from typing import Any

import numpy as np

from benchmarks.stability.case import CONVERGED, Case, Finding
from benchmarks.stability.measure import REGULARISED, apart, difference, found, solved, solved_from
from benchmarks.stability.scenes import example1
from benchmarks.stability.shapes import triangle
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.records import Status
from signorini_fx.results.solution import Solution
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene

_OTHER = "the other of fp and newton"
COEFFICIENTS = (0.0, 1e-9, 1e-3, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0, 1e3, 1e6)
# Bounds and coefficients that are zero in places, or jump.
BOUNDS: dict[str, dict[str, Any]] = {
    "bound zero on the left half": {"law": "tresca", "bound": "0 if x[0] < 1.5 else 1.5"},
    "bound zero but for the middle": {"law": "tresca", "bound": "1.5 if 1.4 <= x[0] <= 1.6 else 0"},
    "bound jumps by 1e6": {"law": "tresca", "bound": "1e3 if x[0] < 1.5 else 1e-3"},
    "bound alternates": {"law": "tresca", "bound": "3 if sin(20*x[0]) > 0 else 0.1"},
    "bound 1e9": {"law": "tresca", "bound": 1e9},
    "bound 1e-9": {"law": "tresca", "bound": 1e-9},
    "coefficient zero on the left half": {"law": "coulomb", "coefficient": "0 if x[0] < 1.5 else 0.3"},
    "coefficient jumps": {"law": "coulomb", "coefficient": "1 if x[0] < 1.4 else 0.05"},
    "coefficient alternates": {"law": "coulomb", "coefficient": "0.6 if sin(20*x[0]) > 0 else 0.02"},
    "cap below most": {"law": "coulomb", "coefficient": 0.3, "cap": 0.5},
    "cap zero on the left half": {"law": "coulomb", "coefficient": 0.3, "cap": "0 if x[0] < 1.5 else 2"},
}


def cases(*, short: bool) -> Iterator[Case]:
    """Coefficients, bounds, the triangle with three solutions, large friction."""
    for coefficient in (0.3, 1e6) if short else COEFFICIENTS:
        for way in ("fp",) if short else ("fp", "newton"):
            name = f"F = {coefficient:g}, {way}"
            yield Case(name, partial(_coefficient, coefficient, way), target=1e-6, reference=_OTHER)
    for name, law in BOUNDS.items():
        if not short or name == "coefficient jumps":
            yield Case(name, partial(_bound, law), target=REGULARISED, reference="unregularised limit")
    for state in STATES:
        name = f"triangle, F = 3, start: {state}"
        yield Case(name, partial(_triangle, state), target=1e-12, reference="closed form")
    for load in (1.0, -1.0):
        yield Case(
            f"triangle, F = 1, load {load:+g}, all starts",
            partial(_unique, load),
            target=1e-12,
            reference="one another",
        )
    yield Case("triangle, warning above the critical F", _warned, target=0.0, reference="at F = 3, not at 0.1")
    for state in STATES:
        yield Case(
            f"triangle, F = 3, fp from {state}", partial(_triangle_fp, state), target=1e-3, reference="one of the three"
        )
    for coefficient in (1.5,) if short else (0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0):
        for way in ("fp", "newton"):
            for push in (1.0, -1.0):
                yield Case(
                    f"pulled block, F = {coefficient:g}, {way}, {push:+g}",
                    partial(_pulled, coefficient, way, push),
                    allowed=_NO_CONTRACTION,
                    target=REGULARISED,
                    reference="augmented monolithic Newton",
                    note="several solutions are possible here; another start or smaller steps of the load may find one",
                )


_NO_CONTRACTION = (
    Status.OUTER_MAX_ITERATIONS.value,
    Status.CYCLING.value,
    Status.SLIDES_AT_PRESSURES.value,
)


def _coefficient(coefficient: float, way: str) -> Finding:
    return found(
        _example(coefficient, way),
        apart(_example(coefficient, way), _example(coefficient, "newton" if way == "fp" else "fp")),
    )


@cache
def _example(coefficient: float, way: str) -> Solution:
    law = {"law": "coulomb", "coefficient": coefficient}
    return solved(example1(law, coulomb=way, tolerance=1e-10))


def _bound(law: dict[str, Any]) -> Finding:
    ours, limit = solved(example1(law)), solved(example1(law, algorithm="alm", tolerance=1e-12))
    return found(ours, apart(ours, limit))


# The triangle of Hassani, Hild, Ionescu and Sakki: K_A = [[3, -sqrt 3], [-sqrt 3, 5]], nodal force (2.5, -1).
STIFFNESS = np.array([[3.0, -np.sqrt(3.0)], [-np.sqrt(3.0), 5.0]])
FORCE = np.array([2.5, -1.0])
_SLIP = (FORCE[0] + 3.0 * FORCE[1]) / (3.0 - 3.0 * np.sqrt(3.0))
# Displacement of the free node in each of the three states at F = 3.
STATES = {
    "stick": np.zeros(2),
    "slip": np.array([_SLIP, 0.0]),
    "separated": np.linalg.solve(STIFFNESS, FORCE),
}
_SETS = {"stick": (True, 0), "slip": (True, 1), "separated": (False, 1)}


def _scene(coefficient: float, load: float = 1.0, **settings: Any) -> dict[str, Any]:
    corners = [(0.0, 0.0), (1.0, 0.0), (1.0 + np.sqrt(3.0), 1.0)]
    return {
        "mesh": triangle(corners, {"contact": (0, 1), "support": (1, 2)}),
        "material": {"young": 2.5, "poisson": 0.25},
        "displacement": {"boundary": "support", "x": 0.0, "y": 0.0},
        "body_force": {"x": 15.0 * load, "y": -6.0},
        "contact": {"boundary": "contact", "friction": {"law": "coulomb", "coefficient": coefficient}},
        # The three states of the problem are known as numbers, not as displacements of a body.
        "solver": {"largest_deformation": 10.0, **settings},
    }


def _from(state: str, coefficient: float, load: float = 1.0, **settings: Any) -> Solution:
    def sets(boundary: ContactBoundary) -> ActiveSets:
        contact, slip = _SETS[state]
        return ActiveSets.of(np.full(boundary.size, contact), np.full((boundary.size, 1), float(slip)))

    def start(boundary: ContactBoundary) -> tuple[Nodal, Nodal]:
        reaction = STIFFNESS @ STATES[state] - FORCE
        free = boundary.free.all(axis=1) / boundary.weight
        return reaction[1] * free, -reaction[0] * free

    return solved_from(_scene(coefficient, load, **settings), sets, start)


def _free_node(solution: Solution) -> np.ndarray:
    """Displacement of A."""
    x = solution.model.space.tabulate_dof_coordinates()
    u: np.ndarray = solution.displacement.x.array.reshape(-1, 2)[np.argmin(np.hypot(x[:, 0], x[:, 1]))]
    return u


def _triangle(state: str) -> Finding:
    """The start determines which of the three states is found; augmentation finds each to round-off."""
    solution = _from(state, 3.0, algorithm="alm", coulomb="newton", tolerance=1e-14)
    return found(solution, float(np.abs(_free_node(solution) - STATES[state]).max()))


def _triangle_fp(state: str) -> Finding:
    """The fixed-point iteration diverges from the slip state: it must end at another one and report how."""
    solution = _from(state, 3.0, coulomb="fp")
    node = _free_node(solution)
    nearest = min(STATES, key=lambda name: float(np.abs(node - STATES[name]).max()))
    return found(solution, float(np.abs(node - STATES[nearest]).max()), f"ends at: {nearest}")


def _unique(load: float) -> Finding:
    solutions = [_from(state, 1.0, load, algorithm="alm", coulomb="newton", tolerance=1e-14) for state in STATES]
    nodes = [_free_node(solution) for solution in solutions]
    failed = next((s for s in solutions if not s.converged), solutions[0])
    return found(failed, max(float(np.abs(node - nodes[0]).max()) for node in nodes))


def _warned() -> Finding:
    said = [
        [f.message for f in check_scene(parse_scene(_scene(F))).warnings if "several solutions" in f.message]
        for F in (3.0, 0.1)
    ]
    return Finding(CONVERGED, error=0.0 if said[0] and not said[1] else 1.0, note=(said[0] or ["no warning"])[0])


def _pulled(coefficient: float, way: str, push: float) -> Finding:
    ours, limit = _block(coefficient, way, push), _block(coefficient, "newton", push, "alm")
    if not limit.converged:
        return found(ours, 0.0 if ours.converged else None, f"the limit: {limit.status.value}")
    return found(ours, difference(ours.displacement.x.array, limit.displacement.x.array))


@cache
def _block(coefficient: float, way: str, push: float, algorithm: str = "auto") -> Solution:
    """A slender block, clamped on the right, its left end pressed down and pulled sideways."""
    scene = {
        "mesh": {"generator": "rectangle", "parameters": {"length": 3.0, "height": 1.0, "nx": 60, "ny": 20}},
        "material": {"young": 5000.0, "poisson": 0.3},
        "displacement": {"boundary": "right", "x": 0.0, "y": 0.0},
        "traction": [{"boundary": "top", "y": -20.0}, {"boundary": "left", "x": 60.0 * push}],
        "contact": {"boundary": "bottom", "gap": 1e-4, "friction": {"law": "coulomb", "coefficient": coefficient}},
        "solver": {"coulomb": way, "algorithm": algorithm, "tolerance": 1e-9},
    }
    return solved(scene)
