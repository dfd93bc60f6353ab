"""Nonlinear bodies in contact: felupe and CalculiX solve the same problems on the same meshes, one after another.

    ./env python3 bench/nonlinear_rivals.py [--problems disk,seal] [--scale 1] [--rounds 3] [--felupe DIR]
                                            [--ccx PROGRAM]

Problems of the plane and of revolution: a disk of rubber between plates, a circle that ploughs over rubber, a seal of
rubber in its groove, a disk that yields and is unloaded, and a stiff half ring that slides over a block.  felupe and
CalculiX have contact by a penalty: felupe is solved with two and extrapolated, and its CPU time is that of the larger
one.  felupe has rigid shapes only, CalculiX not the neo-Hookean law of the block.  Answers are forces on the body, and
are compared before times: CPU times of one thread, of CalculiX from its deck, of the others from meshes in memory,
without starting Python and compiling forms.  All have the same load steps and shorten them where they must.  A program
that is not there, or finds no answer, is named with what it says.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import basix.ufl
import calculix
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx import Coulomb, NonlinearContactProblem, Pair, SignoriniError, solve
from signorini_fx.forms.named_parts import tagged_mesh
from signorini_fx.scenes.reading import parse_scene

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

# Penalties over a modulus: felupe's at a node, CalculiX's per area; of sticking points a tenth of them.
_NODAL = (1e3, 1e4)
_PER_AREA = 1e4
_PARTS = 1, 16  # of each load step, in CalculiX, where two bodies slide
_FACETS = 96  # of the half circle that CalculiX has in place of a circle


@dataclass(frozen=True)
class Shape:
    """A rigid shape.

    Attributes:
        nodes: that may touch it.
        sides: edges that may touch it, outward to the right of their direction, shape (n, 2).
        at: a point of a plane, or the centre of a circle.
        normal: of a plane, to the body; None: a circle.
        radius: of the circle.
        ways: displacements at the load steps, shape (steps, 2).
    """

    nodes: Integers
    sides: Integers
    at: tuple[float, float]
    normal: tuple[float, float] | None
    radius: float
    ways: Floats


@dataclass(frozen=True)
class Problem:
    """One body between rigid shapes.

    Attributes:
        title: of the rows.
        points: shape (n, 2).
        cells: corners counterclockwise, shape (m, 4).
        material: as a scene has it.
        held: axes along which nodes are held, as "xy", and the nodes.
        shapes: which touch it.
        coefficient: of friction.
        revolved: whether about x = 0.
        small: whether strains are small.
        shown: numbers of the load steps whose forces are compared.
        modulus: of the size of the stresses, which penalties are multiples of.
    """

    title: str
    points: Floats
    cells: Integers
    material: dict[str, Any]
    held: tuple[tuple[str, Integers], ...]
    shapes: tuple[Shape, ...]
    coefficient: float = 0.0
    revolved: bool = False
    small: bool = False
    shown: tuple[int, ...] = (-1,)
    modulus: float = 1.0


@dataclass(frozen=True)
class Answer:
    """Of a program.

    Attributes:
        forces: on the body, of the shown load steps and of each shape, shape (steps, shapes, 2).
        increments: load increments that were solved.
        iterations: of Newton's method.
        cpu: seconds.
    """

    forces: Floats
    increments: int
    iterations: int
    cpu: float


def grid(columns: int, rows: int) -> tuple[Floats, Integers]:
    """The unit square in quadrilaterals: points row by row, and cells."""
    points = np.stack(np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))).reshape(2, -1).T
    first = (np.arange(columns) + (columns + 1) * np.arange(rows)[:, None]).reshape(-1, 1)
    return points, first + np.array([0, 1, columns + 2, columns + 1])


def quarter(cells: int) -> tuple[Floats, Integers]:
    """The upper right quarter of the unit disk, in three blocks about a square."""
    square, corners = grid(cells, cells)
    along, out = square.T

    def to_arc(side: Floats, angle: Floats) -> Floats:
        return ((1 - out) * side + out * np.array([np.cos(angle), np.sin(angle)])).T

    right = to_arc(np.array([np.full_like(along, 0.5), 0.5 * (1 - along)]), np.pi / 4 * (1 - along))
    above = to_arc(np.array([0.5 * along, np.full_like(along, 0.5)]), np.pi / 4 * (2 - along))
    return joined((0.5 * square, corners), (right, corners), (above, corners))


def joined(*parts: tuple[Floats, Integers]) -> tuple[Floats, Integers]:
    """Parts with one node where theirs coincide."""
    starts = np.cumsum([0, *(len(points) for points, _ in parts)])
    points = np.concatenate([points for points, _ in parts])
    cells = np.concatenate([cells + start for (_, cells), start in zip(parts, starts[:-1], strict=True)])
    _, first, numbers = np.unique(np.round(points, 9), axis=0, return_index=True, return_inverse=True)
    return points[first], numbers.ravel()[cells]


def edges_on(cells: Integers, nodes: Integers) -> Integers:
    """Edges of cells that belong to one cell and have both ends in a set, the cell to the left."""
    edges = np.concatenate([cells[:, [a, (a + 1) % 4]] for a in range(4)])
    _, place, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    outer = edges[place[count == 1]]
    return outer[np.isin(outer, nodes).all(axis=1)]


def _shape(
    points: Floats,
    cells: Integers,
    where: npt.NDArray[np.bool_],
    at: tuple[float, float],
    ways: Sequence[Any],
    *,
    normal: tuple[float, float] | None = None,
    radius: float = 0.0,
) -> Shape:
    """A shape that the nodes at some of the points may touch."""
    nodes = np.flatnonzero(where)
    return Shape(nodes, edges_on(cells, nodes), at, normal, radius, np.array(ways, float))


def disk(scale: int) -> Problem:
    """A quarter of a disk of rubber, flattened by 40 % in four steps."""
    points, cells = quarter(16 * scale)
    plate = [(0.0, -0.1 * k) for k in range(1, 5)]
    arc = np.isclose(np.hypot(*points.T), 1.0)
    return Problem(
        "disk of rubber, flattened by 40 %",
        points,
        cells,
        {"law": "mooney-rivlin", "c10": 0.5, "bulk": 10.0},
        tuple((axis, np.flatnonzero(np.isclose(points[:, k], 0.0))) for k, axis in enumerate("xy")),
        (_shape(points, cells, arc, (0.0, 1.0), plate, normal=(0.0, -1.0)),),
    )


def circle(scale: int) -> Problem:
    """A circle pressed into a block of rubber and moved over it, friction coefficient 0.3."""
    points, cells = grid(64 * scale, 16 * scale)
    points = points * [4.0, 1.0]
    bottom, top = (np.isclose(points[:, 1], y) for y in (0.0, 1.0))
    ways = [(0.0, -0.06 * k) for k in range(1, 6)] + [(0.1 * k, -0.3) for k in range(1, 11)]
    return Problem(
        "circle that ploughs over rubber",
        points,
        cells,
        {"law": "neo-hooke", "young": 100.0, "poisson": 0.4},
        (("xy", np.flatnonzero(bottom)),),
        (_shape(points, cells, top, (1.5, 1.5), ways, radius=0.5),),
        coefficient=0.3,
        modulus=10.0,
    )


def seal(scale: int) -> Problem:
    """The upper half of an O-ring, squeezed by 30 % against the wall of its groove; bulk modulus 100 times c10 / .5."""
    points, cells = quarter(8 * scale)
    left = points * [-1.0, 1.0]
    points, cells = joined((points, cells), (left, cells[:, ::-1]))
    arc = np.isclose(np.hypot(*points.T), 1.0)
    middle = np.flatnonzero(np.isclose(points[:, 1], 0.0))
    above = arc & (points[:, 1] > np.abs(points[:, 0]) - 1e-9)
    outside = arc & (points[:, 0] > points[:, 1] - 1e-9)
    still, down = np.zeros((5, 2)), [(0.0, -0.06 * k) for k in range(1, 6)]
    points = points + np.array([5.0, 0.0])
    return Problem(
        "seal in its groove, of revolution",
        points,
        cells,
        {"law": "mooney-rivlin", "c10": 0.5, "bulk": 100.0, "hypothesis": "axisymmetric"},
        (("y", middle),),
        (
            _shape(points, cells, above, (5.0, 1.0), down, normal=(0.0, -1.0)),
            _shape(points, cells, outside, (6.0, 0.0), still, normal=(-1.0, 0.0)),
        ),
        revolved=True,
    )


def yielding(scale: int) -> Problem:
    """The disk of a metal that yields and hardens, at small strains, and its unloading."""
    ways = [(0.0, -0.0025 * k) for k in range(1, 17)] + [(0.0, -0.04 + 0.001 * k) for k in range(1, 5)]
    one = disk(scale)
    return replace(
        one,
        title="disk that yields, and its unloading",
        material={"law": "j2", "young": 1000.0, "poisson": 0.3, "yield_stress": 5.0, "hardening": 10.0},
        shapes=(replace(one.shapes[0], ways=np.array(ways)),),
        small=True,
        modulus=100.0,
        shown=(15, 19),
    )


def package(problem: Problem) -> Answer:
    """The package, of a scene, which has its certificate in the time."""
    steps = np.arange(len(problem.shapes[0].ways) + 1)
    contact = []
    for number, one in enumerate(problem.shapes):
        shape = {"shape": "plane", "point": one.at, "normal": one.normal}
        if one.normal is None:
            shape = {"shape": "circle", "centre": one.at, "radius": one.radius}
        ways = np.vstack((np.zeros(2), one.ways))
        shift = ["+".join(f"{b - a}*min(max(t-{k},0),1)" for k, (a, b) in enumerate(pairwise(way))) for way in ways.T]
        contact.append({"boundary": f"shape{number}", "foundation": {**shape, "shift": shift}})
        if problem.coefficient:
            contact[-1]["friction"] = {"law": "coulomb", "coefficient": problem.coefficient}
    names = {f"shape{number}": one.sides for number, one in enumerate(problem.shapes)}
    names |= {f"held_{axes}": edges_on(problem.cells, nodes) for axes, nodes in problem.held}
    mesh = _Mesh(problem.points, problem.cells)
    scene = parse_scene(
        {
            "mesh": tagged_mesh(mesh.mesh, {name: mesh.facets(edges) for name, edges in names.items()}),
            "material": problem.material,
            "element": {"volumetric": "reduced" if problem.revolved else "full"},
            "displacement": [{"boundary": f"held_{axes}", **dict.fromkeys(axes, 0.0)} for axes, _ in problem.held],
            "contact": contact,
            "load_steps": {"times": steps[1:].tolist()},
        }
    )
    start = time.process_time()
    solution = solve(scene, MPI.COMM_SELF, check=False)
    cpu = time.process_time() - start
    if not solution.converged:
        raise RuntimeError(str(solution.status))
    at = {step.time: step.contact.forces_of_each.sum(axis=1) for step in solution.steps}
    forces = np.array([at[steps[1:][number]] for number in problem.shown])
    return Answer(forces, len(solution.steps), len(solution.history.outer), cpu)


class _Mesh:
    """A mesh of dolfinx whose edges are found by their ends."""

    def __init__(self, points: Floats, cells: Integers) -> None:
        element = basix.ufl.element("Lagrange", "quadrilateral", 1, shape=(2,))
        self.mesh = dmesh.create_mesh(MPI.COMM_SELF, cells=cells[:, [0, 1, 3, 2]], x=points, e=element)
        self.mesh.topology.create_connectivity(1, 2)
        every = np.arange(self.mesh.topology.index_map(1).size_local, dtype=np.int32)
        nodes = np.asarray(self.mesh.geometry.input_global_indices)[dmesh.entities_to_geometry(self.mesh, 1, every)]
        self._number = {tuple(sorted(pair)): facet for facet, pair in enumerate(nodes.tolist())}

    def facets(self, edges: Integers) -> npt.NDArray[np.int32]:
        """Their numbers, ascending."""
        return np.array(sorted(self._number[tuple(sorted(pair))] for pair in edges.tolist()), dtype=np.int32)


def felupe(problem: Problem) -> Answer:
    """felupe, extrapolated to a penalty without end from two of them."""
    soft, hard = (_felupe(problem, penalty * problem.modulus) for penalty in _NODAL)
    share = _NODAL[0] / (_NODAL[1] - _NODAL[0])
    return replace(hard, forces=hard.forces + share * (hard.forces - soft.forces))


def _felupe(problem: Problem, penalty: float) -> Answer:
    import felupe as fe

    # Its axis of revolution is the first one.
    turn = slice(None, None, -1) if problem.revolved else slice(None)
    centres = np.array([one.at for one in problem.shapes])
    mesh = fe.Mesh(np.vstack((problem.points, centres))[:, turn], problem.cells[:, turn], "quad")
    region, law = fe.RegionQuad(mesh), problem.material
    if problem.revolved:
        field = fe.FieldContainer([fe.FieldAxisymmetric(region, dim=2)])
        body = fe.SolidBodyNearlyIncompressible(fe.NeoHooke(mu=2 * law["c10"]), field, bulk=law["bulk"])
    else:
        field = fe.FieldContainer([fe.FieldPlaneStrain(region, dim=2)])
        body = fe.SolidBody(_material_of_felupe(fe, law), field)

    def held(nodes: Any, axis: str) -> Any:
        mask = np.zeros(mesh.npoints, dtype=bool)
        mask[nodes] = True
        return fe.Boundary(field[0], mask=mask, skip=tuple(one != axis for one in "xy"[turn]))

    boundaries = {f"{axes}, {axis}": held(nodes, axis) for axes, nodes in problem.held for axis in axes}
    contacts, ramp = [], {}
    for number, one in enumerate(problem.shapes):
        node = len(problem.points) + number
        options = {"friction": problem.coefficient, "multiplier": penalty, "multiplier_tangential": 0.1 * penalty}
        if one.normal is None:
            contacts.append(fe.ContactRigidCylinder(field, one.nodes, node, radius=one.radius, **options))
        else:
            contacts.append(fe.ContactRigidPlane(field, one.nodes, node, normal=one.normal[turn], **options))
        for axis, ways in zip("xy", one.ways.T, strict=True):
            moved = boundaries[f"shape {number}, {axis}"] = held(node, axis)
            ramp[moved] = np.append(0.0, ways)  # a first step that can be divided begins at nothing

    class Count(fe.Plugin):  # type: ignore[misc]
        """What Newton's method does, also where it fails, and the forces of each step."""

        def __init__(self) -> None:
            self.iterations, self.increments, self.forces = 0, 0, list[Floats]()

        def after_iteration(self, context: Any, state: Any) -> None:
            """One more."""
            self.iterations += 1

        def after_newton(self, context: Any, state: Any) -> None:
            """One more."""
            self.increments += 1

        def after_substep(self, context: Any, state: Any) -> None:
            """Keep the forces on the nodes, not that on the shape."""
            nodal = [-one.results.force.toarray().reshape(-1, 2)[: len(problem.points), turn] for one in contacts]
            self.forces.append(np.array([of_nodes.sum(axis=0) for of_nodes in nodal]))

    count, step = Count(), fe.Step([body, *contacts], ramp=ramp, boundaries=boundaries)
    start = time.process_time()
    fe.Job([step], plugins=[fe.CutbackPlugin(), count]).evaluate(x0=field, verbose=0)
    cpu = time.process_time() - start
    return Answer(np.array(count.forces)[1:][list(problem.shown)], count.increments - 1, count.iterations, cpu)


