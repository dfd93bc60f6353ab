"""One problem, three fronts: as a scene, as forms, and as a residual it has one solution."""

from dataclasses import replace
from itertools import pairwise

import pytest
from mpi4py import MPI
from parameters import slow

from benchmarks.stability.fronts import RandomProblem, compared, iterations
from signorini_fx import solve
from signorini_fx.scenes.reading import parse_scene


@pytest.mark.mpi
@pytest.mark.parametrize("seed", [7, *(slow(seed) for seed in (18, 153, 2012))])
def test_fronts_agree(seed):
    """Status, load steps, sets, forces, displacements, pressures, states and estimated error."""
    _, found = compared(RandomProblem.drawn(seed), MPI.COMM_WORLD)
    assert found == []


@pytest.mark.mpi
@pytest.mark.parametrize("moves", [False, True], ids=["still", "moving"])
def test_load_steps_begin_with_the_sets_of_the_last_one(moves):
    """A sphere that turns back with the body that it touches at one node: Newton's method finds a
    step in few solves.

    From the iterate round-off would decide whether a point at its bound still slips, and a
    foundation that has moved would begin with contact and stick everywhere.
    """
    drawn = RandomProblem.drawn(153)
    drawn = drawn if moves else replace(drawn, velocity=None)
    solution = solve(parse_scene(drawn.stated()), MPI.COMM_WORLD)
    firsts = {step: rest for step, _, *rest in reversed(iterations(solution))}
    lasts = {step: rest for step, _, *rest in iterations(solution)}
    steps = sorted(firsts)
    assert len(steps) > 2
    for earlier, later in pairwise(steps):
        assert firsts[later][:3] == lasts[earlier][:3]
        assert sum(step == later for step, *_ in iterations(solution)) < 8
