"""Example 1 of section 7.1: known numbers, and other discretisations of the same problem.

The Q1 numbers (120 x 40, gamma = 1e8, nu = 0.4) are those of an independent program (oracle.py).
Refined to 480 x 160 they are energy 0.023207 and largest pressure 20.115: the 120 x 40 mesh is 0.09
% and 0.02 % off, P1 on the same nodes 0.24 % and 0.02 %.  Other elements must agree with Q1 to the
sum of such errors.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scenes import alone, energy, example1, table_of

LAWS = {"tresca": {"bound": 1.5}, "coulomb": {"coefficient": 0.3}}
ENERGY = {"tresca": 0.0231870, "coulomb": 0.0234108}
LARGEST_PRESSURE = {"tresca": 20.1121, "coulomb": 20.1810}


def zones(table, mask):
    """Runs of nodes as intervals of x[0]."""
    return [[pytest.approx(end[0], abs=1e-9) for end in run] for run in table.zones(mask)]


@pytest.fixture(scope="module", params=LAWS)
def solved(request):
    """(law, solution, table) on the paper's mesh."""
    solution = alone(example1(**LAWS[request.param]))
    return request.param, solution, table_of(solution)


def test_resultants(solved):
    """The foundation carries the load of 20, and nothing sideways by symmetry."""
    _, solution, _ = solved
    contact, friction = solution.contact.forces
    assert np.dot(solution.contact.boundary.weight, solution.contact.pressure) == pytest.approx(
        20.0, abs=1e-6
    )
    assert_allclose(contact, [0.0, 20.0], atol=1e-6)
    assert_allclose(friction, [0.0, 0.0], atol=1e-6)


def test_numbers(solved):
    """Energy, largest pressure, and u_2 in the middle of the top."""
    law, solution, _ = solved
    assert energy(solution) == pytest.approx(ENERGY[law], abs=5e-8)
    assert solution.contact.pressure.max() == pytest.approx(LARGEST_PRESSURE[law], abs=5e-5)
    x = solution.model.space.tabulate_dof_coordinates()
    middle = np.flatnonzero(np.isclose(x[:, 0], 1.5) & np.isclose(x[:, 1], 1.0))
    u_2 = solution.displacement.x.array.reshape(-1, 2)[middle, 1]
    assert u_2 == pytest.approx({"tresca": -0.00382157, "coulomb": -0.00384852}[law], abs=5e-9)


def test_contact_zone(solved):
    """The same 53 nodes with either law."""
    _, _, table = solved
    assert zones(table, table.columns["state"] != "open") == [[0.85, 2.15]]


def test_slip_zones(solved):
    """Tresca friction slips outside the contact zone too, Coulomb friction at the ends of it."""
    law, _, table = solved
    friction, state = table.columns["friction"], table.columns["state"]
    if law == "tresca":
        assert zones(table, friction == "slip-") == [[0.325, 0.95]]
        assert zones(table, friction == "slip+") == [[2.05, 2.675]]
        assert_allclose(np.abs(table.columns["shear"])[friction != "stick"], 1.5, rtol=1e-12)
    else:
        assert zones(table, state == "stick") == [[1.025, 1.975]]
        assert zones(table, state == "slip-") == [[0.85, 1.0]]
        assert zones(table, state == "slip+") == [[2.0, 2.15]]


def test_certificate(solved):
    """The conditions of the problem hold, but for what the regularisation leaves: lambda /
    gamma.
    """
    _, solution, _ = solved
    certificate = solution.certificate
    assert certificate.holds
    assert certificate.equilibrium < 1e-10
    largest = np.abs(solution.displacement.x.array).max()
    assert certificate.penetration == pytest.approx(
        solution.contact.pressure.max() / 1e8 / largest, rel=1e-6
    )


@pytest.mark.parametrize(("coefficient", "zone"), [(0.1, [1.35, 1.65]), (1.0, [0.9, 2.1])])
def test_stick_zone_grows_with_friction(coefficient, zone):
    """The stick zones of Figure 5."""
    table = table_of(alone(example1(coefficient=coefficient)))
    assert zones(table, table.columns["state"] == "stick") == [zone]


OTHERS = {
    "P1": {"cell": "triangle"},
    "gmsh Q1": {"generator": "block"},
    "gmsh P1": {"generator": "block", "cell": "triangle"},
    "gmsh P1 unstructured": {"generator": "block", "cell": "triangle", "layout": "unstructured"},
    "gmsh Q1 unstructured": {"generator": "block", "layout": "unstructured"},
    "P2": {"cell": "triangle", "degree": 2, "nx": 60, "ny": 20},
    "Q2": {"degree": 2, "nx": 60, "ny": 20},
    "gmsh P2 unstructured": {
        "generator": "block", "cell": "triangle", "layout": "unstructured", "degree": 2, "nx": 60, "ny": 20
    },
}  # fmt: skip


@pytest.mark.one_quick("law", LAWS)
@pytest.mark.parametrize("other", OTHERS)
def test_other_discretisations(law, other):
    """Equilibrium holds exactly, energy and largest pressure to the discretisation error."""
    solution = alone(example1(**LAWS[law], **OTHERS[other]))
    assert np.dot(solution.contact.boundary.weight, solution.contact.pressure) == pytest.approx(
        20.0, abs=1e-6
    )
    assert energy(solution) == pytest.approx(ENERGY[law], rel=3e-3)
    assert solution.contact.pressure.max() == pytest.approx(LARGEST_PRESSURE[law], rel=1e-3)
    exact = OTHERS[other] == {"generator": "block"}
    if exact:
        assert energy(solution) == pytest.approx(ENERGY[law], abs=5e-8)
