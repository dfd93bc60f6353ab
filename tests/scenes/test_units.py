"""Nothing depends on the units of length and force: generated scenes in other units.

Lengths and forces are multiplied by powers of ten, each apart; every setting of the solver is a
share of the scales of the scene, so that the same linear solves lead to the same result.
"""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from certifying import certify
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scene_tables import coulomb_friction, tresca_friction
from scenes import alone
from spaces import CELLS

from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.results.certificate.contact_nodes import Tractions
from signorini_fx.scenes.reading import parse_scene

YOUNG = 5000.0
PLANE = {"triangles": dmesh.CellType.triangle, "quadrilaterals": dmesh.CellType.quadrilateral}
ELEMENTS = list(product((*PLANE, *CELLS), (1, 2)))
LAWS = ("none", "tresca", "coulomb", "cap", "bilateral")
ALGORITHMS = ("ssn", "continuation", "path-following", "alm")
WAYS = ("fp", "newton")
LINEAR_ALGEBRA = ("full", "condensed", "krylov")
# (length, force): what a unit of length and of force is in other units.
UNITS = [
    (10.0**length, 10.0**force)
    for length in (-12, 0, 12)
    for force in (-12, 0, 12)
    if (length, force) != (0, 0)
]


def body(cells, degree, length=1.0, comm=MPI.COMM_SELF):
    """A block without symmetry, named before it is scaled."""
    if cells in PLANE:
        ends, shape = [(0.0, 0.0), (3.0, 1.0)], (8, 3) if degree == 1 else (4, 2)
        mesh, up = dmesh.create_rectangle(comm, ends, shape, PLANE[cells]), 1
    else:
        ends, shape = [(0.0, 0.0, 0.0), (3.0, 1.3, 1.0)], (4, 3, 2) if degree == 1 else (3, 2, 1)
        mesh, up = dmesh.create_box(comm, ends, shape, CELLS[cells]), 2
    sides = {
        "left": lambda x: x[0] < 1e-9,
        "right": lambda x: x[0] > 3 - 1e-9,
        "bottom": lambda x: x[up] < 1e-9,
        "top": lambda x: x[up] > 1 - 1e-9,
    }
    tagged = tag_boundaries(mesh, sides)
    mesh.geometry.x[:] *= length
    return tagged


def block(element, law="none", length=1.0, force=1.0, comm=MPI.COMM_SELF, **solver):
    """The block pressed and pulled on a foundation that is nearest at one side; supports that
    move.
    """
    stress, tagged = force / length**2, body(*element, length, comm)
    friction = {
        "none": {"law": "none"},
        "tresca": tresca_friction(1.1 * stress),
        "coulomb": coulomb_friction(0.3),
        "cap": {"law": "coulomb", "coefficient": 0.4, "cap": 3.0 * stress},
        "bilateral": tresca_friction(0.7 * stress),
    }[law]
    space = tagged.dimension == 3
    return parse_scene(
        {
            "mesh": tagged,
            "element": {"degree": element[1]},
            "material": {"young": YOUNG * stress, "poisson": 0.3},
            "displacement": [
                {"boundary": "left", "x": 0.0002 * length, **({"y": 0.0} if space else {})},
                {"boundary": "right", "x": -0.0001 * length},
            ],
            "traction": {
                "boundary": "top",
                "x": 1.7 * stress,
                "z" if space else "y": -12.0 * stress,
            }
            | ({"y": 2.9 * stress} if space else {}),
            "contact": {
                "boundary": "bottom",
                "kind": "bilateral" if law == "bilateral" else "unilateral",
                "gap": lambda x: (
                    length * (0.002 * (x[0] / length - 1.1) ** 2 + 0.0007 * x[1] / length + 0.0001)
                ),
                "friction": friction,
            },
            "solver": solver,
        }
    )


def counts(solution):
    """Linear solves of each problem, and the sets of each solve."""
    sets = [
        (r.active_contact, r.slip_plus, r.slip_minus, r.changed)
        for r in solution.history.iterations
    ]
    return solution.algorithm, [record.linear_solves for record in solution.history.outer], sets


