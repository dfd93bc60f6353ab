"""Orthotropic materials: uniform states by formulas, a tube, isotropic constants, turned scenes,
products.
"""

from dataclasses import replace

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from on_meshes import nodes, tensors, turn_by
from revolved import section
from scene_tables import fixed
from scenes import alone
from steel_blocks import PLANE, body, pushed_down

from signorini_fx import SceneError
from signorini_fx.mechanics.elasticity.moduli import middles
from signorini_fx.results.accuracy.stress_recovery import StressRecovery
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD
E1, E2, E3 = 12000.0, 900.0, 500.0
NU12, NU13, NU23 = 0.37, 0.42, 0.5
G12, G13, G23 = 800.0, 700.0, 60.0
WOOD = {"young": [E1, E2, E3], "poisson": [NU12, NU13, NU23], "shear": [G12, G13, G23]}
PRESSURE = 3.0


def wood(**more):
    """The material of a scene; ``hypothesis`` and the like are its own keys, the others those of
    ``orthotropic``.
    """
    own = {
        key: more.pop(key) for key in ("hypothesis", "region", "grading", "density") if key in more
    }
    return {"orthotropic": WOOD | more, **own}


def compliance():
    """S_ijkl along the axes, as a map of stresses to strains, shape (3, 3) -> (3, 3)."""
    normal = np.array(
        [
            [1 / E1, -NU12 / E1, -NU13 / E1],
            [-NU12 / E1, 1 / E2, -NU23 / E2],
            [-NU13 / E1, -NU23 / E2, 1 / E3],
        ]
    )
    shear = np.array([[0, G12, G13], [G12, 0, G23], [G13, G23, 0]])
    return normal, shear


def off_axis(angle, hypothesis):
    """Strains xx, yy, and xy twice, per stress along x, with axis 1 at an angle to x (R. M. Jones,
    Mechanics of Composite Materials, 2nd ed., Taylor & Francis, 1999, section 2.8), and the stress
    zz per stress.
    """
    c, s = np.cos(angle), np.sin(angle)
    s11, s22, s12, s66, out = 1 / E1, 1 / E2, -NU12 / E1, 1 / G12, 0.0
    if hypothesis == "plane strain":
        s13, s23, s33 = -NU13 / E1, -NU23 / E2, 1 / E3
        s11, s22, s12 = s11 - s13**2 / s33, s22 - s23**2 / s33, s12 - s13 * s23 / s33
        out = -(s13 * c**2 + s23 * s**2) / s33
    along = s11 * c**4 + (2 * s12 + s66) * s**2 * c**2 + s22 * s**4
    across = s12 * (s**4 + c**4) + (s11 + s22 - s66) * s**2 * c**2
    shear = (2 * s11 - 2 * s12 - s66) * s * c**3 - (2 * s22 - 2 * s12 - s66) * s**3 * c
    return along, across, shear, out


def uniform(tagged, material, degree, linear_algebra):
    """A bar that is pressed on a wall on its left without friction, and is free otherwise."""
    dim = tagged.dimension
    origin = [{"at": [0.0, 0.0], "y": 0.0}]
    if dim == 3:
        origin = [{"at": [0.0] * 3, "y": 0.0, "z": 0.0}, {"at": [0.0, 0.0, 1.0], "y": 0.0}]
    return parse_scene(
        {
            "mesh": tagged,
            "element": {"degree": degree},
            "material": material,
            "displacement": origin,
            "traction": {"boundary": "right", "pressure": PRESSURE},
            "contact": {"boundary": "left"},
            "solver": {"algorithm": "alm", "linear_algebra": linear_algebra, "tolerance": 1e-12},
        }
    )


def assert_uniform(solution, strain, stress, rel=1e-7):
    """The displacement grad u X with no rotation of the wall, the recovered stress, energies and
    the certificate.
    """
    assert solution.converged
    assert solution.certificate.holds
    x = solution.displacement.function_space.tabulate_dof_coordinates()
    dim = solution.model.tagged.dimension
    gradient = np.array(
        [[strain[i, j] * (1 if i == j else 2 * (i > j)) for j in range(dim)] for i in range(dim)]
    )
    exact = x[:, :dim] @ gradient.T
    found = solution.displacement.x.array.reshape(len(x), dim)
    assert np.abs(found - exact).max() <= rel * np.abs(strain).max() * 2
    assert solution.contact.pressure == pytest.approx(PRESSURE, rel=1e-7)
    tensor = tensors(solution.stress.recovered.tensor)
    assert np.abs(tensor - stress).max() <= rel * PRESSURE
    raw = tensors(solution.stress.tensor)
    assert np.abs(raw - stress).max() <= rel * PRESSURE
    size = 2.0
    energy = size * PRESSURE * -strain[0, 0] / 2
    assert solution.certificate.strain_energy == pytest.approx(energy, rel=rel)
    recovery = StressRecovery.of(solution.model)
    assert recovery.energy(solution.displacement) == pytest.approx(energy, rel=rel)
    assert recovery.error(solution.displacement) <= 1e-5 * np.sqrt(2 * energy)


