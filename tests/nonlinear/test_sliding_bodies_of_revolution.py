"""Two nonlinear bodies of revolution that slide on each other: closed forms, limits, invariances, and what the
certificate refuses.
"""

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI
from support.nonlinear_bodies import stress_of_block
from support.sliding_bodies import as_linear_bodies, cylinders, dome, ring_on_cone

from signorini_fx import Coulomb, Foundation, NonlinearContactProblem

FRICTION = pytest.mark.parametrize("friction", [None, Coulomb(0.3)], ids=["smooth", "rough"])
SLOW = pytest.mark.slow


@pytest.mark.one_quick
@pytest.mark.parametrize("kind", ["quadrilateral", pytest.param("triangle", marks=SLOW)])
@pytest.mark.parametrize("slave", [0, 1])
@pytest.mark.parametrize("inner", [0.0, pytest.param(0.2, marks=SLOW)])
def test_patch(kind, slave, inner):
    """Two cylinders whose meshes do not match, compressed by two fifths: uniform, in closed form; the tubes as well."""
    scene = cylinders(kind, inner=inner, slave=slave)
    area = np.pi * (1.0 - inner**2)
    for depth in (0.1, 0.4):
        force = scene.move(0.0, -2 * depth)
        assert scene.problem.certificate.holds
        state = scene.problem.state
        (pair,) = scene.problem.linear.pairs.values()
        into = -pair.coupling.gap
        assert into == pytest.approx(into[0], rel=1e-6)
        assert 0 < into[0] < 1e-4
        stress = stress_of_block(1 - depth + into[0] / 2, directions=2)
        assert state.pressure == pytest.approx(-stress, rel=1e-8)
        assert abs(force[1]) == pytest.approx(-stress * area, rel=1e-8)
        x = scene.u.function_space.tabulate_dof_coordinates()[:, :2]
        across = scene.u.x.array.reshape(-1, 2)[:, 0]
        assert across == pytest.approx(across[x[:, 0].argmax()] * x[:, 0], abs=1e-9)


def agrees_with_linear_bodies(scene):
    """Whether displacements and forces are those of the pair of linear bodies on the same mesh, to 1e-6."""
    force = scene.move(1e-8 * (not scene.half), -1e-7)
    linear = as_linear_bodies(scene)
    expected = sum(linear.state.forces)
    assert np.count_nonzero(linear.state.in_contact) > 3
    assert force == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())
    far = np.abs(linear.u.x.array).max()
    assert scene.u.x.array == pytest.approx(linear.u.x.array, abs=1e-6 * far)
    return linear


@pytest.mark.one_quick
@pytest.mark.parametrize("friction", [pytest.param(None, marks=SLOW), Coulomb(0.3)], ids=["smooth", "rough"])
@pytest.mark.parametrize("slave", [0, 1])
def test_linear_limit(friction, slave):
    """A paraboloid on a cylinder."""
    linear = agrees_with_linear_bodies(dome(friction=friction, slave=slave, algorithm="alm"))
    if friction is not None:
        assert np.abs(linear.state.shear).max() > 0.01 * linear.state.pressure.max()


