"""Torsion of bodies of revolution by scenes: against formulas, statics, and the same problem by
forms of one's own.
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from on_meshes import (
    at_coordinate,
    hooke_stress,
    nodes,
    strain_of_section,
    trial_and_test,
    vector_space,
)
from scene_tables import circle_shape, coulomb_friction, fixed, rectangle_mesh

from signorini_fx import ContactProblem, ConvergenceError, Coulomb, Foundation, SceneError, Tresca
from signorini_fx.mechanics.assembly.mesh_entities import strain_degree
from signorini_fx.mechanics.kinematics import TORSION
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.records import Status
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD
YOUNG, RADIUS, LENGTH, PRESSURE, FRICTION = 1000.0, 1.5, 2.0, 10.0, 0.3
LIMIT = (
    2 / 3 * FRICTION * PRESSURE * np.pi * RADIUS**3
)  # the torque of the friction of a uniform pressure
POLAR = np.pi / 2 * RADIUS**4


def section(cells="quadrilateral", counts=(6, 3), inner=0.0, unit=1.0):
    """A cylinder, or a ring, of which one length is ``unit``."""
    corners = np.array([[inner, 0.0], [RADIUS, LENGTH]]) * unit
    mesh = dmesh.create_rectangle(COMM, corners, counts, dmesh.CellType[cells])
    near = {"inside": (0, 0), "outside": (0, 1), "bottom": (1, 0), "top": (1, 1)}
    return tag_boundaries(
        mesh,
        {
            name: lambda x, k=k, at=corners[end][k]: np.abs(x[k] - at) < 1e-9 * unit
            for name, (k, end) in near.items()
        },
    )


def scene(tagged, degree=1, poisson=0.0, young=YOUNG, material=None, element=None, **more):
    """A body that is twisted."""
    material = {"hypothesis": "axisymmetric", "torsion": True, **(material or {})}
    return parse_scene(
        {
            "mesh": tagged,
            "element": {"degree": degree, **(element or {})},
            "material": [{"young": young, "poisson": poisson, **material}],
            **more,
        }
    )


def pressed(tagged, torques, degree=1, friction=None, length=1.0, stress=1.0, **more):
    """A cylinder on a plane, pressed by a uniform pressure and twisted by torques at its top, one
    in each load step; friction alone holds it about the axis.  Lengths and stresses are multiplied
    by units.
    """
    first = (
        torques[0] * stress / (POLAR * length)
    )  # times x[0]: the torque has the unit stress length^3
    return scene(
        tagged,
        degree,
        young=YOUNG * stress,
        traction=[
            {"boundary": "top", "pressure": PRESSURE * stress},
            {
                "boundary": "top",
                "z": f"{-first!r} * x[0]",
                "factors": [one / torques[0] for one in torques],
            },
        ],
        contact={"boundary": "bottom", "friction": friction or coulomb_friction(FRICTION)},
        **more,
    )


def by_forms(solution, torque, friction, algorithm):
    """The same cylinder as forms of one's own on the same mesh, with the same quadrature."""
    d = solution.model
    mesh, degree = d.tagged.mesh, d.statement.element.degree
    space = vector_space(mesh, degree, 3)
    (u, v), r = trial_and_test(space), ufl.SpatialCoordinate(mesh)[0]

    inside = ufl.dx(metadata={"quadrature_degree": strain_degree(space, TORSION)})
    top = dmesh.meshtags(mesh, 1, d.tagged.facets("top"), 1)
    ds = ufl.Measure("ds", domain=mesh, subdomain_data=top)(1, degree=6)
    load = -(PRESSURE * v[1] + torque / POLAR * r * v[2]) * 2 * np.pi * r * ds
    axis = fem.locate_dofs_geometrical(space, at_coordinate(0, 0.0))
    held = [fem.dirichletbc(0.0, (3 * axis + k).astype(np.int32), space.sub(k)) for k in (0, 2)]
    floor = Foundation(d.tagged.facets("bottom"), friction=friction, measure=2 * np.pi * r)
    strains = strain_of_section(u, r), strain_of_section(v, r)
    stiffness = YOUNG * ufl.inner(*strains) * 2 * np.pi * r * inside
    problem = ContactProblem(stiffness, load, held, floor, algorithm=algorithm)
    problem.solve()
    return problem


