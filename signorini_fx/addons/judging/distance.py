"""How far a result is from the solution: a guaranteed interval of its error, and what stands beside our solution.

The bound takes any displacement v: the stress in equilibrium is ours (``bounds``).  With our solution u_h it gives

    |v - u| <= min(bound(v), |v - u_h| + bound(u_h)),    |v - u| >= |v - u_h| - bound(u_h),

in the energy norm; the second one is better where v does not touch.  On finer meshes of ours, in which v is nested, the
bound becomes its error.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
import numpy as np
from dolfinx import fem

from signorini_fx.addons.bounds.error_bound import error_bound
from signorini_fx.addons.decks.tagged_arrays import tagged
from signorini_fx.addons.judging.contact_figures import JudgedContactFigures
from signorini_fx.addons.judging.formulations import EXACT, FULL, elastic_stiffness, stiffness_by_material
from signorini_fx.addons.judging.own_solution import (
    HALVES,
    CarriedMesh,
    OneBody,
    as_functions,
    at_nodes_of,
    at_points,
    one_body,
    solved,
)
from signorini_fx.addons.judging.problem_data import JudgedProblem
from signorini_fx.addons.judging.reference_elements import gauss, reference_element
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.quantities.proved_statements import Refused
from signorini_fx.results.solution import Solution
from signorini_fx.tuned import JUDGED_FINEST, JUDGED_HALVINGS

FiguresOf = Callable[[Floats], Sequence[JudgedContactFigures] | None]
# Along each axis, exact for squares of gradients of degree 4.
_INTERPOLATION_POINTS = 5


@dataclass(frozen=True)
class DistanceOfResult:
    """How far a result is from the solution.

    Attributes:
        error: see ``Judgement.error``.
        beside: see ``Judgement.beside``.
    """

    error: Mapping[str, Any]
    beside: Mapping[str, Any]

    @property
    def lines(self) -> dict[str, str]:
        """In words."""
        return {"error": self._of_error(), "beside ours": self._of_beside()}

    def _of_error(self) -> str:
        error = self.error
        if not error.get("guaranteed"):
            distance = error.get("distance")
            reason = f"not bounded: {error['reason']}"
            return reason if distance is None else f"{_percent(distance)} in energy from ours on its mesh; {reason}"
        mesh = error["ours_on_their_mesh"]
        theirs = f"between {_percent(error['low'])} and {_percent(error['high'])} in energy, guaranteed"
        ours = f"ours on its mesh {_percent(mesh['low'])} to {_percent(mesh['high'])}"
        return f"{theirs}; {ours}, {_percent(error['distance'])} away"

    def _of_beside(self) -> str:
        if "reason" in self.beside:
            return str(self.beside["reason"])
        words = {"displacement": "displacement", "force": "contact force", "pressure": "largest pressure"}
        return ", ".join(f"{word} {_percent(self.beside[key])}" for key, word in words.items() if key in self.beside)


def _percent(value: float) -> str:
    return f"{100 * value:.3g} %"


def measured_distance(
    problem: JudgedProblem,
    v: Floats,
    contacts: Sequence[JudgedContactFigures],
    figures_of: FiguresOf,
    *,
    supported: bool,
) -> DistanceOfResult:
    """How far a displacement is from the solution.

    Args:
        problem: the problem.
        v: the displacement, length, shape (n, d).
        contacts: its figures.
        figures_of: the figures of another displacement, None where it is in equilibrium in no formulation.
        supported: whether it keeps to its supports, up to print.
    """
    held = ~np.isnan(problem.prescribed)
    exact = np.where(held, np.nan_to_num(problem.prescribed), v)
    try:
        if not supported:
            raise Refused("it does not keep to its supports")
        if problem.springs:
            raise Refused("a guaranteed bound is for bodies without springs so far")
        if any(material.varies for material in problem.materials):
            raise Refused("a guaranteed bound is for materials that do not vary so far")
        if any(figure.is_soft for figure in contacts):
            raise Refused("a guaranteed bound is for hard contact")
        body = one_body(problem, exact)
        if problem.statement.has_coulomb:
            raise Refused("friction of Coulomb")
        return _guaranteed(problem, body, contacts, figures_of)
    except Refused as reason:
        return _estimated(problem, v, contacts, figures_of, str(reason))


def _guaranteed(
    problem: JudgedProblem, body: OneBody, contacts: Sequence[JudgedContactFigures], figures_of: FiguresOf
) -> DistanceOfResult:
    """With the interval of the error."""
    dim = body.mesh.arrays.dim
    coarse = solved(body.solve)
    on_mesh = at_points(coarse, body.mesh.arrays.points)
    theirs = body.mesh.displacements
    apart = _energy_norm(problem, body.mesh, theirs - on_mesh)
    mesh, ours = body.mesh.with_displacement(on_mesh), coarse
    for _ in range(_halvings(body.mesh)):
        mesh = mesh.finer()
    missed = [0.0, 0.0]
    if mesh.arrays.kind == "quad9":
        missed = [_interpolation_error(problem, mesh, number) for number in range(len(missed))]
        mesh = mesh.on_triangles()
    if mesh.arrays is not body.mesh.arrays:
        ours = solved(body.solve, mesh=tagged(mesh.arrays))
    size, own_error = _bound(ours, ours.displacement)
    finest = at_points(ours, mesh.arrays.points)
    intervals = []
    for number, displacement in enumerate(as_functions(ours, mesh)):
        distance = _energy_norm(problem, mesh, mesh.displacements[:, number * dim : (number + 1) * dim] - finest)
        _, direct = _bound(ours, displacement)
        high = min(direct, distance + own_error) + missed[number]
        low = max(distance - own_error - missed[number], 0.0)
        intervals.append({"low": low / size, "high": high / size})
    error = {
        "guaranteed": True,
        **intervals[0],
        "ours_on_their_mesh": intervals[1],
        "distance": apart / size,
        "unknowns": int(ours.displacement.x.array.size),
    }
    return DistanceOfResult(error, _beside(problem, theirs, on_mesh, coarse, contacts, figures_of))


def _halvings(mesh: CarriedMesh) -> int:
    """How often the sides of a mesh can be halved until a solve takes long."""
    unknowns, dim = mesh.arrays.points.size, mesh.arrays.dim
    finest = np.log(JUDGED_FINEST[dim] / unknowns) / np.log(2**dim)
    return int(np.clip(np.floor(finest), 0, JUDGED_HALVINGS))


def _bound(solution: Solution, displacement: fem.Function) -> tuple[float, float]:
    """The energy norm of a displacement, and the bound of that of its error with the stress of a solution."""
    bound = error_bound(solution.model, displacement, solution.contact, solution.steps[-1].place)
    if isinstance(bound, str):
        raise Refused(bound)
    return bound.size, bound.error


def _interpolation_error(problem: JudgedProblem, mesh: CarriedMesh, number: int) -> float:
    """The energy norm of the difference of a displacement on parallelograms and its interpolation on their halves.

    Args:
        problem: the problem.
        mesh: of parallelograms of degree 2.
        number: of the displacement.
    """
    arrays, dim = mesh.arrays, mesh.arrays.dim
    u = mesh.displacements[:, number * dim : (number + 1) * dim][arrays.cells]
    whole, half = reference_element(arrays.kind), reference_element("triangle6")
    places, weights = gauss(_INTERPOLATION_POINTS, dim, simplex=True)
    jacobian = np.einsum("qkj,mkd->mqdj", whole.gradient(np.full((1, dim), 0.5)), arrays.points[arrays.cells])[:, 0]
    square = 0.0
    for nodes in map(list, HALVES):
        corners = whole.nodes[nodes]
        to_whole = np.einsum("qkj,kd->qdj", half.gradient(places), corners)  # the same at all places
        gradient = np.einsum("qkj,qjd->qkd", half.gradient(places), np.linalg.inv(to_whole))
        difference = np.einsum("qkj,mkd->mqdj", whole.gradient(half.shape(places) @ corners), u)
        difference -= np.einsum("qkj,mkd->mqdj", gradient, u[:, nodes])
        physical = np.einsum("mqdj,mje->mqde", difference, np.linalg.inv(jacobian))
        size = np.abs(np.linalg.det(jacobian))[:, None] * weights * np.abs(np.linalg.det(to_whole))
        strain = np.zeros((*physical.shape[:2], 6))
        strain[..., 0], strain[..., 1] = physical[..., 0, 0], physical[..., 1, 1]
        strain[..., 3] = physical[..., 0, 1] + physical[..., 1, 0]
        for material, cells in zip(problem.materials, _cells_of(problem, mesh), strict=True):
            stiffness = elastic_stiffness(problem, material.stiffness)
            square += float(
                np.einsum("mq,mqi,ij,mqj->", size[cells], strain[cells], stiffness, strain[cells], optimize=True)
            )
    return float(np.sqrt(square))


def _cells_of(problem: JudgedProblem, mesh: CarriedMesh) -> list[Ints]:
    """The cells of each material on a mesh of one body."""
    arrays = mesh.arrays
    everything = np.arange(len(arrays.cells))
    owner = np.full(len(arrays.cells), -1)
    for number, material in enumerate(problem.materials):
        owner[arrays.regions.get(material.name, everything[:0]) if material.name else everything] = number
    return [np.flatnonzero(owner == number) for number in range(len(problem.materials))]


def _energy_norm(problem: JudgedProblem, mesh: CarriedMesh, difference: Floats) -> float:
    """Of a displacement of a mesh of one body, shape (n, d)."""
    arrays = mesh.arrays
    materials = tuple(
        replace(material, cells=cells)
        for material, cells in zip(problem.materials, _cells_of(problem, mesh), strict=True)
    )
    names = np.arange(len(arrays.points))
    part_mesh = replace(problem.mesh, points=arrays.points, kind=arrays.kind, cells=arrays.cells, names=names)
    part = replace(problem, mesh=part_mesh, materials=materials)
    u = difference.ravel()
    square = sum(float(u @ (matrix @ u)) for matrix in stiffness_by_material(part, EXACT))
    return float(np.sqrt(max(square, 0.0)))


def _estimated(
    problem: JudgedProblem, v: Floats, contacts: Sequence[JudgedContactFigures], figures_of: FiguresOf, reason: str
) -> DistanceOfResult:
    """With the distance to our solution on the same mesh alone."""
    try:
        solution = solved(problem.solve)
        ours = at_nodes_of(solution, problem)
        if not ours[problem.deformable].any():
            raise Refused("in our own solution nothing moves")
    except Refused as missing:
        why = f"{reason}; {missing}"
        return DistanceOfResult({"guaranteed": False, "distance": None, "reason": why}, {"reason": str(missing)})
    v = np.where(problem.deformable[:, None], v, ours)
    matrices = [*stiffness_by_material(problem, FULL), *problem.springs.values()]
    difference, size = (
        np.sqrt(sum(float(u.ravel() @ (matrix @ u.ravel())) for matrix in matrices)) for u in (v - ours, ours)
    )
    error = {"guaranteed": False, "distance": float(difference / size), "reason": reason}
    return DistanceOfResult(error, _beside(problem, v, ours, solution, contacts, figures_of))


def _beside(
    problem: JudgedProblem,
    v: Floats,
    ours: Floats,
    solution: Solution,
    contacts: Sequence[JudgedContactFigures],
    figures_of: FiguresOf,
) -> dict[str, float]:
    """Differences of displacement, contact force and largest pressure, relative to ours."""
    beside = {"displacement": float(np.linalg.norm(v - ours, axis=1).max() / np.linalg.norm(ours, axis=1).max())}
    if solution.contact is None or not contacts:
        return beside
    theirs = _forces_of(contacts)
    on_mesh = figures_of(ours) if ours.shape == problem.mesh.points.shape else None
    weights, largest = _of_solution(problem, solution) if on_mesh is None else _forces_of(on_mesh)
    if weights > 0:
        beside["force"] = float(abs(theirs[0] - weights) / weights)
        beside["pressure"] = float(abs(theirs[1] - largest) / largest)
    return beside


def _forces_of(contacts: Sequence[JudgedContactFigures]) -> tuple[float, float]:
    """The sum of what presses at corners, and the largest pressure there."""
    pushes = [(f.surface.push[f.surface.judged], f.surface.area[f.surface.judged]) for f in contacts]
    return float(sum(push.sum() for push, _ in pushes)), max(float((p / a).max(initial=0.0)) for p, a in pushes)


def _of_solution(problem: JudgedProblem, solution: Solution) -> tuple[float, float]:
    """The same of a solution of ours by its own points, where its displacement is on another mesh."""
    assert solution.contact is not None
    share = 2 * np.pi if problem.hypothesis == "axisymmetric" else 1.0
    rivals = [part for part, entry in enumerate(solution.model.statement.contact) if not entry.bonded]
    pressures = solution.contact.pressure[np.isin(solution.contact.boundary.part, rivals)]
    force = float(np.linalg.norm(solution.contact.forces_of_each[rivals, 0], axis=1).sum()) / share
    return force, float(pressures.max())
