"""Writes docs/evidence.md and the pictures of docs/trust.md from the tables in docs/evidence.

    ./env python3 docs/evidence.py

``docs/evidence/index.csv`` names each table, what makes it, and when it was recorded.
"""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DOCS = Path(__file__).resolve().parent
TABLES, PAGE = DOCS / "evidence", DOCS / "evidence.md"
HEAD = """# Evidence

The tables behind [Can it be trusted?](trust.md), as CSV files. `./env python3 docs/evidence.py` writes this page from
`docs/evidence/index.csv`. Dates and commits are those of the recording; *with every commit* means that tests compute
the numbers anew. Commands run through `./env`.
"""
BLUE, ORANGE, GREY, RED = "#3b6ea5", "#d98032", "#9aa0a6", "#b3261e"


def rows(name: str) -> list[dict[str, str]]:
    """The rows of a table."""
    with (TABLES / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def page() -> str:
    """The page: one row for each table."""
    text, about = HEAD, ""
    for row in rows("index"):
        if row["about"] != about:
            about = row["about"]
            text += f"\n## {about}\n\n| table | made by | recorded |\n|---|---|---|\n"
        name, command = row["table"].replace("|", r"\|"), row["made by"]
        cells = (f"[{name}](evidence/{row['file']}.csv)", f"`{command}`" if command else "", row["recorded"])
        text += f"| {' | '.join(cells)} |\n"
    return text


def number(text: str) -> float:
    """The first number of a cell."""
    return float(re.findall(r"\d[\d.,]*(?:e[+-]?\d+)?", text)[0].replace(",", ""))


def benchmarks(axes: Axes) -> None:
    """How far each benchmark is from its reference, over what is allowed."""
    found = [row for row in rows("benchmarks") if float(row["tolerance"].split()[0])]
    every = {row["benchmark"] for row in found}
    stems = {name: name.partition(",")[0] for name in every}
    kinds = [
        stem if list(stems.values()).count(stem) > 1 else row["benchmark"]
        for row in found
        for stem in [stems[row["benchmark"]]]
    ]
    names = list(dict.fromkeys(kinds))[::-1]
    shares = [max(float(row["difference"]) / float(row["tolerance"].split()[0]), 1e-8) for row in found]
    axes.plot(shares, [names.index(kind) for kind in kinds], "o", color=BLUE, alpha=0.6)
    axes.axvline(1, color=RED)
    axes.set(xscale="log", xlabel="difference over tolerance", yticks=range(len(names)), yticklabels=names)


def random_scenes(axes: Axes) -> None:
    """What a second program says of random scenes."""
    runs = {"one body, plane": ("oracle", "plane"), "one body, space": ("oracle", "space")}
    runs |= {"two and three bodies": ("oracle_bodies", "scenes"), "further effects": ("oracle_effects", "scenes")}
    parts = {"right": BLUE, "no equilibrium, confirmed": GREY, "failure reported": ORANGE, "wrong": RED}
    for place, (file, column) in enumerate(runs.values()):
        count = dict.fromkeys(parts, 0)
        for row in rows(file):
            words = {"converged, correct": "right", "no equilibrium, confirmed": "no equilibrium, confirmed"}
            kind = "wrong" if "WRONG" in row["verdict"] else words.get(row["verdict"], "failure reported")
            count[kind] += 0 if row["verdict"] == "all" else int(row[column])
        left = 0.0
        for kind, color in parts.items():
            share = 100 * count[kind] / sum(count.values())
            axes.barh(place, share, left=left, color=color, label=kind if place == 0 else None)
            left += share
    axes.set(yticks=range(len(runs)), yticklabels=list(runs), xlabel="% of the scenes")
    axes.legend(loc="lower center", bbox_to_anchor=(0.3, 1.0), ncol=2, frameon=False)


def effectivities(axes: Axes) -> None:
    """Estimated over true errors."""
    for column, color, name in (("energy", BLUE, "displacement"), ("pressure", ORANGE, "contact pressure")):
        found = [re.findall(r"[\d.]+(?:e-?\d+)?", row[column]) for row in rows("effectivity")]
        axes.plot([100 * float(b) for _, b in found], [float(a) for a, _ in found], "o", color=color, label=name)
    axes.axhspan(0.5, 2, color=GREY, alpha=0.2)
    axes.set(xscale="log", yscale="log", ylim=(0.2, 5), xlabel="true error, %", ylabel="estimated over true error")
    axes.set_yticks([0.25, 0.5, 1, 2, 4], ["1/4", "1/2", "1", "2", "4"])
    axes.minorticks_off()
    axes.legend(frameon=False)


def requests(axes: Axes) -> None:
    """True errors where an accuracy was requested."""
    found = []
    for row in rows("asked_accuracy_random"):
        for target in (10.0, 5.0, 2.0, 1.0):
            if "out of reach" not in row[f"{target:g} %"]:
                found.append((target, max(number(row[f"{target:g} %"]), 1e-3)))
    for name in ("asked_accuracy", "asked_accuracy_in_space"):
        met = (row for row in rows(name) if "budget" not in row["estimated"])
        found += [(100 * number(row["asked"]), max(100 * number(row["true"]), 1e-3)) for row in met]
    axes.plot(*zip(*found, strict=True), "o", color=BLUE, alpha=0.35)
    axes.plot([0.05, 40], [0.05, 40], color=RED)
    axes.set(xscale="log", yscale="log", xlabel="requested error, %", ylabel="true error, % (0.001: or less)")


def targets(axes: Axes) -> None:
    """The cost of a solve over that of one linear solve, by MUMPS, of the same body."""
    found = [
        row for row in rows("performance") if "over a linear solve" in row["what"] and "CHOLMOD" not in row["what"]
    ]
    found = [row for row in found if row["mesh"] in ("960x320", "1734x578")]
    labels = [re.sub(",? over a linear solve.*", "", row["what"]) + f", {row['mesh']}" for row in found][::-1]
    axes.barh(range(len(found)), [number(row["value"]) for row in found][::-1], color=BLUE)
    axes.axvline(1, color=GREY)
    axes.set(yticks=range(len(found)), yticklabels=labels, xlabel="over one linear elastic solve by MUMPS")


def rivals(axes: Axes) -> None:
    """How many times the CPU seconds of this package other programs take."""
    found = [(f"{row['rival']}, {row['law']}", number(row["package faster by"])) for row in rows("rivals_in_space")]
    large = [row["unknowns"].startswith("316") or row["rival"] == "GetFEM" for row in rows("rivals_in_space")]
    found = [pair for pair, kept in zip(found, large, strict=True) if kept]
    column = next(name for name in rows("calculix")[0] if "faster" in name)
    found += [
        (f"CalculiX, {row['Coulomb friction, unknowns']} unknowns", number(row[column])) for row in rows("calculix")
    ]
    axes.barh(range(len(found)), [value for _, value in found][::-1], color=BLUE)
    axes.axvline(1, color=RED)
    axes.set(yticks=range(len(found)), yticklabels=[name for name, _ in found][::-1], xlabel="CPU seconds over ours")


PICTURES = (benchmarks, random_scenes, effectivities, requests, targets, rivals)


def main() -> None:
    """Write the page and the pictures."""
    from matplotlib import pyplot as plt

    PAGE.write_text(page(), encoding="utf-8")
    plt.rcParams |= {"font.size": 11, "axes.spines.top": False, "axes.spines.right": False}
    for draw in PICTURES:
        figure, axes = plt.subplots(figsize=(5.6, 3.8), layout="constrained")
        draw(axes)
        figure.savefig(DOCS / "images" / f"evidence_{draw.__name__}.png", dpi=150, metadata={"Software": None})
        plt.close(figure)


if __name__ == "__main__":
    main()
