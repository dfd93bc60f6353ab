"""Runs ``signorini_fx``: semi-smooth Newton, regularisation of 1e5 E / L."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.contactbench.answers import Answer, CannotRun, ContactForces
from benchmarks.contactbench.elasticity import coordinates
from benchmarks.contactbench.expressions import COORDINATES, names
from benchmarks.contactbench.grids import Grid
from benchmarks.contactbench.problem import Formula, Problem


def available() -> None:
    """Raise ``CannotRun`` where the package is not there."""
    try:
        import dolfinx  # noqa: F401

        import signorini_fx  # noqa: F401
    except ImportError as error:
        raise CannotRun(f"{error}: install FEniCSx and signorini_fx") from None


def solve(problem: Problem, grid: Grid) -> Answer:
    """Solve a problem on a mesh, with linear elements; incompressible bodies with mixed elements of
    degree 2.

    Raises:
        signorini_fx.ConvergenceError: there is no solution.
    """
    from mpi4py import MPI

    import signorini_fx
    from signorini_fx.machine.compat import geometry_cells

    made, nodes = scene(problem, grid)
    start = time.process_time()
    solution = signorini_fx.solve(made, MPI.COMM_SELF)
    seconds = time.process_time() - start
    mesh, dimension = solution.displacement.function_space.mesh, problem.dimension
    u = np.empty((len(nodes), dimension))
    space, values = (
        solution.displacement.function_space,
        solution.displacement.x.array.reshape(-1, dimension),
    )
    # The first degrees of freedom of a cell are those of its corners, in the order of its nodes.
    corners = grid.cells.shape[1]
    u[nodes[geometry_cells(mesh).ravel()]] = values[space.dofmap.list[:, :corners].ravel()]
    energy = float(solution.steps[-1].strain_energy)
    return Answer(
        u, _contacts(problem, solution), solution.displacement.x.array.size, seconds, energy
    )


def scene(problem: Problem, grid: Grid, degree: int = 1, **settings: Any) -> tuple[Any, Any]:
    """The scene of a problem on a mesh, and the node of the grid that each node of its mesh is.

    Args:
        problem: any.
        grid: its mesh.
        degree: of the displacement.
        settings: of ``SolverSettings``.
    """
    import signorini_fx as sfx
    from benchmarks.contactbench.adapters.dolfinx_mesh import make_mesh, tag_cells, tag_facets

    mesh, nodes = make_mesh(grid)
    facets, tags = tag_facets(mesh, nodes, grid)
    regions = {name: number for number, name in enumerate(grid.names, 1)}
    tagged = sfx.TaggedMesh(mesh, facets, tags, tag_cells(mesh, grid), regions)
    mixed = any(body.poisson == 0.5 for body in problem.bodies)

    def value(formula: Formula) -> float | Callable[[Any], Any]:
        """Of points, shape (3, n)."""
        if not isinstance(formula, str):
            return float(formula)
        if not names(formula) & {*problem.fields, *COORDINATES}:
            return problem.number(formula)
        return lambda x: np.broadcast_to(
            problem.at(formula, coordinates(x[: problem.dimension].T)), x.shape[1:]
        )

    def named(components: dict[int, Formula]) -> dict[str, Any]:
        return {"xyz"[k]: value(formula) for k, formula in components.items()}

    supports = [
        sfx.Displacement(
            **(
                {"at": [problem.number(c) for c in support.at]}
                if support.at
                else {"boundary": support.boundary}
            ),
            **named(support.components),
        )
        for support in problem.supports
    ]
    contacts = []
    for contact in problem.contacts:
        law = {
            "none": lambda contact: sfx.NoFriction(),
            "tresca": lambda contact: sfx.Tresca(bound=value(contact.bound)),
            "coulomb": lambda contact: sfx.Coulomb(coefficient=value(contact.coefficient)),
        }[contact.law](contact)
        how: dict[str, Any] = {"direction": [problem.number(c) for c in contact.direction] or None}
        if contact.against:
            how = {"against": contact.against, "distance": "nominal", "points": "boundary"}
        gap = value(contact.gap)
        contacts.append(sfx.Contact(boundary=contact.boundary, gap=gap, friction=law, **how))
    hypothesis = {} if problem.hypothesis == "space" else {"hypothesis": problem.hypothesis}
    several = len(problem.bodies) > 1
    made = sfx.Scene(
        mesh=tagged,
        element=sfx.Element(degree=2, volumetric="mixed") if mixed else sfx.Element(degree=degree),
        material=[
            sfx.LinearElastic(
                young=body.young,
                poisson=body.poisson,
                **hypothesis,
                **({"region": body.name} if several else {}),
            )
            for body in problem.bodies
        ],
        displacement=supports,
        traction=[
            sfx.Traction(boundary=t.boundary, **named(t.components)) for t in problem.tractions
        ],
        contact=contacts,
        solver=sfx.SolverSettings(**settings),
    )
    return made, nodes


def _contacts(problem: Problem, solution: Any) -> dict[str, ContactForces]:
    state, found = solution.contact, {}
    boundary, d = state.boundary, problem.dimension
    normal = boundary.weight * state.pressure
    friction = -boundary.nodal_forces(np.zeros_like(state.pressure), state.shear)
    for number, contact in enumerate(problem.contacts):
        own = boundary.part == number
        x, weight = boundary.centre[own][:, :d], boundary.weight[own]
        found[contact.boundary] = ContactForces(x, weight, normal[own], friction[own][:, :d])
    return found
