"""Mesh levels that a mesh does not have: the scene ends with a certificate, or with another outcome that has a name."""

import pytest
from mpi4py import MPI

from signorini_fx.errors import SceneError
from signorini_fx.records import Status
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve


def attempt(function, *arguments):
    """The result and no problems, or no result and the problems; any other error goes through."""
    try:
        return function(*arguments), []
    except SceneError as error:
        problems = error.problems
    assert problems
    for path, message in problems:
        assert path.strip(), message
        assert len(message) > 5, path
    return None, problems


def ends_well(data):
    """A scene ends with a certificate, with another outcome that has a name, or with the paths of its mistakes."""
    scene, problems = attempt(parse_scene, data)
    if problems:
        return
    solution, problems = attempt(lambda: solve(scene, MPI.COMM_SELF, check=False))
    check, foreseen = attempt(check_scene, scene, MPI.COMM_SELF)
    assert foreseen == problems
    if problems:
        return
    assert isinstance(solution.status, Status)
    assert solution.converged == (solution.status is Status.CONVERGED)
    if solution.converged:
        assert solution.certificate.holds
        assert len(solution.steps) == scene.statement.steps
    said = [finding.message for finding in check.warnings]
    if any("nothing holds the body" in message for message in said):
        assert solution.status is Status.NOT_HELD
    if any("no static equilibrium" in message for message in said):
        assert not solution.converged


@pytest.mark.one_quick
@pytest.mark.parametrize(("nx", "ny", "levels"), [(1, 1, 2), (1, 3, 2), (4, 4, 3), (1, 1, 12)])
@pytest.mark.parametrize("algorithm", ["ssn", "path-following"])
def test_meshes_that_get_no_coarser(nx, ny, levels, algorithm):
    """A mesh of one cell has no coarser one: the levels that there are count."""
    parameters = {"length": 3.0, "nx": nx, "ny": ny, "cell": "quadrilateral"}
    ends_well(
        {
            "mesh": {"generator": "rectangle", "parameters": parameters},
            "material": {"young": 5000.0, "poisson": 0.3},
            "displacement": [{"boundary": "left", "x": 0.0, "y": 0.0}],
            "traction": [{"boundary": "top", "y": -20.0}],
            "contact": [{"boundary": "bottom", "friction": {"law": "none"}}],
            "solver": {"levels": levels, "algorithm": algorithm},
        }
    )
