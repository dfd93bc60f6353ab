"""Writes docs/contactbench.md and its pictures from the problems and from docs/evidence/contactbench.csv.

    ./env python3 docs/references.py

``python3 -m contactbench run --csv FILE`` makes the table; no program is run here.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS.parent))

from contactbench.adapters import ADAPTERS  # noqa: E402
from contactbench.problem import Problem, Quantity, problem_names, read_problem  # noqa: E402

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PAGE, TABLE = DOCS / "contactbench.md", DOCS / "evidence" / "contactbench.csv"
TEXT = """# contactbench

Contact problems as plain text, each with a reference that does not rest on one program: {NUMBER} problems with
{QUANTITIES} quantities in the folder `contactbench` of the repository, whose `README.md` explains the files. Your
program needs neither this package nor FEniCSx. The runner needs Python 3.11 and NumPy.

<!-- not run: its commands are run by tests/verification/test_contactbench_judging.py -->
```sh
python3 -m contactbench list                     # the problems
python3 -m contactbench show wedge               # one of them in words, with its references
python3 -m contactbench mesh wedge --levels 3    # wedge-0.msh, wedge-0.inp, ...: also --triangles; without a name: all
python3 -m contactbench judge wedge mine.csv     # your results: quantity,value[,unknowns,seconds]; --json
python3 -m contactbench run --csv found.csv      # the programs below, on all problems
```

`judge` ends with 0 if all values are within the tolerances, with 1 if one is not, with 2 if the file cannot be read.

## References

- **exact**: a number with its source and formula. Tests recompute each, without reading the number in the file. Bodies
  are cut out of half-planes and half-spaces, with the tractions of the closed-form solution on the cut, so that most
  references have no truncation error. Where there is one, the text says how large it is.
