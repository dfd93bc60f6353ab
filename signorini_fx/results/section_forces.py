"""The force through each section that is shortened, without any compiled form.

With the jump J of a shortening of one, which is that of the cells beyond the section alone, the force through it is the
work of the stress there on J without that of the loads in these cells, a tension.  Loads on the surface of these cells
do not count.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from dolfinx import fem

from signorini_fx.machine import parallel
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.effect import Force
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.results.certificate.nodal_forces import NodalForces


@dataclass(frozen=True)
class SectionForce:
    """A shortened section in a result.

    Attributes:
        name: which one.
        force: tension through it, force.
        shortening: by how much its sides have moved towards each other, length.
    """

    name: str
    force: float
    shortening: float

    def as_dict(self) -> dict[str, Any]:
        """A row of the summary."""
        return asdict(self)


def section_forces(
    statement: Statement, tagged: TaggedMesh, displacement: fem.Function, step: float, scale: float = 1.0
) -> list[SectionForce]:
    """What goes through each section that a scene shortens, with all loads times ``scale``; collective."""
    if not statement.interfaces:
        return []
    nodal = NodalForces(statement, tagged, displacement.function_space)
    inside, forces = [load for load in statement.of(Force) if load.where is None], []
    for jump, beyond in nodal.jumps():
        shortening = scale * jump.amount(step)
        moved = nodal.volume.moved(displacement)
        moved.x.array[:] = displacement.x.array + shortening * jump.at_nodes.ravel()
        residual = beyond.internal(moved)
        residual = residual - beyond.external(step, scale, inside) - beyond.strained(step, scale)[0]
        force = parallel.global_sum(tagged.mesh.comm, np.array(np.sum(residual * jump.at_nodes[: beyond.owned])))
        forces.append(SectionForce(jump.entry.name, float(force), shortening))
    return forces
