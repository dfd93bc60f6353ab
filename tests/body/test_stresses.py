"""Stresses and what follows from them against exact states: Lame's cylinder, made-up displacements,
two materials.
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from numpy.testing import assert_allclose
from on_meshes import at_coordinate, tensors
from scene_tables import fixed, rectangle_mesh
from scenes import alone
from spaces import box

from signorini_fx.results.accuracy.stress_recovery import element_stress
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD
YOUNG, POISSON, PRESSURE = 1000.0, 0.3, 2.0
OUTER, INNER = 3.0, 1.5


def cylinder(degree, size, cell="triangle", hypothesis="plane strain"):
    """A quarter of a cylinder around (0, OUTER) with pressure inside."""
    parameters = {"radius": OUTER, "thickness": OUTER - INNER, "angle": 90.0, "symmetric": True}
    parameters |= {"size": size, "contact_size": size, "order": degree, "cell": cell}
    return parse_scene(
        {
            "mesh": {"generator": "ring_segment", "parameters": parameters},
            "element": {"degree": degree},
            "material": {"young": YOUNG, "poisson": POISSON, "hypothesis": hypothesis},
            "displacement": [{"boundary": name, "normal": 0.0} for name in ("symmetry", "right")],
            "traction": {"boundary": "inner", "pressure": PRESSURE},
        }
    )


def lame(x, hypothesis="plane strain"):
    """The exact stress, shape (n, 3, 3), and its principal stresses, largest first, shape (n,
    3).
    """
    arms = x[:, :2] - [0.0, OUTER]
    r = np.hypot(*arms.T)
    mean = PRESSURE * INNER**2 / (OUTER**2 - INNER**2)
    radial, hoop = mean - mean * OUTER**2 / r**2, mean + mean * OUTER**2 / r**2
    out = np.full_like(r, 2 * POISSON * mean if hypothesis == "plane strain" else 0.0)
    n = arms / r[:, None]
    t = np.column_stack((-n[:, 1], n[:, 0]))
    sigma = np.zeros((len(x), 3, 3))
    for direction, size in ((n, radial), (t, hoop)):
        sigma[:, :2, :2] += size[:, None, None] * direction[:, :, None] * direction[:, None]
    sigma[:, 2, 2] = out
    return sigma, np.column_stack((hoop, out, radial))


def mises_of(principal):
    """From the differences of the principal stresses."""
    one, two, three = principal.T
    return np.sqrt(((one - two) ** 2 + (two - three) ** 2 + (three - one) ** 2) / 2)


def errors_of(stresses, hypothesis="plane strain"):
    """Largest error at the nodes of each field, relative to the largest exact value of the same
    kind.
    """
    x = stresses.tensor.function_space.tabulate_dof_coordinates()
    sigma, principal = lame(x, hypothesis)
    mises = mises_of(principal)
    density = (
        mises**2 * (1 + POISSON) / (3 * YOUNG)
    )  # Huber and von Mises: (1 + nu) / (3 E) times its square
    pairs = {
        "tensor": (stresses.tensor, sigma),
        "von Mises": (stresses.von_mises, mises),
        "principal": (stresses.principal, principal),
        "zz": (stresses.component("zz"), sigma[:, 2, 2]),
        "density": (stresses.shear_energy_density, density),
    }
    found = {}
    for name, (function, exact) in pairs.items():
        away = np.abs(function.x.array.reshape(exact.shape) - exact).max(initial=0.0)
        size = np.abs(density if name == "density" else sigma).max(initial=0.0)
        found[name] = COMM.allreduce(away, op=MPI.MAX) / COMM.allreduce(size, op=MPI.MAX)
    return found


@pytest.mark.mpi
@pytest.mark.one_quick("cell", ["triangle", "quadrilateral"])
@pytest.mark.parametrize("hypothesis", ["plane strain", "plane stress"])
def test_pressed_cylinder(hypothesis, cell):
    """Every field has the stress of Lame, raw and recovered, and at its worst node an error that
    falls with h.
    """
    coarse, fine = (solve(cylinder(2, size, cell, hypothesis), COMM).stress for size in (0.4, 0.1))
    for one, other in ((coarse, fine), (coarse.recovered, fine.recovered)):
        before, after = errors_of(one, hypothesis), errors_of(other, hypothesis)
        for name, error in after.items():
            assert error < 0.01, name
            # h^2 in the mean; the largest error of all nodes, on meshes that are not similar, falls
            # at least with h.
            assert error < max(before[name] / 4, 1e-12), name
    # The recovered stress is the better one: its largest error is a half to a quarter of the other.
    assert (
        errors_of(fine.recovered, hypothesis)["tensor"]
        < 0.65 * errors_of(fine, hypothesis)["tensor"]
    )


@pytest.mark.mpi
@pytest.mark.parametrize("degree", [1, 2])
def test_extremes_and_estimate(degree):
    """The hoop stress is largest inside; the estimate is near the true error in the energy norm."""
    solution = solve(cylinder(degree, 0.2), COMM)
    found = solution.stress
    mean = PRESSURE * INNER**2 / (OUTER**2 - INNER**2)
    hoop = PRESSURE * (OUTER**2 + INNER**2) / (OUTER**2 - INNER**2)
    for one in (found, found.recovered):
        largest = one.largest("principal", 0)
        assert largest.value == pytest.approx(hoop, rel={1: 0.1, 2: 0.01}[degree])
        assert np.hypot(largest.place[0], largest.place[1] - OUTER) == pytest.approx(
            INNER, rel=0.01
        )
        assert one.largest("zz").value == pytest.approx(
            2 * POISSON * mean, rel={1: 0.8, 2: 0.06}[degree]
        )
        assert COMM.bcast(largest) == largest
    # The exact energy: half the pressure times the widening of the hole.
    widening = PRESSURE * INNER * (1 + POISSON) / YOUNG * ((1 - 2 * POISSON) * INNER**2 + OUTER**2)
    widening /= OUTER**2 - INNER**2
    exact = PRESSURE * widening * np.pi / 2 * INNER / 2
    missing = np.sqrt(1 - solution.steps[-1].strain_energy / exact)
    assert found.error == pytest.approx(missing, rel=0.25)


def quadratic(degree, comm):
    """Displacements of degree 2 in a box, given on all sides, with the body force that holds them
    in balance.
    """
    moves = {
        "x": "1e-3 * x[0] * x[1]",
        "y": "2e-3 * x[2]**2 - 1e-3 * x[1]",
        "z": "5e-4 * (x[0]**2 + x[1] * x[2])",
    }
    sides = ("left", "right", "front", "back", "bottom", "top")
    mu, lame_one = (
        YOUNG / (2 * (1 + POISSON)),
        YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON)),
    )
    # mu Laplace y + (lambda + mu) grad div y, with div y = 1.5e-3 x[1] - 1e-3.
    laplace, gradient = np.array([0.0, 4e-3, 1e-3]), np.array([0.0, 1.5e-3, 0.0])
    force = -(mu * laplace + (lame_one + mu) * gradient)
    scene = {
        "mesh": box("tetrahedra" if degree == 2 else "hexahedra", (3, 2, 2), comm=comm),
        "element": {"degree": 2},
        "material": {"young": YOUNG, "poisson": POISSON},
        "displacement": [{"boundary": name, **moves} for name in sides],
        "body_force": dict(zip("xyz", force.tolist(), strict=True)),
    }
    return parse_scene(scene), (lame_one, mu)


@pytest.mark.mpi
@pytest.mark.parametrize("degree", [1, 2])
def test_made_up_displacement(degree):
    """Quadratic elements hold it: the tensor, von Mises and principal stresses and the density are
    exact everywhere.
    """
    scene, (lame_one, mu) = quadratic(degree, COMM)
    found = solve(scene, COMM).stress
    x, y, z = found.tensor.function_space.tabulate_dof_coordinates().T
    zero = np.zeros_like(x)
    gradient = 1e-3 * np.array([[y, x, zero], [zero, zero - 1, 4 * z], [x, z / 2, y / 2]])
    strain = ((gradient + gradient.swapaxes(0, 1)) / 2).transpose(2, 0, 1)
    sigma = 2 * mu * strain + lame_one * np.trace(strain, axis1=1, axis2=2)[:, None, None] * np.eye(
        3
    )
    principal = np.array(
        [sorted(np.linalg.eigvals(one).real, reverse=True) for one in sigma]
    ).reshape(-1, 3)
    pressure = -np.trace(sigma, axis1=1, axis2=2) / 3
    bulk = YOUNG / (3 * (1 - 2 * POISSON))
    density = np.einsum("nij,nij->n", sigma, strain) / 2 - pressure**2 / (2 * bulk)
    size = COMM.allreduce(np.abs(sigma).max(initial=0.0), op=MPI.MAX)
    for function, exact, scale in (
        (found.tensor, sigma, size),
        (found.von_mises, mises_of(principal), size),
        (found.principal, principal, size),
        (found.component("yz"), sigma[:, 1, 2], size),
        (found.shear_energy_density, density, size**2 / YOUNG),
    ):
        assert_allclose(function.x.array, exact.ravel(), rtol=0, atol=1e-8 * scale)


@pytest.mark.mpi
@pytest.mark.parametrize(
    "stiff_yield", [{}, {"yield_stress": 1.0}], ids=["soft may yield", "both may yield"]
)
def test_two_materials(stiff_yield):
    """A constant state in each of two layers: the recovered stress keeps the jump along them, and
    nothing is missed.

    The stress is larger in the stiff layer, the share of the yield stress in the soft one.
    """
    from dolfinx import mesh as dmesh

    from signorini_fx.mechanics.mesh.tagged import TaggedMesh, tag_boundaries

    mesh = dmesh.create_rectangle(COMM, [(0.0, 0.0), (2.0, 1.0)], (6, 4))
    count = mesh.topology.index_map(2)
    cells = np.arange(count.size_local + count.num_ghosts, dtype=np.int32)
    middles = dmesh.compute_midpoints(mesh, 2, cells)
    sides = {
        "ends": lambda x: np.isclose(x[0], 0.0) | np.isclose(x[0], 2.0),
        "bottom": at_coordinate(1, 0.0),
    }
    own = tag_boundaries(mesh, sides)
    regions = dmesh.meshtags(mesh, 2, cells, np.where(middles[:, 1] < 0.5, 1, 2).astype(np.int32))
    tagged = TaggedMesh(mesh, own.facet_tags, own.boundaries, regions, {"soft": 1, "stiff": 2})
    strain = 1e-3
    scene = parse_scene(
        {
            "mesh": tagged,
            "material": [
                {"young": 100.0, "poisson": POISSON, "region": "soft", "yield_stress": 0.1},
                {"young": 300.0, "poisson": POISSON, "region": "stiff", **stiff_yield},
            ],
            "displacement": [{"boundary": "ends", "x": f"{strain} * x[0]"}, fixed("bottom", "y")],
        }
    )
    found = solve(scene, COMM).stress
    # Plane strain without stress across the layers: the von Mises stress is sqrt(1 - nu + nu^2)
    # times that along them.
    used = np.sqrt(1 - POISSON + POISSON**2) * strain / (1 - POISSON**2) * 100.0 / 0.1
    utilisation = found.utilisation()
    assert utilisation["value"] == pytest.approx(used, rel=1e-6)
    assert utilisation["region"] == "soft"
    assert utilisation["place"][1] <= 0.5
    for one in (found, found.recovered):
        assert one.largest("xx").value == pytest.approx(300.0 * strain / (1 - POISSON**2), rel=1e-6)
        assert one.smallest("xx").value == pytest.approx(
            100.0 * strain / (1 - POISSON**2), rel=1e-6
        )
        assert one.largest("zz").value == pytest.approx(
            POISSON * 300.0 * strain / (1 - POISSON**2), rel=1e-6
        )
        assert one.largest("xx").place[1] >= 0.5
    assert found.error == pytest.approx(0.0, abs=1e-6)
    told = found.as_dict()
    for one in (told, told["recovered"]):
        assert [one[name]["region"] for name in ("von_mises", "largest_zz", "smallest_zz")] == [
            "stiff",
            "stiff",
            "soft",
        ]


# --- elements with a reduced volumetric term, near nu = 1/2 ---------------------------------------

MEAN = PRESSURE * INNER**2 / (OUTER**2 - INNER**2)
KINDS = [(1, "quadrilateral"), (2, "quadrilateral"), (2, "triangle")]


def nearly(poisson, degree, cell, size, comm=COMM):
    """Lame's cylinder of a nearly incompressible material, with reduced integration, solved."""
    scene = cylinder(degree, size, cell)
    changes = {
        "element": scene.element.model_copy(update={"volumetric": "reduced"}),
        "material": tuple(own.model_copy(update={"poisson": poisson}) for own in scene.material),
    }
    return solve(scene.model_copy(update=changes), comm)


