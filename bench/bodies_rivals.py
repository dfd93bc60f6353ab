"""Two bodies in space: GetFEM, Kratos and CalculiX solve the same scene on the same meshes, one after another.

    ./env python3 bench/bodies_rivals.py [--cells 10,20] [--laws frictionless,coulomb] [--rounds 3] [--kratos DIR]
                                         [--ccx PROGRAM]

The upper one of two blocks of hexahedra that do not match, with paraboloids between them, is pressed and pushed by its
top onto the lower one, whose bottom is held.  Answers are compared before times: the force on the top, and the
displacements of all nodes.  Times are CPU times of one thread, of CalculiX from its deck, of the others from the meshes
in memory to the solution, without starting Python and compiling forms.  A program that is not there is passed over.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import calculix
import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from scipy.spatial import cKDTree

from signorini_fx import solve
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene

Floats = npt.NDArray[np.float64]

# The softer and finer body is the upper one, which every program is given as the slave.
BODIES = {"upper": {"young": 500.0, "poisson": 0.3}, "lower": {"young": 1000.0, "poisson": 0.25}}
PUSHED = (0.0015, 0.0, -0.003)  # the displacement of the top
COEFFICIENTS = {"frictionless": 0.0, "coulomb": 0.3}
_RISE = 0.01  # of each paraboloid, times the distance from the middle squared
_APART = 1e-9  # so that nodes of both bodies can be told apart by their places
# CalculiX has soft contact; stiffness per area, and of sticking.
_CONTACT, _STICK = 1e6, 1e5
_WARM = 4  # cells of the solve that compiles forms


@dataclass(frozen=True)
class Answer:
    """Of a program.

    Attributes:
        u: displacements of the nodes, the upper body's first, shape (n, 3).
        force: on the top, shape (3,).
        cpu: seconds.
        note: steps, or what else there is to say.
    """

    u: Floats
    force: Floats
    cpu: float
    note: str

    def far(self, other: Answer) -> tuple[float, float]:
        """Differences of force and displacement, relative to the largest of this one."""
        force = np.linalg.norm(other.force - self.force) / np.linalg.norm(self.force)
        u = np.linalg.norm(other.u - self.u, axis=1).max() / np.linalg.norm(self.u, axis=1).max()
        return float(force), float(u)


def meshes(cells: int) -> dict[str, Any]:
    """Of both bodies: points, cells (corners as in Abaqus), facets of the contact (outward), nodes that are held."""
    found: dict[str, Any] = {}
    for name, count, side, heights in (
        ("upper", cells, (0.0, 1.0), (_RISE, 0.5)),
        ("lower", 4 * cells // 5, (-0.1, 1.1), (-0.5, -_RISE)),
    ):
        at, up = np.linspace(*side, count + 1), np.linspace(0.0, 1.0, count // 2 + 1)
        z, y, x = np.stack(np.meshgrid(up, at, at, indexing="ij")).reshape(3, -1)
        round_off = (x - 0.5) ** 2 + (y - 0.5) ** 2
        low, high = (heights[0] * round_off, heights[1]) if name == "upper" else (heights[0], heights[1] * round_off)
        layer, around = (count + 1) ** 2, np.array([0, 1, count + 2, count + 1])
        k, j, i = np.stack(np.meshgrid(*map(np.arange, (count // 2, count, count)), indexing="ij")).reshape(3, -1)
        first = i + j * (count + 1) + k * layer
        bottom, top = (first[part, None] + around for part in (k == 0, k == k.max()))
        top = top + layer
        contact, held = (bottom[:, ::-1], top) if name == "upper" else (top, bottom)
        found |= {
            f"{name}_points": np.column_stack((x, y, low + (high - low) * z + (name == "upper") * _APART)),
            f"{name}_cells": first[:, None] + np.concatenate((around, layer + around)),
            f"{name}_contact": contact,
            f"{name}_held": np.unique(held),
        }
    return found


def deck(made: dict[str, Any], coefficient: float) -> str:
    """As an Abaqus deck, which the package reads the mesh of."""
    lines, sets, start, count = ["*NODE"], list[str](), 1, 1
    elements = list[str]()
    for name in BODIES:
        points, cells, held = (made[f"{name}_{what}"] for what in ("points", "cells", "held"))
        lines += [f"{n}, {a:.12g}, {b:.12g}, {c:.12g}" for n, (a, b, c) in enumerate(points.tolist(), start)]
        elements.append(f"*ELEMENT, TYPE=C3D8, ELSET={name.upper()}")
        elements += [f"{n}, {', '.join(map(str, row))}" for n, row in enumerate((cells + start).tolist(), count)]
        layer, last = len(made[f"{name}_contact"]), count + len(cells) - 1
        for where, first, face in (("LOW", count, "S1"), ("HIGH", last - layer + 1, "S2")):
            sets += [f"*ELSET, ELSET={name.upper()}{where}, GENERATE", f"{first}, {first + layer - 1}"]
            role = "CONTACT" if (where == "LOW") == (name == "upper") else "HELD"
            sets += [f"*SURFACE, NAME={name.upper()}_{role}", f"{name.upper()}{where}, {face}"]
        sets += [f"*NSET, NSET={name.upper()}_NODES", *(f"{node}," for node in (held + start).tolist())]
        material = BODIES[name]
        sets += [f"*MATERIAL, NAME=OF_{name.upper()}", "*ELASTIC", f"{material['young']}, {material['poisson']}"]
        sets.append(f"*SOLID SECTION, ELSET={name.upper()}, MATERIAL=OF_{name.upper()}")
        start, count = start + len(points), last + 1
    rest = ["*SURFACE INTERACTION, NAME=S", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{_CONTACT}"]
    rest += ["*FRICTION", f"{coefficient}, {_STICK}"] if coefficient else []
    rest += ["*CONTACT PAIR, INTERACTION=S, TYPE=SURFACE TO SURFACE", "UPPER_CONTACT, LOWER_CONTACT"]
    rest += ["*BOUNDARY", "LOWER_NODES, 1, 3", "*STEP", "*STATIC", "1., 1.", "*BOUNDARY"]
    rest += [f"UPPER_NODES, {k}, {k}, {u}" for k, u in enumerate(PUSHED, 1)]
    rest += ["*NODE PRINT, NSET=UPPER_NODES, TOTALS=ONLY", "RF", "*END STEP"]
    return "\n".join([*lines, *elements, *sets, *rest]) + "\n"


def package(path: Path, law: str, points: Floats, linear_algebra: str) -> Answer:
    """The whole solve, from the mesh in memory to the certificate."""
    scene = parse_scene(
        {
            "mesh": {"file": str(path)},
            "material": [{"region": name.upper(), **material} for name, material in BODIES.items()],
            "displacement": [
                {"boundary": "UPPER_HELD", **dict(zip("xyz", PUSHED, strict=True))},
                {"boundary": "LOWER_HELD", **dict.fromkeys("xyz", 0.0)},
            ],
            "contact": {
                "boundary": "UPPER_CONTACT",
                "against": "LOWER_CONTACT",
                "friction": {"law": "coulomb", "coefficient": COEFFICIENTS[law]}
                if law == "coulomb"
                else {"law": "none"},
            },
            "solver": {"linear_algebra": linear_algebra, "coulomb": "newton"},
        }
    )
    scene = scene.model_copy(update={"mesh": load_mesh(scene, MPI.COMM_SELF)})
    gc.collect()
    start = time.process_time()
    solution = solve(scene, MPI.COMM_SELF, check=False)
    cpu = time.process_time() - start
    if not solution.converged:
        raise RuntimeError(f"the package has no solution: {solution.status}")
    space = solution.displacement.function_space
    node = cKDTree(space.tabulate_dof_coordinates()).query(points)[1]
    u = solution.displacement.x.array.reshape(-1, 3)[node]
    force = -np.array(solution.resultants.of("UPPER_CONTACT").force)
    note = f"{solution.history.linear_solves} solves, {solution.linear_algebra.split(':')[0]}"
    return Answer(u, force, cpu, note)


def in_process(program: str, data: Path, law: str, path: str = "") -> Answer | str:
    """A rival's script in a process of its own; a text where it has no answer."""
    script = Path(__file__).with_name(f"bodies_{program}.py")
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, (path, os.environ.get("PYTHONPATH"))))
    command = [sys.executable, str(script), str(data), str(COEFFICIENTS[law])]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=data.parent, check=False)
    if done.returncode:
        lines = (done.stderr or done.stdout or f"exit code {done.returncode}").strip().splitlines()
        return "not installed" if "ModuleNotFoundError" in done.stderr else lines[-1]
    said = json.loads(done.stdout.splitlines()[-1])
    return Answer(np.array(said["u"]), np.array(said["force"]), said["cpu"], said["note"])


