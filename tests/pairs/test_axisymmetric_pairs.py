"""Bodies of revolution in contact: fits, patches and spheres."""

from pathlib import Path

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from on_meshes import at_coordinate, trial_and_test, vector_space
from revolved import Bodies, Box, Touching
from scene_tables import coulomb_friction, fixed, rectangle_mesh
from two_bodies import facets, held

from signorini_fx import Status, read_scene, solve
from signorini_fx.forms.contact_problem import ContactProblem
from signorini_fx.mechanics.interfaces import Pair
from signorini_fx.mechanics.laws.coulomb import Coulomb
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_WORLD
DEMO = Path(__file__).parents[2] / "demos" / "scenes" / "press_fit.toml"
EXACT = {"solver": {"algorithm": "alm", "tolerance": 1e-10}}


# --- fits of rings --------------------------------------------------------------------------------


def rings(
    radii, young, poisson, fit, *, height=1.0, counts=(4, 5), degree=2, cell="quadrilateral", **more
):
    """A ring in another one that is too small, on the ground, with meshes that do not match."""

    def body(name, inner, outer, along):
        across = {"length": outer - inner, "height": height, "nx": 3, "ny": along, "cell": cell}
        return {"name": name, "mesh": rectangle_mesh(**across), "shift": [inner, 0.0]}

    names = "shaft", "hub"
    return parse_scene(
        {
            "body": [body(*given) for given in zip(names, radii, radii[1:], counts, strict=False)],
            "element": {"degree": degree},
            "material": [
                {
                    "region": name,
                    "young": young[k],
                    "poisson": poisson[k],
                    "hypothesis": "axisymmetric",
                }
                for k, name in enumerate(names)
            ],
            "displacement": [fixed(f"{name}.bottom", "y") for name in names],
            "contact": {
                "boundary": "hub.left",
                "against": "shaft.right",
                "distance": "nominal",
                "gap": -fit,
            },
        }
        | more
    )


def pressure_of_a_fit(radii, young, poisson, fit):
    """Lame's, without stress along the axis."""
    a, b, c = radii
    inner = b / young[0] * ((b * b + a * a) / (b * b - a * a) - poisson[0])
    outer = b / young[1] * ((c * c + b * b) / (c * c - b * b) + poisson[1])
    return fit / (inner + outer)


@pytest.mark.one_quick(
    ("cell", "degree", "tolerance"),
    [("quadrilateral", 2, 3e-3), ("triangle", 2, 0.02), ("quadrilateral", 1, 0.06)],
)
@pytest.mark.parametrize(
    ("young", "poisson"), [((200.0, 200.0), (0.3, 0.3)), ((100.0, 300.0), (0.3, 0.25))]
)
def test_fit_of_two_rings(young, poisson, cell, degree, tolerance):
    """Lame's pressure at every point, also of different materials."""
    radii, fit = (1.0, 2.0, 3.0), 0.002
    found = solve(rings(radii, young, poisson, fit, cell=cell, degree=degree))
    assert found.contact.pressure == pytest.approx(
        pressure_of_a_fit(radii, young, poisson, fit), rel=tolerance
    )
    assert found.contact.boundary.weight.sum() == pytest.approx(2 * np.pi * radii[1], rel=1e-12)
    (figures,) = found.contact_figures
    assert figures.area == pytest.approx(2 * np.pi * radii[1], rel=1e-12)


