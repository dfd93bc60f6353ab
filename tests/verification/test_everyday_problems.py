"""Everyday problems after examples of felupe and CalculiX, each small: solved, or ended by the
outcome that it has; with what is known of them.
"""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scene_tables import circle_shape, coulomb_friction, fixed, plane_shape, rectangle_mesh
from scenes import alone
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

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
    """A rectangle of quadrilaterals, or a box of hexahedra, with its sides, moved by a function of
    the coordinates.
    """
    dim = len(cells)
    names = [("left", "right"), *[("front", "back")] * (dim - 2), ("bottom", "top")]
    make, cell = dmesh.create_rectangle, dmesh.CellType.quadrilateral
    if dim == 3:
        make, cell = dmesh.create_box, dmesh.CellType.hexahedron
    mesh = make(MPI.COMM_SELF, [low, high], list(cells), cell)
    sides = {
        name: dmesh.locate_entities_boundary(
            mesh, dim - 1, lambda x, k=k, at=at: np.isclose(x[k], at[k])
        )
        for k, pair in enumerate(names)
        for name, at in zip(pair, (low, high), strict=True)
    }
    if place is not None:
        mesh.geometry.x[:, :dim] = np.column_stack(place(*mesh.geometry.x[:, :dim].T.copy()))
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
SLOPE, GROOVE_SLOPE, DIE_SLOPE, TAPER = np.tan(np.radians([15.0, 17.0, 8.0, 2.864789]))
CONE = [[1.2, -0.3 / DIE_SLOPE], *quarter((2.9, 0.14), 2.0, 188, 180, 5)]
CONE += quarter((1.2, 0.34), 0.3, 180, 100, 7)
CLAMPED = [fixed("left"), {"boundary": "right", "x": "-0.012*t", "y": 0.0}]
BELT = {"boundary": "bottom", "foundation": plane_shape([0.0, 0.0], [0.0, 1.0])}
BELT["foundation"]["shift"] = ["0.1*t", "0"]
BELT["friction"] = {"law": "stribeck", "coefficient": 0.4, "kinetic": 0.2, "speed": 0.05}
PULLED = {"springs": {"boundary": "left", "x": 2.0}, "traction": {"boundary": "top", "y": -1.0}}
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


SOFT_CORNER = (8, 11), 0.0, [("right", 1.0), ("bottom", 1.0)], [fixed("left", "x")]


def v_belt(cells, low, sides, supports, steps):
    """A belt from x = ``low`` on, on the walls of its groove on the right or on the left of it."""

    def place(x, y):
        return x * (0.6 + y * GROOVE_SLOPE), y

    walls = [
        rough(name, plane_shape([0.6 * side, 0.0], [-side, GROOVE_SLOPE]), 0.4)
        for name, side in sides
    ]
    pressed = AUTO | {"traction": [{"boundary": "top", "y": "-0.15*min(t,2-t)"}]}
    mesh = bent(cells, [low, 0.0], [1.0, 1.0], place)
    return mesh, RUBBER | {"density": 0.01}, supports, walls, (*steps[:2], pressed | steps[2])


