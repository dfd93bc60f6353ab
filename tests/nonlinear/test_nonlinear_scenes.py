"""Scenes with nonlinear materials: closed forms, others' figures, linear limits, rotations, units
and ranks.
"""

import numpy as np
import pytest
from mpi4py import MPI
from on_meshes import turn_by
from scene_tables import coulomb_friction, fixed
from scipy.optimize import brentq
from support.nonlinear_scenes import (
    LAWS,
    block,
    but_slow,
    energy_of_stretches,
    flattened_disk,
    force,
    indented,
    material,
    pressed_cube,
    slope,
)

from signorini_fx import ConvergenceError, Status, solve, write_results
from signorini_fx.solving.meshed_problem import Unsolved

HYPERELASTIC = [name for name in LAWS if name != "j2"]


def pressed_block(energy, height, free):
    """The nominal stress along axis 1 of a block whose stretch along the axes ``free`` adjusts
    itself.
    """

    def stretches(wide, high):
        return [high if axis == 1 else wide if axis in free else 1.0 for axis in range(3)]

    wide = brentq(
        lambda wide: slope(lambda x: energy(*stretches(x, height)), wide), 0.7, 2.0, xtol=1e-14
    )
    return slope(lambda high: energy(*stretches(wide, high)), height)


# A law, the body, and the axes along which its stretches adjust themselves.
BLOCKS = [
    *((name, "plane", (0,)) for name in HYPERELASTIC),
    *((name, "revolved", (0, 2)) for name in ("neo-hooke", "mooney-rivlin", "ogden")),
    ("ogden", "revolved, degree 2", (0, 2)),
    *(
        (name, "cube", (0, 2))
        for name in ("neo-hooke, isochoric", "saint-venant-kirchhoff", "mooney-rivlin")
    ),
]
QUICK = [("neo-hooke", "plane"), ("ogden", "revolved, degree 2")]


@pytest.mark.parametrize(
    ("name", "body", "free"),
    [pytest.param(*case, marks=[pytest.mark.slow] * (case[:2] not in QUICK)) for case in BLOCKS],
)
def test_a_body_between_plates(name, body, free):
    """Nominal stress from the stretches alone, loaded and unloaded; of revolution the force is that
    of all around.
    """
    path, steps = (
        "0.1*t if t <= 1 else (0.2*t - 0.1 if t <= 2 else 0.6 - 0.15*t)",
        {"times": [1.0, 2.0, 3.0]},
    )
    revolved = body.startswith("revolved")
    law = material(name, **({"hypothesis": "axisymmetric"} if revolved else {}))
    element = {"element": {"degree": 2}} if body.endswith("2") else {}
    solution = solve(
        (pressed_cube if body == "cube" else block)(law, path, load_steps=steps, **element),
        MPI.COMM_SELF,
    )
    expected = [
        pressed_block(energy_of_stretches(name), height, free) for height in (0.9, 0.7, 0.85)
    ]
    found = [force(step)[-1] / (np.pi if revolved else 1.0) for step in solution.steps]
    assert found == pytest.approx(expected, rel=1e-7)
    assert solution.certificate.holds


@pytest.mark.slow
def test_a_disk_of_rubber():
    """Forces of felupe and of a Newton method with the exact law, on the same kind of mesh (16
    cells per side), and the bulge at the last one.  Ogden's material with one exponent 2 is this
    one.
    """
    constants = {
        "mooney-rivlin": {"c10": 0.5, "bulk": 10.0},
        "ogden": {"mu": [1.0], "alpha": [2.0], "bulk": 10.0},
    }
    for law, numbers in constants.items():
        solution = solve(
            flattened_disk({"law": law, **numbers}, 16, "0.1*t", times=[1, 2, 3, 4]), MPI.COMM_SELF
        )
        expected = [0.144644, 0.403534, 0.832366, 1.566154]
        assert [-force(step)[1] for step in solution.steps] == pytest.approx(expected, rel=3e-4)
        assert solution.displacement.x.array.max() == pytest.approx(0.3205, abs=1e-4)