def _material_of_felupe(fe: Any, law: dict[str, Any]) -> Any:
    if law["law"] == "mooney-rivlin":
        return fe.NeoHooke(mu=2 * law["c10"], bulk=law["bulk"])
    if law["law"] == "neo-hooke":
        mu = law["young"] / 2 / (1 + law["poisson"])
        return fe.NeoHookeCompressible(mu=mu, lmbda=2 * mu * law["poisson"] / (1 - 2 * law["poisson"]))
    constants = (law[name] for name in ("young", "poisson", "yield_stress", "hardening"))
    return fe.LinearElasticPlasticIsotropicHardening(*constants)


class Deck:
    """An Abaqus deck of bodies of the plane in contact, which is written part by part."""

    def __init__(self, title: str, element: str = "CPE4") -> None:
        self.lines, self.cells, self._count, self._element = [f"*HEADING\n{title}"], list[list[int]](), 0, element

    def body(self, name: str, points: Floats, cells: Integers, material: Sequence[str]) -> int:
        """A body of such elements; the number of its first node."""
        first, element = self._count + 1, len(self.cells) + 1
        self._count += len(points)
        self.lines += ["*NODE", *(f"{n}, {x:.12g}, {y:.12g}, 0." for n, (x, y) in enumerate(points.tolist(), first))]
        self.lines.append(f"*ELEMENT, TYPE={self._element}, ELSET={name}")
        rows = (cells + first).tolist()
        self.lines += [f"{n}, {', '.join(map(str, row))}" for n, row in enumerate(rows, element)]
        self.cells += rows
        self.lines += [
            f"*MATERIAL, NAME=OF_{name}",
            *material,
            f"*SOLID SECTION, ELSET={name}, MATERIAL=OF_{name}",
            "1.",
        ]
        return first

    def nodes(self, name: str, numbers: Integers) -> None:
        """A set of nodes."""
        self.lines += [f"*NSET, NSET={name}", *(f"{number}," for number in numbers.tolist())]

    def surface(self, name: str, sides: Integers) -> None:
        """Sides of elements by their ends, in the direction in which these follow in the element."""
        side_of = {
            (row[k], row[(k + 1) % 4]): f"{n}, S{k + 1}" for n, row in enumerate(self.cells, 1) for k in range(4)
        }
        self.lines += [f"*SURFACE, NAME={name}, TYPE=ELEMENT", *(side_of[a, b] for a, b in sides.tolist())]

    def pair(self, slave: str, master: str, coefficient: float, slope: float) -> None:
        """Contact of two surfaces, with so much pressure per overclosure."""
        self.lines += [f"*SURFACE INTERACTION, NAME=I_{slave}"]
        self.lines += ["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{slope!r}"]
        self.lines += ["*FRICTION", f"{coefficient}, {0.1 * slope!r}"] if coefficient else []
        self.lines += [f"*CONTACT PAIR, INTERACTION=I_{slave}, TYPE=SURFACE TO SURFACE", f"{slave}, {master}"]

    def solved(
        self, program: str, steps: Sequence[dict[str, npt.NDArray[np.float64]]], *, small: bool
    ) -> tuple[Floats, int, int, float]:
        """Forces that sets of nodes take at the end of each step, shape (steps, sets, 2), increments, iterations, and
        CPU seconds.

        Args:
            program: ccx.
            steps: displacements of the sets.
            small: whether strains are small.

        Raises:
            RuntimeError: there is no such program, or it has found no answer.
        """
        lines = list(self.lines)
        for moved in steps:
            lines += [f"*STEP, INC=1000{'' if small else ', NLGEOM'}", "*STATIC", "1., 1., 1e-4, 1.", "*BOUNDARY"]
            lines += [f"{name}, {k}, {k}, {u!r}" for name, way in moved.items() for k, u in enumerate(way.tolist(), 1)]
            for name in moved:
                lines += [f"*NODE PRINT, NSET={name}, TOTALS=ONLY, FREQUENCY=1000", "RF"]
            lines.append("*END STEP")
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "job.inp").write_text("\n".join(lines) + "\n", encoding="utf-8")
            environment = os.environ | {"OMP_NUM_THREADS": "1", "CCX_NPROC_EQUATION_SOLVER": "1"}
            start = calculix.cpu()
            done = subprocess.run(
                [program, "job"], cwd=folder, capture_output=True, text=True, env=environment, check=False
            )
            seconds = calculix.cpu() - start
            if done.returncode or "*ERROR" in done.stdout:
                said = re.findall(r"\*ERROR.*", done.stdout) or done.stdout.split("\n")[-1:]
                raise RuntimeError(" ".join(" ".join(said).split())[:120])
            totals = re.findall(r"total force .*\n\s*\n?(.+)", Path(folder, "job.dat").read_text(encoding="utf-8"))
            records = [line.split() for line in Path(folder, "job.sta").read_text(encoding="utf-8").splitlines()[2:]]
        forces = np.array([[float(word) for word in row.split()[:2]] for row in totals])
        iterations = sum(int(words[3]) for words in records)
        return forces.reshape(len(steps), len(steps[0]), 2), len(records), iterations, seconds