# The mesh, the material, the supports, the contacts, times, steps in each, and further entries.
PROBLEMS = {
    "indentation": lambda: (
        rectangle_mesh(64, 16, length=4.0),
        RUBBER | {"young": 100.0, "poisson": 0.4},
        [fixed("bottom")],
        [
            rough(
                "top",
                circle_shape([1.5, 1.5], 0.5) | {"shift": ["0.5*max(t-1,0)", "-0.3*min(t,1)"]},
                0.3,
            )
        ],
        ([1.0, 2.0], 5, {}),
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
        bent((64, 1), [0.0, 0.0], [1.0, 0.02], arc((-np.pi / 2, np.pi / 2))),
        RUBBER | {"young": 1e3},
        [fixed("left", "x"), fixed("right")],
        [
            rough(
                "top",
                plane_shape([0.0, -1.02], [0.0, 1.0]) | {"shift": [0.0, "0.3*max(t-1,0)"]},
                0.5,
            )
        ],
        (
            [1.0, 2.0],
            6,
            {"element": {"degree": 2}}
            | {"traction": [{"boundary": "bottom", "pressure": "0.2*min(t,1)"}]},
        ),
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
                0.2,
            )
        ],
        ([1.0, 2.0, 4.0], 8, AUTO),
    ),
    "crossed wires": lambda: (
        bent(
            (12, 12, 10),
            [0.0, 0.0, 0.0],
            [1.0, 1.0, 1.0],
            lambda x, y, z: (
                0.6 * x**1.6,
                0.6 * y**1.6,
                -0.18 * y**3.2 * z - 0.6 * (1 - z) ** 1.6,
            ),
        ),
        {"young": 1.0, "poisson": 0.3},
        [fixed("bottom", "xyz"), fixed("left", "x"), fixed("front", "y")],
        [
            {
                "boundary": "top",
                "foundation": {"shape": "cylinder", "centre": [0.0, 0.0, 0.97], "radius": 1.0}
                | {"axis": [0.0, 1.0, 0.0]},
            }
        ],
        ([1.0], None, {}),
    ),
    "disc spring": lambda: (
        bent((12, 2), [12.7, 0.0], [25.0, 2.0], lambda x, y: (x, y + 1.4 * (25 - x) / 12.3)),
        STIFF | ROUND | {"young": 206000.0, "poisson": 0.3},
        [],
        [
            rough("bottom", plane_shape([0.0, 0.0], [0.0, 1.0]), 0),
            rough("top", plane_shape([0.0, 3.4], [0.0, -1.0]) | {"shift": [0.0, "-1.05*t"]}, 0),
        ],
        ([1.0], 6, {"element": {"degree": 2}}),
    ),
    "leaf springs": lambda: (
        [
            ("upper", bent((27, 1), [0.0, 0.0], [9.0, 0.2])),
            ("lower", bent((18, 1), [0.0, -0.2], [6.0, 0.0])),
        ],
        STIFF | {"young": 1e4},
        [
            fixed("upper.left"),
            fixed("lower.left"),
            {"boundary": "upper.right", "y": "-0.1*t"},
        ],
        [{"boundary": "upper.bottom", "against": "lower.top"}],
        ([1.0], 1, {"element": {"degree": 2}}),
    ),
    "wedge under a block": lambda: (
        [
            ("wedge", bent((12, 3), [0, 0], [3, 1], lambda x, y: (x, y * (0.5 + x * SLOPE)))),
            (
                "block",
                bent(
                    (8, 4),
                    [0.5, 0.0],
                    [2.5, 1.0],
                    lambda x, y: (x, (1 - y) * (0.5 + x * SLOPE) + 2 * y),
                ),
            ),
        ],
        {"young": 1e4, "poisson": 0.3},
        [
            fixed("block.left", "x"),
            fixed("block.right", "x"),
            {"boundary": "wedge.right", "x": "-0.02*min(t,2-t)"},
        ],
        [
            {"boundary": "block.bottom", "against": "wedge.top"}
            | {"friction": coulomb_friction(0.1)},
            {"boundary": "wedge.bottom", "friction": coulomb_friction(0.1)},
        ],
        ([1.0, 2.0], 2, {"traction": [{"boundary": "block.top", "y": -1.0}]}),
    ),
    "v-belt in its groove": lambda: v_belt(
        (12, 8), -1.0, [("right", 1.0), ("left", -1.0)], [], ([1.0, 2.0], 6, {})
    ),
    "v-belt with a soft corner": lambda: v_belt(*SOFT_CORNER, ([1.0, 2.0], 6, {})),
    "v-belt with a soft corner and inertia": lambda: v_belt(
        *SOFT_CORNER,
        (np.linspace(0.25, 2.0, 8).tolist(), None, {"inertia": {"time_step": 0.05}}),
    ),
    "tube expanded into a plate": lambda: (
        [
            ("tube", bent((4, 1), [9.0, 0.0], [10.0, 0.5])),
            ("plate", bent((16, 1), [10.05, 0.0], [30.0, 0.5])),
        ],
        [
            METAL
            | ROUND
            | {"young": 2e5, "yield_stress": 250.0, "hardening": 1000.0}
            | {"region": "tube", "strains": "small"},
            {"young": 2e5, "poisson": 0.3, "region": "plate"} | ROUND,
        ],
        [fixed(f"{body}.{side}", "y") for body in ("tube", "plate") for side in ("bottom", "top")],
        [{"boundary": "tube.right", "against": "plate.left"}],
        (
            [1.0, 2.0],
            5,
            {"traction": [{"boundary": "tube.left", "pressure": "200*min(t,2-t)"}]},
        ),
    ),
    "wire drawn through a die": lambda: (
        bent(
            (3, 20),
            [0.0, -2.1],
            [1.0, 0.4],
            lambda x, y: (x * np.clip(0.9 - y * DIE_SLOPE, 0.9, 1.0), y),
        ),
        METAL | ROUND | {"hardening": 0.01},
        [fixed("left", "x"), {"boundary": "top", "y": "0.8*t"}],
        [rough("right", polyline(CONE), 0.05)],
        ([1.0], 12, AUTO),
    ),
    "plug in a socket": lambda: (
        bent(
            (4, 4, 6),
            [0.0, 0.0, 0.0],
            [1.0, 1.0, 1.0],
            lambda x, y, z: (x * (0.5 + z * TAPER), y * (0.5 + z * TAPER), z),
        ),
        RUBBER | {"poisson": 0.4},
        [fixed("left", "x"), fixed("front", "y"), fixed("top", "z")],
        [
            rough(
                side,
                plane_shape([0.5 * x, 0.5 * y, 0.0], [-x, -y, TAPER])
                | {"shift": [0.0, 0.0, "0.1*t"]},
                0.1,
            )
            for side, x, y in (("right", 1.0, 0.0), ("back", 0.0, 1.0))
        ],
        ([1.0], 1, {}),
    ),
    "roller on a layer": lambda: (
        bent((48, 4), [0.0, 0.0], [3.0, 0.25]),
        RUBBER,
        [fixed("bottom")],
        [
            rough(
                "top",
                circle_shape([0.8, 0.75], 0.5)
                | {"pivot": [0.8, 0.75], "force": [0.0, "-0.1*min(t,1)"]}
                | {"prescribed": {"x": "1.2*max(t-1,0)"}},
                0.6,
            )
        ],
        ([1.0, 2.0], 8, AUTO),
    ),
    "bush pushed along its sleeve": lambda: (
        bent((6, 24), [0.5, 0.0], [1.0, 3.0]),
        RUBBER | ROUND,
        [fixed("left", "x") | {"y": "0.1*max(t-1,0)"}],
        [
            rough(
                "right",
                plane_shape([1.0, 0.0], [-1.0, 0.0]) | {"shift": ["-0.02*min(t,1)", 0.0]},
                1.0,
            )
        ],
        ([1.0, 2.0], 2, AUTO),
    ),
    "hub turned on a shaft": lambda: (
        bent((8, 14), [10.0, 0.0], [20.0, 20.0]),
        {"young": 2e5, "poisson": 0.3, "torsion": True} | ROUND,
        [fixed("bottom", "y"), {"boundary": "right", "z": "0.02*max(t-1,0)"}],
        [{"boundary": "left", "gap": -0.005, "friction": coulomb_friction(0.2)}],
        ([1.0, 2.0], None, {"element": {"degree": 2}}),
    ),
    "pipe clip": lambda: (
        bent((40, 2), [0.0, 0.0], [1.0, 0.15], arc((-np.pi / 2, np.radians(40)))),
        STIFF | {"young": 1e3, "poisson": 0.3},
        [fixed("left")],
        [
            rough(side, circle_shape([0.0, 1.286], 1.0) | {"shift": [0.0, "-1.28*t"]}, 0)
            for side in ("bottom", "right")
        ],
        ([1.0], 32, {"element": {"degree": 2}}),
    ),
    "block on a belt": lambda: (
        rectangle_mesh(4, 2, length=2.0),
        {"young": 1e3, "poisson": 0.3},
        [],
        [BELT],
        (np.linspace(0.25, 5.0, 20).tolist(), None, PULLED),
    ),
    "block on a belt with inertia": lambda: (
        rectangle_mesh(2, 1, length=2.0),
        {"young": 1e3, "poisson": 0.3, "density": 1.0},
        [],
        [BELT],
        (np.linspace(0.25, 9.0, 36).tolist(), None, PULLED | {"inertia": {"time_step": 0.125}}),
    ),
    "gasket under a flange": lambda: (
        bent((16, 6), [1.0, 0.0], [3.0, 0.5]),
        RUBBER | {"isochoric": True, "poisson": 0.499},
        [],
        [
            rough("bottom", plane_shape([0.0, 0.0], [0.0, 1.0]), 0.4),
            rough(
                "top",
                plane_shape([0.0, 0.5], [0.0, -1.0])
                | {"force": [0.0, "-min(t,1)"], "prescribed": {"x": 0.0, "rotation": 0.0}},
                0.4,
            ),
        ],
        (
            [1.0, 2.0],
            8,
            AUTO | {"traction": [{"boundary": "left", "pressure": "3*max(t-1,0)"}]},
        ),
    ),
    "balloon": lambda: (
        bent((24, 1), [0.0, 0.0], [1.0, 0.02], arc((0.0, np.pi / 2))),
        RUBBER | ROUND,
        [fixed("left", "y"), fixed("right", "x")],
        [rough("top", plane_shape([0.0, 1.5], [0.0, -1.0]), 0)],
        (
            [1.0],
            8,
            AUTO | {"traction": [{"boundary": "bottom", "pressure": "0.012*t"}]},
        ),
    ),
}
OUTCOMES = {
    "strip between walls": Status.UNSTABLE,
    "v-belt with a soft corner": Status.JUMPS,
    "block on a belt": Status.JUMPS,
    "gasket under a flange": Status.LIMIT,
    "balloon": Status.LIMIT,
}


