"""Iterations of Newton's method with curved tools: rigid shapes that are pressed into neo-Hookean bodies, and slide.

    ./env python3 -m benchmarks.stability.curved_tools

A row for each tool, law and element: load steps, iterations of Newton's method in all of them, in the first one and at
most in any, linear solves, and the force of the tool.  No step is halved.  Wanted are ``MOST`` in each step at most.

A step that takes more may lead past a limit point, where the branch of equilibria ends: then smaller steps have no
solution from there on, and the whole one ends on another branch, whose distance says how many iterations it takes.  The
row tells so, and is not counted: with quadratic cells a corner of the body that slides in a bowl lets go.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx import ConvergenceError, Coulomb, Foundation, NonlinearContactProblem

MOST = 6  # iterations in a step
SMALL = 1 / 20  # of a step, by which a limit point is looked for
BULK = 5.0  # over the shear modulus
_PRESSED_AND_SLID = ((0.0, -0.05), (0.0, -0.1), (0.0, -0.15), (0.1, -0.15), (0.2, -0.15), (0.3, -0.15))
_PRESSED = ((0.0, -0.2), (0.0, -0.25))  # deep from rest
_TOOLS: dict[str, tuple[int, dict[str, Any]]] = {
    "circle": (2, {"shape": "circle", "centre": (1.3, 1.5), "radius": 0.5}),
    "bowl": (2, {"shape": "circle", "centre": (1.5, -3.7), "radius": 5.0, "hollow": True}),
    "rounded wedge": (2, {"shape": "cone", "tip": (1.3, 0.8), "axis": (0.0, 1.0), "angle": 60.0, "radius": 1.293}),
    "sphere": (3, {"shape": "sphere", "centre": (1.3, 1.03, 1.6), "radius": 0.6}),
    "cylinder": (3, {"shape": "cylinder", "centre": (1.3, 0.0, 1.6), "axis": (0.2, 1.0, 0.0), "radius": 0.6}),
}


@dataclass(frozen=True)
class ToolCase:
    """A tool on a block that is held at its bottom, [0, 3] x [0, 1], in 3D [0, 3] x [0, 2] x [0, 1].

    Attributes:
        tool: its name.
        degree: of the displacement.
        friction: coefficient; 0: none.
        path: places of the tool along and down, length, one step each.
    """

    tool: str
    degree: int
    friction: float
    path: tuple[tuple[float, float], ...]

    @property
    def name(self) -> str:
        """In words."""
        way = "from rest" if self.path is _PRESSED else "slid"
        return f"{self.tool}, degree {self.degree}, mu {self.friction:g}, {way}"

    def posed(self) -> NonlinearContactProblem:
        """The problem."""
        dim, shape = _TOOLS[self.tool]
        if dim == 2:
            counts = (24 // self.degree, 8 // self.degree)
            mesh = dmesh.create_rectangle(MPI.COMM_WORLD, [[0, 0], [3, 1]], counts, dmesh.CellType.quadrilateral)
        else:
            counts = (12 // self.degree, 8 // self.degree, 4 // self.degree)
            mesh = dmesh.create_box(MPI.COMM_WORLD, [[0, 0, 0], [3, 2, 1]], counts, dmesh.CellType.hexahedron)
        space = fem.functionspace(mesh, ("Lagrange", self.degree, (dim,)))
        u = fem.Function(space)
        gradient = ufl.Identity(dim) + ufl.grad(u)
        volume = ufl.det(gradient)
        stretches = ufl.inner(gradient, gradient) + (3 - dim)  # of plane strain, too
        dx = ufl.dx(metadata={"quadrature_degree": 2 * self.degree})
        energy = (volume ** (-2 / 3) * stretches - 3 + BULK * (volume - 1) ** 2) / 2 * dx
        bottom, top = (
            dmesh.locate_entities_boundary(mesh, dim - 1, lambda x, at=at: np.isclose(x[dim - 1], at))
            for at in (0.0, 1.0)
        )
        held = fem.dirichletbc(np.zeros(dim), fem.locate_dofs_topological(space, dim - 1, bottom), space)
        friction = Coulomb(self.friction) if self.friction else None
        contact = Foundation(top, shape=shape, friction=friction)
        return NonlinearContactProblem(
            ufl.derivative(energy, u, ufl.TestFunction(space)), u, bcs=[held], contact=contact, stability=False
        )

    def iterations(self) -> tuple[list[int], NonlinearContactProblem]:
        """Of each step.

        Raises:
            ConvergenceError: a step has no solution.
        """
        problem, counts = self.posed(), list[int]()
        for number in range(len(self.path)):
            self._place(problem, number, 1.0)
            problem.solve()
            problem.advance()
            counts.append(problem.iterations)
        return counts, problem

    def _place(self, problem: NonlinearContactProblem, number: int, share: float) -> None:
        """The tool after a share of a step."""
        before = np.array(self.path[number - 1] if number else (0.0, 0.0))
        along, down = (before + share * (np.array(self.path[number]) - before)).tolist()
        shift = (along, down) if problem.u.function_space.mesh.geometry.dim == 2 else (along, 0.0, down)
        problem.place(0, shift=shift)

    def limit(self, number: int) -> float:
        """The share of a step up to which small ones have a solution, 1: all of them have.

        Raises:
            ConvergenceError: a step before it has no solution.
        """
        problem, reached = self.posed(), [0.0]
        for earlier in range(number):
            self._place(problem, earlier, 1.0)
            problem.solve()
            problem.advance()
        sizes = dict.fromkeys(("first", "largest", "smallest"), SMALL)
        with suppress(ConvergenceError):
            problem.ramp(
                lambda share: self._place(problem, number, share),
                **sizes,
                on_step=lambda step: reached.append(step.load),
            )
        return reached[-1]


def cases() -> Iterator[ToolCase]:
    """All of them."""
    for tool, (dim, _) in _TOOLS.items():
        for degree in (1, 2) if dim == 2 else (1,):
            for friction in (0.0, 0.3):
                paths = (_PRESSED_AND_SLID, _PRESSED) if tool == "circle" else (_PRESSED_AND_SLID,)
                for path in paths:
                    yield ToolCase(tool, degree, friction, path)


def main() -> int:
    """Print the table; the number of cases that take more."""
    print(f"{'':50}{'steps':>6}{'all':>5}{'first':>6}{'most':>5}{'solves':>7}  force")
    above = 0
    for case in cases():
        try:
            counts, problem = case.iterations()
        except ConvergenceError as error:
            print(f"{case.name:50}  {error}", flush=True)
            above += 1
            continue
        most = max(counts)
        ends = [(k, case.limit(k)) for k, count in enumerate(counts) if count > MOST]
        past = ", ".join(f"past a limit point at {end:.3g} of step {k + 1}" for k, end in ends if end < 1)
        above += any(end == 1 for _, end in ends)
        force = ", ".join(f"{component:.4g}" for component in sum(problem.state.forces))
        solves = len(problem.history.iterations)
        row = f"{len(counts):6}{sum(counts):5}{counts[0]:6}{most:5}{solves:7}  {force}"
        print(f"{case.name:50}{row}{past and f' ({past})'}", flush=True)
    print(f"\n{above} take more than {MOST} iterations in a step")
    return above


if __name__ == "__main__":
    sys.exit(bool(main()))