def calculix_of(program: str, problem: Problem) -> Answer:
    """CalculiX, in which a rigid shape is a layer of elements whose nodes are all prescribed."""
    deck, law = Deck(problem.title, "CAX4" if problem.revolved else "CPE4"), problem.material
    material = ["*HYPERELASTIC, NEO HOOKE", f"{law.get('c10')}, {2 / law.get('bulk', 1)!r}"]
    if law["law"] == "neo-hooke":
        raise RuntimeError("has no such material")
    if law["law"] == "j2":
        stress, slope = law["yield_stress"], law["hardening"]
        material = [
            "*ELASTIC",
            f"{law['young']}, {law['poisson']}",
            "*PLASTIC",
            f"{stress}, 0.",
            f"{stress + slope}, 1.",
        ]
    body = deck.body("BODY", problem.points, problem.cells, material)
    for axes, nodes in problem.held:
        deck.nodes(f"HELD_{axes.upper()}", body + nodes)
        deck.lines += ["*BOUNDARY", *(f"HELD_{axes.upper()}, {'xy'.index(axis) + 1}" for axis in axes)]
    for number, one in enumerate(problem.shapes):
        points, cells, sides = rigid(one)
        first = deck.body(f"RIGID{number}", points, cells, ["*ELASTIC", "1e5, 0."])
        deck.nodes(f"MOVED{number}", first + np.arange(len(points)))
        deck.surface(f"ON{number}", body + one.sides)
        deck.surface(f"OFF{number}", first + sides)
        deck.pair(f"ON{number}", f"OFF{number}", problem.coefficient, _PER_AREA * problem.modulus)
    ways = zip(*(one.ways for one in problem.shapes), strict=True)
    steps = [{f"MOVED{number}": way for number, way in enumerate(of_step)} for of_step in ways]
    forces, *effort = deck.solved(program, steps, small=problem.small)
    if problem.revolved:
        forces = forces * 180.0  # elements are a sector of two degrees inside, whose forces are printed
    return Answer(forces[list(problem.shown)], *effort)


