"""The reference that other solutions are compared with: one of much higher accuracy, with an estimate of its own error.

It is a solution without regularisation.  Bodies with straight sides get adaptively refined triangles of degree 2, many
more than any run that is measured; others get a fine uniform mesh.
"""

from __future__ import annotations

from typing import Any

import basix
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from mpi4py import MPI

from signorini_fx.machine import compat
from signorini_fx.mechanics.body.elastic_law import compliance
from signorini_fx.mechanics.body.element_stress import element_stress
from signorini_fx.mechanics.mesh.points import cells_of_points
from signorini_fx.mechanics.mesh.refinement import mark, refine
from signorini_fx.mechanics.mesh.tagged import simplex_parameters
from signorini_fx.mechanics.statement.features import refuse
from signorini_fx.mechanics.statement.mesh_sources import MeshGenerator
from signorini_fx.mechanics.statement.settings import SolverSettings
from signorini_fx.results.accuracy.contact_values import interpolated
from signorini_fx.results.accuracy.price_list import zone_change
from signorini_fx.results.accuracy.stress_recovery import StressRecovery
from signorini_fx.results.solution import Solution
from signorini_fx.scenes.hierarchy import scene_on
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.scene import Scene
from signorini_fx.scenes.solver import solve
from signorini_fx.tuned import EXPECTED_RATES, FIRST_CELLS, OUTSIDE_OTHER_MESH, SLOWEST_RATE

Floats = npt.NDArray[np.float64]
EXACT = {"algorithm": "exact", "linear_algebra": "condensed"}
_CELLS = {"P": "triangle", "Q": "quadrilateral"}
# How errors decrease with h on smooth parts of the boundary.
_EXPECTED = {"energy": 1.0, **EXPECTED_RATES}


# Features of a scene that a study does not know.
REFUSES = {
    "nonlinear material": "a study is not possible yet with a nonlinear material",
    "mixed element": "a study compares elements without a pressure: leave 'mixed' out",
    "anisotropic material": "a study is not possible yet with an anisotropic material",
    "mesh that no generator makes": "a study needs a mesh from a generator, which can make coarser and finer ones",
    "several bodies": "a study is not possible yet with several [[body]]",
}


def on_mesh(scene: Scene, factor: float, element: str, settings: dict[str, Any]) -> Scene:
    """The scene with elements ``factor`` times as large, of this kind, and with other solver settings.

    Raises:
        SceneError: the generator makes no such meshes; the element is mixed.
    """
    refuse(scene.statement, REFUSES)
    finer = scene_on(scene, factor)
    mesh = finer.mesh
    assert isinstance(mesh, MeshGenerator)
    parameters = {**mesh.parameters, "cell": _CELLS[element[0]]}
    inherited = {"max_iterations", "max_outer_iterations", "tolerance"}
    return finer.model_copy(
        update={
            "mesh": mesh.model_copy(update={"parameters": parameters}),
            "element": scene.element.model_copy(update={"degree": int(element[1])}),
            # Each method is measured by itself, without fall-backs.
            "solver": SolverSettings(**scene.solver.model_dump(include=inherited), **settings, fallbacks=False),
            "accuracy": None,
        }
    )


class Reference:
    """A solution to compare others with.

    Stresses are compared at the quadrature points of the reference's cells; where a point lies outside the other mesh
    (a curved boundary), the nearest cell is continued.
    """

    def __init__(self, solution: Solution) -> None:
        self.solution = solution
        self._located: dict[Any, tuple[npt.NDArray[np.int32], Floats]] = {}
        model, mesh = solution.model, solution.model.tagged.mesh
        points, weights = basix.make_quadrature(getattr(basix.CellType, mesh.topology.cell_name()), 2)
        cells = np.arange(mesh.topology.index_map(mesh.topology.dim).size_local, dtype=np.int32)

        def at_points(expression: Any) -> Floats:
            return np.asarray(fem.Expression(expression, points).eval(mesh, cells)).reshape(
                cells.size * len(points), -1
            )

        self._points = np.zeros((cells.size * len(points), 3))
        self._points[:, : mesh.geometry.dim] = at_points(ufl.SpatialCoordinate(mesh))
        self._weights = np.abs(at_points(ufl.JacobianDeterminant(mesh))[:, 0]) * np.tile(weights, cells.size)
        lame = at_points(ufl.as_vector(model.lame))
        self._lame, self._mu = lame.T
        self._stress = at_points(_stress(solution))
        self._size = self._energy_norm(self._stress)

    @property
    def about(self) -> str:
        """A description for the text of the study."""
        mesh, statement = self.solution.model.tagged.mesh, self.solution.statement
        kind = {"triangle": "P", "quadrilateral": "Q"}[mesh.topology.cell_name()]
        adaptive = "" if statement.generated else ", adaptive"
        return f"{kind}{statement.element.degree}, exact{adaptive}"

    def errors(self, solution: Solution, mesh_key: Any = None) -> dict[str, float | None]:
        """Relative errors of a solution; None where there is nothing to compare.

        Args:
            solution: the solution.
            mesh_key: solutions with the same key are on the same mesh; None: on a separate mesh.
        """
        table, fine = solution.table, self.solution.table
        weight, pressure = fine.columns["weight"], fine.columns["pressure"]
        difference = interpolated(table, fine, "pressure") - pressure
        size = float(np.sqrt(np.dot(weight, pressure**2)))
        assert solution.contact is not None
        assert self.solution.contact is not None
        force, true_force = (s.contact.forces_of_each for s in (solution, self.solution) if s.contact)
        peak = pressure.max()
        return {
            "energy": self._energy_norm(self._stress_of(solution, mesh_key) - self._stress) / self._size,
            "pressure": float(np.sqrt(np.dot(weight, difference**2))) / size if size > 0 else None,
            "peak": float(abs(table.columns["pressure"].max() / peak - 1)) if peak > 0 else None,
            "zone": zone_change(table, fine),
            "force": float(np.linalg.norm(force - true_force) / np.linalg.norm(true_force)),
        }

    def _energy_norm(self, tau: Floats) -> float:
        """The square root of the integral of C^-1 tau : tau for the components of tau at the points."""
        density = compliance(tau.T, self.solution.model.kinematics, self._lame, self._mu)
        return float(np.sqrt(max(0.0, np.dot(self._weights, density))))

    def _stress_of(self, solution: Solution, key: Any) -> Floats:
        """Stress of another solution at the points of the reference."""
        mesh = solution.model.tagged.mesh
        space = fem.functionspace(mesh, ("DG", solution.statement.element.degree, (self._stress.shape[1],)))
        function = fem.Function(space)
        points = compat.interpolation_points(space.element)
        function.interpolate(fem.Expression(_stress(solution), points))
        if key is None or key not in self._located:
            cells, places, _ = cells_of_points(mesh, self._points, OUTSIDE_OTHER_MESH)
            assert (cells >= 0).all()  # the meshes are of one body
            self._located[key] = cells, places
        cells, places = self._located[key]
        shares = space.element.basix_element.tabulate(0, places)[0, :, :, 0]
        values = function.x.array.reshape(-1, self._stress.shape[1])
        return np.asarray(np.einsum("nk,nkc->nc", shares, values[space.dofmap.list[cells]]))