@pytest.mark.mpi
@pytest.mark.one_quick("linear_algebra", ["full", "condensed", "krylov"])
@pytest.mark.parametrize("hypothesis", ["plane strain", "plane stress"])
@pytest.mark.parametrize(("cells", "degree"), [("quadrilateral", 1), ("triangle", 2)])
def test_off_axis(cells, degree, hypothesis, linear_algebra):
    """A strip at an angle to its fibres shortens, widens and shears."""
    if linear_algebra == "condensed" and COMM.size > 1:
        pytest.skip("condensation is for one rank")
    angle = 0.6
    material = wood(direction=[2 * np.cos(angle), 2 * np.sin(angle)], hypothesis=hypothesis)
    solution = solve(uniform(body(cells), material, degree, linear_algebra), COMM, check=False)
    along, across, shear, out = off_axis(angle, hypothesis)
    strain = -PRESSURE * np.array([[along, shear / 2], [shear / 2, across]])
    assert_uniform(solution, strain, -PRESSURE * np.diag([1.0, 0.0, out]))


@pytest.mark.mpi
@pytest.mark.one_quick("linear_algebra", ["full", "krylov"])
@pytest.mark.parametrize(("cells", "degree"), [("hexahedra", 1), ("tetrahedra", 2)])
def test_off_axis_in_space(cells, degree, linear_algebra):
    """The same with three turned axes; E along x is also that of S. G. Lekhnitskii (Theory of
    Elasticity of an Anisotropic Body, Mir, 1981, section 5), from the cosines of the angles between
    x and the axes.
    """
    first, second = np.array([1.0, 0.5, -0.3]), np.array([0.2, 1.0, 0.7])
    axes, _ = np.linalg.qr(np.column_stack((first, second, np.cross(first, second))))
    normal, shear = compliance()
    own = axes.T @ np.diag([-PRESSURE, 0.0, 0.0]) @ axes
    strained = np.diag(normal @ own.diagonal()) + np.divide(
        own, 2 * shear, out=np.zeros((3, 3)), where=shear > 0
    )
    strain = axes @ strained @ axes.T
    a, b, c = axes[0] ** 2
    soft = a**2 / E1 + b**2 / E2 + c**2 / E3 + a * b * (1 / G12 - 2 * NU12 / E1)
    soft += a * c * (1 / G13 - 2 * NU13 / E1) + b * c * (1 / G23 - 2 * NU23 / E2)
    assert strain[0, 0] == pytest.approx(-PRESSURE * soft)
    material = wood(direction=list(first), second=list(second))
    solution = solve(uniform(body(cells), material, degree, linear_algebra), COMM, check=False)
    assert_uniform(solution, strain, np.diag([-PRESSURE, 0.0, 0.0]))


def tube(n):
    """Error of the displacement of a long tube of cylindrically orthotropic material under a
    pressure inside.

    S. G. Lekhnitskii, section 26: u = A r^k + B r^-k with k^2 = C_tt / C_rr.
    """
    inside, outside = 1.0, 2.0
    s, _ = compliance()
    c = np.linalg.inv(s)[
        np.ix_([1, 2, 0], [1, 2, 0])
    ]  # axis 1 is along x[1], axis 2 towards the axis, 3 around it
    k = np.sqrt(c[1, 1] / c[0, 0]) * np.array([1, -1])
    given = parse_scene(
        {
            "mesh": section(inside, outside, 0.25, counts=(n, 2), comm=MPI.COMM_SELF),
            "material": wood(direction=[0.0, 1.0], hypothesis="axisymmetric"),
            "displacement": [fixed(side, "y") for side in ("top", "bottom")],
            "traction": {"boundary": "inside", "pressure": PRESSURE},
        }
    )
    solution = alone(given, check=False)
    assert solution.certificate.holds
    r = solution.displacement.function_space.tabulate_dof_coordinates()[:, 0]
    found = solution.displacement.x.array.reshape(len(r), -1)[:, 0]

    def radial(at):
        return (c[0, 0] * k + c[0, 1]) * at ** (k - 1)

    exact = r[:, None] ** k @ np.linalg.solve([radial(inside), radial(outside)], [-PRESSURE, 0.0])
    return np.abs(found - exact).max() / np.abs(exact).max()


