"""Recomputes certified intervals with the guaranteed bounds of ``signorini_fx``; nothing else here needs them.

The mesh has triangles, displacements are quadratic.  An interval holds for the solution of the problem, whatever the
mesh that it was found on: no program may leave it by more than its own error.  Round-off has a share, which grows with
the mesh: the finest mesh need not have the narrowest interval.
"""

from __future__ import annotations

from contactbench.grids import make_grid
from contactbench.problem import Problem, Quantity


def certified(problem: Problem, level: int) -> dict[str, tuple[float, float]]:
    """The intervals of all quantities of the kind "interval", by name.

    Args:
        problem: whose bodies are polygons; no friction, or Tresca's.
        level: of the mesh.

    Raises:
        ValueError: there is no bound, and why.
    """
    from mpi4py import MPI

    import signorini_fx
    from contactbench.adapters.signorini import scene

    made, _ = scene(problem, make_grid(problem, level, triangles=True), degree=2, text=True, error_bound=True)
    solution = signorini_fx.solve(made, MPI.COMM_SELF)
    found = {}
    for quantity in problem.quantities:
        if quantity.kind == "interval":
            found[quantity.name] = _interval(solution, problem, quantity)
    return found


def _interval(solution: object, problem: Problem, quantity: Quantity) -> tuple[float, float]:
    bound = solution.error_bound  # type: ignore[attr-defined]
    if isinstance(bound, str) or bound.grounds.estimated:
        raise ValueError(f"{problem.name}: {bound}")
    if quantity.measure == "strain energy":
        low, high = bound.strain_energy
        return float(low), float(high)
    if quantity.measure != "normal force":
        raise ValueError(f"{problem.name}: {quantity.name}: there are bounds of the strain energy and of forces alone")
    contact = next(contact for contact in problem.contacts if contact.boundary == quantity.boundary)
    up = tuple(-problem.number(c) for c in contact.direction)
    force = solution.force_bounds(quantity.boundary, up)  # type: ignore[attr-defined]
    if isinstance(force, str) or force.grounds.estimated:
        raise ValueError(f"{problem.name}: {quantity.name}: {force}")
    return float(force[0]), float(force[1])
