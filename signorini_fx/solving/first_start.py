"""Where the first load step starts: from a coarser mesh, else with contact everywhere."""

from __future__ import annotations

from dataclasses import dataclass

from signorini_fx.algebra.algorithms.task import Start, Task
from signorini_fx.mechanics.body.elastic_body import ElasticBody
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.rigid.mesh_levels import MeshLevel


@dataclass(frozen=True)
class CoarserMesh:
    """What a coarser mesh gives to a finer one: the levels of multigrid, its contact points, and the level with a
    displacement to begin with.
    """

    level: MeshLevel | None = None
    state: ContactState | None = None
    displaced: MeshLevel | None = None


def first_start(
    task: Task, start: Start, body: ElasticBody, state: ContactState | None, coarser: MeshLevel | None
) -> Start:
    """Where the first load step of a task starts, from the contact state and the displacement of a coarser mesh if
    there are any; collective.
    """
    if state is None:
        return start
    from signorini_fx.solving.nested import carry_over

    assert body.boundary is not None
    if coarser is not None:
        begin_at_coarse(task, coarser, body)
    return start.begin_from(*carry_over(state, body.boundary))


def begin_at_coarse(task: Task, coarser: MeshLevel, body: ElasticBody) -> None:
    """Begin with the displacement of the coarser mesh, where solves are not exact and gain by it; collective."""
    from signorini_fx.algebra.linalg.krylov import KrylovSystem

    system, free = task.system, ~body.fixed
    if not isinstance(system, KrylovSystem) or body.turned is not None:
        return
    level = system.elasticity.level
    start = level.start() if isinstance(level, MeshLevel) and level.coarser is coarser else None
    if start is not None:
        if task.rest is not None:
            start.getArray()[:] -= body.motions.displacement(task.rest.motion).ravel()[: free.size]
        task.iterate.x.getArray()[: free.size][free] = start.getArray(readonly=True)[free]