def test_tube():
    """The error is of the second order."""
    errors = [tube(n) for n in (8, 16)]
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.1)


# --- isotropic constants, turned scenes -----------------------------------------------------------


@pytest.mark.one_quick("hypothesis", ["plane strain", "plane stress", "axisymmetric", None])
def test_isotropic_constants(hypothesis):
    """The same solution and the same scales."""
    young, poisson = 5000.0, 0.3
    shear = young / (2 * (1 + poisson))
    axes = (
        {"direction": [0.6, 0.8]}
        if hypothesis
        else {"direction": [1.0, 2.0, 2.0], "second": [0.0, 1.0, 0.0]}
    )
    more = {} if hypothesis is None else {"hypothesis": hypothesis}
    constants = {"young": [young] * 3, "poisson": [poisson] * 3, "shear": [shear] * 3}
    tagged = body("hexahedra" if hypothesis is None else "quadrilateral", MPI.COMM_SELF)
    one, other = (
        alone(pushed_down(tagged, material | more))
        for material in ({"young": young, "poisson": poisson}, {"orthotropic": constants | axes})
    )
    assert other.converged
    assert other.certificate.holds
    y = one.displacement.x.array
    assert np.abs(other.displacement.x.array - y).max() <= 1e-10 * np.abs(y).max()
    assert other.contact.shear == pytest.approx(
        one.contact.shear, abs=1e-9 * np.abs(one.contact.pressure).max()
    )
    field, same = other.stress.recovered, one.stress.recovered
    assert field.von_mises.x.array == pytest.approx(same.von_mises.x.array, rel=1e-8)
    assert other.model.scales == one.model.scales


@pytest.mark.one_quick("dim", [2, 3])
def test_turned_and_mirrored(dim):
    """Everything is turned or mirrored, and the pressures are the same."""
    angle = 0.7
    turn = np.eye(dim)
    turn[:2, :2] = turn_by(angle)
    first = np.array([1.0, 0.4] if dim == 2 else [1.0, 0.4, 0.6])
    second = np.array([-0.3, 1.0, 0.2])
    found = []
    for motion in (np.eye(dim), turn, np.diag([-1.0] + [1.0] * (dim - 1))):
        tagged = body("triangle" if dim == 2 else "tetrahedra", MPI.COMM_SELF)
        own = [one.copy() for one in (tagged.facets("bottom"), tagged.facets("top"))]
        tagged.mesh.geometry.x[:, :dim] = tagged.mesh.geometry.x[:, :dim] @ motion.T
        axes = {"direction": list(motion @ first)} | (
            {} if dim == 2 else {"second": list(motion @ second)}
        )
        solution = alone(pushed_down(tagged, wood(**axes), motion))
        assert solution.certificate.holds
        assert all(
            np.array_equal(a, b)
            for a, b in zip(own, (tagged.facets("bottom"), tagged.facets("top")), strict=True)
        )
        found.append(solution.contact)
    for one in found[1:]:
        assert np.abs(one.pressure - found[0].pressure).max() <= 1e-8 * found[0].pressure.max()
        sizes = [
            np.linalg.norm(state.shear.reshape(len(state.pressure), -1), axis=1)
            for state in (one, found[0])
        ]
        assert np.abs(sizes[0] - sizes[1]).max() <= 1e-7 * found[0].pressure.max()


# --- independent check, several materials, products -----------------------------------------------


def halves(tagged):
    """The same body with its left half called a, the other one b."""
    mesh, dim = tagged.mesh, tagged.dimension
    count = mesh.topology.index_map(dim).size_local + mesh.topology.index_map(dim).num_ghosts
    cells = np.arange(count, dtype=np.int32)
    tags = dmesh.meshtags(mesh, dim, cells, (1 + (middles(tagged, cells)[0] > 1)).astype(np.int32))
    return replace(tagged, cell_tags=tags, regions={"a": 1, "b": 2})


