"""Figures 2 to 9 of the paper, one function each; figure 1 shows no result.

Multipliers are solid, foundation and bounds dotted, displacements dashed, all in the paper's scales.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from signorini_fx.addons.picture_data.body_cells import gather_cells
from signorini_fx.addons.pictures.deformed_body import DrawnFoundation, deformed_mesh
from signorini_fx.addons.pictures.fields import FIELDS
from signorini_fx.addons.pictures.style import PRINT
from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.results.solution import Solution

from . import laboratory as lab
from .report import Entry, Picture, Table, power
from .scenes import coulomb, example1, example2, tresca

_GRAYS = LinearSegmentedColormap.from_list("shear energy", ["#ffffff", "#0d0d0d"])
_STYLE: dict[str, Any] = {
    "font.size": 8,
    "mathtext.fontset": "dejavusans",
    "axes.titlesize": 8.5,
    "axes.labelsize": 8,
    "axes.linewidth": 0.6,
    "axes.edgecolor": "#6b6b6b",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.xmargin": 0.0,
    "xtick.color": "#6b6b6b",
    "ytick.color": "#6b6b6b",
    "xtick.labelcolor": "#1a1a1a",
    "ytick.labelcolor": "#1a1a1a",
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "legend.handlelength": 2.6,
    "pdf.fonttype": 42,
}
_INK, _MUTED, _BLUE = "#1a1a1a", "#6b6b6b", "#0072b2"
SOLID: dict[str, Any] = {"color": _INK, "linewidth": 1.4, "zorder": 3}
DOTTED: dict[str, Any] = {"color": _MUTED, "linewidth": 1.4, "linestyle": (0, (1, 1.3)), "zorder": 2}
DASHED: dict[str, Any] = {"color": _BLUE, "linewidth": 1.4, "linestyle": (0, (4.5, 1.8)), "zorder": 4}
# What the paper multiplies displacements and distances with, for each example.
SCALE1, SCALE2 = 1e4, 5e3


def figure2(folder: Path) -> Picture:
    """Example 1, Tresca friction: deformed mesh."""
    _deformed(folder / "figure2", lab.solved(example1(tresca(1.5))))
    return Picture(
        "figure2",
        "Figure 2: example 1, deformed mesh",
        "Displacement and distance to the foundation are multiplied by 20; gray tones: elastic shear energy density.  "
        "nu = 0.4, g = 1.5, gamma_1 = gamma_2 = 1e8.",
    )


def figure3(folder: Path) -> Picture:
    """Example 1, Tresca friction: curves along the contact boundary."""
    solution = lab.solved(example1(tresca(1.5)))
    table = lab.table_of(solution)
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(7.2, 3.0), layout="constrained")
        left, right = figure.subplots(1, 2)
        _tangential(left, table, SCALE1)
        _normal(right, table, SCALE1)
        _legends_above(left, right)
        _save(figure, folder / "figure3")
    stick = table.zones((table.columns["friction"] == "stick") & (table.columns["state"] == "open"))
    shown = ", ".join(f"[{a[0]:g}, {b[0]:g}]" for a, b in stick)
    return Picture(
        "figure3",
        "Figure 3: example 1, given friction",
        "Left: shear stress mu with its bounds and the tangential displacement.  Right: contact pressure lambda, rigid "
        "foundation and normal displacement.  Displacements and foundation are multiplied by 1e4.  nu = 0.4, g = 1.5, "
        "gamma_1 = gamma_2 = 1e8.",
        [f"The body sticks without being in contact on {shown}: what the paper remarks on [0, 0.3]."],
    )


def figure4(folder: Path) -> Picture:
    """Example 1, Coulomb friction: curves, and the inner iterations of (ALM-FP)."""
    gammas = (1e6, 1e7, 1e8, 1e9)
    counts = {g: lab.solves_per_problem(lab.solved(example1(coulomb(0.3), gamma=g, algorithm="alm"))) for g in gammas}
    slow = lab.solves_per_problem(lab.solved(example1(coulomb(0.3), gamma=1e5, algorithm="alm")))
    table = lab.table_of(lab.solved(example1(coulomb(0.3), algorithm="alm")))
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(7.2, 3.0), layout="constrained")
        left, right = figure.subplots(1, 2)
        _normal(left, table, SCALE1)
        _tangential(right, table, SCALE1, coefficient=0.3)
        _legends_above(left, right)
        _save(figure, folder / "figure4")
    longest = max(map(len, counts.values()))
    rows = [
        [str(m) if m else "start", *(Entry(found[m]) if m < len(found) else "" for found in counts.values())]
        for m in range(longest)
    ]
    inner = Table(
        "figure4_iterations",
        "Figure 4: inner iterations of (ALM-FP)",
        ["m \\ gamma", *map(power, gammas)],
        rows,
        "Linear solves in outer iteration m, F = 0.3; 'start' is the pure contact problem.",
        [
            "The numbers of the paper's table are part of its figure and not at hand.",
            f"For gamma = 1e5 it takes {len(slow) - 1} outer iterations with {sum(slow[1:])} linear solves: the "
            "smaller gamma, the slower the update of the multipliers.",
        ],
        {"figure4": {**{power(g): found for g, found in counts.items()}, "1e5": slow}},
    )
    return Picture(
        "figure4",
        "Figure 4: example 1, Coulomb friction with F = 0.3",
        "Left: contact pressure lambda, rigid foundation and normal displacement.  Right: shear stress mu with its "
        "bounds +-0.3 lambda and the tangential displacement.  Displacements and foundation are multiplied by 1e4.  "
        "nu = 0.4; the curves do not depend on gamma.",
        tables=[inner],
    )


def figure5(folder: Path) -> Picture:
    """Example 1, Coulomb friction with two other coefficients."""
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(7.2, 3.0), layout="constrained")
        panels = figure.subplots(1, 2)
        for axes, coefficient in zip(panels, (0.1, 1.0), strict=True):
            solution = lab.solved(example1(coulomb(coefficient), algorithm="alm"))
            _tangential(axes, lab.table_of(solution), SCALE1, coefficient=coefficient)
            axes.set_title(rf"$\mathfrak{{F}}={coefficient:g}$")
        _legend_below(figure, panels[0])
        _save(figure, folder / "figure5")
    return Picture(
        "figure5",
        "Figure 5: example 1, Coulomb friction with F = 0.1 and F = 1",
        "Shear stress mu with its bounds +-F lambda and the tangential displacement, multiplied by 1e4; (ALM-FP), nu "
        "= 0.4.",
    )


def figure6(folder: Path) -> Picture:
    """Example 2, Tresca friction: deformed mesh."""
    _deformed(folder / "figure6", lab.solved(example2(tresca(1.0))))
    return Picture(
        "figure6",
        "Figure 6: example 2, deformed mesh",
        "Displacement and distance to the foundation are multiplied by 20 (the paper does not give its factor); gray "
        "tones: elastic shear energy density.  g = 1, gamma_1 = gamma_2 = 1e8.",
        [
            "The stress is concentrated at (0, 0.2) and (3, 0.2), where the prescribed displacement begins, and less "
            "beside the kinks of the foundation, as the paper says."
        ],
    )


def figure7(folder: Path) -> Picture:
    """Example 2, Tresca friction: curves along the contact boundary."""
    solution = lab.solved(example2(tresca(1.0)))
    table = lab.table_of(solution)
    first, second = lab.zones(solution).contact
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(9.6, 3.0), layout="constrained")
        left, middle, right = figure.subplots(1, 3)
        _normal(left, table, SCALE2)
        _normal(middle, table, SCALE2)
        _magnify(middle, [table])
        middle.axvspan(first[1], second[0], color="#ececec", linewidth=0, zorder=0)
        middle.annotate(r"$\lambda=0$", (1.5, 0.97), xycoords=("data", "axes fraction"), ha="center", va="top")
        _tangential(right, table, SCALE2)
        _legends_above(left, right)
        middle.set_title("magnified", loc="left", fontsize=8)
        _save(figure, folder / "figure7")
    return Picture(
        "figure7",
        "Figure 7: example 2, given friction g = 1",
        "Left: contact pressure lambda, rigid foundation and normal displacement; middle: the same, magnified "
        "between the kinks of the foundation.  Right: shear stress mu with its bounds and the tangential "
        "displacement.  Displacements and foundation are multiplied by 5000.  gamma_1 = gamma_2 = 1e8.",
        [
            "Between the kinks the body lifts off the foundation, and lambda is zero there, as in the paper; but "
            f"ours is in contact up to {first[1]:g} and from {second[0]:g} on, where the paper says that it is not in "
            "contact in [1.3, 1.7].  See the study of the zones: [1.3, 1.7] is what we find for g = 0."
        ],
    )


def figure8(folder: Path) -> Picture:
    """Example 2: the influence of given friction."""
    bounds = (0.0, 1.0, 5.0)
    tables = [lab.table_of(lab.solved(example2(tresca(bound)))) for bound in bounds]
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(11.0, 2.9), layout="constrained")
        panels = figure.subplots(1, 4)
        for axes, table, bound in zip(panels, tables, bounds, strict=False):
            _normal(axes, table, SCALE2)
            axes.set_title(rf"$g={bound:g}$" if bound else "pure contact, $g=0$")
            axes.set_ylim(-1.5, 40)
        last = panels[3]
        x, d = tables[0].columns["x"], SCALE2 * tables[0].columns["gap"]
        last.plot(x, d, **DOTTED)
        for table, bound, width in zip(tables, bounds, (0.9, 1.4, 2.0), strict=True):
            u_n = SCALE2 * table.columns["u_n"]
            last.plot(x, u_n, **{**DASHED, "linewidth": width})
            lifted = u_n.min() < d.min()
            style: dict[str, Any] = {"xytext": (0, -3 if lifted else 3), "va": "top" if lifted else "bottom"}
            last.annotate(f"$g={bound:g}$", (1.5, u_n.min()), textcoords="offset points", ha="center", **style)
        _magnify(last, tables)
        last.set(title="magnified", xlabel="$x_1$")
        _legend_below(figure, panels[0])
        _save(figure, folder / "figure8")
    return Picture(
        "figure8",
        "Figure 8: example 2, the influence of given friction",
        "Contact pressure lambda, rigid foundation and normal displacement (both multiplied by 5000) for the pure "
        "contact problem and for g = 1 and g = 5; at the right the normal displacements of all three between the "
        "kinks of the foundation, magnified.  gamma_1 = gamma_2 = 1e8.",
        ["The more friction, the less the middle lifts off: for g = 5 it stays in contact."],
    )


def figure9(folder: Path) -> Picture:
    """Example 2, Coulomb friction."""
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(9.6, 5.2), layout="constrained")
        panels = figure.subplots(2, 3, sharex=True)
        for (upper, lower), coefficient in zip(panels.T, (2.0, 5.0, 10.0), strict=True):
            table = lab.table_of(lab.solved(example2(coulomb(coefficient), algorithm="alm")))
            _normal(upper, table, SCALE2)
            upper.set(title=rf"$\mathfrak{{F}}={coefficient:g}$", ylim=(-1.5, 40), xlabel="")
            _tangential(lower, table, SCALE2, coefficient=coefficient)
        _legend_below(figure, panels[0, 0], panels[1, 0])
        _save(figure, folder / "figure9")
    return Picture(
        "figure9",
        "Figure 9: example 2, Coulomb friction with F = 2, 5 and 10",
        "Upper row: contact pressure lambda, rigid foundation and normal displacement.  Lower row: shear stress mu "
        "with its bounds +-F lambda and the tangential displacement.  Displacements and foundation are multiplied by "
        "5000; (ALM-FP).",
        [
            "The body is in contact in [1.4, 1.6] for all three coefficients, where the paper says it is for F = 2 "
            "only; see the study of the zones."
        ],
    )


FIGURES: dict[int, Callable[[Path], Picture]] = {
    2: figure2,
    3: figure3,
    4: figure4,
    5: figure5,
    6: figure6,
    7: figure7,
    8: figure8,
    9: figure9,
}


def _normal(axes: Axes, table: ContactTable, factor: float) -> None:
    """Contact pressure, foundation and normal displacement."""
    c = table.columns
    times = _times(factor)
    axes.plot(c["x"], c["pressure"], **SOLID, label=r"$\lambda$")
    axes.plot(c["x"], factor * c["gap"], **DOTTED, label=f"foundation ${times}d$")
    axes.plot(c["x"], factor * c["u_n"], **DASHED, label=rf"${times}\tau_N\,\mathbf{{y}}$")
    _finish(axes)


def _tangential(axes: Axes, table: ContactTable, factor: float, coefficient: float | None = None) -> None:
    """Shear stress, its bounds and the tangential displacement; Coulomb friction names its coefficient."""
    c = table.columns
    bound = r"$\pm\,g$" if coefficient is None else r"$\pm\,\mathfrak{F}\lambda$"
    axes.plot(c["x"], c["shear"], **SOLID, label=r"$\mu$")
    axes.plot(c["x"], c["bound"], **DOTTED, label=f"bounds {bound}")
    axes.plot(c["x"], -c["bound"], **DOTTED)
    axes.plot(c["x"], factor * c["u_t"], **DASHED, label=rf"${_times(factor)}\tau_T\,\mathbf{{y}}$")
    _finish(axes)


def _finish(axes: Axes) -> None:
    axes.axhline(0.0, color="#c8c8c8", linewidth=0.6, zorder=0)
    axes.set_xlabel("$x_1$")
    axes.locator_params(axis="x", nbins=7)


def _magnify(axes: Axes, tables: Sequence[ContactTable]) -> None:
    """Look at the flat part of the foundation, as closely as what happens there needs."""
    x, gap = tables[0].columns["x"], tables[0].columns["gap"]
    flat = gap < gap.min() * (1 + 1e-9)
    low, level = x[flat].min(), SCALE2 * gap.min()
    depth = max(level - SCALE2 * float(table.columns["u_n"][flat].min()) for table in tables)
    axes.set(xlim=(low - 0.05, x[flat].max() + 0.05), ylim=(level - 1.6 * depth, level + 0.9 * depth))
    axes.ticklabel_format(axis="y", useOffset=False)
    axes.locator_params(axis="y", nbins=6)


def _times(factor: float) -> str:
    """A factor in front of a symbol: what is drawn is their product."""
    exponent = int(np.floor(np.log10(factor)))
    digit = round(factor / 10**exponent)
    return rf"10^{exponent}\," if digit == 1 else rf"{digit}\cdot 10^{exponent}\,"


def _legends_above(*panels: Axes) -> None:
    """For each panel a legend of its own above it."""
    for axes in panels:
        axes.legend(
            loc="lower left", bbox_to_anchor=(-0.02, 0.99), ncols=3, fontsize=7.5, handlelength=2, columnspacing=1
        )


def _legend_below(figure: Figure, *panels: Axes) -> None:
    """One legend for all panels, with a line for each of the given ones."""
    found = [axes.get_legend_handles_labels() for axes in panels]
    # Legends are filled column by column.
    handles = [handle for column in zip(*(handles for handles, _ in found), strict=True) for handle in column]
    labels = [label for column in zip(*(labels for _, labels in found), strict=True) for label in column]
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels) // len(panels), columnspacing=3)


def _deformed(stem: Path, solution: Solution) -> None:
    """The deformed mesh in gray tones; displacement and distance to the foundation times 20."""
    cells = gather_cells(solution)
    c = lab.table_of(solution).columns
    nodes, normals = (np.column_stack((c[a], c[b])) for a, b in (("x", "y"), ("n_x", "n_y")))
    deformed_mesh(
        stem,
        cells.points,
        cells.perimeters,
        cells.displacement,
        cells.values["density"],
        outline=cells.outline,
        field=replace(FIELDS["density"], colours=_GRAYS),
        foundation=DrawnFoundation(nodes, normals * c["gap"][:, None]),
        factor=20.0,
        suffixes=PRINT,
    )


def _save(figure: Figure, stem: Path) -> None:
    logging.getLogger("fontTools").setLevel(logging.ERROR)  # it dislikes the dates of some fonts
    figure.savefig(stem.with_suffix(".png"), dpi=160)
    figure.savefig(stem.with_suffix(".pdf"), metadata={"CreationDate": None})