@pytest.mark.slow
def test_a_disk_that_yields():
    """Forces of another return mapping and of CalculiX, with steps of 0.005 and of 0.0025, and of
    its unloading.
    """
    law = {"law": "j2", "young": 1000.0, "poisson": 0.3, "yield_stress": 5.0, "hardening": 10.0}
    path = "0.01*t - 0.014*max(t - 4, 0)"
    solution = solve(flattened_disk(law, 32, path, times=[1, 2, 3, 4, 5], steps=2), MPI.COMM_SELF)
    forces = [-force(step)[1] for step in solution.steps if step.time == round(step.time)]
    assert forces == pytest.approx([1.29487, 2.06439, 2.40637, 2.59112, 0.83804], rel=1e-3)


WARMER = {"temperature": {"change": "1e-3 * (1 + x[0] - 2 * x[1]) * t"}}


@pytest.mark.parametrize("warmer", [{}, WARMER], ids=["", "warmer"])
@pytest.mark.parametrize("name", but_slow(LAWS, "j2"))
def test_small_loads_are_those_of_the_linear_scene(name, warmer):
    """To first order in the strain, and in what the normals of the circle turn by; with a
    temperature that is linear in the place, which changes the force.
    """
    exact, heat = (
        {"depth": 1e-6, "solver": {"algorithm": "alm"}, **warmer},
        {"expansion": 1e-3} if warmer else {},
    )
    solution = solve(indented(material(name) | heat, **exact), MPI.COMM_SELF)
    rest = solution.statement.material[0].at_rest
    linear = solve(
        indented({"young": rest.young, "poisson": rest.poisson} | heat, **exact), MPI.COMM_SELF
    )
    for mine, theirs in zip(solution.steps, linear.steps, strict=True):
        assert (
            np.abs(force(mine) - force(theirs)).max()
            < (5e-5 if warmer else 2e-5) * np.abs(force(theirs)).max()
        )
    if warmer:
        cold = solve(
            indented(material(name), depth=1e-6, solver={"algorithm": "alm"}), MPI.COMM_SELF
        )
        assert np.abs(force(mine) - force(cold.steps[-1])).max() > 0.1 * np.abs(force(mine)).max()
    mine, theirs = solution.displacement.x.array, linear.displacement.x.array
    assert np.abs(mine - theirs).max() < (2e-5 if warmer else 1e-5) * np.abs(theirs).max()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["neo-hooke", "ogden"])
