"""What a parameter of a scene changes: forces, pressure, areas and energy against its values."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from signorini_fx.addons.pictures.style import MOTION, MULTIPLIER, ORANGE, PRINT, STYLE, finish, plain, unit_of

# One panel each: what stands at the axis, the quantity whose unit it has, and columns with their labels.
_PANELS = (
    ("size of the force", "force", {"contact_force": "of the contact", "friction_force": "of the friction"}),
    ("largest stress", "stress", {"max_pressure": "pressure", "max_shear": "shear"}),
    ("contact zone", "area", {"contact_area": "in contact", "stick_area": "that sticks"}),
    ("strain energy", "energy", {"strain_energy": ""}),
)


def draw(path_stem: str | Path, parameter: str, rows: Sequence[Mapping[str, Any]], title: str = "") -> None:
    """Draw a study.

    Args:
        path_stem: where to write, without suffix.
        parameter: the path of the entry.
        rows: those of sweep.csv.
        title: above the picture.
    """
    values = [row["value"] for row in rows]
    without = [row["value"] for row in rows if math.isnan(row["contact_force"])]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.0, 4.8), layout="constrained")
        for axes, (name, quantity, columns) in zip(figure.subplots(2, 2, sharex=True).flat, _PANELS, strict=True):
            for (column, label), style in zip(columns.items(), (MULTIPLIER, MOTION), strict=False):
                axes.plot(values, [row[column] for row in rows], marker="o", markersize=3, label=label, **style)
            axes.set_ylabel(f"{name}{unit_of(0, quantity)}")
            axes.set_ylim(0.0, 1.06 * axes.get_ylim()[1])
            if without:
                at_the_foot = axes.get_xaxis_transform()
                once = "no solution" if len(columns) == 1 else None  # where there is room
                axes.plot(without, [0.03] * len(without), "x", color=ORANGE, transform=at_the_foot, label=once)
            if len(columns) > 1 or without:
                axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
        figure.supxlabel(plain(parameter), fontsize="medium")
        finish(figure, path_stem, plain(title), PRINT)
