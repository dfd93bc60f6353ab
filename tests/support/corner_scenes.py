"""Blocks whose stress is singular at corners, interfaces and jumps, and references that resolve
these points.
"""

from dataclasses import dataclass

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI
from reference import Reference

from signorini_fx.machine import compat
from signorini_fx.mechanics.mesh.refinement import mark, refine
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, tag_boundaries
from signorini_fx.mechanics.statement.settings import SolverSettings
from signorini_fx.records import History
from signorini_fx.results.solution import ConvergenceError
from signorini_fx.scenes.mesh_sequence import MeshedScene

# gamma of a reference, in units of Young's modulus: on a block on a table the energy of 1e5 and of
# 1e9 differ by less than 1e-11.
HARD = 1e6
QUANTITIES = ("energy", "pressure", "force")


@dataclass(frozen=True)
class Block:
    """A rectangle of triangles.

    Attributes:
        length: along the bottom.
        height: of the sides.
        cells: along the bottom and the sides.
        interface: height at which a second material begins; 0: there is one material.
        jumps: points where loads or friction jump.
    """

    length: float
    height: float
    cells: tuple[int, int]
    interface: float = 0.0
    jumps: tuple[tuple[float, float], ...] = ()

    @property
    def points(self):
        """Where the stress may be singular."""
        levels = {0.0, self.interface, self.height}
        return [*((x, y) for x in (0.0, self.length) for y in sorted(levels)), *self.jumps]

    def mesh(self):
        """With the regions ``first`` and ``second`` if there are two materials."""
        up = self.cells[1]
        below = round(up * self.interface / self.height)
        rows = np.linspace(self.interface, self.height, up - below + 1)
        rows = np.append(np.linspace(0.0, self.interface, below + 1)[:-1], rows)
        corners, diagonal = [[0.0, 0.0], [self.length, up]], dmesh.DiagonalType.left_right
        mesh = dmesh.create_rectangle(
            MPI.COMM_SELF, corners, self.cells, dmesh.CellType.triangle, diagonal=diagonal
        )
        x = mesh.geometry.x
        x[:, 1] = rows[np.rint(x[:, 1]).astype(int)]
        sides = {
            "left": (0, 0.0),
            "right": (0, self.length),
            "bottom": (1, 0.0),
            "top": (1, self.height),
        }
        markers = {
            name: lambda x, k=k, at=at: np.isclose(x[k], at) for name, (k, at) in sides.items()
        }
        tagged = tag_boundaries(mesh, markers)
        if not self.interface:
            return tagged
        cells = np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
        kinds = np.where(
            dmesh.compute_midpoints(mesh, 2, cells)[:, 1] > self.interface, 2, 1
        ).astype(np.int32)
        tags = dmesh.meshtags(mesh, 2, cells, kinds)
        return TaggedMesh(
            mesh, tagged.facet_tags, tagged.boundaries, tags, {"first": 1, "second": 2}
        )


def touching(mesh, points):
    """Cells that hold one of the points."""
    x = mesh.geometry.x[compat.geometry_cells(mesh)][:, :, :2]
    a, b, c = x[:, 0], x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    area = b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0]
    found = np.zeros(len(x), dtype=bool)
    for point in points:
        d = np.asarray(point) - a
        s, t = (
            (d[:, 0] * c[:, 1] - d[:, 1] * c[:, 0]) / area,
            (b[:, 0] * d[:, 1] - b[:, 1] * d[:, 0]) / area,
        )
        found |= (s >= -1e-6) & (t >= -1e-6) & (s + t <= 1 + 1e-6)
    return np.flatnonzero(found).astype(np.int32)


def reference(scene, block, halvings, unknowns):
    """A solution on strongly graded triangles of degree 2, and its distance to one with half of the
    unknowns.

    Args:
        scene: whose mesh is replaced.
        block: its body.
        halvings: of the cells at each point where the solution may be singular.
        unknowns: at least.
    """
    tagged = block.mesh()
    for _ in range(halvings):
        tagged = refine(tagged, touching(tagged.mesh, block.points))
    gamma = HARD * scene.statement.young
    # Augmentation would converge slowly on cells that are divided many times at a corner.
    settings = SolverSettings(
        gamma_n=gamma, gamma_t=gamma, linear_algebra="condensed", tolerance=1e-9
    )
    element = scene.element.model_copy(update={"degree": 2})
    scene = scene.model_copy(update={"element": element, "solver": settings, "accuracy": None})
    found, history = [], History()
    while not found or found[-1].model.dofs < unknowns:
        changed = scene.model_copy(update={"mesh": tagged})
        solved = MeshedScene(comm=MPI.COMM_SELF, history=history, scene=changed).solved(
            len(found), None, None
        )
        if solved.errors is None:
            raise ConvergenceError(solved.solution)
        found.append(solved.solution)
        squares = [solved.errors.squares[of] for of in ("energy", "pressure")]
        cells = [mark(MPI.COMM_SELF, own / own.sum(), 0.6) for own in squares]
        near = touching(tagged.mesh, block.points)
        tagged = refine(tagged, np.unique(np.concatenate((*cells, near))).astype(np.int32))
    fine = Reference(found[-1])
    dofs = found[-1].model.dofs
    coarse = min(found[:-1], key=lambda solution: abs(np.log(dofs / solution.model.dofs / 2)))
    return fine, fine.errors(coarse)
