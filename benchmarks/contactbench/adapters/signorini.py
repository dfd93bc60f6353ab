"""Runs ``signorini_fx``: semi-smooth Newton, regularisation of 1e5 E / L."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from ..answers import Answer, CannotRun, ContactForces
from ..elasticity import coordinates
from ..expressions import COORDINATES
from ..grids import Grid
from ..problem import Formula, Problem


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
    # The first degrees of freedom of a cell are those of its corners, in the order of its nodes.
    corners = grid.cells.shape[1]

    def answer(step: Any, earlier: dict[float, Answer]) -> Answer:
        space = step.displacement.function_space
        values = step.displacement.x.array.reshape(-1, problem.dimension)
        u = np.empty((len(nodes), problem.dimension))
        found = values[space.dofmap.list[:, :corners].ravel()]
        u[nodes[geometry_cells(space.mesh).ravel()]] = found
        contacts = _contacts(problem, step)
        return Answer(u, contacts, values.size, seconds, step.strain_energy, earlier=earlier)

    steps = solution.steps[-len(problem.times) :]
    earlier = {at: answer(step, {}) for at, step in zip(problem.times, steps[:-1], strict=False)}
    return answer(steps[-1], earlier)


def scene(problem: Problem, grid: Grid, degree: int = 1, **settings: Any) -> tuple[Any, Any]:
    """The scene of a problem on a mesh, and the node of the grid that each node of its mesh is.

    Args:
        problem: any.
        grid: its mesh.
        degree: of the displacement.
        settings: of ``SolverSettings``.
    """
    import signorini_fx as sfx

    from .dolfinx_mesh import make_mesh, tag_cells, tag_facets

    mesh, nodes = make_mesh(grid)
    facets, tags = tag_facets(mesh, nodes, grid)
    regions = {name: number for number, name in enumerate(grid.names, 1)}
    tagged = sfx.TaggedMesh(mesh, facets, tags, tag_cells(mesh, grid), regions)
    mixed = any(body.poisson == 0.5 for body in problem.bodies)

    def value(formula: Formula, time: float | None = None) -> float | Callable[[Any], Any]:
        """Of points, shape (3, n)."""
        if not problem.depends_on(formula, *COORDINATES):
            return float(problem.at(formula, {}, time))
        return lambda x: np.broadcast_to(
            problem.at(formula, coordinates(x[: problem.dimension].T), time), x.shape[1:]
        )

    times = (0.0,) * problem.dynamic + problem.times

    def entries(components: dict[int, Formula], holds: bool) -> Iterator[dict[str, Any]]:
        """Components that act in every step alike, then those that depend on the time: numbers as
        factors, fields one by one for each step.
        """
        varying = {k: f for k, f in components.items() if problem.depends_on(f, "time")}
        if steady := {k: f for k, f in components.items() if k not in varying}:
            yield {"xyz"[k]: value(formula) for k, formula in steady.items()}
        for k, formula in varying.items():
            if not problem.depends_on(formula, *COORDINATES):
                yield {"xyz"[k]: 1.0, "factors": [value(formula, now) for now in times]}
                continue
            for now in times:
                steps = [now == other for other in times]
                when = {"holds": steps} if holds else {"factors": list(map(float, steps))}
                yield {"xyz"[k]: value(formula, now), **when}

    supports = [
        sfx.Displacement(
            **(
                {"at": [problem.number(c) for c in support.at]}
                if support.at
                else {"boundary": support.boundary}
            ),
            **components,
        )
        for support in problem.supports
        for components in entries(support.components, holds=True)
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
            how |= {"distance": "geometry", "sliding": "finite"} if problem.finite else {}
            if contact.against == contact.boundary:
                del how["points"]  # both sides of a boundary that touches itself have some
        gap = value(contact.gap)
        contacts.append(sfx.Contact(boundary=contact.boundary, gap=gap, friction=law, **how))
    hypothesis = {} if problem.hypothesis == "space" else {"hypothesis": problem.hypothesis}
    several = len(problem.bodies) > 1
    material: Any = sfx.LinearElastic
    if problem.finite:
        material = partial(sfx.SaintVenantKirchhoff, law="saint-venant-kirchhoff")
    made = sfx.Scene(
        mesh=tagged,
        element=sfx.Element(degree=2, volumetric="mixed") if mixed else sfx.Element(degree=degree),
        material=[
            material(
                young=body.young,
                poisson=body.poisson,
                **hypothesis,
                **({"region": body.name} if several else {}),
                **({"density": body.density} if body.density else {}),
            )
            for body in problem.bodies
        ],
        displacement=supports,
        traction=[
            sfx.Traction(boundary=t.boundary, **components)
            for t in problem.tractions
            for components in entries(t.components, holds=False)
        ],
        **_times(problem, value),
        contact=contacts,
        solver=sfx.SolverSettings(**settings),
    )
    return made, nodes


def _times(problem: Problem, value: Callable[[Formula], Any]) -> dict[str, Any]:
    """Load steps, and what moves."""
    import signorini_fx as sfx

    if not problem.dynamic:
        several = len(problem.times) > 1
        return {"load_steps": sfx.LoadSteps(times=list(problem.times))} if several else {}
    several = len(problem.bodies) > 1
    return {
        "load_steps": sfx.LoadSteps(times=[0.0, *problem.times]),
        "inertia": sfx.Inertia(time_step=problem.time_step),
        "initial_velocity": [
            sfx.InitialVelocity(
                **({"body": body.name} if several else {}),
                **{"xyz"[k]: value(formula) for k, formula in enumerate(body.velocity)},
            )
            for body in problem.bodies
            if body.velocity
        ],
    }


def _contacts(problem: Problem, step: Any) -> dict[str, ContactForces]:
    state, found = step.contact, {}
    boundary, d = state.boundary, problem.dimension
    normal = boundary.weight * state.pressure
    friction = -boundary.nodal_forces(np.zeros_like(state.pressure), state.shear)
    for number, contact in enumerate(problem.contacts):
        own = boundary.part == number
        x, weight = boundary.centre[own][:, :d], boundary.weight[own]
        found[contact.boundary] = ContactForces(x, weight, normal[own], friction[own][:, :d])
    return found
