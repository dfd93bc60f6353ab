"""The cost that ``check`` foresees, against what the factorisation counts; no clock is read."""

from itertools import pairwise

import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scenes import example1, prepared

from signorini_fx.algebra.linalg.factorisation import factor_entries, has_package
from signorini_fx.results.accuracy.convergence_table import factorisation_seconds

# What a core of the 2020s does in a sparse factorisation: from small fronts, where the ordering
# takes most of the time, to large ones that run at the speed of a dense product.
SLOWEST, FASTEST = 5e8, 2e10  # operations a second


@pytest.mark.skipif(not has_package("mumps"), reason="MUMPS counts")
@pytest.mark.one_quick(
    ("cell", "degree"), [("quadrilateral", 1), ("triangle", 1), ("quadrilateral", 2)]
)
def test_operations_and_entries_of_a_factorisation(cell, degree):
    """Seconds are those of the operations on a core of the 2020s, bytes those of the entries to a
    factor of two.
    """
    speeds = []
    for nx in (30, 60, 120):
        cells = nx // degree
        scene = example1(nx=cells, ny=cells // 3, cell=cell, degree=degree, linear_algebra="full")
        pc = PETSc.PC().create(MPI.COMM_SELF)
        stiffness = prepared(scene).stiffness
        unknowns = stiffness.getSize()[0]
        pc.setOperators(stiffness)
        pc.setType(PETSc.PC.Type.CHOLESKY)
        pc.setFactorSolverType("mumps")
        pc.setUp()
        factor = pc.getFactorMatrix()
        speeds.append(factor.getMumpsRinfog(3) / factorisation_seconds(unknowns, 2))
        assert 0.5 <= 9.0 * factor_entries(unknowns, 2) / (8.0 * factor.getMumpsInfog(9)) <= 2.0
    assert all(SLOWEST <= speed <= FASTEST for speed in speeds)
    # Operations grow like n^1.5 and what else there is like n: the speed rises, and never by more
    # than that.
    assert all(1.0 <= fine / coarse <= 4.0**0.5 * 1.25 for coarse, fine in pairwise(speeds))