def on_support(solution, boundary, place=-1):
    """The force on a support in a step."""
    rows = solution.at(solution.steps[place]).resultants.as_rows()
    return next(row["force"] for row in rows if row["boundary"] == boundary)


def column_loads(solution):
    """The force with which the right end of a strip is pushed in each step, over that at which it
    buckles between clamps one apart, and the number of its nodes that touch a wall.
    """
    found = []
    for place, step in enumerate(solution.steps):
        force = on_support(solution, "right", place)[0]
        load = -force / (4 * np.pi**2 * 1e6 * 0.01**3 / 12)
        found.append((load, np.count_nonzero(step.contact.in_contact)))
    return found


def nodes(solution):
    """Where the nodes have been, and their displacements."""
    at = solution.displacement.function_space.tabulate_dof_coordinates()
    moved = solution.displacement.x.array.reshape(len(at), -1)
    return at[:, : moved.shape[1]], moved


def thinning(stretch, *others):
    """The stretch of free sides of rubber of E = 1, beside one stretch, or two."""
    mu, lame = 1 / 2.9, 0.45 / 1.45 / 0.1
    return brentq(
        lambda a: (
            mu * (a * a - 1) + lame * np.log(a ** (2 - len(others)) * np.prod(others) * stretch)
        ),
        0.1,
        2,
    )


