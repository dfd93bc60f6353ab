"""Geometry: rough foundations, bad and tiny meshes, patches, turned scenes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache, partial
from typing import Any

import numpy as np

from benchmarks.stability.case import Case, Finding
from benchmarks.stability.measure import REGULARISED, counts, difference, found, solved, worst
from benchmarks.stability.scenes import LAWS, example1
from benchmarks.stability.shapes import SIDES, Points, grid, stretched, turned
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.results.solution import Solution

GAPS = {
    "kinked": "0.001 + 0.01 * abs(x[0] - 1.2)",
    "V upside down": "0.004 - 0.003 * abs(x[0] - 1.5)",
    "sawtooth, coarse": "0.001 + 0.002 * abs(sin(4 * x[0]))",
    "sawtooth, every other node": "0.001 + 0.0005 * abs(sin(10.471975511965978 * x[0]))",
    "jump": "0.001 if x[0] < 1.37 else 0.002",
    "jump of 1e3": "0.001 if x[0] < 1.37 else 1.0",
    "one node raised": "0.0 if abs(x[0] - 1.5) < 1e-6 else 0.01",
    "two nodes raised": "0.0 if abs(abs(x[0] - 1.5) - 1) < 1e-6 else 0.01",
}
# Cells of an aspect ratio, put into a mesh by moving its lines.
_ASPECTS = (10.0, 1e2, 1e3, 1e4)
ANGLES = (0.1, 0.7, np.pi / 4, 1.2, np.pi / 2, 2.6, np.pi, -1.9)


def cases(*, short: bool) -> Iterator[Case]:
    """Foundations, meshes, tiny bodies, patches, angles."""
    limit = "unregularised limit"
    for law in ("Coulomb",) if short else LAWS:
        for name in ("sawtooth, every other node", "jump") if short else GAPS:
            yield Case(f"gap: {name}, {law}", partial(_gap, law, name), target=1e-3, reference=limit)
        for aspect in (1e4,) if short else _ASPECTS:
            for kind in SLIVERS:
                name = f"{kind}, aspect {aspect:g}, {law}"
                yield Case(name, partial(_sliver, law, kind, aspect), target=1e-2, reference="u_y(1.5, 1), plain mesh")
        for name in ("one Q1", "one P2") if short else TINY:
            yield Case(f"{name}, {law}", partial(_tiny, law, name), target=REGULARISED, reference=limit)
        yield Case(
            f"contact boundary of one facet, {law}", partial(_patches, law, 1), target=REGULARISED, reference=limit
        )
        yield Case(f"three patches, {law}", partial(_patches, law, 3), target=REGULARISED, reference=limit)
        for angle in (0.7,) if short else ANGLES:
            yield Case(
                f"turned by {angle:.3g}, {law}",
                partial(_turned, law, angle),
                target=1e-8,
                reference="not turned, same sets in every solve",
            )
        for grading in (1e4,) if short else (1e2, 1e4, 1e6):
            yield Case(
                f"graded by {grading:g}, {law}",
                partial(_graded, law, grading),
                target=3e-2,
                reference="u_y(1.5, 1), plain mesh",
            )


def _gap(law: str, name: str) -> Finding:
    def scene(**settings: Any) -> dict[str, Any]:
        result = example1(law, **settings)
        result["contact"] = result["contact"] | {"gap": GAPS[name]}
        return result

    return _against_limit(scene)


def _against_limit(scene: Callable[..., dict[str, Any]]) -> Finding:
    """The displacement, against the one without regularisation."""
    ours, limit = solved(scene()), solved(scene(algorithm="alm", tolerance=1e-12))
    note = "" if limit.converged else f"alm: {limit.status.value}"
    return found(ours, difference(ours.displacement.x.array, limit.displacement.x.array), note)


def _thin_row(aspect: float) -> Callable[[Points], Points]:
    """The lowest row of cells becomes flat."""

    def place(x: Points) -> Points:
        x[:, 1] = np.where(np.isclose(x[:, 1], 1 / 20), 3 / 60 / aspect, x[:, 1])
        return x * np.array([3.0, 1.0])

    return place


def _thin_column(aspect: float) -> Callable[[Points], Points]:
    """A column of cells under the load becomes narrow."""

    def place(x: Points) -> Points:
        x[:, 0] = np.where(np.isclose(x[:, 0], 25 / 60), 24 / 60 + 1 / 20 / aspect / 3, x[:, 0])
        return x * np.array([3.0, 1.0])

    return place


def _needles(aspect: float) -> Callable[[Points], Points]:
    """Every other line is moved close to the one below it: needles all over the body."""

    def place(x: Points) -> Points:
        row = np.rint(20 * x[:, 1])
        x[:, 1] = np.where(row % 2 == 1, (row - 1) / 20 + 3 / 60 / aspect, x[:, 1])
        return x * np.array([3.0, 1.0])

    return place


SLIVERS = {"thin row at the contact": _thin_row, "thin column": _thin_column, "needles": _needles}


def _on(law: str, tagged: TaggedMesh, **settings: Any) -> dict[str, Any]:
    return example1(law, **settings) | {"mesh": tagged}


@cache
def _plain(law: str) -> float:
    return _sinking(solved(_on(law, grid(60, 20, stretched(3.0, 1.0)))))


def _sinking(solution: Solution) -> float:
    """u_y at (1.5, 1)."""
    x = solution.model.space.tabulate_dof_coordinates()
    node = np.argmin(np.hypot(x[:, 0] - 1.5, x[:, 1] - 1.0))
    return float(solution.displacement.x.array[2 * node + 1])


def _sliver(law: str, kind: str, aspect: float) -> Finding:
    solution = solved(
        _on(law, grid(60, 20, SLIVERS[kind](aspect), cell="triangle" if kind == "needles" else "quadrilateral"))
    )
    return found(solution, abs(_sinking(solution) / _plain(law) - 1))


def _graded(law: str, grading: float) -> Finding:
    parameters = {"layout": "graded", "grading": grading, "nx": 80, "ny": 40}
    solution = solved(example1(law, mesh={"generator": "block", "parameters": parameters}))
    return found(solution, abs(_sinking(solution) / _plain(law) - 1))


TINY: dict[str, tuple[str, int, int, int]] = {
    "one Q1": ("quadrilateral", 1, 1, 1),
    "one Q2": ("quadrilateral", 2, 1, 1),
    "one P1 pair": ("triangle", 1, 1, 1),
    "one P2": ("triangle", 2, 1, 1),
    "two Q1": ("quadrilateral", 1, 2, 1),
}


def _tiny(law: str, name: str) -> Finding:
    cell, degree, nx, ny = TINY[name]

    def scene(**settings: Any) -> dict[str, Any]:
        mesh = {"generator": "rectangle", "parameters": {"nx": nx, "ny": ny, "cell": cell}}
        result = example1(law, element={"degree": degree}, mesh=mesh, **settings)
        return result | {"traction": {"boundary": "top", "y": -20.0}}

    return _against_limit(scene)


def _patches(law: str, count: int) -> Finding:
    """Contact on a few facets only, each a boundary of its own."""
    sides = {name: marker for name, marker in SIDES.items() if name != "bottom"}
    for k in range(count):
        low = (30 if count == 1 else 5 + 22 * k) / 60
        high = low + (1 if count == 1 else 4 + k) / 60
        sides[f"patch {k}"] = lambda x, low=low, high=high: (x[1] < 1e-9) & (x[0] > low - 1e-9) & (x[0] < high + 1e-9)

    def scene(**settings: Any) -> dict[str, Any]:
        result = _on(law, grid(60, 20, stretched(3.0, 1.0), sides=sides), **settings)
        contact = result["contact"]
        return result | {"contact": [contact | {"boundary": f"patch {k}"} for k in range(count)]}

    return _against_limit(scene)


def _turned(law: str, angle: float) -> Finding:
    one, two = solved(_inclined(law, 0.0)), solved(_inclined(law, angle))
    if counts(one) != counts(two):
        return found(two, np.inf, f"other sets than without the turn ({one.history.linear_solves} solves)")
    c, s = np.cos(angle), np.sin(angle)
    back = two.displacement.x.array.reshape(-1, 2) @ np.array([[c, -s], [s, c]])
    assert one.contact is not None
    assert two.contact is not None
    return found(
        two,
        worst(
            [difference(back.ravel(), one.displacement.x.array), difference(two.contact.pressure, one.contact.pressure)]
        ),
    )


def _inclined(law: str, angle: float) -> dict[str, Any]:
    """A block pressed down by its top on a curved foundation, all turned."""
    c, s = np.cos(angle), np.sin(angle)
    top = np.array([[c, -s], [s, c]]) @ np.array([0.0006, -0.002])

    def gap(x: Points) -> Points:
        along = c * x[0] + s * x[1]
        return 0.003 * (along - 1.4) ** 2 + 0.0002

    return {
        "mesh": grid(30, 10, turned(angle)),
        "material": {"young": 5000.0, "poisson": 0.3},
        "displacement": {"boundary": "top", "x": float(top[0]), "y": float(top[1])},
        "contact": {"boundary": "bottom", "gap": gap, "friction": LAWS[law]},
    }
