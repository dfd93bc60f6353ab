"""Random scenes in 3D with fixed seeds: bodies, supports, loads, foundations, laws and settings
together.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.stability.oracle import elements
from benchmarks.stability.oracle.body import Mesh
from benchmarks.stability.oracle.elements import Array, Ints
from benchmarks.stability.oracle.scenes import (
    Dice,
    Trial,
    beside,
    drawn_friction,
    drawn_materials,
    drawn_solver,
    drawn_units,
)
from benchmarks.stability.oracle.units import Units

SIDES = ("left", "right", "front", "back", "bottom", "top")
# The walls of the unit cube by axis; contact is at the bottom, the foundation below.
_WALLS = (("left", "right"), ("front", "back"), ("bottom", "top"))
_LARGEST_QUADRATIC = 60  # cells


@dataclass(frozen=True)
class _Turn:
    """How a scene is turned in 3D."""

    matrix: Array

    def vector(self, x: float, y: float, z: float, scale: float = 1.0) -> list[float]:
        return [float(v) for v in scale * self.matrix @ np.array([x, y, z])]

    def along(self, axis: int) -> str:
        """A coordinate of the body before the turn."""
        column = self.matrix[:, axis]
        terms = [f"{float(c)!r}*x[{k}]" for k, c in enumerate(column) if c != 0]
        return f"({' + '.join(terms)})"


def trial(seed: int, units: Units | None = None) -> Trial:
    """The scene of a seed, in its own units or in given ones."""
    dice = Dice(seed, 3)
    turn = _Turn(_turned(dice))
    if dice.chance(0.1):
        turn = _Turn(np.eye(3))
        source, mesh, degree, names, flat = _generated(dice)
    else:
        mesh, flat = _own_mesh(dice, turn)
        source, names = {"file": "body.inp"}, {side: side for side in SIDES}
        degree = dice.one_of(1, 1, 2) if len(mesh.cells) <= _LARGEST_QUADRATIC else 1
    tetrahedra = (
        mesh.cells.shape[1] == 4
        if mesh is not None
        else source["parameters"]["cell"] == "tetrahedron"
    )
    scene: dict[str, Any] = {
        "title": f"seed {seed}, in 3D",
        "mesh": source,
        "element": {"degree": degree},
    }
    scene["material"] = drawn_materials(dice, mesh, {}, -0.3)
    if any(material["poisson"] >= 0.45 for material in scene["material"]) and dice.chance(0.7):
        scene["element"]["volumetric"] = "auto"
    steps = dice.one_of(1, 1, 1, 1, 1, 2, 3)
    size = dice.power(-5, -2)
    _hold_and_load(dice, turn, scene, names, steps, size, flat=flat, triangles=tetrahedra)
    scene["contact"] = _contacts(dice, turn, scene, names, size)
    solver = drawn_solver(dice, turn.along(0), levels=source.get("generator") == "box")
    if solver.get("algorithm") == "path-following" and steps > 1:
        del solver["algorithm"]
        solver.pop("regularisation_error", None)
    if solver:
        scene["solver"] = solver
    return Trial(seed, scene, mesh, units or drawn_units(seed, 3))


def _turned(dice: Dice) -> Array:
    """A rotation: none, one that exchanges axes, or any."""
    kind = dice.one_of("none", "none", "axes", "any", "any")
    if kind == "any":
        return np.asarray(Rotation.random(random_state=int(dice.whole(0, 2**31 - 1))).as_matrix())
    if kind == "none":
        return np.eye(3)
    order = dice.one_of(*permutations(range(3)))
    matrix = np.eye(3)[list(order)] * np.array([dice.one_of(-1.0, 1.0) for _ in range(3)])[:, None]
    return matrix if np.linalg.det(matrix) > 0 else -matrix


# ---- meshes


def grid(nx: int, ny: int, nz: int, cell: str) -> tuple[Array, Ints, dict[str, Ints]]:
    """A grid of the unit cube with the names of its sides; hexahedra, or each of them as six
    tetrahedra.
    """
    z, y, x = np.meshgrid(
        np.linspace(0, 1, nz + 1),
        np.linspace(0, 1, ny + 1),
        np.linspace(0, 1, nx + 1),
        indexing="ij",
    )
    points = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    number = np.arange(len(points)).reshape(nz + 1, ny + 1, nx + 1)
    corner = [(slice(None, -1), slice(1, None))[k] for k in (0, 1)]
    cells = np.stack(
        [
            number[corner[c], corner[b], corner[a]].ravel()
            for c in (0, 1)
            for b in (0, 1)
            for a in (0, 1)
        ],
        1,
    )
    if cell == "tetrahedron":
        paths = [(0, a, a + b, 7) for a, b in permutations((1, 2, 4), 2)]
        cells = np.concatenate([cells[:, list(path)] for path in paths])
    return points, cells, _named(points, cells)


def _named(points: Array, cells: Ints) -> dict[str, Ints]:
    """The facets on the walls of the unit cube."""
    faces = np.concatenate([cells[:, list(face)] for face in elements.FACES[3, cells.shape[1]]])
    found = {}
    for axis, pair in enumerate(_WALLS):
        for name, place in zip(pair, (0.0, 1.0), strict=True):
            found[name] = faces[(np.abs(points[faces][:, :, axis] - place) < 1e-9).all(axis=1)]
    return found


def _own_mesh(dice: Dice, turn: _Turn) -> tuple[Mesh, bool]:
    """A mesh of one body or of two pieces, and whether its sides are flat."""
    cell = dice.one_of("tetrahedron", "hexahedron")
    mesh, flat = _piece(dice, cell)
    if dice.chance(0.06):
        other, _ = _piece(dice, cell)
        mesh = beside(mesh, other)
        flat = False  # the sides of both are not in one plane
    regions = {}
    if dice.chance(0.2):
        centre = mesh.points[mesh.cells].mean(axis=1)
        soft = (
            centre[:, 2] < dice.between(0.2, 0.8)
            if dice.chance(0.5)
            else dice.random.random(len(centre)) < 0.5
        )
        if soft.any() and not soft.all():
            regions = {"soft": np.flatnonzero(soft), "hard": np.flatnonzero(~soft)}
    return Mesh(mesh.points @ turn.matrix.T, mesh.cells, mesh.boundaries, regions), flat


def _piece(dice: Dice, cell: str) -> tuple[Mesh, bool]:
    """A mapped grid, sometimes with nodes displaced at random, and whether its sides are flat."""
    nx, ny = dice.one_of(1, 2, 2, 3, 3, 4, 5, 6), dice.one_of(1, 2, 2, 3, 3, 4)
    nz = dice.one_of(1, 1, 2, 2, 3)
    points, cells, boundaries = grid(nx, ny, nz, cell)
    moved = points
    if dice.chance(0.4):
        inner = (points > 1e-9) & (points < 1 - 1e-9)
        step = 0.2 / np.array([nx, ny, nz])
        # Nodes on a side stay on it.
        moved = points + inner * step * dice.random.uniform(-1, 1, points.shape)
    mapped, flat = _mapped(dice, moved)
    mesh = Mesh(mapped, cells, boundaries)
    if not _sound(mesh):
        mesh, flat = (
            Mesh(points * np.array([2.0, 1.0, 0.8]) - [1.0, 0.5, 0.0], cells, boundaries),
            True,
        )
    return mesh, flat


def _mapped(dice: Dice, p: Array) -> tuple[Array, bool]:
    """The unit cube as box, wedge, leaning block, round block, bulge, twisted block or arch;
    whether sides are flat.
    """
    length, width, height = dice.between(0.7, 2.5), dice.between(0.5, 1.5), dice.between(0.4, 1.2)
    kind = dice.one_of("box", "box", "box", "wedge", "lean", "round", "bulge", "twist", "arch")
    slope, bend = dice.between(-0.3, 0.4), dice.between(0.3, 1.0)
    x, y, z = length * (p[:, 0] - 0.5), width * (p[:, 1] - 0.5), height * p[:, 2]
    if kind == "wedge":
        x, y = x * (1 + slope * p[:, 2]), y * (1 - 0.5 * slope * p[:, 2])
    elif kind == "lean":
        x, y = x + slope * z, y - 0.5 * slope * z
    elif kind == "round":
        a, b = 2 * p[:, 0] - 1, 2 * p[:, 1] - 1
        square, radius = np.maximum(np.abs(a), np.abs(b)), np.hypot(a, b)
        grown = (
            1
            - 0.6 * square
            + 0.6 * square * np.divide(square, radius, out=np.ones_like(a), where=radius > 0)
        )
        x, y = 0.5 * length * a * grown, 0.5 * length * b * grown
    elif kind == "bulge":
        z = z + 0.3 * slope * (1 - p[:, 2]) * ((2 * p[:, 0] - 1) ** 2 + (2 * p[:, 1] - 1) ** 2) / 2
    elif kind == "twist":
        angle = bend * p[:, 2]
        x, y = x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle)
    elif kind == "arch":
        angle, radius = 2 * bend * (p[:, 0] - 0.5), 1.0 - 0.6 * height * p[:, 2]
        x, z = radius * np.sin(angle), 1 - radius * np.cos(angle)
    return np.stack([x, y, z], axis=1), kind in ("box", "lean")


def _sound(mesh: Mesh) -> bool:
    """Whether all cells have a positive volume with room to spare, at their corners too."""
    xi = np.concatenate([elements.reference_nodes(3, mesh.cells.shape[1]), np.full((1, 3), 0.25)])
    _, slopes = elements.shape(3, mesh.cells.shape[1], xi)
    x = mesh.points[mesh.cells]
    volume = np.linalg.det(np.einsum("cki,pkj->cpij", x, slopes))
    volume = volume * np.sign(volume[:, -1:])
    longest = np.linalg.norm(x[:, :, None] - x[:, None], axis=3).max(axis=(1, 2))
    return bool((volume > 0.01 * longest[:, None] ** 3).all())


def _generated(dice: Dice) -> tuple[dict[str, Any], None, int, dict[str, str], bool]:
    """A mesh of a generator of the package, with the names that its sides go by."""
    kind, cell = dice.one_of("box", "cylinder", "ring"), dice.one_of("tetrahedron", "hexahedron")
    degree = dice.one_of(1, 2)
    parameters: dict[str, Any] = {"cell": cell}
    names = {side: side for side in SIDES}
    if kind == "box":
        parameters |= {"length": 1.5, "width": 1.0, "height": 1.0, "nx": 3, "ny": 2, "nz": 2}
    else:
        counts = {"nr": 1, "nt": 2} if kind == "cylinder" else {"nr": 1, "nt": 3}
        parameters |= {"radius": 1.0, "height": 0.7, "nz": dice.one_of(1, 2), **counts}
        around = {"left": "side"} if kind == "cylinder" else {"left": "outer", "right": "inner"}
        names = {
            "left": "top",
            "right": "top",
            "front": "top",
            "back": "top",
            "bottom": "bottom",
            "top": "top",
        } | around
        if kind == "ring":
            parameters["inner_radius"] = 0.5
        # Curved tetrahedra depend on a quadrature rule of their own, curved hexahedra on Gauss's.
        if cell == "hexahedron" and degree == 2 and dice.chance(0.6):
            parameters["order"] = 2
    return {"generator": kind, "parameters": parameters}, None, degree, names, kind == "box"


# ---- effects


def _hold_and_load(
    dice: Dice,
    turn: _Turn,
    scene: dict[str, Any],
    names: dict[str, str],
    steps: int,
    size: float,
    *,
    flat: bool,
    triangles: bool,
) -> None:
    """Supports, tractions and a body force; with several steps some of them follow factors."""

    def factors() -> list[float]:
        if dice.chance(0.5):
            return [round((n + 1) / steps, 3) for n in range(steps)]
        return [round(dice.between(-1, 1), 3) for _ in range(steps)]

    def stepped(load: dict[str, Any], probability: float) -> dict[str, Any]:
        return load | {"factors": factors()} if steps > 1 and dice.chance(probability) else load

    def vector(x: float, y: float, z: float, scale: float) -> dict[str, float]:
        return dict(zip("xyz", turn.vector(x, y, z, scale), strict=True))

    held = dict.fromkeys("xyz", 0.0)
    some = dict.fromkeys(dice.one_of("x", "y", "z", "xy", "yz", "xz"), 0.0)
    wall = dice.one_of("left", "front", "back")
    kinds = ["clamp", "clamp", "clamp", "top", "top", "some", "ends", "none", "none", "none"]
    if flat:
        kinds += ["walls", "walls", "slide", "lid"]
    kind = dice.one_of(*kinds)
    supports: list[dict[str, Any]] = []
    if kind == "clamp":
        supports = [{"boundary": names[wall], **held}]
    elif kind == "top":
        move = vector(dice.between(-1, 1), dice.between(-1, 1), -dice.between(0.2, 2), size)
        supports = [stepped({"boundary": names["top"], **move}, 0.8)]
    elif kind == "some":
        supports = [{"boundary": names[wall], **some}]
    elif kind == "ends":
        supports = [{"boundary": names[side], **some} for side in ("left", "right")]
    elif kind == "walls":
        supports = [{"boundary": names[side], "normal": 0.0} for side in ("left", "front")]
    elif kind == "slide":
        supports = [
            {"boundary": names["left"], "normal": 0.0},
            stepped({"boundary": names["back"], "normal": dice.between(-1, 1) * size}, 0.7),
        ]
    elif kind == "lid":
        value: Any = -dice.between(0.2, 2) * size
        if dice.chance(0.4):
            value = f"{value!r}*(1 + 0.3*{turn.along(0)})"
        supports = [stepped({"boundary": names["top"], "normal": value}, 0.7)]
        if dice.chance(0.5):
            supports.append(
                {"boundary": names["left"], **(held if dice.chance(0.3) else {"normal": 0.0})}
            )
    tractions: list[dict[str, Any]] = []
    if kind not in ("top", "lid") or dice.chance(0.3):
        side = names["right" if kind in ("top", "lid") else "top"]
        style = dice.one_of(
            "press", "press", "slant", "slant", "pressure", "linear", "part", "tip", "lift"
        )
        if style == "press":
            tractions.append({"boundary": side, **vector(0.0, 0.0, -1.0, size)})
        elif style == "slant":
            tractions.append(
                {"boundary": side, **vector(dice.between(-1, 1), dice.between(-1, 1), -1.0, size)}
            )
        elif style == "pressure":
            tractions.append({"boundary": side, "pressure": size})
        elif style == "linear":
            tractions.append({"boundary": side, "pressure": f"{size!r}*(1 + 0.4*{turn.along(0)})"})
        elif style == "tip":
            tractions.append(
                {
                    "boundary": side,
                    "pressure": f"{size!r}*(1 + {dice.between(1, 6)!r}*{turn.along(1)})",
                }
            )
        elif style == "lift":
            tractions.append(
                {
                    "boundary": side,
                    **vector(dice.between(-0.3, 0.3), 0.0, dice.between(-0.2, 1.0), size),
                }
            )
        elif triangles:  # on which a jump would depend on the rule
            tractions.append({"boundary": side, "pressure": f"{size!r}*(1 + {turn.along(0)}**2)"})
        else:
            cut = dice.between(-0.5, 0.5)
            tractions.append(
                {
                    "boundary": side,
                    "pressure": f"{size!r} if {turn.along(0)} < {cut!r} else {0.2 * size!r}",
                }
            )
        if steps > 1:
            tractions[0] = stepped(tractions[0], 0.3)
        if dice.chance(0.4):
            push = vector(
                dice.between(-1, 1), dice.between(-1, 1), dice.between(-0.4, 0.2), 0.6 * size
            )
            tractions.append(
                stepped(
                    {"boundary": names[dice.one_of("left", "right", "front", "top")], **push}, 0.7
                )
            )
    if dice.chance(0.3):
        force = vector(dice.between(-0.3, 0.3), dice.between(-0.3, 0.3), -1.0, size)
        scene["body_force"] = stepped(force, 0.3)
    if steps > 1 and not any(
        "factors" in effect for effect in [*supports, *tractions, scene.get("body_force", {})]
    ):
        last = (tractions or supports or [scene.get("body_force", {})])[-1]
        if last:
            last["factors"] = factors()
    if supports:
        scene["displacement"] = supports
    if tractions:
        scene["traction"] = tractions


def _contacts(
    dice: Dice, turn: _Turn, scene: dict[str, Any], names: dict[str, str], size: float
) -> list[dict[str, Any]]:
    first, second = turn.along(0), turn.along(1)

    def gap() -> Any:
        a, b = dice.between(-0.5, 0.5), dice.between(-0.5, 0.5)
        return dice.one_of(
            0.0,
            0.0,
            size * dice.between(-0.5, 1.0),
            f"{size * dice.power(-1, 1)!r}*(({first} - {a!r})**2 + ({second} - {b!r})**2)",
            f"{size * dice.power(-1, 0.5)!r}*abs(sin({dice.between(1, 9)!r}*{second}))",
            f"{size!r} if {first} < {a!r} else 0.0",
            f"{size * dice.between(-1, 1)!r}*{first} + {size * dice.between(-1, 1)!r}*{second}",
        )

    def contact(boundary: str) -> dict[str, Any]:
        found = {
            "boundary": boundary,
            "gap": gap(),
            "friction": drawn_friction(dice, size, first, second),
        }
        if dice.chance(0.08):
            found["kind"] = "bilateral"
        if boundary == names["bottom"] and dice.chance(0.2):
            found["direction"] = turn.vector(dice.between(-0.3, 0.3), dice.between(-0.3, 0.3), -1.0)
        return found

    found = [contact(names["bottom"])]
    taken = {effect["boundary"] for effect in scene.get("displacement", [])} | {names["bottom"]}
    for side in ("right", "left", "front", "back"):
        if names[side] not in taken and dice.chance(0.12):
            found.append(contact(names[side]))
            taken.add(names[side])
    return found