def hoop_stress(stretch, *others):
    """Of rubber of E = 1, per undeformed area."""
    return (stretch**2 - thinning(stretch, *others) ** 2) / 2.9 / stretch


def check_indentation(solution):
    """By felupe 11.3, extrapolated over its penalty."""
    force = np.sum(solution.contact.forces, axis=0)
    assert force == pytest.approx([17.179, -44.414], rel=1e-3)


def check_o_ring(solution):
    """Hertz's line at a squeeze of 5 %; at last the pressure is carried by wall and friction."""
    stiff = np.pi * 2.0 / (1 - 0.45**2)
    force = -solution.steps[1].contact.forces_of_each[1, 0, 1]
    squeeze = 2 * force / stiff * (np.log(4 * stiff / force) - 1)
    assert squeeze == pytest.approx(0.1, rel=0.04)
    at, moved = nodes(solution)
    left = np.isclose(at[:, 0], at[:, 0].min() * np.sqrt(0.5), atol=0.01)
    height = np.ptp((at + moved)[left & (np.abs(at[:, 1]) > 0.7), 1])
    push = np.sum(solution.contact.forces, axis=0)[0]
    assert push == pytest.approx(-0.5 * height, rel=1e-3)


def check_bending(solution):
    """What is given back at first is that of an elastic beam as long as up to the die."""
    at, moved = nodes(solution)
    before, after = solution.steps[11:13]
    lower = np.isclose(at[:, 1], 0.0)
    moved = before.displacement.x.array.reshape(moved.shape)
    x, y = (at + moved)[lower].T
    die = np.argmin(np.hypot(x - 4, y + 1))
    length, along = at[lower][die, 0], (x[die], y[die] - y[np.argmin(np.abs(x))])
    way = 1.5 * (after.time - before.time) * along[0] / np.hypot(*along)
    lost = np.subtract(
        *(np.linalg.norm(step.contact.forces_of_each[1, 0]) for step in (before, after))
    )
    assert lost == pytest.approx(3 * 200 / 0.91 * 0.4**3 / 12 * way / length**3, rel=0.06)
    assert np.abs(solution.contact.forces).max() == 0.0


