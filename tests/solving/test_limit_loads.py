"""Limit loads in 3D that statics does not prove: the bracket of a ramp against limits by hand and by programme."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "demos" / "studies"))

import limit_loads


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


@pytest.mark.slow
@pytest.mark.parametrize("aside", [False, True])
def test_a_plate_between_two_rails(aside):
    """Directions of slip settle also at the edges of two contacts, where the plate hardly slips."""
    row = enclosed(limit_loads.plate(cells=20, layers=1, aside=aside))
    assert row.beyond.solves < row.below.solves
