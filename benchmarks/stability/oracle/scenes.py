"""Random scenes with fixed seeds: bodies, meshes, materials, supports, loads, foundations, laws and
settings together.

They are drawn for a body of about size 1 with E = 1, and written in units of their own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from scipy.spatial import Delaunay, QhullError

from benchmarks.stability.oracle.body import Mesh
from benchmarks.stability.oracle.elements import Array, Ints
from benchmarks.stability.oracle.units import AS_DRAWN, Units

SIDES = ("left", "right", "bottom", "top")


@dataclass(frozen=True)
class Trial:
    """A scene to be solved."""

    seed: int  # its number
    scene: dict[str, Any]  # what its TOML file says, in units of the body
    mesh: Mesh | None  # its mesh; None where a generator of the package makes it
    units: Units = AS_DRAWN  # what the scene file is written in

    def write(self, folder: Path) -> Path:
        """Scene file, and mesh file beside it, in their units; the path of the scene."""
        folder.mkdir(parents=True, exist_ok=True)
        if self.mesh is not None:
            write_abaqus(folder / "body.inp", self.mesh, self.units.length)
        path = folder / "scene.toml"
        path.write_text(tomli_w.dumps(self.units.scene(self.scene)), encoding="utf-8")
        return path


# Abaqus's type and order of the corners of cells and facets, by dimension and number of corners.
_ABAQUS = {
    (2, 2): ("T2D2", [0, 1]),
    (2, 3): ("CPE3", [0, 1, 2]),
    (2, 4): ("CPE4", [0, 1, 3, 2]),
    (3, 3): ("S3", [0, 1, 2]),
    (3, 4): ("S4", [0, 1, 3, 2]),
    (3, 8): ("C3D8", [0, 1, 3, 2, 4, 5, 7, 6]),
}


def write_abaqus(file: Path, mesh: Mesh, length: float = 1.0) -> None:
    """The mesh, straight cells, as an Abaqus input file: boundaries are sets of lines or shells,
    regions of cells.
    """
    dimension = mesh.points.shape[1]
    lines = ["*NODE"]
    lines += [
        f"{n}, {', '.join(map(repr, x))}" for n, x in enumerate((length * mesh.points).tolist(), 1)
    ]
    number = 0
    for name, rows in (("", mesh.cells), *mesh.boundaries.items()):
        tetrahedra = not name and (dimension, rows.shape[1]) == (3, 4)
        kind, around = ("C3D4", [0, 1, 2, 3]) if tetrahedra else _ABAQUS[dimension, rows.shape[1]]
        lines.append(f"*ELEMENT, TYPE={kind}" + (f", ELSET={name}" if name else ""))
        for row in (rows[:, around] + 1).tolist():
            number += 1
            lines.append(", ".join(map(str, [number, *row])))
    for name, cells in mesh.regions.items():
        lines.append(f"*ELSET, ELSET={name}")
        lines += [str(cell + 1) for cell in cells.tolist()]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


class Dice:
    """Random choices of one seed."""

    def __init__(self, seed: int, *stream: int) -> None:
        self.random = np.random.default_rng([20050831, seed, *stream])

    def chance(self, probability: float) -> bool:
        """Whether something happens."""
        return bool(self.random.random() < probability)

    def one_of(self, *choices: Any) -> Any:
        """One of the choices, all of them equally often."""
        return choices[int(self.random.integers(len(choices)))]

    def between(self, low: float, high: float) -> float:
        """A number between the two."""
        return float(self.random.uniform(low, high))

    def power(self, low: float, high: float) -> float:
        """Ten to something between the two."""
        return float(10 ** self.random.uniform(low, high))

    def whole(self, low: int, high: int) -> int:
        """A whole number from the one to the other."""
        return int(self.random.integers(low, high + 1))


def drawn_units(seed: int, dimension: int) -> Units:
    """The units of a seed: lengths and forces from 1e-9 to 1e9, each for itself."""
    dice = Dice(seed, dimension, 1)
    return Units(dice.power(-9, 9), dice.power(-9, 9), dimension)


def trial(seed: int, units: Units | None = None) -> Trial:
    """The scene of a seed in 2D, in its own units or in given ones."""
    dice = Dice(seed)
    angle = dice.one_of(0.0, 0.0, 0.0, np.pi / 2, np.pi, dice.between(0, 2 * np.pi))
    if dice.chance(0.4):  # not used: seeds keep their scenes, whose units were once drawn here
        dice.random.random(2)
    turn = _Turn(angle)
    generated = _generated(dice) if dice.chance(0.12) else None
    if generated is not None:
        turn = _Turn(0.0)
        source, mesh, degree, names = generated
    else:
        mesh = _own_mesh(dice, turn)
        source, names = {"file": "body.inp"}, {side: side for side in SIDES}
        degree = dice.one_of(1, 1, 2)
        if len(mesh.cells) > 400:
            degree = 1
    scene: dict[str, Any] = {"title": f"seed {seed}", "mesh": source, "element": {"degree": degree}}
    hypothesis = dice.one_of("plane strain", "plane strain", "plane strain", "plane stress")
    scene["material"] = drawn_materials(dice, mesh, {"hypothesis": hypothesis}, 0.4999, -0.3)
    if any(material["poisson"] >= 0.45 for material in scene["material"]) and dice.chance(0.7):
        scene["element"]["volumetric"] = "auto"
    elif degree == 2 and dice.chance(0.1):
        scene["element"]["volumetric"] = "reduced"
    steps = dice.one_of(1, 1, 1, 1, 2, 3, 4)
    _hold_and_load(dice, turn, scene, names, steps)
    scene["contact"] = _contacts(dice, turn, scene, names, mesh)
    solver = drawn_solver(dice, turn.along, levels="generator" in source)
    if solver:
        scene["solver"] = solver
    return Trial(seed, scene, mesh, units or drawn_units(seed, 2))


@dataclass(frozen=True)
class _Turn:
    """By what angle a scene is turned."""

    angle: float

    def turn(self, x: float, y: float) -> tuple[float, float]:
        c, s = np.cos(self.angle), np.sin(self.angle)
        return float(c * x - s * y), float(s * x + c * y)

    def place(self, points: Array) -> Array:
        c, s = np.cos(self.angle), np.sin(self.angle)
        return points @ np.array([[c, s], [-s, c]])

    @property
    def along(self) -> str:
        """The coordinate that runs along the foundation, before the turn."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return f"({float(c)!r}*x[0] + {float(s)!r}*x[1])"

    @property
    def straight(self) -> bool:
        """Whether the sides of an unturned rectangle are along the axes."""
        return abs(np.sin(2 * self.angle)) < 1e-12


