"""How good the forecasts of the line ``cost`` are: what the next error was said to take, over what it then took.

    ./env python3 demos/studies/forecasts.py --out docs/evidence/forecasts.csv

Each problem is solved on a coarse mesh, which foretells unknowns and seconds for a smaller error.  The mesh with so
many unknowns is then made and solved.  From its error, and the rate between both meshes, follow the unknowns and the
seconds that the smaller error needs.  Problems *by list* request an accuracy, and then one ten times better: needed is
what that run had taken when its error was as small as foretold.  All errors are estimates;
docs/evidence/effectivity.csv says how good these are.  Each problem runs in a process of its own with its forms
compiled; seconds are those of one core, of several rounds the fewest.  The last rows have the median and the range of
each kind.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

# Rounds of which the fastest counts: on the coarse mesh, and on the fine one.
COARSE_ROUNDS, FINE_ROUNDS = 5, 2


@dataclass(frozen=True)
class Problem:
    """One that can be solved on a mesh as fine as is wanted.

    Attributes:
        kind: of the body.
        name: of the problem.
        solved: gives the solution on cells so many times as small as those of the first mesh.
    """

    kind: str
    name: str
    solved: Callable[[float], Any]


def _scene(scene: Any, first: float = 1.0) -> Callable[[float], Any]:
    """Of a scene from generators, the cells of whose first mesh are ``first`` times as large as its own."""
    from mpi4py import MPI

    from signorini_fx import solve
    from signorini_fx.mesh.hierarchy import scene_on

    return lambda finer: solve(scene_on(scene, first / finer), MPI.COMM_SELF)


def _parsed(
    cells: tuple[int, int], size: tuple[float, float] = (3.0, 1.0), cell: str = "quadrilateral", **data: Any
) -> Any:
    from signorini_fx.scene.reading import parse_scene

    mesh = {
        "generator": "rectangle",
        "parameters": {"length": size[0], "height": size[1], "nx": cells[0], "ny": cells[1], "cell": cell},
    }
    material = {"young": 5000.0, "poisson": 0.3, **data.pop("material", {})}
    return parse_scene({"mesh": mesh, "material": material, **data})


TRESCA, COULOMB = {"law": "tresca", "bound": 1.5}, {"law": "coulomb", "coefficient": 0.3}


def _plane() -> list[tuple[str, Callable[[float], Any]]]:
    """Scenes of the demos, a block that stands on its base, and random ones."""
    import random_scenes
    from mpi4py import MPI
    from cases import scene_of

    from signorini_fx import solve

    example = scene_of("example1_coulomb")
    contact = example.contact[0]
    smooth = example.model_copy(update={"contact": (contact.model_copy(update={"friction": _no_friction()}),)})
    quadratic = example.model_copy(update={"element": example.element.model_copy(update={"degree": 2})})
    base = {"displacement": {"boundary": "top", "x": 0.01, "y": -0.02}}
    standing = {
        f"flat base, {name}": _parsed((24, 8), contact={"boundary": "bottom", "friction": law}, **base)
        for name, law in (("Coulomb 0.3", COULOMB), ("Coulomb 1", {"law": "coulomb", "coefficient": 1.0}))
    }
    problems = [
        ("Example 1, Tresca", _scene(scene_of("example1_tresca"), 4)),
        ("Example 1, Coulomb", _scene(example, 4)),
        ("Example 1, frictionless", _scene(smooth, 4)),
        ("Example 1, Coulomb, degree 2", _scene(quadratic, 8)),
        ("Example 2, Tresca", _scene(scene_of("example2_tresca"), 4)),
        ("Hertz", _scene(scene_of("hertz"), 2)),
        ("Hertz, friction", _scene(scene_of("hertz_friction"), 4)),
        ("rubber mount, four load steps", _scene(scene_of("rubber_mount"))),
        *((name, _scene(scene)) for name, scene in standing.items()),
    ]
    drawn = random_scenes.scenes(7, 9)
    for degree, numbers in ((1, slice(0, 5)), (2, slice(5, 9))):
        for one in drawn[numbers]:

            def solved(finer: float, one: Any = one, degree: int = degree) -> Any:
                return solve(random_scenes.on(one, 0.5 * degree / finer, degree), MPI.COMM_SELF)

            problems.append((f"random {one.name}, degree {degree}", solved))
    return problems


def _no_friction() -> Any:
    from signorini_fx.laws.none import NoFriction

    return NoFriction()


def _rings() -> list[tuple[str, Callable[[float], Any]]]:
    """Bodies of revolution: a ball, a cylinder that stands, and one with a crown."""
    turned = {"material": {"hypothesis": "axisymmetric"}}
    axis = {"boundary": "left", "x": 0.0}
    down = [axis, {"boundary": "top", "x": 0.0, "y": -0.02}]
    crown = "0.02 * x[0]**2"

    def cylinder(gap: Any, friction: Any = None, degree: int = 1, cells: tuple[int, int] = (16, 16)) -> Any:
        contact = {"boundary": "bottom", "gap": gap, **({"friction": friction} if friction else {})}
        return _parsed(cells, (1.0, 1.0), displacement=down, contact=contact, element={"degree": degree}, **turned)

    return [
        ("crowned cylinder", _scene(cylinder(crown))),
        ("crowned cylinder, Tresca", _scene(cylinder(crown, TRESCA))),
        ("crowned cylinder, Coulomb", _scene(cylinder(crown, COULOMB))),
        ("crowned cylinder, Coulomb, degree 2", _scene(cylinder(crown, COULOMB, 2, (8, 8)))),
        ("flat cylinder", _scene(cylinder(0.0))),
        ("flat cylinder, Coulomb", _scene(cylinder(0.0, COULOMB))),
    ]


def _space() -> list[tuple[str, Callable[[float], Any]]]:
    """The block, the ball and the brick of ``accuracy_in_space``."""
    import accuracy_in_space
    from mpi4py import MPI

    from signorini_fx import solve

    def of(name: str, first: float) -> Callable[[float], Any]:
        scene = accuracy_in_space.SCENES[name]()
        return lambda finer: solve(accuracy_in_space.on_mesh(scene, first / finer), MPI.COMM_SELF)

    names = ("block, Q1", "block, Tresca, P1", "block, Coulomb, Q1", "sphere, P1", "sphere, Q1", "brick, Q1")
    return [(name, of(name, 2.0)) for name in names]


def _bodies() -> list[tuple[str, Callable[[float], Any]]]:
    """A body on another one: equal or wider, softer, crowned, with friction, bodies of revolution."""
    from signorini_fx.scene.reading import parse_scene

    def pair(gap: Any, *, wide: float = 3.0, friction: Any = None, degree: int = 1, turned: bool = False) -> Any:
        hypothesis = {"hypothesis": "axisymmetric"} if turned else {}

        def body(name: str, length: float, shift: list[float], nx: int, ny: int) -> dict[str, Any]:
            parameters = {"length": length, "height": 1.0, "nx": nx, "ny": ny}
            return {"name": name, "shift": shift, "mesh": {"generator": "rectangle", "parameters": parameters}}

        beside = 0.0 if turned else -(wide - 2.0) / 2
        axis = [{"boundary": f"{name}.left", "x": 0.0} for name in ("upper", "lower")] if turned else []
        return parse_scene(
            {
                "body": [
                    body("upper", 2.0, [0.0, 1.0], 16, 8),
                    body("lower", wide, [beside, 0.0], round(10 * wide), 10),
                ],
                "element": {"degree": degree},
                "material": [
                    {"region": "upper", "young": 200.0, "poisson": 0.3, **hypothesis},
                    {"region": "lower", "young": 600.0, "poisson": 0.2, **hypothesis},
                ],
                "displacement": [
                    *axis,
                    {"boundary": "lower.bottom", "x": 0.0, "y": 0.0},
                    {"boundary": "upper.top", "x": 0.0, "y": -0.05},
                ],
                "contact": {
                    "boundary": "upper.bottom",
                    "against": "lower.top",
                    "gap": gap,
                    **({"friction": friction} if friction else {}),
                },
            }
        )

    crown, middle = "0.05 * (x[0] - 1)**2", "0.05 * x[0]**2"
    return [
        ("crowned on a block", _scene(pair(crown))),
        ("crowned on a block, Coulomb", _scene(pair(crown, friction=COULOMB))),
        ("crowned on a block, degree 2", _scene(pair(crown, degree=2), 2)),
        ("edges on a block", _scene(pair(0.0))),
        ("edges on a block, Coulomb", _scene(pair(0.0, friction=COULOMB))),
        ("of revolution", _scene(pair(middle, turned=True))),
    ]


def _forms() -> list[tuple[str, Callable[[float], Any]]]:
    """A block over a bowl and a box over another one, as forms in UFL."""
    return [
        ("block, frictionless", _form((3.0, 1.0), (30, 10), None)),
        ("block, Tresca, Q1", _form((3.0, 1.0), (30, 10), "tresca", quadrilaterals=True)),
        ("block, Coulomb", _form((3.0, 1.0), (30, 10), "coulomb")),
        ("block, Coulomb, degree 2", _form((3.0, 1.0), (15, 5), "coulomb", degree=2)),
    ]


def _form(
    sizes: tuple[float, ...], counts: tuple[int, ...], law: str | None, *, degree: int = 1, quadrilaterals: bool = False
) -> Callable[[float], Any]:
    def solved(finer: float) -> Any:
        import numpy as np
        import ufl
        from mpi4py import MPI
        from dolfinx import mesh as dmesh
        from dolfinx.fem import dirichletbc, functionspace, locate_dofs_topological

        from signorini_fx import ContactProblem, Coulomb, Foundation, Tresca

        kind = dmesh.CellType.quadrilateral if quadrilaterals else dmesh.CellType.triangle
        cells = [round(count * finer) for count in counts]
        mesh = dmesh.create_rectangle(MPI.COMM_SELF, [[0.0, 0.0], list(sizes)], cells, kind)
        V = functionspace(mesh, ("Lagrange", degree, (2,)))
        u, v, x = ufl.TrialFunction(V), ufl.TestFunction(V), ufl.SpatialCoordinate(mesh)

        def stress(y: Any) -> Any:
            e = ufl.sym(ufl.grad(y))
            return 5000.0 / 1.4 * (e + 0.4 / 0.2 * ufl.tr(e) * ufl.Identity(2))

        def side(axis: int, at: float) -> Any:
            return dmesh.locate_entities_boundary(mesh, 1, lambda x: np.isclose(x[axis], at))

        held = [dirichletbc(np.zeros(2), locate_dofs_topological(V, 1, side(0, at)), V) for at in (0.0, sizes[0])]
        top = dmesh.meshtags(mesh, 1, side(1, sizes[1]), np.full(side(1, sizes[1]).size, 1, np.int32))
        load = ufl.conditional(abs(x[0] - 1.5) <= 0.5, -20.0, 0.0) * v[1] * ufl.ds(subdomain_data=top)(1)
        friction = {"tresca": Tresca(1.5), "coulomb": Coulomb(0.3)}.get(law or "")
        gap = lambda x: 0.003 * (x[0] - 1.5) ** 2 + 0.001  # noqa: E731
        contact = Foundation(side(1, 0.0), gap=gap, **({"friction": friction} if friction else {}))
        problem = ContactProblem(ufl.inner(stress(u), ufl.grad(v)) * ufl.dx, load, held, contact, stress=stress)
        problem.solve()
        return problem.solution

    return solved


def _listed() -> list[tuple[str, Callable[[float], Any]]]:
    """Scenes with a requested accuracy, and with one so many times better."""
    from mpi4py import MPI
    from cases import scene_of

    from signorini_fx import Accuracy, solve

    def of(scene: Any, error: str, target: float) -> Callable[[float], Any]:
        def solved(better: float) -> Any:
            goal = Accuracy(target=target / better, of=error)
            return solve(scene.model_copy(update={"accuracy": goal}), MPI.COMM_SELF)

        return solved

    wanted = [
        ("example1_tresca", "energy", 0.1),
        ("example1_tresca", "pressure", 0.05),
        ("example1_coulomb", "pressure", 0.05),
        ("example2_tresca", "energy", 0.1),
        ("hertz", "energy", 0.1),
        ("hertz", "peak", 0.1),
    ]
    return [(f"{name}, {error}", of(scene_of(name), error, target)) for name, error, target in wanted]


KINDS = {
    "plane": _plane,
    "rings": _rings,
    "space": _space,
    "two bodies": _bodies,
    "forms": _forms,
    "by list": _listed,
}


def problems(kind: str) -> list[Problem]:
    """Those of a kind."""
    return [Problem(kind, name, solved) for name, solved in KINDS[kind]()]


def _seconds(solution: Any) -> float:
    if solution.price_list:
        return float(sum(price.seconds for price in solution.price_list if not price.predicted))
    return float(sum(solution.timings.total.values()))


def _fastest(solved: Callable[[float], Any], finer: float, rounds: int) -> Any:
    return min((solved(finer) for _ in range(rounds)), key=_seconds)


def row_of(problem: Problem) -> dict[str, Any]:
    """What was foretold, and what was needed."""
    time.perf_counter = time.process_time  # other programs take no part of it
    problem.solved(1.0)  # compiles forms and loads libraries
    coarse = _fastest(problem.solved, 1.0, COARSE_ROUNDS)
    cost, dimension = coarse.cost, coarse.discretisation.tagged.dimension
    unknowns, seconds = _by_list(problem, cost) if coarse.price_list else _on_mesh(problem, cost, dimension)
    low, high = cost.next_seconds
    foretold = math.sqrt(low * high)
    return {
        "kind": problem.kind,
        "problem": problem.name,
        "unknowns": cost.dofs,
        "of": cost.of,
        "error": f"{cost.error:.2e}",
        "next error": f"{cost.next_error:.2e}",
        "unknowns foretold": f"{cost.next_dofs:.2g}",
        "needed": f"{unknowns:.2g}",
        "unknowns, ratio": f"{cost.next_dofs / unknowns:.2f}",
        "seconds foretold": f"{low:.2g} to {high:.2g}",
        "seconds needed": f"{seconds:.2g}",
        "seconds, ratio": f"{foretold / seconds:.2f}",
        "within": "yes" if low <= seconds <= high else "no",
    }


def _on_mesh(problem: Problem, cost: Any, dimension: int) -> tuple[float, float]:
    """Unknowns and seconds that the next error needs, from the mesh with as many unknowns as were foretold."""
    finer = (cost.next_dofs / cost.dofs) ** (1 / dimension)
    finer = round(finer) if dimension == 2 else finer  # whole multiples keep the nodes where loads jump
    fine = _fastest(problem.solved, finer, FINE_ROUNDS)
    dofs, error = fine.discretisation.dofs, fine.stress.error
    rate = math.log(cost.error / error) / math.log(dofs / cost.dofs)
    needed = dofs * (error / cost.next_error) ** (1 / rate)
    power = max(math.log(_seconds(fine) / cost.seconds) / math.log(dofs / cost.dofs), 0.0)
    return needed, _seconds(fine) * (needed / dofs) ** power


def _by_list(problem: Problem, cost: Any) -> tuple[float, float]:
    """The same from the price list of a run to a better accuracy."""
    fine = _fastest(problem.solved, cost.error / cost.next_error, FINE_ROUNDS)
    rows = [price for price in fine.price_list if not price.predicted and getattr(price, cost.of)]
    spent = {price.level: sum(row.seconds for row in fine.price_list[: price.level + 1]) for price in rows}
    for before, after in pairwise(rows):
        errors = getattr(before, cost.of), getattr(after, cost.of)
        if errors[1] <= cost.next_error:
            share = math.log(max(errors[0] / cost.next_error, 1.0)) / math.log(errors[0] / errors[1])
            share = min(max(share, 0.0), 1.0)
            dofs = before.dofs * (after.dofs / before.dofs) ** share
            return dofs, spent[before.level] + share * (spent[after.level] - spent[before.level])
    return float(rows[-1].dofs), spent[rows[-1].level]


def spread(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """A row for each kind, and one for all on one mesh: median, smallest and largest ratio."""
    groups = {kind: [row for row in rows if row["kind"] == kind] for kind in KINDS}
    groups["on one mesh"] = [row for row in rows if row["kind"] != "by list"]
    summary = []
    for kind, group in groups.items():
        if not group:
            continue
        entry = dict.fromkeys(rows[0], "")
        entry |= {"kind": "all", "problem": f"{kind}, {len(group)}: median, from to"}
        for column in ("unknowns, ratio", "seconds, ratio"):
            ratios = [float(row[column]) for row in group]
            entry[column] = f"{statistics.median(ratios):.2f}, {min(ratios):.2f} to {max(ratios):.2f}"
        entry["within"] = f"{sum(row['within'] == 'yes' for row in group)} of {len(group)}"
        summary.append(entry)
    return summary


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("results/forecasts.csv"), help="file (default: %(default)s)")
    parser.add_argument("--kind", choices=KINDS, action="append", help="only these")
    parser.add_argument("--one", nargs=2, metavar=("KIND", "NUMBER"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        kind, number = options.one
        print(json.dumps(row_of(problems(kind)[int(number)])))
        return
    from signorini_fx.csv_text import write_csv

    rows = []
    for kind in options.kind or KINDS:
        for number in range(len(KINDS[kind]())):
            command = [sys.executable, __file__, "--one", kind, str(number)]
            ended = subprocess.run(command, capture_output=True, text=True, check=True)
            rows.append(json.loads(ended.stdout.splitlines()[-1]))
            print(*rows[-1].values(), sep="  ", flush=True)
    write_csv(options.out, rows + spread(rows))


if __name__ == "__main__":
    main()
