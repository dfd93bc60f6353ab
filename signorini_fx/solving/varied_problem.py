"""A problem on other meshes, with other elements and settings than it states, as studies of accuracy solve it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.settings import Accuracy, SolverSettings
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.results.solution import Solution

# How many times as large as stated its cells are, or a mesh; an element, P1, Q1, P2 or Q2; how it is solved, with the
# number of nested meshes; and the requested accuracy, None: there is none.
Variation: TypeAlias = "Callable[[float | TaggedMesh, str, SolverSettings, Accuracy | None], Callable[[], Solution]]"


@dataclass(frozen=True)
class VariedProblem:
    """A problem that scenes and forms make; all functions are collective.

    Attributes:
        statement: what is stated of it.
        mesh: makes a mesh with cells so many times as large as stated, for an element.
        on: gives what solves a variation of it, to the last iterate or with an error if there is no solution.
        divisible: whether triangles have straight sides on the boundary, so that they may be divided.
    """

    statement: Statement
    mesh: Callable[[float, str], TaggedMesh]
    on: Variation
    divisible: bool


def cell_of(element: str) -> str:
    """The cells of an element in the plane."""
    return {"P": "triangle", "Q": "quadrilateral"}[element[0]]
