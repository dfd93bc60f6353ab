"""Which quantities cells are divided for where the error is, unless a scene says otherwise."""

from __future__ import annotations

from signorini_fx.mechanics.statement.features import divisible
from signorini_fx.mechanics.statement.statement import Statement

# Quantities that a mesh shows the error of, cell by cell.  Others are told by comparing meshes; of them the largest
# pressure is known on meshes that are fine in some places only, if these become finer where it is.
LOCAL = ("energy", "pressure", "force")

# For which of these the cells are divided if another quantity is asked for.
DIVIDED_FOR = {"zone": "force"}


def divides(statement: Statement, of: str, cell: str, *, straight: bool) -> bool:
    """Whether a requested accuracy divides cells where the error is, unless a scene says otherwise.

    Args:
        statement: of the problem.
        of: the quantity.
        cell: of its mesh; a generator makes triangles in place of quadrilaterals.
        straight: whether the body has no arcs and no curved cells.
    """
    if of not in LOCAL or not straight or not divisible(statement, of):
        return False
    if statement.nonlinear and cell == "tetrahedron":  # those of degree 2 meet planes alone
        return False
    if statement.bodies:  # they become one mesh of triangles
        return of == "energy" and cell in ("triangle", "quadrilateral")
    return cell in ("triangle", "tetrahedron") or (statement.generated and cell == "quadrilateral")
