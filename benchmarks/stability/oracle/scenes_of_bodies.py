"""Random scenes of two and three bodies whose meshes do not match, with fixed seeds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.stability.oracle import scenes as plane
from benchmarks.stability.oracle import scenes_in_space as space
from benchmarks.stability.oracle.body import Mesh
from benchmarks.stability.oracle.elements import Array
from benchmarks.stability.oracle.scenes import Dice, Trial, drawn_units
from benchmarks.stability.oracle.units import Units

# Cells of a mesh that may have elements of degree 2, by the dimension.
_QUADRATIC = {2: 150, 3: 40}
# Counts of cells of a body along its contact and through it, by the dimension.
_ALONG, _THROUGH = (
    {2: (1, 2, 3, 4, 5, 6, 8, 10), 3: (1, 2, 2, 3, 3, 4)},
    {2: (1, 2, 3), 3: (1, 1, 2)},
)


@dataclass(frozen=True)
class _Frame:
    """Of a scene: the contact is across the last axis before the turn."""

    matrix: Array
    size: float

    def vector(self, across: float, *along: float) -> dict[str, float]:
        """A vector of the scene's size by its components."""
        values = self.size * self.matrix @ np.array([*along[: len(self.matrix) - 1], across])
        return dict(zip("xyz", map(float, values), strict=False))

    def along(self, axis: int) -> str:
        """A coordinate of the scene before the turn."""
        terms = [f"{float(c)!r}*x[{k}]" for k, c in enumerate(self.matrix[:, axis]) if c != 0]
        return f"({' + '.join(terms)})"


def trial(seed: int, dimension: int, units: Units | None = None) -> Trial:
    """The scene of a seed, in its own units or in given ones."""
    dice = Dice(seed, dimension, 7)
    frame = _Frame(_turned(dice, dimension), dice.power(-5, -2))
    count = dice.one_of(2, 2, 2, 3)
    mesh = _mesh(dice, frame, dimension, count)
    degree = dice.one_of(1, 1, 2) if len(mesh.cells) <= _QUADRATIC[dimension] else 1
    scene: dict[str, Any] = {
        "title": f"bodies {seed}",
        "mesh": {"file": "body.inp"},
        "element": {"degree": degree},
    }
    soft = dice.power(-3, 3) if dice.chance(0.5) else 1.0
    youngs = [1.0, *(soft if dice.chance(0.6) else 1.0 for _ in range(count - 1))]
    dice.random.shuffle(youngs)
    youngs = [young / max(youngs) for young in youngs]
    scene["material"] = [
        {
            "region": f"body{k}",
            "young": young,
            "poisson": dice.one_of(0.0, 0.2, 0.3, 0.3, 0.4, 0.45, 0.49, -0.3),
        }
        for k, young in enumerate(youngs)
    ]
    if any(material["poisson"] >= 0.45 for material in scene["material"]) and dice.chance(0.7):
        scene["element"]["volumetric"] = "auto"
    stress = frame.size * min(youngs)
    steps = dice.one_of(1, 1, 1, 2, 3)
    _hold_and_load(dice, frame, scene, count, steps, _Frame(frame.matrix, stress))
    scene["contact"] = _contacts(dice, frame, scene, count, stress)
    if solver := _solver(dice, steps):
        scene["solver"] = solver
    return Trial(seed, scene, mesh, units or drawn_units(seed, dimension))


def _turned(dice: Dice, dimension: int) -> Array:
    if dice.chance(0.5):
        return np.eye(dimension)
    if dimension == 3:
        return np.asarray(Rotation.random(random_state=dice.whole(0, 2**31 - 1)).as_matrix())
    angle = dice.between(0, 2 * np.pi)
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


# ---- meshes


