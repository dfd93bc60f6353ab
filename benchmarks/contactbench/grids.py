"""Meshes of the problems: quadrilaterals or hexahedra on mapped lines, in NumPy alone."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from .problem import SHAPES, SIDES, Body, Problem

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Grid:
    """A mesh of linear elements.

    Attributes:
        points: positions of the nodes, shape (n, 2) or (n, 3).
        cells: nodes of the cells, counter-clockwise; of hexahedra the four of the bottom first,
        shape (c, 4 or 8).
        body: number of the body of each cell, shape (c,).
        facets: for each name of a boundary the nodes of its facets, shape (f, 2 or 4).
        names: of the bodies.
    """

    points: Floats
    cells: Ints
    body: Ints
    facets: dict[str, Ints]
    names: tuple[str, ...]

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return self.points.shape[1]

    def nodes(self, boundary: str) -> Ints:
        """Nodes of a boundary, each once, ascending."""
        return np.unique(self.facets[boundary])

    def node_at(self, point: Floats) -> int:
        """The node at a point.

        Raises:
            ValueError: no node is there.
        """
        distance = np.linalg.norm(self.points - point, axis=1)
        node = int(distance.argmin())
        if distance[node] > 1e-8 * np.ptp(self.points, axis=0).max():
            raise ValueError(f"no node of the mesh is at {point.tolist()}")
        return node


def make_grid(problem: Problem, level: int = 0) -> Grid:
    """The mesh of a problem.

    Args:
        problem: any.
        level: each adds a division of all cells by two in each direction; 0 is the coarsest mesh.

    Raises:
        ValueError: the mesh cannot be made in this way.
    """
    if level < 0:
        raise ValueError("the level of a mesh is not negative")
    points, cells, body, facets, start = [], [], [], dict[str, list[Ints]](), 0
    for number, part in enumerate(problem.bodies):
        x, corners, sides = _lattice(part, 2**level)
        points.append(x)
        cells.append(corners + start)
        body.append(np.full(len(corners), number))
        for name, nodes in sides:
            facets.setdefault(name, []).append(nodes + start)
        start += len(x)
    every, owner = np.concatenate(cells), np.concatenate(body)
    named = {name: np.concatenate(parts) for name, parts in facets.items()}
    return Grid(
        np.concatenate(points), every, owner, named, tuple(part.name for part in problem.bodies)
    )


def _line(segments: list[tuple[float, float, int, float]], times: int) -> Floats:
    """Points of a line; those of segments with a ratio grow as a geometric sequence, whatever their
    number.
    """
    found = [np.array([segments[0][0]])]
    for low, high, count, ratio in segments:
        s = np.arange(1, count * times + 1) / (count * times)
        growth = ratio ** (count / max(count - 1, 1))
        part = s if abs(ratio - 1) < 1e-12 else (growth**s - 1) / (growth - 1)
        found.append(low + (high - low) * part)
        found[-1][-1] = high
    return np.concatenate(found)


def _halved(values: Floats, times: int) -> Floats:
    """Points of a line between those of the coarsest one, evenly."""
    s = np.arange(times) / times
    return np.append((values[:-1, None] + np.diff(values)[:, None] * s).ravel(), values[-1])


def _lattice(body: Body, times: int) -> tuple[Floats, Ints, list[tuple[str, Ints]]]:
    """Nodes, cells and named facets of a mapped body."""
    keys = SHAPES[body.shape]
    lines = [_line(body.lines[key], 1 if body.straight else times) for key in keys]
    if body.straight:
        coarse = _mapped(body, np.meshgrid(*lines, indexing="ij"))
        at = [_halved(np.arange(len(line), dtype=float), times) for line in lines]
        x = _bilinear(coarse, at)
    else:
        x = _mapped(body, np.meshgrid(*lines, indexing="ij"))
    numbers = np.arange(x[..., 0].size).reshape(x.shape[:-1])
    cells = _cells(numbers)
    sides: list[tuple[str, Ints]] = []
    for k in range(len(keys)):
        for end, side in enumerate(SIDES[body.shape][k]):
            surface = numbers.take(-end, axis=k)
            sides += _named(body, side, surface, [i for i in range(len(keys)) if i != k], times)
    return x.reshape(-1, x.shape[-1]), cells, sides


def _mapped(body: Body, at: list[Floats]) -> Floats:
    if body.shape != "annulus":
        x, angle = np.stack(at, axis=-1), np.deg2rad(body.turn)
        if not angle:
            return x
        cos, sin = np.cos(angle), np.sin(angle)
        return np.concatenate([x[..., :2] @ [[cos, sin], [-sin, cos]], x[..., 2:]], axis=-1)
    radius, angle = at[0], np.deg2rad(at[1])
    exact = [np.where(np.abs(f) < 1e-15, 0.0, f) for f in (np.cos(angle), np.sin(angle))]
    return np.stack(
        [body.centre[0] + radius * exact[0], body.centre[1] + radius * exact[1]], axis=-1
    )


def _bilinear(coarse: Floats, at: list[Floats]) -> Floats:
    """Between the points of a lattice in 2D, at places in units of its cells."""
    parts = []
    for count, places in zip(coarse.shape[:2], at, strict=True):
        low = np.minimum(places.astype(int), count - 2)
        parts.append((low, places - low))
    (i, s), (j, t) = parts
    s, t = s[:, None, None], t[None, :, None]
    corner = [coarse[np.ix_(i + a, j + b)] for a in (0, 1) for b in (0, 1)]
    return (1 - s) * ((1 - t) * corner[0] + t * corner[1]) + s * (
        (1 - t) * corner[2] + t * corner[3]
    )


def _cells(numbers: Ints) -> Ints:
    if numbers.ndim == 2:
        around = (numbers[:-1, :-1], numbers[1:, :-1], numbers[1:, 1:], numbers[:-1, 1:])
        return np.stack([part.ravel() for part in around], axis=1)
    around = []
    for up in (slice(None, -1), slice(1, None)):
        low, high = slice(None, -1), slice(1, None)
        around += [
            numbers[a, b, up] for a, b in ((low, low), (high, low), (high, high), (low, high))
        ]
    return np.stack([part.ravel() for part in around], axis=1)


def _named(
    body: Body, side: str, surface: Ints, others: list[int], times: int
) -> list[tuple[str, Ints]]:
    """Facets of a side; where it has several names they are those of the segments of its first
    coordinate.
    """
    names = body.sides[side]
    segments = body.lines[SHAPES[body.shape][others[0]]]
    counts = [count * times for _, _, count, _ in segments]
    if len(names) == 1:
        names = names * len(segments)
    if len(names) != len(segments):
        raise ValueError(f"side {side} of {body.name} needs one name, or {len(segments)}")
    ends = np.concatenate([[0], np.cumsum(counts)])
    found = []
    for name, (low, high) in zip(names, pairwise(ends), strict=True):
        if not name:
            continue
        part = surface[low : high + 1]
        if part.ndim == 1:
            nodes = np.stack([part[:-1], part[1:]], axis=1)
        else:
            around = (part[:-1, :-1], part[1:, :-1], part[1:, 1:], part[:-1, 1:])
            nodes = np.stack([corner.ravel() for corner in around], axis=1)
        found.append((name, nodes))
    return found
