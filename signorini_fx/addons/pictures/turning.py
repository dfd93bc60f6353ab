"""A body in 3D as data for the page on which it can be turned; it needs no other program."""

from __future__ import annotations

import json
import math
from base64 import b64encode
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.addons.pictures import view
from signorini_fx.addons.pictures.fields import FIELDS, Field
from signorini_fx.addons.pictures.foundation import FoundationSurface
from signorini_fx.addons.pictures.marks import Largest
from signorini_fx.addons.pictures.solid_body import Skin, tones_of
from signorini_fx.mechanics.statement.units import bracketed, unit

Floats = npt.NDArray[np.float64]


def write_turning(
    file: Path,
    skin: Skin,
    foundations: Sequence[FoundationSurface],
    seen: view.View,
    field: Field = FIELDS["von_mises"],
    largest: Largest | None = None,
) -> None:
    """Write the surface of a body with a field, its displacement, and the foundations.

    Args:
        file: JSON; arrays are written as the bytes of 32-bit numbers, little end first, in base64.
        skin: the body.
        foundations: of each contact boundary.
        seen: the view at first.
        field: what is drawn.
        largest: what is marked; None: nothing.
    """
    factor = skin.factor
    tones = tones_of(skin, seen, field)
    pairs = np.column_stack((skin.triangles.ravel(), np.nan_to_num(skin.values.astype(np.float32)).ravel()))
    distinct, corner = np.unique(pairs, axis=0, return_inverse=True)  # where the field jumps, a point for each value
    row = distinct[:, 0].astype(np.int64)
    first = np.searchsorted(distinct[:, 0], np.arange(len(skin.points)))
    moved = np.nan_to_num(skin.displacement)
    body = _part(skin.points[row], moved[row], distinct[:, 1], corner.reshape(-1, 3), first[skin.edges])
    grounds = []
    for foundation in foundations:
        points, motion, polygons = foundation.moving()
        k = np.arange(1, polygons.shape[1] - 1)
        first_ones = np.broadcast_to(polygons[:, :1], polygons[:, k].shape)
        fan = np.stack((first_ones, polygons[:, k], polygons[:, k + 1]), axis=2)
        grounds.append(_part(points, motion, np.zeros(len(points)), fan, view.outline(points, polygons)))
    x, y, z = seen.toward
    data = {
        "body": body,
        "grounds": grounds,
        "colours": _packed((256 * tones.colours(np.arange(256))[:, :3]).clip(0, 255), np.uint8),
        "limits": [float(tones.low), float(tones.high)],
        "label": f"{tones.field.label}{bracketed(tones.field.quantity)}",
        "largest": None if largest is None else _marked(skin, largest),
        "unit": unit("length"),
        "factor": factor,
        "bends": not all(foundation.looks_like_itself(factor, skin.size) for foundation in foundations),
        "low": skin.points.min(axis=0).tolist(),
        "high": skin.points.max(axis=0).tolist(),
        "azimuth": math.degrees(math.atan2(y, x)),
        "lift": math.degrees(math.asin(z)),
    }
    file.write_text(json.dumps(data, separators=(",", ":"), allow_nan=False) + "\n", encoding="utf-8")


def _marked(skin: Skin, largest: Largest) -> dict[str, Any]:
    """Where the field is largest, how that point moves, and the value."""
    moved = np.nan_to_num(skin.displacement[largest.nearest(skin.points)])
    return {"point": largest.place.tolist(), "motion": moved.tolist(), "value": largest.text}


def _part(points: Floats, motion: Floats, values: Floats, triangles: Any, lines: Any) -> dict[str, str]:
    arrays = {"points": points, "motion": motion, "values": values}
    rows = {"triangles": triangles, "lines": lines}
    return {name: _packed(array, "<f4") for name, array in arrays.items()} | {
        name: _packed(array, "<u4") for name, array in rows.items()
    }


def _packed(array: npt.NDArray[Any], kind: Any) -> str:
    return b64encode(np.ascontiguousarray(array).astype(kind).tobytes()).decode("ascii")