def check_tyre(solution):
    """A membrane between rim and road: half a circle and two arcs of the radius T / p, and where
    it is flat the pressure on the road is the one inside.
    """
    high, stiff = 2.02 - 0.3, 0.02 * 1e3 / (1 - 0.45**2)

    def flat(radius):
        return np.sqrt(radius**2 - (high - radius) ** 2)

    def longer(radius):
        around = np.pi + np.arctan2(flat(radius), high - radius)
        return flat(radius) + radius * around - np.pi * 1.01 * (1 + 0.2 * radius / stiff)

    wanted = 0.2 * flat(brentq(longer, high / 2, 1.2))
    assert solution.contact.forces[0][1] == pytest.approx(wanted, rel=0.08)


def check_upsetting(solution):
    """Between the force without friction and that of Siebel's formula."""
    for place, height in ((2, 0.9), (5, 0.8)):
        force = -solution.steps[place].contact.forces_of_each[:, :, 1].sum()
        smooth = np.pi * 100 * (0.7 - 0.3 * np.log(height)) / (1 + 0.3 / 200) / height
        assert smooth < force < smooth * (1 + 0.3 * 20 / np.sqrt(height) / (3 * 30 * height))


def check_hose(solution):
    """Rings of the tube that are stretched one by one, relative to the tube beyond the barb."""
    at, moved = nodes(solution)
    rows = np.lexsort(at.T)[: 4 * 17]
    x, y = at[rows].T.reshape(2, 17, 4)
    stretch = 1 + moved[rows, 0].reshape(17, 4) / x
    stress = np.vectorize(hoop_stress)(stretch / stretch[-1].mean())
    hoop = 2 * np.pi * np.trapezoid(np.trapezoid(stress, x), y[:, 0])
    assert np.sum(solution.contact.forces, axis=0)[0] == pytest.approx(hoop, rel=0.12)


def check_dragged(solution):
    """It slides wholly to both sides, so that one is the mirror image of the other."""
    forces = [solution.steps[place].contact.forces_of_each[0] for place in (15, -1)]
    for (normal, friction), sign in zip(forces, (1, -1), strict=True):
        assert friction[0] == pytest.approx(sign * 0.2 * normal[1], rel=1e-6)
    assert forces[0][0] == pytest.approx(forces[1][0], rel=1e-5)


def check_soft_corner(solution):
    """The point neither sticks nor slides in any equilibrium nearby, on whatever way to it."""
    (said,) = (found.message for found in solution.findings if "sliding jumps" in found.message)
    assert "the point at (0.6, 0) neither sticks nor slides" in said


def check_sliding(solution):
    normal, friction = (np.linalg.norm(force) for force in solution.contact.forces)
    assert friction == pytest.approx(0.2 * normal, rel=1e-5)


def check_dent(solution):
    lowest = nodes(solution)[1][:, 1].min()
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


def check_cup(solution):
    """The rim is pressed around the axis alone, so that its thickness is t sqrt(R0 / R), and the
    force is that of a membrane of rigid rings that are drawn in, bent and unbent over the die.
    """
    at, moved = nodes(solution)
    rim = np.isclose(at[:, 0], 20.0)
    moved = at + moved
    thickness, outer = np.hypot(*np.ptp(moved[rim], axis=0)), moved[rim, 0].mean()
    assert thickness == pytest.approx(np.sqrt(20 / outer), rel=1e-3)
    angle = brentq(lambda a: 7.5 * np.sin(a) + (7 - 6) * np.cos(a) - 7, 0.5, 1.2)
    radius = np.linspace(outer, 14.5, 1001)
    strained = np.log(np.sqrt(400 - outer**2 + radius**2) / radius)
    flow = 0.3 + 0.5 * strained
    bend = (flow[-1] + 0.5 / 14) / 14
    end = 14.5 - 3.5 * np.sin(angle)
    stress = bend + np.trapezoid(flow / radius, -radius)
    drawn = flow[-1] * np.log(14.5 / end)
    stress = bend + drawn + stress * np.exp(0.05 * angle)
    punch = -solution.contact.forces_of_each[0, :, 1].sum()
    assert punch == pytest.approx(2 * np.pi * end * stress * np.sin(angle), rel=0.05)


