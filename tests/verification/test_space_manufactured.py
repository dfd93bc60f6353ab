"""A solution in 3D made up beforehand, whose slip turns from node to node: how fast the errors
fall.
"""

import numpy as np
import pytest
from manufactured_in_space import BOUND, displacement, made_up, slip_and_shear
from scenes import alone


def errors(cells, n, algorithm):
    """Of the displacement in L2 and of the shear on the bottom in L2, by the nodes, relative."""
    solution = alone(made_up(cells, n, algorithm))
    x = solution.model.space.tabulate_dof_coordinates().T
    exact = displacement(x)
    found = solution.displacement.x.array.reshape(-1, 3).T
    columns = solution.table.columns
    nodes = np.vstack([columns[axis] for axis in "xyz"])
    inner = np.abs(nodes[:2]).max(axis=0) < 2 - 1e-9  # at the rim the supports take the shear
    shear = np.vstack([columns[f"shear_{axis}"] for axis in "xy"])
    wrong = np.square(shear - slip_and_shear(nodes)[1]).sum(axis=0)
    share = columns["weight"][inner] @ wrong[inner] / columns["weight"][inner].sum()
    return np.linalg.norm(found - exact) / np.linalg.norm(exact), np.sqrt(share) / BOUND


@pytest.mark.one_quick("algorithm", ["ssn", "alm"])
@pytest.mark.parametrize("cells", ["hexahedra", "tetrahedra"])
def test_rates(cells, algorithm):
    """Halving the cells divides the error of the displacement by more than 2.8, that of the shear
    by more than 1.7.
    """
    coarse, fine = (np.array(errors(cells, n, algorithm)) for n in (4, 8))
    first, second = np.log2(coarse / fine)
    assert first > 1.5
    assert second > 0.75
