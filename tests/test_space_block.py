"""The block of three independent programs in space: their answers, and how many linear solves it takes."""

import numpy as np
import pytest
from mpi4py import MPI
from scenes import alone
from spaces import block

from signorini_fx.records import History
from signorini_fx.solving.solver import _solve_nested

LAWS = {"none": {}, "tresca": {"bound": 1.5}, "coulomb": {"coefficient": 0.3}}
# Of the block with 24 x 8 x 8 hexahedra and gamma = 1e8, as other programs print it: u_z under the load, the
# largest pressure, the friction force along x[1], the area with more than a hundredth of the largest pressure.
REFERENCE = {
    "none": (-0.0049189, 24.73, 0.0, 1.359),
    "tresca": (-0.0048746, 25.50, -1.539, 1.289),
    "coulomb": (-0.0048012, 29.4, -2.421, 1.289),
}


def figures(solution):
    """What ``REFERENCE`` has."""
    x = solution.discretisation.space.tabulate_dof_coordinates()
    y = solution.displacement.x.array.reshape(-1, 3)
    under = int(np.argmin(np.abs(x - (1.5, 0.5, 1.0)).sum(axis=1)))
    columns = solution.table.columns
    pressed = columns["pressure"] > 0.01 * columns["pressure"].max()
    friction = solution.contact.forces[1][1]
    return y[under, 2], columns["pressure"].max(), friction, columns["weight"][pressed].sum()


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


def test_equal_sets_are_not_the_end():
    """The sets stay solves before the friction law holds, while directions still turn; the answer obeys the law."""
    for gamma in GAMMAS:
        solution = alone(block(12, bound=1.5, gamma=gamma))
        settled, done = solves_until(solution)
        assert done > settled
        contact = solution.contact
        trial = gamma * contact.u_t
        size = np.linalg.norm(trial, axis=1, keepdims=True)
        wanted = np.where(size > 1.5, 1.5 * trial / np.maximum(size, 1.5), trial)
        assert np.abs(contact.shear - wanted).max() <= 1.5e-8


@pytest.mark.parametrize("cells", ["hexahedra", "tetrahedra"])
def test_monolithic_takes_half_of_the_fixed_point(cells):
    """At most half of the linear solves, the start from the pure contact problem counted with both."""
    for gamma in GAMMAS:
        fixed, newton = (
            alone(block(24, cells, coefficient=0.3, gamma=gamma, coulomb=way)).history.linear_solves
            for way in ("fp", "newton")
        )
        assert 2 * newton <= fixed


@pytest.mark.parametrize("law", LAWS)
def test_nested_iteration(law):
    """Meshes of one's own, each from the state of the one before: at most 6 linear solves on the last of three."""
    scenes = [block(nx, **LAWS[law], gamma=1e7) for nx in (6, 12, 24)]
    history = History()
    solution = _solve_nested(scenes, MPI.COMM_SELF, history)
    assert solution.certificate.holds
    assert history.outer[-1].linear_solves <= 6
    alone_answer = alone(scenes[-1])
    np.testing.assert_allclose(figures(solution), figures(alone_answer), rtol=1e-6, atol=1e-9)
