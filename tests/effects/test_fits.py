"""Friction of a fit: its pressure balances itself, so that statics alone does not know what it can
carry.
"""

import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from on_meshes import at_coordinate
from two_bodies import facets, forms, held

from signorini_fx import ContactProblem, ConvergenceError, Coulomb, Foundation, Status

pytestmark = pytest.mark.mpi
YOUNG, OVERLAP, FRICTION = 100.0, 0.01, 0.3


def pushed_between_walls(dimension, share, **settings):
    """A unit block between two rigid walls, each of which overlaps it, pushed along them by its
    weight.

    Without a Poisson effect the mean of the pressure follows from the overlap alone, E 2 d / L,
    however friction and bending distribute it, as long as the contact is closed: the stress along x
    has the same mean in each section.
    """
    cells = {2: (mesh.create_unit_square, (6, 5)), 3: (mesh.create_unit_cube, (4, 3, 2))}[dimension]
    kind = {2: mesh.CellType.quadrilateral, 3: mesh.CellType.hexahedron}[dimension]
    block = cells[0](MPI.COMM_WORLD, *cells[1], cell_type=kind)
    space, a, v = forms(block, 1, YOUNG, 0.0)
    walls = [facets(block, at_coordinate(0, at)) for at in (0.0, 1.0)]
    weight = share * 2 * FRICTION * YOUNG * 2 * OVERLAP
    load = fem.Constant(block, (0.0, -weight, 0.0)[:dimension])
    bcs = [held(space, facets(block, at_coordinate(2, 0.0)), 2)] if dimension == 3 else []
    contact = [Foundation(wall, gap=-OVERLAP, friction=Coulomb(FRICTION)) for wall in walls]
    return ContactProblem(a, ufl.inner(load, v) * ufl.dx, bcs, contact=contact, **settings)


def share_found(problem):
    """The share of the loads that the history names."""
    told = [
        event
        for event in problem.history.events
        if event.startswith("friction at this pressure carries at most ")
    ]
    return float(told[-1].split()[7])


@pytest.mark.mpi(slow=True)
@pytest.mark.one_quick(
    "settings", [{}, {"algorithm": "alm"}, {"coulomb": "newton"}, {"fallbacks": False}], ids=str
)
@pytest.mark.parametrize("dimension", [2, 3])
def test_it_slides_beyond_what_its_pressure_can_carry(dimension, settings):
    """The limit is 2 F p A: at 1.01 the outcome says so, with the share that is carried."""
    problem = pushed_between_walls(dimension, 1.01, **settings)
    with pytest.raises(ConvergenceError, match="nothing is proved of other pressures"):
        problem.solve()
    assert problem.status is Status.SLIDES_AT_PRESSURES
    assert share_found(problem) == pytest.approx(1 / 1.01, rel=1e-4)


@pytest.mark.parametrize("dimension", [2, 3])
def test_below_it_is_held(dimension):
    """At 0.99 there is a solution that carries the load; too few problems for it are no limit of
    friction.
    """
    problem = pushed_between_walls(dimension, 0.99)
    problem.solve()
    contact, friction = problem.state.forces
    assert (contact + friction)[1] == pytest.approx(
        0.99 * 2 * FRICTION * YOUNG * 2 * OVERLAP, rel=1e-6
    )
    assert len(problem.history.outer) > 2
    short = pushed_between_walls(
        dimension, 0.99, coulomb="fp", max_outer_iterations=1, fallbacks=False
    )
    with pytest.raises(ConvergenceError):
        short.solve()
    assert short.status is Status.OUTER_MAX_ITERATIONS
