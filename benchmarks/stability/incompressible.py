"""Poisson's ratio close to 1/2: the element that does not lock, compared with those that do."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, partial
from typing import Any

import numpy as np

from benchmarks.stability.case import Case, Finding
from benchmarks.stability.measure import found, solved
from benchmarks.stability.scenes import LAWS, example1
from signorini_fx.results.solution import Solution

RATIOS = (0.3, 0.4, 0.45, 0.49, 0.499, 0.4999, 0.49999, 0.499999)
_TRIANGLES = {"generator": "rectangle", "parameters": {"cell": "triangle"}}
# Elements without locking, and those that lock.
SOUND: dict[str, dict[str, Any]] = {
    "Q1/P0": {"element": {"volumetric": "reduced"}},
    "P2/P0": {"element": {"volumetric": "reduced", "degree": 2}, "mesh": _TRIANGLES},
    "Q2/P1": {"element": {"volumetric": "reduced", "degree": 2}},
}
FULL: dict[str, dict[str, Any]] = {
    "full Q1": {},
    "full P2": {"element": {"degree": 2}, "mesh": _TRIANGLES},
    "full Q2": {"element": {"degree": 2}},
}
# The largest growth of counts compared with nu = 0.3.
_GROWTH = 1.6
# The largest oscillation from node to node, or cell to cell.
_OSCILLATION = 1e-2


def cases(*, short: bool) -> Iterator[Case]:
    """Displacement at (1.5, 1), pressure and counts for every ratio; the locking elements are shown beside them."""
    for law in ("Tresca",) if short else ("Tresca", "Coulomb"):
        for poisson in (0.499999,) if short else RATIOS:
            for name in ("Q1/P0",) if short else SOUND:
                yield Case(
                    f"{law}, {name}, nu = {poisson}",
                    partial(_sound, law, name, poisson),
                    target=1e-2,
                    reference="u_y(1.5, 1), Q2/P1 on twice as fine a mesh",
                )
    for law in ("Tresca",) if short else LAWS:
        for name in ("full Q2",) if short else FULL:
            for poisson in (0.49999,) if short else (0.49, 0.4999, 0.49999, 0.499999):
                yield Case(
                    f"{law}, {name}, nu = {poisson}, locks",
                    partial(_locking, law, name, poisson),
                    reference="u_y(1.5, 1), shown and not judged",
                )


def _scene(law: str, poisson: float, element: dict[str, Any], nx: int) -> dict[str, Any]:
    return example1(law, nx=nx, ny=nx // 3, poisson=poisson, **element)


@cache
def _solution(law: str, name: str, poisson: float) -> Solution:
    # Elements of degree 2 on half the cells have as many unknowns.
    return solved(_scene(law, poisson, SOUND[name], 120 if name == "Q1/P0" else 60))


@cache
def _reference(law: str, poisson: float) -> float:
    return _sinking(solved(_scene(law, poisson, SOUND["Q2/P1"], 120)))


def _sinking(solution: Solution) -> float:
    """u_y at (1.5, 1)."""
    x = solution.model.space.tabulate_dof_coordinates()
    node = np.argmin(np.hypot(x[:, 0] - 1.5, x[:, 1] - 1.0))
    return float(solution.displacement.x.array[2 * node + 1])


def _sound(law: str, name: str, poisson: float) -> Finding:
    solution, reference = _solution(law, name, poisson), _reference(law, poisson)
    error = abs(_sinking(solution) / reference - 1)
    pressure = solution.table.columns["pressure"]
    at_contact = _alternation(pressure) / pressure.max()
    note = f"u_y = {_sinking(solution):.6g} ({reference:.6g}), sawtooth of the contact pressure {at_contact:.1e}"
    inside = 0.0
    if name == "Q1/P0":
        inside = _checkerboard(solution, poisson)
        note += f", checkerboard of the stress in the body {inside:.1e}"
    first = _solution(law, name, RATIOS[0]).history.linear_solves
    if max(at_contact, inside) > _OSCILLATION or solution.history.linear_solves > _GROWTH * first:
        error = np.inf
        note += f", {first} solves at nu = {RATIOS[0]}"
    return found(solution, error, note)


def _alternation(values: np.ndarray, axis: int = 0) -> float:
    """The oscillation from node to node: neighbouring second differences of opposite sign, relative to the values."""
    bend = np.diff(values, 2, axis=axis) / 4
    neighbours = np.split(bend, [1], axis=axis)[1] * np.split(bend, [-1], axis=axis)[0]
    return float(np.sqrt(np.maximum(0.0, -neighbours).mean()))


def _checkerboard(solution: Solution, poisson: float) -> float:
    """The oscillation from cell to cell of the mean volumetric stress of a grid, relative to its mean size."""
    space = solution.model.space
    x = space.tabulate_dof_coordinates()[:, :2]
    u = solution.displacement.x.array.reshape(-1, 2)
    order = np.lexsort((x[:, 0].round(9), x[:, 1].round(9)))
    nx, ny = (np.unique(x[:, k].round(9)).size for k in (0, 1))
    u, x = u[order].reshape(ny, nx, 2), x[order].reshape(ny, nx, 2)
    hx, hy = x[0, 1, 0] - x[0, 0, 0], x[1, 0, 1] - x[0, 0, 1]
    across, up = np.diff(u[:, :, 0], axis=1) / hx, np.diff(u[:, :, 1], axis=0) / hy
    divergence = (across[:-1] + across[1:] + up[:, :-1] + up[:, 1:]) / 2
    pressure = divergence / (1 - 2 * poisson)
    return max(_alternation(pressure, axis) for axis in (0, 1)) / float(np.sqrt((pressure**2).mean()))


def _locking(law: str, name: str, poisson: float) -> Finding:
    solution = solved(_scene(law, poisson, FULL[name], 120 if name == "full Q1" else 60))
    reference = _reference(law, poisson)
    return found(solution, abs(_sinking(solution) / reference - 1))