def rigid(shape: Shape) -> tuple[Floats, Integers, Integers]:
    """One layer of quadrilaterals behind a shape: points, cells, and sides on it."""
    points, cells = grid(1 if shape.normal else _FACETS, 1)
    along, behind = points.T
    if shape.normal:
        normal = np.array(shape.normal)
        tangent = np.array([-normal[1], normal[0]])
        x = np.array(shape.at) + np.outer(8 * (along - 0.5), tangent) - np.outer(0.5 * behind, normal)
    else:
        angle, r = np.pi * (2 - along), shape.radius * (1 - 0.2 * behind)
        x = np.array(shape.at) + np.column_stack((r * np.cos(angle), r * np.sin(angle)))
    return x, cells, cells[:, [0, 1]]


@dataclass(frozen=True)
class TwoBodies:
    """A body that is held, and one that is driven over it; both of rubber, in plane strain.

    Attributes:
        title: of the row.
        points, cells: of both, see ``Problem``.
        touching: sides of both, outward to the right of their direction.
        ends: nodes of the first that are held, and of the second that are driven.
        constants: c10 and bulk modulus of both.
        coefficient: of friction.
        ways: of the driven nodes at the load steps, shape (steps, 2).
    """

    title: str
    points: tuple[Floats, Floats]
    cells: tuple[Integers, Integers]
    touching: tuple[Integers, Integers]
    ends: tuple[Integers, Integers]
    constants: tuple[tuple[float, float], tuple[float, float]]
    coefficient: float
    ways: Floats


