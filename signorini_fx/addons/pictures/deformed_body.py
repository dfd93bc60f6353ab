"""The deformed body of the plane on its foundation, a field in colours or gray tones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection, TriMesh
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation
from scipy.spatial import cKDTree

from signorini_fx.addons.pictures.fields import FIELDS, Field
from signorini_fx.addons.pictures.marks import Largest, draw_lengths, mark_largest
from signorini_fx.addons.pictures.style import INK, MUTED, SCREEN, STYLE, Floats, finish, math_number, readable
from signorini_fx.addons.pictures.tiling import Tiling, refined
from signorini_fx.addons.pictures.tones import Tones, draw_principal, upper_tone
from signorini_fx.mechanics.statement.units import bracketed
from signorini_fx.tuned import (
    BENT_FOUNDATION,
    GAP_IN_PICTURE,
    SEEN_AS_IT_IS,
    SMALL_ZONE,
    VISIBLE_CELL,
    VISIBLE_COLOURED_CELL,
)

_BENT = math.cos(math.radians(BENT_FOUNDATION))
_EDGE = "#9a9a9a"
_TRIANGLES = 15_000  # of which a field is made up at least
_FAINT = (0.0, 0.0, 0.0, 0.22)


def magnification(points: Floats, displacement: Floats, parted: float = 0.0) -> float:
    """A factor that makes a displacement visible: the largest becomes about 8 % of the body's diagonal.

    Args:
        points: positions, shape (n, d).
        displacement: at the points, shape (n, d).
        parted: how far two bodies that touch each other seem to be apart, or to overlap, where the displacement is
            not magnified, length: at most 0.3 % of the diagonal in the picture.

    Returns:
        1, 2 or 5 times a power of ten, 1 or more; 1 for a body that does not move but for round-off of its size, or
        whose displacement is seen as it is, above 3 % of the diagonal.
    """
    largest = float(np.hypot.reduce(np.asarray(displacement, dtype=np.float64), axis=1).max(initial=0.0))
    if not (math.isfinite(largest) and largest > np.finfo(np.float64).eps * _diagonal(points)):
        return 1.0
    ideal = 0.08 * _diagonal(points) / largest
    if parted > 0:
        ideal = min(ideal, 0.003 * _diagonal(points) / parted)
    return readable(ideal) if ideal > SEEN_AS_IT_IS else 1.0


def _diagonal(points: Floats) -> float:
    return float(np.hypot.reduce(np.ptp(points, axis=0))) if len(points) else 0.0


def keeps_shape(added: float, size: float, real: Floats, drawn: Floats) -> bool:
    """Whether a foundation keeps its shape where its gap is magnified.

    Args:
        added: how much farther away it is drawn, length.
        size: of the body, length.
        real: directions of its pieces, along or perpendicular to them, shape (m, d).
        drawn: those of the pieces that are drawn, shape (m, d).
    """
    lengths = np.linalg.norm(real, axis=1) * np.linalg.norm(drawn, axis=1)
    return added <= GAP_IN_PICTURE * size and bool((np.einsum("ij,ij->i", real, drawn) >= _BENT * lengths).all())


@dataclass(frozen=True)
class DrawnFoundation:
    """The contact boundary and what it may touch.

    Attributes:
        nodes: positions of the contact nodes, length, in order along each boundary, shape (k, 2).
        offset: the vector d n from each to the rigid foundation, or to the other body, length, shape (k, 2).
        touching: nodes in contact, shape (k,); None: not known.
        other: nodes that may touch another body, which is drawn itself, shape (k,); None: none.
        shaped: nodes whose foundation is among ``lines``, shape (k,); None: none.
        lines: whole foundations where they are, each of shape (k, 2), the body on its left: they are drawn instead of
            what is opposite of the nodes where nothing is magnified.
    """

    nodes: Floats
    offset: Floats
    touching: npt.NDArray[np.bool_] | None = None
    other: npt.NDArray[np.bool_] | None = None
    shaped: npt.NDArray[np.bool_] | None = None
    lines: Sequence[Floats] = ()

    @property
    def grounded(self) -> npt.NDArray[np.bool_]:
        """Nodes on a rigid foundation, shape (k,)."""
        return np.full(len(self.nodes), True) if self.other is None else ~self.other

    @property
    def parted(self) -> float:
        """The largest gap that has closed between two bodies, length: in a magnified picture they are so far apart."""
        if self.other is None or self.touching is None:
            return 0.0
        closed = np.linalg.norm(self.offset[self.other & self.touching], axis=1)
        return float(closed[np.isfinite(closed)].max(initial=0.0))

    def pieces(self) -> list[DrawnFoundation]:
        """Connected parts of the boundary."""
        nodes, offset = (np.asarray(part, dtype=np.float64) for part in (self.nodes, self.offset))
        touching = np.zeros(len(nodes), dtype=bool) if self.touching is None else np.asarray(self.touching, dtype=bool)
        finite = np.isfinite(nodes).all(axis=1) & np.isfinite(offset).all(axis=1)
        nodes, offset, touching, ungrounded = nodes[finite], offset[finite], touching[finite], ~self.grounded[finite]
        shaped = np.zeros(len(nodes), dtype=bool) if self.shaped is None else self.shaped[finite]
        # From one boundary to the next the step is nought or much longer than those before and after.
        steps = np.concatenate(([0.0], np.hypot(*np.diff(nodes, axis=0).T), [0.0]))
        usual = np.maximum(steps[:-2], steps[2:])
        inner = steps[1:-1]
        breaks = (
            np.flatnonzero((inner == 0) | ((inner > 4 * usual) & (usual > 0)) | np.diff(ungrounded) | np.diff(shaped))
            + 1
        )
        split = zip(*(np.split(part, breaks) for part in (nodes, offset, touching, ungrounded, shaped)), strict=True)
        return [DrawnFoundation(*parts) for parts in split if len(parts[0]) > 1]

    def with_mirror_image(self) -> DrawnFoundation:
        """Behind that on the other side of the axis, which is x[0] = 0, in the other order: the body is on the left."""
        nodes, offset = (np.concatenate((part[::-1] * (-1.0, 1.0), part)) for part in (self.nodes, self.offset))
        touching, other, shaped = (
            None if part is None else np.append(part[::-1], part) for part in (self.touching, self.other, self.shaped)
        )
        lines = [*self.lines, *(line[::-1] * (-1.0, 1.0) for line in self.lines)]
        return DrawnFoundation(nodes, offset, touching, other, shaped, lines)

    def looks_like_itself(self, factor: float, size: float) -> bool:
        """Whether a connected part keeps its shape where its gap is magnified.

        Args:
            factor: of the gap.
            size: of the body, length.
        """
        real, drawn = (np.diff(self.nodes + scale * self.offset, axis=0) for scale in (1.0, factor))
        return keeps_shape((factor - 1) * float(np.hypot(*self.offset.T).max()), size, real, drawn)


def deformed_mesh(
    path_stem: str | Path,
    points: Floats,
    cells: npt.NDArray[Any],
    displacement: Floats,
    values: Floats,
    *,
    outline: npt.NDArray[np.int64],
    tiles: Tiling | None = None,
    field: Field = FIELDS["von_mises"],
    stress: Floats | None = None,
    foundation: DrawnFoundation | None = None,
    factor: float | None = None,
    largest: Largest | None = None,
    title: str = "",
    suffixes: Sequence[str] = SCREEN,
) -> None:
    """Draw the deformed mesh on its foundation, a field in colours.

    A displacement that is magnified needs a gap that is magnified alike, or the body would seem to enter the
    foundation.  That is a true picture as long as the gap hardly varies.  Where the magnified gap would bend the
    foundation visibly, as under a disk on a plane, there are two panels: body and foundation as they are; and the body
    with its displacement magnified, without foundation, its contact zone marked.  Where the factor is given there is
    only the latter.  Where contact is on a small part of the body, the second panel shows that part as it is.

    Values at points of the cells are drawn with colours that vary within each cell, and jump between cells only where
    the values do; the label of the colour bar says whether it is so.  The edges of the cells are drawn if the mesh is
    coarse enough to see them; the body's outline always is.  Where a singular corner would leave the rest of the body
    without colour, the scale ends at the value that 99 % of the area stays below; an arrow at the colour bar says that
    there is more.  A circle marks the largest value, a gray line is the outline of the undeformed body, and
    arrows show how long that is: coordinates stand at the axes only where nothing is magnified.

    Args:
        path_stem: where to write, without suffix.
        points: positions, length, shape (n, 2); a point may appear several times.
        cells: points of each cell, shape (m, p): those in order along its perimeter, more than its corners if it is
            curved; with ``tiles`` also those within.
        displacement: y at the points, length, shape (n, 2).
        values: the field, one value per cell, shape (m,), or with ``tiles`` at its points, shape (m, p).
        outline: pairs of points along the boundary of the body, shape (e, 2).
        tiles: how each cell is divided; None: it has one value.
        field: what it is.
        stress: tensors at the middles of the cells, shape (m, 3, 3): their principal stresses are drawn as strokes.
        foundation: None: none is drawn.
        factor: of the displacement, and of the gap where that is a true picture, in one panel; None:
            ``magnification(points, displacement)``, in two panels where one would not be true.
        largest: what the circle marks; None: no circle.
        title: what to say above the picture.
        suffixes: of the files to write.

    Raises:
        ValueError: there are no cells.
    """
    points, displacement = np.asarray(points, dtype=np.float64), np.asarray(displacement, dtype=np.float64)
    cells, values = np.asarray(cells).astype(np.int64), np.asarray(values, dtype=np.float64)
    if not cells.size:
        raise ValueError("the mesh has no cells")
    perimeters = cells if tiles is None else cells[:, : tiles.rim]
    panels, zone, remark = _panels(points, perimeters, displacement, outline, foundation, factor)
    triangles = None if tiles is None else cells[:, tiles.triangles].reshape(-1, 3)
    nodal = values if tiles is None else np.empty(len(points))
    areas = _areas(panels[0].corners)
    if tiles is not None and triangles is not None:
        nodal[cells] = values
        share = _areas(panels[0].moved[triangles]).repeat(3) / 3
        areas = np.asarray(np.bincount(triangles.ravel(), share, len(points)), dtype=np.float64)
    top = None
    if zone is not None:  # the scale is that of what is enlarged
        places = panels[-1].moved if tiles is not None else panels[-1].corners.mean(axis=1)
        seen = np.all((places >= zone[0]) & (places <= zone[1]), axis=1)
        top = upper_tone(nodal[seen], areas[seen])
    tones = Tones(field.told(at_points=tiles is not None), nodal, areas, top)
    frames = [panel.frame() for panel in panels]
    if zone is not None:
        frames[-1] = zone
    aspects = [float((high[1] - low[1]) / (high[0] - low[0])) for low, high in frames]
    widest = 4.8 if len(panels) == 1 else 2.6
    widths = [min(widest, widest / aspect) for aspect in aspects]
    height = max(width * aspect for width, aspect in zip(widths, aspects, strict=True))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(max(sum(widths), 3.0) + 0.7 * len(panels), height + 1.3), layout="constrained")
        grid = figure.subplots(1, len(panels), squeeze=False, width_ratios=widths)[0]
        for axes, panel, (low, high), width in zip(grid, panels, frames, widths, strict=True):
            cell_size = math.sqrt(float(np.median(_areas(panel.corners)))) * 72 * width / (high[0] - low[0])
            panel.draw(axes, nodal, triangles, tones, cell_size, (low, high) if zone is not None else frames[0])
            if stress is not None:
                size = float(np.max(high - low)) * max(1.0, widest / width)
                draw_principal(axes, panel.corners.mean(axis=1), stress, size)
            axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
            if panel.factor == 1:
                axes.set(xlabel=f"$x${bracketed('length')}", ylabel=f"$y${bracketed('length')}")
                axes.spines[:].set_visible(False)
                axes.locator_params(axis="x", nbins=max(2, min(7, round(1.4 * width))))
                axes.locator_params(axis="y", nbins=max(2, min(7, round(2.5 * height))))
            else:  # numbers at the axes would be those of no place of the body
                axes.set_axis_off()
            if panel is panels[0] and panel.factor != 1:
                draw_lengths(axes, points, below=low)
            if panel is panels[0] and largest is not None:
                mark_largest(axes, largest.moved(points, perimeters, values, panel.moved), largest.text)
        tones.bar(figure, list(grid))
        finish(figure, path_stem, f"{title}   ({remark})" if title else remark, suffixes)


def _panels(
    points: Floats,
    cells: npt.NDArray[np.int64],
    displacement: Floats,
    outline: npt.NDArray[np.int64],
    foundation: DrawnFoundation | None,
    factor: float | None,
) -> tuple[list[_Panel], tuple[Floats, Floats] | None, str]:
    """What is seen where, see ``deformed_mesh``; the contact zone if the last panel enlarges it; and what to say of it.

    ``cells`` are perimeters.
    """
    parted = 0.0 if foundation is None else foundation.parted
    chosen = magnification(points, displacement, parted) if factor is None else factor
    pieces = [] if foundation is None else foundation.pieces()
    true = all(piece.looks_like_itself(chosen, _diagonal(points)) for piece in pieces)
    scales = (chosen,) if true or factor is not None else (1.0, chosen)
    shapes = [] if foundation is None else foundation.lines
    panels = [_Panel.of(points, cells, displacement, outline, scale, pieces, shapes) for scale in scales]
    if not true:
        panels[-1] = replace(panels[-1], with_foundation=False)
    scaling = f"displacement $\\times\\,{math_number(chosen)}$"
    if true:
        grounded = any(piece.grounded.all() for piece in pieces)
        remark = scaling if chosen == 1 or not grounded else scaling.replace("displacement", "displacement and gap")
    elif factor is not None:
        remark = f"{scaling}, contact zone thick"
    else:
        remark = f"left: as it is; right: {scaling}, contact zone thick"
    zone = _small_zone(pieces, _diagonal(points)) if factor is None else None
    if zone is None:
        return panels, None, remark
    enlarged = _Panel.of(points, cells, displacement, outline, 1.0, pieces, shapes)
    return [panels[0], enlarged], zone, f"left: {remark if true else 'as it is'}; right: the contact zone as it is"


def _small_zone(pieces: Sequence[DrawnFoundation], size: float) -> tuple[Floats, Floats] | None:
    """Lowest and highest coordinates around what is in contact; None if that is no small part of the body."""
    touching = [piece.nodes[piece.touching] for piece in pieces if piece.touching is not None]
    nodes = np.concatenate([np.empty((0, 2)), *touching])
    if not len(nodes) or not 0 < _diagonal(nodes) < SMALL_ZONE * size:
        return None
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    around = 0.8 * float(max(high - low))
    return low - around, high + around


@dataclass(frozen=True)
class _Panel:
    """The body with its displacement and its gap times ``factor``; ``cells`` are perimeters."""

    points: Floats
    cells: npt.NDArray[np.int64]
    moved: Floats
    outline: npt.NDArray[np.int64]
    factor: float
    pieces: list[DrawnFoundation]
    shapes: Sequence[Floats] = ()
    with_foundation: bool = True

    @classmethod
    def of(
        cls,
        points: Floats,
        cells: npt.NDArray[np.int64],
        displacement: Floats,
        outline: npt.NDArray[np.int64],
        factor: float,
        pieces: list[DrawnFoundation],
        shapes: Sequence[Floats],
    ) -> _Panel:
        moved = points + factor * displacement
        # A solve that failed may leave anything behind.
        return cls(points, cells, np.where(np.isfinite(moved), moved, points), outline, factor, pieces, shapes)

    @property
    def corners(self) -> Floats:
        """Of the cells, shape (m, 3 or 4, 2)."""
        return self.moved[self.cells]

    def lines(self) -> list[tuple[Floats, float, bool]]:
        """The rigid foundations, on which side of each the body is, see ``_side_of_body``, and whether it is whole."""
        if not self.with_foundation:
            return []
        centres, shapes = self.points[self.cells].mean(axis=1), self.shapes if self.factor == 1 else ()
        pieces = [piece for piece in self.pieces if piece.grounded.all()]
        opposite = [piece for piece in pieces if not shapes or piece.shaped is None or not piece.shaped.all()]
        return [
            *(
                (piece.nodes + self.factor * piece.offset, _side_of_body(piece.nodes, centres), False)
                for piece in opposite
            ),
            *((line, 1.0, True) for line in shapes),
        ]

    def frame(self) -> tuple[Floats, Floats]:
        """What is seen: the body, and a foundation that runs far away not much further than that."""
        body = np.concatenate((self.corners.reshape(-1, 2), self.points[self.cells].reshape(-1, 2)))
        low, high = body.min(axis=0), body.max(axis=0)
        around = 0.3 * float(max(high - low))
        # Whole foundations end near the body.
        seen = [line if shaped else np.clip(line, low - around, high + around) for line, _, shaped in self.lines()]
        everything = np.concatenate([np.stack((low, high)), *seen])
        low, high = everything.min(axis=0), everything.max(axis=0)
        margin = 0.035 * float(max(high - low))
        return low - margin, high + margin

    def draw(
        self,
        axes: Axes,
        values: Floats,
        triangles: npt.NDArray[np.int64] | None,
        tones: Tones,
        cell_size: float,
        extent: tuple[Floats, Floats],
    ) -> None:
        """The body in colours, the outline, the foundations; or the contact zone where there are none."""
        edged = cell_size >= (VISIBLE_CELL if triangles is None else VISIBLE_COLOURED_CELL)
        coloured: dict[str, Any] = {
            "array": values * 10.0**tones.power,
            "cmap": tones.colours,
            "norm": tones.norm,
        }
        if triangles is not None:
            # matplotlib interpolates red, green and blue instead of the field, which only small triangles do not show.
            corners = refined(np.dstack((self.moved[triangles], coloured["array"][triangles])), _TRIANGLES)
            rows = np.arange(3 * len(corners)).reshape(-1, 3)
            coloured["array"] = corners[..., 2].ravel()
            parts = Triangulation(corners[..., 0].ravel(), corners[..., 1].ravel(), rows)
            field = TriMesh(parts, rasterized=True, zorder=1, **coloured)
            axes.add_collection(field, autolim=False)
        # Vector cells without edges show seams in print, and a million of them take a viewer minutes.
        if triangles is None or edged:
            body = PolyCollection(
                list(self.corners),
                **({"facecolors": "none"} if triangles is not None else coloured),
                edgecolors="none" if not edged else _EDGE if triangles is None else _FAINT,
                linewidths=min(0.4, 0.045 * cell_size) if edged else 0.0,
                antialiaseds=edged,
                rasterized=not edged,
                zorder=1,
            )
            axes.add_collection(body, autolim=False)
        if self.factor != 1:
            undeformed = LineCollection(
                list(self.points[self.outline]), colors=MUTED, linewidths=0.6, zorder=3, alpha=0.7
            )
            axes.add_collection(undeformed, autolim=False)
        edges = self.moved[self.outline]
        axes.add_collection(LineCollection(list(edges), colors=INK, linewidths=0.8, capstyle="round"), autolim=False)
        if not self.with_foundation:
            self._mark_contact(axes)
            return
        margin = 0.035 * float(np.max(extent[1] - extent[0]))
        for line, side, _ in self.lines():
            _draw_foundation(axes, line, side, margin)

    def _mark_contact(self, axes: Axes) -> None:
        """A thick line along the edges of the body between two nodes in contact, where they have gone."""
        at = cKDTree(self.points)
        for piece in self.pieces:
            line = self.moved[at.query(piece.nodes)[1]]
            assert piece.touching is not None
            in_contact = piece.touching[:-1] & piece.touching[1:]
            zone = np.stack((line[:-1], line[1:]), axis=1)[in_contact]
            axes.add_collection(
                LineCollection(list(zone), colors=INK, linewidths=3.0, capstyle="round", zorder=5), autolim=False
            )


def _side_of_body(nodes: Floats, centres: Floats) -> float:
    """+1 if the body, cells with centres of shape (m, 2), lies to the left of a piece of its boundary, else -1."""
    votes = 0.0
    for k in np.unique(np.linspace(0, len(nodes) - 2, 9).astype(int)):
        ahead, middle = nodes[k + 1] - nodes[k], 0.5 * (nodes[k + 1] + nodes[k])
        towards = centres[np.argmin(((centres - middle) ** 2).sum(axis=1))] - middle
        votes += math.copysign(1.0, ahead[0] * towards[1] - ahead[1] * towards[0])
    return math.copysign(1.0, votes)


def _areas(corners: Floats) -> Floats:
    """Areas of polygons of shape (m, k, 2)."""
    x, y = corners[..., 0], corners[..., 1]
    twice: Floats = np.abs((x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1))
    return 0.5 * twice


def _draw_foundation(axes: Axes, line: Floats, side: float, length: float) -> None:
    """A line of shape (k, 2), with short strokes on its right (``side`` 1: the body is on its left) or left (-1)."""
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))))
    if not along[-1] > 0:
        return
    count = int(np.clip(along[-1] / (0.5 * length), 2, 5000))
    at = (np.arange(count) + 0.5) * along[-1] / count
    step = 0.1 * along[-1] / count
    feet, behind, ahead = (
        np.column_stack([np.interp(where, along, line[:, axis]) for axis in (0, 1)])
        for where in (at, at - step, at + step)
    )
    tangent = (ahead - behind) / np.maximum(np.hypot(*(ahead - behind).T), 1e-300)[:, None]
    away = side * np.column_stack((tangent[:, 1], -tangent[:, 0]))
    tips = feet + 0.45 * length * (away - side * tangent)
    strokes = LineCollection(list(np.stack((feet, tips), axis=1)), colors=INK, linewidths=0.5, zorder=4)
    axes.add_collection(strokes, autolim=False)
    axes.plot(*line.T, color=INK, linewidth=1.2, zorder=5, solid_capstyle="round")
