"""The reference that other solutions are compared with: one of much higher accuracy, with an
estimate of its own error.

It is a solution without regularisation on adaptively refined triangles of degree 2, many more than
any run that is measured has.
"""

from __future__ import annotations

from typing import Any

import basix
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from mpi4py import MPI
from scenes import alone
from scipy.spatial import cKDTree

from signorini_fx.machine import compat
from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.mechanics.mesh.points import cells_of_points
from signorini_fx.mechanics.mesh.refinement import mark, refine
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.mesh_sources import MeshGenerator
from signorini_fx.mechanics.statement.settings import SolverSettings
from signorini_fx.results.accuracy.contact_surface import ContactSurface, places
from signorini_fx.results.solution import Solution
from signorini_fx.scenes.mesh import load_mesh, scene_on
from signorini_fx.scenes.scene import Scene
from signorini_fx.tuned import EXPECTED_RATES

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
# Pieces of a surface near a point that are looked at for the one that it is in.
NEAR = 8
LIMIT = {"algorithm": "alm", "linear_algebra": "condensed"}
# The slowest rate that is assumed of the errors of a reference: half of the rate of a square-root
# end.
SLOWEST_RATE = 0.5
# Adaptive meshes of a reference begin with cells so many times as large as those of the scene: all
# its important nodes, where loads jump or named sides end, should be nodes of them too.
FIRST_CELLS = 2.0
# Points of the reference are so many sizes of a cell outside the other mesh at most.
OUTSIDE_OTHER_MESH = 1.0
# How errors decrease with h on smooth parts of the boundary.
_EXPECTED = {"energy": 1.0, **EXPECTED_RATES}


def interpolated(coarse: ContactTable, fine: ContactTable, name: str) -> Floats:
    """A column of the coarse table at the nodes of the fine one, interpolated on the facet that is
    nearest there.

    Arc lengths would not do: that of a curve grows with the facets, and between two bodies pieces
    begin elsewhere.
    """
    if fine.facets is not None:
        return _interpolated_in_space(coarse, fine, name)
    x, old, column = places(fine), places(coarse), coarse.columns[name]
    previous_node, next_node = np.arange(len(old)), np.arange(len(old))
    for path in coarse.paths:
        next_node[path[:-1]], previous_node[path[1:]] = path[1:], path[:-1]
    values, nearest = np.zeros(len(x)), np.full(len(x), np.inf)
    of_fine, of_coarse = fine.columns["boundary"], coarse.columns["boundary"]
    for boundary in np.unique(of_fine):
        fine_rows, coarse_rows = (
            np.flatnonzero(of_fine == boundary),
            np.flatnonzero(of_coarse == boundary),
        )
        if not coarse_rows.size:
            continue
        node = coarse_rows[cKDTree(old[coarse_rows]).query(x[fine_rows])[1]]
        for neighbour in (previous_node[node], next_node[node]):
            side, away = old[neighbour] - old[node], x[fine_rows] - old[node]
            square = (side**2).sum(axis=1)
            share = np.divide(
                (side * away).sum(axis=1), square, out=np.zeros(fine_rows.size), where=square > 0
            )
            share = np.clip(share, 0.0, 1.0)
            distance = np.linalg.norm(share[:, None] * side - away, axis=1)
            candidate = column[node] + share * (column[neighbour] - column[node])
            values[fine_rows] = np.where(
                distance < nearest[fine_rows], candidate, values[fine_rows]
            )
            nearest[fine_rows] = np.minimum(distance, nearest[fine_rows])
    return values


def _interpolated_in_space(coarse: ContactTable, fine: ContactTable, name: str) -> Floats:
    surface, c = ContactSurface.of(coarse), fine.columns
    x, values = np.column_stack([c[axis] for axis in "xyz"]), np.zeros(len(fine.columns["x"]))
    assert fine.nodes is not None
    assert coarse.nodes is not None
    part = coarse.nodes[surface.corners[:, 0], 0]
    for number in np.unique(part):
        on_part = fine.nodes[:, 0] == number
        near, weights = _nearest(surface, np.flatnonzero(part == number), x[on_part])
        values[on_part] = np.einsum(
            "nk,nk->n", weights, coarse.columns[name][surface.corners[near]]
        )
    return values