# --- without contact ------------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.one_quick(
    ("cells", "degree", "how"), [("quadrilateral", 1, "full"), ("triangle", 2, "reduced")]
)
def test_twisted_shaft(cells, degree, how):
    """It is twisted by T / (G J) per length; its shear, torque and energy follow, and nothing moves
    along the axis.
    """
    poisson, torque = 0.3, 7.0
    modulus = YOUNG / (2 * (1 + poisson))
    given = scene(
        section(cells),
        degree,
        poisson,
        element={"volumetric": how},
        displacement=fixed("bottom", "yz"),
        traction={"boundary": "top", "z": f"{-torque / POLAR!r} * x[0]"},
    )
    solution = solve(given, COMM)
    x, y = nodes(solution)
    twist = torque / (modulus * POLAR)
    expected = np.column_stack((0 * x[:, :2], -twist * x[:, 1] * x[:, 0]))
    assert np.abs(y - expected).max() <= 1e-11 * twist * RADIUS * LENGTH
    assert solution.certificate.holds
    assert solution.last_step.strain_energy == pytest.approx(torque * twist * LENGTH / 2, rel=1e-11)
    top, bottom = solution.resultants.of("top"), solution.resultants.of("bottom")
    assert top.moment == pytest.approx([0.0, torque, 0.0], abs=1e-11)
    assert bottom.moment == pytest.approx([0.0, -torque, 0.0], abs=1e-10)
    largest = 2 * torque / (np.pi * RADIUS**3)
    assert solution.stress.smallest("yz").value == pytest.approx(-largest, rel=1e-9)
    assert solution.stress.largest().value == pytest.approx(np.sqrt(3) * largest, rel=1e-9)
    assert solution.stress.largest("xz").value == pytest.approx(0.0, abs=1e-9 * largest)
    assert solution.stress.recovered.smallest("yz").value == pytest.approx(-largest, rel=1e-5)


@pytest.mark.slow
@pytest.mark.mpi
def test_everything_acts():
    """Every load and support with torsion: the certificate, which integrates all of it without UFL,
    agrees with the forms, and without z the result is that of the body without torsion.
    """
    more = {
        "degree": 2,
        "poisson": 0.47,
        "element": {"volumetric": "reduced"},
        "displacement": [{"boundary": "bottom", "normal": 0.0}],
        "traction": {"boundary": "top", "pressure": "1 + x[0]"},
        "force": {"boundary": "outside", "y": 3.0},
        "fluid": {"boundary": "outside", "level": 1.2, "weight": 2.0, "up": "y"},
        "gravity": {"y": -9.0},
        "rotation": {"speed": 2.0, "axis": [0.0, 1.0], "about": [0.0, 0.5]},
        "temperature": {"change": "x[0] * x[1]"},
        "springs": {"boundary": "inside", "normal": 3e3, "tangential": 5e3},
    }
    density = {"density": 1.5, "expansion": 1e-3}
    tagged = section(inner=0.5, counts=(3, 3))
    plain = solve(scene(tagged, material={**density, "torsion": False}, **more), COMM)
    same = solve(scene(tagged, material=density, **more), COMM)
    (_, y), (_, z) = nodes(plain), nodes(same)
    assert same.certificate.holds
    assert z[:, :2] == pytest.approx(y, abs=1e-11 * np.abs(y).max())
    assert z[:, 2] == pytest.approx(0.0, abs=1e-11 * np.abs(y).max())
    assert same.last_step.strain_energy == pytest.approx(plain.last_step.strain_energy, rel=1e-10)
    stresses = [one.stress.largest().value for one in (plain, same)]
    assert stresses[1] == pytest.approx(stresses[0], rel=1e-9)
    more |= {
        "traction": {"boundary": "top", "z": "x[0]**2"},
        "force": {"boundary": "outside", "z": 3.0, "y": 1.0},
        "body_force": {"z": "x[1]"},
    }
    twisted = solve(scene(tagged, material=density, **more), COMM)
    assert twisted.certificate.holds
    # the springs alone take the torque of the loads
    torque = (
        2 * np.pi * (RADIUS**5 - 0.5**5) / 5
        + 3.0 * RADIUS
        + 2 * np.pi * (RADIUS**3 - 0.5**3) / 3 * LENGTH**2 / 2
    )
    assert twisted.resultants.of("inside").moment[1] == pytest.approx(torque, rel=1e-9)
    assert twisted.resultants.of("bottom").moment[1] == 0.0


