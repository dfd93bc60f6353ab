"""The force through each section that is shortened.

With the jump J of a shortening of one, which is that of the cells beyond the section alone, the force through it is the
work of the stress there on J without that of the loads in these cells, a tension.  Loads on the surface of these cells
do not count.
"""

from __future__ import annotations

from dolfinx import fem

from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.quantities.summary import SectionForce
from signorini_fx.results.certificate.nodal_forces import NodalForces


def section_forces(
    statement: Statement, tagged: TaggedMesh, displacement: fem.Function, step: float
) -> list[SectionForce]:
    """What goes through each section that a scene shortens; collective."""
    if not statement.interfaces:
        return []
    nodal = NodalForces(statement, tagged, displacement.function_space)
    return [
        SectionForce(name=jump.entry.name, force=nodal.through(jump, displacement, step), shortening=jump.amount(step))
        for jump in nodal.jumps()
    ]