def test_force_that_pushes_a_shaft_out():
    """CalculiX's issue 98: radii 10, 20 and 30 mm, 5 um of fit in the diameter, F = .1; by hand
    5.74 MPa and 1371 N, from which E = 196 GPa and 19 mm of length follow.  By surfaces of nodes
    CalculiX finds 3,200 N.

    The force is F times that of the pressure to round-off.  Pressed along its axis the shaft grows,
    by nu times half of the stress at its end over E of the radius, and the hub is thinner by its
    share: .9 % of the fit.
    """
    by_hand = pressure_of_a_fit((10.0, 20.0, 30.0), (196e3, 196e3), (0.3, 0.3), 0.0025)
    assert by_hand == pytest.approx(5.74, rel=1e-3)
    expected = 0.1 * by_hand * 2 * np.pi * 20.0 * 19.0
    assert expected == pytest.approx(1371.0, rel=1e-3)
    found = solve(read_scene(DEMO))
    (figures,) = found.contact_figures
    force = abs(figures.friction_force[1])
    assert force == pytest.approx(0.1 * figures.pressure_integral, rel=1e-6)
    assert force == pytest.approx(expected, rel=0.01)
    assert found.resultants.of("shaft.top").force[1] == pytest.approx(-force, rel=1e-9)
    assert found.resultants.of("hub.bottom").force[1] == pytest.approx(force, rel=1e-9)
    assert all(found.table.columns["state"] != "stick")


@pytest.mark.parametrize(
    ("radii", "height", "along", "stiff", "fit", "force"),
    [((1.2, 1.8, 2.2), 1.46, 9, 1000.0, 0.02, -0.2), ((0.9, 1.7, 3.2), 2.1, 7, 20.0, -0.01, -0.2)],
)
def test_ring_that_the_friction_of_a_fit_holds(radii, height, along, stiff, fit, force):
    """A ring that nothing but friction holds along its axis, in one that is too small or pressed on
    it.

    Its normals have an axial part, the round-off of places such as 1.46 / 9: no resistance, and no
    way to come to rest.
    """
    low, high = np.array([0.0, height])
    bodies = Bodies(
        "quadrilateral",
        [
            Box("a", (3, along), (radii[0], low), (radii[1], high), 50.0, 0.1),
            Box("b", (3, along), (radii[1], low), (radii[2], high), stiff, 0.3),
        ],
        held=[("b.bottom", {"y": 0.0})],
        pressed=[("b.right", 2.0), ("a.top", force)],
        touching=[Touching("a.right", "b.left", -fit, coulomb_friction(0.3))],
    )
    found = solve(bodies.scene(), check=False)
    assert found.status is Status.CONVERGED
    axial = force * np.pi * (radii[1] ** 2 - radii[0] ** 2)
    assert abs(found.contact_figures[0].friction_force[1]) == pytest.approx(abs(axial), rel=1e-9)


# --- patches --------------------------------------------------------------------------------------


@pytest.mark.mpi(slow=True)
@pytest.mark.one_quick(
    ("cell", "degree", "linear_algebra", "exchanged"),
    [
        ("quadrilateral", 1, "full", False),
        ("triangle", 1, "condensed", True),
        ("quadrilateral", 2, "krylov", False),
        ("quadrilateral", 2, "full", True),
    ],
)
def test_cylinders_upon_each_other(cell, degree, linear_algebra, exchanged):
    """A pressure passes through the flat sides of cylinders whose meshes do not match, up to the
    axis, to round-off.
    """
    if linear_algebra == "condensed" and COMM.size > 1:
        pytest.skip("condensation is for one rank")
    pressure, radius = 3.0, 2.0

    def body(name, count, height):
        across = {"length": radius, "height": 1.0, "nx": count, "ny": 2, "cell": cell}
        return {"name": name, "mesh": rectangle_mesh(**across), "shift": [0.0, height]}

    sides = ["upper.bottom", "lower.top"][:: -1 if exchanged else 1]
    found = solve(
        parse_scene(
            {
                "body": [body("upper", 5, 1.0), body("lower", 4, 0.0)],
                "element": {"degree": degree},
                "material": {"young": 200.0, "poisson": 0.3, "hypothesis": "axisymmetric"},
                "displacement": fixed("lower.bottom", "y"),
                "traction": {"boundary": "upper.top", "pressure": pressure},
                "contact": {"boundary": sides[0], "against": sides[1], "points": "boundary"},
                "solver": {
                    "algorithm": "alm",
                    "linear_algebra": linear_algebra,
                    "tolerance": 1e-10,
                },
            }
        ),
        COMM,
    )
    assert found.contact.pressure == pytest.approx(pressure, rel=1e-8)
    x = found.displacement.function_space.tabulate_dof_coordinates()
    moved = found.displacement.x.array.reshape(-1, 2)
    expected = np.column_stack((0.3 * pressure * x[:, 0], -pressure * x[:, 1])) / 200.0
    # The upper one as a whole sinks into the lower one by the pressure over gamma.
    assert np.abs(moved - expected)[x[:, 1] < 1.0 - 1e-9].max(initial=0.0) < 1e-8 * pressure / 200.0
    assert np.abs(moved - expected).max(initial=0.0) < 1e-4 * pressure / 200.0
    assert abs(found.contact.forces_of_each[0, 0, 1]) == pytest.approx(
        np.pi * radius**2 * pressure, rel=1e-9
    )
    least = COMM.allreduce(float(found.contact.boundary.x[:, 0].min(initial=np.inf)), MPI.MIN)
    assert (least < 1e-9) == (degree == 1)  # the function of the axis is zero on quadratic cells
    assert found.table.chains == [range(len(found.table.columns["x"]))]


