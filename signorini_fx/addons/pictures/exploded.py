"""Bodies in 3D moved apart, so that the contact faces which they hide from each other can be seen."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from scipy.spatial import cKDTree

from signorini_fx.addons.pictures import view
from signorini_fx.addons.pictures.fields import FIELDS
from signorini_fx.addons.pictures.foundation import normals_of
from signorini_fx.addons.pictures.solid_body import Skin, show, solid_of, telling_view, tones_of
from signorini_fx.addons.pictures.style import SCREEN, STYLE, Floats, finish
from signorini_fx.machine.csv_text import Table
from signorini_fx.tuned import (
    APART_INCHES,
    APART_TIMES,
    BODIES_APART,
    BODY_OUT,
    CLOSED_IN_PICTURE,
    NARROWEST,
    VIEW_FROM_BELOW,
)

_LINES = 24  # directions of lines that may separate two bodies in a picture


def moved_apart(skin: Skin, contact: Table, views: Sequence[view.View] = ()) -> Floats | None:
    """How far each point is moved with its body, length, shape (n, 3); None: no contact hides faces of two bodies.

    Along the mean normal of their contact; out of a closed contact boundary along the direction that it faces least.
    The first of some distances at which a body covers fewest others.

    Args:
        skin: of all bodies.
        contact: columns of ``contact.csv``.
        views: from which no body should cover another one.
    """
    if skin.pieces is None:
        return None
    normals = np.zeros_like(skin.points)
    of_triangles = normals_of(skin.points, skin.triangles)
    for corner in skin.triangles.T:
        np.add.at(normals, corner, of_triangles)
    names_of_pieces, bodies = np.unique(skin.pieces, return_inverse=True)
    trees = {body: np.flatnonzero(bodies == body) for body in range(len(names_of_pieces))}
    nearest = {body: cKDTree(skin.points[rows]) for body, rows in trees.items()}
    steps: dict[int, list[tuple[int, Floats]]] = {body: [] for body in trees}
    names, against = (np.asarray(contact[key]).astype(str) for key in ("boundary", "against"))
    for name in dict.fromkeys(names[against != ""]):
        rows = names == name
        x, n = (np.column_stack([contact[f"{prefix}{axis}"] for axis in "xyz"])[rows] for prefix in ("", "n_"))
        weight = np.asarray(contact["weight"], dtype=np.float64)[rows]
        distances: dict[bool, dict[int, float]] = {True: {}, False: {}}
        for body, tree in nearest.items():
            away, nearest_rows = tree.query(x)
            same_way = np.einsum("nd,nd->n", normals[trees[body][nearest_rows]], n) > 0
            for side in (True, False):  # that of the points, and the other one
                far = np.where(same_way == side, away, np.inf)
                reached = np.isfinite(far)
                distances[side][body] = float(far[reached].mean()) / reached.mean() if reached.any() else np.inf
        slave = min(distances[True], key=distances[True].__getitem__)
        candidates = {body: far for body, far in distances[False].items() if body != slave and np.isfinite(far)}
        if not candidates:
            continue
        master = min(candidates, key=candidates.__getitem__)
        mean = weight @ n / weight.sum()
        if np.linalg.norm(mean) > CLOSED_IN_PICTURE:
            way = -mean / np.linalg.norm(mean) * BODIES_APART * float(np.linalg.norm(np.ptp(x, axis=0)))
        else:
            axis = np.linalg.eigh((weight[:, None] * n).T @ n)[1][:, 0]
            axis = axis * np.sign(axis[np.argmax(np.abs(axis))])
            heights = skin.points[np.isin(bodies, (slave, master))] @ axis
            way = axis * BODY_OUT * float(np.ptp(heights))
        steps[slave].append((master, -way))
        steps[master].append((slave, way))
    if not any(steps.values()):
        return None
    shifts, seen = np.zeros((len(trees), 3)), set[int]()
    outlines = {body: _extents(skin.points[rows], views) for body, rows in trees.items()}

    def covered(body: int, shift: Floats) -> int:
        """How many bodies that have their places no straight line separates from one with this shift in some view."""
        low, high = outlines[body] + _extents(shift[None], views)
        places = ((outlines[other] + _extents(shifts[None, other], views)) for other in seen)
        return sum(int(((low < top) & (bottom < high)).all(axis=1).sum()) for bottom, top in places)

    for first in sorted(trees, key=lambda body: -len(trees[body])):
        waiting = deque([first] if first not in seen else [])
        seen.add(first)
        while waiting:
            body = waiting.popleft()
            for neighbour, way in steps[body]:
                if neighbour not in seen:
                    farther = [shifts[body] + times * way for times in APART_TIMES]
                    shifts[neighbour] = min(farther, key=partial(covered, neighbour))  # the first of equal ones
                    seen.add(neighbour)
                    waiting.append(neighbour)
    return np.asarray(shifts[bodies])


def _extents(points: Floats, views: Sequence[view.View]) -> Floats:
    """Lowest and highest coordinates of points of shape (n, 3) across lines in pictures, shape (2, views, lines)."""
    angles = np.linspace(0.0, np.pi, _LINES, endpoint=False)
    across = np.stack((np.cos(angles), np.sin(angles)))
    heights = [sight.flat(points) @ across for sight in views]
    ends = [[height.min(axis=0) for height in heights], [height.max(axis=0) for height in heights]]
    return np.array(ends).reshape(2, len(views), _LINES)


def exploded(
    path_stem: str | Path, skin: Skin, contact: Table, *, title: str = "", suffixes: Sequence[str] = SCREEN
) -> None:
    """Draw deformed bodies in contact moved apart, seen from above and from below; nothing where none hides another.

    Args:
        path_stem: where to write, without suffix.
        skin: of all bodies, with the von Mises stress.
        contact: columns of ``contact.csv``.
        title: title of the picture.
        suffixes: of the files to write.

    Raises:
        PictureError: PyVista is missing.
    """
    above = telling_view(skin)
    azimuth = float(np.degrees(np.arctan2(above.toward[1], above.toward[0])))
    views = (above, view.oblique(azimuth, VIEW_FROM_BELOW))
    shifts = moved_apart(skin, contact, views)
    if shifts is None:
        return
    apart = replace(skin, points=skin.points + shifts)
    field = FIELDS["von_mises"]
    tones = tones_of(apart, above, field)
    solid = replace(solid_of(apart, tones, 1.0, ()), edges=apart.edges)
    cameras = [view.Camera.on(sight, solid.points) for sight in views]
    inch = APART_INCHES / max(2 * float(camera.half.max()) for camera in cameras)
    widths, heights = (2 * inch * np.array([camera.half[k] for camera in cameras]) for k in (0, 1))
    with mpl.rc_context(STYLE):
        size = (max(float(widths.sum()), NARROWEST), float(heights.max()) + 1.1)
        figure = Figure(figsize=size, layout="constrained")
        panels = figure.subplots(1, 2, width_ratios=list(map(float, widths)))
        for axes, camera in zip(panels, cameras, strict=True):
            show(axes, solid, camera, inch)
        tones.bar(figure, list(panels))
        remark = "moved apart, from above and from below"
        finish(figure, path_stem, f"{title}   ({remark})" if title else remark, suffixes)
