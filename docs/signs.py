"""Draw docs/images/signs.svg: gap, normal, pressure, shear and slip with their signs.

./env python3 docs/signs.py
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np

from signorini_fx.addons.pictures.style import STYLE

PICTURE = Path(__file__).resolve().parent / "images" / "signs.svg"
BODY, GROUND, FORCE, MOTION = "#dfe8ef", "#8a8a8a", "#b3372f", "#1f5fa8"
FLOOR = 0.0


def _arrow(
    axes: Any,
    start: tuple[float, float],
    end: tuple[float, float],
    color: str = "k",
    style: str = "-|>",
) -> None:
    shape = {
        "arrowstyle": style,
        "color": color,
        "lw": 1.4,
        "shrinkA": 0,
        "shrinkB": 0,
        "mutation_scale": 11,
    }
    axes.annotate("", end, start, arrowprops=shape)


def _floor(axes: Any) -> None:
    axes.plot([-2.6, 2.6], [FLOOR, FLOOR], color=GROUND, lw=1.5)
    for x in np.arange(-2.5, 2.6, 0.2):
        axes.plot([x, x - 0.13], [FLOOR, FLOOR - 0.16], color=GROUND, lw=0.7)


def _body(axes: Any, low: np.ndarray, x: np.ndarray, label: str) -> None:
    axes.fill(np.r_[x, x[-1], x[0]], np.r_[low, 2.3, 2.3], color=BODY)
    axes.plot(np.r_[x[0], x, x[-1]], np.r_[2.3, low, 2.3], color="k", lw=1.2)
    axes.plot([x[0], x[-1]], [2.3, 2.3], color="k", lw=1.2)
    axes.text(x[0] + 0.12, 2.12, label, va="top", ha="left")


def _before(axes: Any) -> None:
    """The undeformed body: normal, tangent and gap."""
    x = np.linspace(-2.0, 2.0, 81)
    low = 0.62 + 0.09 * x**2
    _body(axes, low, x, "body, undeformed")
    _floor(axes)
    axes.text(2.6, FLOOR - 0.24, "foundation", ha="right", va="top", color="0.35")
    at = 0.62
    axes.plot(0.0, at, "ko", ms=4)
    _arrow(axes, (0.0, at), (0.0, FLOOR), style="<|-|>")
    axes.text(0.08, 0.27, "gap > 0", va="center")
    _arrow(axes, (-0.9, 0.62 + 0.09 * 0.81), (-0.9 - 0.09, 0.2), MOTION)
    axes.text(-1.1, 0.3, "n", ha="right", va="center", color=MOTION)
    _arrow(axes, (0.0, at), (0.75, at), MOTION)
    axes.text(0.82, at - 0.08, "t", va="center", color=MOTION)
    axes.text(0.0, at + 0.14, "point of the\ncontact boundary", ha="center", va="bottom")
    for place in np.linspace(0.6, 1.8, 5):
        _arrow(axes, (place, 2.75), (place, 2.3), FORCE)
    axes.text(0.5, 2.55, "pressure > 0 of [[traction]]", ha="right", va="center", color=FORCE)
    axes.set_title("before: gap along the outward normal n")


def _after(axes: Any) -> None:
    """The body in contact: displacement, pressure and shear."""
    shift = 0.45
    x = np.linspace(-2.0, 2.0, 81)
    low = np.maximum(0.09 * (np.abs(x) - 0.9).clip(0) ** 2, FLOOR)
    axes.plot(x, 0.62 + 0.09 * x**2, color="0.6", lw=0.9, ls="--")
    _body(axes, low, x + shift, "body, deformed")
    _floor(axes)
    axes.plot(0.0, 0.62, "o", ms=4, color="0.6")
    axes.plot(shift, FLOOR, "ko", ms=4)
    _arrow(axes, (0.0, 0.62), (0.0, FLOOR + 0.02), MOTION)
    axes.text(-0.08, 0.36, "u_n = gap", ha="right", va="center", color=MOTION)
    _arrow(axes, (0.0, 0.08), (shift, 0.08), MOTION)
    axes.text(shift + 0.06, 0.14, "u_t > 0", va="bottom", color=MOTION)
    for place in np.linspace(0.75, 1.25, 3):
        _arrow(axes, (place, FLOOR - 0.62), (place, FLOOR), FORCE)
    axes.text(1.35, -0.5, "pressure > 0\non the body", va="center", color=FORCE)
    _arrow(axes, (0.3, -0.36), (-0.55, -0.36), FORCE)
    axes.text(
        -0.65,
        -0.5,
        "shear > 0: the foundation\nholds the body back",
        ha="right",
        va="center",
        color=FORCE,
    )
    axes.set_title("after: what the foundation does to the body")


def main() -> None:
    """Draw both states side by side."""
    mpl.rcParams.update({**STYLE, "svg.fonttype": "none", "svg.hashsalt": "signs", "font.size": 9})
    figure, panels = plt.subplots(1, 2, figsize=(9.4, 3.5), layout="constrained", sharey=True)
    for axes, draw in zip(panels, (_before, _after), strict=True):
        draw(axes)
        axes.set(xlim=(-2.75, 2.85), ylim=(-0.85, 2.85), aspect="equal")
        axes.axis("off")
    figure.savefig(PICTURE, metadata={"Date": None})


if __name__ == "__main__":
    main()
