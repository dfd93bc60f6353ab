"""What ``solve`` refuses before it has solved anything, ``check`` refuses as well, with the same
words.
"""

import pytest
from mpi4py import MPI
from scene_tables import (
    box_mesh,
    coulomb_friction,
    fixed,
    plane_shape,
    rectangle_mesh,
    tresca_friction,
)

from signorini_fx import solve
from signorini_fx.errors import SignoriniError
from signorini_fx.records import IterationRecord
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_SELF
COULOMB = coulomb_friction(0.3)
BLOCK = {
    "mesh": rectangle_mesh(8, 4, length=2.0, height=1.0),
    "material": {"young": 1000.0, "poisson": 0.3},
    "contact": [{"boundary": "bottom", "friction": COULOMB}],
}
HELD = {"displacement": {"boundary": "top", "x": 0.0, "y": -0.001}}
TRIANGLES = rectangle_mesh(4, 2, cell="triangle")
STACK = [
    {"name": name, "mesh": TRIANGLES, "shift": [0.0, height]}
    for name, height in (("lower", 0.0), ("upper", 1.0))
]


def bodies(**more):
    """One block on another one."""
    return {
        "body": STACK,
        "material": BLOCK["material"],
        "displacement": [fixed("lower.bottom"), {"boundary": "upper.top", "x": 0.0, "y": -0.001}],
        "contact": [{"boundary": "upper.bottom", "against": "lower.top"}],
        **more,
    }


def tool(**more):
    """A block on a plane that a force presses."""
    foundation = {
        "shape": "plane",
        "point": [0.0, 0.0],
        "normal": [0.0, 1.0],
        "pivot": [1.0, 0.0],
        "force": [0.0, 1.0],
    }
    return (
        BLOCK
        | HELD
        | {"contact": [{"boundary": "bottom", "foundation": foundation, "friction": COULOMB}]}
        | more
    )


SPACE = {
    "mesh": box_mesh(4, 2, 2),
    "material": BLOCK["material"],
    "displacement": {"boundary": "top", "x": 0.0, "y": 0.0, "z": -0.001},
}
AXISYMMETRIC = {"material": {"young": 1000.0, "poisson": 0.3, "hypothesis": "axisymmetric"}}
ORTHOTROPIC = {"young": [1000.0, 900.0, 800.0], "poisson": [0.3] * 3, "shear": [300.0] * 3}
DISK = {"generator": "half_disk", "parameters": {"radius": 1.0, "size": 0.5}}
TETRAHEDRA = box_mesh(2, 2, 2, cell="tetrahedron")


def contact(scene=BLOCK | HELD, **more):
    """A scene with this contact of its bottom."""
    return scene | {"contact": [{"boundary": "bottom"} | more]}


def of_disk(**more):
    """A half disk that is pressed on its arc."""
    press = {"boundary": "top", "x": 0.0, "y": -0.1}
    return {
        "mesh": DISK,
        "material": BLOCK["material"],
        "displacement": press,
        "contact": [{"boundary": "arc"}],
    } | more


def mesh_of(mesh, **more):
    """The pressed block with this mesh."""
    return BLOCK | HELD | {"mesh": mesh} | more


def ellipse(**more):
    """Friction in 3D that depends on the direction."""
    return contact(SPACE, friction=COULOMB | {"ratio": 2.0, "along": [1.0, 0.0, 0.0]} | more)