def ring(scale: int) -> TwoBodies:
    """Half a ring, ten times as stiff as a block, pressed into it and moved over five of its facets."""
    lower, cells = grid(32 * scale, 8 * scale)
    lower = lower * [4.0, 1.0]
    upper, around = grid(16 * scale, 4 * scale)
    angle, r = np.pi * (1 + upper[:, 0]), 0.5 * (1 - 0.7 * upper[:, 1])
    upper = np.column_stack((1.5 + r * np.cos(angle), 1.5 + r * np.sin(angle)))
    outer, top = np.flatnonzero(np.isclose(r, 0.5)), np.flatnonzero(np.isclose(lower[:, 1], 1.0))
    down = [(0.0, -0.05 * k) for k in range(1, 4)]
    return TwoBodies(
        "stiff half ring over five facets",
        (lower, upper),
        (cells, around),
        (edges_on(cells, top), edges_on(around, outer)),
        (np.flatnonzero(lower[:, 1] == 0.0), np.flatnonzero(np.isclose(upper[:, 1], 1.5))),
        ((0.5, 10.0), (5.0, 100.0)),
        0.3,
        np.array([*down, *((0.125 * k, -0.15) for k in range(1, 6))]),
    )


def package_of_two(problem: TwoBodies) -> Answer:
    """The package, of a residual in UFL."""
    (lower, upper), (low, high) = problem.points, problem.cells
    together = _Mesh(np.concatenate((lower, upper)), np.concatenate((low, high + len(lower))))
    mesh = together.mesh
    space = fem.functionspace(mesh, ("Lagrange", 1, (2,)))
    u, of_body = fem.Function(space), fem.Function(fem.functionspace(mesh, ("DG", 0)))
    of_body.x.array[:] = mesh.topology.original_cell_index >= len(low)
    (c10, bulk), (stiff, _) = problem.constants
    gradient = ufl.Identity(2) + ufl.grad(u)
    volume = ufl.det(gradient)
    squares = ufl.inner(gradient, gradient) + 1
    energy = c10 * (volume ** (-2 / 3) * squares - 3) + bulk / 2 * (volume - 1) ** 2
    energy *= 1 + (stiff / c10 - 1) * of_body
    residual = ufl.derivative(energy * ufl.dx(metadata={"quadrature_degree": 2}), u, ufl.TestFunction(space))
    way = fem.Constant(mesh, np.zeros(2))
    held, driven = (edges_on(of, ends) for of, ends in zip(problem.cells, problem.ends, strict=True))
    nodes = together.facets(held), together.facets(driven + len(lower))
    bcs = [
        fem.dirichletbc(value, fem.locate_dofs_topological(space, 1, facets), space)
        for value, facets in zip((np.zeros(2), way), nodes, strict=True)
    ]
    sides = problem.touching[0], problem.touching[1] + len(lower)
    pair = Pair(
        *(together.facets(edges) for edges in sides),
        friction=Coulomb(problem.coefficient) if problem.coefficient else None,
    )
    start = time.process_time()
    contact = NonlinearContactProblem(residual, u, bcs=bcs, contact=pair)
    increments = 0
    for begin, end in pairwise(np.vstack((np.zeros(2), problem.ways))):
        steps = contact.ramp(lambda t, a=begin, b=end: np.copyto(way.value, a + t * (b - a)), first=1.0)
        increments += len(steps)
    cpu = time.process_time() - start
    return Answer(sum(contact.state.forces).reshape(1, 1, 2), increments, len(contact.history.outer), cpu)


