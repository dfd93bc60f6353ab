"""Every benchmark with its reference, our number and the tolerance: docs/evidence/benchmarks.csv.

    ./env python3 demos/studies/verification.py [--write]     # prints the rows; writes the file

References are formulae, balances of forces, or numbers of an independent program
(tests/support/oracle.py: NumPy alone, no line shared with the package).  The exit code is 1 if a
number is further from its reference than the tolerance says. One rank, some seconds.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mpi4py import MPI

from signorini_fx.results.solution import Solution
from signorini_fx.scenes.reading import parse_scene, read_scene
from signorini_fx.scenes.scene import Scene
from signorini_fx.scenes.solver import solve

SCENES = Path(__file__).resolve().parents[1] / "scenes"
TABLE = SCENES.parents[1] / "docs" / "evidence" / "benchmarks.csv"
ELEMENTS = {
    "P1": ("triangle", 1),
    "Q1": ("quadrilateral", 1),
    "P2": ("triangle", 2),
    "Q2": ("quadrilateral", 2),
}


@dataclass(frozen=True)
class Row:
    """One number and what it is held against.

    Attributes:
        benchmark: the problem.
        quantity: what is compared.
        source: where the reference comes from.
        reference: its value.
        ours: what was computed.
        tolerance: largest difference, relative to the reference; absolute where that is zero.
        form: format specification of both.
    """

    benchmark: str
    quantity: str
    source: str
    reference: float
    ours: float
    tolerance: float
    form: str = ".6g"

    @property
    def difference(self) -> float:
        """Relative to the reference, absolute where that is zero."""
        return abs(self.ours - self.reference) / (abs(self.reference) or 1.0)

    @property
    def holds(self) -> bool:
        """Whether the difference keeps to the tolerance; not a number does not."""
        return self.difference <= self.tolerance


def alone(scene: Scene, *, check: bool = True) -> Solution:
    """Solve on this rank."""
    return solve(scene, MPI.COMM_SELF, check=check)


# --- states of constant stress --------------------------------------------------------------------

YOUNG, POISSON, PRESSED, SHEAR = 200.0, 0.3, 5.0, 2.0
GAMMA_N, GAMMA_T = 4e5, 3e5  # part of the exact solution: the body sinks in by pressure / gamma_n
SHORTENING = PRESSED * (1 + POISSON) * (1 - 2 * POISSON) / (YOUNG * (1 - POISSON))
SIDEWAYS = POISSON / (1 - POISSON) * PRESSED
MU = YOUNG / (2 * (1 + POISSON))


def patch(cell: str, degree: int, **effects: object) -> Scene:
    """An unstructured mesh of a block 2 x 1 with Coulomb friction of 0.4 on a flat foundation."""
    size = {"length": 2.0, "height": 1.0, "nx": 8, "ny": 4, "cell": cell, "layout": "unstructured"}
    return parse_scene(
        {
            "mesh": {"generator": "block", "parameters": size},
            "element": {"degree": degree},
            "material": {"young": YOUNG, "poisson": POISSON},
            "contact": {
                "boundary": "bottom",
                "friction": {"law": "coulomb", "coefficient": SHEAR / PRESSED},
            },
            "solver": {"gamma_n": GAMMA_N, "gamma_t": GAMMA_T, "tolerance": 1e-12},
            **effects,
        }
    )


def sides(shear: float) -> list[dict[str, object]]:
    """Tractions on the sides of a block that cannot widen, sheared."""
    return [
        {"boundary": "left", "x": SIDEWAYS, "y": -shear},
        {"boundary": "right", "x": -SIDEWAYS, "y": shear},
    ]


def patch_tests() -> Iterator[Row]:
    """Compression, stick and slip: what every element must hold exactly."""
    stuck = 0.95 * SHEAR
    moved = 0.1
    states = {
        "compression": (
            {
                "displacement": [{"boundary": side, "x": 0.0} for side in ("left", "right")],
                "traction": {"boundary": "top", "y": -PRESSED},
            },
            lambda y: 0 * y,
            0.0,
        ),
        "stick": (
            {"traction": [*sides(stuck), {"boundary": "top", "x": stuck, "y": -PRESSED}]},
            lambda y: stuck * y / MU + stuck / GAMMA_T,
            stuck,
        ),
        "slip": (
            {
                "displacement": {
                    "boundary": "top",
                    "x": moved,
                    "y": -SHORTENING - PRESSED / GAMMA_N,
                },
                "traction": sides(SHEAR),
            },
            lambda y: moved - SHEAR * (1 - y) / MU,
            SHEAR,
        ),
    }
    for state, (effects, across, shear) in states.items():
        worst = 0.0
        for element in ELEMENTS.values():
            solution = alone(patch(*element, **effects))
            x = solution.model.space.tabulate_dof_coordinates()
            exact = np.column_stack((across(x[:, 1]), -SHORTENING * x[:, 1] - PRESSED / GAMMA_N))
            wrong = [
                np.abs(solution.displacement.x.array.reshape(-1, 2) - exact).max()
                / np.abs(exact).max()
            ]
            wrong += [np.abs(solution.contact.pressure - PRESSED).max() / PRESSED]
            wrong += [np.abs(solution.contact.shear[:, 0] - shear).max() / PRESSED]
            worst = float(np.max([worst, *wrong]))
        quantity = f"largest error of displacement, pressure, shear; {', '.join(ELEMENTS)}"
        yield Row(f"Patch test, {state}", quantity, "exact", 0.0, worst, 1e-9, ".0e")


# --- Hertz ----------------------------------------------------------------------------------------

RADIUS = 8.0
MODULUS = YOUNG / (1 - POISSON**2)


def half_width_of(load: float) -> float:
    """Hertz: a^2 = 4 P R / (pi E*)."""
    return math.sqrt(4 * load * RADIUS / (math.pi * MODULUS))


def moment_width(x: np.ndarray, pressure: np.ndarray, weight: np.ndarray) -> float:
    """a from the mean of x^2, which is a^2 / 4 for an ellipse: it does not depend on where the last
    node is.
    """
    return float(2 * np.sqrt(np.dot(weight, pressure * x**2) / np.dot(weight, pressure)))


def hertz() -> Iterator[Row]:
    """Half a disk on a plane, load prescribed; a block on a cylinder, motion prescribed."""
    load = 0.2157686 * 2 * RADIUS  # hertz.toml presses so
    width = half_width_of(load)
    columns = alone(read_scene(SCENES / "hertz.toml")).table.columns
    x, pressure, weight = columns["x"], columns["pressure"], columns["weight"]
    name, formula = "Hertz, half a disk on a plane", "Hertz's formula; (a/R)^2 = 0.25 %"
    yield Row(
        name,
        "contact force",
        "balance of forces",
        load / 2,
        float(np.dot(weight, pressure)),
        1e-8,
        ".8g",
    )
    yield Row(name, "half-width a", formula, width, moment_width(x, pressure, weight), 5e-3)
    yield Row(
        name, "largest pressure", formula, 2 * load / (math.pi * width), float(pressure.max()), 5e-3
    )

    block = {
        "length": 10.0,
        "height": 5.0,
        "nx": 120,
        "ny": 60,
        "layout": "graded",
        "grading": 40.0,
    }
    solution = alone(
        parse_scene(
            {
                "mesh": {"generator": "block", "parameters": block},
                "material": {"young": YOUNG, "poisson": POISSON},
                "displacement": {"boundary": "top", "x": 0.0, "y": -0.06},
                "contact": {"boundary": "bottom", "gap": "(x[0] - 5)**2 / 16"},
            }
        )
    )
    columns = solution.table.columns
    x, pressure, weight = columns["x"] - 5, columns["pressure"], columns["weight"]
    total = float(np.dot(weight, pressure))
    width = half_width_of(total)
    name, formula = "Hertz, block on a cylinder", "Hertz's formula at our force; (a/H)^2 = 1.3 %"
    yield Row(name, "contact force", "another program", 7.2185, total, 2e-3)
    yield Row(name, "largest pressure", "another program", 7.989, float(pressure.max()), 2e-3)
    yield Row(name, "half-width a", formula, width, moment_width(x, pressure, weight), 8e-3)


# --- the paper's first example --------------------------------------------------------------------


def example1() -> Iterator[Row]:
    """Example 1 on 120 x 40, gamma = 1e8, F = 0.3 or g = 1.5; the numbers of
    tests/support/oracle.py.
    """
    known = {
        "tresca": (20.1121, 0.0231870, -0.00382157, ("friction", [0.95, 2.05])),
        "coulomb": (20.1810, 0.0234108, -0.00384852, ("state", [1.0, 2.0])),
    }
    oracle = "independent program"
    for law, (largest, energy, u_2, (column, ends)) in known.items():
        solution = alone(read_scene(SCENES / f"example1_{law}.toml"))
        columns, name = solution.table.columns, f"Example 1 of the paper, {law.capitalize()}"
        force = float(np.dot(columns["weight"], columns["pressure"]))
        yield Row(name, "contact force", "balance of forces", 20.0, force, 1e-9, ".10g")
        yield Row(name, "largest pressure", oracle, largest, float(columns["pressure"].max()), 3e-6)
        yield Row(name, "strain energy", oracle, energy, solution.steps[-1].strain_energy, 3e-6)
        x = solution.model.space.tabulate_dof_coordinates()
        middle = int(np.argmin(np.hypot(x[:, 0] - 1.5, x[:, 1] - 1.0)))
        yield Row(
            name,
            "u_2(1.5, 1)",
            oracle,
            u_2,
            float(solution.displacement.x.array[2 * middle + 1]),
            2e-6,
        )
        zone = columns["x"][columns["state"] != "open"]
        for which, at, wanted in (("first", zone.min(), 0.85), ("last", zone.max(), 2.15)):
            yield Row(name, f"{which} node in contact", oracle, wanted, float(at), 1e-9)
        for sign, wanted in zip("-+", ends, strict=True):
            slipping = columns["x"][columns[column] == f"slip{sign}"]
            at = slipping.max() if sign == "-" else slipping.min()
            yield Row(name, f"inner end of slip{sign}", oracle, wanted, float(at), 1e-9)


# --- friction -------------------------------------------------------------------------------------

FRICTION, LOAD = 0.3, 20.0


def block(loads: dict[str, object]) -> Scene:
    """A block 3 x 1 that its foundation alone holds."""
    return parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": {"length": 3.0, "nx": 60, "ny": 20}},
            "material": {"young": 5000.0, "poisson": 0.3},
            "contact": {
                "boundary": "bottom",
                "friction": {"law": "coulomb", "coefficient": FRICTION},
            },
            **loads,
        }
    )


def friction() -> Iterator[Row]:
    """The limit of friction from both sides, the loop of push and pull, and what sliding costs."""
    limit = FRICTION * LOAD * 3.0
    for share, wanted in ((0.99, 0.99), (1.01, math.nan)):
        push = {"boundary": "left", "x": share * limit}
        scene = block({"traction": [{"boundary": "top", "y": -LOAD}, push]})
        solution = alone(scene, check=False)
        if solution.converged:
            ours = -float(solution.contact.forces[1][0]) / limit
            yield Row(
                "Limit of friction F N",
                f"pushed with {share} F N",
                "balance of forces",
                wanted,
                ours,
                1e-8,
            )
        else:
            slides = float(solution.status.name == "SLIDES")
            yield Row(
                "Limit of friction F N",
                f"pushed with {share} F N: 'slides'",
                "F N < push",
                1.0,
                slides,
                0.0,
            )
    steps = alone(read_scene(SCENES / "press_and_slide.toml")).steps
    forces = np.array([step.contact.forces[1][0] for step in steps])
    apart = float(np.abs(forces[-16:] - forces[-32:-16]).max() / np.abs(forces).max())
    yield Row(
        "Press, push and pull back",
        "second loop less the first",
        "the loop closes",
        0.0,
        apart,
        1e-6,
        ".0e",
    )
    factors = [0.0, 1.0, 2.0, 3.0]
    pushed = [{"boundary": "top", "y": -0.003}, {"boundary": "top", "x": 0.02, "factors": factors}]
    contact = alone(block({"displacement": pushed})).steps[-1].contact
    work, source = FRICTION * float(contact.forces[0][1]) * 0.02, "F N times its length"
    yield Row(
        "A block that slides",
        "work of friction of one step",
        source,
        work,
        contact.friction_work,
        1e-6,
    )


# --- near incompressibility -----------------------------------------------------------------------


def incompressible() -> Iterator[Row]:
    """u_2 in the middle of the top of Example 1, Tresca, 30 x 10 cells, against Q2 on 90 x 30."""

    def sinking(poisson: float, name: str, nx: int) -> float:
        cell, degree = ELEMENTS[name]
        scene = tomllib.loads((SCENES / "example1_tresca.toml").read_text(encoding="utf-8"))
        parameters = {"length": 3.0, "height": 1.0, "nx": nx, "ny": nx // 3, "cell": cell}
        scene["mesh"] = {"generator": "rectangle", "parameters": parameters}
        scene["element"] = {"degree": degree, "volumetric": "reduced"}
        scene["material"] = {"young": 5000.0, "poisson": poisson}
        scene["solver"] = {}
        solution = alone(parse_scene(scene))
        x = solution.model.space.tabulate_dof_coordinates()
        middle = int(np.argmin(np.hypot(x[:, 0] - 1.5, x[:, 1] - 1.0)))
        return float(solution.displacement.x.array[2 * middle + 1])

    for poisson in (0.4, 0.4999, 0.499999):
        reference = sinking(poisson, "Q2", 90)
        for name in ("Q1", "P2"):
            ours = sinking(poisson, name, 30)
            benchmark, quantity = (
                f"Example 1, nu = {poisson}, reduced",
                f"u_2(1.5, 1), {name} on 30 x 10",
            )
            yield Row(benchmark, quantity, "Q2 on 90 x 30", reference, ours, 5e-3)


def stresses() -> Iterator[Row]:
    """A quarter of a cylinder in plane strain under internal pressure: the extremes of Lame's
    stress, at the bore.
    """
    outer, inner, pressure, poisson = 3.0, 1.5, 2.0, 0.3
    parameters = {"radius": outer, "thickness": outer - inner, "angle": 90.0, "symmetric": True}
    parameters |= {"size": 0.1, "contact_size": 0.1, "order": 2}
    solution = alone(
        parse_scene(
            {
                "mesh": {"generator": "ring_segment", "parameters": parameters},
                "element": {"degree": 2},
                "material": {"young": 1000.0, "poisson": poisson},
                "displacement": [
                    {"boundary": name, "normal": 0.0} for name in ("symmetry", "right")
                ],
                "traction": {"boundary": "inner", "pressure": pressure},
            }
        )
    )
    mean = pressure * inner**2 / (outer**2 - inner**2)
    hoop, radial, out = mean * (1 + (outer / inner) ** 2), -pressure, 2 * poisson * mean
    mises = math.sqrt(((hoop - radial) ** 2 + (radial - out) ** 2 + (out - hoop) ** 2) / 2)
    found = solution.stress.recovered
    for name, exact, ours in (
        ("largest von Mises stress", mises, found.largest().value),
        ("largest principal stress", hoop, found.largest("principal", 0).value),
        ("smallest principal stress", radial, found.smallest().value),
        ("largest stress out of the plane", out, found.largest("zz").value),
    ):
        yield Row(
            "Cylinder under pressure, P2", f"{name}, recovered", "Lame's formula", exact, ours, 2e-3
        )
    # Half of the body: the pressure on the cut of the bore.
    held = solution.resultants.of("symmetry")
    yield Row(
        "Cylinder under pressure, P2",
        "force on the cut",
        "statics",
        pressure * inner,
        float(-held.force[0]),
        1e-9,
    )


def standing() -> Iterator[Row]:
    """A block that its weight holds against a push at half its height."""
    push = 0.2 * FRICTION * LOAD * 3.0
    loads = {"traction": [{"boundary": "top", "y": -LOAD}, {"boundary": "left", "x": push}]}
    used = alone(block(loads)).friction_used
    assert used is not None
    yield Row("A block that is pushed", "friction used", "push over F N", 0.2, used, 1e-6)


BENCHMARKS = (patch_tests, hertz, example1, friction, incompressible, stresses, standing)


def rows() -> list[Row]:
    """Everything."""
    return [row for benchmark in BENCHMARKS for row in benchmark()]


def table(found: list[Row]) -> list[list[str]]:
    """The columns and the rows of the file."""
    lines = [["benchmark", "quantity", "reference", "source", "ours", "difference", "tolerance"]]
    for row in found:
        reference = f"{row.reference:{row.form}}" if row.reference else "0"
        tolerance = f"{row.tolerance:.0e}" if row.holds else f"{row.tolerance:.0e} missed"
        numbers = [
            reference,
            row.source,
            f"{row.ours:{row.form}}",
            f"{row.difference:.0e}",
            tolerance,
        ]
        lines.append([row.benchmark, row.quantity, *numbers])
    return lines


def main(arguments: Sequence[str] = ()) -> int:
    """Print the table; 1 if a number is not within its tolerance."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--write", action="store_true", help=f"write {TABLE.name}")
    writing = parser.parse_args(arguments).write
    found = rows()
    if writing:
        with TABLE.open("w", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows(table(found))
    for line in table(found):
        print(" | ".join(line))
    missed = sum(not row.holds for row in found)
    print(f"\n{len(found) - missed} of {len(found)} within the tolerance")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
