"""Input files with contact for CalculiX, and its results: one body above a rigid plate, or two bodies.

Three kinds: a *shelf* is clamped on the left and bent down onto a plate below a gap; a *press* is pushed onto a plate
by its top, with friction; a *stack* is two elastic bodies, the upper one pressed and pushed.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from math import cos, radians, sin
from pathlib import Path

import numpy as np

# Corners of the simplices that a square or cube is divided into, and the faces S1, S2 ... of each element.
_HALVES = ((0, 1, 2), (0, 2, 3))
_SIXTHS = ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6))
_SQUARE = ((0, 0), (1, 0), (1, 1), (0, 1))
_CUBE = (*((*c, 0) for c in _SQUARE), *((*c, 1) for c in _SQUARE))
_FACES = {
    (2, 3): ((0, 1), (1, 2), (2, 0)),
    (2, 4): ((0, 1), (1, 2), (2, 3), (3, 0)),
    (3, 4): ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    (3, 8): ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
}
# Corners between which the further nodes of elements of degree 2 lie, in the order of the programs.
_EDGES = {
    (2, 3): ((0, 1), (1, 2), (2, 0)),
    (2, 4): ((0, 1), (1, 2), (2, 3), (3, 0)),
    (3, 4): ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
    (3, 8): (*((0, 1), (1, 2), (2, 3), (3, 0)), *((4, 5), (5, 6), (6, 7), (7, 4)), *((0, 4), (1, 5), (2, 6), (3, 7))),
}
_SIDES = ("LEFT", "RIGHT", "BOTTOM", "TOP", "FRONT", "BACK")


# From x and height to others.  The plate below one body stays flat but for an arc, which is for two bodies.
SHAPES: dict[str, Callable[[float, float], tuple[float, float]]] = {
    "": lambda x, y: (x, y),
    "taper": lambda x, y: (x, y * (1 + 0.35 * x)),
    "skew": lambda x, y: (x + 0.4 * y, y),
    "rotated": lambda x, y: (x * cos(_TURN) - y * sin(_TURN), x * sin(_TURN) + y * cos(_TURN)),
    "dome": lambda x, y: (x, y * (1 + 0.5 * sin(1.4 * x)) if y > 0 else y),
    "slender": lambda x, y: (2.5 * x, 0.8 * y),
    "arc": lambda x, y: (1 + (_RADIUS - y) * sin((x - 1) / _RADIUS), _RADIUS - (_RADIUS - y) * cos((x - 1) / _RADIUS)),
}
_TURN, _RADIUS = radians(25), 5.0


@dataclass(frozen=True)
class ForeignDeck:
    """A deck.

    Attributes:
        kind: shelf, press or stack.
        element: its type, such as CPE4.
        cells: along each axis.
        young: Young's modulus, stress; of the lower body of a stack three times it.
        poisson: Poisson's ratio.
        stiffness: of contact, stress per length; None: HARD.
        friction: coefficient; 0: none.
        stick: stiffness of sticking, stress per length.
        pair: TYPE of *CONTACT PAIR.
        pressure: on the top.
        push: pressure on the left of the upper body of a stack, and on the right of a shelf.
        displaced: prescribed motion of the top of a press along x and down.
        gap: below a shelf.
        above: by which a press begins above its plate, length.
        increments: of the step.
        warp: by which share of a cell nodes inside are moved.
        clamped: whether a shelf is held on its left.
        tied: whether contact is bonded.
        lower: modulus of the lower body of a stack over that of the upper one.
        law: of soft contact instead of ``stiffness``: its PRESSURE-OVERCLOSURE, and the numbers of each row.
        adjust: ADJUST of *CONTACT PAIR: a length, or a set of nodes; "": none.
        tilt: by which a plate is lower on its right than on its left, length.
        shape: a name of ``SHAPES``, into which the bodies are bent; "": they are boxes.
        capped: whether a further body, whose nodes do not fit, is tied onto the top, and has its loads and its motion.
        earlier: of the loads and the motion of the top in a load step before the last one; 0: there is none.
    """

    kind: str = "shelf"
    element: str = "CPE4"
    cells: tuple[int, ...] = (8, 3)
    young: float = 1000.0
    poisson: float = 0.3
    stiffness: float | None = 1e5
    friction: float = 0.0
    stick: float = 1e5
    pair: str = "SURFACE TO SURFACE"
    pressure: float = 1.0
    push: float = 0.5
    displaced: tuple[float, float] = (0.01, 0.03)
    gap: float = 0.02
    above: float = 0.0
    increments: int = 1
    warp: float = 0.0
    clamped: bool = True
    tied: bool = False
    lower: float = 3.0
    law: tuple[str, tuple[tuple[float, ...], ...]] | None = None
    adjust: str = ""
    tilt: float = 0.0
    shape: str = ""
    capped: bool = False
    earlier: float = 0.0

    @property
    def dim(self) -> int:
        """2 in the plane, 3 in space."""
        return 3 if self.element.startswith("C3D") else 2

    @property
    def nodes_of_element(self) -> int:
        """How many nodes an element has."""
        return int(re.sub(r"\D", "", self.element.removeprefix("C3D")))


@dataclass
class _Part:
    nodes: dict[int, tuple[float, ...]] = field(default_factory=dict)
    elements: dict[int, list[int]] = field(default_factory=dict)
    faces: dict[str, list[tuple[int, int]]] = field(default_factory=dict)
    sides: dict[str, list[int]] = field(default_factory=dict)


def _box(deck: ForeignDeck, cells: Sequence[int], lower: Sequence[float], upper: Sequence[float], first: int) -> _Part:
    """A box of elements, whose numbers begin with ``first``."""
    part, dim = _Part(), len(cells)
    low, high = np.array(lower), np.array(upper)
    corners = 4 if dim == 2 else 8
    simplex = deck.nodes_of_element in ((3, 6) if dim == 2 else (4, 10))
    quadratic = deck.nodes_of_element in (6, 8) if dim == 2 else deck.nodes_of_element in (10, 20)
    count = dim + 1 if simplex else corners
    pieces = (_HALVES if dim == 2 else _SIXTHS) if simplex else (tuple(range(corners)),)
    numbers: dict[tuple[int, ...], int] = {}

    def node(at: tuple[int, ...]) -> int:
        """By twice its place in the lattice."""
        if at not in numbers:
            numbers[at] = first + len(numbers)
            share = np.array(at) / (2 * np.array(cells))
            inside = all(0 < a < 2 * n for a, n in zip(at, cells, strict=True))
            x = low + share * (high - low)
            if inside and deck.warp:
                rng = np.random.default_rng([*at, 7])
                x = x + deck.warp * rng.uniform(-0.5, 0.5, dim) * (high - low) / np.array(cells)
            part.nodes[numbers[at]] = tuple(x.tolist())
        return numbers[at]

    element = first
    for cell in product(*(range(n) for n in reversed(cells))):
        base = 2 * np.array(cell[::-1])
        lattice = [tuple((base + 2 * np.array(c)).tolist()) for c in (_SQUARE if dim == 2 else _CUBE)]
        for piece in pieces:
            members = [lattice[c] for c in piece]
            nodes = [node(at) for at in members]
            if quadratic:
                for a, b in _EDGES[dim, count]:
                    middle = tuple((p + q) // 2 for p, q in zip(members[a], members[b], strict=True))
                    nodes.append(node(middle))
                    ends = [part.nodes[node(members[c])] for c in (a, b)]
                    part.nodes[nodes[-1]] = tuple(np.mean(ends, axis=0).tolist())
            part.elements[element] = nodes
            for number, face in enumerate(_FACES[dim, count], start=1):
                for axis, end in product(range(dim), (0, 1)):
                    if all(members[c][axis] == end * 2 * cells[axis] for c in face):
                        axes = (0, 1) if dim == 2 else (0, 2, 1)  # in space z is up
                        name = _SIDES[2 * axes.index(axis) + end]
                        part.faces.setdefault(name, []).append((element, number))
            element += 1
    for axis, end in product(range(dim), (0, 1)):
        axes = (0, 1) if dim == 2 else (0, 2, 1)
        name = _SIDES[2 * axes.index(axis) + end]
        part.sides[name] = [n for at, n in numbers.items() if at[axis] == end * 2 * cells[axis]]
    return part


def _bent(deck: ForeignDeck, part: _Part) -> _Part:
    """A part in the shape of the deck."""
    nodes: dict[int, tuple[float, ...]] = {}
    for number, (x, *across, y) in part.nodes.items():
        along, height = SHAPES[deck.shape](x, y)
        nodes[number] = (along, *across, height)
    return replace(part, nodes=nodes)


def _written(deck: ForeignDeck, part: _Part, name: str) -> list[str]:
    lines = ["*NODE", *(f"{n}, {', '.join(map(repr, x))}" for n, x in part.nodes.items())]
    lines.append(f"*ELEMENT, TYPE={deck.element}, ELSET={name}")
    for number, nodes in part.elements.items():
        words = [str(number), *map(str, nodes)]
        lines += [", ".join(words)] if len(words) < 16 else [", ".join(words[:11]) + ",", ", ".join(words[11:])]
    for side, faces in part.faces.items():
        lines += [f"*SURFACE, NAME={name}_{side}", *(f"{element}, S{face}" for element, face in faces)]
    for side, nodes in part.sides.items():
        lines += _set(f"{name}_{side}_N", nodes)
    return [*lines, *_set(f"{name}_N", list(part.nodes))]


def _set(name: str, nodes: Sequence[int]) -> list[str]:
    return [f"*NSET, NSET={name}", *(", ".join(map(str, nodes[k : k + 12])) for k in range(0, len(nodes), 12))]


def text_of(deck: ForeignDeck) -> str:
    """The deck."""
    dim = deck.dim
    flat = dim == 2
    inner = 1.0 if deck.element.startswith("CAX") else 0.0

    def box(
        cells: Sequence[int], low: tuple[float, float], high: tuple[float, float], first: int, wider: float = 0.0
    ) -> _Part:
        """From x and height; the lower body is wider, as CalculiX loses nodes at the edge of a surface."""
        if flat:
            return _box(deck, cells, (low[0] + inner, low[1]), (high[0] + inner, high[1]), first)
        return _box(deck, cells, (low[0], -wider, low[1]), (high[0], 1.0 + wider, high[1]), first)

    cells = deck.cells
    body = box(cells, (0.0, 0.0), (2.0, 0.5), 1)
    start = max([*body.nodes, *body.elements]) + 100
    body = _bent(deck, body)
    lines = _written(deck, body, "BODY")
    one = (1, 1) if flat else (1, 1, 1)
    elements = "*SOLID SECTION, ELSET={}, MATERIAL={}"
    boundary: list[str] = []
    across = [] if flat else ["BODY_FRONT_N, 2"]
    if deck.kind == "stack":
        other = box(tuple(max(1, n + 1) for n in cells[:-1]) + cells[-1:], (-0.25, -0.6), (2.25, 0.0), start, 0.25)
        other = _bent(deck, other)
        lines += _written(deck, other, "BASE")
        boundary += [f"BASE_BOTTOM_N, 1, {dim}", *across]
        boundary += ["BODY_TOP_N, 1, 1", f"BODY_TOP_N, {dim}, {dim}"] if deck.friction else ["BODY_LEFT_N, 1"]
    else:
        gap = deck.gap if deck.kind == "shelf" else deck.above
        other = box(one, (-0.5, -0.5 - gap), (2.5, -gap), start, 0.25)
        for number, (x, *rest, y) in other.nodes.items():
            other.nodes[number] = (x, *rest, y - deck.tilt * (x - inner + 0.5) / 3)
        other = _bent(deck, other)
        lines += _written(deck, other, "BASE")
        boundary += [f"BASE_N, 1, {dim}", *across]
        boundary += [f"BODY_LEFT_N, 1, {dim}"] * (deck.kind == "shelf" and deck.clamped)
        boundary += ["BODY_TOP_N, 1, 1", f"BODY_TOP_N, {dim}, {dim}"] * (deck.kind == "press")
    top, further = "BODY", dict[int, tuple[float, ...]]()
    if deck.capped:
        first = max([*other.nodes, *other.elements]) + 100
        # Nodes of the finer side are tied: those of the other one between them would be loose.
        cap = _bent(deck, box((*(n + 1 for n in cells[:-1]), 1), (0.0, 0.5), (2.0, 0.8), first))
        lines += [*_written(deck, cap, "CAP"), elements.format("CAP", "M")]
        lines += ["*TIE, NAME=C, POSITION TOLERANCE=0.01", "CAP_BOTTOM, BODY_TOP"]
        boundary = [line.replace("BODY_TOP_N", "CAP_TOP_N") for line in boundary]
        top, further = "CAP", cap.nodes
    lines += ["*MATERIAL, NAME=M", "*ELASTIC", f"{deck.young!r}, {deck.poisson!r}"]
    lines += ["*MATERIAL, NAME=W", "*ELASTIC", f"{deck.young * deck.lower!r}, {deck.poisson!r}"]
    lines += [elements.format("BODY", "M"), elements.format("BASE", "W" if deck.kind == "stack" else "M")]
    if deck.tied:
        lines += ["*TIE, NAME=T, POSITION TOLERANCE=0.01", "BODY_BOTTOM, BASE_TOP"]
    else:
        hard = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE="
        lines += ["*SURFACE INTERACTION, NAME=S"]
        if deck.law is not None:
            name, rows = deck.law
            lines += [f"{hard}{name}", *(", ".join(map(repr, row)) for row in rows)]
        else:
            lines += [f"{hard}HARD"] if deck.stiffness is None else [f"{hard}LINEAR", repr(deck.stiffness)]
        lines += ["*FRICTION", f"{deck.friction!r}, {deck.stick!r}"] if deck.friction else []
        adjust = f", ADJUST={deck.adjust}" if deck.adjust else ""
        lines += [f"*CONTACT PAIR, INTERACTION=S, TYPE={deck.pair}{adjust}", "BODY_BOTTOM, BASE_TOP"]
    lines += _set("ALL", [*body.nodes, *other.nodes, *further])
    lines += ["*BOUNDARY", *boundary]
    for share in [deck.earlier] * (deck.earlier != 0) + [1.0]:
        lines += _step(deck, top, share)
    return "\n".join(lines) + "\n"


def _step(deck: ForeignDeck, top: str, share: float) -> list[str]:
    """A load step with a share of the loads and the motion of a body's top."""
    dim, step = deck.dim, 1 / deck.increments
    static = ["*STATIC, DIRECT", f"{step!r}, 1."] if deck.increments > 1 else ["*STATIC", "1., 1."]
    lines = ["*STEP, INC=1000", *static]
    if deck.kind == "press" or (deck.kind == "stack" and deck.friction):
        along, down = (share * value for value in deck.displaced)
        lines += ["*BOUNDARY", f"{top}_TOP_N, 1, 1, {along!r}", f"{top}_TOP_N, {dim}, {dim}, {-down!r}"]
    loads = [f"BODY_RIGHT, P, {share * deck.push!r}"]
    if deck.kind == "shelf" or (deck.kind == "stack" and not deck.friction):
        loads.insert(0, f"{top}_TOP, P, {share * deck.pressure!r}")
    lines += ["*DSLOAD", *loads, "*NODE PRINT, NSET=ALL", "U", "*NODE PRINT, NSET=ALL", "RF", "*NODE FILE", "U, RF"]
    return [*lines, "*END STEP"]