# --- a pressed cylinder ---------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.one_quick(
    ("cells", "degree", "law", "algorithm", "algebra"),
    [
        ("quadrilateral", 1, "coulomb", "alm", "auto"),
        ("triangle", 2, "coulomb", "alm", "full"),
        ("quadrilateral", 2, "tresca", "alm", "condensed"),
    ],
)
def test_pressed_cylinder(cells, degree, law, algorithm, algebra):
    """Below 3/4 of the largest torque all of it sticks and the twist is that of a shaft; above, an
    outer ring slips, and the state is that of the same forms of one's own.
    """
    if algebra == "condensed" and COMM.size > 1:
        pytest.skip("condensation is for one rank")
    friction = {
        "law": law,
        **({"coefficient": FRICTION} if law == "coulomb" else {"bound": FRICTION * PRESSURE}),
    }
    tagged, torque = section(cells), 0.9 * LIMIT
    solver = {"algorithm": algorithm, "linear_algebra": algebra}
    solution = solve(pressed(tagged, [0.6 * LIMIT, torque], degree, friction, solver=solver), COMM)
    assert solution.converged
    first, last = solution.steps
    held = solution.at(first)
    assert held.certificate.holds
    assert solution.certificate.holds
    x, y = nodes(held)
    angle = 0.6 * LIMIT / (YOUNG / 2 * POLAR) * x[:, 1]
    expected = np.column_stack((0 * angle, -PRESSURE / YOUNG * x[:, 1], -angle * x[:, 0]))
    close = (
        1e-9 if degree == 2 else 2e-3
    )  # weights of degree 1 share the torque a little differently
    assert np.abs(y - expected).max() <= close * np.abs(expected).max()
    for step, twisting in ((first, 0.6 * LIMIT), (last, torque)):
        assert step.contact.forces[0][1] == pytest.approx(PRESSURE * np.pi * RADIUS**2, rel=1e-9)
        assert step.contact.moments[1][1] == pytest.approx(-twisting, rel=1e-9)
    assert solution.resultants.of("bottom").moment == pytest.approx(
        [0.0, -torque, 0.0], abs=1e-8 * torque
    )
    table = solution.table.columns
    sticks = table["friction"] == "stick"
    assert (np.diff(table["x"]) > 0).all()
    assert sticks[table["x"] < 0.4 * RADIUS].all()
    assert not sticks[table["x"] > 0.95 * RADIUS].any()
    assert table["shear_z"][~sticks] == pytest.approx(-table["bound"][~sticks], rel=1e-7)
    alone = solve(pressed(tagged, [torque], degree, friction, solver=solver), COMM)
    own = Coulomb(FRICTION) if law == "coulomb" else Tresca(FRICTION * PRESSURE)
    problem = by_forms(alone, torque, own, algorithm)
    _, y = nodes(alone)
    # Augmentation ends at a tolerance.
    assert np.abs(problem.u.x.array.reshape(y.shape) - y).max() <= 1e-8 * np.abs(y).max()


@pytest.mark.mpi
@pytest.mark.parametrize(("length", "stress"), [(1.0, 1.0), (1e-3, 1e6)])
def test_the_largest_torque(length, stress):
    """Just below 2/3 F N R it is held; above it slides, which statics says."""
    tagged = section(unit=length)
    held = solve(pressed(tagged, [0.99 * LIMIT], length=length, stress=stress), COMM)
    assert held.converged
    assert held.certificate.holds
    found = held.contact.moments[1][1] / (stress * length**3)
    assert found == pytest.approx(-0.99 * LIMIT, rel=1e-9)
    with pytest.raises(ConvergenceError) as failed:
        solve(pressed(tagged, [1.02 * LIMIT], length=length, stress=stress), COMM)
    assert failed.value.solution.status in (Status.SLIDES, Status.SLIDES_AT_PRESSURES)


@pytest.mark.mpi
def test_prescribed_angle():
    """Turned by its top, all of it slips: the torque is 2/3 F N R, and the nodes of the top turn
    rigidly.
    """
    angle, down = 0.5, PRESSURE / YOUNG * LENGTH
    given = scene(
        section(),
        displacement={"boundary": "top", "y": -down, "rotation": angle, "axis": [0.0, 1.0]},
        contact={"boundary": "bottom", "friction": coulomb_friction(FRICTION)},
        solver={"algorithm": "alm"},
    )
    solution = solve(given, COMM)
    assert solution.certificate.holds
    x, y = nodes(solution)
    top = np.isclose(x[:, 1], LENGTH)
    assert y[top, 2] == pytest.approx(-angle * x[top, 0], abs=1e-12)
    assert solution.contact.moments[1][1] == pytest.approx(-LIMIT, rel=1e-9)
    assert solution.resultants.of("top").moment[1] == pytest.approx(LIMIT, rel=1e-9)


