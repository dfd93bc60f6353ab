"""Everyday problems of rubber and metal after examples of felupe and CalculiX, each small: solved,
or ended by the outcome that it has; with what is known of them.
"""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scene_tables import circle_shape, coulomb_friction, fixed, plane_shape, rectangle_mesh
from scenes import alone

from signorini_fx import Status
from signorini_fx.mechanics.mesh.tagged import tagged_mesh
from signorini_fx.scenes.reading import parse_scene

RUBBER = {"law": "neo-hooke", "young": 1.0, "poisson": 0.45}
METAL = {"law": "j2", "strains": "finite", "young": 200.0, "poisson": 0.3, "yield_stress": 0.3}
METAL |= {"hardening": 0.5}
STIFF = {"law": "saint-venant-kirchhoff", "young": 1e6, "poisson": 0.0}
ROUND = {"hypothesis": "axisymmetric"}
AUTO = {"element": {"volumetric": "auto"}}


def bent(cells, low, high, place=None):
    """A rectangle of quadrilaterals with its four sides, moved by a function of x and y."""
    mesh = dmesh.create_rectangle(
        MPI.COMM_SELF, [low, high], list(cells), dmesh.CellType.quadrilateral
    )
    ends = {"left": (0, low), "right": (0, high), "bottom": (1, low), "top": (1, high)}
    sides = {
        name: dmesh.locate_entities_boundary(mesh, 1, lambda x, k=k, at=at: np.isclose(x[k], at[k]))
        for name, (k, at) in ends.items()
    }
    if place is not None:
        mesh.geometry.x[:, :2] = np.column_stack(place(*mesh.geometry.x[:, :2].T.copy()))
    return tagged_mesh(mesh, sides)


def arc(angles, radius=1.0):
    """A function that bends the x of ``bent`` into these angles, and its y into radii."""

    def place(x, y):
        angle = angles[0] + (angles[1] - angles[0]) * x
        return (radius + y) * np.cos(angle), (radius + y) * np.sin(angle)

    return place


def polyline(points, **motion):
    return {"shape": "polyline", "points": np.asarray(points).tolist()} | motion


def quarter(centre, radius, first, last, count=9):
    """Points of an arc of a polyline, between two angles in degrees."""
    angles = np.radians(np.linspace(first, last, count))
    return [[centre[0] + radius * np.cos(a), centre[1] + radius * np.sin(a)] for a in angles]


def rough(boundary, shape, coefficient=0.2):
    friction = {"friction": coulomb_friction(coefficient)} if coefficient else {}
    return {"boundary": boundary, "foundation": shape} | friction


def disk(x, y):
    """A square as a disk."""
    return x * np.sqrt(1 - y * y / 2), y * np.sqrt(1 - x * x / 2)


UPSET = plane_shape([0.0, 15.0], [0.0, -1.0]) | {"shift": [0.0, "-5*t"]}
GROOVE = [[1.02, -3.0], [1.02, 0.55], [1.05, 0.68], [1.12, 0.75], [1.25, 0.8], [3.0, 0.8]]
BORE = [[1.0, -3.0], [1.0, -0.3], [1.2, 0.0], [1.2, 3.0]]
# A sharp end of a body does not pass a sharp corner with friction: both ends have chamfers.
BARB = [[0.85, 0.2], [0.85, 0.0], [0.9, -0.2], [1.2, -1.05], [1.2, -1.2], [1.05, -1.3]]
BARB += [[1.05, -3.5]]
NOSE = [[0.0, -0.32], *quarter((4.6, -0.32), 0.5, 180, 0, 13), [9.0, -0.32]]
PUNCH = [[10.0, 30.0], *quarter((7.0, 4.0), 3.0, 0, -90), [-1.0, 1.0]]
DIE = [[11.5, -30.0], *quarter((14.5, -3.0), 3.0, 180, 90), [40.0, 0.0]]
CLAMPED = [fixed("left"), {"boundary": "right", "x": "-0.012*t", "y": 0.0}]
WALLS = [
    rough("top", plane_shape([0.0, 0.02], [0.0, -1.0]), 0),
    rough("bottom", plane_shape([0.0, -0.02], [0.0, 1.0]), 0),
]


def strip(length):
    return bent(
        (80, 2),
        [0.0, -0.005],
        [length, 0.005],
        lambda x, y: (x, y + 0.0005 * (1 - np.cos(2 * np.pi * x))),
    )


