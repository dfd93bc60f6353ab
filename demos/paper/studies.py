"""What the text of section 7 says in words, and what the paper leaves open: one function for each study."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from signorini_fx import Box, Scene, Status
from signorini_fx.results.solution import Solution

from . import laboratory as lab
from .report import Entry, Table, power, progress
from .scenes import STARTS, coulomb, example1, example2, tresca
from .tables import COUNTING, PRINTED, error_quotients

METHODS: dict[str, dict[str, Any]] = {
    "FP": {},
    "ALM-FP": {"algorithm": "alm"},
    "Newton": {"coulomb": "newton"},
}
EXAMPLES: dict[int, Callable[..., Scene]] = {1: example1, 2: example2}
# The coefficients that the paper shows for each example.
COEFFICIENTS = {1: (0.1, 0.3, 1.0), 2: (2.0, 5.0, 10.0)}
DIAGONAL = (1e4, 1e5, 1e6, 1e7, 1e8, 1e9)


def coulomb_methods() -> list[Table]:
    """FP, ALM-FP and monolithic Newton for Coulomb friction."""
    rows, runs = [], []
    for number, example in EXAMPLES.items():
        for coefficient in sorted(c for values in COEFFICIENTS.values() for c in values):
            progress(f"Coulomb friction: example {number}, F = {coefficient:g}")
            found = {
                name: lab.solved(example(coulomb(coefficient), **options), check=False)
                for name, options in METHODS.items()
            }
            for name, solution in found.items():
                runs.append(_coulomb_run(number, coefficient, name, solution, found))
                rows.append(_coulomb_row(runs[-1]))
    shown = [run for run in runs if run["method"] in ("FP", "ALM-FP") and run["F"] in COEFFICIENTS[run["example"]]]
    low, high = PRINTED["coulomb"]["linear_solves"]

    def span(key: str, *examples: int) -> tuple[int, int]:
        values = [run[key] for run in shown if run["example"] in examples]
        return min(values), max(values)

    in_all, without_start, counted = span("linear_solves", 1, 2), span("without_start", 2), span("counted", 1)
    return [
        Table(
            "coulomb",
            "Coulomb friction: linear solves of the methods",
            [
                "example, F, method",
                "solves",
                "without start",
                "outer",
                "last d_g",
                "to FP",
                "to ALM-FP",
                "remark",
            ],
            rows,
            "gamma = 1e8, stopped at d_g <= 1e-7: linear solves in all and without those of the frictionless start, "
            "fixed point iterations, last change d_g, and the distance of the contact pressure to that of FP and to "
            "that of ALM-FP, which has no regularisation, relative in L2(Gamma_c).  FP and ALM-FP are the paper's "
            "methods, Newton also differentiates the friction bound.",
            [
                f"The paper says about {low} to {high} linear solves overall for FP and ALM-FP, in both examples.  "
                f"For the coefficients that it shows ours take {in_all[0]} to {in_all[1]}; which of them it counts is "
                "not said.  With one more for each problem that starts from the one before, as in Table 4, example 1 "
                f"takes {counted[0]} to {counted[1]}; without the frictionless start example 2 takes "
                f"{without_start[0]} to {without_start[1]}.",
            ],
            {"coulomb": {"linear_solves": list(in_all), "runs": runs}},
        )
    ]


def _coulomb_run(
    number: int, coefficient: float, name: str, solution: Solution, found: dict[str, Solution]
) -> dict[str, Any]:
    solves = lab.solves_per_problem(solution)
    changes = [record.change for record in solution.history.outer if record.change is not None]
    return {
        "example": number,
        "F": coefficient,
        "method": name,
        "status": solution.status.value,
        "linear_solves": sum(solves),
        "without_start": sum(solves[1:]),
        "counted": sum(map(lab.counted, solves[1:])) + solves[0],
        "outer": len(changes),
        "d_g": changes[-1] if changes else None,
        "to_fp": lab.pressure_distance(solution, found["FP"]),
        "to_alm_fp": lab.pressure_distance(solution, found["ALM-FP"]),
        "events": solution.history.events,
    }


def _coulomb_row(run: dict[str, Any]) -> list[Any]:
    remark = run["events"][0] if run["events"] else ""
    if run["status"] != Status.CONVERGED.value:
        remark = run["status"]
    return [
        f"{run['example']}, {run['F']:g}, {run['method']}",
        Entry(run["linear_solves"]),
        Entry(run["without_start"]),
        Entry(run["outer"]) if run["outer"] else "",
        Entry(run["d_g"], None, ".1e") if run["outer"] else "",
        Entry(run["to_fp"], None, ".1e") if run["method"] != "FP" else "",
        Entry(run["to_alm_fp"], None, ".1e") if run["method"] != "ALM-FP" else "",
        remark,
    ]


def sigma() -> list[Table]:
    """The role of sigma."""
    values: dict[str, Callable[[float], Any]] = {
        "1e-4": lambda gamma: 1e-4,
        "1e-2": lambda gamma: 1e-2,
        "1": lambda gamma: 1.0,
        "100": lambda gamma: 100.0,
        "infinite": lambda gamma: "auto",
        "1/gamma_2": lambda gamma: 1 / gamma,
    }
    found: dict[str, list[Any]] = {}
    for name, value in values.items():
        progress(f"sigma = {name}")
        runs = [
            lab.solved(example1(tresca(1.5), gamma=gamma, sigma=value(gamma), fallbacks=False), check=False)
            for gamma in DIAGONAL
        ]
        found[name] = [
            run.history.linear_solves
            if run.converged
            else "cycles"
            if run.status is Status.CYCLING
            else run.status.value
            for run in runs
        ]
    return [
        Table(
            "sigma",
            "The role of sigma",
            ["sigma \\ gamma", *map(power, DIAGONAL)],
            [[name, *map(Entry, values)] for name, values in found.items()],
            "Example 1, nu = 0.4, g = 1.5, gamma_1 = gamma_2: iterations of (SSN).",
            [
                "As section 7.1 says: sigma = 1/gamma_2, which makes (SSN) a semi-smooth Newton method in function "
                "space, cycles; every sigma that is large enough gives the same iterates, and 'infinite' (a node "
                "never jumps from one slip set to the other) needs no unit."
            ],
            {"sigma": found},
        )
    ]


def statements() -> list[Table]:
    """What section 7.2 says of the contact zones of example 2."""
    rows, numbers = [], []
    cases: dict[str, Any] = {f"g = {bound:g}": tresca(bound) for bound in (0.0, 1.0, 5.0)}
    cases |= {f"F = {coefficient:g}": coulomb(coefficient) for coefficient in COEFFICIENTS[2]}
    for name, friction in cases.items():
        for grid in ((120, 40), (240, 80)):
            for method in ("regularised", "unregularised"):
                progress(f"contact zones: {name}, {grid[0]}x{grid[1]}, {method}")
                scene = example2(friction, grid=grid)
                solution = lab.solved(scene, algorithm="ssn" if method == "regularised" else "alm")
                zones = lab.zones(solution)
                columns = lab.table_of(solution).columns
                middle = np.abs(columns["x"] - 1.5) < 0.1 + 1e-9
                lowest = float(columns["pressure"][middle].min())
                rows.append(
                    [
                        f"{name}, {grid[0]}x{grid[1]}, {method}",
                        _intervals(zones.contact),
                        _intervals(zones.stick),
                        Entry(lowest, None, ".3g"),
                        Entry(float(columns["pressure"].max()), None, ".3g"),
                    ]
                )
                numbers.append(
                    {
                        "friction": name,
                        "grid": list(grid),
                        "method": method,
                        "contact": zones.contact,
                        "stick": zones.stick,
                        "lowest_pressure_in_[1.4,1.6]": lowest,
                    }
                )
    return [
        Table(
            "statements",
            "Contact and stick zones of example 2",
            ["friction, grid, method", "in contact", "sticking in contact", "lowest pressure in [1.4, 1.6]", "highest"],
            rows,
            "Where the nodes are in contact, and where they stick in contact; Tresca and Coulomb friction, gamma = 1e8 "
            "(for Coulomb friction: FP) and unregularised.",
            [
                "Of F = 2, 5, 10 the paper says that the body is in contact in [1.4, 1.6] for F = 2, but not for 5 "
                "and 10.  We find it in contact there for all three, with a pressure that grows with F: more "
                "friction holds the middle back from bulging upwards.  Both grids, FP and the unregularised fixed "
                "point agree, as do three programs written apart from each other.  For F = 2 the interval [1.4, 1.6] "
                "is where the body sticks, so the sentence may have meant the stick zone, which is larger for F = 5 "
                "and 10.",
                "Of g = 1 the paper says that there is no contact in [1.3, 1.7].  We find an open interval between "
                "the kinks of the foundation, but a smaller one for g = 1; [1.3, 1.7] is that of g = 0.",
            ],
            {"statements": {"zones": numbers}},
        )
    ]


def _intervals(intervals: list[tuple[float, float]]) -> str:
    return " ".join(f"[{low:g}, {high:g}]" for low, high in intervals) or "nowhere"


def starts() -> list[Table]:
    """How the start changes the counts."""
    patches: dict[str, Any] = {
        "[1.25, 1.75]": STARTS["symmetric"],
        "[1, 2]": Box(x=(1.0, 2.0)),
        "[0, 0.5]": STARTS["nonsymmetric"],
        "[0, 3]": Box(x=(0.0, 3.0)),
    }
    rows, numbers = [], {}
    for name, patch in patches.items():
        progress(f"starts: {name}")
        counts = [lab.linear_solves(example1(tresca(1.5), start=patch, gamma=gamma)) for gamma in DIAGONAL]
        iterates = lab.iterates(example1(tresca(1.5), start=patch, gamma=1e4))
        q = [float(part.sum()) for part in error_quotients(iterates)]
        rows.append([name, *map(Entry, counts), "  ".join(f"{value:.3g}" for value in q)])
        numbers[name] = {"iterations": counts, "q": q}
    theirs = "  ".join(f"{value:.3g}" for value in PRINTED["table2"]["q"])
    other = numbers["[1, 2]"]
    return [
        Table(
            "starts",
            "Starts of (SSN)",
            ["contact forced on", *map(power, DIAGONAL), "q^k for gamma = 1e4"],
            rows,
            "Example 1, nu = 0.4, g = 1.5: iterations of (SSN) for gamma_1 = gamma_2, and the quotients of Table 2.",
            [
                "The text gives 9 iterations for gamma = 1e8, 'at most 12' from other starts, and in Table 2 the "
                f"quotients {theirs}.  From contact on [1, 2] we need {other['iterations'][DIAGONAL.index(1e8)]} "
                f"iterations and have {len(other['q'])} quotients; Tables 1 and 3 come from [1.25, 1.75].",
            ],
            {"starts": numbers},
        )
    ]


def example2_counts() -> list[Table]:
    """Iterations for example 2 with given friction."""
    rows, numbers = [], {}
    for bound, text in ((0.0, "7 or 8"), (1.0, "7"), (5.0, "7 or 8")):
        progress(f"example 2: g = {bound:g}")
        solution = lab.solved(example2(tresca(bound)))
        after = sum(record.iteration > 0 for record in solution.history.iterations)
        numbers[f"{bound:g}"] = lab.counted(after)
        rows.append([f"{bound:g}", Entry(solution.history.linear_solves), Entry(lab.counted(after)), text])
    found = sorted(numbers.values())
    return [
        Table(
            "example2_tresca",
            "Iterations for example 2 with given friction",
            ["g", "linear solves", "counted", "in the paper"],
            rows,
            "gamma = 1e8, start from the solution of the unconstrained dual problem, whose linear solve is included "
            "in the first column.",
            [COUNTING],
            {"example2_tresca": {"iterations": [found[0], found[-1]], "by_bound": numbers}},
        )
    ]


STUDIES: dict[str, Callable[[], list[Table]]] = {
    "coulomb": coulomb_methods,
    "sigma": sigma,
    "zones": statements,
    "starts": starts,
    "example2": example2_counts,
}
