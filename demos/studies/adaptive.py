"""What refining where the error is saves on Example 2: true error in the energy norm against unknowns.

    ./env python3 demos/studies/adaptive.py --out results/adaptive

The solution is singular at the ends of its supports and contact zones, and at the kinks of the foundation: meshes
that are made finer everywhere converge slowly whatever the degree; those that are divided where the estimated error is
keep the rate of smooth solutions.  Errors are measured against a reference of much higher accuracy (see ``cases``).
Written are adaptive.csv and the picture.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib as mpl
import numpy as np
from cases import on_mesh, reference_of, scene_of
from effectivity import as_asked, one_after_the_other
from matplotlib.figure import Figure

from signorini_fx.addons.pictures.style import RULE, STYLE, finish
from signorini_fx.machine.csv_text import write_csv

SCENE = "example2_tresca"
# Element: sizes of uniform cells relative to those of the demo, what the adaptive meshes are asked for.
ELEMENTS = {"P1": ((4, 2, 1, 0.5, 0.25), 0.03), "P2": ((8, 4, 2, 1, 0.5), 0.002)}
COLOURS = {"P1": "#0072b2", "P2": "#d55e00"}


def curves(reference) -> dict[tuple[str, str], np.ndarray]:
    """Unknowns, true and estimated error, peak pressure: one row per mesh, for each element and refinement."""
    found = {}
    for element, (factors, target) in ELEMENTS.items():
        uniform = one_after_the_other([on_mesh(scene_of(SCENE), factor, element, {}) for factor in factors])
        adaptive, _ = as_asked(on_mesh(scene_of(SCENE), 1.0, element, {}), target, of="energy", refinement="adaptive")
        for name, meshes in (("uniform", uniform), ("adaptive", adaptive)):
            true = [reference.errors(mesh.solution)["energy"] for mesh in meshes]
            peak = [mesh.level.table.columns["pressure"].max() for mesh in meshes]
            rows = [(m.level.dofs, e, m.level.energy, p) for m, e, p in zip(meshes, true, peak, strict=True)]
            found[element, name] = np.array(rows)
    return found


def saving(uniform: np.ndarray, adaptive: np.ndarray) -> tuple[float, float, float]:
    """Error of the finest uniform mesh that the adaptive ones reach, the unknowns of it, and what they need for it."""
    dofs, error = next(row[:2] for row in uniform[::-1] if row[1] >= adaptive[-1, 1])
    # Errors fall from mesh to mesh; between two meshes in a straight line on log axes.
    order = np.argsort(adaptive[:, 1])
    enough = np.exp(np.interp(np.log(error), np.log(adaptive[order, 1]), np.log(adaptive[order, 0])))
    return float(error), float(dofs), float(enough)


def rate(rows: np.ndarray) -> float:
    """Slope of the finer half of the meshes: the error falls like unknowns to this power, with a minus."""
    last = rows[len(rows) // 2 :]
    return float(-np.polyfit(np.log(last[:, 0]), np.log(last[:, 1]), 1)[0])


def draw(stem: Path, found: dict, floor: float) -> None:
    """Error against unknowns on log axes, with the optimal rates."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 5.2), layout="constrained")
        axes = figure.add_subplot()
        for (element, name), rows in found.items():
            adaptive = name == "adaptive"
            style = {"marker": "o" if adaptive else "s", "markersize": 4, "linestyle": "-" if adaptive else "--"}
            face = COLOURS[element] if adaptive else "white"
            label = f"{element}, {name}: error falls like unknowns$^{{-{rate(rows):.2f}}}$"
            axes.loglog(rows[:, 0], rows[:, 1], color=COLOURS[element], markerfacecolor=face, label=label, **style)
            if adaptive:
                degree = int(element[1])
                ends = np.array([rows[len(rows) // 2, 0], rows[-1, 0]])
                line = 0.6 * rows[-1, 1] * (ends / ends[1]) ** (-degree / 2)
                axes.loglog(ends, line, color="#6b6b6b", linewidth=1)
                text = f"optimal: unknowns$^{{-{degree / 2:g}}}$"
                place = {"xytext": (4, 0), "textcoords": "offset points", "ha": "left", "va": "center"}
                axes.annotate(text, (ends[1], line[1]), color="#6b6b6b", fontsize=8, **place)
        low = axes.get_ylim()[0]
        axes.axhspan(low / 10, floor, facecolor="#f3e9e9", zorder=0)
        axes.annotate("the reference may be wrong by so much", (0.02, 0.015), xycoords="axes fraction", fontsize=7)
        axes.set_ylim(min(low, floor / 2))
        axes.set(xlabel="unknowns", ylabel="relative error of the displacement, energy norm")
        axes.grid(visible=True, which="major", color=RULE, linewidth=0.35)
        axes.margins(x=0.1)
        axes.legend(loc="upper right", fontsize=8)
        finish(figure, stem, "Example 2, Tresca friction: where to put the unknowns")


def main() -> None:
    """Measure, print, draw and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("results/adaptive"), help="folder (default: %(default)s)")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    reference, own = reference_of(SCENE)
    found = curves(reference)
    rows = [
        {"element": element, "meshes": name, "dofs": int(n), "true": e, "estimated": est, "peak": peak}
        for (element, name), table in found.items()
        for n, e, est, peak in table
    ]
    write_csv(options.out / "adaptive.csv", rows)
    for row in rows:
        told = f"error {row['true']:.2e}, estimated {row['estimated']:.2e} ({row['estimated'] / row['true']:.2f} of it)"
        print(f"{row['element']} {row['meshes']:8s} {row['dofs']:7d} unknowns: {told}, peak {row['peak']:.2f}")
    print(f"\nreference: {reference.solution.model.dofs} unknowns, perhaps wrong by {own['energy']:.1e}")
    for element in ELEMENTS:
        pair = [found[element, name] for name in ("uniform", "adaptive")]
        error, dofs, enough = saving(*pair)
        print(f"{element}: error {error:.1e} takes {dofs:.0f} unknowns uniform, {enough:.0f} adaptive", end=", ")
        print(f"1/{dofs / enough:.0f} of them", end="; ")
        print(f"rate {rate(pair[1]):.2f} of {int(element[1]) / 2:g}, uniform {rate(pair[0]):.2f}")
    peaks = found["P2", "adaptive"][:, 3]
    half = peaks[: len(peaks) // 2].max(), peaks[len(peaks) // 2 :].max()
    told = f"on the coarser half of the adaptive P2 meshes {half[0]:.1f}, on the finer half {half[1]:.1f}"
    print(f"largest peak pressure {told}", end="")
    print(": it has no limit, the foundation has kinks" if half[1] > 1.2 * half[0] else "")
    draw(options.out / "adaptive", found, own["energy"])


if __name__ == "__main__":
    main()
