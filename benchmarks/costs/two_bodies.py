"""Two bodies in contact: the rows of plane and space, beside both as one mesh and one of them on a rigid foundation.

Two blocks 3 x 1, in 3D 3 x 1 x 1, whose meshes do not match, lie on each other; the upper one is pressed in the
middle of its top onto a gap of a parabola or paraboloid, in 3D pulled sideways too.  *As one* is a mesh with as many
unknowns in which both are bonded, held at the bottom; one linear solve is that of ``linear.py`` or ``space.py``.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Iterator
from typing import Any

import basix.ufl
import linear
import numpy as np
import space
import ufl
from dolfinx import mesh as dmesh
from mpi4py import MPI
from once import stopwatch
from row import Row, Say, Sizes
from space import Run

from signorini_fx import solve
from signorini_fx.extensions import GENERATORS, register
from signorini_fx.mechanics.mesh.shares_of_ranks import partitioner, shares
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, generate_mesh, tag_boundaries
from signorini_fx.mechanics.obstacles import paired_points
from signorini_fx.meshes import generator
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.scene import Scene

# Between both blocks, so that their boundaries can be told apart.
_APART = 1e-3
_GAMMAS = (1e5, 1e7, 1e9)
_NAME = "two_blocks"
_COARSEST = 12  # cells along the upper block


@generator(counts=("nx", "other"))
def generate(comm: MPI.Comm, /, *, nx: int = 30, other: int = 24, dimension: int = 2) -> Any:
    """The upper block with nx and the lower one with ``other`` squares or cubes along it."""
    cells, points, z = list[Any](), list[Any](), dimension - 1
    for count, low in ((other, -1.0), (nx, _APART)):
        numbers = (count, *(max(1, count // 3),) * z)
        starts, ends = ([value] * z for value in (0.0, 1.0))
        lines = zip((0.0, *starts), (3.0, *ends), numbers, strict=True)
        axes = [np.linspace(a, b, n + 1) for a, b, n in lines]
        axes[z] += low
        x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, dimension)
        strides = [int(np.prod([n + 1 for n in numbers[k + 1 :]])) for k in range(dimension)]
        first = np.stack(np.meshgrid(*map(np.arange, numbers), indexing="ij"), axis=-1).reshape(-1, dimension) @ strides
        corners = [sum(((k >> axis) & 1) * strides[axis] for axis in range(dimension)) for k in range(2**dimension)]
        cells.append(first[:, None] + np.array(corners) + sum(map(len, points)))
        points.append(x)
    every = [np.concatenate(part) for part in (cells, points)]
    brought, nodes = (np.array_split(part, comm.size)[comm.rank] for part in every)
    element = basix.ufl.element("Lagrange", ("quadrilateral", "hexahedron")[dimension - 2], 1, shape=(dimension,))
    x, up = every[1].take(brought, axis=0), np.arange(2**dimension) >> z & 1
    sides = np.concatenate([x[:, up == 0], x[:, up == 1]])
    owner = shares(comm, x.mean(axis=1), sides[(np.abs(sides[..., z]) < 2 * _APART).all(axis=1)])
    divide = partitioner(owner)
    mesh = dmesh.create_mesh(comm, brought.astype(np.int64), x=nodes, e=ufl.Mesh(element), partitioner=divide)
    heights = {"bottom": -1.0, "lower": 0.0, "upper": _APART, "top": 1.0 + _APART}
    marks: dict[str, Any] = {name: lambda x, y=y: np.abs(x[z] - y) < 1e-9 for name, y in heights.items()}
    marks |= {name: lambda x, y=y: np.abs(x[0] - y) < 1e-9 for name, y in (("left", 0.0), ("right", 3.0))}
    return tag_boundaries(mesh, marks)


register(GENERATORS, _NAME, generate)


def scene(
    mesh: int | TaggedMesh, dimension: int, *, gamma: float = 1e8, levels: int = 1, rigid: bool = False, **solver: Any
) -> Scene:
    """The scene with so many cells along the upper block, or on a mesh; ``rigid``: this alone on a rigid foundation."""
    axes, nx = "xyz"[:dimension], mesh if isinstance(mesh, int) else 3
    load = {axes[-1]: "-20 if 1 <= x[0] <= 2 else 0"} | ({"y": "4 if 1 <= x[0] <= 2 else 0"} if dimension == 3 else {})
    gap = "0.003 * (x[0] - 1.5)**2 + 0.001" + (" + 0.003 * (x[1] - 0.5)**2" if dimension == 3 else "")
    contact = {"boundary": "upper", "against": "lower", "distance": "nominal", "gap": gap}
    made: dict[str, Any] = {"generator": _NAME}
    made["parameters"] = {"nx": nx, "other": 4 * nx // 5, "dimension": dimension}
    held = [{"boundary": "bottom", **dict.fromkeys(axes, 0.0)}]
    if rigid:
        contact, held = {"boundary": "bottom", "gap": gap}, []
        name, cell = (("rectangle", "quadrilateral"), ("box", "hexahedron"))[dimension - 2]
        made = {"generator": name, "parameters": space.parameters(nx, cell)}
        if dimension == 2:
            del made["parameters"]["width"], made["parameters"]["nz"]
    found = parse_scene(
        {
            "mesh": made,
            "material": {"young": space.YOUNG, "poisson": space.POISSON},
            "displacement": [{"boundary": name, **dict.fromkeys(axes[:-1], 0.0)} for name in ("left", "right")] + held,
            "traction": {"boundary": "top", **load},
            "contact": {**contact, "friction": space.LAWS["coulomb"]},
            "solver": {"gamma_n": gamma, "gamma_t": gamma, "levels": levels, **solver},
        }
    )
    return found if isinstance(mesh, int) else found.model_copy(update={"mesh": mesh})


def package(made: Scene) -> tuple[Run, float, int]:
    """A whole solve without the making of meshes, the CPU seconds of its pairing, and solves on the finest mesh."""
    pairing, couple = [0.0], paired_points.couple

    def timed(*given: Any, **more: Any) -> Any:
        begin = time.process_time()
        found = couple(*given, **more)
        pairing[0] += time.process_time() - begin
        return found

    gc.collect()
    paired_points.couple = timed
    try:
        with space._watch() as (steps, sizes), stopwatch() as making, stopwatch(time.process_time) as burnt:
            start, cpu = time.perf_counter(), time.process_time()
            solution = solve(made, MPI.COMM_SELF, check=False)
            seconds, cpu = time.perf_counter() - start - sum(making), time.process_time() - cpu - sum(burnt)
    finally:
        paired_points.couple = couple
    dofs = solution.model.dofs
    spent = [count for size, count in steps if size == dofs]
    solves = solution.levels[-1].linear_solves if solution.levels else solution.history.linear_solves
    phases = ", ".join(f"{name} {value:.1f}" for name, value in solution.timings.seconds.items())
    note = f"{dofs} unknowns, {solves} solves, {solution.linear_algebra.split(':')[0]}; {phases}"
    return Run(seconds, cpu, sum(spent), len(sizes), dofs, note, solution.converged), pairing[0], solves


def as_one(nx: int, dimension: int) -> Run:
    """One linear solve: in 2D by MUMPS, in 3D by CG with GAMG."""
    nx = 3 * round(0.3 * nx)  # as many unknowns
    if dimension == 3:
        return space.linear(nx, "hexahedron", 2)
    tagged = generate_mesh("rectangle", {"length": 3.0, "height": 2.0, "nx": nx, "ny": 2 * nx // 3}, MPI.COMM_SELF)
    gc.collect()
    start, cpu = time.perf_counter(), time.process_time()
    x, _ = linear.solve(tagged, "mumps")
    return Run(time.perf_counter() - start, time.process_time() - cpu, 0, 0, x.getSize())


def rows(sizes: Sizes, repeats: int, say: Say) -> Iterator[Row]:
    """Whole solves with Coulomb friction over one linear solve as one, the share of the pairing, solves and steps."""
    plane, spaces = (sizes.middle, sizes.large), sizes.space
    for dimension, nx in [*((2, nx) for nx in plane), *((3, nx) for nx in spaces)]:
        name, settings = f"{'plane' if dimension == 2 else 'space'} {nx}", dict[str, Any]()
        if dimension == 3:
            settings = {"linear_algebra": "krylov", "levels": space_levels(nx)}
        as_one(_COARSEST, dimension), package(scene(_COARSEST, dimension, **settings | {"levels": 1}))
        found, shares, notes = [], [], ""
        for repeat in range(repeats):
            say(f"two-bodies, {name}, round {repeat + 1} of {repeats}")
            made = scene(nx, dimension, gamma=1e7, **settings)
            if dimension == 2:
                made = made.model_copy(update={"mesh": load_mesh(made, MPI.COMM_SELF)})
            run, pairing, solves = package(made)
            unit = as_one(nx, dimension)
            found.append(run.cpu / unit.cpu if run.converged else np.inf)
            shares.append(pairing / run.cpu)
            notes = f"{run.note}; {run.cpu:.1f} s over {unit.cpu:.1f} s of CPU, {unit.dofs} unknowns as one"
        yield Row("two-bodies", "Coulomb, two bodies, over a linear solve as one", name, found, 2.0, note=notes)
        yield Row("two-bodies", "share of the pairing", name, shares, 0.2)
        rigid = package(scene(nx, dimension, gamma=1e7, rigid=True, **settings))[2]
        what = "solves of two bodies over those on a rigid foundation"
        yield Row("two-bodies", what, name, [solves / rigid], 1.3, note=f"{solves} over {rigid}")
    most = {}
    for nx in spaces:
        say(f"two-bodies, steps, space {nx}")
        once, settings = as_one(nx, 3).steps, {"linear_algebra": "krylov", "levels": space_levels(nx)}
        runs = [package(scene(nx, 3, gamma=gamma, **settings))[0] for gamma in _GAMMAS]
        most[nx] = [run.steps if run.converged else np.inf for run in runs]
        what = "Krylov steps on the finest mesh over a linear solve as one, worst gamma"
        yield Row("two-bodies", what, f"space {nx}", [max(most[nx]) / once], 1.5, note=f"{most[nx]} over {once}")
    coarse, fine = (most[nx] for nx in spaces)
    what = f"space {spaces[0]} to {spaces[1]}"
    yield Row("two-bodies", "growth of the steps, worst gamma", what, [max(np.divide(fine, coarse))], 1.3)


def space_levels(nx: int) -> int:
    """Meshes down to one with 12 cells along the upper block, two at least."""
    return max(2, 1 + round(np.log2(nx / _COARSEST)))