@pytest.mark.mpi(slow=True)
def test_turned_on_a_sphere():
    """A circle in the section is a sphere: the state is that of forms of one's own on the sphere in
    3D, and the torque where all of it slips that of Hertz's pressure, 3 pi F N a / 16.
    """
    poisson, radius, down, angle = 0.49, 4.0, 0.0125, 0.05
    mesh = dmesh.create_rectangle(
        COMM, [[0.0, 0.0], [1.0, 1.0]], [16, 16], dmesh.CellType.quadrilateral
    )
    mesh.geometry.x[:] = 4.0 * mesh.geometry.x**2.5  # fine near the contact
    tagged = tag_boundaries(mesh, {"bottom": at_coordinate(1, 0.0), "top": at_coordinate(1, 4.0)})
    given = scene(
        tagged,
        2,
        poisson,
        displacement={
            "boundary": "top",
            "x": 0.0,
            "y": -down,
            "rotation": angle,
            "axis": [0.0, 1.0],
        },
        contact={
            "boundary": "bottom",
            "foundation": circle_shape([0.0, -radius], radius),
            "friction": coulomb_friction(FRICTION),
        },
        solver={"algorithm": "alm"},
    )
    solution = solve(given, COMM)
    assert solution.certificate.holds
    force, torque = solution.contact.forces[0][1], -solution.contact.moments[1][1]
    a = (3 * force * radius * (1 - poisson**2) / (4 * YOUNG)) ** (1 / 3)
    assert torque == pytest.approx(3 * np.pi / 16 * FRICTION * force * a, rel=0.015)
    d = solution.model
    space = vector_space(d.tagged.mesh, 2, 3)
    (u, v), r = trial_and_test(space), ufl.SpatialCoordinate(d.tagged.mesh)[0]
    stress = hooke_stress(strain_of_section(u, r), YOUNG, poisson)
    inside = ufl.dx(metadata={"quadrature_degree": strain_degree(space, TORSION)})
    moved = fem.Function(space)
    moved.interpolate(lambda x: np.stack((0 * x[0], 0 * x[0] - down, -angle * x[0])))
    axis = fem.locate_dofs_geometrical(space, at_coordinate(0, 0.0))
    held = [fem.dirichletbc(0.0, (3 * axis + k).astype(np.int32), space.sub(k)) for k in (0, 2)]
    held.append(
        fem.dirichletbc(moved, fem.locate_dofs_topological(space, 1, d.tagged.facets("top")))
    )
    ball = {"shape": "sphere", "centre": (0, -radius, 0), "radius": radius}
    bottom, around = d.tagged.facets("bottom"), 2 * np.pi * r
    floor = Foundation(bottom, friction=Coulomb(FRICTION), measure=around, shape=ball)
    nothing = ufl.inner(fem.Constant(d.tagged.mesh, (0.0, 0.0, 0.0)), v) * ufl.dx
    form = ufl.inner(stress, strain_of_section(v, r)) * around * inside
    problem = ContactProblem(form, nothing, held, floor, algorithm="alm")
    problem.solve()
    y = solution.displacement.x.array
    assert np.abs(problem.u.x.array - y).max() <= 1e-9 * np.abs(y).max()


@pytest.mark.parametrize(
    ("more", "path", "why"),
    [
        (
            {"material": {"hypothesis": "plane strain"}},
            r"material\[0\].torsion",
            "needs hypothesis",
        ),
        (
            {"gravity": [{"z": 1.0}], "material": {"density": 1.0}},
            r"gravity\[0\].z",
            "nothing of this kind",
        ),
        ({"fluid": [{"boundary": "top", "level": 1.0, "weight": 1.0}]}, r"fluid\[0\]", "up = 'y'"),
        (
            {"displacement": [{"boundary": "top", "x": 0.0, "rotation": 0.1}]},
            r"displacement\[0\]",
            r"must be that of the body",
        ),
        (
            {"traction": [{"boundary": "top", "z": "x[2]"}]},
            r"traction\[0\].z",
            r"there is no x\[2\]",
        ),
    ],
)
def test_what_is_not_possible(more, path, why):
    """One error each, before anything is compiled."""
    given = {"contact": {"boundary": "bottom"}, **more}
    with pytest.raises(SceneError, match=f"{path}: .*{why}") as found:
        solve(scene(section(counts=(2, 2)), **given), COMM)
    assert len(found.value.problems) == 1


# --- with other features --------------------------------------------------------------------------


def twisted(material=None, **more):
    """A cylinder with a bowl-shaped gap, pressed and twisted."""
    return parse_scene(
        {
            "mesh": rectangle_mesh(6, 4, length=RADIUS, height=LENGTH),
            "material": {"hypothesis": "axisymmetric", "torsion": True}
            | (material or {"young": YOUNG, "poisson": 0.3}),
            "traction": [
                {"boundary": "top", "pressure": PRESSURE},
                {"boundary": "top", "z": "-0.8*x[0]"},
            ],
            "contact": {
                "boundary": "bottom",
                "gap": "0.0005*x[0]**2",
                "friction": coulomb_friction(FRICTION),
            },
            **more,
        }
    )
