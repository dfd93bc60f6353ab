"""Problems whose largest contact pressure is finite and smooth, with parameters drawn at random.

A problem is a function of the degree of the displacement and of the size of the cells relative to those of its first
mesh; it returns a scene.  What is drawn (radii, moduli, loads, friction) is the same for all meshes of one problem.
Cells of the first mesh are about a sixth of the half width of the contact there, larger elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.scene import Scene

Table = dict[str, Any]
Make = Callable[[int, float], Scene]
BELOW = {"gap": "x[1]", "direction": [0.0, -1.0]}
AXISYMMETRIC = {"hypothesis": "axisymmetric"}


def _modulus(young: float, poisson: float) -> float:
    return young / (1 - poisson**2)


def _half_disk(radius: float, wide: float, size: float, degree: int) -> Table:
    parameters = {
        "radius": radius,
        "symmetric": True,
        "size": 0.12 * radius * max(size, 0.25),
        "contact_size": wide / 6 * size,
        "contact_zone": 1.5 * wide,
        "order": degree,
    }
    return {"generator": "half_disk", "parameters": parameters}


def line(rng: np.random.Generator, folder: Path) -> Make:
    """Half a disk on a plane."""
    radius, share, poisson = rng.uniform(3, 10), rng.uniform(0.03, 0.1), rng.uniform(0, 0.4)
    wide, young = share * radius, 200.0
    force = math.pi * wide**2 * _modulus(young, poisson) / (4 * radius)

    def make(degree: int, size: float) -> Scene:
        return parse_scene(
            {
                "mesh": _half_disk(radius, wide, size, degree),
                "element": {"degree": degree},
                "material": {"young": young, "poisson": poisson},
                "displacement": {"boundary": "symmetry", "x": 0.0},
                "traction": {"boundary": "top", "pressure": force / (2 * radius)},
                "contact": {"boundary": "arc", **BELOW},
            }
        )

    return make


def sphere(rng: np.random.Generator, folder: Path) -> Make:
    """The same, of revolution."""
    radius, share, poisson = rng.uniform(3, 10), rng.uniform(0.04, 0.12), rng.uniform(0, 0.4)
    wide, young = share * radius, 200.0
    force = 4 * _modulus(young, poisson) * wide**3 / (3 * radius)

    def make(degree: int, size: float) -> Scene:
        return parse_scene(
            {
                "mesh": _half_disk(radius, wide, size, degree),
                "element": {"degree": degree},
                "material": {"young": young, "poisson": poisson, **AXISYMMETRIC},
                "displacement": {"boundary": "symmetry", "x": 0.0},
                "traction": {"boundary": "top", "pressure": force / (math.pi * radius**2)},
                "contact": {"boundary": "arc", **BELOW},
            }
        )

    return make


def _rectangle(length: float, height: float, across: int, up: int, size: float, degree: int) -> Table:
    cell = "quadrilateral" if degree == 1 else "triangle"
    counts = {"nx": round(across / size), "ny": round(up / size), "cell": cell}
    return {"generator": "rectangle", "parameters": {"length": length, "height": height, **counts}}


def periodic(rng: np.random.Generator, folder: Path) -> Make:
    """One wave of a wavy foundation under a tall block between rollers (Westergaard)."""
    part = rng.uniform(0.15, 0.3)
    young, poisson, length = 1000.0, rng.uniform(0, 0.4), 1.0
    depth = 0.005
    mean = math.pi * _modulus(young, poisson) * depth / length * math.sin(math.pi * part) ** 2

    def make(degree: int, size: float) -> Scene:
        # Half a wave between rollers, whose crest is at one of them.
        return parse_scene(
            {
                "mesh": _rectangle(length / 2, length, 24, 48, size, degree),
                "element": {"degree": degree},
                "material": {"young": young, "poisson": poisson},
                "displacement": [{"boundary": "left", "x": 0.0}, {"boundary": "right", "x": 0.0}],
                "traction": {"boundary": "top", "pressure": mean},
                "contact": {"boundary": "bottom", "gap": f"{depth} * (1 - cos({2 * math.pi / length} * x[0]))"},
            }
        )

    return make


def layer(rng: np.random.Generator, folder: Path) -> Make:
    """A layer bonded to a rigid base, under a parabola whose tip is at no node."""
    wide, poisson, shift = rng.uniform(0.7, 1.6), rng.uniform(0, 0.4), rng.uniform(-0.05, 0.05)
    young, height, radius = 100.0, 1.0, 40.0
    deep = wide**2 / (2 * radius) * 1.3

    def make(degree: int, size: float) -> Scene:
        return parse_scene(
            {
                "mesh": _rectangle(8 * wide, height, 48, 8, size, degree),
                "element": {"degree": degree},
                "material": {"young": young, "poisson": poisson},
                "displacement": {"boundary": "bottom", "x": 0.0, "y": 0.0},
                "contact": {"boundary": "top", "gap": f"(x[0] - {4 * wide + shift})**2 / {2 * radius} - {deep}"},
            }
        )

    return make


def axisymmetric_layer(rng: np.random.Generator, folder: Path) -> Make:
    """A layer that is bonded to a rigid base, under a paraboloid; it is pulled back outside."""
    wide, poisson = rng.uniform(0.7, 1.6), rng.uniform(0, 0.35)
    young, height, radius = 100.0, 1.0, 40.0
    deep = wide**2 / (2 * radius) * 1.4

    def make(degree: int, size: float) -> Scene:
        return parse_scene(
            {
                "mesh": _rectangle(4 * wide, height, 24, 8, size, degree),
                "element": {"degree": degree},
                "material": {"young": young, "poisson": poisson, **AXISYMMETRIC},
                "displacement": [{"boundary": "bottom", "x": 0.0, "y": 0.0}, {"boundary": "left", "x": 0.0}],
                "contact": {"boundary": "top", "gap": f"x[0]**2 / {2 * radius} - {deep}"},
            }
        )

    return make


def receding(rng: np.random.Generator, folder: Path) -> Make:
    """A layer that is pressed onto a smooth plane in its middle, and lifts elsewhere."""
    part, poisson = rng.uniform(0.3, 0.9), rng.uniform(0, 0.4)

    def make(degree: int, size: float) -> Scene:
        return parse_scene(
            {
                "mesh": _rectangle(5.0, 1.0, 40, 8, size, degree),
                "element": {"degree": degree},
                "material": {"young": 1000.0, "poisson": poisson},
                "displacement": {"boundary": "left", "x": 0.0},
                "traction": {"boundary": "top", "y": f"-exp(-(x[0] / {part})**2)"},
                "contact": {"boundary": "bottom"},
            }
        )

    return make


def bowl(rng: np.random.Generator, folder: Path) -> Make:
    """A block over a bowl, pressed and pulled, with Coulomb's friction."""
    middle, bend, coefficient = rng.uniform(1.2, 1.8), rng.uniform(0.004, 0.008), rng.uniform(0.1, 0.4)
    poisson = rng.uniform(0.1, 0.4)

    def make(degree: int, size: float) -> Scene:
        return parse_scene(
            {
                "mesh": _rectangle(3.0, 1.0, 36, 12, size, degree),
                "element": {"degree": degree},
                "material": {"young": 5000.0, "poisson": poisson},
                "displacement": [{"boundary": name, "x": 0.0} for name in ("left", "right")],
                "traction": {"boundary": "top", "y": f"-20 * exp(-(x[0] - {middle})**2 / 0.3)", "x": 2.0},
                "contact": {
                    "boundary": "bottom",
                    "gap": f"{bend} * (x[0] - 1.5)**2",
                    "friction": {"law": "coulomb", "coefficient": coefficient},
                },
            }
        )

    return make


