"""What a program finds on a mesh, and the quantities of the problem that follow from it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from .grids import Grid
from .problem import ON_BOUNDARY, Problem, Quantity

Floats = npt.NDArray[np.float64]


class CannotRun(Exception):
    """A program is not there, or cannot state this problem: the message says why."""


@dataclass(frozen=True)
class ContactForces:
    """Forces at the points of a contact.

    Attributes:
        points: shape (m, d).
        weights: areas that belong to them, of a revolution where the body is axisymmetric, shape
        (m,).
        normal: of the foundation, or the other body, pushing the body off, shape (m,).
        friction: of the foundation, or the other body, on the body, along the surface, shape (m,
        d).
    """

    points: Floats
    weights: Floats
    normal: Floats
    friction: Floats

    @property
    def pressure(self) -> Floats:
        """Shape (m,)."""
        return self.normal / np.where(self.weights > 0, self.weights, np.inf)


@dataclass(frozen=True)
class Answer:
    """Of a program, on a mesh.

    Attributes:
        displacement: at the nodes of the mesh, shape (n, d).
        contacts: by the names of their boundaries.
        unknowns: of the displacement and of multipliers.
        seconds: CPU time from the mesh in memory, or the deck, to the solution.
        energy: the strain energy; None: the program does not give it.
        note: what else there is to say, such as a penalty.
        earlier: answers at the times before the last one, by time.
    """

    displacement: Floats
    contacts: dict[str, ContactForces]
    unknowns: int
    seconds: float
    energy: float | None = None
    note: str = ""
    earlier: dict[float, Answer] = field(default_factory=dict)


def refuse_histories(problem: Problem) -> None:
    """Say that an adapter has one load step and small deformations, where a problem has more.

    Raises:
        CannotRun: it has.
    """
    if problem.dynamic or problem.finite or len(problem.times) > 1:
        raise CannotRun("this adapter has one load step, small deformations and no inertia")


def measured(problem: Problem, grid: Grid, answer: Answer) -> dict[str, float]:
    """The quantities of a problem that the program gives, by their names."""
    given = [
        q for q in problem.quantities if q.measure != "strain energy" or answer.energy is not None
    ]
    return {quantity.name: _measure(problem, grid, answer, quantity) for quantity in given}


def _measure(problem: Problem, grid: Grid, answer: Answer, quantity: Quantity) -> float:
    answer = answer.earlier.get(quantity.time, answer)
    if quantity.measure == "strain energy":
        assert answer.energy is not None
        return answer.energy
    at = np.array([problem.number(c) for c in quantity.point])
    if quantity.measure == "displacement":
        return float(answer.displacement[grid.node_at(at), quantity.axis])
    assert quantity.measure in ON_BOUNDARY
    contact = answer.contacts[quantity.boundary]
    along = contact.points[:, quantity.axis]
    match quantity.measure:
        case "normal force":
            return float(contact.normal.sum())
        case "friction force":
            return float(contact.friction[:, quantity.axis].sum())
        case "largest pressure":
            return float(contact.pressure.max())
        case "pressure moment":
            return float(contact.normal @ along)
        case "pressure mean square":
            return float(contact.normal @ along**2 / contact.normal.sum())
    distance = np.linalg.norm(contact.points - at, axis=1)
    nearest = distance.argmin()
    if quantity.measure == "shear at":
        return float(contact.friction[nearest, quantity.axis] / contact.weights[nearest])
    return float(contact.pressure[nearest])
