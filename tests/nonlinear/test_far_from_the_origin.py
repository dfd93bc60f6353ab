"""Nonlinear scenes far from the origin: coordinates lose digits there, and answers and verdicts no
more than these.
"""

import numpy as np
import pytest
from mpi4py import MPI
from scene_tables import fixed, rectangle_mesh
from support.nonlinear_bodies import stress_of_block
from support.nonlinear_scenes import material

from benchmarks.stability.nonlinear_scenes import Judge, RandomScene, Step, gathered
from signorini_fx import solve
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_SELF
# units in the last place of coordinates that displacements may lose, and strains over the size of a
# cell
UNITS_OF_PLACES = 4.0


def moved(stated, far):
    """A scene with all that has a place, as a table, moved."""
    tagged = load_mesh(parse_scene(stated), COMM)
    tagged.mesh.geometry.x[:, : far.size] += far
    foundation = stated["contact"]["foundation"]
    for place in {"centre", "point", "pivot"} & set(foundation):
        foundation[place] = (np.array(foundation[place]) + far).tolist()
    if "temperature" in stated:
        for k, way in enumerate(far.tolist()):
            change = stated["temperature"]["change"]
            stated["temperature"]["change"] = change.replace(f"x[{k}]", f"(x[{k}] - {way!r})")
    return parse_scene(stated | {"mesh": tagged})


# With a pull before there is contact (15, 35), and pressed by ways of 1e-4 of the size (6).
@pytest.mark.one_quick("seed", [6, 15, 35])
def test_a_scene_as_the_judge_sees_it(seed):
    """1e6 times its size away from the origin: certified, right for another program that looks at
    the origin, and with the displacements of the scene at the origin, to the last digits of
    coordinates.
    """
    drawn = RandomScene.drawn(seed)
    size, dim = drawn.sizes.max(), drawn.sizes.size
    far = 1e6 * size * np.array([1.0, 0.7, -0.4])[:dim]
    if drawn.kind == "axisymmetric":
        far[0] = 0.0
    there, here = (
        solve(scene, COMM, check=False)
        for scene in (moved(drawn.stated(), far), parse_scene(drawn.stated()))
    )
    assert there.status is here.status
    at_origin = {step.time: step.displacement.x.array for step in here.steps}
    x, cells, displacements = gathered(there, COMM)
    judge, before = (
        Judge(drawn, x - far, cells),
        Step(0.0, np.zeros_like(x), np.zeros(dim), np.zeros(dim)),
    )
    for step, u in zip(there.steps, displacements, strict=True):
        motion = (
            step.rigid_bodies[0].translation
            if drawn.push is not None
            else drawn.between(step.time, drawn.ways)
        )
        now = Step(step.time, u, motion, np.sum(step.contact.forces, axis=0))
        assert judge.faults(now, before) == []
        before = now
        lost = np.abs(step.displacement.x.array - at_origin[step.time]).max()
        assert lost < UNITS_OF_PLACES * np.finfo(float).eps * np.abs(x).max()


@pytest.mark.one_quick(("unit", "far"), [(1e-6, 1e6), (1e6, 1e3)])
def test_block_between_plates(unit, far):
    """Compressed by a third in plane strain: the pressure in closed form, to the digits of
    coordinates over a cell.
    """
    plate = {
        "shape": "plane",
        "point": [0.0, unit],
        "normal": [0.0, -1.0],
        "shift": [0.0, f"-{unit / 3}*t"],
    }
    stated = {
        "mesh": rectangle_mesh(4, 4, length=unit, height=unit),
        "material": material("neo-hooke"),
        "displacement": [fixed("left", "x"), fixed("bottom", "y")],
        "contact": {"boundary": "top", "foundation": plate},
        "load_steps": {"times": [1.0]},
        "solver": {"algorithm": "alm"},
    }
    place = far * unit * np.array([1.0, 0.7])
    solution = solve(moved(stated, place), COMM)
    pressed = -stress_of_block(2 / 3)
    lost = UNITS_OF_PLACES * np.finfo(float).eps * 4 * far
    assert solution.contact.pressure == pytest.approx(pressed, rel=max(1e-9, lost))