@pytest.mark.one_quick(
    ("kind", "inner", "slope"), [("quadrilateral", 0.0, 0.4), ("triangle", 0.5, -0.3)]
)
def test_bonded_cones(kind, inner, slope):
    """A uniform state passes through the conical side of bodies whose meshes do not match, and
    which are tied.
    """
    bodies = Bodies(
        kind,
        [Box("a", (5, 3), (inner, 0.0), (2.0, 1.0)), Box("b", (4, 2), (inner, 1.0), (2.0, 2.0))],
        # Bottom and top stay flat.
        lambda x: np.column_stack(
            (x[:, 0], x[:, 1] + slope * (x[:, 0] - 1.0) * x[:, 1] * (2.0 - x[:, 1]))
        ),
        held=[("a.bottom", {"y": 0.0})],
        pressed=[("b.top", 3.0)],
        touching=[Touching("b.bottom", "a.top", kind="bonded")],
    )
    found = solve(bodies.scene(**EXACT))
    x = found.displacement.function_space.tabulate_dof_coordinates()
    moved = found.displacement.x.array.reshape(-1, 2)
    expected = np.column_stack((0.3 * 3.0 * x[:, 0], -3.0 * x[:, 1])) / 200.0
    lower = x[:, 1] < 0.5
    assert np.abs(moved - expected)[lower].max() < 1e-9
    assert np.abs(moved - expected).max() < 1e-6  # gamma
    normal, cosine = found.contact.boundary.normal, 1.0 / np.hypot(1.0, slope)
    if inner == 0.0:  # at the tip of the cone the mean all around
        assert normal[found.table.columns["x"].argmin()] == pytest.approx([0.0, -1.0], abs=1e-14)
    # Per area of the cone the stress of 3 has a force of 3 times its cosine, along the axis.
    assert found.contact.pressure == pytest.approx(3.0 * cosine * np.abs(normal[:, 1]), rel=1e-8)


