"""One problem, three fronts: as a scene, as forms, and as a residual it has one solution."""

import sys
from pathlib import Path

import pytest
from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).parents[2]))
from stability.fronts import SAME, Differences, RandomProblem, compared


@pytest.mark.mpi
@pytest.mark.parametrize("seed", [4, 5, 7, 18])
def test_fronts_agree(seed):
    """Status, load steps, forces, displacements, pressures, states, estimated error and guaranteed bound."""
    _, found = compared(RandomProblem.drawn(seed), MPI.COMM_WORLD)
    assert found == []


@pytest.mark.long
def test_two_hundred_problems():
    """That of ``python3 -m stability.fronts 200``."""
    assert {seed: found for seed in range(200) if (found := compared(RandomProblem.drawn(seed))[1])} == {}


def test_differences_are_seen():
    """Of values, and of shapes."""
    differences = Differences(MPI.COMM_SELF, [])
    differences.look("equal", [1.0, 2.0], [1.0, 2.0 + SAME], 2.0)
    assert differences.found == []
    differences.look("apart", [1.0, 2.0], [1.0, 2.0 + 3 * SAME], 2.0)
    differences.look("longer", [1.0], [1.0, 2.0], 2.0)
    assert differences.found == ["apart: 1.5e-08", "longer: shapes (1,) and (2,)"]