@pytest.mark.mpi
@pytest.mark.parametrize("cells", ["quadrilateral", "hexahedra"])
def test_bar_of_two_woods(cells):
    """Along the fibres on the left, across them and softer on the right: it shortens by p (l / E1 +
    l / (E2 / 4)).
    """
    across = (
        {"direction": [0.0, 1.0]}
        if cells in PLANE
        else {"direction": [0.0, 1.0, 0.0], "second": [-1.0, 0.0, 0.0]}
    )
    straight = {"poisson": [0.0] * 3}
    material = [wood(region="a", **straight), wood(region="b", grading=0.25, **straight, **across)]
    solution = solve(uniform(halves(body(cells)), material, 1, "full"), COMM, check=False)
    assert solution.certificate.holds
    x, y = nodes(solution)
    shortened = -y[np.isclose(x[:, 0], 2.0), 0]
    assert shortened == pytest.approx(PRESSURE * (1 / E1 + 4 / E2), rel=1e-8)


# --- what is refused and said ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "place", "message"),
    [
        (
            {"poisson": [4.0, 0.0, 0.0]},
            "poisson",
            r"nu_12 = 4 must be between -3.65148 and 3.65148",
        ),
        ({"poisson": [0.0, 0.0, -1.5]}, "poisson", r"nu_23 = -1.5 .* square root of E_2 / E_3"),
        (
            {"poisson": [2.5, 3.5, 0.9]},
            "poisson",
            "2 nu_21 nu_32 nu_13 = .* must be positive: otherwise some strain",
        ),
        ({"young": [1.0, 0.0, 1.0]}, "young", "greater than 0"),
        ({"shear": [1.0, -1.0, 1.0]}, "shear", "greater than 0"),
        ({"shear": [1.0, 1.0]}, "shear", "missing"),
        ({"direction": [1.0, 0.0, 0.0]}, "direction", "give 2 values, not 3"),
        ({"direction": ["x[2]", 1.0]}, "direction", "there is no x"),
        ({"direction": [0.0, "0*x[0]"]}, "", "must be finite, not zero"),
        ({"direction": [1.0, "log(x[0] - 1)"]}, "", "must be finite, not zero"),
        ({"second": [0.0, 1.0]}, "second", "leave it out"),
    ],
)
def test_wrong_constants(change, place, message):
    with pytest.raises(SceneError, match=rf"orthotropic.*{place}.*{message}") as raised:
        check_scene(pushed_down(body(comm=MPI.COMM_SELF), wood(**change)), MPI.COMM_SELF)
    assert len(raised.value.problems) == 1


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (
            {"element": {"degree": 2, "volumetric": "mixed"}},
            "element.volumetric: must be 'full' with an anisotropic",
        ),
        (
            {"element": {"volumetric": "reduced"}},
            "element.volumetric: must be 'full' with an anisotropic",
        ),
        ({"temperature": {"change": 1.0}}, "material: has no expansion"),
        ({"material": {**wood(), "young": 1.0}}, "material.young: unknown key"),
        ({"material": {"poisson": 0.3}}, "material.young: is missing"),
    ],
)
def test_refused(more, message):
    data = {
        "mesh": body(comm=MPI.COMM_SELF),
        "material": wood(),
        "contact": {"boundary": "bottom"},
    } | more
    with pytest.raises(SceneError, match=message):
        parse_scene(data)


@pytest.mark.mpi(slow=True)
def test_free_expansion_and_prevented_expansion():
    """Heat strains a free bar without stress; held along its length it has the stress of E along
    it.
    """
    turned = {"direction": [1.0, 0.0]}
    for hypothesis in ("plane strain", "plane stress"):
        material = wood(hypothesis=hypothesis, **turned) | {"expansion": 1e-4}
        heated = {"mesh": body(), "material": material, "temperature": {"change": 20.0}}
        heated["displacement"] = [fixed("left", "x"), fixed("bottom", "y")]
        solution = solve(parse_scene(heated), COMM)
        assert solution.certificate.holds
        out = 0.0 if hypothesis == "plane stress" else -E3 * 2e-3
        tensor = tensors(solution.stress.recovered.tensor)
        assert np.abs(tensor - np.diag([0.0, 0.0, out])).max() <= 1e-9 * E1
        heated["displacement"].append(fixed("right", "x"))
        normal, _ = compliance()
        held = [0] if hypothesis == "plane stress" else [0, 2]
        stress = np.zeros(3)
        stress[held] = np.linalg.solve(normal[np.ix_(held, held)], np.full(len(held), -2e-3))
        solution = solve(parse_scene(heated), COMM)
        tensor = tensors(solution.stress.recovered.tensor)
        assert np.abs(tensor - np.diag(stress)).max() <= 1e-9 * E1
        assert solution.certificate.holds
        strained = -2e-3 * stress[held].sum() / 2 * 2.0  # of a bar of area 2
        assert solution.certificate.strain_energy == pytest.approx(strained, rel=1e-9)
