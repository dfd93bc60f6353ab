"""Accuracy of the elements: rates of convergence against a solution that was made up, and locking
(C.9).
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from manufactured import (
    HEIGHT,
    LAWS,
    LENGTH,
    NUMBERS,
    displacement,
    made_up,
    pressure,
    r_of,
    s_of,
    shear,
)
from on_meshes import vector_space
from scenes import alone, example1, rectangle

ELEMENTS = [("triangle", 1), ("quadrilateral", 1), ("triangle", 2), ("quadrilateral", 2)]


def errors(count, cell, degree, law, **solver):
    """Energy norm, L2 norm, pressure and shear in L2 of the contact boundary, all relative, and the
    wrong nodes.
    """
    tagged = rectangle(length=LENGTH, height=HEIGHT, nx=count, ny=count // 2, cell=cell)
    solution = alone(made_up(tagged, degree, law, **solver))
    # In a richer space: against the interpolant in its own a solution looks better than it is.
    richer = vector_space(tagged.mesh, degree + 2)
    exact, found = fem.Function(richer), fem.Function(richer)
    exact.interpolate(lambda x: np.array(displacement(NUMBERS, x)))
    found.interpolate(solution.displacement)
    found.x.array[:] -= exact.x.array

    def norms(v):
        epsilon = ufl.sym(ufl.grad(v))
        lame, mu = solution.model.elastic.lame
        energy = lame * ufl.tr(epsilon) ** 2 + 2 * mu * ufl.inner(epsilon, epsilon)
        return [
            np.sqrt(fem.assemble_scalar(fem.form(e * ufl.dx))) for e in (energy, ufl.inner(v, v))
        ]

    contact = solution.contact
    x = contact.boundary.x.T
    fields = (contact.pressure, pressure(NUMBERS, x)), (contact.shear[:, 0], shear(NUMBERS, x, law))
    sizes = [
        contact.points.norm(ours - theirs) / contact.points.norm(theirs) for ours, theirs in fields
    ]
    touching, r = s_of(NUMBERS, x) > 0, r_of(NUMBERS, x)
    sliding = np.where(np.abs(r) > 1, np.sign(r), 0)
    transmits = touching | (law == "tresca")
    slips = (contact.direction[:, 0] != sliding) & transmits
    wrong = np.count_nonzero(contact.in_contact != touching), np.count_nonzero(slips)
    relative = [error / size for error, size in zip(norms(found), norms(exact), strict=True)]
    return np.array([*relative, *sizes]), wrong


def rates(counts, *case):
    """Slopes of the errors over the mesh size in log scale, and the largest numbers of wrong
    nodes.
    """
    rows, wrong = zip(*(errors(count, *case) for count in counts), strict=True)
    slopes = -np.polyfit(np.log(counts), np.log(rows), 1)[0]
    return dict(zip(("energy", "l2", "pressure", "shear"), slopes, strict=True)), np.max(
        wrong, axis=0
    )


each_law = pytest.mark.parametrize("law", LAWS)
each_element = pytest.mark.parametrize(("cell", "degree"), ELEMENTS)


@pytest.mark.one_quick
@each_law
@each_element
def test_rates_with_kinks_at_nodes(cell, degree, law):
    """The full orders: energy O(h^p), displacement O(h^(p+1)); the pressure 1.5 and 2."""
    slopes, wrong = rates([24, 48, 96] if degree == 1 else [12, 24, 48], cell, degree, law)
    assert slopes["energy"] > (0.95 if degree == 1 else 1.9)
    assert slopes["l2"] > (1.85 if degree == 1 else 2.9)
    assert slopes["pressure"] > (1.4 if degree == 1 else 1.95)
    assert slopes["shear"] > (1.45 if degree == 1 else 1.7)
    # A node where s = 0 or |r| = 1 may be in either set.
    assert max(wrong) <= 2


@pytest.mark.one_quick(
    "solver",
    [
        {"algorithm": "ssn"},
        {"algorithm": "ssn", "coulomb": "newton"},
        {"algorithm": "path-following"},
    ],
)
@each_element
def test_regularisation_costs_no_accuracy(cell, degree, solver):
    """The automatic gamma, and the one that path-following finds, leave the error of the mesh, and
    hardly more.
    """
    exact, _ = errors(16, cell, degree, "coulomb")
    regularised, _ = errors(16, cell, degree, "coulomb", **solver)
    assert regularised[0] < (1.3 if solver["algorithm"] == "path-following" else 1.01) * exact[0]


def sinking(poisson, cell, degree, volumetric, nx):
    """u_y at the middle of the top of Example 1."""
    scene = example1(
        poisson=poisson, bound=1.5, gamma="auto", nx=nx, ny=nx // 3, cell=cell, degree=degree
    )
    element = scene.element.model_copy(update={"volumetric": volumetric})
    solution = alone(scene.model_copy(update={"element": element}))
    x = solution.model.space.tabulate_dof_coordinates()
    middle = np.argmin(np.hypot(x[:, 0] - 1.5, x[:, 1] - 1.0))
    return solution.displacement.x.array[2 * middle + 1]


@pytest.mark.slow
@pytest.mark.parametrize("poisson", [0.3, 0.4999])
def test_reduced_elements_do_not_lock(poisson):
    """Nearly incompressible: reduced integration stays within 1 % of a fine reference, full Q1
    loses two thirds.
    """
    reference = sinking(poisson, "quadrilateral", 2, "reduced", 90)
    for cell, degree in ELEMENTS[1:]:
        assert sinking(poisson, cell, degree, "reduced", 30) == pytest.approx(reference, rel=0.005)
    # The triangle of degree 2 has another reduced form than the quadrilateral: two references, not
    # one.
    assert sinking(poisson, "triangle", 2, "reduced", 90) == pytest.approx(reference, rel=0.001)
    if poisson >= 0.45:
        assert sinking(poisson, "quadrilateral", 1, "auto", 30) == sinking(
            poisson, "quadrilateral", 1, "reduced", 30
        )
    if poisson > 0.4999:
        assert abs(sinking(poisson, "quadrilateral", 1, "full", 30)) < 0.4 * abs(reference)