def calculix_of_two(program: str, problem: TwoBodies, parts: int) -> Answer:
    """CalculiX, with each load step in equal parts: it takes normals and pairs of an increment's beginning."""
    deck = Deck(problem.title)
    firsts = []
    for name, points, cells, (c10, bulk) in zip(
        ("LOWER", "UPPER"), problem.points, problem.cells, problem.constants, strict=True
    ):
        firsts.append(deck.body(name, points, cells, ["*HYPERELASTIC, NEO HOOKE", f"{c10}, {2 / bulk!r}"]))
    for name, first, nodes, sides in zip(("HELD", "DRIVEN"), firsts, problem.ends, problem.touching, strict=True):
        deck.nodes(name, first + nodes)
        deck.surface(f"SIDE_{name}", first + sides)
    deck.lines += ["*BOUNDARY", "HELD, 1, 2"]
    deck.pair("SIDE_HELD", "SIDE_DRIVEN", problem.coefficient, 0.1 * _PER_AREA)  # with more it fails
    ways, along = np.vstack((np.zeros(2), problem.ways)), np.arange(1, parts * len(problem.ways) + 1) / parts
    x, y = (np.interp(along, np.arange(len(ways)), way) for way in ways.T)
    steps = [{"DRIVEN": way} for way in np.column_stack((x, y))]
    forces, *effort = deck.solved(program, steps, small=False)
    return Answer(forces[-1:], *effort)