def groove(rng: np.random.Generator, folder: Path) -> Make:
    """Half a disk in a round groove a little larger than itself."""
    radius, more, poisson = rng.uniform(3, 10), rng.uniform(1.05, 1.4), rng.uniform(0, 0.4)
    young, share = 200.0, rng.uniform(0.1, 0.25)
    wide, relative = share * radius, 1 / (1 / radius - 1 / (more * radius))
    force = math.pi * wide**2 * _modulus(young, poisson) / (4 * relative)
    circle = {"shape": "circle", "centre": [0.0, more * radius], "radius": more * radius, "hollow": True}

    def make(degree: int, size: float) -> Scene:
        return parse_scene(
            {
                "mesh": _half_disk(radius, wide, size, degree),
                "element": {"degree": degree},
                "material": {"young": young, "poisson": poisson},
                "displacement": {"boundary": "symmetry", "x": 0.0},
                "traction": {"boundary": "top", "pressure": force / (2 * radius)},
                "contact": {"boundary": "arc", "foundation": circle},
            }
        )

    return make


def pin(rng: np.random.Generator, folder: Path) -> Make:
    """A plate hangs on a rigid pin: loose, the pin smaller than the hole (Persson)."""
    return _pinned(rng, -rng.uniform(0.002, 0.01), rng.uniform(2, 6))


