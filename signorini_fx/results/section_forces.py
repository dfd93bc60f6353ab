"""The force through each section that is shortened.

With the jump J of a shortening of one, which is that of the cells beyond the section alone, the force through it is the
work of the stress there on J without that of the loads in these cells, a tension.  Loads on the surface of these cells
do not count.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from dolfinx import fem

from signorini_fx.mechanics.mesh.tagged import TaggedMesh
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
    statement: Statement, tagged: TaggedMesh, displacement: fem.Function, step: float
) -> list[SectionForce]:
    """What goes through each section that a scene shortens; collective."""
    if not statement.interfaces:
        return []
    nodal = NodalForces(statement, tagged, displacement.function_space)
    return [
        SectionForce(jump.entry.name, nodal.through(jump, displacement, step), jump.amount(step))
        for jump in nodal.jumps()
    ]
