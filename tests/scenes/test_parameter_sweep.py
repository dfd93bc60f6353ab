"""Several values of one entry: each solution is that of its own scene."""

import numpy as np
import pytest
from mpi4py import MPI
from numpy.testing import assert_allclose
from scene_tables import coulomb_friction, rectangle_mesh
from scenes import alone

from signorini_fx.errors import SceneError
from signorini_fx.records import Status
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.sweep import sweep

# The entry, its values, and how many times the stiffness is assembled for them.
ENTRIES = {
    "contact[0].gap": (["0.01 + 0.02 * (x[0] - 0.4)**2", "0.02 * (x[0] - 0.6)**2", 0.004], 1),
    "contact[0].friction.coefficient": ([0.1, 0.5, 0.2], 1),
    "material.young": ([500.0, 2000.0, 900.0], 3),
    "traction[0].y": (["-1 - x[0]", "1 + x[0]", -1.5], 3),
    "mesh.parameters.nx": ([24, 12, 30], 3),
}


def leaning(path=None, value=None):
    """A block that drops on its foundation, pressed against a smooth wall, with another value of an
    entry.
    """
    data = {
        "mesh": rectangle_mesh(24, 6, length=1.0, height=0.3),
        "material": {"young": 1000.0, "poisson": 0.3},
        "traction": [{"boundary": "top", "y": "-1 - x[0]"}, {"boundary": "right", "x": -0.05}],
        "contact": [
            {
                "boundary": "bottom",
                "gap": "0.01 + 0.02 * (x[0] - 0.4)**2",
                "friction": coulomb_friction(0.3),
            },
            {"boundary": "left"},
        ],
    }
    if path is not None:
        *tables, key = path.replace("]", "").replace("[", ".").split(".")
        table = data
        for name in tables:
            table = table[int(name) if name.isdigit() else name]
        table[key] = value
    return parse_scene(data)


@pytest.mark.mpi(slow=True)
@pytest.mark.one_quick("path", ENTRIES)
def test_values_of_an_entry(path):
    """The elastic system is assembled anew only where it changes; a value may have no solution."""
    values, matrices = ENTRIES[path]
    wanted = [alone(leaning(path, value), check=False) for value in values]
    points = list(sweep(leaning(), {path: values}))
    for point, solution in zip(points, wanted, strict=True):
        assert point.status is solution.status
        if solution.status is not Status.CONVERGED:
            continue
        assert point.certificate.holds
        size = np.abs(solution.contact.forces).max()
        assert_allclose(point.contact.forces, solution.contact.forces, rtol=0, atol=1e-8 * size)
        pressure = MPI.COMM_WORLD.allreduce(point.contact.pressure.max(initial=0.0), MPI.MAX)
        assert_allclose(pressure, solution.contact.pressure.max(), rtol=1e-6)
    assert len({id(point.model.stiffness) for point in points}) == matrices


def test_load_steps_and_several_meshes():
    """Scenes that are more than one contact problem are solved as ``solve`` does it."""
    slid = leaning("traction", [{"boundary": "top", "y": -1.0, "factors": [0.5, 1.0]}])
    finer = leaning("solver", {"levels": 2})
    for scene, steps in ((slid, 2), (finer, 1)):
        for value, point in zip(
            (0.1, 0.3), sweep(scene, {"contact[0].friction.coefficient": (0.1, 0.3)}), strict=True
        ):
            wanted = alone(scene.remade(contact=point.statement.contact))
            assert point.statement.contact[0].friction.coefficient == value
            assert len(point.steps) == steps
            assert_allclose(point.contact.forces, wanted.contact.forces, rtol=0, atol=1e-8)


def test_values_are_refused_by_their_place():
    """Before anything is solved."""
    with pytest.raises(SceneError, match=r"material\[0\].young"):
        sweep(leaning(), {"material.young": [1.0, -1.0]})
    with pytest.raises(SceneError, match=r"contact\[2\]"):
        sweep(leaning(), {"contact[2].gap": [1.0]})