@pytest.mark.slow
@FRICTION
def test_ring_over_a_cone(friction):
    """A soft thin ring that is driven down a cone, over ten facets, widens by two fifths: its force along the axis is
    that of the slope and the angle of friction, whatever the number of steps is.
    """
    angle = np.pi / 4 + np.arctan(0.0 if friction is None else 0.3)
    ends = []
    for steps in (4, 8):
        scene = ring_on_cone(ratio=0.02, slave=1, size=0.1, cells=(48, 4), friction=friction)
        for way in -0.4 * np.arange(1, steps + 1) / steps:
            force = scene.move(0.0, way)
        assert scene.problem.certificate.holds
        assert max(scene.iterations) <= 7
        ends.append(force)
    assert force[1] / force[0] == pytest.approx(np.tan(angle), rel=0.01)
    assert np.abs(scene.u.x.array).max() > 0.35
    assert ends[1] == pytest.approx(ends[0], rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("slave", [0, 1])
def test_hertz(slave):
    """Small pressures are those of Hertz: on the axis and within half of the radius of contact to 3 %."""
    height = 0.02
    scene = dome(height=height, lower=(44, 16), upper=(40, 16), power=2.5, slave=slave)
    force = abs(scene.move(0.0, -1e-4)[1])
    state = scene.problem.state
    modulus, curvature = 100.0 / (1 - 0.3**2) / 2, 2 * height
    a = (3 * force / curvature / 4 / modulus) ** (1 / 3)
    largest = 3 * force / (2 * np.pi * a**2)
    r = state.boundary.x[:, 0]
    inner = r < a / 2
    assert np.count_nonzero(inner) > 4
    assert state.pressure[inner] == pytest.approx(largest * np.sqrt(1 - (r[inner] / a) ** 2), abs=0.03 * largest)
    assert not state.in_contact[r > 1.15 * a].any()


def random_rings(seed, degree=1):
    """The force on a random ring that a rigid cone of facets widens, and that of a shape in its place, which other code
    meets at the nodes; and how far the ring has come, in facets of the cone.
    """
    rng = np.random.default_rng(seed)
    kind, up, friction = rng.choice(["quadrilateral", "triangle"]), rng.choice([-1.0, 1.0]), rng.uniform(0.0, 0.35)
    slope, size, scale = rng.uniform(0.7, 2.0), rng.uniform(0.1, 0.2), 10.0 ** rng.uniform(-3.0, 3.0)
    cells, around, steps = int(rng.integers(24, 60)), int(rng.integers(12, 24)), int(rng.integers(2, 5))
    depth = rng.uniform(0.1, 0.3)
    law = Coulomb(friction) if rng.random() < 0.7 else None
    forces = []
    for shaped in (False, True):
        scene = ring_on_cone(kind, (cells, 1), around, size, slope, up, scale, slave=1, friction=law, degree=degree)
        space = scene.u.function_space
        scene.mesh.topology.create_connectivity(2, 2)
        of_cone = np.flatnonzero(scene.of_body.x.array == 0)
        rigid = fem.dirichletbc(np.zeros(2), fem.locate_dofs_topological(space, 2, of_cone.astype(np.int32)), space)
        contact = scene.pair
        if shaped:
            plane = {"shape": "plane", "point": (0.0, 0.0), "normal": (slope, up)}
            contact = Foundation(scene.sides[1], shape=plane, friction=law, measure=scene.pair.measure)
        problem = NonlinearContactProblem(scene.form, scene.u, bcs=[*scene.bcs, rigid], contact=contact)
        for share in np.arange(1, steps + 1) / steps:
            scene.driven.value = -share * depth * up * scale
            problem.solve()
            problem.advance()
        assert problem.certificate.holds
        forces.append(sum(problem.state.forces))
    way = np.linalg.norm([np.abs(scene.u.x.array[::2]).max(), depth * scale]) / scale
    return forces[0], forces[1], way * cells / 1.5 / np.hypot(1.0, slope)


@pytest.mark.slow
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("seed", range(2))
def test_random_rings(seed, degree):
    """Half a per cent, which is what mean normals of both sides are off those of the cone by."""
    force, expected, way = random_rings(seed, degree)
    assert way > 2.0
    assert force == pytest.approx(expected, abs=5e-3 * np.abs(expected).max())


@pytest.mark.slow
@pytest.mark.mpi
def test_on_ranks():
    """The same on any number of ranks."""
    forces = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        scene = ring_on_cone(ratio=0.02, slave=1, cells=(24, 3), around=8, friction=Coulomb(0.3), comm=comm)
        for way in (-0.1, -0.2):
            force = scene.move(0.0, way)
        assert scene.problem.certificate.holds
        forces.append(force)
    assert np.abs(forces[0]).min() > 0.01
    assert forces[0] == pytest.approx(forces[1], rel=1e-8)