REFUSED = {
    "no contact to begin with": BLOCK | HELD | {"solver": {"initial_contact": "x[0] - 5"}},
    "pressure of an enclosed body": {
        "mesh": BLOCK["mesh"],
        "material": {"young": 1000.0, "poisson": 0.5},
        "element": {"degree": 2, "volumetric": "mixed"},
        "displacement": [
            fixed(side) for side in ("left", "right", "top", "bottom")
        ],
    },
    # Requested accuracy.
    "quadrilaterals one by one": BLOCK | HELD | {"accuracy": {"target": 0.3, "refinement": "adaptive"}},
    "hexahedra one by one": contact(SPACE) | {"accuracy": {"target": 0.3, "refinement": "adaptive"}},
    "peak on meshes that are divided": BLOCK
    | HELD
    | {"accuracy": {"target": 0.3, "refinement": "adaptive", "of": "peak"}},
    # Boundaries and values.
    "no such boundary": contact(boundary="nowhere"),
    "support on contact": BLOCK | {"displacement": fixed("bottom", "y")},
    "gap that is no number": contact(gap="log(x[0] - 0.5)"),
    "negative bound": contact(friction=tresca_friction("x[0] - 0.5")),
    "negative coefficient": contact(friction=coulomb_friction("x[0] - 0.5")),
    "negative coefficient later": contact(friction=coulomb_friction("0.3*(1 - 2*t)"))
    | {"load_steps": {"times": [0.0, 1.0]}},
    "ellipse in 2D": contact(friction=COULOMB | {"ratio": 2.0}),
    "ellipse along the normal": ellipse(along=[0.0, 0.0, 1.0]),
    "ellipse and support": ellipse(along=[1.0, 1.0, 0.0])
    | {"displacement": [SPACE["displacement"], fixed("left", "x")]},
    "plane in 3D": contact(foundation=plane_shape([0.0] * 3, [0.0, 1.0, 0.0])),
    "surface without a file": contact(SPACE, foundation={"shape": "surface", "file": "/nowhere.stl"}),
    "force whose spread is nothing": BLOCK
    | HELD
    | {"force": [{"boundary": "left", "x": 1.0, "spread": "x[1] - 0.5"}]},
    "springs that push": BLOCK | HELD | {"springs": [{"boundary": "left", "x": "x[1] - 0.5"}]},
    "traction that is no number": BLOCK | HELD | {"traction": {"boundary": "left", "x": "log(x[1] - 0.5)"}},
    "displacement that is no number": BLOCK | {"displacement": {"boundary": "top", "x": "log(x[0] - 0.5)"}},
    "temperature that is no number": BLOCK
    | HELD
    | {"temperature": {"change": "log(x[0] - 0.5)"}, "material": BLOCK["material"] | {"expansion": 1e-5}},
    "point without a node": BLOCK | {"displacement": {"at": [0.01, 0.0], "x": 0.0}},
    "normal of an arc": of_disk(displacement={"boundary": "arc", "normal": 0.0}, contact=[{"boundary": "top"}]),
    # Materials and elements.
    "grading below zero": BLOCK | HELD | {"material": BLOCK["material"] | {"grading": "1 - 2*x[1]"}},
    "no such region": BLOCK | HELD | {"material": BLOCK["material"] | {"region": "nowhere"}},
    "body without a material": bodies(material=BLOCK["material"] | {"region": "lower"}),
    "fibres without a direction": BLOCK
    | HELD
    | {"material": {"orthotropic": ORTHOTROPIC | {"direction": ["x[0] - x[0]", "0"]}}},
    "reduced triangles": mesh_of(TRIANGLES, element={"volumetric": "reduced"}),
    "linear elements on arcs": of_disk(mesh={"generator": "half_disk", "parameters": {"size": 0.5, "order": 2}}),
    "radius below zero": {**mesh_of({"generator": "punch", "parameters": {}}), **AXISYMMETRIC},
    # Preloads.
    "section beside the body": bodies(preload=[{"point": [0.5, 7.0], "axis": [0.0, 1.0], "force": 1.0}]),
    "section of no facets": bodies(preload=[{"section": "nowhere", "force": 1.0}]),
    "section on the boundary": bodies(preload=[{"section": "upper.left", "force": 1.0}]),
    # Meshes.
    "no such generator": mesh_of({"generator": "nothing"}),
    "no such parameter": mesh_of(rectangle_mesh(wrong=1)),
    "no such file": mesh_of({"file": "/nowhere.msh"}),
    "no format of meshes": mesh_of({"file": "/nowhere.docx"}),
    "two kinds of cells": bodies(body=[STACK[0], STACK[1] | {"mesh": TETRAHEDRA}]),
    "body without a generator": bodies(body=[STACK[0], STACK[1] | {"mesh": {"generator": "nothing"}}]),
    "sides that do not face each other": bodies(contact=[{"boundary": "upper.bottom", "against": "lower.bottom"}]),
    "points of two contacts on one side": bodies(
        contact=[
            {"boundary": name, "against": "lower.top", "points": "against"} for name in ("upper.bottom", "upper.left")
        ]
    ),
}  # fmt: skip


def message(function, scene):
    """Of the error that a function raises for a scene."""
    with pytest.raises(SignoriniError) as caught:
        function(parse_scene(scene), COMM)
    return str(caught.value)


@pytest.mark.one_quick("name", REFUSED)
def test_check_refuses_what_solve_refuses(name):
    """In the same words, and ``solve`` before the first linear solve."""
    solved = []

    def begin(scene, comm):
        solve(scene, comm, observers=[solved.append])

    assert message(check_scene, REFUSED[name]) == message(begin, REFUSED[name])
    assert not any(isinstance(record, IterationRecord) for record in solved)