# The mesh, the material, the supports, the contacts, times, steps in each, and further entries.
PROBLEMS = {
    "indentation": lambda: (
        rectangle_mesh(24, 6, length=4.0),
        RUBBER,
        [fixed("bottom")],
        [
            rough(
                "top",
                circle_shape([1.5, 1.5], 0.5) | {"shift": ["0.4*max(t-1,0)", "-0.4*min(t,1)"]},
                0.3,
            )
        ],
        ([1.0, 2.0], 5, AUTO),
    ),
    "ball into metal and out": lambda: (
        bent((16, 10), [0, 0], [2, 1], lambda x, y: (2 * (x / 2) ** 1.3, 1 - (1 - y) ** 1.3)),
        METAL | ROUND,
        [fixed("left", "x"), fixed("bottom")],
        [
            rough(
                "top",
                circle_shape([0.0, 2.0], 1.0) | {"shift": [0.0, "-0.1*min(t,2-t)"]},
                0,
            )
        ],
        ([1.0, 2.0], 8, AUTO),
    ),
    "o-ring into its gap": lambda: (
        bent((12, 12), [-1.0, -1.0], [1.0, 1.0], disk),
        RUBBER | {"young": 2.0},
        [],
        [
            rough("bottom", plane_shape([0.0, -1.0], [0.0, 1.0]), 0.1),
            rough(
                "top",
                plane_shape([0.0, 1.0], [0.0, -1.0]) | {"shift": [0.0, "-0.3*min(t,1)"]},
                0.1,
            ),
            rough("right", polyline(GROOVE), 0.1),
        ],
        ([1.0, 2.0], 6, AUTO | {"traction": [{"boundary": "left", "pressure": "0.5*max(t-1,0)"}]}),
    ),
    "bending and spring-back": lambda: (
        bent((40, 3), [0.0, 0.0], [8.0, 0.4]),
        METAL,
        [fixed("left", "x")],
        [
            rough("top", circle_shape([0.0, 1.9], 1.5) | {"shift": [0.0, "-1.5*min(t,2-t)"]}, 0.1),
            rough("bottom", circle_shape([4.0, -1.0], 1.0), 0.1),
        ],
        ([1.0, 1.9], 12, AUTO),
    ),
    "hook": lambda: (
        bent((30, 3), [0.0, 0.0], [6.0, 0.3]),
        STIFF | {"young": 1e3, "poisson": 0.35},
        [{"boundary": "left", "x": "-1.5*t", "y": 0.0}],
        [rough("bottom", polyline(NOSE))],
        ([1.0], 20, {}),
    ),
    "belt": lambda: (
        bent((48, 2), [0.0, 0.0], [1.0, 0.02], arc((0.0, np.pi / 2))),
        RUBBER | {"young": 1e4, "poisson": 0.3},
        [{"boundary": "right", "x": "-0.004*max(t-1,0)"}],
        [rough("bottom", circle_shape([0.0, 0.0], 1.0), 0.3)],
        ([1.0, 2.0], 4, {"traction": [{"boundary": "left", "y": "-50*min(t,1)"}]}),
    ),
    "tyre": lambda: (
        bent((48, 3), [0.0, 0.0], [1.0, 0.2], arc((-np.pi / 2, np.pi / 2))),
        RUBBER | {"young": 5.0},
        [fixed("left", "x"), fixed("right")],
        [
            rough(
                "top",
                plane_shape([0.0, -1.2], [0.0, 1.0]) | {"shift": [0.0, "0.3*max(t-1,0)"]},
                0.5,
            )
        ],
        ([1.0, 2.0], 6, AUTO | {"traction": [{"boundary": "bottom", "pressure": "0.2*min(t,1)"}]}),
    ),
    "bellows": lambda: (
        bent(
            (72, 2),
            [0.0, 0.0],
            [3.0, 0.08],
            lambda x, y: (1.96 + 0.3 * np.cos(2 * np.pi * x) + y, x),
        ),
        RUBBER | ROUND | {"young": 5.0, "poisson": 0.4},
        [fixed("left"), {"boundary": "right", "x": 0.0, "y": "-2.1*t"}],
        [{"boundary": side, "against": side} for side in ("top", "bottom")],
        ([1.0], 25, AUTO),
    ),
    "column": lambda: (
        bent(
            (2, 60),
            [0.0, 0.0],
            [0.06, 2.0],
            lambda x, y: (x + 0.01 * np.sin(np.pi * y / 2) ** 2, y),
        ),
        RUBBER | {"poisson": 0.3},
        [fixed("bottom"), {"boundary": "top", "x": 0.0, "y": "-1.9*t"}],
        [{"boundary": side, "against": side} for side in ("left", "right")],
        ([1.0], 40, {}),
    ),
    "strip between walls": lambda: (
        strip(1.0),
        STIFF,
        CLAMPED,
        WALLS,
        ([1.0], 24, {"element": {"degree": 2}}),
    ),
    "half a strip between walls": lambda: (
        strip(0.5),
        STIFF,
        [fixed("left"), {"boundary": "right", "x": "-0.0013*t"}],
        WALLS,
        ([1.0], 24, {"element": {"degree": 2}}),
    ),
    "upsetting": lambda: (
        rectangle_mesh(10, 12, length=10.0, height=15.0),
        METAL | ROUND | {"yield_stress": 0.7, "hardening": 0.3},
        [fixed("left", "x"), fixed("bottom", "y")],
        [rough(side, UPSET, 0.3) for side in ("top", "right")],
        ([1.0], 10, AUTO),
    ),
    "cup": lambda: (
        bent((40, 2), [0.0, 0.0], [20.0, 1.0]),
        METAL | ROUND,
        [fixed("left", "x")],
        [
            rough("top", polyline(PUNCH, shift=[0.0, "-6*t"]), 0.1),
            rough("bottom", polyline(DIE), 0.05),
        ],
        ([1.0], 20, AUTO),
    ),
    "bush in a bore": lambda: (
        bent(
            (4, 20),
            [0.5, 0.0],
            [1.05, 1.0],
            lambda x, y: (0.5 + (x - 0.5) * (1 - 0.2 * np.maximum(0, 1 - y / 0.2) ** 2), y),
        ),
        RUBBER | ROUND,
        [fixed("left")],
        [rough("right", polyline(BORE, shift=[0.0, "1.2*t"]))],
        ([1.0], 12, {}),
    ),
    "hose over a barb": lambda: (
        bent(
            (3, 24),
            [1.0, 0.0],
            [1.25, 3.0],
            lambda x, y: (x + 0.3 * (1.25 - x) * np.maximum(0, 1 - y / 0.3) ** 2, y),
        ),
        RUBBER | ROUND,
        [fixed("top")],
        [rough("left", polyline(BARB, shift=[0.0, "1.5*t"]))],
        ([1.0], 15, AUTO),
    ),
    "block dragged to and fro": lambda: (
        rectangle_mesh(12, 6, length=2.0),
        RUBBER,
        [fixed("top")],
        [
            rough(
                "bottom",
                plane_shape([0.0, 0.0], [0.0, 1.0])
                | {"shift": ["0.3*sin(max(t-1,0)*pi/2)", "0.1*min(t,1)"]},
                0.5,
            )
        ],
        ([1.0, 2.0, 4.0], 8, AUTO),
    ),
}
OUTCOMES = {"strip between walls": Status.UNSTABLE}


