"""The block of three independent programs in 3D: their answers, and how many linear solves it
takes.
"""

import numpy as np
import pytest
from scenes import alone
from spaces import block

LAWS = {"none": {}, "tresca": {"bound": 1.5}, "coulomb": {"coefficient": 0.3}}
# Of the block with 24 x 8 x 8 hexahedra and gamma = 1e8, as other programs print it: u_z under the
# load, the
# largest pressure, the friction force along x[1], the area with more than a hundredth of the
# largest pressure.
REFERENCE = {
    "none": (-0.0049189, 24.73, 0.0, 1.359),
    "tresca": (-0.0048746, 25.50, -1.539, 1.289),
    "coulomb": (-0.0048012, 29.4, -2.421, 1.289),
}


def figures(solution):
    """What ``REFERENCE`` has."""
    x = solution.model.space.tabulate_dof_coordinates()
    y = solution.displacement.x.array.reshape(-1, 3)
    under = int(np.argmin(np.abs(x - (1.5, 0.5, 1.0)).sum(axis=1)))
    columns = solution.table.columns
    pressed = columns["pressure"] > 0.01 * columns["pressure"].max()
    friction = solution.contact.forces[1][1]
    return y[under, 2], columns["pressure"].max(), friction, columns["weight"][pressed].sum()


@pytest.mark.one_quick("law", LAWS)
def test_answers_of_other_programs(law):
    """All digits that they agree in."""
    solution = alone(block(24, **LAWS[law], gamma=1e8))
    settled, peak, friction, area = figures(solution)
    u_z, pressure, force, touching = REFERENCE[law]
    assert settled == pytest.approx(u_z, abs=6e-8)
    assert peak == pytest.approx(pressure, abs=0.06 if law == "coulomb" else 0.006)
    assert friction == pytest.approx(force, abs=6e-4)
    assert area == pytest.approx(touching, abs=6e-4)
    np.testing.assert_allclose(sum(solution.contact.forces), [0.0, force, 20.0], atol=6e-4)