def _nearest(surface: ContactSurface, pieces: Ints, points: Floats) -> tuple[Ints, Floats]:
    """The piece whose nearest place is nearest to each point, shape (n,), and the weights of its
    corners there.
    """
    count = min(NEAR, pieces.size)
    centres = surface.x[surface.corners[pieces]].mean(axis=1)
    near = pieces[cKDTree(centres).query(points, count)[1].reshape(-1, count)]
    x = surface.x[surface.corners[near]]
    if x.shape[2] == 3:
        a, b = x[:, :, 1] - x[:, :, 0], x[:, :, 2] - x[:, :, 0]
        s, t = _affine(a, b, points[:, None, :] - x[:, :, 0])
        weights = np.maximum(np.stack((1 - s - t, s, t), axis=2), 0.0)
        weights /= weights.sum(axis=2, keepdims=True)
    else:
        a = (x[:, :, 1] + x[:, :, 2] - x[:, :, 0] - x[:, :, 3]) / 2
        b = (x[:, :, 2] + x[:, :, 3] - x[:, :, 0] - x[:, :, 1]) / 2
        s, t = (
            np.clip(part + 0.5, 0.0, 1.0)
            for part in _affine(a, b, points[:, None, :] - x.mean(axis=2))
        )
        weights = np.stack(((1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t), axis=2)
    away = np.linalg.norm(np.einsum("nck,nckd->ncd", weights, x) - points[:, None, :], axis=2)
    rows, best = np.arange(len(points)), away.argmin(axis=1)
    return near[rows, best], weights[rows, best]


def _affine(a: Floats, b: Floats, d: Floats) -> tuple[Floats, Floats]:
    """S and t with s a + t b nearest to d, shapes (n, c, 3) -> (n, c)."""
    aa, ab, bb = (
        np.einsum("nck,nck->nc", first, second) for first, second in ((a, a), (a, b), (b, b))
    )
    ad, bd = (np.einsum("nck,nck->nc", first, d) for first in (a, b))
    determinant = aa * bb - ab**2
    return (bb * ad - ab * bd) / determinant, (aa * bd - ab * ad) / determinant


def zone_change(coarse: ContactTable, fine: ContactTable) -> float | None:
    """Change of the ends of the contact zones from node to node, relative to their length; in 3D
    that of their area.
    """
    pressed = [table.columns["pressure"] > 0 for table in (coarse, fine)]
    if fine.facets is not None:
        areas = [
            float(np.sum(table.columns["weight"][on]))
            for table, on in zip((coarse, fine), pressed, strict=True)
        ]
        return abs(areas[1] - areas[0]) / areas[1] if areas[1] > 0 else None
    ends = [np.array(table.zones(on)) for table, on in zip((coarse, fine), pressed, strict=True)]
    if ends[0].shape != ends[1].shape or not ends[1].size:
        return None
    length = float(np.linalg.norm(np.diff(ends[1], axis=1), axis=2).sum())
    return float(np.linalg.norm(ends[1] - ends[0], axis=2).max()) / length if length > 0 else None


def varied(
    scene: Scene, cells: float | TaggedMesh, element: str, settings: dict[str, Any]
) -> Scene:
    """The scene with other cells, element and method.

    Args:
        scene: with a mesh from a generator.
        cells: how many times as large as stated, or a mesh.
        element: P1, Q1, P2 or Q2.
        settings: of the method, which is measured by itself, without fall-backs.

    Raises:
        SceneError: the generator makes no such meshes.
    """
    scene = (
        scene.model_copy(update={"mesh": cells})
        if isinstance(cells, TaggedMesh)
        else scene_on(scene, cells)
    )
    inherited = scene.solver.model_dump(
        include={"max_iterations", "max_outer_iterations", "tolerance"}
    )
    changes: dict[str, Any] = {
        "solver": SolverSettings(**inherited, **settings, fallbacks=False),
        "accuracy": None,
        "element": scene.element.model_copy(update={"degree": int(element[1])}),
    }
    if isinstance(mesh := scene.mesh, MeshGenerator):
        cell = {"P": "triangle", "Q": "quadrilateral"}[element[0]]
        changes["mesh"] = mesh.model_copy(update={"parameters": {**mesh.parameters, "cell": cell}})
    return scene.model_copy(update=changes)


class Reference:
    """A solution to compare others with.

    Stresses are compared at the quadrature points of the reference's cells; where a point lies
    outside the other mesh (a curved boundary), the nearest cell is continued.
    """

    def __init__(self, solution: Solution) -> None:
        self.solution = solution
        stress, mesh = solution.stress.stress, solution.model.tagged.mesh
        points, weights = basix.make_quadrature(
            getattr(basix.CellType, mesh.topology.cell_name()), 2
        )
        cells = np.arange(mesh.topology.index_map(mesh.topology.dim).size_local, dtype=np.int32)

        def at_points(expression: Any) -> Floats:
            return np.asarray(fem.Expression(expression, points).eval(mesh, cells)).reshape(
                cells.size * len(points), -1
            )

        self._points = np.zeros((cells.size * len(points), 3))
        self._points[:, : mesh.geometry.dim] = at_points(ufl.SpatialCoordinate(mesh))
        sizes = at_points(stress.around * ufl.JacobianDeterminant(mesh))[:, 0]
        self._weights = np.abs(sizes) * np.tile(weights, cells.size)
        self._stress = at_points(_within(stress))
        tau = ufl.variable(fem.Constant(mesh, np.zeros(len(stress.kinematics.pairs))))
        twice = ufl.diff(ufl.diff(stress.compliance(tau), tau), tau)
        self._compliance = at_points(twice / 2).reshape(-1, len(tau), len(tau))
        self._size = self._energy_norm(self._stress)

    def errors(self, solution: Solution) -> dict[str, float | None]:
        """Relative errors of a solution; None where there is nothing to compare."""
        table, fine = solution.table, self.solution.table
        weight, pressure = fine.columns["weight"], fine.columns["pressure"]
        difference = interpolated(table, fine, "pressure") - pressure
        size = float(np.sqrt(np.dot(weight, pressure**2)))
        assert solution.contact is not None
        assert self.solution.contact is not None
        force, true_force = (
            s.contact.forces_of_each for s in (solution, self.solution) if s.contact
        )
        peak = pressure.max()
        return {
            "energy": self._energy_norm(self._stress_of(solution) - self._stress) / self._size,
            "pressure": float(np.sqrt(np.dot(weight, difference**2))) / size if size > 0 else None,
            "peak": float(abs(table.columns["pressure"].max() / peak - 1)) if peak > 0 else None,
            "zone": zone_change(table, fine),
            "force": float(np.linalg.norm(force - true_force) / np.linalg.norm(true_force)),
        }

    def _energy_norm(self, tau: Floats) -> float:
        """The square root of the integral of C^-1 tau : tau for the components of tau at the
        points.
        """
        density = np.einsum("qi,qij,qj->q", tau, self._compliance, tau)
        return float(np.sqrt(max(0.0, np.dot(self._weights, density))))

    def _stress_of(self, solution: Solution) -> Floats:
        """Stress of another solution at the points of the reference."""
        mesh = solution.model.tagged.mesh
        space = fem.functionspace(
            mesh, ("DG", solution.statement.element.degree, (self._stress.shape[1],))
        )
        function = fem.Function(space)
        points = compat.interpolation_points(space.element)
        function.interpolate(fem.Expression(_within(solution.stress.stress), points))
        cells, places, _ = cells_of_points(mesh, self._points, OUTSIDE_OTHER_MESH)
        assert (cells >= 0).all()  # the meshes are of one body
        shares = space.element.basix_element.tabulate(0, places)[0, :, :, 0]
        values = function.x.array.reshape(-1, self._stress.shape[1])
        return np.asarray(np.einsum("nk,nkc->nc", shares, values[space.dofmap.list[cells]]))


def _within(stress: Any) -> Any:
    """Components of a stress without that out of the plane."""
    return ufl.as_vector([stress.components[k] for k in range(len(stress.kinematics.pairs))])


def reference_solution(scene: Scene, unknowns: int) -> tuple[Reference, dict[str, float | None]]:
    """A reference for a scene with contact and one load step, and an estimate of its error.

    Args:
        scene: whose body has straight sides.
        unknowns: smallest number of unknowns of the reference.
    """
    solutions = divided(scene, FIRST_CELLS, unknowns)
    reference = Reference(solutions[-1])
    # Meshes with half and a quarter of the cells along a line; of the energy norm both differences
    # see the same error.
    finest = solutions[-1].model.dofs
    near, far = (
        min(solutions[:-1], key=lambda s: abs(np.log(finest / s.model.dofs / k))) for k in (4, 16)
    )
    return reference, reference_errors(reference.errors(near), reference.errors(far))


def divided(scene: Scene, first: float, unknowns: int) -> list[Solution]:
    """Solutions on triangles of degree 2, refined adaptively up to this number of unknowns."""
    tagged = load_mesh(varied(scene, first, "P2", {}), MPI.COMM_SELF)
    solutions: list[Solution] = []
    while not solutions or solutions[-1].model.dofs < unknowns:
        solutions.append(alone(varied(scene, tagged, "P2", LIMIT), check=False))
        tagged = refine(tagged, mark(MPI.COMM_SELF, solutions[-1].stress.squares))
    return solutions


def reference_errors(
    second: dict[str, float | None], third: dict[str, float | None]
) -> dict[str, float | None]:
    """The error of the reference, estimated from the differences to it on cells two and four times
    as large.

    With errors like h^r the differences are 2^r - 1 and 4^r - 1 times that of the reference, so
    that their ratio is 2^r + 1; in the energy norm, where the error is orthogonal to the coarser
    spaces, this holds for the squares.  The rate is the observed one, or the expected one if that
    is smaller.
    """
    errors: dict[str, float | None] = {}
    for name, near in second.items():
        far, power = third[name], 2 if name == "energy" else 1
        expected, slowest = (2 ** (power * rate) - 1 for rate in (_EXPECTED[name], SLOWEST_RATE))
        seen = expected if not far or not near else (far / near) ** power - 2
        errors[name] = (
            None if near is None else near / min(expected, max(seen, slowest)) ** (1 / power)
        )
    return errors