def tight_pin(rng: np.random.Generator, folder: Path) -> Make:
    """The same with a pin that is larger than the hole: pressed all around, most below."""
    return _pinned(rng, rng.uniform(0.002, 0.005), rng.uniform(0.2, 0.6))


def _pinned(rng: np.random.Generator, larger: float, pull: float) -> Make:
    poisson, angle = rng.uniform(0.1, 0.4), 0.0
    circle = {"shape": "circle", "centre": [0.0, 0.0], "radius": 1 + larger}

    def make(degree: int, size: float) -> Scene:
        parameters = {"size": 0.6 * size, "contact_size": 0.12 * size, "symmetric": True, "order": degree}
        return parse_scene(
            {
                "mesh": {"generator": "plate_with_hole", "parameters": parameters},
                "element": {"degree": degree},
                "material": {"young": 1000.0, "poisson": poisson},
                "displacement": {"boundary": "symmetry", "y": angle},
                "traction": {"boundary": "right", "x": pull},
                "contact": {"boundary": "hole", "foundation": circle},
            }
        )

    return make


LUG = """
SetFactory("Built-in"); Mesh.ElementOrder = {order}; Mesh.HighOrderOptimize = 0;
Point(1) = {{0, 0, 0, {coarse}}};
Point(2) = {{0, {pin}, 0, {fine}}}; Point(3) = {{{pin}, 0, 0, {fine}}};
Point(4) = {{0, {bore}, 0, {coarse}}}; Point(5) = {{{bore}, 0, 0, {coarse}}};
Point(7) = {{0, -{pin}, 0, {fine}}}; Point(8) = {{0, -{bore}, 0, {coarse}}};
Circle(1) = {{2, 1, 3}}; Circle(6) = {{3, 1, 7}}; Line(2) = {{7, 8}}; Circle(3) = {{8, 1, 5}}; Circle(7) = {{5, 1, 4}};
Line(4) = {{4, 2}};
Curve Loop(1) = {{1, 6, 2, 3, 7, 4}}; Plane Surface(1) = {{1}};
Point(11) = {{0, {shift}, 0, {fine}}};
Point(12) = {{0, {top}, 0, {fine}}}; Point(13) = {{{hole}, {shift}, 0, {fine}}};
Point(14) = {{0, {low}, 0, {fine}}};
Point(15) = {{0, {end}, 0, {coarse}}}; Point(16) = {{{width}, {end}, 0, {coarse}}};
Point(17) = {{{width}, {head}, 0, {coarse}}}; Point(18) = {{0, {head}, 0, {coarse}}};
Circle(11) = {{12, 11, 13}}; Circle(12) = {{13, 11, 14}};
Line(13) = {{14, 15}}; Line(14) = {{15, 16}}; Line(15) = {{16, 17}}; Line(16) = {{17, 18}}; Line(17) = {{18, 12}};
Curve Loop(11) = {{11, 12, 13, 14, 15, 16, 17}}; Plane Surface(11) = {{11}};
Physical Curve("pin") = {{1, 6}}; Physical Curve("bore") = {{3, 7}};
Physical Curve("hole") = {{11, 12}}; Physical Curve("end") = {{14}};
Physical Curve("symmetry") = {{2, 4, 13, 17}};
Physical Surface("bush") = {{1}}; Physical Surface("lug") = {{11}};
"""


