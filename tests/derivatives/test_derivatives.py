"""Derivatives of results by the data of a problem, against central differences of solves."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from forms import box as plain_box
from forms import hooke, side
from on_meshes import trial_and_test, vector_space
from scene_tables import coulomb_friction, fixed, rectangle_mesh
from sensitivities import COMM, COULOMB, TRESCA, agrees
from spaces import box

from signorini_fx import ContactProblem, Coulomb, Foundation, SceneError, sensitivity
from signorini_fx.scenes.reading import parse_scene

PLANE = [
    "force bottom x",
    "moment bottom",
    "pressure bottom 6",
    "mean top y",
    "displacement 1.7,0.6 x",
]
SPACE = ["force bottom y", "moment bottom x", "pressure bottom", "displacement 1.7,0.6,0.4 x"]


def plane(friction, **solver):
    """A block between two walls, pressed and pushed on a shallow bowl."""
    return parse_scene(
        {
            "mesh": rectangle_mesh(12, 4),
            "material": {"young": 5000.0, "poisson": 0.33},
            "displacement": [fixed("left", "x"), {"boundary": "right", "x": 0.001}],
            "traction": [{"boundary": "top", "x": 3.0, "y": -20.0}],
            "contact": {"boundary": "bottom", "gap": "0.003*(x[0]-1.5)**2", "friction": friction},
            "solver": {"gamma_n": 1e7, "gamma_t": 1e7, **solver},
        }
    )


def space(friction, cells="hexahedra", degree=1, **solver):
    """The same in 3D, on a sphere."""
    return parse_scene(
        {
            "mesh": box(cells, (6, 2, 2), comm=COMM),
            "element": {"degree": degree},
            "material": {"young": 5000.0, "poisson": 0.33},
            "displacement": [fixed("left"), {"boundary": "right", "x": 0.001, "y": 0.0}],
            "traction": [{"boundary": "top", "x": 3.0, "y": 2.0, "z": -20.0}],
            "contact": {
                "boundary": "bottom",
                "foundation": {"shape": "sphere", "centre": [1.4, 0.55, -100.0], "radius": 100.0},
                "friction": friction,
            },
            "solver": {"gamma_n": 1e7, "gamma_t": 1e7, **solver},
        }
    )


DATA = ["contact.gap", "material.poisson", "traction[0]", "displacement[1].x"]
WAYS = {
    "none": ({"law": "none"}, [], {}),
    "tresca": (TRESCA, ["contact.friction.bound"], {}),
    "monolithic": (COULOMB, ["contact.friction.coefficient"], {"coulomb": "newton"}),
    "fixed point": (COULOMB, ["contact.friction.coefficient"], {"coulomb": "fp"}),
    "alm": (COULOMB, ["contact.friction.coefficient"], {"algorithm": "alm"}),
    "tresca alm": (TRESCA, ["contact.friction.bound"], {"algorithm": "alm"}),
    "condensed": (COULOMB, ["contact.friction.coefficient"], {"linear_algebra": "condensed"}),
}


@pytest.mark.mpi(slow=True)
@pytest.mark.one_quick("way", WAYS)
def test_in_the_plane(way):
    """Each law, each way to treat regularisation and Coulomb's law, full and condensed."""
    friction, more, solver = WAYS[way]
    if COMM.size > 1 and way == "condensed":
        pytest.skip("condensation is for one rank")
    agrees(plane(friction, **solver), PLANE, [*more, *DATA])


SHAPE = [
    "contact[0].foundation.radius",
    "contact.foundation.shift[0]",
    "contact.foundation.centre[1]",
    "material.young",
]


@pytest.mark.mpi(slow=True)
@pytest.mark.one_quick(
    ("friction", "cells", "degree", "solver"),
    [
        (
            {"law": "coulomb", "coefficient": 0.2, "cap": 2.5},
            "hexahedra",
            1,
            {"linear_algebra": "full"},
        ),
        (TRESCA, "hexahedra", 1, {"algorithm": "alm"}),
        (coulomb_friction(0.2), "tetrahedra", 2, {"linear_algebra": "krylov"}),
    ],
    ids=["capped", "tresca alm", "quadratic krylov"],
)
def test_in_space(friction, cells, degree, solver):
    """Gap and normals follow the shape."""
    key = "bound" if friction["law"] == "tresca" else "coefficient"
    agrees(
        space(friction, cells, degree, **solver), SPACE, [f"contact.friction.{key}", *SHAPE], 5e-5
    )


def test_the_force_on_a_block_that_slides():
    """Full slip: the friction force is F times the pressing force, so that its derivative by F is
    that force, and by the load as a whole the friction force itself.
    """
    scene = parse_scene(
        {
            "mesh": rectangle_mesh(8, 4, length=2.0),
            "material": {"young": 1000.0, "poisson": 0.0},
            "displacement": [{"boundary": "top", "x": 0.3}],
            "traction": [{"boundary": "top", "y": -4.0}],
            "contact": {"boundary": "bottom", "friction": coulomb_friction(0.25)},
        }
    )
    found = sensitivity(
        scene, "force bottom x", ["contact.friction.coefficient", "traction[0]", "displacement.x"]
    )
    assert found.value == pytest.approx(-2.0, rel=1e-9)
    assert found.derivatives == pytest.approx((-8.0, -2.0, 0.0), rel=1e-9, abs=1e-7)


