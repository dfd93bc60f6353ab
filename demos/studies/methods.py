"""The methods that a study compares: they vary one choice at a time around the default.

The choices are the element, the regularisation, the algorithm, the linear algebra, and the meshes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.results.solution import Solution

FAMILIES = {
    "element": "Element",
    "gamma": r"Fixed $\gamma$, in units of $E$ / size",
    "algorithm": "Algorithm",
    "linear algebra": "Linear algebra",
    "meshes": "One mesh, nested, adaptive",
}


@dataclass(frozen=True)
class Method:
    """One way to solve the scene.

    Attributes:
        name: what to call it.
        families: the comparisons that it takes part in.
        element: P1, Q1, P2 or Q2.
        gamma: gamma_1 = gamma_2 over E / size of the body; None: automatic.
        settings: further solver settings.
        adaptive: whether its meshes are refined adaptively until an accuracy is reached.
    """

    name: str
    families: tuple[str, ...]
    element: str = "Q1"
    gamma: float | None = None
    settings: dict[str, Any] = field(default_factory=dict)
    adaptive: bool = False

    @property
    def degree(self) -> int:
        """The degree of the element."""
        return int(self.element[1])


def methods(statement: Statement, *, quick: bool = False) -> list[Method]:
    """The list, simplest first."""
    limit = {"algorithm": "alm"}
    augmented = "ALM-FP" if statement.has_coulomb else "ALM"
    candidates = [Method(f"Q1, {augmented}", tuple(FAMILIES), settings=limit)]
    elements = ("Q2",) if quick else ("Q2", "P1", "P2")
    candidates += [Method(f"{name}, {augmented}", ("element",), name, settings=limit) for name in elements]
    for name, settings in (
        ("gamma automatic", {}),
        ("continuation", {"algorithm": "continuation"}),
        ("path-following", {"algorithm": "path-following"}),
    ):
        if not quick:
            name = f"{name}, FP" if statement.has_coulomb else name
            candidates.append(Method(name, ("algorithm",), settings=settings))
    powers = (5,) if quick else (3, 4, 5, 6, 7, 8, 9, 10)
    candidates += [Method(f"gamma = 1e{power}", ("gamma",), gamma=10.0**power) for power in powers]
    if statement.has_coulomb:
        candidates.append(Method("gamma automatic, monolithic", ("algorithm",), settings={"coulomb": "newton"}))
    for kind in ("condensed", "full", "krylov")[: 2 if quick else 3]:
        candidates.append(Method(f"Q1, {kind}", ("linear algebra",), settings={**limit, "linear_algebra": kind}))
    for element in ("Q1", "Q2"):
        nested = {**limit, "levels": 2 if quick else 3}
        candidates.append(Method(f"{element}, nested", ("meshes",), element, settings=nested))
    if not quick:
        candidates.append(Method(f"Q2, {augmented}", ("meshes",), "Q2", settings=limit))
        candidates.append(Method("P1, adaptive", ("meshes",), "P1", settings=limit, adaptive=True))
    candidates.append(Method("P2, adaptive", ("meshes",), "P2", settings=limit, adaptive=True))
    return list({method.name: method for method in _merge(candidates)}.values())


def _merge(candidates: list[Method]) -> list[Method]:
    """Methods that are in the list twice are merged, with the families of both."""
    families: dict[str, list[str]] = {}
    for method in candidates:
        families.setdefault(method.name, []).extend(method.families)
    return [replace(method, families=tuple(families[method.name])) for method in candidates]


def work_of(solution: Solution) -> int:
    """Linear solves on every mesh times the unknowns there."""
    meshes = [(level.linear_solves, level.dofs) for level in solution.levels]
    meshes = meshes or [(solution.history.linear_solves, solution.model.dofs)]
    return sum(solves * dofs for solves, dofs in meshes)