# ---- meshes


def grid(
    nx: int, ny: int, cell: str, dice: Dice | None = None
) -> tuple[Array, Ints, dict[str, Ints]]:
    """A grid of the unit square with the names of its sides."""
    x, y = np.meshgrid(np.linspace(0, 1, nx + 1), np.linspace(0, 1, ny + 1))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    number = np.arange(len(points)).reshape(ny + 1, nx + 1)
    a, b, c, d = (
        n.ravel() for n in (number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:])
    )
    cells = np.stack([a, b, c, d], axis=1)
    if cell == "triangle":
        flip = (
            np.zeros(len(cells), dtype=bool)
            if dice is None
            else dice.random.random(len(cells)) < 0.5
        )
        one = np.where(flip[:, None], cells[:, [0, 1, 2]], cells[:, [0, 1, 3]])
        two = np.where(flip[:, None], cells[:, [1, 3, 2]], cells[:, [0, 3, 2]])
        cells = np.concatenate([one, two])
    lines = {"left": number[:, 0], "right": number[:, -1], "bottom": number[0], "top": number[-1]}
    return points, cells, {name: np.stack([n[:-1], n[1:]], axis=1) for name, n in lines.items()}


def _shape(dice: Dice) -> Callable[[Array], Array]:
    """A map of the unit square: rectangle, wedge, leaning block, arch, bulge."""
    width, height = dice.between(0.7, 3.0), dice.between(0.4, 1.2)
    kind = dice.one_of("rectangle", "rectangle", "wedge", "lean", "arch", "bulge", "wave")
    slope, bend = dice.between(-0.3, 0.4), dice.between(0.3, 1.2)

    def place(p: Array) -> Array:
        x, y = width * (p[:, 0] - 0.5), height * p[:, 1]
        if kind == "wedge":
            x = x * (1 + slope * p[:, 1])
        elif kind == "lean":
            x = x + slope * y
        elif kind == "arch":
            angle, radius = 2 * bend * (p[:, 0] - 0.5), 1.0 - 0.6 * height * p[:, 1]
            x, y = radius * np.sin(angle), 1 - radius * np.cos(angle)
        elif kind == "bulge":
            y = y + slope * 0.3 * (1 - p[:, 1]) * (2 * p[:, 0] - 1) ** 2
        elif kind == "wave":
            y = y + 0.03 * (1 - p[:, 1]) * np.cos(7 * p[:, 0])
        return np.stack([x, y], axis=1)

    return place


