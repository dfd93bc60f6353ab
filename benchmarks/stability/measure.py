"""Functions for all cases: solving, comparing, and the finding."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from benchmarks.stability.case import Finding
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.mechanics.body.discretisation import discretise
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.records import History, Timings
from signorini_fx.results.mechanics import StatedBody
from signorini_fx.results.solution import Solution
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.scene import Scene
from signorini_fx.scenes.solver import solve
from signorini_fx.solving.solve_on_mesh import contact_task, solve_contact


def solved(scene: Scene | dict) -> Solution:
    """The scene solved on this rank, whatever the outcome."""
    return solve(parse_scene(scene) if isinstance(scene, dict) else scene, MPI.COMM_SELF, check=False)


def solved_from(
    scene: Scene | dict,
    sets: Callable[[ContactBoundary], ActiveSets] | None = None,
    start: Callable[[ContactBoundary], tuple[Nodal, Nodal]] | None = None,
    motion: Callable[[npt.NDArray[np.float64]], npt.NDArray[np.float64]] | None = None,
) -> Solution:
    """The scene solved from a start of one's own, whatever the outcome.

    Args:
        scene: the scene.
        sets: first sets; None: those of the scene.
        start: (lambda, mu) to start from; None: those that the algorithm begins with.
        motion: first displacement, from points of shape (n, 2) to the same shape; then sets follow from it.
    """
    scene = parse_scene(scene) if isinstance(scene, dict) else scene
    if motion is not None:  # of all unknowns
        solver = scene.solver.model_copy(update={"linear_algebra": "full"})
        scene = scene.model_copy(update={"solver": solver})
    timings = Timings()
    discretisation = StatedBody.of(discretise(scene.statement, load_mesh(scene, MPI.COMM_SELF), timings))
    assert discretisation.boundary is not None
    task = contact_task(discretisation, History())
    begin = task.start
    if sets is not None:
        begin = replace(begin, sets=sets(discretisation.boundary), iteration=1)
    if start is not None:
        begin = replace(begin, multipliers=start(discretisation.boundary))
    if motion is not None:
        first = task.iterate.x
        x = discretisation.space.tabulate_dof_coordinates()[: first.getLocalSize() // 2, :2]
        first.getArray()[:] = np.where(discretisation.fixed, first.getArray(readonly=True), motion(x).ravel())
        begin = replace(begin, sets=None)
    solution, *_ = solve_contact(discretisation, task, begin, timings)
    return solution


# The largest error of the displacement by gamma = auto.
REGULARISED = 5e-4


def found(solution: Solution, error: float | None = None, note: str = "") -> Finding:
    """The finding of a solve."""
    certificate = solution.certificate.worst
    # A fall-back of the solver is reported.
    events = dict.fromkeys(event for event in solution.history.events if not event.startswith("level "))
    solves = solution.history.linear_solves or sum(step.linear_solves for step in solution.steps)
    return Finding(solution.status.value, solves, certificate, error, "; ".join([*([note] if note else []), *events]))


def difference(ours: npt.ArrayLike, theirs: npt.ArrayLike) -> float:
    """Largest difference, relative to the largest value of the second; infinite where the shapes differ."""
    a, b = np.asarray(ours, dtype=float), np.asarray(theirs, dtype=float)
    if a.shape != b.shape:
        return np.inf
    largest = np.abs(b).max(initial=0.0)
    change = np.abs(a - b).max(initial=0.0)
    return float(change / largest if largest > 0 else change)


def apart(one: Solution, other: Solution, length: float = 1.0, stress: float = 1.0) -> float:
    """Largest relative difference of displacement, pressure and shear, ``one`` in other units."""
    assert one.contact is not None
    assert other.contact is not None
    pressure = np.column_stack([one.contact.pressure, one.contact.shear]) / stress
    return max(
        difference(one.displacement.x.array / length, other.displacement.x.array),
        difference(pressure, np.column_stack([other.contact.pressure, other.contact.shear])),
    )


def counts(solution: Solution) -> list[tuple[int, ...]]:
    """The sets of every linear solve."""
    return [(r.outer, r.active_contact, r.slip_plus, r.slip_minus, r.changed) for r in solution.history.iterations]


def column(solution: Solution, name: str) -> npt.NDArray[np.float64]:
    """A column of the contact table."""
    values: npt.NDArray[np.float64] = solution.table.columns[name]
    return values


def worst(errors: Sequence[float]) -> float:
    """The largest value; NaN counts as the largest."""
    return float(np.max(np.nan_to_num(np.asarray(errors, dtype=float), nan=np.inf)))