def lug(rng: np.random.Generator, folder: Path) -> Make:
    """Half a lug on a bush of another stiffness, pulled down: touches at the top of the bush."""
    loose, stiff = rng.uniform(0.005, 0.03), rng.uniform(0.4, 2.5)
    pull, wide, coefficient = rng.uniform(10, 30), rng.uniform(1.8, 2.6), rng.choice([0.0, 0.2])
    friction = {"law": "coulomb", "coefficient": float(coefficient)} if coefficient else {"law": "none"}

    def make(degree: int, size: float) -> Scene:
        name = folder / f"lug_{rng_key(loose)}_{degree}_{size:g}.geo"
        hole = 1 + loose
        values = {
            "pin": 1.0, "bore": 0.4, "hole": hole, "shift": -loose, "top": hole - loose, "low": -hole - loose,
            "end": -5.0, "width": wide, "head": 2.2, "fine": 0.12 * size, "coarse": 0.4 * max(size, 0.25),
            "order": degree,
        }  # fmt: skip
        name.write_text(LUG.format(**values), encoding="utf-8")
        return parse_scene(
            {
                "mesh": {"file": str(name)},
                "element": {"degree": degree},
                "material": [
                    {"region": "bush", "young": 1e4 * stiff, "poisson": 0.3},
                    {"region": "lug", "young": 1e4, "poisson": 0.3},
                ],
                "displacement": [
                    {"boundary": "symmetry", "x": 0.0},
                    {"boundary": "bore", "x": 0.0, "y": 0.0},
                ],
                "traction": {"boundary": "end", "y": -pull},
                "contact": {"boundary": "hole", "against": "pin", "friction": friction},
            }
        )

    return make


def rng_key(value: float) -> str:
    """A name for what was drawn."""
    return f"{value:.9f}".replace(".", "_")


CYLINDERS = """
SetFactory("Built-in"); Mesh.ElementOrder = {order}; Mesh.HighOrderOptimize = 0;
Point(1) = {{0, 0, 0, {fine}}}; Point(2) = {{0, {up}, 0, {coarse}}}; Point(3) = {{{up}, {up}, 0, {coarse}}};
Circle(1) = {{1, 2, 3}}; Line(2) = {{3, 2}}; Line(3) = {{2, 1}};
Curve Loop(1) = {{1, 2, 3}}; Plane Surface(1) = {{1}};
Point(11) = {{0, 0, 0, {finer}}}; Point(12) = {{0, -{low}, 0, {coarse}}}; Point(13) = {{{low}, -{low}, 0, {coarse}}};
Circle(11) = {{13, 12, 11}}; Line(12) = {{11, 12}}; Line(13) = {{12, 13}};
Curve Loop(11) = {{11, 12, 13}}; Plane Surface(11) = {{11}};
Physical Curve("upper") = {{1}}; Physical Curve("top") = {{2}}; Physical Curve("symmetry") = {{3, 12}};
Physical Curve("lower") = {{11}}; Physical Curve("bottom") = {{13}};
Physical Surface("first") = {{1}}; Physical Surface("second") = {{11}};
"""


def _pressed(rng: np.random.Generator, folder: Path, kind: Table, friction: Table, load: Callable[..., float]) -> Make:
    radii, share = rng.uniform(3, 10, 2), rng.uniform(0.06, 0.15)
    young, poisson = 200 * rng.uniform(0.3, 3, 2), rng.uniform(0, 0.4, 2)
    relative, modulus = 1 / np.sum(1 / radii), 1 / np.sum((1 - poisson**2) / young)
    wide = share * relative
    pressure = float(load(wide, modulus, relative, radii[0]))

    def make(degree: int, size: float) -> Scene:
        name = folder / f"cylinders_{rng_key(share)}_{degree}_{size:g}.geo"
        values = {"fine": wide / 6 * size, "finer": wide / 7 * size, "up": radii[0], "low": radii[1]}
        values |= {"coarse": 0.12 * radii.max() * max(size, 0.25), "order": degree}
        name.write_text(CYLINDERS.format(**values), encoding="utf-8")
        return parse_scene(
            {
                "mesh": {"file": str(name)},
                "element": {"degree": degree},
                "material": [
                    {"region": region, "young": float(e), "poisson": float(nu), **kind}
                    for region, e, nu in zip(("first", "second"), young, poisson, strict=True)
                ],
                "displacement": [{"boundary": "symmetry", "x": 0.0}, {"boundary": "bottom", "y": 0.0}],
                "traction": {"boundary": "top", "pressure": pressure},
                "contact": {"boundary": "upper", "against": "lower", "friction": friction},
            }
        )

    return make


