"""The package against an independent program that was written from the paper (oracle.py)."""

import numpy as np
import oracle
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scenes import PATCH, alone, energy, example1, table_of

GRIDS = [(30, 10), (60, 20)]
CELLS = ["quadrilateral", "triangle"]


def in_grid_order(solution, nx, ny):
    """Nodal displacements in the order of the oracle's grid, shape (nodes, 2)."""
    space = solution.model.space
    x = space.tabulate_dof_coordinates()
    number = np.rint(x[:, 0] * nx / oracle.LENGTH) + (nx + 1) * np.rint(
        x[:, 1] * ny / oracle.HEIGHT
    )
    return solution.displacement.x.array.reshape(-1, 2)[np.argsort(number)]


def agree(solution, reference, nx, ny):
    """Displacement, lambda, mu to 1e-9 of their largest values, the sets and the energy."""
    table = table_of(solution).columns
    assert_array_equal(table["state"] != "open", reference.in_contact)
    for ours, theirs in (
        (in_grid_order(solution, nx, ny), reference.u),
        (table["pressure"], reference.pressure),
        (table["shear"], reference.shear),
    ):
        assert_allclose(ours, theirs, rtol=0, atol=1e-9 * np.abs(theirs).max())
    assert energy(solution) == pytest.approx(reference.energy, rel=1e-9)


@pytest.mark.one_quick("cell", CELLS)
@pytest.mark.parametrize(("nx", "ny"), GRIDS)
@pytest.mark.parametrize("gamma", [(1e4, 1e6), (1e8, 1e8)])
def test_tresca(nx, ny, cell, gamma):
    """Given friction, from the paper's patch: the same solution after the same number of linear
    solves.
    """
    solution = alone(
        example1(bound=1.5, nx=nx, ny=ny, cell=cell, gamma=gamma, patch=PATCH, sigma=1.0)
    )
    reference = oracle.tresca(nx, ny, 0.4, 1.5, gamma, (1.25, 1.75), cell)
    agree(solution, reference, nx, ny)
    table = table_of(solution).columns
    assert_array_equal(
        np.select([table["friction"] == "slip+", table["friction"] == "slip-"], [1, -1]),
        reference.slip,
    )
    assert solution.history.linear_solves == reference.solves


@pytest.mark.one_quick("cell", CELLS)
@pytest.mark.parametrize(("nx", "ny"), GRIDS)
@pytest.mark.parametrize("coefficient", [0.1, 0.3, 1.0])
def test_coulomb(nx, ny, cell, coefficient):
    """Coulomb friction by Algorithm (FP) from the pure contact problem: the same solution after the
    same solves.
    """
    solution = alone(example1(coefficient=coefficient, nx=nx, ny=ny, cell=cell, sigma=1.0))
    reference = oracle.coulomb(nx, ny, 0.4, coefficient, (1e8, 1e8), cell)
    agree(solution, reference, nx, ny)
    assert solution.history.linear_solves == reference.solves
    assert len(solution.history.outer) == 1 + reference.outer


def test_numbers_of_example_1():
    """The numbers that the package's results are known by, from the oracle alone (Q1, 120 x 40,
    gamma = 1e8).
    """
    middle = 40 * 121 + 60
    tresca, coulomb = (
        oracle.tresca(120, 40, 0.4, 1.5, (1e8, 1e8), (1.25, 1.75)),
        oracle.coulomb(120, 40, 0.4, 0.3, (1e8, 1e8)),
    )
    assert tresca.u[middle, 1] == pytest.approx(-0.00382157, abs=5e-9)
    assert coulomb.u[middle, 1] == pytest.approx(-0.00384852, abs=5e-9)
    assert (tresca.energy, coulomb.energy) == pytest.approx((0.0231870, 0.0234108), abs=5e-8)
    assert (tresca.pressure.max(), coulomb.pressure.max()) == pytest.approx(
        (20.1121, 20.1810), abs=5e-5
    )
    assert (tresca.solves, coulomb.solves) == (11, 16)