PROBLEMS: dict[str, Callable[[int], Problem | TwoBodies]] = {
    "disk": disk,
    "circle": circle,
    "seal": seal,
    "yielding": yielding,
    "ring": ring,
}


def contestants(problem: Problem | TwoBodies, program: str) -> dict[str, Callable[[], Answer]]:
    """Who solves a problem, the package first."""
    if isinstance(problem, TwoBodies):
        own = {"the package": lambda: package_of_two(problem)}
        parts = {f"CalculiX, steps in {n}": lambda n=n: calculix_of_two(program, problem, n) for n in _PARTS}
        return own | parts
    return {
        "the package": lambda: package(problem),
        "felupe": lambda: felupe(problem),
        "CalculiX": lambda: calculix_of(program, problem),
    }


def rows(names: Sequence[str], scale: int, rounds: int, program: str) -> Iterator[str]:
    """The table, row by row; the programs take turns, and medians count."""
    yield "| problem | unknowns | program | forces | difference | increments | iterations | CPU s | times faster |"
    yield "|---|---|---|---|---|---|---|---|---|"
    for name in names:
        problem = PROBLEMS[name](scale)
        contestants(PROBLEMS[name](1), program)["the package"]()  # compiles forms
        points = problem.points if isinstance(problem.points, tuple) else (problem.points,)
        size = 2 * sum(map(len, points))
        taken: dict[str, list[Answer | str]] = {who: [] for who in contestants(problem, program)}
        for _ in range(rounds):
            for who, run in contestants(problem, program).items():
                taken[who].append(_tried(run))
        ours = [one for one in taken["the package"] if isinstance(one, Answer)]
        for who, answers in taken.items():
            yield f"| {problem.title} | {size} | {who} {_row(ours, answers)} |"


