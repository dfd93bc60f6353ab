"""Problems that forecasts of cost are tried on: those that their ranges were chosen on, and others."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Problem:
    """One that is solved on a mesh, and then to an accuracy.

    Attributes:
        kind: of the body.
        name: of the problem.
        chosen_on: whether it had a part in the choice of the ranges.
        scene: on its first mesh.
    """

    kind: str
    name: str
    chosen_on: bool
    scene: Any


# Names of problems, and the scene of each on its first mesh.
Problems = list[tuple[str, Any]]


def _scene(scene: Any, first: float = 1.0) -> Any:
    """A scene from generators on cells ``first`` times as large as its own."""
    from signorini_fx.scenes.mesh import scene_on

    return scene_on(scene, first)


def parsed(
    cells: tuple[int, int], size: tuple[float, float] = (3.0, 1.0), cell: str = "quadrilateral", **data: Any
) -> Any:
    from signorini_fx.scenes.reading import parse_scene

    mesh = {
        "generator": "rectangle",
        "parameters": {"length": size[0], "height": size[1], "nx": cells[0], "ny": cells[1], "cell": cell},
    }
    material = {"young": 5000.0, "poisson": 0.3, **data.pop("material", {})}
    return parse_scene({"mesh": mesh, "material": material, **data})


TRESCA, COULOMB = {"law": "tresca", "bound": 1.5}, {"law": "coulomb", "coefficient": 0.3}


def _plane() -> Problems:
    """Scenes of the demos, a block that stands on its base, and random ones."""
    from cases import scene_of

    example = scene_of("example1_coulomb")
    contact = example.contact[0]
    smooth = example.model_copy(update={"contact": (contact.model_copy(update={"friction": _no_friction()}),)})
    quadratic = example.model_copy(update={"element": example.element.model_copy(update={"degree": 2})})
    base = {"displacement": {"boundary": "top", "x": 0.01, "y": -0.02}}
    standing = {
        f"flat base, {name}": parsed((24, 8), contact={"boundary": "bottom", "friction": law}, **base)
        for name, law in (("Coulomb 0.3", COULOMB), ("Coulomb 1", {"law": "coulomb", "coefficient": 1.0}))
    }
    problems = [
        ("Example 1, Tresca", _scene(scene_of("example1_tresca"), 4)),
        ("Example 1, Coulomb", _scene(example, 4)),
        ("Example 1, frictionless", _scene(smooth, 4)),
        ("Example 1, Coulomb, degree 2", _scene(quadratic, 8)),
        ("Example 2, Tresca", _scene(scene_of("example2_tresca"), 4)),
        ("Example 1, Coulomb, as it is", _scene(example)),
        ("Hertz", _scene(scene_of("hertz"), 2)),
        ("Hertz, friction", _scene(scene_of("hertz_friction"), 4)),
        ("rubber mount, four load steps", _scene(scene_of("rubber_mount"))),
        *((name, _scene(scene)) for name, scene in standing.items()),
    ]
    return problems


def _no_friction() -> Any:
    from signorini_fx.mechanics.laws.none import NoFriction

    return NoFriction()


def _cylinder(
    gap: Any,
    friction: Any = None,
    degree: int = 1,
    cells: tuple[int, int] = (16, 16),
    size: tuple[float, float] = (1.0, 1.0),
    cell: str = "quadrilateral",
) -> Any:
    """A cylinder, half of its section, pressed down on its base."""
    contact = {"boundary": "bottom", "gap": gap, **({"friction": friction} if friction else {})}
    down = [{"boundary": "left", "x": 0.0}, {"boundary": "top", "x": 0.0, "y": -0.02}]
    turned = {"hypothesis": "axisymmetric"}
    return parsed(cells, size, cell, displacement=down, contact=contact, element={"degree": degree}, material=turned)


def _rings() -> Problems:
    """Cylinders that stand, and with a crown."""
    crown = "0.02 * x[0]**2"
    return [
        ("crowned cylinder", _scene(_cylinder(crown))),
        ("crowned cylinder, Tresca", _scene(_cylinder(crown, TRESCA))),
        ("crowned cylinder, Coulomb", _scene(_cylinder(crown, COULOMB))),
        ("crowned cylinder, Coulomb, degree 2", _scene(_cylinder(crown, COULOMB, 2, (8, 8)))),
        ("flat cylinder", _scene(_cylinder(0.0))),
        ("flat cylinder, Coulomb", _scene(_cylinder(0.0, COULOMB))),
    ]


def _space() -> Problems:
    """The block, the ball and the brick of ``accuracy_in_space``."""
    names = ("block, Q1", "block, Tresca, P1", "block, Coulomb, Q1", "sphere, P1", "sphere, Q1", "brick, Q1")
    return _of_space(names)


def _of_space(names: Sequence[str]) -> Problems:
    """Scenes of ``accuracy_in_space`` by their names."""
    import accuracy_in_space

    return [(name, accuracy_in_space.on_mesh(accuracy_in_space.SCENES[name](), 2.0)) for name in names]


def _pair(
    gap: Any,
    *,
    wide: float = 3.0,
    friction: Any = None,
    degree: int = 1,
    turned: bool = False,
    young: tuple[float, float] = (200.0, 600.0),
    cells: tuple[int, int] = (8, 10),
    cell: str = "quadrilateral",
) -> Any:
    """A body of 2 x 1 that is pressed on one of ``wide`` x 1, with so many cells per unit of length."""
    from signorini_fx.scenes.reading import parse_scene

    hypothesis = {"hypothesis": "axisymmetric"} if turned else {}

    def body(name: str, length: float, shift: list[float], along: int) -> dict[str, Any]:
        parameters = {"length": length, "height": 1.0, "nx": round(along * length), "ny": along, "cell": cell}
        return {"name": name, "shift": shift, "mesh": {"generator": "rectangle", "parameters": parameters}}

    beside = 0.0 if turned else -(wide - 2.0) / 2
    axis = [{"boundary": f"{name}.left", "x": 0.0} for name in ("upper", "lower")] if turned else []
    return parse_scene(
        {
            "body": [body("upper", 2.0, [0.0, 1.0], cells[0]), body("lower", wide, [beside, 0.0], cells[1])],
            "element": {"degree": degree},
            "material": [
                {"region": "upper", "young": young[0], "poisson": 0.3, **hypothesis},
                {"region": "lower", "young": young[1], "poisson": 0.2, **hypothesis},
            ],
            "displacement": [
                *axis,
                {"boundary": "lower.bottom", "x": 0.0, "y": 0.0},
                {"boundary": "upper.top", "x": 0.0, "y": -0.05},
            ],
            "contact": {
                "boundary": "upper.bottom",
                "against": "lower.top",
                "gap": gap,
                **({"friction": friction} if friction else {}),
            },
        }
    )


def _bodies() -> Problems:
    """A body on a wider, stiffer one, crowned or with its edges, with friction, and bodies of revolution."""
    crown, middle = "0.05 * (x[0] - 1)**2", "0.05 * x[0]**2"
    return [
        ("crowned on a block", _scene(_pair(crown))),
        ("crowned on a block, Coulomb", _scene(_pair(crown, friction=COULOMB))),
        ("crowned on a block, degree 2", _scene(_pair(crown, degree=2), 2)),
        ("edges on a block", _scene(_pair(0.0))),
        ("edges on a block, Coulomb", _scene(_pair(0.0, friction=COULOMB))),
        ("of revolution", _scene(_pair(middle, turned=True))),
    ]


def _other_plane() -> Problems:
    """Other shapes, materials and elements, and random scenes of another seed."""
    from cases import scene_of

    wheel = scene_of("braked_wheel")
    base = {"displacement": {"boundary": "top", "x": -0.01, "y": -0.01}}
    bowl = {"boundary": "bottom", "gap": "0.01 * (x[0] - 1)**2"}
    guides = {"displacement": [{"boundary": "left", "x": 0.0}, {"boundary": "right", "x": 0.0}]}
    pressed = {"traction": {"boundary": "top", "x": 3.0, "y": -20.0}, **guides}
    fine, coarse, quadratic = ((24, 12), (2.0, 1.0)), ((12, 6), (2.0, 1.0)), {"element": {"degree": 2}}
    rough, rubber = bowl | {"friction": COULOMB}, {"material": {"poisson": 0.45}}
    return [
        ("flat base, Tresca, triangles", _scene(parsed(*fine, "triangle", contact=_on(0.0, TRESCA), **base))),
        ("bowl between guides", _scene(parsed(*fine, contact=bowl, **pressed))),
        ("bowl between guides, Coulomb, degree 2", _scene(parsed(*coarse, contact=rough, **pressed, **quadratic))),
        (
            "rubber, Coulomb, degree 2",
            _scene(parsed(*coarse, contact=_on(0.0, COULOMB), **base, **rubber, **quadratic)),
        ),
        ("braked wheel, three load steps", _scene(wheel, 4)),
    ]


def _on(gap: Any, friction: Any) -> dict[str, Any]:
    return {"boundary": "bottom", "gap": gap, "friction": friction}


def _other_rings() -> Problems:
    """Flat and tall cylinders, on triangles and with degree 2, and a shaft with torsion."""
    from cases import scene_of

    sharp = "0.05 * x[0]**2"
    return [
        ("disc with a crown, triangles", _scene(_cylinder(sharp, None, 1, (24, 12), (2.0, 1.0), "triangle"))),
        ("tall cylinder, Tresca", _scene(_cylinder(0.0, TRESCA, 1, (10, 20), (1.0, 2.0)))),
        ("disc with a crown, Coulomb, degree 2", _scene(_cylinder(sharp, COULOMB, 2, (12, 6), (2.0, 1.0)))),
        ("tall cylinder, degree 2", _scene(_cylinder(0.0, None, 2, (6, 12), (1.0, 2.0)))),
        ("twisted shaft, seven load steps", _scene(scene_of("twisted_shaft"), 3)),
    ]


def _other_space() -> Problems:
    """The other scenes of ``accuracy_in_space``."""
    return _of_space(("block, P1", "block, Tresca, Q1", "block, Coulomb, P1", "brick, P1", "foot, P1", "block, Q2"))


def _other_bodies() -> Problems:
    """A stiff body on a soft one, equal ones, triangles, degree 2, Tresca, revolution with friction, a press fit."""
    from cases import scene_of

    crown, middle = "0.05 * (x[0] - 1)**2", "0.05 * x[0]**2"
    stiff: dict[str, Any] = {"young": (900.0, 100.0), "friction": COULOMB}
    return [
        ("stiff crowned, Tresca", _scene(_pair(crown, **stiff | {"friction": TRESCA}, cells=(10, 8)))),
        ("stiff crowned, Coulomb, degree 2", _scene(_pair(crown, **stiff, degree=2, cells=(6, 4)))),
        ("edges, triangles", _scene(_pair(0.0, wide=5.0, cells=(10, 6), cell="triangle"))),
        ("edges, Coulomb, degree 2", _scene(_pair(0.0, friction=COULOMB, degree=2, cells=(4, 5)))),
        ("of revolution, Coulomb", _scene(_pair(middle, turned=True, friction=COULOMB))),
        ("press fit, two load steps", _scene(scene_of("press_fit"), 2)),
    ]


CHOSEN_ON: Mapping[str, Callable[[], Problems]] = {
    "plane": _plane,
    "rings": _rings,
    "space": _space,
    "two bodies": _bodies,
}
OTHERS: Mapping[str, Callable[[], Problems]] = {
    "plane": _other_plane,
    "rings": _other_rings,
    "space": _other_space,
    "two bodies": _other_bodies,
}


def problems() -> list[Problem]:
    """All of them."""
    return [
        Problem(kind, name, kinds is CHOSEN_ON, scene)
        for kinds in (CHOSEN_ON, OTHERS)
        for kind, listed in kinds.items()
        for name, scene in listed()
    ]