def _mesh(dice: Dice, frame: _Frame, dimension: int, count: int) -> Mesh:
    """A stack; the boundaries of body k are bottomk, topk and sidek, its region is bodyk."""
    cell = (
        dice.one_of("triangle", "quadrilateral")
        if dimension == 2
        else dice.one_of("tetrahedron", "hexahedron")
    )
    slope, bend = (
        dice.one_of(0.0, dice.between(-0.3, 0.3)),
        dice.one_of(0.0, 0.0, dice.between(-0.3, 0.3)),
    )
    levels = np.cumsum([0.0, *(dice.between(0.4, 1.0) for _ in range(count))])
    # The surfaces between bodies do not reach those above and below.
    rise = 1.2 * abs(slope) + 1.44 * (dimension - 1) * abs(bend)
    flatter = min(1.0, 0.3 * float(np.diff(levels).min()) / rise) if rise > 0 else 1.0
    start, mesh = 0, None
    for k in range(count):
        counts = [dice.one_of(*_ALONG[dimension]) for _ in range(dimension - 1)]
        p, cells, sides = (
            plane.grid(counts[0], dice.one_of(*_THROUGH[2]), cell)
            if dimension == 2
            else space.grid(*counts, dice.one_of(*_THROUGH[3]), cell)
        )
        if dice.chance(0.4):
            inner = (p > 1e-9) & (p < 1 - 1e-9)
            room = np.array([1.0 / np.unique(np.round(column, 9)).size for column in p.T])
            p = p + 0.2 * room * inner * dice.random.uniform(-1, 1, p.shape)
        low = np.array([dice.one_of(-1.0, dice.between(-1.2, -0.4)) for _ in range(dimension - 1)])
        high = np.array([dice.one_of(1.0, dice.between(0.4, 1.2)) for _ in range(dimension - 1)])
        x = low + p[:, :-1] * (high - low)

        def height(level: int, x: Array = x, k: int = k) -> Array:
            """Of the surface between two bodies; the bodies may be apart, or overlap a little."""
            inside = 0 < level < count
            shape = (
                flatter * (slope * x[:, 0] + bend * (x**2).sum(axis=1))
                if inside
                else np.zeros(len(x))
            )
            return np.asarray(levels[level] + shape)

        apart = frame.size * dice.one_of(0.0, 0.0, 0.0, dice.between(-0.5, 1.0)) if k else 0.0
        bottom, top = height(k) + apart, height(k + 1)
        z = bottom + p[:, -1] * (top - bottom)
        points = np.column_stack([x, z]) @ frame.matrix.T
        named = {"bottom": sides["bottom"], "top": sides["top"], "side": sides["left"]}
        boundaries = {f"{name}{k}": rows + start for name, rows in named.items()}
        region = {f"body{k}": np.arange(len(cells)) + (0 if mesh is None else len(mesh.cells))}
        cells = cells + start
        start += len(points)
        if mesh is None:
            mesh = Mesh(points, cells, boundaries, region)
        else:
            mesh = Mesh(
                np.concatenate([mesh.points, points]),
                np.concatenate([mesh.cells, cells]),
                mesh.boundaries | boundaries,
                mesh.regions | region,
            )
    assert mesh is not None
    return mesh


# ---- effects