def _own_mesh(dice: Dice, turn: _Turn) -> Mesh:
    """A mesh of one body or of several pieces."""
    if dice.chance(0.2):
        mesh = _polygon(dice)
    else:
        mesh = _piece(
            dice,
            dice.one_of(2, 3, 5, 8, 8, 12, 12, 16, 16, 24, 24, 40, 70),
            dice.one_of("triangle", "quadrilateral"),
        )
    if dice.chance(0.06):
        cell = "triangle" if mesh.cells.shape[1] == 3 else "quadrilateral"
        mesh = beside(mesh, _piece(dice, dice.one_of(3, 6, 9), cell))
    points = mesh.points
    if dice.chance(0.2):
        low, high = points.min(axis=0), points.max(axis=0)
        centre = points[mesh.cells].mean(axis=1)
        soft = (
            centre[:, 1] < dice.between(low[1], high[1])
            if dice.chance(0.5)
            else dice.random.random(len(centre)) < 0.5
        )
        if soft.any() and not soft.all():
            mesh = Mesh(
                points,
                mesh.cells,
                mesh.boundaries,
                {"soft": np.flatnonzero(soft), "hard": np.flatnonzero(~soft)},
            )
    return Mesh(turn.place(points), mesh.cells, mesh.boundaries, mesh.regions)