def check_wires(solution):
    """Hertz's largest pressure: crossed cylinders of equal radii touch as a sphere and a plane."""
    force = -4 * solution.contact.forces[0][2]
    wanted = (6 * force / 0.91**2 / np.pi**3) ** (1 / 3)
    assert solution.contact.pressure.max() == pytest.approx(wanted, rel=0.04)


def check_disc_spring(solution):
    """Almen and Laszlo, Trans. ASME 58 (1936) 305-314, whose section is free to grow across: with E
    for E / (1 - nu^2) (G. Curti, M. Orlando, Wire 28 (1979) 199-204).
    """
    ratio, height = 25 / 12.7, 1.4 / 2
    shape = ((ratio - 1) / ratio) ** 2 / ((ratio + 1) / (ratio - 1) - 2 / np.log(ratio)) / np.pi
    for number, step in enumerate(solution.steps, 1):
        way = 1.05 / 2 * number / 6
        bent = (height - way) * (height - way / 2) + 1
        wanted = 4 * 206000 * 2.0**4 / (shape * 50**2) * way * bent
        forces = step.contact.forces_of_each[:, 0, 1]
        assert forces == pytest.approx([wanted, -wanted], rel=0.015)


def check_leaves(solution):
    """Beams that touch at the end of the shorter one alone."""
    wanted = 0.1 * 1e4 * 0.2**3 / 12 / (9**3 / 3 - 126**2 / 144)
    assert -on_support(solution, "upper.right")[1] == pytest.approx(wanted, rel=0.015)


def check_wedge(solution):
    """Both faces slide under the load of 2, inwards and out again."""
    angle, friction = np.arctan([SLOPE, 0.1])
    for place, sign in ((1, 1), (-1, -1)):
        wanted = 2 * (np.tan(sign * angle + friction) + np.tan(friction))
        force = on_support(solution, "wedge.right", place)[0]
        assert -sign * force == pytest.approx(wanted, rel=1e-8)


def check_v_belt(solution):
    """It stays wedged when it is let go: the walls push it out, and friction holds it."""
    for normal, friction in np.linalg.norm(solution.contact.forces_of_each, axis=2):
        assert normal > 0.02
        assert friction == pytest.approx(GROOVE_SLOPE * normal, rel=1e-6)


def check_tube(solution):
    """Relief is elastic: the pressure falls by that of Lame for both as one."""
    before, after = (solution.steps[place].contact.pressure.mean() for place in (4, -1))
    assert before - after == pytest.approx(200 * 81 / (900 - 81) * (900 / 100 - 1), rel=1e-3)
    assert after > 0


def check_wire(solution):
    """The stress of drawing is between that without redundant work and that of Siebel, with it."""
    angle = np.radians(8.0)
    least = 0.3 * np.log(1 / 0.81) * (1 + 0.05 / angle)
    forces = [on_support(solution, "top", place)[1] for place in range(6, 12)]
    assert least < np.mean(forces) / (np.pi * 0.81) < least + 0.3 * 2 / 3 * angle


def check_plug(solution):
    """Statics of walls along which all slides, and their force by Janssen's formula."""
    forces = solution.contact.forces_of_each
    normal = np.linalg.norm(forces[:, 0], axis=1).sum()
    push = on_support(solution, "top")[2]
    assert -push == pytest.approx(normal * (TAPER + 0.1) / np.hypot(1, TAPER), rel=2e-3)
    growth = 4 * (0.1 + TAPER) * 0.4 / 0.6
    wanted = 0.1 * TAPER / 0.5 / 0.6 * np.expm1(growth) / growth
    assert normal == pytest.approx(wanted, rel=0.1)


def check_roller(solution):
    """Rolling takes no work, so that no force drives it."""
    for step in solution.steps[8:]:
        along, across = np.sum(step.contact.forces, axis=0)
        assert across == pytest.approx(-0.1, rel=1e-6)
        assert abs(along) < 0.01 * 0.1