# Seconds after which CalculiX is ended; these decks take one or two.
_LONGEST = 60


def program() -> str | None:
    """CalculiX: ccx, or what CCX in the environment names; None: there is none."""
    return shutil.which(os.environ.get("CCX", "ccx"))


def solve(text: str, folder: Path, name: str = "job", *, calculix: str | None = None) -> Path | None:
    """Solve a deck: the deck beside its .dat and .frd; None: CalculiX has no solution, or does not end."""
    ccx = calculix or program()
    assert ccx is not None
    deck = folder / f"{name}.inp"
    deck.write_text(text, encoding="utf-8")
    environment = os.environ | {"OMP_NUM_THREADS": "1", "CCX_NPROC_EQUATION_SOLVER": "1"}
    try:
        done = subprocess.run(
            [ccx, name], cwd=folder, capture_output=True, text=True, env=environment, check=False, timeout=_LONGEST
        )
    except subprocess.TimeoutExpired:  # its contact sometimes alternates for ever
        return None
    dat = folder / f"{name}.dat"
    ended = "Job finished" in done.stdout and "*ERROR" not in done.stdout
    return deck if ended and dat.exists() and "displacements" in dat.read_text(encoding="utf-8") else None


__all__ = ["ForeignDeck", "program", "replace", "solve", "text_of"]