def _tried(run: Callable[[], Answer]) -> Answer | str:
    try:
        return run()
    except (ModuleNotFoundError, FileNotFoundError):
        return "not installed"
    except (RuntimeError, SignoriniError, ArithmeticError, ValueError) as error:
        return " ".join(str(error).split())[:100]


def _row(ours: Sequence[Answer], answers: Sequence[Answer | str]) -> str:
    """The answers of a program beside those of the package in the same rounds."""
    if said := [one for one in answers if isinstance(one, str)]:
        return f"| {said[0]} | | | | |"
    found = [one for one in answers if isinstance(one, Answer)]
    last, cpu = found[-1], float(np.median([one.cpu for one in found]))
    forces = "; ".join(f"{x:.4f}, {y:.4f}" for x, y in last.forces.reshape(-1, 2) + 0.0)
    row = f"| {forces} | {{}} | {last.increments} | {last.iterations} | {cpu:.2f} | {{}}"
    if not ours or last is ours[-1]:
        return row.format("", "")
    apart = np.abs(last.forces - ours[-1].forces).max() / np.abs(ours[-1].forces).max()
    faster = float(np.median([b.cpu / a.cpu for a, b in zip(ours, found, strict=True)]))
    return row.format(f"{100 * apart:.2g} %", f"{faster:.2g}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare, and print what was found."""
    parser = argparse.ArgumentParser(prog="bench/nonlinear_rivals.py", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--problems", default=",".join(PROBLEMS), metavar="NAME,...")
    parser.add_argument("--scale", type=int, default=1, metavar="N", help="cells along each edge, times this (1)")
    parser.add_argument("--rounds", type=int, default=1, metavar="N", help="of the programs in turn (1)")
    parser.add_argument("--felupe", default="", metavar="DIR", help="where pip has installed felupe")
    parser.add_argument("--ccx", default=os.environ.get("CCX", "ccx"), metavar="PROGRAM")
    given = parser.parse_args(arguments)
    names = given.problems.split(",")
    if unknown := set(names) - set(PROBLEMS):
        parser.error(f"no problem {', '.join(sorted(unknown))}: there are {', '.join(PROBLEMS)}")
    sys.path += [given.felupe] if given.felupe else []
    for row in rows(names, given.scale, given.rounds, given.ccx):
        print(row, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
