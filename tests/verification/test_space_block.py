"""The block of three independent programs in 3D: their answers, and how many linear solves it takes."""

import numpy as np
import pytest
from scenes import alone
from spaces import block

LAWS = {"none": {}, "tresca": {"bound": 1.5}, "coulomb": {"coefficient": 0.3}}
# Of the block with 24 x 8 x 8 hexahedra and gamma = 1e8, as other programs print it: u_z under the load, the
# largest pressure, the friction force along x[1], the area with more than a hundredth of the largest pressure.
REFERENCE = {
    "none": (-0.0049189, 24.73, 0.0, 1.359),
    "tresca": (-0.0048746, 25.50, -1.539, 1.289),
    "coulomb": (-0.0048012, 29.4, -2.421, 1.289),
}
# u_z of these programs on 96 x 32 x 32 hexahedra.
FINEST = {"none": -0.0049153, "tresca": -0.0048748, "coulomb": -0.0048038}


def figures(solution):
    """What ``REFERENCE`` has."""
    x = solution.model.space.tabulate_dof_coordinates()
    y = solution.displacement.x.array.reshape(-1, 3)
    under = int(np.argmin(np.abs(x - (1.5, 0.5, 1.0)).sum(axis=1)))
    columns = solution.table.columns
    pressed = columns["pressure"] > 0.01 * columns["pressure"].max()
    friction = solution.contact.forces[1][1]
    return y[under, 2], columns["pressure"].max(), friction, columns["weight"][pressed].sum()


@pytest.mark.one_quick
@pytest.mark.parametrize("law", LAWS)
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


GAMMAS = (1e5, 1e6, 1e7, 1e8, 1e9)


def solves_until(solution):
    """Linear solves of the last regularised problem until the sets stay, and until the law holds as well."""
    last = [record for record in solution.history.iterations if record.outer == solution.history.iterations[-1].outer]
    moving = [place for place, record in enumerate(last, start=1) if record.changed > 0]
    return (moving[-1] if moving else 0) + 1, len(last)


@pytest.mark.slow
@pytest.mark.parametrize("cells", ["hexahedra", "tetrahedra"])
@pytest.mark.parametrize("law", [{}, {"bound": 1.5}, {"coefficient": 0.3, "coulomb": "newton"}])
def test_linear_solves(cells, law):
    """The sets are settled within 12 linear solves and the law holds within 14, for every gamma."""
    for gamma in GAMMAS:
        solution = alone(block(24, cells, gamma=gamma, **law))
        settled, done = solves_until(solution)
        assert solution.history.events == []
        assert settled <= 12
        assert done <= 14


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "finer"),
    [
        (law, gammas)
        for gammas in (GAMMAS[-1:], GAMMAS)
        for law in ({}, {"bound": 1.5}, {"coefficient": 0.3, "coulomb": "newton"})
    ],
    ids=["law0", "law1", "law2", "law0, all", "law1, all", "law2, all"],
)
def test_linear_solves_on_quadratic_tetrahedra(law, finer):
    """Fewer than on other cells, and the displacement under the load near that of the finest mesh of other programs."""
    for nx, gammas in ((9, GAMMAS), (15, finer)):
        for gamma in gammas:
            solution = alone(block(nx, "tetrahedra", gamma=gamma, degree=2, **law))
            settled, done = solves_until(solution)
            assert solution.history.events == []
            assert settled <= 9
            assert done <= 11
    kind = "none" if not law else "tresca" if "bound" in law else "coulomb"
    assert figures(solution)[0] == pytest.approx(FINEST[kind], rel=3e-3)
    assert sum(solution.contact.forces)[2] == pytest.approx(20.0)
