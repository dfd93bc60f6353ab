"""The style of all pictures, and how they are written; ``with mpl.rc_context(STYLE)`` applies it to
other pictures.

A picture is written as ``stem.png``, unless ``suffixes`` names others: ``.pdf`` for print, which
takes longer than all the rest, or ``.svg`` as in the report.  Pictures are readable in black and
white: line styles and lightness differ as well, and in every field the lighter colour is the larger
value, as in most programs.  Lettering has 9 points in pictures of at most 5 to 7 inches, so that it
can still be read on a telephone, with a width of 9 cm.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from signorini_fx.arrays import Array
from signorini_fx.machine.terminal import printable
from signorini_fx.mechanics.statement.units import bracketed, unit

PNG_DPI = 200
_RASTER_DPI = 300  # of images within a PDF or SVG
SCREEN = (".png",)
INK = "#1a1a1a"
MUTED = "#6b6b6b"
RULE = "#c8c8c8"
TIMES, MINUS = "\N{MULTIPLICATION SIGN}", "\N{MINUS SIGN}"
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
# Perceptually uniform, from dark to light; without the darkest colours, on which neither light nor
# lines would be seen.
VALUES = ListedColormap(mpl.colormaps["viridis"](np.linspace(0.15, 1.0, 256)), name="values")
BLUE, ORANGE = "#0072b2", "#e69f00"
MULTIPLIER: dict[str, Any] = {"color": INK, "linewidth": 1.5}
LIMIT: dict[str, Any] = {"color": MUTED, "linewidth": 1.3, "linestyle": (0, (1, 1.4))}
MOTION: dict[str, Any] = {"color": BLUE, "linewidth": 1.3, "linestyle": (0, (4.5, 1.8))}
# Arrows whose lengths are those of the coordinates.
IN_DATA_UNITS: dict[str, str | float] = {
    "angles": "xy",
    "scale_units": "xy",
    "scale": 1.0,
    "units": "inches",
    "width": 0.018,
}
STYLE: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9,
    "mathtext.fontset": "dejavusans",
    "axes.titlesize": 10,
    "axes.labelsize": 9,
    "axes.edgecolor": MUTED,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.labelcolor": INK,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 3,
    "ytick.major.size": 3,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "legend.handlelength": 2.4,
    "legend.borderaxespad": 0.2,
    "legend.labelspacing": 0.3,
    "pdf.fonttype": 42,
    "svg.hashsalt": "signorini_fx",  # the same data give the same identifiers
    "text.color": INK,
}


def plain(text: str) -> str:
    """Return a user's text for a picture: dollar signs do not begin mathematics, and control
    characters are escaped.
    """
    return printable(text).replace("$", r"\$")


def largest_of(*curves: Array) -> float:
    """Return the largest magnitude of finite entries, 0 if there is none."""
    values = np.abs(np.concatenate(curves))
    return float(values[np.isfinite(values)].max(initial=0.0))


def decimal_power(largest: float) -> int:
    """Return the k for which figures up to ``largest``, times 10^k, need no exponent at an axis."""
    return 0 if largest == 0 or 1e-3 <= largest < 1e4 else -math.floor(math.log10(largest))


def readable(ideal: float) -> float:
    """Return the factor nearest to a positive ideal one that is 1, 2 or 5 times a power of ten."""
    decade = math.floor(math.log10(ideal))
    steps = [m * 10.0**k for k in (decade, decade + 1) for m in (1, 2, 5)]
    return float(f"{min(steps, key=lambda step: abs(math.log(step / ideal))):.0e}")


def visible_factor(points: Array, displacement: Array) -> float:
    """Return the magnification that shows the largest displacement as a tenth of the longest side
    of the body, at least 1.
    """
    largest = float(np.linalg.norm(displacement, axis=1).max(initial=0.0))
    wanted = 0.1 * float(np.ptp(points, axis=0).max()) / largest if largest > 0 else 1.0
    return float(f"{wanted:.1g}") if wanted > 1 else 1.0


def unit_of(power: int, quantity: str = "") -> str:
    """Return the unit in the label of an axis whose figures were multiplied by 10^power, such as ``
    (unit 10⁻⁴ m)``.

    A factor behind the name, as in "force x 10^4", could be read in either direction.

    Args:
        power: the power of ten.
        quantity: its quantity, for the unit, see ``signorini_fx.mechanics.statement.units``.
    """
    if not power:
        return plain(bracketed(quantity))
    return f" (unit {f'{_power_of_ten(-power)} {plain(unit(quantity))}'.rstrip()})"


def number(value: float) -> str:
    """Return a factor as text: in digits if they are few, otherwise as m x 10^k."""
    if value == 0 or 0.01 <= abs(value) < 1e5:
        return f"{value:.6g}".replace("-", MINUS)
    digits, power = f"{value:.5e}".split("e")
    digits = f"{float(digits):g}".replace("-", MINUS)
    return (
        _power_of_ten(int(power))
        if digits == "1"
        else f"{digits}\N{MIDDLE DOT}{_power_of_ten(int(power))}"
    )


def _power_of_ten(power: int) -> str:
    """Return a power of ten in raised digits: setting the first formula takes matplotlib a tenth of
    a second.
    """
    return "10" + str(power).translate(_RAISED)


def _entitle(figure: Figure, title: str) -> None:
    """Write the title at the top left; a title wider than the figure is broken into lines, with the
    remark on its own line.
    """
    text = figure.suptitle(title, x=0.012, ha="left", fontsize=10)
    room = 0.976 * figure.bbox.width
    if text.get_window_extent().width <= room:
        return
    headline, *remark = title.split("   (", 1)
    text.set_text(headline)
    letters = int(
        len(headline) * room / text.get_window_extent().width
    )  # a user's text, without mathematics
    lines = [
        line for part in headline.split("\n") for line in textwrap.wrap(part, max(letters, 10))
    ]
    text.set_text("\n".join([*lines, *(f"({part}" for part in remark)]))


@mpl.rc_context(STYLE)
def finish(
    figure: Figure, path_stem: str | Path, title: str, suffixes: Sequence[str] = SCREEN
) -> None:
    """Add the title to a figure and write it, without dates, so that the same data give the same
    files.

    Args:
        figure: the figure.
        path_stem: where to write, without suffix.
        title: the title; "" for none.
        suffixes: suffixes of the files to write.
    """
    stem = Path(path_stem)
    stem.parent.mkdir(parents=True, exist_ok=True)
    of_kind: dict[str, dict[str, Any]] = {
        ".png": {"pil_kwargs": {"compress_level": 1}},  # in half the time, up to a third larger
        ".pdf": {"metadata": {"CreationDate": None}},
        ".svg": {"metadata": {"Date": None}},
    }
    figure.set_dpi(PNG_DPI)
    if title:
        _entitle(figure, title)
    if layout := figure.get_layout_engine():  # once: matplotlib would draw everything twice
        layout.execute(figure)
        figure.set_layout_engine(None)
    for suffix in suffixes:
        dpi = PNG_DPI if suffix == ".png" else _RASTER_DPI
        figure.savefig(stem.with_name(f"{stem.name}{suffix}"), dpi=dpi, **of_kind[suffix])
