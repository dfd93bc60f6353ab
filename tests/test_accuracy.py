"""An accuracy that is asked for is reached, or the budget ends by name."""

import numpy as np
import pytest

from signorini_fx.results import Status
from signorini_fx.scene import Accuracy
from signorini_fx.solver import solve
from tests.scenes import example1

FRICTION = {"tresca": {"bound": 1.5}, "coulomb": {"coefficient": 0.3}}


def asked(friction, **accuracy):
    """Example 1 with gamma left to the program, asked for an accuracy."""
    scene = example1(**FRICTION[friction], gamma="auto", nx=120, ny=40)
    return scene.model_copy(update={"accuracy": Accuracy(**accuracy)})


@pytest.fixture(scope="module", params=sorted(FRICTION))
def reference(request):
    """A solution without regularisation on a much finer mesh."""
    return request.param, solve(example1(**FRICTION[request.param], nx=960, ny=320, algorithm="exact")).table.columns


@pytest.mark.parametrize("target", [1e-1, 3e-2, 1e-2])
def test_pressure(reference, target):
    """The true error of the contact pressure is what was asked for, or less."""
    friction, fine = reference
    solution = solve(asked(friction, target=target, of="pressure"))
    coarse = solution.table.columns
    difference = np.interp(fine["s"], coarse["s"], coarse["pressure"]) - fine["pressure"]
    true = np.sqrt(np.dot(fine["weight"], difference**2) / np.dot(fine["weight"], fine["pressure"] ** 2))
    assert true <= target


@pytest.mark.parametrize("target", [1e-2, 1e-3])
def test_peak(reference, target):
    """The same for the largest pressure."""
    friction, fine = reference
    solution = solve(asked(friction, target=target, of="peak"))
    assert abs(solution.table.columns["pressure"].max() / fine["pressure"].max() - 1) <= target


def test_gamma_is_raised_where_it_is_in_the_way():
    """A large given regularisation error is brought below the target, by gamma and not by meshes alone."""
    scene = example1(bound=1.5, gamma=1e5, nx=60, ny=20)
    solution = solve(scene.model_copy(update={"accuracy": Accuracy(target=3e-2, of="pressure")}))
    assert solution.parameters["gamma_n"] > 1e6
    assert solution.levels[-1].pressure_regularisation < 0.5 * 3e-2


def test_budget_ends_by_name():
    """A refinement that the budget does not allow is not begun; the answer is the last mesh's, certified."""
    solution = solve(asked("tresca", target=1e-6, seconds=1e-3), check=False)
    assert solution.status is Status.BUDGET
    assert solution.certificate.holds
    assert len(solution.levels) == 2
    assert solve(asked("tresca", target=1e-6, memory=1e-3), check=False).status is Status.BUDGET


def test_no_more_than_asked_for():
    """A rough answer costs two small meshes."""
    assert len(solve(asked("tresca", target=0.5, of="pressure")).levels) == 2
