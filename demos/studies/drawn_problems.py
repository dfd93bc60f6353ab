"""Eighty contact problems drawn at random, half of them with another seed: what studies of the
accuracy measure on.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import ufl
from mpi4py import MPI
from dolfinx import fem
from dolfinx import mesh as dmesh

import signorini_fx as sfx
from signorini_fx.scenes.reading import parse_scene

# Of the first half, on which rules may be chosen, and of the second, drawn after the last choice.
SEEDS = (7, 9)
TRIANGLE, QUADRILATERAL, TETRAHEDRON, HEXAHEDRON = (
    "triangle",
    "quadrilateral",
    "tetrahedron",
    "hexahedron",
)


@dataclass(frozen=True)
class Problem:
    """A problem: its solve on one mesh, and that to an accuracy."""

    kind: str
    name: str
    first: Callable[[], Any]
    to_accuracy: Callable[[sfx.Accuracy], Any]


def of_scene(data: dict[str, Any]) -> tuple[Callable[[], Any], Callable[[sfx.Accuracy], Any]]:
    """Both solves of a scene."""
    scene = parse_scene(data)

    def to_accuracy(goal: sfx.Accuracy) -> Any:
        return sfx.solve(scene.model_copy(update={"accuracy": goal}), MPI.COMM_SELF, check=False)

    return partial(sfx.solve, scene, MPI.COMM_SELF), to_accuracy


def rectangle(length: float, n: int, cell: str) -> dict[str, Any]:
    """Its mesh, of n cells over its height, which is 1."""
    parameters = {"length": length, "height": 1.0, "nx": round(n * length), "ny": n, "cell": cell}
    return {"generator": "rectangle", "parameters": parameters}


def friction(draw: Random) -> dict[str, Any]:
    """None, Tresca or Coulomb."""
    coulomb = {"law": "coulomb", "coefficient": draw.uniform(0.1, 0.6)}
    tresca = {"law": "tresca", "bound": draw.uniform(0.5, 3.0)}
    return draw.choice(({"law": "none"}, tresca, coulomb, coulomb))


def gap(draw: Random, length: float) -> str:
    """A bowl, waves, a dent or a plane."""
    middle = f"(x[0] - {draw.uniform(0.3, 0.7) * length:.3f})"
    return draw.choice(
        (
            f"{draw.uniform(0.003, 0.03):.4f} * {middle}**2",
            f"{draw.uniform(0.003, 0.03):.4f} * {middle}**2",
            f"{draw.uniform(0.0005, 0.003):.4f} * (1 - cos({draw.uniform(2, 5):.2f} * {middle}))",
            f"{draw.uniform(0.002, 0.01):.4f} * (1 - exp(-({middle} / 0.5)**2))",
            "0",
        )
    )


def plane(draw: Random) -> dict[str, Any]:
    """A block that is pushed or loaded onto a foundation."""
    length = draw.choice((1.0, 2.0, 3.0))
    cell = draw.choice(("quadrilateral", "triangle"))
    sides = [{"boundary": "left", "x": 0.0}, {"boundary": "right", "x": 0.0}]
    load = {"boundary": "top", "y": -draw.uniform(3, 20)}
    begin = draw.uniform(0, 0.5) * length
    end = begin + draw.uniform(0.2, 0.5) * length
    part = {"boundary": "top", "y": f"-20 if {begin:.2f} <= x[0] <= {end:.2f} else 0"}
    moved = {"boundary": "top", "x": draw.uniform(0, 0.02), "y": -0.015}
    ways = (
        {"displacement": moved},
        {"displacement": sides, "traction": load},
        {"displacement": sides[0], "traction": load | {"x": draw.uniform(0, 2)}},
        {"displacement": sides[0] | {"y": 0.0}, "traction": load},
        {"displacement": sides, "traction": part},
    )
    hypothesis = draw.choice(("plane strain", "plane stress"))
    return {
        "mesh": rectangle(length, draw.randint(5, 14), cell),
        "element": {"degree": draw.choice((1, 1, 2))},
        "material": material(draw, hypothesis),
        "contact": {
            "boundary": "bottom",
            "gap": gap(draw, length),
            "friction": friction(draw),
        },
        **draw.choice(ways),
    }


def material(draw: Random, hypothesis: str) -> dict[str, Any]:
    """A linear one."""
    poisson = draw.choice((0.2, 0.3, 0.4, 0.45))
    return {"young": 1000.0, "poisson": poisson, "hypothesis": hypothesis}


def revolved(draw: Random) -> dict[str, Any]:
    """The same block, of revolution."""
    data = plane(draw)
    moved = {"boundary": "top", "x": 0.0, "y": -0.01}
    loaded = {"traction": {"boundary": "top", "y": -draw.uniform(3, 20)}}
    way = draw.choice(({"displacement": moved}, {"displacement": []} | loaded))
    return {**data, "traction": [], "material": material(draw, "axisymmetric"), **way}


def bodies(draw: Random) -> dict[str, Any]:
    """A body with a crown or edges that is pressed on a wider one, and pushed."""
    cell = draw.choice(("quadrilateral", "triangle"))
    crown = draw.choice((0.0, 0.02, 0.05, 0.1))
    upper = {
        "name": "upper",
        "shift": [0.0, 1.0],
        "mesh": rectangle(1.0, draw.randint(6, 12), cell),
    }
    lower = {
        "name": "lower",
        "shift": [-0.5, 0.0],
        "mesh": rectangle(2.0, draw.randint(6, 12), cell),
    }
    pushed = {"boundary": "upper.top", "x": draw.uniform(0, 0.02), "y": -draw.uniform(0.01, 0.05)}
    return {
        "body": [upper, lower],
        "element": {"degree": draw.choice((1, 2))},
        "material": [
            {"poisson": 0.3, "young": draw.uniform(50, 500), "region": region}
            for region in ("upper", "lower")
        ],
        "displacement": [{"boundary": "lower.bottom", "x": 0.0, "y": 0.0}, pushed],
        "contact": {
            "boundary": "upper.bottom",
            "against": "lower.top",
            "gap": f"{crown:.3f} * (x[0] - 0.5)**2",
            "friction": friction(draw),
        },
    }


def arcs(draw: Random) -> dict[str, Any]:
    """A half disk, of revolution or not, that is pressed onto a plane."""
    radius = draw.uniform(4.0, 10.0)
    sizes = {"size": radius / 8, "contact_size": draw.uniform(0.02, 0.06) * radius}
    parameters = {"radius": radius, "symmetric": True, "contact_zone": 0.2 * radius, **sizes}
    hypothesis = draw.choice(("plane strain", "axisymmetric"))
    sides = [{"boundary": "symmetry", "x": 0.0}]
    pressed = draw.choice(
        (
            {
                "displacement": [
                    *sides,
                    {"boundary": "top", "y": -draw.uniform(0.01, 0.04) * radius},
                ]
            },
            {"displacement": sides, "traction": {"boundary": "top", "y": -draw.uniform(3, 20)}},
        )
    )
    foundation = {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
    return {
        "mesh": {"generator": "half_disk", "parameters": parameters},
        "element": {"degree": draw.choice((1, 2))},
        "material": material(draw, hypothesis),
        "contact": {"boundary": "arc", "foundation": foundation, "friction": friction(draw)},
        **pressed,
    }


def space(draw: Random) -> dict[str, Any]:
    """A box whose top is moved down and along, on a bowl."""
    n = draw.randint(4, 6)
    bowl = f"{draw.uniform(0.002, 0.02):.4f} * ((x[0] - 1)**2 + (x[1] - 0.4)**2)"
    cell = draw.choice(("tetrahedron", "hexahedron"))
    sizes = {"length": 2.0, "nx": 2 * n, "ny": n, "nz": n, "cell": cell}
    return {
        "mesh": {"generator": "box", "parameters": sizes},
        "material": {"young": 1000.0, "poisson": draw.choice((0.2, 0.3, 0.4))},
        "displacement": {"boundary": "top", "x": draw.uniform(0, 0.01), "y": 0.0, "z": -0.02},
        "contact": {"boundary": "bottom", "gap": bowl, "friction": friction(draw)},
    }


def nonlinear(draw: Random) -> dict[str, Any]:
    """Rubber or metal into which a rigid circle is pressed in two load steps."""
    metal = {"law": "j2", "young": 2e5, "poisson": 0.3, "yield_stress": 300.0, "hardening": 2e3}
    law = draw.choice(
        (
            {"law": "neo-hooke", "young": 3.0, "poisson": draw.choice((0.3, 0.4))},
            {"law": "mooney-rivlin", "c10": 0.3, "c01": 0.1, "bulk": 3.0},
            {"law": "saint-venant-kirchhoff", "young": 1.0, "poisson": 0.3},
            metal,
        )
    )
    depth = draw.uniform(*((0.01, 0.02) if law is metal else (0.08, 0.2)))
    radius = draw.uniform(0.6, 1.2)
    place = {"centre": [draw.uniform(0.8, 1.2), 1 + radius], "shift": [0.0, f"-{depth:.3f}*t"]}
    return {
        "mesh": rectangle(2.0, draw.randint(6, 12), draw.choice(("quadrilateral", "triangle"))),
        "element": {"degree": draw.choice((1, 2))},
        "material": law,
        "displacement": {"boundary": "bottom", "x": 0.0, "y": 0.0},
        "contact": {
            "boundary": "top",
            "foundation": {"shape": "circle", "radius": radius, **place},
            "friction": draw.choice(({"law": "none"}, {"law": "coulomb", "coefficient": 0.3})),
        },
        "load_steps": {"times": [0.5, 1.0]},
    }


def drawing(draw: Random) -> dict[str, Any]:
    """A punch of a drawing, its edges rounded or cut, on a plane or on a circle."""
    width, edge = draw.uniform(1.0, 3.0), draw.uniform(0.1, 0.3)
    corners = [(0, 1), (0, edge), (edge, 0), (width - edge, 0), (width, edge), (width, 1)]
    points = [*corners, (edge, edge), (width - edge, edge)]
    lines = [f"Point({k + 1}) = {{{x:.6f}, {y:.6f}, 0}};" for k, (x, y) in enumerate(points)]
    lines += [f"Line({k}) = {{{k}, {k % 6 + 1}}};" for k in (1, 3, 5, 6)]
    if draw.random() < 0.5:
        lines += ["Circle(2) = {2, 7, 3};", "Circle(4) = {4, 8, 5};"]
    else:
        lines += ["Line(2) = {2, 3};", "Line(4) = {4, 5};"]
    lines += [
        f"Curve Loop(1) = {{1 : 6}}; Plane Surface(1) = {{1}}; MeshSize {{:}} = "
        f"{draw.uniform(0.08, 0.14):.3f};",
        'Physical Curve("bottom") = {2 : 4}; Physical Curve("top") = {6};',
        'Physical Surface("body") = {1};',
    ]
    file = Path(tempfile.mkdtemp()) / "punch.geo"
    file.write_text("\n".join(lines), encoding="utf-8")
    radius = draw.uniform(3.0, 10.0)
    foundation = draw.choice(
        (
            {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]},
            {"shape": "circle", "radius": radius, "centre": [width / 2, -radius]},
        )
    )
    return {
        "mesh": {"file": str(file)},
        "element": {"degree": draw.choice((1, 2))},
        "material": material(draw, "plane strain"),
        "displacement": {
            "boundary": "top",
            "x": draw.uniform(0, 0.005),
            "y": -draw.uniform(0.01, 0.03),
        },
        "contact": {"boundary": "bottom", "foundation": foundation, "friction": friction(draw)},
    }


def forms(draw: Random) -> tuple[Callable[[], Any], Callable[[sfx.Accuracy], Any]]:
    """A block of a user's own forms, softer towards x[0] = 0, whose top is moved."""
    cell = draw.choice((TRIANGLE, TRIANGLE, QUADRILATERAL, TETRAHEDRON))
    dim, kind = (3 if cell == TETRAHEDRON else 2), dmesh.CellType[cell]
    degree = 1 if dim == 3 else draw.choice((1, 2))
    n = draw.randint(8, 12) // degree // (dim - 1)
    bowl, across = draw.uniform(0.0, 0.02), draw.uniform(0.0, 0.01)
    weak = draw.choice((0.0, 0.5, 0.8))
    law = draw.choice((sfx.Coulomb(draw.uniform(0.1, 0.5)), sfx.Tresca(1.0), sfx.NoFriction()))

    def mesh(finer: int) -> Any:
        create = dmesh.create_rectangle if dim == 2 else dmesh.create_box
        size = (2, 1) if dim == 2 else (2, 1, 1)
        return create(MPI.COMM_SELF, [[0.0] * dim, size], [finer * n * k for k in size], kind)

    def make(domain: Any) -> sfx.ContactProblem:
        V = fem.functionspace(domain, ("Lagrange", degree, (dim,)))
        u, v, x = ufl.TrialFunction(V), ufl.TestFunction(V), ufl.SpatialCoordinate(domain)
        ends = (lambda x: np.isclose(x[dim - 1], 0.0)), (lambda x: np.isclose(x[dim - 1], 1.0))
        bottom, top = (dmesh.locate_entities_boundary(domain, dim - 1, end) for end in ends)
        moved = np.array([across, 0.0, -0.02] if dim == 3 else [across, -0.02])

        def stress(y: Any) -> Any:
            e = ufl.sym(ufl.grad(y))
            return (1 - weak * (1 - x[0] / 2)) * (800 * e + 600 * ufl.tr(e) * ufl.Identity(dim))

        a = ufl.inner(stress(u), ufl.grad(v)) * ufl.dx
        L = ufl.inner(fem.Constant(domain, np.zeros(dim)), v) * ufl.dx
        held = fem.dirichletbc(moved, fem.locate_dofs_topological(V, dim - 1, top), V)
        base = sfx.Foundation(bottom, gap=bowl * (x[0] - 1) ** 2, friction=law)
        return sfx.ContactProblem(a, L, [held], base, stress=stress)

    def first() -> Any:
        (problem := make(mesh(1))).solve()
        return problem.solution

    def to_accuracy(goal: sfx.Accuracy) -> Any:
        try:
            return sfx.solve_to_accuracy(make, mesh if cell == QUADRILATERAL else mesh(1), goal)
        except sfx.ConvergenceError as error:
            return error.solution

    return first, to_accuracy


SCENES = {
    "plane": plane,
    "rings": revolved,
    "two bodies": bodies,
    "arcs": arcs,
    "drawings": drawing,
    "space": space,
    "nonlinear": nonlinear,
}
# Of sixteen problems one after the other.
ORDER = (
    *("plane", "nonlinear", "space", "arcs", "forms", "rings", "nonlinear", "space"),
    *("drawings", "nonlinear", "two bodies", "arcs", "forms", "nonlinear", "plane", "space"),
)
COUNT = 5 * len(ORDER)


def drawn(number: int) -> Problem:
    """The problem of a number up to ``COUNT``."""
    kind = ORDER[number % len(ORDER)]
    draw = Random(1000 * SEEDS[held_out(number)] + number)
    solves = forms(draw) if kind == "forms" else of_scene(SCENES[kind](draw))
    return Problem(kind, f"{kind} {number}", *solves)


def held_out(number: int) -> bool:
    """Whether a problem was drawn after the last choice of rules."""
    return 2 * number >= COUNT