def _piece(dice: Dice, nx: int, cell: str) -> Mesh:
    """A mapped grid, sometimes with inner nodes displaced at random."""
    ny = max(1, min(12, dice.one_of(1, nx // 3, nx // 2, nx)))
    points, cells, boundaries = grid(nx, ny, cell, dice)
    if dice.chance(0.4):
        inner = (points > 1e-9).all(axis=1) & (points < 1 - 1e-9).all(axis=1)
        step = np.array([0.25 / nx, 0.25 / ny])
        points = points + inner[:, None] * step * dice.random.uniform(-1, 1, points.shape)
        # Along the bottom too, so that contact nodes stand for different lengths.
        foot = (points[:, 1] < 1e-9) & (points[:, 0] > 1e-9) & (points[:, 0] < 1 - 1e-9)
        points[foot, 0] += 0.3 / nx * dice.random.uniform(-1, 1, int(foot.sum()))
    shape = _shape(dice)
    if _folded(shape(points)[cells]):
        points, *_ = grid(nx, ny, cell)
    return Mesh(shape(points), cells, boundaries)


def _folded(corners: Array) -> bool:
    """Whether a cell with these corners, shape (cells, 3 or 4, 2), is not convex."""
    around = [0, 1, 3, 2] if corners.shape[1] == 4 else [0, 1, 2]
    edges = np.roll(corners[:, around], -1, axis=1) - corners[:, around]
    following = np.roll(edges, -1, axis=1)
    turns = edges[..., 0] * following[..., 1] - edges[..., 1] * following[..., 0]
    return bool((turns.min(axis=1) * turns.max(axis=1) <= 0).any())


def beside(mesh: Mesh, other: Mesh) -> Mesh:
    """Both in one mesh, the second to the right of the first, sharing names but no node."""
    shift = np.zeros(mesh.points.shape[1])
    shift[0] = mesh.points[:, 0].max() - other.points[:, 0].min() + 0.2
    count = len(mesh.points)
    boundaries = {
        name: np.concatenate([own, other.boundaries[name] + count])
        for name, own in mesh.boundaries.items()
    }
    return Mesh(
        np.concatenate([mesh.points, other.points + shift]),
        np.concatenate([mesh.cells, other.cells + count]),
        boundaries,
    )


def _polygon(dice: Dice) -> Mesh:
    """A random polygon that is seen whole from its middle, triangulated, its outline named by
    direction.
    """
    while True:
        corners = dice.whole(5, 9)
        angles = np.sort(dice.random.uniform(0, 2 * np.pi, corners))
        if np.diff(np.append(angles, angles[0] + 2 * np.pi)).max() > 2.0:
            continue
        outline = (
            np.stack([np.cos(angles), np.sin(angles)], axis=1)
            * dice.random.uniform(0.55, 1.0, corners)[:, None]
        )
        per_side = dice.one_of(1, 2, 4, 7)
        along = np.arange(per_side) / per_side
        following = np.roll(outline, -1, axis=0)
        rim = (
            outline[:, None] * (1 - along[:, None]) + following[:, None] * along[:, None]
        ).reshape(-1, 2)
        size = 0.9 / per_side
        inner = [
            dice.between(0.0, 1 - 0.45 * size) * rim[dice.whole(0, len(rim) - 1)]
            for _ in range(dice.whole(3, 60))
        ]
        points = list(rim)
        for p in inner:
            if min(np.linalg.norm(p - q) for q in points) > 0.3 * size:
                points.append(p)
        table = np.array(points)
        try:
            cells = Delaunay(table).simplices.astype(np.int64)
        except QhullError:
            continue
        ends = np.stack([np.arange(len(rim)), np.roll(np.arange(len(rim)), -1)], axis=1)
        if (mesh := _inside(table, cells, ends)) is not None:
            return mesh


def _inside(points: Array, cells: Ints, rim: Ints) -> Mesh | None:
    """The cells inside the outline, if they are sound and their outline is the one that was
    drawn.
    """
    centre = points[cells].mean(axis=1)
    a, b = points[rim[:, 0]], points[rim[:, 1]]
    crossings = np.zeros(len(centre), dtype=int)
    for (x0, y0), (x1, y1) in zip(a, b, strict=True):
        between = (y0 > centre[:, 1]) != (y1 > centre[:, 1])
        with np.errstate(divide="ignore", invalid="ignore"):
            crossings += between & (centre[:, 0] < (x1 - x0) * (centre[:, 1] - y0) / (y1 - y0) + x0)
    cells = cells[crossings % 2 == 1]
    if not len(cells) or len(np.unique(cells)) != len(points):
        return None
    edge1, edge2 = (
        points[cells[:, 1]] - points[cells[:, 0]],
        points[cells[:, 2]] - points[cells[:, 0]],
    )
    area = np.abs(edge1[:, 0] * edge2[:, 1] - edge1[:, 1] * edge2[:, 0]) / 2
    longest = np.linalg.norm(points[cells] - np.roll(points[cells], 1, axis=1), axis=2).max(axis=1)
    if (area < 0.02 * longest**2).any():
        return None
    pairs = np.sort(np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [0, 2]]]), axis=1)
    unique, counts = np.unique(pairs, axis=0, return_counts=True)
    if {tuple(p) for p in unique[counts == 1]} != {tuple(sorted(p)) for p in rim.tolist()}:
        return None
    middle = (a + b) / 2
    direction = np.degrees(np.arctan2(middle[:, 1], middle[:, 0]))
    names = np.select(
        [np.abs(direction) < 45, np.abs(direction) > 135, direction < 0],
        ["right", "left", "bottom"],
        "top",
    )
    boundaries = {name: rim[names == name] for name in SIDES}
    return Mesh(points, cells, boundaries) if all(len(f) for f in boundaries.values()) else None