def _stress(solution: Solution) -> Any:
    """The components of the stress as UFL."""
    return element_stress(solution.model, solution.displacement, solution.last_step.place).components


def reference_solution(scene: Scene, fine: float, unknowns: int) -> tuple[Reference, dict[str, float | None]]:
    """A reference for a scene, and an estimate of its error.

    Args:
        scene: with a mesh from a generator, contact and one load step.
        fine: cells of a uniform reference, relative to those of the scene.
        unknowns: smallest number of unknowns of an adaptive reference.

    Raises:
        SceneError: the scene is not of that kind.
        ConvergenceError: there is no solution.
    """
    solutions = divided(scene, FIRST_CELLS, unknowns) if _straight(scene) else uniform(scene, fine, "Q2")
    reference = Reference(solutions[-1])
    # Meshes with half and a quarter of the cells along a line; of the energy norm both differences see the same error.
    finest = solutions[-1].model.dofs
    near, far = (min(solutions[:-1], key=lambda s: abs(np.log(finest / s.model.dofs / k))) for k in (4, 16))
    return reference, reference_errors(reference.errors(near), reference.errors(far))


def uniform(scene: Scene, fine: float, element: str) -> list[Solution]:
    """Solutions on uniform meshes with cells 4, 2 and 1 times ``fine`` times as large as those of the scene."""
    return [solve(on_mesh(scene, k * fine, element, EXACT), MPI.COMM_SELF) for k in (4, 2, 1)]


def divided(scene: Scene, first: float, unknowns: int) -> list[Solution]:
    """Solutions on triangles of degree 2, refined adaptively up to this number of unknowns."""
    scene = on_mesh(scene, first, "P2", EXACT)
    tagged = load_mesh(scene, MPI.COMM_SELF)
    solutions: list[Solution] = []
    while not solutions or solutions[-1].model.dofs < unknowns:
        solution = solve(scene.model_copy(update={"mesh": tagged}), MPI.COMM_SELF)
        solutions.append(solution)
        squares = StressRecovery.of(solution.model).squares(solution.displacement)
        tagged = refine(tagged, mark(MPI.COMM_SELF, squares))
    return solutions


def _straight(scene: Scene) -> bool:
    return (
        isinstance(scene.mesh, MeshGenerator)
        and simplex_parameters(scene.mesh.generator, scene.mesh.parameters) is not None
    )


def reference_errors(second: dict[str, float | None], third: dict[str, float | None]) -> dict[str, float | None]:
    """The error of the reference, estimated from the differences to it on cells two and four times as large.

    With errors like h^r the differences are 2^r - 1 and 4^r - 1 times that of the reference, so that their ratio is
    2^r + 1; in the energy norm, where the error is orthogonal to the coarser spaces, this holds for the squares.  The
    rate is the observed one, or the expected one if that is smaller.
    """
    errors: dict[str, float | None] = {}
    for name, near in second.items():
        far, power = third[name], 2 if name == "energy" else 1
        expected, slowest = (2 ** (power * rate) - 1 for rate in (_EXPECTED[name], SLOWEST_RATE))
        seen = expected if not far or not near else (far / near) ** power - 2
        errors[name] = None if near is None else near / min(expected, max(seen, slowest)) ** (1 / power)
    return errors