def column_loads(solution):
    """The force with which the right end of a strip is pushed in each step, over that at which it
    buckles between clamps one apart, and the number of its nodes that touch a wall.
    """
    found = []
    for step in solution.steps:
        rows = solution.at(step).resultants.as_rows()
        force = next(row["force"][0] for row in rows if row["boundary"] == "right")
        load = -force / (4 * np.pi**2 * 1e6 * 0.01**3 / 12)
        found.append((load, np.count_nonzero(step.contact.in_contact)))
    return found


def check_sliding(solution):
    normal, friction = (np.linalg.norm(force) for force in solution.contact.forces)
    assert friction == pytest.approx(0.2 * normal, rel=1e-5)


def check_dent(solution):
    lowest = solution.displacement.x.array.reshape(-1, 2)[:, 1].min()
    assert np.abs(solution.contact.forces).max() == 0.0
    assert -0.1 < lowest < -0.05


def check_belt(solution):
    """Euler's formula, of a belt as thin as a line."""
    tensions = np.abs(np.sum(solution.contact.forces, axis=0))
    assert tensions[1] == pytest.approx(1.0, rel=1e-6)
    assert tensions[0] == pytest.approx(np.exp(0.3 * np.pi / 2), rel=5e-3)


def check_touching(solution):
    said = [found.message for found in solution.findings if "touches itself" in found.message]
    assert any(not text.startswith("touches itself at 0 of") for text in said)


def check_strip(solution):
    """It snaps at the load of the mode that is odd about its middle, 8.183 pi^2 E I / L^2."""
    load, touching = column_loads(solution)[-1]
    assert touching == 1
    assert load == pytest.approx(8.183 / 4, rel=1e-2)


def check_half_strip(solution):
    """It is held straight by its middle up to 16 pi^2 E I / L^2, at which load it goes on to bend
    (H. Chai, J. Mech. Phys. Solids 46 (1998) 1155-1171).
    """
    loads = [load for load, _ in column_loads(solution)]
    assert loads == sorted(loads)
    assert loads[-1] == pytest.approx(16 / 4, rel=1e-2)
    assert loads[-1] - loads[-5] < 1e-2 < loads[12] - loads[8]


CHECKS = {
    "ball into metal and out": check_dent,
    "hook": check_sliding,
    "belt": check_belt,
    "bellows": check_touching,
    "column": check_touching,
    "strip between walls": check_strip,
    "half a strip between walls": check_half_strip,
    "bush in a bore": check_sliding,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", PROBLEMS)
def test_everyday_problems(name):
    mesh, material, displacement, contact, (times, steps, further) = PROBLEMS[name]()
    scene = {"mesh": mesh, "material": material, "displacement": displacement, "contact": contact}
    scene |= {"load_steps": {"times": times, "steps": steps}} | further
    solution = alone(parse_scene(scene), check=False)
    assert solution.status is OUTCOMES.get(name, Status.CONVERGED)
    if name in CHECKS:
        CHECKS[name](solution)