def _generated(dice: Dice) -> tuple[dict[str, Any], None, int, dict[str, str]]:
    """A mesh of a generator of the package, with the names that its sides go by."""
    order = dice.one_of(1, 2)
    kind = dice.one_of("rectangle", "wedge", "ring_segment", "half_disk", "block", "punch")
    cell = dice.one_of("triangle", "quadrilateral")
    parameters: dict[str, Any] = {"cell": cell}
    names = {side: side for side in SIDES}
    if kind in ("rectangle", "block"):
        nx = dice.one_of(4, 8, 12)
        parameters |= {"length": 2.0, "height": 1.0, "nx": nx, "ny": nx // 2}
        order = 1
        if kind == "block":
            parameters["layout"] = dice.one_of("structured", "graded", "unstructured")
    elif kind == "wedge":
        parameters |= {"tip": 0.5, "height": 1.0, "angle": dice.between(5, 30), "nx": 6, "ny": 8}
        names["bottom"] = dice.one_of("tip", "left")
        if names["bottom"] == "left":
            names["left"] = "right"
        order = 1
    else:
        parameters |= {"size": 0.3, "contact_size": dice.one_of(0.05, 0.1), "contact_zone": 0.2}
        if kind == "ring_segment":
            parameters |= {"radius": 1.0, "thickness": 0.4, "angle": 60.0}
            names |= {"bottom": "outer", "top": "inner"}
        elif kind == "half_disk":
            parameters |= {"radius": 1.0}
            names = {"bottom": "arc", "top": "top", "left": "top", "right": "top"}
        else:
            parameters |= {"width": 2.0, "height": 1.0, "rounding": 0.25}
            names |= {"bottom": "foot"}
        parameters["order"] = order
    degree = 2 if order == 2 else dice.one_of(1, 2)
    return {"generator": kind, "parameters": parameters}, None, degree, names


# ---- effects


def drawn_materials(
    dice: Dice, mesh: Mesh | None, more: dict[str, Any], *poisson: float
) -> list[dict[str, Any]]:
    """One of E = 1, or two of which one is softer; ``more``: what all have."""

    def one(young: float) -> dict[str, Any]:
        found = dice.one_of(0.0, 0.2, 0.3, 0.3, 0.4, 0.45, 0.49, 0.499, *poisson)
        return {"young": young, "poisson": found} | more

    if mesh is not None and mesh.regions:
        return [one(1.0) | {"region": "hard"}, one(dice.power(-2, 0)) | {"region": "soft"}]
    return [one(1.0)]


def _hold_and_load(
    dice: Dice, turn: _Turn, scene: dict[str, Any], names: dict[str, str], steps: int
) -> None:
    """Supports, tractions and a body force; with several steps some of them follow factors."""

    def factors() -> list[float]:
        kind = dice.one_of("ramp", "push", "random")
        if kind == "ramp":
            return [round((n + 1) / steps, 3) for n in range(steps)]
        if kind == "push":
            return [
                0.0,
                *dice.one_of([1.0, 0.5, -0.5], [0.5, 1.0, 0.0], [-1.0, 1.0, -1.0])[: steps - 1],
            ]
        return [round(dice.between(-1, 1), 3) for _ in range(steps)]

    def stepped(load: dict[str, Any], probability: float) -> dict[str, Any]:
        return load | {"factors": factors()} if steps > 1 and dice.chance(probability) else load

    def vector(x: float, y: float, scale: float) -> dict[str, float]:
        a, b = turn.turn(x, y)
        return {"x": a * scale, "y": b * scale}

    size = dice.power(-5, -2)
    kind = dice.one_of(
        "sides", "left", "left", "top", "top", "rail", "none", "left and right", "normal"
    )
    supports: list[dict[str, Any]] = []
    across, along = ("x", "y") if abs(np.cos(turn.angle)) > 0.5 else ("y", "x")
    if kind == "sides":
        supports = [{"boundary": names[side], across: 0.0} for side in ("left", "right")]
    elif kind == "left":
        supports = [{"boundary": names["left"], "x": 0.0, "y": 0.0}]
    elif kind == "top":
        drop = stepped(
            {"boundary": names["top"], **vector(dice.between(-1, 1), -dice.between(0.2, 2), size)},
            0.8,
        )
        supports = [drop]
    elif kind == "rail":
        supports = [{"boundary": names["left"], across: 0.0}]
    elif kind == "left and right":
        value = f"{size!r}*{turn.along}" if dice.chance(0.5) else dice.between(-1, 1) * size
        supports = [
            {"boundary": names["left"], across: 0.0},
            stepped({"boundary": names["right"], along: value}, 0.7),
        ]
    elif kind == "normal":
        straight = scene["mesh"].get("generator") in ("rectangle", "block")
        supports = [
            {"boundary": names["left"], **({"normal": 0.0} if straight else {"x": 0.0, "y": 0.0})}
        ]
    tractions: list[dict[str, Any]] = []
    if kind != "top" or dice.chance(0.3):
        side = names["right" if kind == "top" else "top"]
        style = dice.one_of("press", "press", "slant", "slant", "pressure", "linear", "part")
        if style == "press":
            tractions.append({"boundary": side, **vector(0.0, -1.0, size)})
        elif style == "slant":
            tractions.append({"boundary": side, **vector(dice.between(-1, 1), -1.0, size)})
        elif style == "pressure":
            tractions.append({"boundary": side, "pressure": size})
        elif style == "linear":
            tractions.append({"boundary": side, "pressure": f"{size!r}*(1 + 0.4*{turn.along})"})
        else:
            cut = dice.between(-0.5, 0.5)
            tractions.append(
                {
                    "boundary": side,
                    "pressure": f"{size!r} if {turn.along} < {cut!r} else {0.2 * size!r}",
                }
            )
        if steps > 1:
            tractions[0] = stepped(tractions[0], 0.3)
        if dice.chance(0.4):
            push = vector(dice.between(-1, 1), dice.between(-0.4, 0.2), 0.6 * size)
            tractions.append(
                stepped({"boundary": names[dice.one_of("left", "right", "top")], **push}, 0.7)
            )
    if dice.chance(0.25):
        scene["body_force"] = stepped(vector(dice.between(-0.3, 0.3), -1.0, size), 0.3)
    if steps > 1 and not any(
        "factors" in effect for effect in [*supports, *tractions, scene.get("body_force", {})]
    ):
        if tractions:
            tractions[-1]["factors"] = factors()
        elif supports:
            supports[-1]["factors"] = factors()
    if supports:
        scene["displacement"] = supports
    if tractions:
        scene["traction"] = tractions
    scene["_size"] = size


def drawn_friction(dice: Dice, size: float, first: str, second: str) -> dict[str, Any]:
    """A law of friction whose values may vary along one of two directions, as expressions of the
    position.
    """
    kind = dice.one_of(
        "none", "tresca", "tresca", "tresca", "coulomb", "coulomb", "coulomb", "coulomb"
    )
    if kind == "none":
        return {"law": "none"}
    if kind == "tresca":
        bound = size * dice.power(-2, 1)
        if dice.chance(0.3):
            return {"law": "tresca", "bound": f"{bound!r}*abs(sin({dice.between(1, 9)!r}*{first}))"}
        return {"law": "tresca", "bound": bound}
    coefficient: Any = dice.one_of(dice.power(-2, 0), dice.power(-0.7, 0.3))
    if dice.chance(0.25):
        coefficient = (
            f"{coefficient!r} if {second} < {dice.between(-0.5, 0.5)!r} else {dice.power(-2, 0)!r}"
        )
    law = {"law": "coulomb", "coefficient": coefficient}
    if dice.chance(0.15):
        law["cap"] = size * dice.power(-1, 1)
    return law


def _limits(dice: Dice, algorithm: str, gamma: float) -> dict[str, Any]:
    """Settings of an algorithm that say when it ends; ``gamma``: the largest one."""
    found: dict[str, Any] = {}
    if algorithm == "path-following" and dice.chance(0.4):
        found["regularisation_error"] = dice.power(-6, -1)
    if algorithm == "continuation" and dice.chance(0.3):
        found["gamma_first"] = gamma * dice.power(-5, -1)
    if dice.chance(0.08):
        found["tolerance"] = dice.power(-10, -7)
    if dice.chance(0.05):
        found["fallbacks"] = False
    return found


def _contacts(
    dice: Dice, turn: _Turn, scene: dict[str, Any], names: dict[str, str], mesh: Mesh | None
) -> list[dict[str, Any]]:
    size = scene.pop("_size")

    def gap() -> Any:
        return dice.one_of(
            0.0,
            0.0,
            size * dice.between(-0.5, 1.0),
            f"{size * dice.power(-1, 1)!r}*({turn.along} - {dice.between(-0.5, 0.5)!r})**2",
            f"{size * dice.power(-1, 0.5)!r}*abs(sin({dice.between(1, 9)!r}*{turn.along}))",
            f"{size!r} if {turn.along} < {dice.between(-0.5, 0.5)!r} else 0.0",
            f"{size * dice.between(-1, 1)!r}*{turn.along}",
        )

    def contact(boundary: str) -> dict[str, Any]:
        found = {
            "boundary": boundary,
            "gap": gap(),
            "friction": drawn_friction(dice, size, turn.along, turn.along),
        }
        if dice.chance(0.08):
            found["kind"] = "bilateral"
        if boundary == names["bottom"] and dice.chance(0.2):
            found["direction"] = list(turn.turn(dice.between(-0.4, 0.4), -1.0))
        return found

    found = [contact(names["bottom"])]
    taken = {effect["boundary"] for effect in scene.get("displacement", [])}
    for side in ("right", "left"):
        if names[side] not in taken | {effect["boundary"] for effect in found} and dice.chance(
            0.12
        ):
            found.append(contact(names[side]))
    return found


def drawn_solver(dice: Dice, along: str, *, levels: bool) -> dict[str, Any]:
    """Settings of the solver; ``along``: a coordinate along the foundation; ``levels``: on coarser
    meshes, too.
    """
    natural = 1e5
    found: dict[str, Any] = {}
    algorithm = dice.one_of(
        "auto", "auto", "auto", "ssn", "continuation", "path-following", "alm", "alm", "alm", "alm"
    )
    if algorithm != "auto":
        found["algorithm"] = algorithm
    if dice.chance(0.5):
        found["coulomb"] = dice.one_of("fp", "newton")
    if dice.chance(0.35):
        found["gamma_n"] = natural * dice.power(-3, 5 if algorithm == "alm" else 3)
    if dice.chance(0.35):
        found["gamma_t"] = natural * dice.power(-3, 5 if algorithm == "alm" else 3)
    if dice.chance(0.1):
        found["sigma"] = dice.power(-4, 4) / natural
    if dice.chance(0.2):
        found["linear_algebra"] = dice.one_of("full", "condensed", "condensed", "krylov")
    if dice.chance(0.08):
        found["initial_contact"] = f"{along} < {dice.between(-0.3, 0.5)!r}"
    if levels and dice.chance(0.2):
        found["levels"] = 2
    if algorithm == "alm" and dice.chance(0.2):
        found["gamma_factor"] = dice.between(1.0, 4.0)
    if algorithm == "alm" and dice.chance(0.15):
        found["inner_iterations"] = dice.whole(1, 3)
    return found | _limits(dice, algorithm, found.get("gamma_n", natural))
