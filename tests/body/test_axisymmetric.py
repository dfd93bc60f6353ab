"""Axisymmetric bodies: exact states, Lame, Hertz, a flat punch, and the same body in 3D."""

import numpy as np
import pytest
from certifying import certify
from dolfinx import mesh as dmesh
from mpi4py import MPI
from on_meshes import nodes
from revolved import section
from scene_tables import coulomb_friction, fixed, plane_shape, rectangle_mesh
from scenes import alone

from signorini_fx import ConvergenceError, SceneError
from signorini_fx.mechanics.kinematics import AXISYMMETRIC
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.records import Status
from signorini_fx.results.accuracy.stress_recovery import StressRecovery
from signorini_fx.results.certificate.contact_nodes import Tractions
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD
YOUNG, POISSON = 200.0, 0.3
REDUCED = [("quadrilateral", 1), ("quadrilateral", 2), ("triangle", 2)]
ELEMENTS = [*REDUCED, ("triangle", 1)]


def scene(tagged, degree=1, material=None, **more):
    """An axisymmetric body."""
    material = {
        "young": YOUNG,
        "poisson": POISSON,
        "hypothesis": "axisymmetric",
        **(material or {}),
    }
    return parse_scene(
        {"mesh": tagged, "element": {"degree": degree}, "material": material, **more}
    )


# --- exact states ---------------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.one_quick("linear_algebra", ["full", "condensed", "krylov"])
@pytest.mark.parametrize(
    ("cells", "degree", "volumetric"),
    [*((*kind, "reduced") for kind in REDUCED), *((*kind, "full") for kind in ELEMENTS)],
)
def test_pressed_cylinder(cells, degree, volumetric, linear_algebra):
    """A cylinder that is pressed on a plane: y = (nu p r, -p z) / E, pressure p on the axis and
    everywhere, force pi R^2 p, no hoop stress.
    """
    if linear_algebra == "condensed" and COMM.size > 1:
        pytest.skip("condensation is for one rank")
    p, radius = 3.0, 2.0
    given = scene(
        section(cells=cells),
        degree,
        element={"degree": degree, "volumetric": volumetric},
        traction={"boundary": "top", "pressure": p},
        contact={"boundary": "bottom"},
        solver={"algorithm": "alm", "linear_algebra": linear_algebra, "tolerance": 1e-11},
    )
    solution = solve(given, COMM, check=False)
    assert solution.converged
    assert solution.certificate.holds
    x, y = nodes(solution)
    expected = np.column_stack((POISSON * p * x[:, 0], -p * x[:, 1])) / YOUNG
    assert np.abs(y - expected).max(initial=0.0) <= 1e-9 * p / YOUNG
    assert solution.contact.pressure == pytest.approx(p, rel=1e-8)
    total = np.pi * radius**2 * p
    assert solution.contact.forces[0][1] == pytest.approx(total, rel=1e-9)
    assert solution.resultants.of("top").force == pytest.approx([0.0, -total], abs=1e-8)
    strained = p**2 / (2 * YOUNG) * np.pi * radius**2
    assert solution.certificate.strain_energy == pytest.approx(strained, rel=1e-8)
    for stress in (solution.stress, solution.stress.recovered):
        hoop, along = stress.component("zz").x.array, stress.component("yy").x.array
        assert np.abs(hoop).max(initial=0.0) <= 1e-6 * p
        assert along == pytest.approx(-p, rel=1e-6)
    recovery = StressRecovery.of(solution.model)
    assert recovery.error(solution.displacement) <= 1e-5 * np.sqrt(2 * strained)
    assert recovery.energy(solution.displacement) == pytest.approx(strained, rel=1e-8)


TOP = plane_shape([0.0, 1.0], [0.0, -1.0])


