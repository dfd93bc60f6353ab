"""What each effect costs: time and memory of one body on one mesh, as effects are added to it one by one.

    ./env python3 demos/studies/effects.py --out results/effects

Times are medians of repeats that take turns, so that a busy machine hurts all effects alike; a first round, in which
forms may still be compiled to machine code, is not counted.  Memory is the peak of a process of its own per effect.
Written are effects.csv (the table that is printed), repeats.csv (every repeat) and effects.png, effects.pdf.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import time
from pathlib import Path

from mpi4py import MPI

from signorini_fx.machine.csv_text import write_csv
from signorini_fx.mechanics.mesh.tagged import generate_mesh
from signorini_fx.results.accuracy.convergence_table import peak_memory
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

PRESSED = {"boundary": "top", "y": "-20 if 1 <= x[0] <= 2 else 0"}
CONTACT = {"boundary": "bottom", "gap": "0.003*(x[0] - 1.5)**2 + 0.001"}
# The body of the paper's Example 1 with clamped sides, so that it is held without contact too.
ELASTIC = {
    "material": {"young": 5000.0, "poisson": 0.4},
    "displacement": [{"boundary": side, "x": 0.0, "y": 0.0} for side in ("left", "right")],
    "traction": PRESSED,
}
TRESCA = {**CONTACT, "friction": {"law": "tresca", "bound": 1.5}}
COULOMB = {**CONTACT, "friction": {"law": "coulomb", "coefficient": 0.3}}
STEPS = {"traction": {**PRESSED, "factors": [0.2, 0.4, 0.6, 0.8, 1.0]}}
EFFECTS = {
    "elastic": ELASTIC,
    "+ body force": {**ELASTIC, "body_force": {"y": -1.0}},
    "+ contact": {**ELASTIC, "contact": CONTACT},
    "+ Tresca friction": {**ELASTIC, "contact": TRESCA},
    "+ Coulomb friction": {**ELASTIC, "contact": COULOMB},
    "+ 5 load steps": {**ELASTIC, **STEPS, "contact": COULOMB},
}
NOTES = {
    "elastic": "pressed on top, no contact: one linear solve",
    "+ body force": "elastic, with its weight",
    "+ contact": "elastic, with a foundation below",
    "+ Tresca friction": "contact, with given friction",
    "+ Coulomb friction": "contact, with friction by the pressure",
    "+ 5 load steps": "Coulomb friction, loaded in 5 steps",
}
# What the solver times; 'compile' is Python's part of it, for the machine code is there already.
PHASES = {
    "compile": "set up the forms",
    "assemble": "assemble matrix and loads",
    "condense": "eliminate the interior once",
    "iterate": "iterate: linear solves",
    "certify": "check the result",
}


def body(nx: int):
    """The mesh that all effects share."""
    return generate_mesh("rectangle", {"length": 3.0, "height": 1.0, "nx": nx, "ny": nx // 3}, MPI.COMM_SELF)


def measure(name: str, tagged, linear_algebra: str) -> dict[str, float]:
    """Solve once: seconds by phase, and what was done."""
    scene = parse_scene(
        {"mesh": {"generator": "rectangle"}, **EFFECTS[name], "solver": {"linear_algebra": linear_algebra}}
    )
    scene = scene.model_copy(update={"mesh": tagged})
    start = time.perf_counter()
    solution = solve(scene, MPI.COMM_SELF)
    total = time.perf_counter() - start
    seconds = {phase: solution.timings.seconds.get(phase, 0.0) for phase in PHASES}
    return {
        "seconds": total,
        **seconds,
        "linear_solves": sum(step.linear_solves for step in solution.steps),
        "factorisations": sum(record.factorised for record in solution.history.iterations) or 1,
        "forms": len(solution.model.inventory.forms),
        "dofs": solution.model.dofs,
    }


def peak_of_process(name: str, nx: int, linear_algebra: str) -> float:
    """Peak memory of a process that solves this once (an empty name: that makes the mesh and nothing else), MB."""
    command = [sys.executable, __file__, "--process", name, "--nx", str(nx), "--linear-algebra", linear_algebra]
    ended = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(ended.stdout.splitlines()[-1])


def study(nx: int, repeats: int, linear_algebra: str) -> tuple[list[dict], list[dict]]:
    """The table and the single repeats."""
    tagged = body(nx)
    runs = []
    for repeat in range(repeats + 1):
        for name in EFFECTS:
            run = {"effect": name, "repeat": repeat, **measure(name, tagged, linear_algebra)}
            if repeat > 0:
                runs.append(run)
        print(f"round {repeat} of {repeats}" + (" (not counted)" if repeat == 0 else ""), file=sys.stderr, flush=True)
    empty = peak_of_process("", nx, linear_algebra)
    rows = []
    for name in EFFECTS:
        own = [run for run in runs if run["effect"] == name]
        row = {"effect": name, **{key: statistics.median(run[key] for run in own) for key in ("seconds", *PHASES)}}
        row |= {"fastest": min(run["seconds"] for run in own), "slowest": max(run["seconds"] for run in own)}
        row |= {key: own[0][key] for key in ("linear_solves", "factorisations", "forms", "dofs")}
        row |= {"peak_MB": peak_of_process(name, nx, linear_algebra), "mesh_MB": empty}
        rows.append(row)
    for row in rows:
        row["time_ratio"] = row["seconds"] / rows[0]["seconds"]
        row["memory_ratio"] = (row["peak_MB"] - empty) / (rows[0]["peak_MB"] - empty)
    return rows, runs


def text_table(rows: list[dict]) -> str:
    """The rows for a terminal."""
    lines = [
        f"{'':20s} {'seconds':>8s} {'ratio':>6s}   {'set up':>7s} {'iterate':>8s} {'check':>7s}"
        f"   {'solves':>6s} {'forms':>5s}   {'peak MB':>7s} {'ratio':>6s}"
    ]
    for row in rows:
        set_up = row["compile"] + row["assemble"] + row["condense"]
        lines.append(
            f"{row['effect']:20s} {row['seconds']:8.3f} {row['time_ratio']:6.2f}   {set_up:7.3f} {row['iterate']:8.3f}"
            f" {row['certify']:7.3f}   {row['linear_solves']:6d} {row['forms']:5d}   {row['peak_MB']:7.0f}"
            f" {row['memory_ratio']:6.2f}"
        )
    lines.append(
        f"Ratios are to elastic; of memory, what is above the {rows[0]['mesh_MB']:.0f} MB of imports and mesh."
    )
    return "\n".join(lines)


def draw(rows: list[dict], stem: Path, nx: int, repeats: int) -> None:
    """Bars: seconds by phase on the left, memory on the right."""
    from matplotlib.figure import Figure

    colours = {
        "compile": "#d9d9d9",
        "assemble": "#a6a6a6",
        "condense": "#e69f00",
        "iterate": "#0072b2",
        "certify": "#262626",
    }
    figure = Figure(figsize=(10.0, 0.6 * len(rows) + 2.0), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True, gridspec_kw={"width_ratios": [2.4, 1.0]})
    places = range(len(rows))
    starts = [0.0] * len(rows)
    for phase, label in PHASES.items():
        widths = [1e3 * row[phase] for row in rows]
        if any(widths):
            left.barh(places, widths, left=starts, color=colours[phase], label=label, height=0.62)
        starts = [start + width for start, width in zip(starts, widths, strict=True)]
    for place, (row, end) in enumerate(zip(rows, starts, strict=True)):
        solves = f"{row['linear_solves']} linear solve" + "s" * (row["linear_solves"] > 1)
        left.text(end, place, f"  {row['time_ratio']:.1f} x,  {solves}", va="center", fontsize=8.5)
        right.text(row["peak_MB"], place, f"  {row['peak_MB']:.0f}", va="center", fontsize=8.5)
    left.set_yticks(list(places), [f"{row['effect']}\n{NOTES[row['effect']]}" for row in rows], fontsize=8.5)
    left.set_xlim(0, 1.3 * max(starts))
    left.set_xlabel("time of one solve, milliseconds")
    above = {"loc": "lower left", "borderaxespad": 0.0, "fontsize": 8, "frameon": False, "handlelength": 1.2}
    left.legend(**above, bbox_to_anchor=(0.0, 1.0), ncols=3, columnspacing=1.2)
    base = rows[0]["mesh_MB"]
    right.barh(places, [base] * len(rows), color="#d9d9d9", label="imports and mesh", height=0.62)
    right.barh(
        places, [row["peak_MB"] - base for row in rows], left=base, color="#0072b2", label="the solve", height=0.62
    )
    right.set_xlim(0, 1.25 * max(row["peak_MB"] for row in rows))
    right.set_xlabel("peak memory, MB")
    right.legend(**above, bbox_to_anchor=(0.0, 1.0))
    left.invert_yaxis()
    for axes in (left, right):
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(axis="y", length=0)
    figure.suptitle(
        f"What each effect costs: one body, {nx} x {nx // 3} quadrilaterals, {rows[0]['dofs']} unknowns, one core"
        f"\n(bars: medians of {repeats} repeats; '2.0 x' is twice the time of the elastic body)",
        fontsize=10,
    )
    for suffix in (".png", ".pdf"):
        figure.savefig(stem.with_suffix(suffix), dpi=150)


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results/effects"), help="folder (default: %(default)s)")
    parser.add_argument("--nx", type=int, default=240, help="cells along the body (default: %(default)s)")
    parser.add_argument("--repeats", type=int, default=11, help="counted repeats (default: %(default)s)")
    parser.add_argument("--linear-algebra", default="auto", help="as in [solver] (default: %(default)s)")
    parser.add_argument("--process", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.process is not None:
        tagged = body(options.nx)
        if options.process:
            measure(options.process, tagged, options.linear_algebra)
        print(json.dumps(peak_memory(MPI.COMM_SELF)))
        return
    rows, runs = study(options.nx, options.repeats, options.linear_algebra)
    options.out.mkdir(parents=True, exist_ok=True)
    write_csv(options.out / "effects.csv", rows)
    write_csv(options.out / "repeats.csv", runs)
    draw(rows, options.out / "effects", options.nx, options.repeats)
    print(text_table(rows))
    print(f"written: {options.out}/effects.csv, repeats.csv, effects.png, effects.pdf")


if __name__ == "__main__":
    main()
