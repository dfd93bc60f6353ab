"""Random scenes for studies of accuracy, and references that resolve their corners.

Most have contact up to the corners of the body; there are slanted sides, reentrant corners, several materials, loads
and friction that jump between nodes.  Scenes are small, so that hundreds of runs take minutes.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from mpi4py import MPI
from dolfinx import mesh as dmesh
from reference import Reference

from signorini_fx.errors import SignoriniError
from signorini_fx.machine import compat
from signorini_fx.mechanics.mesh.refinement import mark, refine
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, tag_boundaries
from signorini_fx.mechanics.statement.settings import SolverSettings
from signorini_fx.records import History
from signorini_fx.results.solution import ConvergenceError
from signorini_fx.scenes.mesh_sequence import meshed_scene
from signorini_fx.scenes.scene import Scene
from signorini_fx.scenes.solver import solve

NEAR = 1e-9
# gamma of a reference, in units of Young's modulus: on the block of ``test_contact_up_to_a_corner`` the energy of 1e5
# and of 1e9 differ by less than 1e-11.
HARD = 1e6
QUANTITIES = ("energy", "pressure", "force")


@dataclass(frozen=True)
class Body:
    """A body on a grid of squares, some of them left out, its sides slanted.

    Attributes:
        length: along the bottom.
        height: of the body.
        slant: the top is longer than the bottom by this share.
        cut: (x, y, kind): the corner beyond is left out, kind ``shelf`` (above) or ``foot`` (below); None: none.
        layer: (axis, place): beyond it is the second material; None: one material.
        cells: along the bottom and the left side.
    """

    length: float
    height: float
    slant: float
    cut: tuple[float, float, str] | None
    layer: tuple[int, float] | None
    cells: tuple[int, int]

    def corners(self) -> list[tuple[float, float]]:
        """Points where the stress may be singular: corners, and ends of the interface."""
        length, height = self.length, self.height
        points = [(0.0, 0.0), (length, 0.0), (length, height), (0.0, height)]
        if self.cut is not None:
            x, y, kind = self.cut
            points += [(x, y), (x, height if kind == "shelf" else 0.0), (length, y)]
        if self.layer is not None:
            axis, place = self.layer
            points += [(place, 0.0), (place, height)] if axis == 0 else [(0.0, place), (length, place)]
        return [tuple(p) for p in self._slanted(np.array(points).T).T]

    def _slanted(self, x: Any) -> Any:
        middle = self.length / 2
        return np.array([middle + (x[0] - middle) * (1 + self.slant * x[1] / self.height), x[1]])

    def mesh(self, factor: float = 1.0) -> TaggedMesh:
        """Triangles, ``factor`` times as large as those of the scene, where the grid allows it."""
        nx, ny = (max(1, round(n / factor)) for n in self.cells)

        def lines(n: int, length: float, at: list[float]) -> Any:
            """A grid line through each of the places."""
            ends = [0.0, *sorted(at), length]
            parts = [np.linspace(a, b, max(1, round(n * (b - a) / length)) + 1)[:-1] for a, b in pairwise(ends)]
            return np.append(np.concatenate(parts), length)

        at: tuple[list[float], list[float]] = ([], [])
        if self.cut is not None:
            at[0].append(self.cut[0])
            at[1].append(self.cut[1])
        if self.layer is not None and self.layer[1] not in at[self.layer[0]]:
            at[self.layer[0]].append(self.layer[1])
        xs, ys = lines(nx, self.length, at[0]), lines(ny, self.height, at[1])
        points = np.array([(x, y) for y in ys for x in xs])
        squares = [(i, j) for j in range(len(ys) - 1) for i in range(len(xs) - 1) if self._kept(xs, ys, i, j)]
        corner = np.array([[j * len(xs) + i, j * len(xs) + i + 1] for i, j in squares])
        low, high = corner, corner + len(xs)
        # The diagonal alternates: no direction is preferred.
        even = np.array([(i + j) % 2 == 0 for i, j in squares])[:, None]
        a, b, c, d = low[:, :1], low[:, 1:], high[:, 1:], high[:, :1]
        first = np.where(even, np.hstack((a, b, c)), np.hstack((a, b, d)))
        second = np.where(even, np.hstack((a, c, d)), np.hstack((b, c, d)))
        cells = np.vstack((first, second))
        used, cells = np.unique(cells, return_inverse=True)
        cells = cells.reshape(-1, 3)
        mesh = _create(points[used], cells)
        tagged = tag_boundaries(mesh, self._sides())
        mesh.topology.create_entities(2)
        count = mesh.topology.index_map(2).size_local
        middles = dmesh.compute_midpoints(mesh, 2, np.arange(count, dtype=np.int32))
        kinds = np.ones(count, dtype=np.int32)
        regions = {"body": 1}
        if self.layer is not None:
            axis, place = self.layer
            kinds[middles[:, axis] > place] = 2
            regions = {"first": 1, "second": 2}
        tags = dmesh.meshtags(mesh, 2, np.arange(count, dtype=np.int32), kinds)
        mesh.geometry.x[:, :2] = self._slanted(mesh.geometry.x[:, :2].T).T
        return TaggedMesh(mesh, tagged.facet_tags, tagged.boundaries, tags, regions)

    def _kept(self, xs: Any, ys: Any, i: int, j: int) -> bool:
        if self.cut is None:
            return True
        x, y, kind = self.cut
        above = ys[j] >= y - NEAR
        return not (xs[i] >= x - NEAR and (above if kind == "shelf" else not above))

    def _sides(self) -> dict[str, Any]:
        sides = {
            "left": lambda x: np.abs(x[0]) < NEAR,
            "right": lambda x: np.abs(x[0] - self.length) < NEAR,
            "bottom": lambda x: np.abs(x[1]) < NEAR,
            "top": lambda x: np.abs(x[1] - self.height) < NEAR,
        }
        return sides


def _create(points: Any, cells: Any) -> Any:
    import basix.ufl
    import ufl

    element = basix.ufl.element("Lagrange", "triangle", 1, shape=(2,))
    return dmesh.create_mesh(MPI.COMM_SELF, cells=cells.astype(np.int64), x=points, e=ufl.Mesh(element))


@dataclass(frozen=True)
class RandomScene:
    """A scene, the body that it is of, and the points where its solution may be singular."""

    name: str
    scene: Scene
    body: Body
    points: tuple[tuple[float, float], ...]
    traits: tuple[str, ...]


def draw(rng: np.random.Generator, number: int) -> RandomScene:
    """A random scene; it may have no solution.

    Args:
        rng: where the numbers come from.
        number: every second scene has contact up to corners for sure.
    """
    length, height = round(rng.uniform(1.0, 3.0), 2), round(rng.uniform(0.6, 1.5), 2)
    along = int(rng.integers(6, 17))
    cells = along, max(3, round(along * height / length))
    shape = rng.choice(["rectangle", "slanted", "shelf", "foot", "layers"])
    corner = number % 2 == 0 or bool(rng.integers(2))
    slant, cut, layer = 0.0, None, None
    traits = [str(shape)]
    if shape == "slanted":
        slant = round(rng.uniform(-0.4, 0.5), 2)
    if shape in ("shelf", "foot"):
        cut = round(length * rng.uniform(0.4, 0.75), 2), round(height * rng.uniform(0.35, 0.65), 2), str(shape)
    if shape == "layers":
        axis = int(rng.integers(2))
        layer = axis, round((length, height)[axis] * rng.uniform(0.3, 0.7), 2)
    body = Body(length, height, slant, cut, layer, cells)
    touching = cut[0] if cut is not None and cut[2] == "foot" else length
    young = 1000.0
    poisson = round(rng.uniform(0.2, 0.42), 2)
    material: Any = {"young": young, "poisson": poisson}
    if layer is not None:
        ratio = round(float(np.exp(rng.uniform(np.log(0.05), np.log(20)))), 3)
        material = [
            {"young": young, "poisson": poisson, "region": "first"},
            {"young": young * ratio, "poisson": round(rng.uniform(0.2, 0.42), 2), "region": "second"},
        ]
    points = body.corners()
    friction: Any = None
    law = rng.choice(["none", "tresca", "coulomb", "coulomb", "jump"])
    pressed = 10.0
    if law == "tresca":
        friction = {"law": "tresca", "bound": round(rng.uniform(0.5, 3.0), 2)}
    elif law == "coulomb":
        friction = {"law": "coulomb", "coefficient": round(rng.uniform(0.1, 0.8), 2)}
    elif law == "jump":
        at, f, g = (
            round(touching * rng.uniform(0.2, 0.8), 3),
            round(rng.uniform(0.05, 0.3), 2),
            round(rng.uniform(0.4, 0.9), 2),
        )
        friction = {"law": "coulomb", "coefficient": f"where(x[0] < {at}, {f}, {g})"}
        points.append((at, 0.0))
    gap: Any = 0.0
    if corner:
        traits.append("corners")
    else:
        middle, sharp = round(touching * rng.uniform(0.35, 0.65), 2), round(rng.uniform(0.01, 0.04), 4)
        gap = f"{sharp}*(x[0] - {middle})**2"
    traits.append(str(law))
    contact = {"boundary": "bottom", "gap": gap, "direction": [0.0, -1.0]}
    if friction is not None:
        contact["friction"] = friction
    data: dict[str, Any] = {"material": material, "contact": contact, "title": f"random {number}"}
    load = rng.choice(["pressed", "jump", "displaced"])
    traits.append(str(load))
    if load == "displaced":
        down = round(pressed / young * height * rng.uniform(0.5, 1.5), 5)
        data["displacement"] = [{"boundary": "top", "x": round(down * rng.uniform(-0.5, 0.5), 5), "y": -down}]
    else:
        data["displacement"] = [{"boundary": "left", "x": 0.0}] if slant == 0 else []
        if slant != 0:
            data["displacement"] = [{"boundary": "top", "x": 0.0}]
        value: Any = round(-pressed * rng.uniform(0.5, 1.5), 2)
        top = cut[0] if cut is not None and cut[2] == "shelf" else length
        if load == "jump":
            a, b = sorted(round(top * v, 3) for v in rng.uniform(0.1, 0.9, 2))
            b = max(b, a + 0.1)
            value = f"where(x[0] > {a} and x[0] < {b}, {value}, {round(0.2 * value, 2)})"
            points += [(a, height), (b, height)]
        data["traction"] = [{"boundary": "top", "x": 0.0, "y": value}]
        if rng.integers(2):
            data["body_force"] = {"x": 0.0, "y": round(-pressed * rng.uniform(0, 0.5), 2)}
    plain = shape == "rectangle"
    mesh: Any = body.mesh()
    if plain:
        mesh = {
            "generator": "rectangle",
            "parameters": {"length": length, "height": height, "nx": cells[0], "ny": cells[1]},
        }
    scene = Scene.model_validate({"mesh": mesh, **data})
    return RandomScene(f"{number}", scene, body, tuple(points), tuple(traits))


def scenes(seed: int, count: int) -> list[RandomScene]:
    """So many random scenes that have a solution, and contact."""
    rng = np.random.default_rng(seed)
    found: list[RandomScene] = []
    while len(found) < count:
        one = draw(rng, len(found))
        try:
            solution = solve(on(one, 1.0, 2), MPI.COMM_SELF)
        except SignoriniError:
            continue
        if solution.table.columns["pressure"].max() > 0:
            found.append(one)
    return found


def on(one: RandomScene, factor: float, degree: int) -> Scene:
    """The scene on triangles so many times as large, hardly regularised.

    Augmentation would converge slowly on cells that are divided many times at a corner.
    """
    element = one.scene.element.model_copy(update={"degree": degree})
    gamma = HARD * one.scene.statement.young
    return one.scene.model_copy(
        update={
            "mesh": one.body.mesh(factor),
            "element": element,
            "solver": SolverSettings(gamma_n=gamma, gamma_t=gamma, linear_algebra="condensed", tolerance=1e-9),
            "accuracy": None,
        }
    )


def touching(mesh: Any, points: Any) -> Any:
    """Cells that hold one of the points."""
    x = mesh.geometry.x[compat.geometry_cells(mesh)][:, :, :2]
    a, b, c = x[:, 0], x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    area = b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0]
    found = np.zeros(len(x), dtype=bool)
    for point in points:
        d = np.asarray(point) - a
        s, t = (d[:, 0] * c[:, 1] - d[:, 1] * c[:, 0]) / area, (b[:, 0] * d[:, 1] - b[:, 1] * d[:, 0]) / area
        found |= (s >= -1e-6) & (t >= -1e-6) & (s + t <= 1 + 1e-6)
    return np.flatnonzero(found).astype(np.int32)


def reference(one: RandomScene, halvings: int = 30, unknowns: int = 60_000) -> tuple[Reference, dict[str, float]]:
    """A solution on strongly graded triangles of degree 2, and its distance to one with half of the unknowns.

    Args:
        one: the scene.
        halvings: of the cells at each point where the solution may be singular.
        unknowns: at least.
    """
    tagged = one.body.mesh()
    for _ in range(halvings):
        tagged = refine(tagged, touching(tagged.mesh, one.points))
    scene, found, history = on(one, 1.0, 2), [], History()
    while not found or found[-1].model.dofs < unknowns:
        solved = meshed_scene(scene.model_copy(update={"mesh": tagged}), MPI.COMM_SELF, history).solved(
            len(found), None, None
        )
        if solved.errors is None:
            raise ConvergenceError(solved.solution)
        found.append(solved.solution)
        squares = [solved.errors.squares[of] for of in ("energy", "pressure")]
        cells = [mark(MPI.COMM_SELF, own / own.sum(), 0.6) for own in squares]
        near = touching(tagged.mesh, one.points)
        tagged = refine(tagged, np.unique(np.concatenate((*cells, near))).astype(np.int32))
    fine = Reference(found[-1])
    dofs = found[-1].model.dofs
    coarse = min(found[:-1], key=lambda solution: abs(np.log(dofs / solution.model.dofs / 2)))
    own = fine.errors(coarse)
    return fine, {name: own[name] for name in QUANTITIES}
