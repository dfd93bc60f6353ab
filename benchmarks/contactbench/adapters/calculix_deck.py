"""Runs CalculiX (``ccx``, or what CCX in the environment names): a deck, soft contact with a fixed
block of elements.

The foundation is a layer of elements along the contact boundary, whose nodes are fixed: their
reactions are the contact forces.  Plane elements of CalculiX are bricks inside.
"""

from __future__ import annotations

import os
import re
import resource
import shutil
import subprocess
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ..answers import Answer, CannotRun, ContactForces
from ..elasticity import nodal_loads, nodal_weights, prescribed, values_at
from ..grids import Grid
from ..mesh_files import ABAQUS, FACES, field, inp_lines
from ..problem import Problem

Floats = npt.NDArray[np.float64]
# Stiffness of contact per area in units of E over the shortest facet, and that of sticking in units
# of that of contact.
_STIFF, _STICK = 50.0, 0.1
_SECONDS = 600.0


def available() -> None:
    """Raise ``CannotRun`` where the program is not there."""
    if _program() is None:
        raise CannotRun("there is no ccx: apt install calculix-ccx, or name it in CCX")


def _program() -> str | None:
    return shutil.which(os.environ.get("CCX", "ccx"))


def solve(problem: Problem, grid: Grid) -> Answer:
    """Solve a problem on a mesh.

    Raises:
        CannotRun: two bodies, Tresca friction, or an incompressible body.
        RuntimeError: ccx has not solved the deck; the end of what it printed.
    """
    if problem.dynamic or problem.finite:
        raise CannotRun("this adapter has small deformations, and no inertia")
    if any(contact.against for contact in problem.contacts) or len(problem.contacts) > 1:
        raise CannotRun("forces between two bodies are not among the nodal results of CalculiX")
    if problem.contacts[0].law == "tresca":
        raise CannotRun("CalculiX has no Tresca friction")
    if any(body.poisson == 0.5 for body in problem.bodies):
        raise CannotRun("CalculiX has no elements for incompressible linear elasticity")
    lines = deck(problem, grid)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "job.inp").write_text("\n".join(lines) + "\n", encoding="utf-8")
        start = _used()
        environment = os.environ | {"OMP_NUM_THREADS": "1", "CCX_NPROC_EQUATION_SOLVER": "1"}
        command = [_program() or "ccx", "job"]
        done = subprocess.run(
            command,
            cwd=folder,
            capture_output=True,
            text=True,
            env=environment,
            check=False,
            timeout=_SECONDS,
        )
        seconds = _used() - start
        data = folder / "job.dat"
        text = data.read_text(encoding="utf-8") if data.exists() else ""
    tables = _tables(text)
    # The step of each time lasts as long as one unit of time.
    last = [{kind: found.get(step) for kind, found in tables.items()} for step in _steps(problem)]
    if "*ERROR" in done.stdout or not all(all(found.values()) for found in last):
        said = re.findall(r"\*ERROR.*", done.stdout) or done.stdout.splitlines()[-1:]
        raise RuntimeError("ccx has not solved it: " + " ".join(" ".join(said).split()))
    *before, answer = [_answer(problem, grid, found, seconds) for found in last]
    return replace(answer, earlier=dict(zip(problem.times, before, strict=False)))


def _steps(problem: Problem) -> range:
    """Numbers of the load steps, which are the times at their ends."""
    return range(1, len(problem.times) + 1)


def _answer(
    problem: Problem, grid: Grid, tables: dict[str, dict[int, list[float]]], seconds: float
) -> Answer:
    """What the tables of one step say."""
    n, d = len(grid.points), problem.dimension
    u = np.array([tables["displacements"][node + 1][:d] for node in range(n)])
    contact = problem.contacts[0]
    own = grid.nodes(contact.boundary)
    force = np.array([tables["forces"].get(n + 1 + k, [0.0] * 3)[:d] for k in range(len(own))])
    # Axisymmetric elements are a sector of two degrees inside, whose reactions are printed.
    force *= 180.0 if problem.hypothesis == "axisymmetric" else 1.0
    direction = np.array([problem.number(c) for c in contact.direction])
    normal = -force @ direction
    friction = force + np.outer(normal, direction)
    weight = nodal_weights(problem, grid, contact.boundary)[own]
    forces = ContactForces(grid.points[own], weight, normal, friction)
    note = f"penalty {_penalty(problem, grid):.3g}"
    return Answer(u, {contact.boundary: forces}, u.size, seconds, note=note)


def _used() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _penalty(problem: Problem, grid: Grid) -> float:
    facets = grid.points[grid.facets[problem.contacts[0].boundary]]
    shortest = float(np.linalg.norm(facets - np.roll(facets, 1, axis=1), axis=2).min())
    return _STIFF * problem.bodies[0].young / shortest


