"""Many values of one parameter: every point is the solution of its own scene."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scenes import alone

from signorini_fx.errors import SceneError
from signorini_fx.records import Status
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.sweep import sweep


def floating(friction, load=1.0):
    """A block that drops on its foundation, and turns."""
    return parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": {"length": 1.0, "height": 0.3, "nx": 24, "ny": 6}},
            "material": {"young": 1000.0, "poisson": 0.3},
            "traction": {"boundary": "top", "x": 0.05 * load, "y": f"{-load} * (1 + x[0])"},
            "contact": {"boundary": "bottom", "gap": "0.01 + 0.02 * (x[0] - 0.4)**2", "friction": friction},
        }
    )


@pytest.mark.one_quick
@pytest.mark.parametrize(
    "friction",
    [{"law": "coulomb", "coefficient": 0.3}, {"law": "tresca", "bound": 0.5}],
    ids=lambda friction: friction["law"],
)
def test_loads_that_vanish_and_turn_round(friction):
    """The reference motion is that of the scene's own load; it is an origin, and changes no solution and no outcome."""
    points = sweep(floating(friction), MPI.COMM_SELF, loads=[1.0, 0.0, 0.5, -1.0, 2.0])
    assert [point.status for point in points if point.value <= 0] == [Status.OPEN, Status.OPEN]
    for point in points:
        if point.value > 0:
            assert point.status is Status.CONVERGED
            assert point.certificate().holds
            wanted = alone(floating(friction, point.value)).contact
            for name in ("pressure", "shear"):
                size = np.abs(wanted.pressure).max()
                np.testing.assert_allclose(
                    getattr(point.contact, name), getattr(wanted, name), rtol=0, atol=1e-6 * size
                )


ENTRIES = {
    "contact[0].gap": (["0.01 + 0.02 * (x[0] - 0.4)**2", "0.02 * (x[0] - 0.6)**2", 0.004], 1),
    "contact[0].friction.coefficient": ([0.1, 0.5, 0.2], 1),
    "material.young": ([500.0, 2000.0, 900.0], 3),
    "traction[0].y": (["-1 - x[0]", "-2 + x[0]", -1.5], 1),
    "mesh.parameters.nx": ([24, 12, 30], 3),
}