def cylinders(rng: np.random.Generator, folder: Path) -> Make:
    """Two cylinders of different radii and stiffness, with Coulomb's friction."""
    friction = {"law": "coulomb", "coefficient": float(rng.uniform(0.05, 0.4))}
    return _pressed(rng, folder, {}, friction, lambda a, modulus, r, own: math.pi * a**2 * modulus / (8 * r * own))


def balls(rng: np.random.Generator, folder: Path) -> Make:
    """Two balls, as bodies of revolution."""
    return _pressed(
        rng,
        folder,
        AXISYMMETRIC,
        {"law": "none"},
        lambda a, modulus, r, own: 4 * modulus * a**3 / (3 * math.pi * r * own**2),
    )


def shoe(rng: np.random.Generator, folder: Path) -> Make:
    """A shoe is pressed into a drum of a slightly larger radius, with Coulomb's friction."""
    larger, coefficient, poisson = rng.uniform(1.005, 1.03), rng.uniform(0.1, 0.4), rng.uniform(0.1, 0.4)
    load = rng.uniform(1, 3)
    drum = {"shape": "circle", "centre": [0.0, 8 * larger], "radius": 8 * larger, "hollow": True}

    def make(degree: int, size: float) -> Scene:
        parameters = {"symmetric": True, "size": 0.8 * size, "contact_size": 0.3 * size, "order": degree}
        return parse_scene(
            {
                "mesh": {"generator": "ring_segment", "parameters": {**parameters, "angle": 80.0}},
                "element": {"degree": degree},
                "material": {"young": 1000.0, "poisson": poisson},
                "displacement": {"boundary": "symmetry", "x": 0.0},
                "traction": {"boundary": "inner", "y": f"-{load} * exp(-(x[0] / 2)**2)"},
                "contact": {
                    "boundary": "outer",
                    "foundation": drum,
                    "friction": {"law": "coulomb", "coefficient": coefficient},
                },
            }
        )

    return make


def saddle(rng: np.random.Generator, folder: Path) -> Make:
    """A block with a round seat on a cylinder that is smaller than the seat."""
    smaller, poisson, load = rng.uniform(0.97, 0.99), rng.uniform(0.1, 0.4), rng.uniform(2, 6)
    circle = {"shape": "circle", "centre": [0.0, -4 * smaller], "radius": 4 * smaller}

    def make(degree: int, size: float) -> Scene:
        parameters = {"size": size, "contact_size": 0.2 * size, "order": degree}
        return parse_scene(
            {
                "mesh": {"generator": "block_on_cylinder", "parameters": parameters},
                "element": {"degree": degree},
                "material": {"young": 1000.0, "poisson": poisson},
                "displacement": [{"boundary": name, "x": 0.0} for name in ("left", "right")],
                "traction": {"boundary": "top", "pressure": load},
                "contact": {"boundary": "seat", "foundation": circle},
            }
        )

    return make


def punch(rng: np.random.Generator, folder: Path) -> Make:
    """A punch with round edges on a plane: the pressure is largest near their beginning."""
    rounding, poisson, load = rng.uniform(0.5, 0.8), rng.uniform(0.1, 0.4), rng.uniform(20, 60)

    def make(degree: int, size: float) -> Scene:
        parameters = {"width": 2.0, "height": 2.0, "rounding": rounding, "symmetric": True, "order": degree}
        sizes = {"size": 0.25 * size, "contact_size": 0.06 * size}
        return parse_scene(
            {
                "mesh": {"generator": "punch", "parameters": {**parameters, **sizes}},
                "element": {"degree": degree},
                "material": {"young": 1000.0, "poisson": poisson},
                "displacement": {"boundary": "symmetry", "x": 0.0},
                "traction": {"boundary": "top", "pressure": load},
                "contact": {"boundary": "foot", **BELOW},
            }
        )

    return make