def check_bush(solution):
    """A sleeve of rubber in shear along its axis."""
    wanted = 2 * np.pi / 2.9 * 3 * 0.1 / np.log(2)
    assert on_support(solution, "left")[1] == pytest.approx(wanted, rel=0.05)


def check_hub(solution):
    """Lame's pressure on a rigid shaft, all of which slips."""
    pressure = 0.005 * 2e5 / 10 / (500 / 300 + 0.3)
    torque = abs(solution.contact.moments[1][1])
    assert torque == pytest.approx(2 * np.pi * 100 * 20 * 0.2 * pressure, rel=0.02)


def check_clip(solution):
    """It is pushed on and pulls itself on further, and gives back all that it has stored."""
    forces = [np.sum(step.contact.forces, axis=0)[1] for step in solution.steps]
    work = np.cumsum(np.convolve([0.0, *forces], [0.5, 0.5], "valid"))
    assert not solution.findings
    assert max(forces) > 0 > min(forces)
    assert abs(work[-1]) < 0.02 * np.abs(work).max()


def check_belt_of_a_block(solution):
    """It is carried until it is about to slide with all of its weight."""
    force = solution.steps[-2].contact.forces[1][0]
    assert 0.8 - 0.1 < force < 0.8


def check_belt_with_inertia(solution):
    """A point on a spring that sticks and slips."""

    def rates(_, state):
        slip = 0.1 - state[1]
        friction = 2 * (0.2 + 0.2 * np.exp(-((slip / 0.05) ** 2))) * np.tanh(slip / 1e-4)
        return state[1], friction / 2 - state[0]

    times = [step.time for step in solution.steps]
    known = solve_ivp(rates, (0, 9), (0, 0), t_eval=times, method="LSODA", max_step=0.02)
    way = [step.displacement.x.array.reshape(-1, 2)[:, 0].mean() for step in solution.steps]
    assert way == pytest.approx(known.y[0], abs=0.05 * known.y[0].max())


def check_gasket(solution):
    """It is blown out where friction on both sides is less than the pressure on its height."""
    step = solution.steps[-1]
    height = 0.5 + step.rigid_bodies[0].translation[1]
    push = 3 * (step.time - 1) * height
    assert push == pytest.approx(2 * 0.4 * 1.0, rel=0.01)


def check_balloon(solution):
    """The largest pressure of a thin sphere, of this energy."""
    stretch = np.linspace(1.2, 1.6, 401)
    hoop = np.array([hoop_stress(one, one) for one in stretch])
    largest = np.max(2 * 0.02 * hoop / stretch**2)
    assert 0.012 * solution.steps[-1].time == pytest.approx(largest, rel=0.02)


CHECKS = {
    "indentation": check_indentation,
    "o-ring into its gap": check_o_ring,
    "bending and spring-back": check_bending,
    "tyre": check_tyre,
    "upsetting": check_upsetting,
    "hose over a barb": check_hose,
    "block dragged to and fro": check_dragged,
    "v-belt with a soft corner": check_soft_corner,
    "cup": check_cup,
    "crossed wires": check_wires,
    "disc spring": check_disc_spring,
    "leaf springs": check_leaves,
    "wedge under a block": check_wedge,
    "v-belt in its groove": check_v_belt,
    "tube expanded into a plate": check_tube,
    "wire drawn through a die": check_wire,
    "plug in a socket": check_plug,
    "roller on a layer": check_roller,
    "bush pushed along its sleeve": check_bush,
    "hub turned on a shaft": check_hub,
    "pipe clip": check_clip,
    "block on a belt": check_belt_of_a_block,
    "block on a belt with inertia": check_belt_with_inertia,
    "gasket under a flange": check_gasket,
    "balloon": check_balloon,
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
    scene = {"material": material, "displacement": displacement, "contact": contact}
    bodies = [{"name": body, "mesh": own} for body, own in mesh] if isinstance(mesh, list) else []
    scene |= {"body": bodies} if bodies else {"mesh": mesh}
    scene |= {"load_steps": {"times": times, "steps": steps}} | further
    solution = alone(parse_scene(scene), check=False)
    assert solution.status is OUTCOMES.get(name, Status.CONVERGED)
    if name in CHECKS:
        CHECKS[name](solution)