@pytest.mark.one_quick(
    ("linear_algebra", "cells", "degree"),
    [("full", "triangle", 1), ("condensed", "quadrilateral", 2), ("krylov", "quadrilateral", 1)],
)
def test_cylinder_pressed_by_a_force(linear_algebra, cells, degree):
    """A plate that a force moves, and nothing else holds but the cylinder on its ground: the same
    exact state.
    """
    if linear_algebra == "condensed" and COMM.size > 1:
        pytest.skip("condensation is for one rank")
    p = 3.0
    total = np.pi * 2.0**2 * p

    def given(force):
        contact = [
            {"boundary": "bottom"},
            {"boundary": "top", "foundation": {**TOP, "force": [0.0, force]}},
        ]
        solver = {"algorithm": "alm", "linear_algebra": linear_algebra, "tolerance": 1e-11}
        return scene(section(cells=cells), degree, contact=contact, solver=solver)

    solution = solve(given(-total))
    x, y = nodes(solution)
    expected = np.column_stack((POISSON * p * x[:, 0], -p * x[:, 1])) / YOUNG
    assert np.abs(y - expected).max(initial=0.0) <= 1e-8 * p / YOUNG
    (tool,) = solution.last_step.rigid_bodies
    assert np.append(tool.translation, tool.rotation) == pytest.approx(
        [0.0, -p / YOUNG, 0.0], rel=1e-8, abs=1e-14
    )
    row = tool.as_dict(solution.contact, solution.statement.contact, AXISYMMETRIC)
    assert [*row["force"], row["moment"]] == pytest.approx([0.0, total, 0.0], rel=1e-9)
    tagged, tractions = solution.model.tagged, Tractions.of(solution.contact)
    judged = certify(
        given(-1.01 * total).statement, tagged, solution.displacement, tractions, rigid=(tool,)
    )
    assert judged.equilibrium > 1e-3
    with pytest.raises(ConvergenceError) as raised:
        solve(given(total))
    assert raised.value.solution.status is Status.OPEN


@pytest.mark.mpi
@pytest.mark.one_quick(("cells", "degree"), ELEMENTS)
def test_squeezed_cylinder(cells, degree):
    """Under pressure all around: the stress is the same in all directions, on the axis too."""
    p = 3.0
    loads = [{"boundary": side, "pressure": p} for side in ("top", "outside")]
    given = scene(section(cells=cells), degree, displacement=fixed("bottom", "y"), traction=loads)
    solution = solve(given, COMM, check=False)
    x, y = nodes(solution)
    assert np.abs(y + (1 - 2 * POISSON) * p / YOUNG * x[:, :2]).max(initial=0.0) <= 1e-11
    assert solution.certificate.holds
    for stress in (solution.stress, solution.stress.recovered):
        assert stress.principal.x.array == pytest.approx(-p, rel=1e-6)


def lame(inside, outside, p, r):
    """Radial and hoop stress of a thick cylinder with free ends under a pressure inside, and its
    displacement.
    """
    a, b = (
        p * inside**2 / (outside**2 - inside**2),
        p * inside**2 * outside**2 / (outside**2 - inside**2),
    )
    return a - b / r**2, a + b / r**2, ((1 - POISSON) * a * r + (1 + POISSON) * b / r) / YOUNG


