"""The deformed body from load step to load step, as an animation."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from signorini_fx.report.deformed_body import Foundation, deformed_mesh, magnification
from signorini_fx.report.style import Floats
from signorini_fx.report.tiling import Tiling

if TYPE_CHECKING:
    from signorini_fx.report.solid_foundation import FoundationSurface

MOST_FRAMES = 40  # matplotlib takes half a second for each
_MILLISECONDS, _LAST = 300, 1500  # of a frame, and of the last one
_MARGIN = 0.04
_PALE = 248  # red, green and blue of what is taken for white


@dataclass(frozen=True)
class Moment:
    """The body at a load step.

    Attributes:
        name: of the load step.
        displacement: at the points, length, shape (n, d).
        values: von Mises stress of each cell, in space of each facet, shape (m,); or at its points, shape (m, p).
        touching: the nodes of ``Foundation`` in contact, shape (k,); None: without contact, or in space.
    """

    name: str
    displacement: Floats
    values: Floats
    touching: npt.NDArray[np.bool_] | None = None


def shown(count: int) -> list[int]:
    """The load steps that are drawn: all, or every second, third, ..., and the last."""
    stride = ceil(count / MOST_FRAMES)
    return [*range(0, count - 1, stride), count - 1]


def moving_body(
    path: str | Path,
    points: Floats,
    cells: npt.NDArray[np.int64],
    moments: Sequence[Moment],
    *,
    tiles: Tiling | None = None,
    outline: npt.NDArray[np.int64] | None = None,
    foundation: Foundation | None = None,
    foundations: Sequence[FoundationSurface] = (),
    title: str = "",
) -> None:
    """Write a GIF of the deformed body, one frame per load step; magnification, colours and frame stay the same.

    Foundations that a magnified gap would bend are left out.

    Args:
        path: the file.
        points: positions, length, shape (n, d).
        cells: the cells of a body of the plane, see ``deformed_mesh``, or the facets of one in space, see
            ``deformed_solid``.
        moments: the load steps, in order.
        tiles: how each cell or facet is divided; None: it has one value.
        outline: of a body of the plane, see ``deformed_mesh``.
        foundation: of a body of the plane; where the magnified gap would bend it (see ``deformed_mesh``) the contact
            zone of each load step is marked instead.
        foundations: of a body in space.
        title: what to say above each frame.

    Raises:
        ValueError: there is nothing to draw.
    """
    if not moments:
        raise ValueError("there are no load steps")
    furthest = max((moment.displacement for moment in moments), key=lambda y: float(np.abs(y).max(initial=0.0)))
    factor = magnification(points, furthest)
    # Singular corners would leave the rest without colour: the scale ends where a hundredth of the cells is above.
    stresses = np.concatenate([moment.values.ravel() for moment in moments])
    top = float(np.quantile(stresses[np.isfinite(stresses)], 0.99)) or 1.0
    places = [points, *(points + factor * moment.displacement for moment in moments)]
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    how: dict[str, Any] = {"tiles": tiles, "factor": factor, "top": top, "suffixes": [".png"]}
    if outline is not None:
        shown_whole = foundation is not None and foundation.keeps_its_shape(factor, points)
        how |= {"outline": outline, "frame": _frame(places, foundation if shown_whole else None, factor)}
    else:
        from signorini_fx.report.solid_body import deformed_solid, frame_of, telling_view

        foundations = [one for one in foundations if one.looks_like_itself(factor, size)]
        seen = telling_view(points, cells, moments[-1].values, tiles)
        how |= {"foundations": foundations, "seen": seen, "frame": frame_of(seen, places, foundations, factor)}
    draw = deformed_mesh if outline is not None else deformed_solid
    with tempfile.TemporaryDirectory() as folder:
        pictures = []
        for number, moment in enumerate(moments):
            stem = Path(folder) / f"{number:04d}"
            said = f"{title}\n{moment.name}" if title else moment.name
            if foundation is not None:
                how["foundation"] = replace(foundation, touching=moment.touching)
            draw(stem, points, cells, moment.displacement, moment.values, title=said, **how)
            with Image.open(stem.with_suffix(".png")) as picture:
                half = (picture.width // 2, picture.height // 2)
                pictures.append(picture.convert("RGB").resize(half, Image.Resampling.LANCZOS))
        palette = _palette([pictures[0], pictures[len(pictures) // 2], pictures[-1]])
        pictures = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
        durations = [*[_MILLISECONDS] * (len(pictures) - 1), _LAST]
        pictures[0].save(path, save_all=True, append_images=pictures[1:], duration=durations, loop=0, optimize=True)


def _frame(places: Sequence[Floats], foundation: Foundation | None, factor: float) -> tuple[Floats, Floats]:
    """What is seen in the plane, with a margin; not all of a foundation that runs far away."""
    body = np.concatenate(places)
    low, high = body.min(axis=0), body.max(axis=0)
    around = 0.3 * float(max(high - low))
    ground = body if foundation is None else foundation.nodes + factor * foundation.offset
    every = np.concatenate((body, np.clip(ground, low - around, high + around)))
    low, high = every.min(axis=0), every.max(axis=0)
    margin = _MARGIN * float(max(high - low))
    return low - margin, high + margin


def _palette(pictures: Sequence[Image.Image]) -> Image.Image:
    """One palette for all frames, so that a colour stays the same."""
    together = Image.new("RGB", (pictures[0].width, sum(picture.height for picture in pictures)))
    for number, picture in enumerate(pictures):
        together.paste(picture, (0, number * picture.height))
    found = together.quantize(colors=256, method=Image.Quantize.MEDIANCUT, kmeans=3)
    # The ground stays white: the mean with a few pale colours would show around the picture.
    colours = np.array(found.getpalette(), dtype=np.uint8).reshape(-1, 3)
    colours[(colours >= _PALE).all(axis=1)] = 255
    found.putpalette(colours.tobytes())
    return found