def exact_stress(x):
    """Lame's solution in 2D, as UFL, shape (2, 2); it does not depend on the material."""
    arm = ufl.as_vector((x[0], x[1] - OUTER))
    square = ufl.inner(arm, arm)
    return MEAN * ufl.Identity(2) + MEAN * OUTER**2 / square * (
        ufl.Identity(2) - 2 * ufl.outer(arm, arm) / square
    )


def true_error(solution):
    """Error of the stress of the elements in the energy norm, relative."""
    d = solution.model
    stress = element_stress(d, solution.displacement)
    exact = exact_stress(ufl.SpatialCoordinate(d.tagged.mesh))
    dx = ufl.dx(metadata={"quadrature_degree": 8})
    squares = [
        COMM.allreduce(
            fem.assemble_scalar(
                fem.form(
                    stress.compliance(
                        ufl.as_vector([tau[pair] for pair in stress.kinematics.pairs])
                    )
                    * dx
                )
            )
        )
        for tau in (exact - stress.sigma, exact)
    ]
    return float(np.sqrt(squares[0] / squares[1]))


@pytest.mark.mpi(slow=True)
@pytest.mark.one_quick(("degree", "cell"), KINDS)
def test_nearly_incompressible_cylinder(degree, cell):
    """Errors and their estimates are the same at nu = 0.499 and 0.4999, fall with h, and agree with
    each other.
    """
    found = []
    for poisson in (0.499, 0.4999):
        for size in (0.5, 0.25):
            solution = nearly(poisson, degree, cell, size)
            error = true_error(solution)
            assert 0.85 < solution.stress.error / error < 1.7
            extremes = [
                one.largest("principal", 0).value
                for one in (solution.stress, solution.stress.recovered)
            ]
            found.append((error, solution.stress.error, *extremes))
    coarse, fine, *others = np.array(found)
    assert_allclose(np.array(others), [coarse, fine], rtol=0.02)
    assert fine[0] < {1: 0.6, 2: 0.4}[degree] * coarse[0]
    hoop = PRESSURE * (OUTER**2 + INNER**2) / (OUTER**2 - INNER**2)
    assert_allclose(fine[2:], hoop, rtol={1: 0.18, 2: 0.03}[degree])


@pytest.mark.one_quick(("degree", "cell"), KINDS)
def test_uniform_stress(degree, cell):
    """A nearly incompressible block under uniform pressure has that stress everywhere; the estimate
    is nought.
    """
    scene = parse_scene(
        {
            "mesh": rectangle_mesh(5, 3, cell=cell),
            "element": {"degree": degree, "volumetric": "reduced"},
            "material": {"young": 6.0, "poisson": 0.4999},
            "displacement": [fixed("left", "x"), fixed("bottom", "y")],
            "traction": [{"boundary": "right", "x": -2.0}, {"boundary": "top", "y": -1.0}],
        }
    )
    stress = alone(scene).stress
    for one in (stress, stress.recovered):
        exact = np.diag([-2.0, -1.0, -3 * 0.4999])
        assert_allclose(
            tensors(one.tensor),
            np.broadcast_to(exact, (len(one.tensor.x.array) // 9, 3, 3)),
            atol=1e-5,
        )
    assert stress.error < 1e-5
