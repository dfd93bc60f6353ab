"""Bodies in 3D whose costs and errors are forecast."""

from __future__ import annotations

from signorini_fx.mechanics.statement.mesh_sources import MeshGenerator
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.scene import Scene

BOWL = "0.003 * ((x[0] - 1.5)**2 + (x[1] - 0.5)**2) + 0.001"


def block(cell: str, friction: dict | None = None, gap: str = BOWL, degree: int = 1, **more) -> Scene:
    """A block of 3 x 1 x 1 over a bowl, pressed in the middle of its top and pulled along x[1]."""
    return parse_scene(
        {
            "mesh": {"generator": "box", "parameters": {"nx": 24, "ny": 8, "nz": 8, "cell": cell}},
            "element": {"degree": degree},
            "material": {"young": 5000.0, "poisson": 0.4},
            "displacement": [{"boundary": name, "x": 0.0, "y": 0.0} for name in ("left", "right")],
            "traction": {"boundary": "top", "y": "4 if 1 <= x[0] <= 2 else 0", "z": "-20 if 1 <= x[0] <= 2 else 0"},
            "contact": {"boundary": "bottom", "gap": gap, "friction": friction or {"law": "none"}},
            **more,
        }
    )


def sphere(cell: str) -> Scene:
    """A quarter of a block on a sphere (as a paraboloid): Hertz, with a contact radius of 0.3 of the block."""
    return parse_scene(
        {
            "mesh": {
                "generator": "box",
                "parameters": {"length": 1.0, "width": 1.0, "height": 1.0, "nx": 12, "ny": 12, "nz": 12, "cell": cell},
            },
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": [
                {"boundary": "left", "normal": 0.0},
                {"boundary": "front", "normal": 0.0},
                {"boundary": "top", "z": -0.06},
            ],
            "contact": {"boundary": "bottom", "gap": "(x[0]**2 + x[1]**2) / 2"},
        }
    )


def brick(cell: str) -> Scene:
    """A brick that friction alone holds, pushed obliquely: contact all over its base, up to the edges."""
    parameters = {"length": 2.0, "width": 2.0, "height": 1.0, "nx": 12, "ny": 12, "nz": 6, "cell": cell}
    return parse_scene(
        {
            "mesh": {"generator": "box", "parameters": parameters},
            "material": {"young": 1000.0, "poisson": 0.3},
            "traction": {"boundary": "top", "pressure": "10 + 2 * x[0]"},
            "body_force": {"x": 2.0, "y": 1.5},
            "contact": {"boundary": "bottom", "friction": {"law": "coulomb", "coefficient": 0.4}},
        }
    )


def foot(cell: str) -> Scene:
    """A block that leans on an inclined foundation with half of its base: the gap ends there with a step."""
    gap = "0.0 if x[0] <= 1.5 else 0.02"
    return block(cell, {"law": "tresca", "bound": 1.0}, gap, traction={"boundary": "top", "pressure": 10.0})


TRESCA, COULOMB = {"law": "tresca", "bound": 1.5}, {"law": "coulomb", "coefficient": 0.3}
SCENES = {
    "block, P1": lambda: block("tetrahedron"),
    "block, Q1": lambda: block("hexahedron"),
    "block, Q2": lambda: block("hexahedron", degree=2),
    "block, Tresca, P1": lambda: block("tetrahedron", TRESCA),
    "block, Tresca, Q1": lambda: block("hexahedron", TRESCA),
    "block, Coulomb, P1": lambda: block("tetrahedron", COULOMB),
    "block, Coulomb, Q1": lambda: block("hexahedron", COULOMB),
    "sphere, P1": lambda: sphere("tetrahedron"),
    "sphere, Q1": lambda: sphere("hexahedron"),
    "brick, P1": lambda: brick("tetrahedron"),
    "brick, Q1": lambda: brick("hexahedron"),
    "foot, P1": lambda: foot("tetrahedron"),
}


def on_mesh(scene: Scene, factor: float, **changed) -> Scene:
    """The scene with cells so many times as large, with other parameters of its mesh and no accuracy."""
    counts = {name: max(1, round(scene.mesh.parameters[name] / factor)) for name in ("nx", "ny", "nz")}
    mesh = MeshGenerator(generator="box", parameters={**scene.mesh.parameters, **counts, **changed})
    return scene.model_copy(update={"mesh": mesh, "accuracy": None})