@pytest.mark.one_quick("algorithm", ["alm", "ssn"])
@pytest.mark.parametrize("springs", [False, True])
def test_a_support_holds_a_node_that_slips(algorithm, springs):
    """The left edge is pushed and held along the contact: its corner slips, but its shear moves
    nothing.
    """
    more = {"springs": [{"boundary": "right", "x": 100.0, "y": 40.0}]} if springs else {}
    scene = parse_scene(
        {
            "mesh": rectangle_mesh(4, 4, length=1.0, height=1.0),
            "material": {"young": 5000.0, "poisson": 0.3},
            "displacement": [{"boundary": "left", "x": 0.002}],
            "traction": [{"boundary": "top", "y": -7.0}],
            "contact": {"boundary": "bottom", "gap": 0.0, "friction": coulomb_friction(0.15)},
            "solver": {"algorithm": algorithm},
            **more,
        }
    )
    found = agrees(scene, ["force bottom x", "force bottom y"], ["contact.friction.coefficient"])
    if not springs:
        assert found[0].derivatives[0] == pytest.approx(-7.0, rel=1e-8)


@pytest.mark.parametrize(
    ("of", "by", "said"),
    [
        ("force top y", [], "is no contact boundary; there are: bottom"),
        ("force bottom z", [], "is no result; there are"),
        ("displacement 9,9 x", [], "outside of the body"),
        ("pressure bottom 1", [], "power must be above 1"),
        ("mean nowhere x", [], "nowhere"),
        ("mean top y", ["mesh.parameters.nx"], "cannot differentiate with respect to this entry"),
        ("mean top y", ["contact[3].gap"], "there is no such entry"),
        ("mean top y", ["contact[0].boundary"], "is no number"),
        ("mean top y", ["contact..gap"], "cannot differentiate with respect to this entry"),
        ("mean top y", ["contact.friction.coefficient"], "no derivative at 0: use a small value"),
    ],
)
def test_what_has_no_derivative(of, by, said):
    """One error each, before or after the solve."""
    friction = coulomb_friction(0.0) if "at 0" in said else TRESCA
    with pytest.raises(SceneError, match=said) as caught:
        sensitivity(plane(friction), of, by)
    assert len(caught.value.problems) == 1


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.parametrize("settings", [{}, {"algorithm": "alm"}], ids=["ssn", "alm"])
def test_constants_of_forms(settings):
    """Young's modulus in the form, a friction coefficient, a gap, a load, and a prescribed
    displacement.
    """
    mesh = plain_box((3.0, 1.0), (18, 6), dmesh.CellType.quadrilateral)
    space = vector_space(mesh)
    young, friction, load, gap, moved = (
        fem.Constant(mesh, value) for value in (5000.0, 0.3, -20.0, 0.001, 0.002)
    )
    (y, z), x = trial_and_test(space), ufl.SpatialCoordinate(mesh)
    top = np.sort(side(mesh, 1, 1.0))
    ds = ufl.Measure(
        "ds", mesh, subdomain_data=dmesh.meshtags(mesh, 1, top, np.ones(top.size, dtype=np.int32))
    )
    held = space.sub(0)
    bcs = [
        fem.dirichletbc(value, fem.locate_dofs_topological(held, 1, side(mesh, 0, at)), held)
        for value, at in ((fem.Constant(mesh, 0.0), 0.0), (moved, 3.0))
    ]
    foundation = Foundation(
        side(mesh, 1, 0.0), gap=0.003 * (x[0] - 1.5) ** 2 + gap, friction=Coulomb(friction)
    )
    settings = {"gamma_n": 1e7, "gamma_t": 1e7, "coulomb": "newton"} | settings
    problem = ContactProblem(
        hooke(y, z, young), load * z[1] * ds(1), bcs, contact=[foundation], **settings
    )
    problem.solve()
    by = [young, friction, load, gap, moved]
    for of in (
        problem.u[1] * problem.u[1] * ds(1) + load * problem.u[0] * ds(1),
        "force 0 x",
        "pressure 0",
    ):
        found = problem.gradient(of, by)
        for constant, slope in zip(by, found.derivatives, strict=True):
            kept, step, values = float(constant.value), 1e-5 * abs(float(constant.value)), []
            for sign in (1, -1):
                constant.value = kept + sign * step
                problem.solve()
                values.append(problem.gradient(of, []).value)
            constant.value = kept
            wanted = (values[0] - values[1]) / (2 * step)
            assert slope == pytest.approx(wanted, rel=1e-5, abs=1e-6 * abs(found.value / kept))
        problem.solve()


