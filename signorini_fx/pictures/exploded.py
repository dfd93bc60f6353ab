"""Bodies in space moved apart, so that the contact faces which they hide from each other can be seen."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from scipy.spatial import cKDTree

from signorini_fx.csv_text import Table
from signorini_fx.pictures import view
from signorini_fx.pictures.fields import FIELDS
from signorini_fx.pictures.foundation import normals_of
from signorini_fx.pictures.solid_body import Skin, show, solid_of, telling_view, tones_of
from signorini_fx.pictures.style import SCREEN, STYLE, Floats, finish
from signorini_fx.tuned import APART_INCHES, BODIES_APART, BODY_OUT, CLOSED_IN_PICTURE, VIEW_FROM_BELOW


def moved_apart(skin: Skin, contact: Table) -> Floats | None:
    """How far each point is moved with its body, length, shape (n, 3); None: no contact hides faces of two bodies.

    Along the mean normal of their contact; out of a closed contact boundary along the direction that it faces least.

    Args:
        skin: of all bodies.
        contact: columns of ``contact.csv``.
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
    for first in sorted(trees, key=lambda body: -len(trees[body])):
        waiting = deque([first] if first not in seen else [])
        seen.add(first)
        while waiting:
            body = waiting.popleft()
            for neighbour, way in steps[body]:
                if neighbour not in seen:
                    shifts[neighbour] = shifts[body] + way
                    seen.add(neighbour)
                    waiting.append(neighbour)
    return np.asarray(shifts[bodies])


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
    shifts = moved_apart(skin, contact)
    if shifts is None:
        return
    apart = replace(skin, points=skin.points + shifts)
    above = telling_view(skin)
    azimuth = float(np.degrees(np.arctan2(above.toward[1], above.toward[0])))
    views = (above, view.oblique(azimuth, VIEW_FROM_BELOW))
    field = FIELDS["von_mises"]
    tones = tones_of(apart, above, field)
    solid = replace(solid_of(apart, tones, 1.0, ()), edges=apart.edges)
    cameras = [view.Camera.on(sight, solid.points) for sight in views]
    inch = APART_INCHES / max(2 * float(camera.half.max()) for camera in cameras)
    widths, heights = (2 * inch * np.array([camera.half[k] for camera in cameras]) for k in (0, 1))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(float(widths.sum()), float(heights.max()) + 1.1), layout="constrained")
        panels = figure.subplots(1, 2, width_ratios=list(map(float, widths)))
        for axes, camera in zip(panels, cameras, strict=True):
            show(axes, solid, camera, inch)
        tones.bar(figure, list(panels))
        remark = "bodies moved apart; left: from above, right: from below"
        finish(figure, path_stem, f"{title}   ({remark})" if title else remark, suffixes)