PLANE = {
    problem.__name__: problem
    for problem in (
        line, sphere, periodic, layer, axisymmetric_layer, receding, bowl, groove, pin, tight_pin, lug, cylinders,
        balls, shoe, saddle, punch,
    )
}  # fmt: skip


def _quarter_of_sphere(radius: float, wide: float, size: float, degree: int) -> Table:
    parameters = {"part": "quarter", "radius": radius, "size": 0.3 * radius * max(size, 0.5), "order": degree}
    sizes = {"contact_size": wide / 4 * size, "contact_zone": 1.4 * wide}
    return {"generator": "half_sphere", "parameters": parameters | sizes}


def _pressed_sphere(
    radius: float, wide: float, load: float, poisson: float, degree: int, size: float, gap: str
) -> Scene:
    return parse_scene(
        {
            "mesh": _quarter_of_sphere(radius, wide, size, degree),
            "element": {"degree": degree},
            "material": {"young": 200.0, "poisson": poisson},
            "displacement": [{"boundary": "symmetry_x", "x": 0.0}, {"boundary": "symmetry_y", "y": 0.0}],
            "traction": {"boundary": "top", "pressure": load},
            "contact": {"boundary": "sphere", "gap": gap, "direction": [0.0, 0.0, -1.0]},
        }
    )


def ball(rng: np.random.Generator, folder: Path) -> Make:
    """A quarter of half a ball on a plane."""
    radius, share, poisson = rng.uniform(3, 10), rng.uniform(0.12, 0.2), rng.uniform(0, 0.4)
    wide = share * radius
    load = 4 * _modulus(200.0, poisson) * wide**3 / (3 * radius) / (math.pi * radius**2)
    return lambda degree, size: _pressed_sphere(radius, wide, load, poisson, degree, size, "x[2]")


def ellipsoid(rng: np.random.Generator, folder: Path) -> Make:
    """The same on a saddle, which makes an ellipse of the contact."""
    radius, share, poisson = rng.uniform(3, 10), rng.uniform(0.12, 0.18), rng.uniform(0, 0.4)
    across, along = rng.uniform(0.1, 0.6, 2)
    wide = share * radius
    load = 4 * _modulus(200.0, poisson) * wide**3 / (3 * radius) / (math.pi * radius**2)
    gap = f"x[2] + {across / 2 / radius} * x[0]**2 - {along / 2 / radius} * x[1]**2"
    return lambda degree, size: _pressed_sphere(radius, wide, load, poisson, degree, size, gap)


def box(rng: np.random.Generator, folder: Path) -> Make:
    """A box of hexahedra over a bowl, pulled across with Coulomb's friction."""
    bend, coefficient, poisson = rng.uniform(0.008, 0.015, 2), rng.uniform(0.1, 0.4), rng.uniform(0.1, 0.4)

    def make(degree: int, size: float) -> Scene:
        counts = {"nx": round(12 / size), "ny": round(8 / size), "nz": round(6 / size), "cell": "hexahedron"}
        return parse_scene(
            {
                "mesh": {"generator": "box", "parameters": {"length": 1.5, "width": 1.0, "height": 0.8, **counts}},
                "element": {"degree": degree},
                "material": {"young": 5000.0, "poisson": poisson},
                "displacement": [
                    {"boundary": "left", "x": 0.0},
                    {"boundary": "right", "x": 0.0},
                    {"boundary": "front", "y": 0.0},
                ],
                "traction": {
                    "boundary": "top",
                    "z": "-20 * exp(-((x[0] - 0.75)**2 + x[1]**2) / 0.3)",
                    "y": 2.0,
                },
                "contact": {
                    "boundary": "bottom",
                    "gap": f"{bend[0]} * (x[0] - 0.7)**2 + {bend[1]} * x[1]**2",
                    "friction": {"law": "coulomb", "coefficient": coefficient},
                },
            }
        )

    return make


SPACE = {problem.__name__: problem for problem in (ball, ellipsoid, box)}
