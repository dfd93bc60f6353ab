"""Limit loads in 3D that statics does not prove: the bracket of a ramp against limits by hand and
by programme.

Dead loads press a body into three contacts, a live one pulls it beyond what Coulomb friction holds.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from scenes import alone
from scipy.optimize import linprog

from signorini_fx import solve
from signorini_fx.mechanics.statement.settings import SolverSettings
from signorini_fx.records import IterationRecord, Status, StepRecord
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.scene import Scene

# Of the bracket and of its distance, relative to the limit; of the work without a solution, over
# that with one.
WIDEST, FURTHEST, MOST_WORK = 0.01, 0.01, 5.0
# The bounds of the programme meet to this share; cutting planes at most.
_DIGITS, _CUTS = 1e-4, 500


@dataclass(frozen=True)
class Case:
    """A body, and what is known of its limit without a solution.

    Attributes:
        scene: a ramp of its live load from time 0 to time 1.
        dead, live: forces and the points where they act, both of shape (3,).
        limit: the time at which it slides, by hand; None: by ``limit_by_programme``.
    """

    scene: Scene
    dead: list
    live: tuple
    limit: float | None = None


def pulled(size, young, coefficient, dead, live):
    """A box on three contacts: the dead loads first, then the live one in ten increments."""
    friction = {"law": "coulomb", "coefficient": coefficient}
    contacts = ("left", "front", "bottom")
    return parse_scene(
        {
            "mesh": {"generator": "box", "parameters": size},
            "material": {"young": young, "poisson": 0.3},
            "traction": [*dead, {**live, "factors": [0.0, 1.0]}],
            "contact": [{"boundary": name, "friction": friction} for name in contacts],
            "load_steps": {"steps": 10, "times": [0.0, 1.0]},
            # What regularisation leaves of slip in each step would wedge the body: the ramp would
            # end up to 12 % early.
            "solver": {"algorithm": "alm", "coulomb": "newton"},
        }
    )


def corner(coefficient, cells, beyond=1.3):
    """A cube in a corner of three walls that is pulled away from one of them.

    It slides along the other two, straight away from the first, which has opened.  All friction is
    then opposite to the pull, so that nothing but the loads presses: the limit is F times their
    sum, and what pressed into the first wall.
    """
    down, side, back = 5.0, 2.0, 1.0
    pull = beyond * (coefficient * (down + side) + back)
    size = {"length": 1.0, "width": 1.0, "height": 1.0, "nx": cells, "ny": cells, "nz": cells}
    dead = (
        {"boundary": "top", "z": -down},
        {"boundary": "back", "y": -side},
        {"boundary": "right", "x": -back},
    )
    return Case(
        pulled(size, 5000.0, coefficient, dead, {"boundary": "right", "x": pull}),
        [
            ((0, 0, -down), (0.5, 0.5, 1)),
            ((0, -side, 0), (0.5, 1, 0.5)),
            ((-back, 0, 0), (1, 0.5, 0.5)),
        ],
        ((pull, 0, 0), (1, 0.5, 0.5)),
        1 / beyond,
    )


def limit_by_programme(case, solution):
    """The time at which the body moves away as a rigid one, with the friction bounds of the last
    load step.

    It is the least of sum g_i |v_i| - (power of the dead loads) over all rigid motions v that press
    nothing into the foundation and on which the live load has the power 1.  The sum is convex:
    cutting planes replace it by linear programmes, whose values are bounds from below; the sum
    itself is one from above.
    """
    columns = solution.table.columns
    x = np.column_stack([columns[name] for name in ("x", "y", "z")])
    normal = np.column_stack([columns[name] for name in ("n_x", "n_y", "n_z")])
    centre, size = x.mean(axis=0), float(np.ptp(x, axis=0).max())

    def work(loads):
        return np.sum(
            [
                np.asarray(force) @ motions((np.asarray([at]) - centre) / size)[0]
                for force, at in loads
            ],
            axis=0,
        )

    bound = columns["weight"] * columns["bound"]
    unit = float(bound.sum())
    bound, dead, live = bound / unit, work(case.dead) / unit, work([case.live]) / unit
    modes = motions((x - centre) / size)
    away = np.einsum("ij,ijk->ik", normal, modes)
    along = modes - normal[:, :, None] * away[:, None, :]
    flat = np.column_stack((away, np.zeros(len(x))))
    reach = 1e3 / float(np.linalg.norm(live))
    cuts = []
    lower, upper = 0.0, np.inf
    for _ in range(_CUTS):
        found = linprog(
            np.append(-dead, 1.0),
            A_ub=np.vstack((flat, *(np.append(cut, -1.0) for cut in cuts))),
            b_ub=np.zeros(len(flat) + len(cuts)),
            A_eq=np.append(live, 0.0)[None],
            b_eq=[1.0],
            bounds=[(-reach, reach)] * 6 + [(0, None)],
            method="highs",
        )
        slip = along @ found.x[:6]
        speed = np.linalg.norm(slip, axis=1)
        lower, upper = max(lower, found.fun), min(upper, float(bound @ speed - dead @ found.x[:6]))
        if upper - lower <= _DIGITS * upper:
            return upper
        cuts.append(np.einsum("i,ij,ijk->k", bound / np.maximum(speed, 1e-300), slip, along))
    raise ArithmeticError(f"the bounds {lower} and {upper} do not meet")


def motions(x):
    """Three translations and three rotations about the origin at points x, shape (n, 3, 6)."""
    turns = np.cross(np.eye(3)[None], x[:, None, :])
    return np.concatenate(
        (np.broadcast_to(np.eye(3), (len(x), 3, 3)), turns.transpose(0, 2, 1)), axis=2
    )


def enclosed(case):
    """A ramp that ends as it should, and its linear solves in attempts with and without a
    solution.
    """
    attempts = []

    def count(record):
        if isinstance(record, StepRecord):
            attempts.append([record.time, 0])
        elif isinstance(record, IterationRecord) and attempts:
            attempts[-1][1] += 1

    solution = alone(case.scene, check=False, observers=[count])
    limit = case.limit or limit_by_programme(case, solution)
    held, failed = solution.last_step.time, solution.steps[-1].time
    assert (1 - FURTHEST) * limit <= held <= limit <= failed <= (1 + FURTHEST) * limit
    assert failed - held <= WIDEST * limit
    assert solution.history.events[-1].startswith("the ramp ends: there is a solution")
    found = {step.time for step in solution.steps if step.status is Status.CONVERGED}
    last = {time: number for number, (time, _) in enumerate(attempts) if time in found}
    below = sum(attempts[number][1] for number in last.values())
    beyond = sum(
        solves for number, (_, solves) in enumerate(attempts) if number not in last.values()
    )
    assert beyond <= MOST_WORK * below
    return below, beyond


@pytest.mark.slow
@pytest.mark.parametrize("coefficient", [0.3, 0.6])
def test_a_cube_in_a_corner_of_three_walls(coefficient):
    """No fixed point finds its last load steps: the friction of the step before would not hold
    it.
    """
    _, beyond = enclosed(corner(coefficient, cells=3))
    assert beyond > 0


@pytest.mark.slow
def test_regularised_steps_end_early_and_say_so():
    """By a few per cent in a corner of three walls; the advice names the method that finds the
    limit.
    """
    case = corner(0.5, cells=3)
    scene = case.scene.model_copy(update={"solver": SolverSettings()})
    solution = solve(scene, check=False)
    assert 0.85 * case.limit < solution.last_step.time < case.limit
    assert "set solver.algorithm = 'alm' and solver.coulomb = 'newton'" in solution.advice