def leaning(path=None, value=None):
    """A block that drops on its foundation, pressed against a smooth wall, with another value of an entry."""
    data = {
        "mesh": {"generator": "rectangle", "parameters": {"length": 1.0, "height": 0.3, "nx": 24, "ny": 6}},
        "material": {"young": 1000.0, "poisson": 0.3},
        "traction": [{"boundary": "top", "y": "-1 - x[0]"}, {"boundary": "right", "x": -0.05}],
        "contact": [
            {
                "boundary": "bottom",
                "gap": "0.01 + 0.02 * (x[0] - 0.4)**2",
                "friction": {"law": "coulomb", "coefficient": 0.3},
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


@pytest.mark.one_quick
@pytest.mark.mpi(slow=True)
@pytest.mark.parametrize("path", ENTRIES)
def test_values_of_an_entry(path):
    """Each point is the solution of a scene of its own; the elastic system is assembled anew only where it changes."""
    values, matrices = ENTRIES[path]
    wanted = [alone(leaning(path, value)) for value in values]
    points = sweep(leaning(), MPI.COMM_WORLD, path=path, values=values)
    assert [point.value for point in points] == values
    for point, solution in zip(points, wanted, strict=True):
        assert point.status is Status.CONVERGED
        assert point.certificate().holds
        size = np.abs(solution.contact.forces).max()
        np.testing.assert_allclose(point.contact.forces, solution.contact.forces, rtol=0, atol=1e-8 * size)
        pressure = MPI.COMM_WORLD.allreduce(point.contact.pressure.max(initial=0.0), MPI.MAX)
        np.testing.assert_allclose(pressure, solution.contact.pressure.max(), rtol=1e-6)
    assembled = {id(point._model.inventory): point._model.inventory for point in points}
    assert sum(inventory.matrices.count("stiffness") for inventory in assembled.values()) == matrices
    assert len({id(point._model.tagged.mesh) for point in points}) == (3 if "mesh" in path else 1)


SPRINGS = {"springs": {"boundary": "right", "x": 50.0, "y": 20.0}}
# What else is in the scene, the entry, its values, and whether all values have one function space.
MODULI = {
    "Poisson's ratio, Q1": ({}, "material.poisson", [0.2, -0.1, 0.4], True),
    "springs, Q2": ({**SPRINGS, "element": {"degree": 2}}, "material.young", [400.0, 3000.0, 1000.0], True),
    "axisymmetric": ({"material": {"hypothesis": "axisymmetric"}}, "material.poisson", [0.2, 0.4], True),
    "graded": ({"material": {"grading": "1 - x[0] / 2"}}, "material.young", [400.0, 3000.0], True),
    "it begins to lock": ({"element": {"volumetric": "auto"}}, "material.poisson", [0.3, 0.499, 0.49], False),
    "a pressure": ({"element": {"degree": 2, "volumetric": "mixed"}}, "material.poisson", [0.3, 0.5], False),
    "warm": (
        {"material": {"expansion": 1e-5}, "temperature": {"change": "40 * x[1]"}},
        "material.young",
        [400.0, 3000.0],
        False,
    ),
}


def squeezed(further, path="", value=None):
    """A block that is moved onto its foundation, to the left of which it is held."""
    data = {
        "mesh": {"generator": "rectangle", "parameters": {"length": 1.0, "height": 0.4, "nx": 10, "ny": 4}},
        "displacement": [{"boundary": "left", "x": 0.0}, {"boundary": "top", "y": -2e-4}],
        "traction": {"boundary": "right", "x": -0.1},
        "contact": {"boundary": "bottom", "gap": 1e-4, "friction": {"law": "coulomb", "coefficient": 0.3}},
        "solver": {"coulomb": "newton"},  # to round-off, whatever the start
        **further,
    }
    data["material"] = {"young": 1000.0, "poisson": 0.3, **further.get("material", {})}
    if path:
        data["material"][path.removeprefix("material.")] = value
    return parse_scene(data)


@pytest.mark.one_quick
@pytest.mark.parametrize("name", MODULI)
def test_other_moduli_keep_all_but_the_stiffness(name):
    """Where loads or the element depend on them, nothing but the mesh stays; each value has its own solution."""
    further, path, values, stays = MODULI[name]
    points = sweep(squeezed(further), MPI.COMM_SELF, path=path, values=values)
    for point, wanted in zip(points, (alone(squeezed(further, path, value)) for value in values), strict=True):
        assert point.certificate().holds
        evaluated_anew = replace(point, _model=replace(point._model, of_mesh={}))
        assert point.certificate() == evaluated_anew.certificate()
        assert (wanted.contact.pressure > 0).any()
        owned = wanted.displacement.x.array
        np.testing.assert_allclose(point.displacement().x.array, owned, rtol=0, atol=1e-9 * np.abs(owned).max())
        size = np.abs(wanted.contact.forces).max()
        np.testing.assert_allclose(point.contact.forces, wanted.contact.forces, rtol=0, atol=1e-9 * size)
    assert (len({id(point._model.space) for point in points}) == 1) == stays


def test_values_are_refused_by_their_place():
    """Before anything is solved."""
    with pytest.raises(SceneError, match=r"material\[0\].young"):
        sweep(leaning(), MPI.COMM_SELF, path="material.young", values=[1.0, -1.0])
    with pytest.raises(SceneError, match=r"contact\[2\]"):
        sweep(leaning(), MPI.COMM_SELF, path="contact[2].gap", values=[1.0])
    with pytest.raises(SceneError, match="path and values"):
        sweep(leaning(), MPI.COMM_SELF, loads=[1.0], path="material.young", values=[1.0])
    for wrong in (
        {"loads": [1.0, np.nan]},
        {"loads": [np.inf]},
        {"coefficients": [np.nan]},
        {"coefficients": [0.1, -0.3]},
    ):
        with pytest.raises(SceneError, match="must be finite numbers"):
            sweep(leaning(), MPI.COMM_SELF, **wrong)
