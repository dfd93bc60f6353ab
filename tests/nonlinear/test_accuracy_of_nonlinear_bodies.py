"""A requested accuracy of the stress of nonlinear bodies: met, on a finer mesh, too, by the command that is printed."""

import numpy as np
import pytest
from mpi4py import MPI
from support.nonlinear_scenes import material

from signorini_fx import Status, solve
from signorini_fx.errors import SceneError
from signorini_fx.scenes.reading import parse_scene

PRESSED = {
    "mesh": {"generator": "rectangle", "parameters": {"length": 2.0, "height": 1.0, "nx": 8, "ny": 4}},
    "displacement": {"boundary": "bottom", "x": 0.0, "y": 0.0},
    "contact": {
        "boundary": "top",
        "foundation": {"shape": "circle", "centre": [0.8, 1.5], "radius": 0.5, "shift": [0.0, "-0.2*t"]},
        "friction": {"law": "coulomb", "coefficient": 0.3},
    },
    "load_steps": {"times": [0.5, 1.0]},
}
MATERIALS = {"rubber": material("neo-hooke"), "metal": material("j2", yield_stress=5.0, hardening=100.0)}


def pressed(name, comm=MPI.COMM_SELF, **accuracy):
    """A block under a rough circle."""
    scene = PRESSED | {"material": MATERIALS[name]} | ({"accuracy": accuracy} if accuracy else {})
    return solve(parse_scene(scene), comm, check=False)


@pytest.mark.slow
@pytest.mark.parametrize("name", MATERIALS)
def test_it_is_met(name):
    """The error that is told is met, and the force is that of a mesh with a third of the error to as much."""
    found, fine = pressed(name, target=0.06), pressed(name, target=0.02)
    assert found.status is fine.status is Status.CONVERGED
    assert found.convergence_table[-2].energy < 0.06
    force, exact = (sum(solution.contact.forces) for solution in (found, fine))
    assert np.linalg.norm(force - exact) < 0.06 * np.linalg.norm(exact)


def test_what_is_not_known():
    """Forces and pressures have no estimate, in 3D cells are not divided, and bounds are for linear bodies."""
    for accuracy in ({"of": "force"}, {"of": "peak"}, {"certified": True}):
        with pytest.raises(SceneError, match="nonlinear body"):
            pressed("rubber", target=0.1, **accuracy)


@pytest.mark.mpi
def test_ranks():
    """All ranks make the meshes of one; bisection may begin elsewhere."""
    alone, together = pressed("rubber", target=0.15), pressed("rubber", MPI.COMM_WORLD, target=0.15)
    assert together.status is Status.CONVERGED
    assert together.cost.error == pytest.approx(alone.cost.error, rel=0.1)
    assert sum(together.contact.forces) == pytest.approx(sum(alone.contact.forces), rel=5e-3)