def of_calculix(program: str, path: Path, points: Floats) -> Answer | str:
    """CalculiX's answer from the deck; a text where it has none."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            x, u, force, cpu = calculix.ccx(program, path, Path(folder), plane=False)
        except FileNotFoundError:
            return "not installed"
        except RuntimeError as error:
            return str(error).splitlines()[0]
    return Answer(u[cKDTree(x).query(points)[1]], force, cpu, "its own steps")


def rows(
    sizes: Sequence[int], laws: Sequence[str], kratos: str, ccx: str, linear_algebra: str, rounds: int
) -> Iterator[str]:
    """The table, row by row; the programs take turns, and medians count."""
    yield "| law | unknowns | program | force | its difference | difference of u | CPU s | times faster | |"
    yield "|---|---|---|---|---|---|---|---|---|"
    with tempfile.TemporaryDirectory() as folder:
        path, data = Path(folder) / "bodies.inp", Path(folder) / "bodies.npz"
        for cells in (_WARM, *sizes):
            made = meshes(cells)
            points = np.concatenate([made[f"{name}_points"] for name in BODIES])
            properties = {f"{name}_{key}": value for name, of in BODIES.items() for key, value in of.items()}
            np.savez(data, pushed=PUSHED, **made, **properties)
            for law in laws:
                path.write_text(deck(made, COEFFICIENTS[law]), encoding="utf-8")
                contestants: dict[str, Callable[[], Answer | str]] = {
                    "the package": lambda law=law, points=points: package(path, law, points, linear_algebra),
                    "GetFEM": lambda law=law: in_process("getfem", data, law),
                    "Kratos": lambda law=law: in_process("kratos", data, law, kratos),
                    "CalculiX": lambda points=points: of_calculix(ccx, path, points),
                }
                if cells == _WARM:
                    contestants["the package"]()
                    continue
                turns = [{name: run() for name, run in contestants.items()} for _ in range(rounds)]
                ours = [turn["the package"] for turn in turns]
                for name in contestants:
                    yield f"| {law} | {points.size} | {name} {_row(ours, [turn[name] for turn in turns])} |"


def _row(ours: Sequence[Any], found: Sequence[Any]) -> str:
    """The answers of a program beside those of the package in the same rounds."""
    if missing := [one for one in found if isinstance(one, str)]:
        return f"| | | | | | {missing[0]}"
    last = found[-1]
    across, down = np.linalg.norm(last.force[:2]), -last.force[2]
    cpu, faster = (
        float(np.median(of))
        for of in ([one.cpu for one in found], [b.cpu / a.cpu for a, b in zip(ours, found, strict=True)])
    )
    row = f"| {across:.4f}, {down:.4f} "
    if last is ours[-1]:
        return f"{row}| | | {cpu:.2f} | | {last.note}"
    force, u = ours[-1].far(last)
    return f"{row}| {100 * force:.1f} % | {100 * u:.1f} % | {cpu:.2f} | {faster:.1f} | {last.note}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare, and print what was found."""
    parser = argparse.ArgumentParser(prog="bench/bodies_rivals.py", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--cells", default="10,20", metavar="N,...", help="multiples of ten along the upper block")
    parser.add_argument("--laws", default=",".join(COEFFICIENTS), metavar="LAW,...")
    parser.add_argument("--rounds", type=int, default=3, metavar="N", help="of the programs in turn (3)")
    parser.add_argument("--kratos", default="", metavar="DIR", help="where pip has installed Kratos")
    parser.add_argument("--linear-algebra", default="auto", help="of the package (auto)")
    parser.add_argument("--ccx", default=os.environ.get("CCX", "ccx"), metavar="PROGRAM")
    given = parser.parse_args(arguments)
    sizes = [int(word) for word in given.cells.split(",")]
    laws = given.laws.split(",")
    if unknown := set(laws) - set(COEFFICIENTS):
        parser.error(f"no law {', '.join(sorted(unknown))}: there are {', '.join(COEFFICIENTS)}")
    options = given.kratos, given.ccx, given.linear_algebra, given.rounds
    for row in rows(sizes, laws, *options):
        print(row, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
