"""What is measured: solutions, iterates, and distances in the norms of the paper."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx import Scene, Status, solve
from signorini_fx.algebra.contact.complementarity import project
from signorini_fx.mechanics.body.discretisation import prepare
from signorini_fx.records import History, Timings
from signorini_fx.results.certificate.nodal_forces import NodalForces
from signorini_fx.results.solution import Solution
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.solving.solve_on_mesh import contact_task

from .scenes import COMM

Nodal = npt.NDArray[np.float64]


def solved(scene: Scene, *, check: bool = True, **settings: Any) -> Solution:
    """The solution of a scene, with other solver settings if any are given."""
    if settings:
        scene = scene.model_copy(update={"solver": scene.solver.model_copy(update=settings)})
    return solve(scene, COMM, check=check)


def linear_solves(scene: Scene) -> int:
    """Linear solves inside (SSN), what the paper calls iterations."""
    return solved(scene).history.linear_solves


def solves_per_problem(solution: Solution) -> list[int]:
    """Linear solves of each regularised problem in turn."""
    return [record.linear_solves for record in solution.history.outer]


def counted(solves: int) -> int:
    """Iterations as the paper seems to count them where an iteration starts from the solution of
    another problem.

    Tables 4 and 5 and the totals given for (ALM) are met by one rule: the pass through step 2 that
    takes the first sets from that solution counts, too.  Where the first sets are prescribed
    (Tables 1 and 3) there is no such pass.
    """
    return solves + 1


def iterates(scene: Scene) -> list[Solution]:
    """The iterates y^1, y^2, ... of (SSN), the solution last."""
    found: list[Solution] = []
    while not found or found[-1].status is Status.MAX_ITERATIONS:
        found.append(solved(scene, check=False, max_iterations=len(found) + 1))
    return found


def outer_iterates(scene: Scene, count: int) -> list[Solution]:
    """What (ALM) has after 1, 2, ..., count regularised problems."""
    return [
        solved(scene, check=False, max_outer_iterations=problems + 1) for problems in range(count)
    ]


def energy_norm(solution: Solution, other: Solution) -> float:
    """a(e, e)^(1/2) of the difference of the displacements of two solutions on one mesh."""
    difference = solution.displacement.copy()
    difference.x.array[:] -= other.displacement.x.array
    forces = NodalForces.on(solution.model).internal(difference)
    return float(np.sqrt(max(0.0, forces.ravel() @ difference.x.array[: forces.size])))


def multiplier_distances(solution: Solution, other: Solution) -> tuple[float, float]:
    """Distances of lambda and of mu to those of another solution in L2(Gamma_c)."""
    c, o = solution.contact, other.contact
    return o.points.norm(c.pressure - o.pressure), o.points.norm(c.shear - o.shear)


def quotients(errors: list[Any]) -> list[Any]:
    """Each error divided by the one before."""
    return [np.asarray(b) / np.asarray(a) for a, b in pairwise(errors)]


def inexact_alm(
    scene: Scene, most_solves: int, growth: float
) -> Iterator[tuple[int, Nodal, Nodal]]:
    """(ALM) with at most ``most_solves`` linear solves for each problem, as section 7.1 describes
    it.

    The dual variables are projected before the update.  Where an inner iteration is cut off, it
    goes on in the next problem with the sets that follow from its last iterate.

    Yields:
        For each problem the number of linear solves, and the projected pressure and shear.
    """
    discretisation = prepare(scene.statement, load_mesh(scene, COMM), Timings())
    task = contact_task(discretisation, History())
    newton, data, sets = task.newton, task.start.data, task.start.sets
    while True:
        status = newton.solve(data, sets, max_iterations=most_solves)
        _, u_t = task.system.contact.traces(newton.x)
        pressure, shear = project(*newton.multipliers(), u_t, data)
        yield newton.history.outer[-1].linear_solves, pressure, shear
        updated = replace(
            data,
            lambda_hat=pressure,
            mu_hat=shear,
            gamma_n=growth * data.gamma_n,
            gamma_t=growth * data.gamma_t,
        )
        sets = newton.continued_sets(updated if status is Status.CONVERGED else data)
        data = updated
