"""The cost of the next accuracy: error and seconds of the present solve, and a forecast for a
smaller error.

Where a requested accuracy divides cells locally, errors decrease like one over the unknowns
whatever singularities there are; where all cells become smaller, they decrease at a rate between
those at a corner of the body and elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, log, log2

from signorini_fx.machine.display import duration
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, curvature
from signorini_fx.mechanics.statement.features import divisible
from signorini_fx.mechanics.statement.mesh_sources import MeshGenerator
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.quantities.summary import CostOfAccuracy
from signorini_fx.tuned import (
    COARSER_START,
    FIRST_UNKNOWNS,
    FIXED_UNKNOWNS,
    LAST_UNKNOWNS,
    LOCAL_GROWTH,
    LOCAL_SPREAD,
    MARGIN,
    MARGIN_OF_ENERGY,
    MESHES_TIMES,
    NEXT_ERROR,
    SAME_LENGTH,
    UNIFORM_RATE,
    UNIFORM_SPREAD,
)

# The quantities of a forecast by key, in words.
NAMES = {
    "pressure": "the pressure",
    "force": "the force",
    "energy": "the stress",
    "zone": "the zone",
    "peak": "the largest pressure",
}


def between(seconds: tuple[float, float]) -> str:
    """Return a range of times in words, such as 3 to 6 s."""
    low, high = (duration(float(f"{value:.2g}")) for value in seconds)
    if low == high:
        return low if low.startswith("below") else f"about {low}"
    if low.startswith("below"):
        return f"up to {high}"
    number, _, unit = low.rpartition(" ")
    return f"{number} to {high}" if unit == high.rpartition(" ")[2] else f"{low} to {high}"


def divides_cells(statement: Statement, tagged: TaggedMesh, of: str) -> bool:
    """Return whether a requested accuracy makes cells smaller where the error is; for forms,
    whether it can; collective.

    Drawings are remade with such cells, or divided if they are straight.  In 3D local division is
    implemented for the error of the stress alone.
    """
    cell = tagged.mesh.topology.cell_name()
    degree = statement.element.degree
    own_forms = statement.units is None
    if (tagged.dimension == 3 and (of != "energy" or degree != 1 or own_forms)) or (
        own_forms and degree != 2
    ):
        return False
    one_body = not statement.bodies and statement.sides[1] is None
    remade = statement.remade and of != "force" and (one_body or statement.generated)
    straight = (
        not statement.arcs
        if statement.generated
        else not statement.remade and curvature(tagged) <= SAME_LENGTH * tagged.size
    )
    return divides(statement, of, cell, straight=straight or (remade and tagged.dimension == 2))


@dataclass(frozen=True)
class NextRefinement:
    """The meshes that lead to the next error.

    Attributes:
        unknowns: number of unknowns of the last mesh.
        times: time of all these meshes over that of the mesh that was solved, from and to.
        degree: degree of the element.
        local: whether cells are divided locally, where the error is.
        share: ratio of the next error to the present one.
    """

    unknowns: float
    times: tuple[float, float]
    degree: int
    local: bool
    share: float


def next_refinement(
    statement: Statement, tagged: TaggedMesh, of: str, dofs: float, *, able: bool = True
) -> NextRefinement:
    """Return the meshes by which a requested accuracy would reach the next error; collective.

    Args:
        statement: the entries of the problem.
        tagged: the mesh.
        of: the quantity of the error.
        dofs: number of unknowns.
        able: whether an accuracy can be requested; for residuals it cannot, and all cells become
            smaller.
    """
    dimension = tagged.dimension
    degree = statement.element.degree
    local = able and divides_cells(statement, tagged, of)
    # For nonlinear bodies less is foretold: at corners divided cells follow a stress without a
    # limit until they fold, and nothing is known of the edges of plastic zones.
    share = NEXT_ERROR[3 if statement.nonlinear else dimension]
    if local:
        meshes = _divided(statement, dimension, dofs, share)
        fixed = FIXED_UNKNOWNS[2]
        degree = 2
    else:
        fall = share
        first = dofs
        fixed = FIXED_UNKNOWNS[dimension]
        if able and dimension == 2 and degree == 1 and of in LOCAL and statement.units is not None:
            # as in ``_divided``
            fall = 2 * fall
            degree = 2
            first = 4 * dofs
        halvings = -log2(fall) / UNIFORM_RATE
        if not statement.generated:  # other meshes can only be halved, until the target is met
            halvings = ceil(-log2(min(fall * _margin(of, degree), 1.0)) / UNIFORM_RATE)
        meshes = [first * 2.0 ** (dimension * halvings)]
    spread = LOCAL_SPREAD if local and dimension == 2 else UNIFORM_SPREAD
    # Newton's iterations for metal increase like one over the size of cells: 0.51 for 1/2, mean of
    # 12 problems in 2D.
    metal = any(
        not material.linear and hasattr(material, "yield_stress") for material in statement.material
    )
    more = 1 / dimension if metal else 0.0
    middle = MESHES_TIMES * sum((fixed + n) * (n / dofs) ** more for n in meshes) / (fixed + dofs)
    times = (middle / spread, middle * spread)
    return NextRefinement(meshes[0], times, degree, local, share)


def _margin(of: str, degree: int) -> float:
    """Return the requested error over the one that is then expected."""
    return MARGIN_OF_ENERGY[degree] if of == "energy" else MARGIN


def next_cost(
    statement: Statement,
    tagged: TaggedMesh,
    of: str,
    error: float,
    solved: Sequence[tuple[int, float]],
    starting: float,
    *,
    able: bool = True,
) -> CostOfAccuracy:
    """Return the forecast, such as: 3 % error of the stress took 0.4 s; 0.3 %: 0.5 to 2 s with
    --accuracy 0.43%; collective.

    Args:
        statement: the entries of the problem.
        tagged: the mesh.
        of: the quantity of the error.
        error: its relative error.
        solved: unknowns and seconds of each mesh.
        starting: the part of the last seconds that does not grow on a finer mesh, such as
            compilation.
        able: whether an accuracy can be requested.
    """
    dofs, last = solved[-1]
    refinement = next_refinement(statement, tagged, of, dofs, able=able)
    following = refinement.share * error
    target = f"{min(following * _margin(of, refinement.degree), 0.99):.2g}"
    command = f"--accuracy {float(f'{100 * float(target):.2g}'):g}%"
    command += f" --of {of}" if of != "energy" else ""
    if statement.units is None:  # of forms
        more = {"of": of} if of != "energy" else {}
        more |= {"refinement": "adaptive"} if refinement.local else {}
        arguments = "".join(f", {key}={value!r}" for key, value in more.items())
        command = f"Accuracy(target={target}{arguments})"
    command = command if able else ""
    low, high = (starting + times * (last - starting) for times in refinement.times)
    seconds = sum(seconds for _, seconds in solved)
    digits = 1 if following * 5 < error else 2  # a digit less
    took = f"{100 * error:.2g} % error of {NAMES[of]} took {duration(seconds)}"
    smaller = (
        f"{100 * following:.{digits}g} %: {between((low, high))}{' with ' * bool(command)}{command}"
    )
    return CostOfAccuracy(
        of=of,
        error=error,
        seconds=seconds,
        dofs=dofs,
        next_error=following,
        next_seconds=[low, high],
        next_dofs=refinement.unknowns,
        command=command,
        local=refinement.local,
        statement=f"{took}; {smaller}{'' if refinement.local else ', all cells smaller'}",
    )


def _divided(statement: Statement, dimension: int, dofs: float, share: float) -> list[float]:
    """Return the number of unknowns of each mesh, the last one first."""
    mesh = statement.origin.get("mesh")
    last = (LAST_UNKNOWNS[dimension] * dofs**0.5 if statement.accuracy is None else dofs) / share
    coarser = 1.0
    if statement.generated and not statement.bodies and isinstance(mesh, MeshGenerator):
        coarser = mesh.coarsest(COARSER_START[2])
    if coarser > 1 or dimension == 3:
        # The first mesh is one of degree 2, with larger cells where these are their halves.
        finer = 2 / statement.element.degree / coarser
        first = FIRST_UNKNOWNS
        if dimension == 3 or statement.accuracy is None:  # else the mesh is one of divided cells
            first = max(dofs * finer**dimension, first)
        # In 3D an accuracy takes two meshes.
        fall = last / first if dimension == 2 else max(last / first, LOCAL_GROWTH)
    else:  # with degree 2 a mesh has four times the unknowns, and half of the error
        first, fall = (
            (dofs, 1 / share) if statement.element.degree == 2 else (4 * dofs, 1 / share / 2)
        )
    count = max(ceil(log(fall) / log(LOCAL_GROWTH)), 0) + 1
    return [max(first, last / LOCAL_GROWTH**number) for number in range(count)]


# Quantities whose error is estimated cell by cell on one mesh.  The errors of others are found by
# comparing meshes; of them that of the largest pressure is known on locally refined meshes, if
# these become finer where it is.
LOCAL = ("energy", "pressure", "force")

# The quantity whose error divides cells if another one is requested.
DIVIDED_FOR = {"zone": "pressure"}


def divides(statement: Statement, of: str, cell: str, *, straight: bool) -> bool:
    """Return whether a requested accuracy divides cells locally, where the error is, unless a scene
    requests otherwise.

    Args:
        statement: the entries of the problem.
        of: the quantity of the error.
        cell: the cell name of its mesh, although a generator may make triangles in place of
            quadrilaterals.
        straight: whether the body has no arcs and no curved cells.
    """
    if not straight or not divisible(statement, of):
        return False
    # Tetrahedra of degree 2 meet planes alone.
    if cell == "tetrahedron" and (statement.nonlinear or of not in LOCAL):
        return False
    if statement.bodies:  # they become one mesh of triangles
        return of == "energy" and cell in ("triangle", "quadrilateral")
    return cell in ("triangle", "tetrahedron") or (statement.generated and cell == "quadrilateral")
