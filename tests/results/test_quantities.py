"""What is measured after a solve, against the same computed in another way: energies, means,
displacements at rest.
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from numpy.testing import assert_allclose
from scene_tables import fixed, rectangle_mesh
from scenes import alone, example1

from signorini_fx.addons.pictures import gather
from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.mechanics.elasticity import elastic_law as estimators
from signorini_fx.mechanics.materials.isotropic import LinearElastic
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

YOUNG, POISSON = 5000.0, 0.3
GRADIENTS = {
    "pulled along x": [[1e-3, 0.0], [0.0, 0.0]],
    "pressed along y": [[2e-4, 0.0], [0.0, -7e-4]],
    "sheared": [[0.0, 1e-3], [3e-4, 0.0]],
    "all at once": [[1e-3, 4e-4], [-2e-4, 5e-4]],
}


def strain_and_stress(gradient, hypothesis):
    """Of a constant displacement gradient, all components."""
    mu, bulk = YOUNG / (2 * (1 + POISSON)), YOUNG / (3 * (1 - 2 * POISSON))
    strain = np.zeros((3, 3))
    strain[:2, :2] = (np.array(gradient) + np.transpose(gradient)) / 2
    if hypothesis == "plane stress":
        strain[2, 2] = -POISSON / (1 - POISSON) * (strain[0, 0] + strain[1, 1])
    stress = 2 * mu * strain + (bulk - 2 * mu / 3) * np.trace(strain) * np.eye(3)
    assert hypothesis == "plane strain" or abs(stress[2, 2]) < 1e-12 * np.abs(stress).max()
    return strain, stress


def shear_energy(gradient, hypothesis):
    """The whole elastic energy less that of the change of volume, p^2 / (2 K)."""
    strain, stress = strain_and_stress(gradient, hypothesis)
    pressure, bulk = -np.trace(stress) / 3, YOUNG / (3 * (1 - 2 * POISSON))
    return np.sum(stress * strain) / 2 - pressure**2 / (2 * bulk)


def von_mises(gradient, hypothesis):
    """From the differences of the principal stresses."""
    one, two, three = np.linalg.eigvalsh(strain_and_stress(gradient, hypothesis)[1])
    return np.sqrt(((one - two) ** 2 + (two - three) ** 2 + (three - one) ** 2) / 2)


def scene(gradient, hypothesis, cell, degree=1):
    """A rectangle whose sides are all moved by a linear displacement."""
    (a, b), (c, d) = gradient
    sides = {"x": f"{a} * x[0] + {b} * x[1]", "y": f"{c} * x[0] + {d} * x[1]"}
    return parse_scene(
        {
            "mesh": rectangle_mesh(6, 4, cell=cell),
            "element": {"degree": degree},
            "material": {"young": YOUNG, "poisson": POISSON, "hypothesis": hypothesis},
            "displacement": [
                {"boundary": name, **sides} for name in ("left", "right", "top", "bottom")
            ],
        }
    )


@pytest.mark.mpi
@pytest.mark.one_quick("cell", ["quadrilateral", "triangle"])
@pytest.mark.parametrize("hypothesis", ["plane strain", "plane stress"])
@pytest.mark.parametrize("name", GRADIENTS)
def test_cells_for_pictures(name, hypothesis, cell):
    """Cells of all ranks tile the body, with the displacement and the shear energy density of a
    constant strain.
    """
    gradient = GRADIENTS[name]
    comm = MPI.COMM_WORLD
    solution = solve(scene(gradient, hypothesis, cell), comm)
    gathered = gather.gather_body(solution, ("density", "von_mises"))
    assert (
        comm.rank == 0 or len(gathered.perimeters) == len(gathered.points) == 0
    )  # the other ranks do not hold the mesh
    gathered = comm.bcast(gathered)
    exact = {
        "density": shear_energy(gradient, hypothesis),
        "von_mises": von_mises(gradient, hypothesis),
    }
    raw = {"density": solution.stress.shear_energy_density, "von_mises": solution.stress.von_mises}
    for name, value in exact.items():
        assert_allclose(raw[name].x.array, value, rtol=1e-10)
        # Recovered by an average over cells, with weights that are solved for to a residual of
        # 1.5e-8.
        assert_allclose(gathered.values[name], value, rtol=1e-8 if comm.size == 1 else 1e-7)
    assert len(gathered.perimeters) == {"quadrilateral": 24, "triangle": 48}[cell]
    corners = gathered.points[gathered.perimeters]
    following = np.roll(corners, -1, axis=1)
    areas = (
        np.abs(
            (corners[..., 0] * following[..., 1] - corners[..., 1] * following[..., 0]).sum(axis=1)
        )
        / 2
    )
    assert_allclose(areas, 3.0 / len(areas), rtol=1e-12)
    middles = {(round(x, 9), round(y, 9)) for x, y in corners.mean(axis=1)}
    assert len(middles) == len(areas)
    expected = gathered.points @ np.transpose(gradient)
    assert_allclose(gathered.displacement, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.mpi
@pytest.mark.one_quick(("cell", "degree"), [("quadrilateral", 1), ("triangle", 2)])
@pytest.mark.parametrize("hypothesis", ["plane strain", "plane stress"])
@pytest.mark.parametrize("name", GRADIENTS)
def test_stresses(name, hypothesis, cell, degree):
    """The tensor with the component out of the plane, von Mises and principal stresses of a
    constant strain.
    """
    gradient = GRADIENTS[name]
    found = solve(scene(gradient, hypothesis, cell, degree), MPI.COMM_WORLD).stress
    _, sigma = strain_and_stress(gradient, hypothesis)
    size = np.abs(sigma).max()
    for function, expected in (
        (found.tensor, sigma),
        (found.von_mises, von_mises(gradient, hypothesis)),
        (found.principal, np.linalg.eigvalsh(sigma)[::-1]),
    ):
        values = function.x.array.reshape(-1, *np.shape(expected))
        assert_allclose(values, np.broadcast_to(expected, values.shape), rtol=0, atol=1e-9 * size)
    assert found.smallest().value == pytest.approx(
        np.linalg.eigvalsh(sigma)[0], rel=1e-9, abs=1e-9 * size
    )


@pytest.mark.mpi
def test_extremes_of_the_stress():
    """Bending: von Mises and compression are largest at the top, tension at the bottom, on every
    rank alike.
    """
    sides = {
        "x": "-1e-3 * x[0] * (x[1] - 0.4)",
        "y": f"5e-4 * (x[0]**2 + {POISSON} * (x[1] - 0.4)**2)",
    }
    bent = parse_scene(
        {
            "mesh": rectangle_mesh(6, 4),
            "element": {"degree": 2},
            "material": {"young": YOUNG, "poisson": POISSON, "hypothesis": "plane stress"},
            "displacement": [
                {"boundary": name, **sides} for name in ("left", "right", "top", "bottom")
            ],
        }
    )
    found = solve(bent, MPI.COMM_WORLD).stress
    largest, tension, compression = found.largest(), found.largest("principal", 0), found.smallest()
    assert largest.place[1] == pytest.approx(1.0)
    assert compression.place[1] == pytest.approx(1.0)
    assert tension.place[1] == pytest.approx(0.0)
    assert largest.value == pytest.approx(0.6e-3 * YOUNG, rel=1e-6)
    assert compression.value == pytest.approx(-0.6e-3 * YOUNG, rel=1e-6)
    assert tension.value == pytest.approx(0.4e-3 * YOUNG, rel=1e-6)
    assert MPI.COMM_WORLD.bcast(largest) == largest
    # The nodes next to the line without stress, x[1] = 0.4, are at 0.375.
    assert found.smallest("von_mises").value == pytest.approx(0.025e-3 * YOUNG, rel=1e-6)
    with pytest.raises(ValueError, match="von_mises"):
        found.largest("mises")


@pytest.mark.one_quick("hypothesis", ["plane strain", "plane stress"])
@pytest.mark.parametrize("name", GRADIENTS)
def test_compliance_is_the_inverse_of_the_stiffness(name, hypothesis):
    """The energy of a stress, by which errors are measured, is that of the strain that it comes
    from.
    """
    solution = alone(scene(GRADIENTS[name], hypothesis, "triangle"))
    constants = LinearElastic(young=YOUNG, poisson=POISSON, hypothesis=hypothesis).lame
    lame, mu = constants
    strain = ufl.sym(ufl.grad(solution.displacement))
    sigma = lame * ufl.tr(strain) * ufl.Identity(2) + 2 * mu * strain
    kinematics = solution.statement.kinematics
    components = ufl.as_vector([sigma[pair] for pair in kinematics.pairs])
    energy = estimators.compliance(components, kinematics, *constants)
    strained = ufl.inner(sigma, strain)
    found, expected = (
        fem.assemble_scalar(fem.form(density * ufl.dx)) for density in (energy, strained)
    )
    assert found == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("degree", [1, 2])
def test_mean_tangential_displacement(degree):
    """It is an integral over the boundary, of which the nodes of degree 2 have different shares."""
    symmetric = example1(bound=1.5, nx=6, ny=2, degree=degree)
    left, right = symmetric.displacement
    solution = alone(
        symmetric.model_copy(update={"displacement": (left.model_copy(update={"x": 0.001}), right)})
    )
    tagged = solution.model.tagged
    tag = tagged.boundaries["bottom"]
    ds = ufl.Measure("ds", domain=tagged.mesh, subdomain_data=tagged.facet_tags)(tag)
    integral = fem.assemble_scalar(fem.form(solution.displacement[0] * ds))
    assert integral > 1e-4
    assert solution.contact.mean_tangential_displacement == pytest.approx(integral / 3.0, rel=1e-10)


@pytest.mark.parametrize("degree", [1, 2])
def test_arc_length(degree):
    """Nodes come in order along the boundary, those inside facets too, and count from its
    beginning.
    """
    columns = alone(example1(bound=1.5, nx=6, ny=2, degree=degree)).table.columns
    assert_allclose(columns["x"], np.linspace(0.0, 3.0, 6 * degree + 1), atol=1e-12)
    assert_allclose(columns["s"], columns["x"], atol=1e-12)


def test_zones_of_a_closed_boundary():
    """A run across the first row is one; one all around goes from the first row to the last."""
    table = ContactTable({"x": np.arange(4), "y": np.zeros(4), "to_next": np.ones(4)}, [range(4)])
    assert table.zones(np.array([True, False, True, True])) == [[[2.0, 0.0], [0.0, 0.0]]]
    assert table.zones(np.ones(4, dtype=bool)) == [[[0.0, 0.0], [3.0, 0.0]]]


@pytest.mark.mpi
def test_the_place_of_a_stress_that_is_the_same_everywhere():
    """That with the smallest coordinates, on any number of ranks, raw and recovered."""
    scene = parse_scene(
        {
            "mesh": rectangle_mesh(8, 4),
            "material": {"young": YOUNG, "poisson": POISSON},
            "displacement": [fixed("left", "x"), {"boundary": "top", "y": -0.01}],
            "contact": {"boundary": "bottom"},
        }
    )
    stress = solve(scene, MPI.COMM_WORLD).stress
    for extreme in (stress.largest(), stress.smallest(), stress.recovered.largest()):
        assert_allclose(extreme.place, 0.0, rtol=0, atol=1e-12)