def close(ours, theirs, unit):
    """Equal to 1e-9 of the largest value."""
    np.testing.assert_allclose(
        np.asarray(ours) / unit, theirs, rtol=0, atol=1e-9 * np.abs(theirs).max()
    )


def assert_same(there, here, length, force):
    """The solution in other units, with the same counts."""
    assert (there.status, counts(there)) == (here.status, counts(here))
    stress, dim = force / length**2, here.model.tagged.dimension
    close(there.displacement.x.array, here.displacement.x.array, length)
    close(there.contact.pressure, here.contact.pressure, stress)
    if here.contact.has_friction:
        close(there.contact.shear, here.contact.shear, stress)
    assert there.certificate.strain_energy == pytest.approx(
        here.certificate.strain_energy * stress * length**dim, rel=1e-9
    )


def settings(algorithm, way, linear_algebra):
    return {"algorithm": algorithm, "coulomb": way, "linear_algebra": linear_algebra}


def possible(element, law, algorithm, way, linear_algebra):
    """The way of Coulomb friction is one where there is none."""
    return way == "fp" or law == "coulomb"


EVERY = [
    combination
    for combination in product(ELEMENTS, LAWS, ALGORITHMS, WAYS, LINEAR_ALGEBRA)
    if possible(*combination)
]


def covering():
    """Few combinations among which are all pairs of two choices that are possible, found
    greedily.
    """
    pairs = {c: {((i, c[i]), (j, c[j])) for i in range(5) for j in range(i)} for c in EVERY}
    left, chosen = set().union(*pairs.values()), []
    while left:
        best = max(EVERY, key=lambda c: len(pairs[c] & left))  # the first of several
        chosen.append(best)
        left -= pairs[best]
    return chosen


COVERING = covering()


def named(combination):
    (cells, degree), *rest = combination
    return "-".join((f"{cells}{degree}", *rest))


@pytest.mark.one_quick("number", range(len(COVERING)), ids=[named(c) for c in COVERING])
def test_other_units(number):
    """Each pair of element, law, algorithm and linear algebra, in two of the eight systems of
    units.
    """
    element, law, *rest = COVERING[number]
    here = alone(block(element, law, **settings(*rest)))
    for length, force in (UNITS[number % 8], UNITS[(number + 3) % 8]):
        assert_same(
            alone(block(element, law, length, force, **settings(*rest))), here, length, force
        )


# --- the formulas of dimension, and where they are used -------------------------------------------


SMALL = [("quadrilaterals", 1), ("tetrahedra", 1)]


# --- bodies that were judged wrongly --------------------------------------------------------------


@pytest.mark.parametrize("length", [1.0, 1e-9])
def test_a_cone_that_is_violated(length):
    """Coulomb friction that was iterated once is none, however small the body is."""
    scene = block(("hexahedra", 1), "coulomb", length, length**2, algorithm="alm", tolerance=0.1)
    cones = [
        alone(
            block(("hexahedra", 1), "coulomb", unit, unit**2, algorithm="alm", tolerance=0.1),
            check=False,
        ).certificate.friction_cone
        for unit in (1.0, length)
    ]
    assert scene.solver.tolerance == 0.1
    assert cones[0] > 1e-6
    assert cones[1] == pytest.approx(cones[0], rel=1e-6)


# --- numbers that are none ------------------------------------------------------------------------


@pytest.mark.one_quick("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("where", ["displacement", "pressure", "shear"])
@pytest.mark.parametrize("element", SMALL, ids=str)
@pytest.mark.parametrize("every", [False, True], ids=["one of them", "all of them"])
def test_not_a_number_in_a_result(value, where, element, every):
    """The certificate does not hold, and says so without an error."""
    solution = alone(block(element, "tresca"))
    tractions = Tractions.of(solution.contact)
    place = slice(None) if every else 1
    if where == "displacement":
        solution.displacement.x.array[place] = value
    else:
        values = getattr(tractions, where).copy()
        values[place] = value
        tractions = replace(tractions, **{where: values})
    with np.errstate(all="ignore"):
        found = certify(solution.statement, solution.model.tagged, solution.displacement, tractions)
    assert not found.holds