- **interval**: the solution lies within it. Intervals are [guaranteed
  bounds](theory.md#a-guaranteed-bound-of-the-error) of signorini_fx, and are the only references that rest on one
  program alone. `python3 -m contactbench certify` recomputes them.
- **values**: two numbers, from programs, or a program and an integral equation, that share no code. Results between the
  two are neither right nor wrong.

A tolerance is an error that a correct program with linear elements and exact constraints does not exceed on the
coarsest mesh.

## What five programs say

{COUNTS}
`signorini_fx` runs with its defaults. Each of the others runs through an adapter, one small file in
`contactbench/adapters`: dolfinx with a hand-written penalty method, scikit-fem with a hand-written active-set method,
GetFEM with its contact brick, CalculiX with soft contact. Penalties are part of their errors, most of all in the patch
tests; between bodies GetFEM has node-to-facet contact. All use linear elements on the same meshes, and mixed ones of
degree 2 for incompressible bodies. None was tuned beyond what made it converge: an expert in one of them may do better.
CPU seconds are those of one thread on a machine with other work, from the mesh in memory, or the deck, to the solution;
forms were compiled beforehand.

`signorini_fx` regularises contact by default, which causes its error in the patch tests. In `layer-cylinder` its errors
therefore stop at 0.01 %; with `algorithm = "alm"` they decrease further, to 0.0005 % and 0.0015 % on the third mesh.
For one body on a rigid foundation, scikit-fem and GetFEM constrain the same nodes exactly, so that their lines
coincide.

Error of one quantity, on the coarsest and on the finest mesh that was run. An error of 0 means round-off, or a value
within the interval or between the two values:

{ERRORS}
What was skipped, or failed:

{REASONS}
![Errors against unknowns](images/contactbench_unknowns.png)

*Errors against unknowns; dashed: the tolerance for the coarsest mesh.*

![Errors against CPU seconds](images/contactbench_seconds.png)

*Errors against CPU seconds.*

## All references

{PROBLEMS}"""
COLORS = {"signorini_fx": "#3b6ea5", "dolfinx": "#d98032", "scikit-fem": "#2a9d6f", "getfem": "#b3261e"}
COLORS |= {"calculix": "#7a5195"}
MARKS = dict(zip(ADAPTERS, "osD^v", strict=True))
# Below this an error is round-off, or the statics of the loads.
FLOOR = 1e-6
COLUMNS = 4

Rows = list[dict[str, str]]


def rows() -> Rows:
    """What was run."""
    with TABLE.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def shown(problem: Problem) -> Quantity:
    """The quantity of a problem that tells programs apart: the one with the widest tolerance."""
    return max(problem.quantities, key=lambda quantity: quantity.tolerance)


def reference(quantity: Quantity) -> str:
    """In a cell."""
    numbers = [f"{number:.7g}" for number in quantity.numbers]
    return {"exact": numbers[0], "interval": f"[{', '.join(numbers)}]"}.get(quantity.kind, " or ".join(numbers))


def problems_table() -> str:
    """All problems with all references."""
    text = "| problem | body | quantity | reference | kind |\n|---|---|---|---|---|\n"
    for name in problem_names():
        problem = read_problem(name)
        for number, quantity in enumerate(problem.quantities):
            link = f"[{name}](../contactbench/problems/{name}.toml)" if number == 0 else ""
            body = f"{problem.hypothesis}, {law(problem)}" if number == 0 else ""
            text += f"| {link} | {body} | {quantity.name} | {reference(quantity)} | {quantity.kind} |\n"
    return text


def law(problem: Problem) -> str:
    """What is special, in some words."""
    words = {"none": "no friction", "tresca": "Tresca", "coulomb": "Coulomb"}[problem.contacts[0].law]
    return words + (", two bodies" if len(problem.bodies) > 1 else "")


def errors_table(found: Rows) -> str:
    """The error of each program on the coarsest and on its finest mesh."""
    text = f"| problem | quantity | {' | '.join(ADAPTERS)} |\n|---|---|{'---|' * len(ADAPTERS)}\n"
    for name in problem_names():
        problem = read_problem(name)
        quantity = shown(problem)
        cells = [cell(found, name, program, quantity) for program in ADAPTERS]
        text += f"| {name} | {quantity.name} | {' | '.join(cells)} |\n"
    return text


def cell(found: Rows, name: str, program: str, quantity: Quantity) -> str:
    """Of one program on one problem."""
    own = [row for row in found if (row["problem"], row["program"]) == (name, program)]
    if not own:
        return "not run"
    values = [row for row in own if row["quantity"] == quantity.name]
    if not values:
        return own[0]["meets"]
    errors = [percent(float(row["error"])) for row in (values[0], values[-1])]
    failed = next((f"; level {row['level']} failed" for row in own if row["meets"] == "failed"), "")
    return (" to ".join(errors) if len(values) > 1 else errors[0]) + failed


def percent(error: float) -> str:
    """In per cent; what is round-off, or within an interval or two values, is zero."""
    return "0" if error < FLOOR else f"{100 * error:.2g} %"


def reasons(found: Rows) -> str:
    """Why programs did not run or failed, each sentence once."""
    text = ""
    for program in ADAPTERS:
        notes: dict[tuple[str, str], list[str]] = {}
        for row in found:
            if row["program"] == program and row["meets"] in ("skipped", "failed"):
                notes.setdefault((row["meets"], " ".join(row["note"].split())), []).append(row["problem"])
        for (kind, note), names in notes.items():
            text += f"- {program}, {kind}: {note} ({', '.join(dict.fromkeys(names))})\n"
    return text


def counts(found: Rows) -> str:
    """How many references each program met on the coarsest meshes."""
    text = "| program | problems run | references met on the coarsest mesh | missed | skipped | failed |\n"
    text += "|---|---|---|---|---|---|\n"
    for program in ADAPTERS:
        own = [row for row in found if row["program"] == program]
        first = [row for row in own if row["level"] == "0" and row["quantity"]]
        run = len({row["problem"] for row in first})
        met = sum(row["meets"] == "yes" for row in first)
        others = [len({r["problem"] for r in own if r["meets"] == kind}) for kind in ("skipped", "failed")]
        text += f"| {program} | {run} | {met} | {len(first) - met} | {others[0]} | {others[1]} |\n"
    return text


def page(found: Rows) -> str:
    """The page."""
    parts = {"PROBLEMS": problems_table(), "ERRORS": errors_table(found), "REASONS": reasons(found)}
    parts["COUNTS"] = counts(found)
    text = TEXT
    for key, part in parts.items():
        text = text.replace(f"{{{key}}}", part)
    every = [read_problem(name).quantities for name in problem_names()]
    return text.replace("{NUMBER}", str(len(every))).replace("{QUANTITIES}", str(sum(map(len, every))))


def panels(found: Rows) -> list[tuple[Problem, Quantity]]:
    """What the pictures show: problems with a number that statics alone does not give."""
    every = ((problem, shown(problem)) for problem in map(read_problem, problem_names()))
    return [
        (problem, quantity)
        for problem, quantity in every
        if quantity.kind == "exact"
        and any(
            row["problem"] == problem.name and row["quantity"] == quantity.name and float(row["error"]) > 100 * FLOOR
            for row in found
        )
    ]


def draw(axes: Axes, found: Rows, problem: Problem, quantity: Quantity, against: str) -> None:
    """Errors of all programs against unknowns or seconds."""
    from matplotlib.ticker import NullFormatter

    for program in ADAPTERS:
        own = [
            row
            for row in found
            if (row["problem"], row["program"], row["quantity"]) == (problem.name, program, quantity.name)
        ]
        x = [max(float(row[against]), 1e-3) for row in own]
        y = [100 * max(float(row["error"]), FLOOR) for row in own]
        axes.plot(x, y, MARKS[program] + "-", color=COLORS[program], label=program, ms=5, lw=1.2, alpha=0.8)
    axes.axhline(100 * quantity.tolerance, color="#9aa0a6", lw=0.8, ls="--")
    axes.set(xscale="log", yscale="log")
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, high / 200), high)  # two decades at least, so that each is labelled, and one of x
    low, high = axes.get_xlim()
    axes.set_xlim(min(low, high / 15), high)
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_title(f"{problem.name}: {quantity.name}", fontsize=8)


def pictures(found: Rows) -> None:
    """Both pictures."""
    from matplotlib import pyplot as plt

    plt.rcParams |= {"font.size": 9, "axes.spines.top": False, "axes.spines.right": False}
    every = panels(found)
    lines = -(-len(every) // COLUMNS)
    for against, label in (("unknowns", "unknowns"), ("seconds", "CPU seconds")):
        figure, axes = plt.subplots(lines, COLUMNS, figsize=(12, 2.1 * lines + 0.5), layout="constrained")
        for place, (problem, quantity) in zip(axes.flat, every, strict=False):
            draw(place, found, problem, quantity, against)
        for place in axes.flat[len(every) :]:
            place.set_visible(False)
        names: dict[str, Any] = {}
        for place in axes.flat[: len(every)]:
            names |= dict(zip(*place.get_legend_handles_labels()[::-1], strict=True))
        figure.legend(names.values(), names.keys(), loc="outside upper center", ncol=len(names), frameon=False)
        figure.supxlabel(label)
        figure.supylabel("error, %")
        figure.savefig(DOCS / "images" / f"contactbench_{against}.png", dpi=110, metadata={"Software": None})
        plt.close(figure)


def main() -> None:
    """Write all."""
    found = rows()
    PAGE.write_text(page(found), encoding="utf-8")
    pictures(found)


if __name__ == "__main__":
    main()