def deck(problem: Problem, grid: Grid) -> list[str]:
    """The lines of the deck."""
    contact, d, n = problem.contacts[0], problem.dimension, len(grid.points)
    own = grid.nodes(contact.boundary)
    direction = np.array([problem.number(c) for c in contact.direction])
    gap, size = values_at(problem, contact.gap, grid.points[own]), np.ptp(grid.points, axis=0).max()
    surface = grid.points[own] + gap[:, None] * direction
    deep = surface + 0.05 * size * direction
    lines = inp_lines(grid, problem.hypothesis)
    lines += ["*NODE, NSET=GROUND"]
    lines += [
        f"{n + k}, {', '.join(map(field, point))}"
        for k, point in enumerate(np.concatenate([surface, deep]).tolist(), 1)
    ]
    number = {int(node): k for k, node in enumerate(own)}
    facets = np.vectorize(number.get)(grid.facets[contact.boundary]).astype(int)
    every = np.concatenate([surface, deep])
    corners = grid.cells.shape[1] if d == 3 else 4
    lines.append(f"*ELEMENT, TYPE={ABAQUS[problem.hypothesis, corners]}, ELSET=FLOOR")
    sides, first = [], len(grid.cells) + 1
    for k, facet in enumerate(facets):
        element = _element(facet, len(own), every)
        face = frozenset(facet.tolist())
        side = next(
            s
            for s, f in enumerate(FACES[corners], 1)
            if frozenset(element[list(f)].tolist()) == face
        )
        sides.append(f"{first + k}, S{side}")
        lines.append(f"{first + k}, {', '.join(str(n + 1 + node) for node in element.tolist())}")
    lines += ["*SURFACE, NAME=S_FLOOR, TYPE=ELEMENT", *sides]
    lines += [
        f"*NSET, NSET=EVERY, GENERATE\n1, {n}",
        f"*NSET, NSET=TOUCHED, GENERATE\n{n + 1}, {n + len(own)}",
    ]
    for k, body in enumerate(problem.bodies):
        lines += [f"*MATERIAL, NAME=M{k}", "*ELASTIC", f"{body.young!r}, {body.poisson!r}"]
        lines += [
            f"*SOLID SECTION, ELSET={body.name.upper()}, MATERIAL=M{k}",
            *(["1."] if d == 2 else []),
        ]
    lines += ["*SOLID SECTION, ELSET=FLOOR, MATERIAL=M0", *(["1."] if d == 2 else [])]
    penalty = _penalty(problem, grid)
    lines += [
        "*SURFACE INTERACTION, NAME=S",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR",
        f"{field(penalty)}",
    ]
    if contact.law == "coulomb":
        lines += [
            "*FRICTION",
            f"{problem.number(contact.coefficient)!r}, {field(_STICK * penalty)}",
        ]
    lines += [
        "*CONTACT PAIR, INTERACTION=S, TYPE=SURFACE TO SURFACE",
        f"S_{contact.boundary.upper()}, S_FLOOR",
    ]
    lines += ["*BOUNDARY", f"GROUND, 1, {d}"]
    for time in problem.times:
        lines += ["*STEP, INC=1000", "*STATIC", "1., 1."]
        fixed = prescribed(problem, grid, time).items()
        supports = [f"{node + 1}, {k + 1}, {k + 1}, {field(value)}" for (node, k), value in fixed]
        lines += ["*BOUNDARY", *supports] if supports else []
        loads = nodal_loads(problem, grid, time)
        forces = [
            f"{node + 1}, {k + 1}, {field(loads[node, k])}"
            for node, k in zip(*(part.tolist() for part in np.nonzero(loads)), strict=True)
        ]
        lines += ["*CLOAD, OP=NEW" if len(problem.times) > 1 else "*CLOAD"] if forces else []
        lines += [*forces, "*NODE PRINT, NSET=EVERY", "U", "*NODE PRINT, NSET=TOUCHED", "RF"]
        lines.append("*END STEP")
    return lines


def _element(facet: npt.NDArray[np.int64], below: int, x: Floats) -> npt.NDArray[np.int64]:
    """Nodes of an element on a facet of the foundation, in the order of Abaqus."""
    if len(facet) == 2:
        found = np.array([facet[0] + below, facet[1] + below, facet[1], facet[0]])
        a, b, c = x[found[0]], x[found[1]], x[found[2]]
        return found if (b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0] > 0 else found[::-1]
    found = np.concatenate([facet + below, facet])
    a, b, c, e = (x[found[k]] for k in (0, 1, 3, 4))
    return found if np.cross(b - a, c - a) @ (e - a) > 0 else found[[0, 3, 2, 1, 4, 7, 6, 5]]


def _tables(text: str) -> dict[str, dict[float, dict[int, list[float]]]]:
    """The tables of each kind that ccx printed, by time and node."""
    found: dict[str, dict[float, dict[int, list[float]]]] = {"displacements": {}, "forces": {}}
    rows: dict[int, list[float]] = {}
    for line in text.splitlines():
        head = re.match(r" (displacements|forces) .* time +(\S+)", line)
        if head:
            rows = found[head[1]][float(head[2])] = {}
        elif re.match(r"\s+\d+\s+-?\d\.\d+E", line):
            words = line.split()
            rows[int(words[0])] = [float(word) for word in words[1:]]
    return found