def test_constants_that_enter_nonlinearly():
    """Of a slender body the derivative is that of UFL to 5e-6; narrow differences are wrong by
    1e-4.

    What is left is round-off of residuals, another one with each compiler: 1.5e-6 with dolfinx 0.9,
    2.9e-6 with 0.11.
    """
    mesh = plain_box((30.0, 1.0), (60, 2), dmesh.CellType.quadrilateral)
    space = vector_space(mesh, 2)
    poisson, share = (fem.Constant(mesh, value) for value in (0.3, 1.0))
    y, z = trial_and_test(space)
    bcs = [
        fem.dirichletbc(
            np.zeros(2), fem.locate_dofs_topological(space, 1, side(mesh, 0, 0.0)), space
        )
    ]
    foundation = Foundation(side(mesh, 1, 0.0), gap=0.5)
    load = ufl.inner(fem.Constant(mesh, (0.0, -1e-3)), z) * ufl.dx
    ratio = ufl.variable(poisson)
    (work,) = (integral.integrand() for integral in hooke(y, z, 1000.0, ratio).integrals())
    exact = (
        hooke(y, z, 1000.0, 0.3)
        + (share - 1) * ufl.replace(ufl.diff(work, ratio), {poisson: ufl.as_ufl(0.3)}) * ufl.dx
    )
    slopes = []
    for form, constant in ((work * ufl.dx, poisson), (exact, share)):
        problem = ContactProblem(form, load, bcs, contact=[foundation], gamma_n=1e5)
        problem.solve()
        slopes += problem.gradient(problem.u[1] * ufl.dx, [constant]).derivatives.tolist()
    assert slopes[0] == pytest.approx(slopes[1], rel=5e-6)


def test_bad_arguments_of_gradient():
    """One error each."""
    mesh = plain_box((1.0, 1.0), (2, 2), dmesh.CellType.quadrilateral)
    space = vector_space(mesh)
    y, z = trial_and_test(space)
    load = fem.Constant(mesh, -1.0)
    problem = ContactProblem(
        hooke(y, z),
        load * z[1] * ufl.dx,
        contact=[Foundation(side(mesh, 1, 0.0), friction=Coulomb(0.3))],
    )
    with pytest.raises(RuntimeError, match="no solution"):
        problem.gradient("force 0 y", [load])
    problem.solve()
    for of, by, said in (
        ("force 1 y", [load], "is no result"),
        ("area 0", [load], "is no result"),
        (z[0] * ufl.dx, [load], "without arguments|has arguments"),
        ("force 0 y", [1.0], "a Constant with one value"),
    ):
        with pytest.raises(ValueError, match=said):
            problem.gradient(of, by)
    assert problem.gradient("force 0 y", load).derivatives == pytest.approx([-1.0])


@pytest.mark.mpi(slow=True)
def test_after_advance():
    """A block that slides on and on has forgotten where it was: its friction is F times the
    pressing force, and a mean displacement follows central differences over both steps.  Where
    points stick the step before matters.
    """
    mesh = plain_box((2.0, 1.0), (8, 4), dmesh.CellType.quadrilateral)
    space = vector_space(mesh)
    friction, load, push = (fem.Constant(mesh, value) for value in (0.25, -4.0, 0.0))
    (y, z), top = trial_and_test(space), np.sort(side(mesh, 1, 1.0))
    ds = ufl.Measure(
        "ds", mesh, subdomain_data=dmesh.meshtags(mesh, 1, top, np.ones(top.size, dtype=np.int32))
    )
    bcs = [fem.dirichletbc(push, fem.locate_dofs_topological(space.sub(0), 1, top), space.sub(0))]

    def history(*places):
        foundation = Foundation(side(mesh, 1, 0.0), friction=Coulomb(friction))
        problem = ContactProblem(
            hooke(y, z, 1000.0), load * z[1] * ds(1), bcs, contact=[foundation]
        )
        for number, place in enumerate(places):
            if number:
                problem.advance()
            push.value = place
            problem.solve()
        return problem

    def mean(problem, by):
        return problem.gradient(problem.u[0] * ufl.dx, by)

    problem, by = history(0.3, 0.6), [friction, load]
    force = problem.gradient("force 0 x", by)
    assert force.value == pytest.approx(-2.0, rel=1e-9)
    assert force.derivatives == pytest.approx([-8.0, 0.5], rel=1e-6)
    wanted = []
    for constant in by:
        kept, values = float(constant.value), []
        for sign in (1, -1):
            constant.value = kept * (1 + sign * 1e-4)
            values.append(mean(history(0.3, 0.6), []).value)
        constant.value = kept
        wanted.append((values[0] - values[1]) / (2e-4 * kept))
    assert mean(problem, by).derivatives == pytest.approx(wanted, rel=1e-5)
    with pytest.raises(RuntimeError, match="depends on the slip"):
        mean(history(0.3, 0.29999), by)