def test_objectivity(name):
    """A scene that is rotated as a whole has rotated forces."""
    angle = 0.7
    turn = turn_by(angle)
    exact = {
        "solver": {"algorithm": "alm"}
    }  # the penalty follows entries of the matrix, which rotate
    first = solve(indented(material(name), **exact), MPI.COMM_SELF)
    tagged = first.model.tagged
    tagged.mesh.geometry.x[:, :2] = tagged.mesh.geometry.x[:, :2] @ turn.T
    ways = ["max(0.1*(t - 1), 0)", "-0.2*min(t, 1)"]
    shift = [f"({row[0]:.17g}) * {ways[0]} + ({row[1]:.17g}) * ({ways[1]})" for row in turn]
    circle = {"shape": "circle", "centre": list(turn @ (0.8, 1.5)), "radius": 0.5, "shift": shift}
    contact = {"boundary": "top", "foundation": circle, "friction": coulomb_friction(0.3)}
    turned = solve(indented(material(name), mesh=tagged, contact=contact, **exact), MPI.COMM_SELF)
    for mine, theirs in zip(turned.steps, first.steps, strict=True):
        assert turn.T @ force(mine) == pytest.approx(force(theirs), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ogden", "j2"])
def test_units(name):
    """Lengths in micrometres and stresses in other units: the same steps, and forces of the same
    digits.  Of metal round-off decides which points yield in an iteration, and so how many there
    are.
    """
    unit, stress = 1e-6, 1e3
    keys = ("young", "mu", "bulk", "yield_stress")
    law = material(name, **({"yield_stress": 5.0} if name == "j2" else {}))
    scaled = {
        key: (np.multiply(value, stress).tolist() if key in keys else value)
        for key, value in law.items()
    }
    first, second = (
        solve(scene, MPI.COMM_SELF) for scene in (indented(law), indented(scaled, unit=unit))
    )
    for mine, theirs in zip(second.steps, first.steps, strict=True):
        assert force(mine) / unit / stress == pytest.approx(force(theirs), rel=1e-7)
        assert mine.linear_solves == theirs.linear_solves or name == "j2"


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.parametrize("name", ["ogden", "j2"])
def test_ranks(name):
    """The forces are those of one rank."""
    law = material(
        name,
        **({"yield_stress": 5.0, "hardening": [[0.01, 6.0], [0.1, 8.0]]} if name == "j2" else {}),
    )
    comm, scene = MPI.COMM_WORLD, indented(law, element={"volumetric": "reduced"})
    several, alone = solve(scene, comm), solve(scene, MPI.COMM_SELF)
    for mine, theirs in zip(several.steps, alone.steps, strict=True):
        assert force(mine) == pytest.approx(force(theirs), rel=1e-7)


def test_condensed():
    """Each linearisation has another load, which the factor of the first one condenses."""
    kinds = ("full", "condensed")
    full, ours = (
        solve(indented(material("neo-hooke"), solver={"linear_algebra": kind})) for kind in kinds
    )
    assert force(ours.steps[-1]) == pytest.approx(force(full.steps[-1]), rel=1e-8)


@pytest.mark.mpi
@pytest.mark.one_quick("law", ["neo-hooke", "j2"])
def test_a_path_without_a_first_step(law, tmp_path):
    """Its outcome has a name, and the body is shown as it was before, under the load that it does
    not carry.
    """
    scene = block(
        material(law),
        "0",
        displacement=fixed("left", "x"),
        traction={"boundary": "top", "y": 1.0, "factors": [1.0, 2.0]},
        contact={"boundary": "bottom"},
        load_steps={"names": ["lift", "lift on"], "times": [1.0, 2.0]},
    )
    solution = solve(scene, check=False)
    assert solution.status is Status.LIMIT
    assert [step.status for step in solution.steps] == [Status.LIMIT]
    assert 0.0 < solution.last_step.time < 0.01
    assert not solution.displacement.x.array.any()
    assert not solution.certificate.holds
    load = solution.resultants.of("top").force
    assert load == pytest.approx([0.0, solution.last_step.time], rel=1e-9)
    findings = [finding.message for finding in solution.findings if finding.path == "load_steps"]
    assert "there is no solution before it; a step to" in findings[0]
    assert Unsolved.by_outcome(solution, "mesh 2").reason == f"mesh 2 ends with: {findings[0]}"
    folder = MPI.COMM_WORLD.bcast(str(tmp_path))
    assert write_results(solution, folder, pictures=False)["status"] == Status.LIMIT.value
    with pytest.raises(
        ConvergenceError, match=r"(?s)step 1 \(lift, time 0.0078.*contact opens"
    ) as error:
        solve(scene)
    assert error.value.solution.status is Status.LIMIT


@pytest.mark.one_quick("name", ["neo-hooke", "j2"])
def test_a_path_may_begin_at_rest(name):
    """A plate that touches an unloaded body is a solution, of which all figures are round-off of
    positions; the next step is pressed as without it.
    """
    further = {"displacement": fixed("bottom"), "solver": {}}
    begun = further | {"load_steps": {"times": [0.0, 1.0]}}
    solution = solve(block(material(name), "0.05*t", cells=(8, 8), **begun), MPI.COMM_SELF)
    assert [step.status for step in solution.steps] == [Status.CONVERGED] * 2
    assert np.abs(force(solution.steps[0])).max() < 1e-10
    at_once = solve(block(material(name), "0.05*t", cells=(8, 8), **further), MPI.COMM_SELF)
    np.testing.assert_allclose(
        force(solution.steps[1]), force(at_once.steps[0]), rtol=2e-5, atol=1e-9
    )
