"""Limit loads in 3D that statics does not prove: the bracket of a ramp against limits by hand and by programme."""

import sys
from dataclasses import replace
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "demos" / "studies"))

import limit_loads

from signorini_fx.algebra.algorithms import strategy
from signorini_fx.algebra.attempts import RAMP_BY_AUGMENTATION, RAMP_WITHOUT_AUGMENTATION
from signorini_fx.records import Status

FAILS = Status.CYCLING


def enclosed(case):
    """A ramp that ends as it should, and its row."""
    row = limit_loads.measured("", case)
    assert row.misses == []
    assert row.held <= row.limit <= row.failed
    return row


@pytest.mark.slow
@pytest.mark.parametrize("coefficient", [0.3, 0.6])
def test_a_cube_in_a_corner_of_three_walls(coefficient):
    """No fixed point finds its last load steps: the friction of the step before would not hold it."""
    row = enclosed(limit_loads.corner(coefficient, cells=3))
    assert row.beyond.attempts > 0


@pytest.mark.one_quick
@pytest.mark.parametrize("aside", [False, True])
def test_a_plate_between_two_rails(aside):
    """Directions of slip settle also at the edges of two contacts, where the plate hardly slips."""
    row = enclosed(limit_loads.plate(cells=20, layers=1, aside=aside))
    assert row.beyond.solves < row.below.solves


@pytest.mark.slow
def test_what_was_reached_without_augmentation_is_not_lost(monkeypatch):
    """Where augmentation fails earlier, the ramp ends no lower than where it began again."""
    case = limit_loads.corner(0.3, cells=2)
    monkeypatch.setattr(
        strategy,
        "_augmented_first",
        lambda task, start, law: replace(strategy._coulomb(task, start, law), status=FAILS),
    )
    solution = limit_loads.solve(case.scene, limit_loads.MPI.COMM_SELF, check=False)
    begun = [
        event
        for event in solution.history.events
        if str(RAMP_BY_AUGMENTATION) in event or str(RAMP_WITHOUT_AUGMENTATION) in event
    ]
    assert len(begun) == 2
    times = [float(event.partition("time ")[2].partition(")")[0]) for event in begun]
    assert times[1] <= times[0] <= solution.last_step.time
    assert solution.history.events[-1].startswith("the ramp ends: there is a solution")


@pytest.mark.long
@pytest.mark.parametrize("name", [name for name in limit_loads.CASES if not name.startswith("plate")])
def test_every_case(name):
    """Those of the study but the plate, which takes long."""
    enclosed(limit_loads.CASES[name]())


@pytest.mark.slow
def test_the_programme():
    """With the friction bounds of a load step near the limit it finds the limit that is known by hand."""
    case = limit_loads.corner(0.3, cells=2)
    solution = limit_loads.solve(case.scene, limit_loads.MPI.COMM_SELF, check=False)
    assert limit_loads.limit_by_programme(case, solution) == pytest.approx(case.limit, rel=0.01)


def test_what_is_missed_is_said():
    """A bracket that is too wide, beside the limit, without a reason or too dear."""
    cheap, dear = limit_loads.Work(solves=10, inner=10), limit_loads.Work(solves=51, inner=10)
    ends = "the ramp ends: there is a solution at time 1, and none at time 1.005"
    row = limit_loads.Row("", 1, 3, 1.002, 1.0, 1.005, limit_loads.Status.CYCLING, ends, cheap, cheap)
    assert row.misses == []
    assert replace(row, failed=1.02).misses == ["width", "limit"]
    assert replace(row, limit=1.1).misses == ["limit"]
    assert replace(row, beyond=dear).misses == ["work"]
    assert replace(row, end="active sets cycle").misses == ["reason"]
