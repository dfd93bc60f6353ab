"""The deformed body from load step to load step, as an animation."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from signorini_fx.addons.pictures.body import DrawnBody, Moment
from signorini_fx.addons.pictures.deformed_body import DrawnFoundation, deformed_mesh, magnification
from signorini_fx.addons.pictures.style import Floats
from signorini_fx.tuned import MOTION_MARGIN

if TYPE_CHECKING:
    from signorini_fx.addons.pictures.foundation import FoundationSurface

MOST_FRAMES = 40  # matplotlib takes half a second for each
_MILLISECONDS, _LAST = 300, 1500  # of a frame, and of the last one
_PALE = 248  # red, green and blue of what is taken for white


def shown(count: int) -> list[int]:
    """The load steps that are drawn: all, or every second, third, ..., and the last."""
    stride = ceil(count / MOST_FRAMES)
    return [*range(0, count - 1, stride), count - 1]


def moving_body(
    path: str | Path,
    body: DrawnBody,
    moments: Sequence[Moment],
    *,
    foundation: DrawnFoundation | None = None,
    title: str = "",
) -> None:
    """Write a GIF of the deformed body of the plane, one frame per load step.

    Magnification, colours and frame stay the same.  Where a magnified gap would bend the foundation (see
    ``deformed_mesh``), the contact zone of each load step is marked instead.

    Args:
        path: the file.
        body: of any load step.
        moments: the load steps, in order.
        foundation: None: none is drawn.
        title: what to say above each frame.

    Raises:
        ValueError: there is nothing to draw.
    """
    assert body.outline is not None
    outline = body.outline
    factor, top, places = _alike(body.points, moments, 0.0 if foundation is None else foundation.parted)
    keeps_shape = foundation is not None and foundation.keeps_its_shape(factor, body.points)
    frame = _frame(places, foundation if keeps_shape else None, factor)

    def draw(stem: Path, number: int, caption: str) -> None:
        moment = moments[number]
        ground = None if foundation is None else replace(foundation, touching=moment.touching, shaped=None, lines=())
        deformed_mesh(
            stem,
            body.points,
            body.polygons,
            moment.displacement,
            moment.values,
            outline=outline,
            tiles=body.divided,
            foundation=ground,
            factor=factor,
            top=top,
            frame=frame,
            title=caption,
            suffixes=[".png"],
        )

    _animate(path, moments, draw, title)


def moving_solid(
    path: str | Path,
    body: DrawnBody,
    moments: Sequence[Moment],
    *,
    foundations: Sequence[FoundationSurface] = (),
    title: str = "",
) -> None:
    """Write a GIF of the deformed body in 3D, see ``moving_body``; foundations that a magnified gap would bend are
    left out.
    """
    from signorini_fx.addons.pictures.solid_body import Skin, deformed_solid, telling_view

    factor, top, places = _alike(body.points, moments, body.parted)
    skins = [
        Skin.of(replace(body, displacement=entry.displacement, values={"von_mises": entry.values}), "von_mises")
        for entry in moments
    ]
    shown = [entry for entry in foundations if entry.looks_like_itself(factor, skins[0].size)]
    reach, seen = np.concatenate(places), telling_view(skins[-1])

    def draw(stem: Path, number: int, caption: str) -> None:
        deformed_solid(
            stem,
            skins[number],
            foundations=shown,
            factor=factor,
            top=top,
            reach=reach,
            seen=seen,
            title=caption,
            suffixes=[".png"],
        )

    _animate(path, moments, draw, title)


def _alike(points: Floats, moments: Sequence[Moment], parted: float = 0.0) -> tuple[float, float, list[Floats]]:
    """The magnification (see there) and the end of the scale for all load steps, and the points in all of them."""
    if not moments:
        raise ValueError("there are no load steps")
    furthest = max((moment.displacement for moment in moments), key=lambda y: float(np.abs(y).max(initial=0.0)))
    factor = magnification(points, furthest, parted)
    # Singular corners would leave the rest without colour: the scale ends where a hundredth of the cells is above.
    stresses = np.concatenate([moment.values.ravel() for moment in moments])
    top = float(np.quantile(stresses[np.isfinite(stresses)], 0.99)) or 1.0
    return factor, top, [points, *(points + factor * moment.displacement for moment in moments)]


def _animate(path: str | Path, moments: Sequence[Moment], draw: Callable[[Path, int, str], None], title: str) -> None:
    """Draw all load steps, ``draw(stem, number, title)``, and join them."""
    with tempfile.TemporaryDirectory() as folder:
        pictures = []
        for number, moment in enumerate(moments):
            stem = Path(folder) / f"{number:04d}"
            draw(stem, number, f"{title}\n{moment.name}" if title else moment.name)
            with Image.open(stem.with_suffix(".png")) as picture:
                half = (picture.width // 2, picture.height // 2)
                pictures.append(picture.convert("RGB").resize(half, Image.Resampling.LANCZOS))
        palette = _palette([pictures[0], pictures[len(pictures) // 2], pictures[-1]])
        pictures = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
        durations = [*[_MILLISECONDS] * (len(pictures) - 1), _LAST]
        pictures[0].save(path, save_all=True, append_images=pictures[1:], duration=durations, loop=0, optimize=True)


def _frame(places: Sequence[Floats], foundation: DrawnFoundation | None, factor: float) -> tuple[Floats, Floats]:
    """What is seen in 2D, with a margin; not all of a foundation that runs far away."""
    body = np.concatenate(places)
    low, high = body.min(axis=0), body.max(axis=0)
    around = 0.3 * float(max(high - low))
    ground = body if foundation is None else (foundation.nodes + factor * foundation.offset)[foundation.grounded]
    points = np.concatenate((body, np.clip(ground, low - around, high + around)))
    low, high = points.min(axis=0), points.max(axis=0)
    margin = MOTION_MARGIN * float(max(high - low))
    return low - margin, high + margin


def _palette(pictures: Sequence[Image.Image]) -> Image.Image:
    """One palette for all frames, so that a colour stays the same."""
    together = Image.new("RGB", (pictures[0].width, sum(picture.height for picture in pictures)))
    for number, picture in enumerate(pictures):
        together.paste(picture, (0, number * picture.height))
    palette = together.quantize(colors=256, method=Image.Quantize.MEDIANCUT, kmeans=3)
    # The ground stays white: the mean with a few pale colours would show around the picture.
    colours = np.array(palette.getpalette(), dtype=np.uint8).reshape(-1, 3)
    colours[(colours >= _PALE).all(axis=1)] = 255
    palette.putpalette(colours.tobytes())
    return palette
