"""How many linear solves the algorithms take for Example 1 of the paper."""

import pytest
from scenes import alone, example1

# Tresca friction with g = 1.5, Coulomb friction with F = 0.3 by the fixed point and by ``newton``.
COUNTS = {
    "ssn": ({"algorithm": "ssn"}, (12, 16, 13)),
    "continuation": ({"algorithm": "continuation"}, (15, 19, 16)),
    "path": ({"algorithm": "path-following"}, (8, 14, 10)),
    "path to 1e-4": ({"algorithm": "path-following", "regularisation_error": 1e-4}, (12, 17, 14)),
    "alm": ({"algorithm": "alm", "gamma": 1e7}, (16, 20)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", COUNTS)
def test_on_the_mesh_of_the_paper(name):
    """With all nodes in contact at the start, gamma = 1e8 unless given."""
    setting, expected = COUNTS[name]
    laws = [{"bound": 1.5}, {"coefficient": 0.3}, {"coefficient": 0.3, "coulomb": "newton"}]
    found = [alone(example1(**law, **setting)) for law in laws[: len(expected)]]
    assert tuple(solution.history.linear_solves for solution in found) == expected


@pytest.mark.slow
def test_on_a_fine_mesh():
    """With a large gamma: nested meshes leave three solves to the finest one."""
    fine = {"bound": 2.5, "poisson": 0.49, "gamma": 1e9, "nx": 240, "ny": 80}
    settings = ({}, {"algorithm": "continuation"}, {"levels": 3})
    plain, continued, nested = (alone(example1(**fine, **setting)) for setting in settings)
    counts = [solution.history.linear_solves for solution in (plain, continued, nested)]
    assert [*counts, nested.levels[-1].linear_solves] == [20, 13, 18, 3]