def thick_cylinder(cells, degree, n, comm=COMM):
    """Its largest error of the displacement, relative, and of the hoop stress inside."""
    p = 3.0
    tagged = section(1.0, 2.0, 0.5, cells, (n, max(2, n // 2)), comm)
    given = scene(
        tagged,
        degree,
        displacement=fixed("bottom", "y"),
        traction={"boundary": "inside", "pressure": p},
    )
    solution = solve(given, comm, check=False)
    assert solution.certificate.holds
    x, y = nodes(solution)
    _, _, moved = lame(1.0, 2.0, p, x[:, 0])
    found = solution.stress.recovered.largest("zz").value
    error = comm.allreduce(np.abs(y[:, 0] - moved).max(initial=0.0), op=MPI.MAX)
    return error / lame(1.0, 2.0, p, 1.0)[2], found / lame(1.0, 2.0, p, 1.0)[1] - 1


@pytest.mark.mpi
@pytest.mark.one_quick(("cells", "degree"), ELEMENTS)
def test_thick_cylinder(cells, degree):
    """Lame: the displacement converges with one order more than the degree, the hoop stress is
    right.
    """
    errors = [thick_cylinder(cells, degree, n)[0] for n in (16, 32)]
    assert errors[1] < (1e-3 if degree == 1 else 1e-5)
    assert np.log2(errors[0] / errors[1]) > degree + 1 - 0.35
    assert abs(thick_cylinder(cells, degree, 32)[1]) < (0.03 if degree == 1 else 0.005)


def test_thick_sphere():
    """Lame: a hollow ball under a pressure inside, half of it on a plane of symmetry."""
    inner, outer, p = 1.0, 2.0, 3.0
    mesh = dmesh.create_rectangle(
        MPI.COMM_SELF, [(inner, 0.0), (outer, 1.0)], (12, 24), dmesh.CellType.quadrilateral
    )
    radius, angle = mesh.geometry.x[:, 0].copy(), np.pi / 2 * mesh.geometry.x[:, 1].copy()
    mesh.geometry.x[:, 0], mesh.geometry.x[:, 1] = radius * np.cos(angle), radius * np.sin(angle)
    # A vertex is on the inner sphere, the outer one, or the plane of symmetry; what is left is the
    # axis.
    sides = {
        "inside": lambda x: np.hypot(x[0], x[1]) < inner + 1e-9,
        "outside": lambda x: np.hypot(x[0], x[1]) > outer - 1e-9,
        "equator": lambda x: x[1] < 1e-9,
    }
    held = fixed("equator", "y")
    given = scene(
        tag_boundaries(mesh, sides),
        1,
        displacement=held,
        traction={"boundary": "inside", "pressure": p},
    )
    solution = alone(given, check=False)
    assert solution.certificate.holds
    x, y = nodes(solution)
    r = np.linalg.norm(x, axis=1)
    a, b = p * inner**3 / (outer**3 - inner**3), p * inner**3 * outer**3 / (outer**3 - inner**3)
    moved = ((1 - 2 * POISSON) * a * r + (1 + POISSON) * b / (2 * r**2)) / YOUNG
    assert np.abs(y - moved[:, None] * x[:, :2] / r[:, None]).max() <= 5e-3 * moved.max()
    hoop = solution.stress.recovered.component("zz")
    cells = hoop.function_space.dofmap.list
    at = hoop.function_space.tabulate_dof_coordinates()[cells]
    far = np.linalg.norm(at, axis=2).mean(axis=1)
    expected = a + b / (2 * far**3)
    assert hoop.x.array[cells].mean(axis=1) == pytest.approx(expected, rel=0.04)


# --- contact --------------------------------------------------------------------------------------


def graded(size, cells, power, kind="quadrilateral", comm=COMM):
    """A cylinder with radius and height of this size, fine near the centre of its lower side."""
    tagged = section(0.0, 1.0, 1.0, kind, (cells, cells), comm)
    tagged.mesh.geometry.x[:, :2] = size * tagged.mesh.geometry.x[:, :2] ** power
    return tagged


@pytest.mark.mpi
@pytest.mark.parametrize("degree", [1, 2])
def test_hertz(degree):
    """A flat body on a rigid sphere: radius of contact, pressure and force of Hertz's formula."""
    young, radius, down = 1000.0, 4.0, 0.0125
    given = scene(
        graded(4.0, 64 if degree == 1 else 32, 2.5),
        degree,
        {"young": young},
        displacement={"boundary": "top", "y": -down},
        contact={
            "boundary": "bottom",
            "gap": f"x[0]**2 / (2 * {radius})",
            "direction": [0.0, -1.0],
        },
    )
    solution = solve(given, COMM, check=False)
    assert solution.converged
    assert solution.certificate.holds
    force = solution.contact.forces[0][1]
    assert solution.resultants.of("top").force[1] == pytest.approx(-force, rel=1e-6)
    a = (0.75 * force * radius * (1 - POISSON**2) / young) ** (1 / 3)
    r, pressure = solution.contact.boundary.x[:, 0], solution.contact.pressure
    hertz = 1.5 * force / (np.pi * a**2) * np.sqrt(np.maximum(0, 1 - (r / a) ** 2))
    inside = r < 0.8 * a
    assert COMM.allreduce(int(inside.sum())) > 10
    assert pressure[inside] == pytest.approx(hertz[inside], rel=0.015 * degree)
    assert (pressure[r > 1.1 * a] == 0).all()
    # On the surface at the centre both lateral stresses are - (1 + 2 nu) / 2 times the pressure.
    stress = solution.stress.recovered
    deepest = stress.smallest("zz")
    assert deepest.value == pytest.approx(
        -(1 + 2 * POISSON) / 2 * 1.5 * force / (np.pi * a**2), rel=0.06
    )


@pytest.mark.mpi
def test_flat_punch():
    """A rigid flat punch with a sharp edge: F = 2 a E d / (1 - nu^2) on a half-space; here the body
    is finite.
    """
    young, size, punch, down = 1000.0, 40.0, 1.0, 0.001
    given = scene(
        graded(size, 48, 3.0),
        1,
        {"young": young},
        displacement={"boundary": "top", "y": -down},
        contact={
            "boundary": "bottom",
            "gap": f"0 if x[0] <= {punch} else 1",
            "direction": [0.0, -1.0],
        },
    )
    solution = solve(given, COMM, check=False)
    assert solution.certificate.holds
    force = solution.contact.forces[0][1]
    reach = COMM.allreduce(
        solution.contact.boundary.x[solution.contact.in_contact, 0].max(initial=0.0), op=MPI.MAX
    )
    # The last node in contact stands for a punch that ends half a cell farther out.
    assert force == pytest.approx(2 * reach * young * down / (1 - POISSON**2), rel=0.08)
    r, pressure = solution.contact.boundary.x[:, 0], solution.contact.pressure
    formula = young / (1 - POISSON**2) * down / (np.pi * np.sqrt(np.maximum(punch**2 - r**2, 1e-3)))
    inside = r < 0.7 * punch
    assert pressure[inside] == pytest.approx(formula[inside], rel=0.06)


@pytest.mark.mpi
def test_friction_on_the_axis():
    """A disc between rough plates is barrelled: friction acts along the radius, and all conditions
    hold.
    """
    rough = coulomb_friction(0.2)
    given = scene(
        section(counts=(16, 8)),
        1,
        displacement={"boundary": "top", "y": -0.01},
        contact={"boundary": "bottom", "friction": rough},
    )
    solution = solve(given, COMM, check=False)
    assert solution.converged
    assert solution.certificate.holds
    assert COMM.allreduce(np.abs(solution.contact.shear).max(initial=0.0), op=MPI.MAX) > 0.1


# --- the independent check, and what is said ------------------------------------------------------


@pytest.mark.parametrize("degree", [1, 2])
def test_rotating_disc(degree):
    """A thin solid disc: hoop and radial stress at its centre are (3 + nu) / 8 rho omega^2 R^2,
    with free faces.
    """
    radius, density, speed = 2.0, 3.0, 1.5
    thin = section(0.0, radius, 0.02, "quadrilateral", (32, 1), MPI.COMM_SELF)
    given = scene(
        thin,
        degree,
        {"density": density},
        displacement=fixed("bottom", "y"),
        rotation={"speed": speed, "axis": [0.0, 1.0]},
    )
    solution = alone(given, check=False)
    assert solution.certificate.holds
    expected = (3 + POISSON) / 8 * density * speed**2 * radius**2
    for name in ("xx", "zz"):
        assert solution.stress.recovered.largest(name).value == pytest.approx(expected, rel=0.01)
    x, y = nodes(solution)
    rim = y[np.abs(x[:, 0] - radius) < 1e-9, 0]
    assert rim == pytest.approx(
        (1 - POISSON) * density * speed**2 * radius**3 / (4 * YOUNG), rel=0.01
    )


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("held", "free"),
    [
        ({}, 1),
        ({"displacement": fixed("outside", "x")}, 1),
        ({"displacement": fixed("outside", "y")}, 0),
        ({"springs": {"boundary": "bottom", "normal": 1.0}}, 0),
    ],
)
def test_only_motion_along_the_axis_is_free(held, free):
    """Neither the radius nor a rotation needs a support."""
    given = scene(section(), traction={"boundary": "top", "y": -1.0}, **held)
    report = check_scene(given, COMM)
    found = [one.message for one in report.findings if "nothing holds" in one.message]
    assert len(found) == free
    if free:
        assert "the translation along (0, 1);" in found[0]
    assert report.acts[0] == "elasticity (axisymmetric)"


def test_a_rotation_is_about_the_only_axis():
    """It need not be given."""
    data = {
        "mesh": rectangle_mesh(2, 2),
        "material": {"young": 1.0, "poisson": 0.3, "density": 1.0, "hypothesis": "axisymmetric"},
    }
    (own,), (given,) = (
        parse_scene({**data, "rotation": {"speed": 1.0, **axis}}).statement.effects["rotation"]
        for axis in ({}, {"axis": [0.0, 1.0]})
    )
    assert own == given


REFUSED = {
    "negative radius": (
        {"mesh": (-1.0, 1.0)},
        r"mesh: has points with x\[0\] = -1: it is the radius",
    ),
    "rotation": (
        {"displacement": {"boundary": "top", "rotation": 1.0}},
        r"rotation: is no axisymmetric motion",
    ),
    "up": (
        {"fluid": {"boundary": "outside", "level": 1.0, "weight": 1.0, "up": "x"}},
        r"fluid\.up: must be along the axis of the body: y",
    ),
    "axis": (
        {"material": {"density": 1.0}, "rotation": {"speed": 1.0, "axis": [1.0, 0.0]}},
        r"rotation.axis: must be that of the body: axis",
    ),
}


@pytest.mark.mpi
@pytest.mark.parametrize("mistake", REFUSED)
def test_mistakes(mistake):
    """Each with its path, on all ranks."""
    more, message = REFUSED[mistake]
    more = dict(more)
    inner, outer = more.pop("mesh", (0.0, 2.0))
    with pytest.raises(SceneError, match=message):
        check_scene(scene(section(inner, outer), 1, more.pop("material", None), **more), COMM)