@pytest.mark.one_quick("measured", [True, False])
def test_forms_with_a_measure(measured):
    """A pair in forms that are multiplied by 2 pi r: the pressure of a scene, which without the
    measure is multiplied.

    Without it the certificate has no more to say: the forms are the user's.
    """
    bodies = Bodies(
        "quadrilateral",
        [Box("a", (5, 2), (0.0, 0.0), (2.0, 1.0)), Box("b", (4, 2), (0.0, 1.0), (2.0, 2.0))],
        touching=[Touching("b.bottom", "a.top")],
    )
    tagged = bodies.mesh()
    space = vector_space(tagged.mesh)
    u, v = trial_and_test(space)
    around = 2 * ufl.pi * ufl.SpatialCoordinate(tagged.mesh)[0]

    def strain(y):
        plane = ufl.sym(ufl.grad(y))
        hoop = y[0] / ufl.SpatialCoordinate(tagged.mesh)[0]
        return ufl.as_tensor(
            [[plane[0, 0], plane[0, 1], 0], [plane[1, 0], plane[1, 1], 0], [0, 0, hoop]]
        )

    shear = 200.0 / 2.6
    stress = 2 * shear * strain(u) + 1.5 * shear * ufl.tr(strain(u)) * ufl.Identity(3)
    ds = ufl.Measure("ds", tagged.mesh, subdomain_data=tagged.facet_tags)
    a = ufl.inner(stress, strain(v)) * around * ufl.dx(metadata={"quadrature_degree": 4})
    bcs = [
        held(space, tagged.facets("a.bottom"), 1),
        held(space, facets(tagged.mesh, at_coordinate(0, 0)), 0),
    ]
    pair = Pair(
        tagged.facets("b.bottom"),
        tagged.facets("a.top"),
        friction=Coulomb(0.3),
        measure=around if measured else None,
    )
    problem = ContactProblem(
        a, -3.0 * around * v[1] * ds(tagged.boundaries["b.top"]), bcs, contact=pair
    )
    problem.solve()
    boundary, pressure = problem.state.boundary, problem.state.pressure
    assert problem.certificate.holds
    assert boundary.weight.sum() == pytest.approx(4 * np.pi if measured else 2.0, rel=1e-12)
    assert boundary.weight @ pressure == pytest.approx(12 * np.pi, rel=1e-9)
    if measured:
        assert pressure == pytest.approx(3.0, rel=1e-7)


# --- spheres --------------------------------------------------------------------------------------


def shells(radii, counts, young, poisson, inside, outside, kind="quadrilateral"):
    """The quarters of two hollow spheres in each other, from the axis to the plane of the
    equator.
    """

    def place(x):
        radius, angle = x[:, 0], x[:, 1]
        return np.column_stack((radius * np.sin(angle), radius * np.cos(angle)))

    through, along = counts
    return Bodies(
        kind,
        [
            Box(
                "core",
                (through, along[0]),
                (radii[0], 0.0),
                (radii[1], np.pi / 2),
                young[0],
                poisson[0],
            ),
            Box(
                "coat",
                (through, along[1]),
                (radii[1], 0.0),
                (radii[2], np.pi / 2),
                young[1],
                poisson[1],
            ),
        ],
        place,
        held=[(f"{name}.top", {"y": 0.0}) for name in ("core", "coat")],
        pressed=[("core.left", inside), ("coat.right", outside)],
        touching=[Touching("core.right", "coat.left")],
    )


def pressure_of_shells(radii, young, poisson, inside, outside):
    """Lame's pressure between hollow spheres that touch without a gap."""

    def moved(a, b, p, q, at, young, poisson):
        volume = b**3 - a**3
        pressure_load = (1 - 2 * poisson) / young * (p * a**3 - q * b**3) / volume
        return (
            pressure_load * at
            + (1 + poisson) / (2 * young) * (p - q) * a**3 * b**3 / volume / at**2
        )

    a, b, c = radii

    def apart(p):
        core = moved(a, b, inside, p, b, young[0], poisson[0])
        return moved(b, c, p, outside, b, young[1], poisson[1]) - core

    return -apart(0.0) / (apart(1.0) - apart(0.0))


@pytest.mark.parametrize(
    ("young", "poisson", "inside", "outside"),
    [((2000.0, 2000.0), (0.3, 0.3), 25.0, 0.0), ((2000.0, 500.0), (0.3, 0.4), 0.0, 10.0)],
    ids=["SSNP173", "coated"],
)
def test_hollow_spheres(young, poisson, inside, outside):
    """The pressure between a sphere and its coat, under a pressure inside (code_aster's SSNP173:
    4.894180) or outside: facets of 4 degrees leave errors below 1 %.
    """
    radii = (20.0, 30.0, 40.0)
    expected = pressure_of_shells(radii, young, poisson, inside, outside)
    if inside:
        assert expected == pytest.approx(4.894180, rel=1e-6)
    found = solve(shells(radii, (6, (20, 23)), young, poisson, inside, outside).scene())
    weight = found.contact.boundary.weight
    assert found.contact.pressure @ weight / weight.sum() == pytest.approx(expected, rel=0.01)
    assert found.contact.pressure == pytest.approx(expected, rel=0.06)