def _hold_and_load(
    dice: Dice, frame: _Frame, scene: dict[str, Any], count: int, steps: int, stress: _Frame
) -> None:
    """Supports, tractions and a body force; with several steps some of them follow factors."""
    dimension = len(frame.matrix)

    def stepped(load: dict[str, Any], probability: float) -> dict[str, Any]:
        if steps == 1 or not dice.chance(probability):
            return load
        ramp = [round((n + 1) / steps, 3) for n in range(steps)]
        return load | {
            "factors": ramp
            if dice.chance(0.5)
            else [round(dice.between(-1, 1), 3) for _ in range(steps)]
        }

    def along(most: float) -> list[float]:
        return [dice.between(-most, most) for _ in range(dimension - 1)]

    still = dict.fromkeys("xyz"[:dimension], 0.0)
    supports, tractions = [], []
    if dice.chance(0.75):
        supports.append({"boundary": "bottom0", **still})
    last = count - 1
    if dice.chance(0.5):
        supports.append(
            stepped(
                {"boundary": f"top{last}", **frame.vector(-dice.between(0.2, 2), *along(1))}, 0.8
            )
        )
    else:
        push = dice.one_of((-1.0, 0.0), (-1.0, 0.3), (-1.0, 1.0), (dice.between(-0.2, 1.0), 0.3))
        tractions.append(
            stepped({"boundary": f"top{last}", **stress.vector(push[0], *along(push[1]))}, 0.6)
        )
        if dice.chance(0.4):  # along the contact on one side
            tractions.append(
                stepped(
                    {"boundary": f"side{dice.whole(0, last)}", **stress.vector(0.0, *along(0.6))},
                    0.7,
                )
            )
    for k in range(count):
        if dice.chance(0.25):
            axes = still if dice.chance(0.5) else {dice.one_of(*still): 0.0}
            supports.append({"boundary": f"side{k}", **axes})
    if dice.chance(0.3):
        scene["body_force"] = stepped(stress.vector(-1.0, *along(0.3)), 0.3)
    effects = [*supports, *tractions, *([scene["body_force"]] if "body_force" in scene else [])]
    if steps > 1 and not any("factors" in effect for effect in effects):
        effects[-1]["factors"] = [round((n + 1) / steps, 3) for n in range(steps)]
    if supports:
        scene["displacement"] = supports
    if tractions:
        scene["traction"] = tractions


def _contacts(
    dice: Dice, frame: _Frame, scene: dict[str, Any], count: int, stress: float
) -> list[dict[str, Any]]:
    """Between neighbours, either side first; and of the lowest body on a foundation, if nothing
    holds its bottom.
    """

    def friction() -> dict[str, Any]:
        kind = dice.one_of("none", "tresca", "tresca", "coulomb", "coulomb", "coulomb")
        if kind == "none":
            return {"law": "none"}
        if kind == "tresca":
            bound = stress * dice.power(-2, 1)
            varies = dice.chance(0.3)
            return {
                "law": "tresca",
                "bound": f"{bound!r}*abs(sin(5*{frame.along(0)}))" if varies else bound,
            }
        law = {
            "law": "coulomb",
            "coefficient": dice.one_of(dice.power(-2, 0), dice.power(-0.7, 0.3)),
        }
        if dice.chance(0.15):
            law["cap"] = stress * dice.power(-1, 1)
        return law

    found = []
    for k in range(1, count):
        sides = [f"bottom{k}", f"top{k - 1}"]
        if dice.chance(0.5):
            sides.reverse()
        contact: dict[str, Any] = {"boundary": sides[0], "against": sides[1], "points": "boundary"}
        if dice.chance(0.15):
            contact["kind"] = "bonded"
        else:
            contact["friction"] = friction()
            if dice.chance(0.08):
                contact["kind"] = "bilateral"
            if dice.chance(0.4):
                contact["distance"] = "nominal"
            if dice.chance(0.4):
                contact["gap"] = dice.one_of(
                    frame.size * dice.between(-0.5, 1.0),
                    f"{frame.size * dice.power(-1, 1)!r}*({frame.along(0)} - "
                    f"{dice.between(-0.5, 0.5)!r})**2",
                )
        found.append(contact)
    if not any(effect["boundary"] == "bottom0" for effect in scene.get("displacement", [])):
        found.append({"boundary": "bottom0", "friction": friction()})
    return found


def _solver(dice: Dice, steps: int) -> dict[str, Any]:
    found: dict[str, Any] = {}
    algorithm = dice.one_of(
        "auto", "auto", "auto", "ssn", "continuation", "path-following", "alm", "alm"
    )
    if algorithm == "path-following" and steps > 1:
        algorithm = "auto"
    if algorithm != "auto":
        found["algorithm"] = algorithm
    if dice.chance(0.4):
        found["coulomb"] = dice.one_of("fp", "newton")
    for name in ("gamma_n", "gamma_t"):
        if dice.chance(0.2):
            found[name] = 1e5 * dice.power(-2, 2)
    if dice.chance(0.5):
        found["linear_algebra"] = dice.one_of("full", "condensed", "krylov")
    return found
